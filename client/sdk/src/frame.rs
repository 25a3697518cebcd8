//! One decoded image: color, depth and segmentation.

use bytes::Bytes;
use wheelarm_proto::v1::{self, PixelFormat};

/// An image of one camera. Its planes are registered and row-major from the top left:
/// pixel `(x, y)` has the index `y * width + x`.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Header with the timestamp of the exposure.
    pub header: v1::Header,
    /// Name of the camera.
    pub camera: String,
    /// Pinhole intrinsics with the size of the image, pixels.
    pub intrinsics: v1::Intrinsics,
    /// Pose of the optical frame (z forward, x right, y down) in `house`,
    /// metres.
    pub pose: v1::Pose,
    /// Color: height × width × 3 bytes, red, green, blue, sRGB. Shared with the message,
    /// not copied.
    pub color: Bytes,
    /// Depth along the optical axis: height × width, metres; infinite where no surface
    /// was hit.
    pub depth: Vec<f32>,
    /// Instance IDs: height × width; 0 where no surface was hit. The reply of the scene
    /// query lists the instances.
    pub segmentation: Vec<u16>,
}

/// An image does not match its message.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FrameError {
    /// A part is missing.
    #[error("invalid image: {0} is missing")]
    Missing(&'static str),
    /// The length of a plane does not match its size and format.
    #[error("the plane `{plane}` has {found} bytes, expected {expected} for {width}x{height}")]
    Length {
        /// Name of the plane.
        plane: &'static str,
        /// Its length, bytes.
        found: usize,
        /// Expected length, bytes.
        expected: u64,
        /// Image width, pixels.
        width: u32,
        /// Image height, pixels.
        height: u32,
    },
    /// This version cannot read the format.
    #[error(
        "the plane `{plane}` has the pixel format {format}, which this version cannot read: use client and server of one build"
    )]
    Format {
        /// Name of the plane.
        plane: &'static str,
        /// Number of the format.
        format: i32,
    },
}

/// Depth in millimetres where no surface was hit, or one beyond the range of 16 bits.
const NO_SURFACE: u16 = 0;

impl Frame {
    /// Decodes the planes of a message.
    ///
    /// # Errors
    /// [`FrameError`] for a missing part, a wrong length or an unknown format.
    pub fn from_proto(message: v1::CameraFrame) -> Result<Self, FrameError> {
        let intrinsics = message
            .intrinsics
            .ok_or(FrameError::Missing("intrinsics"))?;
        let format =
            |plane, number| PixelFormat::try_from(number).map_err(|_| unknown(plane, number));
        let plane = |plane, bytes: &Bytes, wide| length(plane, bytes, wide, &intrinsics);
        match format("color", message.color_format)? {
            PixelFormat::Rgb8 | PixelFormat::Unspecified => plane("color", &message.color, 3)?,
            _ => return Err(unknown("color", message.color_format)),
        }
        let depth = match format("depth", message.depth_format)? {
            PixelFormat::DepthMetresF32 | PixelFormat::Unspecified => {
                plane("depth", &message.depth, 4)?;
                let pixels = message.depth.chunks_exact(4);
                pixels
                    .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
                    .collect()
            }
            PixelFormat::DepthMillimetresU16 => {
                plane("depth", &message.depth, 2)?;
                let pixels = message.depth.chunks_exact(2);
                pixels
                    .map(|b| metres(u16::from_le_bytes([b[0], b[1]])))
                    .collect()
            }
            _ => return Err(unknown("depth", message.depth_format)),
        };
        let segmentation = match format("segmentation", message.segmentation_format)? {
            PixelFormat::IdU16 => {
                plane("segmentation", &message.segmentation, 2)?;
                let pixels = message.segmentation.chunks_exact(2);
                pixels.map(|b| u16::from_le_bytes([b[0], b[1]])).collect()
            }
            PixelFormat::IdU8 | PixelFormat::Unspecified => {
                plane("segmentation", &message.segmentation, 1)?;
                message
                    .segmentation
                    .iter()
                    .copied()
                    .map(u16::from)
                    .collect()
            }
            _ => return Err(unknown("segmentation", message.segmentation_format)),
        };
        Ok(Self {
            header: message.header.ok_or(FrameError::Missing("header"))?,
            camera: message.camera,
            intrinsics,
            pose: message.pose.ok_or(FrameError::Missing("pose"))?,
            color: message.color,
            depth,
            segmentation,
        })
    }

    /// Image width, pixels.
    #[must_use]
    pub fn width(&self) -> usize {
        self.intrinsics.width as usize
    }

    /// Image height, pixels.
    #[must_use]
    pub fn height(&self) -> usize {
        self.intrinsics.height as usize
    }

    /// Index of pixel `(x, y)` in the planes; `None` outside the image.
    fn index(&self, x: usize, y: usize) -> Option<usize> {
        (x < self.width() && y < self.height()).then(|| y * self.width() + x)
    }

    /// Red, green, blue of a pixel; `None` outside the image.
    #[must_use]
    pub fn color_at(&self, x: usize, y: usize) -> Option<[u8; 3]> {
        let at = 3 * self.index(x, y)?;
        self.color.get(at..at + 3)?.try_into().ok()
    }

    /// Instance ID of a pixel; `None` outside the image.
    #[must_use]
    pub fn instance_at(&self, x: usize, y: usize) -> Option<u16> {
        self.segmentation.get(self.index(x, y)?).copied()
    }

    /// Surface point at the center of a pixel in the optical frame, metres; `None`
    /// outside the image and where no surface was hit.
    #[must_use]
    pub fn point_at(&self, x: usize, y: usize) -> Option<[f64; 3]> {
        let z = f64::from(*self.depth.get(self.index(x, y)?)?);
        let v1::Intrinsics { fx, fy, cx, cy, .. } = self.intrinsics;
        let along = |pixel: usize, centre: f64, focal: f64| (pixel as f64 + 0.5 - centre) / focal;
        z.is_finite()
            .then(|| [along(x, cx, fx) * z, along(y, cy, fy) * z, z])
    }
}

fn metres(millimetres: u16) -> f32 {
    match millimetres {
        NO_SURFACE => f32::INFINITY,
        some => f32::from(some) * 1e-3,
    }
}

fn unknown(plane: &'static str, format: i32) -> FrameError {
    FrameError::Format { plane, format }
}

fn length(
    plane: &'static str,
    bytes: &Bytes,
    wide: u64,
    intrinsics: &v1::Intrinsics,
) -> Result<(), FrameError> {
    let (width, height) = (intrinsics.width, intrinsics.height);
    let pixels = u64::from(width) * u64::from(height);
    let expected = pixels.saturating_mul(wide);
    if bytes.len() as u64 == expected {
        return Ok(());
    }
    Err(FrameError::Length {
        plane,
        found: bytes.len(),
        expected,
        width,
        height,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two pixels wide and one high.
    fn message() -> v1::CameraFrame {
        let depth = [2.0_f32, f32::INFINITY];
        v1::CameraFrame {
            header: Some(v1::Header::default()),
            camera: "gen3".to_owned(),
            intrinsics: Some(v1::Intrinsics {
                width: 2,
                height: 1,
                fx: 2.0,
                fy: 2.0,
                cx: 1.0,
                cy: 0.5,
            }),
            pose: Some(v1::Pose::default()),
            color: Bytes::from_static(&[1, 2, 3, 4, 5, 6]),
            depth: depth.iter().flat_map(|d| d.to_le_bytes()).collect(),
            segmentation: Bytes::from_static(&[0, 1, 7, 0]),
            color_format: PixelFormat::Rgb8.into(),
            depth_format: PixelFormat::DepthMetresF32.into(),
            segmentation_format: PixelFormat::IdU16.into(),
        }
    }

    #[test]
    fn planes_are_decoded_by_their_formats() {
        let frame = Frame::from_proto(message()).unwrap();
        assert_eq!(frame.color_at(1, 0), Some([4, 5, 6]));
        assert_eq!(
            (frame.instance_at(0, 0), frame.instance_at(1, 0)),
            (Some(256), Some(7))
        );
        // Half a pixel left of the center, two metres away, at f = 2 pixels.
        assert_eq!(frame.point_at(0, 0), Some([-0.5, 0.0, 2.0]));
        assert_eq!(frame.point_at(1, 0), None, "no surface");
        assert_eq!(frame.color_at(2, 0), None, "outside");
        let coarse = v1::CameraFrame {
            depth: Bytes::from_static(&[0xd0, 0x07, 0, 0]),
            depth_format: PixelFormat::DepthMillimetresU16.into(),
            segmentation: Bytes::from_static(&[3, 9]),
            segmentation_format: PixelFormat::IdU8.into(),
            ..message()
        };
        let coarse = Frame::from_proto(coarse).unwrap();
        assert_eq!(coarse.depth, frame.depth);
        assert_eq!(coarse.segmentation, [3, 9]);
    }

    #[test]
    fn image_that_does_not_match_its_message_is_rejected_with_both_values() {
        let short = v1::CameraFrame {
            depth: Bytes::from_static(&[0; 7]),
            ..message()
        };
        let words = Frame::from_proto(short).unwrap_err().to_string();
        assert!(words.contains("7 bytes, expected 8 for 2x1"), "{words}");
        let other = v1::CameraFrame {
            segmentation_format: 99,
            ..message()
        };
        let refused = Frame::from_proto(other).unwrap_err();
        assert_eq!(refused, unknown("segmentation", 99));
        let bare = v1::CameraFrame {
            intrinsics: None,
            ..message()
        };
        assert!(Frame::from_proto(bare).is_err());
        let huge = v1::CameraFrame {
            intrinsics: Some(v1::Intrinsics {
                width: u32::MAX,
                height: u32::MAX,
                ..v1::Intrinsics::default()
            }),
            ..message()
        };
        assert!(matches!(
            Frame::from_proto(huge),
            Err(FrameError::Length { .. })
        ));
    }
}
