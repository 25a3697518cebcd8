//! Shapes of objects as points around their parts, by the recorded object files:
//! enough for boxes and silhouettes.

use std::f64::consts::TAU;

use serde::Deserialize;
use wheelarm_language::kind_of;

use super::state::State;
use crate::pose;

/// A convex part: points whose hull it is, in the object's frame, metres.
pub(super) type Part = Vec<[f64; 3]>;

#[derive(Deserialize)]
struct ObjectFile {
    #[serde(default)]
    parts: Vec<toml::Table>,
    #[serde(default)]
    collision: Vec<toml::Table>,
}

/// Points of a circle.
const ROUND: usize = 16;

/// Parts of an object: what touches, where the file says it apart from what is
/// drawn; none where the file is not recorded.
pub(super) fn parts(state: &State, object: &str) -> Vec<Part> {
    let path = format!("objects/{}.toml", kind_of(object));
    let text = state
        .assets
        .iter()
        .find(|(p, _)| *p == path)
        .map(|(_, text)| text);
    let file: Option<ObjectFile> = text.and_then(|text| toml::from_str(text).ok());
    let Some(file) = file else { return Vec::new() };
    let list = if file.collision.is_empty() {
        file.parts
    } else {
        file.collision
    };
    list.iter().flat_map(part).collect()
}

/// Corners of the box around parts in the object's frame: least and greatest.
pub(super) fn bounds(parts: &[Part]) -> Option<[[f64; 3]; 2]> {
    let mut all = parts.iter().flatten();
    let first = *all.next()?;
    let mut out = [first, first];
    for point in all {
        for k in 0..3 {
            out[0][k] = out[0][k].min(point[k]);
            out[1][k] = out[1][k].max(point[k]);
        }
    }
    Some(out)
}

/// Middle of an object's parts in its frame, metres; its origin where its file is
/// not recorded.
#[must_use]
pub fn middle(state: &State, object: &str) -> [f64; 3] {
    let bounds = bounds(&parts(state, object));
    bounds.map_or([0.0; 3], |[least, most]| {
        [0, 1, 2].map(|k| (least[k] + most[k]) / 2.0)
    })
}

fn part(table: &toml::Table) -> Vec<Part> {
    let points = points(table);
    if points.is_empty() {
        return Vec::new();
    }
    let list = |key: &str| table.get(key).map_or([0.0; 3], vector);
    let turn = list("rpy_deg").map(f64::to_radians);
    let places = match table.get("places").and_then(toml::Value::as_array) {
        Some(places) => places.iter().map(vector).collect(),
        None => vec![list("at")],
    };
    let moved = |at: [f64; 3]| {
        let own = pose::from_rpy(at, turn);
        points.iter().map(|p| pose::point(&own, *p)).collect()
    };
    places.into_iter().map(moved).collect()
}

/// Points of a shape in its own frame; empty for an unknown one.
fn points(table: &toml::Table) -> Part {
    let shape = |key: &str| table.get(key).and_then(toml::Value::as_table);
    let of = |shape: &toml::Table, key: &str| shape.get(key).map_or(0.0, float);
    let rings = |radii: &[(f64, f64)]| -> Part {
        let ring = |&(radius, z): &(f64, f64)| {
            (0..ROUND).map(move |i| {
                let (sin, cos) = (TAU * i as f64 / ROUND as f64).sin_cos();
                [radius * cos, radius * sin, z]
            })
        };
        radii.iter().flat_map(ring).collect()
    };
    let corners = |[x, y, z]: [f64; 3]| -> Part {
        let sign = |i: usize, bit: usize| if i >> bit & 1 == 1 { 0.5 } else { -0.5 };
        (0..8)
            .map(|i| [x * sign(i, 0), y * sign(i, 1), z * sign(i, 2)])
            .collect()
    };
    if let Some(size) = table.get("box") {
        return corners(vector(size));
    }
    if let Some(rounded) = shape("rounded_box") {
        return corners(rounded.get("size").map_or([0.0; 3], vector));
    }
    if let Some(s) = shape("cylinder") {
        let half = of(s, "height") / 2.0;
        return rings(&[(of(s, "radius"), -half), (of(s, "radius"), half)]);
    }
    if let Some(s) = shape("capsule") {
        let (radius, half) = (of(s, "radius"), of(s, "height") / 2.0);
        return rings(&[
            (0.0, -half - radius),
            (radius, -half),
            (radius, half),
            (0.0, half + radius),
        ]);
    }
    if let Some(s) = shape("sphere") {
        let radius = of(s, "radius");
        let near = radius * 0.707;
        return rings(&[
            (0.0, -radius),
            (near, -near),
            (radius, 0.0),
            (near, near),
            (0.0, radius),
        ]);
    }
    if let Some(s) = shape("frustum") {
        let half = of(s, "height") / 2.0;
        return rings(&[(of(s, "bottom_radius"), -half), (of(s, "top_radius"), half)]);
    }
    if let Some(s) = shape("cup") {
        return rings(&[
            (of(s, "bottom_radius"), 0.0),
            (of(s, "top_radius"), of(s, "height")),
        ]);
    }
    if let Some(profile) = table.get("lathe").and_then(toml::Value::as_array) {
        let pair = |entry: &toml::Value| {
            let list = entry.as_array()?;
            Some((float(list.first()?), float(list.get(1)?)))
        };
        let profile: Vec<(f64, f64)> = profile.iter().filter_map(pair).collect();
        return rings(&profile);
    }
    Vec::new()
}

fn float(value: &toml::Value) -> f64 {
    let whole = || value.as_integer().map(|i| i as f64);
    value.as_float().or_else(whole).unwrap_or(0.0)
}

fn vector(value: &toml::Value) -> [f64; 3] {
    let list = value.as_array().map_or(&[][..], Vec::as_slice);
    [0, 1, 2].map(|k| list.get(k).map_or(0.0, float))
}
