//! Marks of a multiplied file: root attributes, which the recorder cannot write itself.

use std::path::Path;

use anyhow::Context;
use hdf5::types::VarLenUnicode;
use wheelarm_dataset::convert;

/// Attribute that names the episode whose demonstration was adapted.
pub const FROM: &str = "multiplied_from";
/// Attribute of its task's seed and the noise, for readers.
pub const HOW: &str = "multiplied_how";

/// Marks a file that does not have its final name yet.
///
/// # Errors
/// When it cannot be written.
pub fn write(file: &Path, from: &str, how: &str) -> anyhow::Result<()> {
    let added = wheelarm_dataset::add_texts(file, &[(FROM, from), (HOW, how)]);
    added.with_context(|| format!("marking {}", file.display()))
}

/// Copies the mark of a file to a new recording of the same episode.
///
/// # Errors
/// When it cannot be written; the file is unchanged then.
pub fn keep(of: &Path, file: &Path) -> anyhow::Result<()> {
    match read(of) {
        Some([from, how]) => convert::change(file, |copy| write(copy, &from, &how)),
        None => Ok(()),
    }
}

/// Source episode and settings of a multiplied file; `None` for other files.
#[must_use]
pub fn read(file: &Path) -> Option<[String; 2]> {
    let at = wheelarm_dataset::read::open_file(file).ok()?;
    let read = |name| {
        let words: VarLenUnicode = at.attr(name).ok()?.read_scalar().ok()?;
        Some(words.as_str().to_owned())
    };
    Some([read(FROM)?, read(HOW)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mark_survives_reading_and_copying() {
        let folder = tempfile::tempdir().unwrap();
        let [one, other, plain] = ["one.h5", "other.h5", "plain.h5"].map(|name| {
            let path = folder.path().join(name);
            hdf5::File::create(&path).unwrap().close().unwrap();
            path
        });
        write(&one, "pick_bowl-0003", "seed 0").unwrap();
        keep(&one, &other).unwrap();
        let mark = ["pick_bowl-0003", "seed 0"].map(str::to_owned);
        assert_eq!(read(&other), Some(mark));
        keep(&plain, &other).unwrap();
        assert_eq!(read(&plain), None);
    }
}
