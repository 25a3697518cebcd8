//! Driving through the gateway, against a real server: a WebSocket client takes the
//! place of the page. The tests check order and ticks, not times.

mod gateway;
mod page;
mod safe;

use std::time::Duration;

use serde_json::json;
use wheelarm_proto::v1;
use wheelarm_tests::{Server, printed, wait_until};

use gateway::Gateway;
use page::{Held, Page};
use safe::Safe;

const CAMERA: [&str; 4] = ["--camera", "gen3=64x48@10", "--quality", "fast"];

fn server(name: &str) -> Server {
    Server::start(name, &CAMERA).expect("a server")
}

/// Waits for ticks of the server.
fn pass(page: &Page, ticks: u64) {
    let from = page.tick();
    wait_until("simulation time advances", || page.tick() >= from + ticks);
}

/// Position and heading of the chair, from the server itself.
fn chair(page: &Page) -> [f64; 3] {
    let place = page.situation()["robot"]["chair"].clone();
    [0, 1, 2].map(|i| place[i].as_f64().expect("a pose of the chair"))
}

fn moved(page: &Page, from: [f64; 3]) -> f64 {
    let [x, y, _] = chair(page);
    (x - from[0]).hypot(y - from[1])
}

/// Whether the chair is at rest.
fn rests(page: &Page) {
    wait_until("the chair rests", || {
        let speed = &page.situation()["robot"]["speed"];
        let still = |i: usize, most: f64| speed[i].as_f64().is_some_and(|v| v.abs() < most);
        still(0, 0.01) && still(1, 0.02)
    });
}

/// Drives until the chair moves; presses again after a press that a busy machine
/// interrupted.
fn gets_going(page: &mut Page, held: Held) {
    let from = chair(page);
    page.press(held);
    wait_until("the chair moves", || {
        let dead = page.situation()["control"]["dead"].as_u64().unwrap_or(0);
        if dead >= u64::from(page.epoch().0) {
            page.press(held);
        }
        moved(page, from) > 0.05
    });
}

#[test]
fn a_page_drives_and_stops_and_nothing_moves_after_a_freeze_or_a_cut() {
    let server = server("drive");
    let client = server.client();
    let refusals = client.samples::<v1::Refusal>().expect("refusals");
    let gateway = Gateway::open(&server);
    let mut page = Page::open(&gateway, "a1", true);
    assert_eq!(page.request("lease.ask", json!({}))["mine"], true);
    // Held, then released.
    gets_going(&mut page, Held::back());
    page.release();
    rests(&page);
    // A stop: the page gets a message when it is in force.
    gets_going(&mut page, Held::back());
    page.stop();
    wait_until("the stop is in force", || page.has_received("stopped"));
    rests(&page);
    let stopped = page.situation();
    assert_eq!(stopped["control"]["stopped"], true, "{stopped}");
    let at = chair(&page);
    page.hold_on();
    pass(&page, 240);
    assert!(moved(&page, at) < 0.01, "the same press moved it again");
    // The image freezes while the key is held.
    gets_going(&mut page, Held::forward());
    page.freeze(true);
    wait_until("the freeze is detected", || {
        page.situation()["control"]["allow"] != "drive"
    });
    rests(&page);
    wait_until("only a stop is allowed", || {
        page.situation()["control"]["allow"] == "stop"
    });
    page.forget_received();
    page.stop();
    wait_until("a stop is accepted nevertheless", || {
        page.has_received("stopped")
    });
    page.freeze(false);
    wait_until("images are fresh", || {
        page.situation()["control"]["allow"] == "drive"
    });
    // The connection stalls while driving.
    gets_going(&mut page, Held::forward());
    let epoch = page.epoch();
    page.cut();
    // The gateway receives no message, not even a close.
    let watching = Page::open(&gateway, "w0", false);
    rests(&watching);
    drop(watching);
    drop(page);
    let mut again = Page::open(&gateway, "a1", true);
    again.goes_on_from(epoch);
    assert_eq!(again.request("lease.ask", json!({}))["mine"], true);
    rests(&again);
    let at = chair(&again);
    again.hold(Held::forward());
    pass(&again, 240);
    assert!(
        moved(&again, at) < 0.01,
        "a press from before the cut moved it"
    );
    gets_going(&mut again, Held::back());
    again.release();
    rests(&again);
    // The chair stops after the browser vanished.
    gets_going(&mut again, Held::back());
    drop(again);
    let watching = Page::open(&gateway, "w1", false);
    rests(&watching);
    let status: v1::Status = client.request(&v1::StatusRequest {}).expect("a status");
    let mut received = 0;
    wait_until("every refusal is received", || {
        while let Some(refusal) = refusals.next(Duration::ZERO).expect("a refusal") {
            // A busy machine can delay a command; other reasons must not occur.
            assert_eq!(refusal.code(), v1::RefusalCode::TooOld, "{refusal:?}");
            received += refusal.count.max(1);
        }
        received >= status.refused
    });
}

#[test]
fn a_preview_is_the_same_page_without_driving() {
    let server = server("preview");
    let gateway = Gateway::preview(&server);
    let (code, text) = gateway.get("/", &gateway.address, "");
    assert_eq!(code, 200);
    assert!(text.contains("default-src 'none'"), "{text}");
    assert_eq!(gateway.get("/", "evil.example", "").0, 403);
    assert_eq!(gateway.get("/../etc/passwd", &gateway.address, "").0, 404);
    let page = Page::open(&gateway, "w1", false);
    wait_until("an image is painted", || page.has_painted());
    let situation = page.situation();
    assert_eq!(situation["you"]["role"], "viewer", "{situation}");
    assert_eq!(situation["scenario"]["task"], "pick_mustard", "{situation}");
    assert_eq!(page.refused_socket(&gateway, "/ws/control"), Some(4403));
}

#[test]
fn two_operators_hand_control_over_and_a_viewer_has_none() {
    let server = server("two");
    let gateway = Gateway::open(&server);
    let mut anna = Page::open(&gateway, "a1", true);
    let mut ben = Page::open(&gateway, "b1", true);
    let carl = Page::open(&gateway, "c1", false);
    assert_eq!(anna.request("lease.ask", json!({}))["mine"], true);
    let refused = ben.request("lease.ask", json!({}));
    assert_eq!(refused["ok"], false, "{refused}");
    wait_until("anna is notified", || anna.was_noted("asks for control"));
    gets_going(&mut anna, Held::back());
    assert_eq!(ben.request("lease.take", json!({}))["mine"], true);
    wait_until("anna is notified", || anna.was_noted("took control"));
    rests(&carl);
    let at = chair(&carl);
    anna.hold_on();
    pass(&carl, 120);
    assert!(moved(&carl, at) < 0.01);
    gets_going(&mut ben, Held::forward());
    // Every operator may stop.
    anna.stop();
    wait_until("ben is notified", || ben.was_noted("stopped everything"));
    rests(&carl);
    assert_eq!(ben.request("lease.give", json!({}))["ok"], true);
    wait_until("control is free", || {
        let situation = carl.situation();
        situation["lease"]["holder"] == "" && situation["lease"]["mine"] == false
    });
    assert_eq!(carl.refused_socket(&gateway, "/ws/control"), Some(4403));
    assert_eq!(carl.situation()["you"]["role"], "viewer");
}

#[test]
fn hostile_requests_are_rejected_and_move_nothing() {
    let server = server("hostile");
    let gateway = Gateway::open(&server);
    let mut anna = Page::open(&gateway, "a1", true);
    assert_eq!(anna.request("lease.ask", json!({}))["mine"], true);
    let at = chair(&anna);
    let own = gateway.address.clone();
    let cookie = gateway.cookie(true);
    // Origin, host name and session of the request.
    for (host, origin, cookie, code) in [
        (own.as_str(), "http://evil.example", cookie.as_str(), 403),
        (
            own.as_str(),
            &format!("http://{own}.evil.example"),
            &cookie,
            403,
        ),
        (own.as_str(), &format!("https://{own}"), &cookie, 403),
        (own.as_str(), "", &cookie, 403),
        ("evil.example", "http://evil.example", &cookie, 403),
        (own.as_str(), &format!("http://{own}"), "", 401),
        (own.as_str(), &format!("http://{own}"), "wheelarm-1=0", 401),
    ] {
        let refused = gateway.upgrade("/ws/control", host, origin, cookie);
        assert_eq!(refused.err(), Some(code), "{host} {origin} {cookie}");
    }
    let (code, _) = gateway.get("/session", &own, "");
    assert_eq!(code, 401);
    let (code, _) = gateway.get("/", "evil.example", "");
    assert_eq!(code, 403);
    let (code, _) = gateway.get("/?token=0123456789abcdef", &own, "");
    assert_eq!(code, 401);
    let (code, _) = gateway.get("/../../Cargo.toml", &own, "");
    assert_eq!(code, 404);
    let foreign = [("Origin", "http://evil.example")];
    assert_eq!(gateway.post("/ticket", &cookie, &foreign, "{}").0, 403);
    let cross = [("Sec-Fetch-Site", "cross-site")];
    assert_eq!(gateway.post("/ticket", &cookie, &cross, "{}").0, 403);
    let long = format!("{{\"count\":1,\"x\":\"{}\"}}", "x".repeat(5000));
    assert_eq!(gateway.post("/ticket", &cookie, &[], &long).0, 413);
    assert_eq!(gateway.post("/ticket", "", &[], "{}").0, 401);

    // Tickets: missing, used twice, of another session.
    let hello =
        |ticket: &str| json!({"t":"hello","protocol":1,"ticket":ticket,"page":"x1","lane":0});
    let ticket = gateway.ticket(true);
    let first = gateway.enter("/ws/state", true, &hello(&ticket));
    assert!(first.is_ok(), "{:?}", first.err());
    for (hello, code) in [
        (hello(&ticket), 4401),
        (hello("nothing"), 4401),
        (hello(&gateway.ticket(false)), 4401),
        (json!({"t":"drive","seq":1,"epoch":1}), 4400),
        (
            json!({"t":"hello","protocol":2,"ticket":ticket,"page":"x1"}),
            4426,
        ),
        (
            json!({"t":"hello","protocol":1,"ticket":gateway.ticket(true),"page":"../x"}),
            4400,
        ),
    ] {
        let refused = gateway.enter("/ws/control", true, &hello);
        assert_eq!(refused.err(), Some(code), "{hello}");
    }

    // Too long, too many, binary, not JSON.
    let oversize = "x".repeat(5000);
    let drive = json!({"t":"drive","seq":1,"epoch":1,"shown":null,"chair":[1,0],
        "device":"keyboard","mode":"hold"})
    .to_string();
    let unknown = drive.replace("keyboard", "mind");
    for (text, count, code) in [
        (oversize.as_str(), 1, 4400),
        (drive.as_str(), 400, 4429),
        ("nothing", 1, 4400),
        (unknown.as_str(), 1, 4400),
    ] {
        let hello = hello(&gateway.ticket(true));
        let socket = gateway
            .enter("/ws/control", true, &hello)
            .expect("a socket");
        assert_eq!(gateway::flood(socket, text, count), Some(code), "{count}");
    }
    // Silent connections and sessions of viewers do not displace hers.
    let silent: Vec<_> = (0..600)
        .map(|_| std::net::TcpStream::connect(&own))
        .collect();
    let viewer = gateway.cookie(false);
    for _ in 0..40 {
        let eight = gateway.post("/ticket", &viewer, &[], "{\"count\":8}");
        assert_eq!(eight.0, 200, "{}", eight.1);
    }
    assert_eq!(gateway.get("/session", &own, &cookie).0, 200);
    let hello = hello(&gateway.ticket(true));
    assert!(gateway.enter("/ws/state", true, &hello).is_ok());
    drop(silent);
    // None of it moved the chair or changed the holder of control.
    pass(&anna, 60);
    assert!(moved(&anna, at) < 0.01);
    gets_going(&mut anna, Held::back());
    anna.release();
    rests(&anna);
}

#[test]
fn an_episode_through_the_gateway_replays_with_the_same_hashes() {
    let folder = tempfile::tempdir().expect("a folder");
    let server = server("replayed");
    let recorder =
        wheelarm_tests::Recorder::start(&server, "disk", folder.path(), &["--episodes", "1"]);
    let gateway = Gateway::open(&server);
    let mut page = Page::open(&gateway, "a1", true);
    assert_eq!(page.request("lease.ask", json!({}))["mine"], true);
    wait_until("the recorder is connected", || {
        !page.situation()["recorders"]
            .as_array()
            .is_none_or(Vec::is_empty)
    });
    let started = page.request("episode.start", json!({"label": "driven", "recorders": 1}));
    assert_eq!(started["ok"], true, "{started}");
    wait_until("the episode runs", || {
        page.situation()["episode"]["label"] == "driven"
    });
    gets_going(&mut page, Held::back());
    page.release();
    rests(&page);
    page.step("hand", 2, 1);
    page.step("grip", 0, -1);
    pass(&page, 240);
    // Long enough for two state hashes in the recording.
    pass(&page, 240);
    let finished = page.request("episode.finish", json!({}));
    assert_eq!(finished["ok"], true, "{finished}");
    let _ = recorder.finish();
    let file = folder.path().join("driven.h5");
    let output = std::process::Command::new(wheelarm_tests::program("wheelarm").expect("a client"))
        .arg("replay")
        .arg(&file)
        .output()
        .expect("a replay");
    assert!(output.status.success(), "{}", printed(&output));
    let commands = page::recorded_commands(&file);
    assert!(
        commands
            .iter()
            .any(|c| c.device == "keyboard" && c.mode == "hold")
    );
    assert!(commands.iter().any(|c| c.mode == "step"));
    assert!(
        commands.iter().any(|c| c.loop_age_ticks > 0),
        "{commands:?}"
    );
}

#[test]
fn an_episode_is_kept_when_its_recorder_confirms_it_and_practice_is_not_recorded() {
    let folder = tempfile::tempdir().expect("a folder");
    let server = server("kept");
    let gateway = Gateway::open(&server);
    let mut page = Page::open(&gateway, "a1", true);
    assert_eq!(page.request("lease.ask", json!({}))["mine"], true);
    // Without a recorder no episode starts, and an alarm says so.
    let refused = page.request("episode.start", json!({}));
    assert_eq!(refused["ok"], false, "{refused}");
    let alarmed = |page: &Page, words: &str| page.situation()["alarms"].to_string().contains(words);
    wait_until("the alarm", || alarmed(&page, "nothing can be recorded"));
    let practice = page.request("episode.start", json!({"recorders": 0}));
    assert_eq!(practice["practice"], true, "{practice}");
    let label = practice["label"].as_str().expect("a label").to_owned();
    wait_until("it clears the alarm", || !alarmed(&page, "recorded"));
    page.request("episode.finish", json!({}));

    // The folder has a file of this label: the next free label is used.
    let file = |number: u64| {
        let name = wheelarm_proto::label::numbered(wheelarm_proto::label::split(&label).0, number);
        folder.path().join(format!("{name}.h5"))
    };
    std::fs::write(file(1), "precious").expect("a file");
    let mut recorder = wheelarm_tests::Recorder::start(&server, "disk", folder.path(), &[]);
    let there = |page: &Page| !page.situation()["recorders"].to_string().eq("[]");
    wait_until("the recorder is connected", || there(&page));
    let practice = page.request("episode.start", json!({"recorders": 0}));
    assert_eq!(practice["label"], label.as_str(), "{practice}");
    pass(&page, 48);
    page.request("episode.finish", json!({}));
    let taken = page.request("episode.start", json!({"label": label}));
    assert!(
        taken["error"].to_string().contains("next free label is"),
        "{taken}"
    );
    let started = page.request("episode.start", json!({}));
    assert_eq!(started["ok"], true, "{started}");
    assert_eq!(
        file(2).file_stem().and_then(|s| s.to_str()),
        started["label"].as_str()
    );
    let status: v1::Status = server
        .client()
        .request(&v1::StatusRequest {})
        .expect("a status");
    let limit = status.episode.and_then(|e| e.scenario?.time_limit_seconds);
    assert_eq!(limit, Some(wheelarm_proto::check::MAX_TIME_LIMIT));
    pass(&page, 48);
    let finished = page.request("episode.finish", json!({}));
    assert!(!finished["text"].to_string().contains("kept"), "{finished}");
    wait_until("the recorder confirms", || page.was_noted("kept in"));
    assert!(file(2).is_file());

    // A recorder that vanishes during an episode raises an alarm at once.
    assert_eq!(page.request("episode.start", json!({}))["ok"], true);
    recorder.kill();
    wait_until("the alarm", || alarmed(&page, "NOTHING IS RECORDED"));
    assert_eq!(
        std::fs::read_to_string(file(1)).expect("the file"),
        "precious"
    );
}

#[test]
fn a_click_selects_an_object_and_a_key_ends_the_skill() {
    let server = Server::start(
        "goal",
        &[
            "--camera",
            "wheelchair=64x48@10",
            "--camera",
            "gen3=64x48@10",
            "--quality",
            "fast",
        ],
    )
    .expect("a server");
    let gateway = Gateway::open(&server);
    let mut page = Page::open(&gateway, "a1", true);
    assert_eq!(page.request("lease.ask", json!({}))["mine"], true);
    let chosen = page
        .points_at_anything()
        .expect("something that can be taken");
    let begun = page.request(
        "goal.start",
        json!({"candidate": chosen["candidate"], "action": "near"}),
    );
    assert_eq!(begun["ok"], true, "{begun}");
    wait_until("a skill runs", || {
        page.situation()["goal"]["stage"]
            .as_str()
            .is_some_and(|s| !s.is_empty())
    });
    wait_until("its phase is reported", || {
        let phase = page.situation()["robot"]["phase"].clone();
        phase.as_str().is_some_and(|p| p.starts_with("assist:"))
    });
    page.press(Held::forward());
    wait_until("the goal has ended", || page.situation()["goal"].is_null());
    rests(&page);
    let at = chair(&page);
    page.hold_on();
    pass(&page, 120);
    assert!(moved(&page, at) < 0.01);
}

#[test]
fn other_machines_need_encryption_and_a_password() {
    let refused =
        std::process::Command::new(wheelarm_tests::program("wheelarm").expect("a client"))
            .args(["drive", "--page", "0.0.0.0:0", "--task", "pick_mustard"])
            .output()
            .expect("a refusal");
    assert!(!refused.status.success());
    assert!(
        printed(&refused).contains("--keys"),
        "{}",
        printed(&refused)
    );

    let folder = tempfile::tempdir().expect("a folder");
    let keys = folder.path().join("keys");
    let safe = Safe::open(server("keys"), &keys);
    // Plain HTTP is disconnected without an answer.
    assert_eq!(safe.plain(), None);
    let (code, text) = safe.request("GET /session", "", "");
    assert_eq!(code, 401, "{text}");
    let (code, _) = safe.request("GET /?token=0", "", "");
    assert_eq!(code, 401, "login links do not exist");
    let login = |user: &str, password: &str| {
        let body = json!({"user": user, "password": password}).to_string();
        safe.request("POST /login", "", &body)
    };
    let (code, head) = login("anna", "right and long");
    assert_eq!(code, 200, "{head}");
    assert!(head.contains("\"role\":\"operator\""), "{head}");
    let cookie = head.lines().find_map(|l| l.strip_prefix("set-cookie: "));
    let cookie = cookie.expect("a cookie");
    for word in ["__Host-", "Secure", "HttpOnly", "SameSite=Strict"] {
        assert!(cookie.contains(word), "{cookie}");
    }
    let cookie = cookie.split(';').next().expect("a value");
    assert_eq!(safe.request("GET /session", cookie, "").0, 200);
    // A cookie chosen by an attacker is never that of a session.
    let name = cookie.split('=').next().expect("a name");
    let chosen = format!("{name}={}", "0".repeat(32));
    let body = json!({"user": "anna", "password": "right and long"}).to_string();
    let (code, head) = safe.request("POST /login", &chosen, &body);
    assert!(code == 200 && !head.contains(&chosen), "{head}");
    assert_eq!(safe.request("GET /session", &chosen, "").0, 401);
    drop(safe.enter("/ws/control", cookie));
    for _ in 0..5 {
        assert_eq!(login("anna", "wrong").0, 401);
    }
    // Now even the right password is rejected; other users may still log in.
    assert_eq!(login("anna", "right and long").0, 429);
    assert_eq!(login("unknown", "wrong").0, 401);
    assert_eq!(safe.request("POST /logout", cookie, "{}").0, 204);
    assert_eq!(safe.request("GET /session", cookie, "").0, 401);
}

/// Takes control for the page `s1`, whose login ends in the way of `how`.
fn loses_control(safe: &Safe, cookie: &str, how: impl FnOnce()) {
    let client = safe.client();
    let holder = || {
        let status: v1::Status = client.request(&v1::StatusRequest {}).expect("a status");
        status.holder
    };
    let lane = safe.enter("/ws/control", cookie);
    let mut state = safe.enter("/ws/state", cookie);
    let mut requests = 0;
    wait_until("anna is in control", || {
        // The gateway may not be connected yet.
        requests += 1;
        let ask = json!({"t": "ask", "id": requests, "ask": "lease.ask"}).to_string();
        let sent = state.send(tungstenite::Message::Text(ask.into()));
        sent.is_ok() && holder() == "anna"
    });
    how();
    assert_eq!(safe::close_code(lane), Some(4401));
    assert_eq!(safe::close_code(state), Some(4401));
    wait_until("control is back", || holder().is_empty());
    assert_eq!(safe.request("GET /session", cookie, "").0, 401);
}

#[test]
fn the_end_of_a_session_closes_its_sockets_and_takes_control_back() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("keys");
    let server = Server::start("sessions", &["--no-cameras"]).expect("a server");
    let safe = Safe::open(server, &path);
    let keys = wheelarm_access::Folder::open(&path).expect("keys");
    let change = |change: &dyn Fn(&mut wheelarm_access::Users)| {
        let mut users = keys.users().expect("users");
        change(&mut users);
        users.save(&keys.users_file()).expect("a file");
    };
    let (first, second) = ("right and long", "another one");
    let cookie = safe.sign_in(first).expect("anna");
    loses_control(&safe, &cookie, || {
        assert_eq!(safe.request("POST /logout", &cookie, "{}").0, 204);
    });
    let cookie = safe.sign_in(first).expect("anna");
    loses_control(&safe, &cookie, || {
        change(&|users| users.set_password("anna", Some(second)).expect("anna"));
    });
    assert_eq!(safe.sign_in(first), None);
    let cookie = safe.sign_in(second).expect("anna");
    loses_control(&safe, &cookie, || {
        change(&|users| {
            let viewer = wheelarm_access::Role::Viewer;
            users.set_role("anna", viewer, false).expect("anna");
        });
    });
    // A session of the lowered role, whatever cookie existed before.
    let cookie = safe.sign_in(second).expect("anna");
    let (code, text) = safe.request("GET /session", &cookie, "");
    assert!(code == 200 && text.contains("viewer"), "{text}");
    let socket = safe.enter("/ws/state", &cookie);
    change(&|users| drop(users.remove("anna").expect("anna")));
    assert_eq!(safe::close_code(socket), Some(4401));
    assert_eq!(safe.sign_in(second), None);
}
