//! Handles of a home: doors and drawers of furniture that the robot opens.

use wheelarm_pack::HandleEntry;

use super::spot::Start;
use super::start::{self, Floors};
use crate::home_report::{Home, RobotFacts, leaves};

/// Adds the leaves that open from the floor of `floors` and are not in `found`. With `within`
/// the chair starts in their rooms only, otherwise at `of_home` where it has no start nearby.
pub(super) fn add(
    home: &Home,
    floors: &Floors<'_>,
    robot: &RobotFacts,
    (within, of_home): (bool, Option<Start>),
    found: &mut Vec<HandleEntry>,
) {
    for leaf in &home.leaves {
        let piece = &home.pieces[leaf.piece].name;
        if found.iter().any(|handle| handle.on == *piece) {
            continue;
        }
        let report = leaves::test(home, floors.driven, robot, leaf);
        let (Some(stop), Some(grasp)) = (report.stop, leaf.grasps.first()) else {
            continue;
        };
        let at = leaves::before(&grasp.translation.vector, leaf);
        let near = start::before(home, floors, at, stop);
        let Some(start) = near.or(of_home.filter(|_| !within)) else {
            continue;
        };
        found.push(HandleEntry {
            on: piece.clone(),
            kind: None,
            room: report.room,
            apart: within,
            start: start.entry(),
        });
    }
}
