//! What the user of these keys may do at the server: every right that its role has
//! is tried in a way that changes nothing. A request of no version of the contract
//! is refused by a server that it reaches, and ends without a word where the
//! transport does not let it through.

use std::time::{Duration, Instant};

use wheelarm_access::{About, Flow, Kind, Role, User, grants};
use wheelarm_proto::keys;
use wheelarm_proto::preview::PreviewLevel;
use wheelarm_proto::{Message, Query, TopicId, v1};
use wheelarm_sdk::{Client, Connect, Silence, open_session};
use zenoh::query::{ConsolidationMode, QueryTarget};
use zenoh::{Session, Wait};

use super::finding::Finding;

/// Longest wait for what should come.
const PATIENCE: Duration = Duration::from_secs(2);
/// A version that no program speaks.
const NO_VERSION: &str = "application/protobuf;wheelarm.v1.Nothing@0";
/// What to do about a right that is missing.
const CURE: &str = "ask who runs the server: `wheelarm users list` says the role, and a server knows the users that were added before it was started";

/// What came of one try.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Tried {
    /// It got through.
    Allowed,
    /// It did not.
    Refused,
    /// Nothing comes now, for anybody.
    Unknown,
}

/// Tries every right of the role, and what is over or missing of the keys.
pub fn appearance(
    connect: &Connect,
    link: &Client,
    status: &v1::Status,
    tell: &mut dyn FnMut(Finding),
) {
    let Some(identity) = &connect.identity else {
        return;
    };
    let Some(about) = About::beside(identity.folder()) else {
        tell(Finding::warn(
            "keys",
            format!(
                "{} does not say whose they are",
                identity.folder().display()
            ),
            "let them be made anew: wheelarm keys user NAME",
        ));
        return;
    };
    let found = format!("of {}, {}, until {}", about.user, about.role, about.until);
    tell(match about.is_over() {
        true => Finding::fail(
            "keys",
            found,
            "they are over: wheelarm keys user NAME makes new ones",
        ),
        false => Finding::ok("keys", found),
    });
    let Ok(user) = User::new(&about.user, about.role) else {
        return;
    };
    let mut tries = Tries {
        link,
        user: &user,
        right: Vec::new(),
        missing: Vec::new(),
        unknown: Vec::new(),
    };
    for query in Query::ALL {
        let name = match query.has_identity() {
            true => format!("{}/{}", query.name(), user.name),
            false => query.name().to_owned(),
        };
        let key = format!("query/{name}");
        tries.note(Kind::Query, &key, &|_| reaches(link, &key));
    }
    let moving = !status.paused && status.waiting_for.is_empty();
    let clock = TopicId::Clock.info().key;
    tries.note(Kind::DeclareSubscriber, clock, &|_| {
        comes(link, clock, moving)
    });
    let cameras = status.scenario.clone().unwrap_or_default().cameras;
    if let Some(camera) = cameras.iter().find(|camera| camera.rate_hz != Some(0.0)) {
        let key = format!("preview/{}/{}", camera.name, PreviewLevel::Low.name());
        tries.note(Kind::DeclareSubscriber, &key, &|_| {
            comes(link, &key, moving)
        });
        let key = format!("camera/{}", camera.name);
        tries.note(Kind::DeclareSubscriber, &key, &|_| {
            comes(link, &key, moving)
        });
    }
    if user.role.commands() {
        let key = format!("command/{}", user.name);
        tries.note(Kind::Put, &key, &|_| commands(link, &user.name));
    }
    let token = match user.role {
        Role::Operator | Role::Admin => Some(format!("commander/{}/doctor/alive", user.name)),
        // A recorder of that name may be at work; its sign of life is let alone.
        Role::Recorder | Role::Viewer => None,
    };
    if let Some(token) = token {
        let other = open_session(connect, Silence::Gone);
        let other = other.as_ref().ok();
        tries.note(Kind::LivelinessToken, &token, &|key| {
            other.map_or(Tried::Unknown, |other| lives(link, other, key))
        });
    }
    for finding in tries.findings() {
        tell(finding);
    }
}

struct Tries<'a> {
    link: &'a Client,
    user: &'a User,
    right: Vec<String>,
    missing: Vec<String>,
    unknown: Vec<String>,
}

impl Tries<'_> {
    /// Tries one right that the role has; of others nothing is said.
    fn note(&mut self, kind: Kind, rest: &str, attempt: &dyn Fn(&str) -> Tried) {
        let key = format!("{}/{}/{rest}", keys::PREFIX, self.link.keys().sim());
        if !has(self.user, self.link.keys().sim(), kind, &key) {
            return;
        }
        match attempt(&key) {
            Tried::Allowed => self.right.push(rest.to_owned()),
            Tried::Refused => self.missing.push(rest.to_owned()),
            Tried::Unknown => self.unknown.push(rest.to_owned()),
        }
    }

    fn findings(self) -> Vec<Finding> {
        let mut findings = vec![Finding::ok("rights", self.right.join(", "))];
        for missing in self.missing {
            let found = format!("{missing} is not let through, and the role has it");
            findings.push(Finding::fail("right", found, CURE));
        }
        if !self.unknown.is_empty() {
            findings.push(Finding::warn(
                "rights untried",
                self.unknown.join(", "),
                "time stands still, so nothing is published: let it go on and ask again",
            ));
        }
        findings
    }
}

/// Whether the table gives the role a right.
fn has(user: &User, sim: &str, kind: Kind, key: &str) -> bool {
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

/// Whether the server refuses a request that it cannot understand.
fn reaches(link: &Client, rest: &str) -> Tried {
    let key = format!("{}/{}/{rest}", keys::PREFIX, link.keys().sim());
    let asked = link
        .session()
        .get(key)
        .payload(Vec::<u8>::new())
        .encoding(NO_VERSION)
        .target(QueryTarget::All)
        .consolidation(ConsolidationMode::None)
        .timeout(PATIENCE)
        .wait();
    let Ok(replies) = asked else {
        return Tried::Unknown;
    };
    let answered = replies.iter().any(|reply| link.server().answered(&reply));
    match answered {
        true => Tried::Allowed,
        false => Tried::Refused,
    }
}

/// Whether something is published to us under a key.
fn comes(link: &Client, rest: &str, moving: bool) -> Tried {
    let key = format!("{}/{}/{rest}", keys::PREFIX, link.keys().sim());
    let (seen, sees) = std::sync::mpsc::channel();
    let subscribed = link.subscribe(&key, move |_| {
        // Whoever waited may have gone.
        let _ = seen.send(());
    });
    let came = subscribed.is_ok_and(|_kept| sees.recv_timeout(PATIENCE).is_ok());
    match (came, moving) {
        (true, _) => Tried::Allowed,
        (false, true) => Tried::Refused,
        (false, false) => Tried::Unknown,
    }
}

/// Whether the gate tells that it refused a command of no version.
fn commands(link: &Client, name: &str) -> Tried {
    let (seen, sees) = std::sync::mpsc::channel();
    let refusals = link.keys().topic(TopicId::Refusal);
    let wanted = name.to_owned();
    let subscribed = link.subscribe(&refusals, move |sample| {
        let refusal = v1::Refusal::decode(sample.payload().to_bytes().as_ref());
        if refusal.is_ok_and(|refusal| refusal.commander == wanted) {
            // Whoever waited may have gone.
            let _ = seen.send(());
        }
    });
    let Ok(_kept) = subscribed else {
        return Tried::Unknown;
    };
    // The first ones may be sent before the server knows who listens.
    let since = Instant::now();
    while since.elapsed() < PATIENCE {
        let put = link
            .session()
            .put(link.keys().command(name), Vec::<u8>::new());
        if put.encoding(NO_VERSION).wait().is_err() {
            return Tried::Unknown;
        }
        if sees.recv_timeout(PATIENCE / 8).is_ok() {
            return Tried::Allowed;
        }
    }
    Tried::Refused
}

/// Whether a sign of life of one session reaches another of the same user.
fn lives(link: &Client, other: &Session, key: &str) -> Tried {
    let Ok(_token) = link.session().liveliness().declare_token(key).wait() else {
        return Tried::Unknown;
    };
    let since = Instant::now();
    while since.elapsed() < PATIENCE {
        let asked = other.liveliness().get(key).timeout(PATIENCE).wait();
        let Ok(replies) = asked else {
            return Tried::Unknown;
        };
        if replies.iter().any(|reply| reply.result().is_ok()) {
            return Tried::Allowed;
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    Tried::Refused
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_the_role_has_is_tried() {
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
            assert_eq!(has(&viewer, "lab", kind, &key), viewers, "{key}");
            assert_eq!(has(&operator, "lab", kind, &key), operators, "{key}");
        }
    }
}
