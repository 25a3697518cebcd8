//! The path of the hand in an image: the end effector at the next steps, in the
//! pixels of the camera at its current pose.

use super::state::State;
use crate::pose::project;
use crate::read::{Episode, ReadError};

/// Steps ahead, the image's own time first.
pub const STEPS: usize = 16;

/// The path of the hand in the images of a camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Trace {
    /// The camera.
    pub camera: String,
    /// Column and row, pixels from the left and top edge: image by step. NaN
    /// behind the camera and after the end.
    pub pixels: Vec<[[f64; 2]; STEPS]>,
}

/// Traces in all cameras; a step is the time from an image to the next.
pub(super) fn traces(episode: &Episode, state: &State) -> Result<Vec<Trace>, ReadError> {
    let mut out = Vec::new();
    for camera in episode.cameras()? {
        let images = episode.camera(&camera)?;
        let stamps = images.stamps();
        let hand = |stamp: u64| {
            let row = state.stamps.partition_point(|&t| t < stamp);
            state.hand.get(row).map(|hand| [hand[0], hand[1], hand[2]])
        };
        let of_image = |i: usize| {
            let (lens, at) = (images.intrinsics(i), images.pose(i));
            std::array::from_fn(|step| {
                let then = stamps.get(i + step).and_then(|&stamp| hand(stamp));
                then.and_then(|point| project(&lens, &at, point))
                    .unwrap_or([f64::NAN; 2])
            })
        };
        let pixels = (0..images.len()).map(of_image).collect();
        out.push(Trace { camera, pixels });
    }
    Ok(out)
}
