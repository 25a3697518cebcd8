//! Files below the assets folder: names, texts, and provenance.

use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use wheelarm_pack::Pack;

use super::Scene;
use super::error::{Place, SceneError};

/// A text of the assets used by a scenario.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AssetText {
    /// Path below the assets folder, with `/`.
    pub path: String,
    /// The whole text.
    pub text: String,
}

/// The texts of files below the assets folder, in the order of `paths`. Other encodings
/// than UTF-8, as in names and comments of OBJ files, are replaced.
///
/// # Errors
/// When one of them cannot be read.
pub fn texts(assets: &Path, paths: &[String]) -> Result<Vec<AssetText>, SceneError> {
    paths
        .iter()
        .map(|path| {
            Ok(AssetText {
                text: String::from_utf8_lossy(&bytes(assets, path)?).into_owned(),
                path: path.clone(),
            })
        })
        .collect()
}

/// Names (without `.toml`) of the files in a folder of the assets, sorted.
pub(crate) fn names(assets: &Path, folder: &str) -> Result<Vec<String>, SceneError> {
    let full = assets.join(folder);
    let unreadable = |source| SceneError::Read {
        path: full.clone(),
        source,
        cure: "name the folder `assets` with --assets, or WHEELARM_ASSETS".to_owned(),
    };
    let mut names = Vec::new();
    for entry in std::fs::read_dir(&full).map_err(unreadable)? {
        let path: PathBuf = entry.map_err(unreadable)?.path();
        if path.extension().is_some_and(|e| e == "toml")
            && let Some(stem) = path.file_stem().and_then(|s| s.to_str())
        {
            names.push(stem.to_owned());
        }
    }
    names.sort();
    Ok(names)
}

/// The text of an asset.
///
/// # Errors
/// When it cannot be read.
pub(crate) fn text(assets: &Path, path: &str) -> Result<String, SceneError> {
    let bytes = bytes(assets, path)?;
    String::from_utf8(bytes).map_err(|error| {
        let source = std::io::Error::new(std::io::ErrorKind::InvalidData, error);
        unreadable(assets, path, source)
    })
}

fn bytes(assets: &Path, path: &str) -> Result<Vec<u8>, SceneError> {
    std::fs::read(assets.join(path)).map_err(|source| unreadable(assets, path, source))
}

fn unreadable(assets: &Path, path: &str, source: std::io::Error) -> SceneError {
    let folder = path.split('/').next().unwrap_or(path);
    let known = names(assets, folder).unwrap_or_default();
    let name = Path::new(path).file_stem().unwrap_or_default();
    let meant = did_you_mean(&name.to_string_lossy(), &known);
    SceneError::Read {
        path: assets.join(path),
        source,
        cure: format!("available {folder}: {}{meant}", known.join(", ")),
    }
}

/// Similarity (Jaro-Winkler, 0 to 1) from which a name is suggested.
const SUGGESTED_SIMILARITY: f64 = 0.85;

/// `; did you mean NAME?`, or nothing when no known name is similar.
pub(crate) fn did_you_mean(name: &str, known: &[String]) -> String {
    let similar = known
        .iter()
        .map(|known| (strsim::jaro_winkler(name, known), known));
    let likely = similar.filter(|(similarity, _)| (SUGGESTED_SIMILARITY..1.0).contains(similarity));
    let nearest = likely.max_by(|(a, _), (b, _)| a.total_cmp(b));
    nearest.map_or_else(String::new, |(_, known)| format!("; did you mean {known}?"))
}

/// An asset as its file type.
pub(crate) fn parse<T: DeserializeOwned>(assets: &Path, path: &str) -> Result<T, SceneError> {
    toml::from_str(&text(assets, path)?).map_err(|source| SceneError::Parse {
        file: path.to_owned(),
        source: Box::new(source),
        cure: "correct the key or the value at the mark".to_owned(),
    })
}

/// Files of a scene: those of its pack, then those of the assets.
#[derive(Clone, Copy)]
pub(crate) struct Files<'a> {
    assets: &'a Path,
    pack: Option<&'a Pack>,
}

impl<'a> Files<'a> {
    /// Of the assets alone.
    pub(crate) fn of_assets(assets: &'a Path) -> Self {
        Self { assets, pack: None }
    }

    /// Of the scene.
    pub(crate) fn of_scene(assets: &'a Path, scene: &'a Scene) -> Self {
        let pack = scene.pack.as_deref();
        Self { assets, pack }
    }

    /// Names (without `.toml`) of the files in a folder, sorted.
    pub(crate) fn names(&self, folder: &str) -> Result<Vec<String>, SceneError> {
        let mut all = names(self.assets, folder)?;
        let packed = self.pack.into_iter();
        all.extend(packed.flat_map(|p| {
            p.names(folder, "toml")
                .map(str::to_owned)
                .collect::<Vec<_>>()
        }));
        all.sort();
        all.dedup();
        Ok(all)
    }

    /// Whether there is a file.
    pub(crate) fn contains(&self, path: &str) -> bool {
        let is_packed = self.pack.is_some_and(|pack| pack.file(path).is_some());
        is_packed || self.assets.join(path).is_file()
    }

    /// A file as its file type.
    pub(crate) fn parse<T: DeserializeOwned>(&self, path: &str) -> Result<T, SceneError> {
        match self.pack.filter(|pack| pack.file(path).is_some()) {
            Some(pack) => parse_packed(pack, path),
            None => parse(self.assets, path),
        }
    }
}

/// A file of a pack as its file type.
pub(crate) fn parse_packed<T: DeserializeOwned>(pack: &Pack, path: &str) -> Result<T, SceneError> {
    let bytes = pack.file(path).unwrap_or_default();
    toml::from_str(&String::from_utf8_lossy(bytes)).map_err(|source| SceneError::Parse {
        file: pack.asset_path(path),
        source: Box::new(source),
        cure: "correct the key or the value at the mark".to_owned(),
    })
}

/// Checks that an asset names its origin and licence.
pub(crate) fn provenance(place: &Place, origin: &str, license: &str) -> Result<(), SceneError> {
    for (key, text) in [("origin", origin), ("license", license)] {
        if text.trim().is_empty() {
            return Err(place.key(key).wrong(
                "empty",
                "where the asset comes from and its licence",
                "for example origin = \"made for WheelArm\", license = \"Apache-2.0\"",
            ));
        }
    }
    Ok(())
}
