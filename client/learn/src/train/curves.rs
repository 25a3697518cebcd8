//! Diagram of the learning curves.

use std::path::Path;

use plotters::prelude::*;
use serde::{Deserialize, Serialize};

const SIZE: (u32, u32) = (900, 420);
const COLORS: [RGBColor; 4] = [
    RGBColor(31, 119, 180),
    RGBColor(214, 39, 40),
    RGBColor(44, 160, 44),
    RGBColor(148, 103, 189),
];

/// A point of the curves.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// Step.
    pub step: u64,
    /// Means of the training's numbers over the interval.
    pub training: Vec<(String, f64)>,
    /// Validation.
    pub validation: Option<f64>,
    /// Learning rate.
    pub rate: f64,
}

/// Draws every number of the log over its step, with a logarithmic vertical axis.
///
/// # Errors
/// When the file cannot be written.
pub fn draw(log: &[Entry], path: &Path) -> anyhow::Result<()> {
    let mut lines: Vec<(String, Vec<(f64, f64)>)> = Vec::new();
    for entry in log {
        let held = entry.validation.map(|v| ("held out".to_owned(), v));
        for (name, value) in entry.training.iter().cloned().chain(held) {
            if !(value.is_finite() && value > 0.0) {
                continue;
            }
            let point = (entry.step as f64, value);
            match lines.iter_mut().find(|(known, _)| *known == name) {
                Some((_, points)) => points.push(point),
                None => lines.push((name, vec![point])),
            }
        }
    }
    let all = || lines.iter().flat_map(|(_, points)| points);
    let Some(last) = all().map(|p| p.0).reduce(f64::max) else {
        return Ok(());
    };
    let least = all().map(|p| p.1).fold(f64::MAX, f64::min);
    let most = all().map(|p| p.1).fold(f64::MIN, f64::max);
    crate::figure::save(path, SIZE, |paper| {
        let mut chart = ChartBuilder::on(paper)
            .margin(12)
            .x_label_area_size(36)
            .y_label_area_size(64)
            .build_cartesian_2d(0.0..last, (least / 1.2..most * 1.2).log_scale())?;
        chart.configure_mesh().x_desc("step").draw()?;
        for (i, (name, points)) in lines.into_iter().enumerate() {
            let stroke = COLORS[i % COLORS.len()].stroke_width(2);
            chart
                .draw_series(LineSeries::new(points, stroke))?
                .label(name)
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], stroke));
        }
        chart
            .configure_series_labels()
            .background_style(WHITE.mix(0.8))
            .border_style(BLACK.mix(0.3))
            .draw()?;
        Ok(())
    })
}
