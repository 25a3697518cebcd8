//! Keypoint targets: positions of the task's object and goal, an auxiliary target for a
//! policy network. No robot has this; it is stored beside training rows and in none
//! of a policy.

use wheelarm_proto::exact;

use super::Recording;
use crate::annotate::{self, State};
use crate::pose;

/// Points of a row: the task's object and its goal.
pub const POINTS: [&str; 2] = ["thing", "goal"];
/// Numbers of a point that no camera gives: its position in the frame of the arm's base.
const SPACE: [&str; 3] = ["x", "y", "z"];

/// Names of the numbers in a row: for each point x, y, z in the frame of the arm's
/// base, metres, then for each camera u and v, shares of the image's width and
/// height from its left and top edge.
#[must_use]
pub fn names<'a>(cameras: impl Iterator<Item = &'a str> + Clone) -> Vec<String> {
    let of_point = |point: &'static str| {
        let space = SPACE.map(|axis| format!("{point}.{axis}"));
        let pixels = cameras.clone().flat_map(move |camera| {
            ["u", "v"].map(|coordinate| format!("{point}.{camera}.{coordinate}"))
        });
        space.into_iter().chain(pixels)
    };
    POINTS.into_iter().flat_map(of_point).collect()
}

/// Positions of objects in the rows of an alignment.
pub struct KeypointTargets {
    /// Rows by the numbers of [`names`].
    pub rows: Vec<Vec<f64>>,
    /// The target of the task: one of `objects`.
    pub object: String,
    /// All possible targets, objects and slides, in the order of their names.
    pub objects: Vec<String>,
    /// Rows by target, each x, y, z, then u and v of each camera as in [`names`].
    pub of_objects: Vec<Vec<f64>>,
}

/// The places in each row of the alignment that is given. NaN for a point that the
/// task does not have, and for pixels of a point behind the camera; what is out of
/// the image or hidden in it has pixels like any other. Places are those of the
/// row, pixels those of the exposure that the row's image shows.
///
/// # Errors
/// When the recording has no state of objects, or a row has no image.
pub fn read(
    recording: &Recording,
    rows: &[usize],
    cameras: &[&str],
) -> anyhow::Result<KeypointTargets> {
    let state = State::read(&recording.episode)?;
    let slides = state.home.slides.iter().map(|slide| slide.name.as_str());
    let names = state.objects.iter().map(String::as_str).chain(slides);
    let names: std::collections::BTreeSet<&str> = names.collect();
    let all: Vec<Point<'_>> = names
        .iter()
        .map(|name| object_point(&state, name))
        .collect();
    let points = [object_point(&state, &state.target), goal(&state)];

    let last = state.stamps.len().saturating_sub(1);
    let sample = |stamp: u64| state.stamps.partition_point(|&t| t < stamp).min(last);
    let mut out = KeypointTargets {
        rows: Vec::with_capacity(rows.len()),
        object: state.target.clone(),
        objects: names.iter().map(ToString::to_string).collect(),
        of_objects: Vec::with_capacity(rows.len()),
    };
    for &row in rows {
        let now = sample(recording.aligned.stamps[row]);
        let base = state.base.get(now).copied();
        let mut views = Vec::new();
        for camera in cameras {
            views.push(recording.shown(camera, row)?);
        }
        let numbers = |place: &Point<'_>| {
            let here = base.zip(place(now));
            let here = here.map(|(base, found)| pose::point(&pose::inverse(&base), found));
            let mut numbers = here.unwrap_or([f64::NAN; 3]).to_vec();
            for view in &views {
                let pixel = view.and_then(|(camera, index)| {
                    let found = place(sample(camera.stamps()[index]))?;
                    let (width, height) = camera.size()?;
                    let (lens, at) = (camera.intrinsics(index), camera.pose(index));
                    let [u, v] = pose::project(&lens, &at, found)?;
                    Some([u / width as f64, v / height as f64])
                });
                numbers.extend(pixel.unwrap_or([f64::NAN; 2]));
            }
            numbers
        };
        out.rows.push(points.iter().flat_map(&numbers).collect());
        out.of_objects.push(all.iter().flat_map(&numbers).collect());
    }
    Ok(out)
}

/// A position in `house` by the sample of the state, metres; `None` without one.
type Point<'a> = Box<dyn Fn(usize) -> Option<[f64; 3]> + 'a>;

/// The middle of an object, or the handle of furniture on a joint.
fn object_point<'a>(state: &'a State, name: &str) -> Point<'a> {
    if let Some(object) = state.objects.iter().position(|object| object == name) {
        let middle = annotate::middle(state, name);
        return Box::new(move |sample| {
            Some(pose::point(state.poses.get(sample)?.get(object)?, middle))
        });
    }
    let slides = &state.home.slides;
    let slide = slides.iter().position(|slide| slide.name == name);
    Box::new(move |sample| {
        let slide = slide?;
        let open = *state.slides.get(sample)?.get(slide)?;
        let slide = &slides[slide];
        if slide.turns {
            let [x, y, z] = slide.origin;
            let [i, j, k, w] = pose::about(slide.axis, open);
            let arm = [0, 1, 2].map(|k| slide.handle[k] - slide.origin[k]);
            return Some(pose::point(&[x, y, z, i, j, k, w], arm));
        }
        Some([0, 1, 2].map(|k| slide.handle[k] + slide.axis[k] * open))
    })
}

/// The middle of the goal area.
fn goal(state: &State) -> Point<'_> {
    let goal = state.home.goals.iter().find(|goal| goal.0 == state.goal);
    let goal = goal.map(|(_, _, area, _)| {
        let (sin, cos) = exact::sin_cos(area.inwards);
        let half = area.depth / 2.0;
        let [x, y, z] = area.edge;
        [x + cos * half, y + sin * half, z]
    });
    Box::new(move |_| goal)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_named_point_by_point_and_camera_by_camera() {
        let names = names(["gen3", "wheelchair"].into_iter());
        assert_eq!(names.len(), 14);
        assert_eq!(names[..3], ["thing.x", "thing.y", "thing.z"]);
        assert_eq!(names[3..5], ["thing.gen3.u", "thing.gen3.v"]);
        assert_eq!(names[13], "goal.wheelchair.v");
    }
}
