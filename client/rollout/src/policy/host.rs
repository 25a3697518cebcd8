//! A policy that this program starts, or finds, and asks again after it broke.

use std::path::PathBuf;
use std::time::Duration;

use crate::launcher::process::{Input, Launch, Process, Program};
use tempfile::TempDir;
use wheelarm_proto::v1;
use wheelarm_sdk::{ClientError, Connect, Silence, open_session};
use zenoh::Session;

use super::interface::{PolicyError, checked};
use super::remote::{Remote, listen};

/// Environment variable that tells a policy the Zenoh endpoint to connect to.
pub const POLICY_VARIABLE: &str = "WHEELARM_POLICY_ENDPOINT";
/// Environment variable that tells a policy its name in the keys.
pub const NAME_VARIABLE: &str = "WHEELARM_POLICY_NAME";
/// For a policy to start, at the least: large networks are read, libraries are imported.
const START: Duration = Duration::from_secs(180);
/// How a shell ends that finds no such command.
const NOT_FOUND: i32 = 127;
/// What is said then.
const ONE_COMMAND: &str = "the policy is one program with its arguments; of several commands make one with sh -c 'cd FOLDER && exec python x.py', set variables with env NAME=VALUE python x.py";

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
        let session = session.map_err(|e| PolicyError::Start(unfound(&e)))?;
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

    /// What it is.
    #[must_use]
    pub fn spec(&self) -> &v1::PolicySpec {
        &self.spec
    }

    /// An episode begins. A policy that broke before is started again first.
    ///
    /// # Errors
    /// [`PolicyError`]; [`PolicyError::Start`] when it cannot be started again.
    pub fn reset(&mut self, request: &v1::PolicyResetRequest) -> Result<(), PolicyError> {
        self.revive()?;
        let told = self.remote.reset(request);
        told.map_err(|problem| self.broke(problem))
    }

    /// Answers to observations, one for each in their order. A policy that has
    /// ended, or does not answer, is started again when it is asked next: whoever asked
    /// now is told at once.
    ///
    /// # Errors
    /// [`PolicyError`]; [`PolicyError::Start`] when it cannot be started again.
    pub fn infer(
        &mut self,
        request: &v1::InferRequest,
    ) -> Result<Vec<v1::PolicyChunk>, PolicyError> {
        self.revive()?;
        let told = self.remote.infer(request);
        told.map_err(|problem| self.broke(problem))
    }

    /// Starts it again where it broke before.
    fn revive(&mut self) -> Result<(), PolicyError> {
        let Some(start) = self.start.as_mut().filter(|_| self.process.is_none()) else {
            return Ok(());
        };
        let (remote, process, spec) = start.run()?;
        (self.remote, self.process) = (remote, Some(process));
        if spec != self.spec {
            tracing::warn!("the policy describes itself otherwise than before");
        }
        Ok(())
    }

    /// Ends it where it can answer no more; the problem with its last words.
    fn broke(&mut self, problem: PolicyError) -> PolicyError {
        let is_over = matches!(problem, PolicyError::Gone(_) | PolicyError::Silent { .. });
        if !is_over {
            return problem;
        }
        match (&problem, self.process.take()) {
            (PolicyError::Gone(_), Some(process)) => {
                // It may still be at its last words.
                std::thread::sleep(Duration::from_millis(100));
                PolicyError::Gone(told(&process))
            }
            _ => problem,
        }
    }
}

/// Why nobody is found behind an endpoint, with the cure.
fn unfound(problem: &ClientError) -> String {
    match problem {
        ClientError::NoServer {
            endpoint,
            seconds,
            cause,
        } => format!(
            "no server answers at {endpoint} (waited {seconds:.1} s): start a `wheelarm-server` or a Zenoh router there, and the policy with that endpoint, or name another with --policy-connect ({cause})"
        ),
        other => other.to_string(),
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
        let is_shell = matches!(self.program, Program::Shell(_));
        remote.wait(START.max(self.patience), &mut || match process.ended() {
            Ok(None) => Ok(()),
            Ok(Some(status)) => {
                let cure = match is_shell && status.code() == Some(NOT_FOUND) {
                    true => ONE_COMMAND,
                    false => "",
                };
                Err(PolicyError::Start(told(&process) + cure))
            }
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

#[cfg(test)]
mod tests {
    use super::*;

    fn shell(line: &str, log: &std::path::Path) -> PolicyError {
        let program = Program::Shell(line.to_owned());
        let started = Host::start(program, Vec::new(), log.to_owned(), Duration::from_secs(1));
        started.unwrap_err()
    }

    #[test]
    fn a_line_of_several_commands_is_told_with_the_cure() {
        let folder = tempfile::tempdir().unwrap();
        for line in ["cd pol && python x.py", "FOO=1 python x.py"] {
            let told = shell(line, folder.path()).to_string();
            assert!(
                told.contains("sh -c") && told.contains("env NAME"),
                "{told}"
            );
        }
        let told = shell("sh -c 'echo error: no weights; exit 3'", folder.path()).to_string();
        assert!(told.ends_with("error: no weights"), "{told}");
    }

    #[test]
    fn a_policy_that_is_nowhere_is_told_with_its_own_cure() {
        let nobody = ClientError::NoServer {
            endpoint: "tcp/127.0.0.1:9".to_owned(),
            seconds: 5.0,
            cause: "refused".to_owned(),
        };
        let told = unfound(&nobody);
        assert!(told.contains("--policy-connect"), "{told}");
        assert!(!told.contains(" --connect"), "{told}");
    }
}
