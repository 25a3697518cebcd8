//! Prepare: the hand gets ready while the chair drives. It turns and moves a little towards
//! the pregrasp, but stays within the outline that the chair's path was planned with.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use super::Now;
use crate::base_placement;
use crate::grasp_candidate::GraspCandidate;
use crate::habits::STOPS;
use crate::tool_path::{Shape, ToolPath, distance};

/// The hand counts as home within this, metres.
const HOME: f64 = 0.02;
/// Greatest turn on the way, radians.
const TURN: f64 = 0.5;
/// Share of the way to the pregrasp that is added to the sampled movement.
const TOWARDS: f64 = 0.12;
/// Shares of the movement that are tried.
const SHARES: [f64; 4] = [1.0, 0.7, 0.45, 0.25];
/// The hand may project from the outline by this, metres: the footprint keeps more
/// room.
const OUT: f64 = 0.02;
/// Room from a seated person, metres.
const FROM_PERSON: f64 = 0.12;
/// Share of the rest of the drive that the movement takes at most.
const LONG: f64 = 0.95;
/// Drive time per intermediate position of the hand, seconds.
const LEG: f64 = 3.5;
/// Overlap of the legs between them.
const OVERLAP: f64 = 0.4;
/// Speed at which a path is timed first, m/s.
const UNIT: f64 = 0.1;

/// The movement of the hand in `base_link` and when it begins in the drive, seconds.
#[derive(Clone, Debug, PartialEq)]
pub struct Prepare {
    begin: f64,
    path: ToolPath,
}

impl Prepare {
    /// The movement for a drive of `seconds` to a chair at `house_from_chair` that is to take
    /// an object by `candidate`; `None` without the habit, or where the arm cannot do it.
    #[must_use]
    pub fn plan(
        now: &mut Now<'_>,
        house_from_chair: &Isometry3<f64>,
        candidate: &GraspCandidate,
        seconds: f64,
    ) -> Option<Self> {
        let (begin, moved) = now.profile.habits?.prepare?;
        let start = now
            .observation
            .base_from_desired
            .unwrap_or(now.observation.base_from_tool);
        if distance(&now.memory.home?, &start) > HOME {
            return None;
        }
        let base_from_house = (house_from_chair * now.scene.chair_from_base).inverse();
        let [pregrasp, grasp] =
            [candidate.pregrasp, candidate.grasp].map(|at| base_from_house * at);
        let base_from_chair = now.scene.chair_from_base.rotation.inverse();
        let towards = (pregrasp.translation.vector - start.translation.vector) * TOWARDS;
        let between = start.rotation.inverse() * pregrasp.rotation;
        let turn = (TURN / between.angle().max(TURN)).min(0.6);
        let at = |stop: usize, share: f64| {
            let moved = base_from_chair * Vector3::from(moved[stop]);
            let to = start.translation.vector + (moved + towards) * share;
            // It turns evenly up to the end.
            let done = (stop + 1) as f64 / STOPS as f64;
            let turn = UnitQuaternion::identity().slerp(&between, turn * share * done);
            Isometry3::from_parts(Translation3::from(to), start.rotation * turn)
        };
        let begin = begin * seconds;
        let seconds = LONG * (seconds - begin);
        let legs = ((seconds / LEG) as usize).clamp(1, STOPS);
        // When the pregrasp is not reachable from there, the hand returns.
        for comes_back in [false, true] {
            for (share, legs) in SHARES.iter().flat_map(|share| [(share, legs), (share, 1)]) {
                let stops = (STOPS - legs..STOPS).map(|stop| at(stop, *share));
                let stops: Vec<_> = stops.chain(comes_back.then_some(start)).collect();
                let path = timed(now, start, &stops, seconds);
                let then: &[_] = match comes_back {
                    true => &[],
                    false => &[pregrasp, grasp],
                };
                let reached = [&path.poses()[..], then].concat();
                if path.poses().iter().all(|pose| stays_inside(now, pose))
                    && base_placement::reaches(&start, &reached, now.reach)
                {
                    return Some(Self { begin, path });
                }
            }
        }
        None
    }

    /// The target of the hand `time` seconds after the drive began; `None` before the movement
    /// begins and after its end.
    #[must_use]
    pub fn target(&self, time: f64) -> Option<Isometry3<f64>> {
        let time = time - self.begin;
        (0.0..self.path.duration() + 0.1)
            .contains(&time)
            .then(|| self.path.at(time + 1.0 / 60.0))
    }
}

/// The path through `stops` that takes `seconds`, or less where the hand would be too fast.
fn timed(now: &Now<'_>, start: Isometry3<f64>, stops: &[Isometry3<f64>], seconds: f64) -> ToolPath {
    let shape = Shape {
        overlap: OVERLAP,
        ..now.profile.shape
    };
    let path = |speed: f64| {
        let stops: Vec<_> = stops.iter().map(|stop| (*stop, speed)).collect();
        ToolPath::shaped(start, &stops, &shape)
    };
    let speed = UNIT * path(UNIT).duration() / seconds.max(1e-3);
    path(speed.min(now.profile.free_speed))
}

/// Whether the hand, with the end effector at `base_from_tool`, keeps within the outline of
/// the chair at its height, and away from a seated person.
fn stays_inside(now: &Now<'_>, base_from_tool: &Isometry3<f64>) -> bool {
    let scene = now.scene;
    let tool = scene.chair_from_base * base_from_tool;
    scene.hand.balls(scene.hand.stroke).iter().all(|ball| {
        let at = tool * Point3::from(ball.centre);
        let outline = scene.outlines.iter().find(|(top, _)| at.z < *top);
        let inside = outline.is_some_and(|(_, outline)| {
            let [back, front, right, left] = outline.sides;
            let out = ball.radius - OUT;
            at.x - out > back && at.x + out < front && at.y - out > right && at.y + out < left
        });
        let capsules = scene.person.iter().flat_map(|person| &person.capsules);
        let mut gaps = capsules.map(|capsule| capsule.distance(&at) - ball.radius);
        inside && gaps.all(|gap| gap > FROM_PERSON)
    })
}
