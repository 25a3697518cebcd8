//! `wheelarm episode …`: an episode is started, and the word is given when it
//! runs; or ended.

use std::time::Duration;

use anyhow::bail;
use clap::{Args, Subcommand};
use wheelarm_link::Link;
use wheelarm_proto::v1;

use super::print::{episode_line, stopped_text};

/// Between two questions whether an episode runs.
const LOOK: Duration = Duration::from_millis(50);

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
    /// Label: letters, digits, `-`, `_`, `.`; names the file.
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
    let started = link.ask(&v1::EpisodeStartRequest {
        label: args.label.clone(),
        instruction: (!instruction.is_empty()).then(|| instruction.clone()),
        require_recorders: args.require_recorders,
        commander: args.commander.clone().unwrap_or_default(),
        ..Default::default()
    })?;
    // It is announced: now its recorders open their files, or cannot.
    loop {
        let status = link.ask(&v1::StatusRequest {})?;
        match stage(&started, args.require_recorders, &status) {
            Stage::Runs => break,
            Stage::Waits => std::thread::sleep(LOOK),
            Stage::Refused(why) => bail!("episode {:?} did not begin: {why}", args.label),
            Stage::Over => {
                check_begun(link, &started)?;
                break;
            }
        }
    }
    println!("started {}", episode_line(&started));
    Ok(())
}

/// How far an announced episode is.
#[derive(Debug, PartialEq)]
enum Stage {
    /// It waits for recorders.
    Waits,
    Runs,
    /// A recorder cannot take part; its words.
    Refused(String),
    /// It is not the running episode any more.
    Over,
}

fn stage(started: &v1::EpisodeStarted, required: u32, status: &v1::Status) -> Stage {
    let id = |header: Option<&v1::Header>| {
        let header = header.cloned().unwrap_or_default();
        (header.run_id, header.episode)
    };
    let ours = id(started.header.as_ref());
    let of_ours = || {
        let recorders = status.recorders.iter();
        recorders.filter(|recorder| id(recorder.header.as_ref()) == ours)
    };
    let count = |state| of_ours().filter(|r| r.state() == state).count();
    let running = status.episode.as_ref();
    let is_running = running.is_some_and(|episode| id(episode.header.as_ref()) == ours);
    let waits = status.waiting_for_code() == v1::WaitingFor::Recorders;
    if is_running && !waits && count(v1::RecorderState::Ready) >= required as usize {
        return Stage::Runs;
    }
    let failed = of_ours().find(|r| r.state() == v1::RecorderState::Failed);
    match failed {
        Some(failed) => Stage::Refused(format!(
            "recorder {} cannot record it: {}",
            failed.recorder, failed.message
        )),
        None if is_running => Stage::Waits,
        None => Stage::Over,
    }
}

/// Tells an episode that has been ended since from one that never began.
fn check_begun(link: &Link, started: &v1::EpisodeStarted) -> anyhow::Result<()> {
    let number = |header: Option<&v1::Header>| header.map_or(0, |header| header.episode);
    let ours = number(started.header.as_ref());
    let state = link.ask(&v1::EpisodeRequest {})?;
    let mut ended = state.ended.iter();
    let end = ended.find(|end| number(end.header.as_ref()) == ours);
    if end.is_some_and(|end| end.cause() == v1::EndCause::Recorders) {
        bail!(
            "episode {:?} did not begin: its recorders were not ready in time; look with \
             `wheelarm status` which are there, and start others with `wheelarm record`",
            started.label
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use v1::{RecorderState, WaitingFor};

    fn header(episode: u64) -> Option<v1::Header> {
        Some(v1::Header {
            run_id: "run".to_owned(),
            episode,
            ..v1::Header::default()
        })
    }

    fn started() -> v1::EpisodeStarted {
        v1::EpisodeStarted {
            header: header(3),
            ..v1::EpisodeStarted::default()
        }
    }

    fn recorder(episode: u64, state: RecorderState, message: &str) -> v1::RecorderStatus {
        v1::RecorderStatus {
            header: header(episode),
            recorder: "r".to_owned(),
            state: state.into(),
            message: message.to_owned(),
            ..v1::RecorderStatus::default()
        }
    }

    #[test]
    fn an_episode_runs_when_its_recorders_are_ready_and_not_before() {
        let status = |waiting: WaitingFor, recorders: &[v1::RecorderStatus]| v1::Status {
            episode: Some(started()),
            waiting_for_code: waiting.into(),
            recorders: recorders.to_vec(),
            ..v1::Status::default()
        };
        let stage = |required, status: &v1::Status| stage(&started(), required, status);
        let earlier = recorder(2, RecorderState::Failed, "of an episode before");
        let ready = recorder(3, RecorderState::Ready, "");
        let failed = recorder(3, RecorderState::Failed, "no disk");
        let none = status(WaitingFor::Unspecified, &[]);
        assert_eq!(stage(0, &none), Stage::Runs);
        assert_eq!(stage(1, &none), Stage::Waits);
        let waits = status(WaitingFor::Recorders, std::slice::from_ref(&earlier));
        assert_eq!(stage(0, &waits), Stage::Waits);
        let both = [earlier.clone(), ready, failed.clone()];
        let runs = status(WaitingFor::Commander, &both);
        assert_eq!(stage(1, &runs), Stage::Runs, "one was asked for");
        let refused = Stage::Refused("recorder r cannot record it: no disk".to_owned());
        assert_eq!(stage(2, &runs), refused);
        let mut over = status(WaitingFor::Recorders, &[earlier, failed]);
        over.episode = None;
        assert_eq!(stage(1, &over), refused);
        over.recorders.clear();
        assert_eq!(stage(1, &over), Stage::Over);
    }
}
