//! Work on a separate thread, which its starter can outlive.

use std::any::Any;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use anyhow::Context;

use crate::limits;

/// Work of this process on a separate thread. A panic in it is an error, and work that never
/// ends can be abandoned.
#[derive(Debug)]
pub struct Work<T> {
    thread: JoinHandle<T>,
}

/// Work that panicked, with its words.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("it panicked: {0}")]
pub struct Panicked(pub String);

impl<T: Send + 'static> Work<T> {
    /// Begins `work` on a thread called `name`.
    ///
    /// # Errors
    /// When the system gives no thread.
    pub fn start(name: &str, work: impl FnOnce() -> T + Send + 'static) -> anyhow::Result<Self> {
        let thread = std::thread::Builder::new().name(name.to_owned());
        let thread = thread
            .spawn(work)
            .with_context(|| format!("starting the thread of the {name}"))?;
        Ok(Self { thread })
    }

    /// Whether it has come to an end.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.thread.is_finished()
    }

    /// Whether it ends within `patience`.
    #[must_use]
    pub fn is_over_within(&self, patience: Duration) -> bool {
        let deadline = Instant::now() + patience;
        while !self.is_over() && Instant::now() < deadline {
            std::thread::sleep(limits::LOOK);
        }
        self.is_over()
    }

    /// Waits for its end and gives what came of it. Dropping it instead leaves
    /// it behind, until this process ends.
    ///
    /// # Errors
    /// [`Panicked`].
    pub fn outcome(self) -> Result<T, Panicked> {
        let outcome = self.thread.join();
        outcome.map_err(|cause| Panicked::because_of(&*cause))
    }
}

impl Panicked {
    /// The words of a panic's cause.
    #[must_use]
    pub fn because_of(cause: &(dyn Any + Send)) -> Self {
        let text = cause.downcast_ref::<&str>().map(|text| (*text).to_owned());
        let text = text.or_else(|| cause.downcast_ref::<String>().cloned());
        Self(text.unwrap_or_else(|| "without words".to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc;

    #[test]
    fn panic_is_an_error_with_its_message() {
        let work = Work::start("operator", || -> u32 {
            let number = 7;
            panic!("no way to {number}")
        });
        assert_eq!(
            work.unwrap().outcome(),
            Err(Panicked("no way to 7".to_owned()))
        );
        let plain = Work::start("operator", || -> u32 { panic!("plain") });
        let error = plain.unwrap().outcome().unwrap_err().to_string();
        assert_eq!(error, "it panicked: plain");
        assert_eq!(Work::start("operator", || 3).unwrap().outcome(), Ok(3));
    }

    #[test]
    fn endless_work_is_abandoned() {
        let (end, ended) = mpsc::channel::<()>();
        let work = Work::start("operator", move || ended.recv().is_err()).unwrap();
        assert!(!work.is_over_within(limits::LOOK));
        drop(work);
        drop(end);
    }
}
