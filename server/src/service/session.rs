//! The Zenoh session of a server.

use wheelarm_proto::keys::Keys;
use zenoh::{Config, Session, Wait};

use super::error::ServiceError;
use crate::sim::Pacing;

/// Largest message that is put together: a picture of 4096 x 4096 pixels with
/// colour, depth and ids, and room for the rest, bytes.
const MAX_MESSAGE: usize = 4096 * 4096 * 8 + (1 << 20);

/// Opens a session that listens on `listen` and connects to `connect`.
///
/// The server is a Zenoh router, so that its clients also see each other.
/// Nothing is announced by multicast unless `multicast` is set. What others
/// publish or answer under the server's own keys is not let through.
///
/// # Errors
/// The transport's error, for example an address in use.
pub fn open(
    keys: &Keys,
    listen: &[String],
    connect: &[String],
    multicast: bool,
    pacing: Pacing,
) -> Result<Session, ServiceError> {
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
    // Connections that never say a word must not keep others out.
    set("transport/unicast/accept_pending", "500".to_owned())?;
    set("transport/unicast/accept_timeout", "5000".to_owned())?;
    // Every callback looks at the length before anything is copied; this bounds
    // what the transport itself puts together. Nothing larger than a picture of
    // the greatest size passes through, from servers that this one is a router for.
    set(
        "transport/link/rx/max_message_size",
        MAX_MESSAGE.to_string(),
    )?;
    // Alone there is nobody to be heard of before the start.
    let alone = !multicast && connect.is_empty();
    let delay = if alone { "0" } else { "500" };
    set("scouting/delay", delay.to_owned())?;
    set("access_control", own_keys_only(keys))?;
    // A camera message waits for room instead of being dropped after 1 ms. In
    // lock-step the simulation waits anyway, so it may wait long; a receiver
    // that stands still costs this once, for then it counts as congested.
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
    Ok(zenoh::open(config).wait()?)
}

/// Opens a session for a server whose clients are in this process: it listens
/// nowhere and looks for nobody. What is published reaches them where it lies.
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

/// Access control of the router that the server is: its own keys are closed to
/// everybody who is connected to it. Behind another router that one would have
/// to do the same; therefore clients look at ids and digests as well. Tokens
/// pass: by them a second server of the same name is told so, and clients keep
/// to the session that they dialled.
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
            subjects: [{{ id: "everybody" }}],
            policies: [{{ rules: ["own"], subjects: ["everybody"] }}] }}"#
    )
}
