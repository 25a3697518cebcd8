//! Ambient light of wide static planes in one texture with a texel per 8 cm, which pixels
//! sample bilinearly. Values at vertices, 0.4 m apart, leave wing-shaped smudges on walls.
//! Each plane of a body is a chart; all charts of a home share an atlas.
//!
//! A sample costs a CPU adapter a third of the time of a pixel. Triangles on which the
//! light is nearly linear therefore interpolate it between their corners.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};

use super::surroundings::{Surroundings, across};

/// Side of a texel, metres: the rays hit cells of this size.
const TEXEL: f64 = 0.08;
/// Smallest side of a plane with a chart, metres. Smaller ones keep light per vertex.
const LEAST_SIDE: f64 = 0.3;
/// Maximum number of texels along a side: coordinates have eight integer bits.
const MOST_TEXELS: i32 = 250;
/// Width of the atlas, texels.
const WIDTH: usize = 1024;
/// Maximum number of rows of the atlas. A home of 80 m² needs about 300.
const MOST_ROWS: usize = 8192;
/// Largest deviation of the light from linear interpolation, of 255, with which a triangle
/// does without the map, along its edges: 10 would show the shapes of triangles on walls.
const FLAT_EDGE: f64 = 4.0;
/// The same inside a triangle.
const FLAT_INSIDE: f64 = 10.0;
/// Shares of the first end at the points of an edge where the deviation is computed.
const ON_EDGE: [f64; 3] = [0.25, 0.5, 0.75];
/// Barycentric coordinates of the points inside a triangle.
const INSIDE: [[f64; 3]; 4] = [
    [0.33, 0.33, 0.34],
    [0.66, 0.17, 0.17],
    [0.17, 0.66, 0.17],
    [0.17, 0.17, 0.66],
];
/// Binomial weights of the smoothing along each axis.
const BLUR: [f32; 5] = [1.0, 4.0, 6.0, 4.0, 1.0];

/// A plane: its normal in steps of 1/200 and its distance from the origin in steps of 2 mm.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Plane([i32; 4]);

/// Corner of a triangle: position and normal, in the world frame.
pub(super) type FlatCorner = (Point3<f64>, Vector3<f64>);

/// The plane of a triangle; `None` if a corner has another normal than the plane.
pub(super) fn plane([a, b, c]: [FlatCorner; 3]) -> Option<Plane> {
    let normal = (b.0 - a.0).cross(&(c.0 - a.0)).try_normalize(1e-12)?;
    if [a, b, c]
        .iter()
        .any(|corner| corner.1.dot(&normal) < 0.9995)
    {
        return None;
    }
    // The offset keeps axes and whole centimetres away from rounding boundaries.
    let step = |x: f64| (x + 0.37).round() as i32;
    let [x, y, z] = [normal.x, normal.y, normal.z].map(|x| step(200.0 * x));
    Some(Plane([x, y, z, step(500.0 * normal.dot(&a.0.coords))]))
}

/// Triangles of one plane, in coordinates of the plane.
struct Outline {
    normal: Vector3<f64>,
    right: Vector3<f64>,
    ahead: Vector3<f64>,
    height: f64,
    triangles: Vec<[[f64; 2]; 3]>,
}

impl Outline {
    fn new([a, b, c]: [FlatCorner; 3]) -> Self {
        let normal = (b.0 - a.0).cross(&(c.0 - a.0)).normalize();
        let (right, ahead) = across(&normal);
        Self {
            normal,
            right,
            ahead,
            height: normal.dot(&a.0.coords),
            triangles: Vec::new(),
        }
    }

    fn project(&self, p: &Point3<f64>) -> [f64; 2] {
        [self.right.dot(&p.coords), self.ahead.dot(&p.coords)]
    }
}

/// The light of one plane of a body.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Chart {
    right: Vector3<f64>,
    ahead: Vector3<f64>,
    normal: Vector3<f64>,
    /// Distance of the plane from the origin of the world along its normal, metres.
    height: f64,
    /// First texel, relative to the origin of the world.
    low: [i32; 2],
    size: [usize; 2],
    /// Corners of the rectangle around the triangles.
    bounds: Bounds,
    /// Whether a triangle covers each texel. Empty in a chart from the cache on disk.
    #[serde(skip)]
    covered: Arc<[bool]>,
    /// Light, row by row.
    #[serde(with = "shared_bytes")]
    values: Arc<[u8]>,
}

/// Shared bytes in an entry of the cache.
mod shared_bytes {
    use std::sync::Arc;

    use serde::{Deserialize, Deserializer, Serializer};

    pub fn serialize<S: Serializer>(bytes: &Arc<[u8]>, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_bytes(bytes)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Arc<[u8]>, D::Error> {
        <&[u8]>::deserialize(from).map(Arc::from)
    }
}

impl Chart {
    /// Texel coordinates of a point, in steps of 1/256.
    pub(super) fn local(&self, p: &Point3<f64>) -> [u16; 2] {
        let along = |axis: &Vector3<f64>, low: i32| {
            let at = axis.dot(&p.coords) / TEXEL - f64::from(low);
            (at * 256.0).round().clamp(0.0, 65535.0) as u16
        };
        [
            along(&self.right, self.low[0]),
            along(&self.ahead, self.low[1]),
        ]
    }

    /// Light at texel coordinates in steps of 1/256, from 0 to 255, filtered as by an
    /// adapter.
    pub(super) fn light_at(&self, local: [f64; 2]) -> f64 {
        let [x, y] = local.map(|x| (x / 256.0 - 0.5).max(0.0));
        let (left, top) = (x.floor(), y.floor());
        let texel = |right: usize, below: usize| {
            let column = (left as usize + right).min(self.size[0] - 1);
            let row = (top as usize + below).min(self.size[1] - 1);
            f64::from(self.values[row * self.size[0] + column])
        };
        let across = |below| texel(0, below) + (x - left) * (texel(1, below) - texel(0, below));
        across(0) + (y - top) * (across(1) - across(0))
    }

    /// Whether the light on a triangle deviates from linear interpolation between its
    /// corners, which are texel coordinates in steps of 1/256.
    pub(super) fn needs_map(&self, corners: [[u16; 2]; 3]) -> bool {
        let corners = corners.map(|corner| corner.map(f64::from));
        let lights = corners.map(|corner| self.light_at(corner));
        let deviates = |shares: [f64; 3], most: f64| {
            let mean = |values: [f64; 3]| -> f64 { (0..3).map(|k| values[k] * shares[k]).sum() };
            let at = std::array::from_fn(|axis| mean(corners.map(|corner| corner[axis])));
            (self.light_at(at) - mean(lights)).abs() > most
        };
        let edge = |k: usize, share: f64| {
            let mut shares = [0.0; 3];
            (shares[k], shares[(k + 1) % 3]) = (share, 1.0 - share);
            shares
        };
        let mut edges = (0..3).flat_map(|k| ON_EDGE.map(|share| edge(k, share)));
        edges.any(|shares| deviates(shares, FLAT_EDGE))
            || INSIDE.iter().any(|shares| deviates(*shares, FLAT_INSIDE))
    }

    /// Whether the light of both is the same in the same surroundings.
    fn has_outline_of(&self, other: &Self) -> bool {
        let own = |chart: &Self| {
            let axes = [chart.right, chart.ahead, chart.normal];
            (axes, chart.height, chart.low, chart.size, chart.bounds)
        };
        own(self) == own(other) && self.covered == other.covered
    }

    /// Whether it has a value for every texel.
    pub(super) fn is_complete(&self) -> bool {
        let is_possible = |n: &usize| (1..=MOST_TEXELS as usize).contains(n);
        self.size.iter().all(is_possible) && self.size[0] * self.size[1] == self.values.len()
    }
}

/// Collects the planes of a body and computes their charts.
#[derive(Default)]
pub(super) struct Planes(BTreeMap<Plane, Outline>);

impl Planes {
    /// Adds a triangle if it is flat.
    pub(super) fn add(&mut self, triangle: [FlatCorner; 3]) {
        let Some(plane) = plane(triangle) else {
            return;
        };
        let outline = self
            .0
            .entry(plane)
            .or_insert_with(|| Outline::new(triangle));
        let flat = triangle.map(|(p, _)| outline.project(&p));
        outline.triangles.push(flat);
    }

    /// The charts of the wide planes. Charts in `known` are reused.
    pub(super) fn charts(
        self,
        around: &Surroundings,
        known: &BTreeMap<Plane, Chart>,
    ) -> BTreeMap<Plane, Chart> {
        let chart = |(plane, outline): (Plane, Outline)| {
            let mut chart = outline.chart()?;
            chart.values = match known.get(&plane).filter(|old| old.has_outline_of(&chart)) {
                Some(old) => Arc::clone(&old.values),
                None => outline.compute_light(&chart, around),
            };
            Some((plane, chart))
        };
        self.0.into_iter().filter_map(chart).collect()
    }
}

/// Least and greatest coordinates.
type Bounds = [[f64; 2]; 2];

impl Outline {
    /// A chart without values.
    fn chart(&self) -> Option<Chart> {
        let (mut least, mut most) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for point in self.triangles.iter().flatten() {
            for k in 0..2 {
                least[k] = least[k].min(point[k]);
                most[k] = most[k].max(point[k]);
            }
        }
        if (0..2).all(|k| most[k] - least[k] < LEAST_SIDE) {
            return None;
        }
        // One extra texel on every side, for bilinear sampling.
        let low: [f64; 2] = std::array::from_fn(|k| (least[k] / TEXEL).floor() - 1.0);
        let count: [f64; 2] = std::array::from_fn(|k| (most[k] / TEXEL).floor() + 2.0 - low[k]);
        if count
            .iter()
            .any(|n| n.is_nan() || *n > f64::from(MOST_TEXELS))
        {
            return None;
        }
        let (low, size) = (low.map(|x| x as i32), count.map(|n| n as usize));
        let mut covered = vec![false; size[0] * size[1]];
        for triangle in &self.triangles {
            cover(triangle, low, size, &mut covered);
        }
        Some(Chart {
            right: self.right,
            ahead: self.ahead,
            normal: self.normal,
            height: self.height,
            low,
            size,
            bounds: [least, most],
            covered: covered.into(),
            values: Arc::default(),
        })
    }

    /// Values of a chart: weighted means of the covered texels around each texel. Texels
    /// inside a body in front of the surface do not count.
    fn compute_light(&self, chart: &Chart, around: &Surroundings) -> Arc<[u8]> {
        let [width, height] = chart.size;
        let [least, most] = chart.bounds;
        let place = |i: usize| {
            let at = [i % width, i / width];
            let [x, y] = std::array::from_fn(|k| {
                let centre = (f64::from(chart.low[k]) + at[k] as f64 + 0.5) * TEXEL;
                centre.clamp(least[k], most[k])
            });
            Point3::from(self.right * x + self.ahead * y + self.normal * self.height)
        };
        let rays = around.hemisphere(&self.normal);
        let light = |i: usize| around.of_surface_along(&place(i), &self.normal, &rays) as f32;
        let mut sums = vec![[0.0f32; 2]; width * height];
        for (i, sum) in sums.iter_mut().enumerate() {
            if chart.covered[i] && around.is_free_before(&place(i), &self.normal) {
                *sum = [light(i), 1.0];
            }
        }
        for step in [1, width] {
            sums = blurred(&sums, step, width, height);
        }
        let value = |(i, [sum, weight]): (usize, [f32; 2])| {
            let light = match weight > 0.0 {
                true => sum / weight,
                false if chart.covered[i] => light(i),
                false => 1.0,
            };
            (light.clamp(0.0, 1.0) * 255.0).round() as u8
        };
        sums.into_iter().enumerate().map(value).collect()
    }
}

/// Weighted sums along one axis; `step` is the distance between neighbours in `sums`.
fn blurred(sums: &[[f32; 2]], step: usize, width: usize, height: usize) -> Vec<[f32; 2]> {
    let reach = BLUR.len() / 2;
    let one = |i: usize| {
        let (at, count) = match step {
            1 => (i % width, width),
            _ => (i / width, height),
        };
        let mut all = [0.0; 2];
        for (k, weight) in BLUR.iter().enumerate() {
            let from = (at + k).wrapping_sub(reach);
            if from < count {
                let [sum, own] = sums[i - at * step + from * step];
                all[0] += weight * sum;
                all[1] += weight * own;
            }
        }
        all
    };
    (0..sums.len()).map(one).collect()
}

/// Marks the texels that a triangle covers, including those at its edges.
fn cover(triangle: &[[f64; 2]; 3], low: [i32; 2], size: [usize; 2], covered: &mut [bool]) {
    let at = |p: &[f64; 2]| -> [f64; 2] {
        std::array::from_fn(|k| p[k] / TEXEL - f64::from(low[k]) - 0.5)
    };
    let [a, b, c] = triangle.each_ref().map(at);
    let cross = |a: [f64; 2], b: [f64; 2], p: [f64; 2]| {
        let (x, y) = (b[0] - a[0], b[1] - a[1]);
        let length = (x * x + y * y).sqrt().max(1e-9);
        (x * (p[1] - a[1]) - y * (p[0] - a[0])) / length
    };
    let side = cross(a, b, c).signum();
    let range = |k: usize| {
        let least = a[k].min(b[k]).min(c[k]) - 0.5;
        let most = a[k].max(b[k]).max(c[k]) + 0.5;
        least.ceil().max(0.0) as usize..=(most.floor().max(0.0) as usize).min(size[k] - 1)
    };
    for y in range(1) {
        for x in range(0) {
            let p = [x as f64, y as f64];
            let inside = [[a, b], [b, c], [c, a]]
                .iter()
                .all(|[from, to]| side * cross(*from, *to, p) >= -0.5);
            covered[y * size[0] + x] |= inside;
        }
    }
}

/// All charts of a home in one texture of bytes.
pub(super) struct AmbientMap {
    pub(super) size: [usize; 2],
    pub(super) texels: Vec<u8>,
    pub(super) charts: PlacedCharts,
}

/// All charts in the world and in the atlas.
pub(super) struct PlacedCharts {
    /// Width and height of the atlas, metres.
    pub(super) extent: [f64; 2],
    /// `None` if the atlas has no room for a chart.
    pub(super) placed: Vec<Option<PlacedChart>>,
}

/// A chart in the world and in the atlas.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlacedChart {
    /// Directions of the columns and rows of the atlas.
    pub(super) axes: [Vector3<f64>; 2],
    pub(super) normal: Vector3<f64>,
    /// Distance of the plane from the origin of the world along its normal, metres.
    pub(super) height: f64,
    /// Atlas coordinates of the origin of the world, metres.
    pub(super) origin: [f64; 2],
}

/// A point of a chart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct ChartPoint {
    /// Index of the chart.
    pub(super) chart: u32,
    /// Texel coordinates in steps of 1/256.
    pub(super) local: [u16; 2],
}

impl AmbientMap {
    /// A map without charts.
    pub(super) fn empty() -> Self {
        Self {
            size: [1, 1],
            texels: vec![255],
            charts: PlacedCharts {
                extent: [TEXEL; 2],
                placed: Vec::new(),
            },
        }
    }

    /// Packs charts in rows, the tallest first.
    pub(super) fn new(charts: &[&Chart]) -> Self {
        let mut order: Vec<usize> = (0..charts.len()).collect();
        order.sort_by_key(|&i| (std::cmp::Reverse(charts[i].size[1]), i));
        let mut places = vec![None; charts.len()];
        let (mut x, mut y, mut rows) = (0, 0, 0);
        for i in order {
            let [width, height] = charts[i].size;
            if x + width > WIDTH {
                (x, y, rows) = (0, y + rows, 0);
            }
            if width > WIDTH || y + height > MOST_ROWS {
                continue;
            }
            places[i] = Some([x, y]);
            x += width;
            rows = rows.max(height);
        }
        let size = [WIDTH, (y + rows).max(1)];
        let mut texels = vec![255; size[0] * size[1]];
        for (chart, place) in charts.iter().zip(&places) {
            let Some([x, y]) = place else {
                continue;
            };
            for (row, values) in chart.values.chunks(chart.size[0]).enumerate() {
                let at = (y + row) * WIDTH + x;
                texels[at..at + values.len()].copy_from_slice(values);
            }
        }
        let placed = |(chart, place): (&&Chart, Option<[usize; 2]>)| {
            let place = place?;
            let origin = |k: usize| (place[k] as f64 - f64::from(chart.low[k])) * TEXEL;
            Some(PlacedChart {
                axes: [chart.right, chart.ahead],
                normal: chart.normal,
                height: chart.height,
                origin: std::array::from_fn(origin),
            })
        };
        Self {
            size,
            texels,
            charts: PlacedCharts {
                extent: size.map(|count| count as f64 * TEXEL),
                placed: charts.iter().zip(places).map(placed).collect(),
            },
        }
    }

    /// Texture coordinates of a point of a chart, which is in steps of 1/256 texel, in units
    /// of 1/65535; `None` if the atlas has no room for the chart.
    pub(super) fn coordinates(
        &self,
        index: usize,
        chart: &Chart,
        local: [u16; 2],
    ) -> Option<[u16; 2]> {
        let placed = self.charts.placed.get(index)?.as_ref()?;
        Some(std::array::from_fn(|k| {
            let texel = f64::from(chart.low[k]) + f64::from(local[k]) / 256.0;
            let share = (texel * TEXEL + placed.origin[k]) / self.charts.extent[k];
            (share * 65535.0).round() as u16
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chart_has_a_value_for_every_texel_of_a_possible_size() {
        let is_complete = |size: [usize; 2], values: usize| {
            Chart {
                right: Vector3::x(),
                ahead: Vector3::y(),
                normal: Vector3::z(),
                height: 0.0,
                low: [0; 2],
                size,
                bounds: [[0.0; 2]; 2],
                covered: Arc::default(),
                values: vec![255; values].into(),
            }
            .is_complete()
        };
        assert!(is_complete([2, 3], 6));
        for (size, values) in [([2, 3], 5), ([0, 3], 0), ([3, 0], 0), ([251, 1], 251)] {
            assert!(!is_complete(size, values), "{size:?}");
        }
    }
}
