//! Parameters of the modeller.

use puffer_core::scans::{SensorKind, Support};
use puffer_core::session::SessionParams;
use puffer_shell::scans::ScanParams;

puffer_core::choice! {
    /// The noise family that is noted with the scans.
    pub enum Noise {
        /// Not known.
        Unknown = "unknown",
        /// Laser triangulation.
        Laser = "laser",
        /// Stereo.
        Stereo = "stereo",
    }
}

impl Noise {
    /// As a scan folder notes it.
    pub(crate) fn kind(self) -> Option<SensorKind> {
        SensorKind::from_word(match self {
            Noise::Unknown => "",
            Noise::Laser => "laser",
            Noise::Stereo => "stereo",
        })
    }
}

puffer_core::params! {
    /// Where results go, and how long each step may take on the clock on the wall.
    pub struct ModellerParams("modeller") {
        /// Folder for scans and report; empty: none are written.
        run_folder: String = String::new();
        /// File of the mesh, as mesh_reconstructor takes it; empty: it chooses.
        mesh_path: String = String::new();
        /// The noise family that is noted with the scans.
        sensor: Noise = Noise::Unknown;
        /// What the object stands on, noted with the scans.
        support: Support = Support::None;
        /// For the other nodes to be there.
        start_deadline: f64 = 30.0, in [1.0, 600.0], unit "s";
        /// For a plan.
        plan_deadline: f64 = 120.0, in [1.0, 3600.0], unit "s";
        /// For a motion, beyond the time that its trajectory takes.
        move_deadline: f64 = 60.0, in [1.0, 3600.0], unit "s";
        /// For a scan.
        scan_deadline: f64 = 120.0, in [1.0, 3600.0], unit "s";
        /// For the verdict on a scan.
        register_deadline: f64 = 120.0, in [1.0, 3600.0], unit "s";
        /// For the joint optimisation.
        refine_deadline: f64 = 900.0, in [1.0, 36000.0], unit "s";
        /// For the cloud.
        filter_deadline: f64 = 600.0, in [1.0, 36000.0], unit "s";
        /// For the mesh.
        reconstruct_deadline: f64 = 900.0, in [1.0, 36000.0], unit "s";
    }
}

puffer_core::param_groups! {
    /// All parameters of the modeller.
    pub struct Params {
        /// When the loop ends.
        session: SessionParams,
        /// Files and deadlines.
        modeller: ModellerParams,
        /// What is known of the poses, noted with the scans.
        scan: ScanParams,
    }
}
