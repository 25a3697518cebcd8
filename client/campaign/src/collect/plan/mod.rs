//! A campaign's plan: TOML, checked in full before anything starts.
//!
//! Every error names the file, the line and the cure. What a task is, which
//! ranges it draws from and how it is done are not said here: that lies in
//! the assets and in the operator.

mod check;
mod form;
mod parts;

use std::path::{Path, PathBuf};

use toml::Spanned;
use wheelarm_proto::installed::file_or_asset;
use wheelarm_proto::seeds::Purpose;
use wheelarm_proto::settings::{Depth, Quality};

pub use self::form::Randomise;
pub use self::parts::{Camera, PlanError, Task};

use self::check::{Check, line_of};
use self::form::PlanFile;
use crate::variation::Variation;

/// A checked plan.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// The text that it was read from; kept beside the data.
    pub text: String,
    /// Name of the dataset.
    pub name: String,
    /// Folder for the dataset, unless told otherwise on the command line.
    pub out: Option<PathBuf>,
    /// Scene below assets/scenes.
    pub scene: String,
    /// Robot below assets/robots.
    pub robot: String,
    /// Attempts at one episode, each with a fresh seed, before it is dropped.
    pub attempts: u32,
    /// How depth is stored.
    pub depth: Depth,
    /// Work per picture.
    pub quality: Quality,
    /// Licence of the dataset, as the Hugging Face hub names licences.
    pub license: String,
    /// Keeps the recordings of attempts that failed at the task.
    pub keep_failed: bool,
    /// What its episodes are for.
    pub purpose: Purpose,
    /// What differs between episodes beside what their task draws.
    pub variation: Variation,
    /// Rate of the state streams, Hz.
    pub state_rate: f64,
    /// Rate of the IMU, Hz.
    pub imu_rate: f64,
    /// Samples per simulated second that are counted; nothing is resampled.
    pub sample_rate: f64,
    /// What differs between episodes beside what the task files draw.
    pub randomise: Randomise,
    /// Cameras.
    pub cameras: Vec<Camera>,
    /// Tasks, in the order of the plan.
    pub tasks: Vec<Task>,
}

impl Plan {
    /// Reads and checks a plan.
    ///
    /// # Errors
    /// [`PlanError`] with file, line and cure.
    pub fn read(path: &Path) -> Result<Self, PlanError> {
        let path = &file_or_asset(path);
        let text = crate::text_file::read(path).map_err(|source| PlanError {
            path: path.to_owned(),
            line: None,
            what: format!(
                "cannot be read ({source}); name a plan, for example assets/campaigns/small.toml"
            ),
        })?;
        Self::parse(path, text)
    }

    /// Checks the text of a plan; `path` stands in errors.
    ///
    /// # Errors
    /// As [`Plan::read`].
    pub fn parse(path: &Path, text: String) -> Result<Self, PlanError> {
        let file: PlanFile = toml::from_str(&text).map_err(|e| PlanError {
            path: path.to_owned(),
            line: e.span().map(|span| line_of(&text, &span)),
            what: e.message().trim().to_owned(),
        })?;
        let check = Check { path, text: &text };
        let cameras = check.cameras(file.camera)?;
        let tasks = check.tasks(file.task, file.first_seed)?;
        let purpose = check.purpose(&tasks, file.purpose, *file.attempts.get_ref())?;
        let language = check.language(file.language)?;
        check.name(&file.name)?;
        check.apart(purpose, language.as_ref())?;
        check.sensors(&file.sensors, &cameras)?;
        check.that(*file.attempts.get_ref() > 0, &file.attempts, || {
            "attempts is 0; at least 1 is needed".to_owned()
        })?;
        let license = file.license.get_ref();
        let fits = |c: char| c.is_ascii_alphanumeric() || "-._+".contains(c);
        check.that(
            !license.is_empty() && license.chars().all(fits),
            &file.license,
            || {
                format!(
                    "license {license:?} is no name of a licence; write for example \"cc-by-4.0\""
                )
            },
        )?;
        if let Some(share) = &file.bear_share {
            check.that((0.0..=1.0).contains(share.get_ref()), share, || {
                format!("bear_share is {}; it is a share, 0 to 1", share.get_ref())
            })?;
        }
        for (key, share) in [
            ("start_in_view", &file.start_in_view),
            ("look_around", &file.look_around),
        ] {
            check.that((0.0..=1.0).contains(share.get_ref()), share, || {
                format!("{key} is {}; it is a share, 0 to 1", share.get_ref())
            })?;
        }
        check.rate("state_rate", &file.state_rate, 60.0)?;
        check.rate("imu_rate", &file.imu_rate, 240.0)?;
        check.rate("sample_rate", &file.sample_rate, 240.0)?;
        Ok(Self {
            name: file.name.into_inner(),
            out: file.out,
            scene: file.scene,
            robot: file.robot,
            attempts: file.attempts.into_inner(),
            depth: file.depth,
            quality: file.quality,
            license: file.license.into_inner(),
            purpose,
            keep_failed: file.keep_failed,
            variation: Variation {
                starts: file.starts,
                bear_share: file.bear_share.map(Spanned::into_inner),
                robots: file.randomise.robots,
                language,
                look: file.look,
                disturb: file.disturb,
                person: file.person,
                style: file.style,
                time_limits: file.time_limits,
                start_in_view: file.start_in_view.into_inner(),
                look_around: file.look_around.into_inner(),
                sensors: file.sensors,
            },
            state_rate: file.state_rate.into_inner(),
            imu_rate: file.imu_rate.into_inner(),
            sample_rate: file.sample_rate.into_inner(),
            randomise: file.randomise,
            cameras,
            tasks,
            text,
        })
    }

    /// Episodes of all tasks.
    #[must_use]
    pub fn episode_count(&self) -> usize {
        self.tasks.iter().map(|task| task.episodes as usize).sum()
    }

    /// Pixels of all cameras per simulated second.
    #[must_use]
    pub fn pixels_per_second(&self) -> f64 {
        self.cameras.iter().map(Camera::pixels_per_second).sum()
    }

    /// Pixels per simulated second of those cameras through which sensor models see.
    #[must_use]
    pub fn sensed_pixels_per_second(&self) -> f64 {
        let sensors = &self.variation.sensors;
        let sensed = |c: &&Camera| sensors.iter().any(|sensor| sensor.camera == c.name);
        let cameras = self.cameras.iter().filter(sensed);
        cameras.map(Camera::pixels_per_second).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheelarm_proto::settings::Named;

    const GOOD: &str = "name = \"x\"\n[[camera]]\nname = \"gen3\"\nsize = [64, 48]\n[[task]]\nname = \"pick_mustard\"\nepisodes = 2\n";

    fn parse(text: &str) -> Result<Plan, PlanError> {
        Plan::parse(Path::new("p.toml"), text.to_owned())
    }

    #[test]
    fn a_short_plan_takes_the_defaults() {
        let plan = parse(GOOD).unwrap();
        assert_eq!(plan.cameras[0].word(), "gen3=64x48@10");
        assert_eq!((plan.attempts, plan.depth.name()), (5, "f32"));
        assert_eq!((plan.episode_count(), plan.tasks[0].first_seed), (2, 0));
    }

    #[test]
    fn a_plan_has_one_purpose() {
        let of = |text: &str| parse(&GOOD.replace("name = \"x\"", text));
        let develop = of("name = \"x\"").unwrap();
        assert_eq!(develop.purpose, Purpose::Develop);
        let train = of("name = \"x\"\npurpose = \"train\"\nfirst_seed = 10000").unwrap();
        assert_eq!(train.purpose, Purpose::Train);
        for (text, words) in [
            (
                "name = \"x\"\npurpose = \"train\"",
                "p.toml:7: task \"pick_mustard\": seeds 0..2 are for develop, the plan is for train, whose seeds are 10000..1000000",
            ),
            ("name = \"x\"\nfirst_seed = 199", "below 200 for develop"),
            (
                "name = \"x\"\nfirst_seed = 18446744073709551615",
                "later attempts have seeds",
            ),
            ("name = \"x\"\npurpose = \"test\"", "policy-claim"),
        ] {
            let problem = of(text).unwrap_err().to_string();
            assert!(problem.contains(words), "{text:?}: {problem}");
        }
    }

    #[test]
    fn several_sentences_share_a_scene() {
        let text = GOOD.replace(
            "[[camera]]",
            "[language]\nseed = 40\nsentences = 3\n[[camera]]",
        );
        let plan = parse(&text.replace("episodes = 2", "episodes = 7")).unwrap();
        let language = plan.variation.language.unwrap();
        let places: Vec<_> = (0..7).map(|index| language.place(index)).collect();
        assert_eq!(
            places,
            [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2), (2, 0)]
        );
        assert_eq!(language.message(2).seed, 42);
    }

    #[test]
    fn training_sees_no_test_sentences_and_no_sensor_is_blind() {
        let told = |more: &str| {
            let text = GOOD.replace("[[camera]]", &format!("{more}\n[[camera]]"));
            parse(&text).map(|_| ()).map_err(|e| e.to_string())
        };
        let train = "purpose = \"train\"\nfirst_seed = 10000\n";
        for split in ["held_out", "any"] {
            let held_out = format!("{train}[language]\nsplit = \"{split}\"");
            assert!(told(&held_out).unwrap_err().contains("split = \"train\""));
        }
        assert_eq!(
            told(&format!("{train}[language]\nsplit = \"train\"")),
            Ok(())
        );
        assert_eq!(told("sensors = [\"kinova_vision@gen3\", \"imu\"]"), Ok(()));
        let blind = told("sensors = [\"chair_stereo@wheelchair\"]").unwrap_err();
        assert!(blind.contains("its cameras are gen3"), "{blind}");
    }

    #[test]
    fn errors_name_the_line_and_the_cure() {
        for (from, to, line, words) in [
            (
                "[[camera]]",
                "[language]\ntypos = 2.0\n[[camera]]",
                3,
                "share",
            ),
            (
                "[[camera]]",
                "[language]\nsplit = \"test\"\n[[camera]]",
                3,
                "held_out",
            ),
            (
                "[[camera]]",
                "[language]\nsentences = 0\n[[camera]]",
                3,
                "at least 1",
            ),
            ("episodes = 2", "episodes = 0", 7, "leave the task out"),
            ("size = [64, 48]", "size = [0, 48]", 4, "16 to 4096"),
            ("size = [64, 48]", "size = [64, 4097]", 4, "16 to 4096"),
            (
                "size = [64, 48]",
                "size = [64, 48]\nrate = 7",
                5,
                "does not divide 240",
            ),
            ("name = \"x\"", "name = \"a/b\"", 1, "letters, digits"),
            (
                "name = \"x\"",
                "name = \"x\"\nlook = \"*:light=4\"",
                2,
                "expected a strength of 0 (off), 1, 2 or 3",
            ),
            (
                "episodes = 2",
                "episodes = 2\ncount = 3",
                8,
                "unknown field `count`",
            ),
            (
                "name = \"x\"",
                "name = \"x\"\ndepth = \"f64\"",
                2,
                "f32, u16",
            ),
            (
                "episodes = 2",
                "episodes = 2\n[[task]]\nname = \"pick_mustard\"\nepisodes = 1",
                9,
                "twice",
            ),
        ] {
            let problem = parse(&GOOD.replace(from, to)).unwrap_err().to_string();
            let place = format!("p.toml:{line}: ");
            assert!(problem.starts_with(&place), "{to:?}: {problem}");
            assert!(problem.contains(words), "{to:?}: {problem}");
        }
        assert!(
            parse("name = \"x\"")
                .unwrap_err()
                .to_string()
                .contains("[[task]]")
        );
    }
}
