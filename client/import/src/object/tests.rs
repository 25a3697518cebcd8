//! Objects of small meshes that the tests make.

use wheelarm_proto::exact;

use super::mesh::{Face, Surface};
use super::*;

fn assets() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets")
}

pub(super) fn categories() -> Categories {
    Categories::read(&assets()).unwrap()
}

pub(super) fn category(name: &str) -> Category {
    categories().named(name).unwrap().clone()
}

pub(super) fn hand() -> Hand {
    Hand::read(&assets(), "wheelarm").unwrap()
}

fn quad(mesh: &mut Mesh, [a, b, c, d]: [Vec3; 4]) {
    for corners in [[a, b, c], [a, c, d]] {
        mesh.faces.push(Face {
            corners,
            uvs: None,
            surface: 0,
        });
    }
}

fn new_mesh() -> Mesh {
    Mesh {
        faces: Vec::new(),
        surfaces: vec![Surface::default()],
    }
}

/// A block with its base at the origin.
pub(super) fn block([x, y, z]: [f64; 3]) -> Mesh {
    let mut mesh = new_mesh();
    let at = |i: usize| {
        let side = |bit: usize, size: f64| {
            if i & bit == 0 {
                -size / 2.0
            } else {
                size / 2.0
            }
        };
        Vec3::new(side(1, x), side(2, y), side(4, z) + z / 2.0)
    };
    for [a, b, c, d] in [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [1, 3, 7, 5],
        [3, 2, 6, 7],
        [2, 0, 4, 6],
    ] {
        quad(&mut mesh, [a, b, c, d].map(at));
    }
    mesh
}

/// A surface that is round about z, from a closed profile of `[radius, z]`, in a
/// counter-clockwise direction with the radius to the right.
pub(super) fn lathe(profile: &[[f64; 2]]) -> Mesh {
    let mut mesh = new_mesh();
    let sides = 48;
    let at = |k: usize, [r, z]: [f64; 2]| {
        let (sin, cos) = exact::sin_cos(std::f64::consts::TAU * k as f64 / f64::from(sides));
        Vec3::new(r * cos, r * sin, z)
    };
    for pair in profile.windows(2) {
        for k in 0..sides as usize {
            quad(
                &mut mesh,
                [
                    at(k, pair[0]),
                    at(k + 1, pair[0]),
                    at(k + 1, pair[1]),
                    at(k, pair[1]),
                ],
            );
        }
    }
    mesh.faces.retain(|face| face.area() > 1e-12);
    mesh
}

fn cylinder(radius: f64, height: f64) -> Mesh {
    lathe(&[[0.0, 0.0], [radius, 0.0], [radius, height], [0.0, height]])
}

fn tumbler() -> Mesh {
    lathe(&[
        [0.0, 0.0],
        [0.030, 0.0],
        [0.036, 0.11],
        [0.033, 0.11],
        [0.027, 0.004],
        [0.0, 0.004],
    ])
}

/// The bytes of a GLB file of a mesh in metres.
fn glb_of(mesh: &Mesh) -> Vec<u8> {
    let corners = mesh
        .faces
        .iter()
        .map(|f| f.corners.map(|c| (c.into(), None)));
    crate::glb::write(&corners.collect::<Vec<_>>())
}

fn import_mesh(mesh: &Mesh, category: &str, options: &ObjectOptions) -> ImportedObject {
    try_import(mesh, category, options).unwrap_or_else(|error| panic!("{error}"))
}

fn try_import(
    mesh: &Mesh,
    category: &str,
    options: &ObjectOptions,
) -> Result<ImportedObject, ObjectError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("shape.glb");
    std::fs::write(&path, glb_of(mesh)).unwrap();
    let options = ObjectOptions {
        name: "shape".into(),
        category: category.into(),
        ..options.clone()
    };
    import(&path, &options, &categories(), &hand())
}

#[test]
fn cylinder_becomes_a_cylinder_with_round_grasps() {
    let options = ObjectOptions {
        license: Some("CC0-1.0".into()),
        author: Some("Ada".into()),
        ..ObjectOptions::default()
    };
    let found = import_mesh(&cylinder(0.033, 0.12), "can", &options);
    let file = &found.object.file;
    let collision = file.collision.as_ref().unwrap();
    assert_eq!(
        (found.summary.form.as_str(), collision.len()),
        ("cylinder", 1)
    );
    let round = collision[0].cylinder.as_ref().unwrap();
    assert!((round.radius - 0.033).abs() < 5e-4 && (round.height - 0.12).abs() < 1e-4);
    assert!(
        file.grasps.iter().any(|g| g.symmetric && g.name == "side"),
        "{file:?}"
    );
    assert_eq!(file.stock.as_ref().unwrap().yaw_deg, 180.0);
    assert_eq!(found.summary.notes, Vec::<String>::new());
    let pack = with_object(None, "cans", &found.object).unwrap();
    assert_eq!(pack.credits()[0].author, "Ada");
    assert!(pack.file("meshes/shape_0.glb").is_some());
    let again = with_object(Some(&pack), "cans", &found.object).unwrap();
    assert_eq!(again.id(), pack.id(), "the same object replaces itself");
}

#[test]
fn tumbler_becomes_an_open_cup() {
    let found = import_mesh(&tumbler(), "glass", &ObjectOptions::default());
    assert_eq!(found.summary.form, "cup");
    let collision = found.object.file.collision.unwrap();
    let cup = collision[0].cup.as_ref().unwrap();
    assert!((cup.bottom_radius - 0.030).abs() < 1e-3, "{cup:?}");
    assert!((cup.top_radius - 0.036).abs() < 1e-3, "{cup:?}");
    assert!((0.0025..0.0035).contains(&cup.wall), "{cup:?}");
    let mass = found.object.file.mass;
    assert!(
        (0.1..0.2).contains(&mass),
        "{mass} kg: two sides of a wall are one"
    );
    let notes = found.summary.notes.join("\n");
    assert!(notes.contains("give --license"), "{notes}");
}

#[test]
fn block_becomes_one_hull_and_its_grasps_face_the_robot() {
    let found = import_mesh(&block([0.05, 0.16, 0.20]), "box", &ObjectOptions::default());
    let file = &found.object.file;
    let collision = file.collision.as_ref().unwrap();
    assert_eq!((found.summary.form.as_str(), collision.len()), ("hull", 1));
    assert_eq!(collision[0].hull.as_ref().unwrap().len(), 8);
    assert!(
        (2..=16).contains(&file.grasps.len()),
        "{}",
        file.grasps.len()
    );
    for grasp in &file.grasps {
        assert!((grasp.width - 0.05).abs() < 2e-3, "{grasp:?}");
        let [a, c] = [grasp.approach, grasp.closing].map(Vec3::from);
        assert!((a.norm() - 1.0).abs() < 1e-3 && a.dot(&c).abs() < 1e-3);
    }
}

#[test]
fn bent_shape_becomes_several_hulls_of_few_corners() {
    let mut mesh = block([0.10, 0.03, 0.03]);
    let mut upright = block([0.03, 0.03, 0.10]);
    upright.map(false, |p| p + Vec3::new(-0.035, 0.0, 0.029));
    mesh.faces.extend(upright.faces);
    let found = import_mesh(&mesh, "tool", &ObjectOptions::default());
    let collision = found.object.file.collision.unwrap();
    assert_eq!(found.summary.form, "parts");
    assert!(
        (2..=convex::MOST_PARTS).contains(&collision.len()),
        "{}",
        collision.len()
    );
    for part in &collision {
        assert!(part.hull.as_ref().unwrap().len() <= convex::MOST_CORNERS);
    }
    let lowest = collision
        .iter()
        .flat_map(|part| part.hull.as_ref().unwrap());
    let lowest = lowest.fold(1.0_f64, |low, p| low.min(p[2]));
    assert!(lowest.abs() < 1e-9, "it stands on the ground: {lowest}");
}

#[test]
fn equal_files_give_equal_bytes() {
    let mesh = block([0.05, 0.16, 0.20]);
    let first = import_mesh(&mesh, "box", &ObjectOptions::default());
    let second = import_mesh(&mesh, "box", &ObjectOptions::default());
    assert_eq!(first.object, second.object);
}

#[test]
fn wrong_units_name_the_scale_that_helps() {
    let mut large = cylinder(0.0425, 0.1);
    large.map(false, |p| p * 1000.0);
    let error = try_import(&large, "mug", &ObjectOptions::default()).unwrap_err();
    assert_eq!(
        error.to_string(),
        "shape.glb is 100 m wide; --scale 0.001 makes it 100 mm"
    );
    let options = ObjectOptions {
        size: SizeOptions {
            scale: Some(0.001),
            ..SizeOptions::default()
        },
        ..ObjectOptions::default()
    };
    let found = import_mesh(&large, "mug", &options);
    assert!((found.summary.size[0] - 0.085).abs() < 1e-3);
}

#[test]
fn units_of_a_file_without_them_are_guessed_and_stated() {
    let mut text = String::from("solid can\n");
    for face in cylinder(33.0, 120.0).faces {
        text += "facet normal 0 0 0\nouter loop\n";
        for c in face.corners {
            text += &format!("vertex {} {} {}\n", c.x, c.y, c.z);
        }
        text += "endloop\nendfacet\n";
    }
    let source = parse("can.stl", text.as_bytes(), &|_| Err(String::new())).unwrap();
    let fit = size::fit(
        "can.stl",
        &source,
        &SizeOptions::default(),
        &category("can"),
    );
    let (_, sized) = fit.unwrap();
    assert_eq!(
        sized.words,
        "millimetres and z up, guessed from the usual size of a can"
    );
    assert!((sized.size[2] - 0.12).abs() < 1e-9);
    let fit = size::fit(
        "can.stl",
        &source,
        &SizeOptions::default(),
        &category("pan"),
    );
    let message = fit.err().map(|error| error.to_string()).unwrap_or_default();
    assert!(message.contains("--size X,Y,Z"), "{message}");
}

/// A block of millimetres in COLLADA, with a node that lifts it, and a red material.
fn collada() -> String {
    let mesh = block([50.0, 60.0, 80.0]);
    let corners = mesh.faces.iter().flat_map(|face| face.corners);
    let points: Vec<String> = corners
        .map(|c| format!("{} {} {}", c.x, c.y, c.z))
        .collect();
    let indices: Vec<String> = (0..points.len()).map(|k| k.to_string()).collect();
    format!(
        "<?xml version='1.0'?><COLLADA version='1.4.1'><asset><unit meter='0.001'/>\
         <up_axis>Z_UP</up_axis></asset>\
         <library_effects><effect id='e'><profile_COMMON><technique sid='c'><phong><diffuse>\
         <color>1 0 0 1</color></diffuse></phong></technique></profile_COMMON></effect></library_effects>\
         <library_materials><material id='m'><instance_effect url='#e'/></material></library_materials>\
         <library_geometries><geometry id='g'><mesh><source id='p'><float_array id='a' count='108'>{}\
         </float_array><technique_common><accessor stride='3'/></technique_common></source>\
         <vertices id='v'><input semantic='POSITION' source='#p'/></vertices>\
         <triangles material='s' count='12'><input semantic='VERTEX' source='#v' offset='0'/><p>{}</p>\
         </triangles></mesh></geometry></library_geometries>\
         <library_visual_scenes><visual_scene id='s'><node><translate>0 0 10</translate>\
         <instance_geometry url='#g'><bind_material><technique_common>\
         <instance_material symbol='s' target='#m'/></technique_common></bind_material>\
         </instance_geometry></node></visual_scene></library_visual_scenes>\
         <scene><instance_visual_scene url='#s'/></scene></COLLADA>",
        points.join(" "),
        indices.join(" ")
    )
}

#[test]
fn collada_states_units_axis_and_colors() {
    let text = collada();
    let none = |_: &str| Err(String::new());
    let source = parse("block.dae", text.as_bytes(), &none).unwrap();
    assert_eq!((source.metres, source.up), (Some(0.001), Up::Z));
    assert_eq!(source.mesh.surfaces[0].colour, [255, 0, 0]);
    let [low, high] = source.mesh.bounds();
    assert!((low.z - 10.0).abs() < 1e-9 && (high.z - 90.0).abs() < 1e-9);
    let options = ObjectOptions {
        name: "block".into(),
        category: "box".into(),
        ..ObjectOptions::default()
    };
    let found = import_bytes(
        "block.dae",
        text.as_bytes(),
        &options,
        &categories(),
        &hand(),
    );
    assert_eq!(found.unwrap().object.file.colour, "red");
    let cyclic = text.replace("<node>", "<node id='n'><instance_node url='#n'/>");
    let error = parse("block.dae", cyclic.as_bytes(), &none).unwrap_err();
    assert!(error.to_string().contains("tree of nodes"), "{error}");
}

#[test]
fn object_wider_than_the_gripper_is_scenery_and_states_its_width() {
    let found = import_mesh(&cylinder(0.06, 0.09), "teapot", &ObjectOptions::default());
    let notes = found.summary.notes.join("\n");
    assert!(
        notes.contains("narrowest graspable width 0.09") && notes.contains("opens 0.085 m"),
        "{notes}"
    );
    assert!(notes.contains("kept as scenery"), "{notes}");
    assert!(found.object.file.stock.unwrap().scenery);
    assert!(found.object.file.grasps.is_empty());
}

#[test]
fn unusual_mass_is_a_note_and_the_option_decides() {
    let options = ObjectOptions {
        mass: Some(2.5),
        ..ObjectOptions::default()
    };
    let found = import_mesh(&cylinder(0.033, 0.12), "can", &options);
    assert_eq!(found.object.file.mass, 2.5);
    let notes = found.summary.notes.join("\n");
    assert!(notes.contains("2.500 kg is not usual for a can"), "{notes}");
}

#[test]
fn every_category_has_what_tasks_need() {
    let categories = categories();
    assert!(categories.all().len() >= 25);
    let error = categories.named("mugs").unwrap_err().to_string();
    assert!(
        error.contains("no category named \"mugs\"; available: mug, cup"),
        "{error}"
    );
}

fn none(name: &str) -> Result<Vec<u8>, String> {
    Err(format!("{name:?} does not exist"))
}

/// The extents of a file with z up.
fn extents(name: &str, bytes: &[u8]) -> Vec3 {
    let source = parse(name, bytes, &none).unwrap_or_else(|error| panic!("{error}"));
    let [low, high] = source.mesh.bounds();
    source.up.upright((high - low).into()).abs()
}

#[test]
fn bodies_of_urdf_and_mjcf_are_one_mesh() {
    let urdf = "<robot name='cup'><link name='base'><visual><geometry><box size='0.1 0.06 0.02'/>\
        </geometry><material name='m'><color rgba='0 0 1 1'/></material></visual></link>\
        <link name='rod'><visual><origin xyz='0 0 0.05'/><geometry><cylinder radius='0.01' length='0.1'/>\
        </geometry></visual></link><joint name='j' type='fixed'><parent link='base'/><child link='rod'/>\
        <origin xyz='0 0 0.01' rpy='0 0 1.5708'/></joint></robot>";
    let found = extents("cup.urdf", urdf.as_bytes());
    assert!(
        (found - Vec3::new(0.1, 0.06, 0.12)).norm() < 1e-6,
        "{found}"
    );
    let circle = urdf.replace(
        "</robot>",
        "<joint name='k' type='fixed'><parent link='rod'/><child link='base'/></joint></robot>",
    );
    let error = parse("cup.urdf", circle.as_bytes(), &none).unwrap_err();
    assert!(error.to_string().contains("tree of links"), "{error}");
    let mjcf = "<mujoco><worldbody><body pos='0 0 0.1'><geom type='box' size='0.05 0.03 0.02'/>\
        <geom type='capsule' fromto='0 0 0 0 0 0.1' size='0.01'/><geom type='box' size='1 1 1' group='3'/>\
        </body></worldbody></mujoco>";
    let found = extents("cup.xml", mjcf.as_bytes());
    assert!(
        (found - Vec3::new(0.1, 0.06, 0.13)).norm() < 1e-6,
        "{found}"
    );
}

#[test]
fn unusual_spellings_of_obj_are_read() {
    let block = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n\
        f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";
    let one = Vec3::repeat(1.0);
    for text in [
        block.to_owned(),
        format!("\u{feff}{block}"),
        block.replace("f 1 4 ", "f 1 4 \\\n "),
        block.replace('\n', "\r\n"),
        format!("mtllib missing.mtl\n{block}"),
    ] {
        assert!(
            (extents("b.obj", text.as_bytes()) - one).norm() < 1e-9,
            "{text:?}"
        );
    }
    let latin = [b"# B\xfcro\n", block.as_bytes()].concat();
    assert!((extents("b.obj", &latin) - one).norm() < 1e-9);
}

#[test]
fn buffers_of_gltf_are_found_beside_it_and_circles_of_nodes_end() {
    let bytes: Vec<u8> = [[0.0f32, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.1]]
        .iter()
        .flatten()
        .flat_map(|c| c.to_le_bytes())
        .collect();
    let text = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
        "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[0.1,0.1,0.1]}],
        "bufferViews":[{"buffer":0,"byteLength":36}],
        "buffers":[{"byteLength":36,"uri":"my%20mug%20(red).bin"}]}"#;
    let beside = |name: &str| match name {
        "my mug (red).bin" => Ok(bytes.clone()),
        _ => none(name),
    };
    let source = parse("mug.gltf", text.as_bytes(), &beside).unwrap();
    assert_eq!(source.mesh.faces.len(), 1);
    let message = parse("mug.gltf", text.as_bytes(), &none)
        .unwrap_err()
        .to_string();
    assert!(message.contains("export one GLB file"), "{message}");
    let circle = text.replace(r#"[{"mesh":0}]"#, r#"[{"mesh":0,"children":[0]}]"#);
    let message = parse("mug.gltf", circle.as_bytes(), &beside)
        .unwrap_err()
        .to_string();
    assert!(message.contains("tree of nodes"), "{message}");
}

#[test]
fn damaged_files_are_errors_with_their_name() {
    for (name, bytes) in [
        ("a.glb", &b"glTF\x02\0\0\0\x04\0\0\0"[..]),
        ("a.gltf", b"{}"),
        ("a.obj", b"v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
        ("a.obj", b"v 0 0 0\n"),
        ("a.stl", b"solid a\nfacet\nouter loop\nvertex 0 x 0\n"),
        ("a.stl", b"short"),
        ("a.dae", b"<COLLADA/>"),
        ("a.dae", b"<a><b></a>"),
        ("a.urdf", b"<house/>"),
        ("a.ply", b"ply"),
        ("a", b""),
    ] {
        let message = parse(name, bytes, &none).unwrap_err().to_string();
        assert!(message.starts_with(name), "{message}");
    }
}
