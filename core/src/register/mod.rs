//! Registration of scans.
