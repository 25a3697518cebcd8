//! Checks of images before they are written.

use wheelarm_proto::settings::Named;
use wheelarm_proto::v1;

use crate::depth::Depth;

/// Largest image side, pixels; keeps every length far below 4 GiB.
pub const MAX_SIDE: u32 = 8192;

/// Size of an image by its intrinsics; all of a stream have one.
fn size(
    intrinsics: Option<v1::Intrinsics>,
    first: Option<(u32, u32)>,
) -> Result<(u32, u32), String> {
    let intrinsics = intrinsics.ok_or("it has no intrinsics")?;
    let (w, h) = (intrinsics.width, intrinsics.height);
    if !(1..=MAX_SIDE).contains(&w) || !(1..=MAX_SIDE).contains(&h) {
        return Err(format!(
            "it is {w}x{h}, expected 1 to {MAX_SIDE} pixels each way"
        ));
    }
    if let Some((fw, fh)) = first
        && (w, h) != (fw, fh)
    {
        return Err(format!("it is {w}x{h}, the first image was {fw}x{fh}"));
    }
    Ok((w, h))
}

/// A sensor's image: either colour or 16-bit depth.
pub(super) fn sensor(
    frame: &v1::SensorFrame,
    first: Option<(u32, u32)>,
) -> Result<(u32, u32), String> {
    let (w, h) = size(frame.intrinsics, first)?;
    let pixels = w as usize * h as usize;
    let (rgb, depth) = (frame.color.len(), frame.depth.len());
    if (rgb, depth) == (3 * pixels, 0) || (rgb, depth) == (0, 2 * pixels) {
        return Ok((w, h));
    }
    Err(format!(
        "rgb has {rgb} bytes and depth {depth}, {w}x{h} needs {} and none, or none and {}",
        3 * pixels,
        2 * pixels
    ))
}

/// An image whose planes are zlib streams; their content is covered by the digest of
/// the stream.
pub(super) fn compressed(
    frame: &v1::CompressedCameraFrame,
    first: Option<(u32, u32)>,
    depth: Depth,
) -> Result<(u32, u32), String> {
    let (width, height) = size(frame.intrinsics, first)?;
    let formats = (frame.color_format(), frame.segmentation_format());
    let expected = (v1::PixelFormat::Rgb8, v1::PixelFormat::IdU16);
    if formats != expected {
        return Err(format!("its planes are {formats:?}, expected {expected:?}"));
    }
    let pixels = width as usize * height as usize;
    let depth_bytes = match (depth, frame.depth_format()) {
        (Depth::Nothing, _) => None,
        (_, v1::PixelFormat::DepthMetresF32) => Some(4 * pixels),
        (Depth::Millimetres, v1::PixelFormat::DepthMillimetresU16) => Some(2 * pixels),
        (_, other) => {
            let kept = depth.name();
            return Err(format!(
                "its depth is {other:?}, which cannot be converted to {kept}"
            ));
        }
    };
    for (what, plane, bytes) in [
        ("rgb", &frame.color, Some(3 * pixels)),
        ("depth", &frame.depth, depth_bytes),
        ("ids", &frame.segmentation, Some(2 * pixels)),
    ] {
        let Some(bytes) = bytes else { continue };
        // Deflate stores incompressible data with 5 bytes for each block.
        let most = bytes + bytes / 1024 + 1024;
        if plane.is_empty() || plane.len() > most {
            return Err(format!(
                "{what} has {} compressed bytes, expected 1 to {most}",
                plane.len()
            ));
        }
    }
    Ok((width, height))
}

/// An image as it was rendered.
pub(super) fn exact(
    frame: &v1::CameraFrame,
    first: Option<(u32, u32)>,
) -> Result<(u32, u32), String> {
    let (w, h) = size(frame.intrinsics, first)?;
    let pixels = w as usize * h as usize;
    for (what, got, expected) in [
        ("rgb", frame.color.len(), 3 * pixels),
        ("depth", frame.depth.len(), 4 * pixels),
        (
            "ids",
            frame.segmentation.len(),
            crate::ids::bytes(frame) * pixels,
        ),
    ] {
        if got != expected {
            return Err(format!("{what} has {got} bytes, {w}x{h} needs {expected}"));
        }
    }
    Ok((w, h))
}
