//! The end of a program whose standard output cannot be written.

use std::io::Write;
use std::process::exit;

/// Exit code of a program whose reader has gone, as a shell reports SIGPIPE.
const READER_GONE: i32 = 141;
/// Exit code of one whose output cannot be stored.
const NOT_WRITTEN: i32 = 1;

/// From here on a program ends without a panic when what it prints cannot be
/// written: quietly with 141 where the reader has gone (`| head -1`), with words
/// and 1 otherwise (a full disk). It is called once, first of all in `main`.
pub fn end_with_output() {
    let panics = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        let words = panic.payload().downcast_ref::<String>();
        match words.and_then(|words| lost(words)) {
            Some(Lost::Reader) => exit(READER_GONE),
            Some(Lost::Written(why)) => {
                let _ = writeln!(
                    std::io::stderr(),
                    "error: what this program prints cannot be written: {why}"
                );
                exit(NOT_WRITTEN)
            }
            None => panics(panic),
        }
    }));
}

#[derive(Debug, PartialEq)]
enum Lost<'a> {
    Reader,
    Written(&'a str),
}

/// What the standard library's `print!` says when it cannot write.
fn lost(panic: &str) -> Option<Lost<'_>> {
    let (_, why) = panic
        .strip_prefix("failed printing to std")?
        .split_once(": ")?;
    // EPIPE, wherever there is one.
    match why.contains("(os error 32)") {
        true => Some(Lost::Reader),
        false => Some(Lost::Written(why)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn output_without_a_reader_or_a_place_is_told_from_other_panics() {
        let broken = "failed printing to stdout: Broken pipe (os error 32)";
        assert_eq!(lost(broken), Some(Lost::Reader));
        let full = "failed printing to stdout: No space left on device (os error 28)";
        let why = "No space left on device (os error 28)";
        assert_eq!(lost(full), Some(Lost::Written(why)));
        assert_eq!(lost("index out of bounds"), None);
    }
}
