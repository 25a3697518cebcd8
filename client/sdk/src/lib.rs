//! The client SDK: one Zenoh session, typed queries and topics, control and commands,
//! decoded images and previews.
//!
//! [`Client::open`] connects, [`Client::request`] sends a query, [`Client::samples`] and
//! [`Client::streams`] subscribe to topics, [`Client::camera`] to images, and [`Client::turns`]
//! answers control ticks, in lock-step too.
//!
//! Samples and replies of every session except the server's are dropped ([`Server`]): the
//! server's liveliness token carries its session ID. The crate is independent of scenarios. A Zenoh
//! callback only moves a sample into one queue, in arrival order.

#![warn(missing_docs)]

mod camera;
mod commander;
mod control_requests;
mod episode;
mod error;
mod frame;
pub mod policy;
mod preview;
mod queries;
mod samples;
mod server;
mod streams;
mod turns;

use std::sync::Arc;
use std::time::{Duration, Instant};

use parking_lot::Mutex;
use wheelarm_proto::bundle::Identity;
use wheelarm_proto::endpoint::{self, check_endpoint};
use wheelarm_proto::keys::{self, Keys};
use wheelarm_proto::v1::FailureCode;
use wheelarm_proto::{Message, TopicId, v1};
use zenoh::bytes::ZBytes;
use zenoh::pubsub::Subscriber;
use zenoh::sample::Sample;
use zenoh::{Config, Session, Wait};

pub use camera::{Camera, SensorImages};
pub use commander::Commander;
pub use error::{ClientError, words as transport_words};
pub use frame::{Frame, FrameError};
pub use preview::Preview;
pub use samples::Samples;
pub use server::Server;
pub use server::session_of;
pub use streams::{Bound, Streams};
pub use turns::{Turn, Turns};

use error::{transport, words};

/// Default endpoint of a server.
pub const DEFAULT_ENDPOINT: &str = "tcp/127.0.0.1:7447";

/// Bounds of the wait for a connection, s; the longest is a day.
const LEAST_WAIT: f64 = 0.1;
const LONGEST_WAIT: f64 = 86_400.0;

/// Address and name of a server, and how to connect to it.
#[derive(Clone, Debug, PartialEq)]
pub struct Connect {
    /// Endpoint of the server, for example `tcp/127.0.0.1:7447`.
    pub endpoint: String,
    /// Name of the server; several servers can share one network.
    pub sim: String,
    /// Longest wait for the connection, s.
    pub timeout_secs: f64,
    /// Keys of the user, for an endpoint `tls/HOST:PORT` only. `None` reads the folder
    /// that the variable `WHEELARM_KEYS` names.
    pub identity: Option<Identity>,
}

impl Connect {
    /// Settings for the server `sim` at an endpoint; otherwise the default.
    #[must_use]
    pub fn to(endpoint: &str, sim: &str) -> Self {
        Self {
            endpoint: endpoint.to_owned(),
            sim: sim.to_owned(),
            ..Self::default()
        }
    }

    /// Whether the endpoint requires keys.
    #[must_use]
    pub fn is_guarded(&self) -> bool {
        endpoint::is_guarded(&self.endpoint)
    }

    /// The wait for the connection within its bounds, s.
    fn wait_secs(&self) -> f64 {
        match self.timeout_secs.is_nan() {
            true => LEAST_WAIT,
            false => self.timeout_secs.clamp(LEAST_WAIT, LONGEST_WAIT),
        }
    }
}

impl Default for Connect {
    fn default() -> Self {
        Self {
            endpoint: DEFAULT_ENDPOINT.to_owned(),
            sim: keys::DEFAULT_SIM.to_owned(),
            timeout_secs: 5.0,
            identity: None,
        }
    }
}

/// How a server treats a client that sends nothing while its connection stays open.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Silence {
    /// The server drops the connection after ten seconds.
    Gone,
    /// The client may stall for up to an hour (a stopped process, a suspended machine).
    /// The server keeps reliable samples for it until then.
    Still,
}

/// Opens a Zenoh session to an endpoint without looking for a server.
///
/// # Errors
/// [`ClientError::Endpoint`] for an invalid endpoint, [`ClientError::NoServer`] when
/// the endpoint does not accept connections, [`ClientError::NoKeys`] when it requires
/// keys and none are given.
pub fn open_session(args: &Connect, silence: Silence) -> Result<Session, ClientError> {
    check_endpoint(&args.endpoint)?;
    let identity = match (args.is_guarded(), &args.identity) {
        (false, _) => None,
        (true, Some(identity)) => Some(identity.clone()),
        (true, None) => Some(
            Identity::from_environment()?
                .ok_or_else(|| ClientError::NoKeys(args.endpoint.clone()))?,
        ),
    };
    zenoh::open(config(args, identity.as_ref(), silence))
        .wait()
        .map_err(|cause| ClientError::NoServer {
            endpoint: args.endpoint.clone(),
            seconds: args.wait_secs(),
            cause: words(&cause),
        })
}

/// An open connection to one server.
#[derive(Clone)]
pub struct Client {
    session: Session,
    keys: Keys,
    endpoint: String,
    server: Server,
    _tokens: Arc<Subscriber<()>>,
    /// Secret of the lease that a commander of this client holds; empty without a lease.
    secret: Arc<Mutex<String>>,
}

impl Client {
    /// Connects and waits until the named server is alive.
    ///
    /// # Errors
    /// [`ClientError::Endpoint`] for an invalid endpoint,
    /// [`ClientError::NoServer`] when nothing listens there before the timeout,
    /// [`ClientError::OtherName`] when the server has another name,
    /// [`ClientError::NoRights`] when the user of these keys cannot see the server,
    /// [`ClientError::Several`] when several sessions claim the name,
    /// [`ClientError::Version`] when the server uses another contract version.
    pub fn open(args: &Connect) -> Result<Self, ClientError> {
        Self::open_as(args, Silence::Gone)
    }

    /// As [`Client::open`], with a policy for a silent client.
    ///
    /// # Errors
    /// As [`Client::open`].
    pub fn open_as(args: &Connect, silence: Silence) -> Result<Self, ClientError> {
        // Reject an invalid name before connecting.
        Keys::new(&args.sim)?;
        let deadline = Instant::now() + Duration::from_secs_f64(args.wait_secs());
        let session = open_session(args, silence)?;
        let client = Self::over(session, &args.endpoint, &args.sim)?;
        client.wait_alive(deadline).map_err(|error| match error {
            ClientError::OtherName { found, .. } if args.is_guarded() && found == NONE => {
                ClientError::NoRights {
                    endpoint: args.endpoint.clone(),
                    sim: args.sim.clone(),
                }
            }
            other => other,
        })?;
        client.check_version()?;
        Ok(client)
    }

    /// A client of the server `sim` in this process, over the server's own session:
    /// samples are shared, not copied.
    ///
    /// # Errors
    /// As [`Client::open`].
    pub fn within(session: Session, sim: &str) -> Result<Self, ClientError> {
        let client = Self::over(session, "this process", sim)?;
        client.wait_alive(Instant::now() + MEETING)?;
        Ok(client)
    }

    /// Whether the server is in this process, over the same session.
    #[must_use]
    pub fn is_within(&self) -> bool {
        self.server.is(self.session.zid())
    }

    /// A client of the server `sim` over an open session, without a check that the
    /// server is alive.
    ///
    /// # Errors
    /// [`ClientError::Name`], [`ClientError::Transport`].
    pub fn over(session: Session, endpoint: &str, sim: &str) -> Result<Self, ClientError> {
        let keys = Keys::new(sim)?;
        let (server, tokens) = Server::watch(&session, &keys)?;
        Ok(Self {
            session,
            keys,
            endpoint: endpoint.to_owned(),
            server,
            _tokens: Arc::new(tokens),
            secret: Arc::default(),
        })
    }

    /// Checks that client and server use the same contract version. A server that does
    /// not reply now is checked at its first reply.
    fn check_version(&self) -> Result<(), ClientError> {
        match self.request_within(&v1::StatusRequest {}, MEETING) {
            Err(
                other @ (ClientError::Version(_)
                | ClientError::Refused {
                    code: FailureCode::Version,
                    ..
                }),
            ) => Err(other),
            _ => Ok(()),
        }
    }

    /// Waits for the liveliness token of the named server.
    fn wait_alive(&self, deadline: Instant) -> Result<(), ClientError> {
        loop {
            self.server.look(&self.session);
            if self.server.is_there() {
                return Ok(());
            }
            if Instant::now() >= deadline {
                let tokens = self.server.tokens();
                if tokens.len() > 1 {
                    return Err(ClientError::Several {
                        endpoint: self.endpoint.clone(),
                        sim: self.keys.sim().to_owned(),
                        count: tokens.len(),
                        ids: tokens.join(", "),
                    });
                }
                let found = self.alive_sims()?;
                return Err(ClientError::OtherName {
                    endpoint: self.endpoint.clone(),
                    sim: self.keys.sim().to_owned(),
                    found: if found.is_empty() {
                        NONE.to_owned()
                    } else {
                        found.join(", ")
                    },
                });
            }
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// Names of the servers that are alive on this network.
    fn alive_sims(&self) -> Result<Vec<String>, ClientError> {
        let replies = self
            .session
            .liveliness()
            .get(Keys::all_alive())
            .timeout(Duration::from_secs(1))
            .wait()
            .map_err(transport("listing the servers"))?;
        let mut sims: Vec<String> = replies
            .into_iter()
            .filter_map(|reply| {
                let sample = reply.into_result().ok()?;
                Some(Keys::server_of(sample.key_expr().as_str())?.0)
            })
            .collect();
        sims.sort();
        sims.dedup();
        Ok(sims)
    }

    /// The Zenoh session, for keys that this crate does not cover.
    #[must_use]
    pub fn session(&self) -> &Session {
        &self.session
    }

    /// The identity of the server.
    #[must_use]
    pub fn server(&self) -> &Server {
        &self.server
    }

    /// Identifies the server again, for example after a restart. Returns whether its
    /// session ID changed.
    #[must_use]
    pub fn look_for_server(&self) -> bool {
        self.server.look(&self.session)
    }

    /// The server's keys.
    #[must_use]
    pub fn keys(&self) -> &Keys {
        &self.keys
    }

    /// Secret of the lease that a commander of this client holds; empty without a lease.
    /// Requests to reset, stop and shut down the server carry it.
    #[must_use]
    pub fn secret(&self) -> String {
        let secret = self.secret.lock();
        secret.clone()
    }

    fn keep_secret(&self, new: &str) {
        let mut secret = self.secret.lock();
        new.clone_into(&mut secret);
    }

    /// Whether a liveliness token is declared on this network.
    ///
    /// # Errors
    /// [`ClientError::Transport`].
    pub fn is_declared(&self, token: &str) -> Result<bool, ClientError> {
        let replies = self
            .session
            .liveliness()
            .get(token)
            .timeout(Duration::from_secs(1))
            .wait()
            .map_err(transport("looking up a liveliness token"))?;
        Ok(replies.into_iter().any(|reply| reply.result().is_ok()))
    }

    /// Calls `taken` with each sample that the server publishes under `key`; samples of
    /// other sessions are dropped.
    ///
    /// # Errors
    /// [`ClientError::Transport`].
    pub fn subscribe(
        &self,
        key: &str,
        taken: impl Fn(Sample) + Send + Sync + 'static,
    ) -> Result<Subscriber<()>, ClientError> {
        let server = self.server.clone();
        self.session
            .declare_subscriber(key)
            .callback(move |sample| {
                if server.sent(&sample) {
                    taken(sample);
                }
            })
            .wait()
            .map_err(transport("subscribing"))
    }

    /// Subscribes to topics, whose samples arrive in one queue without a bound.
    ///
    /// # Errors
    /// [`ClientError::Transport`].
    pub fn streams(&self, topics: &[TopicId]) -> Result<Streams, ClientError> {
        self.streams_within(topics, None)
    }

    /// As [`Client::streams`] with a queue of at most `bound`: the oldest samples are
    /// dropped and counted.
    ///
    /// # Errors
    /// As [`Client::streams`].
    pub fn newest_streams(&self, topics: &[TopicId], bound: Bound) -> Result<Streams, ClientError> {
        self.streams_within(topics, Some(bound))
    }

    fn streams_within(
        &self,
        topics: &[TopicId],
        bound: Option<Bound>,
    ) -> Result<Streams, ClientError> {
        let queue = Arc::default();
        let mut subscribers = Vec::new();
        for topic in topics {
            let (topic, sender) = (*topic, streams::Sender::new(&queue, bound));
            let subscriber = self.subscribe(&self.keys.topic(topic), move |sample| {
                sender.send(topic, sample.payload().clone());
            })?;
            subscribers.push(subscriber);
        }
        Ok(Streams {
            queue,
            _subscribers: subscribers,
        })
    }

    /// Closes the connection.
    ///
    /// # Errors
    /// [`ClientError::Transport`].
    pub fn close(self) -> Result<(), ClientError> {
        self.session
            .close()
            .wait()
            .map_err(transport("closing the connection"))
    }
}

/// List of the servers found, when there are none.
const NONE: &str = "none";

/// Longest wait for the first reply, which carries the contract version.
const MEETING: Duration = Duration::from_secs(2);

fn decode<M: Message + Default>(payload: &ZBytes, what: &str) -> Result<M, ClientError> {
    M::decode(payload.to_bytes().as_ref()).map_err(|cause| ClientError::Garbled {
        what: format!("`{what}`"),
        cause,
    })
}

/// Client mode without scouting: a client connects to the configured endpoint alone.
fn config(args: &Connect, identity: Option<&Identity>, silence: Silence) -> Config {
    let timeout_ms = (args.wait_secs() * 1e3).round();
    // Keep-alive messages every 2.5 s in both cases.
    let (lease_ms, signs) = match silence {
        Silence::Gone => (10_000, 4),
        Silence::Still => (3_600_000, 1440),
    };
    let settings = [
        ("mode", "\"client\"".to_owned()),
        ("transport/link/tx/lease", format!("{lease_ms}")),
        ("transport/link/tx/keep_alive", format!("{signs}")),
        (
            "connect/endpoints",
            serde_json::json!([args.endpoint]).to_string(),
        ),
        ("connect/timeout_ms", timeout_ms.to_string()),
        ("connect/exit_on_failure", "true".to_owned()),
        (
            "connect/retry",
            serde_json::json!({
                "period_init_ms": 100,
                "period_max_ms": 500,
                "period_increase_factor": 2,
            })
            .to_string(),
        ),
        ("scouting/multicast/enabled", "false".to_owned()),
        ("scouting/gossip/enabled", "false".to_owned()),
        // A camera-sized message may wait 50 ms for room before it is dropped.
        (
            "transport/link/tx/queue/congestion_control/drop/wait_before_drop",
            "50000".to_owned(),
        ),
    ];
    let shown = identity.map(|identity| ("transport/link/tls", tls(identity)));
    let mut config = Config::default();
    for (key, value) in settings.into_iter().chain(shown) {
        if let Err(error) = config.insert_json5(key, &value) {
            // Only an invalid endpoint fails here; `zenoh::open` then reports it.
            tracing::warn!("cannot set {key} = {value}: {error}");
        }
    }
    config
}

/// Both sides present certificates of one authority. The server's certificate must
/// name the host of the endpoint.
fn tls(identity: &Identity) -> String {
    serde_json::json!({
        "root_ca_certificate": identity.authority,
        "connect_certificate": identity.certificate,
        "connect_private_key": identity.key,
        "enable_mtls": true,
        "verify_name_on_connect": true,
    })
    .to_string()
}

#[cfg(test)]
mod tests;
