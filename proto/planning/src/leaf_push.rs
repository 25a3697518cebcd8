//! Pushes a door of furniture shut: closed fingers press its outer face near the free edge and
//! follow its arc, from one base placement. A hand at the handle of an open door has to reach
//! around the door; one that pushes has not.
//!
//! Sampling of a scene and the scripted operator use [`HingedLeaf::pushes`] for the hand, and
//! check the same poses with the arm's kinematics.

use std::f64::consts::FRAC_PI_6;

use nalgebra::{
    Isometry3, Matrix3, Point3, Quaternion, Rotation3, Translation3, UnitQuaternion, Vector3,
};
use wheelarm_proto::exact;

use super::closed_hand::ClosedHand;
use super::footprint_check::{Pose2, wrap};
use super::hinged_leaf::HingedLeaf;
use super::obb::Obb;

/// An axis with a smaller upright part is that of a flap, which is not pushed.
const UPRIGHT: f64 = 0.99;
/// The hand keeps this distance from the free edge, and from the ends of the face, metres.
const EDGE: f64 = 0.05;
/// Least distance from the hinge at which the hand pushes, metres: the force at 1 N·m of
/// friction is 7 N.
const NEAREST: f64 = 0.15;
/// Distances from the hinge that are tried, as shares of the greatest one.
const SHARES: [f64; 2] = [1.0, 0.75];
/// Heights of the hand over the floor that are tried, metres.
const HEIGHTS: [f64; 2] = [0.35, 1.20];
/// Their step, and the height that is tried first.
const HEIGHT_STEP: f64 = 0.12;
const BEST_HEIGHT: f64 = 0.75;
/// Angles by which the hand points down, radians.
const DOWN: [f64; 2] = [0.0, 0.4];
/// Greatest angle between the hand and the inward normal of the face, radians.
const ASKEW: f64 = 1.0;
/// Shares of the door's turn by which the hand keeps its direction, the best first: with 1 it
/// does not turn, with 0 it turns as the door does.
const LAGS: [f64; 3] = [1.0, 0.5, 0.0];
/// Before it pushes, the hand is this far from the face, metres.
const GAP: f64 = 0.012;
/// The hand aims this far beyond the face, metres: with the arm's stiffness, the force stays
/// below 20 N where the door stops.
const PRESS: f64 = 0.004;
/// Length of the straight approach, metres.
const APPROACH: f64 = 0.12;
/// Spacing of the poses at which the arm is checked, metres, and greatest change of a joint
/// between two of them, radians: more means that the arm would have to fold over.
pub const ARM_STEPS: [f64; 2] = [0.10, 1.0];
/// Angle between two poses on the arc, radians.
const ARC_STEP: f64 = 0.14;
/// Spacing at which the approach is checked, metres.
const SPACING: f64 = 0.03;
/// Steps of the heading of the chair against the hand, and of the direction to the hand
/// against the heading, radians; and how many to either side.
const TURN: f64 = 0.25;
const TURNS: i32 = 2;
/// Step of the distance between the arm's base and the hand, metres.
const STEP: f64 = 0.08;
/// Pushes that are kept.
const MOST: usize = 150;
/// Placements whose arm is checked.
const LOOKS: usize = 1_500;
/// Placements that differ less count once, metres and radians.
const APART: [f64; 2] = [0.1, 0.3];
/// The arm counts as a straight bar of this radius from its shoulder to the wrist, metres.
const ARM: f64 = 0.05;
/// The shoulder over the arm's base, and the wrist behind the hand, metres.
const SHOULDER: f64 = 0.28;
const WRIST: f64 = 0.17;

/// The outer face of a closed door.
struct Face {
    /// Index of its box.
    panel: usize,
    /// Level unit vector from the hinge along the face.
    along: Vector3<f64>,
    /// Its normal, which points outwards.
    normal: Vector3<f64>,
    /// Distance from the axis along the normal, metres.
    depth: f64,
    /// Distance of the free edge from the axis, metres.
    far: f64,
    /// Lower and upper end over the floor, metres.
    heights: [f64; 2],
}

/// Where and how the hand pushes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PushShape {
    /// Distance from the hinge, metres.
    pub reach: f64,
    /// Height over the floor, metres.
    pub height: f64,
    /// Turn of the hand against the inward normal of the face when it begins, about the axis,
    /// radians.
    pub aside: f64,
    /// Angle by which the hand points down, radians.
    pub down: f64,
    /// Share of the door's turn by which the hand keeps its direction.
    pub lag: f64,
}

/// A push from one angle of the door.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LeafPush {
    /// Where and how.
    pub shape: PushShape,
    /// End effector before the door, from where it moves straight to `contact`.
    pub before: Isometry3<f64>,
    /// End effector at the door.
    pub contact: Isometry3<f64>,
    /// The lower the better.
    pub cost: f64,
}

/// A base placement from which the arm pushes a door shut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PushStop {
    /// Pose of the chair.
    pub chair: Pose2,
    /// The push from there.
    pub push: LeafPush,
}

/// Why a door cannot be pushed shut; later ones are nearer to success.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum NoPush {
    /// It is a flap, or its face is too small, too low or too high.
    NoFace,
    /// Furniture or a wall leaves no room for the hand.
    NoRoomForHand,
    /// No free floor from which the arm may reach it.
    NoFloor,
    /// Something is between the arm and the door.
    Covered,
    /// The arm does not reach along the whole arc.
    OutOfReach,
}

impl std::fmt::Display for NoPush {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        out.write_str(match self {
            Self::NoFace => "it has no upright hinge, or no face at the height of the arm",
            Self::NoRoomForHand => "walls or furniture leave no room for the hand before it",
            Self::NoFloor => "no free floor from which the arm may reach it",
            Self::Covered => "something is between the arm and the door",
            Self::OutOfReach => "the arm does not reach along its whole arc",
        })
    }
}

/// `v` turned about a unit vector.
fn turned(v: &Vector3<f64>, axis: &Vector3<f64>, angle: f64) -> Vector3<f64> {
    let (sin, cos) = exact::sin_cos(angle);
    v * cos + axis.cross(v) * sin + axis * (axis.dot(v) * (1.0 - cos))
}

impl HingedLeaf {
    /// The face of the largest box.
    fn face(&self) -> Option<Face> {
        let axis = self.axis.into_inner();
        if axis.z.abs() < UPRIGHT {
            return None;
        }
        let volume = |obb: &Obb| obb.half.x * obb.half.y * obb.half.z;
        let panels = self.boxes.iter().enumerate();
        let (panel, obb) = panels.max_by(|(_, a), (_, b)| volume(a).total_cmp(&volume(b)))?;
        let obb = obb.at(&self.rest);
        let origin = self.rest.translation.vector;
        let middle = obb.pose.translation.vector - origin;
        let level = middle - axis * axis.dot(&middle);
        let along = level.try_normalize(1e-6)?;
        let mut normal = axis.cross(&along);
        // A hinge may be behind the face: the panel's own normal counts.
        let sides = [Vector3::x(), Vector3::y(), Vector3::z()].map(|side| obb.pose.rotation * side);
        let nearest = sides.into_iter().max_by(|a, b| {
            let [a, b] = [a, b].map(|side| side.dot(&normal).abs());
            a.total_cmp(&b)
        })?;
        normal = nearest * nearest.dot(&normal).signum();
        let along = normal.cross(&axis);
        let most = |direction: &Vector3<f64>| {
            let corners = obb.corners().map(|p| direction.dot(&(p.coords - origin)));
            corners.fold(f64::NEG_INFINITY, f64::max)
        };
        Some(Face {
            panel,
            along,
            normal,
            depth: most(&normal),
            far: most(&along),
            heights: obb.heights(),
        })
    }

    /// The end effector at the face at an angle, `gap` metres before it.
    fn hand_at(
        &self,
        face: &Face,
        hand: &ClosedHand,
        shape: &PushShape,
        (angle, aside, gap): (f64, f64, f64),
    ) -> Isometry3<f64> {
        let axis = self.axis.into_inner();
        let [along, normal] = [face.along, face.normal].map(|v| turned(&v, &axis, angle));
        let origin = self.rest.translation.vector;
        let mut point = origin + along * shape.reach + normal * face.depth;
        point.z = shape.height;
        let ahead = turned(&-normal, &axis, aside);
        let (sin, cos) = exact::sin_cos(shape.down);
        let forward = ahead * cos - Vector3::z() * sin;
        let closing = Vector3::z().cross(&ahead);
        let rotation = Matrix3::from_columns(&[closing, forward.cross(&closing), forward]);
        let rotation = Rotation3::from_matrix_unchecked(rotation);
        let tool = Isometry3::from_parts(
            Translation3::from(point - forward * hand.tip),
            UnitQuaternion::from_rotation_matrix(&rotation),
        );
        // The corner of a hand that is not square to the face touches first.
        let clearance = hand.balls.iter().map(|ball| {
            let middle = (tool * Point3::from(ball.centre)).coords;
            (middle - point).dot(&normal) - ball.radius
        });
        let clearance = clearance.fold(f64::INFINITY, f64::min);
        Translation3::from(normal * (gap - clearance)) * tool
    }

    /// Poses of the end effector that push the door from one angle to another, in `house`.
    #[must_use]
    pub fn way(
        &self,
        hand: &ClosedHand,
        shape: &PushShape,
        [from, to]: [f64; 2],
    ) -> Vec<Isometry3<f64>> {
        let Some(face) = self.face() else {
            return Vec::new();
        };
        let steps = ((from - to).abs() / ARC_STEP).ceil().max(1.0) as u32;
        let at = |step: u32| {
            let angle = from + (to - from) * f64::from(step) / f64::from(steps);
            let aside = shape.aside + shape.lag * (from - angle);
            self.hand_at(&face, hand, shape, (angle, aside, -PRESS))
        };
        (1..=steps).map(at).collect()
    }

    /// The same shape for a hand at `tool`, whose direction it keeps, at an angle.
    #[must_use]
    pub fn continued(&self, shape: &PushShape, tool: &Isometry3<f64>, angle: f64) -> PushShape {
        let Some(face) = self.face() else {
            return *shape;
        };
        let axis = self.axis.into_inner();
        let inward = -turned(&face.normal, &axis, angle);
        let ahead = tool.rotation * Vector3::z();
        let across = inward.cross(&ahead).dot(&axis);
        PushShape {
            aside: exact::atan2(across, inward.dot(&ahead)),
            ..*shape
        }
    }

    /// Pushes from one angle to another among boxes `around`, without those of the door, that
    /// leave the hand room of `margin` metres; the best first.
    ///
    /// # Errors
    /// Why there is none.
    pub fn pushes(
        &self,
        hand: &ClosedHand,
        [from, to]: [f64; 2],
        around: &[Obb],
        margin: f64,
    ) -> Result<Vec<LeafPush>, NoPush> {
        let face = self.face().ok_or(NoPush::NoFace)?;
        let most = face.far - EDGE;
        let low = HEIGHTS[0].max(face.heights[0] + EDGE);
        let high = HEIGHTS[1].min(face.heights[1] - EDGE);
        if most < NEAREST || low > high {
            return Err(NoPush::NoFace);
        }
        let reaches = SHARES.map(|share| share * most);
        let reaches = reaches.into_iter().filter(|reach| *reach >= NEAREST);
        let own = self.boxes_at(from);
        let mut found = Vec::new();
        for shape in reaches.flat_map(|reach| shapes(reach, [low, high], from - to)) {
            let contact = self.hand_at(&face, hand, &shape, (from, shape.aside, GAP));
            let steps = (APPROACH / SPACING).ceil() as u32;
            let approaches = (0..=steps).all(|step| {
                let back = APPROACH * f64::from(step) / f64::from(steps);
                let tool = contact * Translation3::new(0.0, 0.0, -back);
                let margin = margin.min(GAP / 2.0);
                hand.is_free(&tool, margin, around.iter().chain(&own))
            });
            if !approaches {
                continue;
            }
            let shapes = LAGS.map(|lag| PushShape { lag, ..shape });
            let fits =
                |shape: &PushShape| self.has_room(&face, hand, shape, [from, to], (around, margin));
            found.extend(shapes.into_iter().filter(fits).map(|shape| LeafPush {
                shape,
                before: contact * Translation3::new(0.0, 0.0, -APPROACH),
                contact,
                cost: cost(&shape, most, from - to),
            }));
        }
        if found.is_empty() {
            return Err(NoPush::NoRoomForHand);
        }
        found.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        found.truncate(MOST);
        Ok(found)
    }

    /// Whether the hand keeps clear of everything but the face on its way.
    fn has_room(
        &self,
        face: &Face,
        hand: &ClosedHand,
        shape: &PushShape,
        [from, to]: [f64; 2],
        (around, margin): (&[Obb], f64),
    ) -> bool {
        let last = shape.aside + shape.lag * (from - to);
        if last.abs() > ASKEW {
            return false;
        }
        let way = self.way(hand, shape, [from, to]);
        let count = way.len().max(1) as f64;
        way.iter().enumerate().all(|(i, tool)| {
            let angle = from + (to - from) * (i + 1) as f64 / count;
            let mut own = self.boxes_at(angle);
            own.remove(face.panel);
            // Boxes around furniture are larger than it.
            hand.is_free(tool, margin - 2.0 * PRESS, around.iter().chain(&own))
        })
    }

    /// Base placements, at most `most` that differ, from which an arm pushes the door from one
    /// angle to another.
    ///
    /// # Errors
    /// Why there is none.
    pub fn placements(
        &self,
        [from, to]: [f64; 2],
        around: &[Obb],
        chair: &mut PushingChair<'_>,
        most: usize,
    ) -> Result<Vec<PushStop>, NoPush> {
        let pushes = self.pushes(chair.hand, [from, to], around, 0.0)?;
        let mut why = NoPush::NoFloor;
        let mut found: Vec<PushStop> = Vec::new();
        let mut looked = 0;
        let ends = [self.boxes_at(from), self.boxes_at(to)];
        for push in &pushes {
            let way = self.way(chair.hand, &push.shape, [from, to]);
            let end = way.last().unwrap_or(&push.contact);
            for pose in chair.around(&push.contact) {
                let is_known = |PushStop { chair: known, .. }: &PushStop| {
                    known.distance(&pose) < APART[0]
                        && wrap(known.heading - pose.heading).abs() < APART[1]
                };
                if found.iter().any(is_known) || !(chair.is_stop)(&pose) {
                    continue;
                }
                if looked == LOOKS {
                    return enough(found, why);
                }
                looked += 1;
                let house_from_base = pose_on_floor(&pose) * chair.mount;
                let hands = [&push.contact, end].into_iter().zip(&ends);
                let mut hands = hands.map(|(hand, own)| (hand, around.iter().chain(own)));
                if !hands.all(|(hand, boxes)| arm_is_free(&house_from_base, hand, boxes)) {
                    why = why.max(NoPush::Covered);
                    continue;
                }
                let base_from_house = house_from_base.inverse();
                let poses = [push.before, push.contact].into_iter();
                let poses = poses.chain(way.iter().copied());
                let poses: Vec<_> = poses.map(|pose| base_from_house * pose).collect();
                let reached = (chair.reaches)(&poses);
                match reached {
                    true => found.push(PushStop {
                        chair: pose,
                        push: *push,
                    }),
                    false => why = why.max(NoPush::OutOfReach),
                }
                if found.len() == most {
                    return Ok(found);
                }
            }
        }
        enough(found, why)
    }
}

fn enough(found: Vec<PushStop>, why: NoPush) -> Result<Vec<PushStop>, NoPush> {
    match found.is_empty() {
        true => Err(why),
        false => Ok(found),
    }
}

/// Shapes at one distance from the hinge, for a door that turns by `turn`.
fn shapes(reach: f64, [low, high]: [f64; 2], turn: f64) -> impl Iterator<Item = PushShape> {
    let steps = ((high - low) / HEIGHT_STEP).ceil().max(1.0) as u32;
    let heights = (0..=steps).map(move |i| low + (high - low) * f64::from(i) / f64::from(steps));
    // A hand that keeps its direction is square to the face in the middle of the turn.
    let asides = [-turn / 2.0, -turn, 0.0, -turn / 2.0 - FRAC_PI_6, FRAC_PI_6];
    let asides = asides.into_iter().filter(|aside| aside.abs() <= ASKEW);
    let ways: Vec<(f64, f64)> = asides
        .flat_map(|aside| DOWN.map(|down| (aside, down)))
        .collect();
    heights.flat_map(move |height| {
        let of_height = move |(aside, down)| PushShape {
            reach,
            height,
            aside,
            down,
            lag: LAGS[0],
        };
        ways.clone().into_iter().map(of_height)
    })
}

/// The lower the better.
fn cost(shape: &PushShape, furthest: f64, turn: f64) -> f64 {
    let askew = (shape.aside + turn / 2.0) / 0.5;
    let high = (shape.height - BEST_HEIGHT) / 0.25;
    let near = (furthest - shape.reach) / 0.1;
    0.3 * askew * askew
        + 0.2 * high * high
        + 0.2 * near
        + 0.3 * shape.down
        + 0.1 * (LAGS[0] - shape.lag)
}

/// Whether a straight bar from the shoulder to the wrist keeps clear of `boxes`.
fn arm_is_free<'a>(
    house_from_base: &Isometry3<f64>,
    tool: &Isometry3<f64>,
    boxes: impl Iterator<Item = &'a Obb>,
) -> bool {
    let shoulder = house_from_base * Point3::new(0.0, 0.0, SHOULDER);
    let wrist = tool * Point3::new(0.0, 0.0, -WRIST);
    let between = wrist - shoulder;
    let length = between.norm();
    let steps = (length / ARM).ceil().max(1.0) as u32;
    let boxes: Vec<&Obb> = boxes
        .filter(|obb| obb.distance(&shoulder) < length + ARM)
        .collect();
    (0..=steps).all(|step| {
        let point = shoulder + between * (f64::from(step) / f64::from(steps));
        boxes.iter().all(|obb| obb.distance(&point) > ARM)
    })
}

/// `wheelchair_root` in `house`.
fn pose_on_floor(pose: &Pose2) -> Isometry3<f64> {
    let (sin, cos) = exact::sin_cos(pose.heading / 2.0);
    Isometry3::from_parts(
        Translation3::new(pose.x, pose.y, 0.0),
        UnitQuaternion::new_normalize(Quaternion::new(cos, 0.0, 0.0, sin)),
    )
}

/// The chair and its arm.
pub struct PushingChair<'a> {
    /// chair_from_base.
    pub mount: Isometry3<f64>,
    /// Least and greatest distance on the floor plan from the arm's base to the hand, metres.
    pub range: [f64; 2],
    /// The hand.
    pub hand: &'a ClosedHand,
    /// Whether the chair stops at a pose.
    pub is_stop: &'a dyn Fn(&Pose2) -> bool,
    /// Whether the arm, from home, reaches poses of the end effector in its base one after
    /// another.
    pub reaches: &'a mut dyn FnMut(&[Isometry3<f64>]) -> bool,
}

impl PushingChair<'_> {
    /// Poses of the chair for a hand, straight behind it first.
    fn around(&self, tool: &Isometry3<f64>) -> Vec<Pose2> {
        let point = tool * Point3::new(0.0, 0.0, self.hand.tip);
        let forward = tool.rotation * Vector3::z();
        let facing = exact::atan2(forward.y, forward.x);
        let mount = self.mount.translation;
        let [nearest, furthest] = self.range;
        let steps = ((furthest - nearest) / STEP).round().max(0.0) as u32;
        let aside = || {
            (0..=2 * TURNS).map(|i| {
                let sign = if i % 2 == 0 { -1.0 } else { 1.0 };
                sign * f64::from((i + 1) / 2) * TURN
            })
        };
        let mut poses = Vec::new();
        for turn in aside() {
            let heading = wrap(facing + turn);
            let (sin, cos) = exact::sin_cos(heading);
            for bearing in aside() {
                let (left, ahead) = exact::sin_cos(bearing);
                for step in 0..=steps {
                    let distance = furthest - STEP * f64::from(step);
                    let [u, v] = [mount.x + distance * ahead, mount.y + distance * left];
                    poses.push(Pose2 {
                        x: point.x - u * cos + v * sin,
                        y: point.y - u * sin - v * cos,
                        heading,
                    });
                }
            }
        }
        poses
    }
}

/// Poses on straight lines from `start` through `stops`, at most `spacing` metres apart; a
/// radian of turning counts as 0.3 m.
#[must_use]
pub fn sampled_lines(
    start: &Isometry3<f64>,
    stops: &[Isometry3<f64>],
    spacing: f64,
) -> Vec<Isometry3<f64>> {
    let mut start = *start;
    let mut line = vec![start];
    for stop in stops {
        let length = (stop.translation.vector - start.translation.vector)
            .norm()
            .max(0.3 * start.rotation.angle_to(&stop.rotation));
        let samples = (length / spacing).ceil().max(1.0) as usize;
        let share = |sample| sample as f64 / samples as f64;
        line.extend((1..=samples).map(|sample| start.lerp_slerp(stop, share(sample))));
        start = *stop;
    }
    line
}

#[cfg(test)]
mod tests {
    use super::super::closed_hand::Ball;
    use super::*;

    const OPEN: f64 = 0.95;

    /// A door of a cupboard along the wall y = 0, whose room has negative y. It opens to the
    /// left of a person before it.
    fn door() -> HingedLeaf {
        HingedLeaf {
            rest: Isometry3::translation(0.0, 0.0, 0.4),
            axis: -Vector3::z_axis(),
            boxes: vec![
                Obb {
                    pose: Isometry3::translation(0.225, 0.01, 0.35),
                    half: Vector3::new(0.22, 0.01, 0.34),
                    round: false,
                },
                Obb {
                    pose: Isometry3::translation(0.40, -0.02, 0.35),
                    half: Vector3::new(0.006, 0.02, 0.06),
                    round: false,
                },
            ],
        }
    }

    fn hand() -> ClosedHand {
        let palm = [-0.165, -0.06, 0.0, 0.03, 0.07].map(|z| Ball {
            centre: Vector3::z() * z,
            radius: 0.04,
        });
        ClosedHand::with_fingers(palm.to_vec(), 0.024, 0.163)
    }

    /// Placements of a chair among boxes, with an arm that reaches a shell.
    fn placements(around: &[Obb]) -> Result<Vec<PushStop>, NoPush> {
        let hand = hand();
        let stands = |pose: &Pose2| {
            // A round chair of 0.45 m radius.
            let middle = pose.rolled(0.3, 0.0);
            let middle = Point3::new(middle.x, middle.y, 0.3);
            let door = door().boxes_at(OPEN);
            middle.y < -0.5
                && around.iter().chain(&door).all(|obb| {
                    let level = Point3::new(middle.x, middle.y, obb.pose.translation.z);
                    obb.distance(&level) > 0.45
                })
        };
        let mut reaches = |poses: &[Isometry3<f64>]| {
            let shell = |pose: &Isometry3<f64>| {
                let far = (pose.translation.vector - Vector3::z() * 0.28).norm();
                (0.3..0.85).contains(&far) && (pose.rotation * Vector3::z()).x > 0.0
            };
            poses.iter().all(shell)
        };
        let mut chair = PushingChair {
            mount: Isometry3::translation(0.3, 0.3, 0.5),
            range: [0.42, 0.8],
            hand: &hand,
            is_stop: &stands,
            reaches: &mut reaches,
        };
        door().placements([OPEN, 0.0], around, &mut chair, 3)
    }

    #[test]
    fn hand_follows_the_face_and_keeps_touching_it() {
        let (door, hand) = (door(), hand());
        let pushes = door.pushes(&hand, [OPEN, 0.0], &[], 0.0).expect("pushes");
        let face = door.face().expect("a face");
        assert!((face.far - 0.445).abs() < 1e-9 && (face.normal + Vector3::y()).norm() < 1e-9);
        for push in &pushes {
            let way = door.way(&hand, &push.shape, [OPEN, 0.0]);
            let panel = |angle: f64| door.boxes_at(angle)[0];
            let gap = hand.distance(&push.contact, &panel(OPEN));
            assert!((gap - GAP).abs() < 1e-3, "{gap} m at {:?}", push.shape);
            // A hand that keeps its direction does not turn.
            let end = way.last().expect("a way");
            let turned = end.rotation.angle_to(&push.contact.rotation);
            assert!((turned - (1.0 - push.shape.lag) * OPEN).abs() < 1e-6);
            let deep = hand.distance(end, &panel(0.0)) + PRESS;
            assert!(deep.abs() < 5e-3, "{deep} m at {:?}", push.shape);
        }
        // It continues in its own direction from another angle.
        let push = pushes[0];
        let shape = door.continued(&push.shape, &push.contact, OPEN);
        assert!((shape.aside - push.shape.aside).abs() < 1e-9);
        let later = door.continued(&push.shape, &push.contact, 0.5);
        assert!((later.aside - push.shape.aside - (OPEN - 0.5)).abs() < 1e-9);
    }

    #[test]
    fn open_door_within_reach_is_pushed_shut() {
        let found = placements(&[]).expect("placements");
        assert_eq!(found.len(), 3);
        // From the side of the hinge, which the outer face looks at.
        assert!(
            found
                .iter()
                .all(|stop| stop.chair.x < 0.4 && stop.chair.y < -0.5),
            "{found:?}"
        );
    }

    #[test]
    fn corner_of_a_door_beside_a_wall_stops_it() {
        // The face is 41 mm before the hinge, and the wall 30 mm beside it.
        let door = HingedLeaf {
            boxes: vec![Obb::between([-0.009, -0.041, 0.0], [0.787, 0.003, 0.8])],
            ..door()
        };
        let wall = Obb::between([-0.3, -2.0, 0.0], [-0.0305, 1.0, 2.5]);
        assert!(door.swings_free(0.58, &[wall]));
        assert!(!door.swings_free(0.80, &[wall]));
        assert!(door.swings_free(1.2, &[]));
        // What it meets when it is closed does not count.
        let frame = Obb::between([0.1, -0.02, 0.0], [0.3, 0.1, 2.0]);
        assert!(door.swings_free(1.2, &[frame]));
        // But what it only touches then counts where it turns into it.
        let touched = Obb::between([-0.3, -0.6, 0.0], [-0.005, 1.0, 2.5]);
        assert!(!door.swings_free(1.2, &[touched]));
        let beside = Obb::between([0.783, -0.03, 0.0], [1.4, 0.5, 0.8]);
        assert!(door.swings_free(1.2, &[beside]));
    }

    #[test]
    fn door_behind_a_wall_is_refused_with_the_reason() {
        // Beside the free edge, between the door and the room.
        let near = Obb::between([-2.0, -0.5, 0.0], [2.0, -0.38, 2.5]);
        assert_eq!(placements(&[near]), Err(NoPush::Covered));
        // Furniture up to the face.
        let full = Obb::between([-2.0, -2.0, 0.0], [2.0, -0.02, 2.5]);
        assert_eq!(placements(&[full]), Err(NoPush::NoRoomForHand));
        // Further away it leaves no floor from which the arm reaches the door.
        let far = Obb::between([-3.0, -1.3, 0.0], [3.0, -0.8, 2.5]);
        assert_eq!(placements(&[far]), Err(NoPush::NoFloor));
        // A flap has no upright hinge.
        let flap = HingedLeaf {
            axis: Vector3::x_axis(),
            ..door()
        };
        let why = flap.pushes(&hand(), [OPEN, 0.0], &[], 0.0);
        assert_eq!(why, Err(NoPush::NoFace));
    }
}
