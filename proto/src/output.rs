//! Exit of a program whose standard output cannot be written.

use std::io::Write;
use std::process::exit;

/// Exit code after the reader closed the pipe, as a shell reports SIGPIPE.
const READER_GONE: i32 = 141;
/// Exit code when output cannot be stored.
const NOT_WRITTEN: i32 = 1;

/// Ends the program without a panic when its output cannot be written: silently with
/// 141 when the reader closed the pipe (`| head -1`), with a message and 1 otherwise
/// (full disk). Call it first in `main`.
pub fn end_with_output() {
    let panics = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        let words = panic.payload().downcast_ref::<String>();
        match words.and_then(|words| lost(words)) {
            Some(PrintFailure::Reader) => exit(READER_GONE),
            Some(PrintFailure::Written(why)) => {
                let _ = writeln!(
                    std::io::stderr(),
                    "error: cannot write to standard output: {why}"
                );
                exit(NOT_WRITTEN)
            }
            None => panics(panic),
        }
    }));
}

#[derive(Debug, PartialEq)]
enum PrintFailure<'a> {
    Reader,
    Written(&'a str),
}

/// Parses the panic message of `print!`.
fn lost(panic: &str) -> Option<PrintFailure<'_>> {
    let (_, why) = panic
        .strip_prefix("failed printing to std")?
        .split_once(": ")?;
    // EPIPE on every platform.
    match why.contains("(os error 32)") {
        true => Some(PrintFailure::Reader),
        false => Some(PrintFailure::Written(why)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn output_errors_are_distinguished_from_other_panics() {
        let broken = "failed printing to stdout: Broken pipe (os error 32)";
        assert_eq!(lost(broken), Some(PrintFailure::Reader));
        let full = "failed printing to stdout: No space left on device (os error 28)";
        let why = "No space left on device (os error 28)";
        assert_eq!(lost(full), Some(PrintFailure::Written(why)));
        assert_eq!(lost("index out of bounds"), None);
    }
}
