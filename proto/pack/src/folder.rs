//! Folders of packs.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use crate::archive::Sum;
use crate::error::PackError;
use crate::path;

/// Files of a folder, by path. Names that begin with `.` are left out; links are rejected.
pub(crate) fn read(folder: &Path) -> Result<BTreeMap<String, Vec<u8>>, PackError> {
    let mut files = BTreeMap::new();
    let mut sum = Sum::default();
    read_level(folder, "", &mut sum, &mut files)?;
    Ok(files)
}

fn read_level(
    folder: &Path,
    prefix: &str,
    sum: &mut Sum,
    files: &mut BTreeMap<String, Vec<u8>>,
) -> Result<(), PackError> {
    let unreadable = |path: &Path, source| PackError::File {
        action: "read",
        path: path.to_owned(),
        source,
    };
    for entry in fs::read_dir(folder).map_err(|error| unreadable(folder, error))? {
        let entry = entry.map_err(|error| unreadable(folder, error))?;
        let full = entry.path();
        let name = entry.file_name();
        let name = name.to_string_lossy();
        if name.starts_with('.') {
            continue;
        }
        let path = format!("{prefix}{name}");
        let about = fs::symlink_metadata(&full).map_err(|error| unreadable(&full, error))?;
        if about.is_dir() && prefix.is_empty() && path::folders().any(|known| known == name) {
            read_level(&full, &format!("{name}/"), sum, files)?;
            continue;
        }
        if !about.is_file() {
            return Err(PackError::Path {
                path: wheelarm_proto::check::beginning(&path),
                reason: "it is a link or a folder",
                cure: "replace a link by the file; folders are kinds, objects, materials, meshes, \
                       textures, areas and tasks",
            });
        }
        path::group(&path)?;
        sum.add(&path, about.len())?;
        let bytes = fs::read(&full).map_err(|error| unreadable(&full, error))?;
        files.insert(path, bytes);
    }
    Ok(())
}

/// Writes files below a folder that does not exist yet.
pub(crate) fn write(folder: &Path, files: &BTreeMap<String, Vec<u8>>) -> Result<(), PackError> {
    let unwritable = |path: &Path, source| PackError::File {
        action: "write",
        path: path.to_owned(),
        source,
    };
    if let Some(above) = folder.parent() {
        fs::create_dir_all(above).map_err(|error| unwritable(above, error))?;
    }
    fs::create_dir(folder).map_err(|error| unwritable(folder, error))?;
    for (path, bytes) in files {
        path::group(path)?;
        let full = folder.join(path);
        if let Some(above) = full.parent() {
            fs::create_dir_all(above).map_err(|error| unwritable(above, error))?;
        }
        fs::write(&full, bytes).map_err(|error| unwritable(&full, error))?;
    }
    Ok(())
}
