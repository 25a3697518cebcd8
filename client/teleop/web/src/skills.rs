//! Runs a skill for an object that the person selected: the skills of the scripted
//! operator, on a thread, tick by tick. It sends no commands itself: it proposes them to
//! the hub, which decides.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use nalgebra::{Isometry3, Point3, Vector3};
use wheelarm_expert::goal::Goal;
use wheelarm_expert::observation::{self, Collector, Observation};
use wheelarm_expert::operator::{Extent, Operator, Outcome};
use wheelarm_expert::profile::OperatorProfile;
use wheelarm_expert::run::RemoteReach;
use wheelarm_expert::scene::SceneModel;
use wheelarm_planning::obb::Obb;
use wheelarm_proto::robot::Roles;
use wheelarm_proto::topic::Sample;
use wheelarm_proto::{TICKS_PER_CONTROL, TopicId, v1};
use wheelarm_sdk::Client;

use crate::model::GoalRequest;

/// Silence of the server after which a skill gives up.
const SILENCE: Duration = Duration::from_secs(3);
/// Time between two checks whether it is still wanted.
const LOOK: Duration = Duration::from_millis(50);
/// A placed object is within this distance of the point, m: half sides of a box.
const PLACE: [f64; 3] = [0.05, 0.05, 0.10];
/// The chair faces the object within this angle, rad.
const FACES: f64 = 0.03;
/// Greatest turn rate towards the object, rad/s.
const TURN: f64 = 0.5;
/// Turn rate per angle that is left, 1/s.
const TURN_GAIN: f64 = 1.5;
/// A turn that takes longer is blocked, s of simulation time: half a turn takes 8.
const TURN_LONGEST: f64 = 20.0;
/// An object this near to the middle of the pads counts as held, m.
const IN_HAND: f64 = 0.12;

/// Messages of a skill.
#[derive(Debug)]
pub enum SkillEvent {
    /// Proposed command for a tick.
    Acts {
        /// Number of the goal.
        number: u64,
        /// The tick that it answers.
        header: Box<v1::Header>,
        /// The command.
        command: Box<v1::Command>,
        /// Events, in words.
        notes: Vec<String>,
    },
    /// The skill ended.
    Over {
        /// Number of the goal.
        number: u64,
        /// Result, in words.
        result: Result<String, String>,
    },
}

/// A running skill; it ends when this is dropped.
pub struct Skills {
    ended: Arc<AtomicBool>,
}

impl Skills {
    /// Starts it on a thread; `send` receives its messages.
    #[must_use]
    pub fn start(
        client: Client,
        request: GoalRequest,
        send: impl Fn(SkillEvent) + Send + 'static,
    ) -> Self {
        let ended = Arc::new(AtomicBool::new(false));
        let ours = Arc::clone(&ended);
        std::thread::spawn(move || {
            let number = request.number;
            let result = work(&client, &request, &ours, &send);
            send(SkillEvent::Over { number, result });
        });
        Self { ended }
    }
}

impl Drop for Skills {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Release);
    }
}

fn work(
    client: &Client,
    request: &GoalRequest,
    ended: &AtomicBool,
    send: &(impl Fn(SkillEvent) + Send),
) -> Result<String, String> {
    let mut topics = observation::STREAMS.to_vec();
    topics.push(TopicId::Clock);
    let streams = client.streams(&topics).map_err(|e| e.to_string())?;
    let reply = client
        .request(&v1::SceneRequest {})
        .map_err(|e| e.to_string())?;
    let scene = SceneModel::read(&reply).map_err(|e| e.to_string())?;
    let roles = Roles::find(&reply.robot.clone().unwrap_or_default()).map_err(|e| e.to_string())?;
    let mut collector = Collector::new(roles);
    let mut reach = RemoteReach::new(client);
    let mut operator: Option<Operator> = None;
    let object = reply.objects.iter().position(|name| *name == reply.target);
    let mut turn: Option<Turn> = None;
    let (mut last_sample, mut answered) = (Instant::now(), None);
    while !ended.load(Ordering::Acquire) {
        let Some(sample) = streams.next(LOOK).map_err(|e| e.to_string())? else {
            if last_sample.elapsed() > SILENCE {
                return Err("the simulation is silent".to_owned());
            }
            continue;
        };
        last_sample = Instant::now();
        let Sample::Clock(clock) = sample else {
            collector.take(sample);
            continue;
        };
        let header = clock.header.unwrap_or_default();
        // Planning took a while: ticks that passed meanwhile are skipped.
        let due = |last: u64| header.tick >= last + TICKS_PER_CONTROL;
        if !answered.is_none_or(due) {
            continue;
        }
        let observed = collector.observe(header.stamp_nanos);
        let Some(observation) = observed.map_err(|e| e.to_string())? else {
            continue;
        };
        if request.action == "turn" {
            let turn = match &mut turn {
                Some(turn) => turn,
                none => none.insert(Turn::new(object, &observation)?),
            };
            let (command, outcome) = turn.step(&observation);
            answered = Some(header.tick);
            send(SkillEvent::Acts {
                number: request.number,
                header: Box::new(header),
                command: Box::new(command),
                notes: Vec::new(),
            });
            match outcome {
                Some(result) => return result.map(|()| "done: the chair faces the object".into()),
                None => continue,
            }
        }
        let operator = match &mut operator {
            Some(operator) => operator,
            none => none.insert(begin(request, &scene, &observation)?),
        };
        let (act, outcome) = operator.step(&observation, &mut reach);
        if let Some(error) = reach.take_error() {
            return Err(error.to_string());
        }
        answered = Some(header.tick);
        let notes = operator.notes();
        send(SkillEvent::Acts {
            number: request.number,
            header: Box::new(header),
            command: Box::new(operator.command(&act)),
            notes,
        });
        match outcome {
            Some(Outcome::Success) => return Ok(format!("done: {}", words(request))),
            Some(Outcome::Failure(why) | Outcome::Broken(why)) => return Err(why),
            None => {}
        }
    }
    Err("ended".to_owned())
}

/// Turns the chair on the spot until it faces the object of the task.
struct Turn {
    object: usize,
    /// When it began, s of simulation time.
    began: f64,
}

impl Turn {
    fn new(object: Option<usize>, observation: &Observation) -> Result<Self, String> {
        let object = object.filter(|index| *index < observation.objects.len());
        let object = object.ok_or("this task has no object to turn to: turn by hand")?;
        Ok(Self {
            object,
            began: observation.time,
        })
    }

    /// The command of a control tick, and the result at the end.
    fn step(&self, observation: &Observation) -> (v1::Command, Option<Result<(), String>>) {
        let place = observation.objects[self.object].translation.vector;
        let left = bearing(&observation.house_from_chair, &place);
        let [_, turn_rate] = observation.chair_speed;
        let faces = left.abs() < FACES;
        let angular = match faces {
            true => 0.0,
            false => (TURN_GAIN * left).clamp(-TURN, TURN),
        };
        let outcome = match observation.time - self.began > TURN_LONGEST {
            _ if faces && turn_rate.abs() < FACES => Some(Ok(())),
            true => Some(Err(
                "the chair cannot turn further: something is in its way".to_owned(),
            )),
            false => None,
        };
        let command = v1::Command {
            base: Some(v1::BaseCommand {
                linear: 0.0,
                angular,
            }),
            phase: v1::Phase::Navigating.into(),
            phase_name: "turn".to_owned(),
            device: v1::Device::Script.into(),
            ..v1::Command::default()
        };
        (command, outcome)
    }
}

/// Angle from the chair's forward axis to a place on the floor, rad, left positive.
fn bearing(house_from_chair: &Isometry3<f64>, place: &Vector3<f64>) -> f64 {
    let away = house_from_chair.inverse() * Point3::from(*place);
    away.y.atan2(away.x)
}

fn words(request: &GoalRequest) -> String {
    let name = request.body.replace('_', " ");
    match request.action {
        "near" => format!("the hand is in front of the {name}"),
        "put" => "it is put down".to_owned(),
        _ => format!("the {name} is held"),
    }
}

/// Sets up the operator for the requested goal.
fn begin(
    request: &GoalRequest,
    scene: &SceneModel,
    observation: &Observation,
) -> Result<Operator, String> {
    let (goal, extent) = match request.action {
        "put" => {
            let item = held(scene, observation).ok_or("the hand holds nothing")?;
            let [x, y, z] = request.point;
            let region = Obb {
                pose: Isometry3::translation(x, y, z + PLACE[2]),
                half: Vector3::from(PLACE),
                round: false,
            };
            (Goal::Put { item, region }, Extent::Put)
        }
        action => {
            let named = scene
                .items
                .iter()
                .position(|item| item.name == request.body);
            let item = named.ok_or_else(|| format!("{} cannot be taken", request.body))?;
            let extent = match action {
                "near" => Extent::Near,
                _ => Extent::Take,
            };
            (Goal::Lift { item }, extent)
        }
    };
    let operator = Operator::new(scene.clone(), Some(goal), OperatorProfile::new(0))?;
    Ok(operator.only(extent))
}

/// The object between the pads.
fn held(scene: &SceneModel, observation: &Observation) -> Option<usize> {
    let pads = scene.house_from_tool(observation) * Point3::new(0.0, 0.0, scene.tool_length);
    let away = |pose: &Isometry3<f64>| (pose.translation.vector - pads.coords).norm();
    let objects = observation.objects.iter().enumerate();
    let nearest = objects.min_by(|(_, a), (_, b)| away(a).total_cmp(&away(b)));
    nearest
        .filter(|(_, pose)| away(pose) < IN_HAND)
        .map(|(index, _)| index)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bearing_is_positive_to_the_left_of_the_chair() {
        let quarter = std::f64::consts::FRAC_PI_2;
        let chair = Isometry3::new(Vector3::new(1.0, 2.0, 0.0), Vector3::z() * quarter);
        // The chair faces +y: +y is ahead, -x is left, -y is behind.
        for (place, expected) in [
            ([1.0, 5.0, 0.7], 0.0),
            ([-3.0, 2.0, 0.7], quarter),
            ([4.0, 2.0, 0.7], -quarter),
        ] {
            let got = bearing(&chair, &Vector3::from(place));
            assert!((got - expected).abs() < 1e-9, "{place:?}: {got}");
        }
    }
}
