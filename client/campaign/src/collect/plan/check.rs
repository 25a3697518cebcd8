//! Checks of a plan's file; each error names the line and the fix.

use std::collections::BTreeSet;
use std::ops::Range;
use std::path::Path;

use toml::Spanned;
use wheelarm_proto::keys::check_name;
use wheelarm_proto::seeds::{ATTEMPT_STRIDE, Purpose};
use wheelarm_proto::settings::{LanguageSplit, Named};
use wheelarm_proto::v1;

use super::form::TaskFile;
use super::parts::{PlanError, Task};
use crate::sentences::Language;
use crate::variation::{Mistake, Variation};
use crate::worlds;

pub(super) fn line_of(text: &str, span: &Range<usize>) -> usize {
    let before = text.get(..span.start).unwrap_or(text);
    before.matches('\n').count() + 1
}

/// The place of an error.
pub(super) struct Check<'a> {
    pub(super) path: &'a Path,
    pub(super) text: &'a str,
}

impl Check<'_> {
    pub(super) fn that<T>(
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

    pub(super) fn whole(&self, what: &str) -> PlanError {
        PlanError {
            path: self.path.to_owned(),
            line: None,
            what: what.to_owned(),
        }
    }

    pub(super) fn name(&self, name: &Spanned<String>) -> Result<(), PlanError> {
        self.that(check_name(name.get_ref()).is_ok(), name, || {
            format!(
                "name {:?} must be 1 to 64 letters, digits, `-` or `_`",
                name.get_ref()
            )
        })
    }

    pub(super) fn at(&self, (span, what): Mistake) -> PlanError {
        PlanError {
            path: self.path.to_owned(),
            line: (!span.is_empty()).then(|| line_of(self.text, &span)),
            what,
        }
    }

    /// Rejects held-out sentences in a plan for training.
    pub(super) fn apart(
        &self,
        purpose: Purpose,
        language: Option<&Language>,
    ) -> Result<(), PlanError> {
        let held_out = language.is_some_and(|language| language.split != LanguageSplit::Train);
        if purpose == Purpose::Train && held_out {
            return Err(self.whole(
                "[variation.language] of a plan for training uses sentences that are held out for tests; \
                 write split = \"train\"",
            ));
        }
        Ok(())
    }

    /// Rejects homes, objects and looks in a plan for training that are kept for tests. In homes
    /// of packs such a plan takes the objects that are not held out.
    pub(super) fn worlds(
        &self,
        purpose: Purpose,
        variation: &mut Variation,
    ) -> Result<(), PlanError> {
        if purpose != Purpose::Train {
            return Ok(());
        }
        let sides = worlds::shipped().map_err(|error| self.whole(&format!("{error:#}")))?;
        let homes = sides.check_training_homes(&variation.homes);
        let rest = homes.and_then(|()| sides.check_training(&variation.scenario));
        rest.map_err(|what| self.whole(&what))?;
        let scenario = &mut variation.scenario;
        let takes_objects_of_packs = !variation.homes.is_empty() || !scenario.packs.is_empty();
        match scenario.object_split.as_str() {
            "" if takes_objects_of_packs => {
                LanguageSplit::Train
                    .name()
                    .clone_into(&mut scenario.object_split);
            }
            "" | "train" => {}
            other => {
                return Err(self.whole(&format!(
                    "object_split = {other:?} of [scenario] takes objects that are held out for tests, and the plan is for training; write object_split = \"train\""
                )));
            }
        }
        Ok(())
    }

    /// Rejects a sensor whose camera is not recorded.
    pub(super) fn sensors(
        &self,
        sensors: &[v1::SensorSetting],
        cameras: &[v1::CameraSetting],
    ) -> Result<(), PlanError> {
        let is_known = |name: &str| name.is_empty() || cameras.iter().any(|c| c.name == name);
        let Some(blind) = sensors.iter().find(|sensor| !is_known(&sensor.camera)) else {
            return Ok(());
        };
        let known: Vec<&str> = cameras.iter().map(|camera| camera.name.as_str()).collect();
        Err(self.whole(&format!(
            "the sensor {:?} uses the camera {:?}, which the plan does not record; \
             its cameras are {}",
            blind.text(),
            blind.camera,
            known.join(", ")
        )))
    }

    pub(super) fn rate(&self, key: &str, rate: &Spanned<f64>, base: f64) -> Result<(), PlanError> {
        let value = *rate.get_ref();
        let steps = base / value;
        let divides = value > 0.0 && steps >= 1.0 && (steps - steps.round()).abs() < 1e-9;
        self.that(divides, rate, || {
            format!(
                "{key} is {value} Hz, which does not divide {base}; use for example {}",
                base / 6.0
            )
        })
    }

    /// Purpose of the seeds of all tasks, which must equal the plan's if it names one.
    pub(super) fn purpose(
        &self,
        tasks: &[Task],
        stated: Option<Purpose>,
        attempts: u32,
    ) -> Result<Purpose, PlanError> {
        let mut stated = stated;
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
            let found = Purpose::of_range(seeds.clone()).map_err(|mixed| at(mixed.to_string()))?;
            let wanted = *stated.get_or_insert(found);
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
        Ok(stated.unwrap_or_default())
    }

    pub(super) fn tasks(
        &self,
        tasks: Vec<TaskFile>,
        first_seed: u64,
    ) -> Result<Vec<Task>, PlanError> {
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
                format!("task {name:?} is listed twice; add up its episodes in one entry")
            })?;
            let episodes = *task.episodes.get_ref();
            self.that(
                (1..=ATTEMPT_STRIDE).contains(&u64::from(episodes)),
                &task.episodes,
                || format!("episodes is {episodes}; use 1 to {ATTEMPT_STRIDE}, or remove the task"),
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
