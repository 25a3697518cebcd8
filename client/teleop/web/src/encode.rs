//! Images for one page: JPEG as the server sent it, or H.264 from an encoder of this
//! page, if the program was built with one.

use bytes::Bytes;

use crate::feed::Image;

/// Codec of the images.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Codec {
    /// One file per image.
    #[default]
    Jpeg,
    /// Annex B, constrained baseline; each image refers only to earlier ones.
    #[cfg(feature = "h264")]
    H264,
}

impl Codec {
    /// The first codec of a page's list that this program has.
    #[must_use]
    pub fn of(wanted: &[String]) -> Self {
        #[cfg(feature = "h264")]
        if wanted.first().is_some_and(|codec| codec == "h264") {
            return Self::H264;
        }
        let _ = wanted;
        Self::Jpeg
    }

    /// Name in the page protocol.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Jpeg => "jpeg",
            #[cfg(feature = "h264")]
            Self::H264 => "h264",
        }
    }

    /// Number in a message header.
    #[must_use]
    pub fn number(self) -> u8 {
        match self {
            Self::Jpeg => 0,
            #[cfg(feature = "h264")]
            Self::H264 => 1,
        }
    }
}

/// An encoded image.
#[derive(Clone, Debug)]
pub struct Encoded {
    /// Decodes without any other image.
    pub key: bool,
    /// Its bytes.
    pub bytes: Bytes,
}

/// Encodes the images of one camera for one page.
#[derive(Default)]
pub struct Encoder {
    #[cfg(feature = "h264")]
    h264: Option<h264::Stream>,
}

impl Encoder {
    /// Makes the next image a key frame.
    pub fn restart(&mut self) {
        #[cfg(feature = "h264")]
        {
            self.h264 = None;
        }
    }

    /// Encodes an image at `bits` per second; `None` when the encoder returned no data.
    pub fn encode(&mut self, codec: Codec, image: &Image, bits: u32) -> Option<Encoded> {
        match codec {
            Codec::Jpeg => {
                let _ = bits;
                (!image.jpeg.is_empty()).then(|| Encoded {
                    key: true,
                    bytes: image.jpeg.clone(),
                })
            }
            #[cfg(feature = "h264")]
            Codec::H264 => {
                let wanted = [image.width, image.height, bits];
                if self.h264.as_ref().is_none_or(|stream| !stream.is(wanted)) {
                    self.h264 = h264::Stream::new(wanted)
                        .inspect_err(|e| tracing::error!("no H.264 encoder: {e}"))
                        .ok();
                }
                self.h264.as_mut()?.encode(&image.i420)
            }
        }
    }
}

#[cfg(feature = "h264")]
mod h264 {
    use openh264::OpenH264API;
    use openh264::encoder::{
        BitRate, Complexity, Encoder, EncoderConfig, FrameRate, FrameType, Profile,
        RateControlMode, UsageType,
    };
    use openh264::formats::YUVSlices;

    use super::Encoded;

    /// Image rate that the encoder's rate control assumes, Hz.
    const RATE: f32 = 10.0;

    /// A stream of images of one size and bit rate; it begins with a key frame.
    pub struct Stream {
        encoder: Encoder,
        /// Width, height, bits per second.
        of: [u32; 3],
    }

    impl Stream {
        pub fn new(of: [u32; 3]) -> Result<Self, openh264::Error> {
            let config = EncoderConfig::new()
                .bitrate(BitRate::from_bps(of[2]))
                .max_frame_rate(FrameRate::from_hz(RATE))
                .rate_control_mode(RateControlMode::Bitrate)
                .usage_type(UsageType::CameraVideoRealTime)
                .complexity(Complexity::Low)
                .profile(Profile::Baseline)
                .skip_frames(false)
                .scene_change_detect(false)
                .num_threads(1);
            let encoder = Encoder::with_api_config(OpenH264API::from_source(), config)?;
            Ok(Self { encoder, of })
        }

        pub fn is(&self, of: [u32; 3]) -> bool {
            self.of == of
        }

        pub fn encode(&mut self, i420: &[u8]) -> Option<Encoded> {
            let [w, h] = [self.of[0] as usize, self.of[1] as usize];
            let (luma, colour) = i420.split_at_checked(w * h)?;
            let (blue, red) = colour.split_at_checked(w * h / 4)?;
            if red.len() != blue.len() {
                return None;
            }
            let image = YUVSlices::new((luma, blue, red), (w, h), (w, w / 2, w / 2));
            let made = self.encoder.encode(&image);
            let made = made
                .inspect_err(|e| tracing::warn!("cannot encode an image: {e}"))
                .ok()?;
            let key = matches!(made.frame_type(), FrameType::IDR | FrameType::I);
            let bytes = made.to_vec();
            (!bytes.is_empty()).then(|| Encoded {
                key,
                bytes: bytes.into(),
            })
        }
    }

    #[cfg(test)]
    mod tests {
        use super::*;

        /// A slow pan over stripes.
        fn image(at: usize) -> Vec<u8> {
            let luma = (0..320 * 180).map(|i| (((i % 320 + at) / 16 % 2) * 120 + 60) as u8);
            let colour = std::iter::repeat_n(128, 320 * 180 / 2);
            luma.chain(colour).collect()
        }

        #[test]
        fn a_stream_begins_with_a_key_frame_and_continues_without() {
            let mut stream = Stream::new([320, 180, 200_000]).unwrap();
            let first = stream.encode(&image(0)).unwrap();
            assert!(first.key);
            // Start code and a sequence parameter set of a baseline profile.
            assert_eq!(first.bytes[..4], [0, 0, 0, 1]);
            assert_eq!(first.bytes[4] & 31, 7);
            assert_eq!(first.bytes[5], 66);
            let later: Vec<_> = (1..20).filter_map(|i| stream.encode(&image(i))).collect();
            assert_eq!(later.len(), 19);
            assert!(later.iter().all(|one| !one.key));
            assert!(later.iter().all(|one| one.bytes.len() < first.bytes.len()));
            assert!(stream.encode(&[0; 7]).is_none());
        }
    }
}
