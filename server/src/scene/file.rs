//! Layout of the TOML files: one struct per table, which packs share
//! (`wheelarm_pack`). Only the keys are checked.

pub(super) use wheelarm_pack::{
    FurnitureEntry, GraspEntry, HandleEntry, HingeEntry, LightEntry, LobeEntry, MaterialEntry,
    MaterialFile, ObjectEntry, ObjectFile, PartEntry, PlaceEntry, RoomCameraEntry, SceneFile,
    SlideEntry,
};
