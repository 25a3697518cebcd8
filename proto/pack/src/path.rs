//! Paths of files in a pack: which are allowed, and what they count for.

use crate::error::PackError;

/// Prefix of the paths of a pack's files among the assets: `packs/NAME/meshes/sofa.obj`.
pub const ASSET_PREFIX: &str = "packs/";

/// Longest path, bytes.
const LONGEST: usize = 160;

/// What a file determines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Group {
    /// States, sampled values and commands.
    Physics,
    /// Images.
    Rendering,
    /// Neither.
    Other,
}

/// Folders, the endings of their files, and what they count for.
const FOLDERS: [(&str, &[&str], Group); 7] = [
    ("areas", &["toml"], Group::Physics),
    ("kinds", &["toml"], Group::Physics),
    ("objects", &["toml"], Group::Physics),
    ("tasks", &["toml"], Group::Physics),
    ("materials", &["toml"], Group::Rendering),
    ("meshes", &["obj", "glb"], Group::Rendering),
    ("textures", &["png"], Group::Rendering),
];

/// Files beside the folders.
const FILES: [(&str, Group); 10] = [
    ("pack.toml", Group::Other),
    ("home.toml", Group::Physics),
    ("appearance.toml", Group::Rendering),
    ("words.toml", Group::Other),
    ("report.json", Group::Other),
    ("report.html", Group::Other),
    ("plan.png", Group::Other),
    ("README.md", Group::Other),
    ("LICENSE", Group::Other),
    ("LICENSE.txt", Group::Other),
];

/// Checks a path; `/` separates folder and file.
pub(crate) fn group(path: &str) -> Result<Group, PackError> {
    let wrong = |reason, cure| PackError::Path {
        path: wheelarm_proto::check::beginning(path),
        reason,
        cure,
    };
    if path.len() > LONGEST {
        return Err(wrong("it is too long", "shorten the name"));
    }
    let Some((folder, file)) = path.split_once('/') else {
        let known = FILES.iter().find(|(name, _)| *name == path);
        return known.map(|(_, group)| *group).ok_or_else(|| {
            wrong(
                "no such file belongs beside the folders of a pack",
                "remove it; beside pack.toml and home.toml there may be report.json, report.html, \
                 plan.png, words.toml, appearance.toml, README.md and LICENSE",
            )
        });
    };
    let Some((_, endings, group)) = FOLDERS.iter().find(|(name, _, _)| *name == folder) else {
        return Err(wrong(
            "no such folder belongs to a pack",
            "folders are kinds, objects, materials, meshes, textures, areas and tasks",
        ));
    };
    let (stem, ending) = file.rsplit_once('.').unwrap_or((file, ""));
    if wheelarm_proto::keys::check_name(stem).is_err() {
        return Err(wrong(
            "its name has other characters than letters, digits, `-` and `_`, or more than 64",
            "rename the file; a folder of a pack holds no folders",
        ));
    }
    if !endings.contains(&ending) {
        return Err(wrong(
            "its ending does not belong in this folder",
            "meshes end in .obj or .glb, textures in .png, all others in .toml",
        ));
    }
    Ok(*group)
}

/// Names of the folders.
pub(crate) fn folders() -> impl Iterator<Item = &'static str> {
    FOLDERS.iter().map(|(name, _, _)| *name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_outside_the_layout_are_rejected() {
        for path in [
            "",
            "/",
            "..",
            "../pack.toml",
            "/etc/passwd",
            "kinds/../pack.toml",
            "kinds/a/b.toml",
            "kinds//a.toml",
            "kinds/.toml",
            "kinds/a.toml/",
            "kinds/a",
            "meshes/a.gltf",
            "meshes/a.OBJ",
            "kinds\\a.toml",
            "C:\\pack.toml",
            "kinds/ä.toml",
            "other/a.toml",
            "kinds/a\0.toml",
            "notes.txt",
        ] {
            assert!(group(path).is_err(), "{path:?} was accepted");
        }
        let long = format!("kinds/{}.toml", "x".repeat(200));
        assert!(group(&long).unwrap_err().to_string().len() < 300);
        assert!(group(&format!("kinds/{}.toml", "x".repeat(65))).is_err());
    }

    #[test]
    fn files_of_the_layout_count_for_physics_or_rendering() {
        for (path, expected) in [
            ("home.toml", Group::Physics),
            ("kinds/table-1.toml", Group::Physics),
            ("objects/mug.toml", Group::Physics),
            ("meshes/sofa.obj", Group::Rendering),
            ("textures/wood_2.png", Group::Rendering),
            ("pack.toml", Group::Other),
            ("plan.png", Group::Other),
        ] {
            assert_eq!(group(path).unwrap(), expected, "{path}");
        }
    }
}
