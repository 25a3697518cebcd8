//! The facts of a robot that a report needs, from its folder in `assets/robots`: outlines by
//! posture, the range of its arm, and its reach map.

use std::path::{Path, PathBuf};

use serde::Deserialize;
use wheelarm_planning::arm_access::FURTHEST;
use wheelarm_planning::floor_map::{DRIVE_CLEARANCE, STOWED_CLEARANCE};
use wheelarm_planning::footprint_check::Outline;
use wheelarm_planning::reach_map::{FILE_BYTES, ReachMap, ReachMapError};
use wheelarm_proto::exact;

use crate::asset_file::{self, AssetFileError};

/// Posture of the arm while the chair drives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Posture {
    /// Stowed beside the seat.
    #[default]
    Travel,
    /// Hand forward and level.
    Home,
}

impl Posture {
    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Travel => "travel",
            Self::Home => "home",
        }
    }

    /// Least clearance with which the scripted operator drives in it, metres.
    #[must_use]
    pub fn clearance(self) -> f64 {
        match self {
            Self::Travel => STOWED_CLEARANCE,
            Self::Home => DRIVE_CLEARANCE,
        }
    }
}

impl std::str::FromStr for Posture {
    type Err = String;

    fn from_str(word: &str) -> Result<Self, String> {
        let all = [Self::Travel, Self::Home];
        let found = all.into_iter().find(|posture| posture.name() == word);
        found.ok_or_else(|| format!("unknown posture {word:?}; available: travel, home"))
    }
}

/// See the module.
#[derive(Clone, Debug)]
pub struct RobotFacts {
    /// Name.
    pub name: String,
    /// Posture of the outlines.
    pub posture: Posture,
    /// Outlines in it by height, bottom up, each with its upper end, metres.
    pub outlines: Vec<(f64, Outline)>,
    /// The same with the arm at home, from where it works.
    pub outlines_at_home: Vec<(f64, Outline)>,
    /// Least and greatest distance from the arm's base to a point that counts, on the floor
    /// plan, metres.
    pub range: [f64; 2],
    /// Where the hand gets to.
    pub reach: ReachMap,
}

/// Why the facts of a robot cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum RobotFactsError {
    /// A file cannot be read, or `robot.toml` is malformed.
    #[error(transparent)]
    File(#[from] AssetFileError),
    /// A number is invalid.
    #[error("{path}: {what} is {found}, expected {expected}")]
    Invalid {
        /// File.
        path: PathBuf,
        /// Key.
        what: String,
        /// Value.
        found: String,
        /// Allowed values.
        expected: &'static str,
    },
    /// No travel posture.
    #[error("{path} has no [travel] table; add one, or use --posture home")]
    NoTravel {
        /// File.
        path: PathBuf,
    },
    /// The reach map is malformed.
    #[error("{path}: {source}")]
    Reach {
        /// File.
        path: PathBuf,
        /// Cause.
        source: ReachMapError,
    },
}

/// The keys of `robot.toml` that count here.
#[derive(Debug, Deserialize)]
struct RobotFile {
    outline: Vec<OutlineEntry>,
    travel: Option<TravelEntry>,
    reach: ReachEntry,
}

#[derive(Debug, Deserialize)]
struct TravelEntry {
    outline: Vec<OutlineEntry>,
}

#[derive(Debug, Deserialize)]
struct OutlineEntry {
    top: f64,
    footprint: [f64; 4],
}

#[derive(Debug, Deserialize)]
struct ReachEntry {
    nearest: f64,
    furthest: f64,
}

impl RobotFacts {
    /// Reads `robots/NAME` below the assets folder.
    ///
    /// # Errors
    /// [`RobotFactsError`] with the file and the fix.
    pub fn read(assets: &Path, name: &str, posture: Posture) -> Result<Self, RobotFactsError> {
        let folder = assets.join("robots").join(name);
        let path = folder.join("robot.toml");
        let file: RobotFile = asset_file::table(&path)?;
        let travel = match (posture, file.travel) {
            (Posture::Home, _) => None,
            (Posture::Travel, Some(travel)) => Some(travel.outline),
            (Posture::Travel, None) => return Err(RobotFactsError::NoTravel { path }),
        };
        let invalid = |what: String, found: String, expected| RobotFactsError::Invalid {
            path: path.clone(),
            what,
            found,
            expected,
        };
        let outlines = |entries: &[OutlineEntry]| {
            let mut outlines: Vec<(f64, Outline)> = Vec::new();
            for (index, entry) in entries.iter().enumerate() {
                let below = outlines.last().map_or(0.0, |(top, _)| *top);
                let [back, front, right, left] = entry.footprint;
                let is_sane = entry.top > below
                    && entry.top < 5.0
                    && back < front
                    && right < left
                    && entry.footprint.iter().all(|side| side.abs() < 5.0);
                if !is_sane {
                    return Err(invalid(
                        format!("outline[{index}]"),
                        format!("top {} m, {:?} m", entry.top, entry.footprint),
                        "rising tops, x min < x max, y min < y max, within 5 m",
                    ));
                }
                let sides = entry.footprint;
                outlines.push((entry.top, Outline { sides }));
            }
            match outlines.is_empty() {
                true => Err(invalid("outline".to_owned(), "empty".to_owned(), "a table")),
                false => Ok(outlines),
            }
        };
        let outlines_at_home = outlines(&file.outline)?;
        let outlines = match travel {
            Some(travel) => outlines(&travel)?,
            None => outlines_at_home.clone(),
        };
        let range = [file.reach.nearest, file.reach.furthest.min(FURTHEST)];
        if !(range[0] > 0.0 && range[0] < range[1]) {
            let found = format!("{range:?} m");
            return Err(invalid("reach".to_owned(), found, "nearest < furthest"));
        }
        let path = folder.join("reach.bin");
        let bytes = asset_file::bytes(&path, FILE_BYTES as u64)?;
        let reach = ReachMap::from_bytes(&bytes);
        let reach = reach.map_err(|source| RobotFactsError::Reach { path, source })?;
        Ok(Self {
            name: name.to_owned(),
            posture,
            outlines,
            outlines_at_home,
            range,
            reach,
        })
    }

    /// Greatest width of the outlines, metres.
    #[must_use]
    pub fn width(&self) -> f64 {
        let widths = self.outlines.iter().map(|(_, o)| o.sides[3] - o.sides[2]);
        widths.fold(0.0, f64::max)
    }

    /// Greatest length of the outlines, metres.
    #[must_use]
    pub fn length(&self) -> f64 {
        let lengths = self.outlines.iter().map(|(_, o)| o.sides[1] - o.sides[0]);
        lengths.fold(0.0, f64::max)
    }

    /// Diameter of the circle that the chair sweeps when it turns on the spot, metres.
    #[must_use]
    pub fn turning_circle(&self) -> f64 {
        let reach = |outline: &Outline| {
            let [back, front, right, left] = outline.sides;
            let (x, y) = (front.max(-back), left.max(-right));
            exact::hypot(x, y)
        };
        let radii = self.outlines.iter().map(|(_, outline)| reach(outline));
        2.0 * radii.fold(0.0, f64::max)
    }
}
