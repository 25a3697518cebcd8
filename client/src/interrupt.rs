//! Signals: how a person or another program ends a command in good order.

use std::task::Poll;

use anyhow::Context;
use tokio::signal::unix::{Signal, SignalKind, signal};

/// What was heard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Heard {
    /// Ctrl-C.
    Interrupt,
    /// SIGTERM, or SIGHUP where that is listened to.
    Terminate,
}

/// Tells of every Ctrl-C and SIGTERM from now on, on a thread of its own.
///
/// # Errors
/// When the operating system refuses.
pub fn on_signals(mut tell: impl FnMut(Heard) + Send + 'static) -> anyhow::Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .context("listening to Ctrl-C")?;
    let mut signals = {
        let _inside = runtime.enter();
        Signals::listen()?
    };
    std::thread::spawn(move || {
        loop {
            tell(runtime.block_on(signals.next()));
        }
    });
    Ok(())
}

/// Signals, heard from the moment this exists.
#[derive(Debug)]
pub struct Signals {
    all: Vec<(Signal, Heard)>,
}

impl Signals {
    /// Listens to Ctrl-C and SIGTERM, within a runtime.
    ///
    /// # Errors
    /// When the operating system refuses.
    pub fn listen() -> anyhow::Result<Self> {
        let mut signals = Self { all: Vec::new() };
        signals.hear(SignalKind::interrupt(), Heard::Interrupt)?;
        signals.hear(SignalKind::terminate(), Heard::Terminate)?;
        Ok(signals)
    }

    /// Listens to SIGHUP as well: the terminal is gone. (Who was started by
    /// `nohup` is not to hear of that.)
    ///
    /// # Errors
    /// When the operating system refuses.
    pub fn and_hangup(mut self) -> anyhow::Result<Self> {
        self.hear(SignalKind::hangup(), Heard::Terminate)?;
        Ok(self)
    }

    fn hear(&mut self, kind: SignalKind, as_what: Heard) -> anyhow::Result<()> {
        let signal = signal(kind).context("signals cannot be heard")?;
        self.all.push((signal, as_what));
        Ok(())
    }

    /// Resolves at the next of them.
    pub async fn next(&mut self) -> Heard {
        std::future::poll_fn(|context| {
            let heard = self.all.iter_mut().find_map(|(signal, what)| {
                let came = matches!(signal.poll_recv(context), Poll::Ready(Some(())));
                came.then_some(*what)
            });
            heard.map_or(Poll::Pending, Poll::Ready)
        })
        .await
    }
}
