//! Parameters of the modelling loop.

crate::params! {
    /// When the loop ends.
    pub struct SessionParams("session") {
        /// Largest number of scans.
        max_scans: usize = 60, in [1, 10000];
        /// Share of the known surface voxels that must hold their measurements for the loop to end;
        /// with 1 it ends only when no view is left.
        coverage: f64 = 1.0, in [0.0, 1.0];
        /// Mean standard deviation of the mesh that is to be reached by taking more scans; 0
        /// accepts what the first mesh has.
        sigma: f64 = 0.0, in [0.0, 1.0], unit "m";
        /// Number of failed moves in a row after which the loop goes on to the mesh.
        max_failed_moves: usize = 3, in [1, 100];
        /// Number of failed scans in a row after which the loop goes on to the mesh.
        max_failed_scans: usize = 2, in [1, 100];
        /// Number of scans in a row that could not be registered after which the loop goes on to
        /// the mesh.
        max_unplaced: usize = 8, in [1, 1000];
    }
}
