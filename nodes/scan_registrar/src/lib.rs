//! Raw scans and tf to registered scans.
