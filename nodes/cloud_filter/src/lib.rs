//! Registered scans to one filtered cloud.
