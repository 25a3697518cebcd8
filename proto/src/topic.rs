//! The table of topics, and the IDs of streams. Server, clients, recorder and exports
//! use the table; no other code contains the name of a stream.

use std::convert::Infallible;
use std::fmt;
use std::str::FromStr;

use prost::Message;

use crate::v1;

/// A self-contained message: its first field is its header.
pub trait Stamped: Message + Default {
    /// Its header.
    fn header(&self) -> Option<&v1::Header>;
    /// Sets its header.
    fn set_header(&mut self, header: v1::Header);
}

include!(concat!(env!("OUT_DIR"), "/stamped.rs"));

/// A published message type. One message, one topic.
pub trait Topic: Stamped {
    /// Its topic.
    const TOPIC: TopicId;
    /// Name of its topic.
    const NAME: &'static str = TOPICS[Self::TOPIC as usize].name;
}

/// How often a topic is published.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rate {
    /// At every control tick, 60 Hz.
    Control,
    /// At `Scenario.state_rate_hz`.
    State,
    /// At `Scenario.imu_rate_hz`.
    Imu,
    /// At `Scenario.deformable_rate_hz`.
    Deformable,
    /// At `CameraSetting.rate_hz` of its camera.
    Camera,
    /// At `Scenario.scan_rate_hz`.
    Scan,
    /// Once per simulated second.
    Second,
    /// When an event occurs.
    Event,
}

/// Publisher of a topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// The server.
    Server,
    /// A commander.
    Commander,
    /// A recorder.
    Recorder,
}

/// How a recorder stores a topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Record {
    /// It is not recorded.
    Unspecified,
    /// Its messages become columns below `/streams`.
    Columns,
    /// Its messages become rows of `/events`.
    Events,
    /// Its messages become images below `/streams/camera` or `/streams/sensor`.
    Images,
}

/// One row of the table of topics.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TopicInfo {
    /// Name, for example `joint_state`.
    pub name: &'static str,
    /// Key below `wheelarm/{sim}/`; a name in braces is one variable chunk.
    pub key: &'static str,
    /// Full name of its message.
    pub message: &'static str,
    /// How often it is published.
    pub rate: Rate,
    /// Units of its numbers, in the order of the fields; empty for none.
    pub unit: &'static str,
    /// Frame of its numbers; empty where there is none.
    pub frame: &'static str,
    /// Its publisher.
    pub from: Role,
    /// How a recorder stores it.
    pub record: Record,
}

include!(concat!(env!("OUT_DIR"), "/topic.rs"));

impl TopicId {
    /// Its row of the table.
    #[must_use]
    pub fn info(self) -> &'static TopicInfo {
        &TOPICS[self as usize]
    }

    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.info().name
    }

    /// The topic of that name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|topic| topic.name() == name)
    }
}

impl fmt::Display for TopicId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Prefix of a camera stream.
const CAMERA: &str = "camera/";

/// Prefix of a stream of compressed images.
const COMPRESSED: &str = "compressed/";

/// Prefix of a sensor stream.
const SENSOR: &str = "sensor/";

/// A stream: `joint_state`, `event`, `camera/gen3`, `sensor/gen3_depth`. Each is
/// counted, recorded and listed in manifests, except compressed images, which are
/// another form of their camera's. Only this module parses and formats the text.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum StreamId {
    /// A state stream or the events.
    State(TopicId),
    /// The exact images of one camera, by its name.
    Camera(String),
    /// The same images compressed, by the camera's name.
    Compressed(String),
    /// The images of a sensor model, by the sensor's name.
    Sensor(String),
    /// A stream unknown to this version.
    Other(String),
}

impl StreamId {
    /// The events.
    pub const EVENTS: Self = Self::State(TopicId::Event);

    /// The images of a camera.
    #[must_use]
    pub fn camera(name: impl Into<String>) -> Self {
        Self::Camera(name.into())
    }

    /// The compressed images of a camera.
    #[must_use]
    pub fn compressed(name: impl Into<String>) -> Self {
        Self::Compressed(name.into())
    }

    /// The images of a sensor model.
    #[must_use]
    pub fn sensor(name: impl Into<String>) -> Self {
        Self::Sensor(name.into())
    }

    /// The streams of a server of this version: state streams, events, and the given
    /// cameras and image sensors.
    pub fn all<'a>(
        cameras: impl IntoIterator<Item = &'a str>,
        sensors: impl IntoIterator<Item = &'a str>,
    ) -> impl Iterator<Item = Self> {
        let states = TopicId::STATES.into_iter().map(Self::State);
        let cameras: Vec<_> = cameras.into_iter().map(Self::camera).collect();
        let sensors: Vec<_> = sensors.into_iter().map(Self::sensor).collect();
        states.chain([Self::EVENTS]).chain(cameras).chain(sensors)
    }

    /// Parses the output of [`fmt::Display`].
    #[must_use]
    pub fn parse(text: &str) -> Self {
        let known = || TopicId::from_name(text);
        if let Some(sensor) = text.strip_prefix(SENSOR) {
            return Self::sensor(sensor);
        }
        if let Some(camera) = text.strip_prefix(COMPRESSED) {
            return Self::compressed(camera);
        }
        match text.strip_prefix(CAMERA) {
            Some(camera) => Self::camera(camera),
            None => match known().filter(|t| t.info().key.starts_with("stream/")) {
                Some(topic) => Self::State(topic),
                None => Self::Other(text.to_owned()),
            },
        }
    }

    /// Name of the camera, for a stream of exact images.
    #[must_use]
    pub fn camera_name(&self) -> Option<&str> {
        match self {
            Self::Camera(name) => Some(name),
            Self::State(_) | Self::Compressed(_) | Self::Sensor(_) | Self::Other(_) => None,
        }
    }

    /// The exact stream, for compressed images.
    #[must_use]
    pub fn of_compressed(&self) -> Option<Self> {
        match self {
            Self::Compressed(name) => Some(Self::camera(name)),
            Self::State(_) | Self::Camera(_) | Self::Sensor(_) | Self::Other(_) => None,
        }
    }

    /// The stream whose messages are counted and recorded: for compressed images that
    /// of their camera, otherwise itself.
    #[must_use]
    pub fn exact(self) -> Self {
        self.of_compressed().unwrap_or(self)
    }

    /// Name of the sensor, for images of a sensor model.
    #[must_use]
    pub fn sensor_name(&self) -> Option<&str> {
        match self {
            Self::Sensor(name) => Some(name),
            Self::State(_) | Self::Camera(_) | Self::Compressed(_) | Self::Other(_) => None,
        }
    }

    /// The topic, if this version knows it.
    #[must_use]
    pub fn topic(&self) -> Option<TopicId> {
        match self {
            Self::State(topic) => Some(*topic),
            Self::Camera(_) => Some(TopicId::Camera),
            Self::Compressed(_) => Some(TopicId::CompressedCamera),
            Self::Sensor(_) => Some(TopicId::Sensor),
            Self::Other(_) => None,
        }
    }

    /// Whether these are the exact images of a camera.
    #[must_use]
    pub fn is_camera(&self) -> bool {
        matches!(self, Self::Camera(_))
    }

    /// Whether these are images: of a camera, compressed or not, or of a sensor model.
    #[must_use]
    pub fn is_images(&self) -> bool {
        matches!(
            self,
            Self::Camera(_) | Self::Compressed(_) | Self::Sensor(_)
        )
    }
}

impl fmt::Display for StreamId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::State(topic) => f.write_str(topic.name()),
            Self::Camera(name) => write!(f, "{CAMERA}{name}"),
            Self::Compressed(name) => write!(f, "{COMPRESSED}{name}"),
            Self::Sensor(name) => write!(f, "{SENSOR}{name}"),
            Self::Other(name) => f.write_str(name),
        }
    }
}

impl FromStr for StreamId {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Self, Infallible> {
        Ok(Self::parse(text))
    }
}

impl From<TopicId> for StreamId {
    fn from(topic: TopicId) -> Self {
        Self::State(topic)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_stream_survives_a_round_trip() {
        let cameras = ["gen3", "room"];
        for stream in StreamId::all(cameras, ["gen3_depth"]) {
            assert_eq!(StreamId::parse(&stream.to_string()), stream);
            assert!(stream.topic().is_some());
        }
        let other = StreamId::parse("whistle");
        assert_eq!(other, StreamId::Other("whistle".to_owned()));
        assert_eq!(StreamId::parse("camera/gen3").camera_name(), Some("gen3"));
        let compressed = StreamId::parse("compressed/gen3");
        assert_eq!(compressed.to_string(), "compressed/gen3");
        assert_eq!(compressed.of_compressed(), Some(StreamId::camera("gen3")));
        assert_eq!(compressed.clone().exact(), StreamId::camera("gen3"));
        assert_eq!(StreamId::EVENTS.exact(), StreamId::EVENTS);
        assert!(compressed.is_images() && !compressed.is_camera());
        let sensor = StreamId::parse("sensor/gen3_depth");
        assert_eq!(sensor.sensor_name(), Some("gen3_depth"));
        assert!(sensor.is_images() && !sensor.is_camera());
        // Topics that are not streams are not parsed as one.
        assert_eq!(StreamId::parse("refusal").topic(), None);
    }

    #[test]
    fn the_table_is_in_the_order_of_the_topics() {
        for (topic, row) in TopicId::ALL.into_iter().zip(&TOPICS) {
            assert_eq!(topic.info(), row);
            assert_eq!(TopicId::from_name(row.name), Some(topic));
        }
        assert_eq!(v1::JointState::NAME, "joint_state");
        assert_eq!(v1::EpisodeStopped::TOPIC.info().key, "episode/stop");
        assert_eq!(v1::CameraFrame::TOPIC, TopicId::Camera);
        assert_eq!(TopicId::STATES.len(), 21);
    }

    #[test]
    fn a_sample_is_decoded_by_its_topic() {
        let clock = v1::Clock {
            real_time_factor: 0.5,
            ..v1::Clock::default()
        };
        let read = Sample::decode(TopicId::Clock, &clock.encode_to_vec());
        assert_eq!(read, Ok(Sample::Clock(clock)));
        let sample = read.unwrap();
        assert_eq!((sample.topic(), sample.header()), (TopicId::Clock, None));
    }
}
