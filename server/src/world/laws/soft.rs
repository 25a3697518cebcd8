//! Tests of the deformable bear in the world: its weight, the fingers' grip, and saved
//! states.

use rapier3d::prelude::{RigidBodyHandle, RigidBodyType};

use super::super::GRAVITY;
use super::*;
use crate::snapshot::{BodyRef, Snapshot};

/// Half extents of a plate that presses the waist: like a finger pad.
const PLATE: [f64; 3] = [0.0187, 0.004, 0.011];
/// Height of the waist above the seat, metres.
const WAIST: f64 = 0.098;
/// Depth of the waist at rest, metres.
const DEPTH: f64 = 0.0727;

fn bear(pose: Isometry3<f64>) -> Body {
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets");
    let mut bear = crate::scene::object(&assets, "teddy_bear").expect("the bear loads");
    bear.pose = pose;
    bear
}

/// Initial distance of the plates in front of and behind the waist, metres.
const ASIDE: f64 = 0.08;

/// The robot far away, the bear on the table, a plate in front of and behind it.
struct Press {
    world: World,
    plates: [RigidBodyHandle; 2],
    weight: f64,
}

fn press() -> Press {
    press_from(ASIDE)
}

fn press_from(aside: f64) -> Press {
    let seat = pose_at(0.3, 0.0, TABLE_TOP);
    let middle = Vector3::new(0.3, 0.0, TABLE_TOP + WAIST);
    let plate = |y: f64| {
        let pose = pose_at(middle.x, middle.y + y, middle.z);
        let half = PLATE;
        object("plate", pose, 0.5, half, Shape::Cuboid { half })
    };
    let bear = bear(seat);
    let weight = bear.mass.expect("the bear has mass").mass * GRAVITY;
    let (scene, placements) = scene(
        vec![floor(), table(0.0)],
        vec![bear, plate(aside), plate(-aside)],
    );
    let model = model();
    let home = model.settings.home;
    let mut world =
        World::new(&model, &scene, &placements, &pose_at(-3.0, 0.0, 0.0), &home).expect("a world");
    let plates = [world.scene_bodies.objects[1], world.scene_bodies.objects[2]];
    for plate in plates {
        let plate = &mut world.physics.bodies[plate];
        plate.set_body_type(RigidBodyType::KinematicVelocityBased, true);
    }
    Press {
        world,
        plates,
        weight,
    }
}

impl Press {
    fn run(&mut self, secs: f64) {
        seconds(&mut self.world, secs, |_, _| {});
    }

    /// Moves the plates for a time, and stops them.
    fn carry(&mut self, closing: f64, up: f64, secs: f64) {
        for (plate, side) in self.plates.into_iter().zip([-1.0, 1.0]) {
            let velocity = Vector3::new(0.0, side * closing, up);
            let plate = &mut self.world.physics.bodies[plate];
            plate.set_linvel(super::super::convert::vector(&velocity), true);
        }
        self.run(secs);
        for plate in self.plates {
            self.world.physics.bodies[plate].set_linvel(rapier3d::math::Vector::ZERO, true);
        }
    }

    /// Closes the plates until the waist between them is `width` metres deep.
    fn close_to(&mut self, width: f64) {
        let now = self.width();
        self.carry((now - width) / 2.0 / 0.5, 0.0, 0.5);
        self.run(0.5);
    }

    fn width(&self) -> f64 {
        let y = |i: usize| f64::from(self.world.physics.bodies[self.plates[i]].translation().y);
        y(0) - y(1) - 2.0 * PLATE[1]
    }

    /// Force of a body on the bear, N.
    fn force(&self, of: BodyRef) -> Vector3<f64> {
        let snapshot = self.world.snapshot();
        let mut sum = Vector3::zeros();
        for contact in &snapshot.contacts {
            if contact.first == BodyRef::Object(0) && contact.second == of {
                sum -= contact.force;
            } else if contact.second == BodyRef::Object(0) && contact.first == of {
                sum += contact.force;
            }
        }
        sum
    }

    fn plates(&self) -> [Vector3<f64>; 2] {
        [
            self.force(BodyRef::Object(1)),
            self.force(BodyRef::Object(2)),
        ]
    }

    /// The skin in the bear's own frame: friction under its seat may displace the whole
    /// bear.
    fn shape(&self) -> Vec<Point3<f64>> {
        let snapshot = self.world.snapshot();
        let pose = snapshot.objects[0].pose;
        let skin = snapshot.skins[0].vertices.iter();
        skin.map(|p| pose.inverse_transform_point(&p.cast()))
            .collect()
    }

    fn bear(&self) -> Vector3<f64> {
        self.world.snapshot().objects[0].pose.translation.vector
    }
}

/// Contacts press and never pull, friction stays within Coulomb's limit, no solid is
/// ejected, and no energy is created.
fn lawful(world: &World) {
    for worst in world.worst_of_soft() {
        assert!(worst.ticks > 0, "no tick was checked");
        assert!(worst.normal >= 0.0, "{worst:?}");
        assert!(worst.friction <= 1.001, "{worst:?}");
        assert!(worst.kick <= 0.5, "{worst:?}");
        assert!(worst.rise <= 0.0, "{worst:?}");
        assert!(worst.window_rise <= 0.0, "{worst:?}");
    }
}

fn fastest(snapshot: &Snapshot) -> f64 {
    snapshot.objects[0].linear.norm()
}

#[test]
fn the_bear_is_at_rest_and_its_contact_force_is_its_weight() {
    let mut press = press();
    press.run(4.0);
    let up = press.force(BodyRef::Furniture(1));
    assert!(
        (up.z / press.weight - 1.0).abs() < 0.01,
        "{up} N, weight {} N",
        press.weight
    );
    let first = press.bear();
    press.run(1.0);
    let crept = (press.bear() - first).norm();
    assert!(crept < 1e-4, "crept {crept} m in a second");
    assert!(fastest(&press.world.snapshot()) < 1e-3);
    let lean = press.world.snapshot().objects[0].pose.rotation.angle();
    assert!(lean < 0.1, "leans by {lean} rad");
    lawful(&press.world);
}

/// The deeper the plates press, the harder the bear presses back; after release it
/// recovers its shape. The forces of the two plates need not be equal while it sits:
/// belly and back differ, and the table's friction takes the difference. The three
/// forces along the squeeze must cancel.
#[test]
fn a_squeezed_bear_presses_back_and_recovers() {
    let mut press = press();
    press.run(2.0);
    let rest = press.shape();
    let mut last = 0.0;
    for width in [0.066, 0.058, 0.050, 0.042] {
        press.close_to(width);
        press.run(1.0);
        let [front, back] = press.plates().map(|f| f.y);
        let table = press.force(BodyRef::Furniture(1)).y;
        let left = front + back + table;
        println!(
            "{width} m: plates {front:.3} and {back:.3} N, table {table:.3} N, left {left:.4} N"
        );
        assert!(
            left.abs() < 0.02,
            "{front} N, {back} N and {table} N of the table at {width} m"
        );
        let force = (front.abs() + back.abs()) / 2.0;
        assert!(
            force > last + 0.2,
            "{force} N at {width} m, {last} N before"
        );
        last = force;
    }
    // Between the limits of a bar and a half-space for flat punches.
    let squeeze = DEPTH - 0.042;
    let stiffness = last / squeeze;
    assert!((70.0..600.0).contains(&stiffness), "{stiffness} N/m");
    press.close_to(0.14);
    press.run(3.0);
    let shape = press.shape();
    let worst = shape
        .iter()
        .zip(&rest)
        .map(|(now, then)| (now - then).norm())
        .fold(0.0, f64::max);
    assert!(worst < 2e-3, "a vertex is {worst} m from its start");
    lawful(&press.world);
}

/// Lifted by two plates, the bear's whole weight is carried by their friction.
#[test]
fn lifted_plates_carry_the_weight() {
    let mut press = press();
    press.run(1.0);
    press.close_to(0.048);
    press.carry(0.0, 0.1, 1.0);
    press.run(2.0);
    let [a, b] = press.plates();
    let carried = a + b;
    assert_eq!(press.force(BodyRef::Furniture(1)), Vector3::zeros());
    assert!(
        (carried.z / press.weight - 1.0).abs() < 0.02,
        "{carried} N of {} N",
        press.weight
    );
    let first = press.bear();
    press.run(5.0);
    let crept = (press.bear() - first).norm();
    assert!(crept < 1e-3, "crept {crept} m in 5 s");
    lawful(&press.world);
}

/// Friction follows Coulomb's law: on a slope steeper than its coefficient the bear
/// slides with the remaining acceleration, on a flatter one it stays.
///
/// A slope instead of two plates: plates press 12 mm deep into the waist, and the bulge
/// over their edges holds the bear without friction.
#[test]
fn the_bear_slides_beyond_the_friction_limit() {
    const FRICTION: f64 = 0.3;
    for share in [0.8_f64, 1.3] {
        // Feet first, so that it does not tip over.
        let angle = (FRICTION * share).atan();
        let turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), angle);
        let half = [1.0, 1.0, 0.02];
        let slope = Isometry3::from_parts(pose_at(0.0, 0.0, TABLE_TOP).translation, turn);
        let mut board = body("slope", slope, 0.0, Shape::Cuboid { half });
        board.friction = 0.0;
        let mut bear = bear(slope * pose_at(0.0, 0.0, half[2]));
        bear.friction = FRICTION;
        let (scene, placements) = scene(vec![floor(), board], vec![bear]);
        let model = model();
        let home = model.settings.home;
        let mut world = World::new(&model, &scene, &placements, &pose_at(-3.0, 0.0, 0.0), &home)
            .expect("a world");
        let down = turn * -Vector3::y();
        let along = |world: &World| {
            let bear = &world.snapshot().objects[0];
            (
                bear.pose.translation.vector.dot(&down),
                bear.linear.dot(&down),
            )
        };
        seconds(&mut world, 0.5, |_, _| {});
        let (from, before) = along(&world);
        seconds(&mut world, 0.9, |_, _| {});
        let (to, after) = along(&world);
        let (moved, faster) = (to - from, after - before);
        println!("{share} of the limit: {moved} m, {faster} m/s faster");
        if share > 1.0 {
            // It rocks on its legs while sliding.
            let rate = faster / 0.9;
            let felt = (GRAVITY * angle.sin() - rate) / (GRAVITY * angle.cos());
            assert!(
                (felt / FRICTION - 1.0).abs() < 0.1,
                "slides as if the coefficient were {felt}, it is {FRICTION}"
            );
        } else {
            assert!(moved.abs() < 1e-4, "slid {moved} m below the limit");
        }
        lawful(&world);
    }
}

/// A board of 100 g across the bear's legs is carried, and the force on the table is
/// the weight of both. It is wider than the gap between the legs: a small box would
/// fall through.
#[test]
fn the_bear_carries_a_board() {
    let half = [0.10, 0.035, 0.008];
    let load = object(
        "board",
        pose_at(0.3, -0.075, TABLE_TOP + 0.096),
        0.1,
        half,
        Shape::Cuboid { half },
    );
    let bear = bear(pose_at(0.3, 0.0, TABLE_TOP));
    let weight = (bear.mass.expect("mass").mass + 0.1) * GRAVITY;
    let (scene, placements) = scene(vec![floor(), table(0.0)], vec![bear, load]);
    let model = model();
    let home = model.settings.home;
    let mut world =
        World::new(&model, &scene, &placements, &pose_at(-3.0, 0.0, 0.0), &home).expect("a world");
    seconds(&mut world, 4.0, |_, _| {});
    let snapshot = world.snapshot();
    let speed = snapshot.objects[1].linear.norm();
    assert!(speed < 5e-3, "the board moves at {speed} m/s");
    assert!(
        snapshot.objects[1].pose.translation.z > TABLE_TOP + 0.06,
        "the board fell off"
    );
    let table: f64 = snapshot
        .contacts
        .iter()
        .filter(|c| c.second == BodyRef::Furniture(1) && c.first != BodyRef::Object(1))
        .map(|c| -c.force.z)
        .sum();
    assert!(
        (table / weight - 1.0).abs() < 0.05,
        "{table} N on the table, {weight} N of weight"
    );
    lawful(&world);
}

/// A bear between two plates is flung, dropped onto its edge and torn: the laws hold
/// while contacts open and close at random.
#[test]
fn a_shaken_bear_keeps_the_laws() {
    let mut press = press();
    press.run(0.2);
    press.close_to(0.03);
    for (closing, up, secs) in [
        (0.0, 1.5, 0.1),
        (0.02, -1.2, 0.1),
        (-0.05, 2.0, 0.2),
        (0.3, 0.0, 0.1),
        (0.0, -3.0, 0.1),
        (-0.4, 0.5, 0.2),
    ] {
        press.carry(closing, up, secs);
    }
    press.run(1.0);
    lawful(&press.world);
    let worst = press.world.worst_of_soft()[0];
    assert!(worst.speed < 20.0 && worst.energy < 20.0, "{worst:?}");
}

/// A bear at rest sleeps: its state is constant and its contact force is its weight,
/// also after restoring; an approaching body wakes it.
#[test]
fn a_bear_at_rest_sleeps_until_a_body_approaches() {
    const AWAY: f64 = 0.3;
    let mut press = press_from(AWAY);
    press.run(6.0);
    assert!(press.world.soft[0].is_asleep(), "it does not sleep");
    let weighs = |press: &Press| {
        let up = press.force(BodyRef::Furniture(1));
        assert!((up.z / press.weight - 1.0).abs() < 0.01, "{up} N");
    };
    weighs(&press);
    let (skin, saved) = (press.world.snapshot().skins, press.world.save());
    press.run(1.0);
    assert_eq!(
        press.world.snapshot().skins,
        skin,
        "it changed in its sleep"
    );
    weighs(&press);
    let mut other = press_from(AWAY);
    other.world.restore(&saved).expect("the same world");
    other.run(1.0);
    weighs(&other);
    assert_eq!(
        press.world.snapshot().contacts,
        other.world.snapshot().contacts
    );
    for press in [&mut press, &mut other] {
        press.close_to(0.058);
        assert!(!press.world.soft[0].is_asleep(), "it keeps sleeping");
        for force in press.plates() {
            assert!(force.norm() > 0.3, "{force} N of a plate");
        }
        lawful(&press.world);
    }
    assert_eq!(press.world.hash(), other.world.hash());
}

#[test]
fn a_squeezed_bear_survives_saving() {
    let mut first = press();
    first.run(0.5);
    first.close_to(0.05);
    let saved = first.world.save();
    let mut second = press();
    second.run(0.1);
    second.world.restore(&saved).expect("the same world");
    for press in [&mut first, &mut second] {
        press.carry(0.0, 0.1, 0.5);
    }
    assert_eq!(first.world.hash(), second.world.hash());
    assert_eq!(first.world.snapshot().skins, second.world.snapshot().skins);
}

/// A non-finite state is reported and the bear keeps its last state.
#[test]
fn a_state_that_is_not_finite_is_reported() {
    let mut press = press();
    press.run(0.1);
    press.world.soft[0].spoil();
    press.run(0.1);
    let snapshot = press.world.snapshot();
    let own = crate::snapshot::Anomaly::NotFinite(BodyRef::Object(0));
    assert_eq!(snapshot.anomalies, vec![own]);
    let skin = &snapshot.skins[0].vertices;
    assert!(skin.iter().all(|p| p.coords.iter().all(|x| x.is_finite())));
}

/// The bear in the hand of two plates, put down on the table and released.
fn put_down() -> Press {
    let mut press = press();
    press.run(0.5);
    press.close_to(0.048);
    press.carry(0.0, 0.1, 0.5);
    press.run(0.5);
    assert!(!press.world.soft[0].is_asleep(), "it sleeps in the hand");
    press.carry(0.0, -0.098, 0.5);
    press.carry(-0.3, 0.0, 0.5);
    press
}

/// Greatest distance between two skins, metres.
fn farthest(one: &Snapshot, other: &Snapshot) -> f64 {
    let pairs = one.skins[0].vertices.iter().zip(&other.skins[0].vertices);
    pairs.fold(0.0, |far, (a, b)| far.max(f64::from((a - b).norm())))
}

/// A bear that was put down rocks for a while, then sleeps, stays where it was, and weighs
/// the same.
#[test]
fn bear_that_is_put_down_falls_asleep() {
    let mut press = put_down();
    let mut before = press.world.snapshot();
    let mut waited = 0.0;
    while !press.world.soft[0].is_asleep() {
        assert!(waited < 25.0, "it is awake after {waited} s");
        before = press.world.snapshot();
        press.run(0.5);
        waited += 0.5;
    }
    assert!(waited > 1.0, "it slept while it rocked");
    let asleep = press.world.snapshot();
    let crept = farthest(&before, &asleep);
    assert!(crept < 5e-4, "it crept {crept} m in its last half second");
    press.run(5.0);
    assert_eq!(farthest(&asleep, &press.world.snapshot()), 0.0);
    let up = press.force(BodyRef::Furniture(1));
    assert!((up.z / press.weight - 1.0).abs() < 0.02, "{up} N");
    lawful(&press.world);
}

/// A bear that sits still from the start sleeps within two seconds.
#[test]
fn bear_that_sits_still_falls_asleep() {
    let mut press = press_from(0.3);
    let first = press.world.snapshot();
    press.run(2.0);
    assert!(press.world.soft[0].is_asleep(), "it is awake");
    let crept = farthest(&first, &press.world.snapshot());
    assert!(crept < 5e-4, "it crept {crept} m");
}

/// A plate that moves beside a sleeping bear does not wake it, one that arrives does,
/// before it enters the skin by more than a contact would.
#[test]
fn sleeping_bear_wakes_when_it_is_touched() {
    let mut press = press_from(0.3);
    press.run(2.0);
    let asleep = press.world.snapshot();
    // The box around the bear contains the plates long before they touch its waist.
    press.carry(0.2, 0.0, 1.1);
    let moving: Vec<f64> = (press.plates.iter())
        .map(|plate| f64::from(press.world.physics.bodies[*plate].translation().y).abs())
        .collect();
    assert!(moving.iter().all(|y| *y < 0.085), "{moving:?}");
    assert!(press.world.soft[0].is_asleep(), "it woke without a contact");
    assert_eq!(farthest(&asleep, &press.world.snapshot()), 0.0);
    press.carry(0.2, 0.0, 0.22);
    assert!(!press.world.soft[0].is_asleep(), "it sleeps on");
    for force in press.plates() {
        assert!(force.norm() > 0.05, "{force} N of a plate");
    }
    lawful(&press.world);
}

/// A board that falls onto a sleeping bear wakes it.
#[test]
fn sleeping_bear_wakes_when_an_object_falls_on_it() {
    let half = [0.10, 0.035, 0.008];
    let above = pose_at(0.3, -0.075, TABLE_TOP + 0.5);
    let load = object("board", above, 0.1, half, Shape::Cuboid { half });
    let bear = bear(pose_at(0.3, 0.0, TABLE_TOP));
    let (scene, placements) = scene(vec![floor(), table(0.0)], vec![bear, load]);
    let model = model();
    let home = model.settings.home;
    let mut world =
        World::new(&model, &scene, &placements, &pose_at(-3.0, 0.0, 0.0), &home).expect("a world");
    let board = world.scene_bodies.objects[1];
    world.physics.bodies[board].set_body_type(RigidBodyType::Fixed, true);
    seconds(&mut world, 2.0, |_, _| {});
    assert!(world.soft[0].is_asleep(), "it is awake");
    world.physics.bodies[board].set_body_type(RigidBodyType::Dynamic, true);
    let mut touched = false;
    seconds(&mut world, 0.5, |world, _| {
        let contacts = world.snapshot().contacts;
        touched |= contacts
            .iter()
            .any(|c| c.first == BodyRef::Object(0) && c.second == BodyRef::Object(1));
    });
    assert!(touched, "the board does not touch it");
    assert!(!world.soft[0].is_asleep(), "it sleeps under the board");
    lawful(&world);
}

/// The bear on a tray that moves like a drawer.
fn on_a_tray() -> (World, RigidBodyHandle) {
    let half = [0.2, 0.2, 0.01];
    let at = pose_at(0.3, 0.0, TABLE_TOP + 0.05);
    let tray = object("tray", at, 1.0, half, Shape::Cuboid { half });
    let bear = bear(pose_at(0.3, 0.0, TABLE_TOP + 0.06));
    let (scene, placements) = scene(vec![floor(), table(0.0)], vec![bear, tray]);
    let model = model();
    let home = model.settings.home;
    let mut world =
        World::new(&model, &scene, &placements, &pose_at(-3.0, 0.0, 0.0), &home).expect("a world");
    let tray = world.scene_bodies.objects[1];
    let body = &mut world.physics.bodies[tray];
    body.set_body_type(RigidBodyType::Fixed, true);
    (world, tray)
}

fn pull_the_tray(world: &mut World, tray: RigidBodyHandle) {
    let body = &mut world.physics.bodies[tray];
    body.set_body_type(RigidBodyType::KinematicVelocityBased, true);
    let along = Vector3::new(0.0, 0.1, 0.0);
    body.set_linvel(super::super::convert::vector(&along), true);
}

/// A sleeping bear wakes when its support moves, and rides along.
#[test]
fn sleeping_bear_wakes_when_its_support_moves() {
    let (mut world, tray) = on_a_tray();
    seconds(&mut world, 2.0, |_, _| {});
    assert!(world.soft[0].is_asleep(), "it is awake");
    let before = world.snapshot().objects[0].pose.translation.vector;
    pull_the_tray(&mut world, tray);
    seconds(&mut world, 1.0, |_, _| {});
    assert!(!world.soft[0].is_asleep(), "it sleeps on a moving tray");
    let moved = world.snapshot().objects[0].pose.translation.vector - before;
    assert!((moved.y - 0.1).abs() < 0.01, "it moved {moved} m of 0.1 m");
    lawful(&world);
}

/// A world that is restored before the bear sleeps, in its sleep or after it woke runs on
/// as the one that was saved, tick by tick; so does a second run from the start.
#[test]
fn sleep_survives_saving_and_replay() {
    let script = |world: &mut World, tray: RigidBodyHandle, tick: u64| {
        if tick == 480 {
            pull_the_tray(world, tray);
        }
        world.step();
    };
    let (mut world, tray) = on_a_tray();
    let (mut hashes, mut saved, mut slept) = (Vec::new(), Vec::new(), Vec::new());
    for tick in 0..600 {
        if [60, 400, 490].contains(&tick) {
            saved.push((tick, world.save()));
            slept.push(world.soft[0].is_asleep());
        }
        script(&mut world, tray, tick);
        hashes.push(world.hash());
    }
    assert_eq!(slept, [false, true, false]);
    for (start, state) in [(0, None)]
        .into_iter()
        .chain(saved.into_iter().map(|(tick, state)| (tick, Some(state))))
    {
        let (mut other, tray) = on_a_tray();
        if start > 480 {
            // The tray's type is not part of a saved state.
            pull_the_tray(&mut other, tray);
        }
        if let Some(state) = &state {
            other.restore(state).expect("the same world");
        }
        for tick in start..600 {
            script(&mut other, tray, tick);
            assert_eq!(
                other.hash(),
                hashes[tick as usize],
                "tick {tick} from {start}"
            );
        }
    }
}
