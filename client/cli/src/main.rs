//! The `wheelarm` program: parses and wires; the library works.
//!
//! Exit codes: 0 ok, 1 failed, 2 wrong command line, 3 finished with loss.

use std::ffi::OsString;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context;
use clap::error::ErrorKind;
use clap::parser::ValueSource;
use clap::{ArgMatches, CommandFactory, FromArgMatches, Parser, Subcommand};
use clap_complete::Shell;
use wheelarm_access::About;
#[cfg(feature = "hdf5")]
use wheelarm_campaign::collect::{self, CollectArgs};
#[cfg(feature = "hdf5")]
use wheelarm_campaign::evaluate::{self, EvaluateArgs};
#[cfg(feature = "hdf5")]
use wheelarm_campaign::multiply::{self, MultiplyArgs};
#[cfg(feature = "hdf5")]
use wheelarm_campaign::replay::{self, ReplayArgs};
use wheelarm_cli::accounts::{self, KeysCommand, RouterArgs, UsersCommand};
use wheelarm_cli::control::{self, EpisodeCommand, LeaseCommand, ResetArgs, ShutdownArgs, manual};
#[cfg(feature = "hdf5")]
use wheelarm_cli::demo::{self, DemoArgs};
use wheelarm_cli::doctor::{self, DoctorArgs};
use wheelarm_cli::drive::{self, DriveArgs};
use wheelarm_cli::operate::{self, OperateArgs};
#[cfg(feature = "hdf5")]
use wheelarm_cli::record::{self, RecordArgs};
use wheelarm_cli::watch::{self, WatchArgs};
use wheelarm_options::connect::ConnectArgs;
use wheelarm_proto::log;
use wheelarm_proto::output::end_with_output;
use wheelarm_proto::program::{error_chain, version};
use wheelarm_proto::restart::{self, SENDING_THREADS, TRANSPORT_THREADS};
use wheelarm_proto::signals::end_as_first_process;
use wheelarm_sdk::Connect;
#[cfg(feature = "terminal")]
use wheelarm_teleop_terminal::{self as teleop, TeleopArgs};
use wheelarm_teleop_web::preview::{self, PreviewArgs};

/// Clients of the WheelArm simulator: operate, record, replay, watch.
///
/// Every command speaks to one server, which listens on 127.0.0.1 unless it was
/// given keys; then --connect tls/HOST:7447 --keys DIR reaches it from anywhere.
/// Without keys bring its port near through SSH.
#[derive(Parser)]
#[command(
    name = "wheelarm",
    version = version(),
    about,
    allow_external_subcommands = true,
    after_long_help = manual::WHEELARM
)]
struct Cli {
    #[command(flatten)]
    connect: ConnectArgs,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Shows what a server does.
    ///
    /// Scenario, pacing, episode, who holds control, recorders, refused
    /// commands and every condition of the task.
    #[command(after_long_help = manual::STATUS)]
    Status,
    /// Lists the tasks.
    ///
    /// With goal, instruction sentences and conditions of success: those that a
    /// running server knows, else those of the program wheelarm-server.
    #[command(after_long_help = manual::TASKS)]
    Tasks,
    /// Sets up a scenario: scene, task, seed.
    ///
    /// What is not named stays as it is; places are drawn anew from the seed.
    /// Refused while an episode runs or somebody else is in control.
    #[command(after_long_help = manual::RESET)]
    Reset(ResetArgs),
    /// Stops simulation time.
    #[command(after_long_help = manual::PAUSE)]
    Pause,
    /// Lets simulation time go on.
    #[command(after_long_help = manual::PAUSE)]
    Resume,
    /// Holds control of a server by hand.
    ///
    /// In lock-step time waits for whoever is in control: while this runs it
    /// answers every tick, so that an episode can be started and ended by hand.
    #[command(subcommand, after_long_help = manual::LEASE)]
    Lease(LeaseCommand),
    /// Starts or ends an episode.
    ///
    /// Recorders that are connected open a file at the start and finish it at
    /// the end; with --require-recorders time waits until they are ready.
    #[command(subcommand, after_long_help = manual::EPISODE)]
    Episode(EpisodeCommand),
    /// Records episodes, one HDF5 file each, until it is interrupted.
    ///
    /// Everything goes into a log first: what was acknowledged survives a kill
    /// or a power cut, and `wheelarm dataset recover` makes a file of it.
    #[cfg(feature = "hdf5")]
    #[command(after_long_help = manual::RECORD)]
    Record(RecordArgs),
    /// Does a task with the scripted operator.
    ///
    /// It drives, grasps and lifts by the same commands as a person, as one
    /// episode of its own or within the running one.
    #[command(after_long_help = manual::OPERATE)]
    Operate(OperateArgs),
    /// Drive chair, arm and gripper by keys.
    ///
    /// A terminal program, also over SSH and in tmux. It shows task, episode,
    /// recorders and link, starts and ends episodes, and serves the cameras as
    /// a local web page whose address it shows. When the terminal dies the
    /// chair brakes, the arm holds and control is given back.
    #[cfg(feature = "terminal")]
    #[command(after_long_help = manual::TELEOP)]
    Teleop(TeleopArgs),
    /// Drive chair, arm and gripper from a browser.
    ///
    /// Serves a page on this host: cameras, keys, mouse, touch, gamepad, one switch,
    /// voice, headset. It prints two links, one to drive and one to watch. When a
    /// page, a browser or a link dies the chair brakes and the arm holds.
    #[command(after_long_help = manual::DRIVE)]
    Drive(DriveArgs),
    /// Serves what the cameras see as a local web page.
    ///
    /// It shows pictures and state and never commands. Pictures are compressed
    /// by the server only while a page is open, at a size and rate that the
    /// link carries.
    #[command(after_long_help = manual::PREVIEW)]
    Preview(PreviewArgs),
    /// Measures every stream: rate, jitter, delay, gaps, bytes.
    ///
    /// With episode, recorders and task. `delay+` is the delay over the
    /// quickest sample of the last seconds: its growth shows a full link.
    #[command(after_long_help = manual::WATCH)]
    Watch(WatchArgs),
    /// Looks for what is missing or wrong, and names the cure.
    ///
    /// Driver, programs, versions, HDF5, disk and terminal of this machine;
    /// port, version, round trip and clock of the server. It changes nothing.
    #[command(after_long_help = manual::DOCTOR)]
    Doctor(DoctorArgs),
    /// Makes the keys by which users and servers know each other.
    ///
    /// On the host of the server: an authority of your own, the server's
    /// certificate, and a folder for each user to take along (--keys DIR).
    #[command(subcommand, after_long_help = manual::KEYS)]
    Keys(KeysCommand),
    /// Says who may connect, and what each may do.
    ///
    /// Adds, removes and lists the users of a folder of keys (--keys DIR), and
    /// sets their passwords for the web page.
    #[command(subcommand, after_long_help = manual::USERS)]
    Users(UsersCommand),
    /// Stands between servers and clients elsewhere, by the rules of a folder of keys.
    ///
    /// A Zenoh router: servers that are given the same keys connect to it
    /// (`wheelarm-server --connect`), and users reach all of them there, each by its
    /// role (--keys DIR).
    #[command(after_long_help = manual::ROUTER)]
    Router(RouterArgs),
    /// Records an episode with a server, a recorder and the operator of its own.
    #[cfg(feature = "hdf5")]
    #[command(after_long_help = manual::DEMO)]
    Demo(DemoArgs),
    /// Does tasks over many seeds and counts the successes.
    #[cfg(feature = "hdf5")]
    #[command(after_long_help = manual::EVALUATE)]
    Evaluate(Box<EvaluateArgs>),
    /// Makes a whole dataset from a plan, on this machine or as a part of many.
    #[cfg(feature = "hdf5")]
    #[command(after_long_help = manual::COLLECT)]
    Collect(CollectArgs),
    /// Makes many episodes of a few, by adapting what the hand did to other scenes.
    ///
    /// Of each recorded episode of the task in DIR that succeeded, whoever did it, the
    /// last of the reach, the grasp, the lift and the putting down are kept relative to
    /// the thing; the way there is planned anew. Episodes that succeed are recorded
    /// without cameras: `replay --camera` draws them.
    #[cfg(feature = "hdf5")]
    #[command(after_long_help = manual::MULTIPLY)]
    Multiply(MultiplyArgs),
    /// Replays a recorded episode bit for bit, and can record it anew.
    #[cfg(feature = "hdf5")]
    #[command(after_long_help = manual::REPLAY)]
    Replay(ReplayArgs),
    /// Ends the server.
    ///
    /// Refused while somebody else is in control.
    #[command(after_long_help = manual::SHUTDOWN)]
    Shutdown(ShutdownArgs),
    /// Prints completions for a shell.
    #[command(after_long_help = manual::COMPLETIONS)]
    Completions {
        /// The shell.
        shell: Shell,
    },
    /// Writes man pages, one per command.
    #[command(after_long_help = manual::MAN)]
    Man {
        /// Folder for the pages, for example ~/.local/share/man/man1.
        dir: PathBuf,
    },
    /// Reads, checks, aligns, labels and exports episode files.
    ///
    /// Runs the program `wheelarm-dataset`; `wheelarm dataset --help` tells its commands.
    #[command(disable_help_flag = true)]
    Dataset {
        /// What `wheelarm-dataset` is told.
        #[arg(
            trailing_var_arg = true,
            allow_hyphen_values = true,
            value_name = "WORDS"
        )]
        words: Vec<OsString>,
    },
    /// Any other word X runs the program `wheelarm-X`.
    #[command(external_subcommand)]
    External(Vec<OsString>),
}

impl Command {
    /// Whether it needs no server.
    fn works_on_files(&self) -> bool {
        matches!(
            self,
            Self::Keys(_)
                | Self::Users(_)
                | Self::Router(_)
                | Self::Completions { .. }
                | Self::Man { .. }
                | Self::Dataset { .. }
                | Self::External(_)
        )
    }

    /// Whether it draws on the whole terminal.
    fn has_the_screen(&self) -> bool {
        #[cfg(feature = "terminal")]
        return matches!(self, Self::Teleop(_));
        #[cfg(not(feature = "terminal"))]
        false
    }
}

fn main() -> ExitCode {
    end_with_output();
    end_as_first_process();
    let matches = Cli::command().get_matches();
    refuse_without_effect(&matches);
    let mut cli = Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    let filter = "warn,zenoh=error";
    let ansi = std::io::stderr().is_terminal();
    if cli.command.has_the_screen() && std::env::var_os("RUST_LOG").is_none() {
        // They would be written over its screen.
        log::start(filter, ansi, std::io::sink);
    } else {
        log::start(filter, ansi, std::io::stderr);
    }
    let connect = match cli.connect.connect() {
        Ok(connect) => connect,
        // These need no server.
        Err(_) if cli.command.works_on_files() => Connect::from(&cli.connect),
        Err(error) => {
            eprintln!("error: {}", error_chain(error.as_ref()));
            return ExitCode::FAILURE;
        }
    };
    if matches!(cli.command, Command::Router(_)) {
        restart::with_variables([(TRANSPORT_THREADS, SENDING_THREADS.into())]);
    }
    name_by_keys(&mut cli, &connect, &matches);
    match run(cli, connect) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {}", error_chain(error.as_ref()));
            ExitCode::FAILURE
        }
    }
}

/// Who commands or records does so under the name of its keys, unless it is told
/// another: with keys a server takes no other.
fn name_by_keys(cli: &mut Cli, connect: &Connect, matches: &ArgMatches) {
    let Some(identity) = &connect.identity else {
        return;
    };
    let about = About::beside(identity.folder()).map(|about| about.user);
    let Some(user) = about.or_else(|| cli.connect.user.clone()) else {
        return;
    };
    let mut named = matches;
    while let Some((_, inner)) = named.subcommand() {
        named = inner;
    }
    let is_told = |id: &str| named.value_source(id) == Some(ValueSource::CommandLine);
    match &mut cli.command {
        Command::Operate(args) if !is_told("commander") => args.commander = user,
        Command::Lease(LeaseCommand::Hold(args)) if !is_told("name") => args.name = user,
        #[cfg(feature = "terminal")]
        Command::Teleop(args) if !is_told("commander") => args.commander = user,
        #[cfg(feature = "hdf5")]
        Command::Record(args) if !is_told("name") => args.name = user,
        _ => {}
    }
}

/// Refuses the options that say which server, where a command starts its own.
fn refuse_without_effect(matches: &ArgMatches) {
    let own = ["demo", "evaluate", "collect", "multiply", "replay"];
    let Some((command, _)) = matches.subcommand().filter(|(name, _)| own.contains(name)) else {
        return;
    };
    for (id, option) in [
        ("connect", "--connect"),
        ("sim", "--sim"),
        ("connect_timeout", "--connect-timeout"),
    ] {
        if matches.value_source(id) == Some(ValueSource::CommandLine) {
            let words =
                format!("`wheelarm {command}` starts servers of its own: leave {option} out\n");
            Cli::command()
                .error(ErrorKind::ArgumentConflict, words)
                .exit();
        }
    }
}

fn run(cli: Cli, connect: Connect) -> anyhow::Result<ExitCode> {
    let keys = cli.connect.keys.as_ref();
    let link = || control::link(&connect);
    match &cli.command {
        Command::Status => control::status(&connect)?,
        Command::Tasks => control::tasks(&connect)?,
        Command::Reset(args) => {
            let scenario = control::reset(&link()?, args)?;
            println!(
                "scene {}, task {}, seed {}: {:?}",
                scenario.scene,
                scenario.task(),
                scenario.seed(),
                scenario.instruction()
            );
        }
        Command::Pause => control::pause(&link()?, true)?,
        Command::Resume => control::pause(&link()?, false)?,
        Command::Lease(command) => return control::lease(&link()?, command),
        Command::Episode(command) => return control::episode(&link()?, command),
        #[cfg(feature = "hdf5")]
        Command::Record(args) => return record::run(&connect, args),
        #[cfg(feature = "hdf5")]
        Command::Demo(args) => return demo::run(args),
        #[cfg(feature = "hdf5")]
        Command::Evaluate(args) => return evaluate::run(args.as_ref()),
        #[cfg(feature = "hdf5")]
        Command::Collect(args) => return collect::run(args),
        #[cfg(feature = "hdf5")]
        Command::Multiply(args) => return multiply::run(args),
        #[cfg(feature = "hdf5")]
        Command::Replay(args) => return replay::run(args),
        Command::Operate(args) => return operate::run(&link()?, args),
        #[cfg(feature = "terminal")]
        Command::Teleop(args) => {
            control::refuse_closed(&connect.endpoint)?;
            return teleop::run(&connect, args);
        }
        Command::Drive(args) => return drive::run(&connect, args),
        Command::Preview(args) => {
            control::refuse_closed(&connect.endpoint)?;
            return preview::run(&connect, args);
        }
        Command::Watch(args) => return watch::run(&link()?, args),
        Command::Doctor(args) => return doctor::run(&connect, args),
        Command::Shutdown(args) => link()?.shutdown(args.force)?,
        Command::Keys(command) => accounts::keys(keys, command)?,
        Command::Users(command) => accounts::users(keys, command)?,
        Command::Router(args) => accounts::route(keys, args)?,
        Command::Completions { shell } => {
            let mut command = Cli::command();
            let mut script = Vec::new();
            clap_complete::generate(*shell, &mut command, "wheelarm", &mut script);
            print!("{}", String::from_utf8_lossy(&script));
        }
        Command::Man { dir } => write_manual(dir)?,
        Command::Dataset { words } => {
            let name = std::iter::once(OsString::from("dataset"));
            let words: Vec<OsString> = name.chain(words.iter().cloned()).collect();
            return control::run_external(&words, subcommands());
        }
        Command::External(words) => return control::run_external(words, subcommands()),
    }
    Ok(ExitCode::SUCCESS)
}

/// Names of the commands that are built in.
fn subcommands() -> Vec<String> {
    let cli = Cli::command();
    let shown = cli
        .get_subcommands()
        .filter(|command| !command.is_hide_set());
    shown.map(|command| command.get_name().to_owned()).collect()
}

fn write_manual(folder: &Path) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder)
        .and_then(|()| clap_mangen::generate_to(Cli::command(), folder))
        .with_context(|| format!("writing man pages into {}", folder.display()))
}
