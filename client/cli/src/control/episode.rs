//! `wheelarm episode …`: an episode is started, and the word is given when it
//! runs; or ended.

use std::process::ExitCode;

use clap::{Args, Subcommand};
use wheelarm_proto::v1;
use wheelarm_sdk::Client;

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
    #[arg(long, value_parser = wheelarm_options::choice::name)]
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

/// Runs `wheelarm episode …` and prints the result. Exit code 3 when a recorder has not
/// confirmed that it has the whole episode.
///
/// # Errors
/// When the server refuses, or the episode is over before it began.
pub fn episode(link: &Client, command: &EpisodeCommand) -> anyhow::Result<ExitCode> {
    match command {
        EpisodeCommand::Start(args) => start(link, args).map(|()| ExitCode::SUCCESS),
        EpisodeCommand::Stop(args) => {
            let stopped = link.request(&v1::EpisodeStopRequest {
                discard: args.discard,
                episode: None,
                force: args.force,
                secret: link.secret(),
            })?;
            print!("{}", stopped_text(&stopped));
            Ok(match stopped.unconfirmed_recorders.is_empty() {
                true => ExitCode::SUCCESS,
                false => ExitCode::from(3),
            })
        }
    }
}

fn start(link: &Client, args: &EpisodeStartArgs) -> anyhow::Result<()> {
    let instruction = &args.instruction;
    let status = link.request(&v1::StatusRequest {})?;
    if let Some(words) = waiting(args.require_recorders, &status) {
        eprintln!("{words}");
    }
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

/// The recorders that an episode will wait for because they do not answer, in words.
fn waiting(required: u32, status: &v1::Status) -> Option<String> {
    let all = status.recorders.iter();
    let recorders = all.filter(|one| one.silent_seconds.is_none());
    let names: Vec<&str> = recorders.map(|one| one.recorder.as_str()).collect();
    (names.len() < required as usize).then(|| {
        let connected = match names.is_empty() {
            true => "none".to_owned(),
            false => names.join(", "),
        };
        format!(
            "waiting for {required} recorder(s), connected: {connected}; start one with \
             `wheelarm record`"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wait_for_recorders_names_those_that_are_connected() {
        let mut status = v1::Status::default();
        assert_eq!(waiting(0, &status), None);
        let words = waiting(1, &status).unwrap();
        assert!(words.contains("connected: none; start one with `wheelarm record`"));
        status.recorders = vec![v1::RecorderStatus {
            recorder: "r".to_owned(),
            ..v1::RecorderStatus::default()
        }];
        assert_eq!(waiting(1, &status), None);
        assert!(waiting(2, &status).unwrap().contains("connected: r;"));
        status.recorders[0].silent_seconds = Some(4.0);
        assert!(waiting(1, &status).unwrap().contains("connected: none;"));
    }
}
