//! Compressed images for remote viewers. An image is scaled, encoded and sent on its
//! own thread, and only while a client subscribes to its level. The newest image wins,
//! and the simulation is never delayed.

use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use bytes::Bytes;
use jpeg_encoder::{ColorType, Encoder};
use parking_lot::{Condvar, Mutex};
use wheelarm_proto::preview::PreviewLevel;
use wheelarm_proto::{Message, v1};
use wheelarm_proto::{TopicId, schema};
use zenoh::Wait;
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::sample::SourceInfo;

use super::error::ServiceError;
use super::outbox::Outbox;
use super::wall_clock;
use crate::sensors::camera::Frame;

/// Share of its period by which an image may be early.
const EARLY: f64 = 0.2;

/// The preview streams of all cameras.
pub struct Previews {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

struct Shared {
    cameras: Vec<Camera>,
    waiting: Mutex<Waiting>,
    changed: Condvar,
}

/// The newest image of every camera that waits for the encoder.
struct Waiting {
    images: Vec<Option<Image>>,
    ended: bool,
}

struct Image {
    rgb: Bytes,
    width: u32,
    height: u32,
    header: v1::Header,
}

struct Camera {
    name: String,
    levels: Vec<Level>,
}

struct Level {
    level: PreviewLevel,
    publisher: Publisher<'static>,
}

impl Level {
    fn is_watched(&self) -> bool {
        let status = self.publisher.matching_status().wait();
        status.is_ok_and(|status| status.matching())
    }
}

impl Previews {
    /// Declares the streams and starts the encoder.
    ///
    /// # Errors
    /// The transport's error, or when no thread can be started.
    pub fn start(outbox: &Arc<Outbox>, names: &[String]) -> Result<Self, ServiceError> {
        let mut cameras = Vec::new();
        for name in names {
            let mut levels = Vec::new();
            for level in PreviewLevel::ALL.into_iter().chain(PreviewLevel::FLAT) {
                let publisher = outbox
                    .session()
                    .declare_publisher(outbox.keys().preview(name, level))
                    .encoding(schema::encoding(TopicId::Preview.info().message))
                    .congestion_control(CongestionControl::Drop)
                    .priority(Priority::Background)
                    .wait()?;
                levels.push(Level { level, publisher });
            }
            cameras.push(Camera {
                name: name.clone(),
                levels,
            });
        }
        let shared = Arc::new(Shared {
            waiting: Mutex::new(Waiting {
                images: names.iter().map(|_| None).collect(),
                ended: false,
            }),
            cameras,
            changed: Condvar::new(),
        });
        let thread = {
            let (shared, outbox) = (Arc::clone(&shared), Arc::clone(outbox));
            std::thread::Builder::new()
                .name("preview".to_owned())
                .spawn(move || encode(&shared, &outbox))
                .map_err(|e| ServiceError::Thread(format!("for previews: {e}")))?
        };
        Ok(Self {
            shared,
            thread: Some(thread),
        })
    }

    /// Whether a client subscribes to a camera, by its index.
    #[must_use]
    pub fn is_watched(&self, camera: usize) -> bool {
        let camera = self.shared.cameras.get(camera);
        camera.is_some_and(|c| c.levels.iter().any(Level::is_watched))
    }

    /// Queues an image if a client subscribes; returns whether one does. Never waits
    /// for the encoder.
    pub fn offer(&self, frame: &Frame, episode: u64, tick: u64) -> bool {
        if !self.is_watched(frame.camera) {
            return false;
        }
        let image = Image {
            rgb: frame.rgb.clone(),
            width: frame.intrinsics.width,
            height: frame.intrinsics.height,
            header: v1::Header {
                episode,
                tick,
                ..Default::default()
            },
        };
        if let Some(slot) = self.shared.waiting.lock().images.get_mut(frame.camera) {
            *slot = Some(image);
        }
        self.shared.changed.notify_all();
        true
    }
}

impl Drop for Previews {
    fn drop(&mut self) {
        self.shared.waiting.lock().ended = true;
        self.shared.changed.notify_all();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// When a level was last sent, and how often.
#[derive(Clone, Copy, Default)]
struct LevelStats {
    last: Option<Instant>,
    count: u64,
}

impl LevelStats {
    fn is_due(&self, level: PreviewLevel, now: Instant) -> bool {
        let (Some(last), Some(hz)) = (self.last, level.rate_hz()) else {
            return true;
        };
        now.duration_since(last) >= Duration::from_secs_f64((1.0 - EARLY) / hz)
    }
}

/// The encoder: processes the newest image of each camera in turn.
fn encode(shared: &Shared, outbox: &Outbox) {
    super::priority::step_back();
    let mut sent: Vec<Vec<LevelStats>> = shared
        .cameras
        .iter()
        .map(|c| vec![LevelStats::default(); c.levels.len()])
        .collect();
    loop {
        let images = {
            let mut waiting = shared.waiting.lock();
            shared.changed.wait_while(&mut waiting, |w| {
                !w.ended && w.images.iter().all(Option::is_none)
            });
            if waiting.ended {
                return;
            }
            waiting
                .images
                .iter_mut()
                .map(Option::take)
                .collect::<Vec<_>>()
        };
        for ((camera, sent), image) in shared.cameras.iter().zip(&mut sent).zip(images) {
            let Some(image) = image else { continue };
            for (level, sent) in camera.levels.iter().zip(sent) {
                let now = Instant::now();
                if !sent.is_due(level.level, now) || !level.is_watched() {
                    continue;
                }
                match message(&camera.name, level.level, &image, outbox, sent.count) {
                    Ok(message) => {
                        // Viewers accept images of the server's session only.
                        let number = u32::try_from(sent.count).unwrap_or(u32::MAX);
                        let source = SourceInfo::new(level.publisher.id(), number);
                        let put = level.publisher.put(message.encode_to_vec());
                        if let Err(e) = put.source_info(source).wait() {
                            tracing::warn!("cannot send a preview of {}: {e}", camera.name);
                        }
                        sent.last = Some(now);
                        sent.count += 1;
                    }
                    Err(e) => tracing::warn!("cannot encode a preview of {}: {e}", camera.name),
                }
            }
        }
    }
}

fn message(
    camera: &str,
    level: PreviewLevel,
    image: &Image,
    outbox: &Outbox,
    sequence: u64,
) -> Result<v1::PreviewFrame, String> {
    let (width, height, rgb) = scale(image, level.width());
    let side = |n: u32| u16::try_from(n).map_err(|_| format!("{width}x{height} is too large"));
    let (mut jpeg, mut i420) = (Vec::new(), Vec::new());
    let (mut width, mut height) = (width, height);
    match level.quality() {
        Some(quality) => Encoder::new(&mut jpeg, quality)
            .encode(&rgb, side(width)?, side(height)?, ColorType::Rgb)
            .map_err(|e| e.to_string())?,
        None => (width, height, i420) = planes(width, height, &rgb),
    }
    Ok(v1::PreviewFrame {
        header: Some(v1::Header {
            sequence,
            ..outbox.header(image.header.episode, image.header.tick)
        }),
        camera: camera.to_owned(),
        level: level.code().into(),
        width,
        height,
        jpeg: jpeg.into(),
        i420: i420.into(),
        sent_unix_nanos: wall_clock::unix_nanos(),
    })
}

/// An image as I420 (BT.601, 16 to 235) with even sides; an odd last row or column is
/// dropped. Returns width, height and planes.
fn planes(width: u32, height: u32, rgb: &[u8]) -> (u32, u32, Vec<u8>) {
    let row = width as usize * 3;
    let (w, h) = ((width & !1) as usize, (height & !1) as usize);
    let (pixels, quarter) = (w * h, w * h / 4);
    let mut out = vec![0; pixels + 2 * quarter];
    let (luma, colour) = out.split_at_mut(pixels);
    let (blue, red) = colour.split_at_mut(quarter);
    for (y, rows) in rgb.chunks_exact(2 * row).take(h / 2).enumerate() {
        let (upper, lower) = rows.split_at(row);
        for x in 0..w / 2 {
            let mut sums = [0_i32; 3];
            for (line, side) in [upper, lower].into_iter().enumerate() {
                for column in 0..2 {
                    let at = 2 * x + column;
                    let pixel = [0, 1, 2].map(|i| i32::from(side[3 * at + i]));
                    let [r, g, b] = pixel;
                    luma[(2 * y + line) * w + at] =
                        (16 + ((66 * r + 129 * g + 25 * b + 128) >> 8)) as u8;
                    for (sum, value) in sums.iter_mut().zip(pixel) {
                        *sum += value;
                    }
                }
            }
            let [r, g, b] = sums.map(|sum| (sum + 2) >> 2);
            let at = y * (w / 2) + x;
            blue[at] = (128 + ((112 * b - 38 * r - 74 * g + 128) >> 8)) as u8;
            red[at] = (128 + ((112 * r - 94 * g - 18 * b + 128) >> 8)) as u8;
        }
    }
    (w as u32, h as u32, out)
}

/// Scales an image down to at most `most` pixels of width: every new pixel is the mean
/// of the box that it covers.
fn scale(image: &Image, most: u32) -> (u32, u32, Bytes) {
    let (w, h) = (image.width, image.height);
    if w <= most || most == 0 {
        return (w, h, image.rgb.clone());
    }
    let (width, height) = (most, (h * most / w).max(1));
    let row = w as usize * 3;
    let edge =
        |i: u32, old: u32, new: u32| (u64::from(i) * u64::from(old) / u64::from(new)) as usize;
    let mut out = Vec::with_capacity(width as usize * height as usize * 3);
    let mut sums = vec![0_u32; row];
    for y in 0..height {
        let (top, bottom) = (edge(y, h, height), edge(y + 1, h, height));
        sums.fill(0);
        for line in image.rgb.chunks_exact(row).take(bottom).skip(top) {
            for (sum, &value) in sums.iter_mut().zip(line) {
                *sum += u32::from(value);
            }
        }
        for x in 0..width {
            let (left, right) = (edge(x, w, width), edge(x + 1, w, width));
            let count = ((right - left) * (bottom - top)).max(1) as u32;
            for channel in 0..3 {
                let sum: u32 = (left..right).map(|i| sums[3 * i + channel]).sum();
                out.push(((sum + count / 2) / count) as u8);
            }
        }
    }
    (width, height, out.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(width: u32, height: u32, value: impl Fn(u32, u32) -> [u8; 3]) -> Image {
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        Image {
            rgb: pixels.flat_map(|(x, y)| value(x, y)).collect(),
            width,
            height,
            header: v1::Header::default(),
        }
    }

    #[test]
    fn a_scaled_image_is_the_mean_of_its_boxes() {
        let (w, h, rgb) = scale(&image(4, 2, |x, _| [(x * 10) as u8, 100, 7]), 2);
        assert_eq!((w, h), (2, 1));
        assert_eq!(&rgb[..], [5, 100, 7, 25, 100, 7]);
        // A size that does not divide still covers every pixel once.
        let (w, h, rgb) = scale(&image(1000, 501, |_, _| [200, 3, 90]), 320);
        assert_eq!((w, h), (320, 160));
        assert!(rgb.chunks_exact(3).all(|p| p == [200, 3, 90]));
        let small = image(64, 48, |x, y| [x as u8, y as u8, 0]);
        assert_eq!(scale(&small, 320), (64, 48, small.rgb.clone()));
    }

    #[test]
    fn a_raw_image_has_even_sides_and_standard_colours() {
        for (colour, expected) in [
            ([255, 255, 255], [235, 128, 128]),
            ([0, 0, 0], [16, 128, 128]),
            ([255, 0, 0], [82, 90, 240]),
            ([0, 0, 255], [41, 240, 110]),
        ] {
            let image = image(5, 3, |_, _| colour);
            let (w, h, planes) = planes(5, 3, &image.rgb);
            assert_eq!((w, h, planes.len()), (4, 2, 12));
            assert!(planes[..8].iter().all(|&y| y == expected[0]), "{planes:?}");
            assert_eq!(
                planes[8..],
                [expected[1], expected[1], expected[2], expected[2]]
            );
        }
    }

    #[test]
    fn levels_keep_to_their_rates() {
        let start = Instant::now();
        for (level, camera_hz, expected) in [
            (PreviewLevel::Low, 10, 5),
            (PreviewLevel::Medium, 10, 10),
            (PreviewLevel::Medium, 30, 10),
            (PreviewLevel::High, 30, 30),
        ] {
            let (mut sent, mut count) = (LevelStats::default(), 0);
            for i in 0..10 * camera_hz {
                let now = start + Duration::from_secs_f64(f64::from(i) / f64::from(camera_hz));
                if sent.is_due(level, now) {
                    sent.last = Some(now);
                    count += 1;
                }
            }
            assert_eq!(count, 10 * expected, "{level:?} of {camera_hz} Hz");
        }
    }
}
