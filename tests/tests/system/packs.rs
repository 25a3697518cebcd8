//! World packs: a task in a small flat, its recording on a host without the pack, packs that a
//! client sends, and packs that cannot be used.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::Arc;

use wheelarm_dataset::read::Episode;
use wheelarm_pack::{Pack, Store, to_hex};
use wheelarm_proto::v1;
use wheelarm_server::appearance::{Appearance, Kind, SampledAppearance};
use wheelarm_server::robot::RobotModel;
use wheelarm_server::scene::Scene;
use wheelarm_server::sensors::camera::RenderScene;
use wheelarm_server::tasks;
use wheelarm_tests::{Server, printed, program, root};

/// The files of tests/data/flat, with an image of its own on the tiles.
fn files() -> BTreeMap<String, Vec<u8>> {
    let pack = Pack::open(&root().join("tests/data/flat")).expect("the flat");
    let mut files = pack.files().clone();
    let image = fs::read(root().join("assets/textures/tiles.png")).expect("an image");
    files.insert("textures/own.png".into(), image);
    let materials = String::from_utf8_lossy(&files["materials/flat.toml"]).into_owned();
    let materials = materials.replace("\"tiles\"", "\"own\"");
    files.insert("materials/flat.toml".into(), materials.into_bytes());
    files
}

fn flat() -> Pack {
    Pack::from_files(files()).expect("the flat")
}

/// Runs `wheelarm` with these folders of packs.
fn wheelarm(packs: &Path, args: &[&str]) -> Output {
    Command::new(program("wheelarm").expect("the client"))
        .args(args)
        .env("WHEELARM_ASSETS", root().join("assets"))
        .env("WHEELARM_PACKS", packs)
        .output()
        .expect("a process")
}

fn succeeds(packs: &Path, args: &[&str]) -> String {
    let output = wheelarm(packs, args);
    assert!(output.status.success(), "{args:?}: {}", printed(&output));
    printed(&output)
}

/// The only recording of a folder.
fn recording(folder: &Path) -> PathBuf {
    let entries = fs::read_dir(folder).expect("a folder").flatten();
    let mut paths = entries.map(|entry| entry.path());
    let found = paths.find(|path| path.extension().is_some_and(|ending| ending == "h5"));
    found.expect("a recording")
}

#[test]
fn recording_in_a_pack_replays_without_its_folder_with_equal_hashes_and_images() {
    let place = tempfile::tempdir().expect("a folder");
    let [packs, none, first, again, out] =
        ["packs", "none", "first", "again", "out"].map(|name| place.path().join(name));
    fs::create_dir_all(&none).expect("a folder");
    let pack = flat();
    pack.write_folder(&packs.join("flat")).expect("a pack");

    let text = |path: &Path| path.to_string_lossy().into_owned();
    let small = [
        "--width",
        "96",
        "--height",
        "64",
        "--rate",
        "2",
        "--no-sheet",
    ];
    let (out_first, scene) = (text(&first), ["--scene", "flat", "--task", "pick_jar"]);
    let demo = [
        &["demo", "--seed", "1", "--out", &out_first][..],
        &small,
        &scene,
    ]
    .concat();
    let done = succeeds(&packs, &demo);
    assert!(done.contains("missed      0 (complete)"), "{done}");
    let file = recording(&first);
    let episode = Episode::open(&file).expect("an episode");
    assert!(episode.summary().expect("a summary").success);

    // The scenario and the file name and hold the pack.
    let scenario = episode.scenario().expect("a scenario");
    assert_eq!(
        scenario.draws,
        Some(2),
        "rules of sampling of a home with rooms"
    );
    let recorded = scenario.packs;
    assert_eq!(recorded.len(), 1);
    assert_eq!(recorded[0].physics_digest, to_hex(&pack.id().physics));
    assert_eq!(recorded[0].rendering_digest, to_hex(&pack.id().rendering));
    let held = episode.packs().expect("packs");
    let unpacked = Pack::from_zip(&held[0].zip).expect("a pack");
    assert_eq!(unpacked.files(), pack.files());
    assert_eq!(held[0].pack.as_ref(), Some(&recorded[0]));

    // Without the folder, the pack of the recording is used.
    fs::remove_dir_all(&packs).expect("the folder is removed");
    let (path, out_again) = (text(&file), text(&again));
    let replay = succeeds(&none, &["replay", &path, "--out", &out_again]);
    assert!(replay.contains("hashes equal"), "{replay}");
    let repeated = Episode::open(&recording(&again)).expect("an episode");
    assert_eq!(
        repeated.state_hashes().expect("hashes"),
        episode.state_hashes().expect("hashes")
    );
    for name in episode.cameras().expect("cameras") {
        let [a, b] = [&episode, &repeated].map(|e| e.camera(&name).expect("a camera"));
        assert_eq!(a.stamps(), b.stamps());
        assert!(a.stamps().len() > 3, "{name}");
        for i in 0..a.stamps().len() {
            assert_eq!(
                a.rgb(&episode, i).expect("color"),
                b.rgb(&repeated, i).expect("color"),
                "{name} {i}"
            );
        }
    }
    succeeds(&none, &["dataset", "validate", &path]);

    exports_name_authors_and_licenses(&place.path().join("exports"), &none, &path);

    // Labels know furniture and objects of the pack from the texts of the recording.
    let labels = text(&place.path().join("labels"));
    succeeds(&none, &["dataset", "annotate", &path, "--out", &labels]);

    // And it can be taken out of the recording.
    let out_text = text(&out);
    succeeds(&none, &["pack", "extract", &path, "--out", &out_text]);
    let extracted = Pack::open(&out.join("flat.zip")).expect("a pack");
    assert_eq!(extracted.id(), pack.id());
    let over = wheelarm(&none, &["pack", "extract", &path, "--out", &out_text]);
    assert!(!over.status.success(), "a file is not written over");
}

/// Exports carry author and license of the pack, and its doors as joints.
fn exports_name_authors_and_licenses(out: &Path, packs: &Path, recording: &str) {
    let export = |format: &str, more: &[&str]| {
        let folder = out.join(format);
        let text = folder.to_string_lossy().into_owned();
        let args = ["dataset", "export", "--format", format, recording, "--out"];
        succeeds(packs, &[&args[..], &[&text], more].concat());
        folder
    };
    let bag = recording_entry(&export("rosbag2", &[])).join("metadata.yaml");
    let bag = fs::read_to_string(bag).expect("metadata");
    let log = fs::read(recording_entry(&export("mcap", &[]))).expect("a log");
    let log = String::from_utf8_lossy(&log).into_owned();
    let set = export("lerobot", &["--pictures", "png"]);
    let card = fs::read_to_string(set.join("README.md")).expect("a card");
    let json = fs::read_to_string(set.join("meta/world_packs.json")).expect("credits");
    for (what, text) in [("bag", bag), ("log", log), ("card", card), ("json", json)] {
        for words in ["flat", "CC0-1.0", "WheelArm", "jar"] {
            assert!(text.contains(words), "the {what} lacks {words:?}");
        }
    }
}

/// The only entry of a folder.
fn recording_entry(folder: &Path) -> PathBuf {
    let mut entries = fs::read_dir(folder).expect("a folder").flatten();
    entries.next().expect("an entry").path()
}

#[test]
fn check_for_commercial_use_names_the_parts_that_do_not_permit_it() {
    let place = tempfile::tempdir().expect("a folder");
    let [free, bound] = ["free", "bound"].map(|name| place.path().join(name));
    flat().write_folder(&free).expect("a pack");
    let mut changed = files();
    let jar = String::from_utf8_lossy(&changed["objects/jar.toml"]).into_owned();
    let jar = jar.replace("\"CC0-1.0\"", "\"CC-BY-NC-4.0\"");
    changed.insert("objects/jar.toml".into(), jar.into_bytes());
    let pack = Pack::from_files(changed).expect("a pack");
    pack.write_folder(&bound).expect("a pack");
    let check = |folder: &Path, more: &[&str]| {
        let path = folder.to_string_lossy().into_owned();
        let output = wheelarm(
            place.path(),
            &[&["pack", "check", &path][..], more].concat(),
        );
        (output.status.success(), printed(&output))
    };
    let commercial = ["--license", "commercial"];
    let (passes, text) = check(&free, &commercial);
    assert!(passes && text.contains("permits commercial use"), "{text}");
    let (passes, text) = check(&bound, &[]);
    assert!(passes && text.contains("note: pack \"flat\""), "{text}");
    let (passes, text) = check(&bound, &commercial);
    assert!(!passes && text.contains("jar (CC-BY-NC-4.0)"), "{text}");
    assert!(text.contains("remove or replace"), "{text}");
}

#[test]
fn scenario_that_names_another_pack_is_refused_with_both_digests() {
    let packs = tempfile::tempdir().expect("a folder");
    flat()
        .write_folder(&packs.path().join("flat"))
        .expect("a pack");
    let folder = packs.path().to_string_lossy().into_owned();
    let args = ["--no-cameras", "--packs", &folder];
    let server = Server::start("packed", &args).expect("a server");
    let client = server.client();
    let reset = |scenario: v1::Scenario| {
        client.request(&v1::ResetRequest {
            scenario: Some(scenario),
            ..v1::ResetRequest::default()
        })
    };
    let of_flat = |physics: &str| v1::Scenario {
        scene: "flat".into(),
        task: Some("pick_jar".into()),
        packs: vec![v1::PackRef {
            name: "flat".into(),
            physics_digest: physics.into(),
            ..v1::PackRef::default()
        }],
        ..v1::Scenario::default()
    };
    let wrong = "ab".repeat(32);
    let error = reset(of_flat(&wrong)).expect_err("a refusal").to_string();
    for words in [&wrong[..16], "flat 1", "wheelarm pack put"] {
        assert!(error.contains(words), "{error}");
    }
    let error = reset(of_flat("abc")).expect_err("a refusal").to_string();
    assert!(error.contains("64 hexadecimal digits"), "{error}");
    let right = to_hex(&flat().id().physics);
    let reply = reset(of_flat(&right)).expect("a reset");
    let scenario = reply.scenario.expect("a scenario");
    assert_eq!(scenario.packs[0].physics_digest, right);
    assert_eq!(scenario.objects[0].name, "jar_1");
    assert_eq!(scenario.draws, Some(2));
    // A seed alone keeps the pack; another scene has none.
    let again = reset(v1::Scenario {
        seed: Some(3),
        ..v1::Scenario::default()
    });
    assert_eq!(
        again.expect("a reset").scenario.expect("one").packs.len(),
        1
    );
    let home = reset(v1::Scenario {
        scene: "home".into(),
        task: Some("pick_mustard".into()),
        ..v1::Scenario::default()
    });
    let home = home.expect("a reset").scenario.expect("one");
    assert_eq!((home.packs.len(), home.draws), (0, Some(1)));
    let error = reset(v1::Scenario {
        scene: "castle".into(),
        ..v1::Scenario::default()
    });
    let error = error.expect_err("a refusal").to_string();
    for words in ["no scene named \"castle\"", "home", "flat"] {
        assert!(error.contains(words), "{error}");
    }
}

#[test]
fn sent_pack_is_stored_by_digest_and_serves_as_a_scene() {
    let place = tempfile::tempdir().expect("a folder");
    let [store, own] = ["store", "own"].map(|name| place.path().join(name));
    flat().write_folder(&own).expect("a pack");
    let folder = store.to_string_lossy().into_owned();
    let mut server =
        Server::start("receiving", &["--no-cameras", "--packs", &folder]).expect("a server");
    let own_text = own.to_string_lossy().into_owned();
    let run = |args: &[&str]| server.run_client(args).expect("a process");
    let sent = run(&["pack", "put", &own_text]);
    assert!(printed(&sent).contains("sent flat 1"), "{}", printed(&sent));
    let listed = run(&["pack", "list", "--server"]);
    assert!(printed(&listed).contains("flat 1"), "{}", printed(&listed));
    let reset = run(&["reset", "--scene", "flat"]);
    assert!(reset.status.success(), "{}", printed(&reset));
    let stored = Store::new(vec![store.clone()]).open("flat");
    assert_eq!(stored.expect("a pack").expect("one").id(), flat().id());

    // Other files and packs with the name of a scene are not stored.
    let client = server.client();
    let put = |zip: &[u8], digest: &str| {
        client.request(&v1::PackPutRequest {
            transfer: 7,
            zip_digest: digest.to_owned(),
            zip_length: zip.len() as u64,
            offset: 0,
            piece: zip.to_vec().into(),
        })
    };
    let digest = |zip: &[u8]| to_hex(&wheelarm_proto::digest::of_message([zip]));
    let zip = flat().to_zip().expect("a zip file");
    let error = put(&zip, &digest(b"another")).expect_err("a refusal");
    assert!(error.to_string().contains("send it again"), "{error}");
    let error = put(b"not a zip file", &digest(b"not a zip file")).expect_err("a refusal");
    assert!(error.to_string().contains("cannot be read"), "{error}");
    let mut renamed = files();
    let manifest = String::from_utf8_lossy(&renamed["pack.toml"]).replace("\"flat\"", "\"home\"");
    renamed.insert("pack.toml".into(), manifest.into_bytes());
    let home = Pack::from_files(renamed)
        .expect("a pack")
        .to_zip()
        .expect("a zip file");
    let error = put(&home, &digest(&home)).expect_err("a refusal");
    assert!(error.to_string().contains("scene of the assets"), "{error}");
    let kept = fs::read_dir(&store).expect("the store").count();
    assert_eq!(kept, 1);
    assert!(server.alive());
}

#[test]
fn invalid_pack_is_skipped_and_others_are_served() {
    let place = tempfile::tempdir().expect("a folder");
    flat()
        .write_folder(&place.path().join("flat"))
        .expect("a pack");
    let broken = place.path().join("broken");
    flat().write_folder(&broken).expect("a pack");
    fs::write(broken.join("home.toml"), "origin = 3").expect("a file");
    fs::write(place.path().join("rubbish.zip"), "rubbish").expect("a file");
    let folder = place.path().to_string_lossy().into_owned();
    let args = ["--no-cameras", "--packs", &folder, "--scene", "flat"];
    let server = Server::start("skipping", &args).expect("a server");
    let reply = server
        .client()
        .request(&v1::PacksRequest {})
        .expect("packs");
    let names: Vec<&str> = reply.packs.iter().map(|pack| pack.name.as_str()).collect();
    // Besides those of the assets.
    assert!(
        names.contains(&"bench") && names.contains(&"flat") && !names.contains(&"broken"),
        "{names:?}"
    );
    assert_eq!(reply.problems.len(), 2, "{:?}", reply.problems);
    // Its task is offered beside those of the assets.
    let tasks = server
        .client()
        .request(&v1::TasksRequest {})
        .expect("tasks");
    let names: Vec<&str> = tasks.tasks.iter().map(|task| task.name.as_str()).collect();
    assert!(names.contains(&"pick_jar") && names.contains(&"pick_mustard"));
    let checked = wheelarm(place.path(), &["pack", "check", &broken.to_string_lossy()]);
    let text = printed(&checked);
    assert!(
        !checked.status.success() && text.contains("home.toml"),
        "{text}"
    );
    let list = succeeds(place.path(), &["pack", "list"]);
    assert!(
        list.contains("broken: not usable") && list.contains("flat 1"),
        "{list}"
    );
}

#[test]
fn hulls_of_a_pack_have_boxes_and_its_doors_hinges() {
    let scene = Scene::from_pack(&root().join("assets"), &Arc::new(flat())).expect("a scene");
    let body = |name: &str| &scene.furniture[scene.furniture_named(name).expect("furniture")];
    let table = body("table_1");
    assert_eq!((table.collision.len(), table.hulls.len()), (1, 1));
    let boxes: Vec<_> = table.collision_boxes().collect();
    assert_eq!(boxes.len(), 2);
    let (pose, half) = &boxes[1];
    let low = pose.translation.vector - half;
    assert!((low.x + 0.3).abs() < 1e-9 && (low.y + 0.5).abs() < 1e-9 && low.z.abs() < 1e-9);
    assert!((half.z - 0.35).abs() < 1e-9);
    assert_eq!(scene.joints.len(), 2);
    assert_eq!(scene.furniture[0].name, "floor");
    // Objects and materials of the pack, then those of the assets.
    assert_eq!(scene.objects[0].category, "jar");
    let floor = &scene.furniture[0].visual;
    let own = floor.iter().filter_map(|v| v.material.texture.as_ref());
    let own: Vec<_> = own.filter(|texture| texture.file.is_some()).collect();
    assert!(!own.is_empty());
    assert!(own.iter().all(|t| t.pattern == "packs/flat/textures/own"));
}

/// The assets with folders of its own for areas and tasks.
fn assets_with_own_tasks(folder: &Path) -> PathBuf {
    let assets = folder.join("assets");
    for name in ["areas", "tasks"] {
        fs::create_dir_all(assets.join(name)).expect("a folder");
        let entries = fs::read_dir(root().join("assets").join(name)).expect("a folder");
        for entry in entries.flatten() {
            let to = assets.join(name).join(entry.file_name());
            fs::copy(entry.path(), to).expect("a copy");
        }
    }
    for entry in fs::read_dir(root().join("assets"))
        .expect("the assets")
        .flatten()
    {
        let to = assets.join(entry.file_name());
        if !to.exists() {
            std::os::unix::fs::symlink(entry.path(), to).expect("a link");
        }
    }
    assets
}

#[test]
fn invalid_task_or_area_costs_only_itself() {
    let folder = tempfile::tempdir().expect("a folder");
    let assets = assets_with_own_tasks(folder.path());
    let model = RobotModel::load(&assets, "wheelarm").expect("the robot");
    let hand = model.settings.gripper.corridor;
    let names = || -> Vec<String> {
        let usable = tasks::usable(&assets, None, &hand).expect("tasks");
        usable.into_iter().map(|task| task.name).collect()
    };
    assert_eq!(names(), wheelarm_tests::TASKS);
    fs::write(assets.join("areas/workstation.toml"), "scene = 3").expect("a file");
    fs::write(assets.join("tasks/pick_bowl.toml"), "area = []").expect("a file");
    let left = names();
    let gone = ["open_drawer", "close_drawer", "pick_bowl"];
    let expected = wheelarm_tests::TASKS.into_iter();
    let expected: Vec<&str> = expected.filter(|name| !gone.contains(name)).collect();
    assert_eq!(left, expected);
    assert!(tasks::list(&assets, &hand).is_err());
}

#[test]
fn home_of_a_pack_has_appearances_without_a_file() {
    let assets = root().join("assets");
    let scene = Scene::from_pack(&assets, &Arc::new(flat())).expect("a scene");
    let appearance = |seed| Appearance {
        seed,
        light: 3,
        background: 3,
        materials: 3,
        exposure: 3,
        decoration: 3,
        ..Appearance::default()
    };
    let model = RobotModel::load(&assets, "wheelarm").expect("the robot");
    let looks = [1, 2].map(|seed| {
        SampledAppearance::new(appearance(seed), &scene, &assets).expect("an appearance")
    });
    assert_ne!(looks[0], looks[1]);
    let count = |kind: Kind| {
        let looks = looks.iter().flat_map(|look| &look.decoration);
        looks.filter(|decoration| decoration.kind == kind).count()
    };
    // The hall has no ceiling: only the kitchen can have a lamp.
    assert!(count(Kind::Lamp) <= looks.len());
    assert!(count(Kind::Rug) > 0 && count(Kind::WallImage) > 0);
    for look in &looks {
        RenderScene::with_appearance(&model, &scene, &assets, Some(look)).expect("a scene");
    }
}
