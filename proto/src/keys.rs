//! Every key expression of a server.
//!
//! `{sim}` is the server's name, so that several share one network.
//!
//! | key | message | direction |
//! |---|---|---|
//! | `wheelarm/{sim}/alive/{id}` | liveliness token; `id` is the Zenoh ID of the server's session | server |
//! | `wheelarm/{sim}/command/{commander}` | `Command` | commander → server |
//! | `wheelarm/{sim}/refusal` | `Refusal` | server → commanders |
//! | `wheelarm/{sim}/stream/{name}` | see [`TOPICS`](crate::topic::TOPICS) | server → all |
//! | `wheelarm/{sim}/camera/{name}` | `CameraFrame` | server → all |
//! | `wheelarm/{sim}/compressed/{camera}` | `CompressedCameraFrame` | server → recorders |
//! | `wheelarm/{sim}/sensor/{name}` | `SensorFrame` | server → all |
//! | `wheelarm/{sim}/preview/{camera}/{level}` | `PreviewFrame` | server → viewers |
//! | `wheelarm/{sim}/commander/{name}/{run_id}/alive` | liveliness token | commander |
//! | `wheelarm/{sim}/episode/start` | `EpisodeStarted` | server → all |
//! | `wheelarm/{sim}/episode/stop` | `EpisodeStopped` | server → all |
//! | `wheelarm/{sim}/recorder/{name}` | `RecorderStatus` | recorder → server |
//! | `wheelarm/{sim}/recorder/{name}/alive` | liveliness token | recorder |
//! | `wheelarm/{sim}/query/lease/{commander}` | `LeaseRequest` | query |
//! | `wheelarm/{sim}/query/{name}` | see [`Query`]; `service Simulation` | query |
//! | `wheelarm/policy/{name}/{describe,reset,infer}` | see [`PolicyKeys`] | query to a policy |
//!
//! A query answers either its reply message or, as an error reply, `Failure`.
//!
//! The key names the sender, so that access rules can distinguish senders; the server
//! rejects a payload that names another one. Every message has an encoding
//! ([`schema`](crate::schema)).

use crate::preview::PreviewLevel;
use crate::rpc::{Query, Rpc};
use crate::topic::{StreamId, TopicId};

/// First chunk of every key.
pub const PREFIX: &str = "wheelarm";

/// Default name of a server.
pub const DEFAULT_SIM: &str = "sim";

/// The keys of one server.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Keys {
    sim: String,
}

/// An invalid name of a server, a commander or a recorder.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
#[error(
    "the name {0:?} must be 1 to 64 letters, digits, `-` or `_` (it is part of a key expression), \
     and `policy` is taken"
)]
pub struct BadName(pub String);

/// Not allowed as a server's name: the keys of policies start with it.
const POLICY: &str = "policy";

/// Checks a name for use in a key: 1 to 64 letters, digits, `-`, `_`.
///
/// # Errors
/// [`BadName`] when it has another length or character.
pub fn check_name(name: &str) -> Result<(), BadName> {
    let fits = (1..=64).contains(&name.len())
        && name
            .bytes()
            .all(|b| b.is_ascii_alphanumeric() || b == b'-' || b == b'_');
    if fits {
        Ok(())
    } else {
        Err(BadName(name.to_owned()))
    }
}

/// A random name for one process run: 16 hexadecimal digits.
#[must_use]
pub fn run_id() -> String {
    use std::hash::{BuildHasher, Hasher};
    // The standard library's hasher is keyed randomly.
    let mut hasher = std::hash::RandomState::new().build_hasher();
    hasher.write_u32(std::process::id());
    format!("{:016x}", hasher.finish())
}

impl Keys {
    /// Keys of the server `sim`.
    ///
    /// # Errors
    /// [`BadName`] when the name is not valid in a key expression.
    pub fn new(sim: &str) -> Result<Self, BadName> {
        check_name(sim)?;
        if sim == POLICY {
            return Err(BadName(sim.to_owned()));
        }
        Ok(Self {
            sim: sim.to_owned(),
        })
    }

    /// The server's name.
    #[must_use]
    pub fn sim(&self) -> &str {
        &self.sim
    }

    fn key(&self, rest: &str) -> String {
        format!("{PREFIX}/{}/{rest}", self.sim)
    }

    /// Liveliness token of the server whose Zenoh session has the ID `id`; `*` for any
    /// server of this name.
    #[must_use]
    pub fn alive(&self, id: &str) -> String {
        self.key(&format!("alive/{id}"))
    }

    /// Tokens of every server on the network.
    #[must_use]
    pub fn all_alive() -> String {
        format!("{PREFIX}/*/alive/*")
    }

    /// Name of the server and ID of its session in a key of [`Keys::alive`].
    #[must_use]
    pub fn server_of(key: &str) -> Option<(String, String)> {
        let mut chunks = key.split('/').skip(1);
        let (sim, alive, id) = (chunks.next()?, chunks.next()?, chunks.next()?);
        let hex = (1..=32).contains(&id.len()) && id.bytes().all(|b| b.is_ascii_hexdigit());
        let fits = check_name(sim).is_ok() && alive == "alive" && hex && chunks.next().is_none();
        fits.then(|| (sim.to_owned(), id.to_owned()))
    }

    /// Keys under which only the server publishes and replies.
    #[must_use]
    pub fn own(&self) -> Vec<String> {
        let own = [
            "alive/**",
            "refusal/**",
            "stream/**",
            "camera/**",
            "compressed/**",
            "sensor/**",
            "preview/**",
            "episode/**",
            "query/**",
        ];
        own.iter().map(|rest| self.key(rest)).collect()
    }

    /// A topic, with `*` for the variable part of its key.
    #[must_use]
    pub fn topic(&self, topic: TopicId) -> String {
        let chunks = topic.info().key.split('/');
        let chunks: Vec<_> = chunks
            .map(|chunk| if chunk.starts_with('{') { "*" } else { chunk })
            .collect();
        self.key(&chunks.join("/"))
    }

    /// One stream.
    #[must_use]
    pub fn stream(&self, stream: &StreamId) -> String {
        match stream {
            StreamId::State(topic) => self.topic(*topic),
            StreamId::Camera(name) => self.key(&format!("camera/{name}")),
            StreamId::Compressed(name) => self.key(&format!("compressed/{name}")),
            StreamId::Sensor(name) => self.key(&format!("sensor/{name}")),
            StreamId::Other(name) => self.key(&format!("stream/{name}")),
        }
    }

    /// Every stream without images.
    #[must_use]
    pub fn streams(&self) -> String {
        self.key("stream/*")
    }

    /// The stream that a key of [`Keys::stream`] names.
    #[must_use]
    pub fn stream_of(&self, key: &str) -> Option<StreamId> {
        let rest = key.strip_prefix(PREFIX)?.strip_prefix('/')?;
        let rest = rest.strip_prefix(self.sim.as_str())?.strip_prefix('/')?;
        match rest.split_once('/')? {
            ("camera", name) => Some(StreamId::camera(name)),
            ("compressed", name) => Some(StreamId::compressed(name)),
            ("sensor", name) => Some(StreamId::sensor(name)),
            ("stream", name) => Some(StreamId::parse(name)),
            _ => None,
        }
    }

    /// Commands of one commander; `*` for all.
    #[must_use]
    pub fn command(&self, commander: &str) -> String {
        self.key(&format!("command/{commander}"))
    }

    /// One camera.
    #[must_use]
    pub fn camera(&self, name: &str) -> String {
        self.stream(&StreamId::camera(name))
    }

    /// One camera, compressed.
    #[must_use]
    pub fn compressed(&self, camera: &str) -> String {
        self.stream(&StreamId::compressed(camera))
    }

    /// Images of one sensor model.
    #[must_use]
    pub fn sensor(&self, sensor: &str) -> String {
        self.stream(&StreamId::sensor(sensor))
    }

    /// Preview of one camera at one level.
    #[must_use]
    pub fn preview(&self, camera: &str, level: PreviewLevel) -> String {
        self.key(&format!("preview/{camera}/{}", level.name()))
    }

    /// Liveliness token of one process of a commander; `*` for all.
    #[must_use]
    pub fn commander_alive(&self, name: &str, run_id: &str) -> String {
        self.key(&format!("commander/{name}/{run_id}/alive"))
    }

    /// Name and run ID in a key of [`Keys::commander_alive`].
    #[must_use]
    pub fn commander_of(key: &str) -> Option<(String, String)> {
        let mut chunks = key.rsplit('/').skip(1);
        let (run_id, name) = (chunks.next()?, chunks.next()?);
        let fits = check_name(name).is_ok() && check_name(run_id).is_ok();
        fits.then(|| (name.to_owned(), run_id.to_owned()))
    }

    /// Status of one recorder; `*` for all.
    #[must_use]
    pub fn recorder(&self, name: &str) -> String {
        self.key(&format!("recorder/{name}"))
    }

    /// Liveliness token of one recorder; `*` for all. A recorder's statuses count only
    /// while it is declared.
    #[must_use]
    pub fn recorder_alive(&self, name: &str) -> String {
        self.key(&format!("recorder/{name}/alive"))
    }

    /// A query, of any client.
    #[must_use]
    pub fn query(&self, query: Query) -> String {
        let who = if query.has_identity() { "/*" } else { "" };
        self.key(&format!("query/{}{who}", query.name()))
    }

    /// The key of a request: the query, and the client where the key contains it.
    ///
    /// # Errors
    /// [`BadName`] when a name is not valid in a key.
    pub fn request<R: Rpc>(&self, request: &R) -> Result<String, BadName> {
        let query = R::QUERY.name();
        Ok(match request.identity() {
            Some(name) => {
                check_name(name)?;
                self.key(&format!("query/{query}/{name}"))
            }
            None => self.key(&format!("query/{query}")),
        })
    }

    /// The query of a key of [`Keys::request`].
    #[must_use]
    pub fn query_of(key: &str) -> Option<Query> {
        let mut chunks = key.split('/').skip(2);
        let name = (chunks.next()? == "query").then(|| chunks.next())??;
        Query::ALL.into_iter().find(|query| query.name() == name)
    }

    /// The sender, in a key that ends with it.
    #[must_use]
    pub fn sender_of(key: &str) -> &str {
        key.rsplit('/').next().unwrap_or_default()
    }
}

/// The keys of one policy, which are independent of servers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PolicyKeys {
    name: String,
}

impl PolicyKeys {
    /// Keys of the policy `name`.
    ///
    /// # Errors
    /// [`BadName`] when the name is not valid in a key expression.
    pub fn new(name: &str) -> Result<Self, BadName> {
        check_name(name)?;
        Ok(Self {
            name: name.to_owned(),
        })
    }

    /// The policy's name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    fn key(&self, rest: &str) -> String {
        format!("{PREFIX}/{POLICY}/{}/{rest}", self.name)
    }

    /// Liveliness token.
    #[must_use]
    pub fn alive(&self) -> String {
        self.key("alive")
    }

    /// Reply to `PolicyDescribeRequest`: `PolicySpec`.
    #[must_use]
    pub fn describe(&self) -> String {
        self.key("describe")
    }

    /// Reply to `PolicyResetRequest`: `PolicyResetReply`.
    #[must_use]
    pub fn reset(&self) -> String {
        self.key("reset")
    }

    /// Reply to `InferRequest`: `InferReply`.
    #[must_use]
    pub fn infer(&self) -> String {
        self.key("infer")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_policy_has_keys_that_no_server_can_have() {
        let keys = PolicyKeys::new("act").unwrap();
        assert_eq!(keys.infer(), "wheelarm/policy/act/infer");
        assert_eq!(Keys::new("policy"), Err(BadName("policy".to_owned())));
        assert!(PolicyKeys::new("a/b").is_err());
        assert_eq!(Keys::server_of(&keys.alive()), None);
    }

    #[test]
    fn keys_of_two_servers_differ() {
        let a = Keys::new("a").unwrap();
        assert_eq!(a.topic(TopicId::Imu), "wheelarm/a/stream/imu");
        let anna = a.command("anna");
        assert_eq!(anna, "wheelarm/a/command/anna");
        assert_eq!(Keys::sender_of(&anna), "anna");
        assert_eq!(a.command("*"), a.topic(TopicId::SentCommand));
        assert_ne!(anna, Keys::new("b").unwrap().command("anna"));
    }

    #[test]
    fn the_key_of_a_lease_query_names_the_client() {
        use crate::v1;
        let keys = Keys::new("a").unwrap();
        let mut request = v1::LeaseRequest {
            commander: "anna".to_owned(),
            ..v1::LeaseRequest::default()
        };
        let key = keys.request(&request).unwrap();
        assert_eq!(key, "wheelarm/a/query/lease/anna");
        assert_eq!(Keys::query_of(&key), Some(Query::Lease));
        assert_eq!(keys.query(Query::Lease), "wheelarm/a/query/lease/*");
        let status = keys.request(&v1::StatusRequest {}).unwrap();
        assert_eq!(status, keys.query(Query::Status));
        assert_eq!(Keys::query_of(&status), Some(Query::Status));
        request.commander = "a/b".to_owned();
        assert!(keys.request(&request).is_err());
    }

    #[test]
    fn a_stream_is_parsed_from_its_key() {
        let keys = Keys::new("a").unwrap();
        let other = StreamId::Other("whistle".to_owned());
        for stream in StreamId::all(["gen3"], ["gen3_depth"]).chain([other]) {
            assert_eq!(keys.stream_of(&keys.stream(&stream)), Some(stream));
        }
        assert_eq!(keys.topic(TopicId::Camera), keys.camera("*"));
        assert_eq!(keys.stream_of("wheelarm/b/stream/imu"), None);
        assert_eq!(keys.stream_of("wheelarm/a/query/status"), None);
    }

    #[test]
    fn a_commander_is_parsed_from_its_token() {
        let keys = Keys::new("a").unwrap();
        let key = keys.commander_alive("anna", "00ff");
        let read = Keys::commander_of(&key);
        assert_eq!(read, Some(("anna".to_owned(), "00ff".to_owned())));
        assert_eq!(Keys::commander_of("alive"), None);
        assert_ne!(run_id(), run_id());
    }

    #[test]
    fn a_server_is_parsed_from_its_token() {
        let key = Keys::new("a").unwrap().alive("00ff");
        let read = Keys::server_of(&key);
        assert_eq!(read, Some(("a".to_owned(), "00ff".to_owned())));
        for bad in [
            "wheelarm/a/alive",
            "wheelarm/a/alive/x",
            "wheelarm/a/alive/0/0",
        ] {
            assert_eq!(Keys::server_of(bad), None, "{bad}");
        }
    }

    #[test]
    fn names_that_would_break_a_key_are_refused() {
        for bad in ["", "a/b", "*", "a b", "ü", &"x".repeat(65)] {
            assert!(Keys::new(bad).is_err(), "{bad:?} was accepted");
        }
    }
}
