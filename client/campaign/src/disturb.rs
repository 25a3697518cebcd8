//! Disturbed episodes and deliberate errors of the operator, as a plan defines them. All
//! samples follow from the episode's seed.

use serde::de::Error as _;
use serde::{Deserialize, Deserializer};
use wheelarm_expert::forced::ForcedError;
use wheelarm_proto::seeds::ATTEMPT_STRIDE;
use wheelarm_proto::settings::Named;
use wheelarm_proto::v1;

use crate::episode_seed::{EpisodeSeed, mixed};

/// Greatest strength of a disturbance.
const MAX_STRENGTH: u32 = 3;

/// Shares and strengths of disturbances, and the share of forced errors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Disturb {
    /// Share of episodes that are disturbed, 0 to 1.
    #[serde(default = "whole", deserialize_with = "share")]
    pub share: f64,
    /// Share of episodes with a deliberate error of the operator, 0 to 1.
    #[serde(default, deserialize_with = "share")]
    pub error_share: f64,
    /// Strength of the noise on applied commands, 0 to 3.
    #[serde(default, deserialize_with = "strength")]
    pub noise: u32,
    /// Strength of pushes, 0 to 3.
    #[serde(default, deserialize_with = "strength")]
    pub pushes: u32,
    /// Strength of slips, 0 to 3.
    #[serde(default, deserialize_with = "strength")]
    pub slips: u32,
}

fn whole() -> f64 {
    1.0
}

fn share<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    let share = f64::deserialize(from)?;
    match (0.0..=1.0).contains(&share) {
        true => Ok(share),
        false => Err(D::Error::custom(format!(
            "{share} is not a share from 0 to 1"
        ))),
    }
}

fn strength<'de, D: Deserializer<'de>>(from: D) -> Result<u32, D::Error> {
    let strength = u32::deserialize(from)?;
    match strength <= MAX_STRENGTH {
        true => Ok(strength),
        false => Err(D::Error::custom(format!(
            "{strength} is not a strength from 0 (none) to {MAX_STRENGTH}"
        ))),
    }
}

/// Independent samples from a seed.
#[derive(Clone, Copy)]
enum Sample {
    Disturbed = 1,
    Errs = 2,
    Error = 3,
}

/// 0 to 1, below 1, the same for the same seed on every machine (SplitMix64). Later
/// attempts have the samples of the first, so that failures do not change the shares.
fn uniform(seed: EpisodeSeed, sample: Sample) -> f64 {
    let first = seed.scene % ATTEMPT_STRIDE;
    let sentence = u64::from(seed.sentence).wrapping_mul(0xd1b5_4a32_d192_ed03);
    let x = first ^ sentence ^ (sample as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    (mixed(mixed(x)) >> 11) as f64 / (1u64 << 53) as f64
}

impl Disturb {
    /// Reads an option: one strength of noise, pushes and slips, or the keys of a plan's
    /// `[disturb]`, comma separated (`noise=2,pushes=1,share=0.8`).
    ///
    /// # Errors
    /// When it is neither.
    pub fn from_text(text: &str) -> Result<Self, String> {
        const FIX: &str = "use a strength from 0 to 3, or noise, pushes and slips (0 to 3) and share (0 to 1) as noise=2,share=0.8";
        if let Ok(strength) = text.trim().parse() {
            let strength = Some(strength).filter(|s| *s <= MAX_STRENGTH);
            let all = strength.map(|strength| Self::all(strength, 0.0));
            return all.ok_or_else(|| format!("{text} is not a strength; {FIX}"));
        }
        if text.trim().is_empty() {
            return Err(FIX.to_owned());
        }
        let table = text.replace(',', "\n");
        toml::from_str(&table).map_err(|e| format!("{}; {FIX}", e.message()))
    }

    /// Every episode, with all kinds at one strength.
    #[must_use]
    pub fn all(strength: u32, error_share: f64) -> Self {
        Self {
            share: 1.0,
            error_share,
            noise: strength,
            pushes: strength,
            slips: strength,
        }
    }

    /// Disturbances of an episode; strengths of 0 without any, which end earlier ones.
    #[must_use]
    pub fn disturbances(&self, seed: EpisodeSeed) -> v1::Disturbances {
        if uniform(seed, Sample::Disturbed) >= self.share {
            return v1::Disturbances::default();
        }
        v1::Disturbances {
            seed: (seed.sentence > 0).then(|| seed.own()),
            noise: self.noise,
            pushes: self.pushes,
            slips: self.slips,
        }
    }

    /// The error that the operator makes in an episode, if it makes one.
    #[must_use]
    pub fn forced(&self, seed: EpisodeSeed) -> Option<ForcedError> {
        let all = ForcedError::ALL;
        let which = uniform(seed, Sample::Error) * all.len() as f64;
        (uniform(seed, Sample::Errs) < self.error_share).then(|| all[which as usize])
    }

    /// The text that `from_text` reads, without deliberate errors.
    #[must_use]
    pub fn text(&self) -> String {
        format!(
            "noise={},pushes={},slips={},share={}",
            self.noise, self.pushes, self.slips, self.share
        )
    }

    /// As one line.
    #[must_use]
    pub fn words(&self) -> String {
        format!(
            " disturb={}x{}/{}/{} errors={}",
            self.share, self.noise, self.pushes, self.slips, self.error_share
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn option_is_a_strength_or_a_list() {
        assert_eq!(Disturb::from_text("2"), Ok(Disturb::all(2, 0.0)));
        let disturb = Disturb::from_text("noise=2,pushes=1,share=0.8").unwrap();
        assert_eq!((disturb.noise, disturb.pushes, disturb.slips), (2, 1, 0));
        assert_eq!(disturb.share, 0.8);
        assert_eq!(Disturb::from_text(&disturb.text()), Ok(disturb));
        for wrong in ["4", "-1", "noise", "noise=9", "share=2", "wind=1", ""] {
            let disturb = Disturb::from_text(wrong);
            assert!(disturb.is_err(), "{wrong}: {disturb:?}");
        }
    }

    #[test]
    fn shares_are_met_and_every_kind_of_error_occurs() {
        let text = "share = 0.3\nerror_share = 0.15\nnoise = 1\npushes = 2\nslips = 3\n";
        let disturb: Disturb = toml::from_str(text).unwrap();
        let seeds = 10_000..20_000;
        let disturbed = seeds
            .clone()
            .filter(|s| disturb.disturbances((*s).into()).noise > 0);
        let disturbed = disturbed.count() as f64 / 10_000.0;
        assert!((disturbed - 0.3).abs() < 0.02, "{disturbed}");
        let errors: Vec<_> = seeds.filter_map(|s| disturb.forced(s.into())).collect();
        let erred = errors.len() as f64 / 10_000.0;
        assert!((erred - 0.15).abs() < 0.015, "{erred}");
        for kind in ForcedError::ALL {
            let share = errors.iter().filter(|e| *e == kind).count() as f64 / errors.len() as f64;
            assert!((share - 1.0 / 3.0).abs() < 0.05, "{kind:?}: {share}");
        }
    }

    #[test]
    fn mistakes_are_reported() {
        for (text, words) in [
            ("share = 1.2", "1.2 is not a share from 0 to 1"),
            ("noise = 4", "4 is not a strength from 0 (none) to 3"),
            ("shove = 1", "unknown field `shove`"),
        ] {
            let problem = toml::from_str::<Disturb>(text).unwrap_err().to_string();
            assert!(problem.contains(words), "{text}: {problem}");
        }
    }
}
