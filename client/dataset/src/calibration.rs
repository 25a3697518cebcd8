//! Where pixels lie, told the same way in every file that holds pictures.

use serde_json::{Value, json};

use crate::convert::{Recording, Size};

/// Place of the centre of the pixel in column 0 and row 0, pixels.
pub const PIXEL_CENTRE: f64 = 0.5;

/// The convention of recordings and of all exports but MCAP, which has that of
/// its readers.
pub const CONVENTION: &str = "pixel edge: u, v, cx and cy count from the left and top edge of \
the picture, the centre of the pixel in column i and row j is at (i + 0.5, j + 0.5), and a point \
x y z of the optical frame is seen at (fx x/z + cx, fy y/z + cy); OpenCV and ROS count from the \
centre of the first pixel: there cx and cy are smaller by 0.5";

/// Intrinsics of a recording's cameras for pictures of `size`, or as recorded:
/// pixels, pinhole without distortion.
#[must_use]
pub fn cameras(recording: &Recording, size: Option<Size>) -> Value {
    let mut all = serde_json::Map::new();
    for (name, camera) in &recording.cameras {
        let [width, height, fx, fy, cx, cy] = camera.intrinsics(0);
        let to = size.map_or([width, height], |s| [s.width as f64, s.height as f64]);
        // Edges stay edges when a picture is scaled, so that nothing is added.
        let [sx, sy] = [to[0] / width, to[1] / height];
        let entry = json!({
            "width": to[0] as u64, "height": to[1] as u64,
            "fx": sx * fx, "fy": sy * fy, "cx": sx * cx, "cy": sy * cy,
            "distortion": [], "frame": "z forward, x right, y down",
        });
        all.insert(name.clone(), entry);
    }
    json!({
        "units": "pixels", "pixel_centre": PIXEL_CENTRE, "convention": CONVENTION,
        "cameras": all,
    })
}
