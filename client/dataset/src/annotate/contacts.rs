//! From when to when two bodies touch, by the recorded contacts of the robot and
//! of objects.

use std::collections::BTreeMap;

use crate::read::{Episode, ReadError};

/// Two bodies that touch.
#[derive(Clone, Debug, PartialEq)]
pub struct Interval {
    /// First and last sample at which they do, simulation time, nanoseconds.
    pub from: u64,
    /// The last one.
    pub to: u64,
    /// Names of the bodies, in alphabetical order.
    pub bodies: [String; 2],
    /// Greatest force between them, N.
    pub peak: f64,
}

/// Intervals with fewer samples than this between them are one.
const GAP: usize = 3;

/// All intervals by their beginning. Of a sample the sixteen strongest pairs are
/// recorded: a weaker one among more is not reported.
pub(super) fn intervals(episode: &Episode) -> Result<Vec<Interval>, ReadError> {
    let stamps = episode.stamps("contact")?;
    let pairs = episode.texts("contact", "pairs")?;
    let force = episode.f64s("contact", "force")?;
    let most = force.shape().get(1).copied().unwrap_or(0);
    let force = force.into_raw_vec_and_offset().0;
    let mut open: BTreeMap<[String; 2], (usize, usize, f64)> = BTreeMap::new();
    let mut out = Vec::new();
    let mut close = |bodies: &[String; 2], (first, last, peak): (usize, usize, f64)| {
        let stamp = |row: usize| stamps.get(row).copied().unwrap_or(0);
        out.push(Interval {
            from: stamp(first),
            to: stamp(last),
            bodies: bodies.clone(),
            peak,
        });
    };
    for (row, text) in pairs.iter().enumerate() {
        let listed: Vec<(String, String)> = serde_json::from_str(text).unwrap_or_default();
        for (k, (a, b)) in listed.into_iter().enumerate() {
            let at = 3 * (row * most + k);
            let parts = force.get(at..at + 3).unwrap_or_default();
            let newton = parts.iter().map(|x| x * x).sum::<f64>().sqrt();
            let mut bodies = [a, b];
            bodies.sort();
            match open.get_mut(&bodies) {
                Some(run) if row - run.1 <= GAP => {
                    run.1 = row;
                    run.2 = run.2.max(newton);
                }
                Some(run) => {
                    close(&bodies, *run);
                    *run = (row, row, newton);
                }
                None => {
                    open.insert(bodies, (row, row, newton));
                }
            }
        }
    }
    for (bodies, run) in &open {
        close(bodies, *run);
    }
    out.sort_by(|a, b| (a.from, &a.bodies).cmp(&(b.from, &b.bodies)));
    Ok(out)
}
