//! `wheelarm replay FILE`: repeats the recorded commands from the recorded state and compares
//! the state hashes, with one appearance or several.

use std::process::ExitCode;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use anyhow::{Context, bail};
use wheelarm_dataset::read::Episode;
use wheelarm_proto::v1;
use wheelarm_rollout::{Comparison, Driver, Replay, free_label};

use super::args::ReplayArgs;
use super::assets;
use super::recording::{self, Recorded};
use super::script::{self, Script};

/// Replays and prints the result; exit code 1 when a state differs, 3 when the
/// new recording is not complete.
///
/// # Errors
/// When the file cannot be replayed or a program does not reply.
pub(super) fn run(args: &ReplayArgs, episode: &Episode) -> anyhow::Result<ExitCode> {
    let script = Script::read(episode)?;
    script.check_physics(&args.file)?;
    let appearances = args.requested_appearances();
    if appearances.is_empty() {
        let label = format!("{}-replay", script.label);
        let adapters = args.graphics.of_workers(1)?;
        let (lines, code) = once(args, &script, None, &label, adapters[0].as_deref())?;
        lines.iter().for_each(|line| println!("{line}"));
        return Ok(code);
    }
    each(args, &script, &appearances)
}

/// Replays under each appearance, several at a time: the physics of each is its own, so
/// each compares its hashes.
fn each(
    args: &ReplayArgs,
    script: &Script,
    appearances: &[v1::Appearance],
) -> anyhow::Result<ExitCode> {
    let cores = std::thread::available_parallelism().map_or(1, |n| n.get() / 2);
    let jobs = args.jobs.map_or(cores.max(1), |jobs| jobs as usize);
    let jobs = jobs.min(appearances.len());
    let adapters = args.graphics.of_workers(jobs)?;
    let next = AtomicUsize::new(0);
    let worst = Mutex::new(ExitCode::SUCCESS);
    let failed: anyhow::Result<()> = std::thread::scope(|scope| {
        let worker = |adapter: Option<&str>| -> anyhow::Result<()> {
            while let Some(appearance) = appearances.get(next.fetch_add(1, Ordering::Relaxed)) {
                let label = format!("{}-look{}", script.label, appearance.seed);
                let done = once(args, script, Some(*appearance), &label, adapter);
                let (lines, code) = done.with_context(|| format!("look {appearance}"))?;
                let mut worst = worst.lock().unwrap_or_else(PoisonError::into_inner);
                for line in lines {
                    println!("look {appearance}: {line}");
                }
                if code != ExitCode::SUCCESS && *worst != ExitCode::FAILURE {
                    *worst = code;
                }
            }
            Ok(())
        };
        let workers: Vec<_> = adapters
            .iter()
            .map(|adapter| scope.spawn(move || worker(adapter.as_deref())))
            .collect();
        workers.into_iter().try_for_each(|worker| {
            let joined = worker.join();
            joined.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        })
    });
    failed?;
    let code = *worst.lock().unwrap_or_else(PoisonError::into_inner);
    Ok(code)
}

/// One replay, under the appearance of the recording or another one: the lines to print, and the
/// exit code.
fn once(
    args: &ReplayArgs,
    script: &Script,
    appearance: Option<v1::Appearance>,
    label: &str,
    adapter: Option<&str>,
) -> anyhow::Result<(Vec<String>, ExitCode)> {
    let mut scenario = script.scenario.clone();
    let mut cameras = match &args.out {
        Some(_) => script::cameras(&scenario, args.width, args.height, &args.camera),
        None => Vec::new(),
    };
    if let Some(appearance) = appearance {
        let before = scenario.appearance.replace(appearance).unwrap_or_default();
        let moves = |appearance: &v1::Appearance| appearance.camera > 0 || appearance.lens > 0;
        if moves(&before) || moves(&appearance) {
            // Sampled again: the calibration, and the appearance on top of it.
            for camera in &mut cameras {
                (camera.lens, camera.place) = (None, None);
            }
        }
    }
    let recorded = script.assets.clone();
    let replay = Replay {
        scenario: v1::Scenario {
            cameras: cameras.clone(),
            ..scenario.clone()
        },
        instruction: script.instruction.clone(),
        snapshot: script.snapshot.clone(),
        first_tick: script.first_tick,
        last_tick: script.last_tick,
        commands: script.commands.clone(),
        hashes: script.hashes.clone(),
        check_assets: Arc::new(move |loaded| check_assets(&recorded, loaded)),
    };
    let label = match &args.out {
        Some(out) => free_label(out, label),
        None => label.to_owned(),
    };
    let finished = recording::run(
        args,
        &scenario,
        cameras,
        (script.depth, adapter),
        (label, Driver::Replay(Arc::new(replay))),
    )?;
    let comparison = finished.comparison.as_ref();
    let (line, mut code) = report(comparison.context("the replay compared nothing")?);
    let mut lines = vec![line];
    if let Some(recorded) = Recorded::new(args, &finished)? {
        lines.push(format!("recorded {}", recorded.line()));
        if code == ExitCode::SUCCESS {
            code = recorded.code();
        }
    }
    Ok((lines, code))
}

/// The comparison as a line; exit code 1 when something differs.
fn report(comparison: &Comparison) -> (String, ExitCode) {
    let (words, code) = match comparison.equal_hashes() {
        Ok(equal) => (format!("{equal} hashes equal"), ExitCode::SUCCESS),
        Err(problem) => (problem, ExitCode::FAILURE),
    };
    (
        format!("replayed {} ticks, {words}", comparison.ticks()),
        code,
    )
}

/// Prints how the loaded assets differ from the recorded ones, and rejects a robot that
/// would move differently.
fn check_assets(recorded: &[v1::AssetText], loaded: &[v1::AssetText]) -> anyhow::Result<()> {
    let changes = assets::changes(recorded, loaded);
    let (moving, others): (Vec<_>, Vec<_>) = changes
        .into_iter()
        .partition(assets::Change::moves_the_robot);
    if !others.is_empty() {
        eprintln!(
            "assets differ from the recorded ones:\n{}",
            assets::lines(&others)
        );
    }
    if !moving.is_empty() {
        bail!(
            "the robot differs from the recorded one, so the states would diverge:\n{}\nreplay \
             with the recorded assets (--assets DIR; the file has their texts in \
             `initial_state/assets`), or render the recorded states with --as-recorded",
            assets::lines(&moving)
        );
    }
    Ok(())
}
