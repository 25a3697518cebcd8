//! Hand motion: held input becomes a velocity, a press one step. Translation is along the
//! axes of the chair, rotation about the tool's axes. Pure.

use nalgebra::Vector3;
use wheelarm_proto::geometry::{self, normalized};
use wheelarm_proto::v1;
use wheelarm_proto::v1::arm_command::Target;

use crate::protocol::Held;
use crate::speed::{self, Speeds};
use crate::watch::Situation;

/// A step of the hand is rejected while the target is this far ahead, m and rad.
const LEAD: [f64; 2] = [0.12, 0.40];

/// Directions in which `held` moves the hand, as the page protocol names them.
#[must_use]
pub fn directions(held: &Held) -> Vec<&'static str> {
    const NAMES: [[&str; 2]; 6] = [
        ["hand.forward", "hand.back"],
        ["hand.left", "hand.right"],
        ["hand.up", "hand.down"],
        ["turn.roll_plus", "turn.roll_minus"],
        ["turn.pitch_plus", "turn.pitch_minus"],
        ["turn.yaw_plus", "turn.yaw_minus"],
    ];
    let held = held.hand.into_iter().chain(held.turn);
    let moved = held.zip(NAMES).filter(|(value, _)| *value != 0.0);
    moved
        .map(|(value, [plus, minus])| if value > 0.0 { plus } else { minus })
        .collect()
}

/// Hand velocity for an image of `age`, s; `None` without held hand input, without a
/// displayed image or while the pose is unknown.
#[must_use]
pub fn twist(
    held: &Held,
    speeds: &Speeds,
    age: Option<f64>,
    situation: &Situation,
) -> Option<Target> {
    if held.hand == [0.0; 3] && held.turn == [0.0; 3] {
        return None;
    }
    let most = |v: Vector3<f64>| v / v.norm().max(1.0);
    let share = (speed::cap(age?) / speed::cap(0.0)).min(1.0);
    let linear = most(Vector3::from(held.hand)) * speeds.hand[0] * share;
    let about_tool = most(tool_axes(held.turn)) * speeds.hand[1] * share;
    let mount = situation.mount()?;
    let tool = situation.base_from_tool?.rotation;
    Some(Target::Twist(v1::CartesianTwist {
        frame: v1::CommandFrame::Wheelchair.into(),
        twist: Some(geometry::twist(&linear, &(mount * tool * about_tool))),
    }))
}

/// One step in the directions of `held`.
#[must_use]
pub fn step(held: &Held, speeds: &Speeds) -> Target {
    let [metres, radians] = speeds.step;
    let translation = Vector3::from(held.hand) * metres;
    let rotation = tool_axes(held.turn) * radians;
    Target::Step(v1::CartesianStep {
        frame: v1::CommandFrame::Wheelchair.into(),
        translation: Some(geometry::vector(&translation)),
        rotation: Some(geometry::vector(&rotation)),
    })
}

/// Reason for rejecting a further step of the hand.
#[must_use]
pub fn behind(situation: &Situation) -> Option<&'static str> {
    let applied = situation.applied.as_ref()?;
    let desired = normalized("desired pose", applied.desired_pose.as_ref()).ok()?;
    let present = situation.base_from_tool?;
    let way = (desired.translation.vector - present.translation.vector).norm();
    let turn = desired.rotation.angle_to(&present.rotation);
    (way > LEAD[0] || turn > LEAD[1]).then_some("the hand is still on its way")
}

/// Roll to the right, pitch downwards and yaw to the left as turns about the tool's
/// own axes: x is to the left, y upwards and z ahead of a level hand.
fn tool_axes([roll, pitch, yaw]: [f64; 3]) -> Vector3<f64> {
    Vector3::new(pitch, yaw, roll)
}
