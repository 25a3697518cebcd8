//! The Zenoh session of a server.

use wheelarm_access::{Folder, Subjects};
use wheelarm_proto::endpoint;
use wheelarm_proto::keys::Keys;
use wheelarm_proto::v1::Access;
use zenoh::{Config, Session, Wait};

use super::error::ServiceError;
use crate::sim::Pacing;

/// How a server can be reached.
#[derive(Clone, Debug, Default)]
pub struct Reach {
    /// Endpoints that it listens on.
    pub listen: Vec<String>,
    /// Endpoints of routers that it connects to.
    pub connect: Vec<String>,
    /// Announce it by multicast on the local network.
    pub multicast: bool,
    /// Keys and users: clients present a certificate and have the rights of their role.
    pub keys: Option<Folder>,
    /// Allow listening to other hosts without keys.
    pub insecure: bool,
}

impl Reach {
    /// The access mode.
    ///
    /// # Errors
    /// [`ServiceError::Endpoint`] when other hosts could connect without keys, or keys
    /// and endpoints do not match.
    pub fn access(&self) -> Result<Access, ServiceError> {
        let transport = |endpoint: &String| endpoint::parts(endpoint).0.to_owned();
        let endpoints = self.listen.iter().chain(&self.connect);
        if self.keys.is_some() {
            if let Some(open) = endpoints.clone().find(|e| transport(e) == "tcp") {
                return Err(ServiceError::Endpoint(format!(
                    "with --keys only tls/HOST:PORT and unixsock-stream/PATH are allowed, and {open} would admit every client: leave it out"
                )));
            }
            return Ok(Access::Keys);
        }
        if let Some(guarded) = endpoints.clone().find(|e| transport(e) == "tls") {
            return Err(ServiceError::Endpoint(format!(
                "{guarded} needs keys: make them with `wheelarm keys init --keys DIR` and name the folder with --keys DIR"
            )));
        }
        match self.listen.iter().find(|e| !endpoint::is_local(e)) {
            None => Ok(Access::Local),
            Some(_) if self.insecure => Ok(Access::Insecure),
            Some(far) => Err(ServiceError::Endpoint(format!(
                "{far} is open to other hosts, whose users could drive and end this server: listen on tcp/127.0.0.1:PORT and use an SSH tunnel, or give users keys (`wheelarm keys init --keys DIR`, then --keys DIR --listen tls/0.0.0.0:PORT), or use --insecure in a network without other users"
            ))),
        }
    }
}

/// Opens the session.
///
/// The server is a Zenoh router, so that its clients also see each other. Samples and
/// replies of other sessions under the server's own keys are blocked. With keys, so is
/// everything that a user's role does not allow.
///
/// # Errors
/// [`ServiceError::Endpoint`], [`ServiceError::Access`], or the transport's error,
/// for example an address in use.
pub fn open(keys: &Keys, reach: &Reach, pacing: Pacing) -> Result<Session, ServiceError> {
    reach.access()?;
    let (listen, connect, multicast) = (&reach.listen, &reach.connect, reach.multicast);
    let mut config = Config::default();
    let mut set = |key: &str, value: String| {
        config
            .insert_json5(key, &value)
            .map_err(|e| ServiceError::Zenoh(format!("setting {key} to {value}: {e}")))
    };
    let list = |endpoints: &[String]| {
        let quoted: Vec<_> = endpoints.iter().map(|e| format!("{e:?}")).collect();
        format!("[{}]", quoted.join(","))
    };
    set("mode", "\"router\"".to_owned())?;
    set("scouting/multicast/enabled", multicast.to_string())?;
    set("scouting/gossip/enabled", "false".to_owned())?;
    set("timestamping/enabled", "true".to_owned())?;
    set("transport/shared_memory/enabled", "false".to_owned())?;
    set("listen/endpoints", list(listen))?;
    set("connect/endpoints", list(connect))?;
    set("connect/timeout_ms", "5000".to_owned())?;
    for (key, value) in wheelarm_access::guards(keys.sim()) {
        set(key, value.to_string())?;
    }
    // Without connections, do not wait for discovery.
    let alone = !multicast && connect.is_empty();
    let delay = if alone { "0" } else { "500" };
    set("scouting/delay", delay.to_owned())?;
    match &reach.keys {
        None => set("access_control", own_keys_only(keys))?,
        Some(folder) => {
            let link = wheelarm_access::tls(folder);
            for (key, value) in link.as_object().into_iter().flatten() {
                set(&format!("transport/link/{key}"), value.to_string())?;
            }
            let problem = |why: &str| tracing::error!("the users are unchanged: {why}");
            let users = wheelarm_access::follow(folder, zenoh_link_tls::admit, problem)?;
            let rules = wheelarm_access::access_control(&users, keys.sim(), Subjects::Roles);
            set("access_control", rules.to_string())?;
            set("adminspace/enabled", "false".to_owned())?;
        }
    }
    // A camera message waits for buffer space instead of being dropped after 1 ms. In
    // lock-step the simulation waits anyway, so the wait may be long; a suspended
    // receiver causes it only once, because it then counts as congested. The limit is
    // needed because a broken connection is not closed before the wait ends. A peer
    // that reconnects earlier would not receive the key declarations of its samples.
    let wait_micros = if pacing == Pacing::LockStep {
        1_000_000
    } else {
        50_000
    };
    let drop = "transport/link/tx/queue/congestion_control/drop";
    set(&format!("{drop}/wait_before_drop"), wait_micros.to_string())?;
    set(
        &format!("{drop}/max_wait_before_drop_fragments"),
        wait_micros.to_string(),
    )?;
    // Only the user may open the local socket's file: the rules give it the admin role.
    let before = rustix::process::umask(rustix::fs::Mode::from_raw_mode(0o177));
    let opened = zenoh::open(config).wait();
    rustix::process::umask(before);
    Ok(opened?)
}

/// Opens a session for clients in the same process: no listening, no discovery. Samples
/// reach them without a copy.
///
/// # Errors
/// The transport's error.
pub fn within() -> Result<Session, ServiceError> {
    let mut config = Config::default();
    for (key, value) in [
        ("mode", "\"peer\""),
        ("scouting/multicast/enabled", "false"),
        ("scouting/gossip/enabled", "false"),
        ("scouting/delay", "0"),
        ("timestamping/enabled", "true"),
        ("transport/shared_memory/enabled", "false"),
        ("listen/endpoints", "[]"),
        ("connect/endpoints", "[]"),
    ] {
        config
            .insert_json5(key, value)
            .map_err(|e| ServiceError::Zenoh(format!("setting {key} to {value}: {e}")))?;
    }
    Ok(zenoh::open(config).wait()?)
}

/// Access control of the server's router: its own keys are closed to connected clients.
/// Another router in between would not enforce this, so clients also check session IDs
/// and digests. Liveliness tokens pass: a second server of the same name is detected by
/// them, and clients keep to the session that they connected to.
fn own_keys_only(keys: &Keys) -> String {
    let own: Vec<String> = keys.own().iter().map(|key| format!("{key:?}")).collect();
    let rule = format!(
        r#"{{ id: "own", permission: "deny", flows: ["ingress"],
            messages: ["put", "delete", "declare_queryable", "reply"],
            key_exprs: [{}] }}"#,
        own.join(",")
    );
    format!(
        r#"{{ enabled: true, default_permission: "allow", rules: [{rule}],
            subjects: [{{ id: "all" }}],
            policies: [{{ rules: ["own"], subjects: ["all"] }}] }}"#
    )
}
