//! Tests of the readers with real files, and of inputs that cannot be used.

use std::path::{Path, PathBuf};

use super::tests::{block, categories, hand, lathe};
use super::*;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn none(name: &str) -> Result<Vec<u8>, String> {
    Err(format!("{name:?} does not exist"))
}

fn size(source: &Source) -> Vec3 {
    let [low, high] = source.mesh.bounds();
    high - low
}

#[test]
fn bodies_of_robosuite_have_their_size_and_each_shape_once() {
    for (name, faces, wanted) in [
        ("bottle.xml", 132, [0.05511, 0.05855, 0.160]),
        ("milk.xml", 242, [0.03972, 0.03972, 0.144]),
    ] {
        let source = read::read(&root().join("tests/data/objects").join(name)).unwrap();
        assert_eq!(source.notes, Vec::<String>::new(), "{name}");
        assert!(
            source.mesh.faces.len() <= faces && 10 * source.mesh.faces.len() > 9 * faces,
            "{name}: {} triangles of {faces}",
            source.mesh.faces.len()
        );
        let found = size(&source);
        assert!(
            (found - Vec3::from(wanted)).norm() < 1e-4,
            "{name}: {found}"
        );
    }
    let options = ObjectOptions {
        name: "milk".into(),
        category: "carton".into(),
        ..ObjectOptions::default()
    };
    let path = root().join("tests/data/objects/milk.xml");
    let found = import(&path, &options, &categories(), &hand()).unwrap();
    assert!(!found.object.file.grasps.is_empty(), "{:?}", found.summary);
}

#[test]
fn urdf_of_the_robot_is_one_mesh_with_its_mesh_files() {
    let path = root().join("assets/robots/wheelarm/wheelarm.urdf");
    let source = read::read(&path).unwrap();
    assert_eq!(source.notes, Vec::<String>::new());
    assert!(
        source.mesh.faces.len() > 5_000,
        "{}",
        source.mesh.faces.len()
    );
    let found = size(&source);
    assert!(
        (0.8..1.8).contains(&found.x) && (0.8..2.0).contains(&found.z),
        "{found}"
    );
}

#[test]
fn classes_of_mjcf_decide_size_and_what_is_rendered() {
    let text = "<mujoco><default><geom type='box'/><default class='visual'><geom group='2' \
        contype='0' conaffinity='0' size='0.02 0.03 0.04'/></default></default><worldbody>\
        <body childclass='visual'><geom/><geom class='main' size='1 1 1'/></body></worldbody></mujoco>";
    let source = parse("a.xml", text.as_bytes(), &none).unwrap();
    assert_eq!(source.mesh.faces.len(), 12);
    assert!((size(&source) - Vec3::new(0.04, 0.06, 0.08)).norm() < 1e-9);
}

#[test]
fn missing_mesh_of_a_body_is_named() {
    let text = "<mujoco><compiler meshdir='../files'/><asset><mesh name='m' file='cup.stl'/></asset>\
        <worldbody><body><geom type='mesh' mesh='m'/></body></worldbody></mujoco>";
    let message = parse("a.xml", text.as_bytes(), &none)
        .unwrap_err()
        .to_string();
    assert!(
        message.contains("cup.stl") && message.contains("does not exist"),
        "{message}"
    );
    let urdf = "<robot name='r'><link name='l'><visual><geometry>\
        <mesh filename='package://a/meshes/cup.stl'/></geometry></visual></link></robot>";
    let beside = |name: &str| match name {
        "a/meshes/cup.stl" => Ok(
            b"solid a\nfacet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n\
            vertex 0 1 1\nendloop\nendfacet\n"
                .to_vec(),
        ),
        _ => none(name),
    };
    let source = parse("r.urdf", urdf.as_bytes(), &beside).unwrap();
    assert_eq!(source.mesh.faces.len(), 1);
}

#[test]
fn hole_of_a_mesh_is_a_note_with_its_place() {
    let mut mesh = block([0.05, 0.06, 0.10]);
    mesh.faces.pop();
    let note = open_note(&mesh).unwrap();
    assert!(
        note.contains("3 open edges") && note.contains("close them"),
        "{note}"
    );
    assert_eq!(open_note(&block([0.05, 0.06, 0.10])), None);
}

#[test]
fn vertex_that_is_not_a_number_is_named() {
    let text = "v 0 0 0\nv 0.1 nan 0\nv 0 0.1 0.1\nf 1 2 3\n";
    let message = parse("cup.obj", text.as_bytes(), &none)
        .unwrap_err()
        .to_string();
    assert!(
        message.starts_with("cup.obj") && message.contains("export it again"),
        "{message}"
    );
    let mut file: Vec<u8> = [3_i32, 0, 0, 1]
        .iter()
        .flat_map(|n| n.to_le_bytes())
        .collect();
    let numbers = [0.0_f32, 0.0, 0.0, f32::NAN, 0.0, 0.0, 0.0, 0.1, 0.1];
    file.extend(numbers.iter().flat_map(|n| n.to_le_bytes()));
    file.extend([0_i32, 1, 2].iter().flat_map(|n| n.to_le_bytes()));
    let message = parse("cup.msh", &file, &none).unwrap_err().to_string();
    assert!(message.contains("finite numbers"), "{message}");
    file.pop();
    let message = parse("cup.msh", &file, &none).unwrap_err().to_string();
    assert!(message.contains("do not match its counts"), "{message}");
}

#[test]
fn plate_is_grasped_at_its_rim_and_a_full_one_is_scenery() {
    let plate = |inner: f64| {
        lathe(&[
            [0.0, 0.0],
            [0.084, 0.0],
            [0.088, 0.036],
            [0.0845, 0.036],
            [0.080, inner],
            [0.0, inner],
        ])
    };
    let grasps = |mesh: &Mesh| {
        let about = Vec3::new(0.0, 0.0, 0.015);
        grasps::sampled(mesh, &about, &hand(), true).kept
    };
    let kept = grasps(&plate(0.004));
    assert!(kept.iter().any(|grasp| grasp.name == RIM), "{kept:?}");
    assert_eq!(grasps(&plate(0.034)), Vec::new());
}

#[test]
fn straight_part_of_a_bottle_is_grasped_before_its_cone() {
    // As heavy above the cone as below it.
    let bottle = lathe(&[
        [0.0, 0.0],
        [0.024, 0.0],
        [0.034, 0.110],
        [0.034, 0.180],
        [0.0, 0.180],
    ]);
    let about = Vec3::new(0.0, 0.0, 0.105);
    let kept = grasps::sampled(&bottle, &about, &hand(), true).kept;
    let side = kept.iter().find(|grasp| grasp.name == "side").unwrap();
    assert!(side.point[2] > 0.112, "{kept:?}");
}
