//! The `wheelarm` program: parses the command line and calls the libraries.
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
use wheelarm_cli::cache::{self, CacheArgs};
use wheelarm_cli::control::{
    self, EpisodeCommand, LeaseCommand, ResetArgs, SERVER, ShutdownArgs, manual,
};
#[cfg(feature = "hdf5")]
use wheelarm_cli::demo::{self, DemoArgs};
use wheelarm_cli::doctor::{self, DoctorArgs};
use wheelarm_cli::drive::{self, DriveArgs};
use wheelarm_cli::help;
use wheelarm_cli::home::{self, HomeCommand};
use wheelarm_cli::map::{self, MapArgs};
use wheelarm_cli::new::{self, NewArgs};
use wheelarm_cli::object::{self, ObjectCommand};
use wheelarm_cli::operate::{self, OperateArgs};
#[cfg(feature = "hdf5")]
use wheelarm_cli::record::{self, RecordArgs};
use wheelarm_cli::watch::{self, WatchArgs};
use wheelarm_cli::world_pack::{self, PackCommand};
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

/// Simulation of a wheelchair with an arm: drive, record, make data, evaluate.
///
/// Commands for a running server connect to one server, which listens on 127.0.0.1 unless it has keys.
/// With keys, --connect tls/HOST:7447 --keys DIR reaches it from other hosts. Without
/// keys, forward its port through SSH.
#[derive(Parser)]
#[command(
    name = "wheelarm",
    version = version(),
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
    /// Prints the status of a server.
    ///
    /// Scenario, pacing, episode, holder of control, recorders, refused commands and every
    /// condition of the task.
    #[command(after_long_help = manual::STATUS)]
    Status,
    /// Lists the tasks.
    ///
    /// With goal, instructions and conditions of success: of the running server, otherwise
    /// of the program wheelarm-server.
    #[command(after_long_help = manual::TASKS)]
    Tasks,
    /// Writes the map of the home for Nav2.
    ///
    /// Occupied floor and where this chair gets to, in cells of 5 cm, with rooms and
    /// the clear width of doors.
    #[command(after_long_help = manual::MAP)]
    Map(MapArgs),
    /// Sets up a scenario: scene, task, seed.
    ///
    /// Settings without an option keep their values; poses are sampled from the seed.
    /// Refused while an episode runs or another client is in control.
    #[command(after_long_help = manual::RESET)]
    Reset(ResetArgs),
    /// Pauses simulation time.
    #[command(after_long_help = manual::PAUSE)]
    Pause,
    /// Resumes simulation time.
    #[command(after_long_help = manual::PAUSE)]
    Resume,
    /// Holds control of a server by hand.
    ///
    /// In lock-step, time waits for the commander in control. This command replies to
    /// every tick, so that an episode can be started and ended by hand.
    #[command(subcommand, after_long_help = manual::LEASE)]
    Lease(LeaseCommand),
    /// Starts or ends an episode.
    ///
    /// Connected recorders open a file at the start and finish it at the end. With
    /// --require-recorders, time waits until they are ready.
    #[command(subcommand, after_long_help = manual::EPISODE)]
    Episode(EpisodeCommand),
    /// Records episodes, one HDF5 file each, until it is interrupted.
    ///
    /// Samples are written to a log first: acknowledged samples survive a kill or a power
    /// cut, and `wheelarm dataset recover` converts the log to a file.
    #[cfg(feature = "hdf5")]
    #[command(after_long_help = manual::RECORD)]
    Record(RecordArgs),
    /// Does a task with the scripted operator.
    ///
    /// It drives, grasps and lifts with the same commands as a person, in a new episode or
    /// within the running one.
    #[command(after_long_help = manual::OPERATE)]
    Operate(OperateArgs),
    /// Drives chair, arm and gripper from the keyboard.
    ///
    /// A terminal program that also works over SSH and in tmux. It shows task, episode,
    /// recorders and connection, starts and ends episodes, and serves the cameras as a
    /// local web page. When the terminal closes, the chair brakes, the arm holds and
    /// control is released.
    #[cfg(feature = "terminal")]
    #[command(after_long_help = manual::TELEOP)]
    Teleop(TeleopArgs),
    /// Drives chair, arm and gripper from a browser.
    ///
    /// Serves a page on this host: cameras, keys, mouse, touch, gamepad, one switch,
    /// voice, headset. It prints two addresses, one to drive and one to watch. When a
    /// page, a browser or a connection is lost, the chair brakes and the arm holds.
    #[command(after_long_help = manual::DRIVE)]
    Drive(DriveArgs),
    /// Serves the camera images as a local web page.
    ///
    /// It shows images and state and never commands. The server compresses images only
    /// while a page is open, at a size and rate that the connection carries.
    #[command(after_long_help = manual::PREVIEW)]
    Preview(PreviewArgs),
    /// Measures every stream: rate, jitter, delay, gaps, bytes.
    ///
    /// Also prints episode, recorders and task. `delay+` is the delay in excess of the
    /// fastest sample of the last seconds: it grows when the connection is saturated.
    #[command(after_long_help = manual::WATCH)]
    Watch(WatchArgs),
    /// Checks this host and the server, and prints the fix of each problem.
    ///
    /// Driver, programs, versions, HDF5, disk and terminal of this host; port, version,
    /// round trip and clock of the server. It changes nothing.
    #[command(after_long_help = manual::DOCTOR)]
    Doctor(DoctorArgs),
    /// Shows or clears the cache of this user.
    ///
    /// Decoded textures and the light of homes, which servers and workers would compute
    /// again at every start. WHEELARM_CACHE names another folder, or `off`.
    #[command(after_long_help = manual::CACHE)]
    Cache(CacheArgs),
    /// Makes, imports, lists and reports homes.
    ///
    /// Homes come from plans by seed, or from drawings of Sweet Home 3D.
    /// An import writes a world pack: walls, rooms, furniture with collision shapes, doors
    /// and drawers on joints, a start for the chair. Servers find it with --packs.
    #[command(subcommand, after_long_help = manual::HOME)]
    Home(HomeCommand),
    /// Imports meshes as objects, and checks that the scripted operator lifts them.
    ///
    /// An import writes collision shapes, mass and grasps beside the mesh. Tasks place the
    /// objects of a pack with --objects PACK.
    #[command(subcommand, after_long_help = manual::OBJECT)]
    Object(ObjectCommand),
    /// Checks, lists, sends and extracts world packs: homes and objects.
    ///
    /// A server finds packs in its folders (--packs, WHEELARM_PACKS); the name of a pack with a
    /// home is the name of a scene. Recordings contain their packs.
    #[command(subcommand, after_long_help = manual::PACK)]
    Pack(PackCommand),
    /// Makes a folder of your own from a template, for example of an object.
    ///
    /// Templates of object, task, scene, camera, robot, policy and device.
    /// Objects, tasks and scenes are world packs, found with --packs. Cameras and robots are
    /// copies of the shipped robot. Policies and devices are programs in Python.
    #[command(after_long_help = manual::NEW)]
    New(NewArgs),
    /// Makes the keys that authenticate users and servers.
    ///
    /// On the host of the server: a certificate authority, the server's certificate, and a
    /// folder of keys for each user (--keys DIR).
    #[command(subcommand, after_long_help = manual::KEYS)]
    Keys(KeysCommand),
    /// Manages users and their roles.
    ///
    /// Adds, removes and lists the users of a folder of keys (--keys DIR), and
    /// sets their passwords for the web page.
    #[command(subcommand, after_long_help = manual::USERS)]
    Users(UsersCommand),
    /// Runs a router between servers and clients, with the rules of a folder of keys.
    ///
    /// A Zenoh router: servers with the same keys connect to it (`wheelarm-server
    /// --connect`), and users reach all of them through it, each with the rights of its
    /// role (--keys DIR).
    #[command(after_long_help = manual::ROUTER)]
    Router(RouterArgs),
    /// Starts a server and a recorder, and records an episode of the scripted operator.
    #[cfg(feature = "hdf5")]
    #[command(after_long_help = manual::DEMO)]
    Demo(DemoArgs),
    /// Runs tasks over many seeds and counts the successes.
    #[cfg(feature = "hdf5")]
    #[command(after_long_help = manual::EVALUATE)]
    Evaluate(Box<EvaluateArgs>),
    /// Makes a dataset from a plan, on one host or in parts on many.
    #[cfg(feature = "hdf5")]
    #[command(
        after_long_help = manual::COLLECT,
        override_usage = "wheelarm collect [OPTIONS] <PLAN>\n       wheelarm collect --merge <DIR>... [--out <DIR>]"
    )]
    Collect(CollectArgs),
    /// Makes many episodes from a few, by adapting the recorded hand motion to other scenes.
    ///
    /// Uses every successful episode of the task in DIR. The end of the reach, the grasp,
    /// the lift and the placement are kept relative to the object; the path to it is
    /// planned again. Successful episodes are recorded without cameras: `replay --camera`
    /// renders them.
    #[cfg(feature = "hdf5")]
    #[command(after_long_help = manual::MULTIPLY)]
    Multiply(MultiplyArgs),
    /// Replays a recorded episode bit for bit, and can record it again.
    #[cfg(feature = "hdf5")]
    #[command(after_long_help = manual::REPLAY)]
    Replay(ReplayArgs),
    /// Ends the server.
    ///
    /// Refused while another client is in control.
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
    /// Runs the program `wheelarm-dataset`; `wheelarm dataset --help` lists its commands.
    #[command(disable_help_flag = true)]
    Dataset {
        /// Arguments of `wheelarm-dataset`.
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
    /// Whether the command needs only files.
    fn needs_only_files(&self) -> bool {
        if let Self::Pack(command) = self {
            return command.needs_only_files();
        }
        matches!(
            self,
            Self::Cache(_)
                | Self::Home(_)
                | Self::New(_)
                | Self::Object(_)
                | Self::Keys(_)
                | Self::Users(_)
                | Self::Router(_)
                | Self::Completions { .. }
                | Self::Man { .. }
                | Self::Dataset { .. }
                | Self::External(_)
        )
    }

    /// Whether the command uses the whole terminal.
    fn uses_full_screen(&self) -> bool {
        #[cfg(feature = "terminal")]
        return matches!(self, Self::Teleop(_));
        #[cfg(not(feature = "terminal"))]
        false
    }
}

/// The command line with its help.
fn command_line() -> clap::Command {
    help::shaped(Cli::command())
}

fn main() -> ExitCode {
    end_with_output();
    end_as_first_process();
    let matches = command_line().get_matches();
    reject_unused_server_options(&matches);
    let mut cli = Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    let filter = "warn,zenoh=error";
    let ansi = std::io::stderr().is_terminal();
    if cli.command.uses_full_screen() && std::env::var_os("RUST_LOG").is_none() {
        // Log lines would overwrite the screen.
        log::start(filter, ansi, std::io::sink);
    } else {
        log::start(filter, ansi, std::io::stderr);
    }
    let connect = match cli.connect.connect() {
        Ok(connect) => connect,
        // These need no server.
        Err(_) if cli.command.needs_only_files() => Connect::from(&cli.connect),
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

/// Sets the default commander or recorder name to the user of the keys: a server with keys
/// rejects other names.
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
    let is_given = |id: &str| named.value_source(id) == Some(ValueSource::CommandLine);
    match &mut cli.command {
        Command::Operate(args) if !is_given("commander") => args.commander = user,
        Command::Lease(LeaseCommand::Hold(args)) if !is_given("commander") => {
            args.commander = user;
        }
        #[cfg(feature = "terminal")]
        Command::Teleop(args) if !is_given("commander") => args.commander = user,
        #[cfg(feature = "hdf5")]
        Command::Record(args) if !is_given("name") => args.name = user,
        _ => {}
    }
}

/// Rejects the server options for commands that start their own servers.
fn reject_unused_server_options(matches: &ArgMatches) {
    let own = ["demo", "evaluate", "collect", "multiply", "replay", SERVER];
    let Some((command, _)) = matches.subcommand().filter(|(name, _)| own.contains(name)) else {
        return;
    };
    for (id, option) in [
        ("connect", "--connect"),
        ("sim", "--sim"),
        ("connect_timeout", "--connect-timeout"),
    ] {
        if matches.value_source(id) == Some(ValueSource::CommandLine) {
            let message = match command {
                SERVER => format!(
                    "{option} selects a running server; options of `wheelarm server` follow the word `server`\n"
                ),
                _ => format!("`wheelarm {command}` starts its own servers: omit {option}\n"),
            };
            Cli::command()
                .error(ErrorKind::ArgumentConflict, message)
                .exit();
        }
    }
}

fn run(cli: Cli, connect: Connect) -> anyhow::Result<ExitCode> {
    let keys = cli.connect.keys.as_ref();
    let client = || control::open(&connect);
    match &cli.command {
        Command::Status => control::status(&connect)?,
        Command::Tasks => control::tasks(&connect)?,
        Command::Map(args) => print!("{}", map::run(&client()?, args)?),
        Command::Reset(args) => {
            let open = client()?;
            let what = format!("the server {:?} to set up the scenario", connect.sim);
            let scenario = control::announced(&what, || control::reset(&open, args))?;
            println!(
                "scene {}, task {}, seed {}: {:?}",
                scenario.scene,
                scenario.task(),
                scenario.seed(),
                scenario.instruction()
            );
        }
        Command::Pause => control::pause(&client()?, true)?,
        Command::Resume => control::pause(&client()?, false)?,
        Command::Lease(command) => return control::lease(&client()?, command),
        Command::Episode(command) => return control::episode(&client()?, command),
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
        Command::Operate(args) => return operate::run(&client()?, args),
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
        Command::Watch(args) => return watch::run(&client()?, args),
        Command::Doctor(args) => return doctor::run(&connect, args),
        Command::Shutdown(args) => client()?.shutdown(args.force)?,
        Command::Cache(args) => print!("{}", cache::run(args)?),
        Command::Home(command) => print!("{}", home::run(command)?),
        Command::New(args) => print!("{}", new::run(args)?),
        Command::Object(command) => print!("{}", object::run(command)?),
        Command::Pack(command) => print!("{}", world_pack::run(command, client)?),
        Command::Keys(command) => accounts::keys(keys, command)?,
        Command::Users(command) => accounts::users(keys, command)?,
        Command::Router(args) => accounts::route(keys, args)?,
        Command::Completions { shell } => {
            let mut command = command_line();
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
    let visible = cli
        .get_subcommands()
        .filter(|command| !command.is_hide_set());
    visible
        .map(|command| command.get_name().to_owned())
        .collect()
}

fn write_manual(folder: &Path) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder)
        .and_then(|()| clap_mangen::generate_to(command_line(), folder))
        .with_context(|| format!("writing man pages into {}", folder.display()))
}
