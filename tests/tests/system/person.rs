//! A person in the chair: drawn by the seed, told, recorded with parts and forces, and
//! replayed bit by bit; nothing of it where nobody sits there.

use std::path::Path;
use std::process::{Command, Output};

use wheelarm_dataset::read::Episode;
use wheelarm_proto::v1;
use wheelarm_tests::{printed, program, root};

fn wheelarm(args: &[&str]) -> Output {
    Command::new(program("wheelarm").expect("the client"))
        .args(args)
        .env("WHEELARM_ASSETS", root().join("assets"))
        .output()
        .expect("a process")
}

fn recorded(out: &Path, more: &[&str]) -> (Episode, String) {
    let folder = out.to_string_lossy();
    let own = ["evaluate", "--task", "pick_mustard", "--seeds", "2..3"];
    let small = ["--no-grid", "--record", "--camera", "wheelchair=64x48@1"];
    let output = wheelarm(&[&own[..], &small, &["--out", &folder], more].concat());
    let file = out.join("pick_mustard-seed2.h5");
    assert!(file.is_file(), "{}", printed(&output));
    (Episode::open(&file).expect("a recording"), printed(&output))
}

#[test]
fn a_person_is_drawn_recorded_by_parts_and_replayed_bit_by_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    let (seated, printed_words) = recorded(&folder.path().join("seated"), &["--person", "any"]);
    let scenario = seated.scenario().expect("the scenario");
    let person = scenario.person.as_ref().expect("a person");
    let drawn = person.drawn.as_ref().expect("who was drawn");
    let body = root().join("assets/people").join(&drawn.body);
    assert!(body.join("person.toml").is_file(), "{drawn:?}");
    assert!(!drawn.posture.is_empty() && !drawn.clothes.is_empty());

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

    let replay = wheelarm(&["replay", &seated.path().to_string_lossy()]);
    let text = printed(&replay);
    assert!(replay.status.success(), "{text}");
    assert!(text.contains("hashes equal"), "{text}");

    // The scene is drawn as without anybody; the chair moves otherwise.
    let (empty, _) = recorded(&folder.path().join("empty"), &[]);
    let alone = empty.scenario().expect("the scenario");
    assert_eq!((alone.person, &alone.objects), (None, &scenario.objects));
    let none = empty.u64s("person", "tick").expect("an empty stream");
    assert!(none.is_empty(), "{none:?}");
    let last = |of: &Episode| of.state_hashes().expect("hashes").pop();
    assert_ne!(last(&empty), last(&seated));
}

#[test]
fn who_is_not_there_is_refused_with_those_who_are() {
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
