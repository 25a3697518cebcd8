//! `wheelarm-worker`: server, recorder and scripted expert in one process.
//!
//! `wheelarm-rollout` starts it and sends it requests (`wheelarm_rollout::protocol`), one
//! for each episode. All episodes share one session that reaches no other process, so an
//! image goes from the renderer into the log without a copy; the graphics device stays from
//! one episode to the next. Each episode has a new service and recorder, as in a
//! separate process. This is the only package that names both server and clients.

mod episode;
mod room;
mod serving;
mod stdout_protocol;

use std::collections::BTreeMap;
use std::io::BufRead;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;

use anyhow::{Context, bail};
use clap::{CommandFactory, Parser};
use parking_lot::Mutex;
use wheelarm_pack::Store as PackStore;
use wheelarm_proto::cache::Store;
use wheelarm_proto::installed;
use wheelarm_proto::program::{error_chain, version};
use wheelarm_rollout::protocol::{Reply, Request};
use wheelarm_server::environment;
use wheelarm_server::sensors::camera::Graphics;
use wheelarm_server::service;

use room::{Room, Stop};
use stdout_protocol::Output;

/// Makes episodes of a campaign in one process. Started by `wheelarm collect`, `wheelarm
/// evaluate` and `wheelarm multiply`, which send it requests by its standard input.
#[derive(Parser, Debug)]
#[command(name = "wheelarm-worker", version = version())]
struct Args {
    /// Assets folder; found beside the program when absent.
    #[arg(long, env = "WHEELARM_ASSETS")]
    assets: Option<PathBuf>,
    /// Folder of world packs; may be repeated.
    #[arg(
        long,
        value_name = "DIR",
        env = installed::PACKS_VARIABLE,
        value_delimiter = ':'
    )]
    packs: Vec<PathBuf>,
    /// Graphics adapter by its index, its PCI id or a part of its name
    /// (`wheelarm-server --list-adapters`) [default: the strongest].
    #[arg(long, value_name = "INDEX|PCI-ID|NAME")]
    adapter: Option<String>,
    /// Folder of results, for users who list processes.
    #[arg(long = "for", value_name = "DIR")]
    _folder: Option<PathBuf>,
    /// Prints the man page and ends, for packages.
    #[arg(long, hide = true)]
    man: bool,
}

fn main() -> ExitCode {
    let args = Args::parse();
    environment::complete();
    let done = match args.man {
        true => clap_mangen::Man::new(Args::command())
            .render(&mut std::io::stdout())
            .context("printing the man page"),
        false => work(args),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {}", error_chain(error.as_ref()));
            ExitCode::FAILURE
        }
    }
}

fn assets(named: Option<PathBuf>) -> anyhow::Result<PathBuf> {
    if let Some(named) = named {
        if !named.join("scenes").is_dir() {
            bail!(
                "{} has no folder `scenes`; name the assets folder of WheelArm",
                named.display()
            );
        }
        return Ok(named);
    }
    installed::assets()
        .context("no assets folder found; name it with --assets DIR or WHEELARM_ASSETS")
}

/// Runs requests until the standard input ends: then the sender is gone, and would make
/// the running episodes again.
fn work(args: Args) -> anyhow::Result<()> {
    wheelarm_proto::log::start("warn,zenoh=error", false, std::io::stderr);
    let assets = assets(args.assets)?;
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(1)
        .enable_all()
        .build()
        .context("the runtime cannot start")?;
    let room = Arc::new(Room {
        session: service::session::within()?,
        packs: PackStore::search(&args.packs, &assets),
        assets,
        graphics: Graphics::for_adapter(args.adapter.as_deref()).caching(Store::open()),
        runtime: runtime.handle().clone(),
    });
    let output = Output::default();
    output.write(&Reply::Ready);
    let stops: Arc<Mutex<BTreeMap<u64, Stop>>> = Arc::default();
    for line in std::io::stdin().lock().lines() {
        let line = line.context("reading requests")?;
        match serde_json::from_str(&line).context("a request cannot be read")? {
            Request::Run(request) => {
                let (number, stop) = (request.number, Stop::default());
                stops.lock().insert(number, stop.clone());
                let (room, stops) = (Arc::clone(&room), stops.clone());
                let output = output.for_episode(number);
                let thread = std::thread::Builder::new().name("episode".to_owned());
                thread
                    .spawn(move || {
                        episode::make(&room, &request, &stop, &output);
                        stops.lock().remove(&number);
                    })
                    .context("starting the thread of an episode")?;
            }
            Request::Cancel { number } => {
                if let Some(stop) = stops.lock().get(&number) {
                    stop.request();
                }
            }
        }
    }
    // Threads of episodes and of drivers are not waited for.
    std::process::exit(0)
}
