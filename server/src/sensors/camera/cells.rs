//! Batches in pieces that lie together: of a wall or a row of cupboards only what is in
//! view is drawn.

use std::ops::Range;

use nalgebra::{Point3, Vector3};

/// Triangles that lie together, and the box around them in the frame of their body.
#[derive(Clone, Debug)]
pub(super) struct Cell {
    pub(super) indices: Range<u32>,
    /// Middle of the box.
    pub(super) centre: Point3<f64>,
    /// Half its sides.
    pub(super) half: Vector3<f64>,
}

/// A box of which no side is longer is not divided, metres.
const SIDE: f64 = 1.5;
/// Nor are so few triangles.
const FEW: usize = 48;
/// Adapters place a vertex in single precision: what touches the edge of a picture by
/// less than this may be seen, metres.
const SLACK: f64 = 1e-3;

type Triangle = [u32; 3];

/// Orders the triangles `range` of `indices` by where they lie and cuts them into cells,
/// one behind the other. `position` tells where a vertex is. What changes its shape, by up
/// to `reach` metres, is one cell.
pub(super) fn cells(
    indices: &mut [u32],
    range: Range<usize>,
    position: &dyn Fn(u32) -> Point3<f64>,
    reach: f64,
) -> Vec<Cell> {
    let first = range.start as u32;
    let (triangles, _) = indices[range].as_chunks_mut::<3>();
    let mut found = Vec::new();
    if !triangles.is_empty() {
        divide(triangles, first, position, reach, &mut found);
    }
    found
}

fn divide(
    triangles: &mut [Triangle],
    first: u32,
    position: &dyn Fn(u32) -> Point3<f64>,
    reach: f64,
    found: &mut Vec<Cell>,
) {
    let (low, high) = bounds(triangles.iter().flatten().map(|i| position(*i)));
    let sides = high - low;
    let middle = |triangle: &Triangle, axis: usize| {
        let [a, b, c] = triangle.map(|i| position(i)[axis]);
        a + b + c
    };
    if reach == 0.0 && triangles.len() > FEW && sides.max() > SIDE {
        let axis = sides.imax();
        let mut order: Vec<usize> = (0..triangles.len()).collect();
        order.sort_by(|a, b| {
            let [a, b] = [*a, *b].map(|i| middle(&triangles[i], axis));
            a.total_cmp(&b)
        });
        // Half of them on either side, there as they followed one another: neighbours
        // share vertices.
        let half = order.len() / 2;
        order[..half].sort_unstable();
        order[half..].sort_unstable();
        let ordered: Vec<Triangle> = order.into_iter().map(|i| triangles[i]).collect();
        triangles.copy_from_slice(&ordered);
        let (before, behind) = triangles.split_at_mut(half);
        divide(before, first, position, reach, found);
        divide(behind, first + 3 * half as u32, position, reach, found);
        return;
    }
    found.push(Cell {
        indices: first..first + 3 * triangles.len() as u32,
        centre: nalgebra::center(&low, &high),
        half: (sides / 2.0).add_scalar(reach + SLACK),
    });
}

/// The box around points.
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

    use super::super::ambient_occlusion::Surroundings;
    use super::super::buffers::Buffers;
    use super::super::tier::Tier;
    use super::super::view::View;
    use super::super::{Binding, CameraSpec, Graphics, Quality, RenderScene};
    use super::*;
    use crate::robot::RobotModel;
    use crate::scene::Scene;

    #[test]
    fn cells_hold_all_triangles_in_boxes_around_them() {
        // A band of squares, 0.1 m each.
        let squares = 400;
        let corner = |i: u32| Point3::new(0.1 * f64::from(i / 2), 0.1 * f64::from(i % 2), 0.5);
        let mut indices = vec![7; 6];
        let band = (0..squares).flat_map(|s| [[0, 1, 2], [2, 1, 3]].map(|t| t.map(|i| 2 * s + i)));
        let band: Vec<Triangle> = band.collect();
        indices.extend(band.iter().flatten());
        let range = 6..indices.len();
        let found = cells(&mut indices, range.clone(), &corner, 0.0);
        assert!(found.len() > 16, "{}", found.len());
        let mut next = 6;
        for cell in &found {
            assert_eq!(cell.indices.start, next);
            next = cell.indices.end;
            let own = &indices[cell.indices.start as usize..next as usize];
            assert!(own.len() / 3 <= FEW || 2.0 * cell.half.max() <= SIDE + 2.1 * SLACK);
            for i in own {
                let from = (corner(*i) - cell.centre).abs();
                assert!(from <= cell.half, "{from} {}", cell.half);
            }
        }
        assert_eq!(next as usize, indices.len());
        assert_eq!(indices[..6], [7; 6]);
        let mut kept: Vec<Triangle> = indices[6..].as_chunks::<3>().0.to_vec();
        kept.sort_unstable();
        let mut all = band;
        all.sort_unstable();
        assert_eq!(kept, all);
        // What changes its shape stays whole.
        let whole = cells(&mut indices, range, &corner, 0.2);
        assert_eq!(whole.len(), 1);
        assert!((whole[0].half.y - 0.25 - SLACK).abs() < 1e-12);
    }

    /// Everything that is drawn of a scene.
    fn buffers(scene: &RenderScene) -> Buffers {
        let surroundings = Surroundings::new(scene);
        let graphics = Graphics::default();
        let mut light = graphics.last_home().of(&surroundings);
        Buffers::new(scene, &mut light, Tier::of(Quality::Standard, scene))
    }

    /// Cells of a batch that are out of view while a vertex of theirs is in the picture,
    /// and how many are in view of all.
    fn wrongly_left_out(buffers: &Buffers, view: &View) -> (usize, [usize; 2]) {
        let (mut wrong, mut shown, mut all) = (0, 0, 0);
        let placed = view.placed(&Isometry3::identity());
        for cell in buffers
            .batches
            .iter()
            .flat_map(|b| b.full.iter().chain(&b.coarse))
        {
            all += 1;
            if view.shows(&placed, cell) {
                shown += 1;
                continue;
            }
            let own = cell.indices.start as usize..cell.indices.end as usize;
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
    fn what_is_in_the_picture_is_drawn() {
        let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets");
        let robot = RobotModel::load(&assets, "wheelarm").unwrap();
        let home = Scene::load(&assets, "home").unwrap();
        let mut spec = CameraSpec::room(&home, [640, 360]);
        let mut fixed = RenderScene::new(&robot, &home, &assets).unwrap();
        fixed.items.retain(|item| item.binding == Binding::World);
        let buffers = buffers(&fixed);
        let (mut shown, mut all) = (0, 0);
        for i in 0..60 {
            // All over the home, in all directions.
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
