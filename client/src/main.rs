//! The `wheelarm` program: parses and wires; the library works.
//!
//! Exit codes: 0 ok, 1 failed, 3 finished with loss.

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use wheelarm_client::collect::{self, CollectArgs};
use wheelarm_client::control::{self, EpisodeCommand, ResetArgs};
use wheelarm_client::demo::{self, DemoArgs};
use wheelarm_client::link::{self, ConnectArgs, Link};
use wheelarm_client::operate::operator::Outcome;
use wheelarm_client::operate::run::{self as operate, OperateArgs};
use wheelarm_client::record::{self, RecordArgs};
use wheelarm_client::replay::{self, ReplayArgs};
use wheelarm_proto::keys::Query;

/// Clients of the WheelArm simulator.
#[derive(Parser)]
#[command(name = "wheelarm", version, about, allow_external_subcommands = true)]
struct Cli {
    #[command(flatten)]
    connect: ConnectArgs,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Shows what a server does.
    Status,
    /// Lists the tasks that a server knows.
    Tasks,
    /// Sets up a scenario: scene, task, seed.
    Reset(ResetArgs),
    /// Stops simulation time.
    Pause,
    /// Lets simulation time go on.
    Resume,
    /// Starts or ends an episode.
    #[command(subcommand)]
    Episode(EpisodeCommand),
    /// Records episodes, one HDF5 file each, until it is interrupted.
    Record(RecordArgs),
    /// Does a task with the scripted operator.
    Operate(OperateArgs),
    /// Records an episode with a server, a recorder and the operator of its own.
    Demo(DemoArgs),
    /// Makes a whole dataset from a plan, on this machine or as a part of many.
    Collect(CollectArgs),
    /// Does a recorded episode again, bit by bit, and can record it anew.
    Replay(ReplayArgs),
    /// Ends the server.
    Shutdown,
    /// Any other word X runs the program `wheelarm-X`.
    #[command(external_subcommand)]
    External(Vec<OsString>),
}

fn main() -> ExitCode {
    let filter = tracing_subscriber::EnvFilter::try_from_default_env()
        .unwrap_or_else(|_| tracing_subscriber::EnvFilter::new("warn,zenoh=error"));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .init();
    match run(Cli::parse()) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(cli: Cli) -> anyhow::Result<ExitCode> {
    let link = || Link::open(&cli.connect);
    match &cli.command {
        Command::Status => control::status(&link()?)?,
        Command::Tasks => control::tasks(&link()?)?,
        Command::Reset(args) => {
            let scenario = control::reset(&link()?, args)?;
            println!(
                "scene {}, task {}, seed {}: {:?}",
                scenario.scene, scenario.task, scenario.seed, scenario.instruction
            );
        }
        Command::Pause => control::acknowledge(&link()?, Query::Pause)?,
        Command::Resume => control::acknowledge(&link()?, Query::Resume)?,
        Command::Episode(command) => control::episode(&link()?, command)?,
        Command::Record(args) => return record_episodes(&cli.connect, args),
        Command::Demo(args) => return demo::run(args),
        Command::Collect(args) => return collect::run(args),
        Command::Replay(args) => return replay::run(args),
        Command::Operate(args) => return run_operator(&link()?, args),
        Command::Shutdown => control::acknowledge(&link()?, Query::Shutdown)?,
        Command::External(words) => return control::run_external(words),
    }
    Ok(ExitCode::SUCCESS)
}

fn record_episodes(connect: &ConnectArgs, args: &RecordArgs) -> anyhow::Result<ExitCode> {
    let runtime = tokio::runtime::Runtime::new()?;
    let interrupted = async {
        use tokio::signal::unix::{SignalKind, signal};
        match signal(SignalKind::terminate()) {
            Ok(mut terminate) => tokio::select! {
                _ = tokio::signal::ctrl_c() => {}
                _ = terminate.recv() => {}
            },
            Err(_) => {
                let _ = tokio::signal::ctrl_c().await;
            }
        }
    };
    let summary = if connect.sim == record::EVERY_SERVER {
        let session = link::open_session(connect)?;
        runtime.block_on(record::run_many(
            &session,
            &connect.connect,
            args,
            interrupted,
        ))?
    } else {
        let link = Link::open(connect)?;
        runtime.block_on(record::run(&link, args.clone(), interrupted))?
    };
    Ok(ExitCode::from(summary.exit_code()))
}

fn run_operator(link: &Link, args: &OperateArgs) -> anyhow::Result<ExitCode> {
    let mut phase = String::new();
    let report = operate::run(link, args, &mut |progress| {
        if progress.phase != phase {
            progress.phase.clone_into(&mut phase);
            println!("{:7.2} s  {phase}", progress.time);
        }
        for note in progress.notes {
            println!("{:7.2} s  {note}", progress.time);
        }
    })?;
    if let Outcome::Failure(why) = &report.outcome {
        println!("gave up: {why}");
    }
    print!("{}", control::evaluation_lines(&report.evaluation));
    Ok(if report.succeeded() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}
