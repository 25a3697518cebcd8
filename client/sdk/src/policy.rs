//! A policy as a process: connects to its user, holds a liveliness token and replies to the
//! queries `describe`, `reset` and `infer`, one at a time.

use wheelarm_proto::keys::PolicyKeys;
use wheelarm_proto::{Message, schema, v1};
use zenoh::Wait;
use zenoh::query::Query;

use super::error::{ClientError, transport, words};
use super::{Connect, Silence, open_session};

/// Environment variable with the Zenoh endpoint for the policy.
pub const POLICY_VARIABLE: &str = "WHEELARM_POLICY_ENDPOINT";
/// Environment variable with the name of the policy in key expressions.
pub const NAME_VARIABLE: &str = "WHEELARM_POLICY_NAME";
/// Capacity of the queue of queries.
const WAITING: usize = 64;

/// Replies of a policy process.
pub trait PolicyService {
    /// Description of its observations and actions.
    fn spec(&self) -> v1::PolicySpec;

    /// Begins an episode.
    fn reset(&mut self, request: &v1::PolicyResetRequest);

    /// One chunk per observation, in their order; an invalid observation gets a chunk with a
    /// problem.
    fn infer(&mut self, request: &v1::InferRequest) -> v1::InferReply;
}

/// Replies until the process is ended. `ready` is called when queries are accepted.
///
/// # Errors
/// When the name is not valid in a key expression, or the transport fails.
pub fn serve(
    policy: &mut dyn PolicyService,
    name: &str,
    connect: &Connect,
    ready: impl FnOnce(),
) -> Result<(), ClientError> {
    let keys = PolicyKeys::new(name)?;
    let session = open_session(connect, Silence::Still)?;
    let (sender, queries_received) = std::sync::mpsc::sync_channel::<Query>(WAITING);
    // One queue keeps the replies in the order of the queries.
    let all = [keys.describe(), keys.reset(), keys.infer()];
    let mut open = Vec::new();
    for key in all {
        let sender = sender.clone();
        let queries = session.declare_queryable(key).callback(move |query| {
            // Queries beyond the capacity get no reply.
            let _ = sender.try_send(query);
        });
        open.push(
            queries
                .wait()
                .map_err(transport("the declaration of a query"))?,
        );
    }
    drop(sender);
    let token = session.liveliness().declare_token(keys.alive());
    let _token = token
        .wait()
        .map_err(transport("the declaration of the token"))?;
    ready();
    for query in queries_received {
        let key = query.key_expr().as_str().to_owned();
        match answer(policy, &keys, &key, &query) {
            Ok((bytes, message)) => {
                let encoding = schema::encoding(message);
                let reply = query.reply(key, bytes).encoding(encoding).wait();
                if let Err(problem) = reply {
                    tracing::warn!("cannot send a reply: {}", words(&problem));
                }
            }
            Err(problem) => {
                tracing::warn!("{problem}");
                let failure = v1::Failure {
                    message: problem.to_string(),
                    ..v1::Failure::default()
                };
                let encoding = schema::encoding("wheelarm.v1.Failure");
                let reply = query.reply_err(failure.encode_to_vec()).encoding(encoding);
                let _ = reply.wait();
            }
        }
    }
    Ok(())
}

/// The encoded answer and the name of its message.
fn answer(
    policy: &mut dyn PolicyService,
    keys: &PolicyKeys,
    key: &str,
    query: &Query,
) -> Result<(Vec<u8>, &'static str), ClientError> {
    if let Some(encoding) = query.encoding() {
        schema::check(&encoding.to_string())?;
    }
    let bytes = query.payload().map(|payload| payload.to_bytes());
    let bytes = bytes.unwrap_or_default();
    let unread = |cause| ClientError::Garbled {
        what: format!("the request {key}"),
        cause,
    };
    if key == keys.describe() {
        v1::PolicyDescribeRequest::decode(&*bytes).map_err(unread)?;
        Ok((policy.spec().encode_to_vec(), "wheelarm.v1.PolicySpec"))
    } else if key == keys.reset() {
        policy.reset(&v1::PolicyResetRequest::decode(&*bytes).map_err(unread)?);
        let reply = v1::PolicyResetReply {};
        Ok((reply.encode_to_vec(), "wheelarm.v1.PolicyResetReply"))
    } else {
        let request = v1::InferRequest::decode(&*bytes).map_err(unread)?;
        let reply = policy.infer(&request);
        Ok((reply.encode_to_vec(), "wheelarm.v1.InferReply"))
    }
}
