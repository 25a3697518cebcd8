//! Whole episodes: server, expert and recorder as processes, in lock-step, here and on a CPU
//! whose C library computes other bits.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use wheelarm_proto::program::skipped;
use wheelarm_tests::{printed, program, root};

/// Size and rate that keep the software renderer quick.
const SMALL: [&str; 6] = ["--width", "160", "--height", "96", "--rate", "10"];

/// Disables the fast variants of the C library, whose sine and similar functions differ in the
/// last bits: a process then computes as on another CPU.
const OTHER_CPU: (&str, &str) = (
    "GLIBC_TUNABLES",
    "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX2_Usable,-FMA_Usable,-FMA4_Usable",
);

fn wheelarm(args: &[&str], on_other_cpu: bool) -> Output {
    Command::new(program("wheelarm").expect("the client"))
        .args(args)
        .env("WHEELARM_ASSETS", root().join("assets"))
        .envs(on_other_cpu.then_some(OTHER_CPU))
        .output()
        .expect("a process")
}

fn demo(out: &Path, on_other_cpu: bool) -> PathBuf {
    let folder = out.to_string_lossy();
    let args = [&["demo", "--seed", "1", "--out", &folder], &SMALL[..]].concat();
    let output = wheelarm(&args, on_other_cpu);
    assert!(output.status.success(), "{}", printed(&output));
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(text.contains("missed      0 (complete)"), "{text}");
    let file = std::fs::read_dir(out)
        .expect("the folder")
        .flatten()
        .map(|entry| entry.path())
        .find(|path| path.extension().is_some_and(|e| e == "h5"));
    file.expect("an episode file")
}

/// Runs a Python check of the tests folder; `None` without h5py.
fn python(script: &str, args: &[&Path]) -> Option<Output> {
    let python = std::env::var("WHEELARM_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let importable = Command::new(&python)
        .args(["-c", "import h5py, numpy"])
        .output();
    if !importable.is_ok_and(|o| o.status.success()) {
        skipped(&format!(
            "{python} cannot import h5py and numpy; `make test` installs them"
        ));
        return None;
    }
    let script = root().join("tests/python").join(script);
    Some(
        Command::new(python)
            .arg(script)
            .args(args)
            .output()
            .expect("a process"),
    )
}

#[test]
fn episode_repeats_and_replays_bit_by_bit_on_another_cpu() {
    let folder = tempfile::tempdir().expect("a folder");
    let first = demo(&folder.path().join("first"), false);
    let second = demo(&folder.path().join("second"), true);
    if let Some(output) = python("check_episode.py", &[&first]) {
        assert!(output.status.success(), "{}", printed(&output));
    }
    if let Some(output) = python("equal_streams.py", &[&first, &second]) {
        assert!(output.status.success(), "{}", printed(&output));
    }
    let replay = wheelarm(&["replay", &first.to_string_lossy()], true);
    assert!(replay.status.success(), "{}", printed(&replay));
    assert!(
        printed(&replay).contains("hashes equal"),
        "{}",
        printed(&replay)
    );
    let info = wheelarm(&["dataset", "info", &first.to_string_lossy()], false);
    assert!(info.status.success(), "{}", printed(&info));
}
