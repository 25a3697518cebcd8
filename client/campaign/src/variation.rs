//! Scenarios of a campaign: what all episodes share (`[scenario]` of a plan or split, in the
//! spelling of the contract) and what is sampled for each (`[variation]`).
//!
//! Every sampled value follows from the seed of the episode, so sets with disjoint seeds are
//! disjoint in all samples.

use std::collections::BTreeSet;
use std::ops::Range;

use serde::Deserialize;
use sha2::{Digest, Sha256};
use toml::Spanned;
use wheelarm_expert::forced::ForcedError;
use wheelarm_proto::appearance::AppearanceText;
use wheelarm_proto::seeds::{ATTEMPT_STRIDE, Purpose};
use wheelarm_proto::settings::{MAX_SENSOR_STRENGTH, Named, Quality, Starts, Style};
use wheelarm_proto::{CONTROL_HZ, PHYSICS_HZ, defaults, limits, v1};

use crate::disturb::Disturb;
use crate::episode_seed::EpisodeSeed;
use crate::sentences::{Language, LanguageFile};
use crate::worlds::{self, HomesFile};

/// Scenarios of the episodes of one campaign.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Variation {
    /// Fields that all episodes share; [`rejected_field`] lists those that are set here or
    /// by the campaign.
    pub scenario: v1::Scenario,
    /// Robot specimens, each with its own cameras; 0 for the one of the description.
    pub specimens: u32,
    /// Generated sentences; `None`: one of the task's own.
    pub language: Option<Language>,
    /// Visual randomization.
    pub appearance: Option<AppearanceText>,
    /// Disturbances of the robot, and intended errors of the operator.
    pub disturb: Option<Disturb>,
    /// Time limits are computed from path and style instead of taken from the tasks.
    pub time_limits: bool,
    /// Homes, of which the seed of an episode selects one; empty for the scene of `scenario`.
    pub homes: Vec<String>,
    /// Share of episodes whose start has the target in view, 0 to 1.
    pub start_in_view: f64,
    /// Share of episodes in which the operator looks around before it drives, 0 to 1.
    pub look_around: f64,
}

/// `[variation]` of a plan or a split.
#[derive(Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct VariationFile {
    /// The operator's tempo, grasps and step sequence vary with the seed.
    pub operator: bool,
    specimens: u32,
    homes: Option<Spanned<HomesFile>>,
    objects: Option<Spanned<String>>,
    appearance: Option<AppearanceText>,
    start_in_view: Spanned<f64>,
    look_around: Spanned<f64>,
    time_limits: bool,
    language: Option<LanguageFile>,
    disturbances: Option<Disturb>,
}

impl Default for VariationFile {
    fn default() -> Self {
        Self {
            operator: true,
            specimens: 0,
            homes: None,
            objects: None,
            appearance: None,
            start_in_view: Spanned::new(0..0, 0.0),
            look_around: Spanned::new(0..0, 0.0),
            time_limits: false,
            language: None,
            disturbances: None,
        }
    }
}

/// A mistake in `[scenario]` or `[variation]`: its place in the text, bytes, and the fix.
pub type Mistake = (Range<usize>, String);

impl VariationFile {
    /// The variation of a file, checked, with its `[scenario]`.
    ///
    /// # Errors
    /// [`Mistake`].
    pub fn checked(self, scenario: Spanned<v1::Scenario>) -> Result<Variation, Mistake> {
        let at = scenario.span();
        let mut scenario = scenario.into_inner();
        if let Some((field, instead)) = rejected_field(&scenario) {
            return Err((
                at,
                format!("scenario.{field} differs between episodes; {instead}"),
            ));
        }
        check_values(&scenario).map_err(|what| (at, what))?;
        for (key, share) in [
            ("start_in_view", &self.start_in_view),
            ("look_around", &self.look_around),
        ] {
            if !(0.0..=1.0).contains(share.get_ref()) {
                let what = format!("{key} is {}; it is a share, 0 to 1", share.get_ref());
                return Err((share.span(), what));
            }
        }
        let homes = match self.homes {
            None => Vec::new(),
            Some(homes) => {
                let span = homes.span();
                if !scenario.scene.is_empty() || scenario.layout_seed.is_some() {
                    let what = "homes and the scene of [scenario] exclude each other; remove one";
                    return Err((span, what.to_owned()));
                }
                let names = homes.into_inner().names();
                names.map_err(|what| (span, what))?
            }
        };
        if let Some(objects) = self.objects {
            let set = worlds::set_objects(objects.get_ref(), &mut scenario);
            set.map_err(|what| (objects.span(), what))?;
        }
        Ok(Variation {
            homes,
            scenario,
            specimens: self.specimens,
            language: self.language.map(LanguageFile::checked).transpose()?,
            appearance: self.appearance,
            disturb: self.disturbances,
            time_limits: self.time_limits,
            start_in_view: self.start_in_view.into_inner(),
            look_around: self.look_around.into_inner(),
        })
    }
}

/// The first field of `[scenario]` that a campaign sets for each episode, with the key to
/// use instead.
///
/// Names every field of the message: a new field does not compile until its place is decided.
#[must_use]
pub fn rejected_field(scenario: &v1::Scenario) -> Option<(&'static str, &'static str)> {
    let v1::Scenario {
        // Set for each episode.
        task,
        seed,
        pacing,
        calibration_seed,
        language,
        appearance,
        disturbances,
        start_in_view,
        look_around,
        rejected_starts,
        // Shared by all episodes.
        scene: _,
        robot: _,
        cameras: _,
        state_rate_hz: _,
        imu_rate_hz: _,
        scan_rate_hz: _,
        deformable_rate_hz: _,
        quality: _,
        imu_noise: _,
        objects: _,
        start: _,
        instruction: _,
        target: _,
        slides: _,
        style: _,
        person: _,
        starts: _,
        arm_positions: _,
        knuckle: _,
        variant: _,
        variant_share: _,
        sensors: _,
        time_limit_seconds: _,
        packs: _,
        draws: _,
        layout_seed: _,
        home_style: _,
        object_split: _,
    } = scenario;
    [
        ("task", task.is_some(), "list tasks in [[task]]"),
        (
            "seed",
            seed.is_some(),
            "use first_seed, or seeds of a split",
        ),
        ("pacing", *pacing != 0, "campaigns run in lock-step"),
        (
            "calibration_seed",
            calibration_seed.is_some(),
            "use specimens of [variation]",
        ),
        ("language", language.is_some(), "use [variation.language]"),
        (
            "appearance",
            appearance.is_some(),
            "use appearance of [variation], for example \"*:light=2\"",
        ),
        (
            "disturbances",
            disturbances.is_some(),
            "use [variation.disturbances]",
        ),
        (
            "start_in_view",
            start_in_view.is_some(),
            "use start_in_view of [variation], a share",
        ),
        (
            "look_around",
            look_around.is_some(),
            "use look_around of [variation], a share",
        ),
        (
            "rejected_starts",
            *rejected_starts > 0,
            "the server counts them",
        ),
    ]
    .into_iter()
    .find_map(|(field, is_set, instead)| is_set.then_some((field, instead)))
}

/// Checks values that a server would reject in every episode.
fn check_values(scenario: &v1::Scenario) -> Result<(), String> {
    let mut names = BTreeSet::new();
    for camera in &scenario.cameras {
        let name = &camera.name;
        if wheelarm_proto::keys::check_name(name).is_err() {
            return Err(format!(
                "camera name {name:?} must be 1 to 64 letters, digits, `-` or `_`"
            ));
        }
        let sides = limits::IMAGE_SIDES;
        if !sides.contains(&camera.width) || !sides.contains(&camera.height) {
            return Err(format!(
                "camera {name:?} is {}x{}; each side must be {} to {} pixels",
                camera.width,
                camera.height,
                sides.start(),
                sides.end()
            ));
        }
        divides(
            &format!("rate_hz of camera {name:?}"),
            camera.rate_hz,
            PHYSICS_HZ as f64,
        )?;
        if !names.insert(name) {
            return Err(format!("camera {name:?} is listed twice; remove one"));
        }
    }
    let (control, physics) = (CONTROL_HZ as f64, PHYSICS_HZ as f64);
    divides("state_rate_hz", scenario.state_rate_hz, control)?;
    divides("deformable_rate_hz", scenario.deformable_rate_hz, control)?;
    divides("imu_rate_hz", scenario.imu_rate_hz, physics)?;
    divides("scan_rate_hz", scenario.scan_rate_hz, control)?;
    if let Some(share) = scenario.variant_share.filter(|s| !(0.0..=1.0).contains(s)) {
        return Err(format!("variant_share is {share}; it is a share, 0 to 1"));
    }
    if let Some(draws) = scenario.draws.filter(|draws| !(1..=2).contains(draws)) {
        return Err(format!(
            "draws is {draws}; it is 1 (ranges of the area) or 2 (floor map and reach map)"
        ));
    }
    if let Some(style) = &scenario.style {
        Style::from_name(style).map_err(|unknown| unknown.to_string())?;
    }
    let mut places = BTreeSet::new();
    for sensor in &scenario.sensors {
        let strength = sensor.strength.unwrap_or(1.0);
        if !(0.0..=MAX_SENSOR_STRENGTH).contains(&strength) {
            return Err(format!(
                "the strength of the sensor {:?} is {strength}; allowed is 0 to {MAX_SENSOR_STRENGTH}",
                sensor.model
            ));
        }
        if !places.insert((&sensor.model, &sensor.camera)) {
            return Err(format!(
                "the sensor {:?} is listed twice; remove one",
                sensor.text()
            ));
        }
    }
    Ok(())
}

/// Checks that a rate, Hz, divides `base`.
fn divides(key: &str, rate: Option<f64>, base: f64) -> Result<(), String> {
    let Some(rate) = rate else { return Ok(()) };
    let steps = base / rate;
    let divides = rate > 0.0 && steps >= 1.0 && (steps - steps.round()).abs() < 1e-9;
    divides.then_some(()).ok_or_else(|| {
        format!(
            "{key} is {rate} Hz, which does not divide {base}; use for example {}",
            base / 6.0
        )
    })
}

/// Multipliers that spread the numbers of episodes over 0 to 1, one for each share (both
/// are irrational: Roberts 2018, the plastic number's low-discrepancy sequence).
const SPREAD: [f64; 2] = [0.754_877_666_246_693, 0.569_840_290_998_053];

/// Whether an episode belongs to a share: evenly among neighbouring seeds.
fn belongs(seed: EpisodeSeed, share: f64, spread: f64) -> bool {
    let number = seed.scene.wrapping_add(u64::from(seed.sentence)) % (1 << 32);
    (number as f64 * spread + 0.5).fract() < share
}

impl Variation {
    /// The scenario of an episode, without task, seed and pacing.
    #[must_use]
    pub fn for_episode(&self, seed: impl Into<EpisodeSeed>) -> v1::Scenario {
        let seed = seed.into();
        let mut scenario = self.scenario.clone();
        if let Some(home) = self.home(seed) {
            home.clone_into(&mut scenario.scene);
        }
        scenario.calibration_seed = self.specimen(seed);
        scenario.language = self.language.as_ref().map(|l| l.message(seed.sentence));
        scenario.disturbances = self.disturb.map(|disturb| disturb.disturbances(seed));
        let [view, around] = SPREAD;
        let in_share = |share: f64, spread| (share > 0.0).then(|| belongs(seed, share, spread));
        scenario.start_in_view = in_share(self.start_in_view, view);
        scenario.look_around = in_share(self.look_around, around);
        if self.time_limits {
            scenario.time_limit_seconds = Some(0.0);
        }
        scenario.appearance = self.appearance.map(|a| a.for_episode(seed.own()));
        if let Some(person) = scenario.person.as_mut().filter(|_| seed.sentence > 0) {
            person.seed.get_or_insert(seed.own());
        }
        for sensor in scenario.sensors.iter_mut().filter(|_| seed.sentence > 0) {
            sensor.seed.get_or_insert(seed.own());
        }
        scenario
    }

    /// The home of an episode; `None` without a list. Seeds take the homes in turn.
    fn home(&self, seed: EpisodeSeed) -> Option<&str> {
        // A further attempt takes another one: the task may not be offered in the first.
        let turn = seed.scene.wrapping_add(seed.scene / ATTEMPT_STRIDE);
        let turn = turn.checked_rem(self.homes.len() as u64)?;
        let home = self.homes.get(usize::try_from(turn).ok()?);
        home.map(String::as_str)
    }

    /// The intended error of the operator in an episode.
    #[must_use]
    pub fn forced(&self, seed: impl Into<EpisodeSeed>) -> Option<ForcedError> {
        let seed = seed.into();
        self.disturb.and_then(|disturb| disturb.forced(seed))
    }

    /// The robot specimen of an episode. Purposes have distinct specimens.
    fn specimen(&self, seed: EpisodeSeed) -> Option<u64> {
        let kinds = Purpose::ALL.iter();
        let kind = kinds.take_while(|p| **p != Purpose::of_seed(seed.scene));
        let kind = kind.count() as u64;
        let among = u64::from(self.specimens);
        let which = seed.scene.wrapping_add(u64::from(seed.sentence));
        (among > 0).then(|| (kind + 1) * 1_000_000 + which % among)
    }

    /// The settings as one line with sentence number `sentence`, for logs and their resume.
    /// Empty for the defaults. The words equal those of logs up to contract 2, which are resumed.
    #[must_use]
    pub fn words(&self, sentence: u32) -> String {
        let mut shared = self.scenario.clone();
        let starts = Starts::from_proto(shared.starts()).unwrap_or_default();
        shared.set_starts(v1::Starts::Unspecified);
        let style = shared
            .style
            .take()
            .filter(|style| style != Style::default().name());
        let (variant_share, person) = (shared.variant_share.take(), shared.person.take());
        let sensors: Vec<String> = shared.sensors.drain(..).map(|s| s.text()).collect();
        // Written by [`Variation::images_and_rates`].
        take_images_and_rates(&mut shared);
        let mut words = String::new();
        let mut add = |word: String| {
            words.push(' ');
            words.push_str(&word);
        };
        if starts != Starts::default() {
            add(format!("starts={}", starts.name()));
        }
        if !self.homes.is_empty() {
            let digest = Sha256::digest(self.homes.join(" "));
            let digits: Vec<String> = digest[..4].iter().map(|b| format!("{b:02x}")).collect();
            add(format!("homes={}:{}", self.homes.len(), digits.concat()));
        }
        if let Some(share) = variant_share {
            add(format!("bear_share={share}"));
        }
        if self.specimens > 0 {
            add(format!("robots={}", self.specimens));
        }
        if let Some(language) = &self.language {
            add(language.words(sentence).trim_start().to_owned());
        }
        if let Some(disturb) = &self.disturb {
            add(disturb.words().trim_start().to_owned());
        }
        if let Some(style) = style {
            add(format!("style={style}"));
        }
        if self.time_limits {
            add("time_limits".to_owned());
        }
        for (name, share) in [
            ("start_in_view", self.start_in_view),
            ("look_around", self.look_around),
        ] {
            if share > 0.0 {
                add(format!("{name}={share}"));
            }
        }
        if let Some(appearance) = &self.appearance {
            add(format!("look={appearance}"));
        }
        if let Some(person) = &person {
            add(format!("person={}", person.text()));
        }
        if !sensors.is_empty() {
            add(format!("sensors={}", sensors.join(",")));
        }
        if shared != v1::Scenario::default() {
            add(format!("scenario={}", set_fields(&shared)));
        }
        words
    }

    /// Scene, robot, cameras, rates and quality as one line, for logs and their resume.
    #[must_use]
    pub fn images_and_rates(&self) -> [String; 7] {
        take_images_and_rates(&mut self.scenario.clone())
    }
}

/// The fields of a scenario that are set, as JSON.
fn set_fields(scenario: &v1::Scenario) -> serde_json::Value {
    let mut fields = wheelarm_dataset::scenario_text::scenario_json(scenario);
    let unset = wheelarm_dataset::scenario_text::scenario_json(&v1::Scenario::default());
    if let Some(fields) = fields.as_object_mut() {
        fields.retain(|name, value| unset.get(name) != Some(value));
    }
    fields
}

/// The cameras of a scenario, `NAME=WIDTHxHEIGHT@HZ` each.
#[must_use]
pub fn camera_words(scenario: &v1::Scenario) -> Vec<String> {
    scenario
        .cameras
        .iter()
        .map(v1::CameraSetting::text)
        .collect()
}

/// Clears scene, robot, cameras, rates and quality and returns them as words.
///
/// Names every field of the message: a new field does not compile until it is decided whether
/// it belongs here or to the fields that [`Variation::words`] writes.
fn take_images_and_rates(scenario: &mut v1::Scenario) -> [String; 7] {
    let named_quality = Quality::from_proto(scenario.quality()).unwrap_or_default();
    let camera_list = camera_words(scenario).join(",");
    let v1::Scenario {
        scene,
        robot,
        cameras,
        state_rate_hz,
        imu_rate_hz,
        imu_noise,
        quality,
        // Fields of `Variation::words`.
        task: _,
        seed: _,
        pacing: _,
        calibration_seed: _,
        language: _,
        appearance: _,
        disturbances: _,
        start_in_view: _,
        look_around: _,
        rejected_starts: _,
        deformable_rate_hz: _,
        scan_rate_hz: _,
        objects: _,
        start: _,
        instruction: _,
        target: _,
        slides: _,
        style: _,
        person: _,
        starts: _,
        arm_positions: _,
        knuckle: _,
        variant: _,
        variant_share: _,
        sensors: _,
        time_limit_seconds: _,
        packs: _,
        draws: _,
        layout_seed: _,
        home_style: _,
        object_split: _,
    } = scenario;
    cameras.clear();
    *quality = v1::RenderQuality::Unspecified.into();
    let rate = |rate: &mut Option<f64>, default: f64| rate.take().unwrap_or(default).to_string();
    [
        std::mem::take(scene),
        std::mem::take(robot),
        camera_list,
        rate(state_rate_hz, defaults::STATE_RATE_HZ),
        rate(imu_rate_hz, defaults::IMU_RATE_HZ),
        imu_noise.take().unwrap_or_default().to_string(),
        named_quality.name().to_owned(),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheelarm_proto::settings::LanguageSplit;

    #[test]
    fn specimens_repeat_among_seeds_of_one_purpose_and_never_across() {
        let variation = Variation {
            specimens: 7,
            ..Variation::default()
        };
        let of = |seeds: std::ops::Range<u64>| {
            let sampled = seeds.filter_map(|seed| variation.specimen(seed.into()));
            sampled.collect::<std::collections::BTreeSet<u64>>()
        };
        let (train, claim) = (of(10_000..10_100), of(500..600));
        assert_eq!((train.len(), claim.len()), (7, 7));
        assert!(train.is_disjoint(&claim));
        assert_eq!(Variation::default().specimen(3.into()), None);
    }

    #[test]
    fn episodes_take_the_homes_in_turn_and_tasks_share_them() {
        let homes = ["studio-nordic-1", "family-country-2", "senior-nordic-4"];
        let variation = Variation {
            homes: homes.map(str::to_owned).to_vec(),
            ..Variation::default()
        };
        let scenes: Vec<String> = (9..15_u64)
            .map(|seed| variation.for_episode(seed).scene)
            .collect();
        assert_eq!(scenes, [homes, homes].concat());
        let words = variation.words(0);
        assert!(words.contains("homes=3:"), "{words}");
        assert_ne!(
            words,
            Variation {
                homes: vec![homes[0].to_owned(); 3],
                ..Variation::default()
            }
            .words(0)
        );
    }

    #[test]
    fn episode_has_shared_and_sampled_fields() {
        let variation = Variation {
            scenario: v1::Scenario {
                starts: v1::Starts::Anywhere.into(),
                variant_share: Some(0.5),
                sensors: vec![v1::SensorSetting::from_text("imu=2").unwrap()],
                ..v1::Scenario::default()
            },
            specimens: 3,
            language: Some(Language::new(7, LanguageSplit::Train)),
            appearance: AppearanceText::read("*:light=3").ok(),
            ..Variation::default()
        };
        let scenario = variation.for_episode(10_001);
        assert_eq!(scenario.starts(), v1::Starts::Anywhere);
        assert_eq!(scenario.variant_share, Some(0.5));
        let appearance = scenario.appearance.unwrap();
        assert_eq!(
            (appearance.seed, appearance.light, appearance.lens),
            (10_001, 3, 0)
        );
        assert_eq!(scenario.calibration_seed, variation.specimen(10_001.into()));
        assert_eq!(scenario.language.as_ref().map(|l| l.seed), Some(7));
        assert_eq!(
            variation.words(0),
            " starts=anywhere bear_share=0.5 robots=3 language=7/train/0/0.5/0 look=*:light=3 sensors=imu=2"
        );
        assert_eq!(Variation::default().words(0), "");
    }

    #[test]
    fn shares_of_starts_in_view_and_of_looking_around_are_those_of_the_plan() {
        let variation = Variation {
            start_in_view: 0.3,
            look_around: 0.2,
            ..Variation::default()
        };
        let mut counts = [0, 0, 0];
        for seed in 70_000..70_200 {
            let scenario = variation.for_episode(seed);
            let found = [scenario.start_in_view(), scenario.look_around()];
            counts[0] += u32::from(found[0]);
            counts[1] += u32::from(found[1]);
            counts[2] += u32::from(found[0] && found[1]);
        }
        assert!((58..=62).contains(&counts[0]), "{counts:?}");
        assert!((38..=42).contains(&counts[1]), "{counts:?}");
        assert!((6..=18).contains(&counts[2]), "{counts:?}");
        assert_eq!(variation.words(0), " start_in_view=0.3 look_around=0.2");
        let scenario = Variation::default().for_episode(1);
        assert_eq!((scenario.start_in_view, scenario.look_around), (None, None));
    }

    #[test]
    fn episodes_with_one_scene_differ_in_all_but_the_scene() {
        let variation = Variation {
            specimens: 5,
            language: Some(Language::new(7, LanguageSplit::Train)),
            appearance: AppearanceText::read("*").ok(),
            disturb: Some(Disturb::all(1, 0.5)),
            ..Variation::default()
        };
        let of = |sentence| {
            let seed = EpisodeSeed {
                scene: 10_001,
                sentence,
            };
            (variation.for_episode(seed), seed.own())
        };
        let [(first, own), (second, other)] = [of(0), of(1)];
        assert_eq!(own, 10_001);
        assert_ne!(own, other);
        assert_eq!(second.language.map(|l| l.seed), Some(8));
        assert_ne!(first.appearance, second.appearance);
        assert_ne!(first.calibration_seed, second.calibration_seed);
        assert_ne!(first.disturbances, second.disturbances);
        let scenes = 10_000..10_400;
        let forced = |sentence| {
            scenes
                .clone()
                .map(move |scene| EpisodeSeed { scene, sentence })
        };
        let [first, second] = [forced(0), forced(1)].map(|seeds| {
            let errors = seeds.map(|seed| variation.forced(seed));
            errors.collect::<Vec<_>>()
        });
        assert_ne!(first, second);
    }

    fn mistake(text: &str) -> String {
        let scenario = toml::from_str(text).unwrap();
        let checked = VariationFile::default().checked(Spanned::new(0..0, scenario));
        checked.map(|_| ()).unwrap_err().1
    }

    #[test]
    fn values_that_every_server_rejects_are_rejected_at_once() {
        for (text, words) in [
            ("seed = 3", "use first_seed"),
            ("look_around = true", "a share"),
            ("appearance = { seed = 1 }", "appearance of [variation]"),
            ("style = \"slow\"", "quick, human"),
            ("variant_share = 2.0", "0 to 1"),
            ("imu_rate_hz = 7.0", "does not divide 240"),
            ("sensors = [{ model = \"imu\", strength = 4.0 }]", "0 to 3"),
            (
                "sensors = [{ model = \"imu\" }, { model = \"imu\" }]",
                "listed twice",
            ),
        ] {
            let problem = mistake(text);
            assert!(problem.contains(words), "{text}: {problem}");
        }
    }

    #[test]
    fn shared_field_without_a_key_word_is_part_of_the_settings() {
        let mut variation = Variation::default();
        variation.scenario.variant = Some("bear".to_owned());
        assert_eq!(variation.words(0), " scenario={\"variant\":\"bear\"}");
    }
}
