//! URDF and MJCF files (.urdf, .xml): the rendered shapes of all bodies at joint position 0, as one
//! mesh in metres with z up. Their mesh files are beside them.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use wheelarm_proto::exact;

use super::mesh::{Mesh, Surface, Vec3};
use super::source::{Source, Up, face, too_many};
use crate::model::MOST_TRIANGLES;
use crate::xml::{self, Element};

/// Most shapes of a file.
const MOST_SHAPES: usize = 512;
/// Most geoms of a file, and most attributes of a class.
const MOST_GEOMS: usize = 4_096;
const MOST_ATTRIBUTES: usize = 64;
/// Sides of a round shape, and rings of a ball.
const SIDES: usize = 32;
const RINGS: usize = 12;

/// Reads a mesh file beside this one.
type Meshes<'a> = &'a dyn Fn(&str) -> Result<Source, String>;

/// Parses a file.
pub(super) fn parse(bytes: &[u8], meshes: Meshes<'_>) -> Result<Source, String> {
    let root = xml::parse(bytes).map_err(|why| format!("not valid XML: {why}; export it again"))?;
    let mut reader = Reader {
        meshes,
        mesh: Mesh::default(),
        shapes: 0,
        notes: Vec::new(),
    };
    match root.name.as_str() {
        "robot" => reader.urdf(&root)?,
        "mujoco" => reader.mjcf(&root)?,
        other => {
            return Err(format!(
                "its root is {other:?}, expected robot (URDF) or mujoco (MJCF)"
            ));
        }
    }
    if let (true, Some(why)) = (reader.mesh.faces.is_empty(), reader.notes.first()) {
        return Err(why.clone());
    }
    Ok(Source {
        mesh: reader.mesh,
        metres: Some(1.0),
        up: Up::Z,
        up_is_defined: true,
        notes: reader.notes,
    })
}

struct Reader<'a> {
    meshes: Meshes<'a>,
    mesh: Mesh,
    shapes: usize,
    notes: Vec<String>,
}

/// Numbers of an attribute; a missing or damaged one is `usual`.
fn numbers<const N: usize>(element: &Element, name: &str, usual: [f64; N]) -> [f64; N] {
    let Some(text) = element.attribute(name) else {
        return usual;
    };
    let words = text.split_whitespace().map(|word| word.parse().ok());
    let read: Option<Vec<f64>> = words.collect();
    read.and_then(|read| read.try_into().ok())
        .unwrap_or([f64::NAN; N])
}

fn about(axis: Vec3, angle: f64) -> UnitQuaternion<f64> {
    let (sin, cos) = exact::sin_cos(angle / 2.0);
    let [x, y, z]: [f64; 3] = (axis * sin).into();
    UnitQuaternion::new_unchecked(Quaternion::new(cos, x, y, z))
}

/// A rotation about the fixed axes x, then y, then z, radians.
fn fixed([roll, pitch, yaw]: [f64; 3]) -> UnitQuaternion<f64> {
    about(Vec3::z(), yaw) * about(Vec3::y(), pitch) * about(Vec3::x(), roll)
}

fn pose(at: [f64; 3], turn: UnitQuaternion<f64>) -> Isometry3<f64> {
    Isometry3::from_parts(Translation3::from(Vec3::from(at)), turn)
}

fn color(text: Option<&str>) -> Option<Surface> {
    let words = text?
        .split_whitespace()
        .map(|word| word.parse::<f64>().ok());
    let [red, green, blue, ..] = words.collect::<Option<Vec<f64>>>()?[..] else {
        return None;
    };
    let colour = [red, green, blue].map(|c| (c.clamp(0.0, 1.0) * 255.0) as u8);
    Some(Surface {
        colour,
        ..Surface::default()
    })
}

impl Reader<'_> {
    /// Adds triangles of a shape.
    fn add(
        &mut self,
        shape: &Mesh,
        pose: &Isometry3<f64>,
        own: Option<Surface>,
    ) -> Result<(), String> {
        self.shapes += 1;
        if self.shapes > MOST_SHAPES {
            return Err(format!("more than {MOST_SHAPES} shapes; join some of them"));
        }
        if self.mesh.faces.len() + shape.faces.len() > MOST_TRIANGLES {
            return Err(too_many());
        }
        let first = self.mesh.surfaces.len();
        match own {
            Some(surface) => self.mesh.surfaces.push(surface),
            None if shape.surfaces.is_empty() => self.mesh.surfaces.push(Surface::default()),
            None => self.mesh.surfaces.extend(shape.surfaces.iter().cloned()),
        }
        let last = self.mesh.surfaces.len() - 1;
        for face in &shape.faces {
            let mut face = *face;
            face.corners = face
                .corners
                .map(|c| pose.rotation * c + pose.translation.vector);
            face.surface = (first + face.surface).min(last);
            self.mesh.faces.push(face);
        }
        Ok(())
    }

    /// A mesh file beside this one or in a folder there, scaled.
    fn file(&mut self, name: &str, scale: [f64; 3]) -> Option<Mesh> {
        let path = plain(name);
        let last = path.rsplit('/').next().unwrap_or_default();
        let ending = last.to_ascii_lowercase();
        let is_nested = ending.ends_with(".urdf") || ending.ends_with(".xml");
        let read = match is_nested {
            true => Err("it is not a mesh".to_owned()),
            false => (self.meshes)(&path).or_else(|why| (self.meshes)(last).map_err(|_| why)),
        };
        match read {
            Ok(mut source) => {
                let metres = source.metres.unwrap_or(1.0);
                let up = if source.up_is_defined {
                    source.up
                } else {
                    Up::Z
                };
                let scale = Vec3::from(scale) * metres;
                let mirrors = scale.iter().product::<f64>() < 0.0;
                source
                    .mesh
                    .map(mirrors, |p| up.upright(p.into()).component_mul(&scale));
                Some(source.mesh)
            }
            Err(why) => {
                self.notes
                    .push(format!("the mesh {name:?} is left out: {why}"));
                None
            }
        }
    }

    fn urdf(&mut self, root: &Element) -> Result<(), String> {
        let mut parents: BTreeMap<&str, (&str, Isometry3<f64>)> = BTreeMap::new();
        for joint in root.all("joint") {
            let link = |tag: &str| joint.child(tag).and_then(|c| c.attribute("link"));
            if let (Some(parent), Some(child)) = (link("parent"), link("child")) {
                parents.insert(child, (parent, origin(joint)));
            }
        }
        let named: BTreeMap<&str, Option<Surface>> = root
            .all("material")
            .filter_map(|m| {
                Some((
                    m.attribute("name")?,
                    color(m.child("color")?.attribute("rgba")),
                ))
            })
            .collect();
        for link in root.all("link") {
            let mut world = Isometry3::identity();
            let mut name = link.attribute("name").unwrap_or_default();
            let mut steps = 0;
            while let Some((parent, own)) = parents.get(name) {
                world = own * world;
                name = *parent;
                steps += 1;
                if steps > MOST_SHAPES {
                    return Err("its joints form a circle; export a tree of links".into());
                }
            }
            for visual in link.all("visual") {
                let Some(shape) = visual.child("geometry").and_then(|g| g.children.first()) else {
                    continue;
                };
                let material = visual.child("material");
                let own = material.and_then(|m| {
                    let inline = m.child("color").and_then(|c| color(c.attribute("rgba")));
                    inline.or_else(|| named.get(m.attribute("name")?)?.clone())
                });
                let mesh = match shape.name.as_str() {
                    "box" => Some(cuboid(numbers(shape, "size", [f64::NAN; 3]))),
                    "cylinder" => {
                        let [radius] = numbers(shape, "radius", [f64::NAN]);
                        let [length] = numbers(shape, "length", [f64::NAN]);
                        Some(lathe(&[
                            [0.0, -length / 2.0],
                            [radius, -length / 2.0],
                            [radius, length / 2.0],
                            [0.0, length / 2.0],
                        ]))
                    }
                    "sphere" => {
                        let [radius] = numbers(shape, "radius", [f64::NAN]);
                        Some(capsule(radius, 0.0))
                    }
                    "mesh" => {
                        let file = shape.attribute("filename").unwrap_or_default();
                        self.file(file, numbers(shape, "scale", [1.0; 3]))
                    }
                    _ => None,
                };
                if let Some(mesh) = mesh {
                    self.add(&mesh, &(world * origin(visual)), own)?;
                }
            }
        }
        Ok(())
    }

    fn mjcf(&mut self, root: &Element) -> Result<(), String> {
        let compiler = root.child("compiler");
        let angle = compiler.and_then(|c| c.attribute("angle"));
        let per_unit = match angle {
            Some("radian") => 1.0,
            _ => std::f64::consts::PI / 180.0,
        };
        let mut files: BTreeMap<String, (String, [f64; 3])> = BTreeMap::new();
        let mut colors: BTreeMap<String, Surface> = BTreeMap::new();
        for asset in root.all("asset") {
            for mesh in asset.all("mesh") {
                let file = mesh.attribute("file").unwrap_or_default();
                let folder = compiler.and_then(|c| c.attribute("meshdir")).unwrap_or(".");
                let stem = file.rsplit(['/', '\\']).next().unwrap_or(file);
                let stem = stem.rsplit_once('.').map_or(stem, |(stem, _)| stem);
                let name = mesh.attribute("name").unwrap_or(stem);
                let scale = numbers(mesh, "scale", [1.0; 3]);
                files.insert(name.to_owned(), (format!("{folder}/{file}"), scale));
            }
            for material in asset.all("material") {
                let name = material.attribute("name").unwrap_or_default();
                if let Some(surface) = color(material.attribute("rgba")) {
                    colors.insert(name.to_owned(), surface);
                }
            }
        }
        for (geom, world) in shown_geoms(root, per_unit)? {
            let surface = color(geom.attribute("rgba"));
            let material = geom.attribute("material").and_then(|m| colors.get(m));
            let surface = surface.or_else(|| material.cloned());
            if let Some((mesh, ends)) = self.geom(&geom, &files) {
                let at = numbers(&geom, "pos", [0.0; 3]);
                let own = ends.unwrap_or_else(|| pose(at, turn(&geom, per_unit)));
                self.add(&mesh, &(world * own), surface)?;
            }
        }
        Ok(())
    }

    /// The mesh of a geom, and its pose where two points define it.
    fn geom(
        &mut self,
        geom: &Element,
        files: &BTreeMap<String, (String, [f64; 3])>,
    ) -> Option<(Mesh, Option<Isometry3<f64>>)> {
        let size = |count: usize| {
            let text = geom.attribute("size").unwrap_or_default();
            let words = text.split_whitespace().map(|word| word.parse().ok());
            let sizes: Vec<f64> = words.collect::<Option<_>>().unwrap_or_default();
            (sizes.len() >= count).then_some(sizes)
        };
        if let Some(name) = geom.attribute("mesh") {
            let (file, scale) = files.get(name)?.clone();
            return Some((self.file(&file, scale)?, None));
        }
        let ends = geom.attribute("fromto").map(|_| {
            let [ax, ay, az, bx, by, bz] = numbers(geom, "fromto", [f64::NAN; 6]);
            (Vec3::new(ax, ay, az), Vec3::new(bx, by, bz))
        });
        let along = ends.map(|(a, b)| {
            let turn = UnitQuaternion::rotation_between(&Vec3::z(), &(b - a));
            let middle = (a + b) / 2.0;
            pose(middle.into(), turn.unwrap_or_default())
        });
        let half = |sizes: &[f64]| match ends {
            Some((a, b)) => (b - a).norm() / 2.0,
            None => sizes.get(1).copied().unwrap_or(f64::NAN),
        };
        let mesh = match geom.attribute("type").unwrap_or("sphere") {
            "box" => {
                let sizes = size(3)?;
                cuboid([2.0 * sizes[0], 2.0 * sizes[1], 2.0 * sizes[2]])
            }
            "cylinder" => {
                let sizes = size(1)?;
                let (r, h) = (sizes[0], half(&sizes));
                lathe(&[[0.0, -h], [r, -h], [r, h], [0.0, h]])
            }
            "capsule" => {
                let sizes = size(1)?;
                capsule(sizes[0], half(&sizes))
            }
            "sphere" => capsule(size(1)?[0], 0.0),
            "ellipsoid" => {
                let sizes = size(3)?;
                let mut ball = capsule(1.0, 0.0);
                let radii = Vec3::new(sizes[0], sizes[1], sizes[2]);
                ball.map(false, |p| p.component_mul(&radii));
                ball
            }
            other => {
                self.notes
                    .push(format!("geoms of type {other:?} are left out"));
                return None;
            }
        };
        Some((mesh, along))
    }
}

/// A path below the folder of the file: without `package://`, a drive, `.` and `..`.
fn plain(name: &str) -> String {
    let name = name.rsplit_once("://").map_or(name, |(_, path)| path);
    let parts = name.split(['/', '\\']);
    let parts = parts.filter(|part| !matches!(*part, "" | "." | ".."));
    parts.collect::<Vec<_>>().join("/")
}

/// The rendered geoms of MJCF with their inherited attributes, and their bodies in the world.
fn shown_geoms(root: &Element, per_unit: f64) -> Result<Vec<(Element, Isometry3<f64>)>, String> {
    let mut classes = BTreeMap::new();
    gather_classes(root, &[], &mut classes);
    let mut geoms = Vec::new();
    let worlds = root.all("worldbody");
    let mut pending: Vec<(&Element, Isometry3<f64>, &str)> = worlds
        .map(|body| (body, Isometry3::identity(), "main"))
        .collect();
    while let Some((body, world, class)) = pending.pop() {
        let class = body.attribute("childclass").unwrap_or(class);
        for child in &body.children {
            match child.name.as_str() {
                "body" => {
                    let at = numbers(child, "pos", [0.0; 3]);
                    pending.push((child, world * pose(at, turn(child, per_unit)), class));
                }
                "geom" if geoms.len() == MOST_GEOMS => {
                    return Err(format!("more than {MOST_GEOMS} geoms; join some of them"));
                }
                "geom" => geoms.push((inherited(child, class, &classes), world)),
                _ => {}
            }
        }
    }
    // Many files have each shape twice, to render and to collide.
    let is_ghost = |geom: &Element| {
        let is_zero = |name: &str| geom.attribute(name) == Some("0");
        is_zero("contype") && is_zero("conaffinity")
    };
    let has_ghosts = geoms.iter().any(|(geom, _)| is_ghost(geom));
    geoms.retain(|(geom, _)| match has_ghosts {
        true => is_ghost(geom),
        false => !is_hidden(geom),
    });
    Ok(geoms)
}

/// Attributes of geoms by class, of `default` elements.
type Classes = BTreeMap<String, Vec<(String, String)>>;

fn gather_classes(element: &Element, inherited: &[(String, String)], classes: &mut Classes) {
    for entry in element.all("default") {
        let mut own = entry.child("geom").map_or(Vec::new(), |geom| {
            geom.attributes
                .iter()
                .take(MOST_ATTRIBUTES)
                .cloned()
                .collect()
        });
        let former = inherited.iter();
        let missing: Vec<_> = former
            .filter(|(key, _)| !own.iter().any(|(other, _)| other == key))
            .take(MOST_ATTRIBUTES)
            .cloned()
            .collect();
        own.extend(missing);
        let class = entry.attribute("class").unwrap_or("main");
        gather_classes(entry, &own, classes);
        classes.insert(class.to_owned(), own);
    }
}

/// A geom with the attributes of its class.
fn inherited(geom: &Element, class: &str, classes: &Classes) -> Element {
    let class = geom.attribute("class").unwrap_or(class);
    let mut attributes = geom.attributes.clone();
    for (key, value) in classes.get(class).into_iter().flatten() {
        if geom.attribute(key).is_none() {
            attributes.push((key.clone(), value.clone()));
        }
    }
    Element {
        name: geom.name.clone(),
        attributes,
        ..Element::default()
    }
}

/// Whether a geom only collides: by custom of group 3 and above.
fn is_hidden(geom: &Element) -> bool {
    let group = geom
        .attribute("group")
        .and_then(|group| group.parse::<u32>().ok());
    group.is_some_and(|group| group >= 3)
}

fn origin(element: &Element) -> Isometry3<f64> {
    let Some(origin) = element.child("origin") else {
        return Isometry3::identity();
    };
    let turn = fixed(numbers(origin, "rpy", [0.0; 3]));
    pose(numbers(origin, "xyz", [0.0; 3]), turn)
}

/// The rotation of a body or a geom of MJCF.
fn turn(element: &Element, per_unit: f64) -> UnitQuaternion<f64> {
    if element.attribute("quat").is_some() {
        let [w, x, y, z] = numbers(element, "quat", [1.0, 0.0, 0.0, 0.0]);
        return UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
    }
    if element.attribute("euler").is_some() {
        let [x, y, z] = numbers(element, "euler", [0.0; 3]).map(|angle| angle * per_unit);
        // By default about the axes of the body, in the order x, y, z.
        return about(Vec3::x(), x) * about(Vec3::y(), y) * about(Vec3::z(), z);
    }
    if element.attribute("axisangle").is_some() {
        let [x, y, z, angle] = numbers(element, "axisangle", [0.0, 0.0, 1.0, 0.0]);
        let axis = Vec3::new(x, y, z)
            .try_normalize(1.0e-9)
            .unwrap_or(Vec3::z());
        return about(axis, angle * per_unit);
    }
    UnitQuaternion::identity()
}

fn cuboid([x, y, z]: [f64; 3]) -> Mesh {
    let corner = |k: usize| {
        let side = |bit: usize, size: f64| {
            if k & bit == 0 {
                -size / 2.0
            } else {
                size / 2.0
            }
        };
        [side(1, x), side(2, y), side(4, z)]
    };
    let mut mesh = Mesh::default();
    for [a, b, c, d] in [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [1, 3, 7, 5],
        [3, 2, 6, 7],
        [2, 0, 4, 6],
    ] {
        for triangle in [[a, b, c], [a, c, d]] {
            mesh.faces.push(face(triangle.map(corner), None, 0));
        }
    }
    mesh
}

/// A surface that is round about z, from `[radius, z]` points from the bottom to the top.
fn lathe(profile: &[[f64; 2]]) -> Mesh {
    let at = |k: usize, [radius, z]: [f64; 2]| {
        let angle = std::f64::consts::TAU * k as f64 / SIDES as f64;
        let (sin, cos) = exact::sin_cos(angle);
        [radius * cos, radius * sin, z]
    };
    let mut mesh = Mesh::default();
    for pair in profile.windows(2) {
        for k in 0..SIDES {
            let [a, b] = [at(k, pair[0]), at(k + 1, pair[0])];
            let [c, d] = [at(k + 1, pair[1]), at(k, pair[1])];
            mesh.faces.push(face([a, b, c], None, 0));
            mesh.faces.push(face([a, c, d], None, 0));
        }
    }
    mesh
}

/// A capsule about z with this half length of its cylinder; a ball when that is 0.
fn capsule(radius: f64, half: f64) -> Mesh {
    let ring = |k: usize| {
        let angle = std::f64::consts::PI * (k as f64 / RINGS as f64 - 0.5);
        let (sin, cos) = exact::sin_cos(angle);
        let end = if 2 * k > RINGS { half } else { -half };
        [radius * cos, end + radius * sin]
    };
    let mut profile: Vec<[f64; 2]> = (0..=RINGS).map(ring).collect();
    if half > 0.0 {
        let middle = RINGS / 2;
        profile.insert(middle + 1, [radius, half]);
    }
    lathe(&profile)
}
