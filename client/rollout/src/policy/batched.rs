//! Many episodes and one policy: what waits is asked together, and what broke
//! together is asked one by one, so that only the culprit pays.

use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::{Duration, Instant};

use wheelarm_proto::v1;

use super::host::Host;
use super::interface::{Policy, PolicyError};

/// How long the first of a batch waits for others.
const GATHER: Duration = Duration::from_millis(3);
/// Questions that may wait; each asker has one.
const WAITING: usize = 256;

/// A policy that several threads may ask at one time.
#[derive(Debug)]
pub struct Batched {
    spec: v1::PolicySpec,
    queue: SyncSender<Ask>,
}

#[derive(Debug)]
enum Ask {
    Reset(v1::PolicyResetRequest, SyncSender<Result<(), PolicyError>>),
    Infer(v1::PolicyObservation, Answer),
}

type Answer = SyncSender<Result<v1::PolicyChunk, PolicyError>>;

impl Batched {
    /// Starts the policy by `start` on a thread of its own, which ends with this;
    /// `most` observations are asked about at a time, as many as the policy takes
    /// without it.
    ///
    /// # Errors
    /// What `start` says.
    pub fn start(
        start: impl FnOnce() -> Result<Host, PolicyError> + Send + 'static,
        most: Option<usize>,
    ) -> Result<Self, PolicyError> {
        let (queue, asked) = sync_channel(WAITING);
        let (told, spec) = sync_channel(1);
        let spawned = std::thread::Builder::new()
            .name("policy".to_owned())
            .spawn(move || match start() {
                Ok(mut host) => {
                    let spec = host.spec().clone();
                    let takes = (spec.max_batch.max(1)) as usize;
                    let most = most.map_or(takes, |most| most.clamp(1, takes));
                    // Nobody waits for it any more only when the program ends.
                    if told.send(Ok(spec)).is_ok() {
                        serve(&mut host, &asked, most);
                    }
                }
                Err(problem) => {
                    let _ = told.send(Err(problem));
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
        let (answer, told) = sync_channel(1);
        self.queue
            .send(Ask::Reset(request, answer))
            .map_err(|_| over())?;
        told.recv().map_err(|_| over())?
    }

    fn infer(&self, observation: v1::PolicyObservation) -> Result<v1::PolicyChunk, PolicyError> {
        let (answer, told) = sync_channel(1);
        self.queue
            .send(Ask::Infer(observation, answer))
            .map_err(|_| over())?;
        told.recv().map_err(|_| over())?
    }
}

fn over() -> PolicyError {
    PolicyError::Gone("whoever asked it has ended".to_owned())
}

/// Asks until nobody can ask any more.
fn serve(host: &mut Host, asked: &Receiver<Ask>, most: usize) {
    let (mut waiting, mut answers) = (Vec::new(), Vec::new());
    let mut until = Instant::now();
    loop {
        let next = match waiting.is_empty() {
            true => asked.recv().map_err(|_| RecvTimeoutError::Disconnected),
            false => asked.recv_timeout(until.saturating_duration_since(Instant::now())),
        };
        match next {
            Ok(Ask::Reset(request, answer)) => {
                let told = match host.reset(&request) {
                    // It had ended before it was asked, and has been started again.
                    Err(PolicyError::Gone(_)) => host.reset(&request),
                    told => told,
                };
                // Who asked may have given up.
                let _ = answer.send(told);
            }
            Ok(Ask::Infer(observation, answer)) => {
                if waiting.is_empty() {
                    until = Instant::now() + GATHER;
                }
                waiting.push(observation);
                answers.push(answer);
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

/// Answers everybody who waits.
fn answer(host: &mut Host, waiting: Vec<v1::PolicyObservation>, answers: Vec<Answer>) {
    let request = v1::InferRequest {
        observations: waiting,
    };
    let all = match host.infer(&request) {
        Ok(chunks) => chunks.into_iter().map(Ok).collect(),
        // It may have ended before it was asked: then once more, as after a batch.
        Err(problem)
            if request.observations.len() == 1 && !matches!(problem, PolicyError::Gone(_)) =>
        {
            vec![Err(problem)]
        }
        Err(_) => one_by_one(host, request.observations),
    };
    for (chunk, answer) in all.into_iter().zip(answers) {
        // Who asked may have given up.
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
        false => Err(PolicyError::Said(chunk.problem)),
    }
}
