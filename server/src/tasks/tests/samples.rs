//! Tests of samples over many seeds.

use nalgebra::{Isometry3, Vector2, Vector3};
use wheelarm_proto::exact;

use super::super::*;
use super::{hand, task};
use crate::geometry::{Part, Shape};
use crate::robot::RobotModel;
use crate::scene::tests::{assets, home};
use crate::scene::{Body, Bounds, Scene};

/// Every area with its variants, and the home in each of them.
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
fn scenes_of_every_area_are_valid_in_range_and_collision_free() {
    for (area, variant, scene) in variants() {
        let mut poses: Vec<(&str, Vec<Vector3<f64>>)> = Vec::new();
        let mut positions = Vec::new();
        for seed in 0..30 {
            let drawn = sample_scene(&area, &variant, &scene, seed, None);
            let at = format!("{} {:?} seed {seed}", area.name, variant.name);
            if seed < 3 {
                let again = sample_scene(&area, &variant, &scene, seed, None);
                assert_eq!(drawn, again, "{at} repeats");
            }
            assert!(drawn.clearance >= 0.0, "{at} is not valid");
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
                let rests = place.rest.sum() > 0.0;
                if !rests {
                    assert!(place.inwards.contains(on.translation.x), "{at}");
                    assert!(place.along.contains(on.translation.y), "{at}");
                    assert!(place.yaw.contains(on.rotation.euler_angles().2), "{at}");
                }
                assert!(place.mass.is_none_or(|m| m.contains(placement.mass)));
                let friction = placement.friction;
                assert!(place.friction.is_none_or(|f| f.contains(friction)));
                match poses.iter_mut().find(|(name, _)| *name == place.object) {
                    Some((_, places)) => places.push(on.translation.vector),
                    None => poses.push((&place.object, vec![on.translation.vector])),
                }
            }
            for slide in &area.slides {
                let joint = scene.joint_named(&slide.joint).unwrap();
                assert!(slide.friction.contains(drawn.slides[joint].friction));
                assert!(slide.damping.contains(drawn.slides[joint].damping));
                assert!(slide.position.contains(drawn.positions[joint]), "{at}");
            }
            assert!(
                drawn.positions.iter().all(|position| *position > 0.04),
                "{at}"
            );
            positions.extend(&drawn.positions);
            assert_apart(&scene, &drawn, &at);
        }
        for (name, places) in poses {
            let spread = Bounds::of_points(places.into_iter().map(Into::into)).unwrap();
            let enough = spread.size().x > 0.03 && spread.size().y > 0.2;
            assert!(enough, "{name}: {spread:?}");
        }
        positions.sort_by(f64::total_cmp);
        if let [least, .., greatest] = positions[..] {
            assert!(greatest - least > 0.04, "{least} to {greatest} m");
        }
    }
}

/// The start of the robot does not change the scene.
#[test]
fn starts_anywhere_cover_the_home_and_do_not_change_the_scene() {
    let model = RobotModel::load(&assets(), "wheelarm").unwrap_or_else(|error| panic!("{error}"));
    for (area, variant, scene) in variants() {
        let floor = Floor::new(&model, &scene);
        let (mut places, mut closed, mut postures) = (Vec::new(), 0, Vec::new());
        for seed in 0..24 {
            let near = sample_scene(&area, &variant, &scene, seed, None);
            let far = sample_scene(&area, &variant, &scene, seed, Some(&floor));
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

/// The scene is the same for every task in an area.
#[test]
fn all_tasks_of_an_area_have_the_same_scene_bit_for_bit() {
    let tasks = list(&assets(), &hand()).unwrap_or_else(|error| panic!("{error}"));
    let home = home();
    let model = RobotModel::load(&assets(), "wheelarm").unwrap_or_else(|error| panic!("{error}"));
    let mut areas: Vec<Vec<&TaskSpec>> = Vec::new();
    for task in &tasks {
        match areas
            .iter_mut()
            .find(|of| of[0].area.name == task.area.name)
        {
            Some(of) => of.push(task),
            None => areas.push(vec![task]),
        }
    }
    let mut compared = 0;
    for tasks in areas {
        for seed in 0..20 {
            let mut scenes: Vec<(&str, [String; 2])> = Vec::new();
            let mut of_several = None;
            for task in &tasks {
                assert_eq!(task.area, tasks[0].area);
                let variant = variant_of(task, seed, None).unwrap();
                // Only the bear's own task cannot use every variant.
                if task.variants().count() > 1 {
                    let first = *of_several.get_or_insert(&variant.name);
                    assert_eq!(first, &variant.name, "seed {seed}: {}", task.name);
                }
                let mut scene = home.clone();
                scene.keep_optional(&variant.furniture);
                // Few starts anywhere, which take longer.
                let floor = (seed < 3).then(|| Floor::new(&model, &scene));
                // The debug text contains every bit of a number.
                let drawn = [None, floor.as_ref()]
                    .map(|floor| format!("{:?}", sample(task, variant, &scene, seed, floor).scene));
                match scenes.iter().find(|(name, _)| *name == variant.name) {
                    Some((_, first)) => {
                        assert!(*first == drawn, "{} seed {seed}", task.name);
                        compared += 1;
                    }
                    None => scenes.push((&variant.name, drawn)),
                }
            }
        }
    }
    assert!(compared > 200, "{compared}");
}

/// A nearest-centroid classifier on all sampled values of a scene is trained on half of
/// the seeds. It guesses the task of the others no better than chance, also over the
/// areas of a home. `make test-data` uses more seeds and better classifiers.
#[test]
fn sampled_scenes_do_not_reveal_the_task() {
    const SEEDS: u64 = 40;
    const WHOLE_HOME: [&str; 4] = ["coffee_table", "kitchen_table", "shelf", "workstation"];
    let tasks = list(&assets(), &hand()).unwrap_or_else(|error| panic!("{error}"));
    for areas in [&["coffee_table"][..], &["kitchen_table"], &WHOLE_HOME] {
        let of_areas = tasks
            .iter()
            .filter(|t| areas.contains(&t.area.name.as_str()));
        let of_areas: Vec<_> = of_areas
            .filter(|t| t.variants().any(|v| v.name.is_empty()))
            .collect();
        let mut samples: Vec<(usize, Vec<f64>)> = Vec::new();
        for (label, task) in of_areas.iter().enumerate() {
            let variant = &task.area.variants[0];
            let mut scene = home();
            scene.keep_optional(&variant.furniture);
            // No two tasks share a seed.
            let seeds = 1000 * label as u64..;
            let drawn = seeds.map(|seed| sample(task, variant, &scene, seed, None).scene);
            let of_home = drawn.filter(|drawn| {
                let mut names = drawn.surroundings.iter().map(String::as_str);
                names.all(|name| WHOLE_HOME.contains(&name))
            });
            samples.extend(of_home.take(SEEDS as usize).map(|d| (label, numbers(&d))));
        }
        let right = nearest_centroid(&samples, of_areas.len());
        let chance = 1.0 / of_areas.len() as f64;
        // Four standard errors of a share of this many guesses.
        let count = samples.len() as f64 / 2.0;
        let most = chance + 4.0 * (chance * (1.0 - chance) / count).sqrt();
        assert!(
            right <= most,
            "{areas:?}: {right:.3} right, chance {chance:.3}"
        );
    }
}

/// All sampled values of a scene.
fn numbers(drawn: &SceneSample) -> Vec<f64> {
    let mut row: Vec<f64> = drawn.start.translation.vector.iter().copied().collect();
    for placement in &drawn.placements {
        let placed = placement.map_or([0.0; 7], |p| {
            let at = p.pose.translation;
            let yaw = p.pose.rotation.euler_angles().2;
            let up = (p.pose.rotation * Vector3::z()).z;
            [at.x, at.y, at.z, yaw, up, p.mass, p.friction]
        });
        row.extend(placed);
    }
    row.extend(&drawn.positions);
    row.extend(drawn.slides.iter().flat_map(|s| [s.friction, s.damping]));
    row
}

/// The same seed gives other areas the same scene, for every task.
#[test]
fn surroundings_are_the_same_for_the_tasks_of_every_area() {
    let scene = home();
    let [mut mustard, mut coke] = ["pick_mustard", "select_coke"].map(task);
    mustard.area.variants.truncate(1);
    coke.area.variants.truncate(1);
    let mut same = 0;
    for seed in 0..30 {
        let [first, second] = [&mustard, &coke]
            .map(|task| sample_scene(&task.area, &task.area.variants[0], &scene, seed, None));
        let at_home = |drawn: &SceneSample| {
            drawn
                .surroundings
                .iter()
                .all(|name| name != "lounge" && name != "kitchen_meal")
        };
        if at_home(&first) && at_home(&second) {
            assert_eq!(first.placements, second.placements, "seed {seed}");
            assert_eq!(first.positions, second.positions, "seed {seed}");
            same += 1;
        }
    }
    assert!(same > 10, "{same}");
}

/// Clutter is on its side, leaning, stacked or hidden, each in a share of scenes.
#[test]
fn clutter_lies_leans_is_stacked_and_hides() {
    let (spec, scene) = (task("pick_mustard"), home());
    let [mut lying, mut leaning, mut stacked] = [0; 3];
    for seed in 0..100 {
        let drawn = sample_scene(&spec.area, &spec.area.variants[0], &scene, seed, None);
        let placed = scene.objects.iter().zip(&drawn.placements);
        let placed: Vec<_> = placed
            .filter_map(|(b, p)| Some((b, p.as_ref()?.pose)))
            .collect();
        let up = |pose: &Isometry3<f64>| (pose.rotation * Vector3::z()).z;
        lying += usize::from(placed.iter().any(|(_, pose)| up(pose) < 0.1));
        leaning += usize::from(placed.iter().any(|(_, p)| (0.1..0.999).contains(&up(p))));
        stacked += usize::from(placed.iter().any(|(body, pose)| {
            let bounds = body.collision_bounds(pose).unwrap();
            body.name.starts_with("sugar") && bounds.min.z > 0.85
        }));
    }
    assert!(
        (40..85).contains(&lying),
        "{lying} of 100 with a lying object"
    );
    assert!(
        (8..40).contains(&leaning),
        "{leaning} of 100 with a leaning object"
    );
    assert!((4..30).contains(&stacked), "{stacked} of 100 with a stack");
}

/// The share of the odd samples whose nearest centroid, computed from the even ones,
/// has their own label; every number is scaled by its spread.
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
fn the_classifier_detects_a_dependence() {
    let dependent = |i: usize| (i / 2 % 3, vec![(i / 2 % 3) as f64, (i % 7) as f64]);
    let samples: Vec<_> = (0..120).map(dependent).collect();
    assert_eq!(nearest_centroid(&samples, 3), 1.0);
}

#[test]
fn variants_follow_their_shares_and_the_bear_has_its_own() {
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
fn sentence_counts_cans_from_the_left_when_facing_the_shelf() {
    let (spec, scene) = (task("select_coke"), home());
    for seed in 0..40 {
        let drawn = sample(&spec, &spec.area.variants[0], &scene, seed, None);
        let sentence = &drawn.instruction;
        // Facing south, left is east, where x grows.
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

#[test]
fn the_instruction_names_the_drawer_by_its_height() {
    let (spec, scene) = (task("open_drawer"), home());
    let names = [
        ("drawer_1", "the top drawer"),
        ("drawer_2", "the second drawer from the top"),
        ("drawer_3", "the third drawer from the top"),
        ("drawer_4", "the bottom drawer"),
    ];
    let mut counts = [0; 4];
    for seed in 0..60 {
        let drawn = sample(&spec, &spec.area.variants[0], &scene, seed, None);
        let drawer = names.iter().position(|(name, _)| *name == drawn.target);
        let drawer = drawer.expect("a drawer");
        counts[drawer] += 1;
        let sentence = &drawn.instruction;
        assert!(
            sentence.contains(names[drawer].1),
            "seed {seed}: {sentence}"
        );
    }
    assert!(counts.iter().all(|count| *count > 0), "{counts:?}");
}

/// No object overlaps another or furniture, and each rests on its support. Bounds are
/// taken along the first one's axes, then along the other's.
fn assert_apart(scene: &Scene, drawn: &SceneSample, at: &str) {
    let bodies: Vec<_> = scene
        .objects
        .iter()
        .zip(&drawn.placements)
        .filter_map(|(body, placement)| Some((body, placement.as_ref()?.pose)))
        .collect();
    let overlap = |(a, a_pose): (&Body, Isometry3<f64>), (b, b_pose): (&Body, Isometry3<f64>)| {
        let overlap_in = |frame: Isometry3<f64>| {
            let a = a.collision_bounds(&(frame.inverse() * a_pose)).unwrap();
            let b = b.collision_bounds(&(frame.inverse() * b_pose)).unwrap();
            a.overlaps(&b, 1e-6)
        };
        let between = (b_pose.translation.vector - a_pose.translation.vector).xy();
        let line = Isometry3::rotation(Vector3::z() * exact::atan2(between.y, between.x));
        // Round objects are separated along the line between their centres.
        let is_round = |part: &Part| {
            matches!(
                part.shape,
                Shape::Cylinder { .. } | Shape::Frustum { .. } | Shape::Cup { .. }
            )
        };
        let round = |body: &Body| body.collision.iter().all(is_round);
        let along = !(round(a) && round(b)) || overlap_in(line);
        along && overlap_in(a_pose) && overlap_in(b_pose)
    };
    for (i, own) in bodies.iter().enumerate() {
        for other in &bodies[i + 1..] {
            let names = (&own.0.name, &other.0.name);
            // Bounds of a leaning object are not meaningful; `sim::rest_tests` checks
            // that it rests.
            let leans = |(_, pose): &(&Body, Isometry3<f64>)| {
                (0.1..0.999).contains(&(pose.rotation * Vector3::z()).z.abs())
            };
            let apart = leans(own) || leans(other) || !overlap(*own, *other);
            assert!(apart, "{at}: {names:?} overlap");
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
        for (other, pose) in bodies.iter().filter(|(other, _)| other.name != own.0.name) {
            let other = other.collision_bounds(pose).unwrap();
            let over = own.1.translation.vector.xy() - Vector2::new(other.min.x, other.min.y);
            if over.min() > -0.1 && other.max.z > 0.81 {
                gap = gap.min((bounds.min.z - other.max.z).abs());
            }
        }
        assert!(gap <= 0.0005, "{at}: {} hangs {gap} m high", own.0.name);
    }
}
