//! Shapes and triangle meshes: plain data shared by scene, robot, physics and cameras,
//! independent of collision and rendering.

mod detail;
mod load;
mod load_normals;
pub mod mesh;
mod mesh_revolve;
mod packed_file;
pub mod plush;
mod prism;
mod rays;
pub mod tetrahedra;
pub mod texture;

pub(crate) use load::{check_glb_length, load_packed};
pub(crate) use load_normals::box_uvs;
pub use packed_file::PackedFile;
pub use rays::Rays;

use nalgebra::{Isometry3, Vector3};

pub use wheelarm_pack::Family;

/// A solid or a surface in its own frame, metres. Axes of symmetry are z.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// Box.
    Cuboid {
        /// Half extents along x, y, z.
        half: [f64; 3],
    },
    /// Box with rounded edges.
    RoundedCuboid {
        /// Half extents along x, y, z, the rounding included.
        half: [f64; 3],
        /// Of the rounding.
        radius: f64,
    },
    /// Cylinder about z, centred.
    Cylinder {
        /// Across the axis.
        radius: f64,
        /// Along the axis.
        half_height: f64,
    },
    /// Capsule about z, centred.
    Capsule {
        /// Across the axis, and of the caps.
        radius: f64,
        /// Of the cylindrical part.
        half_height: f64,
    },
    /// Sphere.
    Sphere {
        /// Of the sphere.
        radius: f64,
    },
    /// Truncated cone about z, centred.
    Frustum {
        /// At its lower end.
        bottom_radius: f64,
        /// At its upper end.
        top_radius: f64,
        /// Along the axis.
        half_height: f64,
    },
    /// Open cup about z with its base at z = 0: collides as wall pieces and a floor.
    Cup {
        /// Outside, at the floor.
        bottom_radius: f64,
        /// Outside, at the rim.
        top_radius: f64,
        /// Outside.
        height: f64,
        /// Thickness.
        wall: f64,
    },
    /// Surface of revolution about z; for visuals only.
    Lathe {
        /// Points `[radius, z]`.
        profile: Vec<[f64; 2]>,
    },
    /// Polygon with a thickness, from z = 0 upwards; for visuals only.
    Prism {
        /// Corners `[x, y]` of a polygon that does not cross itself.
        outline: Vec<[f64; 2]>,
        /// Along z.
        height: f64,
    },
    /// Mesh file (OBJ or GLB) of a world pack; for visuals only.
    PackedMesh {
        /// The file.
        file: PackedFile,
        /// Metres per unit of the file along x, y, z with z up; a negative one mirrors.
        scale: [f64; 3],
    },
    /// Mesh file (OBJ or glTF) below the assets folder; collides as its convex hull.
    Mesh {
        /// Below the assets folder.
        path: String,
        /// Metres per unit of the file.
        scale: f64,
    },
}

/// A shape at a pose.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// Pose of the shape in its body (body_from_shape).
    pub pose: Isometry3<f64>,
    /// The shape.
    pub shape: Shape,
}

/// Triangles with normals and texture coordinates.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriMesh {
    /// Vertex positions, metres.
    pub positions: Vec<[f32; 3]>,
    /// Unit normals, one per vertex.
    pub normals: Vec<[f32; 3]>,
    /// Texture coordinates, one per vertex; one unit is one metre of surface.
    pub uvs: Vec<[f32; 2]>,
    /// Vertex indices, three per triangle, counter-clockwise from outside.
    pub indices: Vec<u32>,
}

/// Appearance of a surface. Colours are sRGB, 0 to 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name in assets/materials.
    pub name: String,
    /// Base colour, sRGB.
    pub color: [f32; 3],
    /// Roughness, 0 (mirror) to 1.
    pub roughness: f32,
    /// 0 dielectric, 1 metal.
    pub metallic: f32,
    /// Emitted light, as a fraction of the base colour.
    pub emission: f32,
    /// Procedural texture that multiplies the colour.
    pub texture: Option<Texture>,
    /// Materials of one family may replace each other in an appearance.
    pub family: Option<Family>,
    /// Share of transmitted light, with an appearance.
    pub transmission: f32,
}

/// A procedural texture, 512 x 512.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// Pattern name: `planks`, `tiles`, `plaster`, `wood`, `fabric`, `marble`, `label`, ….
    pub pattern: String,
    /// Metres of surface per repetition.
    pub metres: f32,
    /// The image of a world pack; `None` for one of the assets.
    pub file: Option<PackedFile>,
}

/// A rendered part.
#[derive(Clone, Debug, PartialEq)]
pub struct Visual {
    /// Pose and shape.
    pub part: Part,
    /// Material.
    pub material: Material,
}

/// Axis-aligned bounds of a shape in its own frame: centre and half extents,
/// metres. `None` for meshes, whose size is in their file.
#[must_use]
pub fn bounds(shape: &Shape) -> Option<(Vector3<f64>, Vector3<f64>)> {
    let centred = |x, y, z| Some((Vector3::zeros(), Vector3::new(x, y, z)));
    let standing = |r: f64, low: f64, high: f64| {
        let (centre, half) = ((low + high) / 2.0, (high - low) / 2.0);
        Some((Vector3::new(0.0, 0.0, centre), Vector3::new(r, r, half)))
    };
    match shape {
        Shape::Cuboid { half } | Shape::RoundedCuboid { half, .. } => {
            centred(half[0], half[1], half[2])
        }
        Shape::Cylinder {
            radius,
            half_height,
        } => centred(*radius, *radius, *half_height),
        Shape::Capsule {
            radius,
            half_height,
        } => centred(*radius, *radius, half_height + radius),
        Shape::Sphere { radius } => centred(*radius, *radius, *radius),
        Shape::Frustum {
            bottom_radius,
            top_radius,
            half_height,
        } => {
            let radius = bottom_radius.max(*top_radius);
            centred(radius, radius, *half_height)
        }
        Shape::Cup {
            bottom_radius,
            top_radius,
            height,
            ..
        } => standing(bottom_radius.max(*top_radius), 0.0, *height),
        Shape::Lathe { profile } => {
            let fold = |f: fn(f64, f64) -> f64, i: usize, from: f64| {
                profile.iter().map(|p| p[i]).fold(from, f)
            };
            let low = fold(f64::min, 1, f64::INFINITY);
            let high = fold(f64::max, 1, f64::NEG_INFINITY);
            if low > high {
                None
            } else {
                standing(fold(f64::max, 0, 0.0), low, high)
            }
        }
        Shape::Prism { outline, height } => {
            let fold = |f: fn(f64, f64) -> f64, i: usize, from: f64| {
                outline.iter().map(|p| p[i]).fold(from, f)
            };
            let low = [0, 1].map(|i| fold(f64::min, i, f64::INFINITY));
            let high = [0, 1].map(|i| fold(f64::max, i, f64::NEG_INFINITY));
            let half = |i: usize| (high[i] - low[i]) / 2.0;
            (low[0] <= high[0]).then(|| {
                let centre = Vector3::new(low[0] + half(0), low[1] + half(1), height / 2.0);
                (centre, Vector3::new(half(0), half(1), height / 2.0))
            })
        }
        Shape::Mesh { .. } | Shape::PackedMesh { .. } => None,
    }
}
