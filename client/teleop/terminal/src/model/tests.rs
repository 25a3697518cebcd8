//! Keys of an operator and their effects, without terminal and network.

use wheelarm_proto::topic::Sample;
use wheelarm_proto::v1;

use super::*;
use crate::described::robot as described_robot;

const ANNA: &str = "anna";

fn header(tick: u64, episode: u64) -> v1::Header {
    v1::Header {
        run_id: "run".to_owned(),
        tick,
        stamp_nanos: tick * 1_000_000_000 / 240,
        episode,
        ..Default::default()
    }
}

fn status(holder: &str) -> v1::Status {
    v1::Status {
        header: Some(header(240, 0)),
        holder: holder.to_owned(),
        scenario: Some(v1::Scenario {
            task: Some("pick_mustard".to_owned()),
            seed: Some(5),
            instruction: Some("Pick up the mustard".to_owned()),
            ..Default::default()
        }),
        ..Default::default()
    }
}

fn pose(x: f64, y: f64, z: f64) -> v1::Pose {
    v1::Pose {
        position: Some(v1::Vector3 { x, y, z }),
        orientation: Some(v1::Quaternion {
            w: 1.0,
            ..Default::default()
        }),
    }
}

/// Connected, in control, with an arm at 0.5 m ahead of its base.
fn operating() -> Model {
    let mut model = Model::new(Settings {
        commander: ANNA.to_owned(),
        ..Settings::default()
    });
    let requested = model.connected(0.0);
    assert_eq!(
        requested,
        [Effect::Operation(Operation::Lease { take: false })]
    );
    model.done(Done::Lease(Ok(())), 0.0);
    model.status(status(ANNA), 0.002, 0.0);
    model.robot(&described_robot());
    let mut frames = vec![v1::FramePose::default(); 2];
    frames[0].pose = Some(pose(-0.5, 0.0, 0.5));
    let header = None;
    model.sample(Sample::Pose(v1::PoseSet { header, frames }), 0.0);
    let applied = v1::Applied {
        desired_pose: Some(pose(-0.5, 0.0, 0.5)),
        ..Default::default()
    };
    model.sample(Sample::Applied(applied), 0.0);
    model
}

fn press(model: &mut Model, keys: &str, now: f64) -> Vec<Effect> {
    let keys = keys.chars().map(Key::Char);
    keys.flat_map(|key| model.key(&key, now)).collect()
}

fn commands(effects: &[Effect]) -> Vec<&v1::Command> {
    let sent = effects.iter().filter_map(|effect| match effect {
        Effect::Send(_, command) => Some(&**command),
        _ => None,
    });
    sent.collect()
}

fn bases(model: &mut Model, from: f64, to: f64) -> Vec<[f64; 2]> {
    let mut sent = Vec::new();
    let mut now = from;
    while now < to {
        let effects = model.tick(now);
        let base = commands(&effects).into_iter().filter_map(|c| c.base);
        sent.extend(base.map(|b| [b.linear, b.angular]));
        now += 0.01;
    }
    sent
}

fn message(model: &Model) -> &str {
    model.message.as_ref().map_or("", |m| m.text.as_str())
}

#[test]
fn a_latched_key_drives_until_k_and_arm_keys_leave_the_chair_running() {
    let mut model = operating();
    let effects = press(&mut model, "i", 1.0);
    let first = commands(&effects)[0];
    assert_eq!(first.base.map(|b| b.linear), Some(0.5));
    assert_eq!(first.phase(), v1::Phase::Navigating);
    assert!(bases(&mut model, 1.05, 2.0).len() >= 17);
    let effects = press(&mut model, "v", 2.0);
    assert!(commands(&effects)[0].arm.is_some());
    assert!(!bases(&mut model, 2.05, 3.0).is_empty());
    press(&mut model, "k", 3.0);
    let stops = bases(&mut model, 3.0, 5.0);
    assert!(stops.iter().all(|b| *b == [0.0, 0.0]) && stops.len() <= 3);
}

#[test]
fn every_key_without_a_function_stops_a_latched_chair() {
    let unknown = [
        Key::Char('K'),
        Key::Char('л'),
        Key::Char('κ'),
        Key::Char('ｋ'),
        Key::Char('Л'),
        Key::Char('5'),
        Key::Other,
        Key::Enter,
        Key::Tab,
        Key::Up,
        Key::Delete,
        Key::Ctrl('k'),
        Key::Paste("k".to_owned()),
    ];
    for key in unknown {
        let mut model = operating();
        press(&mut model, "j", 1.0);
        assert!(!bases(&mut model, 1.05, 1.5).is_empty());
        let effects = model.key(&key, 1.5);
        let first = commands(&effects).into_iter().find_map(|c| c.base);
        assert_eq!(
            first.map(|b| (b.linear, b.angular)),
            Some((0.0, 0.0)),
            "{key:?}"
        );
        let stops = bases(&mut model, 1.5, 3.0);
        assert!(stops.iter().all(|b| *b == [0.0, 0.0]), "{key:?}");
        assert!(!message(&model).is_empty(), "{key:?}");
    }
    // A key that closes the help stops the robot as well, and so does one in a form.
    let mut model = operating();
    press(&mut model, "j?x", 1.0);
    assert!(!model.help && model.drive.direction.is_none());
    press(&mut model, "j", 2.0);
    model.done(Done::Tasks(Ok(Vec::new())), 2.1);
    assert!(model.form.is_some() && model.drive.direction.is_none());
    // Keys with a function leave the chair running.
    let mut model = operating();
    press(&mut model, "j", 1.0);
    press(&mut model, "vwqr- ", 1.1);
    model.key(&Key::Ctrl('l'), 1.1);
    assert!(model.drive.direction.is_some());
}

#[test]
fn v_moves_the_hand_forward_by_the_originals_step() {
    let mut model = operating();
    let effects = press(&mut model, "v", 1.0);
    let arm = commands(&effects)[0].arm.clone().unwrap();
    let Some(v1::arm_command::Target::Pose(target)) = arm.target else {
        panic!("{arm:?}")
    };
    let position = target.pose.unwrap().position.unwrap();
    assert!((position.x + 0.525).abs() < 1e-12, "{position:?}");
    press(&mut model, " ", 1.1);
    assert!(model.arm.turning);
}

#[test]
fn typing_and_pasting_never_moves_the_robot() {
    let mut model = operating();
    press(&mut model, "i", 1.0);
    let effects = press(&mut model, "s", 1.5);
    assert!(
        commands(&effects)
            .iter()
            .any(|c| c.base.is_some_and(|b| b.linear == 0.0))
    );
    let typed = press(&mut model, "jump into the ravine, ok", 2.0);
    assert!(typed.is_empty(), "{typed:?}");
    assert!(bases(&mut model, 2.0, 3.0).iter().all(|b| *b == [0.0, 0.0]));
    let effects = model.key(&Key::Enter, 3.0);
    let [Effect::Operation(Operation::Start(start))] = &effects[..] else {
        panic!("{effects:?}")
    };
    assert!(start.instruction.ends_with("jump into the ravine, ok"));
    assert_eq!(start.label, "pick_mustard-seed5-1");
    let pasted = model.key(&Key::Paste("iiii".to_owned()), 4.0);
    assert!(pasted.is_empty() && bases(&mut model, 4.0, 5.0).is_empty());
}

#[test]
fn keys_without_a_connection_do_nothing_and_show_a_message() {
    let mut model = operating();
    press(&mut model, "i", 1.0);
    model.lost("the server has gone", 1.5);
    assert!(bases(&mut model, 1.5, 3.0).is_empty());
    for key in ["i", "v", "r", "k"] {
        assert!(press(&mut model, key, 3.0).is_empty());
        assert!(
            message(&model).contains("nothing is sent"),
            "{}",
            message(&model)
        );
    }
    // After reconnecting, the chair moves only after a fresh press.
    model.connected(4.0);
    model.done(Done::Lease(Ok(())), 4.1);
    model.status(status(ANNA), 0.002, 4.1);
    assert!(bases(&mut model, 4.1, 5.0).is_empty());
    assert!(!press(&mut model, "i", 5.0).is_empty());
}

#[test]
fn without_control_nothing_is_sent_and_only_an_explicit_key_takes_it() {
    let mut model = operating();
    press(&mut model, "i", 1.0);
    // A status from before control was granted has no effect.
    assert!(model.status(status(""), 0.002, 1.1).is_empty());
    assert_eq!(model.control, Control::Ours);
    model.status(status("bernd"), 0.002, 2.5);
    assert_eq!(model.control, Control::Held("bernd".to_owned()));
    assert!(bases(&mut model, 2.5, 3.0).is_empty());
    assert!(press(&mut model, "v", 3.0).is_empty());
    assert!(
        message(&model).contains("bernd holds control"),
        "{}",
        message(&model)
    );
    assert!(press(&mut model, "!", 3.1).is_empty());
    assert!(matches!(&model.form, Some(Form::Take { holder }) if holder == "bernd"));
    let effects = press(&mut model, "y", 3.2);
    assert_eq!(
        effects,
        [Effect::Operation(Operation::Lease { take: true })]
    );
}

#[test]
fn an_episode_is_discarded_only_after_a_second_press() {
    let mut model = operating();
    let started = v1::EpisodeStarted {
        header: Some(header(240, 7)),
        label: "try-1".to_owned(),
        instruction: "go".to_owned(),
        ..Default::default()
    };
    model.done(Done::Started(Ok(Box::new(started))), 1.0);
    // Commands carry the new number without waiting for the next status.
    let effects = press(&mut model, "v", 1.1);
    let Effect::Send(sent, _) = &effects[0] else {
        panic!("{effects:?}")
    };
    assert_eq!(sent.episode, 7);
    assert!(model.key(&Key::Left, 2.0).is_empty());
    assert!(model.key(&Key::Left, 9.0).is_empty(), "too late to confirm");
    let effects = model.key(&Key::Left, 10.0);
    let redo = effects.iter().find_map(|e| match e {
        Effect::Operation(Operation::Redo(start)) => Some(start.clone()),
        _ => None,
    });
    assert_eq!(redo.map(|s| s.label), Some("try-1".to_owned()));
}

#[test]
fn leaving_during_an_episode_asks_for_its_end() {
    let mut model = operating();
    let started = v1::EpisodeStarted {
        header: Some(header(240, 7)),
        ..Default::default()
    };
    model.done(Done::Started(Ok(Box::new(started))), 1.0);
    let effects = model.key(&Key::Ctrl('c'), 2.0);
    assert!(!effects.contains(&Effect::Quit) && model.form == Some(Form::Leave));
    let effects = press(&mut model, "s", 2.5);
    let stop = Effect::Operation(Operation::Stop { discard: false });
    assert_eq!(effects, [stop]);
    let done = Done::Stopped(Ok(Box::default()));
    assert_eq!(model.done(done, 3.0), [Effect::Quit]);
}

#[test]
fn a_refusal_is_shown_with_its_reason_and_an_arm_problem_resets_the_target() {
    let mut model = operating();
    let refusal = v1::Refusal {
        commander: ANNA.to_owned(),
        reason: "too fast".to_owned(),
        ..Default::default()
    };
    model.sample(Sample::Refusal(refusal), 1.0);
    assert_eq!(model.refused, 1);
    assert!(message(&model).contains("too fast"));
    press(&mut model, "vv", 1.0);
    let stuck = v1::Applied {
        desired_pose: Some(pose(-0.5, 0.0, 0.5)),
        arm_problem: "out of reach".to_owned(),
        ..Default::default()
    };
    model.sample(Sample::Applied(stuck), 1.1);
    assert!(message(&model).contains("out of reach"));
    let effects = press(&mut model, "n", 1.2);
    let arm = commands(&effects)[0].arm.clone().unwrap();
    let Some(v1::arm_command::Target::Pose(target)) = arm.target else {
        panic!("{arm:?}")
    };
    // From the measured pose of the arm, not from the unreached target.
    let x = target.pose.unwrap().position.unwrap().x;
    assert!((x + 0.475).abs() < 1e-12, "{x}");
}

#[test]
fn the_code_of_a_refusal_not_its_text_triggers_a_new_control_request() {
    let refusal = |code: v1::RefusalCode| v1::Refusal {
        commander: ANNA.to_owned(),
        reason: "out of control".to_owned(),
        code: code.into(),
        ..Default::default()
    };
    let mut model = operating();
    let effects = model.sample(Sample::Refusal(refusal(v1::RefusalCode::Invalid)), 5.0);
    assert_eq!(effects, []);
    let effects = model.sample(Sample::Refusal(refusal(v1::RefusalCode::NoControl)), 5.0);
    assert_eq!(
        effects,
        [Effect::Operation(Operation::Lease { take: false })]
    );
}

#[test]
fn in_lock_step_every_control_tick_is_answered_once_and_not_faster_than_time() {
    let mut model = operating();
    let mut locked = status(ANNA);
    if let Some(scenario) = &mut locked.scenario {
        scenario.pacing = v1::Pacing::LockStep.into();
    }
    model.status(locked, 0.002, 0.5);
    let started = v1::EpisodeStarted {
        header: Some(header(240, 7)),
        ..Default::default()
    };
    model.done(Done::Started(Ok(Box::new(started))), 1.0);
    let (mut tick, mut answers, mut now) = (240, 0, 1.0);
    while now < 2.0 {
        // The server answers at once: simulation time must not run away.
        let clock = v1::Clock {
            header: Some(header(tick, 7)),
            real_time_factor: 1.0,
        };
        model.sample(Sample::Clock(clock), now);
        let sent = model.tick(now);
        for effect in &sent {
            let Effect::Send(header, _) = effect else {
                panic!("{effect:?}")
            };
            assert_eq!(header.tick, tick);
            tick += 4;
            answers += 1;
        }
        now += 0.001;
    }
    assert!(
        (55..=62).contains(&answers),
        "{answers} answers in a second"
    );
}
