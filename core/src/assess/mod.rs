//! How good a mesh is: one definition of each figure for all.
