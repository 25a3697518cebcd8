//! A checked pack in memory.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::fs;
use std::io::Write;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::digest::{self, Digest, to_hex};
use crate::error::{PackError, Place};
use crate::path::{self, ASSET_PREFIX};
use crate::{
    FORMAT, FurnitureEntry, HomeFile, KindFile, Manifest, MaterialFile, ObjectFile, PartEntry,
    archive, expand, folder,
};

const MANIFEST: &str = "pack.toml";
const HOME: &str = "home.toml";
/// Packs that this process has begun to write.
static WRITTEN: AtomicU64 = AtomicU64::new(0);

/// Identity of a pack: equal names have equal states and images.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PackName {
    /// Name.
    pub name: String,
    /// Version that its author gave.
    pub version: String,
    /// Of everything that reaches states and commands.
    pub physics: Digest,
    /// Of everything else that reaches images.
    pub rendering: Digest,
}

impl fmt::Display for PackName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (physics, rendering) = (to_hex(&self.physics), to_hex(&self.rendering));
        write!(
            f,
            "{} {} (physics {}, rendering {})",
            self.name,
            self.version,
            &physics[..16],
            &rendering[..16]
        )
    }
}

/// A pack: its files, checked and parsed.
#[derive(Clone)]
pub struct Pack {
    id: PackName,
    manifest: Manifest,
    home: Option<HomeFile>,
    kinds: BTreeMap<String, KindFile>,
    files: BTreeMap<String, Vec<u8>>,
}

/// Packs with equal names, versions and digests are equal.
impl PartialEq for Pack {
    fn eq(&self, other: &Self) -> bool {
        self.id == other.id
    }
}

impl fmt::Debug for Pack {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Pack({})", self.id)
    }
}

impl Pack {
    /// Opens a folder or a zip file.
    ///
    /// # Errors
    /// [`PackError`] when it cannot be read or is not a valid pack.
    pub fn open(path: &Path) -> Result<Self, PackError> {
        if path.join(MANIFEST).is_file() {
            return Self::from_files(folder::read(path)?);
        }
        let unreadable = |source| PackError::File {
            action: "read",
            path: path.to_owned(),
            source,
        };
        let about = fs::metadata(path).map_err(unreadable)?;
        if !about.is_file() {
            return Err(PackError::NotAPack(path.to_owned()));
        }
        if about.len() > archive::MOST_ZIP_BYTES as u64 {
            return Err(PackError::Large {
                what: format!("{}", path.display()),
                found: about.len(),
                most: archive::MOST_ZIP_BYTES as u64,
                unit: "bytes",
                cure: "leave out or simplify meshes",
            });
        }
        Self::from_zip(&fs::read(path).map_err(unreadable)?)
    }

    /// Reads a zip file.
    ///
    /// # Errors
    /// [`PackError`] when it is damaged, exceeds a limit or is not a valid pack.
    pub fn from_zip(bytes: &[u8]) -> Result<Self, PackError> {
        Self::from_files(archive::read(bytes)?)
    }

    /// A pack of these tables and further files (meshes, textures, materials, objects), by path.
    ///
    /// # Errors
    /// As [`Pack::from_files`].
    pub fn from_tables(
        manifest: &Manifest,
        home: Option<&HomeFile>,
        kinds: &BTreeMap<String, KindFile>,
        mut files: BTreeMap<String, Vec<u8>>,
    ) -> Result<Self, PackError> {
        files.insert(MANIFEST.to_owned(), text(MANIFEST, manifest)?);
        if let Some(home) = home {
            files.insert(HOME.to_owned(), text(HOME, home)?);
        }
        for (name, kind) in kinds {
            let path = format!("kinds/{name}.toml");
            files.insert(path.clone(), text(&path, kind)?);
        }
        Self::from_files(files)
    }

    /// A pack of these files, by path.
    ///
    /// # Errors
    /// [`PackError`] when a path, a file or a value is invalid.
    pub fn from_files(files: BTreeMap<String, Vec<u8>>) -> Result<Self, PackError> {
        let mut sum = archive::Sum::default();
        let mut lower = BTreeSet::new();
        for (path, bytes) in &files {
            path::group(path)?;
            sum.add(path, bytes.len() as u64)?;
            if !lower.insert(path.to_ascii_lowercase()) {
                return Err(PackError::Path {
                    path: path.clone(),
                    reason: "another file has this name in other letters",
                    cure: "rename one of them: some file systems do not tell them apart",
                });
            }
        }
        let missing = |file: &str, cure: &str| PackError::Missing {
            file: file.to_owned(),
            cure: cure.to_owned(),
        };
        let manifest = files
            .get(MANIFEST)
            .ok_or_else(|| missing(MANIFEST, "add it, with format = 1, name and version"))?;
        let manifest: Manifest = parse(MANIFEST, manifest)?;
        check_manifest(&manifest)?;
        let home: Option<HomeFile> = files
            .get(HOME)
            .map(|bytes| parse(HOME, bytes))
            .transpose()?;
        let mut kinds = BTreeMap::new();
        for (path, bytes) in &files {
            let name = |folder: &str| {
                let file = path.strip_prefix(folder)?.strip_suffix(".toml")?;
                Some(file.to_owned())
            };
            if let Some(name) = name("kinds/") {
                let kind: KindFile = parse(path, bytes)?;
                check_meshes(path, &files, kind.parts.iter())?;
                kinds.insert(name, kind);
            } else if name("objects/").is_some() {
                let object: ObjectFile = parse(path, bytes)?;
                check_object(path, &files, &object)?;
            } else if name("materials/").is_some() {
                let materials: MaterialFile = parse(path, bytes)?;
                check_materials(path, &materials)?;
            }
        }
        if home.is_none() && kinds.is_empty() && !files.keys().any(|p| p.starts_with("objects/")) {
            return Err(missing(
                HOME,
                "a pack has a home, furniture kinds in kinds/ or objects in objects/",
            ));
        }
        if let Some(home) = &home {
            expand(home, &kinds)?;
        }
        let [physics, rendering] = digest::digests(&files)?;
        let id = PackName {
            name: manifest.name.clone(),
            version: manifest.version.clone(),
            physics,
            rendering,
        };
        Ok(Self {
            id,
            manifest,
            home,
            kinds,
            files,
        })
    }

    /// Its name, version and digests.
    #[must_use]
    pub fn id(&self) -> &PackName {
        &self.id
    }

    /// `pack.toml`.
    #[must_use]
    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// `home.toml`, if it has a home.
    #[must_use]
    pub fn home(&self) -> Option<&HomeFile> {
        self.home.as_ref()
    }

    /// Its furniture kinds, by name.
    #[must_use]
    pub fn kinds(&self) -> &BTreeMap<String, KindFile> {
        &self.kinds
    }

    /// The furniture of its home; empty without a home.
    ///
    /// # Errors
    /// None for a pack that was checked.
    pub fn furniture(&self) -> Result<Vec<FurnitureEntry>, PackError> {
        match &self.home {
            Some(home) => expand(home, &self.kinds),
            None => Ok(Vec::new()),
        }
    }

    /// A file, by its path in the pack.
    #[must_use]
    pub fn file(&self, path: &str) -> Option<&[u8]> {
        self.files.get(path).map(Vec::as_slice)
    }

    /// All files, by path.
    #[must_use]
    pub fn files(&self) -> &BTreeMap<String, Vec<u8>> {
        &self.files
    }

    /// Names (without ending) of the files of a folder with this ending, sorted.
    pub fn names<'a>(&'a self, folder: &'a str, ending: &'a str) -> impl Iterator<Item = &'a str> {
        self.files.keys().filter_map(move |path| {
            let name = path.strip_prefix(folder)?.strip_prefix('/')?;
            name.strip_suffix(ending)?.strip_suffix('.')
        })
    }

    /// Path of a file of this pack among the assets: `packs/NAME/PATH`.
    #[must_use]
    pub fn asset_path(&self, path: &str) -> String {
        format!("{ASSET_PREFIX}{}/{path}", self.id.name)
    }

    /// The zip file of it. Equal packs give equal bytes.
    ///
    /// # Errors
    /// [`PackError`] when a file cannot be compressed.
    pub fn to_zip(&self) -> Result<Vec<u8>, PackError> {
        archive::write(&self.files)
    }

    /// Writes it as a folder that does not exist yet.
    ///
    /// # Errors
    /// [`PackError::File`] when the folder exists or a file cannot be written.
    pub fn write_folder(&self, path: &Path) -> Result<(), PackError> {
        folder::write(path, &self.files)
    }

    /// Writes it as a zip file: first beside it, then renamed, so that no reader sees a part.
    ///
    /// # Errors
    /// [`PackError::File`] when the file cannot be written.
    pub fn write_zip(&self, path: &Path) -> Result<(), PackError> {
        let unwritable = |source| PackError::File {
            action: "write",
            path: path.to_owned(),
            source,
        };
        let zip = self.to_zip()?;
        // Another process, or another thread of this one, may write the same pack.
        let number = WRITTEN.fetch_add(1, Ordering::Relaxed);
        let beside = path.with_extension(format!("unfinished-{}-{number}", std::process::id()));
        let write = || -> std::io::Result<()> {
            let mut file = fs::File::create(&beside)?;
            file.write_all(&zip)?;
            file.sync_all()?;
            fs::rename(&beside, path)
        };
        write().map_err(|source| {
            // A full disk stays as it was.
            let _ = fs::remove_file(&beside);
            unwritable(source)
        })
    }
}

/// A file as TOML text.
fn text<T: Serialize>(path: &str, table: &T) -> Result<Vec<u8>, PackError> {
    let text = toml::to_string(table).map_err(|error| {
        Place::file(path).wrong(
            error,
            "values that TOML can express",
            "numbers must be finite",
        )
    })?;
    Ok(text.into_bytes())
}

/// Parses a TOML file.
pub(crate) fn parse<T: DeserializeOwned>(path: &str, bytes: &[u8]) -> Result<T, PackError> {
    let text = std::str::from_utf8(bytes)
        .map_err(|error| Place::file(path).wrong(error, "UTF-8 text", "save the file as UTF-8"))?;
    toml::from_str(text).map_err(|source| PackError::Parse {
        file: path.to_owned(),
        source: Box::new(source),
    })
}

fn check_manifest(manifest: &Manifest) -> Result<(), PackError> {
    let place = Place::file(MANIFEST);
    if manifest.format != FORMAT {
        return Err(place.key("format").wrong(
            manifest.format,
            FORMAT,
            "this program reads packs of that format; import the home again, or update WheelArm",
        ));
    }
    place.key("name").name(&manifest.name)?;
    let is_version = (1..=64).contains(&manifest.version.len())
        && manifest
            .version
            .bytes()
            .all(|b| b.is_ascii_alphanumeric() || b"-_.+".contains(&b));
    if !is_version {
        return Err(place.key("version").wrong(
            format!("{:?}", wheelarm_proto::check::beginning(&manifest.version)),
            "1 to 64 letters, digits, `-`, `_`, `.` or `+`",
            "for example \"1\"",
        ));
    }
    for (i, source) in manifest.source.iter().enumerate() {
        let place = place.entry("source", i);
        for (key, value) in [("of", &source.of), ("license", &source.license)] {
            if value.trim().is_empty() {
                return Err(place.key(key).wrong(
                    "empty",
                    "a text",
                    "of = \"home\" or the name of a kind, license = an SPDX identifier or \
                     \"unknown\"",
                ));
            }
        }
    }
    Ok(())
}

/// Checks that the meshes of parts are in the pack.
fn check_meshes<'a>(
    path: &str,
    files: &BTreeMap<String, Vec<u8>>,
    parts: impl Iterator<Item = &'a PartEntry>,
) -> Result<(), PackError> {
    for (i, mesh) in parts
        .enumerate()
        .filter_map(|(i, part)| Some((i, part.mesh.as_ref()?)))
    {
        if !mesh.path.starts_with("meshes/") || !files.contains_key(&mesh.path) {
            let place = Place::file(path).entry("parts", i).key("mesh.path");
            return Err(place.wrong(
                format!("{:?}", wheelarm_proto::check::beginning(&mesh.path)),
                "a file of the pack in meshes/",
                "add the mesh to the pack or correct the path",
            ));
        }
    }
    Ok(())
}

/// Checks meshes of an object: none collides, for a mesh file must not reach the state.
fn check_object(
    path: &str,
    files: &BTreeMap<String, Vec<u8>>,
    object: &ObjectFile,
) -> Result<(), PackError> {
    check_meshes(path, files, object.parts.iter())?;
    let collides = |part: &&PartEntry| part.mesh.is_some() && part.collide != Some(false);
    let of_parts = object.collision.is_none() && object.parts.iter().any(|part| collides(&part));
    let listed = object
        .collision
        .iter()
        .flatten()
        .any(|part| part.mesh.is_some());
    if of_parts || listed {
        return Err(Place::file(path).key("collision").wrong(
            "a mesh",
            "shapes of decimal text: meshes of a pack are rendered only",
            "list shapes under `collision`, for example hull = [[x, y, z], …]",
        ));
    }
    Ok(())
}

fn check_materials(path: &str, materials: &MaterialFile) -> Result<(), PackError> {
    for name in materials.material.keys() {
        let place = Place::file(path).key("material");
        place.key("name").name(name)?;
    }
    Ok(())
}
