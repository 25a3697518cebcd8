//! A policy on a Zenoh network: its three queries.

use std::time::{Duration, Instant};

use wheelarm_proto::keys::PolicyKeys;
use wheelarm_proto::{Message, schema, v1};
use zenoh::qos::Priority;
use zenoh::query::{ConsolidationMode, QueryTarget};
use zenoh::{Config, Session, Wait};

use super::interface::PolicyError;

/// Longest wait for a reply, wall time.
pub const PATIENCE: Duration = Duration::from_secs(30);
/// Share of a wait after which an end without a reply counts as a timeout.
const WAITED: f64 = 0.9;
/// Interval between checks for the token.
const LOOK: Duration = Duration::from_millis(20);

/// A session to which a policy connects, at a socket in `folder`, and the
/// endpoint that the policy receives.
///
/// # Errors
/// [`PolicyError::Start`] when it cannot listen there.
pub fn listen(folder: &std::path::Path) -> Result<(Session, String), PolicyError> {
    let endpoint = format!("unixsock-stream/{}/policy", folder.display());
    Ok((listen_at(&endpoint)?, endpoint))
}

/// A session that listens at an endpoint.
///
/// # Errors
/// [`PolicyError::Start`] when the endpoint cannot be used.
pub fn listen_at(endpoint: &str) -> Result<Session, PolicyError> {
    let settings = [
        ("mode", "\"peer\"".to_owned()),
        (
            "listen/endpoints",
            serde_json::json!([endpoint]).to_string(),
        ),
        ("scouting/multicast/enabled", "false".to_owned()),
        ("scouting/gossip/enabled", "false".to_owned()),
    ];
    let mut config = Config::default();
    let put = |problem: &dyn std::fmt::Display| PolicyError::Start(problem.to_string());
    for (key, value) in settings {
        config.insert_json5(key, &value).map_err(|e| put(&e))?;
    }
    zenoh::open(config).wait().map_err(|e| put(&e))
}

/// A policy that replies over a session.
#[derive(Clone, Debug)]
pub struct Remote {
    session: Session,
    keys: PolicyKeys,
    patience: Duration,
}

impl Remote {
    /// The policy `name`, with the timeout `patience` for every reply.
    ///
    /// # Errors
    /// [`PolicyError::Start`] when the name is not valid in a key expression.
    pub fn new(session: Session, name: &str, patience: Duration) -> Result<Self, PolicyError> {
        let keys = PolicyKeys::new(name).map_err(|e| PolicyError::Start(e.to_string()))?;
        Ok(Self {
            session,
            keys,
            patience,
        })
    }

    /// Waits until the policy exists, or `called_off` returns an error.
    ///
    /// # Errors
    /// The error of `called_off`; [`PolicyError::Start`] when the policy does not exist within
    /// `patience`.
    pub fn wait(
        &self,
        patience: Duration,
        called_off: &mut dyn FnMut() -> Result<(), PolicyError>,
    ) -> Result<(), PolicyError> {
        let deadline = Instant::now() + patience;
        loop {
            if self.is_there()? {
                return Ok(());
            }
            called_off()?;
            if Instant::now() > deadline {
                return Err(PolicyError::Start(format!(
                    "no policy named {:?} answered within {:.0} s",
                    self.keys.name(),
                    patience.as_secs_f64()
                )));
            }
            std::thread::sleep(LOOK);
        }
    }

    /// Whether its token is declared.
    fn is_there(&self) -> Result<bool, PolicyError> {
        let replies = self
            .session
            .liveliness()
            .get(self.keys.alive())
            .timeout(Duration::from_secs(1))
            .wait()
            .map_err(|e| PolicyError::Gone(e.to_string()))?;
        Ok(replies.into_iter().any(|reply| reply.result().is_ok()))
    }

    /// Requests the description of the policy.
    ///
    /// # Errors
    /// [`PolicyError`].
    pub fn describe(&self) -> Result<v1::PolicySpec, PolicyError> {
        let names = ("describe", "wheelarm.v1.PolicyDescribeRequest");
        self.request(self.keys.describe(), names, &v1::PolicyDescribeRequest {})
    }

    /// Begins an episode.
    ///
    /// # Errors
    /// [`PolicyError`].
    pub fn reset(&self, request: &v1::PolicyResetRequest) -> Result<(), PolicyError> {
        let names = ("reset", "wheelarm.v1.PolicyResetRequest");
        let _: v1::PolicyResetReply = self.request(self.keys.reset(), names, request)?;
        Ok(())
    }

    /// Chunks for observations, one for each in their order.
    ///
    /// # Errors
    /// [`PolicyError`] when they do not match; a chunk may still contain a problem.
    pub fn infer(&self, request: &v1::InferRequest) -> Result<Vec<v1::PolicyChunk>, PolicyError> {
        let names = ("infer", "wheelarm.v1.InferRequest");
        let reply: v1::InferReply = self.request(self.keys.infer(), names, request)?;
        let wrong = |problem| PolicyError::Garbled {
            query: "infer",
            problem,
        };
        let (sent, received) = (request.observations.len(), reply.chunks.len());
        if sent != received {
            return Err(wrong(format!("{received} chunks for {sent} observations")));
        }
        for (request_item, chunk) in request.observations.iter().zip(&reply.chunks) {
            let [a, b] = [
                (&request_item.episode_key, request_item.tick),
                (&chunk.episode_key, chunk.tick),
            ];
            if a != b {
                return Err(wrong(format!(
                    "a chunk for episode {:?} tick {} where that of {:?} tick {} belongs",
                    b.0, b.1, a.0, a.1
                )));
            }
        }
        Ok(reply.chunks)
    }

    fn request<R: Message + Default>(
        &self,
        key: String,
        (query, message): (&'static str, &str),
        request: &impl Message,
    ) -> Result<R, PolicyError> {
        let begun = Instant::now();
        let replies = self
            .session
            .get(key)
            .payload(request.encode_to_vec())
            .encoding(schema::encoding(message))
            .target(QueryTarget::All)
            .consolidation(ConsolidationMode::None)
            .priority(Priority::InteractiveHigh)
            .timeout(self.patience)
            .wait()
            .map_err(|e| PolicyError::Gone(e.to_string()))?;
        let seconds = self.patience.as_secs_f64();
        let none = || match begun.elapsed() > self.patience.mul_f64(WAITED) {
            true => PolicyError::Silent { query, seconds },
            false => PolicyError::Gone(format!("no policy replies to `{query}` any more")),
        };
        let reply = replies.recv().map_err(|_| none())?;
        let garbled = |problem: String| PolicyError::Garbled { query, problem };
        match reply.result() {
            Ok(sample) => {
                let encoding = sample.encoding().to_string();
                schema::check(&encoding).map_err(|e| garbled(e.to_string()))?;
                let bytes = sample.payload().to_bytes();
                R::decode(&*bytes).map_err(|e| garbled(e.to_string()))
            }
            Err(error) => match v1::Failure::decode(&*error.payload().to_bytes()) {
                Ok(failure) if !failure.message.is_empty() => {
                    Err(PolicyError::Rejected(failure.message))
                }
                // The transport itself reports a timeout as an error reply.
                _ => Err(none()),
            },
        }
    }
}
