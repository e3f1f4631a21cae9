//! Whether an aligned scan may join the model, and where it belongs if not there.
//!
//! | file | decides |
//! |---|---|
//! | `verdict` | whether correspondences, correction, residual and overlap suffice |
//! | `observability` | which directions of motion the geometry determines beyond its noise |
//! | `layers` | whether the scan forms a second layer beside the map's surface |
//! | `ambiguity` | whether another pose within the prior fits about as well |
//! | `relocalization` | whether a scan is much more probable elsewhere, once all are registered |

mod ambiguity;
mod layers;
mod observability;
mod relocalization;
mod verdict;

pub(crate) use ambiguity::AmbiguityCheck;
pub(crate) use layers::second_layer_ratio;
pub(crate) use observability::Observability;
pub(crate) use relocalization::relocalize;
pub use verdict::{Status, Verdict};
