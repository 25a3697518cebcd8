//! `wheelarm replay FILE`: does an episode again from its snapshot and its
//! applied commands, and compares the state hashes; with `--out` it records
//! again, with other cameras if asked.
//!
//! Nothing is decided here: what was applied at a tick is applied again.

mod recorded;
mod script;

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use anyhow::{Context, bail};
use clap::Args;
use wheelarm_dataset::read::Episode;
use wheelarm_proto::settings::{Pacing, Quality};
use wheelarm_proto::topic::Sample;
use wheelarm_proto::{TopicId, v1};

use crate::choice::named;
use script::Script;
use wheelarm_link::{Link, Turn, Turns};
use wheelarm_rig::local::{self, LocalServer, ServerOptions};

/// Name under which a replay commands and records.
const NAME: &str = "replay";
/// Silence after which the replay gives up.
const PATIENCE: Duration = Duration::from_secs(60);

/// Options of `wheelarm replay`.
#[derive(Args, Clone, Debug)]
pub struct ReplayArgs {
    /// Episode file.
    pub file: PathBuf,
    /// Records again into this folder; only compares when absent.
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// Width of the recorded cameras' new pictures, pixels.
    #[arg(long, requires = "out")]
    pub width: Option<u32>,
    /// Height of the recorded cameras' new pictures, pixels.
    #[arg(long, requires = "out")]
    pub height: Option<u32>,
    /// Another camera as NAME=WIDTHxHEIGHT@HZ; may be repeated. One of the
    /// recorded cameras' names replaces its setting.
    #[arg(long, requires = "out", value_name = "NAME=WxH@HZ")]
    pub camera: Vec<String>,
    /// Draws the recorded states anew instead of computing them, also those of
    /// another version of the physics: robot, objects, furniture, commands and
    /// evaluation as recorded, and new pictures.
    #[arg(long, requires = "out")]
    pub as_recorded: bool,
    /// Work per picture; the recording's when absent.
    #[arg(long, requires = "out", value_parser = named::<Quality>())]
    pub quality: Option<Quality>,
    /// Assets folder; the server looks for it when absent.
    #[arg(long, env = "WHEELARM_ASSETS")]
    pub assets: Option<PathBuf>,
}

/// Replays and prints the result; exit code 1 when a state differs, 3 when the
/// new recording is not complete.
///
/// # Errors
/// When the file cannot be replayed or a program does not answer.
pub fn run(args: &ReplayArgs) -> anyhow::Result<ExitCode> {
    let episode = Episode::open(&args.file)?;
    if let (true, Some(out)) = (args.as_recorded, &args.out) {
        return recorded::run(args, out, &episode);
    }
    let script = Script::read(&episode)?;
    script.check_physics(&args.file)?;
    let cameras = match &args.out {
        Some(_) => script::cameras(&script.scenario, args.width, args.height, &args.camera)?,
        None => Vec::new(),
    };
    let server = LocalServer::start(&ServerOptions {
        scene: script.scenario.scene.clone(),
        task: script.scenario.task().to_owned(),
        robot: script.scenario.robot.clone(),
        seed: script.scenario.seed(),
        pacing: Pacing::LockStep,
        quality: args
            .quality
            .unwrap_or_else(|| script::quality(&script.scenario)),
        cameras: cameras.iter().map(script::camera_option).collect(),
        assets: args.assets.clone(),
    })?;
    let link = server.link()?;
    let mut recorder = match &args.out {
        Some(out) => Some(local::start_recorder(server.connect(), out, NAME)?),
        None => None,
    };
    reset(&link, &script, cameras)?;
    // Subscribed before the episode begins, so that its first state is seen.
    let mut turns = link.turns(NAME, false, &[TopicId::StateHash])?;
    let label = format!("{}-replay", script.label);
    let request = v1::EpisodeStartRequest {
        label: match &args.out {
            Some(out) => local::free_label(out, &label),
            None => label,
        },
        instruction: Some(script.instruction.clone()),
        require_recorders: u32::from(recorder.is_some()),
        commander: NAME.to_owned(),
        replay: true,
    };
    let started: v1::EpisodeStarted = link.ask(&request).with_context(|| server.messages())?;
    let fed = feed(&mut turns, &script, &started);
    // A replay that broke off is not worth a file.
    link.stop_episode(fed.is_err())?;
    let mut comparison = fed?;
    let mut code = comparison.report();
    if let Some(recorder) = &mut recorder {
        let number = started.header.as_ref().map_or(0, |header| header.episode);
        let recorded = local::finished(&link, NAME, number, recorder)?;
        println!(
            "recorded {} ({}, {} missed)",
            recorded.path,
            if recorded.complete {
                "complete"
            } else {
                "NOT complete"
            },
            recorded.missed
        );
        if code == ExitCode::SUCCESS && !(recorded.complete && recorded.missed == 0) {
            code = ExitCode::from(3);
        }
    }
    drop((recorder, turns));
    server.stop(link)?;
    Ok(code)
}

/// Puts the server into the state at the start of the episode.
fn reset(link: &Link, script: &Script, cameras: Vec<v1::CameraSetting>) -> anyhow::Result<()> {
    let mut scenario = script.scenario.clone();
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

/// Feeds the commands by tick and collects the hashes.
fn feed(
    turns: &mut Turns,
    script: &Script,
    started: &v1::EpisodeStarted,
) -> anyhow::Result<Comparison> {
    let number = started.header.as_ref().map_or(0, |header| header.episode);
    let mut comparison = Comparison::new(script);
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
                "nothing came for {:.0} s after {} ticks; the server waits for: {}",
                PATIENCE.as_secs_f64(),
                comparison.ticks,
                status.waiting_for
            ),
        };
        if header.episode != number {
            continue;
        }
        if header.tick > script.last_tick {
            return Ok(comparison);
        }
        turns.answer(script.command(header.tick)?)?;
        comparison.ticks += 1;
    }
}

/// Recorded hashes beside those of the replay.
#[derive(Clone, Debug)]
struct Comparison {
    recorded: Vec<(u64, u64)>,
    seen: Vec<(u64, u64)>,
    ticks: usize,
}

impl Comparison {
    fn new(script: &Script) -> Self {
        Self {
            recorded: script.hashes.clone(),
            seen: Vec::new(),
            ticks: 0,
        }
    }

    fn take(&mut self, tick: u64, hash: u64) {
        self.seen.push((tick, hash));
    }

    /// Number of equal hashes, or the first tick that differs.
    fn outcome(&mut self) -> Result<usize, String> {
        self.seen.sort_unstable();
        self.seen.dedup();
        let mut equal = 0;
        for (tick, hash) in &self.recorded {
            match self.seen.iter().find(|(seen, _)| seen == tick) {
                Some((_, seen)) if seen == hash => equal += 1,
                Some((_, seen)) => {
                    return Err(format!(
                        "differs at tick {tick} ({:.3} s): state hash {seen:016x}, recorded {hash:016x}; {equal} hashes before it are equal",
                        wheelarm_proto::stamp_nanos(*tick) as f64 * 1e-9
                    ));
                }
                None => return Err(format!("no state hash came for tick {tick}")),
            }
        }
        if equal == 0 {
            return Err("the recording holds no state hash that could be compared".to_owned());
        }
        Ok(equal)
    }

    fn report(&mut self) -> ExitCode {
        match self.outcome() {
            Ok(equal) => {
                println!("replayed {} ticks, {equal} hashes equal", self.ticks);
                ExitCode::SUCCESS
            }
            Err(problem) => {
                println!("replayed {} ticks, {problem}", self.ticks);
                ExitCode::FAILURE
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn comparison(seen: &[(u64, u64)]) -> Comparison {
        Comparison {
            recorded: vec![(0, 9), (240, 7), (480, 8)],
            seen: seen.to_vec(),
            ticks: 200,
        }
    }

    #[test]
    fn equal_hashes_are_counted_and_the_first_difference_is_named() {
        assert_eq!(comparison(&[(0, 9), (240, 7), (480, 8)]).outcome(), Ok(3));
        let late = comparison(&[(240, 7), (480, 8)]).outcome();
        assert!(late.unwrap_err().contains("tick 0"));
        let wrong = comparison(&[(0, 9), (240, 6), (480, 5)]).outcome();
        assert!(wrong.unwrap_err().contains("tick 240"));
        let short = comparison(&[(0, 9), (240, 7)]).outcome();
        assert!(short.unwrap_err().contains("tick 480"));
        assert!(comparison(&[]).outcome().is_err());
    }
}
