//! What the robot sees, as a local web page: `wheelarm preview`, and beside
//! `wheelarm teleop`. It is the page of `wheelarm drive` for who only looks: nobody
//! there may drive.

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

/// Where the page is served when nothing else is said.
pub const DEFAULT_ADDRESS: &str = "127.0.0.1:7450";

/// Options of `wheelarm preview`.
#[derive(Args, Clone, Debug)]
pub struct PreviewArgs {
    /// Address of the page; another port is taken when it is in use. Other machines
    /// are let in with --keys only, or through an SSH tunnel.
    #[arg(long, default_value = DEFAULT_ADDRESS, value_name = "ADDRESS:PORT")]
    pub page: SocketAddr,
    /// Folder of keys and users (`wheelarm keys init`): the page is encrypted, and
    /// lets in by password.
    #[arg(long, value_name = "FOLDER")]
    pub keys: Option<PathBuf>,
    /// Name by which browsers know this host; may be repeated.
    #[arg(long, value_name = "HOST", requires = "keys")]
    pub name: Vec<String>,
}

/// Serves the page until what is given back is dropped.
///
/// # Errors
/// When the page's address cannot be used.
pub fn open(runtime: &Runtime, connect: &Connect, args: &PreviewArgs) -> anyhow::Result<Gateway> {
    let options = Options {
        connect: connect.clone(),
        listen: args.page,
        commander: "viewer".to_owned(),
        audit: None,
        files: None,
        keys: args.keys.clone(),
        names: args.name.clone(),
        watch_only: true,
    };
    runtime.block_on(Gateway::open(&options))
}

/// Runs `wheelarm preview` until it is interrupted.
///
/// # Errors
/// When the page's address cannot be used.
pub fn run(connect: &Connect, args: &PreviewArgs) -> anyhow::Result<ExitCode> {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .context("starting the runtime")?;
    let gateway = open(&runtime, connect, args)?;
    // Who reads the first line and closes the pipe has the address.
    match announce(&gateway) {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => {}
        told => told.context("writing the page's address")?,
    }
    let mut signals = Signals::listen(&runtime).context("cannot listen to signals")?;
    runtime.block_on(signals.next());
    gateway.finish();
    Ok(ExitCode::SUCCESS)
}

/// Says where the page is, also from another machine.
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
