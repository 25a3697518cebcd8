//! Numbers out of messages and back. A part that is absent becomes NaN, so that
//! it can never be mistaken for a zero, and a part of nothing but NaN is absent.

use wheelarm_proto::v1;

use crate::pose;

pub(super) fn vector(v: Option<&v1::Vector3>, out: &mut Vec<f64>) {
    match v {
        Some(v) => out.extend([v.x, v.y, v.z]),
        None => out.extend([f64::NAN; 3]),
    }
}

pub(super) fn quaternion(q: Option<&v1::Quaternion>, out: &mut Vec<f64>) {
    match q {
        Some(q) => out.extend([q.x, q.y, q.z, q.w]),
        None => out.extend([f64::NAN; 4]),
    }
}

pub(super) fn pose(p: Option<&v1::Pose>, out: &mut Vec<f64>) {
    out.extend(pose::of_message(p));
}

pub(super) fn twist(t: Option<&v1::Twist>, out: &mut Vec<f64>) {
    vector(t.and_then(|t| t.linear.as_ref()), out);
    vector(t.and_then(|t| t.angular.as_ref()), out);
}

/// The numbers of a part, NaN where the file has fewer; `None` when it is absent.
fn part<const N: usize>(v: &[f64]) -> Option<[f64; N]> {
    let numbers = std::array::from_fn(|i| v.get(i).copied().unwrap_or(f64::NAN));
    (!numbers.iter().all(|n| n.is_nan())).then_some(numbers)
}

/// x y z.
pub(super) fn to_vector(v: &[f64]) -> Option<v1::Vector3> {
    part(v).map(|[x, y, z]| v1::Vector3 { x, y, z })
}

/// x y z w.
pub(super) fn to_quaternion(v: &[f64]) -> Option<v1::Quaternion> {
    part(v).map(|[x, y, z, w]| v1::Quaternion { x, y, z, w })
}

/// Position, then quaternion.
pub(super) fn to_pose(v: &[f64]) -> Option<v1::Pose> {
    let (position, orientation) = v.split_at_checked(3)?;
    let pose = v1::Pose {
        position: to_vector(position),
        orientation: to_quaternion(orientation),
    };
    (pose != v1::Pose::default()).then_some(pose)
}

/// Linear, then angular.
pub(super) fn to_twist(v: &[f64]) -> Option<v1::Twist> {
    let (linear, angular) = v.split_at_checked(3)?;
    let twist = v1::Twist {
        linear: to_vector(linear),
        angular: to_vector(angular),
    };
    (twist != v1::Twist::default()).then_some(twist)
}

/// Gives every entry of a list its numbers, `width` of them; a list that is
/// shorter grows.
pub(super) fn put_each<T: Default>(
    list: &mut Vec<T>,
    numbers: &[f64],
    width: usize,
    put: impl Fn(&mut T, &[f64]),
) {
    let entries = numbers.chunks_exact(width);
    if list.len() < entries.len() {
        list.resize_with(entries.len(), T::default);
    }
    list.iter_mut().zip(entries).for_each(|(e, n)| put(e, n));
}

/// Name of the target of an arm command; empty without one.
pub(super) fn arm_kind(arm: Option<&v1::ArmCommand>) -> String {
    use v1::arm_command::Target;
    match arm.and_then(|a| a.target.as_ref()) {
        None => "",
        Some(Target::Joints(_)) => "joints",
        Some(Target::Pose(_)) => "pose",
        Some(Target::Twist(_)) => "twist",
        Some(Target::Step(_)) => "step",
        Some(Target::Hold(_)) => "hold",
    }
    .to_owned()
}

/// Frame of a Cartesian arm command; empty for others.
pub(super) fn arm_frame(arm: Option<&v1::ArmCommand>) -> String {
    use v1::arm_command::Target;
    let frame = match arm.and_then(|a| a.target.as_ref()) {
        Some(Target::Pose(t)) => t.frame,
        Some(Target::Twist(t)) => t.frame,
        Some(Target::Step(t)) => t.frame,
        _ => return String::new(),
    };
    match v1::CommandFrame::try_from(frame) {
        Ok(v1::CommandFrame::Unspecified | v1::CommandFrame::BaseLink) => "base_link",
        Ok(v1::CommandFrame::EndEffector) => "end_effector",
        Ok(v1::CommandFrame::Wheelchair) => "wheelchair_root",
        Ok(v1::CommandFrame::House) => "house",
        Err(_) => "unknown",
    }
    .to_owned()
}

/// The numbers of an arm command, seven places: joints fill six, a pose seven,
/// a twist or a step six; the rest is NaN.
pub(super) fn arm_values(arm: Option<&v1::ArmCommand>, out: &mut Vec<f64>) {
    use v1::arm_command::Target;
    let start = out.len();
    match arm.and_then(|a| a.target.as_ref()) {
        Some(Target::Joints(j)) => out.extend(j.positions.iter().take(7)),
        Some(Target::Pose(p)) => pose(p.pose.as_ref(), out),
        Some(Target::Twist(t)) => twist(t.twist.as_ref(), out),
        Some(Target::Step(s)) => {
            vector(s.translation.as_ref(), out);
            vector(s.rotation.as_ref(), out);
        }
        Some(Target::Hold(_)) | None => {}
    }
    out.resize(start + 7, f64::NAN);
}

pub(super) fn base(base: Option<&v1::BaseCommand>, out: &mut Vec<f64>) {
    match base {
        Some(b) => out.extend([b.linear, b.angular]),
        None => out.extend([f64::NAN; 2]),
    }
}

/// Opening in metres, knuckle angle in radians, force cap in newtons.
pub(super) fn gripper(gripper: Option<&v1::GripperCommand>, out: &mut Vec<f64>) {
    use v1::gripper_command::Target;
    let target = gripper.and_then(|g| g.target.as_ref());
    out.push(match target {
        Some(Target::Opening(m)) => *m,
        _ => f64::NAN,
    });
    out.push(match target {
        Some(Target::Knuckle(q)) => *q,
        _ => f64::NAN,
    });
    out.push(gripper.and_then(|g| g.max_force).unwrap_or(f64::NAN));
}

/// Touching pairs as a JSON list of two names each.
pub(super) fn pairs(pairs: impl Iterator<Item = [String; 2]>) -> String {
    let list: Vec<[String; 2]> = pairs.take(super::MAX_CONTACTS).collect();
    serde_json::json!(list).to_string()
}

/// The pairs of such a list.
pub(super) fn to_pairs(text: &str) -> Result<Vec<[String; 2]>, String> {
    match text {
        "" => Ok(Vec::new()),
        text => serde_json::from_str(text).map_err(|e| format!("pairs of contacts: {e}")),
    }
}

/// Name of a phase, lower case.
pub(super) fn phase(value: i32) -> String {
    match v1::Phase::try_from(value) {
        Ok(v1::Phase::Unspecified) => "",
        Ok(v1::Phase::Navigating) => "navigating",
        Ok(v1::Phase::Reaching) => "reaching",
        Ok(v1::Phase::Grasping) => "grasping",
        Ok(v1::Phase::Retracting) => "retracting",
        Err(_) => "unknown",
    }
    .to_owned()
}

/// Device of a command in words; empty when it is not set.
pub(super) fn device(command: Option<&v1::Command>) -> String {
    command.map_or_else(String::new, |c| c.device().word())
}

/// Input mode of a command in words; empty when it is not set.
pub(super) fn mode(command: Option<&v1::Command>) -> String {
    command.map_or_else(String::new, |c| c.mode().word())
}

/// Assistance of a command in words; empty without.
pub(super) fn assistance(command: Option<&v1::Command>) -> String {
    command.map_or_else(String::new, |c| c.assistance().word())
}
