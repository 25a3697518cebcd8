//! A plain Zenoh router, like the published `zenohd`, between servers and recorders on a
//! large network.
//!
//! Prints `ready ENDPOINT` when it serves; ends when standard input closes.

use std::io::Read;
use std::net::TcpListener;

use anyhow::anyhow;
use zenoh::{Config, Wait};

fn main() -> anyhow::Result<()> {
    let port = TcpListener::bind("127.0.0.1:0")?.local_addr()?.port();
    let endpoint = format!("tcp/127.0.0.1:{port}");
    let drop = "transport/link/tx/queue/congestion_control/drop";
    let mut config = Config::default();
    for (key, value) in [
        ("mode", "\"router\"".to_owned()),
        ("listen/endpoints", format!("[{endpoint:?}]")),
        ("scouting/multicast/enabled", "false".to_owned()),
        // As the guide configures `zenohd`: samples wait for room; by default they are
        // dropped after a millisecond.
        (
            format!("{drop}/wait_before_drop").as_str(),
            "5000000".to_owned(),
        ),
        (
            format!("{drop}/max_wait_before_drop_fragments").as_str(),
            "5000000".to_owned(),
        ),
    ] {
        config
            .insert_json5(key, &value)
            .map_err(|e| anyhow!("setting {key}: {e}"))?;
    }
    let session = zenoh::open(config)
        .wait()
        .map_err(|e| anyhow!("opening the router: {e}"))?;
    println!("ready {endpoint}");
    std::io::stdin().read_to_end(&mut Vec::new())?;
    session.close().wait().map_err(|e| anyhow!("closing: {e}"))
}
