//! Reading an episode file: what it says of itself, the streams as arrays, the
//! messages that replay needs, the images.

mod camera;
mod chunks;
mod column;
mod error;
mod packs;
mod refusal;
mod robot;
mod samples;
mod shape;
mod states;
mod structure;
mod summary;

pub use camera::{Camera, Frame};
pub use chunks::ChunkMap;
pub use column::{ColumnMeta, ElementKind, Values};
pub use error::ReadError;
pub use robot::first_robot;
pub use samples::Samples;
pub use summary::Summary;

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use hdf5::types::VarLenUnicode;
use hdf5::{Container, Dataset, Group, H5Type, Location};
use ndarray::ArrayD;
use prost::Message;
use wheelarm_proto::{StreamId, v1};

use crate::columns::Context;
use crate::hdf::{Blob, List, read_lists};

/// An open episode file.
#[derive(Debug)]
pub struct Episode {
    file: hdf5::File,
    path: PathBuf,
    /// Names of the robot's joints and frames, cached after the first request.
    context: OnceLock<Context>,
}

impl Episode {
    /// Opens a file and checks that it is an episode.
    ///
    /// # Errors
    /// [`ReadError::Unreadable`] or [`ReadError::NoEpisode`].
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        let no_episode = |reason: String| ReadError::NoEpisode {
            path: path.to_owned(),
            reason,
        };
        let episode = Self {
            file: open_file(path)?,
            path: path.to_owned(),
            context: OnceLock::new(),
        };
        let format = text(&episode.file, "format").unwrap_or_default();
        let version = text(&episode.file, "schema_version").unwrap_or_default();
        match format.as_str() {
            "wheelarm episode" => {}
            "wheelarm aligned episode" => {
                let source = text(&episode.file, "source").unwrap_or_default();
                return Err(no_episode(format!(
                    "it is an aligned one; name the recording that it was made of, {source}"
                )));
            }
            "" => {
                return Err(no_episode(
                    "it is an HDF5 file of another program, without the attribute `format`".into(),
                ));
            }
            other => {
                return Err(no_episode(format!(
                    "its attribute `format` is {other:?}, expected \"wheelarm episode\""
                )));
            }
        }
        if version != wheelarm_proto::SCHEMA_VERSION {
            return Err(no_episode(format!(
                "its layout has version {version:?}, this program reads {:?}",
                wheelarm_proto::SCHEMA_VERSION
            )));
        }
        Ok(episode)
    }

    /// Path of the file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Names of all streams; cameras as `camera/NAME`, image sensors as
    /// `sensor/NAME`, events as `event`.
    ///
    /// # Errors
    /// When the file has no streams.
    pub fn streams(&self) -> Result<Vec<String>, ReadError> {
        let group = self.file.group("streams");
        let names = group
            .and_then(|g| g.member_names())
            .map_err(|e| self.hdf5("streams", e))?;
        let images = |name: &String| name == "camera" || name == "sensor";
        let mut out: Vec<String> = names.into_iter().filter(|n| !images(n)).collect();
        out.push(StreamId::EVENTS.to_string());
        out.extend(
            self.cameras()?
                .into_iter()
                .map(|c| StreamId::Camera(c).to_string()),
        );
        let sensors = self.sensors()?.into_iter();
        out.extend(sensors.map(|name| StreamId::Sensor(name).to_string()));
        Ok(out)
    }

    /// Names of the image sensors: sensor models of the cameras.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn sensors(&self) -> Result<Vec<String>, ReadError> {
        if !self.file.link_exists("streams/sensor") {
            return Ok(Vec::new());
        }
        let group = self.file.group("streams/sensor");
        group
            .and_then(|g| g.member_names())
            .map_err(|e| self.hdf5("streams/sensor", e))
    }

    /// Names of the cameras.
    ///
    /// # Errors
    /// When the file has no camera group.
    pub fn cameras(&self) -> Result<Vec<String>, ReadError> {
        self.file
            .group("streams/camera")
            .and_then(|g| g.member_names())
            .map_err(|e| self.hdf5("streams/camera", e))
    }

    /// The message that opened the episode.
    ///
    /// # Errors
    /// When it is absent.
    pub fn started(&self) -> Result<v1::EpisodeStarted, ReadError> {
        self.message("scenario/episode_started")
    }

    /// The message that closed the episode; `None` when it never came.
    ///
    /// # Errors
    /// When it is there but not readable.
    pub fn stopped(&self) -> Result<Option<v1::EpisodeStopped>, ReadError> {
        let path = "scenario/episode_stopped";
        if self.file.link_exists(path) {
            self.message(path).map(Some)
        } else {
            Ok(None)
        }
    }

    /// The scenario with the sampled values; every field is set.
    ///
    /// # Errors
    /// When it is absent.
    pub fn scenario(&self) -> Result<v1::Scenario, ReadError> {
        self.message("scenario/message").map(whole)
    }

    /// What replay starts from, with asset files and the legend of the ids.
    ///
    /// # Errors
    /// When it is absent.
    pub fn snapshot(&self) -> Result<v1::SnapshotReply, ReadError> {
        let group = self
            .file
            .group("initial_state")
            .map_err(|e| self.hdf5("initial_state", e))?;
        let count = |n: &str| number::<u64>(&group, n).map_err(|e| self.hdf5(n, e));
        let header = v1::Header {
            run_id: text(&group, "run_id").map_err(|e| self.hdf5("run_id", e))?,
            episode: count("episode")?,
            sequence: count("sequence")?,
            stamp_nanos: count("stamp_nanos")?,
            tick: count("tick")?,
        };
        let list = |path: &str| self.texts_at(&format!("initial_state/{path}"));
        let ids = self.raw::<u32>("initial_state/instances/id")?;
        // The first recordings lack the kind of an instance.
        let values = |column: &str| -> Vec<u32> {
            let all = self.raw(&format!("initial_state/instances/{column}"));
            all.unwrap_or_default()
        };
        let (kinds, parts) = (values("kind"), values("part"));
        let at = |all: &[u32], i: usize| -> i32 {
            let value = all.get(i).and_then(|&value| i32::try_from(value).ok());
            value.unwrap_or_default()
        };
        Ok(v1::SnapshotReply {
            header: Some(header),
            snapshot: self.raw::<u8>("initial_state/snapshot")?.into(),
            assets: list("assets/path")?
                .into_iter()
                .zip(list("assets/text")?)
                .map(|(path, text)| v1::AssetText { path, text })
                .collect(),
            instances: ids
                .into_iter()
                .zip(list("instances/name")?)
                .enumerate()
                .map(|(i, (id, name))| v1::Instance {
                    id,
                    name,
                    kind: at(&kinds, i),
                    part: at(&parts, i),
                })
                .collect(),
            packs: self.packs()?,
            furniture_urdf: self.furniture_urdf()?,
        })
    }

    /// The furniture as URDF; empty in earlier recordings.
    fn furniture_urdf(&self) -> Result<String, ReadError> {
        let path = "initial_state/furniture_urdf";
        if !self.file.link_exists(path) {
            return Ok(String::new());
        }
        let text = self.raw::<u8>(path)?;
        Ok(String::from_utf8_lossy(&text).into_owned())
    }

    /// Commands to the robot by control tick: exactly the messages that the
    /// server published.
    ///
    /// # Errors
    /// When the stream is absent.
    pub fn applied(&self) -> Result<Vec<v1::Applied>, ReadError> {
        self.messages("applied")
    }

    /// Commands as they were sent and accepted.
    ///
    /// # Errors
    /// When the stream is absent.
    pub fn commands(&self) -> Result<Vec<v1::CommandLog>, ReadError> {
        self.messages("command")
    }

    /// State hashes with their ticks.
    ///
    /// # Errors
    /// When the stream is absent.
    pub fn state_hashes(&self) -> Result<Vec<(u64, u64)>, ReadError> {
        let ticks = self.u64s("state_hash", "tick")?;
        Ok(ticks
            .into_iter()
            .zip(self.u64s("state_hash", "hash")?)
            .collect())
    }

    /// A column of 64-bit numbers, first axis = sample.
    ///
    /// # Errors
    /// When it is absent, or has another size than it must have.
    pub fn f64s(&self, stream: &str, column: &str) -> Result<ArrayD<f64>, ReadError> {
        let data = self.column(stream, column)?;
        self.check_shape(stream, column, &data)?;
        held(&data)
            .and_then(|()| data.read_dyn())
            .map_err(|e| self.hdf5(&format!("{stream}/{column}"), e))
    }

    /// A column of unsigned integers with one value per sample.
    ///
    /// # Errors
    /// When it is absent, or has another size than it must have.
    pub fn u64s(&self, stream: &str, column: &str) -> Result<Vec<u64>, ReadError> {
        self.all(stream, column)
    }

    /// A column of truth values, all axes in one list.
    ///
    /// # Errors
    /// When it is absent, or has another size than it must have.
    pub fn flags(&self, stream: &str, column: &str) -> Result<Vec<bool>, ReadError> {
        let raw: Vec<u8> = self.all(stream, column)?;
        Ok(raw.into_iter().map(|b| b != 0).collect())
    }

    /// A column of texts.
    ///
    /// # Errors
    /// When it is absent, or has another size than it must have.
    pub fn texts(&self, stream: &str, column: &str) -> Result<Vec<String>, ReadError> {
        let raw: Vec<VarLenUnicode> = self.all_lists(stream, column)?;
        Ok(raw.iter().map(|s| s.as_str().to_owned()).collect())
    }

    /// Entries of a column's named axis (attribute `names`).
    ///
    /// # Errors
    /// When it has none.
    pub fn names(&self, stream: &str, column: &str) -> Result<Vec<String>, ReadError> {
        let data = self.column(stream, column)?;
        texts(&data, "names").map_err(|e| self.hdf5("names", e))
    }

    /// Messages of a stream as they were encoded, where the file keeps them.
    ///
    /// # Errors
    /// When they cannot be read.
    pub fn encoded(&self, stream: &str) -> Result<Option<Vec<Vec<u8>>>, ReadError> {
        if self.column(stream, "message").is_err() {
            return Ok(None);
        }
        let raw: Vec<Blob> = self.all_lists(stream, "message")?;
        Ok(Some(raw.iter().map(|b| b.as_slice().to_vec()).collect()))
    }

    /// Run of the server and number of the episode in it.
    ///
    /// # Errors
    /// When the attributes are absent.
    pub fn run(&self) -> Result<(String, u64), ReadError> {
        let run = text(&self.file, "run_id").map_err(|e| self.hdf5("run_id", e))?;
        let episode = number(&self.file, "episode").map_err(|e| self.hdf5("episode", e))?;
        Ok((run, episode))
    }

    fn messages<M: Message + Default>(&self, stream: &str) -> Result<Vec<M>, ReadError> {
        let path = place(stream, "message");
        let raw: Vec<Blob> = self.all_lists(stream, "message")?;
        raw.iter()
            .map(|bytes| M::decode(bytes.as_slice()).map_err(|e| self.decode(&path, e)))
            .collect()
    }

    fn message<M: Message + Default>(&self, path: &str) -> Result<M, ReadError> {
        let raw: Vec<u8> = self.raw(path)?;
        M::decode(raw.as_slice()).map_err(|e| self.decode(path, e))
    }

    /// All elements of a column, whose size is checked.
    fn all<T: H5Type>(&self, stream: &str, column: &str) -> Result<Vec<T>, ReadError> {
        self.check_shape(stream, column, &self.column(stream, column)?)?;
        self.raw(&place(stream, column))
    }

    fn raw<T: H5Type>(&self, path: &str) -> Result<Vec<T>, ReadError> {
        self.file
            .dataset(path)
            .and_then(|d| {
                held(&d)?;
                d.read_raw()
            })
            .map_err(|e| self.hdf5(path, e))
    }

    /// All lists or texts of a column, whose size is checked.
    fn all_lists<T: List>(&self, stream: &str, column: &str) -> Result<Vec<T>, ReadError> {
        self.check_shape(stream, column, &self.column(stream, column)?)?;
        self.lists(&place(stream, column))
    }

    fn lists<T: List>(&self, path: &str) -> Result<Vec<T>, ReadError> {
        let length = std::fs::metadata(&self.path).map_or(0, |metadata| metadata.len());
        self.file
            .dataset(path)
            .and_then(|d| {
                held(&d)?;
                read_lists(&d, length)
            })
            .map_err(|e| self.hdf5(path, e))
    }

    fn texts_at(&self, path: &str) -> Result<Vec<String>, ReadError> {
        let raw: Vec<VarLenUnicode> = self.lists(path)?;
        Ok(raw.iter().map(|s| s.as_str().to_owned()).collect())
    }

    fn group(&self, stream: &str) -> Result<Group, ReadError> {
        let path = group_path(stream);
        self.file.group(&path).map_err(|e| self.hdf5(&path, e))
    }

    fn column(&self, stream: &str, column: &str) -> Result<Dataset, ReadError> {
        let path = place(stream, column);
        self.file.dataset(&path).map_err(|e| self.hdf5(&path, e))
    }

    fn hdf5(&self, what: &str, source: hdf5::Error) -> ReadError {
        ReadError::Hdf5 {
            path: self.path.clone(),
            what: what.to_owned(),
            source,
        }
    }

    fn decode(&self, what: &str, source: prost::DecodeError) -> ReadError {
        ReadError::Message {
            path: self.path.clone(),
            what: what.to_owned(),
            source,
        }
    }
}

/// A recorded scenario with every field set: the first files omitted what was
/// zero, false or empty.
fn whole(mut scenario: v1::Scenario) -> v1::Scenario {
    scenario.task.get_or_insert_default();
    scenario.seed.get_or_insert_default();
    scenario.state_rate_hz.get_or_insert_default();
    scenario.imu_rate_hz.get_or_insert_default();
    scenario.scan_rate_hz.get_or_insert_default();
    scenario.deformable_rate_hz.get_or_insert_default();
    scenario.imu_noise.get_or_insert_default();
    scenario.instruction.get_or_insert_default();
    scenario.target.get_or_insert_default();
    for camera in &mut scenario.cameras {
        camera.rate_hz.get_or_insert_default();
    }
    scenario
}

/// Opens a recording for reading. Every reader opens files here: a file whose data are
/// stored elsewhere, or that claims more memory than a recording can need, is rejected
/// before anything in it is read.
///
/// # Errors
/// [`ReadError::Unreadable`] with the cause and the fix.
pub fn open_file(path: &Path) -> Result<hdf5::File, ReadError> {
    refusal::check_path(path)?;
    let file = match hdf5::File::open(path) {
        // NFS without a lock service, Lustre, some FUSE file systems.
        Err(problem) if refusal::has_no_locks(&problem) => crate::hdf::unlocked().open(path),
        opened => opened,
    };
    let file = file.map_err(|e| refusal::refusal(path, &e))?;
    let length = std::fs::metadata(path).map_or(0, |metadata| metadata.len());
    structure::check(&file, length).map_err(|problem| refusal::untrusted(path, &problem))?;
    Ok(file)
}

/// Waits until HDF5 is in no call: it does one at a time.
pub fn wait_for_library() {
    hdf5::sync::sync(|| ());
}

fn group_path(stream: &str) -> String {
    if StreamId::parse(stream) == StreamId::EVENTS {
        "events".to_owned()
    } else {
        format!("streams/{stream}")
    }
}

fn place(stream: &str, column: &str) -> String {
    format!("{}/{column}", group_path(stream))
}

/// Deflate makes nothing more than this many times smaller.
const RATIO: u64 = 1032;

/// Refuses data that claim more than their bytes in the file can hold: a damaged
/// size would ask for more memory than there is.
fn held(data: &Container) -> hdf5::Result<()> {
    let element = data.dtype()?.size();
    let shape = data.shape();
    let claimed = shape.iter().try_fold(element, |n, &k| n.checked_mul(k));
    let stored = data.storage_size();
    let most = stored.saturating_mul(RATIO).saturating_add(4096);
    match claimed {
        Some(claimed) if claimed as u64 <= most => Ok(()),
        _ => Err(hdf5::Error::Internal(format!(
            "the file is damaged: {shape:?} elements of {element} bytes cannot come from {stored} bytes"
        ))),
    }
}

fn text(at: &Location, name: &str) -> hdf5::Result<String> {
    let value: VarLenUnicode = at.attr(name)?.read_scalar()?;
    Ok(value.as_str().to_owned())
}

fn texts(at: &Location, name: &str) -> hdf5::Result<Vec<String>> {
    let attribute = at.attr(name)?;
    held(&attribute)?;
    let list: Vec<VarLenUnicode> = attribute.read_raw()?;
    Ok(list.iter().map(|s| s.as_str().to_owned()).collect())
}

fn number<T: H5Type>(at: &Location, name: &str) -> hdf5::Result<T> {
    at.attr(name)?.read_scalar()
}
