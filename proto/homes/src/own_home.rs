//! The own home of a plan, a style and a layout seed, with its places: what `wheelarm home make`
//! writes, and what a server makes for a scenario with a layout seed.
//!
//! A home takes seconds to make, therefore it is kept in the cache folder, which all processes
//! of a machine share.

use std::fmt;
use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use wheelarm_pack::{Pack, PackError};
use wheelarm_proto::cache::{self, Key, Store};

use crate::home_places::PlaceRobot;
use crate::home_report::{Posture, RobotFacts, RobotFactsError};
use crate::layout::{self, Catalog, CatalogError, LayoutError, Order};

/// Style of an own home that names none.
pub const DEFAULT_STYLE: &str = "nordic";

/// Identity of an own home. Its text PLAN-STYLE-SEED is the name of pack and scene.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct OwnHomeId {
    /// Plan, a file in `assets/homes/plans`.
    pub plan: String,
    /// Style, a file in `assets/homes/styles`.
    pub style: String,
    /// Seed of sizes, sides, order and small objects.
    pub layout_seed: u64,
}

impl fmt::Display for OwnHomeId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}-{}-{}", self.plan, self.style, self.layout_seed)
    }
}

impl OwnHomeId {
    /// The home that a scene, a style and a layout seed name. `scene` is the plan, or already
    /// the name of the home.
    #[must_use]
    pub fn of_scene(scene: &str, style: &str, layout_seed: u64) -> Self {
        let ending = format!("-{style}-{layout_seed}");
        Self {
            plan: scene.strip_suffix(&ending).unwrap_or(scene).to_owned(),
            style: style.to_owned(),
            layout_seed,
        }
    }

    /// Whether the assets have its plan.
    #[must_use]
    pub fn is_of(&self, assets: &Path) -> bool {
        assets
            .join(format!("homes/plans/{}.toml", self.plan))
            .is_file()
    }

    /// The home of the name PLAN-STYLE-SEED; `None` for another text.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        let (rest, seed) = name.rsplit_once('-')?;
        let (plan, style) = rest.rsplit_once('-')?;
        let id = Self {
            plan: plan.to_owned(),
            style: style.to_owned(),
            layout_seed: seed.parse().ok()?,
        };
        // Not for example "07", which would be a second name of one home.
        (!plan.is_empty() && !style.is_empty() && id.to_string() == name).then_some(id)
    }
}

/// An own home that cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum OwnHomeError {
    /// The layout is rejected, or the data is invalid.
    #[error(transparent)]
    Layout(Box<LayoutError>),
    /// The data of homes cannot be read, or has no such plan or style.
    #[error(transparent)]
    Catalog(#[from] CatalogError),
    /// The robot cannot be read.
    #[error(transparent)]
    Robot(#[from] RobotFactsError),
    /// The pack is invalid.
    #[error(transparent)]
    Pack(#[from] PackError),
}

impl From<LayoutError> for OwnHomeError {
    fn from(error: LayoutError) -> Self {
        Self::Layout(Box::new(error))
    }
}

/// An own home, and why it could not be kept in the cache.
#[derive(Debug)]
pub struct Made {
    /// Its pack, with places.
    pub pack: Pack,
    /// Reason of the first failed write to the cache.
    pub not_kept: Option<String>,
}

/// Makes an own home for a robot, a folder in `assets/robots`, or reads it from `cache`.
///
/// # Errors
/// [`OwnHomeError`] when a name is unknown, data is invalid, or the layout is not ready.
pub fn make(
    assets: &Path,
    id: &OwnHomeId,
    robot: &str,
    cache: &Store,
) -> Result<Made, OwnHomeError> {
    let catalog = Catalog::read(assets)?;
    let (plan, style) = (catalog.plan(&id.plan)?, catalog.style(&id.style)?);
    let key = key(assets, id, robot);
    let kept = key.and_then(|key| cache.get(&key));
    if let Some(pack) = kept.and_then(|zip| Pack::from_zip(&zip).ok()) {
        return Ok(Made {
            pack,
            not_kept: None,
        });
    }
    let read = |posture| RobotFacts::read(assets, robot, posture);
    let (drives, starts) = (read(Posture::Travel)?, read(Posture::Home)?);
    let robot = PlaceRobot {
        drives: &drives,
        starts: &starts,
    };
    let order = Order {
        catalog: &catalog,
        plan: (&id.plan, plan),
        style: (&id.style, style),
        seed: id.layout_seed,
        name: &id.to_string(),
    };
    let home = layout::make(&order, robot)?;
    let pack = layout::with_places(&home, robot)?.pack;
    let not_kept = match key {
        Some(key) => cache.put(&key, &pack.to_zip()?).err(),
        None => None,
    };
    Ok(Made { pack, not_kept })
}

/// Hash of everything that determines a home: its data, the robot, and the program. `None` when
/// a file cannot be read.
fn key(assets: &Path, id: &OwnHomeId, robot: &str) -> Option<Key> {
    let homes = assets.join("homes");
    let robots = assets.join("robots").join(robot);
    let files: [PathBuf; 5] = [
        homes.join("furniture.toml"),
        homes.join(format!("plans/{}.toml", id.plan)),
        homes.join(format!("styles/{}.toml", id.style)),
        robots.join("robot.toml"),
        robots.join("reach.bin"),
    ];
    let mut inputs = vec![id.to_string().into_bytes(), robot.as_bytes().to_vec()];
    for file in files {
        inputs.push(fs::read(file).ok()?);
    }
    // Another build may have other rules.
    let program = fs::metadata(std::env::current_exe().ok()?).ok()?;
    for number in [program.len(), program.ino()] {
        inputs.push(number.to_le_bytes().to_vec());
    }
    for number in [program.mtime(), program.mtime_nsec()] {
        inputs.push(number.to_le_bytes().to_vec());
    }
    let inputs: Vec<&[u8]> = inputs.iter().map(Vec::as_slice).collect();
    Some(cache::key("own home 1", &inputs))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assets() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets")
    }

    fn id(plan: &str) -> OwnHomeId {
        OwnHomeId {
            plan: plan.to_owned(),
            style: "nordic".to_owned(),
            layout_seed: 3,
        }
    }

    #[test]
    fn name_and_identity_are_one_to_one() {
        let home = id("row_house");
        assert_eq!(home.to_string(), "row_house-nordic-3");
        assert_eq!(
            OwnHomeId::from_name("row_house-nordic-3"),
            Some(home.clone())
        );
        for scene in ["row_house", "row_house-nordic-3"] {
            assert_eq!(OwnHomeId::of_scene(scene, "nordic", 3), home);
        }
        for name in ["home", "a-b", "studio-nordic-03", "-nordic-3", "studio--3"] {
            assert_eq!(OwnHomeId::from_name(name), None, "{name}");
        }
    }

    #[test]
    fn home_from_the_cache_equals_the_made_one() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Store::at(Some(folder.path().to_owned()), cache::LIMIT);
        let made = make(&assets(), &id("studio"), "wheelarm", &cache).unwrap();
        assert_eq!(made.not_kept, None);
        assert_eq!(cache.usage().unwrap().entries, 1);
        let kept = make(&assets(), &id("studio"), "wheelarm", &cache).unwrap();
        assert_eq!(kept.pack.id(), made.pack.id());
        assert_eq!(made.pack.id().name, "studio-nordic-3");
        assert!(!made.pack.home().unwrap().place.is_empty());
    }

    #[test]
    fn unknown_plan_and_style_are_reported_with_the_known_ones() {
        let cache = Store::at(None, 0);
        let error = |id: &OwnHomeId| {
            let made = make(&assets(), id, "wheelarm", &cache);
            made.map(|made| made.pack).unwrap_err().to_string()
        };
        assert!(error(&id("castle")).contains("family"));
        let style = OwnHomeId {
            style: "baroque".to_owned(),
            ..id("studio")
        };
        assert!(error(&style).contains("country"));
    }
}
