//! Objects that are round about z: their profile as a cup, a cylinder or truncated cones. These
//! shapes are exact where hulls are not, and planners know them.

use wheelarm_pack::{CupEntry, FrustumEntry, PartEntry, RoundEntry};
use wheelarm_proto::exact;

use super::hull::decimal;
use super::mesh::{Sample, Vec3};

/// Slices in which roundness is checked, and sectors of each.
const SLICES: usize = 8;
const SECTORS: usize = 16;
/// Greatest relative spread of the radius of a round slice.
const SPREAD: f64 = 0.035;
/// Samples of a slice below which it does not count.
const FEW: usize = 60;
/// Steps of the profile.
const STEPS: usize = 40;
/// Deviation of a profile from its cones, metres.
const DEVIATION: f64 = 0.0015;
/// Most cones of an object.
const MOST_CONES: usize = 10;
/// Least radius of a shape, and least difference of radii that makes a cone, metres.
const LEAST_RADIUS: f64 = 0.002;
const CONE: f64 = 3.0e-4;
/// Least wall of a cup, metres: thinner walls let objects through.
const LEAST_WALL: f64 = 0.0025;

/// Whether the samples of a surface are round about z.
pub fn is_round(samples: &[Sample]) -> bool {
    let top = samples.iter().fold(0.0_f64, |top, s| top.max(s.at.z));
    if top <= 0.0 {
        return false;
    }
    let mut furthest = [[0.0_f64; SECTORS]; SLICES];
    let mut counts = [0_usize; SLICES];
    for sample in samples {
        let slice = ((sample.at.z / top * SLICES as f64) as usize).min(SLICES - 1);
        let angle = exact::atan2(sample.at.y, sample.at.x) + std::f64::consts::PI;
        let sector = (angle / std::f64::consts::TAU * SECTORS as f64) as usize % SECTORS;
        let radius = radius(sample.at);
        furthest[slice][sector] = furthest[slice][sector].max(radius);
        counts[slice] += 1;
    }
    let mut checked = 0;
    for (radii, _) in furthest.iter().zip(counts).filter(|(_, n)| *n >= FEW) {
        let mean = radii.iter().sum::<f64>() / SECTORS as f64;
        let square = radii.iter().map(|r| (r - mean) * (r - mean)).sum::<f64>();
        if (square / SECTORS as f64).sqrt() > SPREAD * mean {
            return false;
        }
        checked += 1;
    }
    checked > 0
}

fn radius(point: Vec3) -> f64 {
    exact::hypot(point.x, point.y)
}

/// Form of an open cup.
pub const CUP: &str = "cup";

/// Collision shapes of a round object.
#[derive(Clone, Debug, PartialEq)]
pub struct Revolved {
    /// `cup`, `cylinder` or `truncated cones`.
    pub form: &'static str,
    /// Its shapes.
    pub parts: Vec<PartEntry>,
}

/// The shapes of a round surface.
pub fn shapes(samples: &[Sample]) -> Option<Revolved> {
    let profile = profile(samples)?;
    if let Some(cup) = cup(samples, &profile) {
        return Some(cup);
    }
    let mut deviation = DEVIATION;
    let mut corners = split(&profile, deviation);
    while corners.len() > MOST_CONES + 1 {
        deviation *= 1.5;
        corners = split(&profile, deviation);
    }
    let pairs = corners
        .windows(2)
        .map(|pair| (profile[pair[0]], profile[pair[1]]));
    let parts: Vec<PartEntry> = pairs.map(|(low, high)| cone(low, high)).collect();
    let form = match &parts[..] {
        [only] if only.cylinder.is_some() => "cylinder",
        _ => "truncated cones",
    };
    Some(Revolved { form, parts })
}

/// A point of a profile: height and outer radius.
type ProfilePoint = [f64; 2];

/// The outer radius by height.
fn profile(samples: &[Sample]) -> Option<Vec<ProfilePoint>> {
    let top = samples.iter().fold(0.0_f64, |top, s| top.max(s.at.z));
    let mut bins: Vec<Vec<f64>> = vec![Vec::new(); STEPS];
    for sample in samples {
        let bin = ((sample.at.z / top * STEPS as f64) as usize).min(STEPS - 1);
        bins[bin].push(radius(sample.at));
    }
    let mut found: Vec<ProfilePoint> = Vec::new();
    for (i, radii) in bins.iter_mut().enumerate() {
        if radii.len() > 5 {
            radii.sort_by(f64::total_cmp);
            let outer = radii[(radii.len() - 1) * 98 / 100];
            found.push([(i as f64 + 0.5) / STEPS as f64 * top, outer]);
        }
    }
    let (first, last) = (*found.first()?, *found.last()?);
    found.insert(0, [0.0, first[1]]);
    found.push([top, last[1]]);
    Some(found)
}

/// Radius of a profile at a height.
fn radius_at(profile: &[ProfilePoint], z: f64) -> f64 {
    let above = profile.partition_point(|point| point[0] < z);
    let high = profile[above.min(profile.len() - 1)];
    let low = profile[above.saturating_sub(1)];
    let share = (z - low[0]) / (high[0] - low[0]).max(1.0e-9);
    low[1] + (high[1] - low[1]) * share.clamp(0.0, 1.0)
}

/// Indices of points between which the profile is straight.
fn split(profile: &[ProfilePoint], deviation: f64) -> Vec<usize> {
    let mut kept = vec![0, profile.len() - 1];
    let mut pending = vec![(0, profile.len() - 1)];
    while let Some((first, last)) = pending.pop() {
        let line = [profile[first], profile[last]];
        let off = |i: usize| (radius_at(&line, profile[i][0]) - profile[i][1]).abs();
        let worst = (first + 1..last).max_by(|&i, &j| off(i).total_cmp(&off(j)));
        if let Some(worst) = worst.filter(|&i| off(i) > deviation) {
            kept.push(worst);
            pending.extend([(first, worst), (worst, last)]);
        }
    }
    kept.sort_unstable();
    kept
}

fn cone(low: ProfilePoint, high: ProfilePoint) -> PartEntry {
    let [bottom, top] = [low[1], high[1]].map(|r| decimal(r.max(LEAST_RADIUS)));
    let height = decimal(high[0] - low[0]).max(1.0e-3);
    let at = Some([0.0, 0.0, decimal(f64::midpoint(low[0], high[0]))]);
    if (bottom - top).abs() < CONE {
        return PartEntry {
            cylinder: Some(RoundEntry {
                radius: decimal(f64::midpoint(bottom, top)),
                height,
            }),
            at,
            ..PartEntry::default()
        };
    }
    PartEntry {
        frustum: Some(FrustumEntry {
            bottom_radius: bottom,
            top_radius: top,
            height,
        }),
        at,
        ..PartEntry::default()
    }
}

/// An open cup, when the inside has a floor near the bottom and the outside is one cone.
fn cup(samples: &[Sample], profile: &[ProfilePoint]) -> Option<Revolved> {
    let top = profile.last()?[0];
    let widest = profile.iter().fold(0.0_f64, |widest, p| widest.max(p[1]));
    let mut walls: Vec<f64> = Vec::new();
    let mut floor: Vec<f64> = Vec::new();
    for Sample { at, normal } in samples {
        let own = radius(*at);
        let outwards = normal.x * at.x + normal.y * at.y;
        if outwards < -0.5 * own && at.z > 0.5 * top {
            walls.push(radius_at(profile, at.z) - own);
        }
        if own < 0.3 * widest && normal.z > 0.7 {
            floor.push(at.z);
        }
    }
    if walls.len() < 80 || floor.is_empty() {
        return None;
    }
    let ends = [profile[1], profile[profile.len() - 2]];
    let off = |point: &ProfilePoint| (radius_at(&ends, point[0]) - point[1]).abs();
    let is_one_cone = profile[2..profile.len() - 2].iter().all(|p| off(p) < 0.004);
    if !is_one_cone || median(&mut floor) > 0.35 * top {
        return None;
    }
    let [bottom_radius, top_radius] = ends.map(|end| decimal(end[1]));
    let most = bottom_radius.min(top_radius).min(top) / 2.0;
    let wall = median(&mut walls).max(LEAST_WALL);
    if wall > 0.9 * most {
        return None;
    }
    Some(Revolved {
        form: CUP,
        parts: vec![PartEntry {
            cup: Some(CupEntry {
                bottom_radius,
                top_radius,
                height: decimal(top),
                wall: decimal(wall),
            }),
            ..PartEntry::default()
        }],
    })
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}
