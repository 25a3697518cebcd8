//! Rendered parts of a model: its triangles by material, as meshes.

use std::collections::BTreeMap;

use wheelarm_pack::{Family, PartEntry};

use crate::archive::Archive;
use crate::build::kinds::{Passage, corners};
use crate::error::ImportError;
use crate::fit::Fitted;
use crate::glb::{self, Corner};
use crate::joints::{is_mirror, is_pane};
use crate::model::Model;
use crate::paint::{Paints, family_of};
use crate::raster::Point3;
use crate::sh3d::{Piece, PieceKind, Rgb};
use crate::simplify;

/// A rendered part that is not stored yet.
pub(super) struct Part {
    pub entry: PartEntry,
    pub bytes: Vec<u8>,
    pub triangles: usize,
}

/// Divides triangles by their materials.
pub(super) struct Painter<'a> {
    pub paints: &'a mut Paints,
    pub archive: &'a mut Archive,
    pub model: &'a Model,
    pub fitted: &'a Fitted,
    pub piece: &'a Piece,
    pub passage: Passage,
}

/// What a triangle is made of.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Surfacing {
    Material(u32),
    Pane,
    Mirror,
}

impl Painter<'_> {
    /// The parts of some triangles, relative to `origin`, one for each material.
    pub fn parts(&mut self, triangles: &[usize], origin: Point3) -> Result<Vec<Part>, ImportError> {
        let mut by: BTreeMap<Surfacing, Vec<usize>> = BTreeMap::new();
        for &index in triangles {
            let triangle = &self.model.triangles[index];
            let group = &self.model.groups[triangle.group as usize];
            let of = if is_pane(group) {
                Surfacing::Pane
            } else if is_mirror(group) {
                Surfacing::Mirror
            } else {
                Surfacing::Material(triangle.material)
            };
            by.entry(of).or_default().push(index);
        }
        let mut by_name: BTreeMap<(String, bool), Vec<usize>> = BTreeMap::new();
        let mut order: Vec<(String, bool)> = Vec::new();
        for (of, indices) in by {
            let key = match of {
                Surfacing::Pane if self.passage == Passage::None => (self.paints.glass(), false),
                Surfacing::Pane => (self.paints.pane(), false),
                Surfacing::Mirror => (self.paints.mirror(), false),
                Surfacing::Material(material) => self.material(material as usize)?,
            };
            if !by_name.contains_key(&key) {
                order.push(key.clone());
            }
            by_name.entry(key).or_default().extend(indices);
        }
        let mut parts = Vec::new();
        for key in order {
            let indices = &by_name[&key];
            let part = self.mesh(indices, origin, key.1);
            if part.is_empty() {
                continue;
            }
            parts.push(Part {
                triangles: part.len(),
                bytes: glb::write(&part),
                entry: PartEntry {
                    material: Some(key.0),
                    collide: Some(false),
                    ..PartEntry::default()
                },
            });
        }
        Ok(parts)
    }

    fn mesh(&self, indices: &[usize], origin: Point3, mapped: bool) -> Vec<[Corner; 3]> {
        let mut triangles: Vec<[Corner; 3]> = Vec::with_capacity(indices.len());
        for &index in indices {
            let points = corners(self.model, self.fitted, index);
            let uvs = self.model.triangles[index].uvs.filter(|_| mapped);
            let mut triangle = [0, 1, 2].map(|k| {
                let point = [0, 1, 2].map(|axis| points[k][axis] - origin[axis]);
                (point, uvs.map(|uvs| uvs[k]))
            });
            if self.piece.mirrored {
                triangle.swap(1, 2);
            }
            triangles.push(triangle);
            if self.piece.back_face_shown {
                let [a, b, c] = triangle;
                triangles.push([a, c, b]);
            }
        }
        let size = [0, 1, 2].map(|axis| self.fitted.high[axis] - self.fitted.low[axis]);
        simplify::simplify(triangles, size[0].max(size[1]).max(size[2]))
    }

    /// The material of a part, and whether the mesh's texture coordinates count.
    fn material(&mut self, index: usize) -> Result<(String, bool), ImportError> {
        let material = &self.model.materials[index];
        let change = self
            .piece
            .materials
            .iter()
            .find(|change| change.name == material.name);
        let family = family_of(&material.name);
        let shininess = change
            .and_then(|change| change.shininess)
            .or(self.piece.shininess)
            .unwrap_or(material.shininess);
        let base = if family == Some(Family::Metal) {
            0.35
        } else {
            0.65
        };
        let roughness = (base - 0.4 * shininess).max(0.1);
        let texture = match change {
            Some(change) if change.texture.is_some() => change.texture.clone(),
            Some(change) if change.colour.is_some() => None,
            _ => self.piece.texture.clone(),
        };
        if let Some(texture) = texture {
            let image = self
                .paints
                .image(self.archive, &texture, family, roughness, None)?;
            if let Some(name) = image {
                return Ok((name, false));
            }
        }
        let own = change
            .and_then(|change| change.colour)
            .or(self.piece.colour);
        if let (None, Some(path)) = (own, &material.image) {
            let texture = crate::sh3d::Texture {
                image: path.clone(),
                width: 100.0,
                height: 100.0,
            };
            let image = self
                .paints
                .image(self.archive, &texture, family, roughness, Some(1.0))?;
            if let Some(name) = image {
                return Ok((name, true));
            }
        }
        let colour: Rgb = own.unwrap_or(material.colour);
        if material.transparency > 0.5 {
            return Ok((self.paints.glass(), false));
        }
        let is_shade = self.piece.kind == PieceKind::Light
            && colour.iter().all(|&c| c > 150)
            && family != Some(Family::Metal);
        if is_shade {
            return Ok((self.paints.shade(colour), false));
        }
        Ok((self.paints.colour(colour, family, roughness), false))
    }
}
