//! One answer for several control ticks, as policies at a lower rate send it.

use wheelarm_proto::topic::Sample;
use wheelarm_proto::{TICKS_PER_CONTROL, TopicId, v1};
use wheelarm_tests::{PATIENCE, Recorder, Server, program};

/// Control ticks of one answer: 10 Hz.
const OVER: u32 = 6;
/// Answers: two seconds.
const ANSWERS: u64 = 20;

/// Row `k` of a drive forward with the hand moving aside.
fn row(start: &[f64], k: u64) -> v1::Command {
    let part = (k + 1) as f64 / ANSWERS as f64;
    let joints = start.iter().enumerate();
    let positions = joints.map(|(i, q)| q + 0.05 * part * (i as f64 - 2.0));
    v1::Command {
        arm: Some(v1::ArmCommand {
            target: Some(v1::arm_command::Target::Joints(v1::JointTarget {
                positions: positions.collect(),
            })),
        }),
        base: Some(v1::BaseCommand {
            linear: 0.2 * part,
            angular: 0.1 * part,
        }),
        gripper: Some(v1::GripperCommand {
            target: Some(v1::gripper_command::Target::Knuckle(0.4 * part)),
            max_force: None,
        }),
        over_ticks: OVER,
        device: v1::Device::Policy.into(),
        mode: v1::InputMode::Stream.into(),
        ..Default::default()
    }
}

#[test]
fn one_answer_stands_for_several_ticks_reaches_its_values_and_replays() {
    let args = ["--no-cameras", "--pacing", "lock-step"];
    let server = Server::start("over", &args).expect("a server");
    let client = server.client();
    let folder = tempfile::tempdir().expect("a folder");
    let recorder = Recorder::start(&server, "r", folder.path(), &["--episodes", "1"]);
    let mut policy = client.commander("policy", false).expect("control");
    let streams = client
        .streams(&[
            TopicId::Clock,
            TopicId::Applied,
            TopicId::JointState,
            TopicId::Refusal,
        ])
        .expect("streams");
    let request = v1::EpisodeStartRequest {
        label: "over".into(),
        require_recorders: 1,
        ..Default::default()
    };
    let started = client.request(&request).expect("an episode");
    let episode = started.header.expect("a header").episode;
    let (mut sent, mut next, mut start) = (0, 0, None);
    let (mut applied, mut joints): (Vec<v1::Applied>, Vec<f64>) = (Vec::new(), Vec::new());
    while sent < ANSWERS || next > 0 {
        match streams.next(PATIENCE).expect("no error").expect("a sample") {
            Sample::Clock(clock) => {
                let header = clock.header.expect("a header");
                if header.episode != episode || header.tick < next {
                    continue;
                }
                if sent == ANSWERS {
                    break;
                }
                let start: &Vec<f64> = start.get_or_insert_with(|| joints[4..10].to_vec());
                policy.answer(&header, row(start, sent)).expect("an answer");
                sent += 1;
                next = header.tick + u64::from(OVER) * TICKS_PER_CONTROL;
            }
            Sample::Applied(sample)
                if sample.header.as_ref().is_some_and(|h| h.episode == episode) =>
            {
                applied.push(sample);
            }
            Sample::JointState(sample) => joints = sample.positions,
            Sample::Refusal(refusal) => panic!("refused: {}", refusal.reason),
            _ => {}
        }
    }
    let _: v1::EpisodeStopped = client
        .request(&v1::EpisodeStopRequest::default())
        .expect("its end");
    println!("{}", recorder.finish());
    assert_eq!(applied.len() as u64, ANSWERS * u64::from(OVER));
    // Velocities grow by the same in every tick: straight through all answers.
    let speeds: Vec<f64> = applied
        .iter()
        .map(|a| a.base.expect("a speed").linear)
        .collect();
    for (i, speed) in speeds.iter().enumerate() {
        let straight = 0.2 * (i + 1) as f64 / speeds.len() as f64;
        assert!(
            (speed - straight).abs() < 1e-3,
            "tick {i}: {speed} for {straight}"
        );
    }
    let start = start.expect("a start");
    let last = applied.last().expect("a last one");
    let Some(v1::arm_command::Target::Joints(asked)) =
        last.arm.as_ref().and_then(|a| a.target.clone())
    else {
        panic!("no joints: {last:?}")
    };
    let row = row(&start, ANSWERS - 1);
    let Some(v1::arm_command::Target::Joints(wanted)) = row.arm.and_then(|a| a.target) else {
        panic!("no joints")
    };
    assert_eq!(
        asked, wanted,
        "the last tick has what was asked, to the bit"
    );
    let off = joints[4..10]
        .iter()
        .zip(&wanted.positions)
        .map(|(q, w)| (q - w).abs());
    let off = off.fold(0.0, f64::max);
    println!("joints are {:.2} mrad from what was asked", 1e3 * off);
    assert!(off < 5e-3, "{off} rad");
    let file = folder.path().join("over.h5");
    let replay = std::process::Command::new(program("wheelarm").expect("the client"))
        .arg("replay")
        .arg(&file)
        .env("WHEELARM_ASSETS", wheelarm_tests::root().join("assets"))
        .output()
        .expect("a replay");
    let said = [replay.stdout, replay.stderr].concat();
    let text = String::from_utf8_lossy(&said).into_owned();
    assert!(
        replay.status.success() && text.contains("hashes equal"),
        "{text}"
    );
}

#[test]
fn in_real_time_and_in_the_hands_own_frame_it_is_refused() {
    let server = Server::start("over-real", &["--no-cameras"]).expect("a server");
    let client = server.client();
    let mut hand = client.commander("hand", false).expect("control");
    let streams = client
        .streams(&[TopicId::Clock, TopicId::Refusal])
        .expect("streams");
    let mut refused = 0;
    while refused < 2 {
        match streams.next(PATIENCE).expect("no error").expect("a sample") {
            Sample::Clock(clock) => {
                let mut command = row(&[0.0; 6], 0);
                if refused == 1 {
                    command.arm = Some(v1::ArmCommand {
                        target: Some(v1::arm_command::Target::Pose(v1::CartesianTarget {
                            frame: v1::CommandFrame::EndEffector.into(),
                            pose: Some(v1::Pose {
                                position: Some(v1::Vector3::default()),
                                orientation: Some(v1::Quaternion {
                                    w: 1.0,
                                    ..Default::default()
                                }),
                            }),
                        })),
                    });
                }
                let header = clock.header.expect("a header");
                hand.answer(&header, command).expect("a command");
            }
            Sample::Refusal(refusal) => {
                assert_eq!(refusal.code(), v1::RefusalCode::Invalid);
                let cure = ["lock-step", "base_link"][refused];
                if refusal.reason.contains(cure) {
                    refused += 1;
                }
            }
            _ => {}
        }
    }
}
