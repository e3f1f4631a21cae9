//! Filtered cloud to a watertight mesh.
