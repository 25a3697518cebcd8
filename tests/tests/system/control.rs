//! One commander at a time; previews for viewers.

use std::process::{Command, Output};
use std::time::Duration;

use wheelarm_proto::preview::PreviewLevel;
use wheelarm_proto::v1;
use wheelarm_tests::{IdleCommander, PATIENCE, Server, printed, program, root, wait_until};
use zenoh::Wait;

fn holder(client: &wheelarm_sdk::Client) -> String {
    let status: v1::Status = client.request(&v1::StatusRequest {}).expect("a status");
    status.holder
}

#[test]
fn second_operator_takes_control_only_explicitly() {
    let server = Server::start("lease", &["--no-cameras"]).expect("a server");
    let (first, second) = (server.client(), server.client());
    let anna = first.commander("anna", false).expect("control");
    let error = second.commander("ben", false).err().expect("a refusal");
    let error = error.to_string();
    assert!(
        error.contains("anna") && error.contains("--take"),
        "{error}"
    );
    let status = server.run_client(&["status"]).expect("a client");
    let text = String::from_utf8_lossy(&status.stdout).into_owned();
    assert!(text.contains("control") && text.contains("anna"), "{text}");

    let ben = second.commander("ben", true).expect("control, taken");
    assert_eq!(holder(&first), "ben");
    let error = anna.acquire(false).expect_err("a refusal").to_string();
    assert!(error.contains("ben"), "{error}");
    // A commander that lost control cannot release it.
    drop(anna);
    assert_eq!(holder(&first), "ben");
    drop(ben);
    assert_eq!(holder(&first), "");

    // Control also ends with the connection of its holder.
    let gone = server.client();
    let carl = gone.commander("carl", false).expect("control");
    std::mem::forget(carl);
    gone.close().expect("the end of the session");
    wait_until("control is free again", || holder(&first).is_empty());

    // A token that returns at once belongs to a connection that broke: control stays.
    let (name, run_id) = ("dora".to_owned(), "0".to_owned());
    let token = || {
        let key = first.keys().commander_alive(&name, &run_id);
        let token = first.session().liveliness().declare_token(key);
        token.wait().expect("a token")
    };
    let before = token();
    let lease = v1::LeaseRequest {
        header: Some(v1::Header {
            run_id: run_id.clone(),
            ..v1::Header::default()
        }),
        commander: name.clone(),
        ..v1::LeaseRequest::default()
    };
    wait_until("dora is in control", || {
        first.request(&lease).is_ok_and(|held| held.holder == name)
    });
    drop(before);
    let again = token();
    let tick = || {
        let status: v1::Status = second.request(&v1::StatusRequest {}).expect("a status");
        status.header.expect("a header").tick
    };
    let until = tick() + 240;
    wait_until("a second passes", || tick() >= until);
    assert_eq!(holder(&second), name);
    drop(again);
    wait_until("control is free again", || holder(&second).is_empty());
}

#[test]
fn lock_step_waits_for_the_holder_of_control() {
    let args = ["--no-cameras", "--pacing", "lock-step"];
    let server = Server::start("whose", &args).expect("a server");
    let client = server.client();
    let start = |label: &str, commander: &str| {
        client.request(&v1::EpisodeStartRequest {
            label: label.into(),
            commander: commander.into(),
            ..Default::default()
        })
    };
    let error = start("a", "idle").expect_err("a refusal").to_string();
    assert!(error.contains("no commander holds control"), "{error}");
    let status = || client.request(&v1::StatusRequest {}).expect("a status");
    let tick = || status().header.expect("a header").tick;
    {
        let _idle = IdleCommander::start(&server.client());
        let error = start("a", "other").expect_err("a refusal").to_string();
        assert!(error.contains("\"idle\" holds control"), "{error}");
        start("a", "").expect("an episode");
        wait_until("time passes", || tick() > 240);
    }
    // After the end of the commander the episode waits for another one.
    wait_until("the status names the missing commander", || {
        status().waiting_for.contains("no commander holds control")
    });
    let before = tick();
    let _next = IdleCommander::start(&server.client());
    wait_until("time passes again", || tick() > before + 240);
}

#[test]
fn viewers_receive_jpeg_previews_at_the_requested_level() {
    let args = ["--camera", "gen3=640x360@10", "--quality", "fast"];
    let server = Server::start("seen", &args).expect("a server");
    let client = server.client();
    let mut sizes = Vec::new();
    for (level, width) in [
        (PreviewLevel::Low, 320),
        (PreviewLevel::Medium, 640),
        (PreviewLevel::High, 640),
    ] {
        let preview = client.preview("gen3", level).expect("a subscription");
        let next = || {
            let frame = preview.next(PATIENCE).expect("no error");
            frame.expect("an image")
        };
        let (first, second) = (next(), next());
        assert_eq!((second.width, second.height), (width, width * 360 / 640));
        assert_eq!(second.level(), level.code());
        assert!(second.sent_unix_nanos > first.sent_unix_nanos);
        assert!(second.jpeg.starts_with(&[0xff, 0xd8]) && second.jpeg.ends_with(&[0xff, 0xd9]));
        let newer = |frame: &v1::PreviewFrame| frame.header.as_ref().map_or(0, |h| h.tick);
        assert!(newer(&second) > newer(&first));
        sizes.push(second.jpeg.len());
    }
    assert!(sizes.is_sorted(), "{sizes:?} bytes from low to high");
    assert!(sizes[2] < 640 * 360, "{sizes:?} bytes");
    // Without a viewer no preview is sent; a later viewer receives new images.
    std::thread::sleep(Duration::from_millis(300));
    let again = client
        .preview("gen3", PreviewLevel::Low)
        .expect("a subscription");
    assert!(again.next(PATIENCE).expect("no error").is_some());
}

/// Runs `wheelarm` without a server, with a connection timeout of an hour.
fn run_without_server(words: &[&str]) -> Output {
    let free = std::net::TcpListener::bind("127.0.0.1:0").expect("a free port");
    let endpoint = format!("tcp/{}", free.local_addr().expect("its address"));
    drop(free);
    Command::new(program("wheelarm").expect("a client"))
        .args(["--connect", &endpoint, "--connect-timeout", "3600"])
        .args(words)
        .env("WHEELARM_ASSETS", root().join("assets"))
        .output()
        .expect("a client")
}

#[test]
fn status_without_a_server_fails_at_once_with_a_fix() {
    let output = run_without_server(&["status"]);
    let error = printed(&output);
    assert_eq!(output.status.code(), Some(1), "{error}");
    assert!(
        error.contains("start one with `wheelarm-server`"),
        "{error}"
    );
}

#[test]
fn tasks_are_equal_with_and_without_a_server() {
    let alone = run_without_server(&["tasks"]);
    assert!(alone.status.success(), "{}", printed(&alone));
    let server = Server::start("tasks", &["--no-cameras"]).expect("a server");
    let connected = server.run_client(&["tasks"]).expect("a client");
    assert_eq!(
        String::from_utf8_lossy(&alone.stdout),
        String::from_utf8_lossy(&connected.stdout)
    );
    let text = String::from_utf8_lossy(&connected.stdout).into_owned();
    for part in [
        "open_drawer (organize, workstation)",
        "goal  open drawer_1 or drawer_2 or drawer_3 or drawer_4",
        "goal  close drawer_1 or drawer_2 or drawer_3 or drawer_4",
        "goal  lift coke_1 or coke_2 or coke_3 or coke_4",
        "needs inside(knife, placemat)",
    ] {
        assert!(text.contains(part), "{part:?} in {text}");
    }
}
