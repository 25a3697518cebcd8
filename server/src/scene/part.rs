//! Parts: converts one entry of a file to rendered and colliding shapes.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion};
use wheelarm_pack::{MOST_HULL_VERTICES, Pack};

use super::bounds::Bounds;
use super::error::{Place, SceneError};
use super::file::PartEntry;
use crate::geometry::{self, Material, PackedFile, Part, Shape, Visual};

/// Context for reading parts.
pub(super) struct Reader<'a> {
    pub assets: &'a Path,
    /// World pack of the scene: its meshes are its own.
    pub pack: Option<&'a Arc<Pack>>,
    pub materials: &'a BTreeMap<String, Material>,
}

/// The shapes of a body.
#[derive(Default)]
pub(super) struct Parts {
    pub collision: Vec<Part>,
    pub hulls: Vec<Vec<Point3<f64>>>,
    pub visual: Vec<Visual>,
}

impl Parts {
    /// Adds a colliding part: a mesh by its vertices, others by their shape.
    fn collide(&mut self, part: Part, vertices: &[Point3<f64>]) {
        if vertices.is_empty() {
            self.collision.push(part);
        } else {
            let hull = vertices.iter().map(|p| part.pose * p).collect();
            self.hulls.push(hull);
        }
    }
}

impl Reader<'_> {
    /// Reads `parts`; `collision` replaces the parts for collision.
    pub(super) fn body(
        &self,
        place: &Place,
        material: Option<&str>,
        parts: &[PartEntry],
        collision: Option<&[PartEntry]>,
    ) -> Result<Parts, SceneError> {
        let mut all = Parts::default();
        for (i, entry) in parts.iter().enumerate() {
            let place = place.entry("parts", i);
            let (shape, vertices) = self.shape(&place, entry)?;
            let collides = entry.collide.unwrap_or(!only_rendered(&shape));
            if collides && only_rendered(&shape) {
                return Err(place.key("collide").wrong(
                    "true for a lathe, a prism or a mesh of a pack",
                    "a shape that is only rendered",
                    "leave `collide` out and give simple shapes under `collision`",
                ));
            }
            for pose in poses(&place, entry)? {
                let part = Part {
                    pose,
                    shape: shape.clone(),
                };
                if collides && collision.is_none() {
                    all.collide(part.clone(), &vertices);
                }
                if entry.draw.unwrap_or(true) {
                    let material = self.material(&place, entry, material)?;
                    all.visual.push(Visual { part, material });
                }
            }
        }
        for (i, entry) in collision.unwrap_or(&[]).iter().enumerate() {
            let place = place.entry("collision", i);
            if let Some(hull) = hull(&place, entry)? {
                for pose in poses(&place, entry)? {
                    all.hulls.push(hull.iter().map(|p| pose * p).collect());
                }
                continue;
            }
            let (shape, vertices) = self.shape(&place, entry)?;
            if only_rendered(&shape) {
                return Err(place.wrong(
                    "a lathe, a prism or a mesh of a pack",
                    "a shape that can collide",
                    "use hull, cylinder, frustum, cup or box",
                ));
            }
            if entry.material.is_some() || entry.draw.is_some() || entry.collide.is_some() {
                return Err(place.wrong(
                    "given with material, draw or collide",
                    "only a shape and its place",
                    "collision shapes are never rendered: remove these keys",
                ));
            }
            for pose in poses(&place, entry)? {
                let shape = shape.clone();
                all.collide(Part { pose, shape }, &vertices);
            }
        }
        Ok(all)
    }

    fn material(
        &self,
        place: &Place,
        entry: &PartEntry,
        of_body: Option<&str>,
    ) -> Result<Material, SceneError> {
        let place = place.key("material");
        let Some(name) = entry.material.as_deref().or(of_body) else {
            return Err(place.wrong(
                "absent",
                "a material",
                "name one here or for the whole body, or set draw = false",
            ));
        };
        self.named(&place, name)
    }

    /// The material of this name; errors refer to `place`.
    pub(super) fn named(&self, place: &Place, name: &str) -> Result<Material, SceneError> {
        self.materials.get(name).cloned().ok_or_else(|| {
            let known: Vec<_> = self.materials.keys().map(String::as_str).collect();
            place.wrong(
                format!("{name:?}"),
                format!("one of {}", known.join(", ")),
                "correct the name or add the material in assets/materials",
            )
        })
    }

    /// The shape, and its vertices in metres when it is a mesh.
    fn shape(&self, place: &Place, entry: &PartEntry) -> Result<MeshShape, SceneError> {
        let simple = [
            cuboid(place, entry)?,
            rounded_box(place, entry)?,
            cylinder(place, entry)?,
            capsule(place, entry)?,
            sphere(place, entry)?,
            frustum(place, entry)?,
            cup(place, entry)?,
            lathe(place, entry)?,
            prism(place, entry)?,
        ];
        let mut found: Vec<Shape> = simple.into_iter().flatten().collect();
        let mut vertices = Vec::new();
        if let Some((shape, of_mesh)) = self.mesh(place, entry)? {
            found.push(shape);
            vertices = of_mesh;
        }
        match (found.pop(), found.len()) {
            (Some(shape), 0) => Ok((shape, vertices)),
            (one, others) => Err(place.wrong(
                format!("a part with {} shapes", others + usize::from(one.is_some())),
                "exactly one of box, rounded_box, cylinder, capsule, sphere, frustum, cup, \
                 lathe, prism, mesh; under `collision` also hull",
                "write one entry per shape",
            )),
        }
    }

    fn mesh(&self, place: &Place, entry: &PartEntry) -> Result<Option<MeshShape>, SceneError> {
        let Some(mesh) = &entry.mesh else {
            return Ok(None);
        };
        let place = place.key("mesh");
        let cure = "0.001 for a mesh in millimetres, 1 for metres";
        for scale in mesh.scale.axes() {
            let scale = scale.abs();
            place
                .key("scale")
                .within(scale, 1e-4, 1e3, "m per unit", cure)?;
        }
        let path = place.key("path");
        if let Some(pack) = self.pack {
            let file = PackedFile::find(pack, &mesh.path).ok_or_else(|| {
                path.wrong(
                    format!("{:?}", mesh.path),
                    "a file of the pack in meshes/",
                    "add the mesh to the pack or correct the path",
                )
            })?;
            let shape = Shape::PackedMesh {
                file,
                scale: mesh.scale.axes(),
            };
            return Ok(Some((shape, Vec::new())));
        }
        let [scale, y, z] = mesh.scale.axes();
        if scale != y || scale != z || scale < 0.0 {
            return Err(place.key("scale").wrong(
                format!("{:?}", [scale, y, z]),
                "one positive number",
                "only meshes of packs have three factors",
            ));
        }
        let read = geometry::mesh::load(&self.assets.join(&mesh.path)).map_err(|error| {
            path.wrong(
                format!("{:?}, which cannot be used ({error})", mesh.path),
                "an OBJ, glTF or GLB file below the assets folder",
                format!("put it at {}", self.assets.join(&mesh.path).display()),
            )
        })?;
        let vertices: Vec<_> = read
            .positions
            .into_iter()
            .map(|v| Point3::from(v.map(|c| f64::from(c) * scale)))
            .collect();
        let bounds = Bounds::of_points(vertices.iter().copied());
        path.within(
            bounds.map_or(0.0, |b| b.size().max()),
            0.002,
            20.0,
            "m in its longest direction",
            "set `scale` to metres per unit, 0.001 for millimetres",
        )?;
        let shape = Shape::Mesh {
            path: mesh.path.clone(),
            scale,
        };
        Ok(Some((shape, vertices)))
    }
}

/// A mesh and its vertices, metres.
type MeshShape = (Shape, Vec<Point3<f64>>);

/// A shape, if the entry has one of this kind.
type OptionalShape = Result<Option<Shape>, SceneError>;

fn cuboid(place: &Place, entry: &PartEntry) -> OptionalShape {
    let Some(size) = entry.cuboid else {
        return Ok(None);
    };
    let half = halves(&place.key("box"), size)?;
    Ok(Some(Shape::Cuboid { half }))
}

fn rounded_box(place: &Place, entry: &PartEntry) -> OptionalShape {
    let Some(rounded) = &entry.rounded_box else {
        return Ok(None);
    };
    let place = place.key("rounded_box");
    let half = halves(&place.key("size"), rounded.size)?;
    let least = half.into_iter().fold(f64::INFINITY, f64::min);
    let radius = place.key("radius").within(
        rounded.radius,
        0.0002,
        least,
        "m",
        "the rounding is at most half of the shortest side",
    )?;
    Ok(Some(Shape::RoundedCuboid { half, radius }))
}

fn cylinder(place: &Place, entry: &PartEntry) -> OptionalShape {
    let Some(round) = &entry.cylinder else {
        return Ok(None);
    };
    let place = place.key("cylinder");
    Ok(Some(Shape::Cylinder {
        radius: place.key("radius").length(round.radius)?,
        half_height: place.key("height").length(round.height)? / 2.0,
    }))
}

fn capsule(place: &Place, entry: &PartEntry) -> OptionalShape {
    let Some(round) = &entry.capsule else {
        return Ok(None);
    };
    let place = place.key("capsule");
    let radius = place.key("radius").length(round.radius)?;
    let height = place.key("height").within(
        round.height,
        2.0 * radius,
        20.0,
        "m",
        "the height of a capsule includes both caps",
    )?;
    Ok(Some(Shape::Capsule {
        radius,
        half_height: height / 2.0 - radius,
    }))
}

fn sphere(place: &Place, entry: &PartEntry) -> OptionalShape {
    let Some(sphere) = &entry.sphere else {
        return Ok(None);
    };
    let radius = place.key("sphere").key("radius").length(sphere.radius)?;
    Ok(Some(Shape::Sphere { radius }))
}

fn frustum(place: &Place, entry: &PartEntry) -> OptionalShape {
    let Some(frustum) = &entry.frustum else {
        return Ok(None);
    };
    let place = place.key("frustum");
    Ok(Some(Shape::Frustum {
        bottom_radius: place.key("bottom_radius").length(frustum.bottom_radius)?,
        top_radius: place.key("top_radius").length(frustum.top_radius)?,
        half_height: place.key("height").length(frustum.height)? / 2.0,
    }))
}

fn cup(place: &Place, entry: &PartEntry) -> OptionalShape {
    let Some(cup) = &entry.cup else {
        return Ok(None);
    };
    let place = place.key("cup");
    let bottom_radius = place.key("bottom_radius").length(cup.bottom_radius)?;
    let top_radius = place.key("top_radius").length(cup.top_radius)?;
    let height = place.key("height").length(cup.height)?;
    let wall = place.key("wall").within(
        cup.wall,
        0.0005,
        bottom_radius.min(height).min(top_radius) / 2.0,
        "m",
        "the wall is thinner than half of the radius",
    )?;
    Ok(Some(Shape::Cup {
        bottom_radius,
        top_radius,
        height,
        wall,
    }))
}

fn lathe(place: &Place, entry: &PartEntry) -> OptionalShape {
    let Some(profile) = &entry.lathe else {
        return Ok(None);
    };
    let place = place.key("lathe");
    for &[radius, z] in profile {
        place.within(radius, 0.0, 20.0, "m", "points are [radius, z] in metres")?;
        place.within(z, -20.0, 20.0, "m", "points are [radius, z] in metres")?;
    }
    if profile.len() < 2 {
        return Err(place.wrong(
            format!("a profile of {} points", profile.len()),
            "at least 2 points",
            "give [radius, z] points from bottom to top",
        ));
    }
    Ok(Some(Shape::Lathe {
        profile: profile.clone(),
    }))
}

fn prism(place: &Place, entry: &PartEntry) -> OptionalShape {
    let Some(prism) = &entry.prism else {
        return Ok(None);
    };
    let place = place.key("prism");
    for [x, y] in &prism.outline {
        place.key("outline").position([*x, *y, 0.0])?;
    }
    if prism.outline.len() < 3 {
        return Err(place.key("outline").wrong(
            format!("a list of {} corners", prism.outline.len()),
            "at least 3 corners",
            "give the corners [x, y] of a polygon",
        ));
    }
    Ok(Some(Shape::Prism {
        outline: prism.outline.clone(),
        height: place.key("height").length(prism.height)?,
    }))
}

/// The points of a colliding hull, metres.
fn hull(place: &Place, entry: &PartEntry) -> Result<Option<Vec<Point3<f64>>>, SceneError> {
    let Some(points) = &entry.hull else {
        return Ok(None);
    };
    let alone = PartEntry {
        hull: entry.hull.clone(),
        at: entry.at,
        places: entry.places.clone(),
        rpy_deg: entry.rpy_deg,
        ..PartEntry::default()
    };
    if *entry != alone {
        return Err(place.wrong(
            "a hull beside another shape, or with material, draw or collide",
            "only the hull and its place",
            "write one entry per shape; hulls are never rendered",
        ));
    }
    let place = place.key("hull");
    if !(4..=MOST_HULL_VERTICES).contains(&points.len()) {
        return Err(place.wrong(
            format!("a list of {} points", points.len()),
            format!("4 to {MOST_HULL_VERTICES} points"),
            "leave out points inside the hull, or split it",
        ));
    }
    let points: Result<Vec<_>, _> = points
        .iter()
        .map(|point| place.position(*point).map(Point3::from))
        .collect();
    let points = points?;
    let size = Bounds::of_points(points.iter().copied()).map_or(0.0, |b| b.size().min());
    place.within(
        size,
        0.0005,
        100.0,
        "m in its shortest direction",
        "points in one plane have no inside: give it a thickness",
    )?;
    Ok(Some(points))
}

/// Shapes that never collide.
fn only_rendered(shape: &Shape) -> bool {
    matches!(
        shape,
        Shape::Lathe { .. } | Shape::Prism { .. } | Shape::PackedMesh { .. }
    )
}

fn halves(place: &Place, size: [f64; 3]) -> Result<[f64; 3], SceneError> {
    for length in size {
        place.edge(length)?;
    }
    Ok(size.map(|length| length / 2.0))
}

fn poses(place: &Place, entry: &PartEntry) -> Result<Vec<Isometry3<f64>>, SceneError> {
    let [roll, pitch, yaw] = entry.rpy_deg.unwrap_or_default();
    for angle in [roll, pitch, yaw] {
        place
            .key("rpy_deg")
            .within(angle, -360.0, 360.0, "degrees", "angles are degrees")?;
    }
    let turn =
        UnitQuaternion::from_euler_angles(roll.to_radians(), pitch.to_radians(), yaw.to_radians());
    let places = match (&entry.at, &entry.places) {
        (Some(_), Some(_)) => {
            return Err(place.wrong(
                "a part with both `at` and `places`",
                "one of them",
                "`at` is one place, `places` a list of them",
            ));
        }
        (Some(at), None) => vec![*at],
        (None, Some(places)) => places.clone(),
        (None, None) => vec![[0.0; 3]],
    };
    places
        .into_iter()
        .map(|at| {
            let at = place.key("at").position(at)?;
            Ok(Isometry3::from_parts(Translation3::from(at), turn))
        })
        .collect()
}
