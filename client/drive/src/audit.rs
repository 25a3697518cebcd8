//! Who did what and when: a line of JSON for every lease, episode, goal, refusal and
//! log-in, into a file if one is named, and into the log.

use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

use anyhow::Context;
use serde_json::{Value, json};

/// Where the lines go.
#[derive(Debug, Default)]
pub struct Audit {
    file: Option<File>,
}

impl Audit {
    /// Appends to a file, if one is named; it and its folder are made where they are not.
    ///
    /// # Errors
    /// When it cannot be opened.
    pub fn open(path: Option<&Path>) -> anyhow::Result<Self> {
        let file = path.map(|path| {
            if let Some(folder) = path.parent() {
                std::fs::create_dir_all(folder).with_context(|| {
                    format!("making the folder {} of the audit file", folder.display())
                })?;
            }
            let file = File::options().create(true).append(true).open(path);
            file.with_context(|| format!("opening the audit file {}", path.display()))
        });
        Ok(Self {
            file: file.transpose()?,
        })
    }

    /// Writes a line, with the time.
    pub fn write(&mut self, line: &Value) {
        let now = SystemTime::now().duration_since(UNIX_EPOCH);
        let mut line = line.clone();
        line["unix_s"] = json!(now.unwrap_or_default().as_secs_f64());
        tracing::info!(target: "audit", "{line}");
        if let Some(file) = &mut self.file
            && let Err(error) = writeln!(file, "{line}")
        {
            tracing::error!("the audit file cannot be written, and is closed: {error}");
            self.file = None;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_folder_of_the_file_is_made() {
        let folder = std::env::temp_dir().join(format!("wheelarm-audit-{}", std::process::id()));
        let path = folder.join("a/b/audit.jsonl");
        let mut audit = Audit::open(Some(&path)).unwrap();
        audit.write(&json!({"what": "lease"}));
        let line = std::fs::read_to_string(path).unwrap();
        std::fs::remove_dir_all(folder).unwrap();
        assert!(line.contains("lease"), "{line}");
    }
}
