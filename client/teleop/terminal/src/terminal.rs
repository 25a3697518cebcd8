//! The terminal: raw mode and the alternate screen, restored in every case; keyboard
//! input; detection of its loss.
//!
//! The keyboard is read here byte by byte, because a reader must notice that
//! the terminal is gone: then the chair must stop. On a terminal that hung up
//! crossterm's reader (0.29, issue 793) neither returns nor fails, but uses a whole
//! CPU core; the test `a_reader_ends_with_its_terminal` checks that this
//! one ends.

use std::io::{BufWriter, IsTerminal, Stdout, Write};
use std::os::fd::AsFd;
use std::time::Duration;

use anyhow::{Context, bail};
use crossbeam_channel::Sender;
use parking_lot::Mutex;
use ratatui::Terminal;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::termios::{OptionalActions, Termios, tcgetattr, tcsetattr};

use crate::keys::{Decoder, Key};
use crate::quiet::Quiet;

/// The other screen, bracketed paste, no cursor.
const ENTER: &str = "\x1b[?1049h\x1b[?2004h\x1b[?25l\x1b[2J";
/// Restores colors, cursor, paste mode and screen.
const LEAVE: &str = "\x1b[0m\x1b[?25h\x1b[?2004l\x1b[?1049l";
/// A lone escape character is the Escape key after this time.
const ESCAPE: Duration = Duration::from_millis(60);
/// Interval of the checks whether the terminal is still there.
const WATCH: Duration = Duration::from_millis(200);

/// The terminal's original settings, to restore them from anywhere.
static SAVED: Mutex<Option<Termios>> = Mutex::new(None);

/// Restores the terminal; does nothing the second time.
pub fn restore() {
    let saved = SAVED.lock().take();
    if let Some(saved) = saved {
        // A lost terminal cannot be restored.
        let mut out = std::io::stdout();
        let _ = out.write_all(LEAVE.as_bytes()).and_then(|()| out.flush());
        let _ = tcsetattr(std::io::stdin().as_fd(), OptionalActions::Flush, &saved);
    }
}

/// The screen while teleoperation owns it.
pub struct Screen {
    terminal: Terminal<Quiet<BufWriter<Stdout>>>,
}

impl Screen {
    /// Takes the terminal over.
    ///
    /// # Errors
    /// When standard input or output is not one.
    pub fn open() -> anyhow::Result<Self> {
        let (input, output) = (std::io::stdin(), std::io::stdout());
        if !(input.is_terminal() && output.is_terminal()) {
            bail!(
                "teleop needs a terminal for keys and screen; over SSH ask for one: ssh -t HOST wheelarm teleop"
            );
        }
        let settings = tcgetattr(input.as_fd()).context("reading the terminal's settings")?;
        let mut raw = settings.clone();
        raw.make_raw();
        *SAVED.lock() = Some(settings);
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            restore();
            before(panic);
        }));
        tcsetattr(input.as_fd(), OptionalActions::Flush, &raw)
            .context("switching the terminal to single keys")?;
        // From here on the screen is restored when this is dropped.
        let writer = BufWriter::with_capacity(1 << 16, output);
        let terminal = Terminal::new(Quiet::new(writer));
        let mut screen = Self {
            terminal: terminal.context("opening the screen")?,
        };
        screen.write(ENTER)?;
        Ok(screen)
    }

    fn write(&mut self, text: &str) -> anyhow::Result<()> {
        let out = self.terminal.backend_mut();
        out.write(text).context("writing to the terminal")
    }

    /// Renders a frame; adapts to a changed size.
    ///
    /// # Errors
    /// When the terminal is gone.
    pub fn draw(&mut self, draw: impl FnOnce(&mut ratatui::Frame<'_>)) -> anyhow::Result<()> {
        self.terminal
            .draw(draw)
            .map(|_| ())
            .context("drawing on the terminal")
    }

    /// Repaints the whole screen with the next frame.
    ///
    /// # Errors
    /// When the terminal is gone.
    pub fn clear(&mut self) -> anyhow::Result<()> {
        self.terminal.clear().context("clearing the terminal")
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        restore();
    }
}

/// Events of the keyboard.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Typed {
    /// Keys.
    Keys(Vec<Key>),
    /// The terminal is gone.
    Gone,
}

/// Reads keys until the terminal is gone or the receiver is dropped.
pub fn read_keys<E: Send + 'static>(events: Sender<E>, to_event: fn(Typed) -> E) {
    std::thread::spawn(move || {
        let mut decoder = Decoder::default();
        loop {
            let typed = match wait_for_bytes(std::io::stdin(), &mut decoder) {
                Some(keys) if keys.is_empty() => continue,
                Some(keys) => Typed::Keys(keys),
                None => Typed::Gone,
            };
            let over = typed == Typed::Gone;
            if events.send(to_event(typed)).is_err() || over {
                return;
            }
        }
    });
}

/// The next keys, possibly none; `None` when the terminal is gone.
fn wait_for_bytes(input: impl AsFd, decoder: &mut Decoder) -> Option<Vec<Key>> {
    let patience = if decoder.waits() { ESCAPE } else { WATCH };
    let timeout = Timespec {
        tv_sec: 0,
        tv_nsec: i64::from(patience.subsec_nanos()),
    };
    let mut watched = [PollFd::new(&input, PollFlags::IN)];
    match poll(&mut watched, Some(&timeout)) {
        Ok(0) => return Some(decoder.idle()),
        Ok(_) => {}
        Err(rustix::io::Errno::INTR) => return Some(Vec::new()),
        Err(_) => return None,
    }
    let ready = watched[0].revents();
    if !ready.contains(PollFlags::IN) {
        // Hung up, or an error: no key will arrive any more.
        return None;
    }
    let mut bytes = [0_u8; 4096];
    match rustix::io::read(&input, &mut bytes) {
        // End of file: the other end is closed.
        Ok(0) => None,
        Ok(count) => Some(decoder.feed(&bytes[..count])),
        Err(rustix::io::Errno::INTR | rustix::io::Errno::AGAIN) => Some(Vec::new()),
        Err(_) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::net::UnixStream;

    #[test]
    fn a_reader_ends_with_its_terminal() {
        let mut decoder = Decoder::default();
        // One end reports the end of its file, the other that it hung up.
        let (keyboard, mut terminal) = UnixStream::pair().unwrap();
        terminal.write_all(b"j").unwrap();
        drop(terminal);
        let typed = wait_for_bytes(&keyboard, &mut decoder);
        assert_eq!(typed, Some(vec![Key::Char('j')]));
        assert_eq!(wait_for_bytes(&keyboard, &mut decoder), None);
        let (keyboard, mut terminal) = std::io::pipe().unwrap();
        assert_eq!(wait_for_bytes(&keyboard, &mut decoder), Some(Vec::new()));
        terminal.write_all(b"\x1b").unwrap();
        assert_eq!(wait_for_bytes(&keyboard, &mut decoder), Some(Vec::new()));
        drop(terminal);
        assert_eq!(wait_for_bytes(&keyboard, &mut decoder), None);
    }
}
