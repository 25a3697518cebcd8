//! Answers on their way out. The transport makes whoever sends one wait until
//! the asker reads, for five seconds where it does not: a thread of its own
//! waits here, so that the simulation never does. It is one thread: two that
//! wait for the same asker would hold up what the transport sends to others.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::{Duration, Instant};

use bytes::Bytes;
use wheelarm_proto::{Message, v1};
use zenoh::Wait;
use zenoh::query::Query;

use super::lock;

/// Answers that may wait.
const ROOM: usize = 512;

/// A request of up to so many bytes costs next to no memory while it waits.
const LIGHT: usize = 4 << 10;

/// Beyond so many answers that wait no heavy request is told why it is refused.
const HEAVY_ROOM: usize = 16;

/// What makes an answer: here, where it may take its time.
type Make = Box<dyn FnOnce() -> Result<Bytes, String> + Send>;

enum Body {
    Made(Bytes),
    Refused(String),
    Later(Make),
}

struct Reply {
    asked: Query,
    header: v1::Header,
    body: Body,
}

impl Reply {
    fn send(self) {
        let answer = match self.body {
            Body::Made(bytes) => Ok(bytes),
            Body::Refused(message) => Err(message),
            Body::Later(make) => make(),
        };
        let outcome = match answer {
            Ok(bytes) => {
                let key = self.asked.key_expr().clone();
                self.asked.reply(key, bytes).wait()
            }
            Err(message) => {
                let failure = v1::Failure {
                    header: Some(self.header),
                    message,
                };
                self.asked.reply_err(failure.encode_to_vec()).wait()
            }
        };
        if let Err(e) = outcome {
            tracing::debug!("cannot answer {}: {e}", self.asked.key_expr());
        }
    }
}

/// The way out of answers.
#[derive(Default)]
pub struct Replies(Arc<Queue>);

impl Replies {
    /// Whether there is room for the next answer.
    pub fn has_room(&self) -> bool {
        self.0.waiting() < ROOM
    }

    /// Answers.
    pub fn answer(&self, asked: Query, header: v1::Header, bytes: Bytes) {
        let body = Body::Made(bytes);
        self.put(asked, header, body);
    }

    /// Answers with what `make` makes, on the other thread.
    pub fn answer_later(
        &self,
        asked: Query,
        header: v1::Header,
        make: impl FnOnce() -> Result<Bytes, String> + Send + 'static,
    ) {
        self.put(asked, header, Body::Later(Box::new(make)));
    }

    /// Refuses with the cure.
    pub fn refuse(&self, asked: Query, header: v1::Header, message: String) {
        self.put(asked, header, Body::Refused(message));
    }

    /// As [`Replies::refuse`] for what came in a flood or is too large: where so
    /// many are being turned away that they would cost memory, it ends without a
    /// word.
    pub fn turn_away(&self, asked: Query, header: v1::Header, message: String) {
        let light = asked.payload().is_none_or(|p| p.len() <= LIGHT);
        let room = if light { 8 * ROOM } else { HEAVY_ROOM };
        if self.0.waiting() < room {
            self.refuse(asked, header, message);
        }
    }

    fn put(&self, asked: Query, header: v1::Header, body: Body) {
        self.0.put(Reply {
            asked,
            header,
            body,
        });
    }

    /// Waits until everything has gone out, `patience` at most; then the thread
    /// ends.
    pub fn finish(&self, patience: Duration) {
        let until = Instant::now() + patience;
        while self.0.is_busy() && Instant::now() < until {
            std::thread::sleep(Duration::from_millis(2));
        }
        lock(&self.0.state).ended = true;
        self.0.came.notify_all();
    }
}

#[derive(Default)]
struct Queue {
    state: Mutex<State>,
    came: Condvar,
}

#[derive(Default)]
struct State {
    waiting: VecDeque<Reply>,
    started: bool,
    idle: bool,
    ended: bool,
}

impl Queue {
    fn waiting(&self) -> usize {
        lock(&self.state).waiting.len()
    }

    fn is_busy(&self) -> bool {
        let state = lock(&self.state);
        !state.waiting.is_empty() || (state.started && !state.idle)
    }

    fn put(self: &Arc<Self>, reply: Reply) {
        let mut state = lock(&self.state);
        state.waiting.push_back(reply);
        if !state.started {
            let queue = Arc::clone(self);
            let thread = std::thread::Builder::new().name("answers".to_owned());
            state.started = thread.spawn(move || queue.work()).is_ok();
        }
        drop(state);
        self.came.notify_one();
    }

    fn work(&self) {
        let mut state = lock(&self.state);
        loop {
            if let Some(reply) = state.waiting.pop_front() {
                drop(state);
                // One answer that cannot be made takes no other with it.
                let sent = std::panic::AssertUnwindSafe(|| reply.send());
                if std::panic::catch_unwind(sent).is_err() {
                    tracing::error!("an answer panicked; please report it");
                }
                state = lock(&self.state);
            } else if state.ended {
                return;
            } else {
                state.idle = true;
                let waked = self.came.wait(state);
                state = waked.unwrap_or_else(PoisonError::into_inner);
                state.idle = false;
            }
        }
    }
}
