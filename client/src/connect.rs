//! The options that say which server to speak to.

use std::time::Duration;

use clap::Args;
use wheelarm_link::{Connect, DEFAULT_ENDPOINT};
use wheelarm_proto::keys::DEFAULT_SIM;

use crate::choice::{endpoint, patience};

/// Which server to speak to.
#[derive(Args, Clone, Debug)]
pub struct ConnectArgs {
    /// Endpoint of the server, for example `tcp/127.0.0.1:7447`.
    #[arg(long, global = true, env = "WHEELARM_CONNECT", default_value = DEFAULT_ENDPOINT, value_parser = endpoint)]
    pub connect: String,
    /// Name of the server; many can share one network. `record` takes `*` for all.
    #[arg(long, global = true, env = "WHEELARM_SIM", default_value = DEFAULT_SIM)]
    pub sim: String,
    /// Longest wait for the connection, seconds.
    #[arg(long, global = true, default_value = "5", value_name = "SECONDS", value_parser = patience::<0>)]
    pub connect_timeout: Duration,
}

impl From<&ConnectArgs> for Connect {
    fn from(args: &ConnectArgs) -> Self {
        Self {
            endpoint: args.connect.clone(),
            sim: args.sim.clone(),
            timeout_secs: args.connect_timeout.as_secs_f64(),
        }
    }
}
