//! Imports homes of Sweet Home 3D (`.sh3d`) and meshes of objects ([`object`]) as world packs,
//! and shows the report on a home ([`home_report`]).
//!
//! ```text
//! archive ─► sh3d (Home.xml) ─► plan: level, walls, openings ─► rooms
//!        └─► model (OBJ, MTL) ─► fit ─► solid, surfaces, joints, glb ─► build ─► Pack
//! ```
//! Units: `sh3d` has the centimetres of the file; everything else metres, z up, angles
//! counter-clockwise. Equal files and options give equal bytes on every machine: arithmetic is
//! that of `wheelarm_proto::exact`, and all collections are ordered.
//!
//! Files are foreign: every reader bounds the number and size of what it reads. A damaged model
//! costs its piece alone; it is listed in [`Summary::left_out`].

#![warn(missing_docs)]

pub mod archive;
mod build;
mod error;
mod fit;
mod glb;
pub mod home_report;
mod joints;
mod model;
pub mod object;
mod paint;
mod place;
mod plan;
mod polygon;
mod raster;
mod rooms;
pub mod sh3d;
mod simplify;
mod solid;
mod store;
mod surfaces;
mod texture;
mod words;
pub mod xml;

use std::collections::BTreeMap;
use std::path::Path;

pub use build::{Imported, Joints, LeftOut, Options, Summary};
pub use error::{ImportError, ModelError};
pub use store::write;
pub use words::slug;

/// Imports the bytes of a `.sh3d` file. `file` is its name in errors and in the origin.
///
/// # Errors
/// When the bytes are not such a file, exceed a limit, or the home has no such level, no walls
/// or no rooms.
pub fn import(file: &str, bytes: Vec<u8>, options: &Options) -> Result<Imported, ImportError> {
    if wheelarm_proto::keys::check_name(&options.name).is_err() {
        return Err(ImportError::Option {
            option: "--name",
            value: options.name.clone(),
            expected: "1 to 64 letters, digits, `-` or `_`, for example anna-flat".into(),
        });
    }
    let (home, mut archive) = sh3d::open(file, bytes)?;
    build::assemble(file, &home, &mut archive, options)
}

/// Imports a `.sh3d` file.
///
/// # Errors
/// As [`import`], and when the file cannot be read.
pub fn import_file(path: &Path, options: &Options) -> Result<Imported, ImportError> {
    let unreadable = |reason: String| ImportError::Unreadable {
        path: path.display().to_string(),
        reason,
    };
    let about = std::fs::metadata(path).map_err(|error| unreadable(error.to_string()))?;
    let name = path
        .file_name()
        .map(|name| name.to_string_lossy().into_owned());
    let name = name.unwrap_or_else(|| path.display().to_string());
    if about.len() > archive::MAX_FILE {
        return Err(ImportError::Unsafe {
            file: name,
            reason: format!(
                "{} MiB, at most {} MiB are read; leave out unused models",
                about.len() >> 20,
                archive::MAX_FILE >> 20
            ),
        });
    }
    let bytes = std::fs::read(path).map_err(|error| unreadable(error.to_string()))?;
    import(&name, bytes, options)
}

impl Summary {
    /// The pieces that are not in the pack, those with one reason together: reason, names with
    /// their numbers.
    #[must_use]
    pub fn left_out_by_reason(&self) -> BTreeMap<&str, BTreeMap<&str, usize>> {
        let mut by: BTreeMap<&str, BTreeMap<&str, usize>> = BTreeMap::new();
        for left in &self.left_out {
            let names = by.entry(left.reason.as_str()).or_default();
            *names.entry(left.name.as_str()).or_default() += 1;
        }
        by
    }
}
