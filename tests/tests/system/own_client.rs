//! Programs of the guide that use `wheelarm-sdk`, run as they are printed
//! there.

use std::path::Path;
use std::process::{Command, Output};

use wheelarm_tests::{Server, printed, program, root};

/// The examples, in the order of the chapter.
const EXAMPLES: [&str; 3] = ["camera", "policy", "memory"];

fn example(name: &str, server: &Server, more: &[&str]) -> Output {
    let file = Path::new("examples").join(name);
    let output = Command::new(program(&file.to_string_lossy()).expect("an example"))
        .args([server.endpoint.as_str(), server.sim.as_str()])
        .args(more)
        .output()
        .expect("a process");
    assert!(output.status.success(), "{name}: {}", printed(&output));
    output
}

#[test]
fn the_guide_shows_the_examples_as_they_are_run() {
    let chapter = root().join("docs/integrate-and-operate/client.md");
    let chapter = std::fs::read_to_string(chapter).expect("a chapter");
    let mut blocks = chapter.split("```rust\n").skip(1);
    for name in EXAMPLES {
        let file = root().join(format!("client/sdk/examples/{name}.rs"));
        let source = std::fs::read_to_string(file).expect("an example");
        let block = blocks.next().and_then(|rest| rest.split("```").next());
        assert_eq!(block, Some(source.as_str()), "{name}");
    }
}

#[test]
fn a_camera_is_read_by_a_foreign_client() {
    let folder = tempfile::tempdir().expect("a folder");
    let server = Server::start("own-camera", &["--camera", "gen3=160x120@10"]).expect("a server");
    let file = folder.path().join("picture.ppm");
    let output = example("camera", &server, &["gen3", &file.to_string_lossy()]);
    let text = printed(&output);
    assert_eq!(text.matches(" m away").count(), 5, "{text}");
    let picture = std::fs::read(&file).expect("a picture");
    assert!(picture.starts_with(b"P6 160 120 255\n"));
    assert_eq!(picture.len(), "P6 160 120 255\n".len() + 160 * 120 * 3);
}

#[test]
fn a_policy_in_lock_step_answers_for_six_ticks_at_a_time() {
    let args = ["--no-cameras", "--pacing", "lock-step"];
    let server = Server::start("own-policy", &args).expect("a server");
    let text = printed(&example("policy", &server, &[]));
    // The knuckle follows its own echo: it closes as far as it was asked.
    assert!(text.contains("30 answers, 3.000 s"), "{text}");
    assert!(text.contains("knuckle at 0.400 rad"), "{text}");
}

#[test]
fn an_episode_is_recorded_to_memory_as_the_manifest_says() {
    let server = Server::start("own-memory", &["--camera", "gen3=160x120@10"]).expect("a server");
    let text = printed(&example("memory", &server, &["gen3"]));
    for stream in ["camera/gen3", "joint_state", "imu", "state_hash"] {
        assert!(text.contains(stream), "{text}");
    }
}
