//! The subcommands and their options.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::{Args, Parser, Subcommand};
use wheelarm_learn::baseline::{self, RunOptions};
use wheelarm_learn::episodes::{self, Episode};
use wheelarm_learn::trained::Trained;
use wheelarm_proto::v1;
use wheelarm_sdk::Connect;
use wheelarm_sdk::policy::{NAME_VARIABLE, POLICY_VARIABLE, PolicyService, serve};

/// Serves, trains and measures networks on the CPU.
#[derive(Parser)]
#[command(name = "wheelarm-learn", version = wheelarm_proto::program::version(), about)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Serves a policy over Zenoh until the process ends.
    Serve {
        /// The policy: a safetensors file with its card.
        file: PathBuf,
        /// Endpoint of the client.
        #[arg(long, env = POLICY_VARIABLE)]
        connect: String,
        /// Name of the policy in the keys.
        #[arg(long, env = NAME_VARIABLE, default_value = "policy")]
        name: String,
    },
    /// Prints a policy's card.
    Card {
        /// The policy.
        file: PathBuf,
    },
    /// Runs a policy on rows of recorded episodes and prints the error by row of its chunk, and
    /// the time. Without a simulation, so it says little about success.
    Try {
        /// The policy.
        file: PathBuf,
        /// Folders or files of `wheelarm dataset export --format tensors`.
        #[arg(required = true)]
        data: Vec<PathBuf>,
        /// Most rows, evenly spaced.
        #[arg(long, default_value_t = 500)]
        rows: usize,
    },
    /// Trains the baseline of WheelArm-Sim's paper, as printed and corrected. Writes a table of
    /// errors beside two naive predictors, and a figure of predictions over truth. The same
    /// command continues an interrupted run. Episodes with homes, objects, words, looks or seeds
    /// that are kept for tests are refused.
    Baseline(BaselineArgs),
}

#[derive(Args)]
struct BaselineArgs {
    /// Folders or files of `wheelarm dataset export --format tensors`, with 24 seeds or more: split
    /// 16 : 4 : 4 by seed.
    #[arg(required = true)]
    data: Vec<PathBuf>,
    /// Folder for features, checkpoints, table.md, table.csv, table.json and figures.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Rows of a window: 20 in the paper's table, 15 in its text.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u16).range(1..=1000))]
    length: u16,
    /// Most epochs; three without progress end the training.
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    epochs: u64,
    /// Weights of torchvision's resnet18, .pth or .safetensors; random without it.
    #[arg(long, value_name = "FILE")]
    backbone: Option<PathBuf>,
    /// Initial word vectors: a text file of word2vec with 300 numbers a word.
    #[arg(long, value_name = "FILE")]
    word_vectors: Option<PathBuf>,
    /// Seed of all random numbers.
    #[arg(long, default_value_t = 0)]
    seed: u64,
}

/// Runs a subcommand and returns the exit code.
pub fn run(cli: Cli) -> anyhow::Result<u8> {
    match cli.command {
        Command::Serve {
            file,
            connect,
            name,
        } => {
            let mut policy = Trained::read(&file)?;
            let connect = Connect::to(&connect, "");
            serve(&mut policy, &name, &connect, || {
                println!("ready {name} {}", file.display());
            })?;
            Ok(0)
        }
        Command::Card { file } => {
            let policy = Trained::read(&file)?;
            println!("{}", serde_json::to_string_pretty(policy.card())?);
            Ok(0)
        }
        Command::Try { file, data, rows } => evaluate_rows(&file, &data, rows),
        Command::Baseline(args) => {
            let options = RunOptions {
                out: args.out,
                length: usize::from(args.length),
                epochs: args.epochs,
                backbone: args.backbone,
                vectors: args.word_vectors,
                seed: args.seed,
            };
            let data = episodes::read(&args.data)?;
            episodes::check_training(&data, &episodes::shipped_worlds()?)?;
            let report = baseline::run(&data, &options)?;
            println!("{}", report.markdown());
            println!("table and figures: {}", options.out.display());
            Ok(0)
        }
    }
}

fn evaluate_rows(file: &Path, data: &[PathBuf], most: usize) -> anyhow::Result<u8> {
    let mut policy = Trained::read(file)?;
    let episodes = episodes::read(data)?;
    let card = policy.card().clone();
    let total: usize = episodes.iter().map(Episode::rows).sum();
    let step = (total / most.max(1)).max(1);
    let (chunk, width) = (card.chunk, card.network.action);
    let mut sums = vec![[0.0_f64; 2]; chunk];
    let mut counts = vec![0.0_f64; chunk];
    let mut millis = Vec::new();
    let mut at = 0;
    for episode in &episodes {
        for row in 0..episode.rows() {
            at += 1;
            if at % step != 0 {
                continue;
            }
            let request = v1::InferRequest {
                observations: vec![observation(episode, row, &card.cameras)],
            };
            let begun = Instant::now();
            let reply = policy.infer(&request);
            millis.push(begun.elapsed().as_secs_f64() * 1e3);
            let answer = &reply.chunks[0];
            anyhow::ensure!(answer.problem.is_empty(), "{}", answer.problem);
            for k in 0..chunk.min(episode.rows() - row) {
                let wanted = episode.actions.row(row + k);
                let found = &answer.values[k * width..(k + 1) * width];
                let now = episode.actions.row(row);
                for (i, std) in card.action.std.iter().enumerate() {
                    let share = f64::from(std * width as f32);
                    sums[k][0] += f64::from((found[i] - wanted[i]).abs()) / share;
                    sums[k][1] += f64::from((now[i] - wanted[i]).abs()) / share;
                }
                counts[k] += 1.0;
            }
        }
    }
    millis.sort_by(f64::total_cmp);
    println!("row  L1      holding the row's action");
    for (k, (sum, count)) in sums.iter().zip(&counts).enumerate() {
        println!("{:3}  {:.4}  {:.4}", k + 1, sum[0] / count, sum[1] / count);
    }
    let all = |i: usize| sums.iter().map(|s| s[i]).sum::<f64>() / counts.iter().sum::<f64>();
    println!("all  {:.4}  {:.4}", all(0), all(1));
    let middle = millis.get(millis.len() / 2).copied().unwrap_or(f64::NAN);
    println!("{} requests, median {middle:.1} ms each", millis.len());
    Ok(0)
}

/// A recorded row as an observation of a rollout.
fn observation(
    episode: &Episode,
    row: usize,
    cameras: &[wheelarm_learn::card::CameraCard],
) -> v1::PolicyObservation {
    let images = cameras
        .iter()
        .filter(|camera| episode.cameras.contains_key(&camera.name));
    let images = images.map(|camera| {
        let size = &episode.cameras[&camera.name];
        v1::PolicyImage {
            camera: camera.name.clone(),
            width: size.width as u32,
            height: size.height as u32,
            color: episode.image(&camera.name, row).to_vec().into(),
            ..Default::default()
        }
    });
    let state = episode.states.row(row).iter().copied().map(f64::from);
    v1::PolicyObservation {
        episode_key: episode.about.label.clone(),
        seed: episode.about.seed,
        first: row == 0,
        tick: row as u64,
        instruction: episode.about.instruction.clone(),
        steps: vec![v1::PolicyStep {
            state_values: state.collect(),
            images: images.collect(),
        }],
    }
}
