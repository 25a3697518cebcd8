//! `wheelarm episode …`: an episode is started, and the word is given when it
//! runs; or ended.

use clap::{Args, Subcommand};
use wheelarm_link::Link;
use wheelarm_proto::v1;

use super::print::{episode_line, stopped_text};

/// `wheelarm episode …`.
#[derive(Subcommand, Clone, Debug)]
pub enum EpisodeCommand {
    /// Starts an episode; connected recorders open a file.
    Start(EpisodeStartArgs),
    /// Ends the running episode; recorders finish their files.
    Stop(EpisodeStopArgs),
}

/// Options of `wheelarm episode start`.
#[derive(Args, Clone, Debug)]
pub struct EpisodeStartArgs {
    /// Label: letters, digits, `-`, `_`, `.`; names the file. A recorder that has a file
    /// of that label refuses and proposes the next free one.
    #[arg(long)]
    pub label: String,
    /// Instruction sentence, stored exactly; the scenario's when absent.
    #[arg(long, default_value = "")]
    pub instruction: String,
    /// Recorders that must be ready before time goes on.
    #[arg(long, default_value_t = 0, value_name = "N")]
    pub require_recorders: u32,
    /// In lock-step: the commander that the simulation waits for; it must hold
    /// control. Whoever does when absent.
    #[arg(long, value_parser = crate::choice::name)]
    pub commander: Option<String>,
}

/// Options of `wheelarm episode stop`.
#[derive(Args, Clone, Copy, Debug)]
pub struct EpisodeStopArgs {
    /// Recorders throw the episode away.
    #[arg(long)]
    pub discard: bool,
    /// Discards also while somebody else is in control.
    #[arg(long, requires = "discard")]
    pub force: bool,
}

/// Runs `wheelarm episode …` and prints the result.
///
/// # Errors
/// When the server refuses, or the episode is over before it began.
pub fn episode(link: &Link, command: &EpisodeCommand) -> anyhow::Result<()> {
    match command {
        EpisodeCommand::Start(args) => start(link, args),
        EpisodeCommand::Stop(args) => {
            let stopped = link.ask(&v1::EpisodeStopRequest {
                discard: args.discard,
                episode: None,
                force: args.force,
                secret: link.secret(),
            })?;
            print!("{}", stopped_text(&stopped));
            Ok(())
        }
    }
}

fn start(link: &Link, args: &EpisodeStartArgs) -> anyhow::Result<()> {
    let instruction = &args.instruction;
    let started = link.start_episode(&v1::EpisodeStartRequest {
        label: args.label.clone(),
        instruction: (!instruction.is_empty()).then(|| instruction.clone()),
        require_recorders: args.require_recorders,
        commander: args.commander.clone().unwrap_or_default(),
        ..Default::default()
    })?;
    println!("started {}", episode_line(&started));
    Ok(())
}
