//! Control and commands: one commander is in control at a time.

use std::time::{Duration, Instant};

use parking_lot::Mutex;
use wheelarm_proto::Query;
use wheelarm_proto::keys;
use wheelarm_proto::{Message, seal, v1};
use wheelarm_proto::{TopicId, schema};
use zenoh::Wait;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Priority};

use super::{Client, ClientError, transport};

/// Longest wait until the server has received this process's token.
const TOKEN_SEEN: Duration = Duration::from_secs(5);

/// A commander in control. Its sequence numbers start at 0, and its commands carry the
/// seal of its lease. Dropping it releases control; the end of this process does too.
pub struct Commander {
    client: Client,
    publisher: Publisher<'static>,
    _token: LivelinessToken,
    name: String,
    run_id: String,
    sequence: u64,
    /// Secret of the lease; empty before the first.
    secret: Mutex<String>,
}

impl Client {
    /// Acquires control as `name`; with `take` from the commander that holds it.
    ///
    /// # Errors
    /// [`ClientError::Refused`], which names the commander in control and how to take
    /// over.
    pub fn commander(&self, name: &str, take: bool) -> Result<Commander, ClientError> {
        let run_id = keys::run_id();
        let publisher = self
            .session
            .declare_publisher(self.keys.command(name))
            .encoding(schema::encoding(TopicId::SentCommand.info().message))
            .congestion_control(CongestionControl::Block)
            .priority(Priority::RealTime)
            .express(true)
            .wait()
            .map_err(transport("opening the command channel"))?;
        let token = self
            .session
            .liveliness()
            .declare_token(self.keys.commander_alive(name, &run_id))
            .wait()
            .map_err(transport("announcing the commander"))?;
        let commander = Commander {
            client: self.clone(),
            publisher,
            _token: token,
            name: name.to_owned(),
            run_id,
            sequence: 0,
            secret: Mutex::default(),
        };
        commander.acquire(take)?;
        Ok(commander)
    }
}

impl Commander {
    /// Acquires control again, after it was lost with the connection or, with `take`, to
    /// another commander. Does nothing while this commander holds it.
    ///
    /// # Errors
    /// As [`Client::commander`].
    pub fn acquire(&self, take: bool) -> Result<v1::LeaseReply, ClientError> {
        let request = self.lease_request(take, false);
        let deadline = Instant::now() + TOKEN_SEEN;
        loop {
            let reply: v1::LeaseReply = self.client.request(&request)?;
            if reply.holder == self.name {
                if !reply.secret.is_empty() {
                    self.client.keep_secret(&reply.secret);
                    let mut secret = self.secret.lock();
                    secret.clone_from(&reply.secret);
                }
                return Ok(reply);
            }
            if Instant::now() > deadline {
                return Err(ClientError::Refused {
                    query: Query::Lease.name(),
                    code: v1::FailureCode::NoControl,
                    message: format!(
                        "the server has not received the token of commander {:?}",
                        self.name
                    ),
                });
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Sends `command` for the control tick of `clock`.
    ///
    /// # Errors
    /// [`ClientError::Transport`].
    pub fn answer(
        &mut self,
        clock: &v1::Header,
        mut command: v1::Command,
    ) -> Result<(), ClientError> {
        command.header = Some(v1::Header {
            run_id: self.run_id.clone(),
            sequence: self.sequence,
            ..clock.clone()
        });
        command.commander.clone_from(&self.name);
        command.answers_tick = Some(clock.tick);
        self.sequence += 1;
        let mut bytes = command.encode_to_vec();
        let secret = self.secret();
        if !secret.is_empty() {
            seal::append(&mut bytes, &secret);
        }
        self.publisher
            .put(bytes)
            .wait()
            .map_err(transport("sending a command"))
    }

    /// Name of the commander.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// ID of this process's run, as in the header of its commands.
    #[must_use]
    pub fn run_id(&self) -> &str {
        &self.run_id
    }

    /// Number of commands sent.
    #[must_use]
    pub fn sent(&self) -> u64 {
        self.sequence
    }

    fn secret(&self) -> String {
        let secret = self.secret.lock();
        secret.clone()
    }

    fn lease_request(&self, take: bool, release: bool) -> v1::LeaseRequest {
        v1::LeaseRequest {
            header: Some(v1::Header {
                run_id: self.run_id.clone(),
                ..Default::default()
            }),
            commander: self.name.clone(),
            take,
            release,
            secret: self.secret(),
            sealed: true,
        }
    }
}

impl Drop for Commander {
    fn drop(&mut self) {
        if self.client.secret() == self.secret() {
            self.client.keep_secret("");
        }
        // Without a reply, control ends with the token, a little later.
        let request = self.lease_request(false, true);
        let released = self.client.request_within(&request, Duration::from_secs(1));
        if let Err(problem) = released {
            tracing::debug!("cannot release control: {problem}");
        }
    }
}
