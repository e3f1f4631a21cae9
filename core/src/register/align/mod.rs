//! One scan onto the map: iterative closest points in the stages of Rusinkiewicz & Levoy 2001
//! (Efficient Variants of the ICP Algorithm), each a file with its variants, and the robot's pose
//! as prior.
//!
//! | stage | file |
//! |---|---|
//! | 1 selection of points | `selection` |
//! | 2 matching them with the map's | `matching`, which searches `map` |
//! | 3 weighting the pairs | `weighting`, which also holds the robust kernels |
//! | 4 rejecting pairs | `rejection`, with `boundary` |
//! | 5 the error metric | `metric`, of the residuals in `factors` |
//! | 6 minimising it | `gauss_newton`, with the prior and new pairs in each iteration |

mod boundary;
pub(crate) mod factors;
mod gauss_newton;
mod icp_iteration;
mod map;
mod matching;
mod metric;
mod prior;
mod rejection;
mod selection;
mod source;
mod weighting;

pub(crate) use boundary::find_boundary;
pub(crate) use gauss_newton::{Alignment, SearchRadius, align};
pub(crate) use icp_iteration::correspondences;
pub(crate) use map::{Map, MapPoint, MapSurface};
pub(crate) use prior::Prior;
pub(crate) use selection::select_points;
pub(crate) use source::{Source, SourceSubset};

#[cfg(test)]
mod matching_tests;
