//! Sampling by the maps, in a home with three rooms that the chair gets to and a closed one.

use std::path::Path;
use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};
use wheelarm_pack::Pack;
use wheelarm_planning::floor_map::{DRIVE_CLEARANCE, STOWED_CLEARANCE};
use wheelarm_planning::footprint_check::{FootprintCheck, Outline, Pose2};
use wheelarm_proto::exact;
use wheelarm_proto::settings::Starts;

use super::super::grasp_reach::GraspReach;
use super::super::*;
use super::hand;
use crate::people::{Person, PersonSetting};
use crate::robot::{OutlineSettings, RobotModel};
use crate::scene::Scene;
use crate::scene::tests::{assets, home};

/// A start on the floor plan.
fn on_floor(start: &Isometry3<f64>) -> Pose2 {
    let forward = start.rotation * Vector3::x();
    Pose2 {
        x: start.translation.x,
        y: start.translation.y,
        heading: exact::atan2(forward.y, forward.x),
    }
}

/// Kitchen and hall with a door of 0.9 m, a study that the chair enters in its travel posture
/// only, and a store without a door, with a table behind the wall to the hall.
const ROOMS: [(&str, [f64; 4]); 4] = [
    ("kitchen", [0.0, 5.0, 0.0, 4.0]),
    ("hall", [5.1, 9.0, 0.0, 4.0]),
    ("study", [0.0, 5.0, 4.1, 8.0]),
    ("store", [5.1, 9.0, 4.1, 8.0]),
];
/// Width of the door to the study, metres.
const NARROW: f64 = 0.78;

fn home_text() -> String {
    let mut text = String::from(
        "origin = \"drawn for tests\"\nlicense = \"CC0-1.0\"\n\
         [light]\nsun_direction = [0.4, -0.6, 0.8]\nsun = [1.7, 1.6, 1.3]\n\
         sky = [0.6, 0.6, 0.7]\nground = [0.5, 0.5, 0.4]\n\
         [room_camera]\nat = [0.4, 0.4, 2.0]\nlook_at = [3.0, 3.0, 0.5]\nhorizontal_fov_deg = 72\n\
         [start]\nat = [2.6, 1.5]\nyaw_deg = 90\n",
    );
    for (name, [x0, x1, y0, y1]) in ROOMS {
        text += &format!(
            "[[room]]\nname = \"{name}\"\noutline = [[{x0}, {y0}], [{x1}, {y0}], [{x1}, {y1}], [{x0}, {y1}]]\n\
             floor_material = \"parquet\"\nheight = 2.5\n"
        );
    }
    for [x0, y0, x1, y1] in [
        [-0.05, -0.05, 9.05, -0.05],
        [9.05, -0.05, 9.05, 8.05],
        [9.05, 8.05, -0.05, 8.05],
        [-0.05, 8.05, -0.05, -0.05],
        [5.05, 0.0, 5.05, 8.0],
        [0.0, 4.05, 9.0, 4.05],
    ] {
        text += &format!(
            "[[wall]]\nfrom = [{x0}, {y0}]\nto = [{x1}, {y1}]\nthickness = 0.1\nheight = 2.5\n\
             material_left = \"wall_white\"\nmaterial_right = \"wall_white\"\n"
        );
    }
    for (wall, at, width) in [(4, 1.5, 0.9), (5, 3.5, NARROW)] {
        text += &format!(
            "[[opening]]\nwall = {wall}\nat = {at}\nwidth = {width}\nheight = 2.0\nkind = \"frame\"\n"
        );
    }
    for (name, at, yaw) in [("table_1", [1.2, 3.4], -90), ("table_2", [7.0, 4.42], -90)] {
        text += &format!(
            "[[piece]]\nname = \"{name}\"\nkind = \"table\"\nat = [{}, {}, 0]\nyaw_deg = {yaw}\n",
            at[0], at[1]
        );
    }
    text + "[[object]]\nname = \"jar_1\"\nkind = \"jar\"\non = \"table_1\"\nat = [0.2, 0]\n"
}

/// Places on both tables, with a start in the kitchen.
fn places() -> String {
    let place = |table: &str, room: &str| {
        format!(
            "[[place]]\non = \"{table}\"\nsurface = \"top\"\nroom = \"{room}\"\n\
             inwards = [0.12, 0.22]\nalong = [-0.2, 0.2]\nheadroom = 0.6\n\
             start = {{ x = [2.5, 2.7], y = [1.4, 1.6], yaw_deg = [88, 92] }}\n"
        )
    };
    place("table_1", "kitchen") + &place("table_2", "store")
}

struct Rooms {
    scene: Scene,
    model: RobotModel,
    task: TaskSpec,
}

impl Rooms {
    fn new() -> Self {
        Self::with(&home_text())
    }

    /// The home of a text.
    fn with(home: &str) -> Self {
        let flat = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/flat");
        let mut files = Pack::open(&flat).unwrap().files().clone();
        files.insert("home.toml".to_owned(), home.to_owned().into_bytes());
        let pack = Arc::new(Pack::from_files(files).unwrap());
        let scene = Scene::from_pack(&assets(), &pack).unwrap();
        let task = TaskSpec::load(&assets(), "pick_jar", &scene, &hand());
        Self {
            model: RobotModel::load(&assets(), "wheelarm").unwrap(),
            task: task.unwrap_or_else(|error| panic!("{error}")),
            scene,
        }
    }

    fn by_maps(&self, floor: Floor) -> Floor {
        let reach = self.model.read_reach_map(&assets()).unwrap();
        assert!(reach.is_some());
        floor.by_maps(&self.scene, reach, Starts::Anywhere)
    }

    fn floor(&self) -> Floor {
        self.by_maps(Floor::new(&self.model, &self.scene))
    }

    fn sample(&self, area: &AreaSpec, seed: u64, floor: &Floor) -> SceneSample {
        sample_scene(area, &area.variants[0], &self.scene, seed, Some(floor))
    }

    /// The area with its object on the table in the closed room.
    fn behind_a_wall(&self) -> AreaSpec {
        let mut area = self.task.area.clone();
        area.variants[0].places[0].on = "table_2".to_owned();
        area
    }

    /// The chair among the furniture, with these outlines.
    fn footprint(&self, outlines: &[OutlineSettings]) -> FootprintCheck {
        let outline = |o: &OutlineSettings| (o.top, Outline { sides: o.footprint });
        let mut check = FootprintCheck::from_outlines(outlines.iter().map(outline));
        for obb in self.scene.furniture.iter().flat_map(collision_boxes) {
            check.put(obb.rectangle(), obb.heights());
        }
        check
    }
}

#[test]
fn starts_by_the_maps_use_every_reached_room_and_no_closed_one() {
    let rooms = Rooms::new();
    let (floor, settings) = (rooms.floor(), &rooms.model.settings);
    let travel = settings.travel.as_ref().expect("a travel posture");
    let at_home = rooms.footprint(&settings.outlines);
    let stowed = rooms.footprint(&travel.outlines);
    let (mut starts, mut at_home_in) = ([0; 4], [0; 4]);
    for seed in 0..60 {
        let sample = rooms.sample(&rooms.task.area, seed, &floor);
        assert!(sample.has_start && sample.has_reach, "seed {seed}");
        let at = sample.start.translation.vector;
        let pose = on_floor(&sample.start);
        let is_in =
            |[x0, x1, y0, y1]: [f64; 4]| (x0..x1).contains(&at.x) && (y0..y1).contains(&at.y);
        let room = ROOMS.iter().position(|(_, room)| is_in(*room));
        let is_stowed = sample.arm == Some(travel.joints);
        match is_stowed {
            true => assert!(
                stowed.is_free(&pose, STOWED_CLEARANCE),
                "seed {seed}: {pose:?}"
            ),
            false => assert!(
                at_home.is_free(&pose, DRIVE_CLEARANCE),
                "seed {seed}: {pose:?}"
            ),
        }
        // Others are in a door.
        if let Some(room) = room {
            starts[room] += 1;
            at_home_in[room] += usize::from(!is_stowed);
        }
    }
    let [kitchen, hall, study, store] = starts;
    assert_eq!(store, 0, "{starts:?}");
    // Each has about a third of the poses.
    assert!(
        [kitchen, hall, study].into_iter().all(|room| room > 8),
        "{starts:?}"
    );
    // The arm is stowed where it has no room only, also in the room with the narrow door.
    let [.., in_study, _] = at_home_in;
    assert!(
        in_study > 3 && in_study < study,
        "{at_home_in:?} of {starts:?}"
    );
}

#[test]
fn starts_by_the_maps_repeat_and_change_nothing_else() {
    let rooms = Rooms::new();
    let floor = rooms.floor();
    let near = Floor::new(&rooms.model, &rooms.scene);
    let reach = rooms.model.read_reach_map(&assets()).unwrap();
    let near = near.by_maps(&rooms.scene, reach, Starts::Near);
    for seed in 0..4 {
        let sample = rooms.sample(&rooms.task.area, seed, &floor);
        assert_eq!(sample, rooms.sample(&rooms.task.area, seed, &rooms.floor()));
        let near = rooms.sample(&rooms.task.area, seed, &near);
        assert_eq!(near.placements, sample.placements);
        let range = rooms.task.area.start;
        assert!(range.x.contains(near.start.translation.x) && near.arm.is_none());
    }
}

#[test]
fn starts_by_the_maps_are_clear_of_the_person() {
    let rooms = Rooms::new();
    let drawn = PersonSetting::default().sample(&assets(), 3).unwrap();
    let person = Person::load(&assets(), drawn).unwrap();
    // No posture but home: the travel posture would meet the person.
    let home = rooms.model.settings.home;
    let floor = Floor::occupied(&rooms.model, &rooms.scene, &person, |arm| *arm == home);
    let check = floor.check.clone();
    let floor = rooms.by_maps(floor);
    for seed in 0..20 {
        let sample = rooms.sample(&rooms.task.area, seed, &floor);
        assert!(sample.has_start, "seed {seed}");
        assert_eq!(sample.arm, Some(home));
        let at = sample.start.translation.vector;
        let pose = on_floor(&sample.start);
        assert!(check.is_free(&pose, DRIVE_CLEARANCE), "{pose:?}");
        assert!(at.y < 4.1, "the study needs the travel posture: {pose:?}");
    }
}

#[test]
fn objects_behind_a_wall_are_out_of_reach_after_few_attempts() {
    let rooms = Rooms::new();
    let (floor, area) = (rooms.floor(), rooms.behind_a_wall());
    let sample = rooms.sample(&area, 0, &floor);
    assert!(!sample.has_reach);
    assert!(sample.attempts <= 150, "{} attempts", sample.attempts);
    // The hand would get there through the wall.
    let object = rooms.scene.object_named("jar_1").unwrap();
    let body = &rooms.scene.objects[object];
    let surface = rooms.scene.surface_named("table_2", None).unwrap();
    let pose = surface.standing(0.16, 0.0, 0.0)
        * nalgebra::Translation3::new(0.0, 0.0, body.standing_height());
    let drivable = floor.drivable(&area).unwrap();
    let reach = floor.grasp_reach(&drivable).unwrap();
    assert!(!reach.can_grasp(body, &pose, surface));
    let through = GraspReach {
        solids: &[],
        ..reach
    };
    assert!(through.can_grasp(body, &pose, surface));
    // On the table in the kitchen it is in reach, and may be put down.
    let surface = rooms.scene.surface_named("table_1", None).unwrap();
    let at = rooms.sample(&rooms.task.area, 0, &floor).placements[object].unwrap();
    assert!(reach.can_grasp(body, &at.pose, surface) && reach.can_put(body, &at.pose, surface));
}

#[test]
fn query_selects_another_place_where_the_robot_does_not_reach_the_first() {
    let rooms = Rooms::with(&(home_text() + &places()));
    let name = "take_from_table";
    let scene = stocked(&assets(), name, rooms.scene.clone()).expect("a stocked home");
    let task = TaskSpec::load(&assets(), name, &scene, &hand()).expect("a task");
    let reach = rooms.model.read_reach_map(&assets()).unwrap();
    let floor = Floor::new(&rooms.model, &scene).by_maps(&scene, reach, Starts::Anywhere);
    // Until two seeds keep their place and two get another.
    let mut counts = [0; 2];
    for seed in 0..8 {
        let variant = variant_of(&task, seed, None).expect("a place");
        let settled = || task.settled(variant, &scene, seed, "").expect("a target");
        let (one, own) = settled();
        let plain = sample(&one, &own, &scene, seed, Some(&floor)).scene;
        let sampled = |is_open: &dyn Fn(&str, &str) -> bool| {
            sample_reached(&task, settled(), is_open, &scene, seed, Some(&floor))
        };
        let ((_, variant), found) = sampled(&|_, _| true);
        assert!(found.scene.is_complete(), "seed {seed}");
        assert!(variant.name.starts_with("table_1"), "{}", variant.name);
        counts[usize::from(!plain.is_complete())] += 1;
        if !plain.is_complete() {
            // A named place is not replaced.
            let ((_, variant), found) = sampled(&|variant, _| variant == own.name);
            assert!(!found.scene.has_reach && variant.name == own.name);
        }
        if counts.iter().all(|count| *count >= 2) {
            return;
        }
    }
    assert!(counts.iter().all(|count| *count > 0), "{counts:?}");
}

/// Every task of the built-in home can be sampled by the maps.
#[test]
fn tasks_of_the_home_are_in_reach_by_the_maps() {
    let model = RobotModel::load(&assets(), "wheelarm").unwrap();
    let reach = model.read_reach_map(&assets()).unwrap();
    // Variants with the same furniture share scene and floor.
    let mut floors: Vec<(Vec<String>, Scene, Floor)> = Vec::new();
    for task in list(&assets(), &hand()).unwrap_or_else(|error| panic!("{error}")) {
        let variant = variant_of(&task, 0, None).expect("a variant");
        if !floors.iter().any(|(of, ..)| *of == variant.furniture) {
            let mut scene = home();
            scene.keep_optional(&variant.furniture);
            let floor = Floor::new(&model, &scene);
            let floor = floor.by_maps(&scene, reach.clone(), Starts::Anywhere);
            floors.push((variant.furniture.clone(), scene, floor));
        }
        let shared = floors.iter().find(|(of, ..)| *of == variant.furniture);
        let (_, scene, floor) = shared.expect("a floor");
        let sample = sample(&task, variant, scene, 0, Some(floor)).scene;
        assert!(
            sample.has_start && sample.has_reach && sample.clearance >= 0.0,
            "{}",
            task.name
        );
    }
}
