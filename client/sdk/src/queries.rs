//! Sends queries to the server and repeats or reports those that a lost connection ends.

use std::time::{Duration, Instant};

use wheelarm_proto::{Message, Query, Rpc, schema, v1};
use zenoh::Wait;
use zenoh::qos::Priority;
use zenoh::query::{ConsolidationMode, QueryTarget, Reply};
use zenoh::sample::SourceInfo;

use super::{Client, ClientError, decode, transport};

/// Longest wait for a missing token of the server before a query is sent anyway.
const TOKEN_RETURN: Duration = Duration::from_millis(500);

/// Longest delay between the end of a query and the end of the server's token, which
/// the same transport reports.
const TOKEN_END: Duration = Duration::from_millis(500);

/// Longest wait for a reply: a reset loads a scene and may build pipelines, an episode
/// waits for its recorders.
fn patience(query: Query) -> Duration {
    Duration::from_secs(match query {
        Query::Reset | Query::EpisodeStart | Query::EpisodeStop => 120,
        _ => 20,
    })
}

impl Client {
    /// Sends the query of a request and waits for the reply. Waits up to half a second
    /// for a server whose token is missing. A read-only query is sent once more when it
    /// did not reach the server.
    ///
    /// # Errors
    /// [`ClientError::Refused`] with the server's message. Without a reply
    /// [`ClientError::Silent`] after the timeout, [`ClientError::Gone`] or
    /// [`ClientError::Unanswered`] before it.
    pub fn request<R: Rpc>(&self, request: &R) -> Result<R::Reply, ClientError> {
        self.request_within(request, patience(R::QUERY))
    }

    /// As [`Client::request`] with the timeout `patience`.
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
        let sent_at = Instant::now();
        let away = (patience / 2).min(TOKEN_RETURN);
        // A query that changes state may have reached the server: never send it twice.
        let mut again = query.only_looks();
        self.find_server(away);
        loop {
            let left = patience.saturating_sub(sent_at.elapsed());
            if let Some(reply) = self.reply(query, &key, &request, left)? {
                return self.read(query, &reply, || {
                    self.unanswered(query, sent_at.elapsed(), patience)
                });
            }
            let error = self.unanswered(query, sent_at.elapsed(), patience);
            if !std::mem::take(&mut again) || matches!(error, ClientError::Silent { .. }) {
                return Err(error);
            }
            self.find_server(away);
            if !self.server.is_there() {
                return Err(error);
            }
        }
    }

    /// The server's reply to a query; `None` when the query ended without one.
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
            // The server schedules queries per client.
            .source_info(SourceInfo::new(self.session.id(), 0))
            // Other sessions can reply too: query all and keep the server's reply, which
            // none of them can delay or replace.
            .target(QueryTarget::All)
            .consolidation(ConsolidationMode::None)
            .priority(Priority::InteractiveHigh)
            .express(true)
            .timeout(patience)
            .wait()
            .map_err(transport("sending a query"))?;
        Ok(replies.iter().find(|reply| self.server.answered(reply)))
    }

    /// Decodes a reply, or its failure.
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
                // Contract version 1 has the message in the same field.
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

    /// Identifies the server and waits up to `patience` for a missing token: a lost
    /// connection is restored within milliseconds, and a query sent meanwhile fails.
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

    /// Whether the server stays away for longer than a lost connection takes to be
    /// restored; waits that long.
    #[must_use]
    pub fn is_gone(&self) -> bool {
        self.find_server(TOKEN_RETURN);
        !self.server.is_there()
    }

    /// The error of a query that ended without a reply.
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
        // The transport ends a query as soon as the server disconnects; the end of the
        // server's token may follow.
        let ended_at = Instant::now();
        while self.server.is_there() && ended_at.elapsed() < TOKEN_END {
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
