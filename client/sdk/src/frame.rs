//! One picture with its planes as numbers: colour, depth, instance ids.

use bytes::Bytes;
use wheelarm_proto::v1::{self, PixelFormat};

/// A picture of one camera; its planes are registered and row-major from the
/// top left, pixel `(x, y)` at `y * width + x`.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Stamp of the exposure.
    pub header: v1::Header,
    /// Name of the camera.
    pub camera: String,
    /// Pinhole intrinsics with the size of the picture, pixels.
    pub intrinsics: v1::Intrinsics,
    /// Pose of the optical frame (z forward, x right, y down) in `house`,
    /// metres.
    pub pose: v1::Pose,
    /// Colour: height × width × 3, red, green, blue, sRGB. Shared, not copied.
    pub rgb: Bytes,
    /// Depth along the optical axis: height × width, metres; infinite where
    /// nothing is.
    pub depth: Vec<f32>,
    /// Instance ids: height × width; 0 where nothing is. The scene query tells
    /// what they stand for.
    pub ids: Vec<u16>,
}

/// A picture that is not as its message says.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BadFrame {
    /// A part is missing.
    #[error("the picture has no {0}")]
    Missing(&'static str),
    /// A plane has another length than its size and format say.
    #[error("the plane `{plane}` has {found} bytes, expected {expected} for {width}x{height}")]
    Length {
        /// Which plane.
        plane: &'static str,
        /// Its bytes.
        found: usize,
        /// Wanted bytes.
        expected: u64,
        /// Picture width, pixels.
        width: u32,
        /// Picture height, pixels.
        height: u32,
    },
    /// A format that this version cannot read.
    #[error(
        "the plane `{plane}` has the pixel format {format}, which this version cannot read: use client and server of one build"
    )]
    Format {
        /// Which plane.
        plane: &'static str,
        /// Number of the format.
        format: i32,
    },
}

/// A surface at millimetres that 16 bits do not hold is told as this.
const NOTHING_HIT: u16 = 0;

impl Frame {
    /// Reads the planes of a message.
    ///
    /// # Errors
    /// [`BadFrame`].
    pub fn read(message: v1::CameraFrame) -> Result<Self, BadFrame> {
        let intrinsics = message.intrinsics.ok_or(BadFrame::Missing("intrinsics"))?;
        let format =
            |plane, number| PixelFormat::try_from(number).map_err(|_| unknown(plane, number));
        let plane = |plane, bytes: &Bytes, wide| length(plane, bytes, wide, &intrinsics);
        match format("rgb", message.color_format)? {
            PixelFormat::Rgb8 | PixelFormat::Unspecified => plane("rgb", &message.color, 3)?,
            _ => return Err(unknown("rgb", message.color_format)),
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
        let ids = match format("ids", message.segmentation_format)? {
            PixelFormat::IdU16 => {
                plane("ids", &message.segmentation, 2)?;
                let pixels = message.segmentation.chunks_exact(2);
                pixels.map(|b| u16::from_le_bytes([b[0], b[1]])).collect()
            }
            PixelFormat::IdU8 | PixelFormat::Unspecified => {
                plane("ids", &message.segmentation, 1)?;
                message
                    .segmentation
                    .iter()
                    .copied()
                    .map(u16::from)
                    .collect()
            }
            _ => return Err(unknown("ids", message.segmentation_format)),
        };
        Ok(Self {
            header: message.header.ok_or(BadFrame::Missing("header"))?,
            camera: message.camera,
            intrinsics,
            pose: message.pose.ok_or(BadFrame::Missing("pose"))?,
            rgb: message.color,
            depth,
            ids,
        })
    }

    /// Picture width, pixels.
    #[must_use]
    pub fn width(&self) -> usize {
        self.intrinsics.width as usize
    }

    /// Picture height, pixels.
    #[must_use]
    pub fn height(&self) -> usize {
        self.intrinsics.height as usize
    }

    /// Where in the planes pixel `(x, y)` lies; `None` outside.
    fn index(&self, x: usize, y: usize) -> Option<usize> {
        (x < self.width() && y < self.height()).then(|| y * self.width() + x)
    }

    /// Red, green, blue of a pixel; `None` outside the picture.
    #[must_use]
    pub fn colour(&self, x: usize, y: usize) -> Option<[u8; 3]> {
        let at = 3 * self.index(x, y)?;
        self.rgb.get(at..at + 3)?.try_into().ok()
    }

    /// Instance id of a pixel; `None` outside the picture.
    #[must_use]
    pub fn id(&self, x: usize, y: usize) -> Option<u16> {
        self.ids.get(self.index(x, y)?).copied()
    }

    /// What the middle of a pixel shows, in the optical frame, metres; `None`
    /// outside the picture and where nothing is.
    #[must_use]
    pub fn point(&self, x: usize, y: usize) -> Option<[f64; 3]> {
        let z = f64::from(*self.depth.get(self.index(x, y)?)?);
        let v1::Intrinsics { fx, fy, cx, cy, .. } = self.intrinsics;
        let along = |pixel: usize, centre: f64, focal: f64| (pixel as f64 + 0.5 - centre) / focal;
        z.is_finite()
            .then(|| [along(x, cx, fx) * z, along(y, cy, fy) * z, z])
    }
}

fn metres(millimetres: u16) -> f32 {
    match millimetres {
        NOTHING_HIT => f32::INFINITY,
        some => f32::from(some) * 1e-3,
    }
}

fn unknown(plane: &'static str, format: i32) -> BadFrame {
    BadFrame::Format { plane, format }
}

fn length(
    plane: &'static str,
    bytes: &Bytes,
    wide: u64,
    intrinsics: &v1::Intrinsics,
) -> Result<(), BadFrame> {
    let (width, height) = (intrinsics.width, intrinsics.height);
    let pixels = u64::from(width) * u64::from(height);
    let expected = pixels.saturating_mul(wide);
    if bytes.len() as u64 == expected {
        return Ok(());
    }
    Err(BadFrame::Length {
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
    fn planes_are_read_as_their_formats_say() {
        let frame = Frame::read(message()).unwrap();
        assert_eq!(frame.colour(1, 0), Some([4, 5, 6]));
        assert_eq!((frame.id(0, 0), frame.id(1, 0)), (Some(256), Some(7)));
        // Half a pixel left of the centre, two metres away, at f = 2 pixels.
        assert_eq!(frame.point(0, 0), Some([-0.5, 0.0, 2.0]));
        assert_eq!(frame.point(1, 0), None, "nothing is there");
        assert_eq!(frame.colour(2, 0), None, "outside");
        let coarse = v1::CameraFrame {
            depth: Bytes::from_static(&[0xd0, 0x07, 0, 0]),
            depth_format: PixelFormat::DepthMillimetresU16.into(),
            segmentation: Bytes::from_static(&[3, 9]),
            segmentation_format: PixelFormat::IdU8.into(),
            ..message()
        };
        let coarse = Frame::read(coarse).unwrap();
        assert_eq!(coarse.depth, frame.depth);
        assert_eq!(coarse.ids, [3, 9]);
    }

    #[test]
    fn a_picture_that_is_not_as_it_says_is_refused_with_both_values() {
        let short = v1::CameraFrame {
            depth: Bytes::from_static(&[0; 7]),
            ..message()
        };
        let words = Frame::read(short).unwrap_err().to_string();
        assert!(words.contains("7 bytes, expected 8 for 2x1"), "{words}");
        let other = v1::CameraFrame {
            segmentation_format: 99,
            ..message()
        };
        let refused = Frame::read(other).unwrap_err();
        assert_eq!(refused, unknown("ids", 99));
        let bare = v1::CameraFrame {
            intrinsics: None,
            ..message()
        };
        assert!(Frame::read(bare).is_err());
        let huge = v1::CameraFrame {
            intrinsics: Some(v1::Intrinsics {
                width: u32::MAX,
                height: u32::MAX,
                ..v1::Intrinsics::default()
            }),
            ..message()
        };
        assert!(matches!(Frame::read(huge), Err(BadFrame::Length { .. })));
    }
}
