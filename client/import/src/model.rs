//! Models of furniture: OBJ files with their MTL files, as triangles with materials and groups.

use std::collections::BTreeMap;
use std::path::Path;

use crate::archive::Archive;
use crate::error::{ImportError, ModelError};
use crate::polygon;
use crate::sh3d::{Rgb, default_colour, transparency};

/// Largest number of triangles of a model.
pub(crate) const MOST_TRIANGLES: usize = 500_000;
/// Largest number of materials or groups of a model.
const MOST_NAMES: usize = 4_096;
/// Largest absolute coordinate of a model.
const LARGEST: f32 = 1.0e7;
/// Color of materials without one.
const GREY: Rgb = [190, 190, 190];

/// A material of a model.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ModelMaterial {
    /// Name.
    pub name: String,
    /// Diffuse color.
    pub colour: Rgb,
    /// From 0 (opaque) to 1.
    pub transparency: f64,
    /// 0 (matt) to 1.
    pub shininess: f64,
    /// Path of its image in the archive.
    pub image: Option<String>,
}

/// A triangle: its corners, texture coordinates, material and group.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle {
    /// Indices of positions.
    pub corners: [u32; 3],
    /// Texture coordinates, v upwards; none when the file has none.
    pub uvs: Option<[[f32; 2]; 3]>,
    /// Index of the material.
    pub material: u32,
    /// Index of the group.
    pub group: u32,
}

/// A model in units of its file, y up.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Model {
    /// Positions of the corners.
    pub positions: Vec<[f64; 3]>,
    /// Triangles.
    pub triangles: Vec<Triangle>,
    /// Materials, in order of use.
    pub materials: Vec<ModelMaterial>,
    /// Names of groups.
    pub groups: Vec<String>,
}

/// Reads the model at `path`, with its materials.
///
/// # Errors
/// The inner error concerns the model alone; the outer one the archive.
pub fn read(archive: &mut Archive, path: &str) -> Result<Result<Model, ModelError>, ImportError> {
    let Some(bytes) = archive.read(path)? else {
        return Ok(Err(ModelError::Missing(path.to_owned())));
    };
    if let Some(format) = other_format(path, &bytes) {
        return Ok(Err(ModelError::Format {
            model: path.to_owned(),
            format,
        }));
    }
    let text = String::from_utf8_lossy(&bytes).replace("\\\n", " ");
    let text = text.trim_start_matches('\u{feff}');
    let mut defined = BTreeMap::new();
    for library in statements(text, "mtllib") {
        let beside = beside(path, library);
        if let Some(bytes) = archive.read(&beside)? {
            let text = String::from_utf8_lossy(&bytes).into_owned();
            for material in materials(&text, &beside) {
                defined.insert(material.name.clone(), material);
            }
        }
    }
    let model = parse(text, &defined).map_err(|reason| ModelError::Malformed {
        model: path.to_owned(),
        reason,
    });
    Ok(model)
}

/// The name of a format that is not OBJ, by the ending of its name or by its first bytes.
fn other_format(path: &str, bytes: &[u8]) -> Option<&'static str> {
    let ending = path.rsplit_once('.').map(|(_, ending)| ending);
    match ending.map(str::to_ascii_lowercase).as_deref() {
        Some("dae") => return Some("COLLADA"),
        Some("3ds") => return Some("3DS"),
        Some("kmz") => return Some("KMZ"),
        Some("lws" | "lwo") => return Some("LightWave"),
        Some("zip") => return Some("a zip archive"),
        _ => {}
    }
    match bytes {
        [b'P', b'K', 3, 4, ..] => Some("a zip archive"),
        [b'M', b'M', ..] => Some("3DS"),
        [b'<', ..] => Some("COLLADA"),
        _ => None,
    }
}

/// The path of a file that is named in the file at `path`.
fn beside(path: &str, name: &str) -> String {
    let name = name.trim().trim_start_matches("./").replace('\\', "/");
    match path.rsplit_once('/') {
        Some((folder, _)) => format!("{folder}/{name}"),
        None => name,
    }
}

/// The arguments of all statements of this name.
pub(crate) fn statements<'a>(text: &'a str, name: &'a str) -> impl Iterator<Item = &'a str> {
    text.lines().filter_map(move |line| {
        let rest = line.trim_start().strip_prefix(name)?;
        rest.starts_with([' ', '\t']).then(|| rest.trim())
    })
}

/// Materials of an MTL file. Values that are not numbers are passed over.
pub(crate) fn materials(text: &str, path: &str) -> Vec<ModelMaterial> {
    let mut all: Vec<ModelMaterial> = Vec::new();
    for line in text.lines() {
        let line = line.trim();
        let (statement, rest) = line.split_once([' ', '\t']).unwrap_or((line, ""));
        let rest = rest.trim();
        if statement == "newmtl" {
            if all.len() == MOST_NAMES {
                break;
            }
            all.push(ModelMaterial {
                name: rest.to_owned(),
                colour: default_colour(rest).unwrap_or(GREY),
                ..ModelMaterial::default()
            });
            continue;
        }
        let Some(material) = all.last_mut() else {
            continue;
        };
        let numbers: Vec<f64> = rest
            .split_whitespace()
            .filter_map(|word| word.parse().ok())
            .filter(|number: &f64| number.is_finite())
            .collect();
        match (statement, numbers.as_slice()) {
            ("Kd", &[red, green, blue, ..]) => {
                material.colour = [red, green, blue].map(|c| (c.clamp(0.0, 1.0) * 255.0) as u8);
            }
            ("d", &[opacity, ..]) => material.transparency = 1.0 - opacity.clamp(0.0, 1.0),
            ("Tr", &[share, ..]) => material.transparency = share.clamp(0.0, 1.0),
            ("Ns", &[exponent, ..]) => {
                material.shininess = (exponent / 128.0).clamp(0.0, 1.0);
            }
            ("map_Kd", _) => {
                // Options precede the name.
                let name = rest.split_whitespace().last().unwrap_or_default();
                material.image = Some(beside(path, name));
            }
            _ => {}
        }
    }
    all
}

/// Parses the text of an OBJ file. `defined` are the materials of its MTL files.
///
/// # Errors
/// When it is not valid, has no triangle, or is above a limit.
pub fn parse(text: &str, defined: &BTreeMap<String, ModelMaterial>) -> Result<Model, String> {
    // The library resolves names with an MTL file only: here one is announced in front, and
    // all used names are materials of it.
    let mut names: Vec<&str> = Vec::new();
    for name in statements(text, "usemtl") {
        if !names.contains(&name) {
            names.push(name);
        }
        if names.len() > MOST_NAMES {
            return Err(format!("more than {MOST_NAMES} materials"));
        }
    }
    let lines = text.lines().filter(|line| !line.starts_with("mtllib"));
    let mut announced = String::with_capacity(text.len() + 16);
    announced.push_str("mtllib all\n");
    for line in lines {
        announced.push_str(line);
        announced.push('\n');
    }
    let options = tobj::LoadOptions {
        single_index: false,
        triangulate: false,
        ignore_points: true,
        ignore_lines: true,
    };
    let known = |_: &Path| {
        let of = |name: &&str| tobj::Material {
            name: (*name).to_owned(),
            ..tobj::Material::default()
        };
        let materials: Vec<_> = names.iter().map(of).collect();
        let indices = names.iter().enumerate();
        let indices = indices.map(|(i, name)| ((*name).to_owned(), i)).collect();
        Ok((materials, indices))
    };
    let (parts, _) = tobj::load_obj_buf(&mut announced.as_bytes(), &options, known)
        .map_err(|error| format!("not a valid OBJ file ({error})"))?;

    let mut model = Model {
        materials: names.iter().map(|name| resolve(name, defined)).collect(),
        ..Model::default()
    };
    let default = u32::try_from(names.len()).unwrap_or(u32::MAX);
    model.materials.push(resolve("default", defined));
    for part in parts {
        let group = match model.groups.iter().position(|name| *name == part.name) {
            Some(group) => group,
            None if model.groups.len() == MOST_NAMES => {
                return Err(format!("more than {MOST_NAMES} groups"));
            }
            None => {
                model.groups.push(part.name.clone());
                model.groups.len() - 1
            }
        };
        let material = part.mesh.material_id.and_then(|id| u32::try_from(id).ok());
        add(
            &mut model,
            &part.mesh,
            material.unwrap_or(default),
            group as u32,
        )?;
    }
    if model.triangles.is_empty() {
        return Err("it has no triangles".into());
    }
    Ok(model)
}

fn resolve(name: &str, defined: &BTreeMap<String, ModelMaterial>) -> ModelMaterial {
    defined.get(name).cloned().unwrap_or_else(|| ModelMaterial {
        name: name.to_owned(),
        colour: default_colour(name).unwrap_or(GREY),
        transparency: transparency(name),
        ..ModelMaterial::default()
    })
}

fn add(model: &mut Model, mesh: &tobj::Mesh, material: u32, group: u32) -> Result<(), String> {
    let first = model.positions.len() as u32;
    let (points, _) = mesh.positions.as_chunks::<3>();
    for point in points {
        if point.iter().any(|c| !c.is_finite() || c.abs() > LARGEST) {
            return Err(format!(
                "a vertex at {point:?}, expected finite numbers; export it again"
            ));
        }
        model.positions.push(point.map(f64::from));
    }
    let (uvs, _) = mesh.texcoords.as_chunks::<2>();
    let arities: Vec<usize> = if mesh.face_arities.is_empty() {
        vec![3; mesh.indices.len() / 3]
    } else {
        mesh.face_arities.iter().map(|&a| a as usize).collect()
    };
    let mut start = 0;
    for arity in arities {
        let corners = mesh.indices.get(start..start + arity).unwrap_or_default();
        let mapped = mesh.texcoord_indices.get(start..start + arity);
        start += arity;
        if corners.iter().any(|&c| c as usize >= points.len()) {
            return Err("a face names a vertex that does not exist".into());
        }
        if arity < 3 || corners.len() < 3 {
            continue;
        }
        if model.triangles.len() + arity > MOST_TRIANGLES {
            return Err(format!(
                "more than {MOST_TRIANGLES} triangles; simplify the model"
            ));
        }
        let at = |k: usize| uvs.get(*mapped?.get(k)? as usize).copied();
        let face: Vec<[f64; 3]> = corners
            .iter()
            .map(|&corner| points[corner as usize].map(f64::from))
            .collect();
        for [a, b, c] in triangulate(&face) {
            let of = [a, b, c].map(at);
            let of = match of {
                [Some(a), Some(b), Some(c)] => Some([a, b, c]),
                _ => None,
            };
            model.triangles.push(Triangle {
                corners: [a, b, c].map(|k| corners[k] + first),
                uvs: of.filter(|uvs| uvs.iter().flatten().all(|c| c.is_finite())),
                material,
                group,
            });
        }
    }
    Ok(())
}

/// Largest number of corners of a face whose ears are cut; others become a fan.
const MOST_CORNERS: usize = 256;

/// Triangles of a plane face, by cutting its ears: frames of doors are one face around their
/// opening.
fn triangulate(face: &[[f64; 3]]) -> Vec<[usize; 3]> {
    let count = face.len();
    let fan = || (1..count - 1).map(|k| [0, k, k + 1]).collect();
    if count == 3 || count > MOST_CORNERS {
        return fan();
    }
    // Newell's normal; the plane of its largest component keeps the orientation.
    let mut normal = [0.0; 3];
    for (i, a) in face.iter().enumerate() {
        let b = face[(i + 1) % count];
        for (k, sum) in normal.iter_mut().enumerate() {
            let (m, n) = ((k + 1) % 3, (k + 2) % 3);
            *sum += (a[m] - b[m]) * (a[n] + b[n]);
        }
    }
    let largest = |best: usize, k: usize| {
        if normal[k].abs() > normal[best].abs() {
            k
        } else {
            best
        }
    };
    let axis = [1, 2].into_iter().fold(0, largest);
    let (m, n) = ((axis + 1) % 3, (axis + 2) % 3);
    let sign = normal[axis].signum();
    // Newell's sum above is negative for a counter-clockwise face of this plane's order.
    let flat: Vec<[f64; 2]> = face.iter().map(|p| [p[m], p[n] * -sign]).collect();
    let flat = if polygon::area(&flat) < 0.0 {
        face.iter().map(|p| [p[m], p[n] * sign]).collect()
    } else {
        flat
    };
    let mut left: Vec<usize> = (0..count).collect();
    let mut triangles = Vec::with_capacity(count - 2);
    while left.len() > 3 {
        let size = left.len();
        let ear = (0..size).find(|&k| {
            let (a, b, c) = (left[(k + size - 1) % size], left[k], left[(k + 1) % size]);
            let is_convex = polygon::cross(flat[a], flat[b], flat[c]) > 0.0;
            let is_inside = |p: [f64; 2]| {
                polygon::cross(flat[a], flat[b], p) >= 0.0
                    && polygon::cross(flat[b], flat[c], p) >= 0.0
                    && polygon::cross(flat[c], flat[a], p) >= 0.0
            };
            let corners = [flat[a], flat[b], flat[c]];
            is_convex
                && !left
                    .iter()
                    .any(|&k| !corners.contains(&flat[k]) && is_inside(flat[k]))
        });
        // A face that is not plane or crosses itself has no ear: its flattest corner goes.
        let ear = ear.unwrap_or_else(|| {
            let flatness = |k: usize| {
                let (a, b, c) = (left[(k + size - 1) % size], left[k], left[(k + 1) % size]);
                polygon::cross(flat[a], flat[b], flat[c]).abs()
            };
            (0..size)
                .min_by(|&a, &b| flatness(a).total_cmp(&flatness(b)))
                .unwrap_or(0)
        });
        let (a, b, c) = (
            left[(ear + size - 1) % size],
            left[ear],
            left[(ear + 1) % size],
        );
        triangles.push([a, b, c]);
        left.remove(ear);
    }
    triangles.push([left[0], left[1], left[2]]);
    triangles
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: &str = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n\
        g board\nusemtl white\nf 1 2 3 4\ng knob\nusemtl own\nf -4 -3 -2\n";

    #[test]
    fn groups_and_materials_of_triangles_are_kept() {
        let own = materials("newmtl own\nKd 1 0 0\nd 0.25\n", "x/a.mtl");
        let defined = own.into_iter().map(|m| (m.name.clone(), m)).collect();
        let model = parse(SQUARE, &defined).unwrap();
        assert_eq!(model.groups, ["board", "knob"]);
        assert_eq!(model.triangles.len(), 3);
        let last = model.triangles[2];
        assert_eq!(model.groups[last.group as usize], "knob");
        let material = &model.materials[last.material as usize];
        assert_eq!(material.colour, [255, 0, 0]);
        assert!((material.transparency - 0.75).abs() < 1e-9);
        assert_eq!(model.materials[0].colour, [255; 3], "a built-in color");
    }

    #[test]
    fn frame_of_a_door_leaves_its_opening_free() {
        let frame = [
            [0.0, 0.0],
            [0.1, 0.0],
            [0.1, 1.9],
            [0.9, 1.9],
            [0.9, 0.0],
            [1.0, 0.0],
            [1.0, 2.0],
            [0.0, 2.0],
        ];
        for turn in [false, true] {
            let mut face: Vec<[f64; 3]> = frame.iter().map(|&[x, y]| [x, y, 0.3]).collect();
            if turn {
                face.reverse();
            }
            let triangles = triangulate(&face);
            let sum: f64 = triangles
                .iter()
                .map(|t| polygon::area(&t.map(|k| [face[k][0], face[k][1]])))
                .sum();
            let whole = 2.0 - 0.8 * 1.9;
            let expected = if turn { -whole } else { whole };
            assert!((sum - expected).abs() < 1e-9, "orientation and area: {sum}");
            let all: f64 = triangles
                .iter()
                .map(|t| polygon::area(&t.map(|k| [face[k][0], face[k][1]])).abs())
                .sum();
            assert!((all - whole).abs() < 1e-9, "no overlap: {all}");
        }
    }

    #[test]
    fn malformed_models_are_errors() {
        for text in [
            "",
            "v 0 0 0\n",
            "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n",
            "v 0 0 0\nf 1 x 2\n",
        ] {
            assert!(parse(text, &BTreeMap::new()).is_err(), "{text:?}");
        }
    }

    #[test]
    fn other_formats_are_named() {
        assert_eq!(other_format("3/lamp.dae", b"<?xml"), Some("COLLADA"));
        assert_eq!(other_format("3", b"PK\x03\x04"), Some("a zip archive"));
        assert_eq!(other_format("3", b"v 0 0 0"), None);
    }
}
