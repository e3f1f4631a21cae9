//! Parameters of the reconstructor.

use puffer_core::filter::FilterParams;
use puffer_core::reconstruct::ReconstructParams;
use puffer_core::register::RegisterParams;
use puffer_shell::scans::ScanParams;

puffer_core::params! {
    /// Where meshes go.
    pub struct MeshParams("mesh") {
        /// Folder that all meshes are written into; empty: the current one.
        output_folder: String = String::new();
        /// Seed named in the mesh files.
        seed: usize = 0, in [0, 9007199254740991_u64];
    }
}

puffer_core::param_groups! {
    /// All parameters of the reconstructor. Those of the first three groups count for inputs from files.
    pub struct Params {
        /// Which points of a bag's scans count.
        scan: ScanParams,
        /// How scans are registered.
        register: RegisterParams,
        /// How they are combined.
        filter: FilterParams,
        /// How a mesh is made.
        reconstruct: ReconstructParams,
        /// Where it goes.
        mesh: MeshParams,
    }
}
