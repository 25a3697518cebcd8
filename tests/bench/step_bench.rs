//! Microseconds per physics tick of 1/240 s with the settings for data: the
//! whole robot in the whole home takes a bottle from the table and waves it.
//!
//! `step_bench [ASSETS]`

mod course;

use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context as _, Result};
use course::{CONTROL_TICKS, Course};
use wheelarm_tests::cpu::thread_seconds;

fn main() -> Result<()> {
    let assets = std::env::args_os()
        .nth(1)
        .map_or_else(|| PathBuf::from("assets"), PathBuf::from);
    let course = Course::load(&assets)?;
    let mut world = course.world()?;
    let mut control = course.control();
    let mut stepping = Vec::with_capacity(CONTROL_TICKS as usize * 4);
    let (mut controlling, mut looking, mut contacts) = (0.0, 0.0, 0);
    let mut checking = 0.0;
    let processor = thread_seconds();
    for control_tick in 0..CONTROL_TICKS {
        let begin = Instant::now();
        let snapshot = world.snapshot();
        looking += begin.elapsed().as_secs_f64();
        contacts += snapshot.contacts.len();
        let begin = Instant::now();
        let targets = control.update(&course.input(control_tick), &snapshot);
        controlling += begin.elapsed().as_secs_f64();
        for (i, target) in targets.iter().enumerate() {
            let begin = Instant::now();
            world.apply(target);
            world.step();
            stepping.push(begin.elapsed().as_secs_f64() * 1e6);
            let begin = Instant::now();
            let fault = match i + 1 == targets.len() {
                true => world.fault(),
                false => world.fault_of_tick(),
            };
            checking += begin.elapsed().as_secs_f64();
            anyhow::ensure!(fault.is_none(), "{fault:?}");
        }
    }
    let ticks = stepping.len() as f64;
    let processor = (thread_seconds() - processor) / ticks * 1e6;
    let mean = stepping.iter().sum::<f64>() / ticks;
    stepping.sort_by(f64::total_cmp);
    let at = |fraction: f64| stepping[((ticks - 1.0) * fraction) as usize];
    let state = world.snapshot();
    let bottle = course.scene.object_named("mustard").context("a bottle")?;
    let bottle = state.objects[bottle].pose.translation.vector;
    let hand = course
        .robot
        .link(&course.robot.settings.end_effector_link)
        .unwrap_or(0);
    let reach = (bottle - state.links[hand].pose.translation.vector).norm();
    println!(
        "physics, {ticks} ticks of 1/240 s: median {:.1} µs (mean {mean:.1}, least {:.1}, 95 % {:.1}, greatest {:.0})\n\
         processor time {processor:.1} µs per tick with control and snapshots\n\
         check of the state {:.2} µs, {:.2} % of a tick\n\
         snapshot {:.1} µs, control {:.1} µs per control tick; {:.1} touching pairs\n\
         at the end the bottle is {:.2} m high, {:.2} m from the hand",
        at(0.5),
        at(0.0),
        at(0.95),
        at(1.0),
        checking / ticks * 1e6,
        checking / ticks * 1e8 / mean,
        looking / CONTROL_TICKS as f64 * 1e6,
        controlling / CONTROL_TICKS as f64 * 1e6,
        contacts as f64 / CONTROL_TICKS as f64,
        bottle.z,
        reach,
    );
    Ok(())
}
