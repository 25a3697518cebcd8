//! Clusters of neighbouring triangles: of a wall or a row of cupboards only the part in
//! view is rendered, in spatial order, which is faster on a GPU.

use std::ops::Range;

use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};

/// A cluster of triangles, in the frame of their body.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Cluster {
    pub(super) indices: Range<u32>,
    /// Centre of the bounding box.
    pub(super) centre: Point3<f64>,
    /// Half extents of the bounding box.
    pub(super) half: Vector3<f64>,
    /// Radius of the bounding sphere.
    pub(super) radius: f64,
    /// Whether pixels sample the ambient map.
    pub(super) mapped: bool,
    /// Those of its triangles that are on charts of the ambient map, in order.
    pub(super) pieces: Vec<Piece>,
    /// Its number among the clusters that objects may darken.
    #[serde(skip)]
    pub(super) number: Option<usize>,
}

/// Neighbouring triangles on one chart of the ambient map.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Piece {
    pub(super) indices: Range<u32>,
    /// Index of the chart.
    pub(super) chart: usize,
    pub(super) outline: Outline,
}

/// Extent of a piece, in the frame of its body.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) enum Outline {
    /// A single triangle.
    Triangle([Point3<f64>; 3]),
    /// Centre and half extents of the bounding box.
    Bounds(Point3<f64>, Vector3<f64>),
}

impl Outline {
    /// Distance of a point to the bounding box.
    pub(super) fn distance_of_box(&self, p: &Point3<f64>) -> f64 {
        let (centre, half) = match self {
            Self::Triangle([a, b, c]) => {
                let (low, high) = (a.inf(b).inf(c), a.sup(b).sup(c));
                (nalgebra::center(&low, &high), (high - low) / 2.0)
            }
            Self::Bounds(centre, half) => (*centre, *half),
        };
        ((p - centre).abs() - half).map(|x| x.max(0.0)).norm()
    }
}

/// Constraints on the triangles of a batch.
#[derive(Clone, Copy, Debug)]
pub(super) struct Division {
    /// Triangles may be reordered and skipped. Those of glass may not, because it is
    /// blended with the background.
    pub(super) free: bool,
    /// How far vertices move in the frame of the body, metres. Batches with moving
    /// vertices are not divided.
    pub(super) reach: f64,
}

/// Largest side of a box that is not divided, metres.
const SIDE: f64 = 1.5;
/// Largest number of triangles that are not divided.
const FEW: usize = 48;
/// Largest side of the bounding box of a piece of several triangles, metres.
const PIECE_SIDE: f64 = 0.4;
/// Adapters compute vertices in single precision: triangles within this distance of the
/// image border may be visible, metres.
const SLACK: f64 = 1e-3;
/// Steps along each axis for ordering triangles.
const STEPS: f64 = 1023.0;

/// Indices of the corners.
pub(super) type Triangle = [u32; 3];

/// Sorts the triangles `range` of `indices` along a Morton curve and divides them into
/// consecutive clusters. `position` returns the position of a vertex.
pub(super) fn clusters(
    indices: &mut [u32],
    range: Range<usize>,
    position: &dyn Fn(u32) -> Point3<f64>,
    division: Division,
) -> Vec<Cluster> {
    let first = range.start as u32;
    let (triangles, _) = indices[range].as_chunks_mut::<3>();
    let mut found = Vec::new();
    if triangles.is_empty() {
        return found;
    }
    if division.free {
        let (low, high) = bounds(triangles.iter().flatten().map(|i| position(*i)));
        let scale = STEPS / (high - low).max().max(1e-9);
        triangles.sort_by_cached_key(|triangle| {
            let [a, b, c] = triangle.map(|i| (position(i) - low) * scale);
            let at = (a + b + c) / 3.0;
            (0..3).fold(0, |key, axis| key | spread(at[axis] as u64) << axis)
        });
    }
    halve(triangles, first, position, division, &mut found);
    found
}

/// Spreads the lowest ten bits, three apart.
fn spread(number: u64) -> u64 {
    (0..10).fold(0, |all, bit| all | (number >> bit & 1) << (3 * bit))
}

fn halve(
    triangles: &[Triangle],
    first: u32,
    position: &dyn Fn(u32) -> Point3<f64>,
    division: Division,
    found: &mut Vec<Cluster>,
) {
    let points = || triangles.iter().flatten().map(|i| position(*i));
    let (low, high) = bounds(points());
    let sides = high - low;
    let divided = division.free && division.reach == 0.0;
    if divided && triangles.len() > FEW && sides.max() > SIDE {
        let (before, behind) = triangles.split_at(triangles.len() / 2);
        halve(before, first, position, division, found);
        let first = first + 3 * before.len() as u32;
        halve(behind, first, position, division, found);
        return;
    }
    let centre = nalgebra::center(&low, &high);
    let radius = points().map(|p| (p - centre).norm()).fold(0.0, f64::max);
    found.push(Cluster {
        indices: first..first + 3 * triangles.len() as u32,
        centre,
        half: (sides / 2.0).add_scalar(division.reach + SLACK),
        radius: radius + division.reach,
        mapped: false,
        pieces: Vec::new(),
        number: None,
    });
}

/// Halves triangles of one chart, in their order, until the boxes are small.
pub(super) fn pieces(
    triangles: &[Triangle],
    first: u32,
    position: &dyn Fn(u32) -> Point3<f64>,
    chart: usize,
    found: &mut Vec<Piece>,
) {
    let outline = match triangles {
        [triangle] => Outline::Triangle(triangle.map(position)),
        _ => {
            let (low, high) = bounds(triangles.iter().flatten().map(|i| position(*i)));
            if (high - low).max() > PIECE_SIDE {
                let (before, behind) = triangles.split_at(triangles.len() / 2);
                pieces(before, first, position, chart, found);
                let first = first + 3 * before.len() as u32;
                pieces(behind, first, position, chart, found);
                return;
            }
            Outline::Bounds(nalgebra::center(&low, &high), (high - low) / 2.0)
        }
    };
    found.push(Piece {
        indices: first..first + 3 * triangles.len() as u32,
        chart,
        outline,
    });
}

/// The bounding box of points.
pub(super) fn bounds(points: impl Iterator<Item = Point3<f64>>) -> (Point3<f64>, Point3<f64>) {
    let none = [f64::INFINITY; 3].into();
    points.fold(
        (none, -none),
        |(low, high): (Point3<f64>, Point3<f64>), p| (low.inf(&p), high.sup(&p)),
    )
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use nalgebra::{Isometry3, UnitQuaternion};

    use super::super::buffers::Buffers;
    use super::super::part_cache::Home;
    use super::super::tier::Tier;
    use super::super::view::View;
    use super::super::{Binding, CameraSpec, Graphics, Quality, RenderScene};
    use super::*;
    use crate::robot::RobotModel;
    use crate::scene::Scene;

    #[test]
    fn clusters_contain_all_triangles_within_their_boxes() {
        // A band of squares, 1 cm each.
        let squares = 400;
        let corner = |i: u32| Point3::new(0.01 * f64::from(i / 2), 0.01 * f64::from(i % 2), 0.5);
        let [free, moves, glass] =
            [(true, 0.0), (true, 0.2), (false, 0.0)].map(|(free, reach)| Division { free, reach });
        let mut indices = vec![7; 6];
        let band = (0..squares).flat_map(|s| [[0, 1, 2], [2, 1, 3]].map(|t| t.map(|i| 2 * s + i)));
        let band: Vec<Triangle> = band.collect();
        let band: Vec<Triangle> = (0..band.len())
            .map(|i| band[i * 301 % band.len()])
            .collect();
        indices.extend(band.iter().flatten());
        let range = 6..indices.len();
        let found = clusters(&mut indices, range.clone(), &corner, free);
        assert_eq!(found.len(), 4);
        let mut next = 6;
        for cluster in &found {
            assert_eq!(cluster.indices.start, next);
            next = cluster.indices.end;
            let own = &indices[cluster.indices.start as usize..next as usize];
            assert!(own.len() / 3 > FEW && 2.0 * cluster.half.max() <= SIDE + 2.1 * SLACK);
            for i in own {
                let from = (corner(*i) - cluster.centre).abs();
                assert!(
                    from <= cluster.half && from.norm() <= cluster.radius + 1e-12,
                    "{from}"
                );
            }
        }
        assert_eq!(next as usize, indices.len());
        assert_eq!(indices[..6], [7; 6]);
        let mut kept: Vec<Triangle> = indices[6..].as_chunks::<3>().0.to_vec();
        kept.sort_unstable();
        let mut all = band;
        all.sort_unstable();
        assert_eq!(kept, all);
        // Deforming batches and glass stay whole, and glass keeps its order.
        let whole = clusters(&mut indices, range.clone(), &corner, moves);
        assert_eq!(whole.len(), 1);
        assert!((whole[0].half.y - 0.205 - SLACK).abs() < 1e-12);
        assert!((whole[0].radius - whole[0].half.x).abs() < 0.01);
        indices[6..].reverse();
        let before = indices.clone();
        assert_eq!(clusters(&mut indices, range, &corner, glass).len(), 1);
        assert_eq!(indices, before);
    }

    /// All rendered geometry of a scene.
    fn buffers(scene: &RenderScene, quality: Quality) -> Buffers {
        let (home, graphics) = (Home::new(scene), Graphics::default());
        let surroundings = graphics.parts().surroundings(&home, scene);
        let mut light = graphics.last_home().take(&surroundings);
        let tier = Tier::for_scene(quality, scene);
        Buffers::new(scene, (&home, &mut light), tier, graphics.parts())
    }

    #[test]
    fn pieces_contain_the_triangles_on_charts() {
        let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets");
        let robot = RobotModel::load(&assets, "wheelarm").unwrap();
        let home = Scene::load(&assets, "home").unwrap();
        let scene = RenderScene::new(&robot, &home, &assets).unwrap();
        let buffers = buffers(&scene, Quality::Standard);
        let clusters = buffers.batches.iter().flat_map(|b| &b.full);
        let (mut mapped, mut all) = (0, 0);
        for cluster in clusters {
            let mut next = cluster.indices.start;
            for piece in &cluster.pieces {
                assert!(piece.indices.start >= next && !piece.indices.is_empty());
                assert!(!cluster.mapped || piece.indices.start == next);
                next = piece.indices.end;
                let chart = buffers.ambient_map.charts.placed[piece.chart].unwrap();
                for i in piece.indices.clone() {
                    let vertex = buffers.indices[i as usize] as usize;
                    let p = Point3::from(buffers.vertices[vertex].position.map(f64::from));
                    let height = chart.normal.dot(&p.coords) - chart.height;
                    assert!(height.abs() < 0.02, "{height}");
                    let outside = match &piece.outline {
                        Outline::Triangle(corners) => {
                            let away = corners.map(|corner| (p - corner).norm());
                            away.into_iter().fold(f64::INFINITY, f64::min)
                        }
                        Outline::Bounds(centre, half) => ((p - centre).abs() - half).max(),
                    };
                    assert!(outside < 1e-9, "{outside}");
                }
                all += piece.indices.len();
            }
            assert!(next <= cluster.indices.end);
            if cluster.mapped {
                assert_eq!(next, cluster.indices.end);
                mapped += cluster.indices.len();
            }
        }
        // Few triangles need the map.
        assert!(mapped > 0 && 3 * mapped < all, "{mapped} of {all}");
        let buffers = self::buffers(&scene, Quality::Draft);
        assert!(buffers.ambient_map.charts.placed.is_empty() && buffers.occluders.is_empty());
        let mut clusters = buffers
            .batches
            .iter()
            .flat_map(|b| b.full.iter().chain(&b.coarse));
        assert!(clusters.all(|cluster| cluster.pieces.is_empty() && !cluster.mapped));
    }

    /// Number of clusters of a batch that are culled although one of their vertices is
    /// in the image, and the visible ones among all.
    fn wrongly_left_out(buffers: &Buffers, view: &View) -> (usize, [usize; 2]) {
        let (mut wrong, mut shown, mut all) = (0, 0, 0);
        let placed = view.placed(&Isometry3::identity());
        for cluster in buffers
            .batches
            .iter()
            .flat_map(|b| b.full.iter().chain(&b.coarse))
        {
            all += 1;
            if view.shows(&placed, cluster) {
                shown += 1;
                continue;
            }
            let own = cluster.indices.start as usize..cluster.indices.end as usize;
            wrong += buffers.indices[own]
                .iter()
                .map(|i| buffers.vertices[*i as usize].position.map(f64::from))
                .filter(|p| {
                    let clip = view.clip_from_world * Point3::from(*p).to_homogeneous();
                    // Depth is near / z.
                    clip.w > 0.0
                        && clip.z <= clip.w
                        && clip.x.abs() <= clip.w
                        && clip.y.abs() <= clip.w
                })
                .count();
        }
        (wrong, [shown, all])
    }

    #[test]
    fn no_visible_cluster_is_culled() {
        let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets");
        let robot = RobotModel::load(&assets, "wheelarm").unwrap();
        let home = Scene::load(&assets, "home").unwrap();
        let mut spec = CameraSpec::room(&home, [640, 360]);
        let mut fixed = RenderScene::new(&robot, &home, &assets).unwrap();
        fixed.items.retain(|item| item.binding == Binding::World);
        let buffers = buffers(&fixed, Quality::Standard);
        let (mut shown, mut all) = (0, 0);
        for i in 0..60 {
            // Viewpoints all over the home, in all directions.
            let t = f64::from(i);
            spec.mount = Isometry3::from_parts(
                Point3::new(
                    -10.5 + 7.0 * (0.37 * t).fract(),
                    6.0 * (0.71 * t).fract(),
                    1.2,
                )
                .into(),
                UnitQuaternion::from_euler_angles(2.1 * t, 0.3 * t, 1.3 * t),
            );
            let view = View::new(&spec, &Isometry3::identity());
            let (wrong, [in_view, of]) = wrongly_left_out(&buffers, &view);
            assert_eq!(wrong, 0, "view {i}");
            shown += in_view;
            all += of;
        }
        // Most of a home is beside or behind a camera.
        assert!(4 * shown < all, "{shown} of {all}");
    }
}
