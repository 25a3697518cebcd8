//! Damaged input of every kind: each decoder of untrusted input returns without a panic. The
//! fuzz targets call the same functions.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use wheelarm_dataset::log::Closing;
use wheelarm_dataset::writer::{EpisodeWriter, WriterOptions};
use wheelarm_proto::{Message, v1};
use wheelarm_tests::decoders;
use wheelarm_tests::mutate::Mutator;
use wheelarm_tests::root;

/// Reads `good`, then `count` damaged copies of it.
fn read_damaged(what: &str, good: &[u8], count: u64, read: impl Fn(&[u8])) {
    read(good);
    for number in 0..count {
        let bytes = Mutator(number).mutate(good);
        let done = catch_unwind(AssertUnwindSafe(|| read(&bytes)));
        assert!(done.is_ok(), "{what}: panic with copy {number}: {bytes:?}");
    }
}

fn pose() -> v1::Pose {
    let vector = |x| v1::Vector3 { x, y: 0.2, z: 0.3 };
    v1::Pose {
        position: Some(vector(0.4)),
        orientation: Some(v1::Quaternion {
            w: 1.0,
            ..Default::default()
        }),
    }
}

fn command() -> v1::Command {
    use v1::arm_command::Target;
    v1::Command {
        header: Some(v1::Header {
            run_id: "00ff".into(),
            sequence: 3,
            ..Default::default()
        }),
        commander: "anna".into(),
        arm: Some(v1::ArmCommand {
            target: Some(Target::Pose(v1::CartesianTarget {
                frame: 1,
                pose: Some(pose()),
            })),
        }),
        base: Some(v1::BaseCommand {
            linear: 0.1,
            angular: -0.2,
        }),
        gripper: Some(v1::GripperCommand {
            target: Some(v1::gripper_command::Target::Opening(0.04)),
            max_force: Some(20.0),
        }),
        phase: 2,
        phase_name: "reaching".into(),
        ..Default::default()
    }
}

#[test]
fn damaged_policy_replies_do_not_panic() {
    let chunk = v1::PolicyChunk {
        episode_key: "run-1".to_owned(),
        tick: 24,
        rows: 4,
        values: [0.4, 0.1, 0.3, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.2, 0.1, -0.1].repeat(4),
        problem: String::new(),
    };
    let reply = v1::InferReply {
        chunks: vec![chunk.clone(), chunk],
    };
    read_damaged(
        "reply",
        &reply.encode_to_vec(),
        3000,
        decoders::policy_reply,
    );
    let spec = v1::PolicySpec {
        name: "act".to_owned(),
        rate_hz: 10.0,
        chunk: 4,
        execute: 2,
        ..Default::default()
    };
    read_damaged("spec", &spec.encode_to_vec(), 1500, decoders::policy_reply);
    // As openpi's `msgpack_numpy.packb({"actions": numpy.zeros((2, 12), "<f4")})`.
    let mut packed = b"\x81\xa7actions\x84\xc4\x0b__ndarray__\xc3\xc4\x04data\xc4\x60".to_vec();
    packed.extend([0; 96]);
    packed.extend(b"\xc4\x05dtype\xa3<f4\xc4\x05shape\x92\x02\x0c");
    let rows = wheelarm_rollout::policy::openpi::rows(&packed, "actions").expect("rows");
    assert_eq!((rows.count, rows.size), (2, 12));
    read_damaged("msgpack", &packed, 3000, decoders::policy_reply);
}

#[test]
fn damaged_messages_do_not_panic() {
    let sent = command();
    read_damaged("command", &sent.encode_to_vec(), 4000, decoders::command);
    for target in [
        v1::arm_command::Target::Joints(v1::JointTarget {
            positions: vec![0.1; 6],
        }),
        v1::arm_command::Target::Step(v1::CartesianStep::default()),
        v1::arm_command::Target::Hold(true),
    ] {
        let mut other = command();
        other.arm = Some(v1::ArmCommand {
            target: Some(target),
        });
        read_damaged("command", &other.encode_to_vec(), 1000, decoders::command);
    }
    let scenario = v1::Scenario {
        scene: "home".into(),
        task: Some("pick_mustard".into()),
        cameras: vec![v1::CameraSetting {
            name: "gen3".into(),
            width: 64,
            height: 48,
            rate_hz: Some(30.0),
            ..v1::CameraSetting::default()
        }],
        start: Some(pose()),
        objects: vec![v1::ObjectPlacement {
            name: "mustard".into(),
            pose: Some(pose()),
            mass: Some(0.5),
            friction: Some(0.8),
        }],
        ..Default::default()
    };
    let reset = v1::ResetRequest {
        scenario: Some(scenario.clone()),
        snapshot: vec![1, 2, 3].into(),
        ..v1::ResetRequest::default()
    };
    let started = v1::EpisodeStarted {
        header: sent.header.clone(),
        label: "try".into(),
        instruction: "Nimm die Flasche".into(),
        scenario: Some(scenario),
        streams: vec!["imu".into()],
        cameras: vec!["gen3".into()],
        ..Default::default()
    };
    for bytes in [
        reset.encode_to_vec(),
        started.encode_to_vec(),
        v1::ReachRequest {
            pose: Some(pose()),
            near_joints: vec![0.1; 6],
            next_poses: vec![pose(); 2],
            max_joint_change: Some(1.0),
        }
        .encode_to_vec(),
        v1::LeaseRequest {
            header: sent.header.clone(),
            commander: "anna".into(),
            ..Default::default()
        }
        .encode_to_vec(),
        sent.encode_to_vec(),
    ] {
        read_damaged("message", &bytes, 1500, decoders::messages);
        read_damaged("sample", &bytes, 1500, decoders::samples);
    }
}

/// A small log that was closed regularly.
fn log() -> Vec<u8> {
    let folder = tempfile::tempdir().expect("a folder");
    let header = |sequence| v1::Header {
        run_id: "run".into(),
        episode: 1,
        sequence,
        stamp_nanos: sequence * 1000,
        tick: sequence,
    };
    let started = v1::EpisodeStarted {
        header: Some(header(0)),
        label: "small".into(),
        streams: vec!["state_hash".into()],
        cameras: vec!["gen3".into()],
        ..Default::default()
    };
    let snapshot = v1::SnapshotReply {
        header: Some(header(0)),
        ..Default::default()
    };
    let options = WriterOptions::default();
    let mut writer =
        EpisodeWriter::open(folder.path(), &started, &snapshot, &options).expect("a writer");
    for sequence in 0..5 {
        let hash = v1::StateHash {
            header: Some(header(sequence)),
            hash: sequence,
        };
        let offered = writer.offer("state_hash", hash.encode_to_vec().into());
        offered.expect("a sample");
        let frame = v1::CameraFrame {
            header: Some(header(sequence)),
            camera: "gen3".into(),
            intrinsics: Some(v1::Intrinsics {
                width: 4,
                height: 2,
                ..Default::default()
            }),
            color: vec![9; 24].into(),
            depth: vec![0; 32].into(),
            segmentation: vec![1; 8].into(),
            ..Default::default()
        };
        let offered = writer.offer("camera/gen3", frame.encode_to_vec().into());
        offered.expect("a frame");
    }
    let log = writer.close(Closing::default()).expect("a closed log");
    std::fs::read(log).expect("the log")
}

#[test]
fn damaged_logs_do_not_panic() {
    let good = log();
    read_damaged("log", &good, 1500, decoders::recorder_log);
    for length in 0..good.len() {
        decoders::recorder_log(&good[..length]);
    }
}

fn below(folder: &Path, ending: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("a folder").flatten() {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.to_string_lossy().ends_with(ending) {
                let path = path
                    .strip_prefix(root().join("assets"))
                    .expect("below assets");
                found.push(path.to_string_lossy().into_owned());
            }
        }
    }
    found.sort();
    found
}

#[test]
fn damaged_packs_and_reach_maps_do_not_panic() {
    let flat = root().join("tests/data/flat");
    let pack = wheelarm_pack::Pack::open(&flat).expect("the flat");
    let zip = pack.to_zip().expect("a zip file");
    read_damaged("pack", &zip, 1500, decoders::pack_zip);
    let home = std::fs::read(flat.join("home.toml")).expect("a home");
    read_damaged("home.toml", &home, 400, decoders::home_toml);
    let map = root().join("assets/robots/wheelarm/reach.bin");
    let map = std::fs::read(map).expect("a reach map");
    read_damaged("reach.bin", &map, 200, decoders::reach_map);
}

#[test]
fn damaged_ledgers_and_results_do_not_panic() {
    let ledger = root().join("assets/policies/tasks.ledger.json");
    let ledger = std::fs::read(ledger).expect("a ledger");
    read_damaged("ledger", &ledger, 100, decoders::suite_results);
    let results = br#"{"identity": {"format": "wheelarm-suite-results/1"}, "digest": "0"}"#;
    read_damaged("results", results, 1000, decoders::suite_results);
}

#[test]
fn damaged_assets_do_not_panic() {
    let assets = root().join("assets");
    for (ending, count) in [(".toml", 10), (".urdf", 30)] {
        let paths = below(&assets, ending);
        assert!(!paths.is_empty(), "no {ending} in the assets");
        // The packs of `make assets` hold hundreds of files of one form: two of each folder.
        let mut of_packs: BTreeMap<PathBuf, u32> = BTreeMap::new();
        for path in paths {
            if path.starts_with("packs") {
                let folder = Path::new(&path).with_file_name("");
                let taken = of_packs.entry(folder).or_default();
                *taken += 1;
                if *taken > 2 {
                    continue;
                }
            }
            let good = std::fs::read(assets.join(&path)).expect("an asset");
            read_damaged(&path, &good, count, |bytes| decoders::asset(&path, bytes));
        }
    }
    for (ending, read) in [
        (".obj", decoders::obj as fn(&[u8])),
        (".glb", decoders::glb as fn(&[u8])),
    ] {
        for path in below(&assets, ending).into_iter().take(2) {
            let good = std::fs::read(assets.join(&path)).expect("an asset");
            read_damaged(&path, &good, 40, read);
        }
    }
    let square = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//1 4//1\n";
    read_damaged("square.obj", square, 1500, decoders::obj);
}

#[test]
fn damaged_objects_do_not_panic() {
    let wedge = b"v 0 0 0\nv 0.1 0 0\nv 0 0.2 0\nv 0 0 0.05\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";
    read_damaged("wedge.obj", wedge, 1500, decoders::object_mesh);
    read_damaged("wedge.obj", wedge, 25, decoders::object);
    let text = b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 0.1 0 0\n\
        vertex 0 0.2 0.1\nendloop\nendfacet\nendsolid a\n";
    read_damaged("text.stl", text, 1500, decoders::object_mesh);
    let mut binary = vec![b'x'; 80];
    binary.extend(1u32.to_le_bytes());
    binary.extend([0u8; 12]);
    for corner in [0.0f32, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 0.1, 0.1] {
        binary.extend(corner.to_le_bytes());
    }
    binary.extend([0u8; 2]);
    read_damaged("binary.stl", &binary, 1500, decoders::object_mesh);
    for path in below(&root().join("assets"), ".glb").into_iter().take(2) {
        let good = std::fs::read(root().join("assets").join(&path)).expect("an asset");
        read_damaged(&path, &good, 40, decoders::object_mesh);
    }
}

#[test]
fn damaged_homes_do_not_panic() {
    let good = br#"<?xml version='1.0'?>
<home version='7000' wallHeight='250.0' selectedLevel='a'>
<level id='a' name='Ground' elevation='0.0' height='250.0'/>
<furnitureGroup name='Table' level='a'>
<pieceOfFurniture name='Table' model='1' x='10' y='1e2' angle='1.5' width='80' depth='60' height='70'
 modelRotation='1 0 0 0 1 0 0 0 1'><material name='a' color='FF336699' shininess='0.5'/></pieceOfFurniture>
</furnitureGroup>
<wall id='w' wallAtStart='v' xStart='0' yStart='0' xEnd='400' yEnd='0' thickness='10' arcExtent='0.5'>
<texture attribute='leftSideTexture' image='2' width='40' height='20'/>
<baseboard attribute='leftSideBaseboard' thickness='1' height='7'/></wall>
<room name='K&#252;che'><point x='0' y='0'/><point x='400' y='0'/><point x='400' y='300'/></room>
</home>"#;
    read_damaged("home", good, 1500, decoders::home);
}
