//! Time of sampling a scenario and of a reset, and number of rejected samples.
//!
//! `draw_bench [ASSETS] [SEEDS]`

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::time::Instant;

use anyhow::Result;
use wheelarm_proto::settings::Starts;
use wheelarm_server::robot::RobotModel;
use wheelarm_server::scene::Scene;
use wheelarm_server::sim::{Scenario, Simulation};
use wheelarm_server::tasks::{self, Floor};

fn main() -> Result<()> {
    let arguments: Vec<_> = std::env::args().collect();
    let assets = PathBuf::from(arguments.get(1).map_or("assets", String::as_str));
    let seeds = arguments
        .get(2)
        .map_or(Ok(2000), |text| text.parse::<u64>())?;
    let home = Scene::load(&assets, "home")?;
    let model = RobotModel::load(&assets, "wheelarm")?;
    let reach = model.read_reach_map(&assets)?;
    let mut sampled = BTreeSet::new();
    for task in tasks::list(&assets, &model.settings.gripper.corridor)? {
        for variant in task.area.variants.iter() {
            if !sampled.insert((task.area.name.clone(), variant.name.clone())) {
                continue;
            }
            let mut scene = home.clone();
            scene.keep_optional(&variant.furniture);
            let floor = Floor::new(&model, &scene);
            let maps = floor
                .clone()
                .by_maps(&scene, reach.clone(), Starts::Anywhere);
            for (floor, starts) in [
                (None, "near"),
                (Some(&floor), "anywhere"),
                (Some(&maps), "by maps"),
            ] {
                let (mut longest, mut attempts, mut tight) = (0.0_f64, Vec::new(), 0);
                let mut nowhere = 0;
                let begin = Instant::now();
                for seed in 0..seeds {
                    let one = Instant::now();
                    let drawn = tasks::sample_scene(&task.area, variant, &scene, seed, floor);
                    longest = longest.max(one.elapsed().as_secs_f64());
                    attempts.push(drawn.attempts);
                    nowhere += usize::from(floor.is_some() && drawn.arm.is_none());
                    tight += usize::from(drawn.clearance < 0.0 || !drawn.has_reach);
                }
                attempts.sort_unstable();
                println!(
                    "{:14} {:5} {starts:8} draw {:6.3} ms on average, {:6.2} ms at most; scenes begun {} in the \
                 middle, {} at most; {tight} of {seeds} without room, {nowhere} without a start",
                    task.area.name,
                    variant.name,
                    begin.elapsed().as_secs_f64() * 1e3 / seeds as f64,
                    longest * 1e3,
                    attempts[attempts.len() / 2],
                    attempts[attempts.len() - 1],
                );
            }
        }
    }
    for task in tasks::list(&assets, &model.settings.gripper.corridor)? {
        let scenario = Scenario {
            task: task.name.clone(),
            cameras: Vec::new(),
            ..Scenario::default()
        };
        let begin = Instant::now();
        Simulation::new(&assets, scenario)?;
        println!(
            "{:20} reset {:.3} s",
            task.name,
            begin.elapsed().as_secs_f64()
        );
    }
    Ok(())
}
