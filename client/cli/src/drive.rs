//! `wheelarm drive`: serves the web page from which an operator drives.

use std::io::{ErrorKind, Write};
use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context;
use clap::Args;
use wheelarm_proto::signals::Signals;
use wheelarm_proto::{defaults, v1};
use wheelarm_rollout::launcher::{Lifetime, Record, Recorder, Server, ServerOptions};
use wheelarm_sdk::Connect;
use wheelarm_teleop_web::{Gateway, Options};

use crate::control::refuse_closed;
use wheelarm_options::choice;
use wheelarm_options::packs::PackArgs;

/// Default address of the page.
const PAGE: &str = "127.0.0.1:7460";

/// Options of `wheelarm drive`.
#[derive(Args, Clone, Debug)]
pub struct DriveArgs {
    /// Address of the page; the next free port when it is in use. Other hosts connect
    /// only with --keys, or through an SSH tunnel.
    #[arg(long, default_value = PAGE, value_name = "ADDRESS:PORT")]
    pub page: SocketAddr,
    /// Commander name, visible to other users.
    #[arg(long, default_value_t = choice::own_name("drive"), value_parser = choice::name, value_name = "NAME")]
    pub commander: String,
    /// Starts a server with this task, which ends with the page, instead of connecting
    /// to a running one.
    #[arg(long, value_name = "TASK")]
    pub task: Option<String>,
    /// Scene of that server: one of the assets, or the home of a world pack.
    #[arg(long, default_value = defaults::SCENE, requires = "task")]
    pub scene: String,
    /// World packs of that server.
    #[command(flatten)]
    pub packs: PackArgs,
    /// Seed of that server's scenario.
    #[arg(long, default_value_t = 0, requires = "task")]
    pub seed: u64,
    /// Records that server's episodes into this folder.
    #[arg(long, value_name = "DIR", requires = "task")]
    pub out: Option<PathBuf>,
    /// Camera of that server, NAME=WIDTHxHEIGHT@HZ, or WIDTHxHEIGHT@HZ for every camera of the
    /// robot. May be repeated.
    #[arg(long, alias = "pictures", default_value = "640x360@10", requires = "task", value_name = "CAMERA", value_parser = choice::camera)]
    pub camera: Vec<v1::CameraSetting>,
    /// Folder of keys and users (`wheelarm keys init`): the page is encrypted and requires
    /// a password; the commander name is the user's.
    #[arg(long, value_name = "DIR")]
    pub keys: Option<PathBuf>,
    /// Host name that browsers use for this host; may be repeated.
    #[arg(long, alias = "name", value_name = "NAME", requires = "keys")]
    pub host: Vec<String>,
    /// Writes an audit log into this file: user, action and time, one JSON object per line.
    #[arg(long, value_name = "FILE")]
    pub audit: Option<PathBuf>,
    /// Serves the page's files from this folder, for their development.
    #[arg(long, value_name = "DIR", hide = true)]
    pub files: Option<PathBuf>,
}

/// Runs `wheelarm drive` until it is interrupted.
///
/// # Errors
/// When no server replies, or the page's address cannot be used.
pub fn run(connect: &Connect, args: &DriveArgs) -> anyhow::Result<ExitCode> {
    let own_server = match &args.task {
        Some(task) => Some(OwnServer::start(task, args)?),
        None => {
            refuse_closed(&connect.endpoint)?;
            None
        }
    };
    let connect = own_server
        .as_ref()
        .map_or(connect, |own_server| own_server.server.connect());
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .context("starting the runtime")?;
    let options = Options {
        connect: connect.clone(),
        listen: args.page,
        commander: args.commander.clone(),
        audit: args.audit.clone(),
        files: args.files.clone(),
        recordings: args.out.clone(),
        keys: args.keys.clone(),
        names: args.host.clone(),
        watch_only: false,
    };
    let gateway = runtime.block_on(Gateway::open(&options))?;
    // A reader may close the pipe after the first line.
    match announce(&gateway) {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => {}
        written => written.context("writing the page's address")?,
    }
    let mut signals = Signals::listen(&runtime).context("cannot listen to signals")?;
    runtime.block_on(signals.next());
    gateway.finish();
    if let Some(own_server) = own_server {
        own_server.finish()?;
    }
    Ok(ExitCode::SUCCESS)
}

fn announce(gateway: &Gateway) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "drive {}", gateway.drive_url())?;
    writeln!(out, "watch {}", gateway.watch_url())?;
    out.flush()
}

/// A server and a recorder that this command starts.
struct OwnServer {
    server: Server,
    recorder: Option<Recorder>,
}

impl OwnServer {
    fn start(task: &str, args: &DriveArgs) -> anyhow::Result<Self> {
        eprintln!(
            "starting a server: scene {}, task {task}, seed {}",
            args.scene, args.seed
        );
        let server = Server::start(&ServerOptions {
            scenario: v1::Scenario {
                scene: args.scene.clone(),
                task: Some(task.to_owned()),
                seed: Some(args.seed),
                cameras: args.camera.clone(),
                pacing: v1::Pacing::RealTime.into(),
                ..v1::Scenario::default()
            },
            packs: args.packs.packs.clone(),
            ..ServerOptions::default()
        })?;
        let recorder = args
            .out
            .as_deref()
            .map(|out| {
                choice::make_folder(out)?;
                let record = Record::new("drive", out);
                Recorder::start(server.connect(), &record, Lifetime::Lasting)
            })
            .transpose()?;
        Ok(Self { server, recorder })
    }

    fn finish(self) -> anyhow::Result<()> {
        let client = self.server.client()?;
        // The end of the server ends a running episode, and the recorder finishes its file.
        self.server.stop(client)?;
        drop(self.recorder);
        Ok(())
    }
}
