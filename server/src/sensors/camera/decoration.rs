//! Shapes of decoration objects.

use crate::appearance::{Decoration, Kind};
use crate::geometry::{Material, Shape};

/// Shapes of a decoration, their positions on it, and their materials.
pub(super) fn parts(decoration: &Decoration) -> Vec<(Shape, [f64; 3], Material)> {
    let [w, h] = decoration.size;
    let [first, second] = &decoration.materials;
    let plate = |half: [f64; 3]| Shape::Cuboid { half };
    match decoration.kind {
        Kind::WallImage => {
            let paper = Material {
                color: [0.93, 0.91, 0.87],
                texture: None,
                ..second.clone()
            };
            let inner = |margin: f64, x: f64| plate([x, w / 2.0 - margin, h / 2.0 - margin]);
            let (broad, narrow) = (0.09 * w.min(h), 0.28 * w.min(h));
            vec![
                (
                    plate([0.010, w / 2.0, h / 2.0]),
                    [0.010, 0.0, 0.0],
                    first.clone(),
                ),
                (inner(0.03, 0.002), [0.021, 0.0, 0.0], paper.clone()),
                (
                    inner(0.03 + broad, 0.002),
                    [0.0225, 0.0, 0.0],
                    second.clone(),
                ),
                (
                    inner(0.03 + narrow, 0.002),
                    [0.024, 0.06 * w, 0.08 * h],
                    Material {
                        color: paper.color.map(|c| 0.55 * c),
                        ..paper
                    },
                ),
            ]
        }
        Kind::Rug => vec![
            (
                plate([w / 2.0, h / 2.0, 0.0016]),
                [0.0, 0.0, 0.0016],
                first.clone(),
            ),
            (
                plate([w / 2.0 - 0.12, h / 2.0 - 0.12, 0.0022]),
                [0.0, 0.0, 0.0022],
                second.clone(),
            ),
        ],
        Kind::Plant => {
            let pot = Shape::Frustum {
                bottom_radius: 0.32 * w,
                top_radius: 0.5 * w,
                half_height: 0.2 * h,
            };
            let (r, z) = (0.75 * w, 0.6 * h);
            let crown = [
                [0.2, 0.0],
                [0.7, 0.15],
                [1.0, 0.45],
                [0.8, 0.75],
                [0.4, 0.95],
                [0.0, 1.0],
            ];
            let leaves = Shape::Lathe {
                profile: crown.map(|[x, y]| [x * r, y * z]).to_vec(),
            };
            vec![
                (pot, [0.0, 0.0, 0.2 * h], first.clone()),
                (leaves, [0.0, 0.0, 0.4 * h], second.clone()),
            ]
        }
        Kind::Lamp => {
            let cord = Shape::Cylinder {
                radius: 0.005,
                half_height: h / 2.0,
            };
            let shade = Shape::Frustum {
                bottom_radius: w / 2.0,
                top_radius: w / 3.2,
                half_height: 0.2 * w,
            };
            vec![
                (cord, [0.0, 0.0, -h / 2.0], second.clone()),
                (shade, [0.0, 0.0, -h], first.clone()),
            ]
        }
    }
}
