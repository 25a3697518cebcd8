//! `wheelarm record`: the recorder with options and words.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context;
use clap::Args;
use wheelarm_proto::settings::Depth;
use wheelarm_proto::signals::Signals;
use wheelarm_recorder::{self as record, Output, RecordOptions, ServerEvent};
use wheelarm_sdk::{Client, Connect, Silence};

use wheelarm_options::choice::{self, named};

/// The server name that stands for every server.
const EVERY_SERVER: &str = "*";

/// Options of a recorder.
#[derive(Args, Clone, Debug)]
pub struct RecordArgs {
    /// Folder for the files; one per episode, named LABEL.h5, with
    /// `--sim '*'` below a folder per server.
    #[arg(long, default_value = "data", value_name = "DIR")]
    pub out: PathBuf,
    /// Folder for the log of an episode until its file is made, for `wheelarm collect`:
    /// it makes again what is lost there.
    #[arg(long, value_name = "DIR", hide = true)]
    pub scratch: Option<PathBuf>,
    /// Name of this recorder; several at one server need different ones.
    #[arg(long, default_value = "recorder", value_parser = choice::name)]
    pub name: String,
    /// How depth is stored: `f32` are metres, bit for bit as rendered; `u16` are
    /// millimetres at half the size, 0 where nothing was hit or the surface is
    /// farther than 65.535 m; `none` leaves it out.
    #[arg(long, value_parser = named::<Depth>(), default_value = "f32")]
    pub depth: Depth,
    /// Ends when standard input is closed: with the program that started it.
    #[arg(long, hide = true)]
    pub end_with_stdin: bool,
    /// Ends after this many episodes, of all servers with `--sim '*'`; runs
    /// until Ctrl-C without it.
    #[arg(long, value_name = "N")]
    pub episodes: Option<u64>,
}

/// Records until it is interrupted and prints a line per episode.
///
/// # Errors
/// When the server is not there, the folder cannot be made or the name is taken.
pub fn run(connect: &Connect, args: &RecordArgs) -> anyhow::Result<ExitCode> {
    let options = RecordOptions {
        out: args.out.clone(),
        scratch: args.scratch.clone(),
        name: args.name.clone(),
        depth: args.depth,
        end_with_stdin: args.end_with_stdin,
        episodes: args.episodes,
    };
    let runtime = tokio::runtime::Runtime::new()?;
    let waits = |server: &str| {
        println!(
            "recorder {:?} of {server}: each episode becomes a file in {}; waiting for the first \
             (`wheelarm episode start --label NAME`), Ctrl-C ends",
            args.name,
            args.out.display()
        );
    };
    let mut signals = Signals::listen(&runtime).context("cannot listen to signals")?;
    let interrupted = async move {
        signals.next().await;
    };
    let summary = if connect.sim == EVERY_SERVER {
        let session = wheelarm_sdk::open_session(connect, Silence::Still)?;
        let endpoint = &connect.endpoint;
        waits("every server");
        let all = record::run_many(
            &session,
            endpoint,
            &options,
            interrupted,
            print_server_event,
        );
        runtime.block_on(all)?
    } else {
        let link = Client::open_as(connect, Silence::Still)?;
        waits(&format!("the server {:?}", connect.sim));
        runtime.block_on(record::run(&link, options, interrupted, print))?
    };
    Ok(ExitCode::from(summary.exit_code()))
}

fn print_server_event(event: &ServerEvent<'_>) {
    match event {
        ServerEvent::Recording(sim) => println!("recording the server {sim:?}"),
        ServerEvent::Output(_, output) => print(output),
        ServerEvent::NotRecorded(sim, problem) => {
            eprintln!("the server {sim:?} is not recorded: {problem:#}")
        }
    }
}

/// Tells people what became of an episode.
fn print(output: &Output) {
    match output {
        Output::Finished(r) => {
            let state = if r.complete { "complete" } else { "PARTIAL" };
            let mb = r.bytes as f64 / 1e6;
            let missed = match r.counted {
                true => format!("{} missed", r.missed),
                false => format!("at least {} missed (how many is unknown)", r.missed),
            };
            println!(
                "{}: {state}, {} frames, {} samples, {missed}, {mb:.1} MB",
                r.path.display(),
                r.frames,
                r.samples
            );
            for line in r.problems.iter().chain(&r.notes) {
                println!("  {line}");
            }
        }
        Output::Failed(words) => eprintln!("recording failed: {words}"),
        Output::Discarded(label) => println!("{label}: discarded"),
        Output::RequestSnapshot
        | Output::RequestState
        | Output::RequestSamples { .. }
        | Output::SubscribeCameras { .. }
        | Output::Status(_)
        | Output::Finish(_) => {}
    }
}
