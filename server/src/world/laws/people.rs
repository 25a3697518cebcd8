//! Tests of people in the seat: every body in every posture is at rest, the chair
//! behaves correctly with them, and contacts press with the right force.

use std::sync::Arc;

use super::super::contact::contacts_among;
use super::*;
use crate::people::{BodyPart, HeadPose, Motion, Person, PersonSetting};
use crate::snapshot::{BodyRef, Touch};

fn assets() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets")
}

fn person(body: &str, posture: &str) -> Arc<Person> {
    let setting = PersonSetting {
        body: body.into(),
        posture: posture.into(),
        ..PersonSetting::default()
    };
    let drawn = setting.sample(&assets(), 1).expect("a person");
    Arc::new(Person::load(&assets(), drawn).expect("a person"))
}

fn motion(person: &Person, strength: f64) -> Motion {
    Motion {
        seed: 3,
        strength,
        mouth_open: false,
        limits: person.limits,
    }
}

fn names(folder: &Path, wanted: fn(&Path) -> bool) -> Vec<String> {
    let entries = std::fs::read_dir(folder).expect("a folder").flatten();
    let paths = entries.map(|e| e.path()).filter(|p| wanted(p));
    let mut names: Vec<String> = paths
        .map(|p| p.file_name().unwrap().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

/// The robot at home touches no person, and nothing moves: the capsules neither overlap
/// the arm nor push the chair.
#[test]
fn every_body_in_every_posture_is_at_rest() {
    let bodies = names(&assets().join("people"), Path::is_dir);
    let list = std::fs::read_to_string(assets().join("people/postures.toml")).unwrap();
    let list: toml::Table = list.parse().unwrap();
    let postures: Vec<&String> = list
        .iter()
        .filter(|(_, v)| v.is_table())
        .map(|(k, _)| k)
        .collect();
    assert_eq!((bodies.len(), postures.len()), (14, 13));
    let mut wrong = Vec::new();
    std::thread::scope(|scope| {
        let work = bodies.chunks(bodies.len().div_ceil(4)).map(|bodies| {
            let postures = &postures;
            scope.spawn(move || {
                let mut wrong = Vec::new();
                for body in bodies {
                    for posture in postures {
                        wrong.extend(sits(body, posture));
                    }
                }
                wrong
            })
        });
        for done in work.collect::<Vec<_>>() {
            wrong.extend(done.join().expect("no panic"));
        }
    });
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Describes an error after a person sat for 2 s.
fn sits(body: &str, posture: &str) -> Option<String> {
    let (mut world, _, start) = robot_alone();
    let person = person(body, posture);
    world.seat(&person, motion(&person, 1.0));
    let mut touched = None;
    seconds(&mut world, 2.0, |world, _| {
        let state = world.snapshot().person.expect("a person");
        if state.forces.iter().any(|f| *f > 0.0) {
            touched = world.snapshot().contacts.first().copied();
        }
    });
    let snapshot = world.snapshot();
    let moved = start.inverse() * snapshot.links[0].pose;
    let (far, turn) = (moved.translation.vector.norm(), moved.rotation.angle());
    if let Some(contact) = touched {
        return Some(format!("{body}, {posture}: touched by {contact:?}"));
    }
    let speed = snapshot
        .links
        .iter()
        .map(|l| l.linear.norm())
        .fold(0.0, f64::max);
    // A heavier chair sinks further into its wheels' contacts.
    (far > 3e-3 || turn > 5e-3 || speed > 5e-3 || !snapshot.anomalies.is_empty())
        .then(|| format!("{body}, {posture}: moved by {far} m, {turn} rad, {speed} m/s"))
}

/// Loads of the four wheels on the floor, N.
fn wheel_loads(world: &World) -> Vec<f64> {
    let on_floor = contacts_among(
        &world.physics,
        world.physics.narrow_phase.contact_pairs(),
        |a, b| matches!((a, b), (BodyRef::Link(_), BodyRef::Furniture(0))),
    );
    on_floor.iter().map(|c| -c.force.z).collect()
}

/// Empty, with 42 kg and with 106 kg, from 0.5 m/s by the chair's own profile: at rest
/// by 0.7 s, all wheels on the floor, the drive below its cap. `cargo test … --
/// --nocapture` prints the table.
#[test]
fn the_chair_stops_with_any_person() {
    use crate::robot::control::{BaseIntent, ControlInput, RobotControl};
    let model = model();
    let most = model.settings.drive.wheel_torque;
    for (body, kilograms) in [("", 0.0), ("girl_12", 42.0), ("man_p95", 106.0)] {
        let (mut world, ..) = robot_alone();
        if !body.is_empty() {
            let person = person(body, "hands_in_lap");
            assert!((person.mass - kilograms).abs() < 0.03 * kilograms);
            world.seat(&person, motion(&person, 0.0));
        }
        let mut control = RobotControl::new(&model);
        let (mut torque, mut least, mut tilt): (f64, f64, f64) = (0.0, f64::MAX, 0.0);
        let mut drive = |world: &mut World,
                         linear: f64,
                         ticks: usize,
                         mut each: Option<&mut dyn FnMut(&World)>| {
            for _ in 0..ticks {
                let input = ControlInput {
                    base: Some(BaseIntent {
                        linear,
                        angular: 0.0,
                    }),
                    ..ControlInput::default()
                };
                for targets in control.update(&input, &world.snapshot()) {
                    world.apply(&targets);
                    world.step();
                }
                let snapshot = world.snapshot();
                for wheel in model.roles.wheels {
                    torque = torque.max(snapshot.joints[wheel].effort.abs());
                }
                let loads = wheel_loads(world);
                assert_eq!(loads.len(), 4, "a wheel lifts: {loads:?}");
                least = loads.into_iter().fold(least, f64::min);
                let up = snapshot.links[0].pose.rotation * Vector3::z();
                tilt = tilt.max((1.0 - up.z * up.z).max(0.0).sqrt());
                if let Some(each) = each.as_deref_mut() {
                    each(world);
                }
            }
        };
        drive(&mut world, 0.0, 60, None);
        drive(&mut world, 0.5, 240, None);
        let cruising = world.snapshot().links[0];
        assert!(
            (cruising.linear.norm() - 0.5).abs() < 0.01,
            "{}",
            cruising.linear.norm()
        );
        let mut rest = None;
        let mut ticks = 0;
        let mut stop = |world: &World| {
            ticks += 1;
            let slow = world.snapshot().links[0].linear.norm() < 0.01;
            rest = if slow { rest.or(Some(ticks)) } else { None };
        };
        drive(&mut world, 0.0, 60, Some(&mut stop));
        let way = (world.snapshot().links[0].pose.translation.vector
            - cruising.pose.translation.vector)
            .norm();
        let rest = f64::from(rest.expect("it stops")) / 60.0;
        println!(
            "{kilograms:>5} kg: at rest after {rest:.2} s and {way:.3} m, torque at most {torque:.1} N·m, \
             least wheel load {least:.0} N, tilt at most {:.2} degrees",
            tilt.asin().to_degrees()
        );
        assert!(rest <= 0.7, "{body}: {rest} s");
        assert!(torque < 0.98 * most, "{body}: {torque} N·m");
        assert!(least > 20.0, "{body}: {least} N");
    }
}

/// A chair with a heavy person is at rest after any stop: the solver's warm start must
/// not let load and lateral friction of its wheels sustain each other.
#[test]
fn a_heavy_chair_stays_where_it_stopped() {
    use crate::robot::control::{BaseIntent, ControlInput, RobotControl};
    let model = model();
    let person = person("man_p95", "hands_on_armrests");
    // With all of the last tick's impulses the first two creep by 2 mm.
    for (linear, angular) in [(-0.2, 0.3), (0.05, -0.3), (0.2, 0.6)] {
        let (mut world, ..) = robot_alone();
        world.seat(&person, motion(&person, 1.0));
        let mut control = RobotControl::new(&model);
        let mut drive = |world: &mut World, linear: f64, angular: f64, ticks: usize| {
            for _ in 0..ticks {
                let input = ControlInput {
                    base: Some(BaseIntent { linear, angular }),
                    ..ControlInput::default()
                };
                for targets in control.update(&input, &world.snapshot()) {
                    world.apply(&targets);
                    world.step();
                }
            }
        };
        drive(&mut world, linear, angular, 150);
        drive(&mut world, 0.0, 0.0, 120);
        let stopped = world.snapshot().links[0];
        let mut turning: f64 = 0.0;
        for _ in 0..30 {
            drive(&mut world, 0.0, 0.0, 6);
            turning = turning.max(world.snapshot().links[0].angular.norm());
        }
        let moved = stopped.pose.inverse() * world.snapshot().links[0].pose;
        let (far, turn) = (moved.translation.vector.norm(), moved.rotation.angle());
        let result = format!(
            "{linear} m/s, {angular} rad/s: then {far} m, {turn} rad in 3 s, at most {turning} rad/s"
        );
        assert!(far < 5e-4 && turn < 1e-3 && turning < 8e-3, "{result}");
    }
}

/// A bar on thighs and hands presses there with its weight, and nowhere else.
#[test]
fn an_object_in_the_lap_presses_with_its_weight() {
    let model = model();
    let person = person("woman_p50", "hands_on_thighs");
    let [a, b] = person
        .capsules
        .iter()
        .find(|c| c.name == "left_thigh")
        .map(|c| person.ends(c, &HeadPose::default()))
        .unwrap();
    // A bar across both thighs.
    let middle = nalgebra::center(&a, &b);
    let bar = object(
        "bar",
        pose_at(middle.x, 0.0, middle.z + 0.14),
        0.5,
        [0.02, 0.16, 0.01],
        Shape::Cuboid {
            half: [0.02, 0.16, 0.01],
        },
    );
    let (scene, placements) = scene(vec![floor()], vec![bar]);
    let home = model.settings.home;
    let mut world =
        World::new(&model, &scene, &placements, &Isometry3::identity(), &home).expect("a world");
    world.seat(&person, motion(&person, 0.0));
    seconds(&mut world, 3.0, |_, _| {});
    let snapshot = world.snapshot();
    let state = snapshot.person.expect("a person");
    let height = snapshot.objects[0].pose.translation.z;
    assert!(height > 0.6, "it fell to {height} m");
    let on_person = snapshot.contacts.iter();
    let on_person = on_person.filter(|c| matches!(c.second, BodyRef::Person(_)));
    let sum: Vector3<f64> = on_person.map(|c| c.force).sum();
    let weight: Vector3<f64> = Vector3::z() * (-0.5 * 9.81);
    assert!((sum - weight).norm() < 0.05, "{sum} N");
    // Friction between the supports cancels in the vectors and not in the parts.
    let parts: f64 = state.forces.iter().sum();
    let share = parts / weight.norm();
    assert!((0.99..1.2).contains(&share), "{parts} N");
    assert_eq!(
        (state.forces[BodyPart::Face.index()], state.robot_force),
        (0.0, 0.0)
    );
    let bar = |touch: &Touch| touch.partner == BodyRef::Object(0);
    assert!(!state.touches.is_empty() && state.touches.iter().all(bar));
    let touched: f64 = state.touches.iter().map(|touch| touch.force).sum();
    assert!((touched / parts - 1.0).abs() < 0.1, "{:?}", state.touches);
    for touch in &state.touches {
        assert!((touch.weight - 0.5 * 9.81).abs() < 1e-3, "{touch:?}");
    }
}

/// The chair rolls against a shelf that only the shins reach.
#[test]
fn a_shin_pressed_against_furniture_is_recorded_with_part_and_partner() {
    use crate::robot::control::{BaseIntent, ControlInput, RobotControl};
    let model = model();
    let person = person("man_p95", "hands_on_armrests");
    let ends = |name: &str| {
        let capsule = person.capsules.iter().find(|c| c.name == name);
        capsule.map(|c| (person.ends(c, &HeadPose::default()), c.radius))
    };
    let ([top, bottom], radius) = ends("left_shank").expect("a shank");
    // A board at two thirds of the shin's height, 0.05 m in front of it.
    let [top, bottom] = if top.z > bottom.z {
        [top, bottom]
    } else {
        [bottom, top]
    };
    let touched = bottom + (top - bottom) * 0.67;
    let half = [0.1, 0.5, 0.01];
    let place = pose_at(touched.x + radius + 0.05 + half[0], 0.0, touched.z);
    let board = body("board", place, 0.6, Shape::Cuboid { half });
    let (scene, placements) = scene(vec![floor(), board], Vec::new());
    let home = model.settings.home;
    let mut world =
        World::new(&model, &scene, &placements, &Isometry3::identity(), &home).expect("a world");
    world.seat(&person, motion(&person, 0.0));
    let mut control = RobotControl::new(&model);
    let mut greatest: f64 = 0.0;
    for _ in 0..90 {
        let input = ControlInput {
            base: Some(BaseIntent {
                linear: 0.2,
                angular: 0.0,
            }),
            ..ControlInput::default()
        };
        for targets in control.update(&input, &world.snapshot()) {
            world.apply(&targets);
            world.step();
        }
        let state = world.snapshot().person.expect("a person");
        for touch in &state.touches {
            let expected = (BodyPart::Legs, BodyRef::Furniture(1));
            assert_eq!((touch.part, touch.partner), expected);
            greatest = greatest.max(touch.force);
            assert!(state.forces[BodyPart::Legs.index()] >= touch.force - 1e-9);
        }
    }
    assert!(greatest > 20.0, "{greatest} N");
}

/// An object released over the thighs rests there and stays.
#[test]
fn an_object_released_over_the_lap_comes_to_rest() {
    let model = model();
    let half = [0.085, 0.021, 0.011];
    let mut restless = Vec::new();
    for body in [
        "woman_p5",
        "woman_heavy",
        "woman_80",
        "man_p50",
        "man_p95",
        "girl_12",
    ] {
        let person = person(body, "hands_on_armrests");
        let lap = person.lap.at;
        let mut bar = object(
            "bar",
            pose_at(lap.x, 0.0, lap.z + 0.02 + half[2]),
            0.11,
            half,
            Shape::Cuboid { half },
        );
        bar.friction = 0.6;
        bar.pose.rotation =
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2);
        let (scene, placements) = scene(vec![floor()], vec![bar]);
        let home = model.settings.home;
        let mut world = World::new(&model, &scene, &placements, &Isometry3::identity(), &home)
            .expect("a world");
        world.seat(&person, motion(&person, 0.0));
        let mut fastest = [0.0_f64; 2];
        seconds(&mut world, 4.0, |world, time| {
            let snapshot = world.snapshot();
            let state = &snapshot.objects[0];
            if time > 2.0 {
                fastest[0] = fastest[0].max(state.linear.norm());
                fastest[1] = fastest[1].max(state.angular.norm());
            }
        });
        let height = world.snapshot().objects[0].pose.translation.z;
        println!("{body}: {fastest:?} height {height} lap {}", lap.z);
        if fastest[0] > 0.01 || fastest[1] > 0.1 || height < lap.z - 0.1 {
            restless.push(format!("{body}: {fastest:?}, at {height} m"));
        }
    }
    assert!(restless.is_empty(), "{restless:#?}");
}

/// The reported pose of the head is that of its shapes, in every tick, and matches the
/// motion at the end of a control tick.
#[test]
fn the_reported_head_pose_is_that_of_its_shapes() {
    let (mut world, ..) = robot_alone();
    let person = person("woman_p50", "hands_in_lap");
    let motion = motion(&person, 1.0);
    world.seat(&person, motion);
    let head = person.capsules.iter().position(|c| c.name == "head");
    let head = head.expect("a head");
    let tag = super::super::contact::tag(BodyRef::Person(head));
    let mut poses = std::collections::BTreeSet::new();
    for tick in 1..=480 {
        world.step();
        let snapshot = world.snapshot();
        let head_pose = snapshot.person.expect("a person").head;
        if tick % 4 == 0 {
            assert_eq!(head_pose, motion.head_pose(tick));
        }
        poses.insert([head_pose.yaw, head_pose.pitch, head_pose.roll].map(f64::to_bits));
        let mut colliders = world.physics.colliders.iter();
        let (_, collider) = colliders
            .find(|(_, c)| c.user_data == tag)
            .expect("a shape");
        let at = super::super::convert::from_pose(collider.position()).translation;
        let [a, b] = person.ends(&person.capsules[head], &head_pose);
        let expected = snapshot.links[0].pose * nalgebra::center(&a, &b);
        let off = (at.vector - expected.coords).norm();
        assert!(off < 1e-4, "tick {tick}: {off} m");
    }
    assert!((50..=121).contains(&poses.len()), "{} poses", poses.len());
}

/// A head that moves under a load gives the same bits in a second run, and after a
/// restore in the middle.
#[test]
fn a_run_with_a_person_is_reproducible_also_from_the_middle() {
    let make = |body: &str| {
        let (mut world, targets, _) = robot_alone();
        let person = person(body, "hands_in_lap");
        world.seat(&person, motion(&person, 1.0));
        (world, targets.arm_position)
    };
    let run = |world: &mut World, home: [f64; 6], first: u64, last: u64| {
        for tick in first..last {
            // Towards the chest and the face, until contact.
            let t = tick as f64 / 240.0;
            let mut targets = hold(home);
            targets.arm_position[0] += 0.6 * t;
            targets.arm_velocity[0] = 0.6;
            world.apply(&targets);
            world.step();
        }
        world.hash()
    };
    let (mut first, home) = make("man_p50");
    let end = run(&mut first, home, 0, 720);
    let (mut second, _) = make("man_p50");
    let (mut third, _) = make("man_p50");
    let mut saved = Vec::new();
    // Between control ticks and in the middle of one.
    for (from, middle) in [(0, 200), (200, 201), (201, 363), (363, 554), (554, 600)] {
        run(&mut second, home, from, middle);
        saved = second.save();
        let hash = second.hash();
        third.restore(&saved).expect("a state of this world");
        assert_eq!(third.hash(), hash, "at tick {middle}");
        assert_eq!(third.snapshot().person, second.snapshot().person);
        assert_eq!(
            run(&mut third, home, middle, 720),
            end,
            "from tick {middle}"
        );
    }
    assert_eq!(run(&mut second, home, 600, 720), end);
    // Another person, or none, is another world.
    let (mut other, _) = make("woman_p5");
    assert!(other.restore(&saved).is_err());
    let (mut empty, ..) = robot_alone();
    assert!(empty.restore(&saved).is_err());
}
