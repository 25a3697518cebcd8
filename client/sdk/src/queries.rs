//! Questions to the server, and what becomes of them where a connection breaks.

use std::time::{Duration, Instant};

use wheelarm_proto::{Message, Query, Rpc, schema, v1};
use zenoh::Wait;
use zenoh::qos::Priority;
use zenoh::query::{ConsolidationMode, QueryTarget, Reply};
use zenoh::sample::SourceInfo;

use super::{Client, ClientError, decode, transport};

/// How long a server's token may be away before a question is asked all the same.
const TOKEN_COMES_BACK: Duration = Duration::from_millis(500);

/// How long the end of a server's token may come after that of a query, both
/// told by the same transport.
const TOKEN_ENDS: Duration = Duration::from_millis(500);

/// Longest wait for an answer: a reset loads a scene and may build pipelines,
/// an episode waits for its recorders.
fn patience(query: Query) -> Duration {
    Duration::from_secs(match query {
        Query::Reset | Query::EpisodeStart | Query::EpisodeStop => 120,
        _ => 20,
    })
}

impl Client {
    /// Asks a query, which its request names, and waits for the reply. A server whose
    /// token is away is waited for, up to half a second of the patience; what only looks
    /// is asked twice where nobody was reached.
    ///
    /// # Errors
    /// [`ClientError::Refused`] with the server's words. Without an answer
    /// [`ClientError::Silent`] when the time is over, before that
    /// [`ClientError::Gone`] or [`ClientError::Unanswered`].
    pub fn request<R: Rpc>(&self, request: &R) -> Result<R::Reply, ClientError> {
        self.request_within(request, patience(R::QUERY))
    }

    /// As [`Client::request`] with a wait of its own.
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn request_within<R: Rpc>(
        &self,
        request: &R,
        patience: Duration,
    ) -> Result<R::Reply, ClientError> {
        let key = self.keys.request(request)?;
        self.query_bytes(R::QUERY, key, request.encode_to_vec(), patience)
    }

    fn query_bytes<R: Message + Default>(
        &self,
        query: Query,
        key: String,
        request: Vec<u8>,
        patience: Duration,
    ) -> Result<R, ClientError> {
        let asked = Instant::now();
        let away = (patience / 2).min(TOKEN_COMES_BACK);
        // What changes something may have reached the server all the same.
        let mut again = query.only_looks();
        self.find_server(away);
        loop {
            let left = patience.saturating_sub(asked.elapsed());
            if let Some(reply) = self.reply(query, &key, &request, left)? {
                return self.read(query, &reply, || {
                    self.unanswered(query, asked.elapsed(), patience)
                });
            }
            let error = self.unanswered(query, asked.elapsed(), patience);
            if !std::mem::take(&mut again) || matches!(error, ClientError::Silent { .. }) {
                return Err(error);
            }
            self.find_server(away);
            if !self.server.is_there() {
                return Err(error);
            }
        }
    }

    /// The server's reply to a query; nothing where it ended without.
    fn reply(
        &self,
        query: Query,
        key: &str,
        request: &[u8],
        patience: Duration,
    ) -> Result<Option<Reply>, ClientError> {
        let replies = self
            .session
            .get(key)
            .payload(request)
            .encoding(schema::encoding(query.messages()[0]))
            // The server serves its askers side by side.
            .source_info(SourceInfo::new(self.session.id(), 0))
            // Strangers can answer as well: all are asked, and the server's
            // answer is taken, neither held back nor displaced by another.
            .target(QueryTarget::All)
            .consolidation(ConsolidationMode::None)
            .priority(Priority::InteractiveHigh)
            .express(true)
            .timeout(patience)
            .wait()
            .map_err(transport("sending a query"))?;
        Ok(replies.iter().find(|reply| self.server.answered(reply)))
    }

    /// What a reply says.
    fn read<R: Message + Default>(
        &self,
        query: Query,
        reply: &Reply,
        silent: impl Fn() -> ClientError,
    ) -> Result<R, ClientError> {
        match reply.result() {
            Ok(sample) => {
                schema::check(&sample.encoding().to_string())?;
                decode(sample.payload(), query.name())
            }
            Err(error) => match decode::<v1::Failure>(error.payload(), query.name()) {
                // In the first version's failures the words are the same field.
                Ok(failure) if !failure.message.is_empty() => Err(ClientError::Refused {
                    query: query.name(),
                    code: failure.code(),
                    message: failure.message,
                }),
                // The transport itself reports a timeout as an error reply.
                _ => Err(silent()),
            },
        }
    }

    /// Looks who the server is. Where its token is away, it may come back at once: a
    /// connection that broke is made anew within milliseconds, and a question asked
    /// meanwhile reaches nobody.
    fn find_server(&self, patience: Duration) {
        let since = Instant::now();
        loop {
            self.server.look(&self.session);
            if self.server.is_there() || since.elapsed() >= patience {
                return;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// Whether the server is away for longer than a connection that broke takes to be made
    /// anew; waits so long.
    #[must_use]
    pub fn is_gone(&self) -> bool {
        self.find_server(TOKEN_COMES_BACK);
        !self.server.is_there()
    }

    /// Why a query ended without an answer.
    fn unanswered(&self, query: Query, after: Duration, patience: Duration) -> ClientError {
        let (sim, query) = (self.keys.sim().to_owned(), query.name());
        if after >= patience.mul_f64(0.9) {
            let seconds = patience.as_secs_f64();
            return ClientError::Silent {
                sim,
                query,
                seconds,
            };
        }
        // The transport ends a query at once when nobody is there any more; the
        // end of the server's token may come right behind.
        let known = Instant::now();
        while self.server.is_there() && known.elapsed() < TOKEN_ENDS {
            std::thread::sleep(Duration::from_millis(10));
        }
        let seconds = after.as_secs_f64();
        if self.server.is_there() {
            ClientError::Unanswered {
                sim,
                query,
                seconds,
            }
        } else {
            ClientError::Gone {
                sim,
                query,
                seconds,
            }
        }
    }
}
