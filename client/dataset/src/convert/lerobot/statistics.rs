//! Statistics of a feature as LeRobot keeps them: exact, over all values.

use serde_json::{Value, json};

/// Names of the statistics, in the order of [`Summary::lists`].
pub const NAMES: [&str; 9] = [
    "min", "max", "mean", "std", "q01", "q10", "q50", "q90", "q99",
];
/// Place of the deviation among them.
const STD: usize = 3;
const QUANTILES: [f64; 5] = [0.01, 0.10, 0.50, 0.90, 0.99];

/// Values of a feature, gathered row by row.
#[derive(Clone, Debug, PartialEq)]
pub enum Gathered {
    /// Numbers in rows of a width.
    Numbers(usize, Vec<f32>),
    /// Counts of the 256 values of three colour channels, and images.
    Colours(Box<[[u64; 256]; 3]>, usize),
    /// Depths in millimetres, and images.
    Depths(Vec<f32>, usize),
}

/// Statistics per component.
#[derive(Clone, Debug, PartialEq)]
pub struct Summary {
    /// One list per name of [`NAMES`].
    pub lists: [Vec<f64>; 9],
    /// Rows or images.
    pub count: usize,
    /// Shape of one list: `[width]`, or `[3, 1, 1]` for images.
    pub shape: Vec<usize>,
}

impl Gathered {
    /// No values of `width` components yet.
    #[must_use]
    pub fn numbers(width: usize) -> Self {
        Self::Numbers(width, Vec::new())
    }

    /// No images yet.
    #[must_use]
    pub fn colours() -> Self {
        Self::Colours(Box::new([[0; 256]; 3]), 0)
    }

    /// No depth images yet.
    #[must_use]
    pub fn depths() -> Self {
        Self::Depths(Vec::new(), 0)
    }

    /// Counts a depth image's pixels (m, as millimetres; 0 for no return),
    /// every `step`-th.
    pub fn depth(&mut self, depth: &[f32], step: usize) {
        if let Self::Depths(all, n) = self {
            let some = depth.iter().step_by(step.max(1));
            all.extend(some.map(|d| f32::from(crate::depth::millimetres(*d))));
            *n += 1;
        }
    }

    /// Adds the rows of another one of the same kind.
    pub fn merge(&mut self, other: &Self) {
        match (self, other) {
            (Self::Numbers(_, all), Self::Numbers(_, more)) => all.extend_from_slice(more),
            (Self::Colours(all, n), Self::Colours(more, m)) => {
                for (a, b) in all.iter_mut().flatten().zip(more.iter().flatten()) {
                    *a += b;
                }
                *n += m;
            }
            (Self::Depths(all, n), Self::Depths(more, m)) => {
                all.extend_from_slice(more);
                *n += m;
            }
            _ => {}
        }
    }

    /// Counts an image's pixels, every `step`-th.
    pub fn image(&mut self, rgb: &[u8], step: usize) {
        if let Self::Colours(all, n) = self {
            for pixel in rgb.chunks_exact(3).step_by(step.max(1)) {
                for (channel, &value) in all.iter_mut().zip(pixel) {
                    channel[usize::from(value)] += 1;
                }
            }
            *n += 1;
        }
    }

    /// The statistics.
    #[must_use]
    pub fn summary(&self) -> Summary {
        match self {
            Self::Numbers(width, all) => {
                let rows = all.len() / (*width).max(1);
                let each = (0..*width).map(|c| {
                    let mut values: Vec<f32> =
                        all.iter().skip(c).step_by(*width).copied().collect();
                    values.sort_by(f32::total_cmp);
                    component(&values)
                });
                collect(each.collect(), rows, vec![*width])
            }
            Self::Depths(all, images) => {
                let mut values = all.clone();
                values.sort_by(f32::total_cmp);
                collect(vec![component(&values)], *images, vec![1, 1, 1])
            }
            Self::Colours(all, images) => {
                let each = all.iter().map(colour).collect();
                collect(each, *images, vec![3, 1, 1])
            }
        }
    }
}

fn collect(each: Vec<[f64; 9]>, count: usize, shape: Vec<usize>) -> Summary {
    Summary {
        lists: std::array::from_fn(|k| each.iter().map(|e| e[k]).collect()),
        count,
        shape,
    }
}

fn component(sorted: &[f32]) -> [f64; 9] {
    let n = sorted.len().max(1) as f64;
    let mean = sorted.iter().map(|&v| f64::from(v)).sum::<f64>() / n;
    let variance = sorted
        .iter()
        .map(|&v| (f64::from(v) - mean).powi(2))
        .sum::<f64>()
        / n;
    let at = |q: f64| {
        let place = q * (sorted.len().max(1) - 1) as f64;
        let value = |i: usize| sorted.get(i).map_or(f64::NAN, |&v| f64::from(v));
        let low = value(place.floor() as usize);
        low + (value(place.ceil() as usize) - low) * place.fract()
    };
    let q = QUANTILES.map(at);
    [
        at(0.0),
        at(1.0),
        mean,
        variance.sqrt(),
        q[0],
        q[1],
        q[2],
        q[3],
        q[4],
    ]
}

fn colour(counts: &[u64; 256]) -> [f64; 9] {
    let total: u64 = counts.iter().sum();
    let n = total.max(1) as f64;
    let value = |i: usize| i as f64 / 255.0;
    let mean = counts
        .iter()
        .enumerate()
        .map(|(i, &c)| value(i) * c as f64)
        .sum::<f64>()
        / n;
    let variance = counts
        .iter()
        .enumerate()
        .map(|(i, &c)| (value(i) - mean).powi(2) * c as f64)
        .sum::<f64>()
        / n;
    let at = |q: f64| {
        let target = q * n;
        let mut counted = 0.0;
        for (i, &c) in counts.iter().enumerate() {
            counted += c as f64;
            if c > 0 && counted >= target {
                return value(i);
            }
        }
        1.0
    };
    let least = counts.iter().position(|&c| c > 0).unwrap_or(0);
    let most = counts.iter().rposition(|&c| c > 0).unwrap_or(0);
    let q = QUANTILES.map(at);
    [
        value(least),
        value(most),
        mean,
        variance.sqrt(),
        q[0],
        q[1],
        q[2],
        q[3],
        q[4],
    ]
}

impl Summary {
    /// Raises every deviation to `least`; least, greatest value and quantiles stay.
    pub fn widen(&mut self, least: f64) {
        for deviation in &mut self.lists[STD] {
            *deviation = deviation.max(least);
        }
    }

    /// As in `meta/stats.json`.
    #[must_use]
    pub fn json(&self) -> Value {
        let mut out = serde_json::Map::new();
        for (name, list) in NAMES.iter().zip(&self.lists) {
            let value = if self.shape.len() == 3 {
                json!(list.iter().map(|v| json!([[v]])).collect::<Vec<_>>())
            } else {
                json!(list)
            };
            out.insert((*name).to_owned(), value);
        }
        out.insert("count".into(), json!([self.count]));
        Value::Object(out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_has_the_statistics_of_a_ramp() {
        let mut all = Gathered::numbers(2);
        let mut more = Gathered::numbers(2);
        more = match more {
            Gathered::Numbers(w, _) => {
                Gathered::Numbers(w, (0..=100).flat_map(|i| [i as f32, 7.0]).collect())
            }
            other => other,
        };
        all.merge(&more);
        let s = all.summary();
        let first: Vec<f64> = s.lists.iter().map(|l| l[0]).collect();
        let deviation = (100.0_f64 * 102.0 / 12.0).sqrt();
        for (found, expected) in first
            .iter()
            .zip([0.0, 100.0, 50.0, deviation, 1.0, 10.0, 50.0, 90.0, 99.0])
        {
            assert!((found - expected).abs() < 1e-4, "{first:?}");
        }
        assert!(s.lists[STD][1].abs() < 1e-9 && s.count == 101);
        let mut wide = s.clone();
        wide.widen(0.01);
        assert_eq!(wide.lists[STD], [s.lists[STD][0], 0.01]);
        let mut image = Gathered::colours();
        image.image(&[255, 0, 51].repeat(8), 1);
        let s = image.summary();
        assert_eq!((s.lists[2][0], s.lists[1][1], s.count), (1.0, 0.0, 1));
        assert!((s.lists[6][2] - 0.2).abs() < 1e-12);
    }
}
