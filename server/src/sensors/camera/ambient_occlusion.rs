//! Ambient occlusion: corners, niches and the floor below furniture receive less
//! ambient light. Computed once, at load, from static geometry, in cells of 8 cm.

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};
use parking_lot::Mutex;
use wheelarm_proto::exact;

use super::ambient_map::{Chart, Plane};
use super::parallel;
use super::scene::{Binding, RenderItem, RenderScene};

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
    low: Point3<f64>,
    count: [usize; 3],
    filled: Vec<bool>,
    /// About z.
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
    fn fill(&mut self, [a, b, c]: [Point3<f64>; 3]) {
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

    fn cell(&self, p: &Point3<f64>) -> Option<usize> {
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
    /// are up to [`LONGEST`] apart, so faster variation would show as wing-shaped
    /// smudges. Points inside or behind a body in front of the surface do not count.
    fn of_wide_surface(&self, p: &Point3<f64>, normal: &Vector3<f64>) -> f64 {
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
    /// Radius and weight: a tent filter of radius [`LONGEST`].
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

/// A corner of a static triangle, in the world frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corner {
    pub(super) position: Point3<f64>,
    pub(super) normal: Vector3<f64>,
    pub(super) uv: [f32; 2],
    pub(super) ambient_occlusion: f64,
}

/// Source of the ambient light at the corners of a triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum CornerLight {
    /// Pixels sample it from a chart.
    Chart,
    /// Rays from each corner; smoothed on a wide surface.
    Own { is_wide: bool },
}

/// Longer edges are halved, so that light can vary along them, metres.
const LONGEST: f64 = 0.4;

/// Computed values of one body, keyed by the bits of position and normal: neighbours
/// share corners, and full and coarse detail of a board are the same triangles.
pub(super) struct AmbientOcclusion<'a> {
    around: &'a Surroundings,
    known: AmbientCache,
}

/// The ambient light of one body.
#[derive(Default)]
pub(super) struct AmbientCache {
    /// By the bits of position and normal, and whether the surface is wide.
    points: BTreeMap<([u64; 6], bool), f64>,
    /// Charts of its wide planes.
    pub(super) charts: BTreeMap<Plane, Chart>,
}

/// The ambient light of a home, by body, so that bodies can be computed in parallel.
pub(super) struct HomeLight<'a> {
    around: &'a Surroundings,
    known: Vec<AmbientCache>,
}

/// Values of the home that was rendered last: the next scene is usually another sample
/// of the same home.
#[derive(Default)]
pub(super) struct LastHome(Mutex<Option<(Home, Vec<AmbientCache>)>>);

/// Occupied cells, which identify a home.
#[derive(PartialEq)]
struct Home {
    low: Point3<f64>,
    count: [usize; 3],
    filled: Vec<bool>,
}

impl LastHome {
    /// Takes the stored values of a home.
    pub(super) fn take<'a>(&self, around: &'a Surroundings) -> HomeLight<'a> {
        let known = self.0.lock().take();
        let same = |home: &Home| {
            (home.low, home.count) == (around.low, around.count) && home.filled == around.filled
        };
        HomeLight {
            around,
            known: known
                .filter(|(home, _)| same(home))
                .map_or_else(Vec::new, |(_, known)| known),
        }
    }

    /// Stores the values for the next scene.
    pub(super) fn keep(&self, worked_out: HomeLight<'_>) {
        let Surroundings {
            low, count, filled, ..
        } = worked_out.around;
        let home = Home {
            low: *low,
            count: *count,
            filled: filled.clone(),
        };
        *self.0.lock() = Some((home, worked_out.known));
    }
}

impl<'a> HomeLight<'a> {
    /// Takes the values of a body, by its number among the static ones.
    pub(super) fn of_body(&mut self, fixed: usize) -> AmbientOcclusion<'a> {
        AmbientOcclusion {
            around: self.around,
            known: self
                .known
                .get_mut(fixed)
                .map_or_else(AmbientCache::default, std::mem::take),
        }
    }

    /// Puts the values of a body back.
    pub(super) fn put_back(&mut self, fixed: usize, known: AmbientCache) {
        if self.known.len() <= fixed {
            self.known.resize_with(fixed + 1, AmbientCache::default);
        }
        self.known[fixed] = known;
    }
}

impl AmbientOcclusion<'_> {
    /// Share of the ambient light that reaches a surface, 0 to 1; smoothed for a wide
    /// surface.
    pub(super) fn of_surface(
        &mut self,
        p: &Point3<f64>,
        normal: &Vector3<f64>,
        is_wide: bool,
    ) -> f64 {
        let key = [p.x, p.y, p.z, normal.x, normal.y, normal.z].map(f64::to_bits);
        let around = self.around;
        *self
            .known
            .points
            .entry((key, is_wide))
            .or_insert_with(|| match is_wide {
                true => around.of_wide_surface(p, normal),
                false => around.of_surface(p, normal),
            })
    }

    /// The bodies that block ambient light.
    pub(super) fn around(&self) -> &Surroundings {
        self.around
    }

    /// Removes the charts of the previous scene from the cache.
    pub(super) fn take_charts(&mut self) -> BTreeMap<Plane, Chart> {
        std::mem::take(&mut self.known.charts)
    }

    /// Stores charts for the next scene.
    pub(super) fn keep_charts(&mut self, charts: &BTreeMap<Plane, Chart>) {
        self.known.charts = charts.clone();
    }

    /// All values.
    pub(super) fn into_known(self) -> AmbientCache {
        self.known
    }

    /// Subdivides a static triangle. Edges are split by their length only, as those of
    /// the neighbour, so there are no gaps. Surfaces facing outdoors stay whole.
    /// Corners on a chart need no light of their own.
    pub(super) fn cut(&mut self, triangle: [Corner; 3], light: CornerLight) -> Vec<[Corner; 3]> {
        let [a, b, c] = &triangle;
        let middle =
            Point3::from((a.position.coords + b.position.coords + c.position.coords) / 3.0);
        if self.around.cell(&(middle + a.normal * 0.5)).is_none() {
            return vec![triangle];
        }
        let mut pieces = Vec::new();
        let mut waiting = vec![triangle];
        while let Some(t) = waiting.pop() {
            let length = |k: usize| (t[(k + 1) % 3].position - t[k].position).norm();
            let k = (0..3)
                .max_by(|&a, &b| length(a).total_cmp(&length(b)))
                .unwrap_or(0);
            if length(k) <= LONGEST {
                pieces.push(t);
                continue;
            }
            let (a, b, c) = (t[k], t[(k + 1) % 3], t[(k + 2) % 3]);
            let m = self.middle(&a, &b, light);
            waiting.extend([[a, m, c], [m, b, c]]);
        }
        pieces
    }

    fn middle(&mut self, a: &Corner, b: &Corner, light: CornerLight) -> Corner {
        let position = nalgebra::center(&a.position, &b.position);
        let normal = (a.normal + b.normal)
            .try_normalize(1e-6)
            .unwrap_or(a.normal);
        Corner {
            position,
            normal,
            uv: std::array::from_fn(|k| 0.5 * (a.uv[k] + b.uv[k])),
            ambient_occlusion: match light {
                CornerLight::Chart => 1.0,
                CornerLight::Own { is_wide } => self.of_surface(&position, &normal, is_wide),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn empty() -> Surroundings {
        Surroundings {
            low: Point3::new(-2.0, -2.0, -0.5),
            count: [50, 50, 40],
            filled: vec![false; 50 * 50 * 40],
            directions: half_sphere(),
        }
    }

    #[test]
    fn stored_values_are_used_only_for_the_same_home() {
        let last = LastHome::default();
        let at = (Point3::new(0.3, 0.0, 0.0), Vector3::z());
        let light = |around: &Surroundings| {
            let mut home = last.take(around);
            let mut body = home.of_body(3);
            let before = body.known.points.len();
            let light = body.of_surface(&at.0, &at.1, false);
            home.put_back(3, body.into_known());
            last.keep(home);
            (before, light)
        };
        let mut walled = empty();
        let wall = |y: f64, z: f64| Point3::new(0.5, y, z);
        walled.fill([wall(-1.5, 0.0), wall(1.5, 0.0), wall(1.5, 2.0)]);
        let (first, again) = (light(&empty()), light(&empty()));
        assert_eq!((first.0, again), (0, (1, first.1)));
        let dark = light(&walled);
        assert!(dark.0 == 0 && dark.1 < first.1, "{dark:?} {first:?}");
        assert_eq!(light(&empty()), first);
    }

    #[test]
    fn a_wall_darkens_only_the_floor_beside_it() {
        let mut around = empty();
        let wall = |y: f64, z: f64| Point3::new(0.5, y, z);
        around.fill([wall(-1.5, 0.0), wall(1.5, 0.0), wall(1.5, 2.0)]);
        around.fill([wall(-1.5, 0.0), wall(1.5, 2.0), wall(-1.5, 2.0)]);
        let floor = |x: f64| around.of_surface(&Point3::new(x, 0.0, 0.0), &Vector3::z());
        let (near, middle, far) = (floor(0.3), floor(-0.1), floor(-1.5));
        assert!(
            near < 0.9 && near < middle && middle < far,
            "{near} {middle} {far}"
        );
        assert!(far > 0.99);
        assert!((0.35..1.0).contains(&near));
    }

    #[test]
    fn pieces_of_neighbours_share_their_corners() {
        let mut around = empty();
        let post = |x: f64, z: f64| Point3::new(x, 0.1, z);
        around.fill([post(0.0, 0.0), post(0.2, 0.0), post(0.1, 0.8)]);
        let corner = |x: f64, y: f64| Corner {
            position: Point3::new(x, y, 0.0),
            normal: Vector3::z(),
            uv: [x as f32, y as f32],
            ambient_occlusion: 1.0,
        };
        let [a, b, c, d] = [
            corner(-1.5, -1.5),
            corner(1.5, -1.5),
            corner(1.5, 1.5),
            corner(-1.5, 1.5),
        ];
        let mut ambient_occlusion = LastHome::default().take(&around).of_body(0);
        let light = CornerLight::Own { is_wide: true };
        let mut pieces = ambient_occlusion.cut([a, b, c], light);
        pieces.extend(ambient_occlusion.cut([a, c, d], light));
        assert!(pieces.len() > 20);
        // Every inner edge has two pieces, the rim one.
        let mut edges: std::collections::BTreeMap<[[u64; 2]; 2], i32> = Default::default();
        for piece in &pieces {
            for k in 0..3 {
                let [p, q] = [piece[k], piece[(k + 1) % 3]]
                    .map(|c| [c.position.x.to_bits(), c.position.y.to_bits()]);
                *edges.entry([p, q]).or_default() += 1;
                *edges.entry([q, p]).or_default() -= 1;
            }
        }
        let on_rim =
            |[x, y]: [u64; 2]| f64::from_bits(x).abs() == 1.5 || f64::from_bits(y).abs() == 1.5;
        for ([p, q], open) in edges {
            assert!(
                open == 0 || (on_rim(p) && on_rim(q)),
                "a gap between pieces"
            );
        }
        let area: f64 = pieces
            .iter()
            .map(|[a, b, c]| {
                0.5 * (b.position - a.position)
                    .cross(&(c.position - a.position))
                    .norm()
            })
            .sum();
        assert!((area - 9.0).abs() < 1e-9);
    }

    #[test]
    fn furniture_in_front_of_a_wall_leaves_no_dark_smudges() {
        let mut around = empty();
        // An upright board in front of the wall y = 0, as deep as a curtain.
        let board = |x: f64, z: f64| Point3::new(x, 0.13, z);
        around.fill([board(-0.05, 0.0), board(0.05, 0.0), board(0.05, 2.0)]);
        around.fill([board(-0.05, 0.0), board(0.05, 2.0), board(-0.05, 2.0)]);
        let wall = |x: f64| Point3::new(x, 0.0, 1.0);
        let sharp = |x: f64| around.of_surface(&wall(x), &Vector3::y());
        let wide = |x: f64| around.of_wide_surface(&wall(x), &Vector3::y());
        // The hidden vertex has the light of the visible surface around it.
        assert!(
            sharp(0.0) < 0.4 && wide(0.0) > 0.6,
            "{} {}",
            sharp(0.0),
            wide(0.0)
        );
        // Neighboring vertices differ by less.
        let step = |light: &dyn Fn(f64) -> f64| {
            let at = |i: i32| light(f64::from(i) * 0.2);
            (-4..4)
                .map(|i| (at(i + 1) - at(i)).abs())
                .fold(0.0, f64::max)
        };
        assert!(
            step(&wide) < 0.5 * step(&sharp),
            "{} {}",
            step(&wide),
            step(&sharp)
        );
        assert!((wide(1.6) - sharp(1.6)).abs() < 0.02);
    }
}
