//! Scenes of world packs, and the texts about them that recordings list.

use std::path::Path;
use std::sync::Arc;

use wheelarm_pack::{FurnitureEntry, HandleEntry, HomeFile, Pack, PlaceEntry, RoomEntry, contains};

use super::error::{Place, SceneError};
use super::file::SceneFile;
use super::{AssetText, Scene};

impl Scene {
    /// The home of a world pack. Materials and objects that the pack lacks are those of the
    /// assets.
    ///
    /// # Errors
    /// When the pack has no home, or a value is invalid.
    pub fn from_pack(assets: &Path, pack: &Arc<Pack>) -> Result<Self, SceneError> {
        let name = &pack.id().name;
        let path = pack.asset_path("home.toml");
        let file = scene_file(pack)?;
        Self::from_file(assets, Some(pack), name, &path, &file)
    }

    /// The kind or name of the room of the pack's home at a point; empty outside of rooms.
    #[must_use]
    pub fn room_at(&self, at: [f64; 2]) -> String {
        let home = self.pack.as_ref().and_then(|pack| pack.home());
        let mut rooms = home.into_iter().flat_map(|home| &home.room);
        let room = rooms.find(|room| contains(&room.outline, at));
        room.map(kind_of_room).unwrap_or_default()
    }

    /// Texts for readers of recordings that need no shapes: the scene of a pack as a scene file
    /// without parts, the objects of that pack, and those of the object packs.
    #[must_use]
    pub fn packed_texts(&self) -> Vec<AssetText> {
        let objects = self.object_packs.iter().flat_map(|pack| object_texts(pack));
        self.scene_texts().into_iter().chain(objects).collect()
    }

    fn scene_texts(&self) -> Vec<AssetText> {
        let Some((pack, Ok(file))) = self.pack.as_ref().map(|pack| (pack, scene_file(pack))) else {
            return Vec::new();
        };
        let outline = SceneFile {
            furniture: file.furniture.into_iter().map(without_shapes).collect(),
            ..file
        };
        let scene = toml::to_string(&outline).ok().map(|text| AssetText {
            path: format!("scenes/{}.toml", self.name),
            text,
        });
        scene.into_iter().chain(object_texts(pack)).collect()
    }
}

/// The object files of a pack.
fn object_texts(pack: &Pack) -> impl Iterator<Item = AssetText> {
    pack.names("objects", "toml").filter_map(|name| {
        let path = format!("objects/{name}.toml");
        let text = String::from_utf8_lossy(pack.file(&path)?).into_owned();
        Some(AssetText { path, text })
    })
}

/// The home of a pack as a scene file.
fn scene_file(pack: &Pack) -> Result<SceneFile, SceneError> {
    let path = pack.asset_path("home.toml");
    let Some(home) = pack.home() else {
        return Err(Place::file(&path).key("home.toml").wrong(
            "absent",
            "a pack with a home",
            "name another scene: this pack has furniture or objects only",
        ));
    };
    Ok(SceneFile {
        origin: home.origin.clone(),
        license: home.license.clone(),
        light: home.light.clone(),
        room_camera: home.room_camera.clone(),
        start: home.start.clone(),
        furniture: pack.furniture().map_err(Box::new)?,
        object: home.object.clone(),
        place: (home.place.iter())
            .map(|place| PlaceEntry {
                room: spoken(home, place.room.as_deref()),
                ..place.clone()
            })
            .collect(),
        handle: (home.handle.iter())
            .map(|handle| HandleEntry {
                room: spoken(home, handle.room.as_deref()),
                ..handle.clone()
            })
            .collect(),
    })
}

/// The kind of the room with this name, or the name of a room of unknown kind.
fn spoken(home: &HomeFile, room: Option<&str>) -> Option<String> {
    room.map(|name| {
        let found = home.room.iter().find(|room| room.name == name);
        found.map_or_else(|| name.to_owned(), kind_of_room)
    })
}

/// The kind of a room, or its name.
fn kind_of_room(room: &RoomEntry) -> String {
    match room.kind.as_str() {
        "" => room.name.clone(),
        kind => kind.to_owned(),
    }
}

fn without_shapes(furniture: FurnitureEntry) -> FurnitureEntry {
    FurnitureEntry {
        parts: Vec::new(),
        collision: None,
        ..furniture
    }
}
