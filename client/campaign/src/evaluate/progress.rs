//! How far an episode came, in steps that every attempt at a task goes through,
//! whoever makes it: told from what the server publishes, never from what an operator
//! or a policy says. Pure: samples in, a course out.

use nalgebra::{Isometry3, Point3};
use serde::{Deserialize, Serialize};
use wheelarm_proto::check::Invalid;
use wheelarm_proto::geometry::normalized;
use wheelarm_proto::robot::Roles;
use wheelarm_proto::topic::Sample;
use wheelarm_proto::{TopicId, v1};

/// Streams that a course is told from.
pub const STREAMS: [TopicId; 6] = [
    TopicId::Pose,
    TopicId::ObjectPose,
    TopicId::FurnitureJoint,
    TopicId::Contact,
    TopicId::Evaluation,
    TopicId::Event,
];

/// The chair stands below this speed, m/s.
const SLOW: f64 = 0.02;
/// And below this turn rate, rad/s.
const STEADY: f64 = 0.03;
/// For so long, nanoseconds.
const REST: u64 = 250_000_000;
/// A pad presses from this force, N.
const PRESSES: f64 = 0.5;
/// A thing is lifted when it is this much higher than it stood, metres.
const LIFTED: f64 = 0.02;
/// A slide has moved when it went this far the right way, metres.
const MOVED: f64 = 0.01;

/// A step on the way to a goal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Milestone {
    /// The chair stood still with the target in the arm's range.
    InReach,
    /// The hand touched the target.
    Touched,
    /// Both pads pressed it.
    Gripped,
    /// It was off its place, in the grip.
    Lifted,
    /// What is to be put somewhere was above the place.
    OverRegion,
    /// The slide moved the right way.
    Moved,
    /// It came half the way.
    HalfWay,
    /// The task's conditions held at its end.
    Done,
}

impl Milestone {
    /// In words.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::InReach => "stopped in reach",
            Self::Touched => "touched",
            Self::Gripped => "both pads",
            Self::Lifted => "lifted",
            Self::OverRegion => "over the region",
            Self::Moved => "moved",
            Self::HalfWay => "half way",
            Self::Done => "done",
        }
    }
}

/// The steps to a kind of goal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Way {
    /// There is no task.
    #[default]
    None,
    /// A thing is lifted and held.
    Lift,
    /// A thing is put somewhere.
    Put,
    /// A slide is opened or closed.
    Slide,
}

impl Way {
    fn to(goal: v1::GoalKind) -> Self {
        match goal {
            v1::GoalKind::Unspecified => Self::None,
            // What is handed over is lifted; where to, moves with the chair.
            v1::GoalKind::Lift | v1::GoalKind::Give | v1::GoalKind::Bring => Self::Lift,
            v1::GoalKind::Put => Self::Put,
            v1::GoalKind::Open | v1::GoalKind::Close => Self::Slide,
        }
    }

    /// The steps in their order, and what share of the way each is, percent.
    #[must_use]
    pub fn steps(self) -> &'static [(Milestone, u8)] {
        use Milestone as M;
        match self {
            Self::None => &[(M::Done, 100)],
            Self::Lift => &[
                (M::InReach, 20),
                (M::Touched, 40),
                (M::Gripped, 60),
                (M::Lifted, 80),
                (M::Done, 100),
            ],
            Self::Put => &[
                (M::InReach, 15),
                (M::Touched, 30),
                (M::Gripped, 45),
                (M::Lifted, 60),
                (M::OverRegion, 80),
                (M::Done, 100),
            ],
            Self::Slide => &[
                (M::InReach, 20),
                (M::Touched, 40),
                (M::Moved, 60),
                (M::HalfWay, 80),
                (M::Done, 100),
            ],
        }
    }
}

/// How far an episode came.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Course {
    /// The steps that its goal has.
    pub way: Way,
    /// The furthest step that was reached, percent of the way.
    pub percent: u8,
    /// Steps that were reached, and simulated seconds into the episode, in the order
    /// of the way.
    pub reached: Vec<(Milestone, f64)>,
    /// The first step of the way after the furthest that was reached; absent at the
    /// goal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub missing: Option<Milestone>,
    /// Pairs of bodies that hit each other hard.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub hard_contacts: Vec<String>,
}

/// Follows one episode.
#[derive(Clone, Debug)]
pub struct Follower {
    sought: Sought,
    roles: Roles,
    /// Newest of each.
    chair: Option<Isometry3<f64>>,
    speeds: [f64; 2],
    objects: Vec<Isometry3<f64>>,
    slides: Vec<f64>,
    pads: [f64; 2],
    touching: bool,
    /// The number of the episode and the stamp of its beginning, nanoseconds.
    episode: (u64, u64),
    since: Option<u64>,
    /// Height of the target at the beginning, metres, or position of the slide.
    began: Option<f64>,
    reached: Vec<(Milestone, f64)>,
    hard: Vec<String>,
}

/// What is sought, as the scene tells it.
#[derive(Clone, Debug, PartialEq)]
struct Sought {
    way: Way,
    target: String,
    /// Index among the objects; absent for a slide.
    object: Option<usize>,
    /// Index among the slides, its pose at 0 and its axis.
    slide: Option<(usize, Isometry3<f64>, [f64; 3])>,
    /// Wanted position of the slide, metres.
    position: f64,
    /// Where it is to be put: pose of the middle and half sides along x and y.
    region: Option<(Isometry3<f64>, [f64; 2])>,
    /// Where it is taken, in its own frame.
    grasps: Vec<Point3<f64>>,
    chair_from_base: Isometry3<f64>,
    /// Greatest distance on the floor plan at which the arm takes things, metres.
    range: f64,
    hand: Vec<String>,
}

impl Follower {
    /// Follows the episode that begins after this, of the scene's task.
    ///
    /// # Errors
    /// [`Invalid`] that names what is not as the contract says.
    pub fn new(scene: &v1::SceneReply) -> Result<Self, Invalid> {
        let robot = scene.robot.as_ref();
        let robot = robot.ok_or(Invalid::Missing("description of the robot"))?;
        let goal = scene.goal.clone().unwrap_or_default();
        let slide = scene.joints.iter().enumerate();
        let way = Way::to(goal.kind());
        let slide = slide
            .filter(|(_, joint)| way == Way::Slide && joint.name == goal.joint)
            .map(|(index, joint)| {
                let axis = joint.axis.unwrap_or_default();
                let rest = normalized("rest pose of a joint", joint.rest.as_ref())?;
                Ok((index, rest, [axis.x, axis.y, axis.z]))
            })
            .next()
            .transpose()?;
        let region = goal.region.map(|region| {
            let half = region.half.unwrap_or_default();
            let pose = normalized("pose of the region", region.pose.as_ref())?;
            Ok((pose, [half.x, half.y]))
        });
        let own = |grasp: &&v1::GraspFrame| grasp.object == goal.target;
        let mut grasps = Vec::new();
        for grasp in scene.grasps.iter().filter(own) {
            let pose = normalized("grasp pose", grasp.pose.as_ref())?;
            grasps.push(Point3::from(pose.translation.vector));
        }
        if grasps.is_empty() {
            grasps.push(Point3::origin());
        }
        let mut hand = vec![robot.end_effector_link.clone()];
        let fingers = robot.joints.iter().filter(|joint| {
            use v1::JointRole as Role;
            matches!(
                joint.role(),
                Role::Knuckle
                    | Role::KnuckleRight
                    | Role::FingerTipLeft
                    | Role::FingerTipRight
                    | Role::InnerKnuckleLeft
                    | Role::InnerKnuckleRight
            )
        });
        hand.extend(fingers.flat_map(|joint| {
            use v1::JointRole as Role;
            // What a finger's tip hangs on is fixed to its knuckle.
            let tip = matches!(joint.role(), Role::FingerTipLeft | Role::FingerTipRight);
            let bar = tip.then(|| joint.parent_link.clone());
            bar.into_iter().chain([joint.child_link.clone()])
        }));
        let last = robot
            .joints
            .iter()
            .filter(|j| j.role() == v1::JointRole::Arm);
        let last = last.max_by_key(|joint| joint.arm_index);
        hand.extend(last.map(|joint| joint.child_link.clone()));
        Ok(Self {
            roles: Roles::find(robot)?,
            sought: Sought {
                way,
                object: scene.objects.iter().position(|name| *name == goal.target),
                slide,
                position: goal.position,
                region: region.transpose()?,
                grasps,
                chair_from_base: normalized("arm mount", robot.arm_mount.as_ref())?,
                range: robot.reach.unwrap_or_default().furthest,
                hand,
                target: goal.target,
            },
            chair: None,
            speeds: [f64::INFINITY; 2],
            objects: Vec::new(),
            slides: Vec::new(),
            pads: [0.0; 2],
            touching: false,
            episode: (0, 0),
            since: None,
            began: None,
            reached: Vec::new(),
            hard: Vec::new(),
        })
    }

    /// Takes a sample; others than those of [`STREAMS`] are left alone.
    pub fn take(&mut self, sample: &Sample) {
        match sample {
            Sample::Pose(s) if self.is_of(s.header.as_ref()) => {
                let frame = s.frames.get(self.roles.chair).cloned().unwrap_or_default();
                self.chair = normalized("pose of the chair", frame.pose.as_ref()).ok();
                let twist = frame.twist.unwrap_or_default();
                let linear = twist.linear.unwrap_or_default();
                let turn = twist.angular.unwrap_or_default().z;
                self.speeds = [linear.x.hypot(linear.y), turn.abs()];
            }
            Sample::ObjectPose(s) if self.is_of(s.header.as_ref()) => {
                let poses = s.poses.iter();
                let poses = poses.filter_map(|p| normalized("pose of an object", Some(p)).ok());
                self.objects = poses.collect();
            }
            Sample::FurnitureJoint(s) if self.is_of(s.header.as_ref()) => {
                self.slides.clone_from(&s.positions);
            }
            Sample::Contact(s) if self.is_of(s.header.as_ref()) => {
                let pad = |i: usize| s.pad_forces.get(i).copied().unwrap_or(0.0);
                self.pads = [pad(0), pad(1)];
                self.touching = s.contacts.iter().any(|contact| {
                    let pair = [&contact.first, &contact.second];
                    pair.contains(&&self.sought.target)
                        && pair.iter().any(|name| self.sought.hand.contains(name))
                });
            }
            Sample::Event(s)
                if self.is_of(s.header.as_ref()) && s.kind() == v1::EventKind::Collision =>
            {
                self.hard.push(format!("{} on {}", s.body, s.other_body));
            }
            // Published after what it is about.
            Sample::Evaluation(s) if self.is_of(s.header.as_ref()) => {
                self.appearance(s.header.as_ref().map_or(0, |h| h.stamp_nanos));
            }
            _ => {}
        }
    }

    /// The course so far, of an episode that ended as `success` says.
    #[must_use]
    pub fn course(&self, success: bool, seconds: f64) -> Course {
        let mut reached = self.reached.clone();
        if success {
            reached.push((Milestone::Done, seconds));
        }
        let way = self.sought.way.steps();
        reached.sort_by_key(|(step, _)| *step);
        let furthest = way
            .iter()
            .rposition(|(step, _)| reached.iter().any(|(known, _)| known == step));
        Course {
            way: self.sought.way,
            percent: furthest.map_or(0, |at| way[at].1),
            missing: way
                .get(furthest.map_or(0, |at| at + 1))
                .map(|(step, _)| *step),
            reached,
            hard_contacts: self.hard.clone(),
        }
    }

    /// Whether it is of the newest episode that anything was heard of.
    fn is_of(&mut self, header: Option<&v1::Header>) -> bool {
        let Some(header) = header.filter(|header| header.episode > 0) else {
            return false;
        };
        if header.episode > self.episode.0 {
            self.episode = (header.episode, header.stamp_nanos);
            (self.since, self.began) = (None, None);
            (self.objects, self.slides) = (Vec::new(), Vec::new());
            self.reached.clear();
            self.hard.clear();
        }
        header.episode == self.episode.0
    }

    /// Where the target is, and a number that grows as it is lifted or opened.
    fn target(&self) -> Option<(Isometry3<f64>, f64)> {
        if let Some((index, rest, axis)) = &self.sought.slide {
            let position = *self.slides.get(*index)?;
            let way = nalgebra::Vector3::from(*axis) * position;
            return Some((nalgebra::Translation3::from(way) * rest, position));
        }
        let pose = *self.objects.get(self.sought.object?)?;
        Some((pose, pose.translation.z))
    }

    /// Notes what holds now.
    fn appearance(&mut self, stamp: u64) {
        let seconds = stamp.saturating_sub(self.episode.1) as f64 * 1e-9;
        let (Some(chair), Some((target, height))) = (self.chair, self.target()) else {
            return;
        };
        let began = *self.began.get_or_insert(height);
        let stands = self.speeds[0] < SLOW && self.speeds[1] < STEADY;
        self.since = match stands {
            true => self.since.or(Some(stamp)),
            false => None,
        };
        let base = chair * self.sought.chair_from_base;
        let near = self.sought.grasps.iter().any(|grasp| {
            let off = (target * grasp).coords - base.translation.vector;
            off.xy().norm() <= self.sought.range
        });
        let rested = self
            .since
            .is_some_and(|since| stamp.saturating_sub(since) >= REST);
        let gripped = self.touching && self.pads.iter().all(|force| *force > PRESSES);
        let lifted = gripped && self.sought.slide.is_none() && height - began > LIFTED;
        let over = self.sought.region.is_some_and(|(pose, half)| {
            let at = pose.inverse_transform_point(&target.translation.vector.into());
            at.x.abs() <= half[0] && at.y.abs() <= half[1]
        });
        let was_lifted = self.has(Milestone::Lifted) || lifted;
        let whole = self.sought.position - began;
        let way = (height - began) * whole.signum();
        let slides = self.sought.slide.is_some();
        for (step, holds) in [
            (Milestone::InReach, near && rested),
            (Milestone::Touched, self.touching),
            (Milestone::Gripped, gripped),
            (Milestone::Lifted, lifted),
            (Milestone::OverRegion, was_lifted && over),
            (Milestone::Moved, slides && way > MOVED),
            (Milestone::HalfWay, slides && way > whole.abs() / 2.0),
        ] {
            let is_on_the_way = || self.sought.way.steps().iter().any(|(on, _)| *on == step);
            if holds && !self.has(step) && is_on_the_way() {
                self.reached.push((step, seconds));
            }
        }
    }

    fn has(&self, step: Milestone) -> bool {
        self.reached.iter().any(|(known, _)| *known == step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use v1::{FrameRole, JointRole};

    fn robot() -> v1::RobotDescription {
        let joint = |role: JointRole, index, link: &str| v1::RobotJoint {
            role: role.into(),
            arm_index: index,
            child_link: link.to_owned(),
            parent_link: format!("below {link}"),
            ..Default::default()
        };
        let mut joints: Vec<_> = (0..6).map(|i| joint(JointRole::Arm, i, "arm")).collect();
        joints.push(joint(JointRole::WheelLeft, 0, "wheel"));
        joints.push(joint(JointRole::WheelRight, 0, "wheel"));
        joints.push(joint(JointRole::Knuckle, 0, "knuckle"));
        joints.push(joint(JointRole::FingerTipLeft, 0, "tip"));
        let frame = |role: FrameRole| v1::RobotFrame {
            role: role.into(),
            ..Default::default()
        };
        v1::RobotDescription {
            joints,
            frames: vec![frame(FrameRole::Chair), frame(FrameRole::EndEffector)],
            end_effector_link: "hand".to_owned(),
            arm_mount: Some(at(0.0, 0.0, 0.5)),
            reach: Some(v1::ReachShell {
                furthest: 0.8,
                ..Default::default()
            }),
            ..Default::default()
        }
    }

    fn at(x: f64, y: f64, z: f64) -> v1::Pose {
        v1::Pose {
            position: Some(v1::Vector3 { x, y, z }),
            orientation: Some(v1::Quaternion {
                w: 1.0,
                ..Default::default()
            }),
        }
    }

    fn scene(kind: v1::GoalKind) -> v1::SceneReply {
        v1::SceneReply {
            robot: Some(robot()),
            objects: vec!["other".to_owned(), "mug".to_owned()],
            joints: vec![v1::FurnitureJoint {
                name: "slide".to_owned(),
                body: "drawer".to_owned(),
                rest: Some(at(2.0, 0.0, 0.4)),
                axis: Some(v1::Vector3 {
                    x: -1.0,
                    ..Default::default()
                }),
                ..Default::default()
            }],
            goal: Some(v1::TaskGoal {
                kind: kind.into(),
                tip: None,
                target: match kind {
                    v1::GoalKind::Open | v1::GoalKind::Close => "drawer",
                    _ => "mug",
                }
                .to_owned(),
                joint: "slide".to_owned(),
                position: if kind == v1::GoalKind::Open { 0.2 } else { 0.0 },
                region: Some(v1::BoxGeometry {
                    pose: Some(at(2.5, 0.0, 0.4)),
                    half: Some(v1::Vector3 {
                        x: 0.1,
                        y: 0.1,
                        z: 0.1,
                    }),
                }),
            }),
            ..Default::default()
        }
    }

    /// Chair's x and speed, the mug, the slide, pad forces, who is touched.
    struct Moment(f64, f64, [f64; 3], f64, [f64; 2], Option<[&'static str; 2]>);

    fn follow(kind: v1::GoalKind, moments: &[Moment]) -> Follower {
        let mut follower = Follower::new(&scene(kind)).unwrap();
        for (i, Moment(x, speed, mug, slide, pads, touched)) in moments.iter().enumerate() {
            let header = Some(v1::Header {
                episode: 3,
                tick: 72 * i as u64,
                stamp_nanos: 5_000_000_000 + 300_000_000 * i as u64,
                ..Default::default()
            });
            let frame = v1::FramePose {
                pose: Some(at(*x, 0.0, 0.0)),
                twist: Some(v1::Twist {
                    linear: Some(v1::Vector3 {
                        x: *speed,
                        ..Default::default()
                    }),
                    ..Default::default()
                }),
            };
            let contact = touched.map(|[first, second]| v1::Contact {
                first: first.to_owned(),
                second: second.to_owned(),
                ..Default::default()
            });
            for sample in [
                Sample::Pose(v1::PoseSet {
                    header: header.clone(),
                    frames: vec![frame, frame],
                }),
                Sample::ObjectPose(v1::ObjectPoses {
                    header: header.clone(),
                    poses: vec![at(9.0, 9.0, 0.0), at(mug[0], mug[1], mug[2])],
                    twists: Vec::new(),
                }),
                Sample::FurnitureJoint(v1::FurnitureJoints {
                    header: header.clone(),
                    positions: vec![*slide],
                    velocities: Vec::new(),
                }),
                Sample::Contact(v1::Contacts {
                    header: header.clone(),
                    pad_forces: pads.to_vec(),
                    contacts: contact.into_iter().collect(),
                    contact_count: 0,
                }),
                Sample::Evaluation(v1::Evaluation {
                    header,
                    ..Default::default()
                }),
            ] {
                follower.take(&sample);
            }
        }
        follower
    }

    const MUG: [f64; 3] = [2.0, 0.0, 0.5];

    #[test]
    fn a_pick_goes_from_driving_to_holding_step_by_step() {
        let far = || Moment(0.0, 0.0, MUG, 0.0, [0.0; 2], None);
        let drives = || Moment(1.5, 0.3, MUG, 0.0, [0.0; 2], None);
        let stands = || Moment(1.5, 0.0, MUG, 0.0, [0.0; 2], None);
        let by_chair = || Moment(1.5, 0.0, MUG, 0.0, [0.0; 2], Some(["mug", "wheel"]));
        let by_finger = || Moment(1.5, 0.0, MUG, 0.0, [3.0, 0.0], Some(["tip", "mug"]));
        let gripped = |z| Moment(1.5, 0.0, [2.0, 0.0, z], 0.0, [3.0; 2], Some(["mug", "tip"]));
        let percent = |moments: &[Moment]| {
            let course = follow(v1::GoalKind::Lift, moments).course(false, 9.0);
            (course.percent, course.missing)
        };
        use Milestone as M;
        assert_eq!(percent(&[]), (0, Some(M::InReach)));
        // Standing far away, or passing by, is not in reach.
        assert_eq!(percent(&[far(), far(), drives()]), (0, Some(M::InReach)));
        assert_eq!(percent(&[far(), drives(), stands()]), (0, Some(M::InReach)));
        assert_eq!(percent(&[stands(), stands()]), (20, Some(M::Touched)));
        assert_eq!(percent(&[stands(), by_chair()]).0, 20);
        assert_eq!(percent(&[stands(), by_finger()]), (40, Some(M::Gripped)));
        let by_bar = || Moment(1.5, 0.0, MUG, 0.0, [0.0; 2], Some(["below tip", "mug"]));
        assert_eq!(percent(&[stands(), by_bar()]), (40, Some(M::Gripped)));
        let by_arm = || Moment(1.5, 0.0, MUG, 0.0, [0.0; 2], Some(["below knuckle", "mug"]));
        assert_eq!(percent(&[stands(), by_arm()]).0, 20);
        assert_eq!(percent(&[stands(), gripped(0.5)]).0, 60);
        assert_eq!(percent(&[stands(), gripped(0.53)]), (80, Some(M::Done)));
        // It counts how far it came, not where it ended.
        let lost = [stands(), gripped(0.53), far()];
        assert_eq!(percent(&lost).0, 80);
        let done = follow(v1::GoalKind::Lift, &lost).course(true, 9.0);
        assert_eq!((done.percent, done.missing), (100, None));
        let times: Vec<f64> = done.reached.iter().map(|(_, seconds)| *seconds).collect();
        assert!(times.is_sorted() && times.last() == Some(&9.0), "{times:?}");
    }

    #[test]
    fn steps_of_other_ways_are_not_reached() {
        // A handle is gripped, a thing to be handed over passes the place: neither is a
        // step there.
        let handle = [2.0, 0.0, 0.4];
        let pulls = |slide| Moment(1.5, 0.0, handle, slide, [3.0; 2], Some(["tip", "drawer"]));
        let opened = follow(v1::GoalKind::Open, &[pulls(0.0), pulls(0.15)]).course(false, 9.0);
        let given =
            |x: f64, z: f64| Moment(1.5, 0.0, [x, 0.0, z], 0.0, [3.0; 2], Some(["tip", "mug"]));
        let moments = [given(2.0, 0.5), given(2.0, 0.6), given(2.5, 0.6)];
        let given = follow(v1::GoalKind::Give, &moments).course(false, 9.0);
        for course in [opened, given] {
            assert!(course.percent > 60, "{course:?}");
            for (step, _) in &course.reached {
                let on = course.way.steps().iter().any(|(known, _)| known == step);
                assert!(on, "{course:?}");
            }
        }
    }

    #[test]
    fn what_is_put_somewhere_has_to_be_lifted_before_it_is_over_the_place() {
        let at =
            |x: f64, z: f64| Moment(1.5, 0.0, [x, 0.0, z], 0.0, [3.0; 2], Some(["tip", "mug"]));
        let pushed = follow(v1::GoalKind::Put, &[at(2.0, 0.5), at(2.5, 0.5)]);
        assert_eq!(pushed.course(false, 1.0).percent, 45);
        let carried = follow(
            v1::GoalKind::Put,
            &[at(2.0, 0.5), at(2.2, 0.6), at(2.5, 0.6)],
        );
        let course = carried.course(false, 1.0);
        assert_eq!(
            (course.percent, course.missing),
            (80, Some(Milestone::Done))
        );
    }

    #[test]
    fn a_slide_counts_by_how_far_it_went_the_right_way() {
        let at = |slide: f64| Moment(1.5, 0.0, MUG, slide, [0.0; 2], None);
        let percent = |kind, way: &[f64]| {
            let moments: Vec<_> = way.iter().map(|slide| at(*slide)).collect();
            follow(kind, &moments).course(false, 1.0).percent
        };
        assert_eq!(percent(v1::GoalKind::Open, &[0.0, 0.0]), 20);
        assert_eq!(percent(v1::GoalKind::Open, &[0.0, 0.05]), 60);
        assert_eq!(percent(v1::GoalKind::Open, &[0.0, 0.12]), 80);
        assert_eq!(percent(v1::GoalKind::Close, &[0.2, 0.25]), 20);
        assert_eq!(percent(v1::GoalKind::Close, &[0.2, 0.15]), 60);
        assert_eq!(percent(v1::GoalKind::Close, &[0.2, 0.05]), 80);
    }

    #[test]
    fn hard_contacts_are_told_and_another_episode_begins_anew() {
        let mut follower = follow(v1::GoalKind::Lift, &[]);
        let event = |episode, kind: v1::EventKind| {
            Sample::Event(v1::Event {
                header: Some(v1::Header {
                    episode,
                    ..Default::default()
                }),
                kind: kind.into(),
                body: "arm".to_owned(),
                other_body: "table".to_owned(),
                ..Default::default()
            })
        };
        follower.take(&event(1, v1::EventKind::Collision));
        follower.take(&event(2, v1::EventKind::Note));
        assert!(follower.course(false, 0.0).hard_contacts.is_empty());
        follower.take(&event(2, v1::EventKind::Collision));
        follower.take(&event(0, v1::EventKind::Collision));
        assert_eq!(follower.course(false, 0.0).hard_contacts, ["arm on table"]);
    }
}
