//! An operator at a pseudo-terminal: presses keys and reads the screen.

use std::io::{Read, Write};
use std::num::NonZeroU16;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use portable_pty::{Child, CommandBuilder, ExitStatus, MasterPty, PtySize, native_pty_system};
use wheelarm_tests::{Server, program};

/// Longest wait for a text on the screen.
const PATIENCE: Duration = Duration::from_secs(90);
const ROWS: u16 = 44;
const COLUMNS: u16 = 130;

/// `wheelarm teleop` on a terminal of its own.
pub struct Operator {
    child: Box<dyn Child + Send + Sync>,
    master: Option<Box<dyn MasterPty + Send>>,
    keys: Option<Box<dyn Write + Send>>,
    screen: Arc<Mutex<vt100::Parser>>,
    /// Everything that was written to the terminal.
    written: Arc<Mutex<Vec<u8>>>,
    /// Set when the terminal is closed.
    closed: Arc<AtomicBool>,
}

impl Operator {
    /// Starts `wheelarm teleop` with this server.
    pub fn start(server: &Server, args: &[&str]) -> Self {
        let size = PtySize {
            rows: ROWS,
            cols: COLUMNS,
            pixel_width: 0,
            pixel_height: 0,
        };
        let pair = native_pty_system().openpty(size).expect("a terminal");
        let mut command = CommandBuilder::new(program("wheelarm").expect("the client"));
        command.args(["--connect", &server.endpoint, "--sim", &server.sim]);
        command.args(["teleop", "--page", "127.0.0.1:0"]);
        command.args(args);
        command.env("TERM", "xterm-256color");
        command.env("LANG", "C.UTF-8");
        let child = pair.slave.spawn_command(command).expect("teleop");
        drop(pair.slave);
        let mut reader = pair.master.try_clone_reader().expect("its output");
        let keys = pair.master.take_writer().expect("its keyboard");
        let [rows, columns] = [ROWS, COLUMNS].map(|n| NonZeroU16::new(n).expect("a size"));
        let screen = Arc::new(Mutex::new(vt100::Parser::new(rows, columns, 0)));
        let written = Arc::new(Mutex::new(Vec::new()));
        let closed = Arc::new(AtomicBool::new(false));
        let (to_screen, to_written) = (Arc::clone(&screen), Arc::clone(&written));
        let to_closed = Arc::clone(&closed);
        std::thread::spawn(move || {
            let mut bytes = [0_u8; 8192];
            while let Ok(count @ 1..) = reader.read(&mut bytes) {
                if to_closed.load(Ordering::Acquire) {
                    return;
                }
                to_screen.lock().expect("a lock").process(&bytes[..count]);
                let mut written = to_written.lock().expect("a lock");
                written.extend_from_slice(&bytes[..count]);
            }
        });
        Self {
            child,
            master: Some(pair.master),
            keys: Some(keys),
            screen,
            written,
            closed,
        }
    }

    /// The text on the screen.
    pub fn screen_text(&self) -> String {
        self.screen.lock().expect("a lock").screen().contents()
    }

    /// Everything that was written to the terminal so far.
    pub fn written(&self) -> String {
        String::from_utf8_lossy(&self.written.lock().expect("a lock")).into_owned()
    }

    /// Presses keys, one character each.
    pub fn press(&mut self, keys: &str) {
        let keyboard = self.keys.as_mut().expect("a keyboard");
        keyboard.write_all(keys.as_bytes()).expect("a terminal");
        keyboard.flush().expect("a terminal");
    }

    /// Waits until `wanted` accepts the text on the screen; the text.
    pub fn wait_until(&self, what: &str, wanted: impl Fn(&str) -> bool) -> String {
        let since = Instant::now();
        loop {
            let text = self.screen_text();
            if wanted(&text) {
                return text;
            }
            assert!(
                since.elapsed() < PATIENCE,
                "timeout while waiting for {what}; the screen:\n{text}"
            );
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Waits until `words` are on the screen.
    pub fn wait_for(&self, words: &str) -> String {
        self.wait_until(words, |text| text.contains(words))
    }

    /// The numbers behind `name` in its line on the screen.
    pub fn numbers(&self, name: &str) -> Option<Vec<f64>> {
        let text = self.screen_text();
        let line = text.lines().find(|line| line.contains(name))?;
        let rest = &line[line.find(name)? + name.len()..];
        let words = rest.split(|c: char| !(c.is_ascii_digit() || c == '.' || c == '-'));
        let numbers: Vec<f64> = words.filter_map(|word| word.parse().ok()).collect();
        (!numbers.is_empty()).then_some(numbers)
    }

    /// Closes the terminal as a closed window does: at the next output, while the reader thread
    /// still holds it.
    pub fn close_terminal(&mut self) {
        self.closed.store(true, Ordering::Release);
        self.keys = None;
        self.master = None;
    }

    /// Waits for the end of the program.
    pub fn end(&mut self) -> ExitStatus {
        let since = Instant::now();
        loop {
            if let Some(status) = self.child.try_wait().expect("its state") {
                return status;
            }
            assert!(since.elapsed() < PATIENCE, "teleop does not end");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Its process id.
    pub fn process(&self) -> u32 {
        self.child.process_id().expect("a process")
    }
}

impl Drop for Operator {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
