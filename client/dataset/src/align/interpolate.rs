//! Interpolation between two samples as pure functions.
//! None of them extrapolates.

/// Position of a time among ascending stamps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Place {
    /// Exactly at a sample.
    At(usize),
    /// Between a sample and the next: the share of the way, in (0, 1).
    Between(usize, f64),
    /// Before the first or after the last sample.
    Outside,
}

/// Finds `time` among rising `stamps`.
#[must_use]
pub fn place(stamps: &[u64], time: u64) -> Place {
    match stamps.binary_search(&time) {
        Ok(index) => Place::At(index),
        Err(0) => Place::Outside,
        Err(next) if next == stamps.len() => Place::Outside,
        Err(next) => {
            let (a, b) = (stamps[next - 1], stamps[next]);
            Place::Between(next - 1, (time - a) as f64 / (b - a) as f64)
        }
    }
}

/// The sample nearest to `time` within `limit` nanoseconds; of two equally near
/// ones the earlier, and of those with the same stamp the last.
#[must_use]
pub fn nearest(stamps: &[u64], time: u64, limit: u64) -> Option<usize> {
    let next = stamps.partition_point(|&s| s < time);
    let candidates = [next.checked_sub(1), (next < stamps.len()).then_some(next)];
    candidates
        .into_iter()
        .flatten()
        .filter(|&i| stamps[i].abs_diff(time) <= limit)
        .min_by_key(|&i| stamps[i].abs_diff(time))
        .map(|i| stamps.partition_point(|&s| s <= stamps[i]) - 1)
}

/// The straight line from `a` to `b`.
#[must_use]
pub fn linear(a: f64, b: f64, share: f64) -> f64 {
    a + (b - a) * share
}

/// The shortest great arc from `a` to `b`, unit quaternions x y z w; the result
/// has norm 1 and the sign that is nearer to `a`. Shoemake 1985.
#[must_use]
pub fn slerp(a: [f64; 4], b: [f64; 4], share: f64) -> [f64; 4] {
    let dot: f64 = a.iter().zip(&b).map(|(x, y)| x * y).sum();
    let sign = if dot < 0.0 { -1.0 } else { 1.0 };
    let difference: f64 = a.iter().zip(&b).map(|(x, y)| (sign * y - x).powi(2)).sum();
    let sum: f64 = a.iter().zip(&b).map(|(x, y)| (sign * y + x).powi(2)).sum();
    // More exact than the arc cosine for nearly equal orientations.
    let angle = 2.0 * difference.sqrt().atan2(sum.sqrt());
    let (wa, wb) = if angle < 1e-9 {
        (1.0 - share, share)
    } else {
        let s = angle.sin();
        (((1.0 - share) * angle).sin() / s, (share * angle).sin() / s)
    };
    unit(std::array::from_fn(|k| wa * a[k] + wb * sign * b[k]))
}

/// The quaternion with norm 1; NaN where the norm is 0.
#[must_use]
pub fn unit(q: [f64; 4]) -> [f64; 4] {
    let norm = q.iter().map(|v| v * v).sum::<f64>().sqrt();
    q.map(|v| v / norm)
}

/// Angle between two orientations, radians in [0, π].
#[must_use]
pub fn angle_between(a: [f64; 4], b: [f64; 4]) -> f64 {
    let dot: f64 = a.iter().zip(&b).map(|(x, y)| x * y).sum();
    let sign = if dot < 0.0 { -1.0 } else { 1.0 };
    let difference: f64 = a.iter().zip(&b).map(|(x, y)| (sign * y - x).powi(2)).sum();
    let sum: f64 = a.iter().zip(&b).map(|(x, y)| (sign * y + x).powi(2)).sum();
    4.0 * difference.sqrt().atan2(sum.sqrt())
}

/// Removes the jumps by whole turns from a series of angles, radians; every
/// step becomes the shortest one. NaN entries are passed over.
pub fn unwrap(angles: &mut [f64], width: usize) {
    use std::f64::consts::TAU;
    for column in 0..width {
        let mut last: Option<f64> = None;
        let mut turns = 0.0;
        for value in angles.iter_mut().skip(column).step_by(width) {
            if !value.is_finite() {
                continue;
            }
            if let Some(last) = last {
                turns -= ((*value - last) / TAU).round();
            }
            last = Some(*value);
            *value += turns * TAU;
        }
    }
}
