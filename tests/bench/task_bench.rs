//! Real-time factor of every task's physics on one core, with control, inverse
//! kinematics, hooks and predicates: the chair drives and turns, the hand waves, the
//! gripper opens and closes.
//!
//! `task_bench [ASSETS] [SECONDS]`

use std::path::PathBuf;
use std::time::Instant;

use anyhow::Result;
use nalgebra::Vector3;
use wheelarm_server::robot::RobotModel;
use wheelarm_server::robot::control::{
    ArmIntent, BaseIntent, ControlInput, GripperIntent, IntentFrame,
};
use wheelarm_server::sim::{Scenario, Simulation};
use wheelarm_server::tasks;
use wheelarm_tests::cpu::thread_seconds;

fn main() -> Result<()> {
    let arguments: Vec<_> = std::env::args().collect();
    let assets = PathBuf::from(arguments.get(1).map_or("assets", String::as_str));
    let seconds = arguments
        .get(2)
        .map_or(Ok(10), |text| text.parse::<u64>())?;
    let mut slowest = (String::new(), f64::INFINITY);
    let model = RobotModel::load(&assets, "wheelarm")?;
    for task in tasks::list(&assets, &model.settings.gripper.corridor)? {
        let scenario = Scenario {
            task: task.name.clone(),
            cameras: Vec::new(),
            ..Scenario::default()
        };
        let mut sim = Simulation::new(&assets, scenario)?;
        let (begin, processor) = (Instant::now(), thread_seconds());
        for tick in 0..60 * seconds {
            sim.step(&input(tick));
        }
        let wall = seconds as f64 / begin.elapsed().as_secs_f64();
        let used = thread_seconds() - processor;
        // Without CPU time from the system, use wall time.
        let cpu = if used > 0.0 {
            seconds as f64 / used
        } else {
            wall
        };
        // Deformable objects have a goal and a bench of their own: `plush_bench`.
        let soft = sim.scene().objects.iter().any(|body| body.soft.is_some());
        println!(
            "{:20} {cpu:5.1} x real time of one core, {wall:5.1} x by the clock{}",
            task.name,
            if soft { ", soft" } else { "" }
        );
        if !soft && cpu < slowest.1 {
            slowest = (task.name, cpu);
        }
    }
    println!(
        "slowest rigid task {:.1} x real time: {}",
        slowest.1, slowest.0
    );
    Ok(())
}

/// A second of driving, then waving while the chair rocks on the spot.
fn input(tick: u64) -> ControlInput {
    let time = tick as f64 / 60.0;
    let phase = 4.0 * time;
    ControlInput {
        arm: Some(ArmIntent::Twist {
            frame: IntentFrame::ArmBase,
            linear: Vector3::new(0.0, 0.15 * phase.cos(), 0.1 * (1.5 * phase).cos()),
            angular: Vector3::new(0.0, 0.0, 0.4 * phase.cos()),
        }),
        base: Some(BaseIntent {
            linear: if time < 1.0 { 0.3 } else { 0.0 },
            angular: 0.5 * time.cos(),
        }),
        gripper: tick.is_multiple_of(120).then(|| GripperIntent {
            knuckle: if tick.is_multiple_of(240) { 0.7 } else { 0.0 },
            max_force: None,
        }),
    }
}
