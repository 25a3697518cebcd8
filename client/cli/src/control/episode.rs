//! `wheelarm episode …`: starts an episode and waits until it runs, or ends it.

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
    /// Label: letters, digits, `-`, `_`, `.`; names the file. A recorder that already has a
    /// file of that label rejects it and proposes the next free one.
    #[arg(long)]
    pub label: String,
    /// Instruction, stored verbatim; the scenario's when absent.
    #[arg(long, default_value = "")]
    pub instruction: String,
    /// Recorders that must be ready before time runs.
    #[arg(long, default_value_t = 0, value_name = "N")]
    pub require_recorders: u32,
    /// In lock-step: the commander that the simulation waits for; it must hold control.
    /// Default: the commander that holds control.
    #[arg(long, value_parser = wheelarm_options::choice::name)]
    pub commander: Option<String>,
}

/// Options of `wheelarm episode stop`.
#[derive(Args, Clone, Copy, Debug)]
pub struct EpisodeStopArgs {
    /// Recorders discard the episode.
    #[arg(long)]
    pub discard: bool,
    /// Discards even while another client is in control.
    #[arg(long, alias = "take", requires = "discard")]
    pub force: bool,
}

/// Runs `wheelarm episode …` and prints the result. Exit code 3 when a recorder has not
/// confirmed a complete file.
///
/// # Errors
/// When the server rejects the request, or the episode ends before it begins.
pub fn episode(client: &Client, command: &EpisodeCommand) -> anyhow::Result<ExitCode> {
    match command {
        EpisodeCommand::Start(args) => start(client, args).map(|()| ExitCode::SUCCESS),
        EpisodeCommand::Stop(args) => {
            let stopped = client.request(&v1::EpisodeStopRequest {
                discard: args.discard,
                episode: None,
                force: args.force,
                secret: client.secret(),
            })?;
            print!("{}", stopped_text(&stopped));
            Ok(match stopped.unconfirmed_recorders.is_empty() {
                true => ExitCode::SUCCESS,
                false => ExitCode::from(3),
            })
        }
    }
}

fn start(client: &Client, args: &EpisodeStartArgs) -> anyhow::Result<()> {
    let instruction = &args.instruction;
    let status = client.request(&v1::StatusRequest {})?;
    if let Some(message) = recorders_warning(args.require_recorders, &status) {
        eprintln!("{message}");
    }
    let started = client.start_episode(&v1::EpisodeStartRequest {
        label: args.label.clone(),
        instruction: (!instruction.is_empty()).then(|| instruction.clone()),
        require_recorders: args.require_recorders,
        commander: args.commander.clone().unwrap_or_default(),
        ..Default::default()
    })?;
    println!("started {}", episode_line(&started));
    Ok(())
}

/// Warning that the episode will wait for recorders; `None` when enough are connected.
fn recorders_warning(required: u32, status: &v1::Status) -> Option<String> {
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
    fn warning_names_the_connected_recorders() {
        let mut status = v1::Status::default();
        assert_eq!(recorders_warning(0, &status), None);
        let message = recorders_warning(1, &status).unwrap();
        assert!(message.contains("connected: none; start one with `wheelarm record`"));
        status.recorders = vec![v1::RecorderStatus {
            recorder: "r".to_owned(),
            ..v1::RecorderStatus::default()
        }];
        assert_eq!(recorders_warning(1, &status), None);
        assert!(
            recorders_warning(2, &status)
                .unwrap()
                .contains("connected: r;")
        );
        status.recorders[0].silent_seconds = Some(4.0);
        assert!(
            recorders_warning(1, &status)
                .unwrap()
                .contains("connected: none;")
        );
    }
}
