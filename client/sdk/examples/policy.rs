//! A policy in lock-step: it sees the state of a control tick and answers for
//! the next six (10 Hz), for three seconds. The simulation waits for it.

use std::error::Error;
use std::time::Duration;

use wheelarm_proto::topic::Sample;
use wheelarm_proto::{TopicId, v1};
use wheelarm_sdk::{Client, Connect, Turn, Turns};

/// Drives gently forward and closes the gripper, from where its knuckle is, rad.
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

/// Thirty answers; how many there were, and where the knuckle is then, rad.
fn act(turns: &mut Turns) -> Result<(u32, f64), Box<dyn Error>> {
    let (mut knuckle, mut answers) = (0.0, 0);
    loop {
        let mut see = |sample| {
            if let Sample::Applied(applied) = sample {
                knuckle = applied.knuckle;
            }
        };
        match turns.next(Duration::from_secs(20), &mut see)? {
            Turn::Answer(_) if answers == 30 => return Ok((answers, knuckle)),
            Turn::Answer(_) => turns.answer(policy(knuckle))?,
            Turn::Refused(refusal) => return Err(refusal.reason.into()),
            Turn::Ended(_) => return Err("somebody else ended the episode".into()),
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
    let link = Client::open(&Connect::to(endpoint, sim))?;
    let mut turns = link.turns("policy", false, &[TopicId::Applied])?;
    let started = link.request(&v1::EpisodeStartRequest {
        label: "policy".to_owned(),
        ..Default::default()
    })?;
    let done = act(&mut turns);
    // Also where it failed: without its policy the episode would go on.
    let stopped = link.stop_episode_of(&started, false);
    let ((answers, knuckle), stopped) = (done?, stopped?);
    let stamp = |header: Option<v1::Header>| header.unwrap_or_default().stamp_nanos as f64 * 1e-9;
    let seconds = stamp(stopped.header) - stamp(started.header);
    println!("{answers} answers, {seconds:.3} s, knuckle at {knuckle:.3} rad");
    Ok(())
}
