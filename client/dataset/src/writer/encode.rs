//! Encodes messages as records, in the compression workers.

use bytes::Bytes;
use crossbeam_channel::Receiver;
use prost::Message;
use wheelarm_proto::v1;

use crate::compress::{self, Deflate};
use crate::depth::{Depth, to_millimetres};
use crate::ids;
use crate::log::{Kind, RecordHeader, begin_record, begin_record_in, finish_record};

/// One worker's buffers.
pub(super) struct Encoder {
    deflate: Deflate,
    millimetres: Vec<u8>,
    depth: Depth,
    /// Length of the last image record, the best guess for the next one.
    last: usize,
    /// Buffers of written records: fresh memory of that size costs
    /// more than filling it.
    spare: Receiver<Vec<u8>>,
}

impl Encoder {
    pub fn new(depth: Depth, spare: Receiver<Vec<u8>>) -> Self {
        Self {
            deflate: Deflate::default(),
            millimetres: Vec::new(),
            depth,
            last: 0,
            spare,
        }
    }

    /// Record of a camera frame: three compressed images.
    pub fn camera(&mut self, header: &RecordHeader, frame: &v1::CameraFrame) -> Vec<u8> {
        let meta = v1::CameraFrame {
            header: frame.header.clone(),
            camera: frame.camera.clone(),
            intrinsics: frame.intrinsics,
            pose: frame.pose,
            color_format: frame.color_format,
            depth_format: frame.depth_format,
            segmentation_format: frame.segmentation_format,
            ..Default::default()
        };
        let spare = self.spare.try_recv().unwrap_or_default();
        let mut out = begin_record_in(spare, self.last + self.last / 8);
        part(&mut out, |out| {
            out.extend(meta.encode_to_vec());
        });
        part(&mut out, |out| {
            self.deflate.append(&frame.color, 1, out);
        });
        part(&mut out, |out| match self.depth {
            Depth::Metres => {
                self.deflate.append(&frame.depth, 4, out);
            }
            Depth::Millimetres => {
                to_millimetres(&frame.depth, &mut self.millimetres);
                self.deflate.append(&self.millimetres, 2, out);
            }
            Depth::Nothing => {}
        });
        part(&mut out, |out| {
            self.deflate
                .append(&frame.segmentation, ids::bytes(frame), out);
        });
        finish_record(&mut out, header);
        self.last = out.len();
        out
    }

    /// Record of a camera frame whose planes are compressed already; depth that is
    /// stored in another format is converted.
    ///
    /// # Errors
    /// When the depth cannot be converted.
    pub fn compressed(
        &mut self,
        header: &RecordHeader,
        frame: v1::CompressedCameraFrame,
    ) -> Result<Vec<u8>, String> {
        let is_metres = frame.depth_format() == v1::PixelFormat::DepthMetresF32;
        let depth = match self.depth {
            Depth::Millimetres if is_metres => self.millimetres_of(&frame)?.into(),
            Depth::Metres | Depth::Millimetres => frame.depth,
            Depth::Nothing => Bytes::new(),
        };
        let meta = v1::CameraFrame {
            header: frame.header,
            camera: frame.camera,
            intrinsics: frame.intrinsics,
            pose: frame.pose,
            color_format: frame.color_format,
            // Of the exact image.
            depth_format: v1::PixelFormat::DepthMetresF32.into(),
            segmentation_format: frame.segmentation_format,
            ..Default::default()
        };
        let meta = meta.encode_to_vec();
        let parts = [&meta[..], &frame.color, &depth, &frame.segmentation];
        let spare = self.spare.try_recv().unwrap_or_default();
        let length: usize = parts.iter().map(|part| part.len() + 4).sum();
        let mut out = begin_record_in(spare, length);
        for bytes in parts {
            part(&mut out, |out| out.extend_from_slice(bytes));
        }
        finish_record(&mut out, header);
        Ok(out)
    }

    /// Compressed millimetres of compressed metres.
    fn millimetres_of(&mut self, frame: &v1::CompressedCameraFrame) -> Result<Vec<u8>, String> {
        let size = frame.intrinsics.unwrap_or_default();
        let bytes = 4 * size.width as usize * size.height as usize;
        let metres = compress::inflate(&frame.depth, 4, bytes)
            .map_err(|e| format!("the depth of {:?} cannot be inflated: {e}", frame.camera))?;
        to_millimetres(&metres, &mut self.millimetres);
        let mut out = Vec::with_capacity(frame.depth.len());
        self.deflate.append(&self.millimetres, 2, &mut out);
        Ok(out)
    }

    /// Record of a sensor's image, as [`Encoder::camera`]: what the sensor does
    /// not have is empty.
    pub fn sensor(&mut self, header: &RecordHeader, mut frame: v1::SensorFrame) -> Vec<u8> {
        let (rgb, depth) = (
            std::mem::take(&mut frame.color),
            std::mem::take(&mut frame.depth),
        );
        let mut out = begin_record(rgb.len() + depth.len());
        part(&mut out, |out| {
            out.extend(frame.encode_to_vec());
        });
        for (image, element) in [(rgb, 1), (depth, 2)] {
            part(&mut out, |out| {
                if !image.is_empty() {
                    self.deflate.append(&image, element, out);
                }
            });
        }
        part(&mut out, |_| {});
        finish_record(&mut out, header);
        out
    }
}

/// Record that closes a log.
pub(super) fn closing(closing: &crate::log::Closing) -> Vec<u8> {
    let mut out = begin_record(0);
    out.extend(closing.encode_to_vec());
    let header = RecordHeader {
        kind: Kind::Closing,
        stream: 0,
        sequence: 0,
        stamp_nanos: 0,
        tick: 0,
    };
    finish_record(&mut out, &header);
    out
}

fn part(out: &mut Vec<u8>, fill: impl FnOnce(&mut Vec<u8>)) {
    let at = out.len();
    out.extend([0; 4]);
    fill(out);
    // Images are bounded far below 4 GiB by the check of their size.
    let length = u32::try_from(out.len() - at - 4).unwrap_or(u32::MAX);
    out[at..at + 4].copy_from_slice(&length.to_le_bytes());
}
