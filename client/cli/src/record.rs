//! `wheelarm record`: options and output of the recorder.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context;
use clap::Args;
use wheelarm_proto::settings::Depth;
use wheelarm_proto::signals::Signals;
use wheelarm_recorder::{self as record, Output, RecordOptions, ServerEvent};
use wheelarm_sdk::{Client, Connect, Silence};

use wheelarm_options::choice::{self, named};

/// Server name that matches every server.
const EVERY_SERVER: &str = "*";

/// Options of a recorder.
#[derive(Args, Clone, Debug)]
pub struct RecordArgs {
    /// Folder for the files; one per episode, named LABEL.h5, with
    /// `--sim '*'` below a folder per server.
    #[arg(long, default_value = "data", value_name = "DIR")]
    pub out: PathBuf,
    /// Folder for the log of an episode until its file is written. For `wheelarm collect`,
    /// which repeats an episode that is lost there.
    #[arg(long, value_name = "DIR", hide = true)]
    pub scratch: Option<PathBuf>,
    /// Name of this recorder, unique within one server.
    #[arg(long, default_value = "recorder", value_parser = choice::name)]
    pub name: String,
    /// Storage of depth: `f32` is metres, bit for bit as rendered; `u16` is millimetres
    /// at half the size, 0 without a surface or beyond 65.535 m; `none` omits depth.
    #[arg(long, value_parser = named::<Depth>(), default_value = "f32")]
    pub depth: Depth,
    /// Ends when standard input is closed, that is with the parent program.
    #[arg(long, hide = true)]
    pub end_with_stdin: bool,
    /// Ends after this many episodes (summed over servers with `--sim '*'`); runs until
    /// Ctrl-C when absent.
    #[arg(long, value_name = "N")]
    pub episodes: Option<u64>,
}

/// Records until it is interrupted and prints a line per episode.
///
/// # Errors
/// When no server replies, the folder cannot be created or the name is in use.
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
    let announce = |server: &str| {
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
        announce("every server");
        let all = record::run_many(
            &session,
            endpoint,
            &options,
            interrupted,
            print_server_event,
        );
        runtime.block_on(all)?
    } else {
        let client = Client::open_as(connect, Silence::Still)?;
        announce(&format!("the server {:?}", connect.sim));
        runtime.block_on(record::run(&client, options, interrupted, print))?
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

/// Prints the result of an episode.
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
        Output::Failed(reason) => eprintln!("recording failed: {reason}"),
        Output::Discarded(label) => println!("{label}: discarded"),
        Output::RequestSnapshot
        | Output::RequestState
        | Output::RequestSamples { .. }
        | Output::SubscribeCameras { .. }
        | Output::Status(_)
        | Output::Finish(_) => {}
    }
}
