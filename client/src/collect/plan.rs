//! A campaign's plan: TOML, checked in full before anything starts.
//!
//! Every error names the file, the line and the cure. What a task is, which
//! ranges it draws from and how it is done are not said here: that lies in
//! the assets and in the operator.

use std::collections::BTreeSet;
use std::fmt;
use std::ops::{Range, RangeInclusive};
use std::path::{Path, PathBuf};

use serde::de::Error as _;
use serde::{Deserialize, Deserializer};
use toml::Spanned;
use wheelarm_proto::keys::check_name;
use wheelarm_proto::look::LookText;
use wheelarm_proto::seeds::{ATTEMPT_STRIDE, Purpose};
use wheelarm_proto::settings::{Depth, Named, Quality, Starts, Style};
use wheelarm_proto::v1::CameraSetting;

use super::language::{Language, LanguageFile};
use crate::disturb::Disturb;
use crate::variation::Variation;

/// Width and height that a server takes for a picture, pixels.
const SIDES: RangeInclusive<u32> = 16..=4096;

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
    /// How tasks are said; by their own sentences when absent.
    pub language: Option<Language>,
    /// Cameras.
    pub cameras: Vec<Camera>,
    /// Tasks, in the order of the plan.
    pub tasks: Vec<Task>,
}

/// What differs between episodes beside what the task files draw.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(deny_unknown_fields)]
pub struct Randomise {
    /// The operator's speed and ways vary with the seed, as a person's do.
    #[serde(default = "yes")]
    pub operator: bool,
    /// Adds the noise of the robot description to the IMU.
    #[serde(default)]
    pub imu_noise: bool,
    /// Specimens of the robot, each with lenses and camera places of its own
    /// within the tolerances of its description; 0 for the one that it describes.
    #[serde(default)]
    pub robots: u32,
}

impl Default for Randomise {
    fn default() -> Self {
        Self {
            operator: true,
            imu_noise: false,
            robots: 0,
        }
    }
}

/// One camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// `gen3`, `wheelchair` or `room`.
    pub name: String,
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// Pictures per simulated second, Hz; divides 240.
    pub rate: f64,
}

impl Camera {
    /// As the server takes it: `NAME=WIDTHxHEIGHT@HZ`.
    #[must_use]
    pub fn word(&self) -> String {
        let [width, height] = self.size;
        format!("{}={width}x{height}@{}", self.name, self.rate)
    }

    /// As a scenario says it.
    #[must_use]
    pub fn setting(&self) -> CameraSetting {
        let [width, height] = self.size;
        CameraSetting {
            name: self.name.clone(),
            width,
            height,
            rate_hz: Some(self.rate),
            ..CameraSetting::default()
        }
    }
}

/// One task.
#[derive(Clone, Debug, PartialEq)]
pub struct Task {
    /// Name below assets/tasks.
    pub name: String,
    /// Line of the plan that names it.
    pub line: usize,
    /// Episodes wanted.
    pub episodes: u32,
    /// Seed of the first episode; the next ones follow.
    pub first_seed: u64,
    /// Mean duration, simulated seconds, if the plan knows it.
    pub seconds: Option<f64>,
    /// Mean samples per episode of the dataset that this one is modelled on.
    pub reference_samples: Option<f64>,
}

/// A plan that cannot be used.
#[derive(Debug, thiserror::Error)]
pub struct PlanError {
    path: PathBuf,
    line: Option<usize>,
    what: String,
}

impl fmt::Display for PlanError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            Some(line) => write!(f, "{}:{line}: {}", self.path.display(), self.what),
            None => write!(f, "{}: {}", self.path.display(), self.what),
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PlanFile {
    name: Spanned<String>,
    out: Option<PathBuf>,
    #[serde(default = "home")]
    scene: String,
    #[serde(default = "wheelarm")]
    robot: String,
    #[serde(default)]
    first_seed: u64,
    #[serde(default = "five")]
    attempts: Spanned<u32>,
    #[serde(default, deserialize_with = "named")]
    depth: Depth,
    #[serde(default, deserialize_with = "named")]
    quality: Quality,
    #[serde(default, deserialize_with = "named")]
    starts: Starts,
    #[serde(default = "apache")]
    license: Spanned<String>,
    #[serde(default, deserialize_with = "purpose")]
    purpose: Option<Purpose>,
    bear_share: Option<Spanned<f64>>,
    look: Option<LookText>,
    #[serde(default)]
    keep_failed: bool,
    disturb: Option<Disturb>,
    #[serde(default, deserialize_with = "named")]
    style: Style,
    #[serde(default)]
    time_limits: bool,
    #[serde(default = "sixty")]
    state_rate: Spanned<f64>,
    #[serde(default = "imu")]
    imu_rate: Spanned<f64>,
    #[serde(default = "ten")]
    sample_rate: Spanned<f64>,
    #[serde(default)]
    randomise: Randomise,
    language: Option<LanguageFile>,
    #[serde(default)]
    camera: Vec<CameraFile>,
    #[serde(default)]
    task: Vec<TaskFile>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CameraFile {
    name: Spanned<String>,
    size: Spanned<[u32; 2]>,
    #[serde(default = "ten")]
    rate: Spanned<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TaskFile {
    name: Spanned<String>,
    episodes: Spanned<u32>,
    first_seed: Option<u64>,
    seconds: Option<Spanned<f64>>,
    reference_samples: Option<Spanned<f64>>,
}

fn named<'de, T: Named, D: Deserializer<'de>>(from: D) -> Result<T, D::Error> {
    let name = String::deserialize(from)?;
    T::from_name(&name).map_err(D::Error::custom)
}
fn purpose<'de, D: Deserializer<'de>>(from: D) -> Result<Option<Purpose>, D::Error> {
    named(from).map(Some)
}
fn yes() -> bool {
    true
}
fn apache() -> Spanned<String> {
    Spanned::new(0..0, "apache-2.0".to_owned())
}
fn home() -> String {
    "home".to_owned()
}
fn wheelarm() -> String {
    "wheelarm".to_owned()
}
fn five() -> Spanned<u32> {
    Spanned::new(0..0, 5)
}
fn sixty() -> Spanned<f64> {
    Spanned::new(0..0, 60.0)
}
fn imu() -> Spanned<f64> {
    Spanned::new(0..0, 240.0)
}
fn ten() -> Spanned<f64> {
    Spanned::new(0..0, 10.0)
}

impl Plan {
    /// Reads and checks a plan.
    ///
    /// # Errors
    /// [`PlanError`] with file, line and cure.
    pub fn read(path: &Path) -> Result<Self, PlanError> {
        let text = std::fs::read_to_string(path).map_err(|source| PlanError {
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
                language: None,
                look: file.look,
                disturb: file.disturb,
                style: file.style,
                time_limits: file.time_limits,
            },
            state_rate: file.state_rate.into_inner(),
            imu_rate: file.imu_rate.into_inner(),
            sample_rate: file.sample_rate.into_inner(),
            randomise: file.randomise,
            language,
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
        let pixels = |c: &Camera| f64::from(c.size[0]) * f64::from(c.size[1]);
        self.cameras.iter().map(|c| pixels(c) * c.rate).sum()
    }
}

fn line_of(text: &str, span: &Range<usize>) -> usize {
    let before = text.get(..span.start).unwrap_or(text);
    before.matches('\n').count() + 1
}

/// The place of an error.
struct Check<'a> {
    path: &'a Path,
    text: &'a str,
}

impl Check<'_> {
    fn that<T>(
        &self,
        holds: bool,
        at: &Spanned<T>,
        what: impl FnOnce() -> String,
    ) -> Result<(), PlanError> {
        if holds {
            return Ok(());
        }
        Err(PlanError {
            path: self.path.to_owned(),
            // A default has no place in the text.
            line: (!at.span().is_empty()).then(|| line_of(self.text, &at.span())),
            what: what(),
        })
    }

    fn whole(&self, what: &str) -> PlanError {
        PlanError {
            path: self.path.to_owned(),
            line: None,
            what: what.to_owned(),
        }
    }

    fn name(&self, name: &Spanned<String>) -> Result<(), PlanError> {
        self.that(check_name(name.get_ref()).is_ok(), name, || {
            format!(
                "name {:?} must be 1 to 64 letters, digits, `-` or `_`",
                name.get_ref()
            )
        })
    }

    fn language(&self, asked: Option<LanguageFile>) -> Result<Option<Language>, PlanError> {
        let Some(asked) = asked else { return Ok(None) };
        for (key, share) in asked.shares() {
            self.that((0.0..=1.0).contains(share.get_ref()), share, || {
                format!(
                    "language.{key} is {}; it is a share, 0 to 1",
                    share.get_ref()
                )
            })?;
        }
        self.that(*asked.sentences.get_ref() > 0, &asked.sentences, || {
            "language.sentences is 0; at least 1 is needed".to_owned()
        })?;
        Ok(Some(asked.checked()))
    }

    fn rate(&self, key: &str, rate: &Spanned<f64>, base: f64) -> Result<(), PlanError> {
        let value = *rate.get_ref();
        let steps = base / value;
        let divides = value > 0.0 && steps >= 1.0 && (steps - steps.round()).abs() < 1e-9;
        self.that(divides, rate, || {
            format!(
                "{key} is {value} Hz, which does not divide {base}; take for example {}",
                base / 6.0
            )
        })
    }

    fn cameras(&self, cameras: Vec<CameraFile>) -> Result<Vec<Camera>, PlanError> {
        let mut names = BTreeSet::new();
        let mut checked = Vec::new();
        for camera in cameras {
            self.name(&camera.name)?;
            let size = *camera.size.get_ref();
            self.that(
                size.iter().all(|side| SIDES.contains(side)),
                &camera.size,
                || {
                    format!(
                        "size is {}x{}; each side must be {} to {} pixels",
                        size[0],
                        size[1],
                        SIDES.start(),
                        SIDES.end()
                    )
                },
            )?;
            self.rate("rate", &camera.rate, 240.0)?;
            self.that(
                names.insert(camera.name.get_ref().clone()),
                &camera.name,
                || {
                    format!(
                        "camera {:?} stands here twice; leave one out",
                        camera.name.get_ref()
                    )
                },
            )?;
            checked.push(Camera {
                name: camera.name.into_inner(),
                size,
                rate: camera.rate.into_inner(),
            });
        }
        Ok(checked)
    }

    /// What the seeds of all tasks are for, which is what the plan says if it
    /// says it.
    fn purpose(
        &self,
        tasks: &[Task],
        asked: Option<Purpose>,
        attempts: u32,
    ) -> Result<Purpose, PlanError> {
        let mut asked = asked;
        // Seeds of the last attempts are numbers too: one that wraps around would
        // be another purpose's.
        let most = u64::MAX - ATTEMPT_STRIDE * (1 + u64::from(attempts));
        for task in tasks {
            let at = |what: String| PlanError {
                path: self.path.to_owned(),
                line: Some(task.line),
                what: format!("task {:?}: {what}", task.name),
            };
            if task.first_seed > most {
                return Err(at(format!(
                    "first_seed is {}; at most {most}, so that later attempts have seeds too",
                    task.first_seed
                )));
            }
            let seeds = task.first_seed..task.first_seed + u64::from(task.episodes);
            let found = Purpose::of_all(seeds.clone()).map_err(|mixed| at(mixed.to_string()))?;
            let wanted = *asked.get_or_insert(found);
            if found != wanted {
                return Err(at(format!(
                    "seeds {}..{} are for {}, the plan is for {}, whose seeds are {}",
                    seeds.start,
                    seeds.end,
                    found.name(),
                    wanted.name(),
                    wanted.seeds()
                )));
            }
        }
        Ok(asked.unwrap_or_default())
    }

    fn tasks(&self, tasks: Vec<TaskFile>, first_seed: u64) -> Result<Vec<Task>, PlanError> {
        if tasks.is_empty() {
            return Err(self.whole(
                "lists no task; add for example\n[[task]]\nname = \"pick_mustard\"\nepisodes = 2",
            ));
        }
        let mut names = BTreeSet::new();
        let mut checked = Vec::new();
        for task in tasks {
            self.name(&task.name)?;
            let name = task.name.get_ref().clone();
            self.that(names.insert(name.clone()), &task.name, || {
                format!("task {name:?} stands here twice; add up its episodes in one entry")
            })?;
            let episodes = *task.episodes.get_ref();
            self.that(
                (1..=ATTEMPT_STRIDE).contains(&u64::from(episodes)),
                &task.episodes,
                || {
                    format!(
                        "episodes is {episodes}; take 1 to {ATTEMPT_STRIDE}, or leave the task out"
                    )
                },
            )?;
            let positive = |key: &str, value: Option<&Spanned<f64>>| match value {
                Some(value) => {
                    let number = *value.get_ref();
                    self.that(number.is_finite() && number > 0.0, value, || {
                        format!("{key} is {number}; it must be above 0")
                    })
                }
                None => Ok(()),
            };
            positive("seconds", task.seconds.as_ref())?;
            positive("reference_samples", task.reference_samples.as_ref())?;
            checked.push(Task {
                line: line_of(self.text, &task.name.span()),
                name,
                episodes,
                first_seed: task.first_seed.unwrap_or(first_seed),
                seconds: task.seconds.map(Spanned::into_inner),
                reference_samples: task.reference_samples.map(Spanned::into_inner),
            });
        }
        Ok(checked)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let language = plan.language.unwrap();
        let places: Vec<_> = (0..7).map(|index| language.place(index)).collect();
        assert_eq!(
            places,
            [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2), (2, 0)]
        );
        assert_eq!(language.message(2).seed, 42);
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
