//! Keys, users and refusals of the programs.

use std::path::Path;
use std::process::{Command, Stdio};

use wheelarm_access::{Folder, Role};
use wheelarm_proto::bundle::Identity;
use wheelarm_proto::{Query, TopicId, v1};
use wheelarm_sdk::{Client, ClientError, Connect, Silence, open_session};
use wheelarm_tests::{PATIENCE, Router, Server, printed, program, wait_until};
use zenoh::Session;

use super::lab::{
    Keys, Listener, REFUSAL_TIMEOUT, SIM, flush_session, gets_through, put, reaches,
    refused_command, shared, status,
};

#[test]
fn client_without_valid_keys_cannot_connect() {
    let lab = shared();
    let lab = lab.lock();
    let other = Keys::new();
    let bundle = lab.keys.place.join("mixed");
    std::fs::create_dir_all(&bundle).expect("a folder");
    let copy = |from: &Path, name: &str| {
        std::fs::copy(from, bundle.join(name)).expect("a copy");
    };
    // A certificate of another authority with our `ca.pem`, so that only the server can
    // reject it.
    let foreign = other.of("ada");
    copy(&lab.keys.folder.authority(), "ca.pem");
    copy(&foreign.certificate, "user.pem");
    copy(&foreign.key, "user.key");
    let foreign = Identity::find(&bundle, None).expect("files");
    let expired = lab.keys.folder.issue_for("bert", -2).expect("expired keys");
    let expired = Identity::find(&expired, None).expect("files");
    for (who, identity) in [
        ("foreign certificate", foreign),
        ("expired keys", expired),
        // Here the client rejects the server.
        ("another authority", other.of("ada")),
    ] {
        let error = Client::open(&lab.connect_with(Some(identity), REFUSAL_TIMEOUT)).err();
        let error = error.unwrap_or_else(|| panic!("{who} connected"));
        assert!(
            matches!(error, ClientError::NoServer { .. }),
            "{who}: {error}"
        );
    }
    lab.keys.folder.issue("bert", 30).expect("keys");
    let error = Client::open(&lab.connect_with(None, REFUSAL_TIMEOUT))
        .err()
        .expect("an error");
    assert!(matches!(error, ClientError::NoKeys(_)), "{error}");
    // A certificate of our authority for a removed user.
    let ghost = lab.connect_with(Some(lab.keys.of("ghost")), REFUSAL_TIMEOUT);
    let error = Client::open(&ghost).err().expect("an error").to_string();
    assert!(
        error.contains("cannot see a server") && error.contains("users list"),
        "{error}"
    );
    // TCP without TLS on the same port.
    let bare = Connect {
        endpoint: lab.server.endpoint.replace("tls/", "tcp/"),
        ..lab.connect_with(None, REFUSAL_TIMEOUT)
    };
    let error = Client::open(&bare).err().expect("an error");
    assert!(matches!(error, ClientError::NoServer { .. }), "{error}");
    // The server still replies.
    assert_eq!(status(&lab.open("veit")).access(), v1::Access::Keys);
}

#[test]
fn programs_accept_keys_and_doctor_checks_every_right() {
    let lab = shared();
    let lab = lab.lock();
    let keys = lab.keys.path().to_owned();
    let output = lab.wheelarm(&["--keys", &keys, "--user", "veit", "status"]);
    let text = printed(&output);
    assert!(
        output.status.success() && text.contains("with keys"),
        "{text}"
    );
    let output = lab.wheelarm(&["status"]);
    assert!(
        !output.status.success() && printed(&output).contains("--keys DIR"),
        "{}",
        printed(&output)
    );
    let anna = lab.keys.folder.bundle("anna");
    let anna = anna.to_str().expect("UTF-8");
    let output = lab.wheelarm(&["--keys", anna, "pause"]);
    assert!(output.status.success(), "{}", printed(&output));
    let output = lab.wheelarm(&["--keys", anna, "resume"]);
    assert!(output.status.success(), "{}", printed(&output));
    let output = lab.wheelarm(&["--keys", anna, "shutdown"]);
    assert!(
        !output.status.success() && printed(&output).contains("may lack the right"),
        "{}",
        printed(&output)
    );

    for user in ["veit", "anna", "rex", "ada"] {
        let output = lab.wheelarm(&[
            "--keys", &keys, "--user", user, "doctor", "--server", "--json",
        ]);
        let found: serde_json::Value = serde_json::from_slice(&output.stdout)
            .unwrap_or_else(|e| panic!("{e}: {}", printed(&output)));
        let found = found.as_array().expect("a list").clone();
        let of = |what: &str| -> Vec<String> {
            let those = found.iter().filter(|one| one["what"] == what);
            those.map(|one| one["found"].to_string()).collect()
        };
        assert_eq!(
            of("right"),
            Vec::<String>::new(),
            "{user}: nothing is missing"
        );
        let rights = of("rights").join(" ");
        assert!(
            rights.contains("query/status") && rights.contains("stream/clock"),
            "{rights}"
        );
        assert_eq!(
            rights.contains("query/reset"),
            ["anna", "ada"].contains(&user),
            "{rights}"
        );
        let command = format!("command/{user}");
        assert_eq!(
            rights.contains(&command),
            ["anna", "ada"].contains(&user),
            "{rights}"
        );
        assert_eq!(
            rights.contains("camera/room"),
            ["rex", "ada"].contains(&user),
            "{rights}"
        );
    }
}

#[test]
fn doctor_names_a_right_that_the_server_does_not_grant() {
    let lab = shared();
    let lab = lab.lock();
    // A certificate states the role at its issue: here the user is an operator then.
    lab.keys.set_role("veit", Role::Operator);
    lab.keys.folder.issue("veit", 30).expect("keys");
    lab.keys.set_role("veit", Role::Viewer);
    let output = lab.wheelarm(&[
        "--keys",
        lab.keys.path(),
        "--user",
        "veit",
        "doctor",
        "--json",
    ]);
    lab.keys.folder.issue("veit", 30).expect("keys");
    let text = printed(&output);
    assert!(!output.status.success(), "{text}");
    for missing in [
        "query/reset is not let through",
        "command/veit is not let through",
        "commander/veit/doctor/alive is not",
    ] {
        assert!(text.contains(missing), "{missing}: {text}");
    }
    assert!(!text.contains("query/status is not"), "{text}");
}

#[test]
fn local_socket_grants_every_right_and_only_its_owner_may_open_it() {
    use std::os::unix::fs::PermissionsExt;
    let keys = Keys::new();
    let socket = keys.place.join("socket");
    let endpoint = format!("unixsock-stream/{}", socket.display());
    let server = Server::start_at(&endpoint, SIM, &["--keys", keys.path(), "--no-cameras"]);
    let mut server = server.expect("a server");
    let mode = std::fs::metadata(&socket)
        .expect("a socket")
        .permissions()
        .mode();
    assert_eq!(mode & 0o777, 0o600);
    let client = server.client();
    for query in Query::ALL {
        let key = client.keys().query(query).replace('*', "any");
        assert!(gets_through(&client, &key, true), "{key}");
    }
    client.shutdown(false).expect("an end");
    wait_until("the server ended", || !server.alive());
}

#[test]
fn router_with_the_same_users_enforces_the_same_rights() {
    let keys = Keys::new();
    let router = Router::start_with_keys(keys.path());
    let endpoint = router.endpoint.clone();
    let own = format!("unixsock-stream/{}", keys.place.join("own").display());
    let args = [
        "--keys",
        keys.path(),
        "--connect",
        &endpoint,
        "--no-cameras",
    ];
    let _server = Server::start_at(&own, SIM, &args).expect("a server");
    let through = |user: &str| {
        let connect = Connect {
            endpoint: endpoint.clone(),
            sim: SIM.to_owned(),
            timeout_secs: PATIENCE.as_secs_f64(),
            identity: Some(keys.of(user)),
        };
        Client::open(&connect).unwrap_or_else(|e| panic!("{user}: {e}"))
    };
    let (veit, anna) = (through("veit"), through("anna"));
    let clock = veit.samples::<v1::Clock>().expect("the clock");
    assert!(clock.next(PATIENCE).expect("a sample").is_some());
    let listener = Listener::new(
        &veit,
        &["stream/clock", "refusal"].map(|r| format!("wheelarm/{SIM}/{r}")),
    );
    flush_session(&anna, "anna", &listener);
    let forged = b"forged".to_vec();
    let key = anna.keys().topic(TopicId::Clock);
    put(anna.session(), &key, "wheelarm.v1.Clock", forged.clone());
    let as_bert = refused_command("bert", 7);
    put(
        anna.session(),
        &anna.keys().command("bert"),
        "wheelarm.v1.Command",
        as_bert,
    );
    flush_session(&anna, "anna", &listener);
    assert!(!listener.has_bytes(&forged));
    assert!(listener.refused_of("bert").is_empty());
    for query in [Query::Reset, Query::Shutdown] {
        let key = veit.keys().query(query);
        assert!(!reaches(&veit, &key), "{key}");
    }
    let mut commander = None;
    wait_until("anna is in control", || {
        commander = anna.commander("anna", false).ok();
        commander.is_some() && status(&veit).holder == "anna"
    });
    drop(commander);
}

/// Error of a server that does not start with these options; `None` when it serves.
fn start_error(args: &[&str]) -> Option<String> {
    match Server::start_with(
        &wheelarm_tests::root().join("assets"),
        args[0],
        SIM,
        &args[1..],
    ) {
        Ok(_server) => None,
        Err(error) => Some(error.to_string()),
    }
}

#[test]
fn server_opens_to_other_hosts_only_on_request() {
    let keys = Keys::new();
    let path = keys.path();
    for (args, words) in [
        (&["tcp/0.0.0.0:0", "--no-cameras"][..], "wheelarm keys init"),
        (&["tls/127.0.0.1:0", "--no-cameras"], "needs keys"),
        (
            &["tcp/127.0.0.1:0", "--no-cameras", "--keys", path],
            "every client",
        ),
        (
            &["tls/127.0.0.1:0", "--no-cameras", "--keys", "/nowhere"],
            "wheelarm keys init",
        ),
    ] {
        let error = start_error(args).unwrap_or_else(|| panic!("{args:?} serves"));
        assert!(error.contains(words), "{args:?}: {error}");
    }
    let args = ["--no-cameras", "--insecure"];
    let server = Server::start_at("tcp/0.0.0.0:0", SIM, &args).expect("a server");
    let near = server.endpoint.replace("0.0.0.0", "127.0.0.1");
    let client = Client::open(&server.connect_through(&near)).expect("a client");
    assert_eq!(status(&client).access(), v1::Access::Insecure);
    let output = Command::new(program("wheelarm").expect("the clients"))
        .args(["--connect", &near, "--sim", SIM, "status"])
        .output()
        .expect("a client");
    assert!(
        printed(&output).contains("INSECURE"),
        "{}",
        printed(&output)
    );
    // Without an option, a server accepts clients of its host only.
    let server = Server::start(SIM, &["--no-cameras"]).expect("a server");
    assert_eq!(status(&server.client()).access(), v1::Access::Local);
}

#[test]
fn program_adds_lists_and_removes_users() {
    let temporary = tempfile::tempdir().expect("a folder");
    let keys = temporary.path().join("keys");
    let run = |input: &str, args: &[&str]| {
        use std::io::Write;
        let mut child = Command::new(program("wheelarm").expect("the clients"))
            .arg("--keys")
            .arg(&keys)
            .args(args)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("a client");
        let mut stdin = child.stdin.take().expect("a pipe");
        // A program that reads no input may have ended already.
        let written = stdin.write_all(input.as_bytes());
        if let Err(error) = written {
            assert_eq!(error.kind(), std::io::ErrorKind::BrokenPipe, "{error}");
        }
        drop(stdin);
        child.wait_with_output().expect("an end")
    };
    let output = run("", &["users", "list"]);
    assert!(
        !output.status.success() && printed(&output).contains("keys init"),
        "{}",
        printed(&output)
    );
    for args in [
        &["keys", "init", "--host", "sim-host"][..],
        &[
            "users",
            "add",
            "anna",
            "--role",
            "operator",
            "--pictures",
            "--password",
        ],
        &["users", "add", "veit", "--role", "viewer"],
        &["keys", "user", "anna", "--days", "30"],
    ] {
        let output = run("correct horse\n", args);
        assert!(output.status.success(), "{args:?}: {}", printed(&output));
    }
    for args in [
        &["keys", "init"][..],
        &["users", "add", "anna", "--role", "viewer"],
        &["users", "add", "x", "--role", "king"],
        &["users", "add", "x", "--role", "viewer", "--pictures"],
        &["users", "remove", "unknown"],
        &["users", "password", "unknown"],
        &["keys", "user", "unknown"],
        &["keys", "user", "anna", "--days", "400"],
    ] {
        let output = run("correct horse\n", args);
        assert!(!output.status.success(), "{args:?}: {}", printed(&output));
    }
    let output = run("short\n", &["users", "password", "veit"]);
    assert!(
        printed(&output).contains("8 to 256"),
        "{}",
        printed(&output)
    );
    let folder = Folder::open(&keys).expect("keys");
    let users = folder.users().expect("users");
    let verified = users.verify("anna", "correct horse");
    assert_eq!(verified.map(|user| user.role), Some(Role::Operator));
    assert_eq!(users.verify("veit", "short"), None);
    let output = run("", &["users", "role", "veit", "--role", "recorder"]);
    assert!(output.status.success(), "{}", printed(&output));
    let users = folder.users().expect("users");
    let veit = users.get("veit").map(|user| user.role);
    assert_eq!(veit, Some(Role::Recorder));
    for role in ["king", "viewer --pictures"] {
        let args = ["users", "role", "veit", "--role"].into_iter();
        let args: Vec<_> = args.chain(role.split(' ')).collect();
        assert!(!run("", &args).status.success(), "{role}");
    }
    let output = run("", &["users", "list", "--json"]);
    let listed: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(listed[0]["name"], "anna");
    assert!(
        listed[0]["until"].is_string() && listed[1]["until"].is_null(),
        "{listed}"
    );
    assert!(!listed.to_string().contains("argon2"));
    let output = run("", &["users", "remove", "anna"]);
    assert!(output.status.success(), "{}", printed(&output));
    assert!(!folder.bundle("anna").exists());
    assert_eq!(
        folder
            .users()
            .expect("users")
            .verify("anna", "correct horse"),
        None
    );
}

#[test]
fn several_programs_use_the_same_keys_at_once() {
    let lab = shared();
    let lab = lab.lock();
    let connect = lab.connect("ada");
    let sessions: Vec<Session> = (0..4)
        .map(|_| open_session(&connect, Silence::Gone).expect("a session"))
        .collect();
    let clients = sessions
        .into_iter()
        .map(|s| Client::over(s, &connect.endpoint, SIM));
    for client in clients {
        let client = client.expect("a client");
        wait_until("the server is found", || {
            let _ = client.look_for_server();
            client.server().is_there()
        });
        assert_eq!(status(&client).access(), v1::Access::Keys);
    }
}
