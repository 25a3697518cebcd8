//! Between the messages of the contract and the types of the core. Everything
//! that enters goes through `wheelarm_proto::check` first.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use wheelarm_proto::check::{self, Invalid};
use wheelarm_proto::v1;

use super::language;
use crate::robot::RobotModel;
use crate::robot::control::{
    ArmIntent, ArmProblem, BaseIntent, ControlInput, GripperIntent, GripperMap, IntentFrame,
};
use crate::robot::kinematics;
use crate::scene::{FurnitureJoint, Placement, Resistance, Scene};
use crate::sensors::frames::RelativeState;
use crate::sim::{
    ALL_CAMERAS, CameraPlace, CameraSetting, Lens, MAX_SIZE, Quality, Scenario, Starts,
};
use crate::snapshot::{Anomaly, BodyRef, BodyState, Fault};
use crate::tasks;

/// A vector as a message.
pub fn vector(v: &Vector3<f64>) -> v1::Vector3 {
    v1::Vector3 {
        x: v.x,
        y: v.y,
        z: v.z,
    }
}

/// A rotation as a message.
pub fn quaternion(q: &UnitQuaternion<f64>) -> v1::Quaternion {
    v1::Quaternion {
        x: q.i,
        y: q.j,
        z: q.k,
        w: q.w,
    }
}

/// A pose as a message.
pub fn pose(p: &Isometry3<f64>) -> v1::Pose {
    v1::Pose {
        position: Some(vector(&p.translation.vector)),
        orientation: Some(quaternion(&p.rotation)),
    }
}

/// A twist as a message.
pub fn twist(linear: &Vector3<f64>, angular: &Vector3<f64>) -> v1::Twist {
    v1::Twist {
        linear: Some(vector(linear)),
        angular: Some(vector(angular)),
    }
}

/// A checked place in or about a home; bits are kept as in [`isometry`].
pub fn place(what: &'static str, p: Option<&v1::Pose>) -> Result<Isometry3<f64>, Invalid> {
    check::place(what, p)?;
    isometry(what, p)
}

/// A checked pose; bits are kept where the quaternion is already of unit length.
pub fn isometry(what: &'static str, p: Option<&v1::Pose>) -> Result<Isometry3<f64>, Invalid> {
    let ([x, y, z], [i, j, k, w]) = check::pose(what, p)?;
    let rotation = UnitQuaternion::new_unchecked(Quaternion::new(w, i, j, k));
    Ok(Isometry3::from_parts(Translation3::new(x, y, z), rotation))
}

/// One recorded frame as a message.
pub fn frame_pose(state: &RelativeState) -> v1::FramePose {
    v1::FramePose {
        pose: Some(pose(&state.pose)),
        twist: Some(twist(&state.linear, &state.angular)),
    }
}

/// Velocity of a body as a message.
pub fn body_twist(state: &BodyState) -> v1::Twist {
    twist(&state.linear, &state.angular)
}

fn frame_from(value: i32) -> IntentFrame {
    match v1::CommandFrame::try_from(value) {
        Ok(v1::CommandFrame::EndEffector) => IntentFrame::EndEffector,
        Ok(v1::CommandFrame::Wheelchair) => IntentFrame::Wheelchair,
        Ok(v1::CommandFrame::House) => IntentFrame::House,
        _ => IntentFrame::ArmBase,
    }
}

fn frame_to(frame: IntentFrame) -> i32 {
    let frame = match frame {
        IntentFrame::ArmBase => v1::CommandFrame::BaseLink,
        IntentFrame::EndEffector => v1::CommandFrame::EndEffector,
        IntentFrame::Wheelchair => v1::CommandFrame::Wheelchair,
        IntentFrame::House => v1::CommandFrame::House,
    };
    frame as i32
}

/// Reads the groups of a command that has passed `check::command`, and holds
/// what it asks of the gripper against the robot's ranges.
///
/// # Errors
/// [`Invalid`] that names the field.
pub fn control_input(command: &v1::Command, map: &GripperMap) -> Result<ControlInput, Invalid> {
    Ok(ControlInput {
        arm: command.arm.as_ref().map(arm_intent).transpose()?,
        base: command.base.as_ref().map(|b| BaseIntent {
            linear: b.linear,
            angular: b.angular,
        }),
        gripper: command
            .gripper
            .as_ref()
            .map(|g| gripper_intent(g, map))
            .transpose()?,
    })
}

fn arm_intent(arm: &v1::ArmCommand) -> Result<ArmIntent, Invalid> {
    use v1::arm_command::Target;
    Ok(
        match arm.target.as_ref().ok_or(Invalid::Missing("arm target"))? {
            Target::Joints(j) => {
                ArmIntent::Joints(check::list("arm joint position", &j.positions)?)
            }
            Target::Pose(p) => ArmIntent::Pose {
                frame: frame_from(p.frame),
                pose: isometry("arm pose", p.pose.as_ref())?,
            },
            Target::Twist(t) => {
                let twist = t.twist.as_ref().ok_or(Invalid::Missing("arm twist"))?;
                ArmIntent::Twist {
                    frame: frame_from(t.frame),
                    linear: check::vector("arm linear velocity", twist.linear.as_ref())?.into(),
                    angular: check::vector("arm angular velocity", twist.angular.as_ref())?.into(),
                }
            }
            Target::Step(s) => ArmIntent::Step {
                frame: frame_from(s.frame),
                translation: check::vector("arm step translation", s.translation.as_ref())?.into(),
                rotation: check::vector("arm step rotation", s.rotation.as_ref())?.into(),
            },
            Target::Hold(_) => ArmIntent::Hold,
        },
    )
}

fn gripper_intent(
    command: &v1::GripperCommand,
    map: &GripperMap,
) -> Result<GripperIntent, Invalid> {
    use v1::gripper_command::Target;
    let target = command
        .target
        .as_ref()
        .ok_or(Invalid::Missing("gripper target"))?;
    let most = map.max_knuckle();
    let knuckle = match target {
        // The linkage may open a hair less than the stroke that may be asked, and
        // close at a hair more than the knuckle may.
        Target::Opening(metres) => {
            let metres = check::within("gripper opening", *metres, 0.0, map.stroke())?;
            map.knuckle(metres).clamp(0.0, most)
        }
        Target::Knuckle(radians) => check::within("gripper knuckle angle", *radians, 0.0, most)?,
    };
    if let Some(cap) = command.max_force {
        check::within("gripper force", cap, 0.0, map.max_force())?;
    }
    Ok(GripperIntent {
        knuckle,
        max_force: command.max_force,
    })
}

/// The input of a control tick as the groups of a command: what a replay sends.
pub fn applied_groups(
    input: &ControlInput,
) -> (
    Option<v1::ArmCommand>,
    Option<v1::BaseCommand>,
    Option<v1::GripperCommand>,
) {
    let base = input.base.map(|b| v1::BaseCommand {
        linear: b.linear,
        angular: b.angular,
    });
    let gripper = input.gripper.map(|g| v1::GripperCommand {
        target: Some(v1::gripper_command::Target::Knuckle(g.knuckle)),
        max_force: g.max_force,
    });
    (input.arm.as_ref().map(arm_command), base, gripper)
}

fn arm_command(intent: &ArmIntent) -> v1::ArmCommand {
    use v1::arm_command::Target;
    let target = match intent {
        ArmIntent::Joints(q) => Target::Joints(v1::JointTarget {
            positions: q.to_vec(),
        }),
        ArmIntent::Pose { frame, pose: p } => Target::Pose(v1::CartesianTarget {
            frame: frame_to(*frame),
            pose: Some(pose(p)),
        }),
        ArmIntent::Twist {
            frame,
            linear,
            angular,
        } => Target::Twist(v1::CartesianTwist {
            frame: frame_to(*frame),
            twist: Some(twist(linear, angular)),
        }),
        ArmIntent::Step {
            frame,
            translation,
            rotation,
        } => Target::Step(v1::CartesianStep {
            frame: frame_to(*frame),
            translation: Some(vector(translation)),
            rotation: Some(vector(rotation)),
        }),
        ArmIntent::Hold => Target::Hold(true),
    };
    v1::ArmCommand {
        target: Some(target),
    }
}

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
    }
}

/// Why the arm does not follow, as a message tells it.
pub fn arm_problem(problem: Option<ArmProblem>) -> v1::ArmProblem {
    match problem {
        None => v1::ArmProblem::None,
        Some(ArmProblem::Unreachable) => v1::ArmProblem::Unreachable,
        Some(ArmProblem::JointLimit) => v1::ArmProblem::JointLimit,
        Some(ArmProblem::Stalled) => v1::ArmProblem::Stalled,
        Some(ArmProblem::Hindered) => v1::ArmProblem::Hindered,
    }
}

/// Why a pose is not reached, as a message tells it.
pub fn reach_problem(reason: kinematics::Reason) -> v1::ReachProblem {
    use kinematics::Reason;
    match reason {
        Reason::TooFar { .. } => v1::ReachProblem::TooFar,
        Reason::Limits(_) => v1::ReachProblem::JointLimits,
        Reason::NoSolution => v1::ReachProblem::NoSolution,
        Reason::Jump(..) => v1::ReachProblem::Jump,
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
    };
    name.cloned().unwrap_or_default()
}

/// Furniture that slides, as a message.
pub fn furniture_joint(joint: &FurnitureJoint, scene: &Scene) -> v1::FurnitureJoint {
    let body = scene.furniture.get(joint.furniture);
    v1::FurnitureJoint {
        name: joint.name.clone(),
        body: body.map(|b| b.name.clone()).unwrap_or_default(),
        rest: body.map(|b| pose(&b.pose)),
        axis: Some(vector(&joint.axis)),
        travel: joint.travel,
        r#type: v1::JointType::Prismatic.into(),
    }
}

/// What is to be done, for programs.
pub fn goal_kind(goal: &tasks::Goal) -> v1::GoalKind {
    match goal {
        tasks::Goal::Lift => v1::GoalKind::Lift,
        tasks::Goal::Put { .. } => v1::GoalKind::Put,
        tasks::Goal::Open { .. } => v1::GoalKind::Open,
        tasks::Goal::Close { .. } => v1::GoalKind::Close,
    }
}

/// What a task asks for, as a message.
pub fn goal(goal: &tasks::Goal, target: &str, scene: &Scene) -> v1::TaskGoal {
    let mut message = v1::TaskGoal {
        kind: goal_kind(goal).into(),
        target: target.to_owned(),
        ..v1::TaskGoal::default()
    };
    match goal {
        tasks::Goal::Lift => {}
        tasks::Goal::Put { on } => {
            message.region = scene
                .surface_named(on, None)
                .map(|surface| v1::BoxGeometry {
                    pose: Some(pose(&surface.centre())),
                    half: Some(vector(&nalgebra::Vector3::new(
                        surface.depth / 2.0,
                        surface.width / 2.0,
                        0.0,
                    ))),
                });
        }
        tasks::Goal::Open { travel: position } | tasks::Goal::Close { position } => {
            let joint = scene
                .furniture_named(target)
                .and_then(|i| scene.joint_of(i));
            message.joint = joint.map_or(String::new(), |joint| joint.name.clone());
            message.position = *position;
        }
    }
    message
}

/// A scenario as a message.
pub fn scenario(s: &Scenario) -> v1::Scenario {
    v1::Scenario {
        scene: s.scene.clone(),
        task: Some(s.task.clone()),
        seed: Some(s.seed),
        robot: s.robot.clone(),
        cameras: s
            .cameras
            .iter()
            .map(|c| v1::CameraSetting {
                name: c.name.clone(),
                width: c.size[0],
                height: c.size[1],
                rate_hz: Some(c.rate_hz),
                lens: c.lens.map(|lens| v1::Intrinsics {
                    width: lens.size[0],
                    height: lens.size[1],
                    fx: lens.focal[0],
                    fy: lens.focal[1],
                    cx: lens.principal[0],
                    cy: lens.principal[1],
                }),
                place: c.place.as_ref().map(|place| v1::CameraPlace {
                    frame: place.frame.clone(),
                    pose: Some(pose(&place.pose)),
                }),
            })
            .collect(),
        state_rate_hz: Some(s.state_rate_hz),
        deformable_rate_hz: Some(s.deformable_rate_hz),
        imu_rate_hz: Some(s.imu_rate_hz),
        pacing: s.pacing.code().into(),
        quality: s.quality.code().into(),
        imu_noise: Some(s.imu_noise),
        objects: s
            .objects
            .iter()
            .map(|(name, p)| v1::ObjectPlacement {
                name: name.clone(),
                pose: Some(pose(&p.pose)),
                mass: Some(p.mass),
                friction: Some(p.friction),
            })
            .collect(),
        slides: s
            .slides
            .iter()
            .map(|(joint, r, position)| v1::SlideResistance {
                joint: joint.clone(),
                friction: Some(r.friction),
                damping: Some(r.damping),
                position: Some(*position),
            })
            .collect(),
        start: s.start.as_ref().map(pose),
        instruction: Some(s.instruction.clone()),
        language: s.language.as_ref().map(language::told),
        target: Some(s.target.clone()),
        calibration_seed: s.calibration_seed,
        starts: s.starts.code().into(),
        arm_positions: s.arm.map(Vec::from).unwrap_or_default(),
        knuckle: s.knuckle,
        variant: s.variant.clone(),
        variant_share: s.variant_share,
    }
}

/// A camera that is asked for.
fn camera(asked: &v1::CameraSetting) -> Result<CameraSetting, Invalid> {
    let lens = |lens: &v1::Intrinsics| {
        let size = [lens.width, lens.height];
        let side = f64::from(MAX_SIZE);
        for pixels in size {
            check::within("lens size", f64::from(pixels), 1.0, side)?;
        }
        Ok(Lens {
            size,
            focal: [
                check::within("lens fx", lens.fx, 1.0, 100.0 * side)?,
                check::within("lens fy", lens.fy, 1.0, 100.0 * side)?,
            ],
            principal: [
                check::within("lens cx", lens.cx, -side, 2.0 * side)?,
                check::within("lens cy", lens.cy, -side, 2.0 * side)?,
            ],
        })
    };
    let placed = |place_of: &v1::CameraPlace| {
        check::name("camera place frame", &place_of.frame)?;
        Ok(CameraPlace {
            frame: place_of.frame.clone(),
            pose: place("camera place", place_of.pose.as_ref())?,
        })
    };
    Ok(CameraSetting {
        name: asked.name.clone(),
        size: [asked.width, asked.height],
        rate_hz: asked.rate_hz.unwrap_or(CAMERA_HZ),
        lens: asked.lens.as_ref().map(lens).transpose()?,
        place: asked.place.as_ref().map(placed).transpose()?,
    })
}

/// Rate of a camera whose rate is not told, Hz.
const CAMERA_HZ: f64 = 10.0;

/// Says of which entry of a list an error is.
fn of(what: &'static str, name: &str) -> impl Fn(Invalid) -> Invalid {
    let place = format!("{what} {name:?}");
    move |source| Invalid::In {
        place: place.clone(),
        source: Box::new(source),
    }
}

/// A number that must be told, within bounds.
fn number(what: &'static str, told: Option<f64>, low: f64, high: f64) -> Result<f64, Invalid> {
    check::within(what, told.ok_or(Invalid::Missing(what))?, low, high)
}

/// Keeps what is new, if anything is.
fn keep<T>(old: &mut T, new: Option<T>) {
    if let Some(new) = new {
        *old = new;
    }
}

/// Most cameras, objects and slides that a scenario may name.
const MOST: [usize; 3] = [16, 256, 256];

/// Checks the lengths of all that a scenario message names.
fn bounded(asked: &v1::Scenario) -> Result<(), Invalid> {
    check::few("cameras", &asked.cameras, MOST[0])?;
    check::few("objects", &asked.objects, MOST[1])?;
    check::few("slides", &asked.slides, MOST[2])?;
    check::instruction(asked.instruction())?;
    let given = [
        ("scene name", asked.scene.as_str()),
        ("task name", asked.task()),
        ("robot name", asked.robot.as_str()),
        ("target", asked.target()),
    ];
    let given = given.into_iter().chain([("variant", asked.variant())]);
    for (what, name) in given.filter(|(_, name)| !name.is_empty()) {
        check::name(what, name)?;
    }
    let cameras = asked.cameras.iter().map(|c| ("camera name", &c.name));
    let cameras = cameras.filter(|(_, name)| *name != ALL_CAMERAS);
    let objects = asked.objects.iter().map(|o| ("object name", &o.name));
    let slides = asked.slides.iter().map(|s| ("slide name", &s.joint));
    for (what, name) in cameras.chain(objects).chain(slides) {
        check::name(what, name)?;
    }
    Ok(())
}

/// Applies a scenario message over the scenario in force: what is absent keeps
/// its value. A scene, task, robot or seed that is given, be it the same, draws
/// anew what is not given.
///
/// # Errors
/// [`Invalid`] that names the field.
pub fn scenario_over(now: &Scenario, asked: &v1::Scenario) -> Result<Scenario, Invalid> {
    bounded(asked)?;
    let mut s = now.clone();
    let pacing = scenario(now).pacing;
    if asked.pacing != 0 && asked.pacing != pacing {
        return Err(Invalid::Word {
            what: "pacing",
            value: asked.pacing.to_string(),
            expected: "the pacing that the server was started with; start another server for another",
        });
    }
    let named = !asked.scene.is_empty() || !asked.robot.is_empty();
    let elsewhere = Starts::told(asked.starts()).is_some_and(|starts| starts != now.starts);
    let other = asked.variant.is_some() && asked.variant != now.variant;
    let anew = asked.task.is_some() || asked.seed.is_some() || elsewhere || other;
    if named || anew {
        s.objects.clear();
        s.slides.clear();
        s.start = None;
        s.instruction.clear();
        if let Some(language) = &mut s.language {
            language.template.clear();
            language.question.clear();
        }
        s.target.clear();
        s.variant = None;
        s.arm = None;
        s.knuckle = None;
    }
    if !asked.robot.is_empty() && asked.robot != now.robot {
        s.cameras = Scenario::all_cameras();
    }
    let given = |new: &str| (!new.is_empty()).then(|| new.to_owned());
    keep(&mut s.scene, given(&asked.scene));
    keep(&mut s.robot, given(&asked.robot));
    keep(&mut s.task, asked.task.clone());
    keep(&mut s.seed, asked.seed);
    keep(&mut s.instruction, asked.instruction.clone());
    if let Some(asked) = &asked.language {
        s.language = Some(language::asked(asked)?);
    }
    // Another way to say it: the sentence is drawn anew.
    if asked.language.is_some() && asked.instruction.is_none() {
        s.instruction.clear();
    }
    keep(&mut s.target, asked.target.clone());
    keep(&mut s.variant, asked.variant.clone().map(Some));
    if let Some(share) = asked.variant_share {
        s.variant_share = Some(check::within("variant_share", share, 0.0, 1.0)?);
    }
    keep(&mut s.imu_noise, asked.imu_noise);
    keep(&mut s.state_rate_hz, asked.state_rate_hz);
    keep(&mut s.deformable_rate_hz, asked.deformable_rate_hz);
    keep(&mut s.imu_rate_hz, asked.imu_rate_hz);
    let rates = [
        ("state_rate_hz", s.state_rate_hz),
        ("deformable_rate_hz", s.deformable_rate_hz),
        ("imu_rate_hz", s.imu_rate_hz),
    ];
    for (what, rate) in rates {
        check::finite(what, rate)?;
    }
    if !asked.cameras.is_empty() {
        s.cameras = asked
            .cameras
            .iter()
            .map(camera)
            .collect::<Result<_, Invalid>>()?;
    } else if asked.calibration_seed.is_some() {
        // Another specimen: what was drawn for the one before goes.
        for camera in &mut s.cameras {
            (camera.lens, camera.place) = (None, None);
        }
    }
    s.calibration_seed = asked.calibration_seed.or(s.calibration_seed);
    match v1::RenderQuality::try_from(asked.quality) {
        Ok(code) => keep(&mut s.quality, Quality::told(code)),
        Err(_) => {
            return Err(Invalid::Word {
                what: "quality",
                value: asked.quality.to_string(),
                expected: "a value of wheelarm.v1.RenderQuality",
            });
        }
    }
    match v1::Starts::try_from(asked.starts) {
        Ok(code) => keep(&mut s.starts, Starts::told(code)),
        Err(_) => {
            return Err(Invalid::Word {
                what: "starts",
                value: asked.starts.to_string(),
                expected: "a value of wheelarm.v1.Starts",
            });
        }
    }
    if !asked.arm_positions.is_empty() {
        s.arm = Some(check::list("arm_positions", &asked.arm_positions)?);
    }
    if let Some(knuckle) = asked.knuckle {
        s.knuckle = Some(check::within("knuckle", knuckle, 0.0, 3.2)?);
    }
    if let Some(start) = &asked.start {
        s.start = Some(place("start", Some(start))?);
    }
    let objects = asked
        .objects
        .iter()
        .map(|o| {
            let placed = || {
                Ok(Placement {
                    pose: place("pose", o.pose.as_ref())?,
                    mass: number("mass", o.mass, 1e-4, 1e3)?,
                    friction: number("friction", o.friction, 0.0, 10.0)?,
                })
            };
            Ok((o.name.clone(), placed().map_err(of("object", &o.name))?))
        })
        .collect::<Result<Vec<_>, Invalid>>()?;
    let slides = asked
        .slides
        .iter()
        .map(|slide| {
            let resistance = || {
                Ok(Resistance {
                    friction: number("friction", slide.friction, 0.0, 1e3)?,
                    damping: number("damping", slide.damping, 0.0, 1e4)?,
                })
            };
            let place = of("slide", &slide.joint);
            let position = || number("position", slide.position.or(Some(0.0)), 0.0, 10.0);
            Ok((
                slide.joint.clone(),
                resistance().map_err(&place)?,
                position().map_err(&place)?,
            ))
        })
        .collect::<Result<Vec<_>, Invalid>>()?;
    keep(&mut s.objects, (!objects.is_empty()).then_some(objects));
    keep(&mut s.slides, (!slides.is_empty()).then_some(slides));
    Ok(s)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn in_force() -> Scenario {
        let placed = Placement {
            pose: Isometry3::translation(1.0, 2.0, 0.5),
            mass: 0.3,
            friction: 0.6,
        };
        Scenario {
            seed: 7,
            imu_noise: true,
            instruction: "bring it".to_owned(),
            target: "mustard".to_owned(),
            objects: vec![("mustard".to_owned(), placed)],
            start: Some(Isometry3::identity()),
            ..Scenario::default()
        }
    }

    #[test]
    fn what_a_reset_does_not_say_stays_as_it_is() {
        let now = in_force();
        assert_eq!(
            scenario_over(&now, &v1::Scenario::default()),
            Ok(now.clone())
        );
        assert_eq!(scenario_over(&now, &scenario(&now)), Ok(now.clone()));
        let asked = v1::Scenario {
            imu_rate_hz: Some(0.0),
            imu_noise: Some(false),
            ..v1::Scenario::default()
        };
        let got = scenario_over(&now, &asked).unwrap();
        assert_eq!((got.imu_rate_hz, got.imu_noise, got.seed), (0.0, false, 7));
        assert_eq!(got.objects, now.objects);
        assert_eq!(got.state_rate_hz, now.state_rate_hz);
    }

    #[test]
    fn a_seed_that_is_given_draws_anew_what_is_not() {
        let now = in_force();
        let asked = v1::Scenario {
            seed: Some(7),
            target: Some("can".to_owned()),
            ..v1::Scenario::default()
        };
        let got = scenario_over(&now, &asked).unwrap();
        assert!(got.objects.is_empty() && got.start.is_none() && got.instruction.is_empty());
        assert_eq!(
            (got.seed, got.target.as_str(), got.imu_noise),
            (7, "can", true)
        );
        let none = v1::Scenario {
            task: Some(String::new()),
            ..v1::Scenario::default()
        };
        assert_eq!(scenario_over(&now, &none).unwrap().task, "");
    }
}
