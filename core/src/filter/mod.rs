//! From registered scans to one cloud with uncertainty.
