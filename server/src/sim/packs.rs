//! World packs of a scenario: the one of its scene, and those whose objects tasks may place.

use std::path::Path;
use std::sync::Arc;

use wheelarm_pack::{Digest, Pack, PackName, to_hex};
use wheelarm_proto::settings::ObjectSplit;

use crate::scene::{Scene, SceneError};

/// The world pack of a scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum ScenePack {
    /// The scene is one of the assets, or of the first pack with its name.
    #[default]
    Search,
    /// The scene is that of the requested pack.
    Exactly(PackRequest),
    /// The scene is that of this pack.
    Open(Arc<Pack>),
}

/// A pack whose objects are part of the stock of tasks.
#[derive(Clone, Debug, PartialEq)]
pub enum ObjectPack {
    /// A requested pack.
    Requested(PackRequest),
    /// This pack.
    Open(Arc<Pack>),
}

impl ObjectPack {
    /// Whether it is the pack of a request.
    #[must_use]
    pub fn fits(&self, request: &PackRequest) -> bool {
        match self {
            Self::Requested(own) => own == request,
            Self::Open(pack) => request.fits(pack.id()),
        }
    }
}

/// A requested pack; `None` accepts any digest.
#[derive(Clone, Debug, PartialEq)]
pub struct PackRequest {
    /// Name.
    pub name: String,
    /// Version, for messages.
    pub version: String,
    /// Physics digest.
    pub physics: Option<Digest>,
    /// Rendering digest.
    pub rendering: Option<Digest>,
}

impl PackRequest {
    /// Whether a pack has the requested digests.
    #[must_use]
    pub fn fits(&self, id: &PackName) -> bool {
        self.name == id.name
            && self.physics.is_none_or(|digest| digest == id.physics)
            && self.rendering.is_none_or(|digest| digest == id.rendering)
    }
}

impl std::fmt::Display for PackRequest {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let short = |digest: &Option<Digest>| match digest {
            Some(digest) => to_hex(digest)[..16].to_owned(),
            None => "any".to_owned(),
        };
        write!(
            f,
            "{} {} (physics {}, rendering {})",
            self.name,
            self.version,
            short(&self.physics),
            short(&self.rendering)
        )
    }
}

/// The scene with this name, of the assets or of an open pack, with the objects of further open
/// packs as stock, as far as they are of the split.
///
/// # Errors
/// When a file is missing or a value is invalid.
pub fn load_scene(
    assets: &Path,
    name: &str,
    pack: &ScenePack,
    (objects, split): (&[ObjectPack], ObjectSplit),
) -> Result<Scene, SceneError> {
    let mut scene = match pack {
        ScenePack::Open(pack) => Scene::from_pack(assets, pack)?,
        ScenePack::Search | ScenePack::Exactly(_) => Scene::load(assets, name)?,
    };
    let open = objects.iter().filter_map(|pack| match pack {
        ObjectPack::Open(pack) => Some(Arc::clone(pack)),
        ObjectPack::Requested(_) => None,
    });
    scene.object_packs = open.collect();
    scene.object_split = split;
    Ok(scene)
}
