//! The map of names: a TOML file that assigns images and state values to the keys of an
//! observation, and columns of a reply to the columns of a row.

use rmpv::Value;
use serde::Deserialize;
use wheelarm_policy::{ActionKind, STATE};
use wheelarm_proto::v1;

use super::array::{self, Rows, at};
use crate::policy::interface::PolicyError;

/// Protocol of a server.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Protocol {
    /// openpi: only observations.
    #[default]
    Openpi,
    /// RoboArena: each message names its `endpoint` and its `session_id`, and an
    /// episode begins with a reset.
    Roboarena,
}

/// Protocol and names of a server.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NameMap {
    /// Protocol.
    #[serde(default)]
    pub protocol: Protocol,
    /// Name for reports.
    #[serde(default)]
    pub name: String,
    /// Observations and rows per second, Hz.
    pub rate_hz: f64,
    /// Most rows of a reply.
    pub chunk: u32,
    /// Rows that are executed before the next request.
    pub execute: u32,
    /// Kind of a row: `next-pose` or `next-joints`.
    pub action: String,
    /// Key of the instruction; not sent when absent.
    pub prompt: Option<String>,
    /// Key of the rows in a reply that is a map.
    #[serde(default = "actions")]
    pub answer: String,
    /// For each number of a row, its column in the reply, or -1 for 0; all in order when
    /// absent.
    pub columns: Option<Vec<i64>>,
    /// For each number of a row, its factor; 1 when absent.
    pub scale: Option<Vec<f32>>,
    /// Images.
    #[serde(default, rename = "pictures")]
    pub images: Vec<ImageMap>,
    /// Values of the state row.
    #[serde(default)]
    pub numbers: Vec<NumbersMap>,
    /// Origin of the map, for readers.
    #[serde(default)]
    pub origin: String,
    /// Licence of the map, for readers.
    #[serde(default)]
    pub license: String,
}

fn actions() -> String {
    "actions".to_owned()
}

/// An image of an observation: height x width x 3, RGB8.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImageMap {
    /// Key.
    pub key: String,
    /// Camera of the robot.
    pub camera: String,
    /// Width as rendered, pixels.
    pub width: u32,
    /// Height as rendered, pixels.
    pub height: u32,
    /// Width and height of the black canvas on which the image is centred, pixels.
    pub pad: Option<[u32; 2]>,
}

/// Values of the state row, float32.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NumbersMap {
    /// Key.
    pub key: String,
    /// Columns of the state row, from 0; all when absent.
    pub places: Option<Vec<usize>>,
}

impl NameMap {
    /// Reads a file's text.
    ///
    /// # Errors
    /// The problem, with the line.
    pub fn read(text: &str) -> Result<Self, String> {
        let map: Self = toml::from_str(text).map_err(|e| e.to_string())?;
        map.kind()?;
        for numbers in &map.numbers {
            let beyond = numbers
                .places
                .iter()
                .flatten()
                .find(|place| **place >= STATE);
            if let Some(place) = beyond {
                return Err(format!(
                    "{}: place {place} of a row of state, which has {STATE} numbers, 0 to {}",
                    numbers.key,
                    STATE - 1
                ));
            }
        }
        for image in &map.images {
            if let Some([width, height]) = image.pad
                && (width < image.width || height < image.height || width > 4096 || height > 4096)
            {
                return Err(format!(
                    "{}: an image of {}x{} does not fit into {width}x{height}; allowed is up to 4096x4096",
                    image.key, image.width, image.height
                ));
            }
        }
        let size = map.kind()?.size();
        let lengths = [
            ("columns", map.columns.as_ref().map(Vec::len)),
            ("scale", map.scale.as_ref().map(Vec::len)),
        ];
        for (what, length) in lengths {
            if let Some(length) = length.filter(|length| *length != size) {
                return Err(format!(
                    "{what}: a row of {} has {size} numbers, and the map has {length}",
                    map.action
                ));
            }
        }
        Ok(map)
    }

    fn kind(&self) -> Result<ActionKind, String> {
        match self.action.as_str() {
            "next-pose" => Ok(ActionKind::NextPose),
            "next-joints" => Ok(ActionKind::NextJoints),
            other => Err(format!(
                "action: {other:?} is not a kind; use next-pose or next-joints"
            )),
        }
    }

    pub(super) fn spec(&self, address: &str) -> v1::PolicySpec {
        let action = match self.kind() {
            Ok(ActionKind::NextJoints) => v1::PolicyAction::NextJoints,
            _ => v1::PolicyAction::NextPose,
        };
        let camera = |image: &ImageMap| v1::PolicyCamera {
            name: image.camera.clone(),
            width: image.width,
            height: image.height,
            depth: false,
        };
        let mut cameras: Vec<v1::PolicyCamera> = Vec::new();
        for image in &self.images {
            // One image may have several keys.
            if !cameras.iter().any(|known| known.name == image.camera) {
                cameras.push(camera(image));
            }
        }
        v1::PolicySpec {
            name: match self.name.is_empty() {
                true => address.to_owned(),
                false => self.name.clone(),
            },
            cameras,
            rate_hz: self.rate_hz,
            history: 1,
            chunk: self.chunk,
            execute: self.execute,
            action: action.into(),
            max_batch: 1,
            ..Default::default()
        }
    }

    /// Checks the metadata of the server against the map.
    pub(super) fn suits(&self, metadata: &Value) -> Result<(), PolicyError> {
        if self.protocol != Protocol::Roboarena {
            return Ok(());
        }
        // Image size that a RoboArena server needs, if its metadata has it.
        let wanted = at(metadata, "image_resolution").and_then(Value::as_array);
        let Some([height, width]) = wanted.map(Vec::as_slice) else {
            return Ok(());
        };
        for image in &self.images {
            let [wide, high] = image.pad.unwrap_or([image.width, image.height]);
            let same = |sent: &Value, own: u32| sent.as_u64() == Some(u64::from(own));
            if !(same(height, high) && same(width, wide)) {
                return Err(PolicyError::Unfit(format!(
                    "the server needs images of {width}x{height}, and the map has {wide}x{high} for {:?}; change `pad`",
                    image.key
                )));
            }
        }
        Ok(())
    }

    /// The first message of an episode.
    pub(super) fn reset(&self, request: &v1::PolicyResetRequest) -> Value {
        let mut entries = self.head("reset", &request.episode_key);
        if let Some(key) = &self.prompt {
            entries.push((key.as_str().into(), request.instruction.as_str().into()));
        }
        Value::Map(entries)
    }

    /// An observation as a message.
    pub(super) fn message(
        &self,
        observation: &v1::PolicyObservation,
    ) -> Result<Value, PolicyError> {
        let lacks = |what: String| PolicyError::Unfit(format!("the observation has no {what}"));
        let moment = observation.steps.last();
        let moment = moment.ok_or_else(|| lacks("moment".to_owned()))?;
        let mut entries = self.head("infer", &observation.episode_key);
        for image in &self.images {
            let received = moment.images.iter().find(|p| p.camera == image.camera);
            let received = received.ok_or_else(|| lacks(format!("image of {:?}", image.camera)))?;
            entries.push((image.key.as_str().into(), image.array(received)));
        }
        for numbers in &self.numbers {
            let state = &moment.state_values;
            let one = |place: usize| state.get(place).map(|value| *value as f32);
            let values: Option<Vec<f32>> = match &numbers.places {
                Some(places) => places.iter().map(|place| one(*place)).collect(),
                None => Some(state.iter().map(|value| *value as f32).collect()),
            };
            let values = values.ok_or_else(|| lacks(format!("numbers for {:?}", numbers.key)))?;
            entries.push((numbers.key.as_str().into(), array::floats(&values)));
        }
        if let Some(key) = &self.prompt {
            entries.push((key.as_str().into(), observation.instruction.as_str().into()));
        }
        Ok(Value::Map(entries))
    }

    fn head(&self, endpoint: &str, key: &str) -> Vec<(Value, Value)> {
        match self.protocol {
            Protocol::Openpi => Vec::new(),
            Protocol::Roboarena => vec![
                ("endpoint".into(), endpoint.into()),
                ("session_id".into(), key.into()),
            ],
        }
    }

    /// The columns that make up rows.
    pub(super) fn chosen(&self, rows: Rows) -> Result<Rows, String> {
        let mut rows = self.picked(rows)?;
        if let Some(scale) = &self.scale {
            let scales = scale.iter().cycle();
            for (value, scale) in rows.values.iter_mut().zip(scales) {
                *value *= scale;
            }
        }
        Ok(rows)
    }

    fn picked(&self, rows: Rows) -> Result<Rows, String> {
        let size = self.kind()?.size();
        let Some(columns) = &self.columns else {
            return match rows.size == size {
                true => Ok(rows),
                false => Err(format!(
                    "its rows have {} numbers, those of {} have {size}; name `columns` in the map",
                    rows.size, self.action
                )),
            };
        };
        let beyond = |column: &&i64| **column >= rows.size as i64;
        if let Some(column) = columns.iter().find(beyond) {
            return Err(format!(
                "its rows have {} numbers, and the map names column {column}",
                rows.size
            ));
        }
        let pick = |row: &[f32]| -> Vec<f32> {
            let one = |column: &i64| usize::try_from(*column).map_or(0.0, |column| row[column]);
            columns.iter().map(one).collect()
        };
        let values = rows.values.chunks_exact(rows.size.max(1)).flat_map(pick);
        Ok(Rows {
            count: rows.count,
            size,
            values: values.collect(),
        })
    }
}

impl ImageMap {
    /// The image on its black canvas, as openpi's clients pad it.
    fn array(&self, received: &v1::PolicyImage) -> Value {
        let (width, height) = (received.width as usize, received.height as usize);
        let Some([wide, high]) = self.pad.map(|sides| sides.map(|side| side as usize)) else {
            return array::bytes(&[height, width, 3], received.color.to_vec());
        };
        let (left, top) = (
            wide.saturating_sub(width) / 2,
            high.saturating_sub(height) / 2,
        );
        let mut pixels = vec![0; 3 * wide * high];
        for (row, line) in received.color.chunks_exact(3 * width.max(1)).enumerate() {
            let to = 3 * ((top + row) * wide + left);
            if let Some(place) = pixels.get_mut(to..to + line.len()) {
                place.copy_from_slice(line);
            }
        }
        array::bytes(&[high, wide, 3], pixels)
    }
}
