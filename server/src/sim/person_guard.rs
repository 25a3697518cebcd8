//! The guard of the seated person: limits arm, gripper and chair by distance and
//! contact force, whatever commands them.
//!
//! # Guarantee
//! Before each control tick the guard reads the state of that tick: the gaps between the
//! engine's shapes and the contact forces. It has no state and no clock of its own, so a
//! restored or replayed episode has the same bits. It applies to every intent, frame,
//! client and pacing:
//!
//! - **Approach.** It limits every link from the second joint on, the gripper and each
//!   object that the arm touches. They approach a part of the body at most at [`RATE`]
//!   times the distance beyond [`STOP`] (head and face: [`HEAD_RATE`], [`HEAD_STOP`]). At
//!   the stop distance the approach ends; motion along the body continues.
//! - **Handover.** An object in the hand may settle in the lap, at [`SETTLE`] and until
//!   [`SETTLED`] press there: dropped from the stop distance it would press harder.
//! - **Head.** The arm gives way to a head that moves towards it, at the head's speed.
//! - **Lead.** The commanded arm is ahead of the measured arm by at most the distance
//!   left to the stop distance, so the drives do not load against a body.
//! - **Force.** Above [`FORCE_LIMIT`] (head and face: [`FACE_FORCE_LIMIT`]) on a part of the body, the
//!   body that presses it backs off.
//! - **Own links.** Links of the arm that touch each other, or an object in the hand, move
//!   apart.
//! - **Gripper.** Within [`FINGERS`] of the person the fingers move slowly and press
//!   weakly; a grasp of an object keeps its force until the fingers open.
//! - **Chair.** With its person it approaches furniture no faster than it can brake
//!   to [`CHAIR_STOP`]; this covers knees, feet, hands and the head, and
//!   arm links near the person. A part pressed by furniture above its limit is
//!   relieved at [`RETREAT`].
//! - **Speed at the face.** The grasp point keeps to the speed of [`Simulation::guarded_speed`].
//!
//! # Limits
//! The guard is a model of a sensing skin without error or delay. It does not cover
//! objects that fall or are thrown onto the person, and soft objects before they press.
//! It does not cover other objects that the chair pushes into its person, and the
//! person's own motion except that of the head. Disturbances push after the guard. A
//! scenario that starts with the arm inside the body starts with the forces of that
//! overlap.

use nalgebra::Vector3;
use wheelarm_proto::person::{FACE_FORCE_LIMIT, FORCE_LIMIT};

use super::Simulation;
use crate::people::BodyPart;
use crate::robot::ARM_JOINTS;
use crate::robot::control::{
    ArmBound, BaseIntent, ChairBound, ControlInput, FingerBound, Guard, PLANNED_BRAKING,
};
use crate::snapshot::{BodyRef, Contact};
use crate::world::Gap;

/// Gaps beyond this distance are not bounded, m: the tool speed over [`RATE`].
const RANGE: f64 = 0.13;
/// Approach speed per distance beyond the stop distance, 1/s.
const RATE: f64 = 4.0;
/// The same at head and face, 1/s.
const HEAD_RATE: f64 = 2.0;
/// Distance at which an approach ends, m.
const STOP: f64 = 0.006;
/// The same at head and face, m.
const HEAD_STOP: f64 = 0.006;
/// The same for links between base and hand, and for objects in the hand except at the
/// head, m. Contacts of their cylinders with the body's capsules begin up to 10 mm
/// early in the engine (measured: single ticks of 15 to 70 N at gaps of 4 to 10 mm in
/// 12 of 880 adversarial episodes).
const LINK_STOP: f64 = 0.012;
/// Speed at which an object in the hand settles in the lap, m/s, and the force at which
/// it stops, N.
const SETTLE: f64 = 0.005;
const SETTLED: f64 = 1.0;
/// Below this gap a force on the part counts for the gap, m.
const TOUCH: f64 = 0.002;
/// Speed of backing off at the force limit, m/s, and its increase with force, m/(s N).
const BACK_OFF: f64 = 0.02;
const BACK_OFF_RATE: f64 = 0.001;
/// Largest speed of backing off, m/s.
const MOST_BACK_OFF: f64 = 0.1;
/// Lead at the stop distance, m: drives have tracking errors.
const SLACK: f64 = 0.001;
/// Distance of the fingers to the person below which they are slow and weak, m.
const FINGERS: f64 = 0.03;
/// Knuckle speed, rad/s, and pad force, N, below that distance.
const FINGER_SPEED: f64 = 0.2;
const FINGER_FORCE: f64 = 5.0;
/// Component of the normal across the hand above which it defines the direction.
const ACROSS: f64 = 0.3;
/// Pad force while the fingers press the person above the limit, N.
const FINGER_RELEASE: f64 = 1.0;
/// Distance to furniture at which the chair stops the person, m.
const CHAIR_STOP: f64 = 0.005;
/// Gap to the person below which a link of the arm counts as part of the person when
/// the chair drives, m.
const BESIDE: f64 = 0.1;
/// Speed at which the chair relieves its person, m/s.
const RETREAT: f64 = 0.03;

/// An object that the arm touches, treated as fixed to the link.
#[derive(Clone, Copy, Debug)]
struct HeldObject {
    object: usize,
    link: usize,
}

fn is_head(part: BodyPart) -> bool {
    matches!(part, BodyPart::Head | BodyPart::Face | BodyPart::Mouth)
}

/// Contact force above which the presser of a part backs off, N.
fn force_limit(part: BodyPart) -> f64 {
    if is_head(part) {
        FACE_FORCE_LIMIT
    } else {
        FORCE_LIMIT
    }
}

impl Simulation {
    /// Bounds of the coming control tick; `None` without a person or with the guard
    /// off.
    pub(super) fn person_guard(&self, input: &ControlInput) -> Option<Guard> {
        let tool_speed = self.guarded_speed()?;
        let carried = self.carried();
        let mut bodies = self.carriers.links.clone();
        bodies.extend(carried.iter().map(|c| BodyRef::Object(c.object)));
        let gaps = self.world.gaps_to_person(&bodies, RANGE);
        let mut arm = Vec::new();
        for gap in &gaps {
            self.bound_gap(gap, &carried, &mut arm);
        }
        self.bound_own(&carried, &mut arm);
        let (chair, retreat) = self.chair_bounds(input, &gaps);
        Some(Guard {
            tool_speed,
            measured: self.arm_positions(),
            arm,
            chair,
            chair_braking: self.chair_braking(),
            retreat,
            fingers: self.finger_bound(input, &gaps, &carried),
        })
    }

    /// Objects that links of the arm touch.
    fn carried(&self) -> Vec<HeldObject> {
        let mut carried: Vec<HeldObject> = Vec::new();
        for contact in &self.snapshot.contacts {
            let (BodyRef::Link(link), BodyRef::Object(object)) = (contact.first, contact.second)
            else {
                continue;
            };
            if self.carriers.depths[link] < 2 {
                continue;
            }
            match carried.iter_mut().find(|c| c.object == object) {
                Some(c) if self.carriers.depths[c.link] < self.carriers.depths[link] => {
                    c.link = link;
                }
                Some(_) => {}
                None => carried.push(HeldObject { object, link }),
            }
        }
        carried
    }

    /// The arm link that moves a body or carries it.
    fn carrier(&self, body: BodyRef, carried: &[HeldObject]) -> Option<usize> {
        match body {
            BodyRef::Link(link) => Some(link),
            BodyRef::Object(object) => {
                let mut all = carried.iter();
                all.find(|c| c.object == object).map(|c| c.link)
            }
            BodyRef::Furniture(_) | BodyRef::Person(_) => None,
        }
    }

    /// Body part of a capsule.
    fn part(&self, body: BodyRef) -> Option<BodyPart> {
        let BodyRef::Person(index) = body else {
            return None;
        };
        Some(self.person.as_ref()?.capsules.get(index)?.part)
    }

    /// Speed of a point along a direction per joint speed, m/rad, for the first
    /// `joints` arm joints.
    fn row(&self, joints: usize, point: &Vector3<f64>, along: &Vector3<f64>) -> [f64; 6] {
        std::array::from_fn(|i| {
            if i >= joints {
                return 0.0;
            }
            let joint = &self.model.joints[self.model.roles.arm[i]];
            let frame = &self.snapshot.links[joint.child].pose;
            let axis = frame.rotation * joint.axis.into_inner();
            axis.cross(&(point - frame.translation.vector)).dot(along)
        })
    }

    /// Bounds of a body at a gap: its nearest point, and corners that a rotation may
    /// bring closer.
    fn bound_gap(&self, gap: &Gap, carried: &[HeldObject], bounds: &mut Vec<ArmBound>) {
        let (Some(link), Some(part)) = (self.carrier(gap.first, carried), self.part(gap.second))
        else {
            return;
        };
        let (rate, stop) = if is_head(part) {
            (HEAD_RATE, HEAD_STOP)
        } else {
            (RATE, STOP)
        };
        let joints = self.carriers.depths[link];
        let force = self.press(gap, part);
        let is_object = matches!(gap.first, BodyRef::Object(_));
        let settles = is_object && force < SETTLED && part == BodyPart::Lap;
        let is_round = joints < ARM_JOINTS || is_object && !is_head(part);
        let stop = match (settles, is_round) {
            (true, _) => 0.0,
            (false, true) => LINK_STOP,
            (false, false) => stop,
        };
        let approach = |distance: f64| {
            // Close without contact: the arm stops.
            let speed = rate * (distance - stop);
            let least = match settles {
                true => SETTLE,
                false => (rate * distance).min(0.0),
            };
            speed.max(least) - gap.closing
        };
        let force = force - force_limit(part);
        let mut speed = approach(gap.distance);
        if force > 0.0 {
            speed = speed.min(-(BACK_OFF + BACK_OFF_RATE * force));
        }
        let lead = (gap.distance - stop).max(0.0);
        bounds.push(ArmBound {
            row: self.row(joints, &gap.point, &gap.normal),
            speed: speed.max(-MOST_BACK_OFF),
            lead: if force > 0.0 { 0.0 } else { lead + SLACK },
        });
        let surface = gap.point + gap.normal * gap.distance;
        for corner in &gap.corners {
            let distance = gap.normal.dot(&(surface - corner)).max(gap.distance);
            if distance < RANGE {
                bounds.push(ArmBound {
                    row: self.row(joints, corner, &gap.normal),
                    speed: approach(distance).max(0.0),
                    lead: f64::INFINITY,
                });
            }
        }
    }

    /// Bounds of arm links that touch each other or an object that another link
    /// carries: a body that presses the person cannot back off against a link that
    /// holds it there.
    fn bound_own(&self, carried: &[HeldObject], bounds: &mut Vec<ArmBound>) {
        for contact in &self.snapshot.contacts {
            let other = self.carrier(contact.second, carried);
            let (BodyRef::Link(one), Some(other)) = (contact.first, other) else {
                continue;
            };
            let [one, other] = [one, other].map(|link| self.carriers.depths[link]);
            let force = contact.force.norm();
            if one == other || force == 0.0 {
                continue;
            }
            // The force pushes the second link away from the first.
            let apart = contact.force / force;
            let [one, other] = [one, other].map(|joints| self.row(joints, &contact.point, &apart));
            let presses = force > FORCE_LIMIT;
            bounds.push(ArmBound {
                row: std::array::from_fn(|i| one[i] - other[i]),
                speed: if presses { -BACK_OFF } else { 0.0 },
                lead: if presses { 0.0 } else { SLACK },
            });
        }
    }

    /// Force on the person at a gap, N: of the pair at the last tick or, for contacts
    /// of the robot, the largest on the part in the last control tick.
    fn press(&self, gap: &Gap, part: BodyPart) -> f64 {
        let contacts = self.snapshot.contacts.iter();
        let pair = contacts
            .filter(|c| c.first == gap.first && c.second == gap.second)
            .map(|c| c.force.norm())
            .sum::<f64>();
        let state = self.snapshot.person.as_ref();
        let on_part = state.map_or(0.0, |state| state.forces[part.index()]);
        if gap.distance < TOUCH {
            pair.max(on_part)
        } else {
            pair
        }
    }

    fn finger_bound(
        &self,
        input: &ControlInput,
        gaps: &[Gap],
        carried: &[HeldObject],
    ) -> Option<FingerBound> {
        let is_finger = |link: usize| self.carriers.fingers[link];
        let near = gaps.iter().filter(|gap| {
            matches!(gap.first, BodyRef::Link(link) if is_finger(link)) && gap.distance < FINGERS
        });
        let presses = near.clone().any(|gap| {
            self.part(gap.second)
                .is_some_and(|p| self.press(gap, p) > force_limit(p))
        });
        near.clone().next()?;
        // A finger moves across the hand, inwards when the gripper closes. When the
        // normal does not define the direction to the person, both are bounded.
        let hand = self.snapshot.links[self.model.roles.end_effector].pose;
        let (mut closing, mut opening) = (FINGER_SPEED, FINGER_SPEED);
        for gap in near {
            let across = hand.rotation * Vector3::x();
            let side = (gap.point - hand.translation.vector).dot(&across);
            let outwards = gap.normal.dot(&across) * side.signum();
            let left = (gap.distance - STOP).max(0.0);
            let most = RATE * left / self.model.settings.gripper.finger_lever;
            if outwards > -ACROSS {
                opening = opening.min(most);
            }
            if outwards < ACROSS {
                closing = closing.min(most);
            }
        }
        let gripper = &self.control.state().gripper;
        let goal = input.gripper.map_or(gripper.goal, |intent| intent.knuckle);
        let opens = goal < gripper.position;
        let holds = carried.iter().any(|c| is_finger(c.link));
        let force = match (presses, holds && !opens) {
            (true, _) => FINGER_RELEASE,
            (false, true) => f64::INFINITY,
            (false, false) => FINGER_FORCE,
        };
        Some(FingerBound {
            closing,
            opening,
            force,
        })
    }

    /// Bounds of the chair near furniture, and the motion that relieves the person.
    fn chair_bounds(
        &self,
        input: &ControlInput,
        gaps: &[Gap],
    ) -> (Vec<ChairBound>, Option<BaseIntent>) {
        let base = &self.control.state().base;
        let wanted = input.base.unwrap_or(base.wanted);
        let retreat = self.chair_retreat(gaps);
        let at_rest = BaseIntent::default();
        if wanted == at_rest && base.now == at_rest && retreat.is_none() {
            return (Vec::new(), None);
        }
        let mut beside: Vec<BodyRef> = Vec::new();
        for gap in gaps.iter().filter(|gap| gap.distance < BESIDE) {
            if !beside.contains(&gap.first) {
                beside.push(gap.first);
            }
        }
        // For the furthest point of the occupied chair.
        let [straight, turn] = self.chair_braking();
        let reach = self.person_reach();
        let way = |motion: &BaseIntent| {
            let (linear, angular) = (motion.linear, motion.angular);
            linear * linear / (2.0 * straight) + angular * angular * reach / (2.0 * turn)
        };
        let range = CHAIR_STOP + way(&wanted).max(way(&base.now)) / PLANNED_BRAKING + RETREAT;
        let near = self.world.gaps_to_furniture(&beside, range);
        let bounds = near.iter().map(|gap| {
            let left = (gap.distance - CHAIR_STOP).max(0.0);
            ChairBound {
                row: self.chair_row(&gap.point, &gap.normal),
                left,
            }
        });
        (bounds.collect(), retreat)
    }

    /// Slowest braking of the chair, forwards or backwards and turning, m/s² and
    /// rad/s².
    fn chair_braking(&self) -> [f64; 2] {
        let drive = &self.model.settings.drive;
        let straight = drive.forward_deceleration.min(drive.backward_deceleration);
        [straight, drive.turn_deceleration]
    }

    /// Distance from the middle of the driven wheels to the furthest point of the
    /// person, on the floor plan, m.
    fn person_reach(&self) -> f64 {
        let Some(person) = &self.person else {
            return 0.0;
        };
        let chair = self.snapshot.links[0].pose;
        let axle = chair.inverse_transform_point(&self.axle().into());
        let head = crate::people::HeadPose::default();
        let ends = person.capsules.iter().flat_map(|capsule| {
            let ends = person.ends(capsule, &head);
            ends.map(|end| (end - axle).xy().norm() + capsule.radius)
        });
        ends.fold(0.0, f64::max)
    }

    /// Middle of the driven wheels in `house`, m.
    fn axle(&self) -> Vector3<f64> {
        let [left, right] = self.model.roles.wheels.map(|joint| {
            let wheel = self.model.joints[joint].child;
            self.snapshot.links[wheel].pose.translation.vector
        });
        (left + right) / 2.0
    }

    /// Speed of a point on the chair along a direction, per forward speed and turn
    /// rate.
    fn chair_row(&self, point: &Vector3<f64>, along: &Vector3<f64>) -> [f64; 2] {
        let turn = self.snapshot.links[0].pose.rotation;
        let (forward, up) = (turn * Vector3::x(), turn * Vector3::z());
        let arm = point - self.axle();
        [forward.dot(along), up.cross(&arm).dot(along)]
    }

    /// The motion that moves the person away from furniture: from a body that presses a
    /// part above its limit, or that presses an arm link onto the person.
    fn chair_retreat(&self, gaps: &[Gap]) -> Option<BaseIntent> {
        let mut row = [0.0; 2];
        let mut add = |contact: &Contact, away: Vector3<f64>| {
            let own = self.chair_row(&contact.point, &away);
            row = [row[0] + own[0], row[1] + own[1]];
        };
        for contact in &self.snapshot.contacts {
            match (contact.first, contact.second) {
                (BodyRef::Furniture(_), BodyRef::Person(_)) => {
                    let limit = self.part(contact.second).map_or(FORCE_LIMIT, force_limit);
                    if contact.force.norm() > limit {
                        add(contact, contact.force);
                    }
                }
                (BodyRef::Link(_), BodyRef::Furniture(_)) => {
                    let pressed = gaps.iter().filter(|gap| gap.first == contact.first);
                    let mut parts = pressed.filter_map(|g| Some((g, self.part(g.second)?)));
                    if parts.any(|(gap, part)| self.press(gap, part) > force_limit(part)) {
                        add(contact, -contact.force);
                    }
                }
                _ => {}
            }
        }
        let [along, across] = row;
        let length = (along * along + across * across).sqrt();
        (length > 1e-6).then(|| BaseIntent {
            linear: RETREAT * along / length,
            angular: RETREAT * across / length,
        })
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Point3, UnitQuaternion};

    use super::*;
    use crate::people::{HeadPose, PersonSetting};
    use crate::robot::control::{ArmIntent, IntentFrame};
    use crate::sim::Scenario;
    use crate::sim::tests::simulation;

    fn seated(guard: bool) -> Simulation {
        simulation(Scenario {
            task: String::new(),
            cameras: Vec::new(),
            // In front of the kitchen table.
            start: Some(Isometry3::from_parts(
                Vector3::new(-3.85, 2.48, 0.0).into(),
                UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 86.0_f64.to_radians()),
            )),
            person: Some(PersonSetting {
                body: "man_p50".to_owned(),
                posture: "hands_in_lap".to_owned(),
                motion: Some(0.0),
                guard,
                ..PersonSetting::default()
            }),
            ..Scenario::default()
        })
    }

    /// Largest force on any part of the body while the grasp point is commanded towards
    /// a capsule at full speed, N.
    fn press(sim: &mut Simulation, capsule: usize, ticks: usize) -> f64 {
        let person = sim.person.clone().expect("a person");
        let mut most = 0.0_f64;
        for _ in 0..ticks {
            let links = &sim.snapshot.links;
            let hand = links[sim.model.roles.end_effector].pose;
            let tool = hand * Point3::new(0.0, 0.0, sim.model.settings.tool_length);
            let [a, b] = person.ends(&person.capsules[capsule], &HeadPose::default());
            let aim = links[0].pose * nalgebra::center(&a, &b);
            sim.step(&ControlInput {
                arm: Some(ArmIntent::Twist {
                    frame: IntentFrame::House,
                    linear: (aim - tool) * 10.0,
                    angular: Vector3::zeros(),
                }),
                ..ControlInput::default()
            });
            assert!(sim.broken().is_none(), "{:?}", sim.broken());
            most = most.max(greatest_force(sim));
        }
        most
    }

    fn greatest_force(sim: &Simulation) -> f64 {
        let state = sim.snapshot.person.as_ref().expect("a person");
        state.forces.iter().copied().fold(0.0, f64::max)
    }

    #[test]
    fn a_guarded_hand_presses_no_part_above_15_newtons() {
        // Face, chest and a thigh.
        for capsule in [1, 4, 15] {
            let mut sim = seated(true);
            let force = press(&mut sim, capsule, 240);
            assert!(force < 15.0, "{force} N on capsule {capsule}");
        }
        let mut sim = seated(false);
        let force = press(&mut sim, 4, 240);
        assert!(force > 50.0, "the hand does not reach the body: {force} N");
    }

    /// Without the guard the hand loads against the chest; then the guard is switched
    /// on.
    #[test]
    fn a_pressing_hand_backs_off_under_the_guard() {
        let mut sim = seated(false);
        assert!(press(&mut sim, 4, 240) > 50.0);
        sim.scenario.person.as_mut().expect("a person").guard = true;
        press(&mut sim, 4, 30);
        let force = press(&mut sim, 4, 60);
        assert!(
            force < 15.0,
            "{force} N half a second after the guard was switched on"
        );
    }

    #[test]
    fn chair_does_not_drive_its_person_into_furniture() {
        let drive = |guard: bool| {
            let mut sim = seated(guard);
            let mut most = 0.0_f64;
            for tick in 0..480 {
                let turn = if (tick / 120) % 2 == 0 { 1.0 } else { -1.0 };
                let forward = tick < 240;
                sim.step(&ControlInput {
                    base: Some(BaseIntent {
                        linear: if forward { 0.5 } else { 0.0 },
                        angular: if forward { 0.0 } else { turn },
                    }),
                    ..ControlInput::default()
                });
                most = most.max(greatest_force(&sim));
            }
            most
        };
        let force = drive(true);
        assert!(force < 15.0, "{force} N");
        let force = drive(false);
        assert!(
            force > 50.0,
            "the person does not reach the furniture: {force} N"
        );
    }

    #[test]
    fn a_restored_state_continues_under_the_guard_with_the_same_bits() {
        let mut sim = seated(true);
        press(&mut sim, 1, 150);
        let saved = sim.save().expect("a state");
        let snapshot = sim.snapshot.clone();
        press(&mut sim, 1, 90);
        let hash = sim.world.hash();
        let mut again = seated(true);
        again.restore(&saved).expect("its own state");
        assert_eq!(again.snapshot, snapshot);
        press(&mut again, 1, 90);
        assert_eq!(again.world.hash(), hash);
    }

    #[test]
    fn guard_is_on_unless_it_is_switched_off() {
        assert!(PersonSetting::default().guard);
        let sim = seated(true);
        let guard = sim.person_guard(&ControlInput::default());
        assert!(guard.is_some());
        assert!(
            seated(false)
                .person_guard(&ControlInput::default())
                .is_none()
        );
    }
}
