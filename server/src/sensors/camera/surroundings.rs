//! Rays of ambient light through the cells of a home: corners, niches and the floor below
//! furniture receive less ambient light. Cells of 8 cm, from static geometry, at load.

use nalgebra::{Point3, Vector3};
use wheelarm_proto::exact;

use super::scene::{Binding, RenderItem, RenderScene};
use wheelarm_proto::parallel;

/// Side of a cell, metres.
const CELL: f64 = 0.08;
/// Occluders beyond this distance do not count, metres.
const REACH: f64 = 1.1;
/// Darkening when all directions are occluded.
const STRENGTH: f64 = 0.65;
/// Largest number of cells along each axis.
const MOST_CELLS: usize = 256;

/// Number of rays from a point.
const RAYS: usize = 28;
/// Unit vectors over a hemisphere, denser at the pole.
pub(super) type Hemisphere = [Vector3<f64>; RAYS];

/// Occupied cells and sampling directions.
pub(super) struct Surroundings {
    pub(super) low: Point3<f64>,
    pub(super) count: [usize; 3],
    pub(super) filled: Vec<bool>,
    /// Unit vectors over the hemisphere about z, denser at the pole.
    directions: Hemisphere,
}

impl Surroundings {
    pub(super) fn new(scene: &RenderScene) -> Self {
        // An emissive surface (a garden behind the windows) is not part of the house.
        let dark = |i: &&RenderItem| i.binding == Binding::World && i.material.emission < 0.3;
        let fixed = scene.items.iter().filter(dark);
        let fixed: Vec<&RenderItem> = fixed.collect();
        let placed = |item: &RenderItem| -> Vec<Point3<f64>> {
            let place = |p: &[f32; 3]| item.body_from_mesh * Point3::from(p.map(f64::from));
            item.coarse.positions.iter().map(place).collect()
        };
        let corners = parallel::map(fixed.clone(), placed);
        let mut low = Point3::from([f64::INFINITY; 3]);
        let mut high = Point3::from([f64::NEG_INFINITY; 3]);
        for p in corners.iter().flatten() {
            low = low.inf(p);
            high = high.sup(p);
        }
        if fixed.is_empty() {
            (low, high) = (Point3::origin(), Point3::origin());
        }
        let count = std::array::from_fn(|k| {
            (((high[k] - low[k]) / CELL).ceil() as usize + 1).clamp(1, MOST_CELLS)
        });
        let empty = || Self {
            low,
            count,
            filled: vec![false; count.iter().product()],
            directions: half_sphere(),
        };
        // Items are distributed over threads, each with its own cells.
        let threads = parallel::threads();
        let filled = parallel::map((0..threads).collect(), |share: usize| {
            let mut built = empty();
            let items = fixed.iter().zip(&corners).skip(share).step_by(threads);
            for (item, corners) in items {
                for t in item.coarse.indices.as_chunks::<3>().0 {
                    built.fill(t.map(|i| corners[i as usize]));
                }
            }
            built.filled
        });
        let mut built = empty();
        for share in filled {
            for (cell, is_filled) in built.filled.iter_mut().zip(share) {
                *cell |= is_filled;
            }
        }
        built
    }

    /// 4 m × 4 m × 3.2 m without occluders.
    #[cfg(test)]
    pub(super) fn empty_for_tests() -> Self {
        Self {
            low: Point3::new(-2.0, -2.0, -0.5),
            count: [50, 50, 40],
            filled: vec![false; 50 * 50 * 40],
            directions: half_sphere(),
        }
    }

    /// Its cells as bytes, for [`Self::from_bytes`].
    pub(super) fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(48 + self.filled.len() / 8 + 1);
        bytes.extend(self.low.iter().flat_map(|x| x.to_le_bytes()));
        bytes.extend(self.count.iter().flat_map(|n| (*n as u64).to_le_bytes()));
        let byte = |cells: &[bool]| {
            let bits = cells.iter().enumerate();
            bits.fold(0u8, |byte, (k, filled)| byte | u8::from(*filled) << k)
        };
        bytes.extend(self.filled.chunks(8).map(byte));
        bytes
    }

    /// The inverse of [`Self::to_bytes`]; `None` for other bytes.
    pub(super) fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let (head, cells) = bytes.split_at_checked(48)?;
        let mut words = head.as_chunks::<8>().0.iter().copied();
        let low: [f64; 3] = std::array::from_fn(|_| words.next().map_or(0.0, f64::from_le_bytes));
        let count: [usize; 3] =
            std::array::from_fn(|_| words.next().map_or(0, u64::from_le_bytes) as usize);
        let is_possible = count.iter().all(|n| (1..=MOST_CELLS).contains(n));
        let cell_count: usize = is_possible.then(|| count.iter().product())?;
        if cells.len() != cell_count.div_ceil(8) {
            return None;
        }
        Some(Self {
            low: low.into(),
            count,
            filled: (0..cell_count)
                .map(|i| cells[i / 8] >> (i % 8) & 1 != 0)
                .collect(),
            directions: half_sphere(),
        })
    }

    /// Marks the cells of a triangle by points half a cell apart.
    pub(super) fn fill(&mut self, [a, b, c]: [Point3<f64>; 3]) {
        let (e, f) = (b - a, c - a);
        let longest = e.norm().max(f.norm()).max((c - b).norm());
        let steps = ((longest / (0.5 * CELL)).ceil() as usize).clamp(1, 2 * MOST_CELLS);
        for i in 0..=steps {
            for j in 0..=steps - i {
                let (s, t) = (i as f64 / steps as f64, j as f64 / steps as f64);
                if let Some(cell) = self.cell(&(a + e * s + f * t)) {
                    self.filled[cell] = true;
                }
            }
        }
    }

    pub(super) fn cell(&self, p: &Point3<f64>) -> Option<usize> {
        let mut index = 0;
        for k in 0..3 {
            let x = (p[k] - self.low[k]) / CELL;
            if !(x >= 0.0 && x < self.count[k] as f64) {
                return None;
            }
            index = index * self.count[k] + x as usize;
        }
        Some(index)
    }

    /// Share of the ambient light that reaches a surface, 0 to 1.
    pub(super) fn of_surface(&self, p: &Point3<f64>, normal: &Vector3<f64>) -> f64 {
        self.of_surface_along(p, normal, &self.hemisphere(normal))
    }

    /// The directions of the rays from a surface.
    pub(super) fn hemisphere(&self, normal: &Vector3<f64>) -> Hemisphere {
        let (right, ahead) = across(normal);
        self.directions
            .map(|d| right * d.x + ahead * d.y + normal * d.z)
    }

    /// As [`Self::of_surface`]; `rays` is the [`Self::hemisphere`] of the normal.
    pub(super) fn of_surface_along(
        &self,
        p: &Point3<f64>,
        normal: &Vector3<f64>,
        rays: &Hemisphere,
    ) -> f64 {
        // Leave the surface's own cells first.
        let start = p + normal * (1.5 * CELL);
        self.light(&start, rays)
    }

    /// Whether the rays of [`Self::of_surface`] start outside of other bodies.
    pub(super) fn is_free_before(&self, p: &Point3<f64>, normal: &Vector3<f64>) -> bool {
        let start = p + normal * (1.5 * CELL);
        !self.cell(&start).is_some_and(|cell| self.filled[cell])
    }

    /// The mean of [`Self::of_surface`] around a point of a wide surface. Its vertices
    /// are up to 0.4 m apart, so faster variation would show as wing-shaped
    /// smudges. Points inside or behind a body in front of the surface do not count.
    pub(super) fn of_wide_surface(&self, p: &Point3<f64>, normal: &Vector3<f64>) -> f64 {
        let (right, ahead) = across(normal);
        let out = normal * (1.5 * CELL);
        let is_free = |p: &Point3<f64>| !self.cell(p).is_some_and(|cell| self.filled[cell]);
        let centre_is_free = is_free(&(p + out));
        let rays = self.hemisphere(normal);
        let (mut sum, mut weights) = (0.0, 0.0);
        for [x, y, weight] in patch() {
            let offset = right * x + ahead * y;
            let at = p + offset;
            let half_way = p + offset * 0.5;
            if is_free(&(at + out)) && (!centre_is_free || is_free(&(half_way + out))) {
                sum += weight * self.of_surface_along(&at, normal, &rays);
                weights += weight;
            }
        }
        if weights > 0.0 {
            sum / weights
        } else {
            self.of_surface(p, normal)
        }
    }

    /// Share of the ambient light from above that reaches a moving body.
    pub(super) fn of_body(&self, p: &Point3<f64>) -> f64 {
        let start = p + Vector3::z() * (1.5 * CELL);
        self.light(&start, &self.directions)
    }

    /// Share of the light along the rays from a point that is not blocked.
    fn light(&self, start: &Point3<f64>, rays: &Hemisphere) -> f64 {
        let blocked: f64 = rays.iter().map(|d| self.blocked(start, d)).sum();
        1.0 - STRENGTH * blocked / RAYS as f64
    }

    /// 1 for an occluder directly ahead, 0 for none within reach.
    fn blocked(&self, start: &Point3<f64>, direction: &Vector3<f64>) -> f64 {
        let mut distance = 0.0;
        while distance < REACH {
            match self.cell(&(start + direction * distance)) {
                None => return 0.0,
                Some(cell) if self.filled[cell] => return 1.0 - distance / REACH,
                Some(_) => distance += CELL,
            }
        }
        0.0
    }
}

/// Two unit vectors perpendicular to a normal.
pub(super) fn across(normal: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let helper = if normal.x.abs() < 0.7 {
        Vector3::x()
    } else {
        Vector3::y()
    };
    let right = normal.cross(&helper).normalize();
    (right, normal.cross(&right))
}

/// Points of a disc, metres, and their weights: its centre and two rings of six.
fn patch() -> [[f64; 3]; 13] {
    /// Radius and weight: a tent filter of radius 0.4 m.
    const RINGS: [[f64; 2]; 2] = [[0.13, 0.675], [0.26, 0.35]];
    std::array::from_fn(|i| {
        let Some(on_ring) = i.checked_sub(1) else {
            return [0.0, 0.0, 1.0];
        };
        let [radius, weight] = RINGS[on_ring / 6];
        let turn = std::f64::consts::PI * (on_ring % 6) as f64 / 3.0
            + std::f64::consts::FRAC_PI_6 * (on_ring / 6) as f64;
        let (sin, cos) = exact::sin_cos(turn);
        [radius * cos, radius * sin, weight]
    })
}

/// Cosine-weighted directions about z: equal areas of the unit disc, lifted.
fn half_sphere() -> Hemisphere {
    let golden = std::f64::consts::PI * (3.0 - 5.0f64.sqrt());
    std::array::from_fn(|i| {
        let r2 = (i as f64 + 0.5) / RAYS as f64;
        let (sin, cos) = exact::sin_cos(i as f64 * golden);
        Vector3::new(r2.sqrt() * cos, r2.sqrt() * sin, (1.0 - r2).sqrt())
    })
}
