//! Everything that reads untrusted input, each behind one function that must
//! return whatever the bytes are. The fuzz targets (`tests/fuzz/`) and the mutation
//! test of this package call the same functions.

use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};
use std::time::Instant;

use wheelarm_campaign::evaluate::SuiteReport;
use wheelarm_dataset::{columns, log};
use wheelarm_import::object::{self, Categories, Hand, ObjectOptions};
use wheelarm_pack::Pack;
use wheelarm_planning::reach_map::ReachMap;
use wheelarm_policy::ledger::Ledger;
use wheelarm_policy::{ChunkExecutor, ExecutorOptions, Player};
use wheelarm_proto::topic::Sample;
use wheelarm_proto::{Message, Query, Rpc, StreamId, TopicId, check, v1};
use wheelarm_rollout::policy::openpi;
use wheelarm_server::geometry::mesh;
use wheelarm_server::robot::control::GripperMap;
use wheelarm_server::robot::{CorridorSettings, RobotModel};
use wheelarm_server::scene::Scene;
use wheelarm_server::service::command_gate::{CommandGate, ControlRequest, Life, Listening};
use wheelarm_server::service::convert;
use wheelarm_server::sim::Scenario;
use wheelarm_server::tasks::TaskSpec;

use crate::root;

/// A command on its way through the gate, in both ways of listening.
pub fn command(bytes: &[u8]) {
    static MODEL: OnceLock<RobotModel> = OnceLock::new();
    let model = MODEL.get_or_init(|| {
        RobotModel::load(&root().join("assets"), "wheelarm").expect("the robot of this repository")
    });
    // The commander of the message holds control, whatever its name.
    let sent = v1::Command::decode(bytes).unwrap_or_default();
    let life = Life {
        name: sent.commander,
        run_id: sent.header.unwrap_or_default().run_id,
    };
    for (lock_step, sealed) in [(false, false), (true, false), (false, true)] {
        let mut command_gate = CommandGate::new(GripperMap::new(model));
        let request = ControlRequest {
            sealed,
            ..ControlRequest::default()
        };
        let _ = command_gate.request_control(life.clone(), &request, Instant::now());
        let listening = Listening {
            lock_step,
            ..Listening::default()
        };
        command_gate.listen(listening, 0);
        let _ = command_gate.accept(bytes, 0.0);
        let _ = command_gate.take(0, 0.0, 0.0);
    }
}

/// Decodes a message, and again from its own encoding.
fn decode_twice<M: Message + Default>(bytes: &[u8]) {
    if let Ok(message) = M::decode(bytes) {
        let again = M::decode(message.encode_to_vec().as_slice());
        assert!(again.is_ok(), "{}", std::any::type_name::<M>());
    }
}

/// Request and reply of a query.
fn decode_query<R: Rpc>(query: Query, bytes: &[u8])
where
    R::Reply: Message + Default,
{
    assert_eq!(query, R::QUERY);
    decode_twice::<R>(bytes);
    decode_twice::<R::Reply>(bytes);
}

/// Names every query: a new one does not compile until its messages are fuzzed.
fn decode_query_messages(query: Query, bytes: &[u8]) {
    match query {
        Query::Status => decode_query::<v1::StatusRequest>(query, bytes),
        Query::Scene => decode_query::<v1::SceneRequest>(query, bytes),
        Query::Tasks => decode_query::<v1::TasksRequest>(query, bytes),
        Query::Lease => decode_query::<v1::LeaseRequest>(query, bytes),
        Query::Reach => decode_query::<v1::ReachRequest>(query, bytes),
        Query::Map => decode_query::<v1::MapRequest>(query, bytes),
        Query::Pick => decode_query::<v1::PickRequest>(query, bytes),
        Query::Reset => decode_query::<v1::ResetRequest>(query, bytes),
        Query::Pause => decode_query::<v1::PauseRequest>(query, bytes),
        Query::Resume => decode_query::<v1::ResumeRequest>(query, bytes),
        Query::Playback => decode_query::<v1::PlaybackRequest>(query, bytes),
        Query::EpisodeStart => decode_query::<v1::EpisodeStartRequest>(query, bytes),
        Query::EpisodeStop => decode_query::<v1::EpisodeStopRequest>(query, bytes),
        Query::Episode => decode_query::<v1::EpisodeRequest>(query, bytes),
        Query::Snapshot => decode_query::<v1::SnapshotRequest>(query, bytes),
        Query::Sensors => decode_query::<v1::SensorsRequest>(query, bytes),
        Query::Packs => decode_query::<v1::PacksRequest>(query, bytes),
        Query::PackPut => decode_query::<v1::PackPutRequest>(query, bytes),
        Query::Shutdown => decode_query::<v1::ShutdownRequest>(query, bytes),
    }
}

/// Every message that is published or that a query sends, with the checks of those that a
/// server accepts.
pub fn messages(bytes: &[u8]) {
    for topic in TopicId::ALL {
        if let Ok(sample) = Sample::decode(topic, bytes) {
            let again = Sample::decode(topic, &sample.encode());
            assert!(again.is_ok(), "{sample:?}");
        }
    }
    for query in Query::ALL {
        decode_query_messages(query, bytes);
    }
    decode_twice::<v1::Failure>(bytes);
    if let Ok(request) = v1::ResetRequest::decode(bytes) {
        let request = request.scenario.unwrap_or_default();
        let _ = convert::scenario_over(&Scenario::default(), &request).map(|s| s.schedules());
    }
    if let Ok(request) = v1::EpisodeStartRequest::decode(bytes) {
        let _ = check::label(&request.label);
        let _ = check::instruction(request.instruction.as_deref().unwrap_or_default());
    }
    if let Ok(request) = v1::ReachRequest::decode(bytes) {
        let _ = convert::isometry("pose", request.pose.as_ref());
    }
}

/// A sample of every stream, as a recorder takes it.
pub fn samples(bytes: &[u8]) {
    let _ = columns::header_of(bytes);
    for stream in StreamId::all([], []) {
        let _ = columns::check(&stream.to_string(), bytes);
    }
    let _ = log::CameraParts::parse(bytes);
}

/// Replies of a policy: its description, its rows, and those of openpi's protocol.
/// Every input ends in commands of finite numbers or in a problem.
pub fn policy_reply(bytes: &[u8]) {
    let robot = v1::RobotDescription::default();
    let fly = |spec: &v1::PolicySpec, rows: usize, values: &[f32]| {
        let Ok((kind, _)) = wheelarm_rollout::policy::checked(spec) else {
            return;
        };
        for ensemble in [None, Some(0.1)] {
            let options = ExecutorOptions {
                execute: spec.execute as usize,
                latency: rows % 3,
                ensemble,
            };
            let mut executor = ChunkExecutor::new(Player::new(kind, &robot, spec.rate_hz), options);
            for _ in 0..4 {
                if executor.needs_chunk() && executor.add(rows, values).is_err() {
                    return;
                }
                let Ok(Some(command)) = executor.command() else {
                    continue;
                };
                let base = command.base.unwrap_or_default();
                assert!(base.linear.is_finite() && base.angular.is_finite());
            }
        }
    };
    let usual = v1::PolicySpec {
        rate_hz: 10.0,
        chunk: 4,
        execute: 2,
        ..Default::default()
    };
    if let Ok(spec) = v1::PolicySpec::decode(bytes) {
        fly(&spec, 1, &[0.1; 12]);
    }
    if let Ok(reply) = v1::InferReply::decode(bytes) {
        for chunk in &reply.chunks {
            fly(&usual, chunk.rows as usize, &chunk.values);
        }
    }
    if let Ok(rows) = openpi::rows(bytes, "actions") {
        assert_eq!(rows.count.checked_mul(rows.size), Some(rows.values.len()));
        fly(&usual, rows.count, &rows.values);
    }
}

/// The log of a recorder.
pub fn recorder_log(bytes: &[u8]) {
    let file = Scratch::new("log", bytes);
    if let Ok(scan) = log::scan(&file.path) {
        assert_eq!(scan.good + scan.lost, bytes.len() as u64);
        assert_eq!(scan.damage.is_some(), scan.lost > 0);
        let mut buffer = Vec::new();
        for entry in &scan.entries {
            let payload = scan.payload(entry, &mut buffer);
            let _ = log::CameraParts::parse(payload.expect("a payload that was checked"));
        }
        // Every entry of the outline is readable exactly when the log was closed.
        if let Ok(Some(outline)) = log::outline(&file.path) {
            let sound = |e| outline.payload(e, &mut buffer).is_ok();
            let whole = outline.entries.iter().all(sound);
            assert_eq!(whole, scan.closing.is_some());
        }
    }
}

/// A mesh file, OBJ.
pub fn obj(bytes: &[u8]) {
    let _ = mesh::load(&Scratch::new("mesh.obj", bytes).path);
}

/// A mesh file, binary glTF.
pub fn glb(bytes: &[u8]) {
    let _ = mesh::load(&Scratch::new("mesh.glb", bytes).path);
}

/// A home of Sweet Home 3D: the whole archive, and the same bytes as the text in one.
pub fn home(bytes: &[u8]) {
    let options = wheelarm_import::Options {
        name: "home".to_owned(),
        ..wheelarm_import::Options::default()
    };
    let _ = wheelarm_import::import("home.sh3d", bytes.to_vec(), &options);
    let _ = wheelarm_import::sh3d::parse("home.sh3d", bytes);
}

/// A mesh of an object, in each format that is imported.
pub fn object_mesh(bytes: &[u8]) {
    for name in ["mesh.glb", "mesh.obj", "mesh.stl", "mesh.dae"] {
        let _ = object::parse(name, bytes, &|_| Err("no other file".to_owned()));
    }
}

/// The same, imported as an object.
pub fn object(bytes: &[u8]) {
    static SHARED: OnceLock<(Categories, Hand)> = OnceLock::new();
    let (categories, hand) = SHARED.get_or_init(|| {
        let assets = root().join("assets");
        let categories = Categories::read(&assets).expect("the categories of this repository");
        let hand = Hand::read(&assets, "wheelarm").expect("its gripper");
        (categories, hand)
    });
    let options = ObjectOptions {
        name: "object".to_owned(),
        category: "tool".to_owned(),
        ..ObjectOptions::default()
    };
    for name in ["mesh.obj", "mesh.stl", "mesh.msh", "mesh.xml"] {
        if let Ok(found) = object::import_bytes(name, bytes, &options, categories, hand) {
            object::with_object(None, "objects", &found.object).expect("a pack");
        }
    }
}

/// The reach map of a robot.
pub fn reach_map(bytes: &[u8]) {
    if let Ok(map) = ReachMap::from_bytes(bytes) {
        assert_eq!(map.to_bytes(), bytes);
        let _ = map.len();
    }
}

/// The results of a suite, and the training ledger of a policy.
pub fn suite_results(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    if let Ok(report) = SuiteReport::read(&text) {
        assert!(report.text().is_ok());
    }
    if let Ok(ledger) = Ledger::read(&text) {
        assert_eq!(Ledger::read(&ledger.text()).ok(), Some(ledger));
    }
}

/// The zip file of a world pack, and the scene of its home.
pub fn pack_zip(bytes: &[u8]) {
    if let Ok(pack) = Pack::from_zip(bytes) {
        let again = Pack::from_zip(&pack.to_zip().expect("a zip file")).expect("a pack");
        assert_eq!(again.files(), pack.files());
        let _ = Scene::from_pack(&root().join("assets"), &Arc::new(pack));
    }
}

/// The home of a world pack in place of the right one.
pub fn home_toml(bytes: &[u8]) {
    static FLAT: OnceLock<Pack> = OnceLock::new();
    let flat = FLAT.get_or_init(|| {
        Pack::open(&root().join("tests/data/flat")).expect("the pack of this repository")
    });
    let mut files = flat.files().clone();
    files.insert("home.toml".into(), bytes.to_vec());
    if let Ok(pack) = Pack::from_files(files) {
        let _ = Scene::from_pack(&root().join("assets"), &Arc::new(pack));
    }
}

/// One file of the assets in place of the right one, and everything that is
/// loaded with it.
pub fn asset(path: &str, bytes: &[u8]) {
    thread_local! {
        static ASSETS: tempfile::TempDir = {
            let folder = tempfile::tempdir().expect("a folder");
            copy(&root().join("assets"), folder.path());
            folder
        };
    }
    ASSETS.with(|folder| {
        let assets = folder.path();
        let file = assets.join(path);
        let right = std::fs::read(&file).unwrap_or_default();
        std::fs::write(&file, bytes).expect("a file");
        if path.starts_with("robots") {
            let _ = RobotModel::load(assets, "wheelarm");
        } else if let Some((folder @ ("tasks" | "areas" | "templates"), name)) =
            path.split_once('/')
        {
            static HOME: OnceLock<(Scene, CorridorSettings)> = OnceLock::new();
            let (home, hand) = HOME.get_or_init(|| {
                let assets = root().join("assets");
                let model = RobotModel::load(&assets, "wheelarm").expect("its robot");
                let home = Scene::load(&assets, "home").expect("the scene of this repository");
                (home, model.settings.gripper.corridor)
            });
            let name = name.trim_end_matches(".toml");
            let task = match folder {
                "tasks" => name,
                // One that uses what was changed.
                "areas" => match name {
                    "coffee_table" => "pick_mustard",
                    "shelf" => "select_coke",
                    "workstation" => "open_drawer",
                    _ => "place_knife",
                },
                _ => match name {
                    "lift" => "pick_mustard",
                    "open" => "open_drawer",
                    "close" => "close_drawer",
                    _ => "place_knife",
                },
            };
            let _ = TaskSpec::load(assets, task, home, hand);
        } else {
            let _ = Scene::load(assets, "home");
        }
        std::fs::write(&file, right).expect("a file");
    });
}

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).expect("a folder");
    for entry in std::fs::read_dir(from).expect("the assets").flatten() {
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy(&entry.path(), &target);
        } else {
            std::fs::copy(entry.path(), target).expect("a copy");
        }
    }
}

/// Bytes in a file, for readers that want a path.
struct Scratch {
    path: PathBuf,
    _folder: tempfile::TempDir,
}

impl Scratch {
    fn new(name: &str, bytes: &[u8]) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).expect("a file");
        Self {
            path,
            _folder: folder,
        }
    }
}
