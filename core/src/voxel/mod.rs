//! Sparse voxel space.
