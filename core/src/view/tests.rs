use super::*;
use crate::geometry::{SensorModel, StereoModel, StriperModel, Surface};
use crate::simulate::{NoiseFamily, SimulateParams, Simulator, objects};
use std::time::Instant;

/// A closed loop before a simulated object.
struct Loop {
    simulator: Simulator,
    surface: Surface,
    truth: crate::mesh::Mesh,
    family: NoiseFamily,
}

impl Loop {
    fn new(object: &str, family: NoiseFamily) -> Loop {
        let truth = objects::make(object).unwrap();
        let params = SimulateParams { family, ..SimulateParams::default() };
        let surface = Surface::new(&truth.vertices, &truth.triangles).unwrap();
        Loop { simulator: Simulator::new(&truth, &params, 1).unwrap(), surface, truth, family }
    }

    fn sensor(&self) -> SensorModel {
        if self.family.is_stereo() {
            SensorModel::Stereo(StereoModel::GUPPY)
        } else {
            SensorModel::Striper(StriperModel::SCANCONTROL)
        }
    }

    fn space(&self, params: &ViewParams) -> ViewSpace {
        let mut roi = self.truth.aabb().padded(0.03);
        roi.min.z = -0.01;
        let mut space = ViewSpace::new(self.sensor(), roi, params).unwrap();
        space.exclude_below(0.0);
        space
    }

    /// Points of the true surface that any of 200 views above the table sees without noise.
    fn observable(&self) -> Vec<Vec3> {
        let views = self.simulator.view_poses(400).into_iter().take(200);
        let eyes: Vec<Vec3> = views.map(|pose| pose.translation.vector).collect();
        let seen = |(i, p): (usize, &Vec3)| {
            let normal = self.truth.normals[i];
            eyes.iter().any(|eye| {
                let (sight, far) = ((p - eye).normalize(), (p - eye).norm());
                sight.dot(&normal) < -0.25
                    && self.surface.cast_ray(eye, &sight, far - 1e-4).is_none()
            })
        };
        let points = self.truth.vertices.iter().enumerate().step_by(17);
        points.filter(|(i, p)| seen((*i, p))).map(|(_, p)| *p).collect()
    }
}

fn satisfied_share(space: &ViewSpace, observable: &[Vec3]) -> f64 {
    let edge = space.edge();
    let near = |p: &Vec3| {
        let voxel = crate::voxel::voxel_of(p, edge);
        (0..27).any(|i: i32| {
            let next = [voxel[0] + i % 3 - 1, voxel[1] + i / 3 % 3 - 1, voxel[2] + i / 9 - 1];
            space.grid.slot(next).is_some_and(|slot| {
                let cell = space.grid.get(slot);
                cell.state == State::Occupied && cell.points as usize >= space.params.min_points
            })
        })
    };
    observable.iter().filter(|p| near(p)).count() as f64 / observable.len() as f64
}

struct Run {
    views: usize,
    coverage: Vec<f64>,
    integrate: f64,
    plan: f64,
    last: Plan,
}

fn run(setup: &Loop, params: &ViewParams, observable: &[Vec3], most: usize) -> Run {
    let mut space = setup.space(params);
    let mut above = |pose: &Pose| {
        if pose.translation.z < 0.0 {
            return Err("below the table".to_owned());
        }
        Ok(ReachedView { pose: *pose, duration: 1.0 })
    };
    let (mut integrate, mut plan_time, mut coverage) = (0.0, 0.0, Vec::new());
    loop {
        let start = Instant::now();
        let plan = next_view(&space, &mut above);
        plan_time += start.elapsed().as_secs_f64();
        let views = coverage.len();
        let Some(view) = plan.chosen.as_ref().filter(|_| views < most) else {
            let n = views as f64;
            return Run {
                views,
                coverage,
                integrate: integrate / n,
                plan: plan_time / n,
                last: plan,
            };
        };
        let scan = setup.simulator.scan(views, &view.pose);
        let start = Instant::now();
        space.integrate(&scan.scan, &scan.true_pose).unwrap();
        integrate += start.elapsed().as_secs_f64();
        coverage.push(satisfied_share(&space, observable));
    }
}

#[test]
#[ignore = "a measurement, not a check"]
fn closed_loops() {
    for family in [NoiseFamily::P2K, NoiseFamily::P3] {
        for object in ["filter", "coffee", "mug"] {
            let setup = Loop::new(object, family);
            let observable = setup.observable();
            for measure in [
                Measure::Thesis,
                Measure::Entropy,
                Measure::MassiosFisher,
                Measure::MassVector,
                Measure::Random,
                Measure::Sphere,
            ] {
                let params = ViewParams { measure, ..ViewParams::default() };
                let run = run(&setup, &params, &observable, 60);
                let share = |n: usize| run.coverage.get(n - 1).copied().unwrap_or(f64::NAN) * 100.0;
                let to = |c: f64| run.coverage.iter().position(|x| *x >= c).map_or(0, |i| i + 1);
                eprintln!(
                    "{family:?} {object} {measure:?}: {} views, coverage {:.1} % (after 4: {:.1}, 8: {:.1}, 12: {:.1}); 95 % after {}, 99 % after {}; integrate {:.0} ms, plan {:.0} ms; {:?} {:?}",
                    run.views,
                    run.coverage.last().unwrap() * 100.0,
                    share(4),
                    share(8),
                    share(12),
                    to(0.95),
                    to(0.99),
                    run.integrate * 1e3,
                    run.plan * 1e3,
                    run.last.done,
                    run.last.counts,
                );
            }
        }
    }
}
