//! Latency from sending a command until it is applied, and until the robot moves, while
//! two cameras stream.

use std::time::{Duration, Instant};

use anyhow::Context;
use wheelarm_proto::robot::Roles;
use wheelarm_proto::topic::Sample;
use wheelarm_proto::{CONTROL_HZ, TopicId, v1};
use wheelarm_sdk::{Client, Commander, Streams};
use wheelarm_tests::{IdleCommander, Server};
use zenoh::Wait;

use super::CAMERAS;

/// Commands measured until they are applied, and until motion starts.
const APPLIED: usize = 500;
const MOVES: usize = 60;
/// Threshold of motion, rad: far above the motion of a resting knuckle.
const MOVED: f64 = 2e-4;
/// Longest wait for what a command does.
const LONGEST: Duration = Duration::from_secs(5);

pub fn measure() -> anyhow::Result<()> {
    println!("two cameras of 160x90 at 30 Hz stream meanwhile");
    let server = Server::start("latency", &CAMERAS)?;
    let client = server.client();
    let images = client
        .session()
        .declare_subscriber(client.keys().camera("*"));
    let _subscriber = images
        .callback(|_| {})
        .wait()
        .map_err(|e| anyhow::anyhow!("{e}"))?;
    report("real time, command to applied", applied(&client)?);
    report("real time, command to motion", moved(&client)?);

    let args = [&CAMERAS[..], &["--pacing", "lock-step"]].concat();
    let server = Server::start("answers", &args)?;
    report(
        "lock-step, command to applied",
        lock_step(&server.client())?,
    );
    Ok(())
}

fn report(what: &str, mut seconds: Vec<f64>) {
    seconds.sort_by(f64::total_cmp);
    let at = |share: f64| {
        let place = (share * seconds.len() as f64) as usize;
        1e3 * seconds[place.min(seconds.len() - 1)]
    };
    println!(
        "{what}: median {:.3} ms, p90 {:.3}, p99 {:.3} ms",
        at(0.5),
        at(0.9),
        at(0.99)
    );
}

fn knuckle(radians: f64) -> v1::Command {
    v1::Command {
        gripper: Some(v1::GripperCommand {
            target: Some(v1::gripper_command::Target::Knuckle(radians)),
            max_force: None,
        }),
        ..Default::default()
    }
}

/// Sent at any time of the control tick, as a person's commands are.
fn sent_at_any_time(
    commander: &mut Commander,
    streams: &Streams,
    i: usize,
    target: f64,
) -> anyhow::Result<Instant> {
    std::thread::sleep(Duration::from_micros((i as u64 * 7919) % 16_667));
    let newest_header = newest(streams)?;
    let sent = Instant::now();
    send(commander, &newest_header, target)?;
    Ok(sent)
}

/// Header of the newest sample; waits for one where none has come.
fn newest(streams: &Streams) -> anyhow::Result<v1::Header> {
    let mut newest_header = None;
    while let Some(sample) = streams.next(Duration::ZERO)? {
        newest_header = sample.header().cloned();
    }
    if newest_header.is_none() {
        let sample = streams.next(LONGEST)?.context("no sample came")?;
        newest_header = sample.header().cloned();
    }
    newest_header.context("a sample without a header")
}

/// An error where `sent` is too long ago: a command was refused or got lost.
fn in_time(sent: Instant) -> anyhow::Result<()> {
    anyhow::ensure!(
        sent.elapsed() < LONGEST,
        "a command was not applied within {LONGEST:?}; the server's log says whether it was refused"
    );
    Ok(())
}

fn applied(client: &Client) -> anyhow::Result<Vec<f64>> {
    let streams = client.streams(&[TopicId::Applied])?;
    let mut commander = client.commander("bench", false)?;
    let mut times = Vec::new();
    for i in 0..APPLIED {
        let sent = sent_at_any_time(&mut commander, &streams, i, 0.2)?;
        loop {
            in_time(sent)?;
            let sample = streams.next(LONGEST)?;
            if let Sample::Applied(sample) = sample.context("no sample came")?
                && sample.gripper.is_some()
            {
                times.push(sent.elapsed().as_secs_f64());
                break;
            }
        }
        // A person's commands are further apart than ticks. Who sends one with
        // every tick has used the lead up, and waits for the schedule.
        std::thread::sleep(Duration::from_millis(17));
    }
    Ok(times)
}

/// The gripper opens and closes.
fn moved(client: &Client) -> anyhow::Result<Vec<f64>> {
    let streams = client.streams(&[TopicId::JointState])?;
    let mut commander = client.commander("bench", false)?;
    let robot = client.request(&v1::SceneRequest {})?.robot;
    let joint = Roles::find(&robot.context("the robot")?)?.knuckle;
    let mut times = Vec::new();
    for i in 0..MOVES {
        let rest = settle(&streams, joint)?;
        let sent = sent_at_any_time(&mut commander, &streams, i, [0.5, 0.2][i % 2])?;
        loop {
            in_time(sent)?;
            let sample = streams.next(LONGEST)?;
            if let Sample::JointState(sample) = sample.context("no sample came")?
                && (sample.positions[joint] - rest).abs() > MOVED
            {
                times.push(sent.elapsed().as_secs_f64());
                break;
            }
        }
    }
    Ok(times)
}

fn send(commander: &mut Commander, newest_header: &v1::Header, target: f64) -> anyhow::Result<()> {
    Ok(commander.answer(newest_header, knuckle(target))?)
}

/// Waits until the joint rests; where it does.
fn settle(streams: &Streams, joint: usize) -> anyhow::Result<f64> {
    let mut last = f64::NAN;
    let mut still = 0;
    while still < 12 {
        let sample = streams
            .next(Duration::from_secs(5))?
            .context("no sample came")?;
        if let Sample::JointState(sample) = sample {
            let position = sample.positions[joint];
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

/// Every tick waits for its command; the commander keeps the pace of the clock,
/// so that the cameras stream at 30 Hz here too.
fn lock_step(client: &Client) -> anyhow::Result<Vec<f64>> {
    let streams = client.streams(&[TopicId::Clock, TopicId::Applied])?;
    let mut commander = client.commander(IdleCommander::NAME, false)?;
    let request = v1::EpisodeStartRequest {
        label: "latency".into(),
        ..Default::default()
    };
    let started: v1::EpisodeStarted = client.request(&request)?;
    let mut header = started.header.context("a header")?;
    let mut times = Vec::new();
    let mut due = Instant::now();
    for _ in 0..600 {
        due = (due + Duration::from_secs(1) / CONTROL_HZ as u32).max(Instant::now());
        std::thread::sleep(due - Instant::now());
        let sent = Instant::now();
        commander.answer(&header, v1::Command::default())?;
        let mut taken = None;
        loop {
            match streams
                .next(Duration::from_secs(5))?
                .context("no sample came")?
            {
                Sample::Applied(_) => taken = Some(sent.elapsed().as_secs_f64()),
                Sample::Clock(clock) => {
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
