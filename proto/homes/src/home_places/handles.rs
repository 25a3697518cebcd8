//! Handles of a home: doors and drawers of furniture that the robot opens.

use wheelarm_pack::HandleEntry;
use wheelarm_proto::parallel;

use super::spot::Start;
use super::start::{self, Floors};
use crate::home_report::home::Leaf;
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
    let entry = |leaf: &Leaf| {
        let report = leaves::test(home, floors.driven, robot, leaf);
        let (stop, grasp) = report.stop.zip(leaf.grasps.first())?;
        let at = leaves::before(&grasp.translation.vector, leaf);
        let near = start::before(home, floors, at, (stop, &[stop]));
        let start = near.or(of_home.filter(|_| !within))?;
        Some(HandleEntry {
            on: home.pieces[leaf.piece].name.clone(),
            kind: None,
            room: report.room,
            apart: within,
            start: start.entry(),
        })
    };
    let mut others: Vec<&Leaf> = home.leaves.iter().collect();
    others.retain(|leaf| {
        let piece = &home.pieces[leaf.piece].name;
        !found.iter().any(|handle| handle.on == *piece)
    });
    found.extend(parallel::map(others, entry).into_iter().flatten());
}
