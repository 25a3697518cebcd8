//! Convex hulls, by the library of the physics engine.

use std::panic::{AssertUnwindSafe, catch_unwind};

use parry3d::math::Vector;
use parry3d::transformation::try_convex_hull;

use super::mesh::{Vec3, bounds};

/// Steps of the decimal text of points, metres.
const STEP: f64 = 1.0e-5;
/// Shortest side of a hull that collides, metres.
const THIN: f64 = 6.0e-4;
/// Distance of a point outside of a hull that is kept, metres.
const NEAR: f64 = 1.0e-4;

/// A convex hull.
#[derive(Clone, Debug, PartialEq)]
pub struct Hull {
    /// Corners.
    pub points: Vec<Vec3>,
    /// Triangles, counter-clockwise seen from outside.
    pub triangles: Vec<[usize; 3]>,
}

impl Hull {
    /// The hull of points; `None` when they have no volume.
    pub fn of(points: &[Vec3]) -> Option<Self> {
        let [low, high] = bounds(points.iter());
        let size = high - low;
        if points.len() < 4 || size.min() < THIN || !size.max().is_finite() {
            return None;
        }
        let narrow: Vec<Vector> = points
            .iter()
            .map(|p| Vector::new(p.x as f32, p.y as f32, p.z as f32))
            .collect();
        // The library asserts what rounding may break; such points have no hull.
        let found = catch_unwind(AssertUnwindSafe(|| try_convex_hull(&narrow)));
        let (points, triangles) = found.ok()?.ok()?;
        let hull = Self {
            points: points.iter().map(point).collect(),
            triangles: triangles.iter().map(|t| t.map(|k| k as usize)).collect(),
        };
        (hull.volume() > 1.0e-10).then_some(hull)
    }

    fn faces(&self) -> impl Iterator<Item = [Vec3; 3]> {
        self.triangles.iter().map(|t| t.map(|k| self.points[k]))
    }

    /// Its volume, m³.
    pub fn volume(&self) -> f64 {
        self.faces()
            .map(|[a, b, c]| a.dot(&b.cross(&c)) / 6.0)
            .sum()
    }

    /// Distance of a point outside of it; negative inside.
    fn distance(&self, point: &Vec3) -> f64 {
        let of = |[a, b, c]: [Vec3; 3]| {
            let normal = (b - a).cross(&(c - a)).try_normalize(1.0e-12);
            normal.map_or(f64::NEG_INFINITY, |normal| normal.dot(&(point - a)))
        };
        self.faces().map(of).fold(f64::NEG_INFINITY, f64::max)
    }

    /// A hull of at most `most` of its corners, those that are furthest out first.
    pub fn reduced(&self, most: usize) -> Option<Self> {
        if self.points.len() <= most {
            return Some(self.clone());
        }
        let mut chosen: Vec<usize> = Vec::new();
        for direction in DIRECTIONS {
            let direction = Vec3::from(direction);
            let furthest = (0..self.points.len()).max_by(|&i, &j| {
                let along = |k: usize| self.points[k].dot(&direction);
                along(i).total_cmp(&along(j))
            });
            chosen.extend(furthest.filter(|k| !chosen.contains(k)));
        }
        let of = |chosen: &[usize]| {
            let points: Vec<Vec3> = chosen.iter().map(|&k| self.points[k]).collect();
            Self::of(&points)
        };
        let mut hull = of(&chosen)?;
        while chosen.len() < most {
            let left = (0..self.points.len()).filter(|k| !chosen.contains(k));
            let distances = left.map(|k| (hull.distance(&self.points[k]), k));
            let Some((distance, furthest)) = distances.max_by(|a, b| a.0.total_cmp(&b.0)) else {
                break;
            };
            if distance < NEAR {
                break;
            }
            chosen.push(furthest);
            let Some(next) = of(&chosen) else {
                break;
            };
            hull = next;
        }
        Some(hull)
    }
}

/// Directions whose extreme corners a reduced hull keeps.
const DIRECTIONS: [[f64; 3]; 14] = [
    [0.0, 0.0, -1.0],
    [0.0, 0.0, 1.0],
    [1.0, 0.0, 0.0],
    [-1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, -1.0, 0.0],
    [1.0, 1.0, -1.0],
    [-1.0, 1.0, -1.0],
    [1.0, -1.0, -1.0],
    [-1.0, -1.0, -1.0],
    [1.0, 1.0, 1.0],
    [-1.0, 1.0, 1.0],
    [1.0, -1.0, 1.0],
    [-1.0, -1.0, 1.0],
];

fn point(narrow: &Vector) -> Vec3 {
    Vec3::new(narrow.x.into(), narrow.y.into(), narrow.z.into())
}

/// A point as decimal text keeps it.
pub fn rounded(point: Vec3) -> [f64; 3] {
    point.map(|c| (c / STEP).round() * STEP).map(decimal).into()
}

/// A length with five decimals.
pub fn decimal(value: f64) -> f64 {
    let text = format!("{value:.5}");
    text.parse::<f64>().unwrap_or(value) + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hull_of_a_ball_keeps_its_size_with_few_corners() {
        let mut points = Vec::new();
        for i in 0..400 {
            let z = -1.0 + 2.0 * (f64::from(i) + 0.5) / 400.0;
            let (sin, cos) = wheelarm_proto::exact::sin_cos(f64::from(i) * 2.399);
            let r = (1.0_f64 - z * z).sqrt();
            points.push(Vec3::new(r * cos, r * sin, z) * 0.04);
        }
        let hull = Hull::of(&points).unwrap();
        let few = hull.reduced(24).unwrap();
        assert!(few.points.len() <= 24);
        let ball = 4.0 / 3.0 * std::f64::consts::PI * 0.04_f64.powi(3);
        assert!((hull.volume() / ball - 1.0).abs() < 0.05);
        assert!(few.volume() / hull.volume() > 0.75);
    }

    #[test]
    fn points_in_a_plane_have_no_hull() {
        let flat = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let flat = flat.map(|[x, y]| Vec3::new(x, y, 0.2));
        assert_eq!(Hull::of(&flat), None);
        assert_eq!(Hull::of(&[Vec3::zeros(); 9]), None);
        assert_eq!(Hull::of(&[Vec3::repeat(f64::NAN); 9]), None);
    }
}
