//! Finds the assets, and the packs of objects.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use wheelarm_options::choice::did_you_mean;
use wheelarm_pack::{Pack, Store};
use wheelarm_proto::installed::{self, ASSETS_VARIABLE};

/// The named assets folder, or the installed one.
pub fn assets_of(named: Option<&PathBuf>) -> anyhow::Result<PathBuf> {
    let found = named.cloned().or_else(installed::assets);
    found.with_context(|| {
        format!("no assets folder found; name it: export {ASSETS_VARIABLE}=…/assets")
    })
}

/// The only pack with an object of this name, and its folder.
pub fn pack_with(store: &Store, name: &str) -> anyhow::Result<(Pack, PathBuf)> {
    let path = format!("objects/{name}.toml");
    let mut found: Vec<(Pack, PathBuf)> = Vec::new();
    let mut known: Vec<String> = Vec::new();
    for (_, folder) in store.candidates() {
        let Ok(pack) = Pack::open(&folder) else {
            continue;
        };
        known.extend(pack.names("objects", "toml").map(str::to_owned));
        if pack.file(&path).is_some() {
            found.push((pack, folder));
        }
    }
    match found.len() {
        1 => {}
        0 => bail!(
            "no object named {name:?} in {}; available: {}; import it with `wheelarm object \
             import`, or name its folder of packs with --packs{}",
            folders(store),
            match known.is_empty() {
                true => "none".to_owned(),
                false => known.join(", "),
            },
            did_you_mean(name, known.iter().map(String::as_str))
        ),
        _ => {
            let packs = found.iter().map(|(_, path)| path.display().to_string());
            let packs: Vec<String> = packs.collect();
            bail!(
                "several packs have an object {name:?}: {}; name one of them with --packs",
                packs.join(", ")
            )
        }
    }
    found.pop().context("no pack")
}

fn folders(store: &Store) -> String {
    let folders = store.folders().iter().map(|f| f.display().to_string());
    folders.collect::<Vec<String>>().join(", ")
}

/// The folder of packs and the name of a pack's folder.
pub fn parent_and_name(path: &Path) -> anyhow::Result<(PathBuf, String)> {
    let name = path
        .file_name()
        .map(|name| name.to_string_lossy().into_owned());
    let name = name.filter(|name| wheelarm_proto::keys::check_name(name).is_ok());
    let name = name.with_context(|| {
        format!(
            "invalid --out {}: expected a folder whose name is that of the pack, 1 to 64 letters, \
             digits, `-` or `_`",
            path.display()
        )
    })?;
    let parent = path
        .parent()
        .filter(|parent| !parent.as_os_str().is_empty());
    Ok((parent.unwrap_or(Path::new(".")).to_owned(), name))
}
