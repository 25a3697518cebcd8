//! Publishes messages and counts them: every stream has its own sequence numbers, and
//! an episode ends with a manifest of them.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use bytes::Bytes;
use parking_lot::Mutex;
use prost::encoding::{self, WireType};
use wheelarm_proto::digest::{self, Digest, StreamDigest};
use wheelarm_proto::keys::Keys;
use wheelarm_proto::topic::{Record, Role, TOPICS, TopicInfo};
use wheelarm_proto::{CREDIT_TICKS, Message, StreamId, Topic, TopicId, schema, stamp_nanos, v1};
use zenoh::bytes::ZBytes;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::{Session, Wait};
use zenoh_ext::{AdvancedPublisher, AdvancedPublisherBuilderExt, MissDetectionConfig};

use super::cache::{Answers, Cache};
use wheelarm_proto::limits::CREDIT_IMAGES;

/// An encoded message.
fn payload(message: impl Message) -> ZBytes {
    message.encode_to_vec().into()
}

/// An encoded image. Its bytes are shared, not copied: they are megabytes.
fn image_payload(mut frame: v1::CameraFrame) -> ZBytes {
    let images = [
        (RGB, std::mem::take(&mut frame.color)),
        (DEPTH, std::mem::take(&mut frame.depth)),
        (IDS, std::mem::take(&mut frame.segmentation)),
    ];
    // In field order, as the whole message would be encoded.
    let formats = v1::CameraFrame {
        color_format: std::mem::take(&mut frame.color_format),
        depth_format: std::mem::take(&mut frame.depth_format),
        segmentation_format: std::mem::take(&mut frame.segmentation_format),
        ..v1::CameraFrame::default()
    };
    let mut payload = ZBytes::writer();
    payload.append(frame.encode_to_vec().into());
    for (field, image) in images {
        payload.append(field_start(field, &image).into());
        payload.append(image.into());
    }
    payload.append(formats.encode_to_vec().into());
    payload.finish()
}

/// An encoded image of a sensor; its bytes are shared, not copied.
fn sensor_payload(mut frame: v1::SensorFrame) -> ZBytes {
    let images = [
        (RGB, std::mem::take(&mut frame.color)),
        (DEPTH, std::mem::take(&mut frame.depth)),
    ];
    // In field order, as the whole message would be encoded.
    let rest = v1::SensorFrame {
        color_format: std::mem::take(&mut frame.color_format),
        depth_format: std::mem::take(&mut frame.depth_format),
        camera: std::mem::take(&mut frame.camera),
        exposure_nanos: std::mem::take(&mut frame.exposure_nanos),
        exposure_tick: std::mem::take(&mut frame.exposure_tick),
        ..v1::SensorFrame::default()
    };
    let mut payload = ZBytes::writer();
    payload.append(frame.encode_to_vec().into());
    for (field, image) in images.into_iter().filter(|(_, p)| !p.is_empty()) {
        payload.append(field_start(field, &image).into());
        payload.append(image.into());
    }
    payload.append(rest.encode_to_vec().into());
    payload.finish()
}

/// Field numbers of the images in `wheelarm.v1.CameraFrame` and `SensorFrame`.
const RGB: u32 = 5;
const DEPTH: u32 = 6;
const IDS: u32 = 7;

/// Field tag and length before the bytes of a field.
fn field_start(field: u32, bytes: &Bytes) -> Vec<u8> {
    let mut start = Vec::new();
    encoding::encode_key(field, WireType::LengthDelimited, &mut start);
    encoding::encode_varint(bytes.len() as u64, &mut start);
    start
}

/// Transport settings of a stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Class {
    State,
    Camera,
    Protocol,
}

impl Class {
    fn from_topic(topic: &TopicInfo) -> Self {
        match topic.record {
            Record::Columns | Record::Events => Self::State,
            Record::Images => Self::Camera,
            Record::Unspecified => Self::Protocol,
        }
    }

    /// Messages of each stream in the cache: for states, five seconds of a stream with
    /// a sample per tick.
    const fn cached(self) -> usize {
        match self {
            Self::State => 1200,
            Self::Camera => CREDIT_IMAGES as usize,
            Self::Protocol => 8,
        }
    }
}

const _: () = assert!(
    2 * CREDIT_TICKS as usize <= Class::State.cached(),
    "the cache covers a recorder's credit"
);

/// Whether a state stream is sent at once, together with waiting ones. The others of a
/// tick are sent with the clock, which is last.
fn is_express(topic: &TopicInfo) -> bool {
    [TopicId::Applied, TopicId::Clock, TopicId::Event]
        .iter()
        .any(|express| express.info() == topic)
}

#[derive(Clone, Copy, Debug, Default)]
struct Counter {
    next: u64,
    episode: u64,
    first: u64,
    count: u64,
}

struct Stream {
    /// Used by [`Outbox::publish`] only, so that the transport's numbers equal those of
    /// the headers.
    publisher: AdvancedPublisher<'static>,
    cache: Cache,
    counter: Counter,
    /// Digest of the messages of the counter's episode.
    digest: StreamDigest,
}

/// A published message.
#[derive(Clone, Copy, Debug, Default)]
pub struct Published {
    /// Its sequence number.
    pub sequence: u64,
    /// Its digest, computed during episodes only.
    pub digest: Option<Digest>,
}

/// Publishes all messages of a server.
pub struct Outbox {
    session: Session,
    keys: Keys,
    run_id: String,
    answers: Answers,
    /// By key.
    streams: Mutex<BTreeMap<String, Arc<Mutex<Stream>>>>,
    /// Whether the images of a camera or a sensor are received, by key.
    watched: Mutex<BTreeMap<String, Arc<AtomicBool>>>,
}

impl Outbox {
    /// An outbox for one run of one server.
    #[must_use]
    pub fn new(session: Session, keys: Keys, run_id: String) -> Self {
        Self {
            session,
            keys,
            run_id,
            answers: Answers::start(),
            streams: Mutex::default(),
            watched: Mutex::default(),
        }
    }

    /// The session, for streams without counter.
    #[must_use]
    pub fn session(&self) -> &Session {
        &self.session
    }

    /// ID of this run of the server.
    #[must_use]
    pub fn run_id(&self) -> &str {
        &self.run_id
    }

    /// The keys.
    #[must_use]
    pub fn keys(&self) -> &Keys {
        &self.keys
    }

    /// Whether a client receives the images of a camera or a sensor. Never waits for an
    /// image that is being sent.
    #[must_use]
    pub fn is_watched(&self, images: &StreamId) -> bool {
        let watched = self.watched.lock();
        watched
            .get(&self.keys.stream(images))
            .is_some_and(|watched| watched.load(Ordering::Relaxed))
    }

    /// Tracks whether a camera's images are received.
    fn watch(&self, images: &StreamId, topic: TopicId) -> zenoh::Result<()> {
        let key = self.keys.stream(images);
        let stream = self.stream(&key, topic.info())?;
        let mut all = self.watched.lock();
        if all.contains_key(&key) {
            return Ok(());
        }
        let watched = Arc::new(AtomicBool::new(false));
        let stream = stream.lock();
        let listener = {
            let watched = Arc::clone(&watched);
            stream
                .publisher
                .matching_listener()
                .callback(move |status| watched.store(status.matching(), Ordering::Relaxed))
        };
        listener.background().wait()?;
        if stream.publisher.matching_status().wait()?.matching() {
            watched.store(true, Ordering::Relaxed);
        }
        all.insert(key, watched);
        Ok(())
    }

    /// A header without sequence number, for replies.
    #[must_use]
    pub fn header(&self, episode: u64, tick: u64) -> v1::Header {
        v1::Header {
            run_id: self.run_id.clone(),
            episode,
            sequence: 0,
            stamp_nanos: stamp_nanos(tick),
            tick,
        }
    }

    /// Declares every state stream and the given cameras and sensors, so that
    /// subscribers find them before the first sample.
    ///
    /// # Errors
    /// The transport's error.
    pub fn declare(&self, cameras: &[String], sensors: &[String]) -> zenoh::Result<()> {
        for name in cameras {
            self.watch(&StreamId::camera(name), TopicId::Camera)?;
            let compressed = TopicId::CompressedCamera.info();
            self.stream(&self.keys.compressed(name), compressed)?;
        }
        for name in sensors {
            self.watch(&StreamId::sensor(name), TopicId::Sensor)?;
        }
        let own = TOPICS.iter().zip(TopicId::ALL);
        for (row, topic) in own.filter(|(row, _)| row.from == Role::Server) {
            // Previews are declared by their encoder.
            if !row.key.contains('{') {
                self.stream(&self.keys.topic(topic), row)?;
            }
        }
        Ok(())
    }

    fn stream(&self, key: &str, topic: &TopicInfo) -> zenoh::Result<Arc<Mutex<Stream>>> {
        let mut streams = self.streams.lock();
        if let Some(stream) = streams.get(key) {
            return Ok(Arc::clone(stream));
        }
        let class = Class::from_topic(topic);
        let (priority, express) = match class {
            Class::State => (Priority::InteractiveHigh, is_express(topic)),
            Class::Camera => (Priority::DataLow, false),
            Class::Protocol => (Priority::InteractiveHigh, true),
        };
        let publisher = self
            .session
            .declare_publisher(key.to_owned())
            .encoding(schema::encoding(topic.message))
            .congestion_control(CongestionControl::Drop)
            .priority(priority)
            .express(express)
            .sample_miss_detection(
                MissDetectionConfig::default().heartbeat(Duration::from_millis(500)),
            )
            .publisher_detection()
            .wait()?;
        let cache = Cache::declare(
            &self.session,
            &self.answers,
            key,
            publisher.id(),
            class.cached(),
            schema::encoding(topic.message),
        )?;
        let stream = Arc::new(Mutex::new(Stream {
            publisher,
            cache,
            counter: Counter::default(),
            digest: StreamDigest::default(),
        }));
        streams.insert(key.to_owned(), Arc::clone(&stream));
        Ok(stream)
    }

    /// Publishes a message of a topic with one key.
    pub fn put<T: Topic>(&self, episode: u64, tick: u64, message: T) {
        let key = self.keys.topic(T::TOPIC);
        self.publish(&key, episode, tick, message, payload);
    }

    /// Publishes an image.
    pub fn camera(
        &self,
        name: &str,
        episode: u64,
        tick: u64,
        message: v1::CameraFrame,
    ) -> Published {
        let key = self.keys.camera(name);
        self.publish(&key, episode, tick, message, image_payload)
    }

    /// Publishes the compressed form of the image `sequence` under its number. Every
    /// image has one, in the same order. If its thread has died, a header alone uses
    /// the number.
    pub fn compressed(
        &self,
        name: &str,
        sequence: u64,
        episode: u64,
        tick: u64,
        message: v1::CompressedCameraFrame,
    ) {
        let key = self.keys.compressed(name);
        let stamp = v1::CompressedCameraFrame::default;
        while self.next(&key).is_some_and(|next| next < sequence) {
            self.publish(&key, 0, tick, stamp(), payload);
        }
        self.publish(&key, episode, tick, message, payload);
    }

    /// Number of the next message of a stream that was declared.
    fn next(&self, key: &str) -> Option<u64> {
        let stream = self.streams.lock().get(key).map(Arc::clone)?;
        let next = stream.lock().counter.next;
        Some(next)
    }

    /// Whether a client receives the compressed images of a camera. Queries the
    /// transport itself, so that a recorder that has just become ready counts.
    #[must_use]
    pub fn wants_compressed(&self, name: &str) -> bool {
        let key = self.keys.compressed(name);
        let stream = self.streams.lock().get(&key).map(Arc::clone);
        let matching = |stream: Arc<Mutex<Stream>>| {
            let status = stream.lock().publisher.matching_status().wait();
            status.is_ok_and(|status| status.matching())
        };
        stream.is_some_and(matching)
    }

    /// Publishes a sensor's image that arrives at `tick`.
    pub fn sensor(&self, name: &str, episode: u64, tick: u64, message: v1::SensorFrame) {
        let key = self.keys.sensor(name);
        self.publish(&key, episode, tick, message, sensor_payload);
    }

    fn publish<M: Topic>(
        &self,
        key: &str,
        episode: u64,
        tick: u64,
        mut message: M,
        encode: fn(M) -> ZBytes,
    ) -> Published {
        let stream = match self.stream(key, M::TOPIC.info()) {
            Ok(stream) => stream,
            Err(e) => {
                tracing::error!("cannot publish {key}: {e}");
                return Published::default();
            }
        };
        let mut stream = stream.lock();
        let Stream {
            publisher,
            cache,
            counter,
            digest,
        } = &mut *stream;
        if counter.episode != episode {
            *counter = Counter {
                episode,
                first: counter.next,
                count: 0,
                next: counter.next,
            };
            *digest = StreamDigest::default();
        }
        let sequence = counter.next;
        counter.next += 1;
        counter.count += 1;
        message.set_header(v1::Header {
            sequence,
            ..self.header(episode, tick)
        });
        let payload = encode(message);
        let digest_of_it = (episode > 0).then(|| digest::of_message(payload.slices()));
        if let Some(of_message) = &digest_of_it {
            digest.add(of_message);
        }
        let stamp = self.session.new_timestamp();
        cache.add(sequence as u32, stamp, payload.clone());
        if let Err(e) = publisher.put(payload).timestamp(stamp).wait() {
            tracing::error!("cannot publish {key}: {e}");
        }
        Published {
            sequence,
            digest: digest_of_it,
        }
    }

    /// Message counts of every stream in `episode`, including streams without samples.
    #[must_use]
    pub fn manifest(
        &self,
        episode: u64,
        cameras: &[String],
        sensors: &[String],
    ) -> Vec<v1::StreamCount> {
        let streams = self.streams.lock();
        StreamId::all(
            cameras.iter().map(String::as_str),
            sensors.iter().map(String::as_str),
        )
        .map(|stream| {
            let of = |key: &str| {
                let (counter, digest) = streams.get(key).map_or_else(Default::default, |s| {
                    let stream = s.lock();
                    (stream.counter, stream.digest.clone())
                });
                if counter.episode == episode {
                    return (counter, digest);
                }
                let none = Counter {
                    first: counter.next,
                    next: counter.next,
                    ..Counter::default()
                };
                (none, StreamDigest::default())
            };
            let (counter, digest) = of(&self.keys.stream(&stream));
            let compressed = stream.camera_name().map(|c| of(&self.keys.compressed(c)).1);
            v1::StreamCount {
                stream: stream.to_string(),
                first: counter.first,
                last: counter.next.saturating_sub(1),
                count: counter.count,
                digest: digest.value().to_vec(),
                compressed_digest: compressed.map_or_else(Vec::new, |c| c.value().to_vec()),
            }
        })
        .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_image_without_copy_decodes_like_an_encoded_one() {
        let image = |bytes: usize, from: u8| Bytes::from(vec![from; bytes]);
        let frame = v1::CameraFrame {
            header: Some(v1::Header {
                sequence: 7,
                ..Default::default()
            }),
            camera: "gen3".into(),
            intrinsics: Some(v1::Intrinsics {
                width: 20,
                height: 10,
                ..Default::default()
            }),
            pose: Some(v1::Pose::default()),
            color: image(600, 1),
            depth: image(800, 2),
            segmentation: image(400, 3),
            color_format: v1::PixelFormat::Rgb8.into(),
            depth_format: v1::PixelFormat::DepthMetresF32.into(),
            segmentation_format: v1::PixelFormat::IdU16.into(),
        };
        let sensor = v1::SensorFrame {
            header: frame.header.clone(),
            sensor: "gen3_depth".into(),
            intrinsics: frame.intrinsics,
            pose: frame.pose,
            depth: image(400, 4),
            depth_format: v1::PixelFormat::DepthMillimetresU16.into(),
            camera: "gen3".into(),
            exposure_nanos: 12,
            exposure_tick: 3,
            ..v1::SensorFrame::default()
        };
        let payload = sensor_payload(sensor.clone());
        assert_eq!(*payload.to_bytes(), sensor.encode_to_vec());
        let payload = image_payload(frame.clone());
        assert_eq!(*payload.to_bytes(), frame.encode_to_vec());
        assert_eq!(v1::CameraFrame::decode(&*payload.to_bytes()), Ok(frame));
    }
}
