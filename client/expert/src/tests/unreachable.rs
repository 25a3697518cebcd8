//! Goals without a way, and goals without a path: the work of a search for a base placement
//! is bounded.

use super::*;
use crate::skill::base_search::{Purpose, find_with};
use crate::skill::{Memory, Now};

/// Nodes of all searches for a chair before a wall with a door of this width, metres, and the
/// error.
fn nodes(door: f64) -> (usize, Result<Pose2, String>) {
    let mut world = KinematicWorld::new([-8.80, 2.10], 0.0, [-8.85, 1.80], 0);
    // Without the sofa.
    world.scene.furniture.truncate(6);
    for [low, high] in [[-0.6, 3.4 - door / 2.0], [3.4 + door / 2.0, 6.9]] {
        let middle = f64::midpoint(low, high);
        let wall = obb([-6.0, middle, 1.3], [0.05, (high - low) / 2.0, 1.3]);
        world.scene.furniture.push(wall);
    }
    world.chair = Pose2 {
        x: -4.2,
        y: 3.4,
        heading: std::f64::consts::PI,
    };
    let (observation, profile) = (world.observe(), OperatorProfile::new(PLAIN));
    let poses = world.scene.poses(&observation);
    let mut routes = (world.scene).route_planner(&poses, world.chair, profile.path.margin);
    let mut now = Now {
        scene: &world.scene,
        goal: &Goal::Lift { item: 0 },
        profile: &profile,
        observation: &observation,
        poses: &poses,
        reach: &mut world.arm,
        shown: &Demonstrations::default(),
        memory: &mut Memory::default(),
    };
    let found = find_with(&mut now, Purpose::Take, &mut routes, &|_| true);
    (routes.nodes(), found.map(|(drive, _)| drive.goal()))
}

#[test]
fn goal_in_a_closed_room_needs_no_search() {
    let (nodes, found) = nodes(0.0);
    assert_eq!(nodes, 0, "{found:?}");
    let why = found.expect_err("no way");
    assert!(why.contains("without a path"), "{why}");
}

#[test]
fn goal_behind_a_door_that_is_too_narrow_by_a_little_takes_few_searches() {
    // The cells of the map are connected, but the chair needs 0.87 m.
    let (nodes, found) = nodes(0.85);
    assert!(found.is_err(), "{found:?}");
    // A complete search has 45,000 nodes.
    assert!((1..=135_100).contains(&nodes), "{nodes}");
}

#[test]
fn goal_behind_a_wide_door_is_found() {
    let (nodes, found) = nodes(0.95);
    assert!(found.is_ok() && nodes < 45_000, "{nodes} nodes, {found:?}");
}
