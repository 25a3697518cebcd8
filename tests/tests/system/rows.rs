//! Rows for learning, played open loop: they repeat the recorded task.

use std::process::Command;

use wheelarm_policy::ActionKind;
use wheelarm_tests::rows::Rows;
use wheelarm_tests::{printed, program, root};

#[test]
fn rows_at_ten_hertz_played_open_loop_lift_the_mustard() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = Command::new(program("wheelarm").expect("the client"))
        .args(["demo", "--seed", "0", "--no-sheet", "--rate", "10"])
        .args(["--width", "96", "--height", "54", "--out"])
        .arg(folder.path())
        .env("WHEELARM_ASSETS", root().join("assets"))
        .output()
        .expect("a process");
    assert!(output.status.success(), "{}", printed(&output));
    let file = folder.path().join("pick_mustard-seed0.h5");
    for kind in [ActionKind::NextPose, ActionKind::NextJoints] {
        let rows = Rows::read(&file, kind, 0).expect("rows");
        assert_eq!(rows.player.over_ticks, 6);
        let played = rows
            .play(&format!("rows-{}", kind.name()))
            .expect("a server");
        println!("{}: {played:?}", kind.name());
        assert!(played.success, "{}: {played:?}", kind.name());
    }
}
