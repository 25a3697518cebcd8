//! A baseline without training: plays the recording whose first images are most similar to
//! the first observed ones.

use std::collections::HashMap;
use std::path::Path;

use anyhow::{Context, ensure};
use parking_lot::Mutex;
use wheelarm_dataset::convert::learning::{self, Learning, RowOptions};
use wheelarm_dataset::convert::{ReadOptions, Recording, Sees};
use wheelarm_policy::ActionKind;
use wheelarm_proto::{PHYSICS_HZ, v1};
use wheelarm_rollout::policy::{Policy, PolicyError};

/// Rows of a chunk.
const CHUNK: usize = 10;
/// Cells across and down in which images are compared.
const CELLS: [usize; 2] = [32, 18];
/// Columns of the chair's speeds in a row.
const SPEEDS: std::ops::Range<usize> = 10..12;

/// Plays the nearest recording.
pub struct Nearest {
    spec: v1::PolicySpec,
    demonstrations: Vec<Demonstration>,
    /// Index of the demonstration and its first tick, by episode.
    chosen: Mutex<HashMap<String, (usize, u64)>>,
}

struct Demonstration {
    /// Means of the cells of the first images, camera after camera.
    first: Vec<f32>,
    rows: Vec<Vec<f64>>,
}

impl Nearest {
    /// Reads the recordings of a folder.
    ///
    /// # Errors
    /// When there are none, or they differ in cameras or rate.
    pub fn of(folder: &Path) -> anyhow::Result<Self> {
        let entries = std::fs::read_dir(folder)
            .with_context(|| format!("reading the recordings in {}", folder.display()))?;
        let mut files: Vec<_> = entries.flatten().map(|entry| entry.path()).collect();
        files.retain(|path| path.extension().is_some_and(|e| e == "h5"));
        files.sort();
        ensure!(
            !files.is_empty(),
            "{} contains no recordings (*.h5)",
            folder.display()
        );
        let mut spec: Option<v1::PolicySpec> = None;
        let mut demonstrations = Vec::new();
        for file in &files {
            let about = || format!("reading {}", file.display());
            let (found, demonstration) = read(file).with_context(about)?;
            let Some(demonstration) = demonstration else {
                continue;
            };
            let known = spec.get_or_insert_with(|| found.clone());
            ensure!(
                (&known.cameras, known.rate_hz) == (&found.cameras, found.rate_hz),
                "{} has other cameras than {}",
                file.display(),
                files[0].display()
            );
            demonstrations.push(demonstration);
        }
        Ok(Self {
            spec: spec.with_context(|| format!("nothing succeeded in {}", folder.display()))?,
            demonstrations,
            chosen: Mutex::default(),
        })
    }

    /// Index of the demonstration with the most similar first images.
    fn nearest(&self, moment: &v1::PolicyStep) -> Option<usize> {
        let observed: Vec<f32> = moment
            .images
            .iter()
            .flat_map(|p| cells(&p.color, p.width as usize, p.height as usize))
            .collect();
        let far = |demonstration: &Demonstration| {
            let pairs = demonstration.first.iter().zip(&observed);
            pairs.map(|(a, b)| (a - b) * (a - b)).sum::<f32>()
        };
        (0..self.demonstrations.len())
            .min_by(|&a, &b| far(&self.demonstrations[a]).total_cmp(&far(&self.demonstrations[b])))
    }
}

impl Policy for Nearest {
    fn spec(&self) -> &v1::PolicySpec {
        &self.spec
    }

    fn reset(&self, request: v1::PolicyResetRequest) -> Result<(), PolicyError> {
        self.chosen.lock().remove(&request.episode_key);
        Ok(())
    }

    fn infer(&self, observation: v1::PolicyObservation) -> Result<v1::PolicyChunk, PolicyError> {
        let none = || PolicyError::Rejected("the observation has no images".to_owned());
        let moment = observation.steps.last().ok_or_else(none)?;
        let mut chosen = self.chosen.lock();
        let (which, since) = match chosen.get(&observation.episode_key) {
            Some(&known) => known,
            None => {
                let new = (self.nearest(moment).ok_or_else(none)?, observation.tick);
                *chosen.entry(observation.episode_key.clone()).or_insert(new)
            }
        };
        let rows = &self.demonstrations[which].rows;
        let ticks = PHYSICS_HZ as f64 / self.spec.rate_hz;
        let now = (observation.tick.saturating_sub(since) as f64 / ticks).round() as usize;
        let row = |i: usize| {
            let mut row = rows[i.min(rows.len() - 1)].clone();
            if i >= rows.len() {
                row[SPEEDS].fill(0.0);
            }
            row
        };
        let values = (now..now + CHUNK).flat_map(row).map(|v| v as f32);
        Ok(v1::PolicyChunk {
            tick: observation.tick,
            rows: CHUNK as u32,
            values: values.collect(),
            problem: String::new(),
            episode_key: observation.episode_key,
        })
    }
}

/// Description of a policy for a recording, and its demonstration if it succeeded.
fn read(file: &Path) -> anyhow::Result<(v1::PolicySpec, Option<Demonstration>)> {
    let wanted = learning::reads;
    let recording = Recording::open(file, &ReadOptions::default(), &wanted)?;
    let options = RowOptions {
        action: ActionKind::NextPose,
        trim_idle: None,
    };
    let (rate, all) = Learning::on_grid(&recording, &options, Sees::Colour)?;
    let begin = recording.aligned.stamps[all.rows[0]];
    let (mut cameras, mut first) = (Vec::new(), Vec::new());
    for (name, camera) in &recording.cameras {
        let Some((width, height)) = camera.size().filter(|_| camera.has_rgb()) else {
            continue;
        };
        let at = camera.stamps().partition_point(|stamp| *stamp < begin);
        let rgb = camera.rgb(&recording.episode, at.min(camera.len() - 1))?;
        first.extend(cells(&rgb, width, height));
        cameras.push(v1::PolicyCamera {
            name: name.clone(),
            width: u32::try_from(width)?,
            height: u32::try_from(height)?,
            depth: false,
        });
    }
    let spec = v1::PolicySpec {
        name: "replay".to_owned(),
        cameras,
        rate_hz: f64::from(rate),
        chunk: CHUNK as u32,
        execute: CHUNK as u32,
        action: v1::PolicyAction::NextPose.into(),
        ..Default::default()
    };
    let succeeded = all.rows.last().is_some_and(|&last| all.success(last));
    let rows = all.actions;
    Ok((spec, succeeded.then_some(Demonstration { first, rows })))
}

/// Mean of every cell and channel of an image, row-major.
fn cells(rgb: &[u8], width: usize, height: usize) -> Vec<f32> {
    let [across, down] = CELLS;
    let mut sums = vec![(0_u32, 0_u32); across * down * 3];
    if width == 0 || height == 0 {
        return vec![0.0; sums.len()];
    }
    for (i, pixel) in rgb.chunks_exact(3).enumerate().take(width * height) {
        let cell = (i / width) * down / height * across + (i % width) * across / width;
        for (sum, value) in sums[3 * cell..].iter_mut().zip(pixel) {
            *sum = (sum.0 + u32::from(*value), sum.1 + 1);
        }
    }
    let mean = |(sum, count): (u32, u32)| sum as f32 / count.max(1) as f32;
    sums.into_iter().map(mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step_with_image(value: u8) -> v1::PolicyStep {
        v1::PolicyStep {
            state_values: Vec::new(),
            images: vec![v1::PolicyImage {
                camera: "gen3".to_owned(),
                width: 64,
                height: 36,
                color: vec![value; 64 * 36 * 3].into(),
                ..Default::default()
            }],
        }
    }

    #[test]
    fn nearest_demonstration_is_played_and_then_the_chair_stops() {
        let rows = |speed: f64| {
            let row = |i: u32| {
                let mut row = vec![f64::from(i); 12];
                row[SPEEDS].fill(speed);
                row
            };
            (0..12).map(row).collect::<Vec<_>>()
        };
        let demonstration = |value: f32, speed| Demonstration {
            first: vec![value; CELLS[0] * CELLS[1] * 3],
            rows: rows(speed),
        };
        let policy = Nearest {
            spec: v1::PolicySpec {
                rate_hz: 10.0,
                ..Default::default()
            },
            demonstrations: vec![demonstration(10.0, 0.1), demonstration(200.0, 0.2)],
            chosen: Mutex::default(),
        };
        let request = |tick, value| {
            let observation = v1::PolicyObservation {
                episode_key: "a".to_owned(),
                tick,
                steps: vec![step_with_image(value)],
                ..Default::default()
            };
            policy.infer(observation).unwrap().values
        };
        let first = request(48, 180);
        assert_eq!((first.len(), first[10]), (CHUNK * 12, 0.2));
        // Later images change nothing.
        let second = request(48 + 240, 10);
        assert_eq!((second[0], second[10]), (10.0, 0.2));
        assert_eq!((second[24], second[34]), (11.0, 0.0));
        assert!(policy.infer(v1::PolicyObservation::default()).is_err());
    }
}
