//! Commands and seeds that broke an earlier physics.

use std::path::PathBuf;
use std::process::Command;

use wheelarm_tests::adversary::{GuardRun, Kind, Recorded, Run, runs};
use wheelarm_tests::{printed, program, root};

/// Commands that pressed, tore and threw the bear until an earlier physics computed 10¹⁷ N
/// and panicked. Each is played until two seconds after that moment.
#[test]
fn commands_that_broke_the_bear_do_not_break_it_now() {
    let folder = root().join("tests/data/adversarial");
    let mut files: Vec<PathBuf> = std::fs::read_dir(&folder)
        .expect("the stored commands")
        .flatten()
        .map(|entry| entry.path())
        .filter(|path| path.extension().is_some_and(|e| e == "commands"))
        .collect();
    files.sort();
    assert_eq!(files.len(), 9, "{files:?}");
    let assets = root().join("assets");
    std::thread::scope(|scope| {
        for half in files.chunks(files.len().div_ceil(2)) {
            let assets = &assets;
            scope.spawn(move || {
                for file in half {
                    let run = Recorded::read(file).expect("stored commands");
                    let verdict = run.play(assets).expect("a scenario");
                    println!("{}: {verdict:?}", file.display());
                    assert!(verdict.broken.is_empty(), "{}: {verdict:?}", file.display());
                    assert!(
                        verdict.unlawful.is_empty(),
                        "{}: {verdict:?}",
                        file.display()
                    );
                    assert!(verdict.ticks > 240 * 2, "{}: {verdict:?}", file.display());
                }
            });
        }
    });
}

/// Adversarial operators that broke an earlier physics of the rigid home. Each runs until two
/// seconds after that moment: an arm link 80 mm deep in a table (seeds 1, 134), flung wrists
/// (42, 78, 82, 132), a wedged chair (77).
#[test]
fn operators_that_broke_the_rigid_home_do_not_break_it_now() {
    let broke = [
        ("pick_blue_mug", Kind::Joints, 1, 25.3),
        ("pick_meat_can", Kind::PressDown, 42, 20.6),
        ("pick_grey_cup", Kind::Ram, 77, 43.5),
        ("pick_meat_can", Kind::PressDown, 78, 22.9),
        ("place_knife", Kind::Joints, 82, 37.2),
        ("open_drawer", Kind::PressDown, 132, 27.5),
        ("pick_bowl", Kind::Harass, 134, 42.4),
    ];
    let assets = root().join("assets");
    let runs = runs(140, 0, 0);
    for (task, kind, seed, then) in broke {
        let of = |run: &&Run| (run.task, run.kind, run.seed) == (task, kind, seed);
        let run = runs.iter().find(of).expect("the run that broke");
        let verdict = run.play(&assets, then + 2.0).expect("a scenario");
        assert!(verdict.broken.is_empty(), "{run:?}: {verdict:?}");
        assert!(verdict.ticks as f64 > 240.0 * then, "{run:?}: {verdict:?}");
    }
}

/// Episodes in which earlier guards let a part of the person be pressed with 20 to 1,900 N:
/// a bicep and a forearm beside the torso (1033, 50082), a wrist held by the bicep (1045), a
/// chair that turns before a table (1145), an arm that carries a can (50101).
#[test]
fn guard_keeps_every_part_of_the_person_below_15_newtons() {
    let assets = root().join("assets");
    std::thread::scope(|scope| {
        for half in [&[1033, 1045, 1145][..], &[50082, 50101]] {
            let assets = &assets;
            scope.spawn(move || {
                for &seed in half {
                    let run = GuardRun { seed, guard: true };
                    let verdict = run.play(assets, 10.0).expect("a scenario");
                    assert!(verdict.fault.is_none(), "{seed}: {verdict:?}");
                    assert!(verdict.broken.is_empty(), "{seed}: {verdict:?}");
                    assert!(verdict.ticks == 600, "{seed}: {verdict:?}");
                }
            });
        }
    });
    let unguarded = GuardRun {
        seed: 1145,
        guard: false,
    };
    let verdict = unguarded.play(&assets, 10.0).expect("a scenario");
    assert!(!verdict.broken.is_empty(), "the operator is too weak");
}

/// Seeds of the bear's task around the one that broke an earlier physics.
#[test]
fn expert_does_not_break_the_bear() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = Command::new(program("wheelarm").expect("the client"))
        .args([
            "evaluate",
            "--task",
            "place_teddy_bear",
            "--seeds",
            "1000..1002",
        ])
        .args(["--no-grid", "--out"])
        .arg(folder.path().join("out"))
        .env("WHEELARM_ASSETS", root().join("assets"))
        .output()
        .expect("a process");
    let text = printed(&output);
    assert!(!text.contains("broke"), "{text}");
    // The expert drops the bear sometimes.
    let took_one = ["1/2", "2/2"].iter().any(|share| text.contains(share));
    assert!(took_one, "{text}");
}
