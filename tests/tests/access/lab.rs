//! A server with keys and users, and listeners that store what a session receives.

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
/// Timeout of a request or connection that must be refused, s.
pub const REFUSAL_TIMEOUT: f64 = 2.0;

/// Users of the server. `ghost` has keys of the same authority but is not a user.
pub const USERS: [(&str, Role); 5] = [
    ("veit", Role::Viewer),
    ("anna", Role::Operator),
    ("bert", Role::Operator),
    ("rex", Role::Recorder),
    ("ada", Role::Admin),
];

/// Keys and users in a temporary folder, which is removed on drop.
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

    /// The keys of a user.
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

    /// Opens a connection with the keys of a user.
    pub fn open(&self, user: &str) -> Client {
        Client::open(&self.connect(user)).unwrap_or_else(|e| panic!("{user}: {e}"))
    }

    /// Runs `wheelarm` with this server's endpoint and name.
    pub fn wheelarm(&self, args: &[&str]) -> Output {
        Command::new(program("wheelarm").expect("the clients"))
            .args(["--connect", &self.server.endpoint, "--sim", SIM])
            .args(args)
            .stdin(Stdio::null())
            .output()
            .expect("a client")
    }
}

/// The server that most tests share while one of them runs; no test changes its users for good.
static SHARED: Mutex<Weak<Mutex<Lab>>> = Mutex::new(Weak::new());

pub fn shared() -> Arc<Mutex<Lab>> {
    let mut shared = SHARED.lock();
    shared.upgrade().unwrap_or_else(|| {
        let lab = Arc::new(Mutex::new(Lab::start(&["--camera", "room=64x48@10"])));
        *shared = Arc::downgrade(&lab);
        lab
    })
}

/// The server's status; retries until it arrives.
pub fn status(client: &Client) -> v1::Status {
    let mut status = None;
    wait_until("a status", || {
        status = client.request(&v1::StatusRequest {}).ok();
        status.is_some()
    });
    status.expect("a status")
}

/// Whether a request reaches a server. The message type is unknown, so that a server that
/// receives it replies with an error.
/// One reply may be late on a busy machine; see [`gets_through`].
pub fn reaches(client: &Client, key: &str) -> bool {
    let replies = client
        .session()
        .get(key)
        .encoding("application/protobuf;wheelarm.v1.Nothing@0")
        .timeout(Duration::from_secs_f64(REFUSAL_TIMEOUT))
        .wait()
        .expect("a request");
    replies.iter().any(|reply| client.server().answered(&reply))
}

/// Whether a request under `key` reaches a server; `wanted` is the expected result.
///
/// An allowed request is repeated until it arrives: a request may be lost or late while
/// connections are young or the machine is busy. A forbidden request is sent once.
pub fn gets_through(client: &Client, key: &str, wanted: bool) -> bool {
    let since = Instant::now();
    loop {
        if reaches(client, key) {
            return true;
        }
        if !wanted || since.elapsed() > PATIENCE {
            return false;
        }
    }
}

/// Publishes a message with the schema of this version.
pub fn put(session: &Session, key: &str, message: &str, bytes: Vec<u8>) {
    let put = session.put(key, bytes).encoding(schema::encoding(message));
    put.wait().expect("a put");
}

/// A command that the gate refuses because `name` does not hold control.
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
type KeyAndPayload = (String, Vec<u8>);

/// Stores every sample that a session receives under some keys, from any sender.
pub struct Listener {
    pub received: Arc<Mutex<Vec<KeyAndPayload>>>,
    _subscribers: Vec<Subscriber<()>>,
}

impl Listener {
    pub fn new(client: &Client, keys: &[String]) -> Self {
        let received: Arc<Mutex<Vec<KeyAndPayload>>> = Arc::default();
        let subscribe = |key: &String| {
            let received = Arc::clone(&received);
            let listens = client.session().declare_subscriber(key.clone());
            let listens = listens.callback(move |sample| {
                let bytes = sample.payload().to_bytes().into_owned();
                received.lock().push((sample.key_expr().to_string(), bytes));
            });
            listens.wait().expect("a subscriber")
        };
        let subscribers = keys.iter().map(subscribe).collect();
        Self {
            received,
            _subscribers: subscribers,
        }
    }

    pub fn has(&self, key: &str) -> bool {
        self.received
            .lock()
            .iter()
            .any(|(sample_key, _)| sample_key.contains(key))
    }

    pub fn has_bytes(&self, bytes: &[u8]) -> bool {
        self.received
            .lock()
            .iter()
            .any(|(_, payload)| payload == bytes)
    }

    /// Refusals of commands of `name`.
    pub fn refusals_of(&self, name: &str) -> Vec<v1::Refusal> {
        let received = self.received.lock();
        let refusals = received.iter().filter(|(key, _)| key.ends_with("/refusal"));
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

/// Drives until the chair moves in the odometry that `watcher` receives.
pub fn drive_until_moving(commander: &mut Commander, client: &Client, watcher: &Client) {
    let clock = client.samples::<v1::Clock>().expect("the clock");
    let poses = watcher.samples::<v1::Odometry>().expect("odometry");
    let mut driven = false;
    // Forward and back: another test may have left the chair in front of an obstacle.
    let mut speeds = [0.3; 120].into_iter().chain([-0.3; 120]).cycle();
    wait_until("the chair moves", || {
        // The newest waiting clock: the gate refuses an answer to one of a second ago.
        let mut tick = clock.next(PATIENCE).expect("a clock").expect("in time");
        while let Some(newer) = clock.next(Duration::ZERO).expect("a clock") {
            tick = newer;
        }
        let forward = v1::Command {
            base: Some(v1::BaseCommand {
                linear: speeds.next().unwrap_or_default(),
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

/// First sequence number of a mark; no commander of these tests sends as many commands.
pub const FIRST_MARK: u64 = 1_000_000;

/// Next sequence number of a mark: a command that is sent to be refused.
static MARKS: AtomicU64 = AtomicU64::new(FIRST_MARK);

/// Sends commands under the own key of `name` until the gate publishes the refusal of one of
/// them. Earlier samples of this session have then been processed.
pub fn flush_session(client: &Client, name: &str, listener: &Listener) {
    let key = client.keys().command(name);
    let first = MARKS.load(Ordering::Relaxed);
    wait_until("the gate refuses a command", || {
        let mark = MARKS.fetch_add(1, Ordering::Relaxed);
        let command = refused_command(name, mark);
        put(client.session(), &key, "wheelarm.v1.Command", command);
        listener.refused_of(name).iter().any(|mark| *mark >= first)
    });
}
