//! The gripper for which grasps are sampled, from its folder in `assets/robots`.

use std::path::Path;

use serde::Deserialize;

use super::error::ObjectError;
use super::source::bytes;

#[derive(Debug, Deserialize)]
struct RobotFile {
    tool_length: f64,
    gripper: GripperEntry,
}

#[derive(Debug, Deserialize)]
struct GripperEntry {
    stroke: f64,
    hand_balls: Vec<[f64; 4]>,
    crank_balls: Vec<[f64; 4]>,
    corridor: CorridorEntry,
}

#[derive(Debug, Deserialize)]
struct CorridorEntry {
    fingers: f64,
    tip: f64,
}

/// Sizes of a parallel gripper about its grasp point: x closes, z approaches, metres.
#[derive(Clone, Debug, PartialEq)]
pub struct Hand {
    /// Largest distance between the pads.
    pub stroke: f64,
    /// Reach of the tips beyond the grasp point.
    pub tip: f64,
    /// Palm, wrist and camera: middle and radius.
    pub balls: Vec<[f64; 4]>,
    /// Half height of a finger.
    pub finger: f64,
    /// Thickness of a finger across the closing direction.
    pub thickness: f64,
}

impl Hand {
    /// Reads `robots/NAME/robot.toml` below the assets folder.
    ///
    /// # Errors
    /// When it cannot be read or has no gripper.
    pub fn read(assets: &Path, robot: &str) -> Result<Self, ObjectError> {
        let path = assets.join("robots").join(robot).join("robot.toml");
        let wrong = |reason: String| ObjectError::Asset {
            path: path.display().to_string(),
            reason,
        };
        let text = bytes(&path)?;
        let file: RobotFile = toml::from_str(&String::from_utf8_lossy(&text))
            .map_err(|error| wrong(error.to_string()))?;
        let about = |[x, y, z, r]: [f64; 4]| [x, y, z - file.tool_length, r];
        let gripper = &file.gripper;
        let hand = Self {
            stroke: gripper.stroke,
            tip: gripper.corridor.tip,
            balls: gripper.hand_balls.iter().copied().map(about).collect(),
            finger: gripper.crank_balls.first().map_or(0.0, |ball| ball[3]),
            thickness: gripper.corridor.fingers - gripper.stroke / 2.0,
        };
        let lengths = [hand.stroke, hand.tip, hand.finger, hand.thickness];
        if !lengths.iter().all(|length| (0.001..0.5).contains(length)) {
            return Err(wrong(format!(
                "stroke, tip, finger and thickness are {lengths:?} m, expected 0.001 to 0.5 m"
            )));
        }
        Ok(hand)
    }

    /// Distance of the palm behind the grasp point.
    pub fn palm(&self) -> f64 {
        let ends = self.balls.iter().map(|[_, _, z, radius]| z + radius);
        -ends.fold(f64::NEG_INFINITY, f64::max)
    }

    /// Largest radius of palm and wrist.
    pub fn radius(&self) -> f64 {
        self.balls.iter().map(|ball| ball[3]).fold(0.0, f64::max)
    }
}
