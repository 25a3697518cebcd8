//! A person in the chair: sampled from the seed, recorded with body parts and forces, and
//! replayed bit by bit. Without a person none of these records exist.

use std::path::{Path, PathBuf};
use std::process::Command;

use wheelarm_dataset::read::Episode;
use wheelarm_proto::v1;
use wheelarm_tests::{PATIENCE, Server, printed, program, root, wait_until, wheelarm};

fn record(out: &Path, more: &[&str]) -> (Episode, String) {
    let folder = out.to_string_lossy();
    let own = ["evaluate", "--task", "pick_mustard", "--seeds", "0..1"];
    let small = ["--no-grid", "--record", "--camera", "wheelchair=64x48@1"];
    let output = wheelarm(&[&own[..], &small, &["--out", &folder], more].concat());
    let file = out.join("pick_mustard-seed0.h5");
    assert!(file.is_file(), "{}", printed(&output));
    let found = wheelarm_dataset::validate::validate(&file, 1).expect("a readable recording");
    assert!(found.problems.is_empty(), "{found}");
    (Episode::open(&file).expect("a recording"), printed(&output))
}

#[test]
fn sampled_person_is_recorded_by_parts_and_replayed_bit_by_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    let (seated, printed_words) = record(&folder.path().join("seated"), &["--person", "any"]);
    let scenario = seated.scenario().expect("the scenario");
    let person = scenario.person.as_ref().expect("a person");
    let sampled = person.sampled.as_ref().expect("the sampled person");
    let body = root().join("assets/people").join(&sampled.body);
    assert!(body.join("person.toml").is_file(), "{sampled:?}");
    assert!(!sampled.posture.is_empty() && !sampled.clothes.is_empty());

    let ticks = |stream: &str| seated.u64s(stream, "tick").expect("ticks");
    assert_eq!(ticks("person"), ticks("joint_state"));
    let head = seated.f64s("person", "head").expect("the head");
    assert!(head.iter().any(|turn| turn.abs() > 0.02));
    let force = seated.f64s("person", "force").expect("forces");
    assert_eq!(force.len(), 8 * ticks("person").len());
    let most = force.iter().copied().fold(0.0, f64::max);
    assert!(most < 5.0, "{most} N on the person: {printed_words}");
    let names = seated.snapshot().expect("the legend").instances;
    let parts = names
        .iter()
        .filter(|i| i.kind() == v1::InstanceKind::Person);
    let parts: Vec<_> = parts.map(v1::Instance::part).collect();
    for part in [
        v1::BodyPart::Head,
        v1::BodyPart::Face,
        v1::BodyPart::Hands,
        v1::BodyPart::Lap,
    ] {
        assert!(parts.contains(&part), "{parts:?}");
    }

    let again = folder.path().join("again");
    let file = seated.path().to_string_lossy().into_owned();
    let replay = wheelarm(&["replay", &file, "--out", &again.to_string_lossy()]);
    let text = printed(&replay);
    assert!(replay.status.success(), "{text}");
    assert!(text.contains("hashes equal"), "{text}");
    // The person is in the images of the recording and of the replay.
    let replayed = Episode::open(&episode_in(&again)).expect("the replay's recording");
    let person: Vec<u16> = names
        .iter()
        .filter(|i| i.kind() == v1::InstanceKind::Person)
        .map(|i| i.id as u16)
        .collect();
    let segmentation = |of: &Episode| -> Vec<Vec<u16>> {
        let camera = of.camera("wheelchair").expect("the camera");
        let all = 0..camera.stamps().len();
        all.map(|i| camera.ids(of, i).expect("ids")).collect()
    };
    let first = segmentation(&seated);
    assert!(first.iter().flatten().any(|id| person.contains(id)));
    assert!(first == segmentation(&replayed), "other images");

    // The sampled scene is the same without a person; the motion of the chair differs.
    let (empty, _) = record(&folder.path().join("empty"), &[]);
    let alone = empty.scenario().expect("the scenario");
    assert_eq!((alone.person, &alone.objects), (None, &scenario.objects));
    let none = empty.u64s("person", "tick").expect("an empty stream");
    assert!(none.is_empty(), "{none:?}");
    let last = |of: &Episode| of.state_hashes().expect("hashes").pop();
    assert_ne!(last(&empty), last(&seated));
}

fn episode_in(folder: &Path) -> PathBuf {
    let files = std::fs::read_dir(folder).expect("a folder");
    let mut files = files.map(|file| file.expect("a file").path());
    let file = files.find(|file| file.extension().is_some_and(|end| end == "h5"));
    file.expect("an episode")
}

/// One server resets from task to task and from person to person.
#[test]
fn person_appears_in_tasks_that_need_one_and_disappears_afterwards() {
    let args = ["--camera", "wheelchair=64x48@10", "--quality", "fast"];
    let server = Server::start("seats", &args).expect("a server");
    let client = server.client();
    let camera = client.camera("wheelchair", 2).expect("the camera");
    let parts = || -> Vec<u32> {
        let scene: v1::SceneReply = client.request(&v1::SceneRequest {}).expect("the scene");
        let instances = scene.instances.iter();
        let parts = instances.filter(|i| i.kind() == v1::InstanceKind::Person);
        parts.map(|i| i.id).collect()
    };
    let shows = |ids: &[u32]| {
        let frame = camera.next(PATIENCE).expect("images");
        let frame = frame.expect("an image");
        let mut pixels = (0..48).flat_map(|y| (0..64).map(move |x| (x, y)));
        pixels.any(|(x, y)| {
            frame
                .instance_at(x, y)
                .is_some_and(|id| ids.contains(&id.into()))
        })
    };
    let reset = |task: &str, limit: Option<f64>, person: Option<&str>| {
        let person = person.map(|text| v1::Person::from_text(text).expect("a person"));
        let scenario = v1::Scenario {
            task: Some(task.to_owned()),
            seed: Some(3),
            time_limit_seconds: limit,
            person,
            ..v1::Scenario::default()
        };
        let request = v1::ResetRequest {
            scenario: Some(scenario),
            ..v1::ResetRequest::default()
        };
        let reply: v1::ResetReply = client.request(&request).expect("a reset");
        reply.scenario.expect("the scenario")
    };
    // The same task, seed and objects, with a person in the chair.
    reset("pick_mustard", None, None);
    assert!(parts().is_empty());
    reset("pick_mustard", None, Some("man_p50"));
    let ids = parts();
    assert!(!ids.is_empty());
    wait_until("the person is visible", || shows(&ids));
    let alone = reset("pick_mustard", Some(0.0), Some("none"));
    assert_eq!(alone.person, None);
    wait_until("the chair is empty", || !shows(&ids));
    // A care task adds a person, the next task removes it.
    let drink = reset("serve_drink", None, None);
    assert!(drink.person.is_some_and(|person| person.guard));
    wait_until("the person is visible", || shows(&ids));
    // Without a time limit in the scenario, each task sets its own.
    assert_ne!(drink.time_limit_seconds, alone.time_limit_seconds);
    let after = reset("pick_mustard", None, None);
    assert_eq!(after.person, None);
    assert_eq!(after.time_limit_seconds, alone.time_limit_seconds);
}

#[test]
fn unknown_person_is_rejected_with_the_available_ones() {
    let refused = |person: &str| {
        let output = Command::new(program("wheelarm-server").expect("the server"))
            .args(["--no-cameras", "--person", person])
            .env("WHEELARM_ASSETS", root().join("assets"))
            .output()
            .expect("a process");
        assert!(!output.status.success());
        printed(&output)
    };
    assert!(refused("man_p51").contains("man_p50"));
    assert!(refused("any/handstand").contains("hands_in_lap"));
    assert!(refused("../x").contains("BODY[/POSTURE]"));
}
