//! Publishes what leaves the server and counts it: every stream has its own
//! sequence numbers, and an episode ends with a manifest of them.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use bytes::Bytes;
use prost::encoding::{self, WireType};
use wheelarm_proto::digest::{self, StreamDigest};
use wheelarm_proto::keys::Keys;
use wheelarm_proto::{Message, names, stamp_nanos, v1};
use zenoh::bytes::ZBytes;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::{Session, Wait};
use zenoh_ext::{AdvancedPublisher, AdvancedPublisherBuilderExt, CacheConfig, MissDetectionConfig};

/// A message with a header.
pub trait Stamped: Message {
    /// Sets the header.
    fn set_header(&mut self, header: v1::Header);

    /// The encoded message.
    fn into_payload(self) -> ZBytes
    where
        Self: Sized,
    {
        self.encode_to_vec().into()
    }
}

macro_rules! stamped {
    ($($name:ident),*) => {
        $(impl Stamped for v1::$name {
            fn set_header(&mut self, header: v1::Header) { self.header = Some(header); }
        })*
    };
}
stamped!(
    JointState,
    PoseSet,
    Imu,
    Clock,
    Odometry,
    Applied,
    CommandLog,
    ObjectPoses,
    FurnitureJoints,
    Deformable,
    Contacts,
    Evaluation,
    PhaseSample,
    StateHash,
    Event,
    Refusal,
    EpisodeStarted,
    EpisodeStopped
);

impl Stamped for v1::CameraFrame {
    fn set_header(&mut self, header: v1::Header) {
        self.header = Some(header);
    }

    /// The pictures are handed over where they lie: megabytes are not copied.
    fn into_payload(mut self) -> ZBytes {
        let pictures = [
            (RGB, std::mem::take(&mut self.rgb)),
            (DEPTH, std::mem::take(&mut self.depth)),
            (IDS, std::mem::take(&mut self.ids)),
        ];
        let mut payload = ZBytes::writer();
        payload.append(self.encode_to_vec().into());
        for (field, picture) in pictures {
            payload.append(field_start(field, &picture).into());
            payload.append(picture.into());
        }
        payload.finish()
    }
}

/// Field numbers of the pictures in `wheelarm.v1.CameraFrame`.
const RGB: u32 = 5;
const DEPTH: u32 = 6;
const IDS: u32 = 7;

/// What stands before the bytes of a field.
fn field_start(field: u32, bytes: &Bytes) -> Vec<u8> {
    let mut start = Vec::new();
    encoding::encode_key(field, WireType::LengthDelimited, &mut start);
    encoding::encode_varint(bytes.len() as u64, &mut start);
    start
}

/// How a stream travels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Class {
    State,
    Camera,
    Protocol,
}

#[derive(Clone, Copy, Debug, Default)]
struct Counter {
    next: u64,
    episode: u64,
    first: u64,
    count: u64,
}

struct Stream {
    publisher: AdvancedPublisher<'static>,
    counter: Counter,
    /// What was published in the counter's episode, to the last bit.
    digest: StreamDigest,
}

/// The way out.
pub struct Outbox {
    session: Session,
    keys: Keys,
    run_id: String,
    streams: Mutex<BTreeMap<String, Arc<Mutex<Stream>>>>,
    /// Whether the pictures of a camera are received.
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
            streams: Mutex::default(),
            watched: Mutex::default(),
        }
    }

    /// The session, for streams that are not counted.
    #[must_use]
    pub fn session(&self) -> &Session {
        &self.session
    }

    /// The keys.
    #[must_use]
    pub fn keys(&self) -> &Keys {
        &self.keys
    }

    /// Whether anybody receives a camera's pictures. Never waits for a picture
    /// that is on its way out.
    #[must_use]
    pub fn is_watched(&self, camera: &str) -> bool {
        let watched = self.watched.lock().unwrap_or_else(PoisonError::into_inner);
        watched
            .get(camera)
            .is_some_and(|watched| watched.load(Ordering::Relaxed))
    }

    /// Keeps account of whether a camera's pictures are received.
    fn watch(&self, camera: &str) -> zenoh::Result<()> {
        let stream = self.stream(
            &format!("camera/{camera}"),
            self.keys.camera(camera),
            Class::Camera,
        )?;
        let mut all = self.watched.lock().unwrap_or_else(PoisonError::into_inner);
        if all.contains_key(camera) {
            return Ok(());
        }
        let watched = Arc::new(AtomicBool::new(false));
        let stream = stream.lock().unwrap_or_else(PoisonError::into_inner);
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
        all.insert(camera.to_owned(), watched);
        Ok(())
    }

    /// A header without sequence number, for answers.
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

    /// Declares every state stream and the given cameras, so that subscribers
    /// find them before the first sample.
    ///
    /// # Errors
    /// The transport's error.
    pub fn declare(&self, cameras: &[String]) -> zenoh::Result<()> {
        for name in names::STREAMS.iter().chain([&names::EVENT_STREAM]) {
            self.stream(name, self.keys.stream(name), Class::State)?;
        }
        for name in cameras {
            self.watch(name)?;
        }
        self.stream("episode/start", self.keys.episode_start(), Class::Protocol)?;
        self.stream("episode/stop", self.keys.episode_stop(), Class::Protocol)?;
        self.stream("refusal", self.keys.refusal(), Class::Protocol)?;
        Ok(())
    }

    fn stream(&self, name: &str, key: String, class: Class) -> zenoh::Result<Arc<Mutex<Stream>>> {
        let mut streams = self.streams.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(stream) = streams.get(name) {
            return Ok(Arc::clone(stream));
        }
        let (priority, express, cache) = match class {
            Class::State => (Priority::InteractiveHigh, true, 1200),
            Class::Camera => (
                Priority::DataLow,
                false,
                super::engine::CREDIT_WINDOW as usize,
            ),
            Class::Protocol => (Priority::InteractiveHigh, true, 8),
        };
        let publisher = self
            .session
            .declare_publisher(key)
            .congestion_control(CongestionControl::Drop)
            .priority(priority)
            .express(express)
            .cache(CacheConfig::default().max_samples(cache))
            .sample_miss_detection(
                MissDetectionConfig::default().heartbeat(Duration::from_millis(500)),
            )
            .publisher_detection()
            .wait()?;
        let stream = Arc::new(Mutex::new(Stream {
            publisher,
            counter: Counter::default(),
            digest: StreamDigest::default(),
        }));
        streams.insert(name.to_owned(), Arc::clone(&stream));
        Ok(stream)
    }

    /// Publishes a sample of a state stream.
    pub fn state(&self, name: &str, episode: u64, tick: u64, message: impl Stamped) {
        self.publish(
            name,
            self.keys.stream(name),
            Class::State,
            episode,
            tick,
            message,
        );
    }

    /// Publishes a picture.
    pub fn camera(&self, name: &str, episode: u64, tick: u64, message: v1::CameraFrame) {
        let key = self.keys.camera(name);
        self.publish(
            &format!("camera/{name}"),
            key,
            Class::Camera,
            episode,
            tick,
            message,
        );
    }

    /// Publishes the start of an episode.
    pub fn episode_start(&self, tick: u64, message: v1::EpisodeStarted) {
        let episode = message.header.as_ref().map_or(0, |h| h.episode);
        let key = self.keys.episode_start();
        self.publish(
            "episode/start",
            key,
            Class::Protocol,
            episode,
            tick,
            message,
        );
    }

    /// Publishes the end of an episode.
    pub fn episode_stop(&self, tick: u64, message: v1::EpisodeStopped) {
        let episode = message.header.as_ref().map_or(0, |h| h.episode);
        let key = self.keys.episode_stop();
        self.publish("episode/stop", key, Class::Protocol, episode, tick, message);
    }

    /// Publishes why a command was not taken.
    pub fn refusal(&self, episode: u64, tick: u64, message: v1::Refusal) {
        self.publish(
            "refusal",
            self.keys.refusal(),
            Class::Protocol,
            episode,
            tick,
            message,
        );
    }

    fn publish(
        &self,
        name: &str,
        key: String,
        class: Class,
        episode: u64,
        tick: u64,
        mut message: impl Stamped,
    ) {
        let stream = match self.stream(name, key, class) {
            Ok(stream) => stream,
            Err(e) => {
                tracing::error!("cannot publish {name}: {e}");
                return;
            }
        };
        let mut stream = stream.lock().unwrap_or_else(PoisonError::into_inner);
        let Stream {
            publisher,
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
        let payload = message.into_payload();
        if episode > 0 {
            digest.add(&digest::of_message(payload.slices()));
        }
        if let Err(e) = publisher.put(payload).wait() {
            tracing::error!("cannot publish {name}: {e}");
        }
    }

    /// What every stream published in `episode`, streams without samples included.
    #[must_use]
    pub fn manifest(&self, episode: u64, cameras: &[String]) -> Vec<v1::StreamCount> {
        let streams = self.streams.lock().unwrap_or_else(PoisonError::into_inner);
        let state = names::STREAMS
            .iter()
            .chain([&names::EVENT_STREAM])
            .map(|s| (*s).to_owned());
        let cameras = cameras.iter().map(|c| format!("camera/{c}"));
        state
            .chain(cameras)
            .map(|name| {
                let (counter, digest) = streams.get(&name).map_or_else(Default::default, |s| {
                    let stream = s.lock().unwrap_or_else(PoisonError::into_inner);
                    (stream.counter, stream.digest.clone())
                });
                let (counter, digest) = if counter.episode == episode {
                    (counter, digest)
                } else {
                    let none = Counter {
                        first: counter.next,
                        next: counter.next,
                        ..Counter::default()
                    };
                    (none, StreamDigest::default())
                };
                v1::StreamCount {
                    stream: name,
                    first: counter.first,
                    last: counter.next.saturating_sub(1),
                    count: counter.count,
                    digest: digest.value().to_vec(),
                }
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_that_is_not_copied_reads_like_one_that_was_encoded() {
        let picture = |bytes: usize, from: u8| Bytes::from(vec![from; bytes]);
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
            rgb: picture(600, 1),
            depth: picture(800, 2),
            ids: picture(200, 3),
        };
        let payload = frame.clone().into_payload();
        assert_eq!(v1::CameraFrame::decode(&*payload.to_bytes()), Ok(frame));
    }
}
