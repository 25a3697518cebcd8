//! A policy that this program starts, or finds, and asks again after it broke.

use std::path::PathBuf;
use std::time::Duration;

use tempfile::TempDir;
use wheelarm_link::{Connect, Silence, open_session};
use wheelarm_proto::v1;
use wheelarm_rig::{Input, Launch, Process, Program};
use zenoh::Session;

use crate::policy::{PolicyError, checked};
use crate::remote::{Remote, listen};

/// Environment variable that tells a policy the Zenoh endpoint to connect to.
pub const POLICY_VARIABLE: &str = "WHEELARM_POLICY_ENDPOINT";
/// Environment variable that tells a policy its name in the keys.
pub const NAME_VARIABLE: &str = "WHEELARM_POLICY_NAME";
/// For a policy to start: large networks are read, libraries are imported.
const START: Duration = Duration::from_secs(180);

/// A policy of this program's own, or one that runs elsewhere.
#[derive(Debug)]
pub struct Host {
    remote: Remote,
    spec: v1::PolicySpec,
    start: Option<Start>,
    process: Option<Process>,
    _session: Session,
}

/// How it is started, and again.
#[derive(Debug)]
struct Start {
    program: Program,
    arguments: Vec<String>,
    session: Session,
    endpoint: String,
    log: PathBuf,
    patience: Duration,
    /// How often it was started. Each has a name of its own: the transport still
    /// knows for some seconds what one declared that was killed.
    count: u32,
    _socket: TempDir,
}

impl Host {
    /// Starts a program, which is told by [`POLICY_VARIABLE`] and
    /// [`NAME_VARIABLE`] where to declare its queries. Its messages go to
    /// `policy.log` in `log`. The kernel ends it with the thread that calls this.
    ///
    /// # Errors
    /// [`PolicyError::Start`] with its last words, [`PolicyError::Unfit`].
    pub fn start(
        program: Program,
        arguments: Vec<String>,
        log: PathBuf,
        patience: Duration,
    ) -> Result<Self, PolicyError> {
        let socket = tempfile::Builder::new()
            .prefix("wheelarm-policy-")
            .tempdir();
        let socket = socket.map_err(|e| PolicyError::Start(e.to_string()))?;
        let (session, endpoint) = listen(socket.path())?;
        let mut start = Start {
            program,
            arguments,
            session: session.clone(),
            endpoint,
            log,
            patience,
            count: 0,
            _socket: socket,
        };
        let (remote, process, spec) = start.run()?;
        Ok(Self {
            remote,
            spec,
            start: Some(start),
            process: Some(process),
            _session: session,
        })
    }

    /// Finds the policy `name` behind an endpoint.
    ///
    /// # Errors
    /// [`PolicyError::Start`] when it is not there, [`PolicyError::Unfit`].
    pub fn find(name: &str, connect: &Connect, patience: Duration) -> Result<Self, PolicyError> {
        let session = open_session(connect, Silence::Gone);
        let session = session.map_err(|e| PolicyError::Start(e.to_string()))?;
        let remote = Remote::new(session.clone(), name, patience)?;
        let wait = Duration::from_secs_f64(connect.timeout_secs.clamp(0.1, 3600.0));
        remote.wait(wait, &mut || Ok(()))?;
        let spec = remote.describe()?;
        checked(&spec)?;
        Ok(Self {
            remote,
            spec,
            start: None,
            process: None,
            _session: session,
        })
    }

    /// What it is.
    #[must_use]
    pub fn spec(&self) -> &v1::PolicySpec {
        &self.spec
    }

    /// An episode begins.
    ///
    /// # Errors
    /// [`PolicyError`].
    pub fn reset(&mut self, request: &v1::PolicyResetRequest) -> Result<(), PolicyError> {
        let told = self.remote.reset(request);
        told.map_err(|problem| self.broke(problem))
    }

    /// Answers to observations, one for each in their order. A policy that has
    /// ended, or does not answer, is started again for whoever asks next.
    ///
    /// # Errors
    /// [`PolicyError`].
    pub fn infer(
        &mut self,
        request: &v1::InferRequest,
    ) -> Result<Vec<v1::PolicyChunk>, PolicyError> {
        let told = self.remote.infer(request);
        told.map_err(|problem| self.broke(problem))
    }

    /// Starts it again where it can answer no more; the problem with its last words.
    fn broke(&mut self, problem: PolicyError) -> PolicyError {
        let is_over = matches!(
            problem,
            PolicyError::Gone(_) | PolicyError::Silent { .. } | PolicyError::Start(_)
        );
        let Some(start) = self.start.as_mut().filter(|_| is_over) else {
            return problem;
        };
        let problem = match (&problem, self.process.take()) {
            (PolicyError::Gone(_), Some(process)) => {
                // It may still be at its last words.
                std::thread::sleep(Duration::from_millis(100));
                PolicyError::Gone(told(&process))
            }
            _ => problem,
        };
        match start.run() {
            Ok((remote, process, spec)) => {
                (self.remote, self.process) = (remote, Some(process));
                if spec != self.spec {
                    tracing::warn!("the policy describes itself otherwise than before");
                }
            }
            // Whoever asks next hears it.
            Err(again) => tracing::warn!("{again}"),
        }
        problem
    }
}

impl Start {
    /// Runs it until it serves.
    fn run(&mut self) -> Result<(Remote, Process, v1::PolicySpec), PolicyError> {
        let failed = |e: anyhow::Error| PolicyError::Start(format!("{e:#}"));
        self.count += 1;
        let name = format!("policy-{}", self.count);
        let remote = Remote::new(self.session.clone(), &name, self.patience)?;
        let environment = [
            (POLICY_VARIABLE, self.endpoint.clone()),
            (NAME_VARIABLE, name),
        ];
        let mut process = Process::start(Launch {
            name: "policy",
            program: self.program.clone(),
            arguments: self.arguments.iter().map(Into::into).collect(),
            environment: environment.map(|(k, v)| (k, v.into())).to_vec(),
            input: Input::Text(String::new()),
            folder: Some(self.log.clone()),
        })
        .map_err(failed)?;
        remote.wait(START, &mut || match process.ended() {
            Ok(None) => Ok(()),
            Ok(Some(_)) => Err(PolicyError::Start(told(&process))),
            Err(e) => Err(failed(e)),
        })?;
        let spec = remote.describe()?;
        checked(&spec)?;
        Ok((remote, process, spec))
    }
}

/// The last words of a process.
fn told(process: &Process) -> String {
    let words = process.last_words();
    match (words.is_empty(), process.tail()) {
        (false, _) => words,
        (true, tail) if tail.is_empty() => "it said nothing".to_owned(),
        (true, tail) => format!("it said last:\n{tail}"),
    }
}
