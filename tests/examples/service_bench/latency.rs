//! From the sending of a command until it is applied, and until the robot is
//! seen to move, while two cameras stream.

use std::time::{Duration, Instant};

use anyhow::Context;
use wheelarm_client::link::{Commander, Link, Received, Stream, Streams};
use wheelarm_proto::{names, v1};
use wheelarm_tests::{IdleCommander, Server};
use zenoh::Wait;

use super::CAMERAS;

/// Commands measured.
const COMMANDS: usize = 60;
/// What counts as motion, rad: far above what a resting knuckle does.
const MOVED: f64 = 2e-4;

pub fn measure() -> anyhow::Result<()> {
    println!("two cameras of 160x90 at 30 Hz stream meanwhile");
    let server = Server::start("latency", &CAMERAS)?;
    let link = server.link();
    let pictures = link.session().declare_subscriber(link.keys().camera("*"));
    let _pictures = pictures
        .callback(|_| {})
        .wait()
        .map_err(|e| anyhow::anyhow!("{e}"))?;
    let (applied, moved) = real_time(&link)?;
    report("real time, command to applied", applied);
    report("real time, command to motion", moved);

    let args = [&CAMERAS[..], &["--pacing", "lock-step"]].concat();
    let server = Server::start("answers", &args)?;
    report("lock-step, command to applied", lock_step(&server.link())?);
    Ok(())
}

fn report(what: &str, mut seconds: Vec<f64>) {
    seconds.sort_by(f64::total_cmp);
    let at = |share: f64| {
        let place = (share * seconds.len() as f64) as usize;
        1e3 * seconds[place.min(seconds.len() - 1)]
    };
    println!("{what}: median {:.3} ms, p99 {:.3} ms", at(0.5), at(0.99));
}

fn knuckle(radians: f64) -> v1::Command {
    v1::Command {
        gripper: Some(v1::GripperCommand {
            target: Some(v1::gripper_command::Target::Knuckle(radians)),
            max_force: 0.0,
        }),
        ..Default::default()
    }
}

/// The gripper opens and closes; commands are sent at any time of the tick.
fn real_time(link: &Link) -> anyhow::Result<(Vec<f64>, Vec<f64>)> {
    let streams = link.streams(&[Stream::JointState, Stream::Applied])?;
    let mut commander = link.commander("bench", false)?;
    let joint = names::JOINT_NAMES
        .iter()
        .position(|name| *name == "robotiq_85_left_knuckle_joint")
        .context("the knuckle")?;
    let (mut applied, mut moved) = (Vec::new(), Vec::new());
    for i in 0..COMMANDS {
        let target = [0.2, 0.5][i % 2];
        let rest = settle(&streams, joint)?;
        // Spreads the sending over the control tick.
        std::thread::sleep(Duration::from_micros((i as u64 * 7919) % 16_667));
        while streams.next(Duration::ZERO)?.is_some() {}
        let sent = Instant::now();
        send(&mut commander, target)?;
        let (mut taken, mut seen) = (None, None);
        while taken.is_none() || seen.is_none() {
            match streams
                .next(Duration::from_secs(5))?
                .context("no sample came")?
            {
                Received::Applied(sample) if sample.gripper.is_some() => {
                    taken.get_or_insert(sent.elapsed().as_secs_f64());
                }
                Received::JointState(sample) if (sample.position[joint] - rest).abs() > MOVED => {
                    seen.get_or_insert(sent.elapsed().as_secs_f64());
                }
                _ => {}
            }
        }
        applied.extend(taken);
        moved.extend(seen);
    }
    Ok((applied, moved))
}

fn send(commander: &mut Commander, target: f64) -> anyhow::Result<()> {
    Ok(commander.answer(&v1::Header::default(), knuckle(target))?)
}

/// Waits until the joint rests; where it does.
fn settle(streams: &Streams, joint: usize) -> anyhow::Result<f64> {
    let mut last = f64::NAN;
    let mut still = 0;
    while still < 12 {
        let sample = streams
            .next(Duration::from_secs(5))?
            .context("no sample came")?;
        if let Received::JointState(sample) = sample {
            let position = sample.position[joint];
            still = if (position - last).abs() < 1e-6 {
                still + 1
            } else {
                0
            };
            last = position;
        }
    }
    Ok(last)
}

/// Every tick waits for its command: the way there and back, and four steps of
/// the physics.
fn lock_step(link: &Link) -> anyhow::Result<Vec<f64>> {
    let streams = link.streams(&[Stream::Clock, Stream::Applied])?;
    let mut commander = link.commander(IdleCommander::NAME, false)?;
    let request = v1::EpisodeStartRequest {
        label: "latency".into(),
        ..Default::default()
    };
    let started: v1::EpisodeStarted =
        link.query(wheelarm_proto::keys::Query::EpisodeStart, &request)?;
    let mut header = started.header.context("a header")?;
    let mut times = Vec::new();
    for _ in 0..600 {
        let sent = Instant::now();
        commander.answer(&header, v1::Command::default())?;
        let mut taken = None;
        loop {
            match streams
                .next(Duration::from_secs(5))?
                .context("no sample came")?
            {
                Received::Applied(_) => taken = Some(sent.elapsed().as_secs_f64()),
                Received::Clock(clock) => {
                    let next = clock.header.unwrap_or_default();
                    if next.episode == header.episode && next.tick > header.tick {
                        header = next;
                        break;
                    }
                }
                _ => {}
            }
        }
        times.extend(taken);
    }
    Ok(times)
}
