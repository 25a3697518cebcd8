//! The Zenoh session of a server.

use crate::sim::Pacing;
use zenoh::{Config, Session, Wait};

/// Opens a session that listens on `listen` and connects to `connect`.
///
/// The server is a Zenoh router, so that its clients also see each other.
/// Nothing is announced by multicast unless `multicast` is set.
///
/// # Errors
/// The transport's error, for example an address in use.
pub fn open(
    listen: &[String],
    connect: &[String],
    multicast: bool,
    pacing: Pacing,
) -> Result<Session, super::ServiceError> {
    let mut config = Config::default();
    let mut set = |key: &str, value: String| {
        config
            .insert_json5(key, &value)
            .map_err(|e| super::ServiceError::Zenoh(format!("setting {key} to {value}: {e}")))
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
    // Alone there is nobody to be heard of before the start.
    let alone = !multicast && connect.is_empty();
    let delay = if alone { "0" } else { "500" };
    set("scouting/delay", delay.to_owned())?;
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
