//! The robot's cameras as a local web page: `wheelarm preview`, also started by
//! `wheelarm teleop`. It is the page of `wheelarm drive` for viewers: no user may drive
//! from it.

use std::io::{ErrorKind, Write};
use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context;
use clap::Args;
use tokio::runtime::Runtime;
use wheelarm_proto::signals::Signals;
use wheelarm_sdk::Connect;

use crate::{Gateway, Options};

/// Default address of the page.
pub const DEFAULT_ADDRESS: &str = "127.0.0.1:7450";

/// Options of `wheelarm preview`.
#[derive(Args, Clone, Debug)]
pub struct PreviewArgs {
    /// Address of the page; another port is used when it is taken. Other machines
    /// need --keys, or an SSH tunnel.
    #[arg(long, default_value = DEFAULT_ADDRESS, value_name = "ADDRESS:PORT")]
    pub page: SocketAddr,
    /// Folder of keys and users (`wheelarm keys init`): enables TLS and password
    /// login.
    #[arg(long, value_name = "DIR")]
    pub keys: Option<PathBuf>,
    /// Host name by which browsers reach this host; may be repeated.
    #[arg(long, alias = "name", value_name = "NAME", requires = "keys")]
    pub host: Vec<String>,
}

/// Serves the page until the returned gateway is dropped.
///
/// # Errors
/// When the page's address cannot be bound.
pub fn open(runtime: &Runtime, connect: &Connect, args: &PreviewArgs) -> anyhow::Result<Gateway> {
    let options = Options {
        connect: connect.clone(),
        listen: args.page,
        commander: "viewer".to_owned(),
        audit: None,
        files: None,
        recordings: None,
        keys: args.keys.clone(),
        names: args.host.clone(),
        watch_only: true,
    };
    runtime.block_on(Gateway::open(&options))
}

/// Runs `wheelarm preview` until it is interrupted.
///
/// # Errors
/// When the page's address cannot be bound.
pub fn run(connect: &Connect, args: &PreviewArgs) -> anyhow::Result<ExitCode> {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .context("starting the runtime")?;
    let gateway = open(&runtime, connect, args)?;
    // A reader that closes the pipe after the first line has the address.
    match announce(&gateway) {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => {}
        result => result.context("writing the page's address")?,
    }
    let mut signals = Signals::listen(&runtime).context("cannot listen to signals")?;
    runtime.block_on(signals.next());
    gateway.finish();
    Ok(ExitCode::SUCCESS)
}

/// Prints the URL of the page, also for another machine.
fn announce(gateway: &Gateway) -> std::io::Result<()> {
    let port = gateway.address().port();
    let mut out = std::io::stdout().lock();
    writeln!(out, "page {}", gateway.watch_url())?;
    if gateway.address().ip().is_loopback() {
        writeln!(
            out,
            "on another machine: ssh -N -L {port}:127.0.0.1:{port} HOST, then the same address"
        )?;
    }
    out.flush()
}
