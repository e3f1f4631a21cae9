//! Which directions the set-ups can look from.

use super::*;
use crate::geometry::{Aabb, Pose, SensorModel, StereoModel, StriperModel, Vec3};
use nalgebra::{Rotation3, Translation3, UnitQuaternion};
use rayon::prelude::*;

/// Half the size of an object of 0.1 x 0.1 x 0.18 m; it stands on z = 0.
fn object() -> Obstacle {
    Obstacle::of_box(&Aabb { min: Vec3::new(-0.05, -0.05, 0.0), max: Vec3::new(0.05, 0.05, 0.18) })
}

fn view(direction: &Vec3, distance: f64) -> Pose {
    let middle = Vec3::new(0.0, 0.0, 0.09);
    let z = -direction.normalize();
    let x = if z.z.abs() > 0.99 { Vec3::x() } else { z.cross(&Vec3::z()).normalize() };
    let rotation = Rotation3::from_basis_unchecked(&[x, z.cross(&x), z]);
    let position = middle - z * distance;
    Pose::from_parts(Translation3::from(position), UnitQuaternion::from_rotation_matrix(&rotation))
}

fn workcell(setup: &str) -> Workcell {
    Workcell::new(RobotModel::from_urdf(description(setup).unwrap()).unwrap()).unwrap()
}

#[test]
#[ignore = "a search, not a test"]
fn report() {
    let which = std::env::var("CELL").unwrap_or_default();
    for setup in SETUPS.iter().filter(|s| s.contains(&which)) {
        let begin = std::time::Instant::now();
        let text = std::env::var("URDF").ok().map(|p| std::fs::read_to_string(p).unwrap());
        let text = text.unwrap_or_else(|| description(setup).unwrap().to_owned());
        let cell = Workcell::new(RobotModel::from_urdf(&text).unwrap()).unwrap();
        println!("{setup}: built in {:?}", begin.elapsed());
        let home = home(setup).unwrap();
        println!("home {:?}", cell.obstructed(&home, &object(), 0.01).unwrap());
        let laser = setup.contains("laser");
        let sensor = if laser {
            SensorModel::Striper(StriperModel::SCANCONTROL)
        } else {
            SensorModel::Stereo(StereoModel::GUPPY)
        };
        let elevations: Vec<f64> = if laser {
            (0..10).map(|i| -10.0 + 10.0 * f64::from(i)).collect()
        } else {
            (-8..=8).map(|i| 10.0 * f64::from(i)).collect()
        };
        let quiet = std::env::var("QUIET").is_ok();
        let mut total = [0, 0];
        let mut worst = (0.0, String::new());
        let (mut sum_ok, mut n_ok, mut sum_bad, mut n_bad) = (0.0, 0, 0.0, 0);
        let mut motion = 0.0;
        for e in elevations.iter().rev() {
            let mut line = format!("{e:5.0} ");
            for a in (0..360).step_by(15) {
                let (e, a) = (e.to_radians(), f64::from(a).to_radians());
                let direction = Vec3::new(e.cos() * a.cos(), e.cos() * a.sin(), e.sin());
                let obstacle = object();
                let request = ReachRequest {
                    view: view(&direction, sensor.working_distance()),
                    start: &home,
                    sweep: sensor.sweep(),
                    slide: slide_range(&sensor, 0.15),
                    obstacle: &obstacle,
                    margin: 0.01,
                };
                let begin = std::time::Instant::now();
                let reach = cell.reach(&request).unwrap();
                let took = begin.elapsed().as_secs_f64();
                if took > worst.0 {
                    worst = (took, format!("{e} {a} {reach:.0?}").chars().take(90).collect());
                }
                total[1] += 1;
                match &reach {
                    Reach::Reached(r) => {
                        total[0] += 1;
                        sum_ok += took;
                        n_ok += 1;
                        motion += r.duration;
                        line.push(if r.path.positions.len() > 0 { '#' } else { '+' });
                    }
                    Reach::Refused { reason } => {
                        sum_bad += took;
                        n_bad += 1;
                        line.push(if reason.starts_with("out") {
                            'o'
                        } else if reason.contains("no free way") {
                            'p'
                        } else if reason.contains("sweep") {
                            's'
                        } else {
                            'c'
                        });
                        if !quiet && std::env::var("WHY").is_ok() {
                            println!("{reason}");
                        }
                    }
                }
            }
            if !quiet {
                println!("{line}");
            }
        }
        println!(
            "reached {} of {}; reached {:.1} ms, refused {:.1} ms, worst {:.1} ms {}; motion {:.2} s",
            total[0],
            total[1],
            1e3 * sum_ok / f64::from(n_ok.max(1)),
            1e3 * sum_bad / f64::from(n_bad.max(1)),
            1e3 * worst.0,
            worst.1,
            motion / f64::from(n_ok.max(1))
        );
    }
}
