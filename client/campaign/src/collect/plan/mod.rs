//! A campaign's plan: TOML, checked in full before anything starts.
//!
//! Every error names the file, the line and the fix. The assets define the tasks and their
//! sampling ranges; the operator defines how a task is done.

mod check;
mod form;
mod parts;

use std::path::{Path, PathBuf};

use wheelarm_proto::installed::file_or_asset;
use wheelarm_proto::seeds::Purpose;
use wheelarm_proto::settings::Depth;
use wheelarm_proto::{defaults, v1};

pub use self::parts::{PlanError, Task};

use self::check::Check;
use self::form::PlanFile;
use crate::renamed_keys::{COMMERCIAL, translated};
use crate::variation::Variation;

/// A checked plan.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// The text that it was read from; kept beside the data.
    pub text: String,
    /// Name of the dataset.
    pub name: String,
    /// Folder for the dataset; the command line overrides it.
    pub out: Option<PathBuf>,
    /// Attempts at one episode, each with a fresh seed, before it is dropped.
    pub attempts: u32,
    /// Storage of depth.
    pub depth: Depth,
    /// License of the dataset, as the Hugging Face hub names licenses.
    pub license: String,
    /// Every part of the world packs has to permit commercial use:
    /// `pack_license = "commercial"`.
    pub commercial: bool,
    /// Keeps the recordings of attempts that failed at the task.
    pub keep_failed: bool,
    /// Purpose of its episodes.
    pub purpose: Purpose,
    /// Scenarios of its episodes. The shared fields have no defaults left to the server.
    pub variation: Variation,
    /// Samples per simulated second that are counted, Hz; nothing is resampled.
    pub sample_rate_hz: f64,
    /// The operator's tempo, grasps and step sequence vary with the seed.
    pub varied_operator: bool,
    /// Former keys in the file, each with the key to write now.
    pub warnings: Vec<String>,
    /// Tasks, in the order of the plan.
    pub tasks: Vec<Task>,
}

impl Plan {
    /// Reads and checks a plan.
    ///
    /// # Errors
    /// [`PlanError`] with file, line and fix.
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

    /// Checks the text of a plan; errors name `path`.
    ///
    /// # Errors
    /// As [`Plan::read`].
    pub fn parse(path: &Path, text: String) -> Result<Self, PlanError> {
        let check = Check { path, text: &text };
        let at = |e: toml::de::Error| {
            check.at((e.span().unwrap_or(0..0), e.message().trim().to_owned()))
        };
        let (table, warnings) = translated(&text).map_err(|what| check.whole(&what))?;
        // Without former keys the text itself is parsed, so that errors have its lines.
        let file: PlanFile = match warnings.is_empty() {
            true => toml::from_str(&text).map_err(at)?,
            false => toml::from_str(&table).map_err(|e| check.whole(e.message()))?,
        };
        let varied_operator = file.variation.operator;
        let variation = file
            .variation
            .checked(file.scenario)
            .map_err(|m| check.at(m))?;
        let mut variation = Variation {
            scenario: with_defaults(variation.scenario),
            ..variation
        };
        let tasks = check.tasks(file.task, file.first_seed)?;
        let purpose = check.purpose(&tasks, file.purpose, *file.attempts.get_ref())?;
        check.name(&file.name)?;
        check.apart(purpose, variation.language.as_ref())?;
        check.worlds(purpose, &mut variation)?;
        check.sensors(&variation.scenario.sensors, &variation.scenario.cameras)?;
        check.that(*file.attempts.get_ref() > 0, &file.attempts, || {
            "attempts is 0; at least 1 is needed".to_owned()
        })?;
        let license = file.license.get_ref();
        let fits = |c: char| c.is_ascii_alphanumeric() || "-._+".contains(c);
        check.that(
            !license.is_empty() && license.chars().all(fits),
            &file.license,
            || format!("license {license:?} is not the name of a license; write for example \"cc-by-4.0\""),
        )?;
        check.that(license != COMMERCIAL, &file.license, || {
            "license = \"commercial\" is not a license; write pack_license = \"commercial\" to refuse world packs that are not for commercial use, and license for that of the dataset".to_owned()
        })?;
        if let Some(of_packs) = &file.pack_license {
            check.that(of_packs.get_ref() == COMMERCIAL, of_packs, || {
                format!(
                    "pack_license {:?} is not a use of world packs; write \"commercial\", or name the key `license` for the license of the dataset",
                    of_packs.get_ref()
                )
            })?;
        }
        check.rate("sample_rate_hz", &file.sample_rate_hz, 240.0)?;
        Ok(Self {
            name: file.name.into_inner(),
            out: file.out,
            attempts: file.attempts.into_inner(),
            depth: file.depth,
            license: file.license.into_inner(),
            commercial: file.pack_license.is_some(),
            purpose,
            keep_failed: file.keep_failed,
            variation,
            sample_rate_hz: file.sample_rate_hz.into_inner(),
            varied_operator,
            warnings,
            tasks,
            text,
        })
    }

    /// Fields that all episodes share.
    #[must_use]
    pub fn scenario(&self) -> &v1::Scenario {
        &self.variation.scenario
    }

    /// Episodes of all tasks.
    #[must_use]
    pub fn episode_count(&self) -> usize {
        self.tasks.iter().map(|task| task.episodes as usize).sum()
    }

    /// Pixels of all cameras per simulated second.
    #[must_use]
    pub fn pixels_per_second(&self) -> f64 {
        self.scenario().cameras.iter().map(pixels_per_second).sum()
    }

    /// Pixels per simulated second of cameras with a sensor model.
    #[must_use]
    pub fn sensed_pixels_per_second(&self) -> f64 {
        let scenario = self.scenario();
        let sensed = |c: &&v1::CameraSetting| scenario.sensors.iter().any(|s| s.camera == c.name);
        let cameras = scenario.cameras.iter().filter(sensed);
        cameras.map(pixels_per_second).sum()
    }
}

fn pixels_per_second(camera: &v1::CameraSetting) -> f64 {
    f64::from(camera.width)
        * f64::from(camera.height)
        * camera.rate_hz.unwrap_or(defaults::CAMERA_RATE_HZ)
}

/// The shared fields with the defaults of a campaign in place of absent ones.
fn with_defaults(mut scenario: v1::Scenario) -> v1::Scenario {
    let or = |value: &mut String, default: &str| {
        if value.is_empty() {
            default.clone_into(value);
        }
    };
    or(&mut scenario.scene, defaults::SCENE);
    or(&mut scenario.robot, defaults::ROBOT);
    for camera in &mut scenario.cameras {
        camera.rate_hz.get_or_insert(defaults::CAMERA_RATE_HZ);
    }
    scenario
        .state_rate_hz
        .get_or_insert(defaults::STATE_RATE_HZ);
    scenario.imu_rate_hz.get_or_insert(defaults::IMU_RATE_HZ);
    scenario.imu_noise.get_or_insert(false);
    if scenario.quality() == v1::RenderQuality::Unspecified {
        scenario.set_quality(v1::RenderQuality::Standard);
    }
    if scenario.starts() == v1::Starts::Unspecified {
        scenario.set_starts(v1::Starts::Near);
    }
    scenario
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheelarm_proto::settings::Named;

    const GOOD: &str = "name = \"x\"\n[[scenario.cameras]]\nname = \"gen3\"\nwidth = 64\nheight = 48\n[[task]]\nname = \"pick_mustard\"\nepisodes = 2\n";

    fn parse(text: &str) -> Result<Plan, PlanError> {
        Plan::parse(Path::new("p.toml"), text.to_owned())
    }

    #[test]
    fn short_plan_has_the_defaults() {
        let plan = parse(GOOD).unwrap();
        assert_eq!(plan.scenario().cameras[0].text(), "gen3=64x48@10");
        assert_eq!((plan.attempts, plan.depth.name()), (5, "f32"));
        assert_eq!((plan.episode_count(), plan.tasks[0].first_seed), (2, 0));
    }

    #[test]
    fn plan_has_one_purpose() {
        let of = |text: &str| parse(&GOOD.replace("name = \"x\"", text));
        let develop = of("name = \"x\"").unwrap();
        assert_eq!(develop.purpose, Purpose::Develop);
        let train = of("name = \"x\"\npurpose = \"train\"\nfirst_seed = 10000").unwrap();
        assert_eq!(train.purpose, Purpose::Train);
        for (text, words) in [
            (
                "name = \"x\"\npurpose = \"train\"",
                "p.toml:8: task \"pick_mustard\": seeds 0..2 are for develop, the plan is for train, whose seeds are 10000..1000000",
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
            "[[scenario.cameras]]",
            "[variation.language]\nseed = 40\nsentences = 3\n[[scenario.cameras]]",
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
    fn training_plan_rejects_held_out_sentences_and_unrecorded_sensor_cameras() {
        let check = |more: &str| {
            let text = GOOD.replace(
                "[[scenario.cameras]]",
                &format!("{more}\n[[scenario.cameras]]"),
            );
            parse(&text).map(|_| ()).map_err(|e| e.to_string())
        };
        let train = "purpose = \"train\"\nfirst_seed = 10000\n";
        for split in ["held_out", "any"] {
            let held_out = format!("{train}[variation.language]\nsplit = \"{split}\"");
            assert!(check(&held_out).unwrap_err().contains("split = \"train\""));
        }
        assert_eq!(
            check(&format!("{train}[variation.language]\nsplit = \"train\"")),
            Ok(())
        );
        assert_eq!(
            check("[[scenario.sensors]]\nmodel = \"kinova_vision\"\ncamera = \"gen3\""),
            Ok(())
        );
        let blind =
            check("[[scenario.sensors]]\nmodel = \"chair_stereo\"\ncamera = \"wheelchair\"")
                .unwrap_err();
        assert!(blind.contains("its cameras are gen3"), "{blind}");
    }

    #[test]
    fn training_plan_uses_no_held_out_world() {
        let check = |more: &str| {
            let text = GOOD.replace(
                "[[scenario.cameras]]",
                &format!("{more}\n[[scenario.cameras]]"),
            );
            parse(&text).map_err(|e| e.to_string())
        };
        let train = "purpose = \"train\"\nfirst_seed = 10000\n";
        let train_homes = check(&format!("{train}[variation]\nhomes = \"train\"")).unwrap();
        assert!(train_homes.variation.homes.len() > 20);
        assert_eq!(train_homes.scenario().object_split, "train");
        let tests = check("[variation]\nhomes = \"held_out\"").unwrap();
        assert_eq!(tests.scenario().object_split, "");
        for (more, words) in [
            ("[variation]\nhomes = \"held_out\"", "kept for tests"),
            (
                "[variation]\nhomes = [\"studio-nordic-1\", \"loft-nordic-1\"]",
                "loft",
            ),
            ("scenario.scene = \"studio-modern-1\"", "modern"),
            ("scenario.object_split = \"any\"", "object_split"),
        ] {
            let error = check(&format!("{train}{more}")).unwrap_err();
            assert!(error.contains(words), "{more}: {error}");
        }
        let both = "[variation]\nhomes = \"train\"\n[scenario]\nscene = \"home\"";
        assert!(check(both).unwrap_err().contains("exclude each other"));
    }

    #[test]
    fn errors_name_the_line_and_the_fix() {
        for (from, to, line, words) in [
            (
                "[[scenario.cameras]]",
                "[variation.language]\ntypos = 2.0\n[[scenario.cameras]]",
                3,
                "share",
            ),
            (
                "[[scenario.cameras]]",
                "[variation.language]\nsplit = \"test\"\n[[scenario.cameras]]",
                3,
                "held_out",
            ),
            (
                "[[scenario.cameras]]",
                "[variation.language]\nsentences = 0\n[[scenario.cameras]]",
                3,
                "at least 1",
            ),
            ("episodes = 2", "episodes = 0", 8, "remove the task"),
            (
                "name = \"x\"",
                "name = \"x\"\npack_license = \"cc-by-4.0\"",
                2,
                "name the key `license`",
            ),
            (
                "name = \"x\"",
                "name = \"x\"\nlicense = \"commercial\"",
                2,
                "write pack_license = \"commercial\"",
            ),
            ("width = 64", "width = 0", 2, "16 to 4096"),
            ("height = 48", "height = 4097", 2, "16 to 4096"),
            (
                "height = 48",
                "height = 48\nrate_hz = 7.0",
                2,
                "does not divide 240",
            ),
            ("name = \"x\"", "name = \"a/b\"", 1, "letters, digits"),
            (
                "name = \"x\"",
                "name = \"x\"\nvariation.appearance = \"*:light=4\"",
                2,
                "expected a strength of 0 (off), 1, 2 or 3",
            ),
            (
                "episodes = 2",
                "episodes = 2\ncount = 3",
                9,
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
                10,
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

    #[test]
    fn plan_of_contract_2_has_equal_episodes_and_names_every_new_key() {
        let old = include_str!("../../../../../tests/data/plans/contract-2.toml");
        let new = include_str!("../../../../../assets/campaigns/train-1k.toml");
        let [old, new] = [old, new].map(|text| parse(text).unwrap());
        assert_eq!(old.variation, new.variation);
        assert_eq!(
            (old.varied_operator, old.depth, old.keep_failed),
            (new.varied_operator, new.depth, new.keep_failed)
        );
        assert_eq!(new.warnings, [""; 0]);
        for (key, now) in [
            ("camera", "scenario.cameras"),
            ("bear_share", "scenario.variant_share"),
            ("look", "variation.appearance"),
            ("randomise.robots", "variation.specimens"),
        ] {
            let warning = format!("the key `{key}` is `{now}` now");
            assert!(
                old.warnings.iter().any(|w| w.starts_with(&warning)),
                "{:?}",
                old.warnings
            );
        }
    }
}
