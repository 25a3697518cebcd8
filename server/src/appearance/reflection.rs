//! Reflections of smooth surfaces: a room with windows, rendered for a sky.

use nalgebra::{Point3, Vector3};

use super::file::AppearanceFile;
use super::irradiance::times;
use super::light::Light;

/// The environment as an octahedral image, with levels for rougher surfaces.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Reflection {
    /// RGBA from the largest level on, each half as wide as the previous one. A value
    /// is the square root of the light as a share of 6.
    pub levels: Vec<Vec<u8>>,
}

impl Reflection {
    /// Side of the largest level, pixels.
    pub const SIDE: usize = SIDE;
}

/// Light of a value of 255; the shader uses the same constant.
const BRIGHTEST: f32 = 6.0;
const SIDE: usize = 64;
/// Sharpness of each level after the first, as a power of the cosine.
const POWERS: [i32; 4] = [300, 40, 8, 2];

pub(super) fn drawn(file: &AppearanceFile, light: &Light, gain: [f32; 3]) -> Reflection {
    let directions = directions(SIDE);
    let sharp: Vec<[f32; 3]> = directions
        .iter()
        .map(|d| times(around(file, light, d), gain))
        .collect();
    let mut levels = vec![bytes(&sharp)];
    // Input of the blurred levels: every other pixel in each direction, and its solid
    // angle.
    let half = SIDE / 2;
    let sources: Vec<(Vector3<f32>, f32, [f32; 3])> = self::directions(half)
        .into_iter()
        .enumerate()
        .map(|(i, d)| {
            let (x, y) = (2 * (i % half), 2 * (i / half));
            let four = [(0, 0), (1, 0), (0, 1), (1, 1)];
            let mean = std::array::from_fn(|k| {
                let sum: f32 = four
                    .iter()
                    .map(|(dx, dy)| sharp[(y + dy) * SIDE + x + dx][k])
                    .sum();
                0.25 * sum
            });
            // An octahedral pixel covers a smaller solid angle where the octahedron is
            // closer.
            let near = d.x.abs() + d.y.abs() + d.z.abs();
            (d, near * near * near, mean)
        })
        .collect();
    for (level, power) in POWERS.into_iter().enumerate() {
        let side = SIDE >> (level + 1);
        let blurred: Vec<[f32; 3]> = self::directions(side)
            .iter()
            .map(|d| {
                let (mut sum, mut weights) = ([0.0; 3], 1e-9);
                for (towards, size, color) in &sources {
                    let cosine = d.dot(towards);
                    if cosine > 0.0 {
                        let weight = cosine.powi(power) * size;
                        weights += weight;
                        for k in 0..3 {
                            sum[k] += weight * color[k];
                        }
                    }
                }
                sum.map(|c| c / weights)
            })
            .collect();
        levels.push(bytes(&blurred));
    }
    Reflection { levels }
}

fn bytes(light: &[[f32; 3]]) -> Vec<u8> {
    let byte = |c: f32| ((c / BRIGHTEST).clamp(0.0, 1.0).sqrt() * 255.0 + 0.5) as u8;
    let pixel = |c: &[f32; 3]| [byte(c[0]), byte(c[1]), byte(c[2]), 255];
    light.iter().flat_map(pixel).collect()
}

/// Directions of the pixels of an octahedral image, row by row.
fn directions(side: usize) -> Vec<Vector3<f32>> {
    let at = |i: usize| (i as f32 + 0.5) / side as f32 * 2.0 - 1.0;
    let direction = |i: usize| {
        let (x, y) = (at(i % side), at(i / side));
        let z = 1.0 - x.abs() - y.abs();
        let fold = (-z).max(0.0);
        let inwards = |v: f32| if v >= 0.0 { v - fold } else { v + fold };
        Vector3::new(inwards(x), inwards(y), z).normalize()
    };
    (0..side * side).map(direction).collect()
}

/// Linear colours of walls, ceiling and floor, and of the furniture along the walls.
const WALL: [f32; 3] = [0.75, 0.72, 0.66];
const CEILING: [f32; 3] = [0.85, 0.84, 0.80];
const FLOOR: [f32; 3] = [0.40, 0.26, 0.14];
const FURNITURE: [[f32; 3]; 4] = [
    [0.07, 0.06, 0.06],
    [0.30, 0.19, 0.10],
    [0.16, 0.19, 0.22],
    [0.75, 0.72, 0.66],
];
/// Height of the furniture, metres.
const HEIGHT: f64 = 0.9;
/// Depth of the furniture, metres.
const WIDTH: f64 = 0.8;
/// Brightness of a window relative to the wall.
const WINDOW: f32 = 3.2;
/// Half the width of a lamp is half of this, metres.
const LAMP: f64 = 0.22;

/// The colour in a direction from the middle of the room: a box with windows.
fn around(file: &AppearanceFile, light: &Light, d: &Vector3<f32>) -> [f32; 3] {
    let centre = Point3::from(file.centre);
    let d = d.cast::<f64>();
    let [low, high] = file.room;
    let mut way = f64::INFINITY;
    let mut side = 0;
    for k in 0..3 {
        let to = if d[k] > 0.0 { high[k] } else { low[k] } - centre[k];
        if d[k].abs() > 1e-9 && to / d[k] < way {
            (way, side) = (to / d[k], k);
        }
    }
    let hit = centre + d * way;
    let inwards: Vector3<f32> = Vector3::ith(side, if d[side] > 0.0 { -1.0 } else { 1.0 });
    let reaches = light.irradiance.evaluate(&inwards);
    if side == 2 {
        if d.z > 0.0 {
            let lamp = light.lamps.iter().flatten().next();
            let near = (hit - centre).xy().norm() < LAMP;
            return match lamp {
                Some(color) if near => color.map(|c| c * 5.0),
                _ => times(CEILING, reaches),
            };
        }
        return times(FLOOR, reaches);
    }
    for window in &file.window {
        let at = Point3::from(window.at);
        let across = (hit[1 - side] - at[1 - side]).abs() < 0.5 * window.size[0];
        let up = (hit.z - at.z).abs() < 0.5 * window.size[1];
        // Window bars.
        let bar = ((hit[1 - side] - at[1 - side]).abs() - 0.4).abs() < 0.035;
        if across && up && !bar && (hit[side] - at[side]).abs() < 0.3 {
            return light.pane.map(|c| c * WINDOW);
        }
    }
    let column = (hit[1 - side] / WIDTH).floor() as i64 + 3 * side as i64;
    let furniture = FURNITURE[(column.wrapping_mul(7) & 3) as usize];
    let wall = if hit.z < HEIGHT { furniture } else { WALL };
    times(wall, reaches)
}
