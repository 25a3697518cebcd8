//! A policy process that this program starts or finds, and restarts after a failure.

use std::path::PathBuf;
use std::process::ExitStatus;
use std::time::Duration;

use crate::launcher::process::{Input, Launch, Process, Program};
use tempfile::TempDir;
use wheelarm_proto::v1;
use wheelarm_sdk::policy::{NAME_VARIABLE, POLICY_VARIABLE};
use wheelarm_sdk::{ClientError, Connect, Silence, open_session};
use zenoh::Session;

use super::interface::{PolicyError, checked};
use super::remote::{Remote, listen};

/// Least start timeout of a policy: it loads networks and imports libraries.
const START_PATIENCE: Duration = Duration::from_secs(180);
/// Exit code of a shell that does not find a command.
const NOT_FOUND: i32 = 127;
/// Fix for that exit code.
const ONE_COMMAND: &str = "the policy is one program with its arguments; combine several commands with sh -c 'cd FOLDER && exec python x.py', set variables with env NAME=VALUE python x.py";

/// A policy process, started by this program or found elsewhere.
#[derive(Debug)]
pub struct Host {
    remote: Remote,
    spec: v1::PolicySpec,
    start: Option<Start>,
    process: Option<Process>,
    _session: Session,
}

/// Settings of the start and of restarts.
#[derive(Debug)]
struct Start {
    program: Program,
    arguments: Vec<String>,
    session: Session,
    endpoint: String,
    log: PathBuf,
    patience: Duration,
    /// Number of starts. Each start has another name, because the transport keeps the
    /// declarations of a killed process for some seconds.
    count: u32,
    _socket: TempDir,
}

impl Host {
    /// Starts a program, which declares its queries as [`POLICY_VARIABLE`] and
    /// [`NAME_VARIABLE`] define. Its output is written to `policy.log` in `log`. The kernel
    /// ends it with the calling thread.
    ///
    /// # Errors
    /// [`PolicyError::Start`] with its last message, [`PolicyError::Unfit`].
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

    /// Finds the policy `name` at an endpoint.
    ///
    /// # Errors
    /// [`PolicyError::Start`] when it does not exist, [`PolicyError::Unfit`].
    pub fn find(name: &str, connect: &Connect, patience: Duration) -> Result<Self, PolicyError> {
        let session = open_session(connect, Silence::Gone);
        let session = session.map_err(|e| PolicyError::Start(describe_missing(&e)))?;
        let remote = Remote::new(session.clone(), name, patience)?;
        let wait = Duration::from_secs_f64(connect.timeout_secs.clamp(0.1, 3600.0));
        let absent = |problem| match problem {
            PolicyError::Start(words) => PolicyError::Start(format!(
                "{words} at {}: start it there, or name another endpoint with --policy-connect",
                connect.endpoint
            )),
            other => other,
        };
        remote.wait(wait, &mut || Ok(())).map_err(absent)?;
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

    /// Description of the policy.
    #[must_use]
    pub fn spec(&self) -> &v1::PolicySpec {
        &self.spec
    }

    /// Begins an episode, after a restart of a failed policy.
    ///
    /// # Errors
    /// [`PolicyError`]; [`PolicyError::Start`] when it cannot be started again.
    pub fn reset(&mut self, request: &v1::PolicyResetRequest) -> Result<(), PolicyError> {
        self.revive()?;
        let result = self.remote.reset(request);
        result.map_err(|problem| self.broke(problem))
    }

    /// Requests one chunk per observation, in their order. A policy that has ended or does
    /// not reply returns its error at once, and is restarted at the next request.
    ///
    /// # Errors
    /// [`PolicyError`]; [`PolicyError::Start`] when it cannot be started again.
    pub fn infer(
        &mut self,
        request: &v1::InferRequest,
    ) -> Result<Vec<v1::PolicyChunk>, PolicyError> {
        self.revive()?;
        let result = self.remote.infer(request);
        result.map_err(|problem| self.broke(problem))
    }

    /// Restarts a failed policy.
    fn revive(&mut self) -> Result<(), PolicyError> {
        let Some(start) = self.start.as_mut().filter(|_| self.process.is_none()) else {
            return Ok(());
        };
        let (remote, process, spec) = start.run()?;
        (self.remote, self.process) = (remote, Some(process));
        if spec != self.spec {
            tracing::warn!("the description of the policy changed with its restart");
        }
        Ok(())
    }

    /// Ends a policy that cannot reply any more, and adds its last message to the error.
    fn broke(&mut self, problem: PolicyError) -> PolicyError {
        let is_over = matches!(problem, PolicyError::Gone(_) | PolicyError::Silent { .. });
        if !is_over {
            return problem;
        }
        match (&problem, self.process.take()) {
            (PolicyError::Gone(_), Some(process)) => {
                // It may still write its last message.
                std::thread::sleep(Duration::from_millis(100));
                PolicyError::Gone(last_message(&process, None))
            }
            _ => problem,
        }
    }
}

/// Reason and fix when an endpoint has no policy.
fn describe_missing(problem: &ClientError) -> String {
    match problem {
        ClientError::NoServer {
            endpoint,
            seconds,
            cause,
        } => format!(
            "no server replies at {endpoint} (waited {seconds:.1} s): start a `wheelarm-server` or a Zenoh router there, and the policy with that endpoint, or name another with --policy-connect ({cause})"
        ),
        other => other.to_string(),
    }
}

impl Start {
    /// Starts the policy and waits until it serves.
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
        let is_shell = matches!(self.program, Program::Shell(_));
        remote.wait(
            START_PATIENCE.max(self.patience),
            &mut || match process.ended() {
                Ok(None) => Ok(()),
                Ok(Some(status)) => {
                    let cure = match is_shell && status.code() == Some(NOT_FOUND) {
                        true => ONE_COMMAND,
                        false => "",
                    };
                    Err(PolicyError::Start(
                        last_message(&process, Some(status)) + cure,
                    ))
                }
                Err(e) => Err(failed(e)),
            },
        )?;
        let spec = remote.describe()?;
        checked(&spec)?;
        Ok((remote, process, spec))
    }
}

/// The last message of a process, with its exit status if it ended without one.
fn last_message(process: &Process, status: Option<ExitStatus>) -> String {
    let words = process.last_words();
    match (words.is_empty(), process.tail()) {
        (false, _) => words,
        (true, tail) if tail.is_empty() => {
            let status = status.map(|status| format!(" ({status})"));
            format!("it printed nothing{}", status.unwrap_or_default())
        }
        (true, tail) => format!("its last output:\n{tail}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shell(line: &str, log: &std::path::Path) -> PolicyError {
        let program = Program::Shell(line.to_owned());
        let started = Host::start(program, Vec::new(), log.to_owned(), Duration::from_secs(1));
        started.unwrap_err()
    }

    #[test]
    fn several_commands_are_an_error_with_its_fix() {
        let folder = tempfile::tempdir().unwrap();
        for line in ["cd pol && python x.py", "FOO=1 python x.py"] {
            let error = shell(line, folder.path()).to_string();
            assert!(
                error.contains("sh -c") && error.contains("env NAME"),
                "{error}"
            );
        }
        let error = shell("sh -c 'echo error: no weights; exit 3'", folder.path()).to_string();
        assert!(error.ends_with("error: no weights"), "{error}");
    }

    #[test]
    fn missing_policy_is_an_error_with_its_fix() {
        let missing = ClientError::NoServer {
            endpoint: "tcp/127.0.0.1:9".to_owned(),
            seconds: 5.0,
            cause: "refused".to_owned(),
        };
        let error = describe_missing(&missing);
        assert!(error.contains("--policy-connect"), "{error}");
        assert!(!error.contains(" --connect"), "{error}");
    }
}
