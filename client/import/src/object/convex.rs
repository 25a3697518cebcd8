//! Objects that are not round: one hull where they are nearly convex, else the parts of a convex
//! decomposition. It runs at import only: an update of the library cannot change a state.

use std::panic::{AssertUnwindSafe, catch_unwind};

use parry3d::math::Vector;
use parry3d::transformation::vhacd::{VHACD, VHACDParameters};
use parry3d::transformation::voxelization::{FillMode, VoxelSet};

use super::hull::Hull;
use super::mesh::{Mesh, Vec3};

/// Voxels along the longest side to measure a volume, and to decompose.
const MEASURED: u32 = 48;
const DECOMPOSED: u32 = 64;
/// Share of its hull that a nearly convex object fills.
const CONVEX: f64 = 0.95;
/// Most parts, and most corners of a part.
pub const MOST_PARTS: usize = 24;
pub const MOST_CORNERS: usize = 24;
/// Two parts are joined when their hull is larger than both by less than this share.
const JOINED: f64 = 0.04;
/// Corners below this height are on the ground, metres.
const GROUND: f64 = 0.002;

/// Collision hulls of a mesh whose base is at z = 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Hulls {
    /// `hull`, or `parts`.
    pub form: &'static str,
    /// The hulls.
    pub hulls: Vec<Hull>,
}

/// The hulls of a mesh; `None` when it has no volume.
pub fn hulls(mesh: &Mesh) -> Option<Hulls> {
    let corners: Vec<Vec3> = mesh.faces.iter().flat_map(|face| face.corners).collect();
    let whole = Hull::of(&corners)?;
    let share = voxels(mesh)
        .zip(voxels(&mesh_of(&whole)))
        .map_or(1.0, |(own, hull)| own as f64 / hull.max(1) as f64);
    let parts = match share >= CONVEX {
        true => Vec::new(),
        false => decomposed(mesh).unwrap_or_default(),
    };
    let hulls = finished(parts);
    Some(match hulls.is_empty() {
        true => Hulls {
            form: "hull",
            hulls: finished(vec![whole]),
        },
        false => Hulls {
            form: "parts",
            hulls,
        },
    })
}

/// The hulls of given parts, for example of CoACD.
pub fn of_parts(parts: &[Vec<Vec3>]) -> Hulls {
    let hulls = parts.iter().filter_map(|points| Hull::of(points)).collect();
    Hulls {
        form: "given parts",
        hulls: finished(hulls),
    }
}

/// Joined, standing on the ground, with few corners.
fn finished(hulls: Vec<Hull>) -> Vec<Hull> {
    let grounded = hulls.iter().filter_map(|hull| {
        let ground = |point: &Vec3| {
            let z = if point.z < GROUND { 0.0 } else { point.z };
            Vec3::new(point.x, point.y, z)
        };
        let points: Vec<Vec3> = hull.points.iter().map(ground).collect();
        Hull::of(&points)
    });
    let joined = joined(grounded.collect());
    joined
        .iter()
        .filter_map(|hull| hull.reduced(MOST_CORNERS))
        .collect()
}

/// Joins pairs whose hull is hardly larger than both, the least loss first.
fn joined(mut hulls: Vec<Hull>) -> Vec<Hull> {
    loop {
        let total: f64 = hulls.iter().map(Hull::volume).sum();
        let mut best: Option<(f64, usize, usize, Hull)> = None;
        for i in 0..hulls.len() {
            for j in i + 1..hulls.len() {
                let both = hulls[i].points.iter().chain(&hulls[j].points);
                let both: Vec<Vec3> = both.copied().collect();
                let Some(hull) = Hull::of(&both) else {
                    continue;
                };
                let own = hulls[i].volume() + hulls[j].volume();
                let loss = hull.volume() - own;
                if best.as_ref().is_none_or(|(least, ..)| loss < *least) {
                    best = Some((loss, i, j, hull));
                }
            }
        }
        let Some((loss, i, j, hull)) = best else {
            return hulls;
        };
        let own = hulls[i].volume() + hulls[j].volume();
        let is_small = loss < JOINED * own && loss < 0.01 * total;
        if !is_small && hulls.len() <= MOST_PARTS {
            return hulls;
        }
        hulls.remove(j);
        hulls[i] = hull;
    }
}

fn mesh_of(hull: &Hull) -> Mesh {
    let face = |t: &[usize; 3]| super::mesh::Face {
        corners: t.map(|k| hull.points[k]),
        uvs: None,
        surface: 0,
    };
    Mesh {
        faces: hull.triangles.iter().map(face).collect(),
        surfaces: Vec::new(),
    }
}

/// Corners and triangles for the library.
fn narrow(mesh: &Mesh) -> (Vec<Vector>, Vec<[u32; 3]>) {
    let mut indices = std::collections::BTreeMap::new();
    let mut points: Vec<Vector> = Vec::new();
    let mut triangles = Vec::new();
    for face in &mesh.faces {
        let triangle = face.corners.map(|corner| {
            let key: [i64; 3] = corner.map(|c| (c * 1.0e6).round() as i64).into();
            *indices.entry(key).or_insert_with(|| {
                let [x, y, z] = corner.map(|c| c as f32).into();
                points.push(Vector::new(x, y, z));
                points.len() as u32 - 1
            })
        });
        let [a, b, c] = triangle;
        if a != b && b != c && c != a {
            triangles.push(triangle);
        }
    }
    (points, triangles)
}

const FILL: FillMode = FillMode::FloodFill {
    detect_cavities: false,
};

/// Number of voxels that a mesh fills, its inside included, counted in voxels of its own box.
fn voxels(mesh: &Mesh) -> Option<usize> {
    let (points, triangles) = narrow(mesh);
    if triangles.is_empty() {
        return None;
    }
    let count = || VoxelSet::voxelize(&points, &triangles, MEASURED, FILL, false).len();
    catch_unwind(AssertUnwindSafe(count)).ok()
}

fn decomposed(mesh: &Mesh) -> Option<Vec<Hull>> {
    let (points, triangles) = narrow(mesh);
    let settings = VHACDParameters {
        resolution: DECOMPOSED,
        concavity: 0.01,
        max_convex_hulls: MOST_PARTS as u32,
        fill_mode: FILL,
        convex_hull_approximation: false,
        ..VHACDParameters::default()
    };
    let run = || {
        let parts = VHACD::decompose(&settings, &points, &triangles, true);
        parts.compute_exact_convex_hulls(&points, &triangles)
    };
    let parts = catch_unwind(AssertUnwindSafe(run)).ok()?;
    let wide = |point: &Vector| Vec3::new(point.x.into(), point.y.into(), point.z.into());
    let hulls = parts.iter().filter_map(|(points, _)| {
        let points: Vec<Vec3> = points.iter().map(wide).collect();
        Hull::of(&points)
    });
    Some(hulls.collect())
}
