//! The table and the figure of the baseline.

use std::fmt::Write as _;
use std::path::Path;

use plotters::prelude::*;
use serde::Serialize;

use super::columns::{OUTPUTS, SHORT, Trial};
use super::errors::{Errors, Predictions, lasts, skill};

/// The greatest errors on validation that the paper's tables give, by output: position
/// of the chair 0.90 m, of the hand 0.125 m, knuckles 0.24 rad, parts of quaternions 0.70.
const PAPER: [f64; OUTPUTS] = [
    0.125, 0.125, 0.125, 0.70, 0.70, 0.70, 0.70, 0.90, 0.90, 0.90, 0.70, 0.70, 0.70, 0.70, 0.24,
    0.24,
];

/// Errors of all predictors at one time ahead, the naive ones first.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Ahead {
    /// Rows ahead.
    pub rows: usize,
    /// Seconds ahead.
    pub seconds: f64,
    /// Name and errors: `repeat last`, `constant velocity`, then the networks.
    pub of: Vec<(String, Errors)>,
}

/// Result of a measurement.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// Number of trials for training, validation and test.
    pub trials: [usize; 3],
    /// Number of tested windows.
    pub windows: usize,
    /// Weights of the ResNet.
    pub backbone: String,
    /// Name, seconds and steps of training by network.
    pub training: Vec<(String, f64, u64)>,
    /// Errors by time ahead.
    pub ahead: Vec<Ahead>,
}

/// Number of naive predictors.
const NAIVE: usize = 2;

impl Report {
    /// The tables in Markdown.
    #[must_use]
    pub fn markdown(&self) -> String {
        let [learned, held, tested] = self.trials;
        let mut text = format!(
            "{learned} episodes for training, {held} for validation, {tested} for test ({} windows). ResNet18: {}.\n",
            self.windows, self.backbone
        );
        for (name, seconds, steps) in &self.training {
            let _ = writeln!(text, "- {name}: {steps} steps, {seconds:.0} s");
        }
        for ahead in &self.ahead {
            let names = ahead.of.iter().map(|(name, _)| name.as_str());
            let _ = write!(
                text,
                "\n## {} s ahead: mean absolute error\n\n| output | paper, greatest of the group | {} |\n|---|---|{}\n",
                ahead.seconds,
                names.collect::<Vec<_>>().join(" | "),
                "---|".repeat(ahead.of.len())
            );
            for (i, output) in SHORT.iter().enumerate() {
                let values = ahead.of.iter().map(|(_, e)| format_value(e.mae[i]));
                let _ = writeln!(
                    text,
                    "| {output} | {} | {} |",
                    PAPER[i],
                    values.collect::<Vec<_>>().join(" | ")
                );
            }
            for (which, part) in ["hand, degrees", "chair, degrees"].iter().enumerate() {
                let values = ahead.of.iter().map(|(_, e)| format_value(e.degrees[which]));
                let _ = writeln!(
                    text,
                    "| {part} | | {} |",
                    values.collect::<Vec<_>>().join(" | ")
                );
            }
            let names = ahead.of.iter().map(|(name, _)| name.as_str());
            let _ = write!(
                text,
                "\nMean squared error:\n\n| output | {} |\n|---|{}\n",
                names.collect::<Vec<_>>().join(" | "),
                "---|".repeat(ahead.of.len())
            );
            for (i, output) in SHORT.iter().enumerate() {
                let values = ahead.of.iter().map(|(_, e)| format!("{:.1e}", e.mse[i]));
                let _ = writeln!(
                    text,
                    "| {} | {} |",
                    squared(output),
                    values.collect::<Vec<_>>().join(" | ")
                );
            }
            let _ = write!(
                text,
                "\nSkill, 1 - MAE / MAE of the better naive predictor, with the 95 % bootstrap interval over episodes:\n\n| output | {} |\n|---|{}\n",
                ahead.of[NAIVE..]
                    .iter()
                    .map(|(n, _)| n.as_str())
                    .collect::<Vec<_>>()
                    .join(" | "),
                "---|".repeat(ahead.of.len() - NAIVE)
            );
            let trivial: Vec<&Errors> = ahead.of[..NAIVE].iter().map(|(_, e)| e).collect();
            for (i, output) in SHORT.iter().enumerate() {
                let values = ahead.of[NAIVE..].iter().map(|(_, e)| {
                    skill(e, &trivial, i).map_or("does not move".to_owned(), |[s, low, high]| {
                        format!("{s:.2} ({low:.2} to {high:.2})")
                    })
                });
                let _ = writeln!(
                    text,
                    "| {output} | {} |",
                    values.collect::<Vec<_>>().join(" | ")
                );
            }
        }
        text
    }

    /// Writes `table.md`, `table.json` and `table.csv`, which has one number a line.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write(&self, folder: &Path) -> anyhow::Result<()> {
        std::fs::write(folder.join("table.md"), self.markdown())?;
        std::fs::write(
            folder.join("table.json"),
            serde_json::to_string_pretty(self)? + "\n",
        )?;
        let mut csv = "seconds,predictor,output,measure,value\n".to_owned();
        for ahead in &self.ahead {
            for (name, e) in &ahead.of {
                for (i, output) in SHORT.iter().enumerate() {
                    let output = output.split(',').next().unwrap_or_default();
                    let measures = [
                        ("mae", e.mae[i]),
                        ("mse", e.mse[i]),
                        ("mae_of_trials_min", e.mae_of_trials[i][0]),
                        ("mae_of_trials_max", e.mae_of_trials[i][1]),
                        ("mae_of_batches_min", e.mae_of_batches[i][0]),
                        ("mae_of_batches_max", e.mae_of_batches[i][1]),
                    ];
                    for (measure, value) in measures {
                        let _ = writeln!(
                            csv,
                            "{},\"{name}\",{output},{measure},{value:e}",
                            ahead.seconds
                        );
                    }
                }
            }
        }
        std::fs::write(folder.join("table.csv"), csv)?;
        Ok(())
    }
}

/// The output with its unit squared.
fn squared(output: &str) -> String {
    match output.contains(", ") {
        true => format!("{output}²"),
        false => output.to_owned(),
    }
}

/// A value with three significant digits or more.
fn format_value(value: f64) -> String {
    match value {
        v if v >= 10.0 => format!("{v:.1}"),
        v if v >= 0.01 => format!("{v:.3}"),
        v => format!("{v:.5}"),
    }
}

/// Draws predictions over the truth of one trial, as in the paper's figure.
///
/// # Errors
/// When it cannot be written.
pub fn figure(
    path: &Path,
    trial: (usize, &Trial),
    length: usize,
    longest: usize,
    ahead: usize,
    of: &[(&str, &Predictions)],
) -> anyhow::Result<()> {
    let (number, trial) = trial;
    let time = |row: usize| (trial.first + row) as f64 * 0.1;
    let last: Vec<usize> = lasts(trial, length, longest).collect();
    let end = time(trial.outputs.len());
    crate::figure::save(path, (1200, 1000), |paper| {
        let cells = paper.split_evenly((4, 4));
        for (i, cell) in cells.iter().enumerate() {
            let truth = trial.outputs.iter().map(|row| f64::from(row[i]));
            let predictions = of
                .iter()
                .flat_map(|(_, p)| p[number].iter().map(|row| f64::from(row[i])));
            let all = || truth.clone().chain(predictions.clone());
            let (low, high) = (
                all().fold(f64::MAX, f64::min),
                all().fold(f64::MIN, f64::max),
            );
            let room = ((high - low) * 0.1).max(0.01);
            let mut chart = ChartBuilder::on(cell)
                .margin(6)
                .caption(SHORT[i], ("sans-serif", 15))
                .x_label_area_size(22)
                .y_label_area_size(44)
                .build_cartesian_2d(0.0..end, low - room..high + room)?;
            chart
                .configure_mesh()
                .x_labels(4)
                .y_labels(4)
                .light_line_style(WHITE)
                .draw()?;
            let line = truth.clone().enumerate().map(|(row, v)| (time(row), v));
            let black = BLACK.stroke_width(2);
            let drawn = chart.draw_series(LineSeries::new(line, black))?;
            drawn
                .label("truth")
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 14, y)], black));
            for (k, (name, found)) in of.iter().enumerate() {
                let stroke = [RGBColor(214, 39, 40), RGBColor(31, 119, 180)][k % 2].stroke_width(1);
                let rows = last.iter().zip(&found[number]);
                let line = rows.map(|(row, out)| (time(row + ahead), f64::from(out[i])));
                let drawn = chart.draw_series(LineSeries::new(line, stroke))?;
                drawn
                    .label(*name)
                    .legend(move |(x, y)| PathElement::new([(x, y), (x + 14, y)], stroke));
            }
            if i == 0 {
                chart
                    .configure_series_labels()
                    .background_style(WHITE.mix(0.8))
                    .border_style(BLACK.mix(0.3))
                    .draw()?;
            }
        }
        Ok(())
    })
}
