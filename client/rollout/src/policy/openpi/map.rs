//! What is named how: a TOML file that says which picture and which numbers stand
//! under which key of an observation, and which columns of an answer make up a row.

use rmpv::Value;
use serde::Deserialize;
use wheelarm_policy::{ActionKind, STATE};
use wheelarm_proto::v1;

use super::array::{self, Rows, at};
use crate::policy::interface::PolicyError;

/// Which protocol a server speaks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Protocol {
    /// openpi's: observations alone.
    #[default]
    Openpi,
    /// RoboArena's: each message names its `endpoint` and its `session_id`, and an
    /// episode begins with a reset.
    Roboarena,
}

/// How a server is to be spoken to.
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
    /// Rows of an answer at most.
    pub chunk: u32,
    /// Rows that are carried out before it is asked again.
    pub execute: u32,
    /// What a row is: `next-pose` or `next-joints`.
    pub action: String,
    /// Key of the sentence; not sent without it.
    pub prompt: Option<String>,
    /// Key of the rows in an answer that is a map.
    #[serde(default = "actions")]
    pub answer: String,
    /// For each number of a row, its column in the answer, or -1 for 0; as they come
    /// without it.
    pub columns: Option<Vec<i64>>,
    /// For each number of a row, what it is multiplied by; 1 without it.
    pub scale: Option<Vec<f32>>,
    /// Pictures.
    #[serde(default)]
    pub pictures: Vec<PictureMap>,
    /// Numbers of the row of state.
    #[serde(default)]
    pub numbers: Vec<NumbersMap>,
    /// Where it is from, for people.
    #[serde(default)]
    pub origin: String,
    /// Its licence, for people.
    #[serde(default)]
    pub license: String,
}

fn actions() -> String {
    "actions".to_owned()
}

/// A picture of an observation: height, width and three colours, uint8.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PictureMap {
    /// Key.
    pub key: String,
    /// Camera of the robot.
    pub camera: String,
    /// Width as drawn, pixels.
    pub width: u32,
    /// Height as drawn, pixels.
    pub height: u32,
    /// Width and height with black around, in the middle of which it stands.
    pub pad: Option<[u32; 2]>,
}

/// Numbers of the row of state, float32.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NumbersMap {
    /// Key.
    pub key: String,
    /// Places in the row of state, from 0; all without it.
    pub places: Option<Vec<usize>>,
}

impl NameMap {
    /// Reads a file's text.
    ///
    /// # Errors
    /// In words, with the line.
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
        for picture in &map.pictures {
            if let Some([width, height]) = picture.pad
                && (width < picture.width
                    || height < picture.height
                    || width > 4096
                    || height > 4096)
            {
                return Err(format!(
                    "{}: a picture of {}x{} does not fit into {width}x{height}; allowed is up to 4096x4096",
                    picture.key, picture.width, picture.height
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
                    "{what}: a row of {} has {size} numbers, and {length} stand there",
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
                "action: {other:?} is none; there are next-pose and next-joints"
            )),
        }
    }

    pub(super) fn spec(&self, address: &str) -> v1::PolicySpec {
        let action = match self.kind() {
            Ok(ActionKind::NextJoints) => v1::PolicyAction::NextJoints,
            _ => v1::PolicyAction::NextPose,
        };
        let camera = |picture: &PictureMap| v1::PolicyCamera {
            name: picture.camera.clone(),
            width: picture.width,
            height: picture.height,
            depth: false,
        };
        let mut cameras: Vec<v1::PolicyCamera> = Vec::new();
        for picture in &self.pictures {
            // One picture may stand under several keys.
            if !cameras.iter().any(|known| known.name == picture.camera) {
                cameras.push(camera(picture));
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

    /// Holds what the server says of itself against the map.
    pub(super) fn suits(&self, metadata: &Value) -> Result<(), PolicyError> {
        if self.protocol != Protocol::Roboarena {
            return Ok(());
        }
        // What a RoboArena server wants, as far as it is told.
        let wanted = at(metadata, "image_resolution").and_then(Value::as_array);
        let Some([height, width]) = wanted.map(Vec::as_slice) else {
            return Ok(());
        };
        for picture in &self.pictures {
            let [wide, high] = picture.pad.unwrap_or([picture.width, picture.height]);
            let same = |told: &Value, own: u32| told.as_u64() == Some(u64::from(own));
            if !(same(height, high) && same(width, wide)) {
                return Err(PolicyError::Unfit(format!(
                    "the server wants pictures of {width}x{height}, and the map says {wide}x{high} for {:?}; change `pad`",
                    picture.key
                )));
            }
        }
        Ok(())
    }

    /// What an episode begins with.
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
        for picture in &self.pictures {
            let seen = moment.images.iter().find(|p| p.camera == picture.camera);
            let seen = seen.ok_or_else(|| lacks(format!("picture of {:?}", picture.camera)))?;
            entries.push((picture.key.as_str().into(), picture.array(seen)));
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

impl PictureMap {
    /// The picture with black around, as openpi's clients do it.
    fn array(&self, seen: &v1::PolicyImage) -> Value {
        let (width, height) = (seen.width as usize, seen.height as usize);
        let Some([wide, high]) = self.pad.map(|sides| sides.map(|side| side as usize)) else {
            return array::bytes(&[height, width, 3], seen.color.to_vec());
        };
        let (left, top) = (
            wide.saturating_sub(width) / 2,
            high.saturating_sub(height) / 2,
        );
        let mut pixels = vec![0; 3 * wide * high];
        for (row, line) in seen.color.chunks_exact(3 * width.max(1)).enumerate() {
            let to = 3 * ((top + row) * wide + left);
            if let Some(place) = pixels.get_mut(to..to + line.len()) {
                place.copy_from_slice(line);
            }
        }
        array::bytes(&[high, wide, 3], pixels)
    }
}
