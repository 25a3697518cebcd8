//! Own homes: a scenario names plan, style and layout seed, and the server makes the home.

use std::fs;
use std::process::Command;

use wheelarm_pack::{Pack, to_hex};
use wheelarm_proto::v1;
use wheelarm_tests::{Server, printed, program, root};

#[test]
fn server_makes_the_home_that_a_scenario_names_and_returns_its_digests() {
    let place = tempfile::tempdir().expect("a folder");
    let [made, none] = ["made", "none"].map(|name| place.path().join(name));
    fs::create_dir_all(&none).expect("a folder");
    let output = Command::new(program("wheelarm").expect("the client"))
        .args(["home", "make", "studio", "--layout-seed", "3", "--out"])
        .arg(&made)
        .env("WHEELARM_ASSETS", root().join("assets"))
        .output()
        .expect("a process");
    assert!(output.status.success(), "{}", printed(&output));
    let pack = Pack::open(&made.join("studio-nordic-3")).expect("a pack");
    let digests = [&pack.id().physics, &pack.id().rendering].map(to_hex);

    let folder = none.to_string_lossy().into_owned();
    let args = ["--no-cameras", "--packs", &folder];
    let server = Server::start("own-homes", &args).expect("a server");
    let client = server.client();
    let reset = |scenario: v1::Scenario| {
        let reply = client.request(&v1::ResetRequest {
            scenario: Some(scenario),
            ..v1::ResetRequest::default()
        });
        reply
            .map(|reply| reply.scenario.expect("a scenario"))
            .map_err(|error| error.to_string())
    };
    let studio = v1::Scenario {
        scene: "studio".into(),
        layout_seed: Some(3),
        task: Some("take_anything".into()),
        seed: Some(1),
        ..v1::Scenario::default()
    };
    let scenario = reset(studio.clone()).expect("a reset");
    assert_eq!(scenario.scene, "studio-nordic-3");
    assert_eq!(scenario.layout_seed, Some(3));
    assert_eq!(scenario.home_style, "nordic");
    assert_eq!(scenario.object_split, "any");
    let of = |pack: &v1::PackRef| [pack.physics_digest.clone(), pack.rendering_digest.clone()];
    assert_eq!(scenario.packs.iter().map(of).collect::<Vec<_>>(), [digests]);
    assert!(!scenario.objects.is_empty());

    // The reply and the name alone are requests for the same home.
    for same in [
        scenario.clone(),
        v1::Scenario {
            scene: "studio-nordic-3".into(),
            layout_seed: None,
            ..studio.clone()
        },
    ] {
        let again = reset(same).expect("a reset");
        assert_eq!(
            (&again.scene, &again.packs, &again.objects),
            (&scenario.scene, &scenario.packs, &scenario.objects)
        );
    }
    // The map of the home: its rooms, doors and files of Nav2.
    let map = client.request(&v1::MapRequest::default()).expect("a map");
    let cells = map.width as usize * map.height as usize;
    assert_eq!([map.occupied.len(), map.free.len()], [cells; 2]);
    assert!(map.free.contains(&0) && map.occupied.contains(&100));
    assert!(map.occupied.contains(&u8::MAX), "cells outside of the home");
    assert!(!map.rooms.is_empty() && !map.doors.is_empty());
    assert!(map.doors.iter().all(|door| door.clear_width <= door.width));
    let output = Command::new(program("wheelarm").expect("the client"))
        .args(["--connect", &server.endpoint, "--sim", &server.sim])
        .args(["map", "--name", "studio", "--layer", "free", "--out"])
        .arg(&made)
        .output()
        .expect("a process");
    assert!(output.status.success(), "{}", printed(&output));
    let image = fs::read(made.join("studio.pgm")).expect("an image");
    let head = format!("P5\n{} {}\n255\n", map.width, map.height);
    assert!(image.starts_with(head.as_bytes()) && image.len() == head.len() + cells);
    let top_right = image.last().copied();
    let level = match map.free[map.width as usize - 1] {
        0 => 254,
        100 => 0,
        _ => 205,
    };
    assert_eq!(
        top_right,
        Some(level),
        "the last row of the image is the first of the map"
    );

    // A layout seed alone is another layout of the plan.
    let other = reset(v1::Scenario {
        layout_seed: Some(4),
        task: Some("take_anything".into()),
        ..v1::Scenario::default()
    })
    .expect("a reset");
    assert_eq!(other.scene, "studio-nordic-4");
    assert_ne!(other.packs, scenario.packs);

    let mut wrong = scenario.clone();
    wrong.packs[0].physics_digest = "ab".repeat(32);
    for (request, words) in [
        (wrong, "wheelarm pack extract"),
        (
            v1::Scenario {
                scene: "castle".into(),
                ..studio.clone()
            },
            "no plan named \"castle\"",
        ),
        (
            v1::Scenario {
                home_style: "baroque".into(),
                ..studio
            },
            "no style named \"baroque\"",
        ),
    ] {
        let error = reset(request).expect_err("a refusal");
        assert!(error.contains(words), "{error}");
    }
}
