//! A file of a world pack, held in memory: meshes and textures of a scene from a pack.

use std::fmt;
use std::sync::Arc;

use wheelarm_pack::Pack;
use wheelarm_proto::cache::{self, Key};

/// A file of a pack.
#[derive(Clone)]
pub struct PackedFile {
    pack: Arc<Pack>,
    path: String,
    key: Key,
}

impl PackedFile {
    /// The file at `path` in a pack; `None` when the pack lacks it.
    #[must_use]
    pub fn find(pack: &Arc<Pack>, path: &str) -> Option<Self> {
        let bytes = pack.file(path)?;
        Some(Self {
            key: cache::key("file of a pack", &[path.as_bytes(), bytes]),
            pack: Arc::clone(pack),
            path: path.to_owned(),
        })
    }

    /// Its content.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        self.pack.file(&self.path).unwrap_or_default()
    }

    /// Its path in the pack.
    #[must_use]
    pub fn path(&self) -> &str {
        &self.path
    }

    /// Its path with the name of the pack, for messages.
    #[must_use]
    pub fn asset_path(&self) -> String {
        self.pack.asset_path(&self.path)
    }
}

/// Files with equal paths and contents are equal, whatever their packs are named.
impl PartialEq for PackedFile {
    fn eq(&self, other: &Self) -> bool {
        self.key == other.key
    }
}

/// Path and hash of the content: caches use this text as a key.
impl fmt::Debug for PackedFile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.path, wheelarm_pack::to_hex(&self.key))
    }
}
