//! The gripper: what it holds, and when it lets slip.

use super::*;

/// Joint rates at which the arm waves, rad/s, and how far, rad.
const RATE: [f64; 6] = [3.0, 2.5, 3.5, 4.0, 3.0, 5.0];
const REACH: [f64; 6] = [0.35, 0.2, 0.25, 0.3, 0.3, 0.24];

struct Grasp {
    world: World,
    targets: Targets,
    hand: usize,
    home: [f64; 6],
}

/// The robot at home, its pads around an object that stands on a pedestal.
fn around(shape: Shape, half: [f64; 3], mass: f64, friction: f64) -> Grasp {
    let model = model();
    let home = model.settings.home;
    let arm: Vec<f64> = (0..model.joints.len())
        .map(|j| {
            let name = &model.joints[j].name;
            wheelarm_proto::names::JOINT_NAMES[4..10]
                .iter()
                .position(|n| n == name)
                .map_or(0.0, |i| home[i])
        })
        .collect();
    let hand = model.link(&model.settings.end_effector_link).expect("hand");
    // In the middle of the pads.
    let grasp = model.link_poses(&arm)[hand] * at(0.0, 0.0, 0.137);
    let p = grasp.translation.vector;
    let pedestal = [0.03, 0.03, (p.z - half[2]) / 2.0];
    let pedestal = body(
        "pedestal",
        at(p.x, p.y, pedestal[2]),
        0.6,
        Shape::Cuboid { half: pedestal },
    );
    let mut thing = object("thing", at(p.x, p.y, p.z), mass, half, shape);
    thing.friction = friction;
    let (scene, placements) = scene(vec![floor(), pedestal], vec![thing]);
    let world =
        World::new(&model, &scene, &placements, &Isometry3::identity(), &home).expect("a world");
    Grasp {
        world,
        targets: hold(home),
        hand,
        home,
    }
}

impl Grasp {
    fn close(&mut self, force: f64) {
        let targets = &mut self.targets;
        targets.pad_force = force;
        seconds(&mut self.world, 2.0, |world, t| {
            targets.knuckle_position = (0.5 * t).min(0.7929);
            targets.knuckle_velocity = if 0.5 * t < 0.7929 { 0.5 } else { 0.0 };
            world.apply(targets);
        });
    }

    fn hand_from_thing(&self) -> Isometry3<f64> {
        let s = self.world.snapshot();
        s.links[self.hand].pose.inverse() * s.objects[0].pose
    }

    fn wave(&mut self, from: f64, duration: f64) {
        let (home, targets) = (self.home, &mut self.targets);
        seconds(&mut self.world, duration, |world, t| {
            let t = from + t;
            let s = t.min(1.0);
            for i in 0..6 {
                let (a, w) = (REACH[i], RATE[i]);
                targets.arm_position[i] = home[i] + a * s * (w * t).sin();
                let ds = if t < 1.0 { (w * t).sin() } else { 0.0 };
                targets.arm_velocity[i] = a * (s * w * (w * t).cos() + ds);
            }
            // The first half second lifts straight off the pedestal.
            world.apply(targets);
        });
    }
}

#[test]
fn probe_grip() {
    let half = [0.048, 0.029, 0.08];
    let shapes = [
        ("rounded", Shape::RoundedCuboid { half, radius: 0.01 }),
        ("box", Shape::Cuboid { half }),
        (
            "cylinder",
            Shape::Cylinder {
                radius: 0.033,
                half_height: 0.08,
            },
        ),
    ];
    for (name, shape) in shapes {
        for force in [20.0, 60.0, 235.0] {
            let mut g = around(shape.clone(), half, 0.603, 0.6);
            let before = g.hand_from_thing();
            g.close(force);
            let rest = g.hand_from_thing();
            let s = g.world.snapshot();
            let n: Vec<String> = s
                .contacts
                .iter()
                .map(|c| format!("{:?}-{:?} {:.1}", c.first, c.second, c.force.norm()))
                .collect();
            let moved = (before.inverse() * rest).translation.vector;
            let q: Vec<f64> = model()
                .joints
                .iter()
                .zip(&s.joints)
                .filter(|(j, _)| j.name.contains("85") && j.name.contains("knuckle_joint"))
                .map(|(_, s)| s.position)
                .collect();
            println!(
                "{name} {force}: closing moved {:.2?} mm, knuckles {:.4?} {:?}",
                moved.as_slice().iter().map(|x| x * 1e3).collect::<Vec<_>>(),
                q,
                n
            );
            for k in 0..4 {
                g.wave(5.0 * f64::from(k), 5.0);
                let drift = rest.inverse() * g.hand_from_thing();
                print!(
                    "   {:.3} mm {:.3} deg",
                    drift.translation.vector.norm() * 1e3,
                    drift.rotation.angle().to_degrees()
                );
            }
            println!(" {:?}", g.world.snapshot().anomalies);
        }
    }
}
