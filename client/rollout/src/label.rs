//! Labels of episodes that name no file yet.

use std::path::Path;

/// A label that names no file in `folder` yet: `label`, `label-2`, `label-3` …
#[must_use]
pub fn free_label(folder: &Path, label: &str) -> String {
    let taken = |label: &str| {
        // Any file of that stem counts: an episode, a log, a sheet.
        std::fs::read_dir(folder).is_ok_and(|entries| {
            entries.flatten().any(|entry| {
                let name = entry.file_name();
                let name = name.to_string_lossy();
                name.strip_prefix(label)
                    .is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
            })
        })
    };
    (1..)
        .map(|number| match number {
            1 => label.to_owned(),
            _ => format!("{label}-{number}"),
        })
        .find(|label| !taken(label))
        .unwrap_or_else(|| label.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn used_label_gets_a_number() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        assert_eq!(free_label(folder, "a-seed1"), "a-seed1");
        for name in ["a-seed1.h5", "a-seed1-2.sheet.png", "a-seed10.h5"] {
            std::fs::write(folder.join(name), "").unwrap();
        }
        let free = (free_label(folder, "a-seed1"), free_label(folder, "a"));
        assert_eq!(free, ("a-seed1-3".to_owned(), "a".to_owned()));
    }
}
