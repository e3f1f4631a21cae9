//! Parameters of the modeller.

use puffer_core::scan::{SensorKind, Support};
use puffer_core::session::SessionParams;
use puffer_ros::scans::ScanParams;

puffer_core::choice! {
    /// Kind of the sensor, which decides how its noise is modelled.
    pub enum SensorChoice {
        /// Not known.
        Unknown = "unknown",
        /// Laser triangulation.
        Laser = "laser",
        /// Stereo camera.
        Stereo = "stereo",
    }
}

impl SensorChoice {
    /// The kind as scan folders have it; `None` if it is not known.
    pub(crate) fn kind(self) -> Option<SensorKind> {
        SensorKind::from_word(match self {
            SensorChoice::Unknown => "",
            SensorChoice::Laser => "laser",
            SensorChoice::Stereo => "stereo",
        })
    }
}

puffer_core::params! {
    /// Where results go, and how long each step may take in wall time.
    pub struct ModellerParams("modeller") {
        /// Folder to which the scans and the report of a run are written; empty: none are written.
        run_folder: String = String::new();
        /// File of the mesh within mesh_reconstructor's output folder; empty: mesh.ply.
        mesh_path: String = String::new();
        /// Kind of the sensor, noted in the scan folder for later processing.
        sensor: SensorChoice = SensorChoice::Unknown;
        /// What the object stands on, noted in the scan folder for later processing.
        support: Support = Support::None;
        /// How long a run waits for the other nodes to appear before it fails.
        start_deadline: f64 = 30.0, in [1.0, 600.0], unit "s";
        /// How long planning the next view may take.
        plan_deadline: f64 = 120.0, in [1.0, 3600.0], unit "s";
        /// How long a motion may take beyond the duration of its trajectory.
        move_deadline: f64 = 60.0, in [1.0, 3600.0], unit "s";
        /// How long taking a scan may take.
        scan_deadline: f64 = 120.0, in [1.0, 3600.0], unit "s";
        /// How long the registration of a scan may take.
        register_deadline: f64 = 120.0, in [1.0, 3600.0], unit "s";
        /// How long the joint optimisation of all poses may take.
        refine_deadline: f64 = 900.0, in [1.0, 36000.0], unit "s";
        /// How long combining all scans to one cloud may take.
        filter_deadline: f64 = 600.0, in [1.0, 36000.0], unit "s";
        /// How long making the mesh may take.
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
        /// How exact the robot's poses are, noted in the scan folder.
        scan: ScanParams,
    }
}
