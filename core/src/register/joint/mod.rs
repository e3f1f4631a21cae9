//! Joint optimisation of all accepted scans (multi-view registration; Pulli 1999, Multiview
//! Registration for Large Data Sets). Each scan is held to the surface that all scans share and to
//! the robot's pose. No scan is fixed, so that the error is spread over all of them and the priors
//! alone place the whole in the object frame.
//!
//! | file | does |
//! |---|---|
//! | `optimization` | Gauss-Newton steps over all poses, coarse to fine |
//! | `resolution` | how far apart the patches of the surface lie in each iteration |
//! | `surfels` | the patches of the surface, and which measurements lie on them |
//! | `measurements` | what every scan measured of every patch, and its weighted equations |
//! | `variances` | robust statistics of the measured heights |
//! | `equations` | the normal equations, with the heights of the patches eliminated |
//! | `correlation` | how much of their noise neighbouring measurements share |
//! | `whitening` | makes this correlated noise white |
//! | `shrinkage` | leaves to the priors what only the noise of the normals seems to determine |

mod correlation;
mod equations;
mod measurements;
mod optimization;
mod resolution;
mod shrinkage;
mod surfels;
mod variances;
mod whitening;

pub(crate) use correlation::{Correlation, Residuals};
pub(crate) use measurements::rms_residual;
pub(crate) use optimization::{Start, optimise};

#[cfg(test)]
mod correlation_tests;
#[cfg(test)]
mod surfels_tests;
