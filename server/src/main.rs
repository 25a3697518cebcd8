//! `wheelarm-server`: parses and wires; the library runs.

use std::io::{IsTerminal, Read, Write};
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, bail};
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{CommandFactory, Parser};
use wheelarm_access::Folder;
use wheelarm_proto::endpoint::check_endpoint;
use wheelarm_proto::keys::{self, Keys};
use wheelarm_proto::look::LookText;
use wheelarm_proto::output::end_with_output;
use wheelarm_proto::program::{EXIT_SCENARIO, Ready, tasks_to_json, told, version};
use wheelarm_proto::settings::{Depth, LanguageSplit, Named, Pacing, Quality, Starts};
use wheelarm_proto::signals::{Signals, end_as_first_process};
use wheelarm_proto::v1;
use wheelarm_proto::{installed, log};
use wheelarm_server::environment;
use wheelarm_server::robot::RobotModel;
use wheelarm_server::scene::Scene;
use wheelarm_server::sensors::camera::{Graphics, Renderer};
use wheelarm_server::service::session::Reach;
use wheelarm_server::service::{self, OpenAhead, Options, startup};
use wheelarm_server::sim::{Scenario, SimError, Simulation};
use wheelarm_server::tasks::{self, Floor, TaskSpec, table};

/// Headless simulation of a wheelchair with a robotic arm in a home.
///
/// Publishes sensor streams over Zenoh and takes protobuf commands. Prints one
/// line `ready ENDPOINT sim=NAME` when it serves. Listens on 127.0.0.1 unless
/// told otherwise; from another machine connect with keys (--keys), or through an
/// SSH tunnel.
#[derive(Parser, Debug)]
#[command(version = version())]
struct Args {
    /// Name of this server, so that several can share one network.
    #[arg(long, default_value = keys::DEFAULT_SIM)]
    sim: String,
    /// Endpoint to listen on; port 0 takes a free one. May be repeated
    /// [default: tcp/127.0.0.1:7447, with --keys tls/0.0.0.0:7447].
    #[arg(long, value_parser = endpoint)]
    listen: Vec<String>,
    /// Folder of keys and users (`wheelarm keys init`): clients come over TLS, each
    /// with a certificate of its own, and may do what the user's role says.
    #[arg(
        long,
        value_name = "DIR",
        env = "WHEELARM_SERVER_KEYS",
        conflicts_with = "insecure"
    )]
    keys: Option<PathBuf>,
    /// Lets other hosts connect without keys: everybody who reaches the port may
    /// drive and end this server.
    #[arg(long)]
    insecure: bool,
    /// Endpoint of a Zenoh router to connect to. May be repeated.
    #[arg(long, value_parser = endpoint)]
    connect: Vec<String>,
    /// Announces the server by multicast on the local network.
    #[arg(long)]
    multicast: bool,
    /// Scenario as TOML, `-` for standard input: the fields of the message
    /// `Scenario`. The options below that are given take the place of its fields.
    #[arg(long, value_name = "FILE")]
    scenario: Option<PathBuf>,
    /// How simulation time passes [default: real-time].
    #[arg(long, value_parser = named::<Pacing>())]
    pacing: Option<Pacing>,
    /// Scene below assets/scenes [default: home].
    #[arg(long)]
    scene: Option<String>,
    /// Task below assets/tasks; an empty name for none [default: pick_mustard].
    #[arg(long)]
    task: Option<String>,
    /// Seed of every random choice [default: 0].
    #[arg(long)]
    seed: Option<u64>,
    /// Where the robot starts: near by, or anywhere in the home with the arm in
    /// any of its postures [default: near].
    #[arg(long, value_parser = named::<Starts>())]
    starts: Option<Starts>,
    /// How often a task's area is drawn in another variant than its first (the
    /// kitchen table with the teddy bear), 0 to 1 [default: as the area says].
    #[arg(long, value_name = "SHARE")]
    variant_share: Option<f64>,
    /// Robot below assets/robots [default: wheelarm].
    #[arg(long)]
    robot: Option<String>,
    /// Assets folder.
    #[arg(long, env = "WHEELARM_ASSETS")]
    assets: Option<PathBuf>,
    /// Camera as NAME=WIDTHxHEIGHT@HZ: one of the robot's, `*` for each of them
    /// that is not named, or `room`. May be repeated; `*=1280x720@10` without it.
    #[arg(long, value_parser = v1::CameraSetting::from_text, conflicts_with = "no_cameras")]
    camera: Vec<v1::CameraSetting>,
    /// Sensor model that is on, MODEL or MODEL@CAMERA, a file in assets/sensors;
    /// with =STRENGTH from 0 (perfect) over 1 (as the file says) to 3. May be
    /// repeated.
    #[arg(long, value_parser = v1::SensorSetting::from_text, value_name = "MODEL@CAMERA")]
    sensor: Vec<v1::SensorSetting>,
    /// Physics only: no pictures, no graphics driver needed.
    #[arg(long)]
    no_cameras: bool,
    /// Work per picture [default: standard].
    #[arg(long, value_parser = named::<Quality>())]
    quality: Option<Quality>,
    /// Graphics adapter by its index, its PCI id (0000:65:00.0) or a part of its
    /// name (see --list-adapters) [default: the strongest].
    #[arg(long, value_name = "INDEX|PCI-ID|NAME")]
    adapter: Option<String>,
    /// Rate of the state streams, Hz; divides 60 [default: 60].
    #[arg(long)]
    state_rate: Option<f64>,
    /// Rate of the shapes of soft objects, Hz; divides 60. A shape has 50 kB
    /// [default: 10].
    #[arg(long)]
    deformable_rate: Option<f64>,
    /// Rate of the IMU, Hz; divides 240 [default: 240].
    #[arg(long)]
    imu_rate: Option<f64>,
    /// Adds the noise of the robot description to the IMU.
    #[arg(long)]
    imu_noise: bool,
    /// Which specimen of the robot: the cameras' lenses and places are drawn from
    /// this number [default: as the robot's description says].
    #[arg(long)]
    calibration_seed: Option<u64>,
    /// How it looks: SEED for the usual look of a seed, SEED:AXIS=STRENGTH,… for
    /// these axes alone: light, background, materials, exposure, decoration,
    /// camera, lens, each 1 to 3 [default: as the assets say].
    #[arg(long, value_name = "SEED[:AXIS=N,…]", value_parser = LookText::read)]
    look: Option<LookText>,
    /// Who sits in the chair: any (drawn by the seed), none, or BODY[/POSTURE], a
    /// folder in assets/people; then ,mouth_open ,motion=0..1 ,unguarded
    /// (no bounds on speed and force beside the person) [default: none].
    #[arg(long, value_name = "PERSON", value_parser = v1::Person::from_text)]
    person: Option<v1::Person>,
    /// Ends when standard input is closed: with the program that started it.
    #[arg(long, hide = true)]
    end_with_stdin: bool,
    /// Prints the tasks and ends.
    #[arg(long)]
    list_tasks: bool,
    /// With --list-tasks: one line of JSON, a list of objects with name,
    /// activity, area, goal, targets, instructions, predicates.
    #[arg(long, requires = "list_tasks")]
    json: bool,
    /// Prints what these seeds draw for --task as a table, comma separated with a
    /// line of names, and ends.
    #[arg(long, value_name = "A..B", value_parser = seeds)]
    draws: Option<std::ops::Range<u64>>,
    /// Prints with what sentences --task begins at these seeds and ends: one line of
    /// JSON each, with task, target, seed and instruction. What teaches words needs no
    /// episodes.
    #[arg(long, value_name = "A..B", value_parser = seeds, conflicts_with = "draws")]
    sentences: Option<std::ops::Range<u64>>,
    /// With --sentences: templates and names that are said [default: as the scenario
    /// says, else train].
    #[arg(long, requires = "sentences", value_parser = named::<LanguageSplit>())]
    language_split: Option<LanguageSplit>,
    /// With --sentences: sentences of each scene.
    #[arg(long, requires = "sentences", value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    each: u64,
    /// Prints the graphics adapters and ends: index, name, driver and PCI id.
    #[arg(long)]
    list_adapters: bool,
    /// Prints the man page and ends, for packages.
    #[arg(long, hide = true)]
    man: bool,
}

fn endpoint(text: &str) -> Result<String, String> {
    let checked = check_endpoint(text).map_err(|bad| bad.to_string());
    checked.map(|()| text.to_owned())
}

/// Takes the names that the contract has for a choice.
fn named<T: Named + Send + Sync>() -> impl TypedValueParser<Value = T> {
    PossibleValuesParser::new(T::ALL.iter().map(|value| value.name()))
        .try_map(|name| T::from_name(&name))
}

/// Longest scenario that is read, bytes.
const LONGEST_SCENARIO: u64 = 1 << 20;

/// Reads seeds, the last one left out.
fn seeds(text: &str) -> Result<std::ops::Range<u64>, String> {
    let read = || {
        let (first, end) = text.split_once("..")?;
        Some(first.parse().ok()?..end.parse().ok()?)
    };
    let seeds = read().filter(|seeds: &std::ops::Range<u64>| !seeds.is_empty());
    seeds.ok_or_else(|| format!("{text:?} is not A..B with A below B, for example 0..1000"))
}

/// Prints the draws of a task.
fn print_draws(
    assets: &Path,
    scenario: &Scenario,
    seeds: std::ops::Range<u64>,
) -> anyhow::Result<()> {
    let model = RobotModel::load(assets, &scenario.robot)?;
    let home = Scene::load(assets, &scenario.scene)?;
    let task = TaskSpec::load(assets, &scenario.task, &home, &model.settings.corridor)?;
    let mut scenes: Vec<(String, Scene, Floor)> = Vec::new();
    for variant in &task.area.variants {
        let mut scene = home.clone();
        scene.keep_optional(&variant.furniture);
        let floor = Floor::new(&model, &scene);
        scenes.push((variant.name.clone(), scene, floor));
    }
    let mut out = std::io::BufWriter::new(std::io::stdout().lock());
    writeln!(out, "{}", table::columns(&task.area))?;
    for seed in seeds {
        let variant = tasks::variant_of(&task, seed, scenario.variant_share)
            .context("the area has no variant for this task")?;
        let found = scenes.iter().find(|(name, ..)| *name == variant.name);
        let (name, scene, floor) = found.context("the area has no such variant")?;
        let floor = (scenario.starts == Starts::Anywhere).then_some(floor);
        let draw = tasks::draw(&task, variant, scene, seed, floor);
        let row = table::row(&task.area, scene, &task.name, name, seed, &draw);
        writeln!(out, "{row}")?;
    }
    Ok(())
}

/// Prints the sentences of a task.
fn print_sentences(
    assets: &Path,
    asked: &v1::Scenario,
    seeds: std::ops::Range<u64>,
    split: Option<LanguageSplit>,
    each: u64,
) -> anyhow::Result<()> {
    let mut asked = asked.clone();
    let mut language = asked.language.take().unwrap_or_default();
    if asked.task() == "" {
        bail!("--sentences needs a task: name one with --task (--list-tasks tells them)");
    }
    let split = split.or(LanguageSplit::told(language.split()));
    language.set_split(split.unwrap_or(LanguageSplit::Train).code());
    let first = language.seed;
    let mut out = std::io::BufWriter::new(std::io::stdout().lock());
    for seed in seeds {
        for n in 0..each {
            asked.seed = Some(seed);
            language.seed = first.wrapping_add(n);
            asked.language = Some(language.clone());
            let mut scenario = startup::scenario(&asked)?;
            scenario.cameras.clear();
            let sim = Simulation::new(assets, scenario)?;
            let told = sim.scenario();
            let line = serde_json::json!({
                "task": told.task, "target": told.target, "seed": seed,
                "instruction": told.instruction,
            });
            writeln!(out, "{line}")?;
        }
    }
    Ok(())
}

impl Args {
    /// How the server is to be reached.
    fn reach(&self) -> anyhow::Result<Reach> {
        let keys = self.keys.as_deref().map(Folder::open).transpose()?;
        let usual = match keys {
            Some(_) => "tls/0.0.0.0:7447",
            None => "tcp/127.0.0.1:7447",
        };
        let listen: Vec<String> = match self.listen.is_empty() {
            true => vec![usual.to_owned()],
            false => self
                .listen
                .iter()
                .map(|e| concrete(e))
                .collect::<Result<_, _>>()?,
        };
        Ok(Reach {
            listen,
            connect: self.connect.clone(),
            multicast: self.multicast,
            keys,
            insecure: self.insecure,
        })
    }

    /// The scenario that file and options ask for.
    fn scenario(&self) -> anyhow::Result<v1::Scenario> {
        let mut asked = match &self.scenario {
            Some(file) => self.scenario_file(file)?,
            None => v1::Scenario::default(),
        };
        asked.scene = self.scene.clone().unwrap_or(asked.scene);
        asked.task = self.task.clone().or(asked.task);
        asked.seed = self.seed.or(asked.seed);
        asked.variant_share = self.variant_share.or(asked.variant_share);
        if let Some(starts) = self.starts {
            asked.set_starts(starts.code());
        }
        asked.robot = self.robot.clone().unwrap_or(asked.robot);
        asked.state_rate_hz = self.state_rate.or(asked.state_rate_hz);
        asked.deformable_rate_hz = self.deformable_rate.or(asked.deformable_rate_hz);
        asked.imu_rate_hz = self.imu_rate.or(asked.imu_rate_hz);
        if let Some(pacing) = self.pacing {
            asked.set_pacing(pacing.code());
        }
        if let Some(quality) = self.quality {
            asked.set_quality(quality.code());
        }
        asked.calibration_seed = self.calibration_seed.or(asked.calibration_seed);
        if let Some(look) = &self.look {
            asked.look = Some(look.of(asked.seed()));
        }
        if let Some(person) = &self.person {
            asked.person = Some(person.clone());
        }
        if self.imu_noise {
            asked.imu_noise = Some(true);
        }
        if !self.camera.is_empty() {
            asked.cameras.clone_from(&self.camera);
        }
        if !self.sensor.is_empty() {
            asked.sensors.clone_from(&self.sensor);
        }
        Ok(asked)
    }

    fn scenario_file(&self, file: &Path) -> anyhow::Result<v1::Scenario> {
        let (mut text, limit) = (String::new(), LONGEST_SCENARIO + 1);
        let read = if file.as_os_str() != "-" {
            std::fs::File::open(file).and_then(|file| file.take(limit).read_to_string(&mut text))
        } else if self.end_with_stdin {
            bail!(
                "standard input cannot say both the scenario and when to end: give --scenario a file"
            );
        } else {
            std::io::stdin().take(limit).read_to_string(&mut text)
        };
        read.with_context(|| format!("reading the scenario {}", file.display()))?;
        if text.len() as u64 > LONGEST_SCENARIO {
            bail!(
                "the scenario {} is longer than {LONGEST_SCENARIO} bytes: is it another file?",
                file.display()
            );
        }
        startup::read(&text).with_context(|| format!("the scenario {}", file.display()))
    }
}

/// The assets folder: as told, or where [`installed::assets`] finds one.
fn assets(told: Option<PathBuf>) -> anyhow::Result<PathBuf> {
    if let Some(told) = told {
        if !told.join("scenes").is_dir() {
            bail!(
                "{} holds no folder `scenes`; name the assets folder of WheelArm",
                told.display()
            );
        }
        return Ok(told);
    }
    let found = installed::assets()
        .context("no assets folder found; name it with --assets DIR or WHEELARM_ASSETS")?;
    if let Some(warning) = installed::unused_assets(&found) {
        tracing::warn!("{warning}");
    }
    Ok(found)
}

/// Replaces port 0 of an endpoint by a free one.
fn concrete(endpoint: &str) -> anyhow::Result<String> {
    let Some((transport, address)) = endpoint
        .split_once('/')
        .filter(|(transport, _)| ["tcp", "tls"].contains(transport))
        .and_then(|(transport, rest)| Some((transport, rest.strip_suffix(":0")?)))
    else {
        return Ok(endpoint.to_owned());
    };
    let listener = TcpListener::bind((address, 0))
        .with_context(|| format!("cannot listen on {address}; is it an address of this host?"))?;
    Ok(format!(
        "{transport}/{address}:{}",
        listener.local_addr()?.port()
    ))
}

fn main() -> ExitCode {
    end_with_output();
    end_as_first_process();
    let args = Args::parse();
    environment::complete();
    let runtime = allow_open_files()
        .and_then(|()| tokio::runtime::Runtime::new().context("the runtime cannot start"));
    let Err(error) = runtime.and_then(|runtime| runtime.block_on(serve(args))) else {
        return ExitCode::SUCCESS;
    };
    eprintln!("error: {}", told(error.as_ref()));
    match error.downcast_ref() {
        Some(SimError::Broken(_) | SimError::Panicked(_)) => ExitCode::from(EXIT_SCENARIO),
        _ => ExitCode::FAILURE,
    }
}

/// Files that may be open at the least: connections, threads' event queues, the graphics
/// driver. The transport panics where one cannot be opened.
const OPEN_FILES: u64 = 256;

/// Raises the limit of open files as far as the user may.
fn allow_open_files() -> anyhow::Result<()> {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    let limit = getrlimit(Resource::Nofile);
    let raised = Rlimit {
        current: limit.maximum,
        ..limit
    };
    // Where it cannot be raised, what is allowed counts.
    let allowed = match setrlimit(Resource::Nofile, raised) {
        Ok(()) => limit.maximum,
        Err(_) => limit.current,
    };
    match allowed {
        Some(allowed) if allowed < OPEN_FILES => bail!(
            "cannot start: at most {allowed} files may be open, a server needs {OPEN_FILES}: \
             raise the limit (`ulimit -n 1024`)"
        ),
        _ => Ok(()),
    }
}

async fn serve(args: Args) -> anyhow::Result<()> {
    if args.man {
        return clap_mangen::Man::new(Args::command())
            .render(&mut std::io::stdout())
            .context("printing the man page");
    }
    let filter = "warn,wheelarm_server=info,zenoh=error";
    log::start(filter, std::io::stderr().is_terminal(), std::io::stderr);
    if args.list_adapters {
        let adapters = Renderer::adapters();
        if adapters.is_empty() {
            bail!(wheelarm_server::sensors::camera::RenderError::NoDriver);
        }
        for adapter in adapters {
            println!("{}: {adapter}", adapter.index);
        }
        return Ok(());
    }
    let assets = assets(args.assets.clone())?;
    if args.list_tasks {
        let robot = args.robot.clone().unwrap_or(Scenario::default().robot);
        let model = RobotModel::load(&assets, &robot)?;
        let tasks =
            service::tasks(&assets, &model.settings.corridor).map_err(anyhow::Error::msg)?;
        if args.json {
            println!("{}", tasks_to_json(&tasks)?);
            return Ok(());
        }
        for task in tasks {
            println!(
                "{:<20} {:<16} {:<14} {}",
                task.name,
                task.activity,
                task.area,
                task.instructions.first().map_or("", String::as_str)
            );
        }
        return Ok(());
    }
    let keys = Keys::new(&args.sim)?;
    let mut scenario = startup::scenario(&args.scenario()?)?;
    if let Some(seeds) = args.draws {
        return print_draws(&assets, &scenario, seeds);
    }
    if let Some(seeds) = args.sentences.clone() {
        let asked = args.scenario()?;
        return print_sentences(&assets, &asked, seeds, args.language_split, args.each);
    }
    if args.no_cameras {
        scenario.cameras.clear();
    }
    let pacing = scenario.pacing;
    let graphics = Graphics::on(args.adapter.as_deref());
    let draws = !scenario.cameras.is_empty();
    let _opening = draws.then(|| OpenAhead::begin(&graphics));
    let sim = Simulation::new(&assets, scenario)?;
    let mut sensors = args.sensor.iter().filter(|_| args.no_cameras);
    if let Some(sensor) = sensors.find(|sensor| !sensor.camera.is_empty()) {
        bail!(
            "--sensor {} takes the pictures of a camera, and --no-cameras leaves all cameras out; leave one of both out",
            sensor.text()
        );
    }
    let reach = args.reach()?;
    let access = reach.access()?;
    let listen = reach.listen.join(", ");
    let session = service::session::open(&keys, &reach, pacing).with_context(|| {
        format!("cannot listen on {listen}; is another server running there? Choose another port with --listen tcp/127.0.0.1:PORT")
    })?;
    if access == v1::Access::Insecure {
        tracing::warn!(
            "{listen}: INSECURE, everybody who reaches this port may drive and end this server"
        );
    }
    let endpoint = reach.listen.first().cloned().unwrap_or_default();
    let options = Options {
        keys,
        graphics,
        no_cameras: args.no_cameras,
        depth: Depth::Metres,
        access,
    };
    let (name, end_with_stdin) = (args.sim, args.end_with_stdin);
    // Heard from here on: whoever reads that the server is ready may end it.
    let signals = Signals::listen_here().context("cannot listen to signals")?;
    let serves = Ready {
        endpoint,
        sim: name,
    };
    let ready = move || println!("{serves}");
    let interrupted = interrupted(signals, end_with_stdin);
    service::run(session, sim, options, ready, interrupted).await?;
    Ok(())
}

/// Resolves on Ctrl-C, SIGTERM or SIGHUP, and at the end of standard input if told so.
async fn interrupted(mut signals: Signals, end_with_stdin: bool) {
    let (closed, input_closed) = tokio::sync::oneshot::channel();
    let closed = if end_with_stdin {
        std::thread::spawn(move || {
            let _ = std::io::copy(&mut std::io::stdin().lock(), &mut std::io::sink());
            let _ = closed.send(());
        });
        None
    } else {
        Some(closed)
    };
    tokio::select! {
        _ = input_closed => {}
        _ = signals.next() => {}
    }
    drop(closed);
}
