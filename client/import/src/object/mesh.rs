//! Triangles of an object with their materials, in the frame of a file or of the object.

use nalgebra::Vector3;

use crate::sh3d::Rgb;

/// A point or direction.
pub type Vec3 = Vector3<f64>;

/// Color of materials without one.
pub const GREY: Rgb = [190, 190, 190];

/// A material of an object.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// sRGB.
    pub colour: Rgb,
    /// 0 (mirror) to 1.
    pub roughness: f64,
    /// 0 dielectric to 1 metal.
    pub metallic: f64,
    /// Bytes of its image, JPEG or PNG.
    pub image: Option<Vec<u8>>,
}

impl Default for Surface {
    fn default() -> Self {
        Self {
            colour: GREY,
            roughness: 0.5,
            metallic: 0.0,
            image: None,
        }
    }
}

/// A triangle, counter-clockwise seen from outside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Face {
    /// Its corners.
    pub corners: [Vec3; 3],
    /// Texture coordinates, v upwards.
    pub uvs: Option<[[f32; 2]; 3]>,
    /// Index of its material.
    pub surface: usize,
}

impl Face {
    /// Twice the area times the normal.
    pub fn cross(&self) -> Vec3 {
        let [a, b, c] = self.corners;
        (b - a).cross(&(c - a))
    }

    /// Its area.
    pub fn area(&self) -> f64 {
        self.cross().norm() / 2.0
    }
}

/// A mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Triangles.
    pub faces: Vec<Face>,
    /// Materials.
    pub surfaces: Vec<Surface>,
}

impl Mesh {
    /// Lower and upper corner of its box.
    pub fn bounds(&self) -> [Vec3; 2] {
        bounds(self.faces.iter().flat_map(|face| &face.corners))
    }

    /// Its area.
    pub fn area(&self) -> f64 {
        self.faces.iter().map(Face::area).sum()
    }

    /// The volume that its faces enclose; meaningless for an open mesh.
    pub fn volume(&self) -> f64 {
        let of = |face: &Face| {
            let [a, b, c] = face.corners;
            a.dot(&b.cross(&c)) / 6.0
        };
        self.faces.iter().map(of).sum()
    }

    /// Converts all corners; with `mirrors` the triangles are turned round.
    pub fn map(&mut self, mirrors: bool, convert: impl Fn(Vec3) -> Vec3) {
        for face in &mut self.faces {
            face.corners = face.corners.map(&convert);
            if mirrors {
                face.corners.swap(1, 2);
                if let Some(uvs) = &mut face.uvs {
                    uvs.swap(1, 2);
                }
            }
        }
    }
}

/// Lower and upper corner of the box of points.
pub fn bounds<'a>(points: impl Iterator<Item = &'a Vec3>) -> [Vec3; 2] {
    let mut low = Vec3::repeat(f64::INFINITY);
    let mut high = Vec3::repeat(f64::NEG_INFINITY);
    for point in points {
        low = low.inf(point);
        high = high.sup(point);
    }
    [low, high]
}

/// A point on a mesh with the normal of its face.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// The point.
    pub at: Vec3,
    /// Unit normal.
    pub normal: Vec3,
}

/// About `count` points, evenly spread by area. Equal meshes give equal points.
pub fn sample(mesh: &Mesh, count: usize) -> Vec<Sample> {
    let total = mesh.area();
    if total <= 0.0 {
        return Vec::new();
    }
    // Additive sequences of the plastic number spread evenly in a triangle.
    let step = [0.754_877_666_246_692_7, 0.569_840_290_998_053_2];
    let mut found = Vec::with_capacity(count);
    let mut due = 0.0;
    let mut index = 0.0_f64;
    for face in &mesh.faces {
        let cross = face.cross();
        let area = cross.norm() / 2.0;
        if area <= 0.0 {
            continue;
        }
        due += area / total * count as f64;
        let normal = cross / (2.0 * area);
        while due >= 1.0 {
            due -= 1.0;
            index += 1.0;
            let mut u = (index * step[0]).fract();
            let mut v = (index * step[1]).fract();
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            let [a, b, c] = face.corners;
            let at = a + (b - a) * u + (c - a) * v;
            found.push(Sample { at, normal });
        }
    }
    found
}
