//! Signals that end a program in good order: SIGINT, SIGTERM and SIGHUP, handled alike
//! by every program.

use std::fs::File;
use std::io::{self, Write};
use std::process::exit;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::Poll;

use rustix::fs::{FileType, fstat};
use rustix::stdio::{dup2_stderr, dup2_stdout, stderr, stdout};
use tokio::runtime::{Builder, Runtime};
use tokio::signal::unix::{Signal, SignalKind, signal};

/// A received signal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReceivedSignal {
    /// SIGINT: Ctrl-C.
    Interrupt,
    /// SIGTERM.
    Terminate,
    /// SIGHUP: the terminal was closed.
    Hangup,
    /// SIGQUIT, after [`Signals::and_quit`].
    Quit,
}

impl ReceivedSignal {
    /// Name for people.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Interrupt => "SIGINT",
            Self::Terminate => "SIGTERM",
            Self::Hangup => "SIGHUP: the terminal was closed",
            Self::Quit => "SIGQUIT",
        }
    }

    fn kind(self) -> SignalKind {
        match self {
            Self::Interrupt => SignalKind::interrupt(),
            Self::Terminate => SignalKind::terminate(),
            Self::Hangup => SignalKind::hangup(),
            Self::Quit => SignalKind::quit(),
        }
    }
}

/// Whether a command handles signals itself, so that [`end_as_first_process`] does not.
static CLAIMED: AtomicBool = AtomicBool::new(false);

/// Calls `notify` for every signal from now on, on its own thread.
///
/// # Errors
/// When the operating system rejects the handler.
pub fn on_signals(notify: impl FnMut(ReceivedSignal) + Send + 'static) -> io::Result<()> {
    CLAIMED.store(true, Ordering::Release);
    on_all(notify)
}

fn on_all(mut notify: impl FnMut(ReceivedSignal) + Send + 'static) -> io::Result<()> {
    let runtime = Builder::new_current_thread().enable_all().build()?;
    let mut signals = Signals::open(&runtime)?;
    std::thread::spawn(move || {
        loop {
            notify(runtime.block_on(signals.next()));
        }
    });
    Ok(())
}

/// Ends a program that runs as PID 1 of a container on a signal, because the kernel has
/// no default action there. Commands with their own handling are not affected. Call it
/// once, at the start of `main`.
pub fn end_as_first_process() {
    if std::process::id() != 1 {
        return;
    }
    let listening = on_all(|received| {
        if !CLAIMED.load(Ordering::Acquire) {
            exit(128 + received.kind().as_raw_value());
        }
    });
    if let Err(problem) = listening {
        let _ = writeln!(io::stderr(), "cannot handle signals: {problem}");
    }
}

/// Receives signals from its creation on.
#[derive(Debug)]
pub struct Signals {
    all: Vec<(Signal, ReceivedSignal)>,
}

impl Signals {
    /// Handles SIGINT, SIGTERM and SIGHUP on the threads of `runtime`. SIGHUP stays
    /// ignored if it was ignored at the start (`nohup`).
    ///
    /// # Errors
    /// When the operating system rejects the handler.
    pub fn listen(runtime: &Runtime) -> io::Result<Self> {
        CLAIMED.store(true, Ordering::Release);
        Self::open(runtime)
    }

    /// As [`Signals::listen`], within a runtime.
    ///
    /// # Errors
    /// When the operating system rejects the handler.
    pub fn listen_here() -> io::Result<Self> {
        CLAIMED.store(true, Ordering::Release);
        Self::handle_all()
    }

    fn open(runtime: &Runtime) -> io::Result<Self> {
        let _inside = runtime.enter();
        Self::handle_all()
    }

    fn handle_all() -> io::Result<Self> {
        let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        let mut signals = Self { all: Vec::new() };
        signals.handle(ReceivedSignal::Interrupt)?;
        signals.handle(ReceivedSignal::Terminate)?;
        if !ignores(&status, SignalKind::hangup()) {
            signals.handle(ReceivedSignal::Hangup)?;
        }
        Ok(signals)
    }

    /// Handles SIGQUIT as well, within a runtime.
    ///
    /// # Errors
    /// When the operating system rejects the handler.
    pub fn and_quit(mut self) -> io::Result<Self> {
        self.handle(ReceivedSignal::Quit)?;
        Ok(self)
    }

    fn handle(&mut self, what: ReceivedSignal) -> io::Result<()> {
        self.all.push((signal(what.kind())?, what));
        Ok(())
    }

    /// Resolves at the next signal.
    pub async fn next(&mut self) -> ReceivedSignal {
        let received = std::future::poll_fn(|context| {
            let received = self.all.iter_mut().find_map(|(signal, what)| {
                let arrived = matches!(signal.poll_recv(context), Poll::Ready(Some(())));
                arrived.then_some(*what)
            });
            received.map_or(Poll::Pending, Poll::Ready)
        })
        .await;
        if received == ReceivedSignal::Hangup {
            leave_the_terminal();
        }
        received
    }
}

/// Discards output to a closed terminal: a failed `println!` would end the program
/// before its files are complete.
fn leave_the_terminal() {
    let Ok(nowhere) = File::options().write(true).open("/dev/null") else {
        return;
    };
    let is_device = |file| {
        fstat(file)
            .is_ok_and(|stat| FileType::from_raw_mode(stat.st_mode) == FileType::CharacterDevice)
    };
    if is_device(stdout()) {
        let _ = dup2_stdout(&nowhere);
    }
    if is_device(stderr()) {
        let _ = dup2_stderr(&nowhere);
    }
}

/// Whether a process ignores a signal by its `/proc/PID/status`, whose `SigIgn` has a
/// bit for each signal, in hexadecimal.
fn ignores(status: &str, kind: SignalKind) -> bool {
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (kind.as_raw_value() - 1) & 1 == 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hangup_ignored_by_nohup_stays_ignored() {
        let status = "Name:\tx\nSigBlk:\t0000000000000001\nSigIgn:\t000000000000";
        assert!(ignores(&format!("{status}1001\n"), SignalKind::hangup()));
        assert!(!ignores(&format!("{status}1000\n"), SignalKind::hangup()));
        assert!(!ignores("", SignalKind::hangup()));
    }

    #[test]
    fn all_three_terminating_signals_are_received() {
        let runtime = Builder::new_current_thread().enable_all().build().unwrap();
        let signals = Signals::open(&runtime).unwrap();
        let received: Vec<ReceivedSignal> = signals.all.iter().map(|(_, what)| *what).collect();
        let status = std::fs::read_to_string("/proc/self/status").unwrap();
        let mut wanted = vec![ReceivedSignal::Interrupt, ReceivedSignal::Terminate];
        if !ignores(&status, SignalKind::hangup()) {
            wanted.push(ReceivedSignal::Hangup);
        }
        assert_eq!(received, wanted);
    }
}
