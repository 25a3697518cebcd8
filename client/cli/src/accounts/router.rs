//! `wheelarm router`: a Zenoh router with the users and rules of a folder of keys.

use std::io::Write;
use std::path::PathBuf;

use anyhow::{Context, anyhow, bail};
use clap::Args;
use wheelarm_access::{Folder, Subjects, follow, router};
use wheelarm_proto::endpoint;
use wheelarm_proto::signals::Signals;
use wheelarm_sdk::transport_words;
use zenoh::Wait;

use super::folder;
use wheelarm_options::choice;

/// Options of `wheelarm router`.
#[derive(Args, Clone, Debug)]
pub struct RouterArgs {
    /// Endpoint to listen on. May be repeated.
    #[arg(long, default_value = "tls/0.0.0.0:7447", value_parser = choice::endpoint)]
    listen: Vec<String>,
}

/// Runs `wheelarm router` until it is interrupted. Prints `ready ENDPOINTS` when it serves.
///
/// # Errors
/// When the keys are invalid or an endpoint is in use.
pub fn route(named: Option<&PathBuf>, args: &RouterArgs) -> anyhow::Result<()> {
    let folder = Folder::open(folder(named)?)?;
    if let Some(any) = args.listen.iter().find(|e| takes_any_port(e)) {
        bail!("{any}: servers and clients need a fixed port: name one");
    }
    let problem = |why: &str| tracing::error!("the previous users stay in force: {why}");
    follow(&folder, zenoh_link_tls::admit, problem)?;
    let text = router(&folder, &args.listen, Subjects::Roles)?;
    let listen = args.listen.join(", ");
    let config = zenoh::Config::from_json5(&text)
        .map_err(|e| anyhow!("the configuration of a router: {}", transport_words(&e)))?;
    let runtime = tokio::runtime::Runtime::new()?;
    let mut signals = Signals::listen(&runtime).context("cannot listen to signals")?;
    // Only the owner may open a local socket, because the rules give it the role admin.
    let before = rustix::process::umask(rustix::fs::Mode::from_raw_mode(0o177));
    let opened = zenoh::open(config).wait();
    rustix::process::umask(before);
    let session = opened.map_err(|e| anyhow!("listening on {listen}: {}", transport_words(&e)))?;
    let mut out = std::io::stdout();
    writeln!(out, "ready {listen}")
        .and_then(|()| out.flush())
        .context("writing where it listens")?;
    runtime.block_on(signals.next());
    session
        .close()
        .wait()
        .map_err(|e| anyhow!("ending: {}", transport_words(&e)))
}

/// Whether the endpoint leaves the port to the system.
fn takes_any_port(endpoint: &str) -> bool {
    ["tcp", "tls"].contains(&endpoint::parts(endpoint).0) && endpoint.ends_with(":0")
}
