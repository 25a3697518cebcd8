//! Answers on their way out. The transport makes whoever sends one wait until
//! the asker reads, and gives an asker up after five seconds: a few threads wait
//! here, so that the simulation never does. An asker is served by one of them at
//! a time: who does not read delays its own answers and no other's. Two threads
//! that wait for the same connection, which takes a peer that asks under several
//! names, keep one of the transport's sending threads busy for as long; `main`
//! sees to it that there are more.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::Bytes;
use parking_lot::{Condvar, Mutex};
use wheelarm_proto::keys::Keys;
use wheelarm_proto::{Message, schema, v1};
use zenoh::Wait;
use zenoh::bytes::ZBytes;
use zenoh::query::Query;

use super::denied::Denied;

/// Answers that may wait.
const ROOM: usize = 512;

/// Of one asker. Who has more under way is told to ask again.
const ROOM_EACH: usize = 128;

/// Refusals of what was turned away that may wait, whatever answers do.
const REFUSALS: usize = 8 * ROOM;

/// Queries that may wait for an end without a word.
const UNSAID: usize = 16 * REFUSALS;

/// Threads that send: as many askers may stall before others feel it.
const THREADS: usize = 8;

/// Who asks, as far as the query says: the id of a session. Those who do not
/// say it are taken for one.
type Asker = Option<[u8; 16]>;

fn asker(asked: &Query) -> Asker {
    let source = asked.source_info()?;
    Some(source.source_id().zid().to_le_bytes())
}

/// What makes an answer: here, where it may take its time.
type Make = Box<dyn FnOnce() -> Result<Bytes, Denied> + Send>;

enum Body {
    Made(Bytes),
    Refused(Denied),
    Later(Make),
    /// The query ends, and that takes as long as an answer.
    Unsaid,
}

struct Reply {
    asked: Query,
    header: v1::Header,
    body: Body,
    /// To what was not taken in at all: it takes no room from answers.
    turned_away: bool,
}

impl Reply {
    fn send(self) {
        let answer = match self.body {
            Body::Made(bytes) => Ok(bytes),
            Body::Refused(why) => Err(why),
            Body::Later(make) => make(),
            Body::Unsaid => return,
        };
        let outcome = match answer {
            Ok(bytes) => {
                let key = self.asked.key_expr().clone();
                let message = Keys::query_of(key.as_str()).map_or("", |q| q.messages()[1]);
                let encoding = schema::encoding(message);
                self.asked.reply(key, bytes).encoding(encoding).wait()
            }
            Err(why) => {
                let failure = v1::Failure {
                    header: Some(self.header),
                    message: why.words,
                    code: why.code.into(),
                };
                let encoding = schema::encoding("wheelarm.v1.Failure");
                let reply = self.asked.reply_err(failure.encode_to_vec());
                reply.encoding(encoding).wait()
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
        self.0.state.lock().answers < ROOM
    }

    /// Whether there is room for one more answer to who asks this.
    pub fn has_room_for(&self, asked: &Query) -> bool {
        self.0.state.lock().turns.waiting_for(asker(asked)) < ROOM_EACH
    }

    /// Answers.
    pub fn answer(&self, asked: Query, header: v1::Header, bytes: Bytes) {
        self.put(asked, header, Body::Made(bytes), false);
    }

    /// Answers with what `make` makes, on another thread.
    pub fn answer_later(
        &self,
        asked: Query,
        header: v1::Header,
        make: impl FnOnce() -> Result<Bytes, Denied> + Send + 'static,
    ) {
        self.put(asked, header, Body::Later(Box::new(make)), false);
    }

    /// Refuses with the cure.
    pub fn refuse(&self, asked: Query, header: v1::Header, why: Denied) {
        self.put(asked, header, Body::Refused(why), false);
    }

    /// As [`Replies::refuse`] for what came in a flood or is too large: where so
    /// many are being turned away that they would cost memory, it ends without a
    /// word.
    pub fn turn_away(&self, asked: Query, header: v1::Header, why: Denied) {
        let waiting = self.0.state.lock().turns.waiting();
        if waiting < REFUSALS {
            self.put(asked, header, Body::Refused(why), true);
        } else if waiting < UNSAID {
            self.put(asked, header, Body::Unsaid, true);
        }
    }

    fn put(&self, mut asked: Query, header: v1::Header, body: Body, turned_away: bool) {
        // What was asked has been read; it may be megabytes.
        if let Some(payload) = asked.payload_mut() {
            *payload = ZBytes::new();
        }
        let asker = asker(&asked);
        self.0.put(
            asker,
            Reply {
                asked,
                header,
                body,
                turned_away,
            },
        );
    }

    /// Waits until everything has gone out, `patience` at most; then the threads
    /// end.
    pub fn finish(&self, patience: Duration) {
        let until = Instant::now() + patience;
        while self.0.state.lock().is_busy() && Instant::now() < until {
            std::thread::sleep(Duration::from_millis(2));
        }
        self.0.state.lock().ended = true;
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
    turns: Turns<Reply>,
    /// Those that wait and were not turned away.
    answers: usize,
    threads: usize,
    /// Threads that wait for something to send.
    free: usize,
    ended: bool,
}

impl State {
    fn is_busy(&self) -> bool {
        self.turns.waiting() > 0 || self.free < self.threads
    }
}

impl Queue {
    fn put(self: &Arc<Self>, asker: Asker, reply: Reply) {
        let mut state = self.state.lock();
        state.answers += usize::from(!reply.turned_away);
        state.turns.put(asker, reply);
        if state.turns.ready() > state.free && state.threads < THREADS {
            let queue = Arc::clone(self);
            let thread = std::thread::Builder::new().name("answers".to_owned());
            state.threads += usize::from(thread.spawn(move || queue.work()).is_ok());
        }
        drop(state);
        self.came.notify_one();
    }

    fn work(&self) {
        let mut state = self.state.lock();
        loop {
            if let Some((asker, reply)) = state.turns.next() {
                state.answers -= usize::from(!reply.turned_away);
                drop(state);
                // One answer that cannot be made takes no other with it.
                let sent = std::panic::AssertUnwindSafe(|| reply.send());
                if std::panic::catch_unwind(sent).is_err() {
                    tracing::error!("an answer panicked; please report it");
                }
                state = self.state.lock();
                state.turns.served(asker);
            } else if state.ended {
                return;
            } else {
                state.free += 1;
                self.came.wait(&mut state);
                state.free -= 1;
            }
        }
    }
}

/// What waits for each asker. Askers come in turn, each with one thing at a
/// time; what waits for one leaves in order.
struct Turns<T> {
    /// Of askers for whom something waits or who are being served.
    lines: BTreeMap<Asker, VecDeque<T>>,
    /// Askers whose turn may come.
    ready: VecDeque<Asker>,
    waiting: usize,
}

impl<T> Default for Turns<T> {
    fn default() -> Self {
        Self {
            lines: BTreeMap::new(),
            ready: VecDeque::new(),
            waiting: 0,
        }
    }
}

impl<T> Turns<T> {
    fn put(&mut self, asker: Asker, what: T) {
        let line = self.lines.entry(asker).or_insert_with(|| {
            self.ready.push_back(asker);
            VecDeque::new()
        });
        line.push_back(what);
        self.waiting += 1;
    }

    /// The next one, whose asker is not served again before [`Turns::served`].
    fn next(&mut self) -> Option<(Asker, T)> {
        let asker = self.ready.pop_front()?;
        let what = self.lines.get_mut(&asker)?.pop_front()?;
        self.waiting -= 1;
        Some((asker, what))
    }

    fn served(&mut self, asker: Asker) {
        if self.lines.get(&asker).is_some_and(VecDeque::is_empty) {
            self.lines.remove(&asker);
        } else {
            self.ready.push_back(asker);
        }
    }

    fn waiting(&self) -> usize {
        self.waiting
    }

    fn waiting_for(&self, asker: Asker) -> usize {
        self.lines.get(&asker).map_or(0, VecDeque::len)
    }

    fn ready(&self) -> usize {
        self.ready.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn askers_come_in_turn_and_one_that_is_served_waits_for_its_end() {
        let mut turns = Turns::default();
        let [deaf, stranger, other] = [Some([1; 16]), None, Some([2; 16])];
        for number in 0..3 {
            turns.put(deaf, number);
        }
        turns.put(stranger, 10);
        turns.put(other, 20);
        turns.put(other, 21);
        assert_eq!(turns.next(), Some((deaf, 0)));
        // While it is waited for, the others are served, each in order.
        assert_eq!(turns.next(), Some((stranger, 10)));
        assert_eq!(turns.next(), Some((other, 20)));
        assert_eq!((turns.next(), turns.waiting()), (None, 3));
        turns.served(other);
        turns.served(stranger);
        assert_eq!(turns.next(), Some((other, 21)));
        turns.served(other);
        turns.put(deaf, 3);
        assert_eq!((turns.next(), turns.waiting_for(deaf)), (None, 3));
        turns.served(deaf);
        for number in 1..4 {
            assert_eq!(turns.next(), Some((deaf, number)));
            turns.served(deaf);
        }
        assert_eq!((turns.next(), turns.waiting()), (None, 0));
        assert!(turns.lines.is_empty(), "nobody is remembered");
    }
}
