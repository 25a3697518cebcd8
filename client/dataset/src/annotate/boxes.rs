//! Boxes of objects in the images, and the visible share of each.
//!
//! The *visible box* is the least that holds all pixels of the object's instance
//! id. The *projected box* is the least that holds its parts projected into the
//! image, also beyond its edges. The *visible share* is the number of pixels of
//! its id over the number of pixels of its silhouette: the union of the convex
//! hulls of its projected parts, on an unbounded image. So what is hidden, or out
//! of the image, is not visible; parts are those of the object's file, which
//! differ by a few per cent from the rendered mesh; shares are clamped to 1.

use super::shapes::{self, Part};
use super::state::State;
use crate::pose::{self, project};
use crate::read::{Episode, ReadError};

/// Boxes in the images of one camera: image by object.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CameraBoxes {
    /// The camera.
    pub camera: String,
    /// Left, top, right, bottom of the visible box, pixels from the left and top
    /// edge, the right and bottom ends left out; NaN where no pixel is its own.
    pub visible: Vec<[f64; 4]>,
    /// The same of the projected box; NaN where a part is behind the camera.
    pub projected: Vec<[f64; 4]>,
    /// Visible share, 0 to 1; NaN where a part is behind the camera.
    pub share: Vec<f64>,
}

/// Side of the grid on which silhouettes are counted, cells.
const GRID: usize = 128;

/// Boxes in all cameras.
///
/// # Errors
/// When images cannot be read.
pub fn boxes(episode: &Episode, state: &State) -> Result<Vec<CameraBoxes>, ReadError> {
    let legend = episode.snapshot()?.instances;
    let id = |name: &String| legend.iter().find(|i| i.name == *name).map_or(0, |i| i.id);
    let ids: Vec<u32> = state.objects.iter().map(id).collect();
    let parts: Vec<Vec<Part>> = state
        .objects
        .iter()
        .map(|name| shapes::parts(state, name))
        .collect();
    let mut out = Vec::new();
    for name in episode.cameras()? {
        let camera = episode.camera(&name)?;
        let mut found = CameraBoxes {
            camera: name,
            ..CameraBoxes::default()
        };
        let width = camera.size().map_or(0, |(width, _)| width).max(1);
        for i in 0..camera.len() {
            let pixels = camera.ids(episode, i)?;
            let counted = count(&pixels, width, &ids);
            let row = state.stamps.partition_point(|&t| t < camera.stamps()[i]);
            let (lens, at) = (camera.intrinsics(i), camera.pose(i));
            for (object, (visible, pixels)) in counted.into_iter().enumerate() {
                let own = state.poses.get(row).and_then(|row| row.get(object));
                let silhouette = own.and_then(|own| silhouette(&lens, &at, own, &parts[object]));
                let (projected, area) = silhouette.unwrap_or(([f64::NAN; 4], f64::NAN));
                found.visible.push(visible);
                found.projected.push(projected);
                let share = pixels as f64 / area;
                // `min` would turn NaN into 1.
                found.share.push(if share > 1.0 { 1.0 } else { share });
            }
        }
        out.push(found);
    }
    Ok(out)
}

/// Visible box and number of pixels of each id.
fn count(pixels: &[u16], width: usize, ids: &[u32]) -> Vec<([f64; 4], usize)> {
    let mut found = vec![([f64::INFINITY, f64::INFINITY, 0.0, 0.0], 0); ids.len()];
    for (i, pixel) in pixels.iter().enumerate() {
        let own = ids
            .iter()
            .position(|id| *id != 0 && *id == u32::from(*pixel));
        let Some(object) = own else { continue };
        let (x, y) = ((i % width) as f64, (i / width) as f64);
        let (extent, count) = &mut found[object];
        *extent = [
            extent[0].min(x),
            extent[1].min(y),
            extent[2].max(x + 1.0),
            extent[3].max(y + 1.0),
        ];
        *count += 1;
    }
    for (extent, _) in found.iter_mut().filter(|(_, count)| *count == 0) {
        *extent = [f64::NAN; 4];
    }
    found
}

/// Box around the projected parts, and the area of their union, pixels.
fn silhouette(
    lens: &[f64; 6],
    camera: &pose::Pose,
    own: &pose::Pose,
    parts: &[Part],
) -> Option<([f64; 4], f64)> {
    let mut hulls = Vec::new();
    for part in parts {
        let to_house = |p: &[f64; 3]| project(lens, camera, pose::point(own, *p));
        let points: Option<Vec<[f64; 2]>> = part.iter().map(to_house).collect();
        hulls.push(hull(points?));
    }
    let mut extent = [
        f64::INFINITY,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::NEG_INFINITY,
    ];
    for [x, y] in hulls.iter().flatten() {
        extent = [
            extent[0].min(*x),
            extent[1].min(*y),
            extent[2].max(*x),
            extent[3].max(*y),
        ];
    }
    let (width, height) = (extent[2] - extent[0], extent[3] - extent[1]);
    if !(width > 0.0 && height > 0.0) {
        return None;
    }
    let cell = |i: usize| (i as f64 + 0.5) / GRID as f64;
    let mut inside = 0;
    for i in 0..GRID * GRID {
        let x = extent[0] + width * cell(i % GRID);
        let y = extent[1] + height * cell(i / GRID);
        inside += usize::from(hulls.iter().any(|hull| holds(hull, [x, y])));
    }
    let area = width * height * inside as f64 / (GRID * GRID) as f64;
    // An object smaller than a pixel fills it where it is visible at all.
    Some((extent, area.max(1.0)))
}

/// Convex hull, counter-clockwise (Andrew 1979).
fn hull(mut points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let half = |points: &mut dyn Iterator<Item = [f64; 2]>| {
        let mut chain: Vec<[f64; 2]> = Vec::new();
        for point in points {
            while let [.., a, b] = chain[..]
                && cross(a, b, point) <= 0.0
            {
                chain.pop();
            }
            chain.push(point);
        }
        chain.pop();
        chain
    };
    let mut out = half(&mut points.iter().copied());
    out.extend(half(&mut points.iter().rev().copied()));
    out
}

fn cross(o: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0])
}

fn holds(hull: &[[f64; 2]], point: [f64; 2]) -> bool {
    let next = hull.iter().cycle().skip(1);
    hull.len() > 2
        && hull
            .iter()
            .zip(next)
            .all(|(a, b)| cross(*a, *b, point) >= 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_square_before_the_camera_has_the_area_it_should() {
        let lens = [640.0, 480.0, 100.0, 100.0, 320.0, 240.0];
        let camera = pose::IDENTITY;
        let corners = |z: f64| {
            [
                [-0.5, -0.5, z],
                [0.5, -0.5, z],
                [0.5, 0.5, z],
                [-0.5, 0.5, z],
            ]
        };
        let part: Part = corners(0.0).to_vec();
        let own = [0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 1.0];
        let (extent, area) = silhouette(&lens, &camera, &own, &[part.clone(), part]).unwrap();
        assert_eq!(extent, [295.0, 215.0, 345.0, 265.0]);
        assert!((area - 2500.0).abs() < 1e-9, "{area}");
        let behind = [0.0, 0.0, -2.0, 0.0, 0.0, 0.0, 1.0];
        assert!(silhouette(&lens, &camera, &behind, &[corners(0.0).to_vec()]).is_none());
    }

    #[test]
    fn boxes_hold_the_pixels_of_an_id() {
        let mut pixels = vec![0; 20];
        (pixels[6], pixels[12]) = (7, 7);
        let found = count(&pixels, 5, &[7, 9, 0]);
        assert_eq!(found[0], ([1.0, 1.0, 3.0, 3.0], 2));
        assert!(found[1].0[0].is_nan() && found[1].1 == 0);
        assert_eq!(found[2].1, 0, "an object without an id has no pixels");
    }
}
