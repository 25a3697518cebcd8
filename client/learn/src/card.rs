//! The model card: everything about a policy but its weights. It stands as JSON in
//! the metadata of the weights' file, and again beside it for people.

use serde::{Deserialize, Serialize};
use wheelarm_policy::ActionKind;

use crate::network::{Shape, ShapeError};

/// Version of the layout.
pub const FORMAT: &str = "wheelarm-policy/1";
/// The key of the card in the file's metadata.
pub const KEY: &str = "wheelarm";
/// Most pixels of a side of a picture.
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
    /// Rows of an answer.
    pub chunk: usize,
    /// Rows of an answer that are carried out before it is asked again.
    pub execute: usize,
    /// Moments that it sees; only 1 is known.
    pub history: usize,
    /// It draws random numbers.
    pub stochastic: bool,
    /// Pictures that it sees, in order.
    pub cameras: Vec<CameraCard>,
    /// How pictures become numbers.
    pub picture: PictureCard,
    /// The state.
    pub state: StateCard,
    /// The action.
    pub action: ActionCard,
    /// Words that it knows, the unknown one first; empty: it reads no sentence.
    pub vocabulary: Vec<String>,
    /// Seeds whose episodes it was trained on.
    pub training_seeds: Vec<u64>,
    /// Seeds that chose among its checkpoints.
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

/// Pictures of a camera.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CameraCard {
    /// Name of the robot's camera.
    pub name: String,
    /// Pixels.
    pub width: usize,
    /// Pixels.
    pub height: usize,
    /// Depth beside colours; only `false` is known.
    pub depth: bool,
}

/// How pictures become numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PictureCard {
    /// Of red, green, blue, 0 to 1.
    pub mean: [f32; 3],
    /// Of red, green, blue.
    pub std: [f32; 3],
    /// Sides are padded to multiples of this, pixels.
    pub multiple: usize,
    /// With what; only `edge` is known.
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
    /// Names of those that the network does not see.
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

/// What is wrong with a card.
#[derive(Debug, thiserror::Error)]
pub enum CardError {
    /// It is no card.
    #[error("the model card cannot be read: {0}")]
    Json(#[from] serde_json::Error),
    /// Of another layout.
    #[error("the model card has the format {0:?}, expected {FORMAT:?}: train or export it anew")]
    Format(String),
    /// Sizes that no network has.
    #[error(transparent)]
    Shape(#[from] ShapeError),
    /// Lists that do not fit each other, or what this program does not know.
    #[error("the model card says {0}")]
    Says(String),
}

impl Card {
    /// Reads and checks one.
    ///
    /// # Errors
    /// [`CardError`].
    pub fn parse(text: &str) -> Result<Self, CardError> {
        let told: serde_json::Value = serde_json::from_str(text)?;
        let format = told.get("format").and_then(|f| f.as_str());
        let format = format.unwrap_or_default();
        if format != FORMAT {
            return Err(CardError::Format(format.to_owned()));
        }
        let card: Self = serde_json::from_value(told)?;
        card.checked()?;
        Ok(card)
    }

    /// What its actions are.
    ///
    /// # Errors
    /// [`CardError::Says`] when nobody knows.
    pub fn action_kind(&self) -> Result<ActionKind, CardError> {
        let kind = self.action.kind.parse();
        kind.map_err(|problem: wheelarm_policy::NoKind| CardError::Says(problem.to_string()))
    }

    /// Height and width of pictures with their padding, pixels.
    #[must_use]
    pub fn padded(&self) -> [usize; 2] {
        let first = self.cameras.first();
        let sides = first.map_or([0, 0], |camera| [camera.height, camera.width]);
        sides.map(|side| side.next_multiple_of(self.picture.multiple))
    }

    fn checked(&self) -> Result<(), CardError> {
        self.network.checked()?;
        let shape = &self.network;
        let says = |words: String| Err(CardError::Says(words));
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
                return says(format!("{found} {what}, and its network has {expected}"));
            }
        }
        let numbers = [
            &self.state.mean,
            &self.state.std,
            &self.action.mean,
            &self.action.std,
        ];
        let numbers = numbers.into_iter().flatten();
        let numbers = numbers.chain(&self.picture.mean).chain(&self.picture.std);
        let deviations = self.state.std.iter().chain(&self.action.std);
        let deviations = deviations.chain(&self.picture.std);
        if !numbers.copied().all(f32::is_finite) || !deviations.copied().all(|std| std > 0.0) {
            return says("a mean or deviation that is not finite, or a deviation of 0".to_owned());
        }
        if self.chunk != shape.chunk || !(1..=self.chunk).contains(&self.execute) {
            return says(format!(
                "that {} of {} rows are carried out, and its network answers {}",
                self.execute, self.chunk, shape.chunk
            ));
        }
        let kind = self.action_kind()?;
        if kind == ActionKind::Applied || kind.size() != shape.action {
            return says(format!(
                "actions {} of {} numbers; a policy answers next-pose (12) or next-joints (9)",
                self.action.kind, shape.action
            ));
        }
        for name in &self.state.hidden {
            if !self.state.names.contains(name) {
                return says(format!(
                    "that {name:?} is hidden, and the state has no such"
                ));
            }
        }
        if self.history != 1 {
            let history = self.history;
            return says(format!(
                "a history of {history} moments; this program knows 1"
            ));
        }
        if self.picture.padding != "edge" || !(1..=1024).contains(&self.picture.multiple) {
            return says(format!(
                "padding {:?} to multiples of {}; this program knows \"edge\" to 1 to 1024",
                self.picture.padding, self.picture.multiple
            ));
        }
        let Some(first) = self.cameras.first() else {
            return says("no camera".to_owned());
        };
        for camera in &self.cameras {
            let sides = [camera.width, camera.height];
            if camera.depth || sides.iter().any(|s| !(8..=MOST_PIXELS).contains(s)) {
                return says(format!(
                    "pictures of {}x{} (depth: {}) of {:?}; this program knows colours of 8 to {MOST_PIXELS} pixels a side",
                    camera.width, camera.height, camera.depth, camera.name
                ));
            }
            if sides != [first.width, first.height] {
                return says("cameras of several sizes; all must have one".to_owned());
            }
        }
        if !(self.rate_hz.is_finite() && self.rate_hz > 0.0) {
            return says(format!("a rate of {} Hz", self.rate_hz));
        }
        Ok(())
    }
}
