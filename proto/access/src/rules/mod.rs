//! The table of rights: which messages under which keys each role may send and receive.
//!
//! All others are rejected. A key of a rule must include the key of the message: `*`
//! and `**` do not match chunks that start with `@`, so those of the publishers' caches
//! (`@adv`) are listed. `sim` may be `*`, for a router.

use serde::Serialize;

use wheelarm_proto::keys::PREFIX;
use wheelarm_proto::preview::PreviewLevel;

use super::{Role, User};

/// A kind of message in the transport.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// A sample.
    Put,
    /// The end of a sample.
    Delete,
    /// A subscription.
    DeclareSubscriber,
    /// A query.
    Query,
    /// A reply.
    Reply,
    /// A queryable.
    DeclareQueryable,
    /// A liveliness token.
    LivelinessToken,
    /// A query for liveliness tokens.
    LivelinessQuery,
    /// A subscription to liveliness tokens.
    DeclareLivelinessSubscriber,
}

impl Kind {
    /// All of them.
    pub const ALL: [Self; 9] = [
        Self::Put,
        Self::Delete,
        Self::DeclareSubscriber,
        Self::Query,
        Self::Reply,
        Self::DeclareQueryable,
        Self::LivelinessToken,
        Self::LivelinessQuery,
        Self::DeclareLivelinessSubscriber,
    ];
}

/// Direction of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Flow {
    /// From the user.
    Ingress,
    /// To the user.
    Egress,
}

/// An allowed flow of messages.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Grant {
    /// Direction.
    pub flow: Flow,
    /// Kinds of messages.
    pub kinds: Vec<Kind>,
    /// Keys; each includes those of the messages.
    pub keys: Vec<String>,
}

/// Rights of a user on the server `sim`.
#[must_use]
pub fn grants(user: &User, sim: &str) -> Vec<Grant> {
    let mut table = Table::new(sim);
    let me = &user.name;
    match user.role {
        Role::Viewer => table.viewer(),
        Role::Operator => {
            table.viewer();
            table.operator(me);
            if user.images {
                table.images();
                table.ask(&["sensors"]);
            }
        }
        Role::Recorder => {
            table.viewer();
            table.recorder(me);
        }
        Role::Admin => table.admin(),
    }
    table.grants
}

/// Rights of servers towards each other through a router, and of a router: all keys of
/// this system.
#[must_use]
pub fn grants_of_servers() -> Vec<Grant> {
    let keys = vec![format!("{PREFIX}/**"), format!("{PREFIX}/**/@adv/**")];
    let both = [Flow::Ingress, Flow::Egress];
    both.map(|flow| Grant {
        flow,
        kinds: Kind::ALL.to_vec(),
        keys: keys.clone(),
    })
    .to_vec()
}

/// Queries that change state, or that only commanders need.
const OF_OPERATORS: [&str; 7] = [
    "reach",
    "pick",
    "reset",
    "pause",
    "resume",
    "episode_start",
    "episode_stop",
];

struct Table {
    sim: String,
    grants: Vec<Grant>,
}

impl Table {
    /// With the rights of every user: available servers, subscriptions and queryables,
    /// because the transport sends nothing without known receivers.
    fn new(sim: &str) -> Self {
        let mut table = Self {
            sim: sim.to_owned(),
            grants: Vec::new(),
        };
        table.watch(vec![format!("{PREFIX}/*/alive/*")]);
        let all = vec![table.key("**")];
        table.let_out(&[Kind::DeclareSubscriber, Kind::DeclareQueryable], all);
        table
    }

    fn key(&self, rest: &str) -> String {
        format!("{PREFIX}/{}/{rest}", self.sim)
    }

    fn let_in(&mut self, kinds: &[Kind], keys: Vec<String>) {
        self.grants.push(Grant {
            flow: Flow::Ingress,
            kinds: kinds.to_vec(),
            keys,
        });
    }

    fn let_out(&mut self, kinds: &[Kind], keys: Vec<String>) {
        self.grants.push(Grant {
            flow: Flow::Egress,
            kinds: kinds.to_vec(),
            keys,
        });
    }

    /// Liveliness tokens of others.
    fn watch(&mut self, keys: Vec<String>) {
        let kinds = [Kind::LivelinessQuery, Kind::DeclareLivelinessSubscriber];
        self.let_in(&kinds, keys.clone());
        self.let_out(&[Kind::LivelinessToken], keys);
    }

    /// A liveliness token of its own, and the query whether the name is free.
    fn live(&mut self, key: &str) {
        let keys = vec![self.key(key)];
        self.let_in(&[Kind::LivelinessToken], keys.clone());
        self.watch(keys);
    }

    fn send(&mut self, key: &str) {
        let keys = vec![self.key(key)];
        self.let_in(&[Kind::Put], keys);
    }

    fn ask(&mut self, queries: &[&str]) {
        let keys: Vec<String> = queries
            .iter()
            .map(|query| self.key(&format!("query/{query}")))
            .collect();
        self.let_in(&[Kind::Query], keys.clone());
        self.let_out(&[Kind::Reply], keys);
    }

    /// What is published under these keys, with what the publishers keep of it
    /// for who came late or missed something.
    fn listen(&mut self, keys: &[&str]) {
        let data: Vec<String> = keys.iter().map(|key| self.key(key)).collect();
        let kept: Vec<String> = data.iter().map(|key| format!("{key}/@adv/**")).collect();
        let both = [&data[..], &kept[..]].concat();
        self.let_in(&[Kind::DeclareSubscriber], both.clone());
        self.let_out(&[Kind::Put, Kind::Delete], both.clone());
        // Missed samples arrive as the reply to a query, under its own key.
        self.let_in(&[Kind::Query], kept.clone());
        self.let_out(&[Kind::Reply], both);
        self.let_out(&[Kind::DeclareQueryable], kept.clone());
        self.watch(kept);
    }

    fn viewer(&mut self) {
        self.listen(&["stream/*", "episode/*", "refusal"]);
        let levels: Vec<String> = PreviewLevel::ALL
            .iter()
            .map(|level| format!("preview/*/{}", level.name()))
            .collect();
        let levels: Vec<&str> = levels.iter().map(String::as_str).collect();
        self.listen(&levels);
        self.ask(&["status", "scene", "map", "tasks", "packs"]);
    }

    fn operator(&mut self, me: &str) {
        self.send(&format!("command/{me}"));
        self.live(&format!("commander/{me}/*/alive"));
        self.ask(&[&format!("lease/{me}")]);
        self.ask(&OF_OPERATORS);
    }

    fn images(&mut self) {
        self.listen(&["camera/*", "compressed/*", "sensor/*"]);
    }

    fn recorder(&mut self, me: &str) {
        self.send(&format!("recorder/{me}"));
        self.live(&format!("recorder/{me}/alive"));
        self.images();
        // The running episode, for a recorder that is late or missed a message.
        self.ask(&["snapshot", "episode"]);
    }

    /// Everything except what only the server publishes and answers, and its liveliness
    /// token.
    fn admin(&mut self) {
        self.send("command/*");
        self.send("recorder/*");
        self.live("commander/*/*/alive");
        self.live("recorder/*/alive");
        let (all, kept) = (self.key("**"), self.key("**/@adv/**"));
        let both = vec![all.clone(), kept.clone()];
        self.let_in(&[Kind::DeclareSubscriber, Kind::Query], both.clone());
        self.watch(both.clone());
        self.let_out(
            &[Kind::Put, Kind::Delete, Kind::Reply, Kind::DeclareQueryable],
            both,
        );
        // Policies that answer through this server.
        let policies = vec![format!("{PREFIX}/policy/**")];
        self.let_in(&Kind::ALL, policies.clone());
        self.let_out(&Kind::ALL, policies);
    }
}

#[cfg(test)]
mod tests;
