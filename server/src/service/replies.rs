//! Sends replies on a few threads of its own.
//!
//! The transport blocks the sender until the client reads, and drops a client after
//! five seconds, so the simulation thread must not send. Each client may occupy one
//! thread, so a client that stops reading delays only its own replies.
//!
//! Client names are not authenticated, so one peer can occupy several threads, which
//! block one of the transport's sending threads. `main` therefore starts several of
//! those.

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

/// Replies that may wait.
const ROOM: usize = 512;

/// Replies that may wait per client; further queries are rejected.
const ROOM_EACH: usize = 128;

/// Rejections that may wait, independent of the number of replies.
const REFUSALS: usize = 8 * ROOM;

/// Queries that may wait to be closed without a reply.
const MAX_SILENT: usize = 16 * REFUSALS;

/// Threads that send: as many clients may stall before others notice.
const THREADS: usize = 8;

/// Session ID of the client, if the query contains it. Clients without ID share one
/// entry.
type ClientId = Option<[u8; 16]>;

fn client(query: &Query) -> ClientId {
    let source = query.source_info()?;
    Some(source.source_id().zid().to_le_bytes())
}

/// Computes a reply on the sending thread.
type ComputeReply = Box<dyn FnOnce() -> Result<Bytes, Denied> + Send>;

enum Body {
    Made(Bytes),
    Refused(Denied),
    Later(ComputeReply),
    /// Closes the query without a reply, which takes as long as a reply.
    Silent,
}

struct Reply {
    query: Query,
    header: v1::Header,
    body: Body,
    /// Reply to a query that was rejected before the queue; takes no room from others.
    turned_away: bool,
}

impl Reply {
    fn send(self) {
        let answer = match self.body {
            Body::Made(bytes) => Ok(bytes),
            Body::Refused(why) => Err(why),
            Body::Later(make) => make(),
            Body::Silent => return,
        };
        let outcome = match answer {
            Ok(bytes) => {
                let key = self.query.key_expr().clone();
                let message = Keys::query_of(key.as_str()).map_or("", |q| q.messages()[1]);
                let encoding = schema::encoding(message);
                self.query.reply(key, bytes).encoding(encoding).wait()
            }
            Err(why) => {
                let failure = v1::Failure {
                    header: Some(self.header),
                    message: why.words,
                    code: why.code.into(),
                };
                let encoding = schema::encoding("wheelarm.v1.Failure");
                let reply = self.query.reply_err(failure.encode_to_vec());
                reply.encoding(encoding).wait()
            }
        };
        if let Err(e) = outcome {
            tracing::debug!("cannot answer {}: {e}", self.query.key_expr());
        }
    }
}

/// Queue of replies.
#[derive(Default)]
pub struct Replies(Arc<Queue>);

impl Replies {
    /// Whether there is room for the next reply.
    pub fn has_room(&self) -> bool {
        self.0.state.lock().answers < ROOM
    }

    /// Whether there is room for one more reply to the client of `query`.
    pub fn has_room_for(&self, query: &Query) -> bool {
        self.0.state.lock().client_queues.waiting_for(client(query)) < ROOM_EACH
    }

    /// Sends a reply.
    pub fn answer(&self, query: Query, header: v1::Header, bytes: Bytes) {
        self.put(query, header, Body::Made(bytes), false);
    }

    /// Sends a reply that `make` computes on another thread.
    pub fn answer_later(
        &self,
        query: Query,
        header: v1::Header,
        make: impl FnOnce() -> Result<Bytes, Denied> + Send + 'static,
    ) {
        self.put(query, header, Body::Later(Box::new(make)), false);
    }

    /// Sends a rejection with the fix.
    pub fn refuse(&self, query: Query, header: v1::Header, why: Denied) {
        self.put(query, header, Body::Refused(why), false);
    }

    /// As [`Replies::refuse`], for a flood or an oversized request. When too many
    /// rejections wait, the query is closed without a reply.
    pub fn turn_away(&self, query: Query, header: v1::Header, why: Denied) {
        let waiting = self.0.state.lock().client_queues.waiting();
        if waiting < REFUSALS {
            self.put(query, header, Body::Refused(why), true);
        } else if waiting < MAX_SILENT {
            self.put(query, header, Body::Silent, true);
        }
    }

    fn put(&self, mut query: Query, header: v1::Header, body: Body, turned_away: bool) {
        // The payload has been decoded; it may be megabytes.
        if let Some(payload) = query.payload_mut() {
            *payload = ZBytes::new();
        }
        let client = client(&query);
        self.0.put(
            client,
            Reply {
                query,
                header,
                body,
                turned_away,
            },
        );
    }

    /// Waits until all replies are sent, `patience` at most; then the threads end.
    pub fn finish(&self, patience: Duration) {
        let until = Instant::now() + patience;
        while self.0.state.lock().is_busy() && Instant::now() < until {
            std::thread::sleep(Duration::from_millis(2));
        }
        self.0.state.lock().ended = true;
        self.0.arrived.notify_all();
    }
}

#[derive(Default)]
struct Queue {
    state: Mutex<State>,
    arrived: Condvar,
}

#[derive(Default)]
struct State {
    client_queues: ClientQueues<Reply>,
    /// Waiting replies that were not turned away.
    answers: usize,
    threads: usize,
    /// Threads that wait for a reply to send.
    free: usize,
    ended: bool,
}

impl State {
    fn is_busy(&self) -> bool {
        self.client_queues.waiting() > 0 || self.free < self.threads
    }
}

impl Queue {
    fn put(self: &Arc<Self>, client: ClientId, reply: Reply) {
        let mut state = self.state.lock();
        state.answers += usize::from(!reply.turned_away);
        state.client_queues.put(client, reply);
        if state.client_queues.ready() > state.free && state.threads < THREADS {
            let queue = Arc::clone(self);
            let thread = std::thread::Builder::new().name("answers".to_owned());
            state.threads += usize::from(thread.spawn(move || queue.work()).is_ok());
        }
        drop(state);
        self.arrived.notify_one();
    }

    fn work(&self) {
        let mut state = self.state.lock();
        loop {
            if let Some((client, reply)) = state.client_queues.next() {
                state.answers -= usize::from(!reply.turned_away);
                drop(state);
                // A reply that panics must not end the thread.
                let sent = std::panic::AssertUnwindSafe(|| reply.send());
                if std::panic::catch_unwind(sent).is_err() {
                    tracing::error!("an answer panicked; please report it");
                }
                state = self.state.lock();
                state.client_queues.served(client);
            } else if state.ended {
                return;
            } else {
                state.free += 1;
                self.arrived.wait(&mut state);
                state.free -= 1;
            }
        }
    }
}

/// Waiting replies of each client. Clients take turns, one reply at a time; replies to
/// one client leave in order.
struct ClientQueues<T> {
    /// Clients with waiting replies, or that are being served.
    lines: BTreeMap<ClientId, VecDeque<T>>,
    /// Clients whose turn may come.
    ready: VecDeque<ClientId>,
    waiting: usize,
}

impl<T> Default for ClientQueues<T> {
    fn default() -> Self {
        Self {
            lines: BTreeMap::new(),
            ready: VecDeque::new(),
            waiting: 0,
        }
    }
}

impl<T> ClientQueues<T> {
    fn put(&mut self, client: ClientId, what: T) {
        let line = self.lines.entry(client).or_insert_with(|| {
            self.ready.push_back(client);
            VecDeque::new()
        });
        line.push_back(what);
        self.waiting += 1;
    }

    /// The next reply; its client is not served again before [`ClientQueues::served`].
    fn next(&mut self) -> Option<(ClientId, T)> {
        let client = self.ready.pop_front()?;
        let what = self.lines.get_mut(&client)?.pop_front()?;
        self.waiting -= 1;
        Some((client, what))
    }

    fn served(&mut self, client: ClientId) {
        if self.lines.get(&client).is_some_and(VecDeque::is_empty) {
            self.lines.remove(&client);
        } else {
            self.ready.push_back(client);
        }
    }

    fn waiting(&self) -> usize {
        self.waiting
    }

    fn waiting_for(&self, client: ClientId) -> usize {
        self.lines.get(&client).map_or(0, VecDeque::len)
    }

    fn ready(&self) -> usize {
        self.ready.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clients_take_turns_with_one_reply_at_a_time() {
        let mut client_queues = ClientQueues::default();
        let [deaf, stranger, other] = [Some([1; 16]), None, Some([2; 16])];
        for number in 0..3 {
            client_queues.put(deaf, number);
        }
        client_queues.put(stranger, 10);
        client_queues.put(other, 20);
        client_queues.put(other, 21);
        assert_eq!(client_queues.next(), Some((deaf, 0)));
        // While one client is served, the others get their replies in order.
        assert_eq!(client_queues.next(), Some((stranger, 10)));
        assert_eq!(client_queues.next(), Some((other, 20)));
        assert_eq!((client_queues.next(), client_queues.waiting()), (None, 3));
        client_queues.served(other);
        client_queues.served(stranger);
        assert_eq!(client_queues.next(), Some((other, 21)));
        client_queues.served(other);
        client_queues.put(deaf, 3);
        assert_eq!(
            (client_queues.next(), client_queues.waiting_for(deaf)),
            (None, 3)
        );
        client_queues.served(deaf);
        for number in 1..4 {
            assert_eq!(client_queues.next(), Some((deaf, number)));
            client_queues.served(deaf);
        }
        assert_eq!((client_queues.next(), client_queues.waiting()), (None, 0));
        assert!(client_queues.lines.is_empty(), "no client is stored");
    }
}
