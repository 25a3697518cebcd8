//! `wheelarm-server`: parses arguments and connects the parts of the library.

use std::io::{IsTerminal, Read, Write};
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, bail};
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{CommandFactory, Parser};
use wheelarm_access::Folder;
use wheelarm_pack::Store as PackStore;
use wheelarm_proto::appearance::AppearanceText;
use wheelarm_proto::cache::Store;
use wheelarm_proto::endpoint::check_endpoint;
use wheelarm_proto::keys::{self, Keys};
use wheelarm_proto::output::end_with_output;
use wheelarm_proto::program::{EXIT_SCENARIO, Ready, error_chain, tasks_to_json, version};
use wheelarm_proto::settings::{Depth, LanguageSplit, Named, Pacing, Quality, Starts};
use wheelarm_proto::signals::{Signals, end_as_first_process};
use wheelarm_proto::v1;
use wheelarm_proto::{installed, log};
use wheelarm_server::environment;
use wheelarm_server::robot::RobotModel;
use wheelarm_server::scene::Scene;
use wheelarm_server::sensors::camera::{Graphics, Renderer};
use wheelarm_server::service::session::Reach;
use wheelarm_server::service::{self, OpenAhead, Options, packs, startup};
use wheelarm_server::sim::{Scenario, SimError, Simulation, load_scene};
use wheelarm_server::tasks::{self, Floor, SamplingRules, TaskSpec, table};

/// Headless simulation of a wheelchair with a robotic arm in a home.
///
/// Publishes sensor streams over Zenoh and accepts protobuf commands. Prints one line
/// `ready ENDPOINT sim=NAME` when it is ready. Listens on 127.0.0.1 by default; from
/// another machine connect with keys (--keys), or through an SSH tunnel.
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
    /// Folder of keys and users (`wheelarm keys init`): clients connect over TLS, each
    /// with its own certificate, and have the rights of the user's role.
    #[arg(
        long,
        value_name = "DIR",
        env = "WHEELARM_SERVER_KEYS",
        conflicts_with = "insecure"
    )]
    keys: Option<PathBuf>,
    /// Lets other hosts connect without keys: every host that can reach the port may drive
    /// and end this server.
    #[arg(long)]
    insecure: bool,
    /// Endpoint of a Zenoh router to connect to. May be repeated.
    #[arg(long, value_parser = endpoint)]
    connect: Vec<String>,
    /// Announces the server by multicast on the local network.
    #[arg(long)]
    multicast: bool,
    /// Scenario as TOML, `-` for standard input: the fields of the message `Scenario`.
    /// The options below override its fields.
    #[arg(long, value_name = "FILE")]
    scenario: Option<PathBuf>,
    /// Pacing of simulation time [default: real-time].
    #[arg(long, value_parser = named::<Pacing>())]
    pacing: Option<Pacing>,
    /// Scene below assets/scenes, the home of a world pack, or an own home,
    /// PLAN-STYLE-SEED [default: home].
    #[arg(long)]
    scene: Option<String>,
    /// Task below assets/tasks; an empty name for none [default: pick_mustard].
    #[arg(long)]
    task: Option<String>,
    /// Seed of every random choice [default: 0].
    #[arg(long)]
    seed: Option<u64>,
    /// Start of the robot: near the target, or anywhere in the home with the arm in any
    /// of its postures [default: near].
    #[arg(long, value_parser = named::<Starts>())]
    starts: Option<Starts>,
    /// Probability that a task's area is sampled in another variant than its first (the
    /// kitchen table with the teddy bear), 0 to 1 [default: the area's].
    #[arg(long, value_name = "SHARE")]
    variant_share: Option<f64>,
    /// Robot below assets/robots [default: wheelarm].
    #[arg(long)]
    robot: Option<String>,
    /// Assets folder.
    #[arg(long, env = "WHEELARM_ASSETS")]
    assets: Option<PathBuf>,
    /// Folder of world packs, whose homes are scenes; may be repeated [default: the user's,
    /// ~/.local/share/wheelarm/packs].
    #[arg(
        long,
        value_name = "DIR",
        env = installed::PACKS_VARIABLE,
        value_delimiter = ':'
    )]
    packs: Vec<PathBuf>,
    /// Packs whose objects the tasks of every home may place, separated by commas.
    #[arg(long, value_name = "PACKS", value_delimiter = ',')]
    objects: Vec<String>,
    /// Camera as NAME=WIDTHxHEIGHT@HZ: one of the robot's, `*` for each robot camera
    /// that is not named, or `room`. May be repeated [default: `*=1280x720@10`].
    #[arg(long, value_parser = v1::CameraSetting::from_text, conflicts_with = "no_cameras")]
    camera: Vec<v1::CameraSetting>,
    /// Active sensor model, MODEL or MODEL@CAMERA, a file in assets/sensors; with
    /// =STRENGTH from 0 (perfect) over 1 (as in the file) to 3. May be repeated.
    #[arg(long, value_parser = v1::SensorSetting::from_text, value_name = "MODEL@CAMERA")]
    sensor: Vec<v1::SensorSetting>,
    /// Physics only: no images, no graphics driver needed.
    #[arg(long)]
    no_cameras: bool,
    /// Rendering effort per image [default: standard].
    #[arg(long, value_parser = named::<Quality>())]
    quality: Option<Quality>,
    /// Graphics adapter by its index, its PCI ID (0000:65:00.0) or a part of its name
    /// (see --list-adapters) [default: the best].
    #[arg(long, value_name = "INDEX|PCI-ID|NAME")]
    adapter: Option<String>,
    /// Rate of the state streams, Hz; divides 60 [default: 60].
    #[arg(long, alias = "state-rate")]
    state_rate_hz: Option<f64>,
    /// Rate of the shapes of deformables, Hz; divides 60. A shape has 50 kB [default:
    /// 10].
    #[arg(long, alias = "deformable-rate")]
    deformable_rate_hz: Option<f64>,
    /// Rate of the IMU, Hz; divides 240 [default: 240].
    #[arg(long, alias = "imu-rate")]
    imu_rate_hz: Option<f64>,
    /// Rate of the laser scanner, Hz; divides 60; 0 is off [default: 0].
    #[arg(long)]
    scan_rate_hz: Option<f64>,
    /// Adds the noise of the robot description to the IMU.
    #[arg(long)]
    imu_noise: bool,
    /// Seed of the robot specimen: the cameras' lenses and mounts are sampled from it
    /// [default: the robot's description].
    #[arg(long)]
    calibration_seed: Option<u64>,
    /// Visual randomization: SEED for the usual look of a seed, SEED:AXIS=STRENGTH,…
    /// for these axes only: light, background, materials, exposure, decoration, camera,
    /// lens, each 1 to 3 [default: as in the assets].
    #[arg(long, alias = "look", value_name = "SEED[:AXIS=N,…]", value_parser = AppearanceText::read)]
    appearance: Option<AppearanceText>,
    /// Person in the chair: any (sampled by the seed), none, or BODY[/POSTURE], a
    /// folder in assets/people; then ,mouth_open ,motion=0..1 ,unguarded (no limits on
    /// speed and force near the person) [default: none].
    #[arg(long, value_name = "PERSON", value_parser = v1::Person::from_text)]
    person: Option<v1::Person>,
    /// Ends when standard input is closed: together with the program that started it.
    #[arg(long, hide = true)]
    end_with_stdin: bool,
    /// Prints the tasks and exits.
    #[arg(long)]
    list_tasks: bool,
    /// With --list-tasks: one line of JSON, a list of objects with name,
    /// activity, area, goal, targets, instructions, predicates.
    #[arg(long, requires = "list_tasks")]
    json: bool,
    /// Prints the samples of --task for these seeds as a table, comma separated with a
    /// header line, and exits.
    #[arg(long, value_name = "A..B", value_parser = seeds)]
    draws: Option<std::ops::Range<u64>>,
    /// Prints the instructions of --task for these seeds and exits: one line of JSON
    /// each, with task, target, seed and instruction. Language data needs no episodes.
    #[arg(long, value_name = "A..B", value_parser = seeds, conflicts_with = "draws")]
    sentences: Option<std::ops::Range<u64>>,
    /// With --sentences: templates and names to use [default: the scenario's, else
    /// train].
    #[arg(long, requires = "sentences", value_parser = named::<LanguageSplit>())]
    language_split: Option<LanguageSplit>,
    /// With --sentences: sentences per scene.
    #[arg(long, requires = "sentences", value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    each: u64,
    /// Prints the graphics adapters and exits: index, name, driver and PCI ID.
    #[arg(long)]
    list_adapters: bool,
    /// Prints the man page and exits, for packages.
    #[arg(long, hide = true)]
    man: bool,
}

fn endpoint(text: &str) -> Result<String, String> {
    let checked = check_endpoint(text).map_err(|bad| bad.to_string());
    checked.map(|()| text.to_owned())
}

/// Value parser for a choice of the contract.
fn named<T: Named + Send + Sync>() -> impl TypedValueParser<Value = T> {
    PossibleValuesParser::new(T::ALL.iter().map(|value| value.name()))
        .try_map(|name| T::from_name(&name))
}

/// Longest accepted scenario, bytes.
const LONGEST_SCENARIO: u64 = 1 << 20;

/// Parses a range of seeds, the last one excluded.
fn seeds(text: &str) -> Result<std::ops::Range<u64>, String> {
    let read = || {
        let (first, end) = text.split_once("..")?;
        Some(first.parse().ok()?..end.parse().ok()?)
    };
    let seeds = read().filter(|seeds: &std::ops::Range<u64>| !seeds.is_empty());
    seeds.ok_or_else(|| format!("{text:?} is not A..B with A below B, for example 0..1000"))
}

/// The scene of a request.
fn scene_of(assets: &Path, packs: &PackStore, request: &v1::Scenario) -> anyhow::Result<Scene> {
    let mut scenario = startup::scenario(request)?;
    packs::attach(assets, packs, &mut scenario).map_err(anyhow::Error::msg)?;
    scene(assets, &scenario)
}

fn scene(assets: &Path, scenario: &Scenario) -> anyhow::Result<Scene> {
    let objects = (&scenario.object_packs[..], scenario.object_split);
    let scene = load_scene(assets, &scenario.scene, &scenario.pack, objects)?;
    Ok(scene)
}

/// Prints the samples of a task.
fn print_samples(
    assets: &Path,
    scenario: &Scenario,
    seeds: std::ops::Range<u64>,
) -> anyhow::Result<()> {
    let model = RobotModel::load(assets, &scenario.robot)?;
    let home = tasks::stocked(assets, &scenario.task, scene(assets, scenario)?)?;
    let task = TaskSpec::load(
        assets,
        &scenario.task,
        &home,
        &model.settings.gripper.corridor,
    )?;
    let rules = scenario.draws;
    let rules = rules.unwrap_or_else(|| SamplingRules::of_scene(&home));
    let reach = model.read_reach_map(assets)?;
    // Variants with the same furniture share scene and floor.
    let mut scenes: Vec<(Vec<String>, Scene, Floor)> = Vec::new();
    for variant in &task.area.variants {
        if scenes
            .iter()
            .any(|(furniture, ..)| *furniture == variant.furniture)
        {
            continue;
        }
        let mut scene = home.clone();
        scene.keep_optional(&variant.furniture);
        let floor = Floor::new(&model, &scene);
        let floor = match rules {
            SamplingRules::Ranges => floor,
            SamplingRules::Maps => floor.by_maps(&scene, reach.clone(), scenario.starts),
        };
        scenes.push((variant.furniture.clone(), scene, floor));
    }
    let mut out = std::io::BufWriter::new(std::io::stdout().lock());
    writeln!(out, "{}", table::columns(&task.area))?;
    for seed in seeds {
        let variant = tasks::variant_of(&task, seed, scenario.variant_share)
            .context("the area has no variant for this task")?;
        let mut found = scenes.iter();
        let found = found.find(|(furniture, ..)| *furniture == variant.furniture);
        let (_, scene, floor) = found.context("the area does not have this variant")?;
        let needs_floor = scenario.starts == Starts::Anywhere || rules == SamplingRules::Maps;
        let floor = needs_floor.then_some(floor);
        let settled = task.settled(variant, scene, seed, "")?;
        let about = tasks::sample_reached(&task, settled, &|_, _| true, scene, seed, floor);
        let ((_, variant), draw) = about;
        let row = table::row(&task.area, scene, &task.name, &variant.name, seed, &draw);
        writeln!(out, "{row}")?;
    }
    Ok(())
}

/// Prints the instructions of a task.
fn print_sentences(
    assets: &Path,
    packs: &PackStore,
    request: &v1::Scenario,
    seeds: std::ops::Range<u64>,
    split: Option<LanguageSplit>,
    each: u64,
) -> anyhow::Result<()> {
    let mut request = request.clone();
    let mut language = request.language.take().unwrap_or_default();
    if request.task() == "" {
        bail!("--sentences needs a task: name one with --task (--list-tasks lists them)");
    }
    let split = split.or(LanguageSplit::from_proto(language.split()));
    language.set_split(split.unwrap_or(LanguageSplit::Train).code());
    let first = language.seed;
    let mut out = std::io::BufWriter::new(std::io::stdout().lock());
    for seed in seeds {
        for n in 0..each {
            request.seed = Some(seed);
            language.seed = first.wrapping_add(n);
            request.language = Some(language.clone());
            let mut scenario = startup::scenario(&request)?;
            scenario.cameras.clear();
            packs::attach(assets, packs, &mut scenario).map_err(anyhow::Error::msg)?;
            let sim = Simulation::new(assets, scenario)?;
            let scenario = sim.scenario();
            let line = serde_json::json!({
                "task": scenario.task, "target": scenario.target, "seed": seed,
                "instruction": scenario.instruction,
            });
            writeln!(out, "{line}")?;
        }
    }
    Ok(())
}

impl Args {
    /// The server's endpoints and access settings.
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

    /// The scenario of file and options.
    ///
    /// Names every option: a new one does not compile until it is decided whether it sets a
    /// field of the scenario.
    fn scenario(&self) -> anyhow::Result<v1::Scenario> {
        let Self {
            scenario,
            pacing,
            scene,
            task,
            seed,
            starts,
            variant_share,
            robot,
            camera,
            sensor,
            quality,
            state_rate_hz,
            deformable_rate_hz,
            imu_rate_hz,
            scan_rate_hz,
            imu_noise,
            calibration_seed,
            appearance,
            person,
            objects,
            // Options of the program.
            sim: _,
            listen: _,
            keys: _,
            insecure: _,
            connect: _,
            multicast: _,
            assets: _,
            packs: _,
            no_cameras: _,
            adapter: _,
            end_with_stdin: _,
            list_tasks: _,
            json: _,
            draws: _,
            sentences: _,
            language_split: _,
            each: _,
            list_adapters: _,
            man: _,
        } = self;
        let mut request = match scenario {
            Some(file) => self.scenario_file(file)?,
            None => v1::Scenario::default(),
        };
        request.scene = scene.clone().unwrap_or(request.scene);
        request.task = task.clone().or(request.task);
        request.seed = seed.or(request.seed);
        request.variant_share = variant_share.or(request.variant_share);
        if let Some(starts) = starts {
            request.set_starts(starts.code());
        }
        request.packs.extend(objects.iter().map(|name| v1::PackRef {
            name: name.clone(),
            ..v1::PackRef::default()
        }));
        request.robot = robot.clone().unwrap_or(request.robot);
        request.state_rate_hz = state_rate_hz.or(request.state_rate_hz);
        request.deformable_rate_hz = deformable_rate_hz.or(request.deformable_rate_hz);
        request.imu_rate_hz = imu_rate_hz.or(request.imu_rate_hz);
        request.scan_rate_hz = scan_rate_hz.or(request.scan_rate_hz);
        if let Some(pacing) = pacing {
            request.set_pacing(pacing.code());
        }
        if let Some(quality) = quality {
            request.set_quality(quality.code());
        }
        request.calibration_seed = calibration_seed.or(request.calibration_seed);
        if let Some(appearance) = appearance {
            request.appearance = Some(appearance.for_episode(request.seed()));
        }
        if let Some(person) = person {
            request.person = Some(person.clone());
        }
        if *imu_noise {
            request.imu_noise = Some(true);
        }
        if !camera.is_empty() {
            request.cameras.clone_from(camera);
        }
        if !sensor.is_empty() {
            request.sensors.clone_from(sensor);
        }
        Ok(request)
    }

    fn scenario_file(&self, file: &Path) -> anyhow::Result<v1::Scenario> {
        let (mut text, limit) = (String::new(), LONGEST_SCENARIO + 1);
        let read = if file.as_os_str() != "-" {
            std::fs::File::open(file).and_then(|file| file.take(limit).read_to_string(&mut text))
        } else if self.end_with_stdin {
            bail!(
                "standard input cannot contain the scenario and also signal the end: use a file for --scenario"
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

/// The assets folder: the given one, or the result of [`installed::assets`].
fn assets(given: Option<PathBuf>) -> anyhow::Result<PathBuf> {
    if let Some(folder) = given {
        if !folder.join("scenes").is_dir() {
            bail!(
                "{} does not contain a folder `scenes`; name the assets folder of WheelArm with --assets",
                folder.display()
            );
        }
        return Ok(folder);
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
    let listener = TcpListener::bind((address, 0)).with_context(|| {
        format!("cannot listen on {address}: it may not be an address of this host")
    })?;
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
        .and_then(|()| tokio::runtime::Runtime::new().context("cannot start the runtime"));
    let Err(error) = runtime.and_then(|runtime| runtime.block_on(serve(args))) else {
        return ExitCode::SUCCESS;
    };
    eprintln!("error: {}", error_chain(error.as_ref()));
    match error.downcast_ref() {
        Some(SimError::Broken(_) | SimError::Panicked(_)) => ExitCode::from(EXIT_SCENARIO),
        _ => ExitCode::FAILURE,
    }
}

/// Smallest limit of open files: for connections, event queues of threads, and the
/// graphics driver. The transport panics when it cannot open one.
const OPEN_FILES: u64 = 256;

/// Raises the limit of open files as far as the user may.
fn allow_open_files() -> anyhow::Result<()> {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    let limit = getrlimit(Resource::Nofile);
    let raised = Rlimit {
        current: limit.maximum,
        ..limit
    };
    // If it cannot be raised, the present limit applies.
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
            .context("cannot print the man page");
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
    let packs = PackStore::search(&args.packs, &assets);
    if args.list_tasks {
        let robot = args.robot.clone().unwrap_or(Scenario::default().robot);
        let model = RobotModel::load(&assets, &robot)?;
        let scene = scene_of(&assets, &packs, &args.scenario()?)?;
        let tasks = service::tasks(&assets, Some(&scene), &model.settings.gripper.corridor)
            .map_err(anyhow::Error::msg)?;
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
    packs::attach(&assets, &packs, &mut scenario).map_err(anyhow::Error::msg)?;
    if let Some(seeds) = args.draws {
        return print_samples(&assets, &scenario, seeds);
    }
    if let Some(seeds) = args.sentences.clone() {
        let request = args.scenario()?;
        let split = args.language_split;
        return print_sentences(&assets, &packs, &request, seeds, split, args.each);
    }
    if args.no_cameras {
        scenario.cameras.clear();
    }
    packs::report(&assets, &packs);
    let pacing = scenario.pacing;
    let graphics = Graphics::for_adapter(args.adapter.as_deref()).caching(Store::open());
    let draws = !scenario.cameras.is_empty();
    let _opening = draws.then(|| OpenAhead::begin(&graphics));
    let sim = Simulation::new(&assets, scenario)?;
    let mut sensors = args.sensor.iter().filter(|_| args.no_cameras);
    if let Some(sensor) = sensors.find(|sensor| !sensor.camera.is_empty()) {
        bail!(
            "--sensor {} needs the images of a camera, but --no-cameras disables all cameras: remove one of the two options",
            sensor.text()
        );
    }
    let reach = args.reach()?;
    let access = reach.access()?;
    let listen = reach.listen.join(", ");
    let session = service::session::open(&keys, &reach, pacing).with_context(|| {
        format!("cannot listen on {listen}: another server may be running there; choose another port with --listen tcp/127.0.0.1:PORT")
    })?;
    if access == v1::Access::Insecure {
        tracing::warn!(
            "{listen}: INSECURE, every host that can reach this port may drive and end this server"
        );
    }
    let endpoint = reach.listen.first().cloned().unwrap_or_default();
    let options = Options {
        keys,
        graphics,
        no_cameras: args.no_cameras,
        depth: Depth::Metres,
        access,
        packs,
    };
    let (name, end_with_stdin) = (args.sim, args.end_with_stdin);
    // Handle signals from here on: a client may end the server as soon as it is ready.
    let signals = Signals::listen_here().context("cannot handle signals")?;
    let serves = Ready {
        endpoint,
        sim: name,
    };
    let ready = move || println!("{serves}");
    let interrupted = interrupted(signals, end_with_stdin);
    service::run(session, sim, options, ready, interrupted).await?;
    Ok(())
}

/// Resolves on Ctrl-C, SIGTERM or SIGHUP, and at the end of standard input if
/// requested.
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
