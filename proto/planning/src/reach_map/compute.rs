//! Fills a reach map from the kinematics of an arm.
//!
//! Newton's method from a neighbour's joint positions finds a solution in a few iterations,
//! so the reached entries grow from seeds like a flood. Seeds are a part of the entries, each
//! tried from several starts. Trying every entry from many starts takes minutes.

use std::collections::VecDeque;

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};
use wheelarm_proto::digest::Digest;
use wheelarm_proto::exact;

use super::{DIRECTIONS, DISTANCES, Entry, HEIGHTS, HandPlace, PITCHES, ReachMap, TABLE_BYTES};

/// Seeds are every so many-th entry along distance, height, pitch and direction.
const SEEDS: [usize; 4] = [3, 3, 3, 3];
/// Starts of a seed.
const STARTS: usize = 6;

/// The arm of a robot.
pub trait Arm {
    /// Joint positions, rad, for a pose of the end effector in the arm's base, found from
    /// `near` in one attempt.
    fn solve(&self, base_from_tool: &Isometry3<f64>, near: &[f64; 6]) -> Option<[f64; 6]>;

    /// Joint positions, rad, from which attempts begin; the same for the same number.
    fn start(&self, number: usize) -> [f64; 6];
}

/// The end effector in the arm's base for a place of the hand straight ahead, with the
/// fingers closing level.
#[must_use]
pub fn hand_pose(place: &HandPlace, tool_length: f64) -> Isometry3<f64> {
    let (sin, cos) = exact::sin_cos(place.direction);
    let (down, level) = exact::sin_cos(place.pitch);
    let along = Vector3::new(level * cos, level * sin, -down);
    let closing = Vector3::new(-sin, cos, 0.0);
    let rotation = Matrix3::from_columns(&[closing, along.cross(&closing), along]);
    let rotation = Rotation3::from_matrix_unchecked(rotation);
    let point = Vector3::new(place.distance, 0.0, place.height);
    Isometry3::from_parts(
        Translation3::from(point - along * tool_length),
        UnitQuaternion::from_rotation_matrix(&rotation),
    )
}

/// Computes the map of an arm mounted at `mount` (chair_from_base), whose grasp point is
/// `tool_length` metres along z of its end effector. `source` is [`ReachMap::source_of`].
/// Takes seconds.
#[must_use]
pub fn compute(arm: &dyn Arm, mount: Isometry3<f64>, tool_length: f64, source: Digest) -> ReachMap {
    let pose = |entry: &Entry| hand_pose(&entry.place(), tool_length);
    let mut found: Vec<Option<[f64; 6]>> = vec![None; Entry::COUNT];
    let mut open = VecDeque::new();
    for number in 0..Entry::COUNT {
        let seed = Entry::numbered(number);
        if found[number].is_some() || !is_seed(&seed) {
            continue;
        }
        let target = pose(&seed);
        let mut starts = (1..=STARTS).map(|start| arm.start(start));
        found[number] = starts.find_map(|start| arm.solve(&target, &start));
        if found[number].is_some() {
            open.push_back(seed);
        }
        while let Some(entry) = open.pop_front() {
            let Some(near) = found[entry.number()] else {
                continue;
            };
            for next in neighbours(&entry) {
                let place = &mut found[next.number()];
                if place.is_none() {
                    *place = arm.solve(&pose(&next), &near);
                    if place.is_some() {
                        open.push_back(next);
                    }
                }
            }
        }
    }
    let mut table = vec![0; TABLE_BYTES];
    for (number, _) in found
        .iter()
        .enumerate()
        .filter(|(_, found)| found.is_some())
    {
        table[number / 8] |= 1 << (number % 8);
    }
    ReachMap {
        mount,
        source,
        table,
    }
}

fn is_seed(entry: &Entry) -> bool {
    let indices = [entry.distance, entry.height, entry.pitch, entry.direction];
    indices
        .iter()
        .zip(SEEDS)
        .all(|(index, every)| index % every == 0)
}

/// Entries that differ by one step.
fn neighbours(entry: &Entry) -> impl Iterator<Item = Entry> {
    let entry = *entry;
    let moved = move |by: i64| {
        let index = |index: usize, count: usize| {
            let index = usize::try_from(index as i64 + by).ok()?;
            (index < count).then_some(index)
        };
        let turn = entry.direction as i64 + by;
        let direction = turn.rem_euclid(DIRECTIONS as i64) as usize;
        let (distance, height, pitch) = (
            index(entry.distance, DISTANCES.2),
            index(entry.height, HEIGHTS.2),
            index(entry.pitch, PITCHES.2),
        );
        [
            distance.map(|distance| Entry { distance, ..entry }),
            height.map(|height| Entry { height, ..entry }),
            pitch.map(|pitch| Entry { pitch, ..entry }),
            Some(Entry { direction, ..entry }),
        ]
    };
    moved(1).into_iter().chain(moved(-1)).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An arm that gets everywhere within a sphere, level or downwards, when it starts near.
    struct Sphere;

    impl Arm for Sphere {
        fn solve(&self, base_from_tool: &Isometry3<f64>, _: &[f64; 6]) -> Option<[f64; 6]> {
            let along = base_from_tool.rotation * Vector3::z();
            let is_near = base_from_tool.translation.vector.norm() < 0.5;
            (is_near && along.z < 1e-9).then_some([0.0; 6])
        }

        fn start(&self, _: usize) -> [f64; 6] {
            [0.0; 6]
        }
    }

    #[test]
    fn the_map_holds_what_the_arm_solves_and_nothing_else() {
        let map = compute(&Sphere, Isometry3::identity(), 0.1, [7; 32]);
        for number in 0..Entry::COUNT {
            let entry = Entry::numbered(number);
            let pose = hand_pose(&entry.place(), 0.1);
            let solved = Sphere.solve(&pose, &[0.0; 6]).is_some();
            assert_eq!(map.contains(entry), solved, "{entry:?}");
        }
        assert!(map.len() > 10_000 && !map.is_empty());
        assert_eq!(map.source(), &[7; 32]);
    }
}
