//! What a simulated scan is worth.
//!
//! Wiedemann 2014, §2.2.1: `q = w_occ N + w_ins M + w_unk O` (1). Kriegel et al. 2012: the entropy
//! of the voxels seen (2). Massios & Fisher 1998: hidden voxels seen, and `f = 1/|M| sum (1 - q_i)
//! |v . n_i|` (3). Khalfaoui et al. 2013 after Loriot et al. 2008: the angle to the mass vector
//! sum, `w = theta / theta_max` (4).

use super::simulated_scan::{RayPattern, SeenVoxel, simulate_scan};
use super::space::ViewSpace;
use super::voxel_state::{VoxelRecord, VoxelState};
use super::{GainMeasure, ViewParams};
use crate::geometry::{Pose, Vec3};
use crate::voxel::SlotSet;

/// Change of the log-odds of a voxel by a scan that hit it: OctoMap's sensor model, ln(0.7 / 0.3).
const HIT_LOG_ODDS: f64 = 0.847;
/// Change of the log-odds of a voxel by a scan that saw through it: OctoMap's, ln(0.4 / 0.6).
const PASS_LOG_ODDS: f64 = -0.405;

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
    /// N and M, weighted: what decides whether a view shows enough that is new.
    pub(crate) fn new_voxels(&self, params: &ViewParams) -> f64 {
        let lacking =
            (self.lacking - self.beside) as f64 + params.beside_share * self.beside as f64;
        params.weight_occupied * lacking + params.weight_inside * self.hidden as f64
    }

    fn add(&mut self, space: &ViewSpace, voxel: &VoxelRecord) {
        let lacking = space.lacks_points(voxel);
        self.lacking += usize::from(lacking);
        self.beside += usize::from(lacking && voxel.beside_satisfied);
        self.hidden += usize::from(space.may_hide_surface(voxel));
        self.unknown += usize::from(voxel.state == VoxelState::Unknown);
    }
}

/// The chosen measure, with what is the same for all candidates of a plan.
enum Worth {
    WeightedCounts,
    Entropy,
    /// With the number of all voxels that may hide surface.
    MassiosFisher(usize),
    /// With the sum of the outward directions of the surface measured so far.
    MassVector(Vec3),
    /// Baselines do not value views.
    Nothing,
}

impl Worth {
    fn new(space: &ViewSpace) -> Worth {
        match space.params.measure {
            GainMeasure::Thesis => Worth::WeightedCounts,
            GainMeasure::Entropy => Worth::Entropy,
            GainMeasure::MassiosFisher => {
                let hidden = space.grid.iter().filter(|(_, voxel)| space.may_hide_surface(voxel));
                Worth::MassiosFisher(hidden.count())
            }
            GainMeasure::MassVector => {
                let surface =
                    space.grid.iter().filter(|(_, voxel)| voxel.state == VoxelState::Occupied);
                let outward = surface.filter_map(|(slot, _)| space.outward_direction(slot));
                Worth::MassVector(outward.sum())
            }
            GainMeasure::Random | GainMeasure::Sphere => Worth::Nothing,
        }
    }
}

/// Sums over the voxels that a simulated scan sees, for the measures that need them.
#[derive(Default)]
struct WorthSums {
    entropy: f64,
    /// `(1 - q_i) |v . n_i|` over the surface voxels.
    missing_quality: f64,
    surface: usize,
}

impl WorthSums {
    fn add(&mut self, worth: &Worth, space: &ViewSpace, seen: &SeenVoxel<'_>) {
        match worth {
            Worth::Entropy => self.entropy += entropy(space, seen.voxel),
            Worth::MassiosFisher(_) if seen.voxel.state == VoxelState::Occupied => {
                self.surface += 1;
                let normal = space.outward_direction(seen.slot);
                let cosine = normal.map_or(0.0, |n| n.dot(&seen.along).abs());
                self.missing_quality += (1.0 - seen.voxel.quality()) * cosine;
            }
            _ => {}
        }
    }
}

/// Evaluates the gain of the candidates of one plan.
pub(crate) struct GainEvaluator<'a> {
    space: &'a ViewSpace,
    pattern: RayPattern,
    worth: Worth,
}

impl<'a> GainEvaluator<'a> {
    pub(crate) fn new(space: &'a ViewSpace) -> GainEvaluator<'a> {
        let pattern = RayPattern::new(&space.sensor, space.edge());
        GainEvaluator { space, pattern, worth: Worth::new(space) }
    }

    /// An empty set for [`GainEvaluator::gain`].
    pub(crate) fn empty_set(&self) -> SlotSet {
        SlotSet::new(self.space.grid.slots())
    }

    /// The gain of a scan from `pose` (`object_from_sensor`). `seen` is scratch space.
    pub(crate) fn gain(&self, pose: &Pose, seen: &mut SlotSet) -> Gain {
        seen.clear();
        let mut gain = Gain::default();
        let mut sums = WorthSums::default();
        let hits = simulate_scan(self.space, &self.pattern, pose, seen, |seen| {
            gain.add(self.space, seen.voxel);
            sums.add(&self.worth, self.space, &seen);
        });
        gain.overlap = hits.overlap();
        gain.worth = self.worth_of_view(pose, &gain, &sums);
        gain
    }

    fn worth_of_view(&self, pose: &Pose, gain: &Gain, sums: &WorthSums) -> f64 {
        let params = &self.space.params;
        match &self.worth {
            Worth::WeightedCounts => {
                gain.new_voxels(params) + params.weight_unknown * gain.unknown as f64 // (1)
            }
            Worth::Entropy => sums.entropy, // (2)
            Worth::MassiosFisher(all_hidden) => {
                let visible = gain.hidden as f64 / (*all_hidden).max(1) as f64;
                visible + sums.missing_quality / sums.surface.max(1) as f64 // (3)
            }
            Worth::MassVector(mass) if mass.norm() > 0.0 => {
                let towards = -(pose.rotation * Vec3::z());
                towards.angle(mass) / std::f64::consts::PI // (4)
            }
            Worth::MassVector(_) | Worth::Nothing => 0.0,
        }
    }
}

/// Entropy of a voxel, nats (2); 0 for a voxel that needs no measurements or was given up.
fn entropy(space: &ViewSpace, voxel: &VoxelRecord) -> f64 {
    let counts = match voxel.state {
        VoxelState::Occupied | VoxelState::Unknown => true,
        _ => space.may_hide_surface(voxel),
    };
    if !counts {
        return 0.0;
    }
    let log_odds = f64::from(voxel.hits) * HIT_LOG_ODDS + f64::from(voxel.passes) * PASS_LOG_ODDS;
    let p = 1.0 / (1.0 + (-log_odds).exp());
    entropy_term(p) + entropy_term(1.0 - p)
}

fn entropy_term(p: f64) -> f64 {
    if p > 0.0 { -p * p.ln() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::tests::{gain_of, space_with_plate, unknown_space, view_along};

    fn with_measure(measure: GainMeasure) -> ViewParams {
        ViewParams { measure, ..ViewParams::default() }
    }

    #[test]
    fn the_entropy_of_a_voxel_follows_from_its_hits_and_passes() {
        let space = unknown_space(&ViewParams::default());
        let unknown = VoxelRecord::default();
        assert!((entropy(&space, &unknown) - 2f64.ln()).abs() < 1e-12);
        // A hit makes it 0.7, and 0.7 and 0.3 have the entropy 0.6109.
        let state = VoxelState::Occupied;
        let hit = VoxelRecord { hits: 1, state, ..unknown };
        assert!((entropy(&space, &hit) - 0.610_864).abs() < 1e-4);
        // A pass makes it 0.4, and 0.4 and 0.6 have the entropy 0.6730.
        let passed = VoxelRecord { passes: 1, ..unknown };
        assert!((entropy(&space, &passed) - 0.673_012).abs() < 1e-4);
        let sure = VoxelRecord { hits: u16::MAX, state, ..unknown };
        assert_eq!(entropy(&space, &sure), 0.0);
        let state = VoxelState::PossibleInside;
        let hidden = VoxelRecord { near_surface: true, state, ..unknown };
        assert!(entropy(&space, &hidden) > 0.69);
        let given_up = VoxelRecord { tries: u8::MAX, ..hidden };
        assert_eq!(entropy(&space, &given_up), 0.0);
        assert_eq!(entropy(&space, &VoxelRecord { state: VoxelState::Free, ..unknown }), 0.0);
    }

    #[test]
    fn the_entropy_of_a_view_is_the_sum_of_its_voxels() {
        let space = unknown_space(&with_measure(GainMeasure::Entropy));
        let gain = gain_of(&space, &view_along(Vec3::new(0.3, 0.2, -1.0)));
        assert!(gain.unknown > 10_000, "{gain:?}");
        assert!((gain.worth / (gain.unknown as f64 * 2f64.ln()) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn weighted_counts_are_the_equation_of_the_thesis() {
        let weights = ViewParams {
            weight_occupied: 3.0,
            beside_share: 0.25,
            weight_inside: 0.5,
            weight_unknown: 0.01,
            min_points: 30,
            ..ViewParams::default()
        };
        let space = space_with_plate(&weights);
        let gain = gain_of(&space, &view_along(Vec3::new(1.0, 0.0, -1.0)));
        let alone = gain.lacking - gain.beside;
        assert!(gain.lacking > 0 && gain.hidden > 0 && gain.unknown > 0, "{gain:?}");
        let new = 3.0 * (alone as f64 + 0.25 * gain.beside as f64) + 0.5 * gain.hidden as f64;
        assert_eq!(gain.new_voxels(&weights), new);
        assert_eq!(gain.worth, new + 0.01 * gain.unknown as f64);
    }

    #[test]
    fn the_mass_vector_of_a_plate_is_its_normal() {
        let space = space_with_plate(&with_measure(GainMeasure::MassVector));
        let [above, side, below] = [-Vec3::z(), Vec3::x(), Vec3::z()]
            .map(|direction| gain_of(&space, &view_along(direction)).worth);
        // Voxels at the rim see hidden space on one side only.
        assert!(above < 0.05 && below > 0.95, "{above} {below}");
        assert!((side - 0.5).abs() < 0.05, "{side}");
        let empty = unknown_space(&with_measure(GainMeasure::MassVector));
        assert_eq!(gain_of(&empty, &view_along(Vec3::x())).worth, 0.0);
    }

    #[test]
    fn massios_and_fisher_value_hidden_voxels_and_surface_measured_at_a_slant() {
        let mut space = space_with_plate(&with_measure(GainMeasure::MassiosFisher));
        let view = view_along(-Vec3::z());
        let seen_well = gain_of(&space, &view).worth;
        let surface: Vec<u32> = space
            .grid
            .iter()
            .filter(|(_, voxel)| voxel.state == VoxelState::Occupied)
            .map(|(slot, _)| slot)
            .collect();
        for slot in surface {
            space.grid.get_mut(slot).quality = 0;
        }
        let seen_badly = gain_of(&space, &view).worth;
        // The plate was measured from straight above: there, quality and incidence are about 1.
        assert!((0.8..1.01).contains(&(seen_badly - seen_well)), "{seen_well} {seen_badly}");
        let side = gain_of(&space, &view_along(Vec3::x()));
        let hidden = space.grid.iter().filter(|(_, voxel)| space.may_hide_surface(voxel)).count();
        assert!(side.worth >= side.hidden as f64 / hidden as f64);
    }
}
