//! What differs between episodes beside what their task draws, as a plan or a
//! split says it. Everything follows from the scenario's seed, so that what is
//! apart by seed is apart in all of it.

use serde::de::Error as _;
use serde::{Deserialize, Deserializer};
use wheelarm_expert::forced::ForcedError;
use wheelarm_proto::look::LookText;
use wheelarm_proto::seeds::Purpose;
use wheelarm_proto::settings::{Named, Starts, Style};
use wheelarm_proto::v1;

use crate::disturb::Disturb;
use crate::episode_seed::EpisodeSeed;
use crate::sentences::Language;

/// What differs between episodes beside what their task draws.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Variation {
    /// Where the robot starts.
    pub starts: Starts,
    /// How often a rigid task stands beside the teddy bear, 0 to 1; as the areas
    /// say when absent.
    pub bear_share: Option<f64>,
    /// Specimens of the robot, each with cameras of its own; 0 for the one of the
    /// description.
    pub robots: u32,
    /// Sentences by the grammar; `None` says nothing of language.
    pub language: Option<Language>,
    /// How the episodes look.
    pub look: Option<LookText>,
    /// Sensor models beside the truth.
    pub sensors: Vec<v1::SensorSetting>,
    /// What hinders the robot, and what the operator does wrong on purpose.
    pub disturb: Option<Disturb>,
    /// Who sits in the chair.
    pub person: Option<v1::Person>,
    /// How the operator moves.
    pub style: Style,
    /// Time limits follow from the way and the style; as the tasks say otherwise.
    pub time_limits: bool,
    /// Share of episodes whose start has the target in view, 0 to 1.
    pub start_in_view: f64,
    /// Share of episodes in which the operator looks around before it drives, 0 to 1.
    pub look_around: f64,
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
    /// Sets what it says of an episode in `scenario`.
    pub fn apply(&self, seed: impl Into<EpisodeSeed>, scenario: &mut v1::Scenario) {
        let seed = seed.into();
        scenario.starts = self.starts.code().into();
        scenario.variant_share = self.bear_share;
        scenario.calibration_seed = self.specimen(seed);
        let scenario_language = self.language.as_ref();
        scenario.language = scenario_language.map(|said| said.message(seed.sentence));
        scenario.disturbances = self.disturb.map(|disturb| disturb.disturbances(seed));
        if self.style != Style::default() {
            scenario.style = Some(self.style.name().to_owned());
        }
        let [view, around] = SPREAD;
        let in_share = |share: f64, spread| (share > 0.0).then(|| belongs(seed, share, spread));
        scenario.start_in_view = in_share(self.start_in_view, view);
        scenario.look_around = in_share(self.look_around, around);
        scenario.time_limit_seconds = self.time_limits.then_some(0.0);
        scenario.look = self.look.map(|look| look.for_episode(seed.own()));
        scenario.person.clone_from(&self.person);
        if let Some(person) = scenario.person.as_mut().filter(|_| seed.sentence > 0) {
            person.seed.get_or_insert(seed.own());
        }
        scenario.sensors.clone_from(&self.sensors);
        for sensor in scenario.sensors.iter_mut().filter(|_| seed.sentence > 0) {
            sensor.seed.get_or_insert(seed.own());
        }
    }

    /// The error that the operator makes on purpose in an episode.
    #[must_use]
    pub fn forced(&self, seed: impl Into<EpisodeSeed>) -> Option<ForcedError> {
        let seed = seed.into();
        self.disturb.and_then(|disturb| disturb.forced(seed))
    }

    /// Which specimen of the robot an episode has. Those of another purpose are others.
    fn specimen(&self, seed: EpisodeSeed) -> Option<u64> {
        let kinds = Purpose::ALL.iter();
        let kind = kinds.take_while(|p| **p != Purpose::of_seed(seed.scene));
        let kind = kind.count() as u64;
        let among = u64::from(self.robots);
        let which = seed.scene.wrapping_add(u64::from(seed.sentence));
        (among > 0).then(|| (kind + 1) * 1_000_000 + which % among)
    }

    /// As one line with sentence number `sentence`, empty where nothing is said: what
    /// was begun before this could be said goes on.
    #[must_use]
    pub fn words(&self, sentence: u32) -> String {
        let mut words = String::new();
        if self.starts != Starts::default() {
            words.push_str(&format!(" starts={}", self.starts.name()));
        }
        if let Some(share) = self.bear_share {
            words.push_str(&format!(" bear_share={share}"));
        }
        if self.robots > 0 {
            words.push_str(&format!(" robots={}", self.robots));
        }
        if let Some(said) = &self.language {
            words.push_str(&said.words(sentence));
        }
        if let Some(disturb) = &self.disturb {
            words.push_str(&disturb.words());
        }
        if self.style != Style::default() {
            words.push_str(&format!(" style={}", self.style.name()));
        }
        if self.time_limits {
            words.push_str(" time_limits");
        }
        for (name, share) in [
            ("start_in_view", self.start_in_view),
            ("look_around", self.look_around),
        ] {
            if share > 0.0 {
                words.push_str(&format!(" {name}={share}"));
            }
        }
        if let Some(look) = &self.look {
            words.push_str(&format!(" look={look}"));
        }
        if let Some(person) = &self.person {
            words.push_str(&format!(" person={}", person.text()));
        }
        if !self.sensors.is_empty() {
            let sensors: Vec<String> = self.sensors.iter().map(|sensor| sensor.text()).collect();
            words.push_str(&format!(" sensors={}", sensors.join(",")));
        }
        words
    }
}

/// Reads who sits in the chair, as `--person` does.
///
/// # Errors
/// The text and its form.
pub fn read_person<'de, D: Deserializer<'de>>(from: D) -> Result<Option<v1::Person>, D::Error> {
    let text = String::deserialize(from)?;
    let read = v1::Person::from_text(&text).map_err(D::Error::custom)?;
    Ok(Some(read))
}

/// Reads sensor models of a plan or a split, a list of `MODEL[@CAMERA][=STRENGTH]`.
///
/// # Errors
/// The text and its form.
pub fn read_sensors<'de, D: Deserializer<'de>>(
    from: D,
) -> Result<Vec<v1::SensorSetting>, D::Error> {
    let texts = Vec::<String>::deserialize(from)?;
    let read = texts.iter().map(|text| v1::SensorSetting::from_text(text));
    let read: Vec<_> = read.collect::<Result<_, _>>().map_err(D::Error::custom)?;
    let place = |sensor: &v1::SensorSetting| (sensor.model.clone(), sensor.camera.clone());
    for (i, sensor) in read.iter().enumerate() {
        if read[..i]
            .iter()
            .any(|before| place(before) == place(sensor))
        {
            let words = format!(
                "the sensor {:?} stands there twice; leave one out",
                texts[i]
            );
            return Err(D::Error::custom(words));
        }
    }
    Ok(read)
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheelarm_proto::settings::LanguageSplit;

    #[test]
    fn specimens_repeat_among_seeds_of_one_purpose_and_never_across() {
        let variation = Variation {
            robots: 7,
            ..Variation::default()
        };
        let of = |seeds: std::ops::Range<u64>| {
            let drawn = seeds.filter_map(|seed| variation.specimen(seed.into()));
            drawn.collect::<std::collections::BTreeSet<u64>>()
        };
        let (train, claim) = (of(10_000..10_100), of(500..600));
        assert_eq!((train.len(), claim.len()), (7, 7));
        assert!(train.is_disjoint(&claim));
        assert_eq!(Variation::default().specimen(3.into()), None);
    }

    #[test]
    fn a_scenario_takes_over_what_is_said() {
        let variation = Variation {
            starts: Starts::Anywhere,
            bear_share: Some(0.5),
            robots: 3,
            language: Some(Language::new(7, LanguageSplit::Train)),
            look: LookText::read("*:light=3").ok(),
            sensors: vec![v1::SensorSetting::from_text("imu=2").unwrap()],
            ..Variation::default()
        };
        let mut scenario = v1::Scenario::default();
        variation.apply(10_001, &mut scenario);
        assert_eq!(scenario.starts(), v1::Starts::Anywhere);
        assert_eq!(scenario.variant_share, Some(0.5));
        let look = scenario.look.unwrap();
        assert_eq!((look.seed, look.light, look.lens), (10_001, 3, 0));
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
            let mut scenario = v1::Scenario::default();
            variation.apply(seed, &mut scenario);
            let found = [scenario.start_in_view(), scenario.look_around()];
            counts[0] += u32::from(found[0]);
            counts[1] += u32::from(found[1]);
            counts[2] += u32::from(found[0] && found[1]);
        }
        assert!((58..=62).contains(&counts[0]), "{counts:?}");
        assert!((38..=42).contains(&counts[1]), "{counts:?}");
        assert!((6..=18).contains(&counts[2]), "{counts:?}");
        assert_eq!(variation.words(0), " start_in_view=0.3 look_around=0.2");
        let mut scenario = v1::Scenario::default();
        Variation::default().apply(1, &mut scenario);
        assert_eq!((scenario.start_in_view, scenario.look_around), (None, None));
    }

    #[test]
    fn episodes_with_one_scene_differ_in_all_but_the_scene() {
        let variation = Variation {
            robots: 5,
            language: Some(Language::new(7, LanguageSplit::Train)),
            look: LookText::read("*").ok(),
            disturb: Some(Disturb::all(1, 0.5)),
            ..Variation::default()
        };
        let of = |sentence| {
            let mut scenario = v1::Scenario::default();
            let seed = EpisodeSeed {
                scene: 10_001,
                sentence,
            };
            variation.apply(seed, &mut scenario);
            (scenario, seed.own())
        };
        let [(first, own), (second, other)] = [of(0), of(1)];
        assert_eq!(own, 10_001);
        assert_ne!(own, other);
        assert_eq!(second.language.map(|l| l.seed), Some(8));
        assert_ne!(first.look, second.look);
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
}
