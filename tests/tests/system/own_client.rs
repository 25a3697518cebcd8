//! Programs of the guide that use `wheelarm-sdk`.

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
fn guide_shows_the_examples_unchanged() {
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
fn camera_example_writes_an_image() {
    let folder = tempfile::tempdir().expect("a folder");
    let server = Server::start("own-camera", &["--camera", "gen3=160x120@10"]).expect("a server");
    let file = folder.path().join("image.ppm");
    let output = example("camera", &server, &["gen3", &file.to_string_lossy()]);
    let text = printed(&output);
    assert_eq!(text.matches(" m away").count(), 5, "{text}");
    let image = std::fs::read(&file).expect("an image");
    assert!(image.starts_with(b"P6 160 120 255\n"));
    assert_eq!(image.len(), "P6 160 120 255\n".len() + 160 * 120 * 3);
}

#[test]
fn policy_example_commands_six_ticks_at_a_time_in_lock_step() {
    let args = ["--no-cameras", "--pacing", "lock-step"];
    let server = Server::start("own-policy", &args).expect("a server");
    let text = printed(&example("policy", &server, &[]));
    // The policy continues from the measured knuckle: it must reach the commanded angle.
    assert!(text.contains("30 answers, 3.000 s"), "{text}");
    assert!(text.contains("knuckle at 0.400 rad"), "{text}");
}

#[test]
fn memory_example_records_every_stream_of_the_manifest() {
    let server = Server::start("own-memory", &["--camera", "gen3=160x120@10"]).expect("a server");
    let text = printed(&example("memory", &server, &["gen3"]));
    for stream in ["camera/gen3", "joint_state", "imu", "state_hash"] {
        assert!(text.contains(stream), "{text}");
    }
}
