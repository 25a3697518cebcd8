//! A mesh as it was read, and what readers share.

use std::io::Read;
use std::path::Path;

use super::error::ObjectError;
use super::mesh::{Face, Mesh, Vec3};
use crate::model::MOST_TRIANGLES;

/// Largest file that is read, bytes.
pub const MOST_BYTES: u64 = 128 << 20;

/// The axis of a file that points up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Up {
    /// As in glTF and most OBJ files.
    Y,
    /// As in most STL files.
    Z,
}

impl Up {
    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Y => "y",
            Self::Z => "z",
        }
    }

    /// A point with z up.
    pub fn upright(self, [x, y, z]: [f64; 3]) -> Vec3 {
        match self {
            Self::Y => Vec3::new(x, -z, y),
            Self::Z => Vec3::new(x, y, z),
        }
    }
}

impl std::str::FromStr for Up {
    type Err = String;

    fn from_str(word: &str) -> Result<Self, String> {
        match word {
            "y" | "Y" => Ok(Self::Y),
            "z" | "Z" => Ok(Self::Z),
            _ => Err(format!("unknown axis {word:?}; available: y, z")),
        }
    }
}

/// A mesh in the units of its file, and what the format states about them.
#[derive(Clone, Debug)]
pub struct Source {
    /// Its triangles.
    pub mesh: Mesh,
    /// Metres per unit, when the format defines it.
    pub metres: Option<f64>,
    /// Axis that the format defines, or that is usual for it.
    pub up: Up,
    /// Whether the format defines the axis.
    pub up_is_defined: bool,
    /// What was not used.
    pub notes: Vec<String>,
}

/// Reads a file that is named in another one, beside it.
pub type Beside<'a> = &'a dyn Fn(&str) -> Result<Vec<u8>, String>;

/// The bytes of a file within the limit.
pub fn bytes(path: &Path) -> Result<Vec<u8>, ObjectError> {
    let unreadable = |reason: String| ObjectError::Unreadable {
        path: path.display().to_string(),
        reason,
    };
    let file = std::fs::File::open(path).map_err(|error| unreadable(error.to_string()))?;
    let mut bytes = Vec::new();
    file.take(MOST_BYTES + 1)
        .read_to_end(&mut bytes)
        .map_err(|error| unreadable(error.to_string()))?;
    if bytes.len() as u64 > MOST_BYTES {
        return Err(unreadable(format!(
            "more than {} MiB; simplify the mesh",
            MOST_BYTES >> 20
        )));
    }
    Ok(bytes)
}

/// The message for a mesh above the limit.
pub fn too_many() -> String {
    format!("more than {MOST_TRIANGLES} triangles; simplify the mesh")
}

/// A triangle of these points.
pub fn face(corners: [[f64; 3]; 3], uvs: Option<[[f32; 2]; 3]>, surface: usize) -> Face {
    Face {
        corners: corners.map(Vec3::from),
        uvs,
        surface,
    }
}
