//! What a simulated scan is worth.
//!
//! Wiedemann 2014, §2.2.1: `q = w_occ N + w_ins M + w_unk O`. Kriegel et al. 2012: entropy of the voxels seen.
//! Massios & Fisher 1998: hidden voxels seen, and `f = 1/|M| sum (1 - q_i) |v . n_i|`. Khalfaoui et al. 2013
//! after Loriot et al. 2008: angle to the mass vector sum, `w = theta / theta_max`.

use super::candidates::outward;
use super::cell::{Cell, State};
use super::look::{Eye, look};
use super::space::ViewSpace;
use super::{Measure, ViewParams};
use crate::geometry::{Pose, Vec3};
use crate::voxel::SlotSet;

/// Log-odds of a scan that hit a voxel and of one that saw through it (OctoMap's sensor model: 0.7 and 0.4).
const LOG_HIT: f64 = 0.847;
const LOG_PASS: f64 = -0.405;

/// What a simulated scan shows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Gain {
    /// N: surface voxels that lack points.
    pub lacking: usize,
    /// Of those, the ones beside a voxel that has its points.
    pub beside: usize,
    /// M: possible inside and border voxels.
    pub hidden: usize,
    /// O: unknown voxels.
    pub unknown: usize,
    /// Share of the rays into the object that meet known surface.
    pub overlap: f64,
    /// Worth under the chosen measure.
    pub worth: f64,
}

impl Gain {
    /// What decides whether there is anything left to do: N and M, weighted.
    pub(crate) fn new_voxels(&self, params: &ViewParams) -> f64 {
        let lacking =
            (self.lacking - self.beside) as f64 + params.beside_share * self.beside as f64;
        params.weight_occupied * lacking + params.weight_inside * self.hidden as f64
    }
}

/// What is the same for all candidates of a plan.
pub(crate) struct Judge<'a> {
    space: &'a ViewSpace,
    eye: Eye,
    /// All possible inside and border voxels that ask to be seen.
    hidden: usize,
    /// Sum of the outward directions of the surface measured so far.
    mass: Vec3,
}

impl<'a> Judge<'a> {
    pub(crate) fn new(space: &'a ViewSpace) -> Judge<'a> {
        let hidden = space.grid.iter().filter(|(_, cell)| space.hides(cell)).count();
        let mass = if space.params.measure == Measure::MassVector {
            let surface = space.grid.iter().filter(|(_, cell)| cell.state == State::Occupied);
            surface.filter_map(|(slot, _)| outward(space, slot)).sum()
        } else {
            Vec3::zeros()
        };
        Judge { space, eye: Eye::new(&space.sensor, space.edge()), hidden, mass }
    }

    /// An empty set for [`Judge::gain`].
    pub(crate) fn set(&self) -> SlotSet {
        SlotSet::new(self.space.grid.slots())
    }

    /// The gain of a scan from `pose`.
    pub(crate) fn gain(&self, pose: &Pose, seen: &mut SlotSet) -> Gain {
        seen.clear();
        let measure = self.space.params.measure;
        let mut gain = Gain::default();
        let (mut entropy_sum, mut quality, mut surface) = (0.0, 0.0, 0usize);
        let met = look(self.space, &self.eye, pose, seen, |slot, cell, along| {
            let lacking = self.space.lacks_points(cell);
            gain.lacking += usize::from(lacking);
            gain.beside += usize::from(lacking && cell.beside);
            gain.hidden += usize::from(self.space.hides(cell));
            gain.unknown += usize::from(cell.state == State::Unknown);
            match measure {
                Measure::Entropy => entropy_sum += entropy(self.space, cell),
                Measure::MassiosFisher if cell.state == State::Occupied => {
                    surface += 1;
                    let cosine = outward(self.space, slot).map_or(0.0, |n| n.dot(along).abs());
                    quality += (1.0 - f64::from(cell.quality) / 255.0) * cosine;
                }
                _ => {}
            }
        });
        gain.overlap = met.overlap();
        let params = &self.space.params;
        gain.worth = match measure {
            Measure::Thesis => {
                gain.new_voxels(params) + params.weight_unknown * gain.unknown as f64
            }
            Measure::Entropy => entropy_sum,
            Measure::MassiosFisher => {
                let visible = gain.hidden as f64 / self.hidden.max(1) as f64;
                visible + quality / surface.max(1) as f64
            }
            Measure::MassVector => {
                let towards = -(pose.rotation * Vec3::z());
                if self.mass.norm() > 0.0 {
                    towards.angle(&self.mass) / std::f64::consts::PI
                } else {
                    0.0
                }
            }
            // Baselines have an order of their own.
            Measure::Random | Measure::Sphere => 0.0,
        };
        gain
    }
}

/// Entropy of a voxel, nats; none is left of what was looked at in vain.
fn entropy(space: &ViewSpace, cell: &Cell) -> f64 {
    let odds = f64::from(cell.hits) * LOG_HIT + f64::from(cell.passes) * LOG_PASS;
    let asks = match cell.state {
        State::Occupied => true,
        State::Unknown => true,
        _ => space.hides(cell),
    };
    if !asks {
        return 0.0;
    }
    let p = 1.0 / (1.0 + (-odds).exp());
    let part = |p: f64| if p > 0.0 { -p * p.ln() } else { 0.0 };
    part(p) + part(1.0 - p)
}

/// A number that looks random, from three others (SplitMix64's finaliser; Steele et al. 2014).
pub(crate) fn scramble(seed: u64, a: u64, b: u64) -> u64 {
    let mix = |mut x: u64| {
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        x ^ (x >> 31)
    };
    let golden = 0x9e37_79b9_7f4a_7c15_u64;
    [a, b].into_iter().fold(mix(seed.wrapping_add(golden)), |x, y| {
        mix(x.wrapping_add(golden) ^ mix(y.wrapping_add(golden)))
    })
}
