//! Reads payloads of a log ahead on its own thread while the caller processes
//! earlier ones.

use crossbeam_channel::{Receiver, Sender};

use super::{Entry, LogError, RECORD_HEADER, Scan};

/// Limit of payloads read ahead.
const WAITING: usize = 3;

/// Payloads in the requested order.
pub struct Ahead {
    ready: Receiver<Result<Record, LogError>>,
    used: Sender<Vec<u8>>,
    now: Record,
}

/// A record of the log, in a buffer that may be longer.
#[derive(Default)]
struct Record {
    memory: Vec<u8>,
    payload: usize,
}

impl Ahead {
    /// The next payload; `None` after the last one and after a failure.
    ///
    /// # Errors
    /// Those of [`Scan::payload`].
    pub fn read(&mut self) -> Option<Result<&[u8], LogError>> {
        // The reader has ended when the receiver is dropped.
        let _ = self.used.send(std::mem::take(&mut self.now.memory));
        match self.ready.recv().ok()? {
            Ok(record) => {
                self.now = record;
                let end = RECORD_HEADER + self.now.payload;
                Some(Ok(&self.now.memory[RECORD_HEADER..end]))
            }
            Err(problem) => Some(Err(problem)),
        }
    }
}

/// Calls `work` with the payloads of `entries` in order.
pub fn read_ahead<T>(scan: &Scan, entries: &[&Entry], work: impl FnOnce(&mut Ahead) -> T) -> T {
    let (to_user, ready) = crossbeam_channel::bounded(WAITING);
    let (used, free) = crossbeam_channel::unbounded();
    std::thread::scope(|scope| {
        scope.spawn(move || {
            for entry in entries {
                let mut memory: Vec<u8> = free.try_recv().unwrap_or_default();
                let payload = scan.payload(entry, &mut memory).map(<[u8]>::len);
                let record = payload.map(|payload| Record { memory, payload });
                let failed = record.is_err();
                if to_user.send(record).is_err() || failed {
                    return;
                }
            }
        });
        work(&mut Ahead {
            ready,
            used,
            now: Record::default(),
        })
    })
}
