//! Rights of the user of these keys at the server: every right that its role has is tested
//! without a change of state. A request of an unknown contract version is rejected by a
//! server that it reaches. It gets no reply where the transport filters it out.

use std::time::{Duration, Instant};

use wheelarm_access::{About, Flow, Kind, Role, User, grants};
use wheelarm_proto::keys;
use wheelarm_proto::preview::PreviewLevel;
use wheelarm_proto::{Message, Query, TopicId, v1};
use wheelarm_sdk::{Client, Connect, Silence, open_session};
use zenoh::query::{ConsolidationMode, QueryTarget};
use zenoh::{Session, Wait};

use super::finding::Finding;

/// Longest wait for a reply or a sample.
const PATIENCE: Duration = Duration::from_secs(2);
/// A contract version that no program implements.
const NO_VERSION: &str = "application/protobuf;wheelarm.v1.Nothing@0";
/// Fix for a missing right.
const FIX: &str = "contact the operator of the server: `wheelarm users list` prints the role; a server knows only users that were added before it started";

/// Result of one test of a right.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum RightTest {
    /// The message got through.
    Allowed,
    /// It was filtered out.
    Refused,
    /// Nothing is published now, so the right cannot be tested.
    Unknown,
}

/// Reports expired or incomplete keys and tests every right of the role.
pub fn inspect(
    connect: &Connect,
    client: &Client,
    status: &v1::Status,
    report: &mut dyn FnMut(Finding),
) {
    let Some(identity) = &connect.identity else {
        return;
    };
    let Some(about) = About::beside(identity.folder()) else {
        report(Finding::warn(
            "keys",
            format!("{} does not name its user", identity.folder().display()),
            "request new keys: wheelarm keys user NAME",
        ));
        return;
    };
    let found = format!("of {}, {}, until {}", about.user, about.role, about.until);
    report(match about.is_over() {
        true => Finding::fail(
            "keys",
            found,
            "the keys have expired: wheelarm keys user NAME makes new ones",
        ),
        false => Finding::ok("keys", found),
    });
    let Ok(user) = User::new(&about.user, about.role) else {
        return;
    };
    let mut tests = RightTests {
        client,
        user: &user,
        allowed: Vec::new(),
        missing: Vec::new(),
        unknown: Vec::new(),
    };
    for query in Query::ALL {
        let name = match query.has_identity() {
            true => format!("{}/{}", query.name(), user.name),
            false => query.name().to_owned(),
        };
        let key = format!("query/{name}");
        tests.test(Kind::Query, &key, &|_| query_arrives(client, &key));
    }
    let moving = !status.paused && status.waiting_for.is_empty();
    let clock = TopicId::Clock.info().key;
    tests.test(Kind::DeclareSubscriber, clock, &|_| {
        is_published(client, clock, moving)
    });
    let cameras = status.scenario.clone().unwrap_or_default().cameras;
    if let Some(camera) = cameras.iter().find(|camera| camera.rate_hz != Some(0.0)) {
        let key = format!("preview/{}/{}", camera.name, PreviewLevel::Low.name());
        tests.test(Kind::DeclareSubscriber, &key, &|_| {
            is_published(client, &key, moving)
        });
        let key = format!("camera/{}", camera.name);
        tests.test(Kind::DeclareSubscriber, &key, &|_| {
            is_published(client, &key, moving)
        });
    }
    if user.role.commands() {
        let key = format!("command/{}", user.name);
        tests.test(Kind::Put, &key, &|_| command_arrives(client, &user.name));
    }
    let token = match user.role {
        Role::Operator | Role::Admin => Some(format!("commander/{}/doctor/alive", user.name)),
        // A recorder of that name may be running; its liveliness token is left alone.
        Role::Recorder | Role::Viewer => None,
    };
    if let Some(token) = token {
        let other = open_session(connect, Silence::Gone);
        let other = other.as_ref().ok();
        tests.test(Kind::LivelinessToken, &token, &|key| {
            other.map_or(RightTest::Unknown, |other| {
                token_arrives(client, other, key)
            })
        });
    }
    for finding in tests.findings() {
        report(finding);
    }
}

struct RightTests<'a> {
    client: &'a Client,
    user: &'a User,
    allowed: Vec<String>,
    missing: Vec<String>,
    unknown: Vec<String>,
}

impl RightTests<'_> {
    /// Tests one right. A right that the role does not have is skipped.
    fn test(&mut self, kind: Kind, rest: &str, attempt: &dyn Fn(&str) -> RightTest) {
        let key = format!("{}/{}/{rest}", keys::PREFIX, self.client.keys().sim());
        if !grants_right(self.user, self.client.keys().sim(), kind, &key) {
            return;
        }
        match attempt(&key) {
            RightTest::Allowed => self.allowed.push(rest.to_owned()),
            RightTest::Refused => self.missing.push(rest.to_owned()),
            RightTest::Unknown => self.unknown.push(rest.to_owned()),
        }
    }

    fn findings(self) -> Vec<Finding> {
        let mut findings = vec![Finding::ok("rights", self.allowed.join(", "))];
        for missing in self.missing {
            let found = format!("{missing} is not let through, and the role has it");
            findings.push(Finding::fail("right", found, FIX));
        }
        if !self.unknown.is_empty() {
            findings.push(Finding::warn(
                "rights untested",
                self.unknown.join(", "),
                "time is paused, so nothing is published: resume and run this again",
            ));
        }
        findings
    }
}

/// Whether the access table grants the right to the role.
fn grants_right(user: &User, sim: &str, kind: Kind, key: &str) -> bool {
    let Ok(key) = zenoh::key_expr::keyexpr::new(key) else {
        return false;
    };
    grants(user, sim)
        .iter()
        .filter(|grant| grant.flow == Flow::Ingress && grant.kinds.contains(&kind))
        .flat_map(|grant| &grant.keys)
        .filter_map(|allowed| zenoh::key_expr::keyexpr::new(allowed.as_str()).ok())
        .any(|allowed| allowed.includes(key))
}

/// Whether the server rejects a request of an unknown version, which shows that it arrived.
fn query_arrives(client: &Client, rest: &str) -> RightTest {
    let key = format!("{}/{}/{rest}", keys::PREFIX, client.keys().sim());
    let replies = client
        .session()
        .get(key)
        .payload(Vec::<u8>::new())
        .encoding(NO_VERSION)
        .target(QueryTarget::All)
        .consolidation(ConsolidationMode::None)
        .timeout(PATIENCE)
        .wait();
    let Ok(replies) = replies else {
        return RightTest::Unknown;
    };
    let answered = replies.iter().any(|reply| client.server().answered(&reply));
    match answered {
        true => RightTest::Allowed,
        false => RightTest::Refused,
    }
}

/// Whether a sample arrives under a key.
fn is_published(client: &Client, rest: &str, moving: bool) -> RightTest {
    let key = format!("{}/{}/{rest}", keys::PREFIX, client.keys().sim());
    let (sender, receiver) = std::sync::mpsc::channel();
    let subscribed = client.subscribe(&key, move |_| {
        // The receiver may have stopped waiting.
        let _ = sender.send(());
    });
    let arrived = subscribed.is_ok_and(|_kept| receiver.recv_timeout(PATIENCE).is_ok());
    match (arrived, moving) {
        (true, _) => RightTest::Allowed,
        (false, true) => RightTest::Refused,
        (false, false) => RightTest::Unknown,
    }
}

/// Whether the command gate publishes the refusal of a command of an unknown version.
fn command_arrives(client: &Client, name: &str) -> RightTest {
    let (sender, receiver) = std::sync::mpsc::channel();
    let refusals = client.keys().topic(TopicId::Refusal);
    let wanted = name.to_owned();
    let subscribed = client.subscribe(&refusals, move |sample| {
        let refusal = v1::Refusal::decode(sample.payload().to_bytes().as_ref());
        if refusal.is_ok_and(|refusal| refusal.commander == wanted) {
            // The receiver may have stopped waiting.
            let _ = sender.send(());
        }
    });
    let Ok(_kept) = subscribed else {
        return RightTest::Unknown;
    };
    // The server may not know the subscription yet when it refuses the first ones.
    let since = Instant::now();
    while since.elapsed() < PATIENCE {
        let put = client
            .session()
            .put(client.keys().command(name), Vec::<u8>::new());
        if put.encoding(NO_VERSION).wait().is_err() {
            return RightTest::Unknown;
        }
        if receiver.recv_timeout(PATIENCE / 8).is_ok() {
            return RightTest::Allowed;
        }
    }
    RightTest::Refused
}

/// Whether the liveliness token of one session reaches another session of the same user.
fn token_arrives(client: &Client, other: &Session, key: &str) -> RightTest {
    let Ok(_token) = client.session().liveliness().declare_token(key).wait() else {
        return RightTest::Unknown;
    };
    let since = Instant::now();
    while since.elapsed() < PATIENCE {
        let replies = other.liveliness().get(key).timeout(PATIENCE).wait();
        let Ok(replies) = replies else {
            return RightTest::Unknown;
        };
        if replies.iter().any(|reply| reply.result().is_ok()) {
            return RightTest::Allowed;
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    RightTest::Refused
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_rights_of_the_role_are_tested() {
        let viewer = User::new("veit", Role::Viewer).unwrap();
        let operator = User::new("anna", Role::Operator).unwrap();
        for (kind, key, viewers, operators) in [
            (Kind::Query, "query/status", true, true),
            (Kind::Query, "query/reset", false, true),
            (Kind::Query, "query/shutdown", false, false),
            (Kind::Put, "command/anna", false, true),
            (Kind::Put, "command/veit", false, false),
            (Kind::DeclareSubscriber, "camera/gen3", false, false),
            (
                Kind::LivelinessToken,
                "commander/anna/doctor/alive",
                false,
                true,
            ),
        ] {
            let key = format!("wheelarm/lab/{key}");
            assert_eq!(grants_right(&viewer, "lab", kind, &key), viewers, "{key}");
            assert_eq!(
                grants_right(&operator, "lab", kind, &key),
                operators,
                "{key}"
            );
        }
    }
}
