//! A server with keys and users, and what a session of each hears.

use std::path::PathBuf;
use std::process::{Command, Output, Stdio};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Weak};
use std::time::{Duration, Instant};

use parking_lot::Mutex;
use wheelarm_access::{Folder, Role, User};
use wheelarm_proto::bundle::Identity;
use wheelarm_proto::{Message, schema, v1};
use wheelarm_sdk::{Client, Commander, Connect};
use wheelarm_tests::{PATIENCE, Server, program, wait_until};
use zenoh::pubsub::Subscriber;
use zenoh::{Session, Wait};

/// Name of every server here.
pub const SIM: &str = "guarded";
/// Longest wait for what is refused.
pub const REFUSED: f64 = 2.0;

/// Users of the laboratory. `ghost` has keys of the same authority and is no user.
pub const USERS: [(&str, Role); 5] = [
    ("veit", Role::Viewer),
    ("anna", Role::Operator),
    ("bert", Role::Operator),
    ("rex", Role::Recorder),
    ("ada", Role::Admin),
];

/// Keys, users and a folder that lives as long.
pub struct Keys {
    pub folder: Folder,
    pub place: PathBuf,
    _temporary: tempfile::TempDir,
}

impl Keys {
    pub fn new() -> Self {
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

    pub fn of(&self, user: &str) -> Identity {
        Identity::find(self.folder.path(), Some(user)).expect("keys of a user")
    }

    /// Gives a user another role, as `wheelarm users role` does.
    pub fn set_role(&self, user: &str, role: Role) {
        let mut users = self.folder.users().expect("users");
        users.set_role(user, role, false).expect("a user");
        users.save(&self.folder.users_file()).expect("a file");
    }

    pub fn path(&self) -> &str {
        self.folder.path().to_str().expect("a path in UTF-8")
    }
}

/// A server with keys.
pub struct Lab {
    pub keys: Keys,
    pub server: Server,
}

impl Lab {
    pub fn start(more: &[&str]) -> Self {
        let keys = Keys::new();
        let args = [&["--keys", keys.path()][..], more].concat();
        let server = Server::start_at("tls/127.0.0.1:0", SIM, &args).expect("a server");
        Self { keys, server }
    }

    pub fn connect(&self, user: &str) -> Connect {
        self.connect_with(Some(self.keys.of(user)), PATIENCE.as_secs_f64())
    }

    pub fn connect_with(&self, identity: Option<Identity>, timeout_secs: f64) -> Connect {
        Connect {
            endpoint: self.server.endpoint.clone(),
            sim: SIM.to_owned(),
            timeout_secs,
            identity,
        }
    }

    pub fn link(&self, user: &str) -> Client {
        Client::open(&self.connect(user)).unwrap_or_else(|e| panic!("{user}: {e}"))
    }

    pub fn client(&self, args: &[&str]) -> Output {
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

pub fn shared() -> Arc<Mutex<Lab>> {
    let mut shared = SHARED.lock();
    shared.upgrade().unwrap_or_else(|| {
        let lab = Arc::new(Mutex::new(Lab::start(&["--camera", "room=64x48@10"])));
        *shared = Arc::downgrade(&lab);
        lab
    })
}

pub fn status(link: &Client) -> v1::Status {
    let mut told = None;
    wait_until("a status", || {
        told = link.request(&v1::StatusRequest {}).ok();
        told.is_some()
    });
    told.expect("a status")
}

/// Whether a request that no server understands is refused by one, which says that
/// it got there.
/// One answer may be late on a busy machine; see [`gets_through`].
pub fn reaches(link: &Client, key: &str) -> bool {
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
pub fn gets_through(link: &Client, key: &str, wanted: bool) -> bool {
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
pub fn put(session: &Session, key: &str, message: &str, bytes: Vec<u8>) {
    let put = session.put(key, bytes).encoding(schema::encoding(message));
    put.wait().expect("a put");
}

/// A command that the gate refuses, for `name` holds no control.
pub fn refused_command(name: &str, sequence: u64) -> Vec<u8> {
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
pub struct Ear {
    pub heard: Arc<Mutex<Vec<Heard>>>,
    _subscribers: Vec<Subscriber<()>>,
}

impl Ear {
    pub fn new(link: &Client, keys: &[String]) -> Self {
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

    pub fn has(&self, key: &str) -> bool {
        self.heard
            .lock()
            .iter()
            .any(|(heard, _)| heard.contains(key))
    }

    pub fn has_bytes(&self, bytes: &[u8]) -> bool {
        self.heard.lock().iter().any(|(_, heard)| heard == bytes)
    }

    /// What was refused of `name`.
    pub fn refusals_of(&self, name: &str) -> Vec<v1::Refusal> {
        let heard = self.heard.lock();
        let refusals = heard.iter().filter(|(key, _)| key.ends_with("/refusal"));
        let refusals = refusals.filter_map(|(_, bytes)| v1::Refusal::decode(&**bytes).ok());
        refusals
            .filter(|refusal| refusal.commander == name)
            .collect()
    }

    /// Sequence numbers of refused commands of `name`.
    pub fn refused_of(&self, name: &str) -> Vec<u64> {
        let refusals = self.refusals_of(name).into_iter();
        refusals.map(|refusal| refusal.sequence).collect()
    }
}

/// Drives until somebody who watches sees the chair move.
pub fn until_moving(commander: &mut Commander, link: &Client, watcher: &Client) {
    let clock = link.samples::<v1::Clock>().expect("the clock");
    let poses = watcher.samples::<v1::Odometry>().expect("odometry");
    let mut driven = false;
    // To and fro: other tests may have left it in front of something.
    let mut ways = [0.3; 120].into_iter().chain([-0.3; 120]).cycle();
    wait_until("the chair moves", || {
        // Of the clocks that wait, the newest: an answer to one of a second ago is refused.
        let mut tick = clock.next(PATIENCE).expect("a clock").expect("in time");
        while let Some(newer) = clock.next(Duration::ZERO).expect("a clock") {
            tick = newer;
        }
        let forward = v1::Command {
            base: Some(v1::BaseCommand {
                linear: ways.next().unwrap_or_default(),
                ..v1::BaseCommand::default()
            }),
            ..v1::Command::default()
        };
        let header = tick.header.unwrap_or_default();
        commander.answer(&header, forward).expect("a command");
        while let Some(odometry) = poses.next(Duration::ZERO).expect("odometry") {
            let twist = odometry.twist.unwrap_or_default();
            driven |= twist.linear.unwrap_or_default().x.abs() > 0.05;
        }
        driven
    });
}

/// A commander here has sent fewer commands when it is done.
pub const FIRST_MARK: u64 = 1_000_000;

/// Numbers of the commands that mark an instant.
static MARKS: AtomicU64 = AtomicU64::new(FIRST_MARK);

/// Sends commands under the own key of `name` until the gate tells that it refused
/// one of them: what was sent on this session before has been through by then.
pub fn until_heard(link: &Client, name: &str, ear: &Ear) {
    let key = link.keys().command(name);
    let first = MARKS.load(Ordering::Relaxed);
    wait_until("the gate refuses a command", || {
        let mark = MARKS.fetch_add(1, Ordering::Relaxed);
        let command = refused_command(name, mark);
        put(link.session(), &key, "wheelarm.v1.Command", command);
        ear.refused_of(name).iter().any(|mark| *mark >= first)
    });
}
