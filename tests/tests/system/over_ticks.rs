//! Commands that last several control ticks, as policies at a lower rate send them.

use wheelarm_proto::topic::Sample;
use wheelarm_proto::{TICKS_PER_CONTROL, TopicId, v1};
use wheelarm_tests::{PATIENCE, Recorder, Server, program};

/// Control ticks of one command: 10 Hz.
const OVER: u32 = 6;
/// Number of commands: two seconds.
const COMMANDS: u64 = 20;

/// Command `k` of a drive forward while the arm moves aside.
fn row(start: &[f64], k: u64) -> v1::Command {
    let part = (k + 1) as f64 / COMMANDS as f64;
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
fn command_over_several_ticks_reaches_its_values_and_replays() {
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
    while sent < COMMANDS || next > 0 {
        match streams.next(PATIENCE).expect("no error").expect("a sample") {
            Sample::Clock(clock) => {
                let header = clock.header.expect("a header");
                if header.episode != episode || header.tick < next {
                    continue;
                }
                if sent == COMMANDS {
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
    assert_eq!(applied.len() as u64, COMMANDS * u64::from(OVER));
    // Velocities grow by the same amount in every tick, across commands.
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
    let Some(v1::arm_command::Target::Joints(applied_joints)) =
        last.arm.as_ref().and_then(|a| a.target.clone())
    else {
        panic!("no joints: {last:?}")
    };
    let row = row(&start, COMMANDS - 1);
    let Some(v1::arm_command::Target::Joints(wanted)) = row.arm.and_then(|a| a.target) else {
        panic!("no joints")
    };
    assert_eq!(
        applied_joints, wanted,
        "the last tick has other joint positions than requested"
    );
    let off = joints[4..10]
        .iter()
        .zip(&wanted.positions)
        .map(|(q, w)| (q - w).abs());
    let off = off.fold(0.0, f64::max);
    println!("joints are {:.2} mrad from the command", 1e3 * off);
    assert!(off < 5e-3, "{off} rad");
    let file = folder.path().join("over.h5");
    let replay = std::process::Command::new(program("wheelarm").expect("the client"))
        .arg("replay")
        .arg(&file)
        .env("WHEELARM_ASSETS", wheelarm_tests::root().join("assets"))
        .output()
        .expect("a replay");
    let output = [replay.stdout, replay.stderr].concat();
    let text = String::from_utf8_lossy(&output).into_owned();
    assert!(
        replay.status.success() && text.contains("hashes equal"),
        "{text}"
    );
}

#[test]
fn commands_over_ticks_are_refused_in_real_time_and_in_the_end_effector_frame() {
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
