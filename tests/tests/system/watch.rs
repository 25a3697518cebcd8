//! `watch` and `doctor` as scripts run them; completions and man pages.

use serde_json::Value;
use wheelarm_tests::{Server, printed};

#[test]
fn watch_measures_streams_and_doctor_accepts_a_healthy_server() {
    let server = Server::start("watched", &["--no-cameras"]).expect("a server");
    // A host that is too busy for real time drops samples for viewers; `watch` counts them and
    // sets its exit code.
    let output = server
        .run_client(&["watch", "--once", "--json"])
        .expect("a client");
    let report: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let all = report["streams"].as_object().expect("streams").values();
    let missed: u64 = all.filter_map(|f| f["missed"].as_u64()).sum();
    let expected = if missed == 0 { 0 } else { 3 };
    assert_eq!(output.status.code(), Some(expected), "{}", printed(&output));
    let streams = report["streams"].as_object().expect("streams");
    for (name, least_samples) in [
        ("joint_state", 20),
        ("pose", 20),
        ("imu", 80),
        ("clock", 20),
    ] {
        let figures = &streams[name];
        assert!(
            figures["samples"].as_u64() > Some(least_samples),
            "{name}: {figures}"
        );
        assert!(
            figures["missed"].as_u64() < figures["samples"].as_u64(),
            "{name}: {figures}"
        );
        assert!(figures["bytes_per_second"].as_f64() > Some(0.0), "{name}");
    }
    // A slow host lowers both rates equally.
    let rate = |name: &str| streams[name]["rate_hz"].as_f64().expect("a rate");
    let ratio = rate("imu") / rate("pose");
    assert!((3.0..5.0).contains(&ratio), "{ratio}");
    assert_eq!(report["task"]["name"], "pick_mustard");
    assert_eq!(report["holder"], "");

    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().to_string_lossy().into_owned();
    let output = server
        .run_client(&["doctor", "--json", "--server", "--out", &out])
        .expect("a client");
    let findings: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let all = findings.as_array().expect("findings");
    // A nearly full disk of this host is the only accepted failure.
    let failed: Vec<_> = all.iter().filter(|f| f["level"] == "fail").collect();
    assert!(
        failed.iter().all(|f| f["what"] == "disk for --out"),
        "{findings}"
    );
    let expected = i32::from(!failed.is_empty());
    assert_eq!(output.status.code(), Some(expected), "{}", printed(&output));
    let finding = |what: &str| {
        all.iter()
            .find(|f| f["what"] == what)
            .cloned()
            .unwrap_or_default()
    };
    for what in [
        "HDF5 library",
        "wheelarm-server",
        "port",
        "server",
        "clocks",
    ] {
        assert_eq!(finding(what)["level"], "ok", "{what}: {findings}");
    }

    // Without a server the port fails, and the fix says how to start one.
    let endpoint = server.endpoint.clone();
    drop(server);
    let lost = std::process::Command::new(wheelarm_tests::program("wheelarm").expect("the client"))
        .args(["--connect", &endpoint, "doctor", "--server"])
        .output()
        .expect("a doctor");
    let text = printed(&lost);
    assert_eq!(lost.status.code(), Some(1), "{text}");
    assert!(
        text.contains("FAIL  port") && text.contains("→ start wheelarm-server"),
        "{text}"
    );
}

#[test]
fn every_command_has_a_man_page_with_examples_and_exit_codes() {
    let wheelarm =
        || std::process::Command::new(wheelarm_tests::program("wheelarm").expect("the client"));
    let folder = tempfile::tempdir().expect("a folder");
    let made = wheelarm()
        .arg("man")
        .arg(folder.path())
        .output()
        .expect("pages");
    assert!(made.status.success(), "{}", printed(&made));
    for name in [
        "status",
        "tasks",
        "reset",
        "pause",
        "resume",
        "episode",
        "record",
        "operate",
        "teleop",
        "preview",
        "watch",
        "doctor",
        "demo",
        "evaluate",
        "collect",
        "replay",
        "shutdown",
        "completions",
        "man",
    ] {
        let page = folder.path().join(format!("wheelarm-{name}.1"));
        let text = std::fs::read_to_string(&page).expect(name);
        assert!(
            text.contains("Examples:") && text.contains("Exit codes:"),
            "{name}"
        );
    }
    for shell in ["bash", "zsh", "fish"] {
        let output = wheelarm()
            .args(["completions", shell])
            .output()
            .expect(shell);
        let text = String::from_utf8_lossy(&output.stdout);
        assert!(
            output.status.success() && text.contains("teleop"),
            "{shell}"
        );
    }
}
