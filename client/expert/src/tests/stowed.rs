//! The travel posture: through a door that the chair passes in no other one, and from a
//! start where the arm has no room to leave it.

use super::*;
use crate::scene::Travel;
use crate::skill::stow::Stow;

/// Greatest speed of a joint, rad/s.
const JOINT_SPEED: f64 = 1.0;
const STOWED: [f64; 6] = [1.0, 0.5, 0.0, 0.0, 0.0, 0.0];
/// A wall across the room, with a door: x of its middle, y of the door's ends, metres.
const WALL: f64 = -6.0;
const DOOR: [f64; 2] = [3.01, 3.79];

/// The bottle's world with a wall before the table, and joints of the arm.
struct DoorWorld {
    world: KinematicWorld,
    joints: [f64; 6],
    /// Greatest distance of the joints from home while the chair drove.
    furthest: f64,
}

impl DoorWorld {
    /// A chair at `chair` with the arm at `joints`.
    fn new(chair: Pose2, joints: [f64; 6]) -> Self {
        let mut world = KinematicWorld::new([-8.80, 2.10], 0.0, [-8.85, 1.80], 0);
        // Without the sofa.
        world.scene.furniture.truncate(6);
        for [low, high] in [[-0.6, DOOR[0]], [DOOR[1], 6.9]] {
            let middle = f64::midpoint(low, high);
            let wall = obb([WALL, middle, 1.3], [0.05, (high - low) / 2.0, 1.3]);
            world.scene.furniture.push(wall);
        }
        let outlines = [
            (0.32, [-0.19, 0.79, -0.30, 0.41]),
            (1.50, [-0.19, 0.50, -0.30, 0.41]),
        ];
        world.scene.travel = Some(Travel {
            joints: STOWED,
            outlines: outlines
                .map(|(top, sides)| (top, Outline { sides }))
                .to_vec(),
        });
        world.chair = chair;
        Self {
            world,
            joints,
            furthest: 0.0,
        }
    }

    fn observe(&self) -> Observation {
        Observation {
            arm: self.joints,
            ..self.world.observe()
        }
    }

    fn off_home(&self) -> f64 {
        let off = self.joints.iter().zip(&self.world.scene.home);
        off.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    /// Whether the chair is free with the arm as it is: within the outlines of the travel
    /// posture in that posture, and within those of home otherwise. On the way between them the
    /// arm needs more room.
    fn is_free(&self) -> bool {
        let travel = self.world.scene.travel.as_ref().expect("a travel posture");
        let is_stowed = Stow::is_home(&self.joints, &travel.joints);
        if !is_stowed && !Stow::is_home(&self.joints, &self.world.scene.home) {
            let check = self.world.scene.change_check(&self.world.objects);
            return check.is_some_and(|check| check.is_free(&self.world.chair, 0.0));
        }
        let scene = SceneModel {
            outlines: match is_stowed {
                true => travel.outlines.clone(),
                false => self.world.scene.outlines.clone(),
            },
            ..self.world.scene.clone()
        };
        let footprint = scene.footprint_check(&self.world.objects);
        footprint.is_free(&self.world.chair, 0.0)
    }

    fn apply(&mut self, act: &Act) {
        if let Some(target) = act.joints {
            let step = JOINT_SPEED * DT;
            for (joint, to) in self.joints.iter_mut().zip(target) {
                *joint += (to - *joint).clamp(-step, step);
            }
        }
        self.world.apply(act);
        if self.world.speed[0].abs() > 0.1 {
            self.furthest = self.furthest.max(self.off_home());
        }
    }

    /// Runs to the end; the chair must be free on the way.
    fn run(&mut self) -> (Outcome, Vec<String>) {
        let mut operator = self.world.operator(0);
        let mut notes = Vec::new();
        loop {
            let (act, outcome) = operator.step(&self.observe(), &mut self.world.arm);
            notes.extend(operator.notes());
            if let Some(outcome) = outcome {
                return (outcome, notes);
            }
            self.apply(&act);
            let chair = self.world.chair;
            assert!(
                self.is_free(),
                "touches something at {chair:?} with {:?} while {}",
                self.joints,
                act.name
            );
            assert!(self.world.time < 200.0, "no end, {notes:?}");
        }
    }
}

const BEFORE_THE_DOOR: Pose2 = Pose2 {
    x: -4.2,
    y: 3.4,
    heading: std::f64::consts::PI,
};

#[test]
fn narrow_door_is_passed_with_the_arm_stowed() {
    let mut world = DoorWorld::new(BEFORE_THE_DOOR, [0.0; 6]);
    let (outcome, notes) = world.run();
    assert_eq!(outcome, Outcome::Success, "{notes:?}");
    assert!(
        notes
            .iter()
            .any(|note| note.ends_with("with the arm stowed")),
        "{notes:?}"
    );
    assert!(world.furthest > 0.97, "it drove with {:?}", world.furthest);
    assert!(
        world.off_home() < 0.02,
        "the arm is not home: {:?}",
        world.joints
    );
}

#[test]
fn narrow_door_ends_the_work_of_a_robot_without_a_travel_posture() {
    let mut world = DoorWorld::new(BEFORE_THE_DOOR, [0.0; 6]);
    world.world.scene.travel = None;
    let mut operator = world.world.operator(0);
    let (_, outcome) = operator.step(&world.observe(), &mut world.world.arm);
    let Some(Outcome::Failure(why)) = outcome else {
        panic!("{outcome:?}");
    };
    assert!(why.contains("without a path"), "{why}");
}

#[test]
fn arm_stays_stowed_from_a_start_where_it_has_no_room() {
    // In the door the arm at home would touch the frame.
    let in_the_door = Pose2 {
        x: -6.2,
        y: 3.455,
        heading: std::f64::consts::PI,
    };
    let mut world = DoorWorld::new(in_the_door, STOWED);
    let scene = &world.world.scene;
    assert!(
        !scene
            .footprint_check(&world.world.objects)
            .is_free(&in_the_door, 0.0)
    );
    let (outcome, notes) = world.run();
    assert_eq!(outcome, Outcome::Success, "{notes:?}");
    assert!(world.furthest > 0.97);
}

/// Shelves around the chair: the arm at home has no room to be stowed there.
#[test]
fn arm_is_stowed_where_it_has_room() {
    let mut world = DoorWorld::new(BEFORE_THE_DOOR, [0.0; 6]);
    let shelf = obb([-4.2, 2.45, 1.3], [0.6, 0.05, 1.3]);
    world.world.scene.furniture.push(shelf);
    let (outcome, notes) = world.run();
    assert_eq!(outcome, Outcome::Success, "{notes:?}");
    let drives = notes.iter().filter(|note| note.starts_with("drives"));
    let drives: Vec<&String> = drives.collect();
    assert!(drives[0].ends_with("where it is stowed"), "{notes:?}");
    assert!(drives[1].contains("with the arm stowed"), "{notes:?}");
}
