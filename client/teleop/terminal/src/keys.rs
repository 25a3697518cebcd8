//! Decodes the bytes of a terminal into keys. Pure.
//!
//! Only what every terminal sends is used, also over SSH and in tmux: no key
//! releases, no extended protocols. Pasted text arrives bracketed as one key,
//! so that it can never be interpreted as driving.
//!
//! crossterm's event reader (0.29) is not used: it decodes an escape
//! sequence that arrives in pieces, as over SSH, as Escape and
//! letters, which drive (crossterm issue 993), and the test
//! `a_sequence_that_arrives_in_pieces_is_one_key_and_a_lone_escape_another`
//! forbids that. `terminal` documents the other reason.

/// A key, or text that was pasted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Key {
    /// A character; Space is `' '`.
    Char(char),
    /// A letter with Ctrl.
    Ctrl(char),
    /// Enter.
    Enter,
    /// Escape.
    Escape,
    /// Backspace.
    Backspace,
    /// Delete.
    Delete,
    /// Tab.
    Tab,
    /// Shift and Tab.
    BackTab,
    /// Arrow up.
    Up,
    /// Arrow down.
    Down,
    /// Arrow left.
    Left,
    /// Arrow right.
    Right,
    /// Home.
    Home,
    /// End.
    End,
    /// Text pasted at once.
    Paste(String),
    /// A key without a function here.
    Other,
}

const PASTE_BEGINS: &[u8] = b"\x1b[200~";
const PASTE_ENDS: &[u8] = b"\x1b[201~";
/// Longest paste that is kept, bytes; an instruction has at most 10 000.
const MAX_PASTE: usize = 64 * 1024;
/// Longest incomplete escape sequence, bytes.
const MAX_SEQUENCE: usize = 32;

/// Decoder of the input bytes.
#[derive(Clone, Debug, Default)]
pub struct Decoder {
    bytes: Vec<u8>,
}

enum Step {
    /// A key of so many bytes.
    Key(Key, usize),
    /// The bytes may be the beginning of something longer.
    More,
}

impl Decoder {
    /// Adds received bytes; returns the complete keys.
    pub fn feed(&mut self, bytes: &[u8]) -> Vec<Key> {
        self.bytes.extend_from_slice(bytes);
        let mut keys = Vec::new();
        while let Step::Key(key, length) = step(&self.bytes) {
            self.bytes.drain(..length);
            keys.push(key);
        }
        keys
    }

    /// Called when no byte arrived for a moment: a lone escape character is the key.
    pub fn idle(&mut self) -> Vec<Key> {
        if self.bytes.starts_with(PASTE_BEGINS) {
            return Vec::new();
        }
        let mut keys = Vec::new();
        if self.bytes.first() == Some(&0x1b) {
            self.bytes.remove(0);
            keys.push(if self.bytes.is_empty() {
                Key::Escape
            } else {
                // The rest of a broken sequence must not become keys.
                self.bytes.clear();
                Key::Other
            });
        } else if !self.bytes.is_empty() {
            self.bytes.clear();
            keys.push(Key::Other);
        }
        keys
    }

    /// Whether bytes wait for [`Decoder::idle`].
    #[must_use]
    pub fn waits(&self) -> bool {
        !self.bytes.is_empty()
    }
}

fn find(bytes: &[u8], part: &[u8]) -> Option<usize> {
    bytes.windows(part.len()).position(|window| window == part)
}

fn step(bytes: &[u8]) -> Step {
    match bytes {
        [] => Step::More,
        [0x1b] => Step::More,
        [0x1b, b'[', ..] => csi(bytes),
        [0x1b, b'O', last, ..] => Step::Key(named(*last), 3),
        [0x1b, b'O'] => Step::More,
        // A key with Alt, or Escape and a key at once: neither is a command.
        [0x1b, 0x1b, ..] => Step::Key(Key::Escape, 1),
        [0x1b, _, ..] => Step::Key(Key::Other, 2),
        [b'\r' | b'\n', ..] => Step::Key(Key::Enter, 1),
        [b'\t', ..] => Step::Key(Key::Tab, 1),
        [0x7f | 0x08, ..] => Step::Key(Key::Backspace, 1),
        [0, ..] => Step::Key(Key::Other, 1),
        [control @ 1..=26, ..] => Step::Key(Key::Ctrl(char::from(control + b'a' - 1)), 1),
        [28..=31, ..] => Step::Key(Key::Other, 1),
        _ => character(bytes),
    }
}

fn named(last: u8) -> Key {
    match last {
        b'A' => Key::Up,
        b'B' => Key::Down,
        b'C' => Key::Right,
        b'D' => Key::Left,
        b'H' => Key::Home,
        b'F' => Key::End,
        b'Z' => Key::BackTab,
        _ => Key::Other,
    }
}

/// A control sequence: parameters, then a letter or `~`.
fn csi(bytes: &[u8]) -> Step {
    if bytes.starts_with(PASTE_BEGINS) {
        let content = &bytes[PASTE_BEGINS.len()..];
        return match find(content, PASTE_ENDS) {
            Some(length) => {
                let text = String::from_utf8_lossy(&content[..length]).into_owned();
                Step::Key(
                    Key::Paste(text),
                    PASTE_BEGINS.len() + length + PASTE_ENDS.len(),
                )
            }
            None if bytes.len() > MAX_PASTE => Step::Key(Key::Other, bytes.len()),
            None => Step::More,
        };
    }
    let end = bytes[2..].iter().position(|b| (0x40..=0x7e).contains(b));
    match end {
        Some(at) => {
            let parameters = &bytes[2..2 + at];
            let key = match (bytes[2 + at], parameters) {
                (b'~', b"1" | b"7") => Key::Home,
                (b'~', b"4" | b"8") => Key::End,
                (b'~', b"3") => Key::Delete,
                (b'~', _) => Key::Other,
                // With Shift, Alt or Ctrl there are parameters.
                (last, b"") => named(last),
                _ => Key::Other,
            };
            Step::Key(key, 3 + at)
        }
        None if bytes.len() > MAX_SEQUENCE => Step::Key(Key::Other, bytes.len()),
        None => Step::More,
    }
}

fn character(bytes: &[u8]) -> Step {
    let length = match bytes[0] {
        0xc2..=0xdf => 2,
        0xe0..=0xef => 3,
        0xf0..=0xf4 => 4,
        _ => 1,
    };
    if bytes.len() < length {
        return Step::More;
    }
    match std::str::from_utf8(&bytes[..length]) {
        Ok(text) => Step::Key(text.chars().next().map_or(Key::Other, Key::Char), length),
        Err(_) => Step::Key(Key::Other, 1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_distinguished() {
        let mut decoder = Decoder::default();
        let keys = decoder.feed("ä \r\x7f\x03\x1b[A\x1bOC\x1b[Z\x1b[3~".as_bytes());
        let expected = [
            Key::Char('ä'),
            Key::Char(' '),
            Key::Enter,
            Key::Backspace,
            Key::Ctrl('c'),
            Key::Up,
            Key::Right,
            Key::BackTab,
            Key::Delete,
        ];
        assert_eq!(keys, expected);
    }

    #[test]
    fn a_sequence_that_arrives_in_pieces_is_one_key_and_a_lone_escape_another() {
        let mut decoder = Decoder::default();
        assert!(decoder.feed(b"\x1b").is_empty());
        assert!(decoder.feed(b"[").is_empty());
        assert_eq!(decoder.feed(b"D"), [Key::Left]);
        assert!(decoder.feed(b"\x1b").is_empty() && decoder.waits());
        assert_eq!(decoder.idle(), [Key::Escape]);
        // An escape key right before another key is not that key with Alt.
        assert_eq!(decoder.feed(b"\x1b\x1b[A"), [Key::Escape, Key::Up]);
        assert_eq!(decoder.feed("ü".as_bytes().get(..1).unwrap()), []);
    }

    #[test]
    fn pasted_text_and_broken_sequences_never_become_driving_keys() {
        let mut decoder = Decoder::default();
        let keys = decoder.feed(b"\x1b[200~iiii\x1b[201~k");
        assert_eq!(keys, [Key::Paste("iiii".to_owned()), Key::Char('k')]);
        assert!(decoder.feed(b"\x1b[200~iiii").is_empty());
        assert!(decoder.idle().is_empty(), "an unfinished paste waits");
        let mut decoder = Decoder::default();
        assert!(decoder.feed(b"\x1b[1;5").is_empty());
        assert_eq!(decoder.idle(), [Key::Other]);
        assert_eq!(decoder.feed(b"\x1bi"), [Key::Other]);
    }

    #[test]
    fn no_bytes_make_it_panic_or_wait_for_ever() {
        let mut decoder = Decoder::default();
        let mut state = 7_u32;
        for _ in 0..20_000 {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            decoder.feed(&[(state >> 24) as u8]);
            assert!(decoder.bytes.len() <= MAX_PASTE + 1);
        }
    }
}
