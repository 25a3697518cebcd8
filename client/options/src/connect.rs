//! Options that select the server.

use std::path::PathBuf;
use std::time::Duration;

use anyhow::Context;
use clap::Args;
use wheelarm_proto::bundle::Identity;
use wheelarm_proto::endpoint;
use wheelarm_proto::keys::DEFAULT_SIM;
use wheelarm_sdk::{Connect, DEFAULT_ENDPOINT};

use crate::choice::{self, patience};

/// Options that select the server.
#[derive(Args, Clone, Debug)]
pub struct ConnectArgs {
    /// Endpoint of the server, for example `tcp/127.0.0.1:7447`, or with keys
    /// `tls/sim-host:7447`.
    #[arg(long, global = true, env = "WHEELARM_CONNECT", default_value = DEFAULT_ENDPOINT, value_parser = choice::endpoint)]
    pub connect: String,
    /// Name of the server; many can share one network. `record` accepts `*` for all.
    #[arg(long, global = true, env = "WHEELARM_SIM", default_value = DEFAULT_SIM)]
    pub sim: String,
    /// Longest wait for the connection, seconds.
    #[arg(long, global = true, default_value = "5", value_name = "SECONDS", value_parser = patience::<0>)]
    pub connect_timeout: Duration,
    /// Folder of your keys, for `--connect tls/…`.
    #[arg(long, global = true, env = "WHEELARM_KEYS", value_name = "DIR")]
    pub keys: Option<PathBuf>,
    /// User whose keys to use, if --keys names a server's folder of all keys.
    #[arg(long, global = true, env = "WHEELARM_USER", value_name = "NAME", value_parser = choice::name)]
    pub user: Option<String>,
}

impl ConnectArgs {
    /// Resolves the server and the identity of the user.
    ///
    /// # Errors
    /// When the endpoint needs keys that do not exist.
    pub fn connect(&self) -> anyhow::Result<Connect> {
        let needs_keys = endpoint::is_guarded(&self.connect);
        let folder = self.keys.as_ref().filter(|_| needs_keys);
        let find_keys = |folder: &PathBuf| Identity::find(folder, self.user.as_deref());
        let identity = folder.map(find_keys).transpose();
        Ok(Connect {
            identity: identity.with_context(|| format!("keys for {}", self.connect))?,
            ..Connect::from(self)
        })
    }
}

impl From<&ConnectArgs> for Connect {
    fn from(args: &ConnectArgs) -> Self {
        Self {
            endpoint: args.connect.clone(),
            sim: args.sim.clone(),
            timeout_secs: args.connect_timeout.as_secs_f64(),
            identity: None,
        }
    }
}
