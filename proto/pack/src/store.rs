//! Packs in folders: by name, and by digest.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use crate::digest::{Digest, to_hex};
use crate::error::{PackError, Place};
use crate::{Pack, PackName};

/// File that makes a folder a pack.
const MANIFEST: &str = "pack.toml";
/// Separates the name of a pack from its digest in the name of a stored file.
const AT: char = '@';

/// Folders in which packs are searched, in this order. A folder contains packs as folders
/// `NAME` and zip files `NAME.zip` or `NAME@DIGEST.zip`; it may also be a pack itself.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Store {
    folders: Vec<PathBuf>,
}

impl Store {
    /// A store of these folders; folders that do not exist are empty.
    #[must_use]
    pub fn new(folders: Vec<PathBuf>) -> Self {
        Self { folders }
    }

    /// The folders of `--packs`, or [`user_folder`] without any, and `packs` in the assets.
    #[must_use]
    pub fn search(named: &[PathBuf], assets: &Path) -> Self {
        let own = match named.is_empty() {
            true => user_folder().into_iter().collect(),
            false => named.to_vec(),
        };
        let shipped = assets.join("packs");
        Self::new(own.into_iter().chain([shipped]).collect())
    }

    /// Its folders.
    #[must_use]
    pub fn folders(&self) -> &[PathBuf] {
        &self.folders
    }

    /// Paths of packs with their names, in the order of the search. They are not opened.
    #[must_use]
    pub fn candidates(&self) -> Vec<(String, PathBuf)> {
        let mut found = Vec::new();
        for folder in &self.folders {
            if folder.join(MANIFEST).is_file() {
                if let Some(name) = name_of(folder) {
                    found.push((name, folder.clone()));
                }
                continue;
            }
            let entries = fs::read_dir(folder).into_iter().flatten().flatten();
            let mut paths: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
            paths.sort();
            found.extend(paths.into_iter().filter_map(|path| {
                let is_zip = path.extension().is_some_and(|ending| ending == "zip");
                let is_pack = is_zip || path.join(MANIFEST).is_file();
                Some((name_of(&path).filter(|_| is_pack)?, path))
            }));
        }
        found
    }

    /// Names of the packs, sorted. They are not opened.
    #[must_use]
    pub fn names(&self) -> BTreeSet<String> {
        self.candidates()
            .into_iter()
            .map(|(name, _)| name)
            .collect()
    }

    /// Opens the pack of this name in the first folder that has one, of several the one that
    /// was written last; `None` when there is none.
    ///
    /// # Errors
    /// [`PackError`] when that pack is not valid.
    pub fn open(&self, name: &str) -> Result<Option<Pack>, PackError> {
        let candidates = self.candidates().into_iter();
        let mut beside: Vec<PathBuf> = candidates
            .filter(|(found, _)| found == name)
            .map(|(_, path)| path)
            .collect();
        let folder = beside.first().and_then(|path| path.parent());
        let folder = folder.map(Path::to_owned);
        beside.retain(|path| path.parent() == folder.as_deref());
        // One alone needs no time of its files.
        let newest = match beside.len() {
            0 | 1 => beside.pop(),
            _ => beside.into_iter().max_by_key(|path| written(path)),
        };
        let Some(path) = newest else {
            return Ok(None);
        };
        let pack = Pack::open(&path)?;
        if pack.id().name != name {
            return Err(Place::file("pack.toml").key("name").wrong(
                format!("{:?}", pack.id().name),
                format!("{name:?}, as {}", path.display()),
                "rename the folder or correct the name",
            ));
        }
        Ok(Some(pack))
    }

    /// Opens the first pack of this name whose identity fits; `None` when there is none. Packs
    /// that cannot be opened are passed over.
    #[must_use]
    pub fn open_where(&self, name: &str, fits: impl Fn(&PackName) -> bool) -> Option<Pack> {
        let mut packs = self.of_name(name);
        packs.find(|pack| fits(pack.id()))
    }

    /// The identities of all packs of this name, as text.
    #[must_use]
    pub fn identities(&self, name: &str) -> Vec<String> {
        let packs = self.of_name(name);
        packs.map(|pack| pack.id().to_string()).collect()
    }

    fn of_name(&self, name: &str) -> impl Iterator<Item = Pack> {
        let candidates = self.candidates().into_iter();
        candidates
            .filter(move |(found, _)| found == name)
            .filter_map(|(_, path)| Pack::open(&path).ok())
            .filter(move |pack| pack.id().name == name)
    }

    /// The first folder that is not a pack itself: a further file in a pack makes it invalid.
    #[must_use]
    pub fn folder_to_fill(&self) -> Option<&Path> {
        let mut folders = self.folders.iter().map(PathBuf::as_path);
        folders.find(|folder| !folder.join(MANIFEST).exists())
    }

    /// The file of a pack in a folder, `NAME@DIGEST.zip`.
    #[must_use]
    pub fn stored_path(folder: &Path, pack: &Pack) -> PathBuf {
        let id = pack.id();
        folder.join(format!("{}{AT}{}.zip", id.name, stored_as(id)))
    }

    /// Writes a pack as `NAME@DIGEST.zip` into a folder, where it is then the newest of its
    /// name.
    ///
    /// # Errors
    /// [`PackError`] when the file cannot be written.
    pub fn put(folder: &Path, pack: &Pack) -> Result<PathBuf, PackError> {
        let path = Self::stored_path(folder, pack);
        fs::create_dir_all(folder).map_err(|source| PackError::File {
            action: "write",
            path: folder.to_owned(),
            source,
        })?;
        pack.write_zip(&path)?;
        Ok(path)
    }
}

/// Time of the last change of a zip file, or of any file of a folder.
fn written(path: &Path) -> Option<SystemTime> {
    let own = fs::metadata(path).and_then(|about| about.modified()).ok();
    let entries = match path.is_dir() {
        true => fs::read_dir(path).ok(),
        false => None,
    };
    let inside = entries.into_iter().flatten().flatten();
    let inside = inside.filter_map(|entry| {
        // A link could lead anywhere, and a pack has none.
        let kind = entry.file_type().ok()?;
        match kind.is_symlink() {
            true => None,
            false => written(&entry.path()),
        }
    });
    own.into_iter().chain(inside).max()
}

/// The user's folder of packs: `wheelarm/packs` below `XDG_DATA_HOME`, by default
/// `~/.local/share`.
#[must_use]
pub fn user_folder() -> Option<PathBuf> {
    let absolute = |name: &str| {
        let folder = PathBuf::from(std::env::var_os(name)?);
        folder.is_absolute().then_some(folder)
    };
    let data = absolute("XDG_DATA_HOME").or_else(|| Some(absolute("HOME")?.join(".local/share")));
    Some(data?.join("wheelarm/packs"))
}

/// Digits of both digests in the name of a stored file.
fn stored_as(id: &PackName) -> String {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&id.physics);
    hasher.update(&id.rendering);
    let both: Digest = hasher.finalize().into();
    to_hex(&both)[..32].to_owned()
}

fn name_of(path: &Path) -> Option<String> {
    let name = match path.extension().is_some_and(|ending| ending == "zip") {
        true => path.file_stem()?,
        false => path.file_name()?,
    };
    let name = name.to_str()?;
    let name = name.split_once(AT).map_or(name, |(name, _)| name);
    wheelarm_proto::keys::check_name(name).ok()?;
    Some(name.to_owned())
}
