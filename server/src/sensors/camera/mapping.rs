//! Texture mapping of shapes: converts metres to repetitions.

use crate::geometry::texture::{has_grain, is_label};
use crate::geometry::{Shape, Texture, TriMesh};

/// Converts texture coordinates from metres to repetitions of the texture.
///
/// - A label covers the height of its shape once. Around a round shape it repeats a
///   whole number of times, on a box it fills each side; lids and bottoms have the
///   colour of the upper edge.
/// - A grain follows the longer side of a board, the axis of a round post.
/// - Around a round shape all other textures repeat a whole number of times, so that
///   no seam is visible.
pub(super) fn fit(mesh: &mut TriMesh, shape: &Shape, texture: &Texture) {
    let round = widest_radius(shape);
    if is_label(&texture.pattern) {
        fit_label(mesh, round);
        return;
    }
    if has_grain(&texture.pattern) {
        turn_grain(mesh, shape);
    }
    let scale = 1.0 / texture.metres.max(1e-3);
    let mut scales = [scale; 2];
    if let Some(radius) = round {
        let around = (std::f64::consts::TAU * radius) as f32;
        let axis = usize::from(has_grain(&texture.pattern));
        scales[axis] = (around * scale).round().max(1.0) / around;
    }
    for uv in &mut mesh.uvs {
        *uv = [uv[0] * scales[0], uv[1] * scales[1]];
    }
}

/// Radius of a surface of revolution.
fn widest_radius(shape: &Shape) -> Option<f64> {
    match shape {
        Shape::Cylinder { radius, .. }
        | Shape::Capsule { radius, .. }
        | Shape::Sphere { radius } => Some(*radius),
        Shape::Frustum {
            bottom_radius,
            top_radius,
            ..
        }
        | Shape::Cup {
            bottom_radius,
            top_radius,
            ..
        } => Some(bottom_radius.max(*top_radius)),
        Shape::Lathe { profile } => Some(profile.iter().map(|p| p[0]).fold(0.0, f64::max)),
        Shape::Cuboid { .. }
        | Shape::RoundedCuboid { .. }
        | Shape::Prism { .. }
        | Shape::PackedMesh { .. }
        | Shape::Mesh { .. } => None,
    }
}

fn fit_label(mesh: &mut TriMesh, round: Option<f64>) {
    let range = |k: usize| {
        let values = mesh.positions.iter().map(|p| p[k]);
        let low = values.clone().fold(f32::INFINITY, f32::min);
        let high = values.fold(f32::NEG_INFINITY, f32::max);
        (low, (high - low).max(1e-6))
    };
    let [(x0, dx), (y0, dy), (z0, dz)] = [range(0), range(1), range(2)];
    let around = round.map(|radius| (std::f64::consts::TAU * radius) as f32);
    for (vertex, side) in sides(mesh).into_iter().enumerate() {
        let p = mesh.positions[vertex];
        let v = (p[2] - z0) / dz;
        let across = |k: usize| [(p[0] - x0) / dx, (p[1] - y0) / dy][k];
        mesh.uvs[vertex] = match (side, around) {
            (Side::Top, _) => [0.5, 0.995],
            (Side::Bottom, _) => [0.5, 0.005],
            (_, Some(around)) => {
                let times = (around / dz).round().max(1.0);
                [mesh.uvs[vertex][0] / around * times, v]
            }
            (Side::East, None) => [across(1), v],
            (Side::West, None) => [1.0 - across(1), v],
            (Side::South, None) => [across(0), v],
            (Side::North, None) => [1.0 - across(0), v],
        };
    }
}

/// Orientation of a triangle: +x is east, +y north, +z top.
#[derive(Clone, Copy)]
enum Side {
    East,
    West,
    North,
    South,
    Top,
    Bottom,
}

/// Side of every vertex, that of its first triangle.
fn sides(mesh: &TriMesh) -> Vec<Side> {
    let mut sides = vec![None; mesh.positions.len()];
    for triangle in mesh.indices.chunks_exact(3) {
        let mut n = [0.0f32; 3];
        for &i in triangle {
            for (sum, x) in n.iter_mut().zip(mesh.normals[i as usize]) {
                *sum += x / 3.0;
            }
        }
        let side = if n[2].abs() > 0.8 {
            if n[2] > 0.0 { Side::Top } else { Side::Bottom }
        } else if n[0].abs() > n[1].abs() {
            if n[0] > 0.0 { Side::East } else { Side::West }
        } else if n[1] > 0.0 {
            Side::North
        } else {
            Side::South
        };
        for &i in triangle {
            sides[i as usize].get_or_insert(side);
        }
    }
    sides.into_iter().map(|s| s.unwrap_or(Side::Top)).collect()
}

fn turn_grain(mesh: &mut TriMesh, shape: &Shape) {
    match shape {
        Shape::Cuboid { half } | Shape::RoundedCuboid { half, .. } => {
            for (uv, n) in mesh.uvs.iter_mut().zip(&mesh.normals) {
                let a = n.map(f32::abs);
                let (along_u, along_v) = if a[2] >= a[0] && a[2] >= a[1] {
                    (half[0], half[1])
                } else if a[0] >= a[1] {
                    (half[1], half[2])
                } else {
                    (half[0], half[2])
                };
                if along_v > along_u {
                    uv.swap(0, 1);
                }
            }
        }
        Shape::Prism { .. } | Shape::PackedMesh { .. } | Shape::Mesh { .. } => {}
        _ => {
            for (uv, n) in mesh.uvs.iter_mut().zip(&mesh.normals) {
                if n[2].abs() < 0.8 {
                    uv.swap(0, 1);
                }
            }
        }
    }
}
