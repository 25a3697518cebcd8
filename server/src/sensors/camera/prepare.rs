//! Preparation of a renderer on the CPU.

use std::collections::BTreeMap;
use std::sync::Arc;

use wheelarm_proto::cache::Key;

use super::RenderError;
use super::buffers::Buffers;
use super::graphics::{Graphics, OpenDevice};
use super::packing::Packer;
use super::part_cache::Home;
use super::pipelines::Pipelines;
use super::scene::{Binding, RenderScene};
use super::spec::CameraSpec;
use super::surroundings::Surroundings;
use super::tier::Tier;
use crate::geometry::texture::Image;
use wheelarm_proto::parallel;

/// Checks that the cameras fit the scene.
pub(super) fn check_cameras(
    scene: &RenderScene,
    cameras: &[CameraSpec],
) -> Result<(), RenderError> {
    for camera in cameras {
        camera.check()?;
        let count = match camera.binding {
            Binding::World => usize::MAX,
            Binding::Link(_) => scene.links,
            Binding::Object(_) => scene.objects,
            Binding::Sliding(_) => scene.sliding,
        };
        if let Binding::Link(i) | Binding::Object(i) | Binding::Sliding(i) = camera.binding
            && i >= count
        {
            return Err(RenderError::BadCamera {
                camera: camera.name.clone(),
                reason: format!("it is on body {i}, there are {count}"),
            });
        }
    }
    Ok(())
}

/// Data of a renderer before the upload.
pub(super) struct PreparedScene {
    pub(super) opened: OpenDevice,
    pub(super) pipelines: Arc<Pipelines>,
    pub(super) packer: Option<Arc<Packer>>,
    pub(super) surroundings: Arc<Surroundings>,
    pub(super) buffers: Buffers,
    /// Decoded images that are not uploaded yet.
    pub(super) images: BTreeMap<Key, Image>,
}

/// Computes everything that needs no adapter, while the driver starts and compiles.
pub(super) fn prepare(
    scene: &RenderScene,
    tier: Tier,
    graphics: &Graphics,
) -> Result<PreparedScene, RenderError> {
    std::thread::scope(|scope| {
        let arranging = scope.spawn(|| {
            // First, while there is little else in memory.
            let store = graphics.parts().store();
            let images = graphics.patterns().missing(&scene.textures, store);
            let home = Home::new(scene);
            let surroundings = graphics.parts().surroundings(&home, scene);
            let mut light = graphics.last_home().take(&surroundings);
            let buffers = Buffers::new(scene, (&home, &mut light), tier, graphics.parts());
            graphics.last_home().keep(light);
            (surroundings, buffers, images)
        });
        let opened = graphics.open(tier);
        let (surroundings, buffers, images) = parallel::joined(arranging);
        let (opened, pipelines, packer) = opened?;
        Ok(PreparedScene {
            opened,
            pipelines,
            packer,
            surroundings,
            buffers,
            images: images?,
        })
    })
}
