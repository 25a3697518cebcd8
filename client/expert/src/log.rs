//! `operator.log`: phases and notes, to find out why an attempt failed.

use std::fs::File;
use std::io::{self, Write};
use std::path::Path;

use super::run::{DriverError, Progress, Report};

/// A log of one operator at work.
pub struct Log {
    file: File,
    phase: String,
}

impl Log {
    /// Makes the file.
    ///
    /// # Errors
    /// The operating system's.
    pub fn create(path: &Path) -> io::Result<Self> {
        let (file, phase) = (File::create(path)?, String::new());
        Ok(Self { file, phase })
    }

    /// Writes down a new phase, and what happened.
    pub fn follow(&mut self, progress: &Progress<'_>) {
        if progress.phase != self.phase {
            progress.phase.clone_into(&mut self.phase);
            self.line(&format!("{:7.2} s  {}", progress.time, progress.phase));
        }
        for note in progress.notes {
            self.line(&format!("{:7.2} s  {note}", progress.time));
        }
    }

    /// Writes down how it went.
    pub fn end(&mut self, report: &Result<Report, DriverError>) {
        match report {
            Ok(report) => self.line(&report.why().unwrap_or_else(|| "done".to_owned())),
            Err(problem) => self.line(&format!("error: {problem}")),
        }
    }

    fn line(&mut self, words: &str) {
        // The recording reports a full disk.
        let _ = writeln!(self.file, "{words}");
    }
}
