//! Parameters of the node.

use puffer_core::planner::PlannerParams;
use puffer_core::view::ViewParams;

puffer_core::param_groups! {
    /// All parameters of the planner.
    pub struct Params {
        /// What the planner knows of the robot cell.
        planner: PlannerParams,
        /// How views are chosen.
        view: ViewParams,
    }
}
