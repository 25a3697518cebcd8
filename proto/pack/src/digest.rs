//! Digests of packs.
//!
//! The physics digest is the BLAKE3 hash of the values of `home.toml`, `kinds`, `objects`,
//! `areas` and `tasks`: comments, the order of keys and the spelling of numbers do not change
//! it. The rendering digest is that of the bytes of meshes, textures and materials. Both
//! contain the path and the length of every file, in the order of the paths.

use std::collections::BTreeMap;

use toml::Value;

use crate::error::PackError;
use crate::path::{self, Group};

/// A BLAKE3 hash.
pub type Digest = [u8; 32];

/// Physics and rendering digest of the files of a pack.
pub(crate) fn digests(files: &BTreeMap<String, Vec<u8>>) -> Result<[Digest; 2], PackError> {
    let mut physics = blake3::Hasher::new();
    let mut rendering = blake3::Hasher::new();
    physics.update(b"wheelarm pack physics 1");
    rendering.update(b"wheelarm pack rendering 1");
    for (path, bytes) in files {
        match path::group(path)? {
            Group::Physics => {
                let mut canonical = Vec::new();
                let table: toml::Table = crate::pack::parse(path, bytes)?;
                write(&Value::Table(table), &mut canonical);
                add(&mut physics, path, &canonical);
            }
            Group::Rendering => add(&mut rendering, path, bytes),
            Group::Other => {}
        }
    }
    Ok([physics, rendering].map(|hasher| hasher.finalize().into()))
}

fn add(hasher: &mut blake3::Hasher, path: &str, bytes: &[u8]) {
    for part in [path.as_bytes(), bytes] {
        hasher.update(&(part.len() as u64).to_le_bytes());
        hasher.update(part);
    }
}

/// The canonical form of a value: a letter for its type, its length, its content. Whole numbers
/// are written as `f64`, tables in the order of their keys.
fn write(value: &Value, out: &mut Vec<u8>) {
    let text = |letter: u8, text: &str, out: &mut Vec<u8>| {
        out.push(letter);
        out.extend((text.len() as u64).to_le_bytes());
        out.extend(text.as_bytes());
    };
    let number = |number: f64, out: &mut Vec<u8>| {
        out.push(b'n');
        // -0 and 0 are equal numbers.
        out.extend((number + 0.0).to_bits().to_le_bytes());
    };
    match value {
        Value::String(string) => text(b's', string, out),
        Value::Integer(integer) => number(*integer as f64, out),
        Value::Float(float) => number(*float, out),
        Value::Boolean(boolean) => out.extend([b'b', u8::from(*boolean)]),
        Value::Datetime(date) => text(b'd', &date.to_string(), out),
        Value::Array(entries) => {
            out.push(b'a');
            out.extend((entries.len() as u64).to_le_bytes());
            for entry in entries {
                write(entry, out);
            }
        }
        Value::Table(table) => {
            out.push(b't');
            out.extend((table.len() as u64).to_le_bytes());
            let sorted: BTreeMap<&String, &Value> = table.iter().collect();
            for (key, value) in sorted {
                text(b'k', key, out);
                write(value, out);
            }
        }
    }
}

/// 64 hexadecimal digits.
#[must_use]
pub fn to_hex(digest: &Digest) -> String {
    blake3::Hash::from_bytes(*digest).to_hex().to_string()
}

/// The digest of 64 hexadecimal digits; `None` for another text.
#[must_use]
pub fn from_hex(text: &str) -> Option<Digest> {
    blake3::Hash::from_hex(text).ok().map(Into::into)
}
