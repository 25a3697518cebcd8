//! Answers the query `lease` on its own thread, because it queries the transport about
//! a liveliness token. No state is kept about other tokens, so their number cannot
//! block a commander.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

use wheelarm_proto::keys::{self, Keys};
use wheelarm_proto::v1::FailureCode;
use wheelarm_proto::{Message, v1};
use zenoh::pubsub::Subscriber;
use zenoh::query::Query;
use zenoh::sample::SampleKind;
use zenoh::{Session, Wait};

use super::command_gate::{ControlRequest, Granted, Life};
use super::denied::Denied;
use super::shared::Shared;
use wheelarm_proto::limits::STALE_COMMAND_SECONDS;

/// Longest wait for the transport's reply about a token, which it stores locally.
const WORD: Duration = Duration::from_secs(1);

/// A token that is back by then was never lost: a broken connection is restored within
/// milliseconds, and the gate brakes a commander that is silent for this long.
const COMES_BACK: Duration = Duration::from_millis((STALE_COMMAND_SECONDS * 1e3) as u64);

/// State of the thread; it ends when the sender is dropped.
pub struct Leases {
    session: Session,
    keys: Keys,
    shared: Arc<Shared>,
    /// Watches the token of the holder.
    watch: Option<Subscriber<()>>,
}

impl Leases {
    /// Answers queries from `queue` until its sender is dropped.
    ///
    /// # Errors
    /// When the thread cannot be started.
    pub fn start(
        session: Session,
        keys: Keys,
        shared: Arc<Shared>,
        queue: Receiver<Query>,
    ) -> std::io::Result<()> {
        let mut leases = Self {
            session,
            keys,
            shared,
            watch: None,
        };
        let thread = std::thread::Builder::new().name("leases".to_owned());
        thread
            .spawn(move || {
                for query in queue {
                    leases.answer(query);
                }
            })
            .map(|_| ())
    }

    fn answer(&mut self, query: Query) {
        let payload = query.payload().map(|p| p.to_bytes().into_owned());
        let request = v1::LeaseRequest::decode(payload.unwrap_or_default().as_slice());
        let answer = request
            .map_err(|e| {
                let words = format!("cannot decode the request: {e}");
                Denied::new(FailureCode::Invalid, words)
            })
            .and_then(|request: v1::LeaseRequest| {
                let from = Keys::sender_of(query.key_expr().as_str());
                if from == request.commander {
                    return self.reply(request);
                }
                self.shared.note_strange();
                let words = format!(
                    "the request names {:?} but arrived under the key of {from:?}; query under \
                     `query/lease/NAME` with your own name",
                    wheelarm_proto::check::beginning(&request.commander)
                );
                Err(Denied::new(FailureCode::Foreign, words))
            });
        let (replies, stamp) = (&self.shared.replies, self.shared.stamp());
        match answer {
            Ok(reply) => replies.answer(query, stamp, reply.encode_to_vec().into()),
            Err(why) => replies.refuse(query, stamp, why),
        }
    }

    fn reply(&mut self, request: v1::LeaseRequest) -> Result<v1::LeaseReply, Denied> {
        let name = request.commander;
        let run_id = request.header.unwrap_or_default().run_id;
        for word in [&name, &run_id] {
            keys::check_name(word).map_err(|_| {
                let words = format!(
                    "commander and run id must be 1 to 64 letters, digits, `-` or `_`, not {:?}",
                    wheelarm_proto::check::beginning(word)
                );
                Denied::new(FailureCode::Invalid, words)
            })?;
        }
        let life = Life { name, run_id };
        let command_gate = || self.shared.command_gate.lock();
        if request.release {
            if command_gate().release(&life, &request.secret)? {
                self.watch = None;
                let words = format!("{:?} released control", life.name);
                let change = v1::ControlChange::Returned;
                self.shared.control(change, &life.name, words);
            }
            return Ok(self.holder_reply(""));
        }
        let held = command_gate().lease().is_held_by(&life);
        if !held && !self.is_alive(&life) {
            return Ok(v1::LeaseReply {
                header: Some(self.shared.stamp()),
                ..Default::default()
            });
        }
        // Watch from here on; an earlier loss is found by the query below.
        let watch = match held {
            true => None,
            false => Some(self.watch(&life)?),
        };
        let query = ControlRequest {
            take: request.take,
            sealed: request.sealed,
            secret: request.secret,
        };
        let granted = command_gate().request_control(life.clone(), &query, Instant::now())?;
        let (change, words) = match granted {
            Granted::Already => return Ok(self.holder_reply(&query.secret)),
            Granted::Free => (
                v1::ControlChange::Given,
                format!("{:?} is in control", life.name),
            ),
            Granted::From(former) => (
                v1::ControlChange::Taken,
                format!("{:?} took control from {former:?}", life.name),
            ),
        };
        self.shared.control(change, &life.name, words);
        self.watch = watch;
        if !self.is_alive(&life) {
            self.shared.commander_lost(&life);
        }
        let secret = {
            let command_gate = self.shared.command_gate.lock();
            let holder = command_gate.lease().holder().filter(|h| h.life == life);
            holder.map(|h| h.secret.clone()).unwrap_or_default()
        };
        Ok(self.holder_reply(&secret))
    }

    /// The holder of control; `secret` is returned to a client that knows it.
    fn holder_reply(&self, secret: &str) -> v1::LeaseReply {
        let command_gate = self.shared.command_gate.lock();
        let knows = command_gate.lease().knows(secret);
        v1::LeaseReply {
            header: Some(self.shared.stamp()),
            secret: if knows {
                secret.to_owned()
            } else {
                String::new()
            },
            ..lease_reply(command_gate.lease())
        }
    }

    fn token(&self, life: &Life) -> String {
        self.keys.commander_alive(&life.name, &life.run_id)
    }

    fn is_alive(&self, life: &Life) -> bool {
        let token = self.token(life);
        let query = self.session.liveliness().get(token).timeout(WORD).wait();
        query.is_ok_and(|replies| replies.iter().any(|reply| reply.result().is_ok()))
    }

    /// Watches the token; control ends when the token does not return.
    fn watch(&self, life: &Life) -> Result<Subscriber<()>, Denied> {
        let (shared, name) = (Arc::clone(&self.shared), life.name.clone());
        let life = life.clone();
        let appearances = Arc::new(AtomicU64::new(0));
        self.session
            .liveliness()
            .declare_subscriber(self.token(&life))
            .callback(move |sample| {
                if sample.kind() == SampleKind::Put {
                    appearances.fetch_add(1, Ordering::AcqRel);
                    return;
                }
                let before = appearances.load(Ordering::Acquire);
                let appearance = {
                    let (appearances, shared, life) =
                        (appearances.clone(), shared.clone(), life.clone());
                    move || {
                        std::thread::sleep(COMES_BACK);
                        if appearances.load(Ordering::Acquire) == before {
                            shared.commander_lost(&life);
                        }
                    }
                };
                let thread = std::thread::Builder::new().name("lease".to_owned());
                if thread.spawn(appearance).is_err() {
                    shared.commander_lost(&life);
                }
            })
            .wait()
            .map_err(|e| Denied::internal(format!("cannot watch the token of {name:?}: {e}")))
    }
}

/// The lease as a message, without header.
pub fn lease_reply(lease: &super::command_gate::Lease) -> v1::LeaseReply {
    let holder = lease.holder();
    v1::LeaseReply {
        holder: holder.map(|h| h.life.name.clone()).unwrap_or_default(),
        held_seconds: holder.map_or(0.0, |h| h.since.elapsed().as_secs_f64()),
        ..Default::default()
    }
}
