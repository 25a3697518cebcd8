//! A policy in lock-step: it receives the state of a control tick and commands the next
//! six ticks (10 Hz) for three seconds. The simulation waits for it.

use std::error::Error;
use std::time::Duration;

use wheelarm_proto::topic::Sample;
use wheelarm_proto::{TopicId, v1};
use wheelarm_sdk::{Client, Connect, Turn, Turns};

/// Drives slowly forward and closes the gripper from its knuckle angle, rad.
fn policy(knuckle: f64) -> v1::Command {
    use v1::gripper_command::Target;
    v1::Command {
        base: Some(v1::BaseCommand {
            linear: 0.1,
            angular: 0.0,
        }),
        gripper: Some(v1::GripperCommand {
            target: Some(Target::Knuckle((knuckle + 0.02).min(0.4))),
            max_force: None,
        }),
        over_ticks: 6,
        device: v1::Device::Policy.into(),
        ..v1::Command::default()
    }
}

/// Sends thirty commands; returns their number and the last knuckle angle, rad.
fn act(turns: &mut Turns) -> Result<(u32, f64), Box<dyn Error>> {
    let (mut knuckle, mut answers) = (0.0, 0);
    loop {
        let mut on_sample = |sample| {
            if let Sample::Applied(applied) = sample {
                knuckle = applied.knuckle;
            }
        };
        match turns.next(Duration::from_secs(20), &mut on_sample)? {
            Turn::Answer(_) if answers == 30 => return Ok((answers, knuckle)),
            Turn::Answer(_) => turns.answer(policy(knuckle))?,
            Turn::Refused(refusal) => return Err(refusal.reason.into()),
            Turn::Ended(_) => return Err("another client ended the episode".into()),
            Turn::Silent(status) => return Err(status.waiting_for.into()),
        }
        answers += 1;
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [endpoint, sim] = words.as_slice() else {
        return Err("give ENDPOINT SIM, for example tcp/127.0.0.1:7447 sim".into());
    };
    let client = Client::open(&Connect::to(endpoint, sim))?;
    let mut turns = client.turns("policy", false, &[TopicId::Applied])?;
    let started = client.request(&v1::EpisodeStartRequest {
        label: "policy".to_owned(),
        ..Default::default()
    })?;
    let done = act(&mut turns);
    // Stop it also after a failure: the episode would go on without its policy.
    let stopped = client.stop_episode_of(&started, false);
    let ((answers, knuckle), stopped) = (done?, stopped?);
    let stamp = |header: Option<v1::Header>| header.unwrap_or_default().stamp_nanos as f64 * 1e-9;
    let seconds = stamp(stopped.header) - stamp(started.header);
    println!("{answers} answers, {seconds:.3} s, knuckle at {knuckle:.3} rad");
    Ok(())
}
