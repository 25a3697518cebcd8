//! `Scenario`: the complete specification of a simulation.

use nalgebra::Isometry3;
use wheelarm_proto::settings::{ObjectSplit, Style};
use wheelarm_proto::{CONTROL_HZ, PHYSICS_HZ, defaults, limits};

use crate::appearance::Appearance;
use crate::people::PersonSetting;
use crate::robot::ARM_JOINTS;
use crate::scene::{Placement, Resistance};
pub use crate::sensors::models::SensorSetting;
use crate::sensors::{BadRate, Schedule};
use crate::tasks::{Language, SamplingRules};

use super::disturb::Disturbances;
use super::packs::{ObjectPack, ScenePack};

pub use wheelarm_proto::settings::{Pacing, Quality, Starts};

/// One camera of a scenario.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraSetting {
    /// `gen3`, `wheelchair` or `room`.
    pub name: String,
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// Images per simulated second, Hz; divides 240; 0 is off.
    pub rate_hz: f64,
    /// Lens; `None`: from the robot's description.
    pub lens: Option<Lens>,
    /// Mount; `None`: from the robot's description.
    pub place: Option<CameraPlace>,
}

/// A pinhole lens without distortion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// Image size of these values, pixels; they scale with the images.
    pub size: [u32; 2],
    /// Focal lengths, pixels.
    pub focal: [f64; 2],
    /// Principal point, pixels from the top left corner.
    pub principal: [f64; 2],
}

/// Mount of a camera.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraPlace {
    /// One of the robot's recorded frames, or [`HOUSE`].
    pub frame: String,
    /// frame_from_optical; z forward, x right, y down.
    pub pose: Isometry3<f64>,
}

/// Frame of a fixed camera.
pub const HOUSE: &str = "house";

/// A scenario.
#[derive(Clone, Debug, PartialEq)]
pub struct Scenario {
    /// Scene below assets/scenes.
    pub scene: String,
    /// Task below assets/tasks; empty for none.
    pub task: String,
    /// Seed of every random choice.
    pub seed: u64,
    /// Robot below assets/robots.
    pub robot: String,
    /// Cameras.
    pub cameras: Vec<CameraSetting>,
    /// Rate of the state streams, Hz; divides 60.
    pub state_rate_hz: f64,
    /// Rate of the shapes of deformables, Hz; divides 60.
    pub deformable_rate_hz: f64,
    /// Rate of the IMU, Hz; divides 240.
    pub imu_rate_hz: f64,
    /// Rate of the laser scanner, Hz; divides 60.
    pub scan_rate_hz: f64,
    /// Pacing.
    pub pacing: Pacing,
    /// Image quality.
    pub quality: Quality,
    /// Adds noise to the IMU.
    pub imu_noise: bool,
    /// Placements by object name; empty: sampled from the seed.
    pub objects: Vec<(String, Placement)>,
    /// Resistance of furniture joints by name, and their initial positions, metres;
    /// missing ones are sampled.
    pub slides: Vec<(String, Resistance, f64)>,
    /// Initial world_from_wheelchair_root; `None`: sampled.
    pub start: Option<Isometry3<f64>>,
    /// Start poses that were sampled and rejected because of the person (count).
    pub rejected_starts: u32,
    /// Region of sampled starts.
    pub starts: Starts,
    /// A sampled start has the target in the field of view of a robot camera.
    pub start_in_view: bool,
    /// The scripted operator looks around before it drives.
    pub look_around: bool,
    /// Initial positions of the arm's joints, rad; `None`: sampled.
    pub arm: Option<[f64; ARM_JOINTS]>,
    /// Initial angle of the gripper's knuckle, rad; `None`: sampled.
    pub knuckle: Option<f64>,
    /// Instruction sentence; empty: one of the task's.
    pub instruction: String,
    /// Language settings for a generated sentence; `None`: one of the task's.
    pub language: Option<Language>,
    /// Target of the task; empty: the task's only target, or sampled.
    pub target: String,
    /// Robot specimen: its cameras' lenses and mounts are sampled from this seed;
    /// `None`: from the description.
    pub calibration_seed: Option<u64>,
    /// Visual randomization; `None`: as in the files.
    pub appearance: Option<Appearance>,
    /// Variant of the task's area, empty for the first; `None`: the one with the given
    /// objects, or sampled.
    pub variant: Option<String>,
    /// Probability of a variant other than the area's first, 0 to 1; `None`: the area's
    /// value.
    pub variant_share: Option<f64>,
    /// Active sensor models.
    pub sensors: Vec<SensorSetting>,
    /// Intentional disturbances of the robot.
    pub disturbances: Option<Disturbances>,
    /// The person in the chair; `None`: empty.
    pub person: Option<PersonSetting>,
    /// Motion style of the scripted operator.
    pub style: Style,
    /// Simulated seconds after which the task fails; `None`: the task's; 0: computed
    /// from path and style.
    pub time_limit: Option<f64>,
    /// World pack of the scene.
    pub pack: ScenePack,
    /// Seed of the layout of an own home; `None` for another scene.
    pub layout_seed: Option<u64>,
    /// Style of the own home; empty for another scene.
    pub home_style: String,
    /// Further packs, whose objects are part of the stock of tasks.
    pub object_packs: Vec<ObjectPack>,
    /// Objects that tasks of every home place.
    pub object_split: ObjectSplit,
    /// Rules of sampling; `None`: those of the scene.
    pub draws: Option<SamplingRules>,
    /// Requested values that the simulation has replaced. Resampling starts from these.
    pub requested: Requested,
}

/// Requested values that a simulation has replaced.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Requested {
    /// The person before a care task added its requirements.
    pub person: Option<PersonSetting>,
    /// The time limit is computed from path and style.
    pub open_limit: bool,
    /// The rules of sampling are those of the scene.
    pub open_draws: bool,
}

/// Name of a camera setting that applies to every robot camera without its own setting.
pub const ALL_CAMERAS: &str = "*";

/// Smallest and largest mass of a deformable, kg.
pub const SOFT_MASS: (f64, f64) = (0.05, 2.0);

/// Largest width or height of an image, pixels.
pub const MAX_SIZE: u32 = *limits::IMAGE_SIDES.end();

impl Default for Scenario {
    /// The values of [`defaults`], with all robot cameras.
    fn default() -> Self {
        Self {
            scene: defaults::SCENE.to_owned(),
            task: defaults::TASK.to_owned(),
            seed: 0,
            robot: defaults::ROBOT.to_owned(),
            cameras: Self::all_cameras(),
            state_rate_hz: defaults::STATE_RATE_HZ,
            deformable_rate_hz: defaults::DEFORMABLE_RATE_HZ,
            imu_rate_hz: defaults::IMU_RATE_HZ,
            scan_rate_hz: defaults::SCAN_RATE_HZ,
            pacing: Pacing::RealTime,
            quality: Quality::Standard,
            imu_noise: false,
            objects: Vec::new(),
            slides: Vec::new(),
            start: None,
            rejected_starts: 0,
            starts: Starts::Near,
            start_in_view: false,
            look_around: false,
            arm: None,
            knuckle: None,
            instruction: String::new(),
            language: None,
            target: String::new(),
            calibration_seed: None,
            appearance: None,
            variant: None,
            variant_share: None,
            sensors: Vec::new(),
            disturbances: None,
            person: None,
            style: Style::Quick,
            time_limit: None,
            pack: ScenePack::Search,
            layout_seed: None,
            home_style: String::new(),
            object_packs: Vec::new(),
            object_split: ObjectSplit::default(),
            draws: None,
            requested: Requested::default(),
        }
    }
}

/// A scenario that cannot be simulated.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum ScenarioError {
    /// An invalid rate.
    #[error(transparent)]
    Rate(#[from] BadRate),
    /// An invalid image size.
    #[error("camera {camera:?} is {width}x{height}, expected {} to {} pixels each way", limits::IMAGE_SIDES.start(), limits::IMAGE_SIDES.end())]
    Size {
        /// The camera.
        camera: String,
        /// Pixels.
        width: u32,
        /// Pixels.
        height: u32,
    },
    /// An unknown frame of a camera's mount.
    #[error("camera {camera:?} is placed in the frame {frame:?}; the robot has {known}")]
    CameraFrame {
        /// The camera.
        camera: String,
        /// The frame.
        frame: String,
        /// Available frames.
        known: String,
    },
    /// The same camera twice.
    #[error("camera {0:?} is named twice; name each camera once")]
    Twice(String),
    /// A rate for a laser scanner that the robot does not have.
    #[error(
        "the robot {0:?} has no laser scanner; set `scan_rate_hz` to 0, or add a table [scanner] \
         to its robot.toml"
    )]
    NoScanner(String),
    /// An invalid mass of a deformable.
    #[error(
        "mass of {name:?}, which is soft, is {} kg, expected {} to {}: lighter or heavier ones do \
         not settle",
        wheelarm_proto::check::Number(*.mass), SOFT_MASS.0, SOFT_MASS.1
    )]
    SoftMass {
        /// The object.
        name: String,
        /// kg.
        mass: f64,
    },
    /// An invalid position of a robot joint.
    #[error(
        "the start sets {name} to {} rad, expected {least} to {most}",
        wheelarm_proto::check::Number(*.position)
    )]
    Joint {
        /// The joint.
        name: String,
        /// rad.
        position: f64,
        /// Lower limit, rad.
        least: f64,
        /// Upper limit, rad.
        most: f64,
    },
    /// A name that could leave the assets folder.
    #[error(
        "{what} name {:?} must be 1 to 64 letters, digits, `-` or `_`",
        wheelarm_proto::check::beginning(.name)
    )]
    Name {
        /// Scene, task or robot.
        what: &'static str,
        /// The name.
        name: String,
    },
}

/// When each sensor of a scenario is due.
#[derive(Clone, Debug, PartialEq)]
pub struct Schedules {
    /// Cameras, in the scenario's order.
    pub cameras: Vec<Schedule>,
    /// State streams.
    pub state: Schedule,
    /// Shapes of deformables.
    pub deformable: Schedule,
    /// IMU.
    pub imu: Schedule,
    /// Laser scanner.
    pub scan: Schedule,
}

impl Scenario {
    /// All cameras of any robot with the default size and rate.
    #[must_use]
    pub fn all_cameras() -> Vec<CameraSetting> {
        vec![CameraSetting {
            name: ALL_CAMERAS.to_owned(),
            size: defaults::CAMERA_SIZE,
            rate_hz: defaults::CAMERA_RATE_HZ,
            lens: None,
            place: None,
        }]
    }

    /// Clears every value that a new scene, task, robot or seed samples again.
    ///
    /// Names every field: a new one does not compile until its place is decided.
    pub fn clear_sampled(&mut self) {
        let Self {
            objects,
            slides,
            start,
            rejected_starts,
            instruction,
            language,
            target,
            variant,
            arm,
            knuckle,
            person,
            time_limit,
            draws,
            requested,
            scene: _,
            task: _,
            seed: _,
            robot: _,
            cameras: _,
            state_rate_hz: _,
            deformable_rate_hz: _,
            imu_rate_hz: _,
            scan_rate_hz: _,
            pacing: _,
            quality: _,
            imu_noise: _,
            starts: _,
            start_in_view: _,
            look_around: _,
            calibration_seed: _,
            appearance: _,
            variant_share: _,
            sensors: _,
            disturbances: _,
            style: _,
            pack: _,
            layout_seed: _,
            home_style: _,
            object_packs: _,
            object_split: _,
        } = self;
        objects.clear();
        slides.clear();
        (*start, *rejected_starts) = (None, 0);
        (*arm, *knuckle, *variant) = (None, None, None);
        instruction.clear();
        target.clear();
        if let Some(language) = language {
            language.template.clear();
            language.question.clear();
        }
        person.clone_from(&requested.person);
        if requested.open_limit {
            *time_limit = Some(0.0);
        }
        if std::mem::take(&mut requested.open_draws) {
            *draws = None;
        }
    }

    /// Whether cameras and sensors of this scenario render the same scene as those of
    /// `other`, so that they are kept over a reset. Poses are not compared.
    ///
    /// Names every field: a new one does not compile until its place is decided.
    #[must_use]
    pub fn has_images_of(&self, other: &Self) -> bool {
        let Self {
            scene,
            task,
            seed,
            robot,
            cameras,
            quality,
            appearance,
            sensors,
            person,
            state_rate_hz: _,
            deformable_rate_hz: _,
            imu_rate_hz: _,
            scan_rate_hz: _,
            pacing: _,
            imu_noise: _,
            objects: _,
            slides: _,
            start: _,
            rejected_starts: _,
            starts: _,
            start_in_view: _,
            look_around: _,
            arm: _,
            knuckle: _,
            instruction: _,
            language: _,
            target: _,
            calibration_seed: _,
            variant: _,
            variant_share: _,
            disturbances: _,
            style: _,
            time_limit: _,
            draws: _,
            requested: _,
            pack,
            // The pack has both.
            layout_seed: _,
            home_style: _,
            object_packs,
            object_split,
        } = self;
        let sampled =
            |person: &Option<PersonSetting>| person.as_ref().and_then(|p| p.drawn.clone());
        *cameras == other.cameras
            && *sensors == other.sensors
            // Their noise is sampled from the seed.
            && (sensors.is_empty() || *seed == other.seed)
            && *scene == other.scene
            && *pack == other.pack
            && *object_packs == other.object_packs
            && *object_split == other.object_split
            && *robot == other.robot
            && *task == other.task
            && *quality == other.quality
            && *appearance == other.appearance
            && sampled(person) == sampled(&other.person)
    }

    /// Replaces [`ALL_CAMERAS`] by the robot's cameras.
    pub(super) fn name_cameras<'a>(&mut self, robot: impl Iterator<Item = &'a str>) {
        let Some(at) = self.cameras.iter().position(|c| c.name == ALL_CAMERAS) else {
            return;
        };
        let all = self.cameras.remove(at);
        let mut named: Vec<CameraSetting> = robot
            .filter(|name| self.cameras.iter().all(|camera| camera.name != *name))
            .map(|name| CameraSetting {
                name: name.to_owned(),
                ..all.clone()
            })
            .collect();
        named.extend(self.cameras.split_off(at));
        self.cameras.extend(named);
    }

    /// Checks names, rates and sizes and returns the schedules.
    ///
    /// # Errors
    /// [`ScenarioError`] that names the field and the allowed values.
    pub fn schedules(&self) -> Result<Schedules, ScenarioError> {
        for (what, name, optional) in [
            ("scene", &self.scene, false),
            ("task", &self.task, true),
            ("robot", &self.robot, false),
        ] {
            let empty_is_fine = optional && name.is_empty();
            if !empty_is_fine && wheelarm_proto::keys::check_name(name).is_err() {
                return Err(ScenarioError::Name {
                    what,
                    name: name.clone(),
                });
            }
        }
        let mut cameras = Vec::new();
        for (i, camera) in self.cameras.iter().enumerate() {
            if self.cameras[..i].iter().any(|c| c.name == camera.name) {
                return Err(ScenarioError::Twice(camera.name.clone()));
            }
            let [width, height] = camera.size;
            let sides = limits::IMAGE_SIDES;
            if !sides.contains(&width) || !sides.contains(&height) {
                return Err(ScenarioError::Size {
                    camera: camera.name.clone(),
                    width,
                    height,
                });
            }
            let what = format!("camera {}", camera.name);
            cameras.push(Schedule::new(&what, camera.rate_hz, PHYSICS_HZ)?);
        }
        Ok(Schedules {
            cameras,
            state: Schedule::new("state streams", self.state_rate_hz, CONTROL_HZ)?,
            deformable: Schedule::new("deformable", self.deformable_rate_hz, CONTROL_HZ)?,
            imu: Schedule::new("IMU", self.imu_rate_hz, PHYSICS_HZ)?,
            scan: Schedule::new("laser scanner", self.scan_rate_hz, CONTROL_HZ)?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_settling_and_wrong_deformable_masses_are_rejected() {
        let assets = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets");
        let bear = Scenario {
            task: "place_teddy_bear".into(),
            ..Scenario::default()
        };
        let set_up = |scenario: &Scenario, late| {
            let made = crate::sim::Simulation::new_within(&assets, scenario.clone(), &|| late);
            made.map(|sim| sim.scenario().clone())
                .map_err(|e| e.to_string())
        };
        let message = set_up(&bear, true).unwrap_err();
        assert!(
            message.contains("takes longer than this server allows"),
            "{message}"
        );
        let mut drawn = set_up(&bear, false).unwrap();
        let soft = |(name, _): &(String, Placement)| name.contains("teddy");
        let bear = drawn.objects.iter().position(soft).unwrap();
        for (mass, fits) in [(1e-4, false), (0.05, true), (2.0, true), (2.1, false)] {
            drawn.objects[bear].1.mass = mass;
            assert_eq!(set_up(&drawn, false).is_ok(), fits, "{mass} kg");
        }
        // A scene without deformables has nothing to settle.
        assert!(set_up(&Scenario::default(), true).is_ok());
    }

    #[test]
    fn one_setting_applies_to_all_cameras_without_their_own() {
        let mut own = Scenario::all_cameras();
        own[0].name = "b".into();
        own[0].rate_hz = 30.0;
        let mut scenario = Scenario::default();
        scenario.cameras.append(&mut own);
        scenario.name_cameras(["a", "b", "c"].into_iter());
        let named = scenario
            .cameras
            .iter()
            .map(|c| (c.name.as_str(), c.rate_hz));
        let named: Vec<_> = named.collect();
        assert_eq!(named, [("a", 10.0), ("c", 10.0), ("b", 30.0)]);
        let before = scenario.clone();
        scenario.name_cameras(["a", "d"].into_iter());
        assert_eq!(scenario, before);
    }

    #[test]
    fn errors_of_invalid_scenarios_give_the_reason() {
        assert!(Scenario::default().schedules().is_ok());
        let mut twice = Scenario::default();
        twice.cameras.extend(Scenario::all_cameras());
        let all = ALL_CAMERAS.to_owned();
        assert_eq!(twice.schedules(), Err(ScenarioError::Twice(all)));
        let mut rate = Scenario::default();
        rate.cameras[0].rate_hz = 7.0;
        assert!(
            rate.schedules()
                .unwrap_err()
                .to_string()
                .contains("divides 240")
        );
        let outside = Scenario {
            task: "../secret".into(),
            ..Scenario::default()
        };
        assert!(outside.schedules().is_err());
        let mut size = Scenario::default();
        size.cameras[0].size = [0, 720];
        assert!(size.schedules().is_err());
    }
}
