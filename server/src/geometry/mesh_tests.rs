//! Tests of every mesh: closed, outward orientation, correct volume, unit normals.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use nalgebra::Vector3;

use super::super::{Shape, TriMesh};
use super::{Detail, MeshError, build, build_detail, load};

fn volume(mesh: &TriMesh) -> f64 {
    let point = |i: u32| Vector3::from(mesh.positions[i as usize]).cast::<f64>();
    mesh.indices
        .chunks_exact(3)
        .map(|t| point(t[0]).dot(&point(t[1]).cross(&point(t[2]))) / 6.0)
        .sum()
}

/// Every edge occurs once in each direction: no hole, no flipped triangle.
fn is_closed(mesh: &TriMesh) -> bool {
    let key = |i: u32| mesh.positions[i as usize].map(|x| (f64::from(x) * 1e6).round() as i64);
    let mut edges: BTreeMap<_, i32> = BTreeMap::new();
    for t in mesh.indices.chunks_exact(3) {
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            *edges.entry((key(a), key(b))).or_default() += 1;
            *edges.entry((key(b), key(a))).or_default() -= 1;
        }
    }
    edges.values().all(|&n| n == 0)
}

#[test]
fn every_shape_is_a_closed_solid_of_the_right_volume() {
    use std::f64::consts::PI;
    let frustum = |a: f64, b: f64, h: f64| PI * h * (a * a + a * b + b * b) / 3.0;
    let shapes = [
        (
            Shape::Cuboid {
                half: [0.1, 0.2, 0.3],
            },
            0.048,
        ),
        (
            Shape::RoundedCuboid {
                half: [0.1, 0.2, 0.3],
                radius: 0.02,
            },
            // Core, six slabs, twelve quarter cylinders, one sphere.
            0.16 * 0.36 * 0.56
                + 2.0 * 0.02 * (0.16 * 0.36 + 0.16 * 0.56 + 0.36 * 0.56)
                + PI * 0.02f64.powi(2) * (0.16 + 0.36 + 0.56)
                + 4.0 / 3.0 * PI * 0.02f64.powi(3),
        ),
        (
            Shape::Cylinder {
                radius: 0.1,
                half_height: 0.2,
            },
            PI * 0.01 * 0.4,
        ),
        (
            Shape::Capsule {
                radius: 0.1,
                half_height: 0.2,
            },
            PI * 0.01 * 0.4 + 4.0 / 3.0 * PI * 0.001,
        ),
        (Shape::Sphere { radius: 0.1 }, 4.0 / 3.0 * PI * 0.001),
        (
            Shape::Frustum {
                bottom_radius: 0.1,
                top_radius: 0.0,
                half_height: 0.1,
            },
            frustum(0.1, 0.0, 0.2),
        ),
        (
            Shape::Cup {
                bottom_radius: 0.03,
                top_radius: 0.039,
                height: 0.105,
                wall: 0.003,
            },
            frustum(0.03, 0.039, 0.105) - frustum(0.027, 0.036, 0.102),
        ),
        (
            // From the top down and open: reversed and closed.
            Shape::Lathe {
                profile: vec![[0.02, 0.3], [0.05, 0.1], [0.05, 0.0]],
            },
            frustum(0.05, 0.02, 0.2) + PI * 0.0025 * 0.1,
        ),
        (
            // A ring that does not touch the axis.
            Shape::Lathe {
                profile: vec![[0.2, 0.0], [0.3, 0.0], [0.3, 0.1], [0.2, 0.1], [0.2, 0.0]],
            },
            PI * 0.05 * 0.1,
        ),
    ];
    for (shape, expected) in shapes {
        for (detail, tolerance) in [(Detail::Full, 0.03), (Detail::Coarse, 0.13)] {
            let mesh = build_detail(&shape, Path::new("."), detail).unwrap();
            assert!(is_closed(&mesh), "{shape:?} {detail:?} has a hole");
            let found = volume(&mesh);
            assert!(
                (found / expected - 1.0).abs() < tolerance,
                "{shape:?} {detail:?}: volume {found}, expected {expected}"
            );
            for t in mesh.indices.chunks_exact(3) {
                let [a, b, c] =
                    [t[0], t[1], t[2]].map(|i| Vector3::from(mesh.positions[i as usize]));
                let face = (b - a).cross(&(c - a)).normalize();
                for &i in t {
                    let n = Vector3::from(mesh.normals[i as usize]);
                    assert!((n.norm() - 1.0).abs() < 1e-4, "{shape:?}: normal {n:?}");
                    assert!(
                        n.dot(&face) > 0.5,
                        "{shape:?}: normal {n:?} on face {face:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn texture_coordinates_of_flat_faces_are_metres() {
    let mesh = build(
        &Shape::Cuboid {
            half: [0.1, 0.2, 0.3],
        },
        Path::new("."),
    )
    .unwrap();
    for t in mesh.indices.chunks_exact(3) {
        let [p, q] = [t[0], t[1]].map(|i| Vector3::from(mesh.positions[i as usize]));
        let [u, v] = [t[0], t[1]].map(|i| mesh.uvs[i as usize]);
        let distance = (u[0] - v[0]).hypot(u[1] - v[1]);
        assert!(((p - q).norm() - distance).abs() < 1e-6);
    }
}

#[test]
fn impossible_sizes_are_refused_with_both_values() {
    let shape = Shape::RoundedCuboid {
        half: [0.1, 0.2, 0.05],
        radius: 0.06,
    };
    let text = build(&shape, Path::new(".")).unwrap_err().to_string();
    assert!(text.contains("0.06") && text.contains("0.05"), "{text}");
    for bad in [
        Shape::Sphere { radius: f64::NAN },
        Shape::Cuboid {
            half: [0.1, 0.0, 0.1],
        },
        Shape::Lathe {
            profile: vec![[0.1, 0.0]],
        },
        Shape::Cup {
            bottom_radius: 0.03,
            top_radius: 0.03,
            height: 0.1,
            wall: 0.03,
        },
    ] {
        assert!(
            matches!(build(&bad, Path::new(".")), Err(MeshError::BadShape { .. })),
            "{bad:?}"
        );
    }
}

const CUBE: &str = "o a\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n\
    f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

#[test]
fn an_obj_file_without_normals_gets_sharp_ones() {
    let dir = tempfile_dir("obj");
    fs::write(dir.join("cube.obj"), CUBE).unwrap();
    let shape = Shape::Mesh {
        path: "cube.obj".into(),
        scale: 0.5,
    };
    let mesh = build(&shape, &dir).unwrap();
    assert!((volume(&mesh) - 0.125).abs() < 1e-6);
    assert!(is_closed(&mesh));
    let axis = |n: &[f32; 3]| n.iter().filter(|x| x.abs() > 0.999).count() == 1;
    assert!(mesh.normals.iter().all(axis));
    fs::remove_dir_all(dir).unwrap();
}

#[test]
fn a_gltf_file_is_converted_from_y_up_and_posed_by_its_nodes() {
    // One triangle (0,0,0) (1,0,0) (0,1,0) in a node moved by (0, 2, 0).
    let mut bytes = Vec::new();
    for x in [0f32, 0., 0., 1., 0., 0., 0., 1., 0.] {
        bytes.extend(x.to_le_bytes());
    }
    let dir = tempfile_dir("gltf");
    fs::write(dir.join("t.bin"), &bytes).unwrap();
    let text = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],
        "nodes":[{"mesh":0,"translation":[0,2,0]}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
        "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}],
        "bufferViews":[{"buffer":0,"byteLength":36}],"buffers":[{"byteLength":36,"uri":"t.bin"}]}"#;
    fs::write(dir.join("t.gltf"), text).unwrap();
    let base64 = text.replace(
        "t.bin",
        "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA",
    );
    fs::write(dir.join("inside.gltf"), base64).unwrap();
    let mesh = load(&dir.join("t.gltf")).unwrap();
    assert_eq!(mesh, load(&dir.join("inside.gltf")).unwrap());
    assert_eq!(mesh.positions, [[0., 0., 2.], [1., 0., 2.], [0., 0., 3.]]);
    for n in &mesh.normals {
        assert!((n[1] + 1.0).abs() < 1e-6, "{n:?}");
    }
    fs::remove_dir_all(dir).unwrap();
}

#[test]
fn unusable_files_are_named_with_the_reason() {
    let dir = tempfile_dir("bad");
    let cases: [(&str, &str, &str); 6] = [
        (
            "nan.obj",
            "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
            "not finite",
        ),
        ("points.obj", "v 0 0 0\nv 1 0 0\n", "no triangles"),
        ("index.obj", "v 0 0 0\nv 1 0 0\nf 1 2 9\n", "index.obj"),
        ("broken.gltf", "{", "not a valid glTF"),
        (
            "short.glb",
            "glTF\u{2}\0\0\0\u{b}\0\0\0",
            "its header says 11 bytes",
        ),
        ("part.stl", "solid", "expected obj, gltf or glb"),
    ];
    for (name, text, expected) in cases {
        fs::write(dir.join(name), text).unwrap();
        let error = load(&dir.join(name)).unwrap_err().to_string();
        assert!(
            error.contains(name) && error.contains(expected),
            "{name}: {error}"
        );
    }
    let error = load(&dir.join("missing.obj")).unwrap_err().to_string();
    assert!(
        error.contains("missing.obj") && error.contains("cannot be read"),
        "{error}"
    );
    fs::remove_dir_all(dir).unwrap();
}

/// A cube of 6 cm, as imported from any exporter.
fn is_cube(path: &Path) {
    let mesh = load(path).unwrap();
    assert_eq!(mesh.indices.len(), 36, "{}", path.display());
    assert!(is_closed(&mesh), "{}", path.display());
    assert!(
        (volume(&mesh) - 0.06_f64.powi(3)).abs() < 1e-9,
        "{}",
        path.display()
    );
}

#[test]
fn obj_files_with_a_mark_another_encoding_or_continued_lines_are_read() {
    let dir = tempfile_dir("obj");
    let mut body = String::new();
    for corner in 0..8 {
        let at = |bit: i32| if corner & bit == 0 { -0.03 } else { 0.03 };
        body += &format!("v {} {} {}\n", at(4), at(2), at(1));
    }
    for face in [
        "1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4",
    ] {
        body += &format!("f {face}\n");
    }
    let cases = [
        (
            "bom.obj",
            [b"\xef\xbb\xbf".as_slice(), body.as_bytes()].concat(),
        ),
        (
            "latin1.obj",
            [b"# B\xfcro\no Caf\xe9\n".as_slice(), body.as_bytes()].concat(),
        ),
        (
            "continued.obj",
            body.replace(" 4 3", " \\\r\n 4 3").into_bytes(),
        ),
        ("lines.obj", format!("{body}l 1 2\np 1\n").into_bytes()),
    ];
    for (name, text) in cases {
        fs::write(dir.join(name), text).unwrap();
        is_cube(&dir.join(name));
    }
    fs::write(dir.join("wide.obj"), b"\xff\xfev\0").unwrap();
    let error = load(&dir.join("wide.obj")).unwrap_err().to_string();
    assert!(error.contains("save the file as UTF-8"), "{error}");
    fs::remove_dir_all(dir).unwrap();
}

#[test]
fn gltf_strips_fans_and_encoded_names_are_read_and_node_graphs_end() {
    let dir = tempfile_dir("gltf");
    let mut bytes = Vec::new();
    for corner in 0..8 {
        for bit in [4, 2, 1] {
            let at: f32 = if corner & bit == 0 { -0.03 } else { 0.03 };
            bytes.extend(at.to_le_bytes());
        }
    }
    // The faces once as strips of four corners, once as fans.
    let strips: [[u16; 4]; 6] = [
        [0, 1, 2, 3],
        [4, 6, 5, 7],
        [0, 4, 1, 5],
        [2, 3, 6, 7],
        [0, 2, 4, 6],
        [1, 5, 3, 7],
    ];
    for strip in strips {
        bytes.extend(strip.iter().flat_map(|i| i.to_le_bytes()));
    }
    for [a, b, c, d] in strips {
        bytes.extend([a, b, d, c].iter().flat_map(|i| i.to_le_bytes()));
    }
    fs::write(dir.join("my mug (red).bin"), &bytes).unwrap();
    let file = |mode: usize, nodes: &str| {
        let first = if mode == 5 { 1 } else { 7 };
        let primitive = |k| {
            format!(
                r#"{{"attributes":{{"POSITION":0}},"indices":{},"mode":{mode}}}"#,
                k + first
            )
        };
        let primitives: Vec<String> = (0..6).map(primitive).collect();
        let view = |k: usize| {
            format!(
                r#"{{"buffer":0,"byteOffset":{},"byteLength":8}}"#,
                96 + 8 * k
            )
        };
        let views: Vec<String> = (0..12).map(view).collect();
        let list = |k| {
            format!(
                r#"{{"bufferView":{},"componentType":5123,"count":4,"type":"SCALAR"}}"#,
                k + 1
            )
        };
        let lists: Vec<String> = (0..12).map(list).collect();
        format!(
            r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":{nodes},
            "meshes":[{{"primitives":[{}]}}],
            "buffers":[{{"byteLength":192,"uri":"my%20mug%20%28red%29.bin"}}],
            "bufferViews":[{{"buffer":0,"byteLength":96}},{}],
            "accessors":[{{"bufferView":0,"componentType":5126,"count":8,"type":"VEC3",
                "min":[-0.03,-0.03,-0.03],"max":[0.03,0.03,0.03]}},{}]}}"#,
            primitives.join(","),
            views.join(","),
            lists.join(",")
        )
    };
    let path = dir.join("mug.gltf");
    for mode in [5, 6] {
        fs::write(&path, file(mode, r#"[{"mesh":0}]"#)).unwrap();
        is_cube(&path);
    }
    // A node with zero scale adds nothing.
    let hidden = r#"[{"mesh":0,"children":[1]},{"mesh":0,"scale":[0,0,0]}]"#;
    fs::write(&path, file(5, hidden)).unwrap();
    is_cube(&path);
    for (nodes, index) in [
        (r#"[{"mesh":0,"children":[1]},{"children":[0]}]"#, 0),
        (r#"[{"children":[1,1]},{"mesh":0}]"#, 1),
        (r#"[{"children":[0]}]"#, 0),
    ] {
        fs::write(&path, file(5, nodes)).unwrap();
        let error = load(&path).unwrap_err().to_string();
        assert!(
            error.contains(&format!("node {index} has two parents")),
            "{error}"
        );
    }
    fs::remove_dir_all(dir).unwrap();
}

fn tempfile_dir(name: &str) -> std::path::PathBuf {
    let dir = std::env::temp_dir().join(format!("wheelarm-mesh-{name}-{}", std::process::id()));
    fs::create_dir_all(&dir).unwrap();
    dir
}
