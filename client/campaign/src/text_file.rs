//! Text files written by users: plans and splits.

use std::io::{self, Read};
use std::path::Path;

/// Longest file, bytes.
const LONGEST: u64 = 1 << 20;

/// Reads a text of at most 1 MiB.
///
/// # Errors
/// When the file cannot be read or is longer.
pub fn read(path: &Path) -> io::Result<String> {
    let mut text = String::new();
    let file = std::fs::File::open(path)?;
    file.take(LONGEST + 1).read_to_string(&mut text)?;
    if text.len() as u64 > LONGEST {
        let words = format!("longer than {LONGEST} bytes: is it another file?");
        return Err(io::Error::new(io::ErrorKind::InvalidData, words));
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_file_is_not_read_to_its_end() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("plan.toml");
        let of = |length: u64| {
            std::fs::write(&path, "#".repeat(length as usize)).unwrap();
            read(&path).map(|text| text.len() as u64)
        };
        assert_eq!(of(LONGEST).unwrap(), LONGEST);
        let problem = of(LONGEST + 1).unwrap_err().to_string();
        assert!(problem.contains("another file"), "{problem}");
    }
}
