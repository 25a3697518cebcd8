//! Tests of the operator's logic in a world without physics: the chair obeys its
//! speed profile, the hand its targets, and what is in the closed hand follows.

mod far;
mod stowed;
mod unreachable;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use super::base_placement::{self, ArmReachability, standing};
use super::demonstration::Demonstrations;
use super::demonstration::cut::{Course, cut};
use super::goal::Goal;
use super::grasp_candidate::GraspCandidate;
use super::hand;
use super::observation::Observation;
use super::operator::{Act, Extent, Operator, Outcome};
use super::profile::{OperatorProfile, PLAIN};
use super::scene::{Grasp, Item, SceneModel};
use wheelarm_planning::footprint_check::{Outline, Pose2};
use wheelarm_planning::obb::Obb;
use wheelarm_proto::exact;

const DT: f64 = 1.0 / 60.0;
const TABLE: f64 = 0.81;

/// The reach of the arm as a shell around its shoulder (the URDF's joints 2 to 4).
struct Shell {
    /// Greatest distance of the end effector from the shoulder, metres.
    longest: f64,
}

impl ArmReachability for Shell {
    fn follows(&mut self, poses: &[Isometry3<f64>], _max_joint_change: f64) -> bool {
        let shoulder = Vector3::new(0.0, -0.005, 0.285);
        let lengths = poses.iter().map(|pose| pose.translation.vector - shoulder);
        lengths
            .map(|v| v.norm())
            .all(|length| (0.40..self.longest).contains(&length))
    }
}

struct KinematicWorld {
    scene: SceneModel,
    chair: Pose2,
    speed: [f64; 2],
    base_from_tool: Isometry3<f64>,
    target: Isometry3<f64>,
    opening: f64,
    wanted: f64,
    objects: Vec<Isometry3<f64>>,
    held: Option<Isometry3<f64>>,
    /// Grips that fail before one holds.
    clumsy: usize,
    time: f64,
    held_for: f64,
    person_force: f64,
    arm: Shell,
}

fn obb(at: [f64; 3], half: [f64; 3]) -> Obb {
    Obb {
        pose: Isometry3::translation(at[0], at[1], at[2]),
        half: half.into(),
        round: false,
    }
}

pub(crate) fn home_scene() -> SceneModel {
    let bottle_half = [0.048, 0.029, 0.0955];
    // Approach along +x of the bottle, closing along its y.
    let grasp = UnitQuaternion::from_basis_unchecked(&[Vector3::y(), Vector3::z(), Vector3::x()]);
    SceneModel {
        furniture: vec![
            obb([-7.0, 3.0, -0.05], [5.0, 4.0, 0.05]),
            obb([-8.95, 1.90, 0.79], [0.40, 1.10, 0.02]),
            obb([-11.6, 3.0, 1.3], [0.1, 4.0, 1.3]),
            obb([-2.4, 3.0, 1.3], [0.1, 4.0, 1.3]),
            obb([-7.0, -0.6, 1.3], [5.0, 0.1, 1.3]),
            obb([-7.0, 6.9, 1.3], [5.0, 0.1, 1.3]),
            // A sofa that leaves a lane.
            obb([-6.0, 1.2, 0.4], [0.45, 0.9, 0.4]),
        ],
        items: vec![
            Item {
                name: "mustard".to_owned(),
                boxes: vec![obb([0.0; 3], bottle_half)],
            },
            Item {
                name: "soup".to_owned(),
                boxes: vec![obb([0.0; 3], [0.034, 0.034, 0.051])],
            },
        ],
        grasps: [1.0, -1.0]
            .map(|side: f64| Grasp {
                item: 0,
                name: "side".to_owned(),
                item_from_grasp: Isometry3::from_parts(
                    Translation3::identity(),
                    UnitQuaternion::from_axis_angle(
                        &Vector3::z_axis(),
                        if side > 0.0 {
                            0.0
                        } else {
                            std::f64::consts::PI
                        },
                    ) * grasp,
                ),
                width: 0.058,
                symmetric: false,
                from_above: false,
                force: None,
            })
            .to_vec(),
        slides: Vec::new(),
        chair_from_base: Isometry3::from_parts(
            Translation3::new(0.42, 0.36, 0.55),
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI),
        ),
        tool_length: 0.12,
        footprint: [-0.19, 0.79, -0.30, 0.41],
        outlines: [
            (0.32, [-0.19, 0.79, -0.30, 0.41]),
            (0.95, [-0.19, 0.50, -0.30, 0.41]),
            (1.50, [-0.19, 0.98, -0.30, 0.47]),
        ]
        .map(|(top, sides)| (top, Outline { sides }))
        .to_vec(),
        travel: None,
        arm_range: [0.42, 0.88],
        hand: hand::tests::hand(),
        home: [0.0; 6],
        person: None,
    }
}

impl KinematicWorld {
    fn new(bottle: [f64; 2], yaw: f64, soup: [f64; 2], clumsy: usize) -> Self {
        let lying = |at: [f64; 2], height: f64, yaw: f64| {
            Isometry3::from_parts(
                Translation3::new(at[0], at[1], TABLE + height),
                UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw),
            )
        };
        // The seed's home: tool along -x of `base_link`, camera above.
        let home = Isometry3::from_parts(
            Translation3::new(-0.346, 0.001, 0.546),
            UnitQuaternion::from_basis_unchecked(&[-Vector3::y(), Vector3::z(), -Vector3::x()]),
        );
        Self {
            scene: home_scene(),
            chair: Pose2 {
                x: -6.635,
                y: 3.389,
                heading: -std::f64::consts::FRAC_PI_2,
            },
            speed: [0.0; 2],
            base_from_tool: home,
            target: home,
            opening: 0.085,
            wanted: 0.085,
            objects: vec![lying(bottle, 0.0955, yaw), lying(soup, 0.051, 0.0)],
            held: None,
            clumsy,
            time: 0.0,
            held_for: 0.0,
            person_force: 0.0,
            arm: Shell { longest: 0.87 },
        }
    }

    fn house_from_tool(&self) -> Isometry3<f64> {
        standing(&self.chair) * self.scene.chair_from_base * self.base_from_tool
    }

    /// Whether the bottle is between the open fingers.
    fn around(&self) -> bool {
        let grasp = self.house_from_tool()
            * Translation3::new(0.0, 0.0, self.scene.hand.pads(self.opening));
        let off = grasp.inverse_transform_point(&Point3::from(self.objects[0].translation.vector));
        off.x.abs() < 0.012 && off.y.abs() < 0.03 && off.z.abs() < 0.03
    }

    fn observe(&self) -> Observation {
        let gripped = self.held.is_some();
        let raised = self.objects[0].translation.z - (TABLE + 0.0955);
        Observation {
            time: self.time,
            house_from_chair: standing(&self.chair),
            chair_speed: self.speed,
            base_from_tool: self.base_from_tool,
            arm: [0.0; 6],
            base_from_desired: Some(self.target),
            arm_problem: String::new(),
            knuckle: 0.8 * (1.0 - self.opening / 0.085),
            pad_force: if gripped { [30.0, 30.0] } else { [0.0, 0.0] },
            objects: self.objects.clone(),
            mouth: None,
            lap_force: 0.0,
            person_force: self.person_force,
            slides: Vec::new(),
            success: raised > 0.1 && self.held_for > 1.0,
            done: false,
            failure: String::new(),
        }
    }

    fn apply(&mut self, act: &Act) {
        let [v, w] = act.base.unwrap_or([0.0; 2]);
        self.speed[0] += (v - self.speed[0]).clamp(-1.25 * DT, 0.23 * DT);
        self.speed[1] += (w - self.speed[1]).clamp(-0.79 * DT, 0.79 * DT);
        self.chair = self
            .chair
            .turned(self.speed[1] * DT)
            .rolled(self.speed[0] * DT, 0.0);
        if let Some(pose) = act.tool {
            self.target = pose;
        }
        // At most 0.5 m/s, as the server allows.
        let left = self.target.translation.vector - self.base_from_tool.translation.vector;
        let share = (0.5 * DT / left.norm().max(1e-9)).min(1.0);
        self.base_from_tool = self.base_from_tool.lerp_slerp(&self.target, share);
        self.wanted = act.opening.unwrap_or(self.wanted);
        let blocked = self.around() && self.wanted < 0.058;
        let stop = if blocked { 0.058 } else { 0.0 };
        let step = (self.wanted.max(stop) - self.opening).clamp(-0.1 * DT, 0.1 * DT);
        self.opening += step;
        if blocked && self.opening <= 0.058 + 1e-9 && self.held.is_none() {
            self.held = Some(self.house_from_tool().inv_mul(&self.objects[0]));
        }
        if self.wanted > 0.058 {
            self.held = None;
        }
        // A clumsy grip loses the bottle during the lift.
        let raised = self.objects[0].translation.z - (TABLE + 0.0955);
        if self.held.is_some() && raised > 0.03 && self.clumsy > 0 {
            self.clumsy -= 1;
            self.held = None;
            self.objects[0].translation.z = TABLE + 0.0955;
            self.opening = 0.0;
        }
        if let Some(held) = self.held {
            self.objects[0] = self.house_from_tool() * held;
            self.held_for += DT;
        } else {
            self.held_for = 0.0;
        }
        self.time += DT;
    }

    /// An operator that grasps the bottle.
    fn operator(&self, seed: u64) -> Operator {
        let goal = Some(Goal::Lift { item: 0 });
        Operator::new(self.scene.clone(), goal, OperatorProfile::new(seed)).unwrap()
    }

    /// Goes on until the operator does what is called `name`.
    fn until(&mut self, operator: &mut Operator, name: &str) {
        loop {
            let (act, outcome) = operator.step(&self.observe(), &mut self.arm);
            assert_eq!(outcome, None, "before {name}");
            if act.name == name {
                return;
            }
            self.apply(&act);
        }
    }

    /// Runs to the end; every pose on the way must be free of collisions.
    fn run(self, seed: u64) -> (Outcome, f64, Vec<String>) {
        let operator = self.operator(seed);
        self.run_by(operator)
    }

    fn run_by(mut self, mut operator: Operator) -> (Outcome, f64, Vec<String>) {
        let mut notes = Vec::new();
        loop {
            let observation = self.observe();
            let (act, outcome) = operator.step(&observation, &mut self.arm);
            notes.extend(operator.notes());
            if let Some(outcome) = outcome {
                return (outcome, self.time, notes);
            }
            self.apply(&act);
            let footprint = self.scene.footprint_check(&self.objects);
            assert!(
                footprint.is_free(&self.chair, 0.0),
                "the chair touches something at {:?}",
                self.chair
            );
            let hand = self.house_from_tool();
            let near = self.around() || self.held.is_some() || act.name != "reaching";
            assert!(
                self.scene
                    .around(&[hand], &self.objects, near.then_some(0))
                    .hand_is_free(&self.scene.hand, self.opening, &[hand], -0.008),
                "the hand touches something at {hand:?} while {}",
                act.name
            );
            assert!(self.time < 200.0, "no end, {notes:?}");
        }
    }
}

#[test]
fn the_bottle_is_taken_wherever_the_task_may_put_it() {
    for (seed, bottle, yaw, soup) in [
        (0, [-8.80, 2.10], 0.0, [-8.85, 1.80]),
        (1, [-8.72, 1.40], 0.4, [-8.75, 1.62]),
        (2, [-8.90, 2.60], -0.5, [-8.70, 2.35]),
        (3, [-8.78, 1.90], 2.9, [-8.80, 2.16]),
    ] {
        let (outcome, time, notes) = KinematicWorld::new(bottle, yaw, soup, 0).run(seed);
        assert_eq!(outcome, Outcome::Success, "seed {seed}: {notes:?}");
        assert!(time < 150.0, "seed {seed} took {time:.1} s");
    }
}

#[test]
fn commands_stay_within_the_force_of_the_gripper() {
    for most in [10.0, 235.0] {
        let mut world = KinematicWorld::new([-8.80, 2.10], 0.0, [-8.85, 1.50], 0);
        world.scene.hand.max_force = most;
        let mut operator = world.operator(3);
        world.until(&mut operator, "closing");
        let (act, _) = operator.step(&world.observe(), &mut world.arm);
        let gripper = operator.command(&act).gripper.expect("the hand closes");
        let force = gripper.max_force.expect("a cap");
        assert!(
            if most < 20.0 {
                force == most
            } else {
                force > 20.0
            },
            "{force} N"
        );
    }
}

#[test]
fn a_slip_is_noticed_and_the_third_attempt_is_the_last() {
    let place = |clumsy| KinematicWorld::new([-8.80, 2.10], 0.1, [-8.85, 1.80], clumsy);
    let (outcome, _, notes) = place(2).run(5);
    assert_eq!(outcome, Outcome::Success, "{notes:?}");
    assert_eq!(
        notes.iter().filter(|note| note.contains("slipped")).count(),
        2
    );
    let (outcome, _, _) = place(3).run(5);
    let Outcome::Failure(why) = outcome else {
        panic!("three slips cannot succeed");
    };
    assert!(why.contains("3 attempts"), "{why}");
}

#[test]
fn a_hand_left_beside_the_bottle_is_put_right_on_the_spot() {
    for (aside, forward) in [(0.03, 0.0), (-0.04, -0.02), (0.0, 0.03), (0.06, -0.03)] {
        let mut world = KinematicWorld::new([-8.80, 2.10], 0.0, [-8.85, 1.50], 0);
        let mut first = world.operator(3);
        world.until(&mut first, "approaching");
        world.base_from_tool *= Translation3::new(aside, 0.0, forward);
        world.target = world.base_from_tool;
        let (chair, begun) = (world.chair, world.time);
        let operator = world.operator(3).on_the_spot();
        let (outcome, time, notes) = world.run_by(operator);
        assert_eq!(outcome, Outcome::Success, "{notes:?}");
        let drove = notes.iter().any(|note| note.contains("drives to"));
        assert!(!drove, "from {chair:?}: {notes:?}");
        assert!(notes[0].contains("where the hand is"), "{notes:?}");
        assert!(time - begun < 15.0, "took {:.1} s", time - begun);
    }
}

#[test]
fn what_the_pads_hold_already_is_lifted() {
    let mut world = KinematicWorld::new([-8.80, 2.10], 0.0, [-8.85, 1.50], 0);
    let mut first = world.operator(3);
    world.until(&mut first, "lifting");
    let mut second = world.operator(3).on_the_spot();
    let mut opens = false;
    for _ in 0..60 {
        let (act, _) = second.step(&world.observe(), &mut world.arm);
        opens |= act.opening.is_some_and(|opening| opening > 0.01);
        world.apply(&act);
    }
    assert!(!opens && world.held.is_some());
}

/// The pads press on something, but not on the bottle.
#[test]
fn what_the_pads_hold_by_mistake_is_let_go() {
    let mut world = KinematicWorld::new([-8.80, 2.10], 0.0, [-8.85, 1.50], 0);
    let mut first = world.operator(3);
    world.until(&mut first, "approaching");
    let mut observation = world.observe();
    observation.pad_force = [20.0, 20.0];
    let (act, _) = world
        .operator(3)
        .on_the_spot()
        .step(&observation, &mut world.arm);
    assert!(act.opening.is_some_and(|opening| opening > 0.08), "{act:?}");
}

#[test]
fn who_cannot_go_on_from_the_spot_begins_again() {
    // The chair is too far away for the arm, and the arm is not stowed.
    let mut world = KinematicWorld::new([-8.80, 2.10], 0.0, [-8.85, 1.50], 0);
    let mut first = world.operator(3);
    world.until(&mut first, "approaching");
    world.chair = world.chair.rolled(-0.3, 0.0);
    let operator = world.operator(3).on_the_spot();
    let (outcome, _, notes) = world.run_by(operator);
    assert_eq!(outcome, Outcome::Success, "{notes:?}");
    assert!(
        notes.iter().any(|note| note.contains("drives to")),
        "{notes:?}"
    );
}

#[test]
fn a_bottle_out_of_reach_is_given_up_with_a_reason() {
    let mut world = KinematicWorld::new([-8.80, 2.10], 0.0, [-8.85, 1.50], 0);
    world.arm.longest = 0.45;
    let (outcome, _, _) = world.run(6);
    let Outcome::Failure(why) = outcome else {
        panic!("a short arm cannot take it");
    };
    assert!(why.contains("mustard") && why.contains("reach"), "{why}");
}

#[test]
fn expert_stops_at_once_when_the_robot_presses_the_person() {
    let mut world = KinematicWorld::new([-8.80, 2.10], 0.0, [-8.85, 1.50], 0);
    for extent in [Extent::Task, Extent::Near, Extent::Take] {
        let mut operator = world.operator(6).only(extent);
        world.person_force = 4.9;
        assert_eq!(operator.step(&world.observe(), &mut world.arm).1, None);
        world.person_force = 181_213.0;
        let (act, outcome) = operator.step(&world.observe(), &mut world.arm);
        assert_eq!(act.base, Some([0.0, 0.0]));
        let Some(Outcome::Failure(why)) = outcome else {
            panic!("it went on: {outcome:?}");
        };
        assert!(why.contains("pressed the person with 181213 N"), "{why}");
    }
}

/// The arm reaches down to the floor from its shoulder: it grasps an object on the
/// floor from nearer than an object on a table.
#[test]
fn the_chair_stops_nearer_to_what_stands_on_the_floor() {
    let scene = home_scene();
    let furthest = |height: f64| {
        let mut at = scene.grasps[0].item_from_grasp;
        at.translation = Translation3::new(-7.0, 3.0, height);
        let candidate = GraspCandidate {
            pregrasp: at * Translation3::new(0.0, 0.0, -0.1),
            grasp: at,
            opening: 0.08,
            width: 0.058,
            force: None,
            lean: 0.0,
            backoff: 0.0,
            cost: 0.0,
            wish: 0.0,
            shown: None,
            push: None,
        };
        let point = candidate.point(&scene.hand);
        let chair = Pose2 {
            x: -6.6,
            y: 3.4,
            heading: 0.0,
        };
        let placements = base_placement::placements(&scene, &chair, &[candidate], None, 0.74);
        let far = placements.iter().map(|placement| {
            let base = standing(&placement.chair) * scene.chair_from_base;
            (Point3::from(base.translation.vector) - point).xy().norm()
        });
        far.fold(0.0, f64::max)
    };
    assert!((furthest(0.14) - 0.66).abs() < 0.02, "{}", furthest(0.14));
    assert!((furthest(0.9) - 0.88).abs() < 0.02, "{}", furthest(0.9));
}

/// A demonstration is repeated around a bottle at another place: the hand passes the
/// same poses relative to the bottle.
#[test]
fn what_was_shown_about_one_bottle_is_done_about_another() {
    let grasped = |mut world: KinematicWorld, mut operator: Operator| {
        let (mut observations, mut commanded, mut opening) = (Vec::new(), Vec::new(), Vec::new());
        let mut closing = None;
        loop {
            let now = world.observe();
            let (act, outcome) = operator.step(&now, &mut world.arm);
            if act.name == "closing" {
                closing.get_or_insert(world.objects[0].inv_mul(&world.house_from_tool()));
            }
            observations.push(now);
            commanded.push(act.opening);
            opening.push(world.opening);
            if let Some(outcome) = outcome {
                assert_eq!(outcome, Outcome::Success, "{:?}", operator.notes());
                let source = operator.source().map(str::to_owned);
                return (closing.unwrap(), source, observations, commanded, opening);
            }
            world.apply(&act);
            assert!(world.time < 100.0);
        }
    };
    let world = KinematicWorld::new([-8.80, 2.10], 0.0, [-8.85, 1.50], 0);
    let operator = world.operator(4);
    let (scene, goal) = (world.scene.clone(), Goal::Lift { item: 0 });
    let (first, source, observations, commanded, opening) = grasped(world, operator);
    assert_eq!(source, None);
    let one = cut(&Course {
        source: "one",
        scene: &scene,
        goal: &goal,
        observations: &observations,
        commanded: &commanded,
        opening: &opening,
    });
    for (bottle, yaw, noise) in [([-8.74, 1.60], 0.3, 0.0), ([-8.85, 2.40], -0.2, 0.001)] {
        let world = KinematicWorld::new(bottle, yaw, [-8.85, 1.2], 0);
        let operator = world.operator(9).shown(Demonstrations {
            list: vec![one.clone().unwrap()],
            seed: 1,
            noise,
        });
        let (second, source, ..) = grasped(world, operator);
        assert_eq!(source.as_deref(), Some("one"));
        let off = first.inv_mul(&second).translation.vector.norm();
        assert!(off < 0.004 + 4.0 * noise, "{off}");
    }
}

/// Step names up to the grasp, the hand in `base_link` there, and the commanded force.
fn to_the_grasp(seed: u64) -> (Vec<&'static str>, Isometry3<f64>, f64) {
    let mut world = KinematicWorld::new([-8.80, 2.10], 0.0, [-8.85, 1.50], 0);
    let mut operator = world.operator(seed);
    let mut names = Vec::new();
    loop {
        let (act, outcome) = operator.step(&world.observe(), &mut world.arm);
        assert_eq!(outcome, None, "seed {seed}: {:?}", operator.notes());
        if names.last() != Some(&act.name) {
            names.push(act.name);
        }
        if act.name == "closing" {
            let gripper = operator.command(&act).gripper;
            let force = gripper.and_then(|gripper| gripper.max_force);
            return (names, world.base_from_tool, force.unwrap());
        }
        world.apply(&act);
        assert!(world.time < 150.0, "seed {seed}: {:?}", operator.notes());
    }
}

#[test]
fn operators_of_different_seeds_do_the_same_work_in_different_ways() {
    let episodes: Vec<_> = (1..=32).map(to_the_grasp).collect();
    let spread = |value: fn(&Isometry3<f64>, f64) -> f64| {
        let values: Vec<f64> = episodes
            .iter()
            .map(|(_, at, force)| value(at, *force))
            .collect();
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let squares = values.iter().map(|value| (value - mean).powi(2));
        (squares.sum::<f64>() / count).sqrt()
    };
    // The arm is mounted backwards.
    let bearing = spread(|at, _| {
        let point = at * Point3::new(0.0, 0.0, 0.13);
        exact::atan2(-point.y, -point.x).to_degrees()
    });
    assert!(bearing > 12.0, "bearing {bearing:.1} degrees");
    let height = spread(|at, _| (at * Point3::new(0.0, 0.0, 0.13)).z);
    assert!(height > 0.004, "height {height:.4} m");
    let lean = spread(|at, _| exact::asin((at.rotation * Vector3::z()).z).to_degrees());
    assert!(lean > 4.0, "lean {lean:.1} degrees");
    let force = spread(|_, force| force);
    assert!(force > 6.0, "force {force:.1} N");
    let mut sequences: Vec<_> = episodes.iter().map(|(names, ..)| names.clone()).collect();
    sequences.sort();
    let often = sequences.chunk_by(|a, b| a == b);
    let often = often
        .filter(|same| same.len() * 10 >= episodes.len())
        .count();
    assert!(often >= 4, "{sequences:?}");
}

#[test]
fn operator_of_a_seed_repeats_itself_and_the_plain_one_has_no_habits() {
    assert_eq!(to_the_grasp(7), to_the_grasp(7));
    let plain = OperatorProfile::new(PLAIN);
    assert_eq!((plain.habits, plain.force), (None, 40.0));
    let (names, at, force) = to_the_grasp(PLAIN);
    assert!(!names.contains(&"driving and preparing") && force == 40.0);
    let point = at * Point3::new(0.0, 0.0, 0.13);
    assert!(exact::atan2(-point.y, -point.x).abs() < 0.1, "{point}");
}
