//! Scan folders and other files that hold scans with their poses.
