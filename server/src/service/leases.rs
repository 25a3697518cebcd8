//! Asks for control: a thread of its own answers the query `lease`, for it asks
//! the transport about the one token that matters. Nothing is kept about the
//! tokens of others, so no number of them keeps a commander out.

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

use super::denied::Denied;
use super::inbox::{Asked, Granted, Life, STALE_SECS};
use super::shared::Shared;

/// Longest wait for the transport's word on a token; it knows it itself.
const WORD: Duration = Duration::from_secs(1);

/// A token that is back by then never vanished: a connection that broke is made anew
/// within milliseconds, and whoever sends no command for so long is braked anyway.
const COMES_BACK: Duration = Duration::from_millis((STALE_SECS * 1e3) as u64);

/// The thread's own: it ends when nobody can ask any more.
pub struct Leases {
    session: Session,
    keys: Keys,
    shared: Arc<Shared>,
    /// Hears when the token of whoever is in control vanishes.
    watch: Option<Subscriber<()>>,
}

impl Leases {
    /// Answers what comes through `queue` until its other end is gone.
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
                for asked in queue {
                    leases.answer(asked);
                }
            })
            .map(|_| ())
    }

    fn answer(&mut self, asked: Query) {
        let payload = asked.payload().map(|p| p.to_bytes().into_owned());
        let request = v1::LeaseRequest::decode(payload.unwrap_or_default().as_slice());
        let answer = request
            .map_err(|e| {
                let words = format!("the request cannot be read: {e}");
                Denied::new(FailureCode::Invalid, words)
            })
            .and_then(|request: v1::LeaseRequest| {
                let from = Keys::sender_of(asked.key_expr().as_str());
                if from == request.commander {
                    return self.reply(request);
                }
                self.shared.note_strange();
                let words = format!(
                    "the request names {:?} and came under the key of {from:?}; ask under \
                     `query/lease/NAME` with your own name",
                    wheelarm_proto::check::beginning(&request.commander)
                );
                Err(Denied::new(FailureCode::Foreign, words))
            });
        let (replies, stamp) = (&self.shared.replies, self.shared.stamp());
        match answer {
            Ok(reply) => replies.answer(asked, stamp, reply.encode_to_vec().into()),
            Err(why) => replies.refuse(asked, stamp, why),
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
        let inbox = || self.shared.inbox.lock();
        if request.release {
            if inbox().release(&life, &request.secret)? {
                self.watch = None;
                let words = format!("{:?} gave control back", life.name);
                let change = v1::ControlChange::Returned;
                self.shared.control(change, &life.name, words);
            }
            return Ok(self.held(""));
        }
        let held = inbox().lease().is_held_by(&life);
        if !held && !self.is_alive(&life) {
            return Ok(v1::LeaseReply {
                header: Some(self.shared.stamp()),
                ..Default::default()
            });
        }
        // Heard from here on; what happened before is asked for below.
        let watch = match held {
            true => None,
            false => Some(self.watch(&life)?),
        };
        let asked = Asked {
            take: request.take,
            sealed: request.sealed,
            secret: request.secret,
        };
        let granted = inbox().ask(life.clone(), &asked, Instant::now())?;
        let (change, words) = match granted {
            Granted::Already => return Ok(self.held(&asked.secret)),
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
            self.shared.gone(&life);
        }
        let secret = {
            let inbox = self.shared.inbox.lock();
            let holder = inbox.lease().holder().filter(|h| h.life == life);
            holder.map(|h| h.secret.clone()).unwrap_or_default()
        };
        Ok(self.held(&secret))
    }

    /// Who is in control; `secret` goes back to an asker that knows it.
    fn held(&self, secret: &str) -> v1::LeaseReply {
        let inbox = self.shared.inbox.lock();
        let knows = inbox.lease().knows(secret);
        v1::LeaseReply {
            header: Some(self.shared.stamp()),
            secret: if knows {
                secret.to_owned()
            } else {
                String::new()
            },
            ..held(inbox.lease())
        }
    }

    fn token(&self, life: &Life) -> String {
        self.keys.commander_alive(&life.name, &life.run_id)
    }

    fn is_alive(&self, life: &Life) -> bool {
        let token = self.token(life);
        let asked = self.session.liveliness().get(token).timeout(WORD).wait();
        asked.is_ok_and(|replies| replies.iter().any(|reply| reply.result().is_ok()))
    }

    /// Hears when the token vanishes; control ends where it does not come back.
    fn watch(&self, life: &Life) -> Result<Subscriber<()>, Denied> {
        let (shared, name) = (Arc::clone(&self.shared), life.name.clone());
        let life = life.clone();
        let came = Arc::new(AtomicU64::new(0));
        self.session
            .liveliness()
            .declare_subscriber(self.token(&life))
            .callback(move |sample| {
                if sample.kind() == SampleKind::Put {
                    came.fetch_add(1, Ordering::AcqRel);
                    return;
                }
                let before = came.load(Ordering::Acquire);
                let look = {
                    let (came, shared, life) = (came.clone(), shared.clone(), life.clone());
                    move || {
                        std::thread::sleep(COMES_BACK);
                        if came.load(Ordering::Acquire) == before {
                            shared.gone(&life);
                        }
                    }
                };
                let thread = std::thread::Builder::new().name("lease".to_owned());
                if thread.spawn(look).is_err() {
                    shared.gone(&life);
                }
            })
            .wait()
            .map_err(|e| Denied::internal(format!("the token of {name:?} cannot be watched: {e}")))
    }
}

/// Who is in control, without stamp.
pub fn held(lease: &super::inbox::Lease) -> v1::LeaseReply {
    let holder = lease.holder();
    v1::LeaseReply {
        holder: holder.map(|h| h.life.name.clone()).unwrap_or_default(),
        held_seconds: holder.map_or(0.0, |h| h.since.elapsed().as_secs_f64()),
        ..Default::default()
    }
}
