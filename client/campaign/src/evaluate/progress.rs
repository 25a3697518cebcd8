//! Progress of an episode, in steps that every attempt at a task passes through. Derived from
//! the streams of the server, never from reports of an operator or a policy. No I/O: samples
//! in, a [`Course`] out.

use nalgebra::{Isometry3, Point3, Unit, Vector3};
use wheelarm_proto::check::{self, Invalid};
use wheelarm_proto::furniture::JointMotion;
use wheelarm_proto::geometry::normalized;
use wheelarm_proto::robot::Roles;
use wheelarm_proto::topic::Sample;
use wheelarm_proto::{TopicId, v1};

use super::milestone::{Course, Milestone, Way};

/// Streams from which a course is derived.
pub const STREAMS: [TopicId; 6] = [
    TopicId::Pose,
    TopicId::ObjectPose,
    TopicId::FurnitureJoint,
    TopicId::Contact,
    TopicId::Evaluation,
    TopicId::Event,
];

/// Speed below which the chair is at rest, m/s.
const REST_SPEED: f64 = 0.02;
/// Turn rate below which the chair is at rest, rad/s.
const REST_TURN_RATE: f64 = 0.03;
/// Duration of rest for [`Milestone::InReach`], ns.
const REST_NANOS: u64 = 250_000_000;
/// Force above which a pad presses, N.
const PRESS_FORCE: f64 = 0.5;
/// Height above its initial one from which an object is lifted, metres.
const LIFT_HEIGHT: f64 = 0.02;
/// Change in the required direction from which a joint has moved, metres or, of what
/// turns, radians.
const SLIDE_DISTANCE: f64 = 0.01;
const TURN_ANGLE: f64 = 0.03;

/// Follows one episode.
#[derive(Clone, Debug)]
pub struct Follower {
    goal: Goal,
    roles: Roles,
    /// Newest samples.
    chair: Option<Isometry3<f64>>,
    speeds: [f64; 2],
    objects: Vec<Isometry3<f64>>,
    slides: Vec<f64>,
    pads: [f64; 2],
    touching: bool,
    /// The number of the episode and the stamp of its beginning, nanoseconds.
    episode: (u64, u64),
    since: Option<u64>,
    /// Height of the target or position of the slide at the beginning, metres.
    began: Option<f64>,
    reached: Vec<(Milestone, f64)>,
    hard: Vec<String>,
}

/// The goal, from the description of the scene.
#[derive(Clone, Debug, PartialEq)]
struct Goal {
    way: Way,
    target: String,
    /// Index among the objects; absent for a slide.
    object: Option<usize>,
    /// Index among the joints of furniture, with the joint.
    slide: Option<(usize, Joint)>,
    /// Wanted position of the joint, metres or radians.
    position: f64,
    /// Region to place it in: pose of the centre and half sizes along x and y, metres.
    region: Option<(Isometry3<f64>, [f64; 2])>,
    /// Grasp points, in the frame of the target.
    grasps: Vec<Point3<f64>>,
    chair_from_base: Isometry3<f64>,
    /// Greatest horizontal distance at which the arm reaches objects, metres.
    range: f64,
    hand: Vec<String>,
}

/// The joint of furniture.
#[derive(Clone, Debug, PartialEq)]
struct Joint {
    motion: JointMotion,
    axis: Unit<Vector3<f64>>,
    /// Pose of the body at position 0.
    rest: Isometry3<f64>,
}

impl Follower {
    /// Follows the next episode, of the scene's task.
    ///
    /// # Errors
    /// [`Invalid`] with the field that violates the contract.
    pub fn new(scene: &v1::SceneReply) -> Result<Self, Invalid> {
        let robot = scene.robot.as_ref();
        let robot = robot.ok_or(Invalid::Missing("description of the robot"))?;
        let goal = scene.goal.clone().unwrap_or_default();
        let slide = scene.joints.iter().enumerate();
        let way = Way::for_goal(goal.kind());
        let slide = slide
            .filter(|(_, joint)| way == Way::Slide && joint.name == goal.joint)
            .map(|(index, joint)| {
                let axis = check::vector("axis of a joint", joint.axis.as_ref())?;
                Ok((
                    index,
                    Joint {
                        motion: JointMotion::of(joint),
                        axis: Unit::new_normalize(axis.into()),
                        rest: normalized("rest pose of a joint", joint.rest.as_ref())?,
                    },
                ))
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
            // The parent link of a finger tip is fixed to its knuckle.
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
            goal: Goal {
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

    /// Adds a sample; ignores streams outside of [`STREAMS`].
    pub fn add(&mut self, sample: &Sample) {
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
                    pair.contains(&&self.goal.target)
                        && pair.iter().any(|name| self.goal.hand.contains(name))
                });
            }
            Sample::Event(s)
                if self.is_of(s.header.as_ref()) && s.kind() == v1::EventKind::Collision =>
            {
                self.hard.push(format!("{} on {}", s.body, s.other_body));
            }
            // Published after the samples of its tick.
            Sample::Evaluation(s) if self.is_of(s.header.as_ref()) => {
                self.update(s.header.as_ref().map_or(0, |h| h.stamp_nanos));
            }
            _ => {}
        }
    }

    /// The course so far, of an episode that ended with `success`.
    #[must_use]
    pub fn course(&self, success: bool, seconds: f64) -> Course {
        let mut reached = self.reached.clone();
        if success {
            reached.push((Milestone::Done, seconds));
        }
        let way = self.goal.way.steps();
        reached.sort_by_key(|(step, _)| *step);
        let furthest = way
            .iter()
            .rposition(|(step, _)| reached.iter().any(|(known, _)| known == step));
        Course {
            way: self.goal.way,
            percent: furthest.map_or(0, |at| way[at].1),
            missing: way
                .get(furthest.map_or(0, |at| at + 1))
                .map(|(step, _)| *step),
            reached,
            hard_contacts: self.hard.clone(),
        }
    }

    /// Whether the header is of the newest episode; a newer one restarts the follower.
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

    /// Pose of the target, and its height or the position of the slide, metres.
    fn target(&self) -> Option<(Isometry3<f64>, f64)> {
        if let Some((index, joint)) = &self.goal.slide {
            let position = *self.slides.get(*index)?;
            let pose = joint.motion.pose(&joint.axis, &joint.rest, position);
            return Some((pose, position));
        }
        let pose = *self.objects.get(self.goal.object?)?;
        Some((pose, pose.translation.z))
    }

    /// Adds the milestones that hold now.
    fn update(&mut self, stamp: u64) {
        let seconds = stamp.saturating_sub(self.episode.1) as f64 * 1e-9;
        let (Some(chair), Some((target, height))) = (self.chair, self.target()) else {
            return;
        };
        let began = *self.began.get_or_insert(height);
        let is_at_rest = self.speeds[0] < REST_SPEED && self.speeds[1] < REST_TURN_RATE;
        self.since = match is_at_rest {
            true => self.since.or(Some(stamp)),
            false => None,
        };
        let base = chair * self.goal.chair_from_base;
        let near = self.goal.grasps.iter().any(|grasp| {
            let off = (target * grasp).coords - base.translation.vector;
            off.xy().norm() <= self.goal.range
        });
        let rested = self
            .since
            .is_some_and(|since| stamp.saturating_sub(since) >= REST_NANOS);
        let gripped = self.touching && self.pads.iter().all(|force| *force > PRESS_FORCE);
        let lifted = gripped && self.goal.slide.is_none() && height - began > LIFT_HEIGHT;
        let over = self.goal.region.is_some_and(|(pose, half)| {
            let at = pose.inverse_transform_point(&target.translation.vector.into());
            at.x.abs() <= half[0] && at.y.abs() <= half[1]
        });
        let was_lifted = self.has(Milestone::Lifted) || lifted;
        let whole = self.goal.position - began;
        let way = (height - began) * whole.signum();
        let least = (self.goal.slide.as_ref()).map(|(_, joint)| match joint.motion {
            JointMotion::Slides => SLIDE_DISTANCE,
            JointMotion::Turns => TURN_ANGLE,
        });
        for (step, holds) in [
            (Milestone::InReach, near && rested),
            (Milestone::Touched, self.touching),
            (Milestone::Gripped, gripped),
            (Milestone::Lifted, lifted),
            (Milestone::OverRegion, was_lifted && over),
            (Milestone::Moved, least.is_some_and(|least| way > least)),
            (
                Milestone::HalfWay,
                least.is_some() && way > whole.abs() / 2.0,
            ),
        ] {
            let is_on_the_way = || self.goal.way.steps().iter().any(|(on, _)| *on == step);
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

    /// Chair's x and speed, the mug, the slide, pad forces, bodies in contact.
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
                follower.add(&sample);
            }
        }
        follower
    }

    const MUG: [f64; 3] = [2.0, 0.0, 0.5];

    #[test]
    fn pick_passes_its_milestones_in_order() {
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
        // The furthest milestone counts, not the last state.
        let lost = [stands(), gripped(0.53), far()];
        assert_eq!(percent(&lost).0, 80);
        let done = follow(v1::GoalKind::Lift, &lost).course(true, 9.0);
        assert_eq!((done.percent, done.missing), (100, None));
        let times: Vec<f64> = done.reached.iter().map(|(_, seconds)| *seconds).collect();
        assert!(times.is_sorted() && times.last() == Some(&9.0), "{times:?}");
    }

    #[test]
    fn milestones_of_other_goals_are_not_reached() {
        // A handle is gripped and a given object passes the region: neither is a milestone there.
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
    fn object_is_over_the_region_only_after_it_was_lifted() {
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
    fn slide_counts_by_its_distance_in_the_required_direction() {
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
    fn hard_contacts_are_listed_per_episode() {
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
        follower.add(&event(1, v1::EventKind::Collision));
        follower.add(&event(2, v1::EventKind::Note));
        assert!(follower.course(false, 0.0).hard_contacts.is_empty());
        follower.add(&event(2, v1::EventKind::Collision));
        follower.add(&event(0, v1::EventKind::Collision));
        assert_eq!(follower.course(false, 0.0).hard_contacts, ["arm on table"]);
    }
}
