//! `wheelarm replay FILE`: the recorded state and the recorded commands again,
//! and the state hashes compared, under one look or several.

use std::process::ExitCode;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use anyhow::{Context, bail};
use wheelarm_dataset::read::Episode;
use wheelarm_link::{Link, Turn, Turns};
use wheelarm_proto::topic::Sample;
use wheelarm_proto::{TopicId, v1};
use wheelarm_rollout::free_label;

use super::args::ReplayArgs;
use super::assets;
use super::comparison::Comparison;
use super::rig::{NAME, Rig};
use super::script::{self, Script};

/// Silence after which the replay gives up.
const PATIENCE: Duration = Duration::from_secs(60);

/// Replays and prints the result; exit code 1 when a state differs, 3 when the
/// new recording is not complete.
///
/// # Errors
/// When the file cannot be replayed or a program does not answer.
pub(super) fn run(args: &ReplayArgs, episode: &Episode) -> anyhow::Result<ExitCode> {
    let script = Script::read(episode)?;
    script.check_physics(&args.file)?;
    let looks = args.asked_looks();
    if looks.is_empty() {
        let label = format!("{}-replay", script.label);
        let adapters = args.graphics.of_workers(1)?;
        let (lines, code) = once(args, &script, None, &label, adapters[0].as_deref())?;
        lines.iter().for_each(|line| println!("{line}"));
        return Ok(code);
    }
    each(args, &script, &looks)
}

/// Replays under each look, several at a time: the physics of each is its own, so
/// each compares its hashes.
fn each(args: &ReplayArgs, script: &Script, looks: &[v1::Look]) -> anyhow::Result<ExitCode> {
    let cores = std::thread::available_parallelism().map_or(1, |n| n.get() / 2);
    let jobs = args.jobs.map_or(cores.max(1), |jobs| jobs as usize);
    let jobs = jobs.min(looks.len());
    let adapters = args.graphics.of_workers(jobs)?;
    let next = AtomicUsize::new(0);
    let worst = Mutex::new(ExitCode::SUCCESS);
    let failed: anyhow::Result<()> = std::thread::scope(|scope| {
        let worker = |adapter: Option<&str>| -> anyhow::Result<()> {
            while let Some(look) = looks.get(next.fetch_add(1, Ordering::Relaxed)) {
                let label = format!("{}-look{}", script.label, look.seed);
                let done = once(args, script, Some(*look), &label, adapter);
                let (lines, code) = done.with_context(|| format!("look {look}"))?;
                let mut worst = worst.lock().unwrap_or_else(PoisonError::into_inner);
                for line in lines {
                    println!("look {look}: {line}");
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

/// One replay, under the look of the recording or another one: what is to be
/// said of it, and the exit code.
fn once(
    args: &ReplayArgs,
    script: &Script,
    look: Option<v1::Look>,
    label: &str,
    adapter: Option<&str>,
) -> anyhow::Result<(Vec<String>, ExitCode)> {
    let mut scenario = script.scenario.clone();
    let mut cameras = match &args.out {
        Some(_) => script::cameras(&scenario, args.width, args.height, &args.camera),
        None => Vec::new(),
    };
    if let Some(look) = look {
        let before = scenario.look.replace(look).unwrap_or_default();
        let moves = |look: &v1::Look| look.camera > 0 || look.lens > 0;
        if moves(&before) || moves(&look) {
            // Drawn anew: the calibration, and the look on top of it.
            for camera in &mut cameras {
                (camera.lens, camera.place) = (None, None);
            }
        }
    }
    let mut rig = Rig::start(args, &scenario, cameras.clone(), script.depth, adapter)?;
    reset(&rig.link, script, scenario, cameras)?;
    // Subscribed before the episode begins, so that its first state is seen.
    let mut turns = rig.link.turns(NAME, false, &[TopicId::StateHash])?;
    let request = v1::EpisodeStartRequest {
        label: match &args.out {
            Some(out) => free_label(out, label),
            None => label.to_owned(),
        },
        instruction: Some(script.instruction.clone()),
        require_recorders: rig.recorders(),
        commander: NAME.to_owned(),
        replay: true,
        ..v1::EpisodeStartRequest::default()
    };
    let started = rig.link.ask(&request);
    let started = started.with_context(|| rig.server.tail())?;
    let fed = check_assets(&rig.link, script).and_then(|()| feed(&mut turns, script, &started));
    // A replay that broke off is not worth a file.
    rig.link.stop_episode_of(&started, fed.is_err())?;
    let (line, mut code) = fed?.report();
    let mut lines = vec![line];
    if let Some(recorded) = rig.recorded(&started)? {
        lines.push(format!("recorded {}", recorded.line()));
        if code == ExitCode::SUCCESS {
            code = recorded.code();
        }
    }
    drop(turns);
    rig.stop()?;
    Ok((lines, code))
}

/// Puts the server into the state at the start of the episode.
fn reset(
    link: &Link,
    script: &Script,
    mut scenario: v1::Scenario,
    cameras: Vec<v1::CameraSetting>,
) -> anyhow::Result<()> {
    scenario.cameras = cameras;
    // Whatever paced the recording, its commands are applied tick by tick.
    scenario.pacing = v1::Pacing::LockStep.into();
    // The quality was given when the server was started.
    scenario.quality = v1::RenderQuality::Unspecified.into();
    let request = v1::ResetRequest {
        scenario: Some(scenario),
        snapshot: script.snapshot.clone(),
        ..v1::ResetRequest::default()
    };
    let reply: v1::ResetReply = link.ask(&request)?;
    let tick = reply.header.unwrap_or_default().tick;
    if tick != script.first_tick {
        bail!(
            "the snapshot puts the server at tick {tick}, the episode began at tick {}; was the file made by another version?",
            script.first_tick
        );
    }
    Ok(())
}

/// Says what the loaded assets have otherwise than the recorded ones, and refuses
/// a robot that would move otherwise.
fn check_assets(link: &Link, script: &Script) -> anyhow::Result<()> {
    let loaded = link.ask(&v1::SnapshotRequest {})?.assets;
    let changes = assets::changes(&script.assets, &loaded);
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
            "the robot is another than the recorded one, so it would drift:\n{}\nreplay with the \
             recorded assets (--assets DIR; their texts stand in the file, `initial_state/assets`), \
             or draw the recorded states with --as-recorded",
            assets::lines(&moving)
        );
    }
    Ok(())
}

/// Feeds the commands by tick and collects the hashes.
fn feed(
    turns: &mut Turns,
    script: &Script,
    started: &v1::EpisodeStarted,
) -> anyhow::Result<Comparison> {
    let number = started.header.as_ref().map_or(0, |header| header.episode);
    let mut comparison = Comparison::with(script.hashes.clone());
    let mut asked = script.first_tick;
    loop {
        let turn = turns.next(PATIENCE, &mut |sample| {
            if let Sample::StateHash(sample) = sample {
                let header = sample.header.unwrap_or_default();
                if header.episode == number {
                    comparison.take(header.tick, sample.hash);
                }
            }
        })?;
        let header = match turn {
            Turn::Answer(clock) => clock.header.unwrap_or_default(),
            Turn::Refused(refusal) => {
                bail!("the server refused a recorded command: {}", refusal.reason);
            }
            Turn::Ended(_) => bail!("the episode was ended by somebody else"),
            Turn::Silent(status) => bail!(
                "nothing came for {:.0} s after tick {asked}; the server waits for: {}",
                PATIENCE.as_secs_f64(),
                status.waiting_for
            ),
        };
        if header.episode != number {
            continue;
        }
        asked = header.tick;
        if asked > script.last_tick {
            return Ok(comparison);
        }
        turns.answer(script.command(asked)?)?;
        comparison.tick();
    }
}
