//! The model card: everything about a policy except its weights. It is stored as JSON in the
//! metadata of the weights' file, and in a second file beside it for readers.

use serde::{Deserialize, Serialize};
use wheelarm_policy::ActionKind;

use crate::network::{Shape, ShapeError};

/// Version of the layout.
pub const FORMAT: &str = "wheelarm-policy/1";
/// The key of the card in the file's metadata.
pub const KEY: &str = "wheelarm";
/// Largest side of an image, pixels.
const MOST_PIXELS: usize = 4096;

/// A model card.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Card {
    /// [`FORMAT`].
    pub format: String,
    /// Name, for reports and keys.
    pub name: String,
    /// Sizes of the network.
    pub network: Shape,
    /// Name of the robot that it was trained on.
    pub robot: String,
    /// Rows per second.
    pub rate_hz: f64,
    /// Rows of a chunk of actions.
    pub chunk: usize,
    /// Rows of a chunk that are executed before the next request.
    pub execute: usize,
    /// Steps of an observation; only 1 is supported.
    pub history: usize,
    /// Whether it samples random numbers.
    pub stochastic: bool,
    /// Cameras of an observation, in order.
    pub cameras: Vec<CameraCard>,
    /// Normalization of images.
    #[serde(rename = "picture")]
    pub image: ImageCard,
    /// The state.
    pub state: StateCard,
    /// The action.
    pub action: ActionCard,
    /// The vocabulary, with the unknown word first; empty: it reads no sentence.
    pub vocabulary: Vec<String>,
    /// Seeds of the training episodes.
    pub training_seeds: Vec<u64>,
    /// Seeds of the episodes that selected the checkpoint.
    pub validation_seeds: Vec<u64>,
    /// Tasks of its episodes.
    pub tasks: Vec<String>,
    /// Episodes, rows and their hash.
    pub data: serde_json::Value,
    /// Program, options and results of the training.
    pub training: serde_json::Value,
    /// Bits of the weights as stored.
    pub bits: u32,
}

/// Images of a camera.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CameraCard {
    /// Name of the robot's camera.
    pub name: String,
    /// Width, pixels.
    pub width: usize,
    /// Height, pixels.
    pub height: usize,
    /// Depth beside color; only `false` is supported.
    pub depth: bool,
}

/// Normalization of images.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ImageCard {
    /// Mean of red, green, blue, 0 to 1.
    pub mean: [f32; 3],
    /// Deviation of red, green, blue.
    pub std: [f32; 3],
    /// Sides are padded to multiples of this, pixels.
    pub multiple: usize,
    /// Kind of padding; only `edge` is supported.
    pub padding: String,
}

/// Numbers of the state.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StateCard {
    /// Names.
    pub names: Vec<String>,
    /// Mean of each.
    pub mean: Vec<f32>,
    /// Deviation of each.
    pub std: Vec<f32>,
    /// Names of the numbers that the network does not receive.
    pub hidden: Vec<String>,
}

/// Numbers of an action.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ActionCard {
    /// `next-pose` or `next-joints`.
    pub kind: String,
    /// Names.
    pub names: Vec<String>,
    /// Units.
    pub units: Vec<String>,
    /// Mean of each.
    pub mean: Vec<f32>,
    /// Deviation of each.
    pub std: Vec<f32>,
}

/// Reason why a card is rejected.
#[derive(Debug, thiserror::Error)]
pub enum CardError {
    /// The text is not a card.
    #[error("the model card cannot be read: {0}")]
    Json(#[from] serde_json::Error),
    /// Another layout.
    #[error(
        "the model card has the format {0:?}, expected {FORMAT:?}: train or export the policy again"
    )]
    Format(String),
    /// Invalid sizes.
    #[error(transparent)]
    Shape(#[from] ShapeError),
    /// Lists that do not fit each other, or a value that this program does not support.
    #[error("the model card is invalid: {0}")]
    Invalid(String),
}

impl Card {
    /// Parses and checks a card.
    ///
    /// # Errors
    /// [`CardError`].
    pub fn parse(text: &str) -> Result<Self, CardError> {
        let value: serde_json::Value = serde_json::from_str(text)?;
        let format = value.get("format").and_then(|f| f.as_str());
        let format = format.unwrap_or_default();
        if format != FORMAT {
            return Err(CardError::Format(format.to_owned()));
        }
        let card: Self = serde_json::from_value(value)?;
        card.check()?;
        Ok(card)
    }

    /// Kind of its actions.
    ///
    /// # Errors
    /// [`CardError::Invalid`] when the kind is unknown.
    pub fn action_kind(&self) -> Result<ActionKind, CardError> {
        let kind = self.action.kind.parse();
        kind.map_err(|problem: wheelarm_policy::NoKind| CardError::Invalid(problem.to_string()))
    }

    /// Height and width of images with their padding, pixels.
    #[must_use]
    pub fn padded(&self) -> [usize; 2] {
        let first = self.cameras.first();
        let sides = first.map_or([0, 0], |camera| [camera.height, camera.width]);
        sides.map(|side| side.next_multiple_of(self.image.multiple))
    }

    fn check(&self) -> Result<(), CardError> {
        self.network.check()?;
        let shape = &self.network;
        let invalid = |reason: String| Err(CardError::Invalid(reason));
        let lengths = [
            ("state.names", self.state.names.len(), shape.state),
            ("state.mean", self.state.mean.len(), shape.state),
            ("state.std", self.state.std.len(), shape.state),
            ("action.names", self.action.names.len(), shape.action),
            ("action.mean", self.action.mean.len(), shape.action),
            ("action.std", self.action.std.len(), shape.action),
            ("cameras", self.cameras.len(), shape.cameras),
            ("vocabulary", self.vocabulary.len(), shape.words),
        ];
        for (what, found, expected) in lengths {
            if found != expected {
                return invalid(format!(
                    "{found} {what}, expected {expected} as in its network"
                ));
            }
        }
        let numbers = [
            &self.state.mean,
            &self.state.std,
            &self.action.mean,
            &self.action.std,
        ];
        let numbers = numbers.into_iter().flatten();
        let numbers = numbers.chain(&self.image.mean).chain(&self.image.std);
        let deviations = self.state.std.iter().chain(&self.action.std);
        let deviations = deviations.chain(&self.image.std);
        if !numbers.copied().all(f32::is_finite) || !deviations.copied().all(|std| std > 0.0) {
            return invalid(
                "a mean or deviation that is not finite, or a deviation of 0".to_owned(),
            );
        }
        if self.chunk != shape.chunk || !(1..=self.chunk).contains(&self.execute) {
            return invalid(format!(
                "{} of {} rows are executed, and its network returns {}",
                self.execute, self.chunk, shape.chunk
            ));
        }
        let kind = self.action_kind()?;
        if kind == ActionKind::Applied || kind.size() != shape.action {
            return invalid(format!(
                "actions {} of {} numbers, expected next-pose (12) or next-joints (9)",
                self.action.kind, shape.action
            ));
        }
        for name in &self.state.hidden {
            if !self.state.names.contains(name) {
                return invalid(format!(
                    "{name:?} is hidden, but the state does not contain it"
                ));
            }
        }
        if self.history != 1 {
            let history = self.history;
            return invalid(format!("a history of {history} steps, expected 1"));
        }
        if self.image.padding != "edge" || !(1..=1024).contains(&self.image.multiple) {
            return invalid(format!(
                "padding {:?} to multiples of {}, expected \"edge\" to 1 to 1024",
                self.image.padding, self.image.multiple
            ));
        }
        let Some(first) = self.cameras.first() else {
            return invalid("no camera".to_owned());
        };
        for camera in &self.cameras {
            let sides = [camera.width, camera.height];
            if camera.depth || sides.iter().any(|s| !(8..=MOST_PIXELS).contains(s)) {
                return invalid(format!(
                    "images of {}x{} (depth: {}) of {:?}, expected color of 8 to {MOST_PIXELS} pixels a side",
                    camera.width, camera.height, camera.depth, camera.name
                ));
            }
            if sides != [first.width, first.height] {
                return invalid("cameras of several sizes, expected one size".to_owned());
            }
        }
        if !(self.rate_hz.is_finite() && self.rate_hz > 0.0) {
            return invalid(format!("a rate of {} Hz", self.rate_hz));
        }
        Ok(())
    }
}
