//! Pages, control and episodes, without sockets and without a server.

use serde_json::Value;
use wheelarm_proto::geometry;
use wheelarm_proto::v1;

use super::*;
use crate::pending_operation::Done;
use crate::protocol::{self, Held, Request};
use crate::visitor::Role;
use crate::watch::tests::described;

fn visitor(name: &str, role: Role) -> Visitor {
    Visitor {
        name: name.to_owned(),
        role,
    }
}

fn header(tick: u64) -> v1::Header {
    v1::Header {
        run_id: "run".to_owned(),
        tick,
        episode: 3,
        ..Default::default()
    }
}

fn status(holder: &str) -> v1::Status {
    v1::Status {
        header: Some(header(2400)),
        holder: holder.to_owned(),
        scenario: Some(v1::Scenario {
            task: Some("pick_mustard".to_owned()),
            seed: Some(5),
            cameras: vec![v1::CameraSetting {
                name: "eye".to_owned(),
                ..Default::default()
            }],
            ..Default::default()
        }),
        ..Default::default()
    }
}

/// Connected; anna and ben have pages with all sockets, carl watches.
fn open() -> Model {
    let mut model = Model::default();
    model.connected(0.0);
    model.robot(&described());
    model.status(status(""), 0.001, 0.0);
    for (page, who) in [("a", "anna"), ("b", "ben")] {
        let visitor = visitor(who, Role::Operator);
        for socket in [
            Socket::State,
            Socket::Video,
            Socket::Control(0),
            Socket::Control(1),
        ] {
            model.joined(page, &visitor, socket, 0.0);
        }
    }
    model.joined("c", &visitor("carl", Role::Viewer), Socket::State, 0.0);
    model.situation.base_from_tool = Some(nalgebra::Isometry3::translation(-0.5, 0.0, 0.5));
    model.situation.house_from_chair = Some(nalgebra::Isometry3::identity());
    model.situation.applied = Some(v1::Applied {
        desired_pose: model.situation.base_from_tool.as_ref().map(geometry::pose),
        ..Default::default()
    });
    model
}

fn request(model: &mut Model, page: &str, text: &str, time: f64) -> Vec<Effect> {
    let request: Request = protocol::read(&format!(r#"{{"t":"ask","id":7,{text}}}"#)).unwrap();
    model.handle_request(page, &request, time)
}

/// As [`open`], with anna in control.
fn driving() -> Model {
    let mut model = open();
    let effects = request(&mut model, "a", r#""ask":"lease.ask""#, 0.0);
    let lease = Effect::Operation(Operation::Lease { take: false }, "anna".to_owned());
    assert!(effects.contains(&lease), "{effects:?}");
    let effects = model.done(Done::Lease(Ok(())), 0.1);
    assert_eq!(answers(&effects)["mine"], true);
    model.status(status("anna"), 0.001, 0.1);
    model
}

fn answers(effects: &[Effect]) -> Value {
    let message = effects.iter().find_map(|effect| match effect {
        Effect::Say(_, message) if message["t"] == "answer" => Some(message.clone()),
        _ => None,
    });
    message.unwrap_or_default()
}

fn notes<'a>(effects: &'a [Effect], page: &str) -> Vec<&'a str> {
    let message = effects.iter().filter_map(|effect| match effect {
        Effect::Say(to, message) if to == page => message["text"].as_str(),
        _ => None,
    });
    message.collect()
}

fn sent(effects: &[Effect]) -> Vec<&v1::Command> {
    let sent = effects.iter().filter_map(|effect| match effect {
        Effect::Send(_, command) => Some(&**command),
        _ => None,
    });
    sent.collect()
}

fn intent(seq: u32, epoch: u32, chair: f64) -> Intent {
    Intent {
        seq,
        epoch,
        shown: Some(2390),
        ms: 0.0,
        device: v1::Device::Keyboard,
        mode: v1::InputMode::Hold,
        speed: 3,
        action: Action::Drive(Held {
            chair: [chair, 0.0],
            ..Held::default()
        }),
    }
}

fn stop(seq: u32) -> Intent {
    Intent {
        action: Action::Stop,
        ..intent(seq, 1, 0.0)
    }
}

fn drives(effects: &[Effect]) -> bool {
    sent(effects)
        .iter()
        .any(|c| wheelarm_proto::check::drives(c))
}

fn stops(effects: &[Effect]) -> bool {
    sent(effects)
        .iter()
        .any(|c| wheelarm_proto::check::stops(c))
}

#[test]
fn only_the_page_in_control_drives_and_any_operator_stops() {
    let mut model = driving();
    let effects = model.intent("a", &intent(1, 1, 1.0), 0.2);
    assert!(drives(&effects));
    let Effect::Send(header, _) = &effects[0] else {
        panic!("{effects:?}");
    };
    assert_eq!((header.tick, header.episode), (2390, 3));
    let refused = model.intent("b", &intent(1, 1, 1.0), 0.2);
    assert!(sent(&refused).is_empty(), "{refused:?}");
    assert!(model.intent("c", &intent(1, 1, 1.0), 0.2).is_empty());
    assert!(model.intent("c", &stop(2), 0.2).is_empty(), "a viewer");
    assert!(model.intent("unknown", &intent(1, 1, 1.0), 0.2).is_empty());
    let effects = model.intent("b", &stop(2), 0.25);
    assert!(stops(&effects));
    assert!(
        notes(&effects, "a")
            .iter()
            .any(|n| n.contains("ben stopped")),
        "{effects:?}"
    );
    assert!(
        !drives(&model.intent("a", &intent(2, 1, 1.0), 0.3)),
        "the same press"
    );
    assert!(drives(&model.intent("a", &intent(3, 2, 1.0), 0.3)));
}

#[test]
fn control_is_requested_taken_and_given() {
    let mut model = driving();
    model.intent("a", &intent(1, 1, 1.0), 0.2);
    let effects = request(&mut model, "b", r#""ask":"lease.ask""#, 0.3);
    assert_eq!(answers(&effects)["ok"], false);
    assert_eq!(notes(&effects, "a"), ["ben asks for control"]);
    assert_eq!(model.control_requests, ["ben"]);
    assert!(
        drives(&model.intent("a", &intent(2, 1, 1.0), 0.3)),
        "a request moves nothing"
    );
    // Taking control stops all motion and notifies the former holder.
    let effects = request(&mut model, "b", r#""ask":"lease.take""#, 0.4);
    assert!(stops(&effects), "{effects:?}");
    assert!(notes(&effects, "a").contains(&"ben took control"));
    let lease = Effect::Operation(Operation::Lease { take: true }, "ben".to_owned());
    assert!(effects.contains(&lease));
    assert!(!drives(&model.intent("a", &intent(3, 2, 1.0), 0.4)));
    let effects = model.done(Done::Lease(Ok(())), 0.5);
    assert_eq!(answers(&effects)["mine"], true);
    assert!(model.control_requests.is_empty());
    assert!(!drives(&model.intent("a", &intent(4, 3, 1.0), 0.5)));
    assert!(drives(&model.intent("b", &intent(5, 9, 1.0), 0.5)));
    let effects = request(&mut model, "b", r#""ask":"lease.give","to":"anna""#, 0.6);
    assert!(stops(&effects) && effects.contains(&Effect::Release));
    assert!(notes(&effects, "a").iter().any(|n| n.contains("offered")));
    assert!(!drives(&model.intent("b", &intent(6, 10, 1.0), 0.6)));
    // A viewer never gets it.
    let effects = request(&mut model, "c", r#""ask":"lease.take""#, 0.7);
    assert_eq!(answers(&effects)["ok"], false);
    assert!(effects.iter().all(|e| matches!(e, Effect::Say(..))));
}

#[test]
fn control_that_another_client_takes_at_the_server_is_lost_at_once() {
    let mut model = driving();
    model.intent("a", &intent(1, 1, 1.0), 4.9);
    let effects = model.status(status("operator"), 0.001, 5.0);
    assert!(effects.contains(&Effect::Release), "{effects:?}");
    assert!(notes(&effects, "a").contains(&"operator took control"));
    assert!(!drives(&model.intent("a", &intent(2, 1, 1.0), 5.1)));
    assert!(!drives(&model.intent("a", &intent(3, 2, 1.0), 5.1)));
    // A status from before control was granted does not revoke it.
    let mut model = driving();
    assert!(model.status(status(""), 0.001, 0.5).is_empty());
    assert!(drives(&model.intent("a", &intent(1, 1, 1.0), 0.6)));
}

#[test]
fn stop_takes_control_from_a_program_and_brakes() {
    let mut model = open();
    model.status(status("policy"), 0.001, 0.1);
    model.intent("c", &stop(1), 0.2);
    assert_eq!(
        model.control,
        Control::None,
        "a stop of a viewer has no effect"
    );
    let take = Effect::Operation(Operation::Lease { take: true }, "ben".to_owned());
    let effects = model.intent("b", &stop(1), 0.2);
    assert!(effects.contains(&take), "{effects:?}");
    assert!(notes(&effects, "b").iter().any(|n| n.contains("policy")));
    // A second press before the server has answered sends one request.
    let effects = model.intent("b", &stop(2), 0.25);
    assert!(!effects.contains(&take), "{effects:?}");
    let effects = model.done(Done::Lease(Ok(())), 0.3);
    assert!(stops(&effects), "{effects:?}");
    assert_eq!(model.control.page(), Some("b"));
    // Control is free: no holder has to be interrupted.
    let mut model = open();
    let effects = model.intent("b", &stop(1), 0.2);
    assert!(!effects.contains(&take), "{effects:?}");
}

#[test]
fn both_lanes_lost_stop_the_chair_and_one_does_not() {
    let mut model = driving();
    model.intent("a", &intent(1, 1, 1.0), 0.2);
    assert!(model.left("a", Socket::Control(0), 0.25).is_empty());
    assert!(drives(&model.intent("a", &intent(2, 1, 1.0), 0.3)));
    let effects = model.left("a", Socket::Control(1), 0.35);
    assert!(stops(&effects));
    model.joined(
        "a",
        &visitor("anna", Role::Operator),
        Socket::Control(0),
        0.5,
    );
    assert!(!drives(&model.intent("a", &intent(3, 1, 1.0), 0.6)));
    assert!(drives(&model.intent("a", &intent(4, 2, 1.0), 0.6)));
}

#[test]
fn a_page_that_stays_away_loses_control() {
    let mut model = driving();
    for socket in [
        Socket::State,
        Socket::Video,
        Socket::Control(0),
        Socket::Control(1),
    ] {
        model.left("a", socket, 1.0);
    }
    assert!(!model.tick(5.0).contains(&Effect::Release));
    assert_eq!(model.control.page(), Some("a"));
    assert!(model.tick(12.0).contains(&Effect::Release));
    assert_eq!(model.control, Control::None);
}

#[test]
fn a_reloaded_page_gets_control_at_once() {
    let mut model = driving();
    for socket in [
        Socket::State,
        Socket::Video,
        Socket::Control(0),
        Socket::Control(1),
    ] {
        model.left("a", socket, 1.0);
    }
    model.joined("a2", &visitor("anna", Role::Operator), Socket::State, 1.5);
    model.joined(
        "a2",
        &visitor("anna", Role::Operator),
        Socket::Control(0),
        1.5,
    );
    let effects = request(&mut model, "a2", r#""ask":"lease.ask""#, 1.6);
    assert_eq!(answers(&effects)["mine"], true);
    assert!(drives(&model.intent("a2", &intent(1, 1, 1.0), 1.7)));
}

#[test]
fn driving_is_rejected_in_lock_step() {
    let mut model = driving();
    let mut newest = status("anna");
    if let Some(scenario) = &mut newest.scenario {
        scenario.pacing = v1::Pacing::LockStep.into();
    }
    newest.episode = Some(v1::EpisodeStarted::default());
    model.status(newest, 0.001, 0.1);
    let effects = model.intent("a", &intent(1, 1, 1.0), 0.2);
    assert!(sent(&effects).is_empty(), "{effects:?}");
    assert!(
        effects
            .iter()
            .any(|e| matches!(e, Effect::Say(_, s) if s["code"] == "LOCK_STEP"))
    );
}

#[test]
fn a_lost_connection_moves_nothing_when_it_returns() {
    let mut model = driving();
    model.intent("a", &intent(1, 1, 1.0), 0.2);
    model.lost("the server has gone", 0.3);
    assert!(sent(&model.intent("a", &intent(2, 2, 1.0), 0.4)).is_empty());
    let effects = model.connected(3.0);
    let lease = Effect::Operation(Operation::Lease { take: false }, "anna".to_owned());
    assert_eq!(effects, [lease]);
    model.done(Done::Lease(Ok(())), 3.1);
    assert!(
        !drives(&model.intent("a", &intent(3, 2, 1.0), 3.2)),
        "an old press"
    );
    assert!(drives(&model.intent("a", &intent(4, 3, 1.0), 3.2)));
}

#[test]
fn a_refusal_and_a_contact_end_the_press_and_are_reported() {
    let mut model = driving();
    model.intent("a", &intent(7, 1, 1.0), 0.2);
    let refusal = v1::Refusal {
        commander: "anna".to_owned(),
        sequence: 0,
        reason: "no".to_owned(),
        code: v1::RefusalCode::TooOld.into(),
        ..Default::default()
    };
    let effects = model.sample(Sample::Refusal(refusal.clone()), 0.25);
    let found = effects.iter().find_map(|effect| match effect {
        Effect::Say(_, message) if message["t"] == "refusal" => Some(message.clone()),
        _ => None,
    });
    let found = found.unwrap();
    assert_eq!(
        (found["seq"].as_u64(), found["code"].as_str()),
        (Some(7), Some("TOO_OLD"))
    );
    assert!(stops(&effects));
    assert!(!drives(&model.intent("a", &intent(8, 1, 1.0), 0.3)));
    assert!(drives(&model.intent("a", &intent(9, 2, 1.0), 0.3)));
    // Commands of other clients have no effect.
    let other = v1::Refusal {
        commander: "zoe".to_owned(),
        ..refusal
    };
    assert!(model.sample(Sample::Refusal(other), 0.3).is_empty());
    let event = v1::Event {
        kind: v1::EventKind::Collision.into(),
        text: "chair and table".to_owned(),
        ..Default::default()
    };
    let effects = model.sample(Sample::Event(event), 0.35);
    assert!(stops(&effects), "{effects:?}");
    assert!(!drives(&model.intent("a", &intent(10, 2, 1.0), 0.4)));
}

#[test]
fn a_stop_is_reported_when_the_server_has_accepted_it() {
    let mut model = driving();
    model.intent("a", &intent(1, 1, 1.0), 0.2);
    model.intent("a", &stop(2), 0.3);
    let log = |sequence| {
        Sample::Command(v1::CommandLog {
            command: Some(v1::Command {
                commander: "anna".to_owned(),
                header: Some(v1::Header {
                    sequence,
                    ..Default::default()
                }),
                ..Default::default()
            }),
            ..Default::default()
        })
    };
    assert_eq!(model.sample(log(0), 0.31), []);
    let effects = model.sample(log(1), 0.32);
    assert_eq!(
        effects,
        [Effect::Say("a".into(), json!({"t": "stopped", "seq": 2}))]
    );
}

#[test]
fn episodes_belong_to_the_page_in_control_and_stop_motion() {
    let mut model = driving();
    model.intent("a", &intent(1, 1, 1.0), 0.2);
    let start = r#""ask":"episode.start","label":"","instruction":"""#;
    assert_eq!(answers(&request(&mut model, "b", start, 0.3))["ok"], false);
    assert_eq!(answers(&request(&mut model, "c", start, 0.3))["ok"], false);
    let effects = request(&mut model, "a", start, 0.3);
    assert!(stops(&effects));
    let begun = effects.iter().find_map(|effect| match effect {
        Effect::Operation(Operation::Start(start), name) => Some((start.clone(), name.clone())),
        _ => None,
    });
    let (begun, name) = begun.unwrap();
    assert_eq!(
        (begun.label.as_str(), name.as_str()),
        ("pick_mustard-seed5-1", "anna")
    );
    // An episode started by a person is recorded, under any label that is free.
    assert!(begun.numbered && begun.recorders == 1, "{begun:?}");
    // One pending operation at a time.
    assert!(answers(&request(&mut model, "a", start, 0.3))["error"].is_string());
    let started = v1::EpisodeStarted {
        header: Some(header(2500)),
        label: "x".to_owned(),
        ..Default::default()
    };
    let effects = model.done(Done::Started(Ok(Box::new(started))), 0.5);
    assert_eq!(answers(&effects)["number"], 3);
    assert_eq!(
        answers(&request(&mut model, "a", start, 0.6))["ok"],
        false,
        "one runs"
    );
    let effects = request(&mut model, "a", r#""ask":"episode.redo""#, 0.6);
    assert!(
        effects
            .iter()
            .any(|e| matches!(e, Effect::Operation(Operation::Redo(_), _)))
    );
    let effects = model.done(Done::Started(Err("the disk is full".to_owned())), 0.7);
    assert_eq!(answers(&effects)["error"], "the disk is full");
    assert_eq!(model.situation.alarms(), ["the disk is full"]);
}

#[test]
fn a_goal_is_picked_started_marked_and_ended_by_manual_input() {
    let mut model = driving();
    model.intent(
        "a",
        &Intent {
            action: Action::Alive,
            ..intent(1, 0, 0.0)
        },
        0.2,
    );
    let pick = r#""ask":"pick","camera":0,"tick":2390,"u":0.5,"v":0.5"#;
    let effects = request(&mut model, "a", pick, 0.2);
    assert!(
        matches!(&effects[..], [Effect::Pick(p)] if p.request.camera == "eye"),
        "{effects:?}"
    );
    let reply = v1::PickReply {
        body: "mustard".to_owned(),
        graspable: true,
        kind: v1::InstanceKind::Object.into(),
        point: Some(v1::Vector3 {
            x: 0.6,
            y: 0.0,
            z: 0.8,
        }),
        bounds: vec![0.4, 0.4, 0.6, 0.6],
        ..Default::default()
    };
    let effects = model.picked("a", 7, Ok(reply), 0.3);
    let candidate = answers(&effects)["candidates"][0].clone();
    assert_eq!(candidate["actions"], json!(["near", "take"]));
    assert_eq!(candidate["outline"][2], json!([0.6, 0.6]));
    let key = candidate["candidate"].as_str().unwrap().to_owned();
    let begin = format!(r#""ask":"goal.start","candidate":"{key}","action":"take""#);
    let wrong = begin.replace("take", "put");
    assert_eq!(answers(&request(&mut model, "a", &wrong, 0.3))["ok"], false);
    let effects = request(&mut model, "a", &begin, 0.3);
    assert_eq!(answers(&effects)["goal"], 1);
    assert!(effects.iter().any(|e| matches!(e, Effect::Goal(_))));
    let command = v1::Command {
        phase_name: "reaching".to_owned(),
        device: v1::Device::Script.into(),
        ..Default::default()
    };
    let effects = model.goal_acts(1, header(2400), command.clone(), &[]);
    let found = sent(&effects)[0];
    assert_eq!(found.phase_name, "assist:reaching");
    assert_eq!(found.mode(), v1::InputMode::Goal);
    assert_eq!(found.assistance(), v1::Assistance::Skill);
    assert!(
        model
            .goal_acts(9, header(2400), command.clone(), &[])
            .is_empty()
    );
    // Manual input ends it; later proposals of the skill are ignored.
    let effects = model.intent("a", &intent(2, 1, 1.0), 0.4);
    assert!(effects.contains(&Effect::EndGoal(1)) && stops(&effects) && !drives(&effects));
    assert!(model.goal_acts(1, header(2404), command, &[]).is_empty());
    // A candidate expires.
    assert!(model.candidates.contains_key(&key));
    model.tick(40.0);
    assert!(model.candidates.is_empty());
}

#[test]
fn a_goal_ends_when_its_page_is_lost() {
    for why in ["silence", "image", "lanes"] {
        let mut model = driving();
        let alive = |seq, shown| Intent {
            action: Action::Alive,
            shown,
            ..intent(seq, 0, 0.0)
        };
        model.intent("a", &alive(1, Some(2390)), 0.2);
        model.candidates.insert(
            "c1".to_owned(),
            Candidate {
                body: "mustard".to_owned(),
                point: [0.0; 3],
                actions: vec!["take"],
                until: 30.0,
            },
        );
        let begin = r#""ask":"goal.start","candidate":"c1","action":"take""#;
        request(&mut model, "a", begin, 0.3);
        assert!(model.goal.is_some());
        assert!(model.tick(0.9).is_empty());
        let effects = match why {
            "silence" => model.tick(1.3),
            "image" => {
                model.intent("a", &alive(2, None), 0.9);
                model.tick(1.0)
            }
            _ => {
                model.left("a", Socket::Control(0), 0.9);
                model.left("a", Socket::Control(1), 0.9)
            }
        };
        assert!(effects.contains(&Effect::EndGoal(1)), "{why}: {effects:?}");
        assert!(stops(&effects), "{why}");
    }
}

#[test]
fn the_end_of_a_session_stops_the_chair_and_gives_control_back() {
    let mut model = driving();
    model.intent("a", &intent(1, 1, 1.0), 0.2);
    let effects = model.signed_out("b", "signed out", 0.25);
    assert!(effects.is_empty(), "another page: {effects:?}");
    let effects = model.signed_out("a", "signed out", 0.3);
    assert!(stops(&effects), "{effects:?}");
    assert!(effects.contains(&Effect::Release), "{effects:?}");
    let stop = effects.iter().position(|e| matches!(e, Effect::Send(..)));
    let release = effects.iter().position(|e| *e == Effect::Release);
    assert!(stop < release, "the stop goes before control: {effects:?}");
    assert_eq!(model.control, Control::None);
    // Commands that are still queued move nothing.
    assert!(sent(&model.intent("a", &intent(2, 2, 1.0), 0.31)).is_empty());
}

#[test]
fn control_granted_after_the_end_of_the_session_is_released_at_once() {
    let mut model = open();
    request(&mut model, "a", r#""ask":"lease.ask""#, 0.0);
    model.signed_out("a", "signed out", 0.05);
    let effects = model.done(Done::Lease(Ok(())), 0.1);
    assert!(effects.contains(&Effect::Release), "{effects:?}");
    assert_eq!(model.control, Control::None);
}

#[test]
fn a_page_has_the_role_of_its_newest_session() {
    let mut model = open();
    let lowered = visitor("anna", Role::Viewer);
    model.joined("a", &lowered, Socket::State, 0.1);
    let effects = request(&mut model, "a", r#""ask":"lease.ask""#, 0.2);
    assert_eq!(answers(&effects)["ok"], false);
}

#[test]
fn a_refusal_of_another_client_with_this_name_stops_nothing() {
    for (code, stopped) in [
        (RefusalCode::Seal, false),
        (RefusalCode::Foreign, false),
        (RefusalCode::Version, false),
        (RefusalCode::Invalid, true),
    ] {
        let mut model = driving();
        model.intent("a", &intent(1, 1, 1.0), 0.2);
        let refusal = v1::Refusal {
            commander: "anna".to_owned(),
            code: code.into(),
            count: 1,
            ..Default::default()
        };
        let effects = model.sample(Sample::Refusal(refusal), 0.3);
        assert_eq!(stops(&effects), stopped, "{code:?}: {effects:?}");
    }
}

#[test]
fn listing_tasks_hides_no_silence_and_is_rejected_for_a_viewer() {
    let mut model = driving();
    model.intent("a", &intent(1, 1, 1.0), 0.2);
    assert_eq!(
        answers(&request(&mut model, "c", r#""ask":"tasks""#, 0.2))["ok"],
        false
    );
    assert!(
        request(&mut model, "a", r#""ask":"tasks""#, 0.2)
            .iter()
            .any(|effect| matches!(effect, Effect::Operation(Operation::Tasks, _)))
    );
    model.silent(0.3);
    assert!(!model.is_busy(), "everything stops");
}
