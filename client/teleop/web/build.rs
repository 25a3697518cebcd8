//! Embeds the page's files in the program: a table of path and bytes.

use std::error::Error;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Endings that are part of the page.
const ENDINGS: [&str; 5] = ["html", "css", "js", "svg", "json"];

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo:rerun-if-changed=page");
    let page = PathBuf::from(std::env::var("CARGO_MANIFEST_DIR")?).join("page");
    let mut found = Vec::new();
    walk(&page, &mut found)?;
    found.sort();
    let mut table = String::from("pub static FILES: &[(&str, &[u8])] = &[\n");
    for path in found {
        let name = path.strip_prefix(&page)?.to_string_lossy().into_owned();
        // A checkout that was moved is still found.
        let inside = format!("/page/{name}");
        writeln!(
            table,
            "    ({name:?}, include_bytes!(concat!(env!(\"CARGO_MANIFEST_DIR\"), {inside:?}))),"
        )?;
    }
    table.push_str("];\n");
    let out = PathBuf::from(std::env::var("OUT_DIR")?);
    std::fs::write(out.join("files.rs"), table)?;
    Ok(())
}

fn walk(folder: &Path, found: &mut Vec<PathBuf>) -> std::io::Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        // Tests of the page are stored beside it and are not served.
        let is_test = path.file_name().is_some_and(|name| name == "tests");
        if path.is_dir() && !is_test {
            walk(&path, found)?;
        }
        let ending = path
            .extension()
            .and_then(|e| e.to_str())
            .unwrap_or_default();
        if path.is_file() && ENDINGS.contains(&ending) {
            found.push(path);
        }
    }
    Ok(())
}
