//! A mesh becomes an object of a pack, the expert lifts it, and its recording replays without the
//! pack.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use wheelarm_pack::Pack;
use wheelarm_proto::exact;
use wheelarm_tests::{printed, program, root};

fn run(name: &str, packs: &Path, args: &[&str]) -> Output {
    Command::new(program(name).expect("the program"))
        .args(args)
        .env("WHEELARM_ASSETS", root().join("assets"))
        .env("WHEELARM_PACKS", packs)
        .output()
        .expect("a process")
}

/// Runs a command that has to succeed; returns its output.
fn done(name: &str, packs: &Path, args: &[&str]) -> String {
    let output = run(name, packs, args);
    let text = printed(&output);
    assert!(output.status.success(), "{name} {args:?}: {text}");
    text
}

/// An OBJ file of a cylinder in millimetres, y up.
fn cylinder(radius: f64, height: f64) -> String {
    let sides = 40;
    let mut text = format!("v 0 0 0\nv 0 {height} 0\n");
    for k in 0..sides {
        let (sin, cos) = exact::sin_cos(std::f64::consts::TAU * f64::from(k) / f64::from(sides));
        let (x, z) = (radius * cos, -radius * sin);
        writeln!(text, "v {x} 0 {z}\nv {x} {height} {z}").expect("text");
    }
    for k in 0..sides {
        let [a, b] = [k, (k + 1) % sides].map(|side| 3 + 2 * side);
        let (c, d) = (a + 1, b + 1);
        writeln!(text, "f 1 {b} {a}\nf {a} {b} {d} {c}\nf 2 {c} {d}").expect("text");
    }
    text
}

/// Imports a cylinder as a can of the pack `cans`.
fn import(folder: &Path) -> String {
    let mesh = folder.join("tin.obj");
    std::fs::write(&mesh, cylinder(33.0, 110.0)).expect("a file");
    let out = folder.join("packs/cans");
    let [mesh, out] = [mesh, out].map(|path: PathBuf| path.to_string_lossy().into_owned());
    let args = [
        "object",
        "import",
        &mesh,
        "--category",
        "can",
        "--license",
        "CC0-1.0",
        "--author",
        "Ada",
        "--out",
        &out,
    ];
    done("wheelarm", &folder.join("packs"), &args)
}

#[test]
fn imported_mesh_is_lifted_and_its_recording_replays_without_the_pack() {
    let folder = tempfile::tempdir().expect("a folder");
    let packs = folder.path().join("packs");
    let text = import(folder.path());
    for part in [
        "millimetres and y up, guessed",
        "collision: cylinder",
        "next: wheelarm object",
    ] {
        assert!(text.contains(part), "{part:?} is missing in: {text}");
    }
    let text = done(
        "wheelarm",
        &packs,
        &["object", "check", "tin", "--trials", "1"],
    );
    assert!(
        text.contains("tin: 1 of 1 trials; tasks may request it"),
        "{text}"
    );
    let pack = Pack::open(&packs.join("cans")).expect("the pack");
    assert_eq!(pack.credits()[0].author, "Ada");
    let object = pack.file("objects/tin.toml").expect("the object");
    assert!(String::from_utf8_lossy(object).contains("lifted = 1"));
    let out = folder.path().join("out").to_string_lossy().into_owned();
    let args = [
        "evaluate",
        "--scene",
        "bench",
        "--task",
        "bench_lift",
        "--objects",
        "cans",
        "--seeds",
        "0..1",
        "--no-grid",
        "--record",
        "--camera",
        "wheelchair=64x48@1",
        "--out",
        &out,
    ];
    done("wheelarm", &packs, &args);
    std::fs::remove_dir_all(&packs).expect("no pack");
    let mut entries = std::fs::read_dir(&out).expect("a folder").flatten();
    let file = entries.find(|entry| entry.path().extension().is_some_and(|e| e == "h5"));
    let file = file
        .expect("a recording")
        .path()
        .to_string_lossy()
        .into_owned();
    let text = done("wheelarm", &packs, &["replay", &file]);
    assert!(text.contains("hashes equal"), "{text}");
}

#[test]
fn object_of_a_pack_is_placed_in_the_home_of_the_assets() {
    let folder = tempfile::tempdir().expect("a folder");
    let packs = folder.path().join("packs");
    import(folder.path());
    let args = [
        "--objects",
        "cans",
        "--task",
        "take_anything",
        "--draws",
        "0..40",
    ];
    let text = done("wheelarm-server", &packs, &args);
    assert!(text.contains("tin"), "{text}");
    let shipped = ["--objects", "care,kitchen", "--task", "take_mug_in_kitchen"];
    let text = done(
        "wheelarm-server",
        &packs,
        &[&shipped[..], &["--draws", "0..40"]].concat(),
    );
    assert!(text.contains("mug-red"), "{text}");
    let wrong = [
        "--objects",
        "tins",
        "--task",
        "take_anything",
        "--draws",
        "0..1",
    ];
    let output = run("wheelarm-server", &packs, &wrong);
    let text = printed(&output);
    assert!(
        !output.status.success() && text.contains("--packs"),
        "{text}"
    );
}
