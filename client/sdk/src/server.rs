//! Server identity: the Zenoh session ID carried in the server's liveliness token.
//! Samples and replies from any other session are dropped.

use std::sync::Arc;

use parking_lot::RwLock;
use wheelarm_proto::keys::Keys;
use zenoh::Session;
use zenoh::Wait;
use zenoh::pubsub::Subscriber;
use zenoh::query::Reply;
use zenoh::sample::{Sample, SampleKind};
use zenoh::session::ZenohId;

use super::{ClientError, transport};

/// The server of a client, identified by its tokens.
#[derive(Clone, Debug, Default)]
pub struct Server {
    known: Arc<RwLock<Known>>,
}

#[derive(Debug, Default)]
struct Known {
    /// Sessions that declare the server's token now.
    tokens: Vec<ZenohId>,
    /// The session that is accepted as the server, also while it is away.
    chosen: Option<ZenohId>,
    /// The chosen session was at the other end of this session's own connection.
    direct: bool,
}

impl Known {
    /// Chooses the server while the chosen one is away: the session at the other end of
    /// our connection or, behind a router, the only one.
    fn choose(&mut self, connected: &[ZenohId]) {
        if self.chosen.is_some_and(|id| self.tokens.contains(&id)) {
            return;
        }
        let dialled = self.tokens.iter().find(|id| connected.contains(id));
        let choice = match (dialled, &self.tokens[..]) {
            (Some(id), _) => Some((*id, true)),
            // A server that we connected to directly is connected to again after a
            // restart; another session's token may arrive before its token.
            (None, [id]) if !self.direct => Some((*id, false)),
            _ => None,
        };
        if let Some((id, direct)) = choice {
            (self.chosen, self.direct) = (Some(id), direct);
        }
    }
}

impl Server {
    /// Watches the tokens of the server that `keys` names until the subscriber is dropped.
    pub(super) fn watch(
        session: &Session,
        keys: &Keys,
    ) -> Result<(Self, Subscriber<()>), ClientError> {
        let server = Self::default();
        let known = Arc::clone(&server.known);
        let subscriber = session
            .liveliness()
            .declare_subscriber(keys.alive("*"))
            .history(true)
            .callback(move |sample| {
                let Some(id) = session_of(&sample) else {
                    return;
                };
                let mut known = known.write();
                known.tokens.retain(|other| *other != id);
                if sample.kind() == SampleKind::Put {
                    known.tokens.push(id);
                }
            })
            .wait()
            .map_err(transport("watching the server"))?;
        Ok((server, subscriber))
    }

    /// Chooses the server again while it is away; returns whether the choice changed.
    pub(super) fn look(&self, session: &Session) -> bool {
        if self.is_there() {
            return false;
        }
        let info = session.info();
        // A server of this session counts as directly connected.
        let connected: Vec<ZenohId> = info
            .routers_zid()
            .wait()
            .chain(info.peers_zid().wait())
            .chain([session.zid()])
            .collect();
        let mut known = self.known.write();
        let before = known.chosen;
        known.choose(&connected);
        known.chosen != before
    }

    /// Whether the server's token is declared.
    #[must_use]
    pub fn is_there(&self) -> bool {
        let known = self.known.read();
        known.chosen.is_some_and(|id| known.tokens.contains(&id))
    }

    /// Whether `id` is the server's session.
    #[must_use]
    pub fn is(&self, id: ZenohId) -> bool {
        let known = self.known.read();
        known.chosen == Some(id)
    }

    /// Whether the server published a sample, by the session ID in it. A session ID can be
    /// forged; a caller that must be sure compares digests.
    #[must_use]
    pub fn sent(&self, sample: &Sample) -> bool {
        sample
            .source_info()
            .is_some_and(|source| self.is(source.source_id().zid()))
    }

    /// Whether the server sent a reply.
    #[must_use]
    pub fn answered(&self, reply: &Reply) -> bool {
        reply.replier_id().is_some_and(|id| self.is(id.zid()))
    }

    /// Session IDs that declare the server's token.
    #[must_use]
    pub fn tokens(&self) -> Vec<String> {
        let known = self.known.read();
        known.tokens.iter().map(ToString::to_string).collect()
    }
}

/// The session that a server's liveliness token names.
#[must_use]
pub fn session_of(token: &Sample) -> Option<ZenohId> {
    let (_, id) = Keys::server_of(token.key_expr().as_str())?;
    id.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn id(text: &str) -> ZenohId {
        text.parse().unwrap()
    }

    #[test]
    fn foreign_token_never_replaces_a_directly_connected_server() {
        let (server, next, stranger) = (id("a1"), id("a2"), id("b1"));
        let mut known = Known {
            tokens: vec![stranger, server],
            ..Known::default()
        };
        known.choose(&[server]);
        assert_eq!(known.chosen, Some(server));
        // The server is killed, and the foreign token is declared first.
        known.tokens = vec![stranger];
        known.choose(&[]);
        assert_eq!(known.chosen, Some(server));
        known.tokens.push(next);
        known.choose(&[next]);
        assert_eq!(known.chosen, Some(next));
    }

    #[test]
    fn behind_a_router_the_only_token_is_the_server_and_two_are_ambiguous() {
        let (router, first, second) = (id("c1"), id("a1"), id("a2"));
        let mut known = Known {
            tokens: vec![first, second],
            ..Known::default()
        };
        known.choose(&[router]);
        assert_eq!(known.chosen, None);
        known.tokens = vec![first];
        known.choose(&[router]);
        assert_eq!(known.chosen, Some(first));
        // A second one changes nothing while the first is there.
        known.tokens.push(second);
        known.choose(&[router]);
        assert_eq!(known.chosen, Some(first));
        known.tokens = vec![second];
        known.choose(&[router]);
        assert_eq!(known.chosen, Some(second), "a successor");
    }
}
