//! COLLADA files (.dae): units, upright axis, nodes, triangles, diffuse colors and images.
//! Skins and animations are ignored.

use std::collections::BTreeMap;

use nalgebra::{Matrix4, Point3, Rotation3, Unit};

use super::mesh::{Face, Mesh, Surface, Vec3};
use super::source::{Beside, Source, Up, too_many};
use crate::model::MOST_TRIANGLES;
use crate::xml::{self, Element};

/// Most nodes that are visited, and their greatest depth.
const MOST_NODES: usize = 10_000;
const MOST_DEPTH: usize = 64;

/// Parses a file.
pub(super) fn parse(bytes: &[u8], beside: Beside<'_>) -> Result<Source, String> {
    let root = xml::parse(bytes).map_err(|why| format!("not valid XML: {why}; export it again"))?;
    if root.name != "COLLADA" {
        return Err(format!("its root is {:?}, expected COLLADA", root.name));
    }
    let mut ids = BTreeMap::new();
    collect(&root, &mut ids);
    let asset = root.child("asset");
    let unit = asset.and_then(|asset| asset.child("unit")?.attribute("meter"));
    let axis = asset.and_then(|asset| asset.child("up_axis"));
    let mut reader = Reader {
        ids,
        beside,
        mesh: Mesh::default(),
        surfaces: BTreeMap::new(),
        notes: Vec::new(),
        visited: 0,
    };
    let scene = root.child("scene");
    let scene = scene.and_then(|scene| scene.child("instance_visual_scene")?.attribute("url"));
    let scene = scene
        .and_then(|url| reader.named(url))
        .or_else(|| root.child("library_visual_scenes")?.child("visual_scene"));
    let scene = scene.ok_or("it has no scene; export it again")?;
    for node in scene.all("node") {
        reader.node(node, &Matrix4::identity(), 0)?;
    }
    Ok(Source {
        mesh: reader.mesh,
        metres: Some(unit.and_then(|unit| unit.parse().ok()).unwrap_or(1.0)),
        up: match axis.map(|axis| axis.text.trim()) {
            Some("Z_UP") => Up::Z,
            _ => Up::Y,
        },
        up_is_defined: true,
        notes: reader.notes,
    })
}

/// Elements by their id.
fn collect<'a>(element: &'a Element, ids: &mut BTreeMap<&'a str, &'a Element>) {
    if let Some(id) = element.attribute("id") {
        ids.entry(id).or_insert(element);
    }
    for child in &element.children {
        collect(child, ids);
    }
}

struct Reader<'a> {
    ids: BTreeMap<&'a str, &'a Element>,
    beside: Beside<'a>,
    mesh: Mesh,
    /// Indices of materials by their ids.
    surfaces: BTreeMap<String, usize>,
    notes: Vec<String>,
    visited: usize,
}

/// The numbers of a text.
fn numbers(element: &Element) -> Vec<f64> {
    let words = element.text.split_whitespace();
    words.map(|word| word.parse().unwrap_or(f64::NAN)).collect()
}

impl<'a> Reader<'a> {
    fn named(&self, url: &str) -> Option<&'a Element> {
        self.ids.get(url.strip_prefix('#')?).copied()
    }

    fn node(
        &mut self,
        node: &'a Element,
        parent: &Matrix4<f64>,
        depth: usize,
    ) -> Result<(), String> {
        self.visited += 1;
        if depth > MOST_DEPTH || self.visited > MOST_NODES {
            return Err(format!(
                "more than {MOST_NODES} nodes or {MOST_DEPTH} levels; export a tree of nodes"
            ));
        }
        let mut world = *parent;
        for child in &node.children {
            let values = numbers(child);
            world *= match (child.name.as_str(), &values[..]) {
                ("matrix", values) if values.len() == 16 => Matrix4::from_row_slice(values),
                ("translate", &[x, y, z]) => Matrix4::new_translation(&Vec3::new(x, y, z)),
                ("scale", &[x, y, z]) => Matrix4::new_nonuniform_scaling(&Vec3::new(x, y, z)),
                ("rotate", &[x, y, z, angle]) => {
                    match Unit::try_new(Vec3::new(x, y, z), 1.0e-9) {
                        Some(axis) => {
                            let angle = angle.to_radians();
                            // Rodrigues' formula with functions of equal bits everywhere.
                            let (sin, cos) = wheelarm_proto::exact::sin_cos(angle);
                            let k = axis.cross_matrix();
                            let turn =
                                nalgebra::Matrix3::identity() + k * sin + k * k * (1.0 - cos);
                            Rotation3::from_matrix_unchecked(turn).to_homogeneous()
                        }
                        None => Matrix4::identity(),
                    }
                }
                _ => Matrix4::identity(),
            };
        }
        for child in &node.children {
            match child.name.as_str() {
                "node" => self.node(child, &world, depth + 1)?,
                "instance_node" => {
                    let named = child.attribute("url").and_then(|url| self.named(url));
                    if let Some(named) = named {
                        self.node(named, &world, depth + 1)?;
                    }
                }
                "instance_geometry" => self.geometry(child, &world)?,
                _ => {}
            }
        }
        Ok(())
    }

    fn geometry(&mut self, instance: &'a Element, world: &Matrix4<f64>) -> Result<(), String> {
        let geometry = instance.attribute("url").and_then(|url| self.named(url));
        let Some(mesh) = geometry.and_then(|geometry| geometry.child("mesh")) else {
            return Ok(());
        };
        let bound = instance
            .child("bind_material")
            .and_then(|b| b.child("technique_common"));
        for primitive in &mesh.children {
            let symbol = primitive.attribute("material").unwrap_or_default();
            let named = bound
                .into_iter()
                .flat_map(|bound| bound.all("instance_material"));
            let mut named = named.filter(|m| m.attribute("symbol") == Some(symbol));
            let target = named.next().and_then(|m| m.attribute("target"));
            match primitive.name.as_str() {
                "triangles" | "polylist" | "polygons" => {
                    let surface = self.surface(target.unwrap_or_default());
                    self.primitive(mesh, primitive, world, surface)?;
                }
                "lines" | "linestrips" | "trifans" | "tristrips" => {
                    self.notes.push(format!("{} are ignored", primitive.name));
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Numbers of a source, three or two at a time.
    fn source(&self, url: &str) -> Option<(Vec<f64>, usize)> {
        let source = self.named(url)?;
        if source.name == "vertices" {
            let mut inputs = source.all("input");
            let position = inputs.find(|i| i.attribute("semantic") == Some("POSITION"))?;
            let source = position.attribute("source")?;
            // The positions of vertices are a source of numbers.
            return self
                .named(source)
                .filter(|s| s.name == "source")
                .and_then(floats);
        }
        floats(source)
    }

    fn primitive(
        &mut self,
        mesh: &'a Element,
        primitive: &'a Element,
        world: &Matrix4<f64>,
        surface: usize,
    ) -> Result<(), String> {
        let _ = mesh;
        let mut stride = 1;
        let mut points = None;
        let mut uvs = None;
        for input in primitive.all("input") {
            let offset: usize = input
                .attribute("offset")
                .and_then(|o| o.parse().ok())
                .unwrap_or(0);
            stride = stride.max(offset.min(64) + 1);
            let source = || self.source(input.attribute("source")?);
            match input.attribute("semantic") {
                Some("VERTEX") => points = source().map(|s| (s, offset)),
                Some("TEXCOORD") if uvs.is_none() => uvs = source().map(|s| (s, offset)),
                _ => {}
            }
        }
        let ((points, step), at) = points.ok_or("a mesh has no positions; export it again")?;
        let corner = |indices: &[usize]| -> Option<Vec3> {
            let first = indices.get(at)?.checked_mul(step)?;
            let p = points.get(first..first.checked_add(3)?)?;
            Some(world.transform_point(&Point3::new(p[0], p[1], p[2])).coords)
        };
        let uv = |indices: &[usize]| -> Option<[f32; 2]> {
            let ((values, step), at) = uvs.as_ref()?;
            let first = indices.get(*at)?.checked_mul(*step)?;
            let v = values.get(first..first.checked_add(2)?)?;
            Some([v[0] as f32, v[1] as f32])
        };
        let mut polygons: Vec<Vec<usize>> = Vec::new();
        let indices = |element: &Element| -> Vec<usize> {
            let words = element.text.split_whitespace();
            words
                .map(|word| word.parse().unwrap_or(usize::MAX))
                .collect()
        };
        match primitive.name.as_str() {
            "polygons" => polygons.extend(primitive.all("p").map(indices)),
            name => {
                let all = primitive.child("p").map(indices).unwrap_or_default();
                let counts = primitive.child("vcount").map(indices).unwrap_or_default();
                let mut rest = &all[..];
                let mut counts = counts.into_iter();
                while !rest.is_empty() {
                    let count = if name == "triangles" {
                        Some(3)
                    } else {
                        counts.next()
                    };
                    let length = count.unwrap_or(0).saturating_mul(stride);
                    if length == 0 || length > rest.len() {
                        break;
                    }
                    polygons.push(rest[..length].to_vec());
                    rest = &rest[length..];
                }
            }
        }
        let mirrors = world.fixed_view::<3, 3>(0, 0).determinant() < 0.0;
        for polygon in polygons {
            let corners: Vec<&[usize]> = polygon.chunks_exact(stride).collect();
            for k in 1..corners.len().saturating_sub(1) {
                if self.mesh.faces.len() >= MOST_TRIANGLES {
                    return Err(too_many());
                }
                let mut triangle = [corners[0], corners[k], corners[k + 1]];
                if mirrors {
                    triangle.swap(1, 2);
                }
                let [Some(a), Some(b), Some(c)] = triangle.map(corner) else {
                    return Err("a face names a vertex that does not exist; export it again".into());
                };
                self.mesh.faces.push(Face {
                    corners: [a, b, c],
                    uvs: match triangle.map(uv) {
                        [Some(a), Some(b), Some(c)] => Some([a, b, c]),
                        _ => None,
                    },
                    surface,
                });
            }
        }
        Ok(())
    }

    /// The index of a material.
    fn surface(&mut self, url: &str) -> usize {
        if let Some(index) = self.surfaces.get(url) {
            return *index;
        }
        let found = self.named(url).and_then(|material| {
            let effect = material.child("instance_effect")?.attribute("url")?;
            self.named(effect)
        });
        let surface = found.map(|effect| self.effect(effect));
        self.mesh.surfaces.push(surface.unwrap_or_default());
        let index = self.mesh.surfaces.len() - 1;
        self.surfaces.insert(url.to_owned(), index);
        index
    }

    fn effect(&mut self, effect: &'a Element) -> Surface {
        let mut surface = Surface::default();
        let Some(profile) = effect.child("profile_COMMON") else {
            return surface;
        };
        let shading = profile.child("technique").and_then(|t| t.children.first());
        let Some(diffuse) = shading.and_then(|shading| shading.child("diffuse")) else {
            return surface;
        };
        if let Some(color) = diffuse.child("color")
            && let [red, green, blue, ..] = numbers(color)[..]
        {
            surface.colour = [red, green, blue].map(|c| (c.clamp(0.0, 1.0) * 255.0) as u8);
        }
        let Some(texture) = diffuse
            .child("texture")
            .and_then(|t| t.attribute("texture"))
        else {
            return surface;
        };
        surface.colour = [255; 3];
        // A sampler names a surface, which names an image.
        let parameter = |name: &str| {
            let mut all = profile.all("newparam");
            all.find(|p| p.attribute("sid") == Some(name))
        };
        let sampler = parameter(texture).and_then(|p| p.child("sampler2D")?.child("source"));
        let init = sampler
            .and_then(|source| parameter(source.text.trim()))
            .and_then(|p| p.child("surface")?.child("init_from"));
        let image = init.map_or(texture, |init| init.text.trim());
        let file = self
            .ids
            .get(image)
            .and_then(|image| image.child("init_from"));
        let Some(file) = file.map(|file| file.text.trim()) else {
            return surface;
        };
        match (self.beside)(file.trim_start_matches("./")) {
            Ok(bytes) => surface.image = Some(bytes),
            Err(why) => self.notes.push(format!("an image is left out: {why}")),
        }
        surface
    }
}

/// Numbers of a source and how many belong together.
fn floats(source: &Element) -> Option<(Vec<f64>, usize)> {
    let array = source.child("float_array")?;
    let accessor = source
        .child("technique_common")
        .and_then(|t| t.child("accessor"));
    let stride = accessor.and_then(|a| a.attribute("stride")?.parse().ok());
    Some((numbers(array), stride.unwrap_or(3)))
}
