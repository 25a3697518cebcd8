//! Errors and damaged input do not harm the simulation.

use std::ops::Range;
use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Translation3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::people::PersonSetting;
use crate::robot::control::{ArmIntent, BaseIntent};
use crate::scene::Placement;
use crate::tasks::Failure;

fn assets() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets")
}

pub(super) fn scenario(task: &str) -> Scenario {
    Scenario {
        task: task.to_owned(),
        seed: 1,
        cameras: Vec::new(),
        ..Scenario::default()
    }
}

pub(super) fn simulation(scenario: Scenario) -> Simulation {
    Simulation::new(&assets(), scenario).expect("a simulation")
}

/// The chair at a position in `house`, metres, with the scene's orientation.
fn started(x: f64, y: f64, z: f64) -> Scenario {
    Scenario {
        start: Some(Isometry3::from_parts(
            Translation3::new(x, y, z),
            nalgebra::UnitQuaternion::identity(),
        )),
        ..scenario("pick_mustard")
    }
}

/// A start inside a piece of furniture.
fn started_in(furniture: &str) -> Scenario {
    let sim = simulation(scenario("pick_mustard"));
    let body = sim.scene().furniture_named(furniture).expect("furniture");
    let at = sim.scene().furniture[body].pose.translation.vector;
    started(at.x, at.y, 0.0)
}

#[test]
fn overlapping_placements_are_rejected_and_sampled_ones_are_not() {
    let drawn = simulation(scenario("pick_mustard")).scenario().clone();
    // As given, and with one object moved to a free place.
    let mut apart = drawn.clone();
    assert!(Simulation::new(&assets(), apart.clone()).is_ok());
    apart.objects[0].1.pose.translation.z += 1.0;
    assert!(Simulation::new(&assets(), apart).is_ok());
    let mut into = drawn.clone();
    let place = |name: &str| drawn.objects.iter().position(|(n, _)| n == name).unwrap();
    let (mustard, soup) = (place("mustard"), place("tomato_soup"));
    into.objects[mustard].1.pose = drawn.objects[soup].1.pose;
    let Err(refused) = Simulation::new(&assets(), into) else {
        panic!("the mustard overlaps the soup");
    };
    assert!(matches!(refused, SimError::Overlap { .. }), "{refused}");
    let message = refused.to_string();
    assert!(
        message.contains("\"mustard\"") && message.contains("\"tomato_soup\""),
        "{message}"
    );
}

#[test]
fn a_panic_in_a_step_breaks_only_the_simulation() {
    let mut sim = simulation(scenario("pick_mustard"));
    sim.step(&ControlInput::default());
    let last = Arc::clone(sim.snapshot());
    let step = sim.step_telling(&ControlInput::default(), |_, _| {
        panic!("an index of 7 of 3")
    });
    assert!(step.imu.is_empty() && step.frames.is_empty());
    let words = sim.broken().expect("it is broken");
    assert!(words.contains("an index of 7 of 3"), "{words}");
    // It keeps its state, reports the panic, and runs no further step.
    sim.step(&ControlInput::default());
    assert!(Arc::ptr_eq(sim.snapshot(), &last));
    assert_eq!(sim.evaluation().failure, Some(Failure::Physics));
    assert!(sim.evaluation().done && !sim.evaluation().success);
    assert!(sim.save().is_err() && sim.hash_due().is_none());
}

#[test]
fn a_chair_in_a_table_breaks_the_physics_with_words() {
    // A reset would reject this start; a playback accepts recorded states.
    let scenario = started_in("kitchen_table");
    let mut sim = Simulation::for_playback(&assets(), scenario, &|| false).expect("a playback");
    assert_eq!(sim.broken(), None);
    let good = Arc::clone(sim.snapshot());
    let mut ticks = 0;
    while sim.broken().is_none() && ticks < 60 {
        sim.step(&ControlInput::default());
        ticks += 1;
    }
    let words = sim.broken().expect("3.5 MN at the first tick");
    assert!(words.contains("press with"), "{words}");
    assert!(
        matches!(sim.fault(), Some(Fault::Contact { .. })),
        "{words}"
    );
    // The broken state is never visible.
    let shown = sim.snapshot();
    assert!(ticks > 1 || shown.tick == good.tick);
    let hardest = shown.contacts.iter().map(|c| c.force.norm());
    assert!(hardest.fold(0.0, f64::max) < crate::world::health::CONTACT_FORCE);
}

#[test]
fn impossible_poses_are_rejected_before_simulation() {
    let far = [
        started(1e30, 0.0, 0.0),
        started(1e39, 0.0, 0.0),
        started(-1e12, 3.0, 0.0),
        started(-7.0, 3.0, -5.0),
        started(-7.0, 3.0, 3.0),
        started(-7.0, 30.0, 0.0),
        started(f64::NAN, 3.0, 0.0),
    ];
    for scenario in far {
        let start = scenario.start;
        match Simulation::new(&assets(), scenario) {
            Ok(_) => panic!("{start:?} was accepted"),
            Err(e) => assert!(e.to_string().contains("cannot be simulated"), "{e}"),
        }
    }
    let drawn = simulation(scenario("pick_mustard")).scenario().clone();
    for x in [1e39, 1e300, f64::NAN] {
        let mut scenario = drawn.clone();
        let (_, placement): &mut (String, Placement) = &mut scenario.objects[0];
        placement.pose.translation.vector = Vector3::new(x, 0.0, 0.5);
        let name = scenario.objects[0].0.clone();
        match Simulation::new(&assets(), scenario) {
            Ok(_) => panic!("an object at {x} m was accepted"),
            Err(e) => assert!(e.to_string().contains(&name), "{e}"),
        }
    }
}

#[test]
fn a_joint_that_is_too_fast_is_noted_and_one_far_too_fast_breaks_the_state() {
    let model = RobotModel::load(&assets(), "wheelarm").expect("the robot");
    let joint = model.joints.iter().position(|j| j.name == "joint_2");
    let joint = joint.expect("an arm joint");
    let limit = model.joints[joint].limits.velocity;
    let spun = |speed: f64| {
        let mut sim = simulation(scenario("pick_mustard"));
        sim.step(&ControlInput::default());
        sim.world.spin(joint, speed * limit);
        let before = sim.snapshot().tick;
        sim.step(&ControlInput::default());
        (sim, before)
    };
    let (sim, _) = spun(0.5);
    assert!(sim.broken().is_none() && sim.snapshot().anomalies.is_empty());
    let (sim, before) = spun(40.0);
    assert!(
        matches!(sim.fault(), Some(Fault::JointSpeed { joint: j, .. }) if *j == joint),
        "{:?}",
        sim.fault()
    );
    assert_eq!(
        sim.snapshot().tick,
        before,
        "the broken state is not visible"
    );
    assert!(sim.broken().is_some_and(|words| words.contains("joint_2")));
}

/// Damages content in one of several ways, within `within`.
fn damaged(content: &[u8], within: Range<usize>, rng: &mut ChaCha8Rng, way: usize) -> Vec<u8> {
    let mut bytes = content.to_vec();
    let at = rng.random_range(within).min(bytes.len() - 24);
    match way % 8 {
        0 => bytes[at] ^= 1 << rng.random_range(0..8u32),
        1 => bytes[at..at + 4].copy_from_slice(&f32::NAN.to_le_bytes()),
        2 => bytes[at..at + 4].copy_from_slice(&1e38f32.to_le_bytes()),
        3 => bytes[at..at + 8].copy_from_slice(&f64::NAN.to_le_bytes()),
        4 => rng.fill(&mut bytes[at..at + 20]),
        5 => bytes[at..at + 4].fill(0xff),
        6 => bytes.insert(at, rng.random()),
        _ => bytes.truncate(at),
    }
    bytes
}

/// Restores `count` damaged states of a moved simulation, each with a valid checksum.
/// Every one is rejected without change, or simulated without a panic. Returns how many
/// were rejected.
fn survives(
    sim: &mut Simulation,
    count: usize,
    rng: &mut ChaCha8Rng,
    place: impl Fn(usize, &[u8]) -> Range<usize>,
) -> usize {
    let good = sim.save().expect("a good state");
    let content = envelope::open(&good).expect("a whole envelope").to_vec();
    let (mut refused, mut broke) = (0, 0);
    for n in 0..count {
        let bytes = envelope::seal(&damaged(&content, place(n, &content), rng, n));
        let before = (sim.world.hash(), Arc::clone(sim.snapshot()));
        match sim.restore(&bytes) {
            Err(e) => {
                refused += 1;
                assert!(!e.to_string().is_empty());
                assert_eq!(sim.world.hash(), before.0, "mutation {n}: {e}");
                assert!(Arc::ptr_eq(sim.snapshot(), &before.1));
                assert_eq!(sim.broken(), None, "mutation {n}: {e}");
            }
            Ok(()) => {
                for _ in 0..8 {
                    sim.step(&ControlInput::default());
                }
                // It may be a state that soon breaks; that is reported.
                let fault = sim.fault();
                let panicked = matches!(fault, Some(Fault::Panic(_)));
                assert!(!panicked, "mutation {n}: {fault:?}");
                if fault.is_some() {
                    broke += 1;
                    *sim = simulation(sim.scenario().clone());
                }
                sim.restore(&good).expect("the good state");
            }
        }
    }
    println!("{refused} of {count} rejected, {broke} accepted and broken within 8 control ticks");
    refused
}

#[test]
fn a_good_state_is_restored_after_the_engine_disabled_a_body() {
    // A body that the engine disabled must not prevent restoring a good state.
    let mut sim = simulation(scenario("pick_mustard"));
    sim.step(&ControlInput::default());
    let good = sim.save().expect("a good state");
    sim.world.put_aside(3);
    sim.step(&ControlInput::default());
    assert!(
        matches!(sim.fault(), Some(Fault::NotFinite(BodyRef::Object(3)))),
        "{:?}",
        sim.fault()
    );
    sim.restore(&good).expect("the good state");
    assert_eq!((sim.fault(), sim.world.fault()), (None, None));
}

#[test]
fn damaged_states_of_a_soft_object_are_refused_or_harmless() {
    let mut sim = simulation(scenario("place_teddy_bear"));
    for _ in 0..30 {
        sim.step(&ControlInput::default());
    }
    let soft = sim.world.saved_soft();
    let mut rng = ChaCha8Rng::seed_from_u64(13);
    let find = |content: &[u8]| {
        let at = content.windows(soft.len()).position(|w| w == soft);
        let at = at.expect("the soft object in the state");
        at..at + soft.len()
    };
    println!("{} bytes of soft state", soft.len());
    // Three of four in the deformable, one anywhere.
    let refused = survives(&mut sim, 120, &mut rng, |n, content| match n / 8 % 4 {
        0 => 0..content.len(),
        _ => find(content),
    });
    assert!((10..120).contains(&refused), "both happen");
}

#[test]
fn damaged_states_are_refused_or_harmless() {
    let mut sim = simulation(scenario("pick_mustard"));
    let drive = ControlInput {
        base: Some(BaseIntent {
            linear: 0.3,
            angular: 0.2,
        }),
        ..ControlInput::default()
    };
    for _ in 0..30 {
        sim.step(&drive);
    }
    let mut rng = ChaCha8Rng::seed_from_u64(12);
    survives(&mut sim, 240, &mut rng, |_, content| 0..content.len());
    let good = sim.save().expect("a good state");
    // With the invalid checksum every state is rejected.
    for n in 0..40 {
        let mut bytes = damaged(&good, 0..good.len(), &mut rng, n);
        if bytes == good {
            bytes[0] ^= 1;
        }
        let e = sim.restore(&bytes).expect_err("its checksum is wrong");
        assert!(matches!(e, StateError::Format(_)), "{e}");
    }
    sim.restore(&good).expect("the good state is one still");
}

#[test]
fn a_restored_state_continues_with_the_same_bits() {
    for task in ["pick_mustard", "place_teddy_bear"] {
        let mut first = simulation(scenario(task));
        for _ in 0..5 {
            first.step(&ControlInput::default());
        }
        let saved = first.save().expect("a good state");
        let mut second = simulation(scenario(task));
        second
            .restore(&saved)
            .expect("a state of the same scenario");
        assert_eq!(second.save().expect("a good state"), saved);
        for _ in 0..10 {
            first.step(&ControlInput::default());
            second.step(&ControlInput::default());
        }
        assert_eq!(first.world.hash(), second.world.hash());
    }
}

/// In every posture the arm touches neither itself nor the chair, and reaches home
/// without contact, with the gripper open or closed.
#[test]
fn every_posture_is_clear_and_reaches_home() {
    let model = RobotModel::load(&assets(), "wheelarm").expect("a robot");
    let (postures, home) = (&model.settings.postures, model.settings.home);
    assert!(postures.len() >= 20, "{}", postures.len());
    for (i, posture) in postures.iter().enumerate() {
        let knuckle = [0.0, model.settings.gripper.closed][i % 2];
        let mut sim = simulation(Scenario {
            task: String::new(),
            arm: Some(*posture),
            knuckle: Some(knuckle),
            cameras: Vec::new(),
            ..Scenario::default()
        });
        let opening = sim.opening();
        assert_eq!(opening < 0.01, knuckle > 0.0, "{opening} m");
        for tick in 0..7 * 60 {
            let arm = (tick == 30).then_some(ArmIntent::Joints(home));
            sim.step(&ControlInput {
                arm,
                ..ControlInput::default()
            });
            if tick < 30 {
                let moved = sim.arm_positions().into_iter().zip(posture);
                let moved = moved.map(|(is, was)| (is - was).abs());
                let moved = moved.fold((sim.opening() - opening).abs() * 10.0, f64::max);
                assert!(moved < 0.02, "posture {i} moves by {moved} at {tick}");
            }
            let touching = sim.snapshot().contacts.iter().find(|contact| {
                let pair = (contact.first, contact.second);
                matches!(pair, (BodyRef::Link(_), BodyRef::Link(_)))
            });
            assert!(touching.is_none(), "posture {i} at {tick}: {touching:?}");
        }
        let left = sim.arm_positions().into_iter().zip(home);
        let left = left.map(|(is, home)| (is - home).abs());
        assert!(
            left.fold(0.0, f64::max) < 0.02,
            "posture {i} does not reach home"
        );
    }
}

/// A generated sentence identifies the target uniquely, and does not change other
/// sampled values.
#[test]
fn a_generated_instruction_does_not_change_the_task() {
    use wheelarm_proto::settings::LanguageSplit;

    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets");
    for (task, verb) in [
        ("select_coke", "lift"),
        ("place_knife", "put"),
        ("open_drawer", "open"),
    ] {
        let plain = Scenario {
            task: task.into(),
            seed: 4,
            ..Scenario::default()
        };
        let language = crate::tasks::Language {
            seed: 9,
            split: LanguageSplit::Train,
            typo_share: 0.0,
            politeness_share: 0.5,
            ambiguous_share: 0.0,
            template: String::new(),
            question: String::new(),
        };
        let generated = Scenario {
            language: Some(language),
            ..plain.clone()
        };
        let set_up = |scenario| Simulation::new(&assets, scenario).expect("a simulation");
        let [plain, generated] = [plain, generated].map(set_up);
        let (one, other) = (plain.scenario(), generated.scenario());
        assert_ne!(one.instruction, other.instruction);
        let language = other.language.as_ref().expect("language settings");
        assert!(language.template.starts_with(verb), "{language:?}");
        assert!(language.question.is_empty(), "{language:?}");
        assert_eq!(
            (&one.objects, &one.target, one.start),
            (&other.objects, &other.target, other.start)
        );
        assert_eq!(plain.snapshot(), generated.snapshot());
        let own = plain.task().expect("a task").instructions.clone();
        assert!(!own.contains(&other.instruction));
    }
}

/// A care task adds a person, and the guard slows motion near the face.
#[test]
fn care_tasks_have_a_person_and_the_guard_on() {
    let mut bodies = Vec::new();
    for seed in 0..6 {
        for task in [
            "take_floor_crackers",
            "throw_meat_can",
            "serve_drink",
            "serve_remote",
            "serve_spoonful",
        ] {
            let sim = simulation(Scenario {
                seed,
                ..scenario(task)
            });
            let person = sim.scenario().person.as_ref().expect("a person");
            assert!(person.guard && sim.person().is_some(), "{task}");
            let drawn = person.drawn.as_ref().expect("a sampled person");
            assert_eq!(drawn.posture, "hands_on_armrests");
            bodies.push(drawn.body.clone());
        }
    }
    bodies.sort_unstable();
    bodies.dedup();
    assert!(bodies.len() > 2, "{bodies:?}");
    let other = simulation(scenario("pick_mustard"));
    assert!(other.scenario().person.is_none() && other.person().is_none());
    // A named person is accepted likewise.
    let requested = |text: &str| {
        let person = PersonSetting {
            body: "woman_p5".to_owned(),
            posture: text.to_owned(),
            ..PersonSetting::default()
        };
        let sim = simulation(Scenario {
            person: Some(person),
            ..scenario("serve_spoonful")
        });
        sim.scenario().person.clone().expect("a person")
    };
    let named = requested("");
    assert!(named.guard && named.mouth_open && named.motion == Some(0.3));
    let drawn = named.drawn.clone().expect("a sampled person");
    assert_eq!(
        (drawn.body.as_str(), drawn.posture.as_str()),
        ("woman_p5", "hands_on_armrests")
    );
    assert_eq!(requested("leaning_left").posture, "leaning_left");
    // The sampled values stay as recorded, so that old episodes replay.
    let person = PersonSetting {
        guard: false,
        ..named
    };
    let again = simulation(Scenario {
        person: Some(person.clone()),
        ..scenario("serve_spoonful")
    });
    assert_eq!(again.scenario().person, Some(person));
}

/// Chair and arm are clear of the person at every start, and remain so without
/// commands.
#[test]
fn no_start_anywhere_touches_the_person() {
    let tasks = [
        "pick_meat_can",
        "pick_bowl",
        "pick_grey_cup",
        "pick_mustard",
    ];
    let mut folded = 0;
    for seed in 0..24 {
        let task = tasks[seed as usize % tasks.len()];
        let mut sim = simulation(Scenario {
            seed,
            starts: Starts::Anywhere,
            person: Some(PersonSetting::default()),
            ..scenario(task)
        });
        let at = format!("{task} seed {seed}");
        let home = sim.model().settings.home;
        folded += usize::from(sim.scenario().arm != Some(home));
        for _ in 0..12 {
            sim.step(&ControlInput::default());
            let person = sim.snapshot().person.clone().expect("a person");
            assert_eq!(person.robot_force, 0.0, "{at}");
            assert!(person.forces.iter().all(|f| *f == 0.0), "{at}: {person:?}");
        }
        assert_eq!(sim.fault(), None, "{at}");
    }
    assert!(folded > 6, "the arm starts folded {folded} times of 24");
}

/// Starts of the seeds, which the same free-space code accepts, are on the free floor of the
/// map, with and without a person.
#[test]
fn the_map_has_the_floor_of_every_start_and_what_stands_on_it() {
    let empty = simulation(scenario("pick_mustard"));
    let map = empty.map_source(true).map();
    let seated = simulation(Scenario {
        person: Some(PersonSetting::default()),
        ..scenario("pick_mustard")
    });
    let occupied = seated.map_source(true).map();
    let free = |map: &crate::tasks::HomeMap| map.free.marked().to_vec();
    let (with, without) = (free(&occupied), free(&map));
    assert_eq!(occupied.free.grid(), map.free.grid());
    let more = with
        .iter()
        .zip(&without)
        .filter(|(with, without)| **with && !**without);
    assert_eq!(more.count(), 0, "a person needs floor and makes none");
    let count = |cells: &[bool]| cells.iter().filter(|cell| **cell).count();
    assert!(count(&with) * 2 > count(&without));
    for seed in 0..12 {
        let sim = simulation(Scenario {
            seed,
            starts: Starts::Anywhere,
            ..scenario("pick_bowl")
        });
        let at = sim.snapshot().links[0].pose.translation.vector;
        assert!(map.free.contains([at.x, at.y]), "seed {seed}: {at:?}");
        assert!(!map.occupied.contains([at.x, at.y]), "seed {seed}: {at:?}");
    }
    for body in &empty.scene().furniture[1..] {
        let boxes = crate::tasks::collision_boxes(body);
        for solid in boxes.filter(|solid| {
            let [low, high] = solid.heights();
            low < 0.3 && high > 0.1
        }) {
            let at = solid.rectangle().centre;
            assert!(map.occupied.contains(at), "{} at {at:?}", body.name);
            assert!(!map.free.contains(at), "{} at {at:?}", body.name);
        }
    }
    assert!(map.rooms.is_empty() && map.doors.is_empty());
}

#[test]
fn a_start_inside_furniture_or_the_person_is_rejected_with_name_and_depth() {
    let refused = |scenario: Scenario| match Simulation::new(&assets(), scenario.clone()) {
        Err(error @ SimError::RobotOverlap { .. }) => {
            let playback = Simulation::for_playback(&assets(), scenario, &|| false);
            assert!(playback.is_ok(), "recorded states must stay viewable");
            error.to_string()
        }
        Err(other) => panic!("another error: {other}"),
        Ok(_) => panic!("accepted"),
    };
    let home = crate::scene::Scene::load(&assets(), "home").expect("the home");
    let table = home.furniture_named("coffee_table").expect("a table");
    let at = home.furniture[table].pose.translation;
    let words = refused(started(at.x, at.y, 0.0));
    assert!(
        words.contains("coffee_table") && words.contains(" mm inside"),
        "{words}"
    );
    // The arm is folded back into the person.
    let words = refused(Scenario {
        arm: Some([3.0, -0.3, 2.2, 0.0, -0.4, -1.57]),
        person: Some(PersonSetting {
            body: "man_p95".to_owned(),
            ..PersonSetting::default()
        }),
        ..scenario("pick_mustard")
    });
    assert!(words.contains("of the person"), "{words}");
}

/// Prints how much floor and start distance a seated person costs, and how many sampled
/// starts are rejected.
#[test]
#[ignore = "takes minutes: make test-people"]
fn starts_keep_the_floor_of_everybody() {
    let tasks = crate::tasks::list(
        &assets(),
        &RobotModel::load(&assets(), "wheelarm")
            .expect("a robot")
            .settings
            .gripper
            .corridor,
    )
    .expect("tasks");
    let (mut area, mut distance, mut starts, mut rejected) = ([0, 0], [0.0, 0.0], 0, 0);
    for task in tasks.iter().filter(|task| !task.is_care()) {
        for seed in 0..20 {
            let of = |person: Option<PersonSetting>| {
                simulation(Scenario {
                    seed,
                    starts: Starts::Anywhere,
                    person,
                    ..scenario(&task.name)
                })
            };
            let sims = [of(None), of(Some(PersonSetting::default()))];
            for (i, sim) in sims.iter().enumerate() {
                let start = sim.scenario().start.expect("a start").translation.vector;
                let target = sim.scenario().target.as_str();
                let known = sim.scene().objects.iter().position(|o| o.name == target);
                let at = known.map_or_else(
                    || {
                        sim.scene().furniture
                            [sim.scene().furniture_named(target).expect("furniture")]
                        .pose
                        .translation
                        .vector
                    },
                    |object| sim.snapshot().objects[object].pose.translation.vector,
                );
                distance[i] += (at - start).xy().norm();
                if seed == 0 {
                    let model = sim.model();
                    let floor = match sim.person() {
                        None => Floor::new(model, sim.scene()),
                        Some(person) => Floor::occupied(model, sim.scene(), person, |_| true),
                    };
                    let named = sim.scenario().variant.clone().expect("a variant");
                    let variant = task
                        .variants()
                        .find(|v| v.name == named)
                        .expect("a variant");
                    area[i] += floor
                        .start_poses(&task.area, variant, sim.scene(), 0.3)
                        .len();
                }
            }
            starts += 1;
            rejected += sims[1].scenario().rejected_starts;
        }
    }
    let floor = area[1] as f64 / area[0] as f64;
    let far = distance[1] / distance[0];
    let share = f64::from(rejected) / f64::from(rejected + starts);
    println!(
        "floor {area:?}: {floor:.3}; distance {far:.3}; {rejected} rejected of {}: {share:.3}",
        rejected + starts
    );
    assert!(
        floor >= 0.9 && far >= 0.9 && share <= 0.3,
        "{floor} {far} {share}"
    );
}
