//! The parameters of the reconstructor.

use puffer_core::filter::FilterParams;
use puffer_core::reconstruct::ReconstructParams;
use puffer_core::register::RegisterParams;
use puffer_ros::scans::ScanParams;

puffer_core::params! {
    /// Parameters of the mesh files.
    pub struct MeshParams("mesh") {
        /// Folder that all meshes are written into; empty for the current one.
        output_folder: String = String::new();
        /// Seed of the random generator that is named in the comments of mesh files.
        seed: usize = 0, in [0, 9007199254740991_u64];
    }
}

puffer_core::param_groups! {
    /// All parameters of the reconstructor. Those of the first three groups apply to inputs from
    /// files only.
    pub struct Params {
        /// Which points of the scans in a bag are used.
        scan: ScanParams,
        /// How scans are registered.
        register: RegisterParams,
        /// How scans are combined.
        filter: FilterParams,
        /// How a mesh is made.
        reconstruct: ReconstructParams,
        /// Where the mesh is written.
        mesh: MeshParams,
    }
}
