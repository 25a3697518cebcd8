//! The program `ffmpeg`, the one foreign program that the data tools start: how it
//! is found, and frames piped to it as they are. No shell is between, the names of
//! its files are chosen here, and a stream that is dropped before its end leaves no
//! process.

use std::ffi::OsString;
use std::fs::File;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Output, Stdio};

use anyhow::{Context, bail, ensure};

/// Names the program; without it `ffmpeg` is looked for on PATH.
pub const PROGRAM: &str = "WHEELARM_FFMPEG";
/// How to install the program.
const CURE: &str =
    "install it (Debian: apt-get install -y ffmpeg), name another one in WHEELARM_FFMPEG";

/// A path as an argument. It is absolute, because ffmpeg takes a name such as `10:30.mp4`
/// for a protocol and one that begins with `-` for an option.
///
/// # Errors
/// When the working directory is gone.
pub(crate) fn argument(path: &Path) -> std::io::Result<OsString> {
    Ok(std::path::absolute(path)?.into_os_string())
}

/// The program.
#[derive(Clone, Debug)]
pub(crate) struct Program {
    path: PathBuf,
    /// How to install it, or the alternative without it.
    cure: String,
}

impl Program {
    /// The one that is named or on PATH, which need not be there; `or` says how to
    /// do without it.
    pub fn named(or: &str) -> Self {
        let path = std::env::var_os(PROGRAM).filter(|name| !name.is_empty());
        Self::from_path(path.map_or_else(|| "ffmpeg".into(), PathBuf::from), or)
    }

    /// The one at `path`.
    pub fn from_path(path: PathBuf, or: &str) -> Self {
        Self {
            path,
            cure: format!("{CURE}, or {or}"),
        }
    }

    pub fn name(&self) -> impl std::fmt::Display {
        self.path.display()
    }

    pub fn cure(&self) -> &str {
        &self.cure
    }

    /// Runs the program with the arguments `question` and returns its standard output.
    ///
    /// # Errors
    /// When it is missing or does not answer, with the fix.
    pub fn request(&self, question: &[&str]) -> anyhow::Result<String> {
        let (name, cure) = (self.name(), &self.cure);
        let output = Command::new(&self.path)
            .arg("-hide_banner")
            .args(question)
            .stdin(Stdio::null())
            .output();
        match output {
            Ok(output) if output.status.success() => {
                Ok(String::from_utf8_lossy(&output.stdout).into_owned())
            }
            Ok(output) => bail!(
                "cannot query the capabilities of {name} ({}): {cure}",
                output.status
            ),
            Err(problem) if problem.kind() == ErrorKind::NotFound => {
                bail!("cannot find {name}, which encodes images as video: {cure}")
            }
            Err(problem) => bail!("{name}: {problem}: {cure}"),
        }
    }

    /// Whether it lists an encoder.
    ///
    /// # Errors
    /// As [`Program::request`].
    pub fn encoders(&self) -> anyhow::Result<Encoders> {
        Ok(Encoders(self.request(&["-encoders"])?))
    }

    /// Runs it to its end.
    ///
    /// # Errors
    /// When it does not start.
    pub fn run(&self, arguments: &[OsString]) -> anyhow::Result<Output> {
        Command::new(&self.path)
            .args(arguments)
            .stdin(Stdio::null())
            .output()
            .with_context(|| self.no_start())
    }

    /// Starts it to encode frames, which follow, into `path`.
    ///
    /// # Errors
    /// When it does not start.
    pub fn begin(&self, arguments: &[OsString], path: &Path) -> anyhow::Result<Stream> {
        let errors = path.with_extension("log");
        let mut child = Command::new(&self.path)
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(File::create(&errors)?)
            .spawn()
            .with_context(|| self.no_start())?;
        let input = child.stdin.take();
        Ok(Stream {
            program: self.path.clone(),
            child,
            input,
            path: path.to_owned(),
            errors,
            frames: 0,
        })
    }

    fn no_start(&self) -> String {
        format!("{} does not start: {}", self.name(), self.cure)
    }
}

/// Encoders that the program lists.
pub(crate) struct Encoders(String);

impl Encoders {
    #[cfg(test)]
    pub fn parse(text: &str) -> Self {
        Self(text.to_owned())
    }

    /// Whether one of this name exists.
    pub fn has(&self, encoder: &str) -> bool {
        // A line is `V....D libx264   libx264 H.264 …`.
        let mut lines = self.0.lines().map(str::split_whitespace);
        lines.any(|mut words| words.nth(1) == Some(encoder))
    }
}

/// A video that grows.
pub(crate) struct Stream {
    program: PathBuf,
    child: Child,
    input: Option<ChildStdin>,
    path: PathBuf,
    errors: PathBuf,
    frames: usize,
}

impl Stream {
    /// Appends a frame of as many bytes as its pixels need.
    ///
    /// # Errors
    /// When the program has ended, with its output.
    pub fn put(&mut self, frame: &[u8]) -> anyhow::Result<()> {
        let written = self.input.as_mut().map(|input| input.write_all(frame));
        if let Some(Ok(())) = written {
            self.frames += 1;
            return Ok(());
        }
        // It closed its input: its output is the reason.
        self.input = None;
        let status = self.child.wait()?;
        bail!(self.words(status))
    }

    /// Waits until all frames are written, and returns the size, bytes.
    ///
    /// # Errors
    /// When the program fails, with its output.
    pub fn finish(mut self) -> anyhow::Result<u64> {
        self.input = None;
        let status = self.child.wait()?;
        ensure!(status.success(), self.words(status));
        std::fs::remove_file(&self.errors)?;
        Ok(std::fs::metadata(&self.path)?.len())
    }

    fn words(&self, status: std::process::ExitStatus) -> String {
        let errors = std::fs::read_to_string(&self.errors).unwrap_or_default();
        format!(
            "{} ended ({status}) after {} frames of {}: {}",
            self.program.display(),
            self.frames,
            self.path.display(),
            errors.trim()
        )
    }
}

impl Drop for Stream {
    fn drop(&mut self) {
        // No effect on a process that has ended and was reaped.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_encoder_is_known_by_its_whole_name() {
        let encoders =
            Encoders::parse(" V..... libsvtav1   SVT-AV1\n V....D libx264rgb   libx264 H.264\n");
        assert!(encoders.has("libsvtav1") && encoders.has("libx264rgb"));
        assert!(!encoders.has("libx264"));
    }

    #[test]
    fn path_that_looks_like_a_protocol_or_an_option_is_given_as_a_file() {
        for name in ["10:30/e.mp4", "10:30.gif", "-y.mp4"] {
            let given = argument(Path::new(name)).unwrap();
            assert!(given.to_string_lossy().starts_with('/'), "{given:?}");
            assert!(Path::new(&given).ends_with(name), "{given:?}");
        }
    }

    #[test]
    fn a_missing_program_is_an_error_with_the_fix() {
        let nowhere = Program::from_path("/nowhere/ffmpeg".into(), "use --images png");
        let error = nowhere.request(&["-encoders"]).unwrap_err().to_string();
        for words in [
            "/nowhere/ffmpeg",
            "apt-get install",
            PROGRAM,
            "or use --images png",
        ] {
            assert!(error.contains(words), "{error}");
        }
    }

    #[test]
    fn a_program_that_ends_early_is_an_error_and_not_a_hang() {
        let folder = tempfile::tempdir().unwrap();
        let ends = Program::from_path("false".into(), "do without");
        let mut stream = ends.begin(&[], &folder.path().join("0.mp4")).unwrap();
        let frame = vec![0; 3 * 96 * 64];
        let error = (0..100).find_map(|_| stream.put(&frame).err());
        let error = error.expect("it took all frames").to_string();
        assert!(error.contains("false ended (exit status: 1)"), "{error}");
    }
}
