//! Keys, users and refusals of the programs themselves.

use std::path::Path;
use std::process::{Command, Stdio};

use wheelarm_access::{Folder, Role};
use wheelarm_proto::bundle::Identity;
use wheelarm_proto::{Query, TopicId, v1};
use wheelarm_sdk::{Client, ClientError, Connect, Silence, open_session};
use wheelarm_tests::{PATIENCE, Router, Server, printed, program, wait_until};
use zenoh::Session;

use super::lab::{
    Ear, Keys, REFUSED, SIM, gets_through, put, reaches, refused_command, shared, status,
    until_heard,
};

#[test]
fn who_has_no_keys_or_wrong_ones_gets_nowhere() {
    let lab = shared();
    let lab = lab.lock();
    let other = Keys::new();
    let bundle = lab.keys.place.join("mixed");
    std::fs::create_dir_all(&bundle).expect("a folder");
    let copy = |from: &Path, name: &str| {
        std::fs::copy(from, bundle.join(name)).expect("a copy");
    };
    // A stranger's certificate, believing our authority, so that only the server
    // can tell.
    let foreign = other.of("ada");
    copy(&lab.keys.folder.authority(), "ca.pem");
    copy(&foreign.certificate, "user.pem");
    copy(&foreign.key, "user.key");
    let foreign = Identity::find(&bundle, None).expect("files");
    let over = lab
        .keys
        .folder
        .issue_for("bert", -2)
        .expect("keys that are over");
    let over = Identity::find(&over, None).expect("files");
    for (who, identity) in [
        ("a stranger", foreign),
        ("keys that are over", over),
        // This one does not believe the server.
        ("another authority", other.of("ada")),
    ] {
        let told = Client::open(&lab.connect_with(Some(identity), REFUSED)).err();
        let told = told.unwrap_or_else(|| panic!("{who} got in"));
        assert!(
            matches!(told, ClientError::NoServer { .. }),
            "{who}: {told}"
        );
    }
    lab.keys.folder.issue("bert", 30).expect("keys");
    let told = Client::open(&lab.connect_with(None, REFUSED))
        .err()
        .expect("an error");
    assert!(matches!(told, ClientError::NoKeys(_)), "{told}");
    // A certificate of ours, of somebody who is no user any more.
    let ghost = lab.connect_with(Some(lab.keys.of("ghost")), REFUSED);
    let told = Client::open(&ghost).err().expect("an error").to_string();
    assert!(
        told.contains("cannot see a server") && told.contains("users list"),
        "{told}"
    );
    // Bare TCP on the same port.
    let bare = Connect {
        endpoint: lab.server.endpoint.replace("tls/", "tcp/"),
        ..lab.connect_with(None, REFUSED)
    };
    let told = Client::open(&bare).err().expect("an error");
    assert!(matches!(told, ClientError::NoServer { .. }), "{told}");
    // Nobody of them did any harm.
    assert_eq!(status(&lab.link("veit")).access(), v1::Access::Keys);
}

#[test]
fn the_programs_take_keys_and_the_doctor_tries_every_right() {
    let lab = shared();
    let lab = lab.lock();
    let keys = lab.keys.path().to_owned();
    let told = lab.client(&["--keys", &keys, "--user", "veit", "status"]);
    let text = printed(&told);
    assert!(
        told.status.success() && text.contains("with keys"),
        "{text}"
    );
    let told = lab.client(&["status"]);
    assert!(
        !told.status.success() && printed(&told).contains("--keys DIR"),
        "{}",
        printed(&told)
    );
    let anna = lab.keys.folder.bundle("anna");
    let anna = anna.to_str().expect("UTF-8");
    let told = lab.client(&["--keys", anna, "pause"]);
    assert!(told.status.success(), "{}", printed(&told));
    let told = lab.client(&["--keys", anna, "resume"]);
    assert!(told.status.success(), "{}", printed(&told));
    let told = lab.client(&["--keys", anna, "shutdown"]);
    assert!(
        !told.status.success() && printed(&told).contains("may lack the right"),
        "{}",
        printed(&told)
    );

    for user in ["veit", "anna", "rex", "ada"] {
        let told = lab.client(&[
            "--keys", &keys, "--user", user, "doctor", "--server", "--json",
        ]);
        let found: serde_json::Value = serde_json::from_slice(&told.stdout)
            .unwrap_or_else(|e| panic!("{e}: {}", printed(&told)));
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
fn the_doctor_names_a_right_that_the_server_does_not_give() {
    let lab = shared();
    let lab = lab.lock();
    // Keys say the role of their day. Here the user was an operator for that moment.
    lab.keys.set_role("veit", Role::Operator);
    lab.keys.folder.issue("veit", 30).expect("keys");
    lab.keys.set_role("veit", Role::Viewer);
    let told = lab.client(&[
        "--keys",
        lab.keys.path(),
        "--user",
        "veit",
        "doctor",
        "--json",
    ]);
    lab.keys.folder.issue("veit", 30).expect("keys");
    let text = printed(&told);
    assert!(!told.status.success(), "{text}");
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
fn a_local_socket_is_its_owners_and_the_admins() {
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
    let link = server.link();
    for query in Query::ALL {
        let key = link.keys().query(query).replace('*', "anybody");
        assert!(gets_through(&link, &key, true), "{key}");
    }
    link.shutdown(false).expect("an end");
    wait_until("the server ended", || !server.alive());
}

#[test]
fn a_router_with_the_same_users_goes_by_the_same_rules() {
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
    let ear = Ear::new(
        &veit,
        &["stream/clock", "refusal"].map(|r| format!("wheelarm/{SIM}/{r}")),
    );
    until_heard(&anna, "anna", &ear);
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
    until_heard(&anna, "anna", &ear);
    assert!(!ear.has_bytes(&forged));
    assert!(ear.refused_of("bert").is_empty());
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

/// How a server ends that was started with these options, or `None` when it serves.
fn ends(args: &[&str]) -> Option<String> {
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
fn a_server_is_not_open_to_other_hosts_by_mistake() {
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
        let told = ends(args).unwrap_or_else(|| panic!("{args:?} serves"));
        assert!(told.contains(words), "{args:?}: {told}");
    }
    let args = ["--no-cameras", "--insecure"];
    let server = Server::start_at("tcp/0.0.0.0:0", SIM, &args).expect("a server");
    let near = server.endpoint.replace("0.0.0.0", "127.0.0.1");
    let link = Client::open(&server.connect_through(&near)).expect("a link");
    assert_eq!(status(&link).access(), v1::Access::Insecure);
    let told = Command::new(program("wheelarm").expect("the clients"))
        .args(["--connect", &near, "--sim", SIM, "status"])
        .output()
        .expect("a client");
    assert!(printed(&told).contains("INSECURE"), "{}", printed(&told));
    // Without a word about it a server is its host's alone.
    let server = Server::start(SIM, &["--no-cameras"]).expect("a server");
    assert_eq!(status(&server.link()).access(), v1::Access::Local);
}

#[test]
fn users_are_added_listed_and_removed_by_the_program() {
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
        // Who asks for nothing may have ended before.
        let written = stdin.write_all(input.as_bytes());
        if let Err(error) = written {
            assert_eq!(error.kind(), std::io::ErrorKind::BrokenPipe, "{error}");
        }
        drop(stdin);
        child.wait_with_output().expect("an end")
    };
    let told = run("", &["users", "list"]);
    assert!(
        !told.status.success() && printed(&told).contains("keys init"),
        "{}",
        printed(&told)
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
        let told = run("correct horse\n", args);
        assert!(told.status.success(), "{args:?}: {}", printed(&told));
    }
    for args in [
        &["keys", "init"][..],
        &["users", "add", "anna", "--role", "viewer"],
        &["users", "add", "x", "--role", "king"],
        &["users", "add", "x", "--role", "viewer", "--pictures"],
        &["users", "remove", "nobody"],
        &["users", "password", "nobody"],
        &["keys", "user", "nobody"],
        &["keys", "user", "anna", "--days", "400"],
    ] {
        let told = run("correct horse\n", args);
        assert!(!told.status.success(), "{args:?}: {}", printed(&told));
    }
    let told = run("short\n", &["users", "password", "veit"]);
    assert!(printed(&told).contains("8 to 256"), "{}", printed(&told));
    let folder = Folder::open(&keys).expect("keys");
    let users = folder.users().expect("users");
    let verified = users.verify("anna", "correct horse");
    assert_eq!(verified.map(|user| user.role), Some(Role::Operator));
    assert_eq!(users.verify("veit", "short"), None);
    let told = run("", &["users", "role", "veit", "--role", "recorder"]);
    assert!(told.status.success(), "{}", printed(&told));
    let users = folder.users().expect("users");
    let veit = users.get("veit").map(|user| user.role);
    assert_eq!(veit, Some(Role::Recorder));
    for role in ["king", "viewer --pictures"] {
        let args = ["users", "role", "veit", "--role"].into_iter();
        let args: Vec<_> = args.chain(role.split(' ')).collect();
        assert!(!run("", &args).status.success(), "{role}");
    }
    let told = run("", &["users", "list", "--json"]);
    let listed: serde_json::Value = serde_json::from_slice(&told.stdout).expect("JSON");
    assert_eq!(listed[0]["name"], "anna");
    assert!(
        listed[0]["until"].is_string() && listed[1]["until"].is_null(),
        "{listed}"
    );
    assert!(!listed.to_string().contains("argon2"));
    let told = run("", &["users", "remove", "anna"]);
    assert!(told.status.success(), "{}", printed(&told));
    assert!(!folder.bundle("anna").exists());
    assert_eq!(
        folder
            .users()
            .expect("users")
            .verify("anna", "correct horse"),
        None
    );
}

/// A second process that looks with the same keys sees what the first does.
#[test]
fn the_same_keys_serve_several_programs_at_once() {
    let lab = shared();
    let lab = lab.lock();
    let connect = lab.connect("ada");
    let sessions: Vec<Session> = (0..4)
        .map(|_| open_session(&connect, Silence::Gone).expect("a session"))
        .collect();
    let links = sessions
        .into_iter()
        .map(|s| Client::over(s, &connect.endpoint, SIM));
    for link in links {
        let link = link.expect("a link");
        wait_until("the server is seen", || {
            let _ = link.look_for_server();
            link.server().is_there()
        });
        assert_eq!(status(&link).access(), v1::Access::Keys);
    }
}
