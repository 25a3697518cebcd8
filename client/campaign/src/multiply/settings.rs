//! Settings of a folder. A resumed run must have the same ones, because one report covers
//! all files.

use std::path::Path;

use anyhow::{Context, bail};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use wheelarm_proto::settings::Named;

use super::args::MultiplyArgs;
use super::sources::Sources;

/// Name of the file in the folder.
const FILE: &str = "settings.json";

/// Settings that must not change between runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// Task.
    task: String,
    /// `near` or `anywhere`.
    starts: String,
    /// Seed of the choice among the sources and of the noise.
    seed: u64,
    /// Deviation of the hand, metres.
    noise: f64,
    /// Disturbances; empty for none.
    #[serde(default)]
    disturb: String,
    /// SHA-256 of the demonstrations.
    sources: String,
}

impl Settings {
    /// The settings of a run.
    ///
    /// # Errors
    /// When the demonstrations cannot be written as text.
    pub(super) fn of(args: &MultiplyArgs, sources: &Sources) -> anyhow::Result<Self> {
        let digest = Sha256::digest(sources.text()?);
        Ok(Self {
            task: args.task.clone(),
            starts: args.starts.name().to_owned(),
            seed: args.seed,
            noise: args.noise,
            disturb: args.disturb.map_or_else(String::new, |d| d.text()),
            sources: digest.iter().map(|byte| format!("{byte:02x}")).collect(),
        })
    }

    /// Compares the settings with those of `folder`, or stores them in a new folder.
    ///
    /// # Errors
    /// When settings differ, with their names, or the file cannot be read or written.
    pub fn check(&self, folder: &Path) -> anyhow::Result<()> {
        let path = folder.join(FILE);
        let text = match std::fs::read_to_string(&path) {
            Ok(text) => text,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
                let text = serde_json::to_string_pretty(self)? + "\n";
                return std::fs::write(&path, text)
                    .with_context(|| format!("writing {}", path.display()));
            }
            Err(e) => return Err(e).with_context(|| format!("reading {}", path.display())),
        };
        let begun: Self = serde_json::from_str(&text).with_context(|| {
            format!(
                "{} is not what `wheelarm multiply` wrote; choose another --out",
                path.display()
            )
        })?;
        let others = [
            (begun.task != self.task).then(|| format!("--task {}", begun.task)),
            (begun.starts != self.starts).then(|| format!("--starts {}", begun.starts)),
            (begun.seed != self.seed).then(|| format!("--seed {}", begun.seed)),
            (begun.noise != self.noise).then(|| format!("--noise {}", begun.noise)),
            (begun.disturb != self.disturb).then(|| match begun.disturb.as_str() {
                "" => "no --disturb".to_owned(),
                disturb => format!("--disturb {disturb}"),
            }),
            (begun.sources != self.sources).then(|| "other sources".to_owned()),
        ];
        let others: Vec<String> = others.into_iter().flatten().collect();
        if !others.is_empty() {
            bail!(
                "{} was begun with {}; use the same, or choose another --out",
                folder.display(),
                others.join(" and ")
            );
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn resumed_folder_keeps_its_settings() {
        let folder = tempfile::tempdir().unwrap();
        let first = Settings {
            task: "pick_bowl".to_owned(),
            starts: "near".to_owned(),
            seed: 0,
            noise: 0.002,
            disturb: String::new(),
            sources: "ab".to_owned(),
        };
        first.check(folder.path()).unwrap();
        first.check(folder.path()).unwrap();
        let other = Settings {
            task: "pick_mustard".to_owned(),
            noise: 0.03,
            disturb: "noise=2,pushes=0,slips=0,share=1".to_owned(),
            ..first.clone()
        };
        let error = other.check(folder.path()).unwrap_err().to_string();
        assert!(
            error.contains("begun with --task pick_bowl and --noise 0.002 and no --disturb;"),
            "{error}"
        );
        std::fs::write(folder.path().join(FILE), "{").unwrap();
        let error = first.check(folder.path()).unwrap_err().to_string();
        assert!(error.contains("choose another --out"), "{error}");
    }
}
