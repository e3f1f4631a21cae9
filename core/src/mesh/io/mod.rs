//! Mesh and cloud files.
