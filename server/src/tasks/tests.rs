//! Draws over many seeds, and judgement of synthetic snapshots.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use wheelarm_proto::PHYSICS_HZ;

use super::*;
use crate::robot::{CorridorSettings, RobotModel};
use crate::scene::tests::{assets, home};
use crate::scene::{Body, Bounds, Scene};
use crate::snapshot::{Anomaly, BodyRef, BodyState, Contact, JointState, Snapshot};

/// The way of the hand of the robot that ships.
pub(super) fn hand() -> CorridorSettings {
    let model = RobotModel::load(&assets(), "wheelarm");
    model
        .unwrap_or_else(|error| panic!("{error}"))
        .settings
        .corridor
}

pub(super) fn task(name: &str) -> TaskSpec {
    TaskSpec::load(&assets(), name, &home(), &hand()).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn every_task_says_what_is_asked_in_several_ways() {
    let tasks = list(&assets(), &hand()).unwrap_or_else(|error| panic!("{error}"));
    assert!(tasks.len() >= 19);
    for task in &tasks {
        assert!(task.instructions.len() >= 5, "{}", task.name);
        assert!(["serve", "organize", "care"].contains(&task.activity.as_str()));
        let turn = match task.area.name.as_str() {
            "coffee_table" | "lounge" => "right",
            "kitchen_table" | "kitchen_bin" | "kitchen_meal" => "left",
            "shelf" | "floor" => "straight",
            "workstation" => "around",
            other => panic!("{} is in {other}", task.name),
        };
        assert!(task.instructions[0].contains(turn), "{}", task.name);
        let reported = task.conditions.iter().filter(|c| !c.required).count();
        assert_eq!(reported, 2, "{}", task.name);
    }
}

/// Every area with its variants, and the home as it is in each of them.
fn variants() -> Vec<(AreaSpec, Variant, Scene)> {
    let mut areas: Vec<AreaSpec> = Vec::new();
    for task in list(&assets(), &hand()).unwrap_or_else(|error| panic!("{error}")) {
        if areas.iter().all(|area| area.name != task.area.name) {
            areas.push(task.area);
        }
    }
    let variants = areas.into_iter().flat_map(|area| {
        let variants = area.variants.clone();
        variants.into_iter().map(move |variant| {
            let mut scene = home();
            scene.keep_optional(&variant.furniture);
            (area.clone(), variant, scene)
        })
    });
    variants.collect()
}

#[test]
fn scenes_of_every_area_count_lie_inside_their_ranges_and_are_apart() {
    for (area, variant, scene) in variants() {
        let mut seen: Vec<(&str, Vec<Vector3<f64>>)> = Vec::new();
        let mut positions = Vec::new();
        for seed in 0..60 {
            let drawn = draw_scene(&area, &variant, &scene, seed, None);
            let at = format!("{} {:?} seed {seed}", area.name, variant.name);
            if seed < 3 {
                let again = draw_scene(&area, &variant, &scene, seed, None);
                assert_eq!(drawn, again, "{at} repeats");
            }
            assert!(drawn.clearance >= 0.0, "{at} does not count");
            let start = drawn.start;
            assert!(area.start.x.contains(start.translation.x));
            assert!(area.start.y.contains(start.translation.y));
            assert!(area.start.yaw.contains(start.rotation.euler_angles().2));
            for place in &variant.places {
                let object = scene.object_named(&place.object).unwrap();
                let Some(placement) = drawn.placements[object] else {
                    assert!(!place.is_certain(), "{at}: no {}", place.object);
                    continue;
                };
                let surface = scene.surface_named(&place.on, None).unwrap();
                let on = surface.edge.inverse() * placement.pose;
                assert!(place.inwards.contains(on.translation.x), "{at}");
                assert!(place.along.contains(on.translation.y), "{at}");
                assert!(place.yaw.contains(on.rotation.euler_angles().2), "{at}");
                assert!(place.mass.is_none_or(|m| m.contains(placement.mass)));
                let friction = placement.friction;
                assert!(place.friction.is_none_or(|f| f.contains(friction)));
                match seen.iter_mut().find(|(name, _)| *name == place.object) {
                    Some((_, places)) => places.push(on.translation.vector),
                    None => seen.push((&place.object, vec![on.translation.vector])),
                }
            }
            for slide in &area.slides {
                let joint = scene.joint_named(&slide.joint).unwrap();
                assert!(slide.friction.contains(drawn.slides[joint].friction));
                assert!(slide.damping.contains(drawn.slides[joint].damping));
                assert!(slide.position.contains(drawn.positions[joint]), "{at}");
                positions.push(drawn.positions[joint]);
            }
            assert_apart(&scene, &drawn, &at);
        }
        for (name, places) in seen {
            let spread = Bounds::of_points(places.into_iter().map(Into::into)).unwrap();
            let wide = area.name != "shelf";
            let enough = spread.size().x > 0.03 && (!wide || spread.size().y > 0.2);
            assert!(enough, "{name}: {spread:?}");
        }
        assert_eq!(positions.is_empty(), area.slides.is_empty());
        positions.sort_by(f64::total_cmp);
        if let [least, .., greatest] = positions[..] {
            assert!(greatest - least > 0.04, "{least} to {greatest} m");
        }
    }
}

/// Where the robot starts changes nothing of what stands there.
#[test]
fn starts_anywhere_are_all_over_the_home_and_leave_the_scene_as_it_is() {
    let model = RobotModel::load(&assets(), "wheelarm").unwrap_or_else(|error| panic!("{error}"));
    for (area, variant, scene) in variants() {
        let floor = Floor::new(&model, &scene);
        let (mut places, mut closed, mut postures) = (Vec::new(), 0, Vec::new());
        for seed in 0..24 {
            let near = draw_scene(&area, &variant, &scene, seed, None);
            let far = draw_scene(&area, &variant, &scene, seed, Some(&floor));
            assert_eq!(near.placements, far.placements);
            assert_eq!((near.arm, near.knuckle), (None, None));
            let at = format!("{} {:?} seed {seed}", area.name, variant.name);
            let arm = far.arm.unwrap_or_else(|| panic!("{at} finds no start"));
            closed += usize::from(far.knuckle.is_some_and(|knuckle| knuckle > 0.0));
            if !postures.contains(&arm) {
                postures.push(arm);
            }
            places.push(far.start.translation.vector.into());
        }
        let spread = Bounds::of_points(places).unwrap().size();
        assert!(
            spread.x > 4.0 && spread.y > 3.0,
            "{}: {spread:?}",
            area.name
        );
        assert!((4..20).contains(&closed), "{}: {closed} closed", area.name);
        assert!(
            postures.len() > 8,
            "{}: {} postures",
            area.name,
            postures.len()
        );
    }
}

/// Whoever asks for something in an area finds the same scene.
#[test]
fn all_tasks_of_an_area_have_the_same_scene_bit_for_bit() {
    let tasks = list(&assets(), &hand()).unwrap_or_else(|error| panic!("{error}"));
    let home = home();
    let model = RobotModel::load(&assets(), "wheelarm").unwrap_or_else(|error| panic!("{error}"));
    let mut pairs = 0;
    for (i, first) in tasks.iter().enumerate() {
        for second in tasks[i + 1..]
            .iter()
            .filter(|t| t.area.name == first.area.name)
        {
            assert_eq!(first.area, second.area);
            for seed in 0..40 {
                let variants = [first, second].map(|task| variant_of(task, seed, None).unwrap());
                let both = [first, second].map(|task| task.variants().count() > 1);
                if variants[0].name != variants[1].name {
                    // Only the bear's own task cannot take the other variant.
                    assert!(!(both[0] && both[1]), "seed {seed}: {}", first.name);
                    continue;
                }
                let mut scene = home.clone();
                scene.keep_optional(&variants[0].furniture);
                // Few starts anywhere, which take longer.
                let floor = (seed < 3).then(|| Floor::new(&model, &scene));
                for floor in [None, floor.as_ref()] {
                    let drawn = [first, second].map(|task| {
                        let variant = variants[0];
                        draw(task, variant, &scene, seed, floor).scene
                    });
                    // Debug text tells every bit of a number.
                    let [a, b] = drawn.map(|scene| format!("{scene:?}"));
                    assert_eq!(a, b, "{} and {} seed {seed}", first.name, second.name);
                }
                pairs += 1;
            }
        }
    }
    assert!(pairs > 600, "{pairs}");
}

/// A nearest centroid on all that a scene draws, trained on half of the seeds,
/// guesses the task of the others no better than by chance. `make test-data`
/// holds more seeds against better classifiers.
#[test]
fn what_a_scene_draws_does_not_tell_the_task() {
    const SEEDS: u64 = 40;
    let tasks = list(&assets(), &hand()).unwrap_or_else(|error| panic!("{error}"));
    for area in ["coffee_table", "kitchen_table"] {
        let of_area = tasks.iter().filter(|t| t.area.name == area);
        let of_area: Vec<_> = of_area.filter(|t| t.variants().count() > 0).collect();
        let of_area: Vec<_> = of_area
            .into_iter()
            .filter(|t| t.variants().any(|v| v.name.is_empty()))
            .collect();
        let mut samples: Vec<(usize, Vec<f64>)> = Vec::new();
        for (label, task) in of_area.iter().enumerate() {
            let variant = &task.area.variants[0];
            let mut scene = home();
            scene.keep_optional(&variant.furniture);
            for i in 0..SEEDS {
                // No two tasks share a seed.
                let drawn = draw(task, variant, &scene, 1000 * label as u64 + i, None).scene;
                let mut row: Vec<f64> = drawn.start.translation.vector.iter().copied().collect();
                for placement in &drawn.placements {
                    let placed = placement.map_or([0.0; 5], |p| {
                        let at = p.pose.translation;
                        let yaw = p.pose.rotation.euler_angles().2;
                        [at.x, at.y, yaw, p.mass, p.friction]
                    });
                    row.extend(placed);
                }
                samples.push((label, row));
            }
        }
        let right = nearest_centroid(&samples, of_area.len());
        let chance = 1.0 / of_area.len() as f64;
        // Four standard errors of a share of this many guesses.
        let count = samples.len() as f64 / 2.0;
        let most = chance + 4.0 * (chance * (1.0 - chance) / count).sqrt();
        assert!(
            right <= most,
            "{area}: {right:.3} right, chance {chance:.3}"
        );
    }
}

/// The share of the odd samples that are nearest to the middle of the even ones
/// of their own label, every number by its own spread.
fn nearest_centroid(samples: &[(usize, Vec<f64>)], labels: usize) -> f64 {
    let width = samples[0].1.len();
    let even = || samples.iter().step_by(2);
    let odd = || samples.iter().skip(1).step_by(2);
    let mean = |rows: &[&Vec<f64>], i: usize| {
        rows.iter().map(|row| row[i]).sum::<f64>() / rows.len().max(1) as f64
    };
    let all: Vec<_> = even().map(|(_, row)| row).collect();
    let spread: Vec<f64> = (0..width)
        .map(|i| {
            let middle = mean(&all, i);
            let squares: f64 = all.iter().map(|row| (row[i] - middle).powi(2)).sum();
            (squares / all.len() as f64).sqrt().max(1e-9)
        })
        .collect();
    let centroids: Vec<Vec<f64>> = (0..labels)
        .map(|label| {
            let own: Vec<_> = even()
                .filter(|(l, _)| *l == label)
                .map(|(_, r)| r)
                .collect();
            (0..width).map(|i| mean(&own, i)).collect()
        })
        .collect();
    let distance = |row: &[f64], centroid: &[f64]| -> f64 {
        let parts = (0..width).map(|i| ((row[i] - centroid[i]) / spread[i]).powi(2));
        parts.sum()
    };
    let right = odd().filter(|(label, row)| {
        let nearest = (0..labels)
            .min_by(|a, b| distance(row, &centroids[*a]).total_cmp(&distance(row, &centroids[*b])));
        nearest == Some(*label)
    });
    right.count() as f64 / odd().count() as f64
}

#[test]
fn the_classifier_finds_what_does_tell() {
    let told = |i: usize| (i / 2 % 3, vec![(i / 2 % 3) as f64, (i % 7) as f64]);
    let samples: Vec<_> = (0..120).map(told).collect();
    assert_eq!(nearest_centroid(&samples, 3), 1.0);
}

#[test]
fn a_variant_comes_by_its_share_and_the_bear_always_has_its_own() {
    let (mug, bear) = (task("pick_blue_mug"), task("place_teddy_bear"));
    let bears = |share: Option<f64>| {
        let seeds = 0..1000;
        let taken = seeds.filter(|seed| variant_of(&mug, *seed, share).unwrap().name == "bear");
        taken.count()
    };
    assert!((160..240).contains(&bears(None)), "{}", bears(None));
    assert_eq!((bears(Some(0.0)), bears(Some(1.0))), (0, 1000));
    for seed in 0..20 {
        assert_eq!(variant_of(&bear, seed, Some(0.0)).unwrap().name, "bear");
    }
}

#[test]
fn the_sentence_counts_the_cans_as_who_faces_the_shelf_sees_them() {
    let (spec, scene) = (task("select_coke"), home());
    for seed in 0..40 {
        let drawn = draw(&spec, &spec.area.variants[0], &scene, seed, None);
        let sentence = &drawn.instruction;
        // Facing south the left is east, where x grows.
        let x = |name: &str| {
            let object = scene.object_named(name).unwrap();
            drawn.scene.placements[object].unwrap().pose.translation.x
        };
        let mut order: Vec<_> = spec.targets.iter().collect();
        order.sort_by(|a, b| x(b).total_cmp(&x(a)));
        if sentence.contains("the right") {
            order.reverse();
        }
        let words = ["first", "second", "third", "fourth"];
        let index = words.iter().position(|w| sentence.contains(w)).unwrap();
        assert_eq!(order[index], &drawn.target, "seed {seed}: {sentence}");
    }
}

/// No object overlaps another or furniture, and each stands on what carries it.
/// Bounds are taken along the first one's axes, then along the other's.
fn assert_apart(scene: &Scene, drawn: &SceneDraw, at: &str) {
    let bodies: Vec<_> = scene
        .objects
        .iter()
        .zip(&drawn.placements)
        .filter_map(|(body, placement)| Some((body, placement.as_ref()?.pose)))
        .collect();
    let overlap = |(a, a_pose): (&Body, Isometry3<f64>), (b, b_pose): (&Body, Isometry3<f64>)| {
        let seen_from = |frame: Isometry3<f64>| {
            let a = a.collision_bounds(&(frame.inverse() * a_pose)).unwrap();
            let b = b.collision_bounds(&(frame.inverse() * b_pose)).unwrap();
            a.overlaps(&b, 1e-6)
        };
        let between = (b_pose.translation.vector - a_pose.translation.vector).xy();
        let line = Isometry3::rotation(Vector3::z() * between.y.atan2(between.x));
        // What is round is apart along the line between the middles.
        let round = |body: &Body| body.grasps.iter().any(|grasp| grasp.symmetric);
        let along = !(round(a) && round(b)) || seen_from(line);
        along && seen_from(a_pose) && seen_from(b_pose)
    };
    for (i, own) in bodies.iter().enumerate() {
        for other in &bodies[i + 1..] {
            let names = (&own.0.name, &other.0.name);
            assert!(!overlap(*own, *other), "{at}: {names:?} overlap");
        }
        let bounds = own.0.collision_bounds(&own.1).unwrap();
        let mut gap = f64::INFINITY;
        for body in &scene.furniture {
            // Part by part: the bounds of a whole table reach down to the floor.
            for part in &body.collision {
                let mut piece = body.clone();
                piece.collision = vec![part.clone()];
                let hit = overlap(*own, (&piece, body.pose));
                assert!(!hit, "{at}: {} in {}", own.0.name, body.name);
                let other = piece.collision_bounds(&body.pose).unwrap();
                let column = Bounds {
                    min: [bounds.min.x, bounds.min.y, other.min.z].into(),
                    max: bounds.max,
                };
                if column.overlaps(&other, 1e-6) {
                    gap = gap.min((bounds.min.z - other.max.z).abs());
                }
            }
        }
        assert!(gap <= 0.0005, "{at}: {} hangs {gap} m high", own.0.name);
    }
}

/// A world of the home's objects at their places, robot far away and at rest.
pub(super) struct Stage {
    pub(super) scene: Scene,
    pub(super) model: RobotModel,
    pub(super) evaluator: Evaluator,
    pub(super) snapshot: Snapshot,
    pub(super) target: usize,
    /// How the chair rolls, m/s.
    rolling: Vector3<f64>,
}

impl Stage {
    fn new() -> Self {
        Self::of("pick_mustard", "mustard")
    }

    pub(super) fn of(name: &str, target: &str) -> Self {
        let scene = home();
        let model =
            RobotModel::load(&assets(), "wheelarm").unwrap_or_else(|error| panic!("{error}"));
        let evaluator = Evaluator::new(&task(name), &scene, &model, target, None)
            .unwrap_or_else(|error| panic!("{error}"));
        let rest = |pose: Isometry3<f64>| BodyState {
            pose,
            linear: Vector3::zeros(),
            angular: Vector3::zeros(),
        };
        let snapshot = Snapshot {
            tick: 1000,
            joints: Vec::new(),
            links: model
                .links
                .iter()
                .map(|_| rest(Isometry3::identity()))
                .collect(),
            objects: scene.objects.iter().map(|body| rest(body.pose)).collect(),
            skins: Vec::new(),
            furniture_joints: vec![JointState::default(); 4],
            sliding: Vec::new(),
            person: None,
            contacts: Vec::new(),
            anomalies: Vec::new(),
        };
        // Of a drawer there is no object: what is lifted then does not matter.
        let target = scene.object_named(target).unwrap_or_default();
        Self {
            scene,
            model,
            evaluator,
            snapshot,
            target,
            rolling: Vector3::zeros(),
        }
    }

    fn link(&self, name: &str) -> BodyRef {
        BodyRef::Link(
            self.model
                .links
                .iter()
                .position(|l| l.name == name)
                .unwrap(),
        )
    }

    fn touch(&mut self, first: BodyRef, second: BodyRef, newtons: f64) {
        self.snapshot.contacts.push(Contact {
            first,
            second,
            point: Vector3::zeros(),
            force: Vector3::x() * newtons,
        });
    }

    pub(super) fn grip(&mut self) {
        for tip in [
            "robotiq_85_left_finger_tip_link",
            "robotiq_85_right_finger_tip_link",
        ] {
            let tip = self.link(tip);
            self.touch(tip, BodyRef::Object(self.target), 20.0);
        }
    }

    pub(super) fn raise(&mut self, metres: f64) {
        let object = &mut self.snapshot.objects[self.target];
        object.pose.translation.z = self.scene.objects[self.target].pose.translation.z + metres;
    }

    fn lean(&mut self, object: usize, degrees: f64) {
        let pose = &mut self.snapshot.objects[object].pose;
        pose.rotation = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), degrees.to_radians());
    }

    /// Judges every control tick for `secs`, and gives the last answer.
    pub(super) fn run(&mut self, secs: f64) -> Evaluation {
        let mut last = self.evaluator.update(&self.snapshot);
        for _ in 0..(secs * 60.0).round() as u64 {
            self.snapshot.tick += PHYSICS_HZ / 60;
            self.snapshot.links[0].pose.translation.vector += self.rolling / 60.0;
            last = self.evaluator.update(&self.snapshot);
        }
        last
    }
}

pub(super) fn condition<'a>(evaluation: &'a Evaluation, name: &str) -> &'a Condition {
    evaluation
        .conditions
        .iter()
        .find(|c| c.name.starts_with(name))
        .unwrap()
}

#[test]
fn a_pick_succeeds_after_a_second_in_the_air_with_the_chair_at_rest() {
    let mut stage = Stage::new();
    let before = stage.run(0.5);
    assert!(!before.done && before.conditions.len() == 4);
    stage.grip();
    stage.raise(0.12);
    let early = stage.run(0.9);
    assert!(!early.done, "held for 0.9 s only");
    assert!((condition(&early, "lifted_and_held").value - 0.12).abs() < 1e-9);
    let late = stage.run(0.2);
    assert!(late.success && late.done && late.failure.is_none());
    assert!((late.elapsed - 1.6).abs() < 1e-9, "{}", late.elapsed);
    stage.snapshot.contacts.clear();
    stage.raise(0.0);
    assert!(stage.run(1.0).success, "success is not taken back");
}

#[test]
fn what_does_not_count_as_a_pick() {
    type Change = fn(&mut Stage);
    let cases: [(&str, Change); 4] = [
        ("too low", |s| {
            s.grip();
            s.raise(0.09);
        }),
        ("one finger only", |s| {
            s.grip();
            s.snapshot.contacts.pop();
            s.raise(0.12);
        }),
        ("in the air but not held", |s| s.raise(0.3)),
        ("chair still rolling", |s| {
            s.grip();
            s.raise(0.12);
            s.rolling.x = 0.05;
        }),
    ];
    for (name, change) in cases {
        let mut stage = Stage::new();
        stage.run(0.1);
        change(&mut stage);
        let evaluation = stage.run(3.0);
        assert!(!evaluation.done, "{name}: {evaluation:?}");
    }
}

#[test]
fn a_chair_that_stands_is_at_rest_whatever_speed_the_engine_tells() {
    let mut stage = Stage::new();
    stage.snapshot.links[0].angular.z = 0.024;
    stage.run(0.1);
    stage.grip();
    stage.raise(0.12);
    let judged = stage.run(1.5);
    assert!(judged.success, "{judged:?}");
    assert_eq!(condition(&judged, "chair_stopped").value, 0.0);
}

#[test]
fn failures_say_why() {
    type Change = fn(&mut Stage);
    let cases: [(Failure, Change); 5] = [
        (Failure::Dropped, |s| {
            s.grip();
            s.raise(0.08);
            s.run(0.2);
            s.snapshot.contacts.clear();
            s.raise(0.0);
        }),
        (Failure::Dropped, |s| s.raise(-0.5)),
        (Failure::Tipped, |s| s.lean(s.target, 80.0)),
        (Failure::Timeout, |s| s.snapshot.tick += 100 * PHYSICS_HZ),
        (Failure::Lost, |s| {
            let lost = Anomaly::NotFinite(BodyRef::Object(s.target));
            s.snapshot.anomalies.push(lost);
        }),
    ];
    for (expected, change) in cases {
        let mut stage = Stage::new();
        stage.run(0.1);
        change(&mut stage);
        let evaluation = stage.run(0.1);
        assert!(evaluation.done && !evaluation.success);
        assert_eq!(evaluation.failure, Some(expected));
    }
}

#[test]
fn accidents_are_remembered_and_reported() {
    let mut stage = Stage::new();
    let quiet = stage.run(0.1);
    assert!(condition(&quiet, "nothing_knocked_over").holds);
    let soup = stage.scene.object_named("tomato_soup").unwrap();
    stage.lean(soup, 90.0);
    let (wheel, floor) = (stage.link("back_left_wheel"), BodyRef::Furniture(0));
    stage.touch(wheel, floor, 400.0);
    let table = BodyRef::Furniture(stage.scene.furniture_named("coffee_table").unwrap());
    stage.touch(table, BodyRef::Link(0), 80.0);
    stage.run(0.0);
    stage.lean(soup, 0.0);
    stage.snapshot.contacts.clear();
    let after = stage.run(0.1);
    let (knocked, hit) = (
        condition(&after, "nothing_knocked_over"),
        condition(&after, "no_hard_collision"),
    );
    assert!(!knocked.holds && !knocked.required);
    assert!((knocked.value - std::f64::consts::FRAC_PI_2).abs() < 1e-6);
    assert!(
        !hit.holds && hit.value == 80.0,
        "the wheel's 400 N do not count"
    );
    assert!(!after.done);
}

#[test]
fn a_knife_is_placed_when_it_was_lifted_and_lies_released_on_the_mat() {
    let mat = home().surface_named("placemat", None).unwrap().centre();
    let on_mat = |stage: &mut Stage| {
        let knife = &mut stage.snapshot.objects[stage.target].pose;
        knife.translation.vector = mat.translation.vector + Vector3::new(-0.04, 0.0, 0.0);
    };
    let lifted = || {
        let mut stage = Stage::of("place_knife", "knife");
        stage.run(0.1);
        stage.grip();
        stage.raise(0.08);
        assert!(!stage.run(0.2).done);
        on_mat(&mut stage);
        stage
    };
    let mut held = lifted();
    assert!(!held.run(2.0).done, "still in the hand");
    held.snapshot.contacts.clear();
    assert!(!held.run(0.3).done, "released for 0.3 s only");
    assert!(held.run(0.4).success);

    let mut moving = lifted();
    moving.snapshot.contacts.clear();
    moving.snapshot.objects[moving.target].linear.x = 0.1;
    assert!(!moving.run(2.0).done, "it still slides");

    let mut pushed = Stage::of("place_knife", "knife");
    pushed.run(0.1);
    on_mat(&mut pushed);
    assert!(!pushed.run(2.0).done, "it was never lifted");

    let mut beside = lifted();
    beside.snapshot.contacts.clear();
    beside.raise(0.0);
    beside.snapshot.objects[beside.target].pose.translation.x += 0.5;
    assert_eq!(beside.run(0.1).failure, Some(Failure::Dropped));
}

#[test]
fn a_can_counts_at_the_bottom_of_the_bin_and_neither_above_it_nor_beside_it() {
    let bin = home().surface_named("table_bin", None).unwrap().centre();
    let released = |offset: Vector3<f64>| {
        let mut stage = Stage::of("throw_meat_can", "meat_can");
        stage.run(0.1);
        stage.grip();
        stage.raise(0.08);
        assert!(!stage.run(0.2).done);
        let up = Vector3::z() * stage.scene.objects[stage.target].standing_height();
        let can = &mut stage.snapshot.objects[stage.target].pose;
        can.translation.vector = bin.translation.vector + up + offset;
        assert!(!stage.run(2.0).done, "still in the hand");
        stage.snapshot.contacts.clear();
        stage
    };
    let bottom = Vector3::z() * -0.114;
    let mut in_bin = released(bottom);
    assert!(!in_bin.run(0.3).done, "released for 0.3 s only");
    assert!(in_bin.run(0.4).success);

    for elsewhere in [Vector3::z() * 0.15, bottom + Vector3::x() * 0.4] {
        let judged = released(elsewhere).run(2.0);
        assert!(!judged.done && !condition(&judged, "inside").holds);
    }
}

#[test]
fn a_drawer_counts_from_twenty_centimetres_on() {
    let mut stage = Stage::of("open_drawer", "drawer_1");
    stage.run(0.1);
    stage.snapshot.furniture_joints[1].position = 0.3;
    stage.snapshot.furniture_joints[0].position = 0.19;
    // A pad that pulls the handle is no collision, a chair at its front is.
    let drawer = BodyRef::Furniture(stage.scene.furniture_named("drawer_1").unwrap());
    let pad = stage.link("robotiq_85_left_finger_tip_link");
    stage.touch(pad, drawer, 80.0);
    let early = stage.run(0.5);
    assert!(!early.done && condition(&early, "no_hard_collision").holds);
    assert_eq!(condition(&early, "opened_by").value, 0.19);
    stage.snapshot.furniture_joints[0].position = 0.2;
    assert!(stage.run(0.1).success);
    let mut shut = Stage::of("close_drawer", "drawer_2");
    shut.snapshot.furniture_joints[1].position = 0.05;
    assert!(!shut.run(0.5).done && !condition(&shut.run(0.0), "closed_to").holds);
    shut.snapshot.furniture_joints[1].position = 0.01;
    assert!(shut.run(0.1).success);
    stage.touch(BodyRef::Link(0), drawer, 80.0);
    assert_eq!(stage.evaluator.hard_collisions(&stage.snapshot).count(), 1);
}

#[test]
fn another_can_is_not_the_one_that_was_asked_for() {
    let mut stage = Stage::of("select_coke", "coke_2");
    stage.run(0.1);
    let other = stage.scene.object_named("coke_3").unwrap();
    stage.snapshot.objects[other].pose.translation.z += 0.12;
    stage.run(0.1);
    stage.grip();
    stage.raise(0.12);
    let evaluation = stage.run(3.0);
    assert!(condition(&evaluation, "lifted_and_held(target)").holds);
    assert!(!condition(&evaluation, "correct_instance").holds && !evaluation.success);
    let model = &stage.model;
    let wrong = Evaluator::new(&task("select_coke"), &stage.scene, model, "mustard", None);
    assert!(wrong.unwrap_err().to_string().contains("coke_4"));
}

#[test]
fn what_rests_too_far_in_and_what_is_rammed_ends_the_task() {
    let mut far = Stage::new();
    far.run(0.1);
    let inwards = far
        .scene
        .surface_named("coffee_table", None)
        .unwrap()
        .edge
        .rotation
        * Vector3::x();
    far.snapshot.objects[far.target].pose.translation.vector += inwards * 0.4;
    assert_eq!(far.run(0.1).failure, Some(Failure::Unreachable));
    let mut rammed = Stage::new();
    rammed.run(0.1);
    let table = BodyRef::Furniture(rammed.scene.furniture_named("coffee_table").unwrap());
    rammed.touch(BodyRef::Link(0), table, 500.0);
    assert_eq!(rammed.run(0.1).failure, Some(Failure::HardCollision));
}

#[test]
fn a_restored_evaluator_goes_on_as_if_never_interrupted() {
    let mut stage = Stage::new();
    stage.run(0.1);
    stage.grip();
    stage.raise(0.12);
    stage.run(0.8);
    let bytes = postcard::to_stdvec(stage.evaluator.state()).unwrap();
    let mut other = Evaluator::new(
        &task("pick_mustard"),
        &stage.scene,
        &stage.model,
        "mustard",
        None,
    )
    .unwrap();
    other.restore(postcard::from_bytes(&bytes).unwrap());
    for _ in 0..30 {
        stage.snapshot.tick += PHYSICS_HZ / 60;
        let expected = stage.evaluator.update(&stage.snapshot);
        assert_eq!(other.update(&stage.snapshot), expected);
    }
    assert!(stage.run(0.0).success);
}

#[test]
fn broken_tasks_are_refused_with_key_values_and_cure() {
    let cases: [(&str, &str, &str, &[&str]); 15] = [
        (
            "tasks/pick_mustard.toml",
            "template = \"lift\"",
            "template = \"juggle\"",
            &["template is \"juggle\"", "close, give, lift, open, put"],
        ),
        (
            "tasks/pick_mustard.toml",
            "template = \"lift\"",
            "template = \"put\"",
            &["place is absent", "placemat"],
        ),
        (
            "tasks/pick_mustard.toml",
            "template = \"lift\"",
            "template = \"open\"",
            &[
                "object is name \"mustard\"",
                "furniture that slides of coffee_table: none",
            ],
        ),
        (
            "tasks/pick_mustard.toml",
            "{ name = \"mustard\" }",
            "{ category = \"mug\", colour = \"red\" }",
            &[
                "category \"mug\" and colour \"red\"",
                "mustard (yellow bottle)",
                "areas/coffee_table.toml",
            ],
        ),
        (
            "tasks/pick_mustard.toml",
            "{ name = \"mustard\" }",
            "{ name = \"banana\" }",
            &["name \"banana\"", "crackers (red box)"],
        ),
        (
            "tasks/pick_mustard.toml",
            "area = \"coffee_table\"",
            "area = \"attic\"",
            &["area is \"attic\"", "coffee_table"],
        ),
        (
            "tasks/pick_mustard.toml",
            "license =",
            "time_limit = -1\nlicense =",
            &["time_limit is -1 s"],
        ),
        (
            "tasks/place_knife.toml",
            "failure = { reach = 0.4 }",
            "inside.height = 0.1",
            &["thresholds.inside.height is 0.1", "above"],
        ),
        (
            "tasks/place_knife.toml",
            "failure = { reach = 0.4 }",
            "opened_by.travel = 0.1",
            &["thresholds.opened_by", "at_rest"],
        ),
        (
            "tasks/place_knife.toml",
            "failure = { reach = 0.4 }",
            "nothing_knocked_over.tilt_deg = 300",
            &["tilt_deg is 300 degrees", "0 to 180"],
        ),
        (
            "tasks/place_knife.toml",
            "{ name = \"placemat\" }",
            "{ name = \"sofa\" }",
            &["place is name \"sofa\"", "placemat"],
        ),
        (
            "areas/coffee_table.toml",
            "inwards = [0.1, 0.4]",
            "inwards = [0.1, 1.4]",
            &["place[mustard].inwards is 1.4 m", "0 to 0.8"],
        ),
        (
            "areas/coffee_table.toml",
            "along = [-0.6, 0.6]",
            "along = [0.6, -0.6]",
            &["along is [0.6, -0.6]", "swap"],
        ),
        (
            "areas/coffee_table.toml",
            "along = [-0.55, 0.55]\nyaw_deg = [70, 110]",
            "along = [1.09, 1.10]\nyaw_deg = [70, 110]",
            &["place is", "missing", "widen"],
        ),
        (
            "templates/lift.toml",
            "predicate.lifted_and_held",
            "predicate.levitating",
            &["levitating", "lifted_and_held"],
        ),
    ];
    let home = home();
    for (i, (file, from, to, expected)) in cases.into_iter().enumerate() {
        let folder = crate::scene::tests::Copy::new(&format!("task{i}"));
        folder.edit(file, from, to);
        let task = match file {
            "tasks/place_knife.toml" => "place_knife",
            _ => "pick_mustard",
        };
        let error = match TaskSpec::load(&folder.0, task, &home, &hand()) {
            Ok(_) => panic!("{to} was taken"),
            Err(error) => error.to_string(),
        };
        assert!(error.contains(file), "{error}");
        for part in expected {
            assert!(error.contains(part), "{part:?} is missing in: {error}");
        }
    }
}
