//! Conversions of the scene, the task's goal and its evaluation.

use wheelarm_proto::geometry::{pose, vector};
use wheelarm_proto::v1;

use crate::people::person_part;
use crate::robot::RobotModel;
use crate::scene::{FurnitureJoint, Scene};
use crate::snapshot::{Anomaly, BodyRef, Fault};
use crate::tasks;

fn failure(failure: tasks::Failure) -> v1::FailureReason {
    use v1::FailureReason as Reason;
    match failure {
        tasks::Failure::Dropped => Reason::Dropped,
        tasks::Failure::Tipped => Reason::Tipped,
        tasks::Failure::Timeout => Reason::Timeout,
        tasks::Failure::Unreachable => Reason::Unreachable,
        tasks::Failure::HardCollision => Reason::HardCollision,
        tasks::Failure::Lost => Reason::Lost,
        tasks::Failure::Physics => Reason::Physics,
        tasks::Failure::PersonForce => Reason::PersonForce,
        tasks::Failure::WrongObject => Reason::WrongObject,
        tasks::Failure::KnockedOver => Reason::KnockedOver,
        tasks::Failure::Tilted => Reason::Tilted,
    }
}

/// The code of an anomaly.
pub fn anomaly_kind(anomaly: &Anomaly) -> v1::AnomalyKind {
    match anomaly {
        Anomaly::NotFinite(_) => v1::AnomalyKind::NotFinite,
        Anomaly::Escaped(_) => v1::AnomalyKind::Escaped,
        Anomaly::Fast(_) => v1::AnomalyKind::JointFast,
    }
}

/// The code of a fault.
pub fn fault_kind(fault: &Fault) -> v1::AnomalyKind {
    match fault {
        Fault::NotFinite(_) => v1::AnomalyKind::FaultNotFinite,
        Fault::JointSpeed { .. } => v1::AnomalyKind::FaultJointSpeed,
        Fault::Contact { .. } => v1::AnomalyKind::FaultContactForce,
        Fault::NodeSpeed { .. } => v1::AnomalyKind::FaultNodeSpeed,
        Fault::Energy { .. } => v1::AnomalyKind::FaultEnergy,
        Fault::Outside { .. } => v1::AnomalyKind::FaultOutside,
        Fault::Panic(_) => v1::AnomalyKind::FaultPanic,
    }
}

/// State of the task as a message, without header.
pub fn evaluation(e: &tasks::Evaluation) -> v1::Evaluation {
    v1::Evaluation {
        header: None,
        success: e.success,
        done: e.done,
        failure: e.failure.map(|f| f.to_string()).unwrap_or_default(),
        failure_reason: e.failure.map_or(v1::FailureReason::None, failure).into(),
        conditions: e
            .conditions
            .iter()
            .map(|c| v1::Condition {
                name: c.name.clone(),
                predicate: c.predicate.to_owned(),
                holds: c.holds,
                value: c.value,
                required: c.required,
            })
            .collect(),
        elapsed_seconds: e.elapsed,
    }
}

/// Name of a body for people.
pub fn body_name(body: BodyRef, model: &RobotModel, scene: &Scene) -> String {
    let name = match body {
        BodyRef::Link(i) => model.links.get(i).map(|l| &l.name),
        BodyRef::Object(i) => scene.objects.get(i).map(|b| &b.name),
        BodyRef::Furniture(i) => scene.furniture.get(i).map(|b| &b.name),
        BodyRef::Person(i) => return person_part(i),
    };
    name.cloned().unwrap_or_default()
}

/// Furniture on a joint, as a message.
pub fn furniture_joint(joint: &FurnitureJoint, scene: &Scene) -> v1::FurnitureJoint {
    let body = scene.furniture.get(joint.furniture);
    v1::FurnitureJoint {
        name: joint.name.clone(),
        body: body.map(|b| b.name.clone()).unwrap_or_default(),
        rest: body.map(|b| pose(&b.pose)),
        axis: Some(vector(&joint.axis)),
        travel: joint.travel,
        r#type: joint.motion.joint_type().into(),
    }
}

/// The goal of a task as an enum.
pub fn goal_kind(goal: &tasks::Goal) -> v1::GoalKind {
    match goal {
        tasks::Goal::Lift => v1::GoalKind::Lift,
        tasks::Goal::Put { .. } => v1::GoalKind::Put,
        tasks::Goal::Give => v1::GoalKind::Give,
        tasks::Goal::Bring => v1::GoalKind::Bring,
        tasks::Goal::Open(_) => v1::GoalKind::Open,
        tasks::Goal::Close(_) => v1::GoalKind::Close,
    }
}

/// The goal of a task as a message; `lap` is the user's lap.
pub fn goal(
    goal: &tasks::Goal,
    target: &str,
    scene: &Scene,
    lap: Option<&v1::BoxGeometry>,
) -> v1::TaskGoal {
    let mut message = v1::TaskGoal {
        kind: goal_kind(goal).into(),
        target: target.to_owned(),
        ..v1::TaskGoal::default()
    };
    match goal {
        tasks::Goal::Lift => {}
        tasks::Goal::Give => message.region = lap.copied(),
        tasks::Goal::Bring => {
            let target = scene.object_named(target).map(|i| &scene.objects[i]);
            message.tip = target
                .and_then(|body| body.tip)
                .map(|tip| vector(&tip.coords));
        }
        tasks::Goal::Put { on } => {
            message.region = scene.surface_named(on, None).map(|surface| {
                let (centre, half) = scene.reached_part(surface);
                v1::BoxGeometry {
                    pose: Some(pose(&centre)),
                    half: Some(vector(&half)),
                }
            });
        }
        tasks::Goal::Open(bounds) | tasks::Goal::Close(bounds) => {
            let joint = scene
                .furniture_named(target)
                .and_then(|i| scene.joint_of(i));
            if let Some(joint) = joint {
                message.joint = joint.name.clone();
                message.position = bounds.of(joint.motion);
            }
        }
    }
    message
}
