//! Observation of the operator: the newest sample of every stream it needs, collected
//! at each clock.

use nalgebra::Isometry3;
use wheelarm_proto::check::Invalid;
use wheelarm_proto::exact;
use wheelarm_proto::geometry::normalized;
use wheelarm_proto::robot::Roles;
use wheelarm_proto::topic::Sample;
use wheelarm_proto::{TopicId, v1};

use wheelarm_planning::footprint_check::Pose2;

/// Streams of an observation; the clock is the last sample of a tick.
pub const STREAMS: [TopicId; 8] = [
    TopicId::JointState,
    TopicId::Pose,
    TopicId::ObjectPose,
    TopicId::FurnitureJoint,
    TopicId::Contact,
    TopicId::Evaluation,
    TopicId::Applied,
    TopicId::Person,
];

/// State of the world at one control tick.
#[derive(Clone, Debug, PartialEq)]
pub struct Observation {
    /// Seconds of simulation time.
    pub time: f64,
    /// `wheelchair_root` in `house`.
    pub house_from_chair: Isometry3<f64>,
    /// Speed of the chair along the floor, m/s, and turn rate, rad/s.
    pub chair_speed: [f64; 2],
    /// End effector in `base_link`.
    pub base_from_tool: Isometry3<f64>,
    /// Positions of the arm's joints, from base to hand, radians.
    pub arm: [f64; 6],
    /// Target of the server for the end effector, in `base_link`.
    pub base_from_desired: Option<Isometry3<f64>>,
    /// Empty, or why the arm does not follow.
    pub arm_problem: String,
    /// The knuckle, rad.
    pub knuckle: f64,
    /// Normal force at the left and the right pad, N.
    pub pad_force: [f64; 2],
    /// Objects in `house`.
    pub objects: Vec<Isometry3<f64>>,
    /// The mouth of the seated person, in `house`, x out of it.
    pub mouth: Option<Isometry3<f64>>,
    /// Force of the robot on the person in the chair, N; 0 without a person.
    pub person_force: f64,
    /// Force on lap and hands of the person in the chair, N; 0 without a person.
    pub lap_force: f64,
    /// Positions of the furniture's joints, metres.
    pub slides: Vec<f64>,
    /// All required conditions hold.
    pub success: bool,
    /// The task is over.
    pub done: bool,
    /// Why it failed.
    pub failure: String,
}

impl Observation {
    /// The chair on the floor.
    #[must_use]
    pub fn chair(&self) -> Pose2 {
        let forward = self.house_from_chair.rotation * nalgebra::Vector3::x();
        Pose2 {
            x: self.house_from_chair.translation.x,
            y: self.house_from_chair.translation.y,
            heading: exact::atan2(forward.y, forward.x),
        }
    }
}

/// Collects samples until a clock completes them.
#[derive(Clone, Debug)]
pub struct Collector {
    roles: Roles,
    joints: Option<v1::JointState>,
    poses: Option<v1::PoseSet>,
    objects: Option<v1::ObjectPoses>,
    slides: Option<v1::FurnitureJoints>,
    contacts: Option<v1::Contacts>,
    evaluation: Option<v1::Evaluation>,
    applied: Option<v1::Applied>,
    person: Option<v1::PersonState>,
}

impl Collector {
    /// An empty collector for a robot whose joints and frames have the indices `roles`.
    #[must_use]
    pub fn new(roles: Roles) -> Self {
        Self {
            roles,
            joints: None,
            poses: None,
            objects: None,
            slides: None,
            contacts: None,
            evaluation: None,
            applied: None,
            person: None,
        }
    }

    /// Takes a sample; others than those of [`STREAMS`] are left alone.
    pub fn take(&mut self, sample: Sample) {
        match sample {
            Sample::JointState(s) => self.joints = Some(s),
            Sample::Pose(s) => self.poses = Some(s),
            Sample::ObjectPose(s) => self.objects = Some(s),
            Sample::FurnitureJoint(s) => self.slides = Some(s),
            Sample::Contact(s) => self.contacts = Some(s),
            Sample::Evaluation(s) => self.evaluation = Some(s),
            Sample::Applied(s) => self.applied = Some(s),
            Sample::Person(s) => self.person = Some(s),
            _ => {}
        }
    }

    /// The newest evaluation of the task; an empty one before the first.
    #[must_use]
    pub fn evaluation(&self) -> v1::Evaluation {
        self.evaluation.clone().unwrap_or_default()
    }

    /// The observation at a clock; `None` until every needed stream has come.
    ///
    /// # Errors
    /// [`Invalid`] when a pose or a list violates the contract.
    pub fn observe(&self, stamp_nanos: u64) -> Result<Option<Observation>, Invalid> {
        let (Some(joints), Some(poses), Some(objects)) = (&self.joints, &self.poses, &self.objects)
        else {
            return Ok(None);
        };
        let frame = |index: usize| poses.frames.get(index).cloned().unwrap_or_default();
        let twist = frame(self.roles.chair).twist.unwrap_or_default();
        let linear = twist.linear.unwrap_or_default();
        let evaluation = self.evaluation();
        let pads = self.contacts.as_ref().map_or(&[][..], |c| &c.pad_forces);
        let desired = self
            .applied
            .as_ref()
            .and_then(|applied| applied.desired_pose.as_ref())
            .map(|pose| normalized("desired pose", Some(pose)))
            .transpose()?;
        Ok(Some(Observation {
            time: stamp_nanos as f64 * 1e-9,
            house_from_chair: normalized(
                "pose of the chair",
                frame(self.roles.chair).pose.as_ref(),
            )?,
            chair_speed: [
                exact::hypot(linear.x, linear.y),
                twist.angular.unwrap_or_default().z,
            ],
            base_from_tool: normalized(
                "pose of the end effector",
                frame(self.roles.end_effector).pose.as_ref(),
            )?,
            arm: self
                .roles
                .arm
                .map(|index| joints.positions.get(index).copied().unwrap_or(0.0)),
            base_from_desired: desired,
            arm_problem: self
                .applied
                .as_ref()
                .map(|applied| applied.arm_problem.clone())
                .unwrap_or_default(),
            knuckle: joints
                .positions
                .get(self.roles.knuckle)
                .copied()
                .unwrap_or(0.0),
            pad_force: [
                pads.first().copied().unwrap_or(0.0),
                pads.get(1).copied().unwrap_or(0.0),
            ],
            objects: objects
                .poses
                .iter()
                .map(|pose| normalized("pose of an object", Some(pose)))
                .collect::<Result<_, _>>()?,
            mouth: self
                .person
                .as_ref()
                .map(|person| normalized("pose of the mouth", person.mouth.as_ref()))
                .transpose()?,
            lap_force: self.person.as_ref().map_or(0.0, |person| {
                let on_part = |part: v1::BodyPart| {
                    let index = (part as usize).checked_sub(1);
                    index.and_then(|i| person.forces.get(i)).copied()
                };
                [v1::BodyPart::Lap, v1::BodyPart::Hands]
                    .into_iter()
                    .filter_map(on_part)
                    .sum()
            }),
            person_force: self.person.as_ref().map_or(0.0, |p| p.robot_force),
            slides: self
                .slides
                .as_ref()
                .map(|slides| slides.positions.clone())
                .unwrap_or_default(),
            success: evaluation.success,
            done: evaluation.done,
            failure: evaluation.failure,
        }))
    }
}
