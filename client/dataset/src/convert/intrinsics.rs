//! Intrinsics of the cameras for readers without the episode file.

use serde_json::{Value, json};

use super::{Recording, Size};
use crate::calibration::{CONVENTION, PIXEL_CENTRE};

/// Intrinsics of a recording's cameras for images of `size`, or as recorded:
/// pixels, pinhole without distortion.
#[must_use]
pub(super) fn cameras(recording: &Recording, size: Option<Size>) -> Value {
    let mut all = serde_json::Map::new();
    let depths = recording.sensors.iter().filter(|(_, s)| s.has_depth());
    for (name, camera) in recording.cameras.iter().chain(depths) {
        // Images of a depth sensor are not scaled.
        let size = size.filter(|_| camera.made_from().is_none());
        let [width, height, fx, fy, cx, cy] = camera.intrinsics(0);
        let to = size.map_or([width, height], |s| [s.width as f64, s.height as f64]);
        // The image edges are preserved by scaling, so no offset is added.
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
