//! The scene of every task starts at rest and stays at rest.

use wheelarm_server::robot::RobotModel;
use wheelarm_server::robot::control::ControlInput;
use wheelarm_server::sim::{Scenario, Simulation};
use wheelarm_tests::root;

/// Control ticks in ten seconds.
const TEN_SECONDS: usize = 600;

#[test]
fn objects_and_drawers_stay_where_they_were_put() {
    let assets = root().join("assets");
    let model = RobotModel::load(&assets, "wheelarm").unwrap();
    let tasks = wheelarm_server::tasks::list(&assets, &model.settings.gripper.corridor).unwrap();
    for task in tasks {
        let scenario = Scenario {
            task: task.name.clone(),
            seed: 5,
            cameras: Vec::new(),
            ..Scenario::default()
        };
        let mut sim = Simulation::new(&assets, scenario).unwrap();
        let names: Vec<String> = (sim.scene().objects.iter())
            .map(|b| b.name.clone())
            .collect();
        let start = sim.snapshot().clone();
        let (mut shift, mut turn): ((f64, &str), (f64, &str)) = ((0.0, ""), (0.0, ""));
        for _ in 0..TEN_SECONDS {
            sim.step(&ControlInput::default());
            let now = sim.snapshot();
            assert!(now.anomalies.is_empty(), "{:?}", now.anomalies);
            let bodies = names.iter().zip(&start.objects);
            for ((name, before), after) in bodies.zip(&now.objects) {
                let moved = before.pose.inverse() * after.pose;
                let (s, t) = (moved.translation.vector.norm(), moved.rotation.angle());
                if s > shift.0 {
                    shift = (s, name.as_str());
                }
                if t > turn.0 {
                    turn = (t, name.as_str());
                }
            }
            let joints = start.furniture_joints.iter().zip(&now.furniture_joints);
            for (before, after) in joints {
                let moved = (after.position - before.position).abs();
                assert!(moved < 0.001, "{}: {after:?}", task.name);
            }
        }
        println!("{}: {shift:?} m, {turn:?} rad", task.name);
        assert!(shift.0 <= 0.001, "{}: {shift:?} m", task.name);
        assert!(turn.0 <= 1f64.to_radians(), "{}: {turn:?} rad", task.name);
    }
}
