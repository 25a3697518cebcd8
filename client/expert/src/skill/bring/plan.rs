//! Poses of the end effector on a way to the seated person, and clearance of the
//! carried object from the person. All in the frame of the chair.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use wheelarm_planning::obb::Obb;
use wheelarm_proto::exact;

use crate::goal::Goal;
use crate::hand::Ball;
use crate::scene::Seated;
use crate::skill::Now;

/// The tip is held this far before the lips, metres.
const BEFORE: f64 = 0.018;
/// The way to the lap is planned to this far over it, metres: the fingers reach below the
/// object. From there the object is laid down.
const OVER: f64 = 0.02;
/// The object is laid down at most this far below that, metres: the lap is not level.
const LAY: f64 = 0.05;
/// The straight way to the lips or down to the lap begins this far off, metres.
pub const AWAY: f64 = 0.11;
/// Clearance of the carried object from the person on the last way down to the lap,
/// metres.
const LAP_ROOM: f64 = 0.003;

/// Share of the plain operator's speed for the slowest operator.
const SLOWEST: f64 = 0.4;

/// A way of the end effector to the mouth.
#[derive(Clone, Debug, PartialEq)]
pub struct Way {
    /// Places of the grasp point on the way round: distance from the arm's base,
    /// direction from there, height, heading of the hand beside that at the start,
    /// and how far it leans forward; metres and radians.
    pub(super) corners: Vec<[f64; 5]>,
    /// The end effector at its start, in `base_link` turned as the chair.
    pub(super) start: Isometry3<f64>,
    /// Final approach of the hand.
    pub(super) end: End,
}

/// Final approach of a hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct End {
    /// Its heading beside that at the start, radians.
    pub(super) turn: f64,
    /// Forward lean, radians; `ways` lists the leans to try.
    pub(super) lean: f64,
    /// The place in the lap, forward of its middle, in shares of its half length.
    pub(super) forward: f64,
}

/// The place to which an object is brought.
pub enum To {
    /// The mouth in the frame of the chair.
    Lips(Isometry3<f64>),
    /// The lap in the frame of the chair.
    Lap(Obb),
}

/// A plan of the ways to the lips or the lap.
pub struct Plan<'a> {
    person: &'a Seated,
    /// The arm's base in the frame of the chair.
    base: Translation3<f64>,
    pub(super) to: To,
    /// The point that is brought to the lips, or to the middle of the lap, in the end
    /// effector's frame.
    tip: Point3<f64>,
    /// The longest side of the object in the end effector's frame.
    pub(super) long: Vector3<f64>,
    /// Half of its width across that on the floor plan, metres.
    wide: f64,
    tool_length: f64,
    /// Speeds on the way round, as a share of the plain operator's.
    pub(super) tempo: f64,
}

impl<'a> Plan<'a> {
    /// The plan for an object with the pose `tool_from_item` in the hand and an end
    /// effector at `start`; `None` without a seated person or an object to bring.
    pub fn of(
        now: &Now<'a>,
        tool_from_item: &Isometry3<f64>,
        start: &Isometry3<f64>,
        mouth: Option<Isometry3<f64>>,
    ) -> Option<Self> {
        let person = now.scene.person.as_ref()?;
        let boxes = now.scene.items[now.goal.item()].boxes.iter();
        let (middle, long, wide) = extent(boxes, &(start * tool_from_item));
        let (to, tip) = match now.goal {
            Goal::Bring { tip, .. } => (
                To::Lips(mouth.unwrap_or(person.mouth)),
                tool_from_item * tip,
            ),
            Goal::Give { lap, .. } => (To::Lap(*lap), start.inverse() * middle),
            _ => return None,
        };
        Some(Self {
            person,
            base: now.scene.chair_from_base.translation,
            to,
            tip,
            long: start.rotation.inverse() * long,
            wide,
            tool_length: now.scene.tool_length,
            tempo: now.profile.tempo.max(SLOWEST),
        })
    }

    /// The end effector, turned about the vertical from `start`, with the tip `off`
    /// metres before the lips or over the lap, in the frame of the chair.
    pub fn at(&self, start: &Isometry3<f64>, end: End, off: f64) -> Isometry3<f64> {
        let aim = match self.to {
            To::Lips(mouth) => {
                let out = mouth.rotation * Vector3::x();
                let out = Vector3::new(out.x, out.y, 0.0);
                let out = out.try_normalize(1e-6).unwrap_or_else(Vector3::x);
                mouth.translation.vector + out * off
            }
            To::Lap(lap) => {
                // A leaning object hangs deeper.
                let deeper = self.wide * exact::sin_cos(end.lean).0;
                let place = Vector3::new(end.forward * lap.half.x, 0.0, off + deeper);
                lap.pose.translation.vector + place
            }
        };
        let rotation = turned(end.turn, end.lean) * start.rotation;
        Isometry3::from_parts(
            Translation3::from(aim - rotation * self.tip.coords),
            rotation,
        )
    }

    /// Final distance of the tip from the target, metres.
    pub fn near(&self) -> f64 {
        match self.to {
            To::Lips(_) => BEFORE,
            To::Lap(_) => OVER,
        }
    }

    /// Final pose: the lowest one at which the object is laid down, or the one with the
    /// tip at the lips.
    pub fn last(&self, start: &Isometry3<f64>, end: End) -> Isometry3<f64> {
        match self.to {
            To::Lips(_) => self.at(start, end, BEFORE),
            To::Lap(_) => self.at(start, end, OVER - LAY),
        }
    }

    /// The grasp point of an end effector.
    pub fn grip(&self, tool: &Isometry3<f64>) -> Point3<f64> {
        tool * Point3::new(0.0, 0.0, self.tool_length)
    }

    /// The grasp point about the arm's base: distance, direction, height.
    pub fn polar(&self, tool: &Isometry3<f64>) -> [f64; 3] {
        let grip = self.grip(tool);
        let off = grip.coords - self.base.vector;
        [
            exact::hypot(off.x, off.y),
            exact::atan2(off.y, off.x),
            grip.z,
        ]
    }

    /// The end effector at a corner of a way.
    pub fn tool(&self, start: &Isometry3<f64>, corner: [f64; 5]) -> Isometry3<f64> {
        let [far, to, height, turn, lean] = corner;
        let (sin, cos) = exact::sin_cos(to);
        let rotation = turned(turn, lean) * start.rotation;
        let grip = Vector3::new(self.base.x + far * cos, self.base.y + far * sin, height);
        let palm = rotation * Vector3::new(0.0, 0.0, self.tool_length);
        Isometry3::from_parts(Translation3::from(grip - palm), rotation)
    }

    /// The end effector along a way, up to its end.
    pub fn poses(&self, way: &Way) -> Vec<Isometry3<f64>> {
        let round = way.corners.iter().skip(1);
        let round = round.map(|corner| self.tool(&way.start, *corner));
        let straight = [0.5 * (AWAY + self.near()), self.near()];
        let straight = straight.map(|off| self.at(&way.start, way.end, off));
        round.chain(straight).collect()
    }

    /// Whether what is in the hand keeps clear of the person on the way round, and on
    /// the straight way to the lips of all but the head, or down to the lap.
    pub fn keeps_clear(&self, way: &Way, held: &HeldBalls, room: [f64; 2]) -> bool {
        let poses = self.poses(way);
        let straight = poses.len() - way.corners.len() + 1;
        let room = |back: usize, moves: bool| match self.to {
            To::Lips(_) if back < straight && moves => None,
            To::Lap(_) if back < straight && !moves => Some(LAP_ROOM),
            _ => Some(room[usize::from(moves)]),
        };
        poses.iter().rev().enumerate().all(|(back, tool)| {
            let middle = tool * Point3::from(held.around.centre);
            self.person.capsules.iter().all(|capsule| {
                let Some(room) = room(back, capsule.moves) else {
                    return true;
                };
                let clear = |at: &Point3<f64>, radius: f64| capsule.distance(at) > radius + room;
                clear(&middle, held.around.radius)
                    || held
                        .balls
                        .iter()
                        .all(|ball| clear(&(tool * Point3::from(ball.centre)), ball.radius))
            })
        })
    }
}

/// Balls of a held object, in the end effector's frame, and one around all of them.
pub struct HeldBalls {
    pub(super) balls: Vec<Ball>,
    around: Ball,
}

impl HeldBalls {
    pub fn new(balls: Vec<Ball>) -> Self {
        let centres = balls.iter().map(|ball| ball.centre);
        let centre = centres.sum::<Vector3<f64>>() / balls.len().max(1) as f64;
        let reach = |ball: &Ball| (ball.centre - centre).norm() + ball.radius;
        let radius = balls.iter().map(reach).fold(0.0, f64::max);
        Self {
            balls,
            around: Ball {
                centre,
                // Rounding: what it excludes is clear for each ball too.
                radius: radius + 1e-6,
            },
        }
    }
}

/// A turn about the vertical, and then forward in the frame of the chair.
fn turned(turn: f64, lean: f64) -> UnitQuaternion<f64> {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn);
    UnitQuaternion::from_axis_angle(&Vector3::y_axis(), lean) * turn
}

/// Lowest point under the middle of an object, direction of its longest side on the
/// floor plan, and half of its width across that, metres.
fn extent<'b>(
    boxes: impl Iterator<Item = &'b Obb>,
    at: &Isometry3<f64>,
) -> (Point3<f64>, Vector3<f64>, f64) {
    let corners: Vec<_> = boxes
        .flat_map(|obb| obb.corners())
        .map(|p| at * p)
        .collect();
    let mut low = Vector3::repeat(f64::INFINITY);
    let mut high = Vector3::repeat(f64::NEG_INFINITY);
    for corner in &corners {
        low = low.inf(&corner.coords);
        high = high.sup(&corner.coords);
    }
    let middle = (low + high) / 2.0;
    // Main axis of the corners' scatter.
    let [xx, xy, yy] = corners.iter().fold([0.0; 3], |[xx, xy, yy], corner| {
        let off = corner.coords - middle;
        [xx + off.x * off.x, xy + off.x * off.y, yy + off.y * off.y]
    });
    let (sin, cos) = exact::sin_cos(0.5 * exact::atan2(2.0 * xy, xx - yy));
    let across = Vector3::new(-sin, cos, 0.0);
    let offs = corners
        .iter()
        .map(|corner| (corner.coords - middle).dot(&across));
    (
        Point3::new(middle.x, middle.y, low.z),
        Vector3::new(cos, sin, 0.0),
        offs.fold(0.0, |wide, off| off.abs().max(wide)),
    )
}
