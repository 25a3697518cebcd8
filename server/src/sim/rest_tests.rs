//! Lying, leaning, stacked and upright objects are at rest from the first step.

use super::ControlInput;
use super::Simulation;
use super::tests::{scenario, simulation};

/// Simulated seconds without motion.
const SECONDS: u64 = 2;
/// Largest movement of an object, metres, and rotation, rad: contacts settle by this
/// much.
const MOST: [f64; 2] = [0.002, 0.01];

fn poses(sim: &Simulation) -> Vec<nalgebra::Isometry3<f64>> {
    let objects = sim.snapshot().objects.iter();
    objects.map(|object| object.pose).collect()
}

#[test]
fn objects_of_every_area_are_at_rest_in_every_placement() {
    let mut unusual = 0;
    for (task, seeds) in [("pick_mustard", 0..14), ("serve_remote", 0..6)] {
        for seed in seeds {
            let mut sim = simulation(crate::sim::Scenario {
                seed,
                ..scenario(task)
            });
            let before = poses(&sim);
            for _ in 0..SECONDS * wheelarm_proto::CONTROL_HZ {
                sim.step(&ControlInput::default());
            }
            for ((name, _), (from, to)) in sim
                .scenario()
                .objects
                .iter()
                .zip(before.iter().zip(poses(&sim)))
            {
                let moved = (to.translation.vector - from.translation.vector).norm();
                let turned = from.rotation.angle_to(&to.rotation);
                assert!(
                    moved < MOST[0] && turned < MOST[1],
                    "{task} seed {seed}: {name} moves {moved:.4} m and turns {turned:.4} rad"
                );
                let up = (from.rotation * nalgebra::Vector3::z()).z;
                unusual += usize::from(up < 0.999 && !name.starts_with("knife"));
            }
        }
    }
    assert!(unusual > 8, "{unusual}");
}
