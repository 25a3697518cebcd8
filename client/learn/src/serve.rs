//! A policy as a process: it connects to whoever asks it, holds its liveliness
//! token and answers the queries `describe`, `reset` and `infer`, one at a time.

use anyhow::Context;
use wheelarm_proto::keys::PolicyKeys;
use wheelarm_proto::{Message, schema, v1};
use wheelarm_sdk::{Connect, Silence, open_session};
use zenoh::Wait;
use zenoh::query::Query;

/// Environment variable that tells a policy the Zenoh endpoint to connect to.
pub const ENDPOINT_VARIABLE: &str = "WHEELARM_POLICY_ENDPOINT";
/// Environment variable that tells a policy its name in the keys.
pub const NAME_VARIABLE: &str = "WHEELARM_POLICY_NAME";
/// Questions that may wait.
const WAITING: usize = 64;

/// What answers for a robot.
pub trait Policy {
    /// What it wants and answers.
    fn spec(&self) -> v1::PolicySpec;

    /// An episode begins.
    fn reset(&mut self, request: &v1::PolicyResetRequest);

    /// A chunk for every observation, in their order; one that does not fit is
    /// answered by a problem in words.
    fn infer(&mut self, request: &v1::InferRequest) -> v1::InferReply;
}

/// Answers until the process is ended. `ready` is called when questions are taken.
///
/// # Errors
/// When the name cannot stand in a key, or the transport fails.
pub fn serve(
    policy: &mut dyn Policy,
    name: &str,
    connect: &Connect,
    ready: impl FnOnce(),
) -> anyhow::Result<()> {
    let keys = PolicyKeys::new(name)?;
    let session = open_session(connect, Silence::Still)?;
    let failed = |problem: zenoh::Error| anyhow::anyhow!("the transport: {problem}");
    let (sender, queries_received) = std::sync::mpsc::sync_channel::<Query>(WAITING);
    // One queue: an answer never stands behind a question that came later.
    let all = [keys.describe(), keys.reset(), keys.infer()];
    let mut open = Vec::new();
    for key in all {
        let sender = sender.clone();
        let queries = session.declare_queryable(key).callback(move |query| {
            // Whoever asks more than waits here is not answered.
            let _ = sender.try_send(query);
        });
        open.push(queries.wait().map_err(failed)?);
    }
    drop(sender);
    let token = session.liveliness().declare_token(keys.alive());
    let _token = token.wait().map_err(failed)?;
    ready();
    for query in queries_received {
        let key = query.key_expr().as_str().to_owned();
        match answer(policy, &keys, &key, &query) {
            Ok((bytes, message)) => {
                let encoding = schema::encoding(message);
                let reply = query.reply(key, bytes).encoding(encoding).wait();
                if let Err(problem) = reply {
                    tracing::warn!("an answer does not arrive: {problem}");
                }
            }
            Err(problem) => {
                tracing::warn!("{problem:#}");
                let failure = v1::Failure {
                    message: format!("{problem:#}"),
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
    policy: &mut dyn Policy,
    keys: &PolicyKeys,
    key: &str,
    query: &Query,
) -> anyhow::Result<(Vec<u8>, &'static str)> {
    if let Some(encoding) = query.encoding() {
        schema::check(&encoding.to_string())?;
    }
    let bytes = query.payload().map(|payload| payload.to_bytes());
    let bytes = bytes.unwrap_or_default();
    let unread = || format!("the request {key} cannot be read");
    if key == keys.describe() {
        v1::PolicyDescribeRequest::decode(&*bytes).with_context(unread)?;
        Ok((policy.spec().encode_to_vec(), "wheelarm.v1.PolicySpec"))
    } else if key == keys.reset() {
        policy.reset(&v1::PolicyResetRequest::decode(&*bytes).with_context(unread)?);
        let reply = v1::PolicyResetReply {};
        Ok((reply.encode_to_vec(), "wheelarm.v1.PolicyResetReply"))
    } else {
        let request = v1::InferRequest::decode(&*bytes).with_context(unread)?;
        let reply = policy.infer(&request);
        Ok((reply.encode_to_vec(), "wheelarm.v1.InferReply"))
    }
}
