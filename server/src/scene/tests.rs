//! Tests of the bundled home (budgets, lanes, origins) and of errors in broken files.

use std::path::PathBuf;
use std::sync::OnceLock;

use nalgebra::{Point2, Vector2};

use super::*;
use crate::geometry::{mesh, texture};

/// The assets of this repository.
pub(crate) fn assets() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../assets"))
}

/// The home, loaded once.
pub(crate) fn home() -> Scene {
    static HOME: OnceLock<Scene> = OnceLock::new();
    let load = || Scene::load(&assets(), "home").unwrap_or_else(|error| panic!("{error}"));
    HOME.get_or_init(load).clone()
}

/// Every scene of the assets with its name.
fn scenes() -> impl Iterator<Item = (String, Scene)> {
    let names = names(&assets(), "scenes").unwrap();
    names.into_iter().map(|name| {
        let scene = Scene::load(&assets(), &name).unwrap_or_else(|error| panic!("{error}"));
        (name, scene)
    })
}

#[test]
fn every_object_file_loads_and_every_asset_names_origin_and_licence() {
    for folder in [
        "scenes",
        "objects",
        "materials",
        "areas",
        "templates",
        "tasks",
    ] {
        let names = names(&assets(), folder).unwrap();
        assert!(!names.is_empty());
        for name in names {
            let text = std::fs::read_to_string(assets().join(format!("{folder}/{name}.toml")));
            let table: toml::Table = text.unwrap().parse().unwrap();
            for key in ["origin", "license"] {
                let value = table.get(key).and_then(toml::Value::as_str).unwrap_or("");
                assert!(value.len() > 5, "{folder}/{name}.toml: {key}");
            }
        }
    }
    for name in texture::names(&assets()) {
        let file = std::fs::File::open(assets().join(format!("textures/{name}.png"))).unwrap();
        let decoder = png::Decoder::new(std::io::BufReader::new(file));
        let reader = decoder.read_info().unwrap();
        for keyword in ["Source", "Copyright"] {
            let mut texts = reader.info().uncompressed_latin1_text.iter();
            assert!(
                texts.any(|t| t.keyword == keyword && t.text.len() > 5),
                "textures/{name}.png: {keyword}"
            );
        }
    }
    let materials = material::library(&assets(), None).unwrap();
    for kind in names(&assets(), "objects").unwrap() {
        let reader = part::Reader {
            assets: &assets(),
            pack: None,
            materials: &materials,
        };
        let body = object::read(&reader, &kind).unwrap_or_else(|error| panic!("{error}"));
        assert!(
            body.standing_height().abs() < 1e-9,
            "{kind} must rest on z = 0"
        );
        for word in [&body.category, &body.colour] {
            let single = !word.is_empty() && word.chars().all(|c| c.is_ascii_lowercase());
            assert!(single, "{kind} is {word:?}");
        }
    }
}

#[test]
fn the_recorded_texts_are_the_files_in_use() {
    for (name, scene) in scenes() {
        let texts = texts(&assets(), &scene.files).unwrap();
        let paths: Vec<_> = texts.iter().map(|text| text.path.as_str()).collect();
        let own = format!("scenes/{name}.toml");
        assert!(paths.contains(&own.as_str()), "{paths:?}");
        assert!(texts.iter().all(|text| text.text.contains("license")));
    }
    let texts = texts(&assets(), &home().files).unwrap();
    let paths: Vec<_> = texts.iter().map(|text| text.path.as_str()).collect();
    for path in ["materials/home.toml", "objects/mustard.toml"] {
        assert!(paths.contains(&path), "{paths:?}");
    }
}

#[test]
fn every_scene_stays_within_the_budget_of_triangles_and_ids() {
    let count = |body: &Body| -> usize {
        let triangles = |v: &Visual| {
            let built = mesh::build(&v.part.shape, &assets());
            built
                .unwrap_or_else(|error| panic!("{error}"))
                .indices
                .len()
                / 3
        };
        body.visual.iter().map(triangles).sum()
    };
    for (name, scene) in scenes() {
        let bodies = scene.furniture.iter().chain(&scene.objects);
        let total: usize = bodies.map(count).sum();
        println!("{name}: {total} triangles");
        assert!(total <= 60_000, "{name}: {total} triangles");
        let ids = scene.furniture.len() + scene.objects.len();
        assert!(ids <= 200, "{name}: {ids} bodies");
    }
}

/// A disc of 1.2 m in diameter moves from the start to in front of every area.
#[test]
fn lanes_are_wide_enough_for_the_chair_to_reach_every_area() {
    for (name, scene) in scenes() {
        let areas = reached_areas(&name, &scene);
        assert!(!areas.is_empty(), "no furniture of {name} has an area");
        if name == "home" {
            let known = ["coffee_table", "kitchen_table", "shelf", "workstation"];
            assert!(areas.iter().eq(&known), "{areas:?}");
        }
    }
}

/// The areas with surfaces, each of which the chair reaches.
fn reached_areas<'a>(name: &str, scene: &'a Scene) -> std::collections::BTreeSet<&'a str> {
    let obstacles: Vec<_> = scene.furniture[1..]
        .iter()
        .flat_map(|body| {
            body.collision.iter().filter_map(|part| {
                let mut piece = body.clone();
                piece.collision = vec![part.clone()];
                piece.collision_bounds(&body.pose)
            })
        })
        .filter(|bounds| bounds.min.z < 1.1)
        .collect();
    let free = |p: Point2<f64>| {
        obstacles.iter().all(|b| {
            let x = (b.min.x - p.x).max(p.x - b.max.x).max(0.0);
            let y = (b.min.y - p.y).max(p.y - b.max.y).max(0.0);
            x.hypot(y) >= 0.6
        })
    };
    let floor = &scene.furniture[0];
    let floor = floor.collision_bounds(&floor.pose).expect("a floor");
    const CELL: f64 = 0.05;
    let cell = |p: Point2<f64>| ((p.x / CELL).round() as i64, (p.y / CELL).round() as i64);
    let start = cell(scene.start.translation.vector.xy().into());
    let mut reached = std::collections::BTreeSet::from([start]);
    let mut open = vec![start];
    while let Some((x, y)) = open.pop() {
        for next in [(x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)] {
            let at = Point2::new(next.0 as f64 * CELL, next.1 as f64 * CELL);
            let inside = (floor.min.x..floor.max.x).contains(&at.x)
                && (floor.min.y..floor.max.y).contains(&at.y);
            if inside && free(at) && reached.insert(next) {
                open.push(next);
            }
        }
    }
    let mut areas = std::collections::BTreeSet::new();
    for surface in scene.surfaces.iter().filter(|s| s.furniture > 0) {
        let area = scene.furniture[surface.furniture].area.as_str();
        if area.is_empty() || !areas.insert(area) {
            continue;
        }
        let out = surface.edge.rotation * -Vector3::x();
        let stop = surface.edge.translation.vector.xy() + Vector2::new(out.x, out.y) * 0.75;
        let stop_cell = cell(stop.into());
        assert!(reached.contains(&stop_cell), "{name}: {area} at {stop:?}");
    }
    areas
}

#[test]
fn mesh_files_collide_as_their_hull_unless_shapes_are_given() {
    let folder = Copy::new("hull");
    let tetrahedron =
        "v 0 0 0\nv 100 0 0\nv 0 100 0\nv 0 0 100\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
    folder.write("meshes/wedge.obj", tetrahedron);
    let parts =
        "parts = [{ mesh = { path = \"meshes/wedge.obj\", scale = 0.001 }, material = \"oak\" }]";
    let rest =
        "mass = 0.1\ncom = [0.02, 0.02, 0.02]\ninertia = [1e-4, 1e-4, 1e-4]\nfriction = 0.5\n";
    let head = "origin = \"a test\"\nlicense = \"Apache-2.0\"\n";
    folder.write("objects/mustard.toml", &format!("{head}{rest}{parts}\n"));
    let scene = Scene::load(&folder.0, "home").unwrap_or_else(|error| panic!("{error}"));
    let body = &scene.objects[scene.object_named("mustard").unwrap()];
    assert_eq!((body.collision.len(), body.hulls.len()), (0, 1));
    let size = body
        .collision_bounds(&Isometry3::identity())
        .unwrap()
        .size();
    assert!((size - Vector3::repeat(0.1)).norm() < 1e-6, "{size:?}");
    let texts = texts(&folder.0, &scene.files).unwrap();
    assert!(texts.iter().any(|t| t.path == "meshes/wedge.obj"));

    let given = "collision = [{ box = [0.1, 0.1, 0.1], at = [0.05, 0.05, 0.05] }]\n";
    folder.write(
        "objects/mustard.toml",
        &format!("{head}{rest}{parts}\n{given}"),
    );
    let scene = Scene::load(&folder.0, "home").unwrap_or_else(|error| panic!("{error}"));
    let body = &scene.objects[scene.object_named("mustard").unwrap()];
    assert_eq!((body.collision.len(), body.hulls.len()), (1, 0));
}

/// A copy of the assets with one error.
pub(crate) struct Copy(pub(crate) PathBuf);

impl Copy {
    pub(crate) fn new(name: &str) -> Self {
        let root = std::env::temp_dir().join(format!("wheelarm-{name}-{}", std::process::id()));
        for folder in [
            "scenes",
            "objects",
            "materials",
            "areas",
            "templates",
            "tasks",
            "meshes",
        ] {
            std::fs::create_dir_all(root.join(folder)).unwrap();
            for name in names(&assets(), folder).unwrap_or_default() {
                let path = format!("{folder}/{name}.toml");
                std::fs::copy(assets().join(&path), root.join(&path)).unwrap();
            }
        }
        for mesh in std::fs::read_dir(assets().join("meshes")).unwrap() {
            let mesh = mesh.unwrap();
            std::fs::copy(mesh.path(), root.join("meshes").join(mesh.file_name())).unwrap();
        }
        std::fs::create_dir_all(root.join("textures")).unwrap();
        for name in texture::names(&assets()) {
            let path = format!("textures/{name}.png");
            std::fs::copy(assets().join(&path), root.join(&path)).unwrap();
        }
        Self(root)
    }

    pub(crate) fn write(&self, path: &str, text: &str) {
        std::fs::write(self.0.join(path), text).unwrap();
    }

    /// Replaces the first `from`, which must exist.
    pub(crate) fn edit(&self, path: &str, from: &str, to: &str) {
        let text = std::fs::read_to_string(self.0.join(path)).unwrap();
        assert!(text.contains(from), "{path} has no {from:?}");
        self.write(path, &text.replacen(from, to, 1));
    }
}

impl Drop for Copy {
    fn drop(&mut self) {
        // If it cannot be removed it stays in the temporary folder.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

#[test]
fn broken_files_are_rejected_with_file_key_values_and_fix() {
    const OBJECT: &str = "objects/mustard.toml";
    const CAN: &str = "objects/meat_can.toml";
    const SCENE: &str = "scenes/home.toml";
    const MATERIALS: &str = "materials/home.toml";
    // File, replaced text, replacement, and required parts of the message.
    let cases: [(&str, &str, &str, &[&str]); 18] = [
        (
            CAN,
            "{ rounded_box",
            "{ mesh = \"meshes/cup.glb\" }, { rounded_box",
            &["expected a table, for example mesh = { path ="],
        ),
        (
            OBJECT,
            "com = [0.0, 0.0, 0.085]",
            "com = [0.0, 0.085, 0.0]",
            &["y up", "write com = [0.0, 0.0, 0.085]"],
        ),
        (
            OBJECT,
            "mass = 0.603",
            "mass = 603",
            &["mass is 603 kg", "0.001 to 100", "kilograms"],
        ),
        (
            OBJECT,
            "mass = 0.603",
            "weight = 0.603",
            &["unknown field `weight`"],
        ),
        (
            OBJECT,
            "friction = 0.6",
            "friction = \"high\"",
            &["friction", "invalid type"],
        ),
        (
            CAN,
            "size = [0.1016,",
            "size = [101.6,",
            &["parts[0].rounded_box.size", "101.6 m", "metres"],
        ),
        (
            CAN,
            "radius = 0.014",
            "radius = 0.040",
            &["radius is 0.04 m", "half of the shortest"],
        ),
        (
            OBJECT,
            "mustard_label",
            "ketchup",
            &["material is \"ketchup\"", "one of", "oak", "add"],
        ),
        (
            CAN,
            "rounded_box =",
            "pyramid =",
            &["unknown field `pyramid`", "rounded_box"],
        ),
        (
            OBJECT,
            "inertia = [2.01e-3,",
            "inertia = [2.01,",
            &["inertia is 2.01", "mass and size"],
        ),
        (
            OBJECT,
            "com = [0.0, 0.0, 0.085]",
            "com = [0.0, 0.0, 85.0]",
            &["com is 85 m"],
        ),
        (
            OBJECT,
            "closing = [0, 1, 0]",
            "closing = [1, 0, 0]",
            &["closing", "perpendicular"],
        ),
        (
            OBJECT,
            "width = 0.058",
            "width = 0.5",
            &["grasps[0].width is 0.5 m", "no gripper opens"],
        ),
        (
            CAN,
            "{ rounded_box",
            "{ mesh = { path = \"meshes/no.obj\" }, rounded_box",
            &["meshes/no.obj", "put it at"],
        ),
        (
            SCENE,
            "name = \"tomato_soup\"\non",
            "name = \"pea_soup\"\non",
            &["\"pea_soup\"", "crackers", "assets/objects"],
        ),
        (
            SCENE,
            "like = \"chair_1\"",
            "like = \"chair_9\"",
            &["furniture[chair_2].like is \"chair_9\""],
        ),
        (
            SCENE,
            "on = \"coffee_table\"",
            "on = \"cofee_table\"",
            &["object[mustard].on", "coffee_table top"],
        ),
        (
            MATERIALS,
            "pattern = \"planks\"",
            "pattern = \"lava\"",
            &["material.parquet.texture.pattern is \"lava\"", "planks"],
        ),
    ];
    for (i, (file, from, to, expected)) in cases.into_iter().enumerate() {
        let folder = Copy::new(&format!("broken{i}"));
        folder.edit(file, from, to);
        let error = match Scene::load(&folder.0, "home") {
            Ok(_) => panic!("{to} in {file} was accepted"),
            Err(error) => error.to_string(),
        };
        assert!(error.contains(file), "{error}");
        for part in expected {
            assert!(error.contains(part), "{part:?} is missing in: {error}");
        }
    }
    let missing = Scene::load(&assets(), "castle").unwrap_err().to_string();
    assert!(
        missing.contains("castle") && missing.contains("home"),
        "{missing}"
    );
}

#[test]
fn obj_files_of_another_encoding_are_recorded_with_replaced_characters() {
    let folder = Copy::new("latin1");
    let path = folder.0.join("meshes");
    std::fs::create_dir_all(&path).unwrap();
    std::fs::write(path.join("latin1.obj"), b"# B\xfcro\nv 0 0 0\n").unwrap();
    let texts = super::texts(&folder.0, &["meshes/latin1.obj".to_owned()]).unwrap();
    assert_eq!(texts[0].text, "# B\u{fffd}ro\nv 0 0 0\n");
}
