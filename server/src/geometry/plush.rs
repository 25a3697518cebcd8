//! A stuffed toy as a union of smoothly blended lobes, and its skin.
//!
//! The skin is the zero surface of a distance function, which `tetrahedra` also uses
//! for the volume. Independent of the elasticity.

use nalgebra::{Isometry3, Point3, Vector3};

use super::{Material, TriMesh};

/// An ellipsoid of a toy.
#[derive(Clone, Debug, PartialEq)]
pub struct Lobe {
    /// toy_from_lobe.
    pub pose: Isometry3<f64>,
    /// Semi-axes along the lobe's x, y, z, metres.
    pub radii: [f64; 3],
    /// Blending distance to the previous lobes, metres.
    pub blend: f64,
    /// Material of the skin closest to this lobe.
    pub material: Material,
}

/// A toy: its lobes, in the order of the union.
#[derive(Clone, Debug, PartialEq)]
pub struct Plush {
    /// At least one.
    pub lobes: Vec<Lobe>,
}

/// The surface of a toy in its rest shape.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Skin {
    /// Vertices in the toy's frame, metres.
    pub positions: Vec<Point3<f64>>,
    /// Triangles, counter-clockwise from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Lobe of each triangle.
    pub lobes: Vec<usize>,
}

impl Lobe {
    /// Approximate signed distance, negative inside, metres (Quilez, "Ellipsoid SDF").
    fn distance(&self, point: &Point3<f64>) -> f64 {
        let p = self.pose.inverse_transform_point(point).coords;
        let r = Vector3::from(self.radii);
        let near = p.component_div(&r);
        let steep = near.component_div(&r).norm();
        if steep < 1e-9 {
            return -self.radii[0].min(self.radii[1]).min(self.radii[2]);
        }
        near.norm() * (near.norm() - 1.0) / steep
    }
}

impl Plush {
    /// Approximate signed distance to the skin, negative inside, metres.
    #[must_use]
    pub fn distance(&self, point: &Point3<f64>) -> f64 {
        self.lobes.iter().fold(f64::INFINITY, |whole, lobe| {
            let d = lobe.distance(point);
            let overlap = lobe.blend - (whole - d).abs();
            if overlap > 0.0 {
                whole.min(d) - overlap * overlap / (4.0 * lobe.blend)
            } else {
                whole.min(d)
            }
        })
    }

    /// Gradient of [`Plush::distance`] by central differences.
    #[must_use]
    pub fn slope(&self, point: &Point3<f64>) -> Vector3<f64> {
        gradient(|p| self.distance(p), point)
    }

    /// The closest point of the skin, by Newton steps along the gradient.
    #[must_use]
    pub fn nearest(&self, point: &Point3<f64>) -> Point3<f64> {
        let mut p = *point;
        for _ in 0..4 {
            let slope = self.slope(&p);
            p -= slope * (self.distance(&p) / slope.norm_squared().max(0.1));
        }
        p
    }

    /// Corners of the bounding box of all lobes, metres.
    #[must_use]
    pub fn bounds(&self) -> (Point3<f64>, Point3<f64>) {
        let mut low = Point3::from([f64::INFINITY; 3]);
        let mut high = Point3::from([f64::NEG_INFINITY; 3]);
        for lobe in &self.lobes {
            let turn = lobe.pose.rotation.to_rotation_matrix();
            let scaled = turn.matrix() * nalgebra::Matrix3::from_diagonal(&lobe.radii.into());
            for axis in 0..3 {
                let reach = scaled.row(axis).norm() + lobe.blend / 4.0;
                let centre = lobe.pose.translation.vector[axis];
                low[axis] = low[axis].min(centre - reach);
                high[axis] = high[axis].max(centre + reach);
            }
        }
        (low, high)
    }

    /// Triangles with an edge length of about `pitch` metres (surface nets, Gibson
    /// 1998).
    #[must_use]
    pub fn skin(&self, pitch: f64) -> Skin {
        let (low, high) = self.bounds();
        let low = low - Vector3::repeat(1.5 * pitch);
        let count: [usize; 3] =
            std::array::from_fn(|i| ((high[i] - low[i]) / pitch).ceil() as usize + 3);
        let index = |c: [usize; 3]| (c[2] * count[1] + c[1]) * count[0] + c[0];
        let corner = |c: [usize; 3]| low + Vector3::from(c.map(|i| i as f64)) * pitch;
        let mut field = vec![0.0; count.iter().product()];
        each(count, |c| field[index(c)] = self.distance(&corner(c)));

        let mut skin = Skin::default();
        let mut vertex = vec![None; field.len()];
        each(count.map(|n| n - 1), |c| {
            if let Some(p) = crossing(c, &field, index, corner) {
                vertex[index(c)] = Some(skin.positions.len() as u32);
                skin.positions.push(self.nearest(&p));
            }
        });
        each(count.map(|n| n - 1), |c| {
            for axis in 0..3 {
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                if c[u] == 0 || c[v] == 0 {
                    continue;
                }
                let mut next = c;
                next[axis] += 1;
                let (here, there) = (field[index(c)] < 0.0, field[index(next)] < 0.0);
                if here == there {
                    continue;
                }
                let around = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[a, b]| {
                    let mut cell = c;
                    cell[u] -= a;
                    cell[v] -= b;
                    vertex[index(cell)]
                });
                if let [Some(a), Some(b), Some(d), Some(e)] = around {
                    let quad = if here { [a, b, d, e] } else { [a, e, d, b] };
                    skin.triangles.push([quad[0], quad[1], quad[2]]);
                    skin.triangles.push([quad[0], quad[2], quad[3]]);
                }
            }
        });
        skin.lobes = skin
            .triangles
            .iter()
            .map(|t| self.nearest_lobe(&skin.middle(*t)))
            .collect();
        self.sew(&mut skin, pitch);
        skin
    }

    /// Moves the vertices between two materials along the skin to where both lobes are
    /// equally close, for smooth seams.
    fn sew(&self, skin: &mut Skin, pitch: f64) {
        let appearances: Vec<usize> = self
            .lobes
            .iter()
            .map(|lobe| self.material_of(lobe))
            .collect();
        let mut meeting = vec![[usize::MAX; 2]; skin.positions.len()];
        for (triangle, lobe) in skin.triangles.iter().zip(&skin.lobes) {
            for corner in triangle {
                let [first, second] = &mut meeting[*corner as usize];
                if *first == usize::MAX {
                    *first = appearances[*lobe];
                } else if *first != appearances[*lobe] {
                    *second = appearances[*lobe];
                }
            }
        }
        let distance = |appearance: usize, p: &Point3<f64>| {
            let own = self
                .lobes
                .iter()
                .zip(&appearances)
                .filter(|(_, l)| **l == appearance);
            own.map(|(lobe, _)| lobe.distance(p))
                .fold(f64::INFINITY, f64::min)
        };
        for (p, [first, second]) in skin.positions.iter_mut().zip(meeting) {
            if second == usize::MAX {
                continue;
            }
            let nearer = |p: &Point3<f64>| distance(first, p) - distance(second, p);
            let at = *p;
            let up = self.slope(&at).normalize();
            let slope = gradient(nearer, &at);
            let along = slope - up * up.dot(&slope);
            let step = along * (-nearer(&at) / along.norm_squared().max(0.01));
            let far = step.norm().max(1e-12);
            *p = self.nearest(&(at + step * (0.45 * pitch / far).min(1.0)));
        }
    }

    /// The first lobe with the same material.
    fn material_of(&self, lobe: &Lobe) -> usize {
        let same = |other: &Lobe| other.material == lobe.material;
        self.lobes.iter().position(same).unwrap_or(0)
    }

    fn nearest_lobe(&self, point: &Point3<f64>) -> usize {
        let distance = |i: &usize| self.lobes[*i].distance(point);
        (0..self.lobes.len())
            .min_by(|a, b| distance(a).total_cmp(&distance(b)))
            .unwrap_or(0)
    }
}

impl Skin {
    fn middle(&self, triangle: [u32; 3]) -> Point3<f64> {
        let [a, b, c] = triangle.map(|i| self.positions[i as usize].coords);
        Point3::from((a + b + c) / 3.0)
    }

    /// Surface area of each vertex, m².
    #[must_use]
    pub fn areas(&self) -> Vec<f64> {
        let mut areas = vec![0.0; self.positions.len()];
        for triangle in &self.triangles {
            let [a, b, c] = triangle.map(|i| self.positions[i as usize]);
            let third = (b - a).cross(&(c - a)).norm() / 6.0;
            for i in triangle {
                areas[*i as usize] += third;
            }
        }
        areas
    }

    /// Unit normals of the vertices at their present positions.
    #[must_use]
    pub fn normals(&self, positions: &[Point3<f64>]) -> Vec<Vector3<f64>> {
        let mut normals = vec![Vector3::zeros(); positions.len()];
        for triangle in &self.triangles {
            let [a, b, c] = triangle.map(|i| positions[i as usize]);
            let normal = (b - a).cross(&(c - a));
            for i in triangle {
                normals[*i as usize] += normal;
            }
        }
        for normal in &mut normals {
            *normal = normal.try_normalize(1e-12).unwrap_or(Vector3::z());
        }
        normals
    }

    /// Volume enclosed by a closed skin, m³.
    #[must_use]
    pub fn volume(&self) -> f64 {
        let part = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| self.positions[i as usize].coords);
            a.dot(&b.cross(&c)) / 6.0
        };
        self.triangles.iter().map(part).sum()
    }

    /// The triangles of some lobes with their own vertices, in the rest shape.
    #[must_use]
    pub fn part(&self, of: impl Fn(usize) -> bool) -> TriMesh {
        let normals = self.normals(&self.positions);
        let mut mesh = TriMesh::default();
        let mut known = std::collections::BTreeMap::new();
        let chosen = self.triangles.iter().zip(&self.lobes);
        for corner in chosen.filter(|(_, lobe)| of(**lobe)).flat_map(|(t, _)| t) {
            let index = *known.entry(*corner).or_insert_with(|| {
                let (p, n) = (self.positions[*corner as usize], normals[*corner as usize]);
                mesh.positions.push(p.coords.cast::<f32>().into());
                mesh.normals.push(n.cast::<f32>().into());
                mesh.uvs.push(unrolled(&p, &n));
                mesh.positions.len() as u32 - 1
            });
            mesh.indices.push(index);
        }
        mesh
    }
}

/// Gradient of a field by central differences.
fn gradient(field: impl Fn(&Point3<f64>) -> f64, at: &Point3<f64>) -> Vector3<f64> {
    const STEP: f64 = 1e-5;
    Vector3::from_fn(|axis, _| {
        let mut step = Vector3::zeros();
        step[axis] = STEP;
        (field(&(at + step)) - field(&(at - step))) / (2.0 * STEP)
    })
}

/// Texture coordinates along the two axes most parallel to the surface, metres.
fn unrolled(p: &Point3<f64>, n: &Vector3<f64>) -> [f32; 2] {
    let face = n.iamax();
    [p[(face + 1) % 3] as f32, p[(face + 2) % 3] as f32]
}

/// Calls `f` for all cells of a grid, x fastest.
fn each(count: [usize; 3], mut f: impl FnMut([usize; 3])) {
    for z in 0..count[2] {
        for y in 0..count[1] {
            for x in 0..count[0] {
                f([x, y, z]);
            }
        }
    }
}

/// Mean of the points at which the surface intersects the edges of a grid cell.
fn crossing(
    c: [usize; 3],
    field: &[f64],
    index: impl Fn([usize; 3]) -> usize,
    corner: impl Fn([usize; 3]) -> Point3<f64>,
) -> Option<Point3<f64>> {
    let mut sum = Vector3::zeros();
    let mut found = 0.0;
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for [a, b] in [[0, 0], [0, 1], [1, 0], [1, 1]] {
            let mut from = c;
            from[u] += a;
            from[v] += b;
            let mut to = from;
            to[axis] += 1;
            let (d0, d1) = (field[index(from)], field[index(to)]);
            if (d0 < 0.0) != (d1 < 0.0) {
                let (p0, p1) = (corner(from), corner(to));
                sum += p0.coords + (p1 - p0) * (d0 / (d0 - d1));
                found += 1.0;
            }
        }
    }
    (found > 0.0).then(|| Point3::from(sum / found))
}
