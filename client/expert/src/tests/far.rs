//! A region at the other end of the room: what is held is brought to where the hand is at home
//! before the chair drives, and put down there.

use super::*;

/// Top of the other table, metres.
const TOP: f64 = 0.81;

#[test]
fn object_is_brought_home_before_a_long_way() {
    let mut world = KinematicWorld::new([-8.80, 2.10], 0.0, [-8.85, 1.50], 0);
    // Without the sofa, with a table at the other wall.
    world.scene.furniture.truncate(6);
    let table = obb([-3.0, 4.5, TOP - 0.02], [0.4, 0.8, 0.02]);
    world.scene.furniture.push(table);
    let region = obb([-3.25, 4.5, TOP + 0.1], [0.12, 0.3, 0.1]);
    let goal = Goal::Put { item: 0, region };
    let operator = Operator::new(world.scene.clone(), Some(goal), OperatorProfile::new(PLAIN));
    let mut operator = operator.expect("a goal");
    let home = world.base_from_tool.translation.vector;
    let (mut notes, mut driven) = (Vec::new(), 0.0);
    let released = loop {
        let (act, outcome) = operator.step(&world.observe(), &mut world.arm);
        notes.extend(operator.notes());
        assert_eq!(outcome, None, "{notes:?}");
        if act.name == "letting go" {
            break world.objects[0].translation.vector;
        }
        world.apply(&act);
        if world.held.is_some() && world.speed[0].abs() > 0.1 {
            driven += world.speed[0].abs() * DT;
            let off = (world.base_from_tool.translation.vector - home).norm();
            assert!(
                off < 0.02,
                "the hand is {off} m from home while {}",
                act.name
            );
        }
        assert!(world.time < 200.0, "no end, {notes:?}");
    };
    assert!(driven > 3.0, "{driven} m, {notes:?}");
    let bounds = [
        released.x + 3.25,
        released.y - 4.5,
        released.z - TOP - 0.0955,
    ];
    assert!(
        bounds[0].abs() < 0.12 && bounds[1].abs() < 0.3,
        "{released}"
    );
    assert!(bounds[2].abs() < 0.01, "{released}");
}
