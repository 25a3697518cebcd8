//! Digest of the files of a policy: results of a policy whose script or checkpoint
//! changed are results of another policy.

use std::collections::BTreeSet;
use std::fs::File;
use std::path::{Path, PathBuf};

use anyhow::Context;
use sha2::{Digest, Sha256};

use super::Choice;

/// Bytes of a digest that are kept.
const KEPT: usize = 8;

/// Digest of the files that `choice` names, hexadecimal; empty if it names none on this
/// host. The files are: for a command those that it names and the Python modules beside
/// them that they import; for a checkpoint all files of its folder; for recordings their
/// names and sizes.
///
/// # Errors
/// When a file cannot be read.
pub fn digest(choice: &Choice) -> anyhow::Result<String> {
    let mut hash = Sha256::new();
    let mut count = 0;
    match choice {
        Choice::Exec(line) => {
            for file in with_imports(named(line)) {
                add(&mut hash, &file)?;
                count += 1;
            }
        }
        Choice::Lerobot(folder) => {
            for file in below(folder)? {
                add(&mut hash, &file)?;
                count += 1;
            }
        }
        Choice::Replay(folder) => {
            for file in below(folder)? {
                let length = file.metadata().map_or(0, |file| file.len());
                hash.update(format!("{}\n{length}\n", file.display()));
                count += 1;
            }
        }
        // The name of such a policy has the hash of its weights, or the files are elsewhere.
        Choice::Act(_)
        | Choice::Operator
        | Choice::Hold
        | Choice::Repeat
        | Choice::Zenoh(_)
        | Choice::Openpi(_) => {}
    }
    let digest = hash.finalize();
    let kept = digest.iter().take(KEPT).map(|byte| format!("{byte:02x}"));
    Ok(if count > 0 {
        kept.collect()
    } else {
        String::new()
    })
}

/// Adds name and content of a file.
fn add(hash: &mut Sha256, path: &Path) -> anyhow::Result<()> {
    let reading = || format!("cannot read {} of the policy", path.display());
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    hash.update(format!("{name}\n"));
    let mut file = File::open(path).with_context(reading)?;
    std::io::copy(&mut file, hash).with_context(reading)?;
    Ok(())
}

/// The files that the words of a command name, also as `--option=FILE`.
fn named(line: &str) -> Vec<PathBuf> {
    let words = line.split(|c: char| c.is_whitespace() || "'\"=;".contains(c));
    let files = words.map(PathBuf::from).filter(|path| path.is_file());
    files.collect()
}

/// `files`, and the Python modules beside them that they import, sorted.
fn with_imports(files: Vec<PathBuf>) -> BTreeSet<PathBuf> {
    let mut all = BTreeSet::new();
    let mut pending = files;
    while let Some(file) = pending.pop() {
        if file.extension().is_some_and(|end| end == "py") {
            pending.extend(imports(&file).into_iter().filter(|f| !all.contains(f)));
        }
        all.insert(file);
    }
    all
}

/// The Python modules in the folder of a script that it imports.
fn imports(script: &Path) -> Vec<PathBuf> {
    let text = std::fs::read_to_string(script).unwrap_or_default();
    let folder = script.parent().unwrap_or(Path::new(""));
    let mut modules = Vec::new();
    for line in text.lines().map(str::trim_start) {
        let names = match line.split_once(' ') {
            Some(("import", names)) => names,
            Some(("from", rest)) => rest.split(" import").next().unwrap_or_default(),
            _ => continue,
        };
        for name in names.split(',') {
            let name = name.split_whitespace().next().unwrap_or_default();
            let path = folder.join(name.trim_start_matches('.').replace('.', "/"));
            modules.extend([path.with_extension("py"), path.join("__init__.py")]);
        }
    }
    modules.retain(|path| path.is_file());
    modules
}

/// All files below a folder, sorted.
fn below(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let reading = || format!("cannot read the folder {} of the policy", folder.display());
    let mut files = Vec::new();
    let mut pending = vec![folder.to_owned()];
    while let Some(folder) = pending.pop() {
        for entry in std::fs::read_dir(&folder).with_context(reading)? {
            let path = entry.with_context(reading)?.path();
            // A link may form a cycle.
            match path.is_dir() {
                true if path.is_symlink() => {}
                true => pending.push(path),
                false => files.push(path),
            }
        }
    }
    files.sort();
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changed_script_module_or_checkpoint_is_another_policy() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let write = |name: &str, text: &str| std::fs::write(at(name), text).unwrap();
        write("p.py", "import os\nfrom helper import grasp\n");
        write("helper.py", "import p\ngrasp = 1\n");
        write("unrelated.py", "");
        write("weights.bin", "1");
        let script = at("p.py").display().to_string();
        let weights = at("weights.bin").display().to_string();
        let exec = Choice::Exec(format!("env A=1 python3 '{script}' --weights={weights}"));
        let lerobot = Choice::Lerobot(folder.path().to_owned());
        let of = |choice: &Choice| digest(choice).unwrap();
        let mut before = (of(&exec), of(&lerobot));
        assert_eq!(before.0.len(), 2 * KEPT);
        assert_eq!(of(&exec), before.0);
        write("unrelated.py", "x = 1\n");
        assert_eq!(of(&exec), before.0);
        assert_ne!(of(&lerobot), before.1);
        for (name, text) in [
            ("helper.py", "grasp = 2\n"),
            ("weights.bin", "2"),
            ("p.py", ""),
        ] {
            write(name, text);
            let now = (of(&exec), of(&lerobot));
            assert_ne!(now.0, before.0, "{name}");
            assert_ne!(now.1, before.1, "{name}");
            before = now;
        }
        assert_eq!(of(&Choice::Hold), "");
        assert_eq!(of(&Choice::Exec("true".to_owned())), "");
    }
}
