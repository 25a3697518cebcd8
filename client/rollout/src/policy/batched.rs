//! One policy for many episodes: waiting observations form a batch. A failed batch is repeated
//! one by one, so that only the episode at fault fails.

use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::{Duration, Instant};

use wheelarm_proto::v1;

use super::host::Host;
use super::interface::{Policy, PolicyError};

/// Longest wait of the first observation of a batch for others.
const GATHER: Duration = Duration::from_millis(3);
/// Capacity of the queue; each episode has one request.
const WAITING: usize = 256;

/// A policy that several threads may use at the same time.
#[derive(Debug)]
pub struct Batched {
    spec: v1::PolicySpec,
    queue: SyncSender<Request>,
}

#[derive(Debug)]
enum Request {
    Reset(v1::PolicyResetRequest, SyncSender<Result<(), PolicyError>>),
    Infer(v1::PolicyObservation, ReplySender),
}

type ReplySender = SyncSender<Result<v1::PolicyChunk, PolicyError>>;

impl Batched {
    /// Starts the policy with `start` on a thread that ends with this value. A batch has at
    /// most `most` observations; without it, as many as the policy accepts.
    ///
    /// # Errors
    /// The error of `start`.
    pub fn start(
        start: impl FnOnce() -> Result<Host, PolicyError> + Send + 'static,
        most: Option<usize>,
    ) -> Result<Self, PolicyError> {
        let (queue, requests) = sync_channel(WAITING);
        let (spec_sender, spec) = sync_channel(1);
        let spawned = std::thread::Builder::new()
            .name("policy".to_owned())
            .spawn(move || match start() {
                Ok(mut host) => {
                    let spec = host.spec().clone();
                    let takes = (spec.max_batch.max(1)) as usize;
                    let most = most.map_or(takes, |most| most.clamp(1, takes));
                    // The receiver is gone only when the program ends.
                    if spec_sender.send(Ok(spec)).is_ok() {
                        serve(&mut host, &requests, most);
                    }
                }
                Err(problem) => {
                    let _ = spec_sender.send(Err(problem));
                }
            });
        spawned.map_err(|e| PolicyError::Start(e.to_string()))?;
        let gone = |_| PolicyError::Start("its thread ended".to_owned());
        let spec = spec.recv().map_err(gone)??;
        Ok(Self { spec, queue })
    }
}

impl Policy for Batched {
    fn spec(&self) -> &v1::PolicySpec {
        &self.spec
    }

    fn reset(&self, request: v1::PolicyResetRequest) -> Result<(), PolicyError> {
        let (sender, reply) = sync_channel(1);
        self.queue
            .send(Request::Reset(request, sender))
            .map_err(|_| over())?;
        reply.recv().map_err(|_| over())?
    }

    fn infer(&self, observation: v1::PolicyObservation) -> Result<v1::PolicyChunk, PolicyError> {
        let (sender, reply) = sync_channel(1);
        self.queue
            .send(Request::Infer(observation, sender))
            .map_err(|_| over())?;
        reply.recv().map_err(|_| over())?
    }
}

fn over() -> PolicyError {
    PolicyError::Gone("its thread has ended".to_owned())
}

/// Serves requests until the last sender is dropped.
fn serve(host: &mut Host, requests: &Receiver<Request>, most: usize) {
    let (mut waiting, mut answers) = (Vec::new(), Vec::new());
    let mut until = Instant::now();
    loop {
        let next = match waiting.is_empty() {
            true => requests.recv().map_err(|_| RecvTimeoutError::Disconnected),
            false => requests.recv_timeout(until.saturating_duration_since(Instant::now())),
        };
        match next {
            Ok(Request::Reset(request, sender)) => {
                let result = match host.reset(&request) {
                    // It had ended before the request, and was started again.
                    Err(PolicyError::Gone(_)) => host.reset(&request),
                    other => other,
                };
                // The caller may have given up.
                let _ = sender.send(result);
            }
            Ok(Request::Infer(observation, sender)) => {
                if waiting.is_empty() {
                    until = Instant::now() + GATHER;
                }
                waiting.push(observation);
                answers.push(sender);
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) if waiting.is_empty() => return,
            Err(RecvTimeoutError::Disconnected) => until = Instant::now(),
        }
        if waiting.len() >= most || (!waiting.is_empty() && Instant::now() >= until) {
            let all = std::mem::take(&mut waiting);
            answer(host, all, std::mem::take(&mut answers));
        }
    }
}

/// Replies to all waiting requests.
fn answer(host: &mut Host, waiting: Vec<v1::PolicyObservation>, answers: Vec<ReplySender>) {
    let request = v1::InferRequest {
        observations: waiting,
    };
    let all = match host.infer(&request) {
        Ok(chunks) => chunks.into_iter().map(Ok).collect(),
        // It may have ended before the request: repeat it, as after a batch.
        Err(problem)
            if request.observations.len() == 1 && !matches!(problem, PolicyError::Gone(_)) =>
        {
            vec![Err(problem)]
        }
        Err(_) => one_by_one(host, request.observations),
    };
    for (chunk, answer) in all.into_iter().zip(answers) {
        // The caller may have given up.
        let _ = answer.send(chunk.and_then(without_problem));
    }
}

fn one_by_one(
    host: &mut Host,
    observations: Vec<v1::PolicyObservation>,
) -> Vec<Result<v1::PolicyChunk, PolicyError>> {
    let request = |observation| {
        let request = v1::InferRequest {
            observations: vec![observation],
        };
        host.infer(&request)?.pop().ok_or_else(over)
    };
    observations.into_iter().map(request).collect()
}

fn without_problem(chunk: v1::PolicyChunk) -> Result<v1::PolicyChunk, PolicyError> {
    match chunk.problem.is_empty() {
        true => Ok(chunk),
        false => Err(PolicyError::Rejected(chunk.problem)),
    }
}
