//! Where what a task is about is: for a network that learns to find it beside what it
//! learns to do. No robot knows this; it stands beside rows of training and in none
//! of a policy.

use wheelarm_proto::exact;

use super::Recording;
use crate::annotate::{self, State};
use crate::pose;

/// Points of a row: the thing of the task, and where it is to be put.
pub const POINTS: [&str; 2] = ["thing", "goal"];
/// Numbers of a point that no camera tells: its place in the frame of the arm's base.
const SPACE: [&str; 3] = ["x", "y", "z"];

/// Names of the numbers in a row: for each point x, y, z in the frame of the arm's
/// base, metres, then for each camera u and v, shares of the picture's width and
/// height from its left and top edge.
#[must_use]
pub fn names<'a>(cameras: impl Iterator<Item = &'a str> + Clone) -> Vec<String> {
    let of_point = |point: &'static str| {
        let space = SPACE.map(|axis| format!("{point}.{axis}"));
        let seen = cameras.clone().flat_map(move |camera| {
            ["u", "v"].map(|coordinate| format!("{point}.{camera}.{coordinate}"))
        });
        space.into_iter().chain(seen)
    };
    POINTS.into_iter().flat_map(of_point).collect()
}

/// The numbers of [`names`] in each row of the alignment that is given. NaN for a
/// point that the task does not have, and for pixels of a point behind the camera;
/// what is out of the picture or hidden in it has pixels like any other. Places are
/// those of the row, pixels those of the exposure that the row's picture shows.
///
/// # Errors
/// When the recording tells no state of objects, or a row has no picture.
pub fn rows(
    recording: &Recording,
    rows: &[usize],
    cameras: &[&str],
) -> anyhow::Result<Vec<Vec<f64>>> {
    let state = State::read(&recording.episode)?;
    let object = state.objects.iter().position(|name| *name == state.target);
    let slides = &state.home.slides;
    let slide = slides.iter().position(|slide| slide.name == state.target);
    let middle = annotate::middle(&state, &state.target);
    let goal = state.home.goals.iter().find(|goal| goal.0 == state.goal);
    let goal = goal.map(|(_, _, area, _)| {
        let (sin, cos) = exact::sin_cos(area.inwards);
        let half = area.depth / 2.0;
        let [x, y, z] = area.edge;
        [x + cos * half, y + sin * half, z]
    });
    let thing = |sample: usize| -> Option<[f64; 3]> {
        if let Some(object) = object {
            return Some(pose::point(state.poses.get(sample)?.get(object)?, middle));
        }
        let slide = slide?;
        let open = *state.slides.get(sample)?.get(slide)?;
        let slide = &slides[slide];
        Some([0, 1, 2].map(|k| slide.origin[k] + slide.axis[k] * open))
    };
    let last = state.stamps.len().saturating_sub(1);
    let sample = |stamp: u64| state.stamps.partition_point(|&t| t < stamp).min(last);
    let mut out = Vec::with_capacity(rows.len());
    for &row in rows {
        let now = sample(recording.aligned.stamps[row]);
        let base = state.base.get(now).copied();
        let mut numbers = Vec::new();
        for place in [&thing as &dyn Fn(usize) -> Option<[f64; 3]>, &|_| goal] {
            let here = base.zip(place(now));
            let here = here.map(|(base, found)| pose::point(&pose::inverse(&base), found));
            numbers.extend(here.unwrap_or([f64::NAN; 3]));
            for camera in cameras {
                let shown = recording.shown(camera, row)?;
                let pixel = shown.and_then(|(camera, index)| {
                    let found = place(sample(camera.stamps()[index]))?;
                    let (width, height) = camera.size()?;
                    let (lens, at) = (camera.intrinsics(index), camera.pose(index));
                    let [u, v] = pose::project(&lens, &at, found)?;
                    Some([u / width as f64, v / height as f64])
                });
                numbers.extend(pixel.unwrap_or([f64::NAN; 2]));
            }
        }
        out.push(numbers);
    }
    Ok(out)
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
