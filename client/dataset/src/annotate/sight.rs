//! Which cameras show an object, a drawer or a finger tip at a time, by instance id.

use crate::ids::VISIBLE_PIXELS;
use crate::read::{Episode, ReadError};

/// Cameras with whether each shows each instance.
type Shown = Vec<(String, Vec<bool>)>;

/// Objects that the cameras show at some times.
#[derive(Clone, Debug, Default)]
pub struct Sight {
    names: Vec<String>,
    /// Time by camera: the camera, and whether each name is visible.
    times: Vec<(u64, Shown)>,
}

impl Sight {
    /// Reads what cameras with instance ids show of `names` at `stamps`. A name counts
    /// as visible when it is in both the last image until then and the first one from
    /// then on, so that a row of either shows it.
    ///
    /// # Errors
    /// When images cannot be read.
    pub fn read(episode: &Episode, names: Vec<String>, stamps: &[u64]) -> Result<Self, ReadError> {
        let legend = episode.snapshot()?.instances;
        let id = |name: &String| legend.iter().find(|i| i.name == *name).map_or(0, |i| i.id);
        let ids: Vec<u32> = names.iter().map(id).collect();
        let mut times: Vec<(u64, Shown)> =
            stamps.iter().map(|&stamp| (stamp, Vec::new())).collect();
        for name in episode.cameras()? {
            let camera = episode.camera(&name)?;
            if !camera.has_ids() || camera.is_empty() {
                continue;
            }
            let taken = camera.stamps();
            for (stamp, cameras) in &mut times {
                let next = taken.partition_point(|t| *t < *stamp);
                let last = taken.partition_point(|t| *t <= *stamp);
                // Visibility needs an image before and after.
                let (Some(before), true) = (last.checked_sub(1), next < taken.len()) else {
                    continue;
                };
                let mut shown = visible(&camera.ids(episode, before)?, &ids);
                if next != before {
                    let after = visible(&camera.ids(episode, next)?, &ids);
                    for (both, after) in shown.iter_mut().zip(after) {
                        *both &= after;
                    }
                }
                cameras.push((name.clone(), shown));
            }
        }
        Ok(Self { names, times })
    }

    /// The cameras that show all of these at a time, in the order of their names.
    #[must_use]
    pub fn cameras(&self, stamp: u64, wanted: &[&str]) -> Vec<String> {
        let Some((_, cameras)) = self.times.iter().find(|(time, _)| *time == stamp) else {
            return Vec::new();
        };
        let places: Option<Vec<usize>> = wanted
            .iter()
            .map(|wanted| self.names.iter().position(|name| name == wanted))
            .collect();
        let Some(places) = places.filter(|places| !places.is_empty()) else {
            return Vec::new();
        };
        let shows = cameras
            .iter()
            .filter(|(_, visible)| places.iter().all(|&i| visible[i]));
        shows.map(|(camera, _)| camera.clone()).collect()
    }
}

/// Whether each id has enough pixels.
fn visible(pixels: &[u16], ids: &[u32]) -> Vec<bool> {
    let mut counts = vec![0; ids.len()];
    for pixel in pixels {
        let own = ids
            .iter()
            .position(|id| *id != 0 && *id == u32::from(*pixel));
        if let Some(own) = own {
            counts[own] += 1;
        }
    }
    counts
        .into_iter()
        .map(|count| count >= VISIBLE_PIXELS)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_instance_with_few_pixels_or_without_an_id_is_not_visible() {
        let mut pixels = vec![7; VISIBLE_PIXELS];
        pixels.extend(vec![9; VISIBLE_PIXELS - 1]);
        pixels.extend(vec![0; 100]);
        assert_eq!(visible(&pixels, &[7, 9, 0]), [true, false, false]);
    }

    #[test]
    fn camera_is_used_for_a_question_only_when_it_shows_all_objects() {
        let names = ["mug", "bowl"].map(str::to_owned).to_vec();
        let visible = vec![
            ("gen3".to_owned(), vec![true, false]),
            ("chair".to_owned(), vec![true, true]),
        ];
        let sight = Sight {
            names,
            times: vec![(5, visible)],
        };
        assert_eq!(sight.cameras(5, &["mug"]), ["gen3", "chair"]);
        assert_eq!(sight.cameras(5, &["mug", "bowl"]), ["chair"]);
        assert!(sight.cameras(5, &["knife"]).is_empty());
        assert!(sight.cameras(5, &[]).is_empty() && sight.cameras(6, &["mug"]).is_empty());
    }
}
