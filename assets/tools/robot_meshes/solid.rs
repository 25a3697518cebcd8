//! Smooth solids from rings, straps and prisms, written as OBJ.
//!
//! Positions and faces only: the reader makes the normals and keeps edges
//! sharp above 40 degrees, so a bevel is what makes an edge soft.

use std::fmt::Write as _;
use std::path::Path;

use nalgebra::{Isometry3, Point3, Vector3};

/// Triangles, counter-clockwise from outside, metres.
#[derive(Default)]
pub struct Solid {
    positions: Vec<Point3<f64>>,
    faces: Vec<[usize; 3]>,
}

/// A closed curve around `center`: an ellipse for `power` 2, nearly a
/// rectangle for 8. Rings follow each other along `across` x `along`.
#[derive(Clone, Copy)]
pub struct Ring {
    pub center: Point3<f64>,
    pub across: Vector3<f64>,
    pub along: Vector3<f64>,
    pub power: f64,
}

impl Ring {
    fn point(&self, turn: f64) -> Point3<f64> {
        let (sin, cos) = (turn * std::f64::consts::TAU).sin_cos();
        let bend = |part: f64| part.abs().powf(2.0 / self.power).copysign(part);
        self.center + self.across * bend(cos) + self.along * bend(sin)
    }
}

impl Solid {
    /// Skin over rings with flat ends.
    pub fn loft(&mut self, rings: &[Ring], segments: usize) {
        let first = self.positions.len();
        for ring in rings {
            let points = (0..segments).map(|j| ring.point(j as f64 / segments as f64));
            self.positions.extend(points);
        }
        let at = |ring: usize, j: usize| first + ring * segments + j % segments;
        for ring in 1..rings.len() {
            for j in 0..segments {
                let (a, b) = (at(ring - 1, j), at(ring - 1, j + 1));
                let (c, d) = (at(ring, j + 1), at(ring, j));
                self.faces.extend([[a, b, c], [a, c, d]]);
            }
        }
        let last = rings.len() - 1;
        for j in 1..segments - 1 {
            self.faces.push([at(0, 0), at(0, j + 1), at(0, j)]);
            self.faces.push([at(last, 0), at(last, j), at(last, j + 1)]);
        }
    }

    /// Solid of revolution about z of `frame`, from `[radius, z]`, z rising.
    pub fn turn(&mut self, frame: &Isometry3<f64>, profile: &[[f64; 2]], segments: usize) {
        let rings: Vec<Ring> = profile
            .iter()
            .map(|&[radius, z]| Ring {
                center: frame * Point3::new(0.0, 0.0, z),
                across: frame * Vector3::new(radius, 0.0, 0.0),
                along: frame * Vector3::new(0.0, radius, 0.0),
                power: 2.0,
            })
            .collect();
        self.loft(&rings, segments);
    }

    /// Cylinder about z of `frame` between two heights, with bevelled edges.
    pub fn cylinder(&mut self, frame: &Isometry3<f64>, radius: f64, z: [f64; 2], bevel: f64) {
        let [low, high] = z;
        let profile = [
            [radius - bevel, low],
            [radius - 0.3 * bevel, low + 0.3 * bevel],
            [radius, low + bevel],
            [radius, high - bevel],
            [radius - 0.3 * bevel, high - 0.3 * bevel],
            [radius - bevel, high],
        ];
        // Small ones need fewer sides.
        let sides = if radius < 0.01 { 12 } else { 24 };
        self.turn(frame, &profile, sides);
    }

    /// Band around a cylinder: a ring without visible ends.
    pub fn band(&mut self, frame: &Isometry3<f64>, radius: f64, z: [f64; 2]) {
        self.turn(frame, &[[radius, z[0]], [radius, z[1]]], 28);
    }

    /// Box with soft edges, centred in `frame`.
    pub fn block(&mut self, frame: &Isometry3<f64>, half: [f64; 3], edge: f64) {
        let [x, y, z] = half;
        let ring = |inset: f64, height: f64| Ring {
            center: frame * Point3::new(0.0, 0.0, height),
            across: frame * Vector3::new(x - inset, 0.0, 0.0),
            along: frame * Vector3::new(0.0, y - inset, 0.0),
            power: 9.0,
        };
        let rings = [
            ring(edge, -z),
            ring(0.3 * edge, -z + 0.3 * edge),
            ring(0.0, -z + edge),
            ring(0.0, z - edge),
            ring(0.3 * edge, z - 0.3 * edge),
            ring(edge, z),
        ];
        self.loft(&rings, 16);
    }

    /// Plate around two pins along y: `[x, z, radius]` each, between two y.
    pub fn strap(&mut self, pins: [[f64; 3]; 2], y: [f64; 2]) {
        const HALF: usize = 5;
        let [[x0, z0, r0], [x1, z1, r1]] = pins;
        let direction = (z1 - z0).atan2(x1 - x0);
        let arc = |x: f64, z: f64, r: f64, from: f64| {
            (0..HALF).map(move |i| {
                let angle = from + std::f64::consts::PI * i as f64 / (HALF - 1) as f64;
                [x + r * angle.cos(), z + r * angle.sin()]
            })
        };
        let quarter = std::f64::consts::FRAC_PI_2;
        let outline: Vec<[f64; 2]> = arc(x1, z1, r1, direction - quarter)
            .chain(arc(x0, z0, r0, direction + quarter))
            .collect();
        self.prism(&outline, y);
    }

    /// Convex outline in x and z, counter-clockwise with x to the right and z
    /// up, between two y; its edges are bevelled by a tenth of the thickness.
    pub fn prism(&mut self, outline: &[[f64; 2]], y: [f64; 2]) {
        let count = outline.len();
        let middle = outline
            .iter()
            .fold([0.0, 0.0], |sum, p| [sum[0] + p[0], sum[1] + p[1]])
            .map(|sum| sum / count as f64);
        let bevel = (0.1 * (y[1] - y[0])).min(0.001);
        let first = self.positions.len();
        // Seen from -y the outline runs counter-clockwise: front ring first.
        for (at, inset) in [
            (y[0], bevel),
            (y[0] + bevel, 0.0),
            (y[1] - bevel, 0.0),
            (y[1], bevel),
        ] {
            for p in outline {
                let way = [p[0] - middle[0], p[1] - middle[1]];
                let keep = 1.0 - inset / way[0].hypot(way[1]).max(2.0 * bevel);
                self.positions.push(Point3::new(
                    middle[0] + way[0] * keep,
                    at,
                    middle[1] + way[1] * keep,
                ));
            }
        }
        let at = |ring: usize, j: usize| first + ring * count + j % count;
        for ring in 0..3 {
            for j in 0..count {
                let (a, b) = (at(ring, j), at(ring, j + 1));
                let (c, d) = (at(ring + 1, j + 1), at(ring + 1, j));
                self.faces.extend([[a, c, b], [a, d, c]]);
            }
        }
        for j in 1..count - 1 {
            self.faces.push([at(0, 0), at(0, j), at(0, j + 1)]);
            self.faces.push([at(3, 0), at(3, j + 1), at(3, j)]);
        }
    }

    /// Mirrored at x = 0.
    pub fn mirrored(&self) -> Solid {
        Solid {
            positions: self
                .positions
                .iter()
                .map(|p| Point3::new(-p.x, p.y, p.z))
                .collect(),
            faces: self.faces.iter().map(|&[a, b, c]| [a, c, b]).collect(),
        }
    }

    /// Volume inside, m³: positive when the faces look outwards.
    pub fn volume(&self) -> f64 {
        let point = |i: usize| self.positions[i].coords;
        self.faces
            .iter()
            .map(|&[a, b, c]| point(a).dot(&point(b).cross(&point(c))) / 6.0)
            .sum()
    }

    pub fn triangles(&self) -> usize {
        self.faces.len()
    }

    /// Writes an OBJ file.
    pub fn write(&self, path: &Path) -> std::io::Result<()> {
        let mut text = String::from("# Generated by assets/tools/robot_meshes. Metres, z up.\n");
        for p in &self.positions {
            let _ = writeln!(text, "v {:.5} {:.5} {:.5}", p.x, p.y, p.z);
        }
        for [a, b, c] in &self.faces {
            let _ = writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1);
        }
        std::fs::write(path, text)
    }
}
