//! World packs: homes, furniture kinds and object kinds that are not part of the assets.
//!
//! A pack is a folder, or a zip file of it:
//! ```text
//! pack.toml                    name, version, sources with author and license
//! home.toml                    a home: rooms, walls, openings, pieces (optional)
//! kinds/*.toml                 furniture: parts, collision, surfaces, joint, grasps
//! objects/*.toml               objects, as in the assets
//! materials/*.toml             materials, as in the assets
//! meshes/*.obj, meshes/*.glb   rendered only
//! textures/*.png               512 x 512, 8 bits, grey or RGB
//! report.json, plan.png        readiness report of the home (optional)
//! ```
//! [`Pack`] is a checked pack in memory, [`Store`] finds packs in folders, [`expand()`]
//! converts a home to the furniture of a scene file.
//!
//! Everything that reaches a state or a command is decimal text in `home.toml`, `kinds` and
//! `objects`: the physics digest covers these files. The rendering digest covers meshes,
//! textures and materials.
//!
//! Pure but for reading and writing packs: no clock, no random numbers, no messages.

#![warn(missing_docs)]

pub mod archive;
mod digest;
mod error;
mod expand;
mod folder;
pub mod indoors;
mod license;
mod pack;
mod path;
mod polygon;
mod store;
mod tables;

pub use digest::{Digest, from_hex, to_hex};
pub use error::PackError;
pub use expand::{MOST_HULL_VERTICES, expand};
pub use indoors::Indoors;
pub use license::{CommercialUse, NotCommercial, credit_lines};
pub use pack::{Pack, PackName};
pub use path::ASSET_PREFIX;
pub use polygon::{area, check_outline, contains};
pub use store::{Store, user_folder};
pub use tables::home::{HomeFile, OpeningEntry, OpeningKind, PieceEntry, RoomEntry, WallEntry};
pub use tables::kind::{JointEntry, KindFile};
pub use tables::manifest::{FORMAT, Manifest, SourceEntry, UNKNOWN};
pub use tables::material::{Family, MaterialEntry, MaterialFile, TextureEntry};
pub use tables::object::{GraspEntry, LobeEntry, ObjectFile, SoftEntry, StockEntry, TrialsEntry};
pub use tables::part::{
    CupEntry, FrustumEntry, MeshEntry, MeshScale, PartEntry, PrismEntry, RoundEntry,
    RoundedBoxEntry, SphereEntry,
};
pub use tables::place::{HandleEntry, PlaceEntry, StartRangesEntry};
pub use tables::scene::{
    FurnitureEntry, HingeEntry, LightEntry, ObjectEntry, RoomCameraEntry, SceneFile, SlideEntry,
    StartEntry, SurfaceEntry,
};
pub use wheelarm_proto::installed::PACKS_VARIABLE;
