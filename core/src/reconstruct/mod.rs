//! From a filtered cloud to a watertight mesh with confidence.
