//! Grasps of a parallel gripper: antipodal points of the surface, from which a level hand, a hand
//! from above, or a hand on a flat object is free.

use wheelarm_pack::GraspEntry;
use wheelarm_proto::exact;

use super::hand::Hand;
use super::hull::decimal;
use super::mesh::{Face, Mesh, Sample, Vec3, sample};
use crate::simplify;

/// Rays, and points that a hand may not touch.
const RAYS: usize = 4_000;
const POINTS: usize = 4_000;
/// Width of a ray's jitter about the normal.
const JITTER: f64 = 0.2;
/// Least cosine between a ray and the normals at its ends: 20 degrees.
const ANTIPODAL: f64 = 0.94;
/// Room beside an object within the stroke, metres.
const MARGIN: f64 = 0.004;
/// Least width, metres.
const LEAST: f64 = 0.002;
/// Depths of the contact beyond the grasp point that are tried, metres.
const DEPTHS: [f64; 4] = [0.022, 0.014, 0.030, 0.037];
/// Half height of a pad, metres.
const PAD: f64 = 0.011;
/// Points between the pads below which the surface is too small.
const FEW: usize = 4;
/// Deviation of touched points from the pads, metres.
const TOUCH: f64 = 0.0015;
/// The same of points that hold against a rotation, and the weight of their extent. On a cone
/// only the edge of a flat pad touches: a bottle turned by 3 degrees in the hand, was put down
/// leaning, and tipped.
const HOLD: f64 = 0.0005;
const HELD: f64 = 0.5;
/// Room of the palm, metres.
const PALM_ROOM: f64 = 0.003;
/// How far the fingers open before they close on an object, metres.
const OPENING: f64 = 0.03;
/// Least height of the grasp point of a level hand, metres: the expert leans it.
const LEVEL_HEIGHT: f64 = 0.036;
/// The same of a hand whose fingers are above each other.
const FLAT_HEIGHT: f64 = 0.055;
/// Least distance of the tips from the ground, metres.
const TIP_ROOM: f64 = 0.003;
/// Distance of a grasp about the axis of a round object, metres, and least cosine between the
/// closing direction of one at its rim and the radius.
const MIDDLE: f64 = 0.006;
const RADIAL: f64 = 0.98;
/// Most grasps, and most of each kind.
const MOST: usize = 16;
const MOST_OF_KIND: usize = 10;

/// Name of a grasp at the wall of a cup.
pub const RIM: &str = "rim";

/// How a hand approaches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Way {
    Level,
    Above,
    /// From above at the wall of a round object, with one finger inside.
    Rim,
    /// Level, with one finger above the other.
    Flat,
}

impl Way {
    fn name(self) -> &'static str {
        match self {
            Self::Level => "side",
            Self::Above => "top",
            Self::Rim => RIM,
            Self::Flat => "flat",
        }
    }
}

#[derive(Clone, Copy, Debug)]
struct Candidate {
    point: Vec3,
    approach: Vec3,
    closing: Vec3,
    width: f64,
    way: Way,
    score: f64,
}

/// The grasps of an object.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Grasps {
    /// At most 16, the best first.
    pub kept: Vec<GraspEntry>,
    /// Antipodal pairs with their approaches, and those with a free hand.
    pub sampled: usize,
    /// The same.
    pub free: usize,
    /// Narrowest pair of opposite points, metres; infinite without any.
    pub narrowest: f64,
    /// Rotation about z that brings the grasps of a level hand to the front, radians.
    pub turn: f64,
    /// Largest rotation from the direction inwards at which a grasp is left, degrees.
    pub yaw_deg: f64,
}

/// Samples the grasps of a mesh whose base is at z = 0; `is_round` is about z.
pub fn sampled(mesh: &Mesh, com: &Vec3, hand: &Hand, is_round: bool) -> Grasps {
    let points = sample(mesh, POINTS);
    let mut grasps = Grasps {
        narrowest: f64::INFINITY,
        ..Grasps::default()
    };
    let mut free = Vec::new();
    for pair in pairs(mesh) {
        grasps.narrowest = grasps.narrowest.min(pair.width);
        if pair.width > hand.stroke - MARGIN {
            continue;
        }
        for (approach, closing, way) in approaches(&pair.axis) {
            grasps.sampled += 1;
            let found = DEPTHS.iter().find_map(|depth| {
                let point = pair.middle - approach * *depth;
                fitted(hand, &points, com, (point, approach, closing, way))
            });
            free.extend(found);
        }
    }
    grasps.free = free.len();
    free.sort_by(|a, b| b.score.total_cmp(&a.score));
    let kept = match is_round {
        true => different_of_round(&free),
        false => different(&free),
    };
    let (turn, yaw_deg) = match is_round {
        true => (0.0, 180.0),
        false => facing(&kept),
    };
    grasps.turn = turn;
    grasps.yaw_deg = yaw_deg;
    let (sin, cos) = exact::sin_cos(turn);
    let turned = |v: Vec3| Vec3::new(v.x * cos - v.y * sin, v.x * sin + v.y * cos, v.z);
    grasps.kept = kept
        .iter()
        .map(|grasp| {
            let text = |v: Vec3| turned(v).map(decimal).into();
            // Unit vectors stay so with five decimals.
            GraspEntry {
                name: grasp.way.name().to_owned(),
                point: text(grasp.point),
                approach: text(grasp.approach),
                closing: text(grasp.closing),
                width: decimal(grasp.width.max(LEAST)),
                symmetric: is_round && grasp.way != Way::Flat,
                force: None,
                from_above: false,
            }
        })
        .collect();
    grasps
}

/// Opposite points of a surface.
struct Pair {
    middle: Vec3,
    axis: Vec3,
    width: f64,
}

/// Pairs of points whose normals are along the line between them.
fn pairs(mesh: &Mesh) -> Vec<Pair> {
    let faces = few_faces(mesh);
    let [low, high] = mesh.bounds();
    let size = (high - low).norm();
    let mut found = Vec::new();
    for (i, Sample { at, normal }) in sample(mesh, RAYS).into_iter().enumerate() {
        let jitter = Vec3::from([0.1031, 0.1137, 0.0973].map(|step: f64| {
            let share = ((i as f64 + 1.0) * (step * 7.389)).fract();
            JITTER * (2.0 * share - 1.0)
        }));
        let Some(axis) = (jitter - normal).try_normalize(1.0e-6) else {
            continue;
        };
        // The pads press from outside: the far side is the first that a ray meets from there.
        let start = at + axis * (2.0 * size);
        let hits = faces.iter().filter_map(|face| hit(face, &start, &-axis));
        let Some((distance, far)) = hits.min_by(|a, b| a.0.total_cmp(&b.0)) else {
            continue;
        };
        let width = 2.0 * size - distance;
        if width < LEAST || far.dot(&axis).abs() < ANTIPODAL || -normal.dot(&axis) < ANTIPODAL {
            continue;
        }
        // The pads touch both sides flat.
        let far = far * far.dot(&axis).signum();
        let Some(flat) = (far - normal).try_normalize(1.0e-6) else {
            continue;
        };
        found.push(Pair {
            middle: at + axis * (width / 2.0),
            axis: flat,
            width: width * axis.dot(&flat),
        });
    }
    found
}

/// The faces of a mesh, simplified where they are many.
fn few_faces(mesh: &Mesh) -> Vec<Face> {
    if mesh.faces.len() <= simplify::MOST {
        return mesh.faces.clone();
    }
    let [low, high] = mesh.bounds();
    let corners = mesh
        .faces
        .iter()
        .map(|face| face.corners.map(|c| (c.into(), None)));
    let simple = simplify::simplify(corners.collect(), (high - low).max());
    let face = |corners: [crate::glb::Corner; 3]| Face {
        corners: corners.map(|(point, _)| Vec3::from(point)),
        uvs: None,
        surface: 0,
    };
    simple.into_iter().map(face).collect()
}

/// Distance to a face and its unit normal, if a ray meets it.
fn hit(face: &Face, start: &Vec3, along: &Vec3) -> Option<(f64, Vec3)> {
    let [a, b, c] = face.corners;
    let (ab, ac) = (b - a, c - a);
    let across = along.cross(&ac);
    let area = ab.dot(&across);
    if area.abs() < 1.0e-14 {
        return None;
    }
    let from = start - a;
    let u = from.dot(&across) / area;
    let q = from.cross(&ab);
    let v = along.dot(&q) / area;
    if u < 0.0 || v < 0.0 || u + v > 1.0 {
        return None;
    }
    let distance = ac.dot(&q) / area;
    (distance > 0.0).then(|| (distance, ab.cross(&ac).normalize()))
}

/// Directions from which a hand may close along an axis.
fn approaches(axis: &Vec3) -> Vec<(Vec3, Vec3, Way)> {
    if axis.z.abs() < 0.25 {
        let Some(closing) = Vec3::new(axis.x, axis.y, 0.0).try_normalize(1.0e-6) else {
            return Vec::new();
        };
        let aside = Vec3::new(closing.y, -closing.x, 0.0);
        return vec![
            (aside, closing, Way::Level),
            (-aside, closing, Way::Level),
            (-Vec3::z(), closing, Way::Above),
        ];
    }
    if axis.z.abs() > 0.97 {
        let closing = Vec3::z() * axis.z.signum();
        return (0..16)
            .map(|k| {
                let (sin, cos) = exact::sin_cos(std::f64::consts::TAU * f64::from(k) / 16.0);
                (Vec3::new(cos, sin, 0.0), closing, Way::Flat)
            })
            .collect();
    }
    Vec::new()
}

/// The grasp at a point, when the hand is free there.
fn fitted(
    hand: &Hand,
    points: &[Sample],
    com: &Vec3,
    (point, approach, closing, way): (Vec3, Vec3, Vec3, Way),
) -> Option<Candidate> {
    let is_high = match way {
        Way::Above | Way::Rim => point.z - hand.tip >= TIP_ROOM,
        Way::Level => point.z >= LEVEL_HEIGHT,
        Way::Flat => point.z >= FLAT_HEIGHT,
    };
    if !is_high {
        return None;
    }
    let height = approach.cross(&closing);
    let local = |sample: &Sample| {
        let off = sample.at - point;
        Vec3::new(off.dot(&closing), off.dot(&height), off.dot(&approach))
    };
    // What is outside of the open fingers, for example the other side of a plate, is free.
    let is_between = |at: &Vec3| {
        at.y.abs() < PAD && at.z > 0.0 && at.z < hand.tip && at.x.abs() < hand.stroke / 2.0
    };
    let (mut low, mut high, mut count) = (f64::INFINITY, f64::NEG_INFINITY, 0);
    for at in points.iter().map(local).filter(is_between) {
        (low, high, count) = (low.min(at.x), high.max(at.x), count + 1);
    }
    let width = high - low;
    if count < FEW || width > hand.stroke - MARGIN {
        return None;
    }
    let middle = f64::midpoint(low, high);
    let open = hand.stroke.min(width + OPENING) / 2.0;
    let palm = -hand.palm();
    let mut touched = [0_usize; 2];
    // Lowest and highest point that each pad touches.
    let mut held = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
    for at in points.iter().map(local) {
        let aside = (at.x - middle).abs();
        let is_at_finger = at.y.abs() < hand.finger + 0.001
            && at.z > palm
            && at.z < hand.tip + 0.008
            && aside > open + 0.001
            && aside < open + hand.thickness;
        let is_behind = at.z < palm + 2.0 * PALM_ROOM;
        let is_in_ball = |ball: &[f64; 4]| {
            let off = at - Vec3::new(ball[0], ball[1], ball[2]);
            off.norm() < ball[3] + PALM_ROOM
        };
        if is_at_finger || (is_behind && hand.balls.iter().any(is_in_ball)) {
            return None;
        }
        if is_between(&at) {
            touched[0] += usize::from(at.x < low + TOUCH);
            touched[1] += usize::from(at.x > high - TOUCH);
            for (side, off) in [at.x - low, high - at.x].into_iter().enumerate() {
                if off < HOLD {
                    held[side] = [held[side][0].min(at.y), held[side][1].max(at.y)];
                }
            }
        }
    }
    let point = point + closing * middle;
    let area = touched[0].min(touched[1]).min(20) as f64 / 20.0;
    let extents = held.map(|[low, high]| (high - low).max(0.0) / (2.0 * PAD));
    let hold = HELD * extents[0].min(extents[1]);
    let contact = point + approach * DEPTHS[0];
    let lever = (com - contact).cross(&closing).norm();
    let wide = if width > 0.88 * hand.stroke {
        0.15
    } else {
        0.0
    };
    Some(Candidate {
        point,
        approach,
        closing,
        width,
        way,
        score: area + hold - 6.0 * lever - wide,
    })
}

/// The best grasps that differ in direction or place.
fn different(free: &[Candidate]) -> Vec<Candidate> {
    let mut kept: Vec<Candidate> = Vec::new();
    for grasp in free {
        let is_like = |other: &Candidate| {
            other.way == grasp.way
                && other.approach.dot(&grasp.approach) > 0.9
                && other.closing.dot(&grasp.closing).abs() > 0.9
                && (other.point - grasp.point).norm() < 0.025
        };
        let of_way = kept.iter().filter(|other| other.way == grasp.way).count();
        if of_way < MOST_OF_KIND && !kept.iter().any(is_like) {
            kept.push(*grasp);
        }
        if kept.len() == MOST {
            break;
        }
    }
    kept
}

/// The best grasps of a round object: level ones by height, one from above, one at the rim.
fn different_of_round(free: &[Candidate]) -> Vec<Candidate> {
    let mut kept: Vec<Candidate> = Vec::new();
    for grasp in free {
        let of_way = |way: Way| kept.iter().filter(move |other| other.way == way);
        let turned = match grasp.way {
            Way::Flat | Way::Rim => continue,
            Way::Level => {
                let is_like = |other: &Candidate| (other.point.z - grasp.point.z).abs() < 0.03;
                if of_way(Way::Level).count() == 2 || of_way(Way::Level).any(is_like) {
                    continue;
                }
                // The same grasp, turned about z.
                let along = grasp.point.dot(&grasp.approach);
                let aside = grasp.point.dot(&grasp.closing);
                if aside.abs() > 0.004 {
                    continue;
                }
                Candidate {
                    point: Vec3::new(along, 0.0, grasp.point.z),
                    approach: Vec3::x(),
                    closing: Vec3::y(),
                    ..*grasp
                }
            }
            Way::Above => {
                let off = exact::hypot(grasp.point.x, grasp.point.y);
                let radial = grasp.point.dot(&grasp.closing).abs();
                let (way, at) = if off <= MIDDLE {
                    (Way::Above, 0.0)
                } else if radial > RADIAL * off && grasp.width < 0.5 * off {
                    (Way::Rim, off)
                } else {
                    continue;
                };
                if of_way(way).next().is_some() {
                    continue;
                }
                Candidate {
                    point: Vec3::new(at, 0.0, grasp.point.z),
                    closing: Vec3::x(),
                    way,
                    ..*grasp
                }
            }
        };
        kept.push(turned);
    }
    kept
}

/// Angle between a level hand and the direction inwards that the robot reaches, degrees.
const ASIDE: f64 = 40.0;

/// Whether some of these directions on the floor plan, degrees, is near a wanted one.
fn is_near(angles: &[f64], wanted: f64) -> bool {
    angles.iter().any(|angle| {
        let off = (angle - wanted).rem_euclid(360.0);
        off.min(360.0 - off) <= ASIDE
    })
}

/// The largest yaw to both sides of `front` up to which a direction is near, degrees.
fn yaw_at(angles: &[f64], front: f64) -> f64 {
    let steps = (0..=36).map(|k| 5.0 * f64::from(k));
    let all = steps.take_while(|yaw| {
        let sides = [front + yaw, front - yaw];
        sides.iter().all(|wanted| is_near(angles, *wanted))
    });
    all.last().unwrap_or(0.0)
}

/// The rotation about z for which most yaws of the object have a grasp near the direction
/// inwards, and the largest such yaw, degrees.
fn facing(grasps: &[Candidate]) -> (f64, f64) {
    if grasps.is_empty() || grasps.iter().any(|grasp| grasp.way == Way::Above) {
        return (0.0, 180.0);
    }
    let angles: Vec<f64> = grasps
        .iter()
        .map(|grasp| exact::atan2(grasp.approach.y, grasp.approach.x).to_degrees())
        .collect();
    let fronts = (0..72).map(|k| 5.0 * f64::from(k));
    let best = fronts.map(|front| (yaw_at(&angles, front), front));
    let best = best.fold(
        (0.0, angles[0]),
        |best, next| if next.0 > best.0 { next } else { best },
    );
    (-best.1.to_radians(), best.0)
}

/// Largest rotation from the direction inwards at which one of the grasps of an object is left,
/// degrees; 180 for a hand from above and for round objects.
#[must_use]
pub fn yaw_deg(grasps: &[GraspEntry]) -> f64 {
    let turns = |grasp: &GraspEntry| grasp.symmetric || grasp.approach[2] < -0.9;
    if grasps.iter().any(turns) {
        return 180.0;
    }
    let angles = grasps
        .iter()
        .map(|grasp| exact::atan2(grasp.approach[1], grasp.approach[0]).to_degrees());
    yaw_at(&angles.collect::<Vec<_>>(), 0.0)
}
