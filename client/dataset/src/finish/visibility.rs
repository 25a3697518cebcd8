//! Whether the first images show the target of the task.

use hdf5::{File, Group};
use ndarray::s;

use crate::hdf::Attributes;
use crate::ids::VISIBLE_PIXELS;
use crate::log::Preamble;

/// Pixels of the target in the first image of each camera.
#[derive(Debug, Default)]
pub(super) struct Visibility {
    /// Instance ID of the target; `None` where the scenario has none.
    id: Option<u16>,
    first: Vec<usize>,
}

impl Visibility {
    /// Of the episode that begins with `preamble`.
    pub(super) fn new(preamble: &Preamble) -> Self {
        let started = preamble.started.clone().unwrap_or_default();
        let target = started
            .scenario
            .unwrap_or_default()
            .target
            .unwrap_or_default();
        let snapshot = preamble.snapshot.iter();
        let mut instances = snapshot.flat_map(|state| &state.instances);
        let found = instances.find(|instance| !target.is_empty() && instance.name == target);
        Self {
            id: found.and_then(|instance| u16::try_from(instance.id).ok()),
            first: Vec::new(),
        }
    }

    /// Counts the target's pixels in the first image of a camera.
    pub(super) fn add(&mut self, camera: &Group) -> hdf5::Result<()> {
        let Some(id) = self.id else {
            return Ok(());
        };
        let Ok(ids) = camera.dataset("ids") else {
            return Ok(());
        };
        if ids.shape().first().is_none_or(|count| *count == 0) {
            return Ok(());
        }
        let first = ids.read_slice::<u16, _, ndarray::Ix2>(s![0, .., ..])?;
        let pixels = first.iter().filter(|found| **found == id).count();
        Attributes::for_object(camera).set("target_pixels_in_first_image", pixels as u64)?;
        self.first.push(pixels);
        Ok(())
    }

    /// Writes whether any first image shows the target; nothing where no camera
    /// has instance IDs or the scenario no target.
    pub(super) fn finish(&self, file: &File) -> hdf5::Result<()> {
        if !self.first.is_empty() {
            let visible = self.first.iter().any(|pixels| *pixels >= VISIBLE_PIXELS);
            Attributes::for_object(file).set("target_in_first_images", visible)?;
        }
        Ok(())
    }
}
