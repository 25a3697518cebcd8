//! The connection to a server: one zenoh session, typed queries, control and
//! commands, streams and previews.
//!
//! Only what the server's own session says is taken ([`Server`]).
//! Nothing here knows what is simulated. No zenoh callback works: samples go
//! undecoded into one queue, in the order in which they arrived.

mod commander;
mod preview;
mod server;
mod streams;

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use clap::Args;
use wheelarm_proto::keys::{self, BadName, Keys, Query};
use wheelarm_proto::{Message, v1};
use zenoh::bytes::ZBytes;
use zenoh::pubsub::Subscriber;
use zenoh::qos::Priority;
use zenoh::query::{ConsolidationMode, QueryTarget};
use zenoh::sample::Sample;
use zenoh::{Config, Session, Wait};

pub use commander::Commander;
pub use preview::Preview;
pub use server::Server;
pub(crate) use server::session_of;
pub use streams::{Received, Stream, Streams};

/// Where a server listens when nothing else is said.
pub const DEFAULT_ENDPOINT: &str = "tcp/127.0.0.1:7447";

/// Which server to speak to.
#[derive(Args, Clone, Debug)]
pub struct ConnectArgs {
    /// Endpoint of the server, for example `tcp/127.0.0.1:7447`.
    #[arg(long, global = true, env = "WHEELARM_CONNECT", default_value = DEFAULT_ENDPOINT)]
    pub connect: String,
    /// Name of the server; many can share one network. `record` takes `*` for all.
    #[arg(long, global = true, env = "WHEELARM_SIM", default_value = keys::DEFAULT_SIM)]
    pub sim: String,
    /// Longest wait for the connection, seconds.
    #[arg(long, global = true, default_value_t = 5.0, value_name = "SECONDS")]
    pub connect_timeout: f64,
}

/// What can go wrong between a client and a server.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// The server's name cannot stand in a key.
    #[error(transparent)]
    Name(#[from] BadName),
    /// Nobody listens.
    #[error(
        "no server answers at {endpoint} (waited {seconds:.1} s): start one with `wheelarm-server`, or name its address with --connect ({cause})"
    )]
    NoServer {
        /// Where it was looked for.
        endpoint: String,
        /// How long.
        seconds: f64,
        /// The transport's own words.
        cause: String,
    },
    /// Somebody listens, but under another name.
    #[error(
        "a server answers at {endpoint}, but none is named {sim:?} (found: {found}): choose one with --sim"
    )]
    OtherName {
        /// Where it was looked for.
        endpoint: String,
        /// The wanted name.
        sim: String,
        /// Names that are there.
        found: String,
    },
    /// More than one session says that it is the server.
    #[error(
        "{count} sessions behind {endpoint} say that they are the server {sim:?} ({ids}): one of them is a stranger or a second server of the same name; connect to the server itself, or end the other"
    )]
    Several {
        /// Where it was looked for.
        endpoint: String,
        /// The wanted name.
        sim: String,
        /// How many there are.
        count: usize,
        /// Ids of the sessions.
        ids: String,
    },
    /// The server did not answer a query in time.
    #[error("the server {sim:?} did not answer `{query}` within {seconds:.0} s")]
    Silent {
        /// Server name.
        sim: String,
        /// Query name.
        query: &'static str,
        /// How long.
        seconds: f64,
    },
    /// Nobody is there any more who could answer.
    #[error(
        "the server {sim:?} has gone: nobody answers `{query}` any more (told after {seconds:.1} s); its own last words say why"
    )]
    Gone {
        /// Server name.
        sim: String,
        /// Query name.
        query: &'static str,
        /// After how long that was known.
        seconds: f64,
    },
    /// The server answered that it will not.
    #[error("the server refused `{query}`: {message}")]
    Refused {
        /// Query name.
        query: &'static str,
        /// The server's words.
        message: String,
    },
    /// A message could not be read.
    #[error("{what} cannot be read ({cause}): client and server differ in version?")]
    Garbled {
        /// Which message.
        what: String,
        /// The decoder's words.
        cause: wheelarm_proto::DecodeError,
    },
    /// The transport failed.
    #[error("{operation} failed: {cause}")]
    Transport {
        /// What was tried.
        operation: &'static str,
        /// The transport's words.
        cause: String,
    },
}

fn transport(operation: &'static str) -> impl Fn(zenoh::Error) -> LinkError {
    move |cause| LinkError::Transport {
        operation,
        cause: words(&cause),
    }
}

/// The transport's words without the place in its source.
fn words(error: &zenoh::Error) -> String {
    let text = error.to_string();
    text.split(" at /").next().unwrap_or(&text).to_owned()
}

/// What a server is to think of a client that falls silent, its connection
/// standing all the while.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Silence {
    /// After ten seconds it has gone.
    Gone,
    /// It stands still (a process that was stopped, a machine that sleeps) and
    /// will go on within the hour. What must not be lost waits for it.
    Still,
}

/// Connects to an endpoint, behind which there may be any servers.
///
/// # Errors
/// [`LinkError::NoServer`] when nobody listens.
pub fn open_session(args: &ConnectArgs, silence: Silence) -> Result<Session, LinkError> {
    zenoh::open(config(&args.connect, args.connect_timeout, silence))
        .wait()
        .map_err(|cause| LinkError::NoServer {
            endpoint: args.connect.clone(),
            seconds: args.connect_timeout,
            cause: words(&cause),
        })
}

/// An open connection to one server.
#[derive(Clone)]
pub struct Link {
    session: Session,
    keys: Keys,
    endpoint: String,
    server: Server,
    _tokens: Arc<Subscriber<()>>,
    /// Secret of the lease that a commander of this link holds; empty without.
    secret: Arc<Mutex<String>>,
}

impl Link {
    /// Connects and makes sure that the named server is alive.
    ///
    /// # Errors
    /// [`LinkError::NoServer`] when nobody listens until the wait is over,
    /// [`LinkError::OtherName`] when the server has another name,
    /// [`LinkError::Several`] when it cannot be told from a stranger.
    pub fn open(args: &ConnectArgs) -> Result<Self, LinkError> {
        Self::open_as(args, Silence::Gone)
    }

    /// As [`Link::open`], saying what silence means.
    ///
    /// # Errors
    /// As [`Link::open`].
    pub fn open_as(args: &ConnectArgs, silence: Silence) -> Result<Self, LinkError> {
        // A bad name is told before anything else.
        Keys::new(&args.sim)?;
        let deadline = Instant::now() + Duration::from_secs_f64(args.connect_timeout.max(0.1));
        let session = open_session(args, silence)?;
        let link = Self::over(session, &args.connect, &args.sim)?;
        link.wait_alive(deadline)?;
        Ok(link)
    }

    /// A link to the server `sim` over a session that stands; whether it is
    /// alive is not asked.
    ///
    /// # Errors
    /// [`LinkError::Name`], [`LinkError::Transport`].
    pub fn over(session: Session, endpoint: &str, sim: &str) -> Result<Self, LinkError> {
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

    /// Waits until the liveliness token of the named server is seen.
    fn wait_alive(&self, deadline: Instant) -> Result<(), LinkError> {
        loop {
            self.server.look(&self.session);
            if self.server.is_there() {
                return Ok(());
            }
            if Instant::now() >= deadline {
                let tokens = self.server.tokens();
                if tokens.len() > 1 {
                    return Err(LinkError::Several {
                        endpoint: self.endpoint.clone(),
                        sim: self.keys.sim().to_owned(),
                        count: tokens.len(),
                        ids: tokens.join(", "),
                    });
                }
                let found = self.alive_sims()?;
                return Err(LinkError::OtherName {
                    endpoint: self.endpoint.clone(),
                    sim: self.keys.sim().to_owned(),
                    found: if found.is_empty() {
                        "none".to_owned()
                    } else {
                        found.join(", ")
                    },
                });
            }
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// Names of the servers that are alive on this network.
    fn alive_sims(&self) -> Result<Vec<String>, LinkError> {
        let replies = self
            .session
            .liveliness()
            .get(Keys::all_alive())
            .timeout(Duration::from_secs(1))
            .wait()
            .map_err(transport("asking for the servers"))?;
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

    /// The session, for clients with keys of their own.
    #[must_use]
    pub fn session(&self) -> &Session {
        &self.session
    }

    /// Who speaks for the server.
    #[must_use]
    pub fn server(&self) -> &Server {
        &self.server
    }

    /// Looks again who the server is, after it may have been restarted; whether
    /// that changed.
    #[must_use]
    pub fn look_for_server(&self) -> bool {
        self.server.look(&self.session)
    }

    /// The server's keys.
    #[must_use]
    pub fn keys(&self) -> &Keys {
        &self.keys
    }

    /// Secret of the lease that a commander of this link holds, empty without:
    /// who is in control may reset, discard and end the server.
    #[must_use]
    pub fn secret(&self) -> String {
        let secret = self.secret.lock().unwrap_or_else(PoisonError::into_inner);
        secret.clone()
    }

    fn keep_secret(&self, new: &str) {
        let mut secret = self.secret.lock().unwrap_or_else(PoisonError::into_inner);
        new.clone_into(&mut secret);
    }

    /// Asks a query without payload.
    ///
    /// # Errors
    /// As [`Link::query`].
    pub fn ask<R: Message + Default>(&self, query: Query) -> Result<R, LinkError> {
        self.query_bytes(query, Vec::new(), patience(query))
    }

    /// As [`Link::ask`] with a wait of its own.
    ///
    /// # Errors
    /// As [`Link::query`].
    pub fn ask_within<R: Message + Default>(
        &self,
        query: Query,
        patience: Duration,
    ) -> Result<R, LinkError> {
        self.query_bytes(query, Vec::new(), patience)
    }

    /// Whether somebody on this network holds a liveliness token.
    ///
    /// # Errors
    /// [`LinkError::Transport`].
    pub fn is_declared(&self, token: &str) -> Result<bool, LinkError> {
        let replies = self
            .session
            .liveliness()
            .get(token)
            .timeout(Duration::from_secs(1))
            .wait()
            .map_err(transport("asking for a token"))?;
        Ok(replies.into_iter().any(|reply| reply.result().is_ok()))
    }

    /// Asks a query and waits for the typed reply.
    ///
    /// # Errors
    /// [`LinkError::Refused`] with the server's words, [`LinkError::Silent`]
    /// when it does not answer.
    pub fn query<R: Message + Default>(
        &self,
        query: Query,
        request: &impl Message,
    ) -> Result<R, LinkError> {
        self.query_within(query, request, patience(query))
    }

    /// As [`Link::query`] with a wait of its own.
    ///
    /// # Errors
    /// As [`Link::query`].
    pub fn query_within<R: Message + Default>(
        &self,
        query: Query,
        request: &impl Message,
        patience: Duration,
    ) -> Result<R, LinkError> {
        self.query_bytes(query, request.encode_to_vec(), patience)
    }

    fn query_bytes<R: Message + Default>(
        &self,
        query: Query,
        request: Vec<u8>,
        patience: Duration,
    ) -> Result<R, LinkError> {
        self.server.look(&self.session);
        let asked = Instant::now();
        let replies = self
            .session
            .get(self.keys.query(query))
            .payload(request)
            // Strangers can answer as well: all are asked, and the server's
            // answer is taken, neither held back nor displaced by another.
            .target(QueryTarget::All)
            .consolidation(ConsolidationMode::None)
            .priority(Priority::InteractiveHigh)
            .express(true)
            .timeout(patience)
            .wait()
            .map_err(transport("sending a query"))?;
        // The transport tells at once when nobody is there to answer.
        let silent = || match asked.elapsed() {
            waited if waited < patience.mul_f64(0.9) => LinkError::Gone {
                sim: self.keys.sim().to_owned(),
                query: query.name(),
                seconds: waited.as_secs_f64(),
            },
            _ => LinkError::Silent {
                sim: self.keys.sim().to_owned(),
                query: query.name(),
                seconds: patience.as_secs_f64(),
            },
        };
        let reply = loop {
            let reply = replies.recv().map_err(|_| silent())?;
            if self.server.answered(&reply) {
                break reply;
            }
        };
        match reply.result() {
            Ok(sample) => decode(sample.payload(), query.name()),
            Err(error) => match decode::<v1::Failure>(error.payload(), query.name()) {
                Ok(failure) if !failure.message.is_empty() => Err(LinkError::Refused {
                    query: query.name(),
                    message: failure.message,
                }),
                // The transport itself reports a timeout as an error reply.
                _ => Err(silent()),
            },
        }
    }

    /// Tells `taken` what the server publishes under `key`, and nothing of
    /// anybody else.
    ///
    /// # Errors
    /// [`LinkError::Transport`].
    pub fn subscribe(
        &self,
        key: &str,
        taken: impl Fn(Sample) + Send + Sync + 'static,
    ) -> Result<Subscriber<()>, LinkError> {
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

    /// Subscribes to streams; their samples come out of one queue.
    ///
    /// # Errors
    /// [`LinkError::Transport`].
    pub fn streams(&self, streams: &[Stream]) -> Result<Streams, LinkError> {
        let (sender, receiver) = crossbeam_channel::unbounded();
        let mut subscribers = Vec::new();
        for stream in streams {
            let (stream, sender) = (*stream, sender.clone());
            let subscriber = self.subscribe(&stream.key(&self.keys), move |sample| {
                // A closed queue means that nobody reads any more.
                let _ = sender.send((stream, sample.payload().clone()));
            })?;
            subscribers.push(subscriber);
        }
        Ok(Streams {
            receiver,
            _subscribers: subscribers,
        })
    }

    /// Closes the connection.
    ///
    /// # Errors
    /// [`LinkError::Transport`].
    pub fn close(self) -> Result<(), LinkError> {
        self.session
            .close()
            .wait()
            .map_err(transport("closing the connection"))
    }
}

/// Longest wait for an answer: a reset loads a scene and may build pipelines,
/// an episode waits for its recorders.
fn patience(query: Query) -> Duration {
    Duration::from_secs(match query {
        Query::Reset | Query::EpisodeStart | Query::EpisodeStop => 120,
        _ => 20,
    })
}

fn decode<M: Message + Default>(payload: &ZBytes, what: &str) -> Result<M, LinkError> {
    M::decode(payload.to_bytes().as_ref()).map_err(|cause| LinkError::Garbled {
        what: format!("`{what}`"),
        cause,
    })
}

/// Client mode, no scouting: a client speaks to the one server it was told.
fn config(endpoint: &str, timeout_secs: f64, silence: Silence) -> Config {
    let timeout_ms = (timeout_secs.max(0.1) * 1e3).round();
    // Signs of life come every two and a half seconds either way.
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
            serde_json::json!([endpoint]).to_string(),
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
    let mut config = Config::default();
    for (key, value) in settings {
        if let Err(error) = config.insert_json5(key, &value) {
            // Only a wrong endpoint can get here; opening then names it.
            tracing::warn!("setting {key} = {value} was not taken: {error}");
        }
    }
    config
}

#[cfg(test)]
mod tests;
