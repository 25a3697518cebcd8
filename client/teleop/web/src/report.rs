//! The `situation` message that every page receives ten times a second (`PROTOCOL.md`).

use serde_json::{Map, Value, json};
use wheelarm_proto::v1;

use crate::model::{Control, Model};
use crate::speed::{self, Allow, Speeds};
use crate::watch::Connection;

/// The chair counts as at rest below these speeds, m/s and rad/s.
const STANDS: [f64; 2] = [0.01, 0.02];
/// Contact force that is shown as a contact, N.
const PUSH: f64 = 2.0;

/// Codec and width that are sent of a camera.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sent {
    /// `jpeg` or `h264`; empty while nothing is sent.
    pub codec: &'static str,
    /// Width, pixels.
    pub width: u32,
}

/// The part of the message that is the same for all pages, at `time`, s.
#[must_use]
pub fn common(model: &Model, number: u64, time: f64) -> Map<String, Value> {
    let situation = &model.situation;
    let status = situation.status.as_ref();
    let scenario = situation.scenario();
    let (link, since) = match &situation.connection {
        Connection::Opening => ("opening", None),
        Connection::Open => ("open", None),
        Connection::Silent(at) => ("silent", Some(time - at)),
        Connection::Lost(at, _) => ("lost", Some(time - at)),
    };
    let evaluation = situation.evaluation.as_ref();
    let mut speeds = situation.chair_speed.iter().zip(STANDS);
    let moving = speeds.any(|(v, stands)| v.abs() > stands) || model.is_busy();
    let message = json!({
        "t": "situation",
        "n": number,
        "tick": situation.header.tick,
        "sim_s": situation.header.stamp_nanos as f64 * 1e-9,
        "link": link,
        "link_for_s": since,
        "people": people(model),
        "scenario": scenario.map(|s| json!({
            "task": s.task(), "seed": s.seed(), "instruction": s.instruction(),
        })),
        "episode": situation.episode().map(|e| json!({
            "number": e.header.as_ref().map_or(0, |h| h.episode),
            "label": e.label,
            "instruction": e.instruction,
            "practice": e.practice,
            "seconds": situation.episode_clock(),
        })),
        "alarms": situation.alarms(),
        "recorders": status.map(|s| s.recorders.iter().map(recorder).collect::<Vec<_>>()),
        "recorded_bytes": situation.episode().and(model.recorded_bytes),
        "evaluation": evaluation.map(|e| json!({
            "success": e.success,
            "failure": e.failure,
            "elapsed_s": e.elapsed_seconds,
            "conditions": e.conditions.iter().map(|c| json!({
                "name": c.name, "holds": c.holds, "required": c.required,
            })).collect::<Vec<_>>(),
        })),
        "paused": status.is_some_and(|s| s.paused),
        "waiting_for": status.map_or("", |s| &s.waiting_for),
        "factor": situation.factor,
        "busy": model.busy.as_ref().map_or("", |(word, _)| word),
        "robot": {
            "speed": situation.chair_speed,
            "chair": situation.chair(),
            "hand": situation.hand(),
            "opening_mm": situation.opening().map(|m| m * 1e3),
            "pad_force": situation.pad_force,
            "moving": moving,
            "phase": situation.phase,
            "problem": situation.applied.as_ref().map_or("", |a| &a.arm_problem),
        },
        "blocked": blocked(model),
        "contacts": contacts(model),
        "goal": model.goal.as_ref().map(|goal| json!({
            "id": goal.number,
            "action": goal.action,
            "name": goal.body.replace('_', " "),
            "stage": goal.stage,
            "at": goal.stages.len(),
            "of": goal.stages.len().max(4),
            "text": goal.text,
        })),
    });
    match message {
        Value::Object(fields) => fields,
        _ => Map::new(),
    }
}

/// The message for one page: the common part and its own. `sent` is the codec and width
/// of each camera.
#[must_use]
pub fn of_page(
    model: &Model,
    page: &str,
    common: &Map<String, Value>,
    sent: &[Sent],
    time: f64,
) -> Value {
    let mut message = common.clone();
    let Some(known) = model.pages.get(page) else {
        return Value::Object(message);
    };
    let status = model.situation.status.as_ref();
    let mine = model.control.page() == Some(page);
    let holder = match &model.control {
        Control::Ours { name, .. } => name.clone(),
        Control::None | Control::Requested { .. } => {
            status.map_or_else(String::new, |s| s.holder.clone())
        }
    };
    let motion = &known.motion;
    let age = motion.age(model.situation.header.tick);
    let open = model.situation.connection == Connection::Open;
    let allow = match mine && open {
        true => Allow::at(age),
        false => Allow::Stop,
    };
    let why = match (open, mine, allow, age) {
        (false, ..) => "no connection to the simulation",
        (_, false, ..) => "this page is not in control",
        (_, _, Allow::Drive, _) => "",
        (_, _, Allow::Steps, _) => "the image is more than 0.9 s old: steps and goals only",
        (_, _, Allow::Stop, None) => "no image is shown",
        (_, _, Allow::Stop, Some(_)) => "the image is more than 2 s old",
    };
    let cap = speed::cap(age.unwrap_or(f64::INFINITY));
    let most = Speeds::of(motion.speed()).chair[0];
    let [epoch, dead] = motion.epochs();
    let own = json!({
        "you": {"user": known.visitor.name, "role": known.visitor.role.name()},
        "lease": {
            "holder": holder,
            "mine": mine,
            "requests": model.control_requests,
            "for_s": match &model.control {
                Control::Ours { since, .. } => Some(time - since),
                Control::None | Control::Requested { .. } => status.map(|s| s.held_seconds),
            },
        },
        "cameras": cameras(model, sent),
        "control": {
            "seq": motion.seq(),
            "epoch": epoch,
            "dead": dead,
            "stopped": motion.is_stopped(),
            "allow": allow.word(),
            "why": why,
            "age_ms": age.map(|age| (age * 1e3).round()),
            "cap": {"chair": cap, "share": (cap / most).min(1.0)},
        },
        "echo": motion.echo(time).map(|(ms, held)| json!({"ms": ms, "held_ms": held * 1e3})),
    });
    if let Value::Object(own) = own {
        message.extend(own);
    }
    Value::Object(message)
}

fn people(model: &Model) -> Vec<Value> {
    let mut people: Vec<Value> = Vec::new();
    for (key, page) in model.pages.iter().filter(|(_, page)| page.is_open()) {
        let control = model.control.page() == Some(key);
        let name = page.visitor.name.as_str();
        let same = people.iter_mut().find(|person| person["name"] == name);
        match same {
            Some(person) if control => person["control"] = json!(true),
            Some(_) => {}
            None => people.push(json!({
                "name": name,
                "role": page.visitor.role.name(),
                "control": control,
            })),
        }
    }
    people
}

fn recorder(status: &v1::RecorderStatus) -> Value {
    json!({
        "name": status.recorder,
        "state": match status.state() {
            v1::RecorderState::Unspecified => "unknown",
            v1::RecorderState::Idle => "idle",
            v1::RecorderState::Ready => "ready",
            v1::RecorderState::Finishing => "finishing",
            v1::RecorderState::Finished => "finished",
            v1::RecorderState::Failed => "failed",
        },
        "missed": status.missed,
        "frames": status.accepted_frames,
        "complete": status.complete,
        "silent_s": status.silent_seconds,
        "message": status.message,
    })
}

fn cameras(model: &Model, sent: &[Sent]) -> Vec<Value> {
    let scenario = model.situation.scenario();
    let cameras = scenario.map_or(&[][..], |s| &s.cameras);
    let listed = cameras.iter().enumerate();
    listed
        .filter(|(_, camera)| camera.rate_hz != Some(0.0))
        .map(|(index, camera)| {
            let sent = sent.get(index).cloned().unwrap_or_default();
            json!({
                "index": index,
                "name": camera.name,
                "width": camera.width,
                "height": camera.height,
                "hz": camera.rate_hz,
                "codec": sent.codec,
                "width_sent": sent.width,
            })
        })
        .collect()
}

/// Contacts between the robot and other bodies.
fn touching(model: &Model) -> impl Iterator<Item = &v1::Contact> {
    let contacts = model.situation.contacts.iter();
    contacts.filter(|contact| {
        if !model.is_robot(&contact.first) && !model.is_robot(&contact.second) {
            return false;
        }
        let force = contact.force.unwrap_or_default();
        force.x.hypot(force.y).hypot(force.z) > PUSH
    })
}

fn contacts(model: &Model) -> Vec<String> {
    let words = |name: &str| name.replace('_', " ");
    touching(model)
        .map(|contact| format!("{} and {}", words(&contact.first), words(&contact.second)))
        .collect()
}

/// Directions that are blocked, with the reason.
fn blocked(model: &Model) -> Map<String, Value> {
    let mut blocked = Map::new();
    let situation = &model.situation;
    let limit = situation.applied.as_ref().is_some_and(|applied| {
        matches!(
            applied.arm_problem_code(),
            v1::ArmProblem::Unreachable | v1::ArmProblem::JointLimit | v1::ArmProblem::Hindered
        )
    });
    for direction in model.hand_directions().into_iter().filter(|_| limit) {
        blocked.insert(direction.to_owned(), json!("limit"));
    }
    let Some(chair) = situation.house_from_chair else {
        return blocked;
    };
    for contact in touching(model) {
        let (Some(point), Some(force)) = (contact.point, contact.force) else {
            continue;
        };
        if !model.is_chair(&contact.first) && !model.is_chair(&contact.second) {
            continue;
        }
        let push = chair.rotation.inverse() * nalgebra::Vector3::new(force.x, force.y, force.z);
        let at = chair.inverse() * nalgebra::Point3::new(point.x, point.y, point.z);
        let direction = match (push.x.abs() >= push.y.abs(), at.x > 0.0, at.y > 0.0) {
            (true, true, _) => "chair.forward",
            (true, false, _) => "chair.back",
            (false, _, true) => "chair.left",
            (false, _, false) => "chair.right",
        };
        blocked.insert(direction.to_owned(), json!("contact"));
    }
    let stroke = model.stroke();
    if let (Some(opening), Some(stroke)) = (situation.opening(), stroke) {
        if opening >= stroke - 1e-3 {
            blocked.insert("grip.open".to_owned(), json!("limit"));
        }
        if opening <= 1e-3 {
            blocked.insert("grip.close".to_owned(), json!("limit"));
        }
    }
    blocked
}
