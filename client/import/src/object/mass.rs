//! Mass, center and inertia by category: density times wall times surface, or times volume, and
//! contents.

use super::category::Category;
use super::hull::Hull;
use super::mesh::{Mesh, Vec3};

/// Share of a container that is filled.
const FILLED: f64 = 0.85;
/// Share of its hull below which the enclosed volume of a mesh is not one.
const CLOSED: f64 = 0.05;
/// An open mesh with both sides of its wall has at most this share of its hull.
const DOUBLE: f64 = 0.7;
/// Smallest moment of inertia, kg·m².
const LEAST: f64 = 2.0e-9;

/// Mass properties about the axes of the object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MassProperties {
    /// kg.
    pub mass: f64,
    /// Center of mass, metres.
    pub com: Vec3,
    /// Moments about the center, kg·m².
    pub inertia: [f64; 3],
}

/// Sums of masses and their first and second moments.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    mass: f64,
    first: Vec3,
    second: Vec3,
}

impl Sums {
    fn add(&mut self, mass: f64, at: Vec3) {
        self.mass += mass;
        self.first += at * mass;
        self.second += at.component_mul(&at) * mass;
    }

    fn scaled(self, factor: f64) -> Self {
        Self {
            mass: self.mass * factor,
            first: self.first * factor,
            second: self.second * factor,
        }
    }

    fn joined(self, other: Self) -> Self {
        Self {
            mass: self.mass + other.mass,
            first: self.first + other.first,
            second: self.second + other.second,
        }
    }
}

/// The mass properties of a mesh with collision `hulls`; `mass` replaces that of the category.
pub fn properties(
    mesh: &Mesh,
    hulls: &[Hull],
    category: &Category,
    mass: Option<f64>,
) -> MassProperties {
    let hull_volume: f64 = hulls.iter().map(Hull::volume).sum();
    let own = mesh.volume();
    let is_closed = own > CLOSED * hull_volume && own < 1.2 * hull_volume;
    let mut total = match category.wall {
        Some(wall) => {
            let sides = if category.open && own < DOUBLE * hull_volume {
                2.0
            } else {
                1.0
            };
            surface(mesh).scaled(category.density * wall / sides)
        }
        None if is_closed => volume_of_mesh(mesh).scaled(category.density),
        None => volume_of_hulls(hulls).scaled(category.density),
    };
    if category.contents > 0.0 {
        let inside = volume_of_hulls(hulls).scaled(category.contents * FILLED);
        total = total.joined(inside);
    }
    if total.mass <= 0.0 {
        total = volume_of_hulls(hulls).scaled(category.density);
    }
    if let Some(mass) = mass {
        total = total.scaled(mass / total.mass);
    }
    let com = total.first / total.mass;
    let spread = total.second / total.mass - com.component_mul(&com);
    let spread = spread.map(|s| s.max(1.0e-8));
    let moment = |a: f64, b: f64| (total.mass * (a + b)).max(LEAST);
    MassProperties {
        mass: total.mass,
        com,
        inertia: [
            moment(spread.y, spread.z),
            moment(spread.z, spread.x),
            moment(spread.x, spread.y),
        ],
    }
}

/// Area with its moments: three points of each triangle are exact for squares.
fn surface(mesh: &Mesh) -> Sums {
    let mut sums = Sums::default();
    for face in &mesh.faces {
        let [a, b, c] = face.corners;
        for at in [(a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0] {
            sums.add(face.area() / 3.0, at);
        }
    }
    sums
}

/// Volume with its moments, of the tetrahedra between the origin and the faces.
fn volume_of_mesh(mesh: &Mesh) -> Sums {
    let mut sums = Sums::default();
    for face in &mesh.faces {
        add_tetrahedron(
            &mut sums,
            [
                Vec3::zeros(),
                face.corners[0],
                face.corners[1],
                face.corners[2],
            ],
        );
    }
    sums
}

fn volume_of_hulls(hulls: &[Hull]) -> Sums {
    let mut sums = Sums::default();
    for hull in hulls {
        for t in &hull.triangles {
            let [a, b, c] = t.map(|k| hull.points[k]);
            add_tetrahedron(&mut sums, [Vec3::zeros(), a, b, c]);
        }
    }
    sums
}

/// Adds a tetrahedron with its signed volume; four points are exact for squares.
fn add_tetrahedron(sums: &mut Sums, corners: [Vec3; 4]) {
    let [o, a, b, c] = corners;
    let volume = (a - o).dot(&(b - o).cross(&(c - o))) / 6.0;
    let middle = (o + a + b + c) / 4.0;
    // Weights of the quadrature of degree 2.
    let near = 5.0_f64.sqrt().recip();
    for corner in corners {
        sums.add(volume / 4.0, middle + (corner - middle) * near);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::object::tests::{block, category};

    #[test]
    fn solid_block_has_the_moments_of_a_block() {
        let size = [0.1, 0.2, 0.3];
        let mesh = block(size);
        let hull = Hull::of(
            &mesh
                .faces
                .iter()
                .flat_map(|f| f.corners)
                .collect::<Vec<_>>(),
        );
        let properties = properties(&mesh, &[hull.unwrap()], &category("box"), Some(1.2));
        let about = |a: f64, b: f64| 1.2 / 12.0 * (a * a + b * b);
        let wanted = [about(0.2, 0.3), about(0.3, 0.1), about(0.1, 0.2)];
        for (found, wanted) in properties.inertia.iter().zip(wanted) {
            assert!((found / wanted - 1.0).abs() < 1e-6, "{found} {wanted}");
        }
        assert!((properties.com - Vec3::new(0.0, 0.0, 0.15)).norm() < 1e-9);
    }
}
