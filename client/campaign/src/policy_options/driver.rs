//! The driver that `--policy` names: the scripted expert or a policy.

use std::ops::Range;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context, bail};
use wheelarm_expert::forced::ForcedError;
use wheelarm_proto::installed::file_or_asset;
use wheelarm_proto::v1;
use wheelarm_rollout::launcher::Program;
use wheelarm_rollout::policy::openpi::{NameMap, OpenPi};
use wheelarm_rollout::policy::{Batched, Hold, Host, Policy, PolicyOptions, Repeat, checked};
use wheelarm_rollout::{Driver, Expert, PolicyDriver, Takeover};
use wheelarm_sdk::Connect;

use super::nearest::Nearest;
use super::{Choice, PolicyArgs};
use crate::episode_seed::mixed;

/// The driver that `--policy` names.
#[derive(Clone)]
pub enum DriverChoice {
    /// The scripted expert.
    Expert,
    /// A policy, the execution of its chunks, and the latest time of the takeover by the
    /// expert, s.
    Policy(Arc<dyn Policy>, PolicyOptions, Option<f64>),
}

/// Settings of the start of a driver.
#[derive(Clone, Debug)]
pub struct Start<'a> {
    /// Seeds of its episodes.
    pub seeds: Range<u64>,
    /// Folder for the log of the policy's process.
    pub log: &'a Path,
    /// Sends one observation at a time, without batches.
    pub alone: bool,
    /// Latest time at which the scripted operator takes over.
    pub takeover: Option<Duration>,
}

impl DriverChoice {
    /// Starts the driver of `--policy`.
    ///
    /// # Errors
    /// When the policy does not start, is incompatible, has chunks with fewer rows than are
    /// executed, or was trained on the seeds; when `--takeover` is given without a policy.
    pub fn start(args: &PolicyArgs, start: &Start<'_>) -> anyhow::Result<Self> {
        let patience = args.policy_patience;
        let most = start.alone.then_some(1);
        let process = |program: Program, arguments: Vec<String>| {
            let log = start.log.to_owned();
            let start = move || Host::start(program, arguments, log, patience);
            Batched::start(start, most)
        };
        let policy: Arc<dyn Policy> = match &args.policy {
            Choice::Operator => {
                if let Some(most) = start.takeover {
                    bail!(
                        "--takeover {}: without a policy there is nothing to take over; name one with --policy",
                        most.as_secs_f64()
                    );
                }
                return Ok(Self::Expert);
            }
            Choice::Hold => Arc::new(Hold::default()),
            Choice::Repeat => Arc::new(Repeat::default()),
            Choice::Replay(folder) => Arc::new(Nearest::of(folder)?),
            Choice::Act(file) => {
                let file = file_or_asset(file);
                if !file.exists() {
                    bail!(
                        "{} does not exist: check the path after act:",
                        file.display()
                    );
                }
                let arguments = vec!["serve".to_owned(), file.display().to_string()];
                Arc::new(process(Program::Own("wheelarm-learn"), arguments)?)
            }
            Choice::Exec(line) => Arc::new(process(Program::Shell(line.clone()), Vec::new())?),
            Choice::Openpi(address) => {
                let map = name_map(&args.policy_map)?;
                let alone = start.alone;
                Arc::new(OpenPi::connect(address, map, patience, alone)?)
            }
            Choice::Lerobot(folder) => {
                if !folder.join("config.json").is_file() {
                    bail!(
                        "{} is not a LeRobot checkpoint: config.json is missing; name its folder `pretrained_model`",
                        folder.display()
                    );
                }
                let line = "\"${WHEELARM_PYTHON:-python3}\" -m wheelarm.lerobot_policy";
                let arguments = vec![folder.display().to_string()];
                Arc::new(process(Program::Shell(line.to_owned()), arguments)?)
            }
            Choice::Zenoh(name) => {
                let connect = Connect::to(&args.policy_connect, "");
                let name = name.clone();
                let start = move || Host::find(&name, &connect, patience);
                Arc::new(Batched::start(start, most)?)
            }
        };
        let spec = policy.spec();
        if !args.training_seeds {
            check_training_seeds(spec, &start.seeds)?;
        }
        let (_, ticks) = checked(spec)?;
        let row = ticks * wheelarm_proto::TICKS_PER_CONTROL as u32;
        if !args.latency.is_multiple_of(row) {
            bail!(
                "--latency {}: a row of this policy has {row} ticks; use a multiple of it",
                args.latency
            );
        }
        let latency = args.latency / row;
        if args.ensemble.is_none() {
            check_rows(spec, args.execute, latency)?;
        }
        let options = PolicyOptions {
            execute: args.execute,
            latency,
            ensemble: args.ensemble,
            ..PolicyOptions::default()
        };
        let takeover = start.takeover.map(|most| most.as_secs_f64());
        Ok(Self::Policy(policy, options, takeover))
    }

    /// Whether it is the scripted expert.
    #[must_use]
    pub fn is_expert(&self) -> bool {
        matches!(self, Self::Expert)
    }

    /// The driver of one episode; `forced` is the deliberate error of the expert.
    #[must_use]
    pub fn for_episode(&self, seed: u64, forced: Option<ForcedError>) -> Driver {
        let expert = Expert {
            forced,
            ..Expert::default()
        };
        match self {
            Self::Expert => Driver::Expert(expert),
            Self::Policy(policy, options, takeover) => Driver::Policy(PolicyDriver {
                policy: Arc::clone(policy),
                options: options.clone(),
                takeover: takeover.map(|most| Takeover {
                    seconds: most * share(seed),
                    expert,
                }),
            }),
        }
    }

    /// Description of a policy in one line; absent for the expert.
    #[must_use]
    pub fn description(&self) -> Option<String> {
        let Self::Policy(policy, options, _) = self else {
            return None;
        };
        let spec = policy.spec();
        let seeds: u64 = spec.training_seeds.iter().map(|r| r.end - r.first).sum();
        let cameras = spec.cameras.iter();
        let cameras: Vec<String> = cameras
            .map(|c| format!("{} {}x{}", c.name, c.width, c.height))
            .collect();
        Some(format!(
            "policy {}: {}, chunks of {} rows at {} Hz of which {} are executed, trained on {seeds} seeds",
            self.name(),
            if cameras.is_empty() {
                "no images".to_owned()
            } else {
                cameras.join(" and ")
            },
            spec.chunk,
            spec.rate_hz,
            options.execute.unwrap_or(spec.execute)
        ))
    }

    /// SHA-256 of the policy's weights, hexadecimal; empty without any.
    #[must_use]
    pub fn weights(&self) -> &str {
        match self {
            Self::Expert => "",
            Self::Policy(policy, ..) => &policy.spec().weights_sha256,
        }
    }

    /// Whether the driver observes images.
    #[must_use]
    pub fn observes_images(&self) -> bool {
        match self {
            Self::Expert => false,
            Self::Policy(policy, ..) => !policy.spec().cameras.is_empty(),
        }
    }

    /// Name for results; empty for the scripted operator.
    #[must_use]
    pub fn name(&self) -> String {
        let Self::Policy(policy, options, takeover) = self else {
            return String::new();
        };
        let spec = policy.spec();
        let hash = spec.weights_sha256.get(..12).map(|hash| format!("@{hash}"));
        let mut name = spec.name.clone() + &hash.unwrap_or_default();
        let execute = options.execute.filter(|rows| *rows != spec.execute);
        name += &execute.map_or(String::new(), |rows| format!(", execute {rows}"));
        if options.latency > 0 {
            name += &format!(", latency {} rows", options.latency);
        }
        if let Some(k) = options.ensemble {
            name += &format!(", ensemble {k}");
        }
        if let Some(most) = takeover {
            name += &format!(", operator after {most} s at most");
        }
        name
    }

    /// Cameras that its servers need; those of the recordings are `recorded`.
    ///
    /// # Errors
    /// When a recording needs other images of a camera than the policy.
    pub fn cameras(
        &self,
        recorded: Vec<v1::CameraSetting>,
        is_requested: bool,
    ) -> anyhow::Result<Vec<v1::CameraSetting>> {
        let Self::Policy(policy, ..) = self else {
            return Ok(recorded);
        };
        let spec = policy.spec();
        if spec.cameras.is_empty() {
            return Ok(recorded);
        }
        let mut cameras: Vec<v1::CameraSetting> = spec
            .cameras
            .iter()
            .map(|camera| v1::CameraSetting {
                name: camera.name.clone(),
                width: camera.width,
                height: camera.height,
                rate_hz: Some(spec.rate_hz),
                ..Default::default()
            })
            .collect();
        for camera in recorded.into_iter().filter(|_| is_requested) {
            match cameras
                .iter()
                .find(|own| own.name == camera.name || camera.name == "*")
            {
                Some(own) if *own == camera => {}
                Some(own) => bail!(
                    "the policy needs camera {:?} at {}x{} and {} Hz, and --camera names another format; remove it",
                    own.name,
                    own.width,
                    own.height,
                    spec.rate_hz
                ),
                None => cameras.push(camera),
            }
        }
        Ok(cameras)
    }
}

/// The share of the longest time for which the policy drives, sampled from the seed: 0 to 1.
fn share(seed: u64) -> f64 {
    (mixed(seed ^ 0x7a6b_0c57_11d3_95e1) >> 11) as f64 / (1_u64 << 53) as f64
}

/// Reads the map of names of a policy at a WebSocket.
fn name_map(path: &Path) -> anyhow::Result<NameMap> {
    let path = &file_or_asset(path);
    let text = std::fs::read_to_string(path).with_context(|| {
        format!(
            "reading the map of names {}; use --policy-map FILE, for example assets/policies/openpi.toml",
            path.display()
        )
    })?;
    NameMap::read(&text).map_err(|problem| anyhow::anyhow!("{}: {problem}", path.display()))
}

/// Rejects a policy whose chunks have fewer rows than are executed `latency` rows late.
fn check_rows(spec: &v1::PolicySpec, execute: Option<u32>, latency: u32) -> anyhow::Result<()> {
    let chunk = spec.chunk;
    if let Some(execute) = execute.filter(|execute| *execute > chunk) {
        bail!("--execute {execute}: a chunk of this policy has {chunk} rows; use 1 to {chunk}");
    }
    let execute = execute.unwrap_or(spec.execute);
    // The previous chunk is executed until the late one arrives.
    let needed = execute + 2 * latency;
    if needed > chunk {
        bail!(
            "a chunk of this policy has {chunk} rows, and {execute} executed {latency} rows late need {needed}; use a lower --latency or --execute"
        );
    }
    Ok(())
}

/// Rejects seeds that a policy was trained on.
fn check_training_seeds(spec: &v1::PolicySpec, seeds: &Range<u64>) -> anyhow::Result<()> {
    let both = spec
        .training_seeds
        .iter()
        .find(|trained| trained.first < seeds.end && seeds.start < trained.end);
    let Some(both) = both else {
        return Ok(());
    };
    Err(anyhow::anyhow!(
        "the policy {:?} was trained on the seeds {}..{}, which overlap the requested {}..{}",
        spec.name, both.first, both.end, seeds.start, seeds.end
    ))
    .context("use other seeds (assets/splits/policy-claim.toml), or --training-seeds to evaluate on training data")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_rows_than_a_chunk_has_are_rejected() {
        let spec = v1::PolicySpec {
            chunk: 20,
            execute: 10,
            ..Default::default()
        };
        for (execute, latency) in [(None, 0), (Some(20), 0), (None, 5), (Some(1), 9)] {
            assert!(check_rows(&spec, execute, latency).is_ok());
        }
        for (execute, latency, words) in [
            (Some(21), 0, "has 20 rows; use 1 to 20"),
            (None, 6, "10 executed 6 rows late need 22"),
        ] {
            let error = check_rows(&spec, execute, latency).unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        }
    }

    #[test]
    fn takeover_needs_a_policy() {
        #[derive(clap::Parser)]
        struct Cli {
            #[command(flatten)]
            args: PolicyArgs,
        }
        let args = <Cli as clap::Parser>::parse_from(["evaluate"]).args;
        let start = Start {
            seeds: 0..1,
            log: Path::new("."),
            alone: false,
            takeover: Some(Duration::from_secs(5)),
        };
        let error = DriverChoice::start(&args, &start)
            .err()
            .unwrap()
            .to_string();
        assert!(error.contains("--policy"), "{error}");
    }

    #[test]
    fn training_seeds_are_rejected() {
        let spec = v1::PolicySpec {
            training_seeds: vec![v1::SeedRange {
                first: 500,
                end: 600,
            }],
            ..Default::default()
        };
        assert!(check_training_seeds(&spec, &(0..500)).is_ok());
        assert!(check_training_seeds(&spec, &(600..700)).is_ok());
        let error = format!(
            "{:#}",
            check_training_seeds(&spec, &(599..610)).unwrap_err()
        );
        assert!(
            error.contains("500..600") && error.contains("--training-seeds"),
            "{error}"
        );
    }
}
