//! Triangulation of every shape. Closed surfaces, counter-clockwise from outside;
//! texture coordinates in metres, `u` around or to the right and `v` upwards.
//! Independent of colours.

use std::path::{Path, PathBuf};

use wheelarm_proto::exact;

pub use super::detail::Detail;
use super::detail::drop_slivers;
pub use super::load::load;
use super::mesh_revolve::{Profile, revolve};
use super::prism::prism;
use super::{Shape, TriMesh, load_packed};

/// Largest number of triangles of one mesh file.
///
/// The whole home has a budget of 95 000, see ARCHITECTURE.md.
pub const MAX_TRIANGLES: usize = 200_000;

/// Why a shape cannot be triangulated.
#[derive(Debug, thiserror::Error)]
pub enum MeshError {
    /// An unreadable file.
    #[error(
        "mesh {path}: cannot be read ({reason}); check the path, which is relative to the assets folder"
    )]
    Unreadable {
        /// File.
        path: PathBuf,
        /// Message of the operating system.
        reason: String,
    },
    /// An unknown file extension.
    #[error(
        "mesh {path}: extension '{extension}' is not known, expected obj, gltf or glb; convert the file"
    )]
    UnknownFormat {
        /// File.
        path: PathBuf,
        /// Its extension.
        extension: String,
    },
    /// A damaged or unsupported file.
    #[error("mesh {path}: {reason}")]
    Malformed {
        /// File.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// A file without triangles.
    #[error("mesh {path}: has no triangles; export faces")]
    Empty {
        /// File.
        path: PathBuf,
    },
    /// A non-finite coordinate.
    #[error("mesh {path}: vertex {vertex} is not finite ({position:?}); repair the file")]
    NotFinite {
        /// File.
        path: PathBuf,
        /// Index of the first such vertex.
        vertex: usize,
        /// Its position.
        position: [f32; 3],
    },
    /// Too many triangles to render in time.
    #[error("mesh {path}: {count} triangles, at most {MAX_TRIANGLES} are accepted; decimate it")]
    TooManyTriangles {
        /// File.
        path: PathBuf,
        /// Triangles in the file.
        count: usize,
    },
    /// Sizes of an impossible solid.
    #[error("shape {shape}: {reason}")]
    BadShape {
        /// The shape as written.
        shape: String,
        /// What is wrong and what is expected.
        reason: String,
    },
}

/// Triangles of a shape in its own frame, metres. Mesh files are looked up below `assets_dir`.
///
/// # Errors
/// When a size is not positive and finite, or a mesh file is unusable.
pub fn build(shape: &Shape, assets_dir: &Path) -> Result<TriMesh, MeshError> {
    build_detail(shape, assets_dir, Detail::Full)
}

/// As [`build`], with a level of detail; mesh files are used as they are.
///
/// # Errors
/// As [`build`].
pub fn build_detail(
    shape: &Shape,
    assets_dir: &Path,
    detail: Detail,
) -> Result<TriMesh, MeshError> {
    check(shape)?;
    Ok(match shape {
        Shape::Cuboid { half } => cuboid(half),
        Shape::RoundedCuboid { half, radius } => rounded_cuboid(half, *radius, detail),
        Shape::Cylinder {
            radius,
            half_height: h,
        } => turned(
            &[[0.0, -h], [*radius, -h], [*radius, *h], [0.0, *h]],
            detail,
        ),
        Shape::Capsule {
            radius,
            half_height,
        } => revolve(&capsule_profile(*radius, *half_height, detail), detail),
        Shape::Sphere { radius } => revolve(&capsule_profile(*radius, 0.0, detail), detail),
        Shape::Frustum {
            bottom_radius: b,
            top_radius: t,
            half_height: h,
        } => turned(&[[0.0, -h], [*b, -h], [*t, *h], [0.0, *h]], detail),
        Shape::Cup {
            bottom_radius: b,
            top_radius: t,
            height,
            wall,
        } => turned(
            &[
                [0.0, 0.0],
                [*b, 0.0],
                [*t, *height],
                [t - wall, *height],
                [b - wall, *wall],
                [0.0, *wall],
            ],
            detail,
        ),
        Shape::Lathe { profile } => turned(profile, detail),
        Shape::Prism { outline, height } => prism(outline, *height),
        Shape::PackedMesh { file, scale } => load_packed(file, scale)?,
        Shape::Mesh { path, scale } => {
            let mut mesh = load(&assets_dir.join(path))?;
            for position in &mut mesh.positions {
                for value in position {
                    *value = (f64::from(*value) * scale) as f32;
                }
            }
            mesh
        }
    })
}

fn turned(points: &[[f64; 2]], detail: Detail) -> TriMesh {
    revolve(&Profile::closed(points.to_vec()), detail)
}

/// Rejects sizes of an impossible solid.
fn check(shape: &Shape) -> Result<(), MeshError> {
    let bad = |reason: String| {
        Err(MeshError::BadShape {
            shape: format!("{shape:?}"),
            reason,
        })
    };
    let positive = |name: &str, value: f64| {
        if value.is_finite() && value > 0.0 {
            Ok(())
        } else {
            bad(format!(
                "{name} is {value}, expected a positive length in metres"
            ))
        }
    };
    let not_negative = |name: &str, value: f64| {
        if value == 0.0 {
            Ok(())
        } else {
            positive(name, value)
        }
    };
    match shape {
        Shape::Cuboid { half } => half.iter().try_for_each(|&h| positive("half extent", h)),
        Shape::RoundedCuboid { half, radius } => {
            half.iter().try_for_each(|&h| positive("half extent", h))?;
            positive("radius", *radius)?;
            let least = half.iter().copied().fold(f64::INFINITY, f64::min);
            if *radius > least {
                return bad(format!(
                    "radius is {radius}, at most the smallest half extent {least} is possible"
                ));
            }
            Ok(())
        }
        Shape::Cylinder {
            radius,
            half_height,
        } => positive("radius", *radius).and(positive("half_height", *half_height)),
        Shape::Capsule {
            radius,
            half_height,
        } => positive("radius", *radius).and(not_negative("half_height", *half_height)),
        Shape::Sphere { radius } => positive("radius", *radius),
        Shape::Frustum {
            bottom_radius,
            top_radius,
            half_height,
        } => {
            positive("half_height", *half_height)?;
            not_negative("bottom_radius", *bottom_radius)?;
            not_negative("top_radius", *top_radius)?;
            positive("the larger radius", bottom_radius.max(*top_radius))
        }
        Shape::Cup {
            bottom_radius,
            top_radius,
            height,
            wall,
        } => {
            positive("bottom_radius", *bottom_radius)?;
            positive("top_radius", *top_radius)?;
            positive("height", *height)?;
            positive("wall", *wall)?;
            let most = bottom_radius.min(*top_radius).min(*height);
            if *wall >= most {
                return bad(format!("wall is {wall}, expected less than {most}"));
            }
            Ok(())
        }
        Shape::Lathe { profile } => {
            if profile.len() < 2 {
                return bad(format!(
                    "the profile has {} points, at least 2 are needed",
                    profile.len()
                ));
            }
            profile.iter().try_for_each(|[r, z]| {
                not_negative("profile radius", *r)?;
                if z.is_finite() {
                    Ok(())
                } else {
                    bad(format!(
                        "profile height is {z}, expected a number of metres"
                    ))
                }
            })?;
            positive(
                "the greatest profile radius",
                profile.iter().map(|p| p[0]).fold(0.0, f64::max),
            )
        }
        Shape::Prism { outline, height } => {
            if outline.len() < 3 {
                return bad(format!(
                    "the outline has {} corners, at least 3 are needed",
                    outline.len()
                ));
            }
            positive("height", *height)
        }
        Shape::PackedMesh { scale, .. } => {
            scale.iter().try_for_each(|s| positive("scale", s.abs()))
        }
        Shape::Mesh { scale, .. } => positive("scale", *scale),
    }
}

/// Half circle, straight side, half circle; from the bottom up.
fn capsule_profile(radius: f64, half_height: f64, detail: Detail) -> Profile {
    let arcs = (detail.chords(radius) / 4).max(2);
    let mut points = Vec::new();
    for (sign, range) in [(-1.0, 0..=arcs), (1.0, 0..=arcs)] {
        for i in range {
            if half_height == 0.0 && sign > 0.0 && i == 0 {
                continue;
            }
            let quarter = i as f64 / arcs as f64 * std::f64::consts::FRAC_PI_2;
            let angle = if sign < 0.0 {
                quarter - std::f64::consts::FRAC_PI_2
            } else {
                quarter
            };
            let r = if i == if sign < 0.0 { 0 } else { arcs } {
                0.0
            } else {
                radius * exact::cos(angle)
            };
            points.push([r, sign * half_height + radius * exact::sin(angle)]);
        }
    }
    Profile::smooth(points)
}

/// The six faces of a box: normal, direction of `u`, direction of `v`.
pub(super) const FACES: [[[f64; 3]; 3]; 6] = [
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    [[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]],
    [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
    [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
    [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
    [[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
];

fn extent(half: &[f64; 3], direction: &[f64; 3]) -> f64 {
    (0..3).map(|k| half[k] * direction[k].abs()).sum()
}

fn cuboid(half: &[f64; 3]) -> TriMesh {
    grid_box(half, 0.0, &[0.0, 1.0])
}

fn rounded_cuboid(half: &[f64; 3], radius: f64, detail: Detail) -> TriMesh {
    let steps = if detail == Detail::Full && radius > 0.008 {
        2
    } else {
        1
    };
    // The first and the last part of each edge are rounded; the middle is flat.
    let mut knots: Vec<f64> = (0..=steps)
        .map(|i| 0.25 * f64::from(i) / f64::from(steps))
        .collect();
    knots.extend((0..=steps).map(|i| 0.75 + 0.25 * f64::from(i) / f64::from(steps)));
    grid_box(half, radius, &knots)
}

/// Six grids. Knots in 0..0.25 cover the first rounding, 0.75..1 the last.
fn grid_box(half: &[f64; 3], radius: f64, knots: &[f64]) -> TriMesh {
    let mut mesh = TriMesh::default();
    let along = |knot: f64, h: f64| -> f64 {
        if radius == 0.0 {
            return h * (2.0 * knot - 1.0);
        }
        // Equal angles: the tangent spaces them on the cube.
        let bend = |part: f64| radius * exact::tan(part * std::f64::consts::FRAC_PI_4);
        if knot <= 0.25 {
            -(h - radius) - bend(1.0 - knot * 4.0)
        } else {
            (h - radius) + bend((knot - 0.75) * 4.0)
        }
    };
    let inner = half.map(|h| h - radius);
    for [normal, u_dir, v_dir] in &FACES {
        let (hu, hv, hn) = (
            extent(half, u_dir),
            extent(half, v_dir),
            extent(half, normal),
        );
        let first = mesh.positions.len() as u32;
        for &kv in knots {
            for &ku in knots {
                let (a, b) = (along(ku, hu), along(kv, hv));
                let mut p: [f64; 3] =
                    std::array::from_fn(|k| normal[k] * hn + u_dir[k] * a + v_dir[k] * b);
                let mut n = *normal;
                if radius > 0.0 {
                    let core: [f64; 3] = std::array::from_fn(|k| p[k].clamp(-inner[k], inner[k]));
                    n = std::array::from_fn(|k| p[k] - core[k]);
                    let length = n.iter().map(|x| x * x).sum::<f64>().sqrt();
                    n = n.map(|x| x / length);
                    p = std::array::from_fn(|k| core[k] + radius * n[k]);
                }
                mesh.positions.push(p.map(|x| x as f32));
                mesh.normals.push(n.map(|x| x as f32));
                mesh.uvs.push([(a + hu) as f32, (b + hv) as f32]);
            }
        }
        let width = knots.len() as u32;
        for j in 0..width - 1 {
            for i in 0..width - 1 {
                let a = first + j * width + i;
                mesh.indices
                    .extend([a, a + 1, a + width, a + 1, a + width + 1, a + width]);
            }
        }
    }
    drop_slivers(&mut mesh);
    mesh
}

#[cfg(test)]
#[path = "mesh_tests.rs"]
mod tests;
