//! Every key expression of a server, in one place.
//!
//! `{sim}` names a server, so that many share one network.
//!
//! | key | message | direction |
//! |---|---|---|
//! | `wheelarm/{sim}/alive/{id}` | liveliness token; `id` is the Zenoh id of the session that alone speaks for the server | server |
//! | `wheelarm/{sim}/command` | `Command` | commander → server |
//! | `wheelarm/{sim}/refusal` | `Refusal` | server → commanders |
//! | `wheelarm/{sim}/stream/{name}` | see `names::STREAMS` | server → all |
//! | `wheelarm/{sim}/camera/{name}` | `CameraFrame` | server → all |
//! | `wheelarm/{sim}/preview/{camera}/{level}` | `PreviewFrame` | server → viewers |
//! | `wheelarm/{sim}/commander/{name}/{run_id}/alive` | liveliness token | commander |
//! | `wheelarm/{sim}/episode/start` | `EpisodeStarted` | server → all |
//! | `wheelarm/{sim}/episode/stop` | `EpisodeStopped` | server → all |
//! | `wheelarm/{sim}/recorder/{name}` | `RecorderStatus` | recorder → server |
//! | `wheelarm/{sim}/recorder/{name}/alive` | liveliness token | recorder |
//! | `wheelarm/{sim}/query/{name}` | see [`Query`] | query |
//!
//! A query answers either its reply message or, as an error reply, `Failure`.

use crate::preview::PreviewLevel;

/// First chunk of every key.
pub const PREFIX: &str = "wheelarm";

/// Name that a server takes when none is given.
pub const DEFAULT_SIM: &str = "sim";

/// Queries that a server answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Query {
    /// No payload → `Status`.
    Status,
    /// No payload → `SceneReply`.
    Scene,
    /// No payload → `TaskList`.
    Tasks,
    /// `LeaseRequest` → `LeaseReply`.
    Lease,
    /// `ReachRequest` → `ReachReply`.
    Reach,
    /// `ResetRequest` → `ResetReply`.
    Reset,
    /// No payload → `Ack`.
    Pause,
    /// No payload → `Ack`.
    Resume,
    /// `EpisodeStartRequest` → `EpisodeStarted`.
    EpisodeStart,
    /// `EpisodeStopRequest` → `EpisodeStopped`.
    EpisodeStop,
    /// No payload → `EpisodeState`: what runs, and the last manifests.
    Episode,
    /// No payload → `SnapshotReply` of the running episode's first tick.
    Snapshot,
    /// No payload → `Ack`; the server ends.
    Shutdown,
}

impl Query {
    /// Every query.
    pub const ALL: [Self; 13] = [
        Self::Status,
        Self::Scene,
        Self::Tasks,
        Self::Lease,
        Self::Reach,
        Self::Reset,
        Self::Pause,
        Self::Resume,
        Self::EpisodeStart,
        Self::EpisodeStop,
        Self::Episode,
        Self::Snapshot,
        Self::Shutdown,
    ];

    /// Last chunk of the key.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Status => "status",
            Self::Scene => "scene",
            Self::Tasks => "tasks",
            Self::Lease => "lease",
            Self::Reach => "reach",
            Self::Reset => "reset",
            Self::Pause => "pause",
            Self::Resume => "resume",
            Self::EpisodeStart => "episode_start",
            Self::EpisodeStop => "episode_stop",
            Self::Episode => "episode",
            Self::Snapshot => "snapshot",
            Self::Shutdown => "shutdown",
        }
    }
}

/// The keys of one server.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Keys {
    sim: String,
}

/// A server name that cannot stand in a key.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
#[error(
    "server name {0:?} must be 1 to 64 letters, digits, `-` or `_` (it stands in a key expression)"
)]
pub struct BadName(pub String);

/// Checks a name that stands in a key: 1 to 64 letters, digits, `-`, `_`.
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

/// A name for one life of one process, drawn at random: 16 hexadecimal digits.
#[must_use]
pub fn run_id() -> String {
    use std::hash::{BuildHasher, Hasher};
    // The standard library's hasher is keyed at random.
    let mut hasher = std::hash::RandomState::new().build_hasher();
    hasher.write_u32(std::process::id());
    format!("{:016x}", hasher.finish())
}

impl Keys {
    /// Keys of the server `sim`.
    ///
    /// # Errors
    /// [`BadName`] when the name cannot stand in a key expression.
    pub fn new(sim: &str) -> Result<Self, BadName> {
        check_name(sim)?;
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

    /// Liveliness token of the server, whose Zenoh session has the id `id`;
    /// `*` for whichever serves under this name.
    #[must_use]
    pub fn alive(&self, id: &str) -> String {
        self.key(&format!("alive/{id}"))
    }

    /// Tokens of every server on the network.
    #[must_use]
    pub fn all_alive() -> String {
        format!("{PREFIX}/*/alive/*")
    }

    /// Name of the server and id of its session in a key of [`Keys::alive`].
    #[must_use]
    pub fn server_of(key: &str) -> Option<(String, String)> {
        let mut chunks = key.split('/').skip(1);
        let (sim, alive, id) = (chunks.next()?, chunks.next()?, chunks.next()?);
        let hex = (1..=32).contains(&id.len()) && id.bytes().all(|b| b.is_ascii_hexdigit());
        let fits = check_name(sim).is_ok() && alive == "alive" && hex && chunks.next().is_none();
        fits.then(|| (sim.to_owned(), id.to_owned()))
    }

    /// Keys under which nobody but the server publishes or answers.
    #[must_use]
    pub fn own(&self) -> Vec<String> {
        let own = [
            "alive/**",
            "refusal/**",
            "stream/**",
            "camera/**",
            "preview/**",
            "episode/**",
            "query/**",
        ];
        own.iter().map(|rest| self.key(rest)).collect()
    }

    /// Commands of every commander.
    #[must_use]
    pub fn command(&self) -> String {
        self.key("command")
    }

    /// Refused commands.
    #[must_use]
    pub fn refusal(&self) -> String {
        self.key("refusal")
    }

    /// One state stream.
    #[must_use]
    pub fn stream(&self, name: &str) -> String {
        self.key(&format!("stream/{name}"))
    }

    /// One camera.
    #[must_use]
    pub fn camera(&self, name: &str) -> String {
        self.key(&format!("camera/{name}"))
    }

    /// Preview of one camera at one level.
    #[must_use]
    pub fn preview(&self, camera: &str, level: PreviewLevel) -> String {
        self.key(&format!("preview/{camera}/{}", level.name()))
    }

    /// Liveliness token of one life of one commander; `*` for all.
    #[must_use]
    pub fn commander_alive(&self, name: &str, run_id: &str) -> String {
        self.key(&format!("commander/{name}/{run_id}/alive"))
    }

    /// Name and run id in a key of [`Keys::commander_alive`].
    #[must_use]
    pub fn commander_of(key: &str) -> Option<(String, String)> {
        let mut chunks = key.rsplit('/').skip(1);
        let (run_id, name) = (chunks.next()?, chunks.next()?);
        let fits = check_name(name).is_ok() && check_name(run_id).is_ok();
        fits.then(|| (name.to_owned(), run_id.to_owned()))
    }

    /// Start of an episode.
    #[must_use]
    pub fn episode_start(&self) -> String {
        self.key("episode/start")
    }

    /// End of an episode.
    #[must_use]
    pub fn episode_stop(&self) -> String {
        self.key("episode/stop")
    }

    /// Status of one recorder; `*` for all.
    #[must_use]
    pub fn recorder(&self, name: &str) -> String {
        self.key(&format!("recorder/{name}"))
    }

    /// Liveliness token of one recorder; `*` for all. What a recorder says
    /// counts only while it is declared.
    #[must_use]
    pub fn recorder_alive(&self, name: &str) -> String {
        self.key(&format!("recorder/{name}/alive"))
    }

    /// A query.
    #[must_use]
    pub fn query(&self, query: Query) -> String {
        self.key(&format!("query/{}", query.name()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_of_two_servers_differ() {
        let a = Keys::new("a").unwrap();
        assert_eq!(a.stream("imu"), "wheelarm/a/stream/imu");
        assert_ne!(a.command(), Keys::new("b").unwrap().command());
    }

    #[test]
    fn a_commander_is_read_back_from_its_token() {
        let keys = Keys::new("a").unwrap();
        let key = keys.commander_alive("anna", "00ff");
        let read = Keys::commander_of(&key);
        assert_eq!(read, Some(("anna".to_owned(), "00ff".to_owned())));
        assert_eq!(Keys::commander_of("alive"), None);
        assert_ne!(run_id(), run_id());
    }

    #[test]
    fn a_server_is_read_back_from_its_token() {
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
            assert!(Keys::new(bad).is_err(), "{bad:?} was taken");
        }
    }
}
