//! Who may do what, with a real server over TLS: every role does what the table in
//! `server/access` says, and nothing else gets through. The table itself is tried
//! key by key in that package; here stands what only a running server shows.
//!
//! What is refused ends without a word or never arrives. So each refusal is
//! followed, on the same session, by something that is let through and seen: what
//! was sent before it must not have been.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Weak};
use std::time::{Duration, Instant};

use parking_lot::Mutex;
use wheelarm_access::{Folder, Role, User};
use wheelarm_link::{Connect, Link, LinkError, Silence, open_session};
use wheelarm_proto::bundle::Identity;
use wheelarm_proto::{Message, Query, TopicId, schema, v1};
use wheelarm_tests::{PATIENCE, Server, printed, program, wait_until};
use zenoh::pubsub::Subscriber;
use zenoh::{Session, Wait};
use zenoh_ext::{AdvancedSubscriberBuilderExt, HistoryConfig};

/// Name of every server here.
const SIM: &str = "guarded";
/// Longest wait for what is refused.
const REFUSED: f64 = 2.0;

/// Users of the laboratory. `ghost` has keys of the same authority and is no user.
const USERS: [(&str, Role); 5] = [
    ("veit", Role::Viewer),
    ("anna", Role::Operator),
    ("bert", Role::Operator),
    ("rex", Role::Recorder),
    ("ada", Role::Admin),
];

/// Keys, users and a folder that lives as long.
struct Keys {
    folder: Folder,
    place: PathBuf,
    _temporary: tempfile::TempDir,
}

impl Keys {
    fn new() -> Self {
        let temporary = tempfile::tempdir().expect("a folder");
        let place = temporary.path().to_owned();
        let hosts = ["127.0.0.1".to_owned(), "localhost".to_owned()];
        let folder = Folder::init(&place.join("keys"), &hosts).expect("keys");
        let mut users = folder.users().expect("users");
        for (name, role) in USERS.into_iter().chain([("ghost", Role::Admin)]) {
            users
                .add(User::new(name, role).expect("a name"))
                .expect("a user");
        }
        users.save(&folder.users_file()).expect("a file of users");
        for user in users.clone().iter() {
            folder.issue(&user.name, 30).expect("keys of a user");
        }
        users.remove("ghost").expect("a user");
        users.save(&folder.users_file()).expect("a file of users");
        Self {
            folder,
            place,
            _temporary: temporary,
        }
    }

    fn of(&self, user: &str) -> Identity {
        Identity::find(self.folder.path(), Some(user)).expect("keys of a user")
    }

    fn path(&self) -> &str {
        self.folder.path().to_str().expect("a path in UTF-8")
    }
}

/// A server with keys.
struct Lab {
    keys: Keys,
    server: Server,
}

impl Lab {
    fn start(more: &[&str]) -> Self {
        let keys = Keys::new();
        let args = [&["--keys", keys.path()][..], more].concat();
        let server = Server::start_at("tls/127.0.0.1:0", SIM, &args).expect("a server");
        Self { keys, server }
    }

    fn connect(&self, user: &str) -> Connect {
        self.connect_with(Some(self.keys.of(user)), PATIENCE.as_secs_f64())
    }

    fn connect_with(&self, identity: Option<Identity>, timeout_secs: f64) -> Connect {
        Connect {
            endpoint: self.server.endpoint.clone(),
            sim: SIM.to_owned(),
            timeout_secs,
            identity,
        }
    }

    fn link(&self, user: &str) -> Link {
        Link::open(&self.connect(user)).unwrap_or_else(|e| panic!("{user}: {e}"))
    }

    fn client(&self, args: &[&str]) -> Output {
        Command::new(program("wheelarm").expect("the clients"))
            .args(["--connect", &self.server.endpoint, "--sim", SIM])
            .args(args)
            .stdin(Stdio::null())
            .output()
            .expect("a client")
    }
}

/// The server that most tests share, while one of them runs; nothing here breaks it.
static SHARED: Mutex<Weak<Mutex<Lab>>> = Mutex::new(Weak::new());

fn shared() -> Arc<Mutex<Lab>> {
    let mut shared = SHARED.lock();
    shared.upgrade().unwrap_or_else(|| {
        let lab = Arc::new(Mutex::new(Lab::start(&["--camera", "room=64x48@10"])));
        *shared = Arc::downgrade(&lab);
        lab
    })
}

fn status(link: &Link) -> v1::Status {
    let mut told = None;
    wait_until("a status", || {
        told = link.ask(&v1::StatusRequest {}).ok();
        told.is_some()
    });
    told.expect("a status")
}

/// Whether a request that no server understands is refused by one, which says that
/// it got there.
/// One answer may be late on a busy machine; see [`gets_through`].
fn reaches(link: &Link, key: &str) -> bool {
    let replies = link
        .session()
        .get(key)
        .encoding("application/protobuf;wheelarm.v1.Nothing@0")
        .timeout(Duration::from_secs_f64(REFUSED))
        .wait()
        .expect("a question");
    replies.iter().any(|reply| link.server().answered(&reply))
}

/// Whether a request under `key` gets to a server, which `wanted` expects. What is to get
/// there is asked again until it does: a question may be lost or late while connections
/// are young or the machine is busy. What is to be held back must be held back at once
/// and is asked a single time.
fn gets_through(link: &Link, key: &str, wanted: bool) -> bool {
    let since = Instant::now();
    loop {
        if reaches(link, key) {
            return true;
        }
        if !wanted || since.elapsed() > PATIENCE {
            return false;
        }
    }
}

/// Sends a message of this version.
fn put(session: &Session, key: &str, message: &str, bytes: Vec<u8>) {
    let put = session.put(key, bytes).encoding(schema::encoding(message));
    put.wait().expect("a put");
}

/// A command that the gate refuses, for `name` holds no control.
fn refused_command(name: &str, sequence: u64) -> Vec<u8> {
    v1::Command {
        header: Some(v1::Header {
            sequence,
            ..v1::Header::default()
        }),
        commander: name.to_owned(),
        ..v1::Command::default()
    }
    .encode_to_vec()
}

/// Key and payload of a sample.
type Heard = (String, Vec<u8>);

/// Everything that reaches a session under some keys, whoever sent it.
struct Ear {
    heard: Arc<Mutex<Vec<Heard>>>,
    _subscribers: Vec<Subscriber<()>>,
}

impl Ear {
    fn new(link: &Link, keys: &[String]) -> Self {
        let heard: Arc<Mutex<Vec<Heard>>> = Arc::default();
        let subscribe = |key: &String| {
            let heard = Arc::clone(&heard);
            let listens = link.session().declare_subscriber(key.clone());
            let listens = listens.callback(move |sample| {
                let bytes = sample.payload().to_bytes().into_owned();
                heard.lock().push((sample.key_expr().to_string(), bytes));
            });
            listens.wait().expect("a subscriber")
        };
        let subscribers = keys.iter().map(subscribe).collect();
        Self {
            heard,
            _subscribers: subscribers,
        }
    }

    fn has(&self, key: &str) -> bool {
        self.heard
            .lock()
            .iter()
            .any(|(heard, _)| heard.contains(key))
    }

    fn has_bytes(&self, bytes: &[u8]) -> bool {
        self.heard.lock().iter().any(|(_, heard)| heard == bytes)
    }

    /// Sequence numbers of refused commands of `name`.
    fn refused_of(&self, name: &str) -> Vec<u64> {
        let heard = self.heard.lock();
        let refusals = heard.iter().filter(|(key, _)| key.ends_with("/refusal"));
        let refusals = refusals.filter_map(|(_, bytes)| v1::Refusal::decode(&**bytes).ok());
        let of_name = refusals.filter(|refusal| refusal.commander == name);
        of_name.map(|refusal| refusal.sequence).collect()
    }
}

/// Numbers of the commands that mark an instant.
static MARKS: AtomicU64 = AtomicU64::new(1000);

/// Sends commands under the own key of `name` until the gate tells that it refused
/// one of them: what was sent on this session before has been through by then.
fn until_heard(link: &Link, name: &str, ear: &Ear) {
    let key = link.keys().command(name);
    let first = MARKS.load(Ordering::Relaxed);
    wait_until("the gate refuses a command", || {
        let mark = MARKS.fetch_add(1, Ordering::Relaxed);
        let command = refused_command(name, mark);
        put(link.session(), &key, "wheelarm.v1.Command", command);
        ear.refused_of(name).iter().any(|mark| *mark >= first)
    });
}

#[test]
fn everybody_watches_and_asks_what_the_role_allows() {
    let lab = shared();
    let lab = lab.lock();
    let all = "veit anna bert rex ada";
    for (user, role) in USERS {
        let link = lab.link(user);
        assert_eq!(status(&link).access(), v1::Access::Keys);
        let clock = link.samples::<v1::Clock>().expect("the clock");
        assert!(clock.next(PATIENCE).expect("a sample").is_some(), "{user}");
        for query in Query::ALL {
            let who = match query {
                Query::Status | Query::Scene | Query::Tasks => all,
                Query::Snapshot | Query::Episode => "rex ada",
                Query::Sensors | Query::Show | Query::Shutdown => "ada",
                _ => "anna bert ada",
            };
            let key = link.keys().query(query).replace('*', user);
            let wanted = who.split(' ').any(|name| name == user);
            assert_eq!(
                gets_through(&link, &key, wanted),
                wanted,
                "{user}, {role}: {key}"
            );
        }
        let lease_of_another = link.keys().query(Query::Lease).replace('*', "carl");
        let wanted = role == Role::Admin;
        assert_eq!(
            gets_through(&link, &lease_of_another, wanted),
            wanted,
            "{user}"
        );
    }
}

#[test]
fn full_pictures_are_for_recorders_and_previews_for_everybody() {
    let lab = shared();
    let lab = lab.lock();
    for (user, role) in USERS {
        let link = lab.link(user);
        let keys = ["preview/room/low", "camera/room"];
        let keys = keys.map(|rest| format!("wheelarm/{SIM}/{rest}"));
        let ear = Ear::new(&link, &keys);
        // Whoever may hears both; each comes ten times a second.
        let full = matches!(role, Role::Recorder | Role::Admin);
        wait_until("pictures come", || {
            ear.has("/preview/") && (!full || ear.has("/camera/"))
        });
        let previews = || {
            let heard = ear.heard.lock();
            heard
                .iter()
                .filter(|(key, _)| key.contains("/preview/"))
                .count()
        };
        let some = previews();
        wait_until("more pictures come", || previews() > some + 3);
        assert_eq!(ear.has("/camera/"), full, "{user}");
    }
}

#[test]
fn an_operator_drives_under_its_own_name_and_no_other() {
    let lab = shared();
    let lab = lab.lock();
    let (anna, bert, veit) = (lab.link("anna"), lab.link("bert"), lab.link("veit"));
    let ear = Ear::new(&veit, &[veit.keys().topic(TopicId::Refusal)]);
    until_heard(&anna, "anna", &ear);
    let clock = anna.samples::<v1::Clock>().expect("the clock");
    let mut commander = anna.commander("anna", false).expect("control");
    assert_eq!(status(&veit).holder, "anna");
    let before = status(&veit).refused;
    let poses = veit.samples::<v1::Odometry>().expect("odometry");
    let mut driven = false;
    wait_until("the chair moves", || {
        let tick = clock.next(PATIENCE).expect("a clock").expect("in time");
        let forward = v1::Command {
            base: Some(v1::BaseCommand {
                linear: 0.3,
                ..v1::BaseCommand::default()
            }),
            ..v1::Command::default()
        };
        let header = tick.header.unwrap_or_default();
        commander.answer(&header, forward).expect("a command");
        while let Some(odometry) = poses.next(Duration::ZERO).expect("odometry") {
            let twist = odometry.twist.unwrap_or_default();
            driven |= twist.linear.unwrap_or_default().x > 0.05;
        }
        driven
    });
    assert_eq!(status(&veit).refused, before, "nothing of hers was refused");

    // Bert cannot speak as Anna: neither under her key nor with her name under his.
    let speaks = refused_command("anna", 7);
    put(
        bert.session(),
        &bert.keys().command("anna"),
        "wheelarm.v1.Command",
        speaks.clone(),
    );
    put(
        bert.session(),
        &bert.keys().command("*"),
        "wheelarm.v1.Command",
        speaks.clone(),
    );
    until_heard(&bert, "bert", &ear);
    assert!(!ear.refused_of("anna").contains(&7), "it reached the gate");
    let strange = status(&veit).strange;
    put(
        bert.session(),
        &bert.keys().command("bert"),
        "wheelarm.v1.Command",
        speaks,
    );
    wait_until("it is counted", || status(&veit).strange > strange);
    assert_eq!(status(&veit).holder, "anna");

    // Nor take control in her name, or end the server.
    let asked = v1::LeaseRequest {
        commander: "anna".to_owned(),
        release: true,
        ..v1::LeaseRequest::default()
    };
    let told = bert.ask_within(&asked, Duration::from_secs_f64(REFUSED));
    assert!(told.is_err(), "{told:?}");
    let told = bert.ask_within(
        &v1::ShutdownRequest::default(),
        Duration::from_secs_f64(REFUSED),
    );
    assert!(
        matches!(told, Err(LinkError::Unanswered { .. })),
        "{told:?}"
    );
    // A viewer takes no control, under any name.
    for name in ["veit", "anna", "zoe"] {
        let told = veit.commander(name, true);
        assert!(told.is_err(), "{name}");
    }
    assert_eq!(status(&veit).holder, "anna");
    drop(commander);
    wait_until("control is given back", || status(&veit).holder.is_empty());
}

#[test]
fn nobody_speaks_as_the_server() {
    let lab = shared();
    let lab = lab.lock();
    let veit = lab.link("veit");
    let keys = ["stream/*", "episode/*", "refusal", "preview/*/low"];
    let keys = keys.map(|rest| format!("wheelarm/{SIM}/{rest}"));
    let ear = Ear::new(&veit, &keys);
    for user in ["anna", "ada"] {
        let forger = lab.link(user);
        // What is let through is heard, so what is not was held back.
        until_heard(&forger, user, &ear);
        let forged = format!("forged by {user}").into_bytes();
        for rest in [
            "stream/clock",
            "stream/joints",
            "episode/start",
            "episode/stop",
            "refusal",
            "preview/room/low",
            "stream/*",
            "episode/*",
            "*/clock",
            "**",
        ] {
            let key = format!("wheelarm/{SIM}/{rest}");
            put(forger.session(), &key, "wheelarm.v1.Clock", forged.clone());
            forger.session().delete(key).wait().expect("a delete");
        }
        put(
            forger.session(),
            "wheelarm/**",
            "wheelarm.v1.Clock",
            forged.clone(),
        );
        // Nor does anybody answer in its place, or claim to be it.
        let asked = Arc::new(Mutex::new(0));
        let counts = Arc::clone(&asked);
        let _answers = forger
            .session()
            .declare_queryable(format!("wheelarm/{SIM}/query/status"))
            .callback(move |_| *counts.lock() += 1)
            .wait()
            .expect("a queryable of its own");
        let _claims = forger
            .session()
            .liveliness()
            .declare_token(forger.keys().alive(&forger.session().zid().to_string()))
            .wait()
            .expect("a token of its own");
        until_heard(&forger, user, &ear);
        assert!(!ear.has_bytes(&forged), "{user} was heard");
        assert_eq!(status(&veit).access(), v1::Access::Keys);
        assert_eq!(*asked.lock(), 0, "{user} was asked");
        assert_eq!(
            veit.server().tokens().len(),
            1,
            "{user} passes for a server"
        );
    }
}

#[test]
fn a_recorder_speaks_for_itself_alone() {
    let lab = shared();
    let lab = lab.lock();
    let (rex, veit) = (lab.link("rex"), lab.link("veit"));
    let tokens = ["rex", "other"].map(|name| {
        let token = rex.keys().recorder_alive(name);
        rex.session()
            .liveliness()
            .declare_token(token)
            .wait()
            .expect("a token")
    });
    let says = |key: &str, name: &str| {
        let status = v1::RecorderStatus {
            header: Some(v1::Header::default()),
            recorder: name.to_owned(),
            state: v1::RecorderState::Idle.into(),
            ..v1::RecorderStatus::default()
        };
        let key = rex.keys().recorder(key);
        let message = "wheelarm.v1.RecorderStatus";
        put(rex.session(), &key, message, status.encode_to_vec());
    };
    let named = |name: &str| status(&veit).recorders.iter().any(|r| r.recorder == name);
    says("other", "other");
    wait_until("it is there", || {
        says("rex", "rex");
        named("rex")
    });
    let strange = status(&veit).strange;
    says("rex", "other");
    wait_until("it is counted", || status(&veit).strange > strange);
    assert!(!named("other"));
    drop(tokens);
}

/// Who comes late gets what the publishers kept, and hears their signs of life:
/// questions, answers and tokens below `@adv`.
#[test]
fn what_was_published_before_is_had_by_everybody_who_may_listen() {
    let lab = shared();
    let lab = lab.lock();
    let ada = lab.link("ada");
    let clock = ada.samples::<v1::Clock>().expect("the clock");
    assert!(clock.next(PATIENCE).expect("a sample").is_some());
    let rex = lab.link("rex");
    let (seen, sees) = std::sync::mpsc::channel();
    let pictures = rex
        .session()
        .declare_subscriber(rex.keys().camera("room"))
        .callback(move |_| {
            let _ = seen.send(());
        })
        .wait()
        .expect("a subscriber");
    sees.recv_timeout(PATIENCE).expect("a picture");
    let _: v1::Ack = ada.ask(&v1::PauseRequest {}).expect("a pause");
    pictures.undeclare().wait().expect("no more pictures");
    for user in ["veit", "anna", "rex"] {
        let link = lab.link(user);
        let (seen, sees) = std::sync::mpsc::channel();
        let _late = link
            .session()
            .declare_subscriber(link.keys().topic(TopicId::Clock))
            .callback(move |sample| {
                let _ = seen.send(sample.key_expr().to_string());
            })
            .history(HistoryConfig::default().detect_late_publishers())
            .wait()
            .expect("a subscriber");
        // Time stands still: nothing new is published.
        let got = sees
            .recv_timeout(PATIENCE)
            .expect("what was published before");
        assert_eq!(got, link.keys().topic(TopicId::Clock), "{user}");
        let kept = format!("wheelarm/{SIM}/stream/clock/@adv/**");
        let signs = Ear::new(&link, std::slice::from_ref(&kept));
        wait_until("a publisher tells its newest number", || signs.has("@adv"));
        // What a client asks of tokens and caches is answered by what its connection
        // has been told of them by then.
        wait_until("the publisher is seen", || {
            let tokens = link.session().liveliness().get(kept.as_str()).wait();
            let tokens = tokens.expect("a question");
            tokens.iter().any(|reply| reply.result().is_ok())
        });
        let has_pictures = || {
            let pictures = link
                .session()
                .get(format!("wheelarm/{SIM}/camera/room/@adv/**"))
                .accept_replies(zenoh::query::ReplyKeyExpr::Any)
                .timeout(PATIENCE)
                .wait()
                .expect("a question");
            pictures.iter().any(|reply| reply.result().is_ok())
        };
        if user == "rex" {
            wait_until("kept pictures are there", has_pictures);
        } else {
            assert!(!has_pictures(), "{user}: kept pictures");
        }
    }
    let _: v1::Ack = ada.ask(&v1::ResumeRequest {}).expect("time");
}

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
        let told = Link::open(&lab.connect_with(Some(identity), REFUSED)).err();
        let told = told.unwrap_or_else(|| panic!("{who} got in"));
        assert!(matches!(told, LinkError::NoServer { .. }), "{who}: {told}");
    }
    lab.keys.folder.issue("bert", 30).expect("keys");
    let told = Link::open(&lab.connect_with(None, REFUSED))
        .err()
        .expect("an error");
    assert!(matches!(told, LinkError::NoKeys(_)), "{told}");
    // A certificate of ours, of somebody who is no user any more.
    let ghost = lab.connect_with(Some(lab.keys.of("ghost")), REFUSED);
    let told = Link::open(&ghost).err().expect("an error").to_string();
    assert!(
        told.contains("shows no server") && told.contains("users list"),
        "{told}"
    );
    // Bare TCP on the same port.
    let bare = Connect {
        endpoint: lab.server.endpoint.replace("tls/", "tcp/"),
        ..lab.connect_with(None, REFUSED)
    };
    let told = Link::open(&bare).err().expect("an error");
    assert!(matches!(told, LinkError::NoServer { .. }), "{told}");
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
        !told.status.success() && printed(&told).contains("may not ask"),
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
fn the_doctor_names_a_right_that_the_running_server_does_not_know() {
    let lab = shared();
    let lab = lab.lock();
    // The same authority; its users changed after the server was started.
    let mut users = lab.keys.folder.users().expect("users");
    let before = users.clone();
    users.remove("veit").expect("a user");
    users
        .add(User::new("veit", Role::Operator).expect("a name"))
        .expect("a user");
    users.save(&lab.keys.folder.users_file()).expect("a file");
    lab.keys.folder.issue("veit", 30).expect("keys");
    let told = lab.client(&[
        "--keys",
        lab.keys.path(),
        "--user",
        "veit",
        "doctor",
        "--json",
    ]);
    before.save(&lab.keys.folder.users_file()).expect("a file");
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
    // Somebody else may take the port between its choice and its use.
    let (_router, endpoint) = (0..10)
        .find_map(|_| {
            let free = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
            let port = free.local_addr().expect("an address").port();
            drop(free);
            let endpoint = format!("tls/127.0.0.1:{port}");
            let text = wheelarm_access::router(&keys.folder, std::slice::from_ref(&endpoint));
            let text = text.expect("a configuration");
            let config = zenoh::Config::from_json5(&text).expect("a valid one");
            Some((zenoh::open(config).wait().ok()?, endpoint))
        })
        .expect("a router");
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
        Link::open(&connect).unwrap_or_else(|e| panic!("{user}: {e}"))
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
    let commander = anna.commander("anna", false).expect("control");
    assert_eq!(status(&veit).holder, "anna");
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
            "everybody in",
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
    let link = Link::open(&server.connect_through(&near)).expect("a link");
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
        stdin.write_all(input.as_bytes()).expect("written");
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
    assert_eq!(users.verify("anna", "correct horse"), Some(Role::Operator));
    assert_eq!(users.verify("veit", "short"), None);
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
        .map(|s| Link::over(s, &connect.endpoint, SIM));
    for link in links {
        let link = link.expect("a link");
        wait_until("the server is seen", || {
            let _ = link.look_for_server();
            link.server().is_there()
        });
        assert_eq!(status(&link).access(), v1::Access::Keys);
    }
}
