//! `wheelarm lease hold`: control from the command line, for episodes by hand.

use std::io::{BufRead, IsTerminal};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use clap::{Args, Subcommand};
use crossbeam_channel::{Receiver, TryRecvError};
use wheelarm_proto::signals::on_signals;
use wheelarm_proto::v1;
use wheelarm_sdk::{Client, Turn};

/// `wheelarm lease …`.
#[derive(Subcommand, Clone, Debug)]
pub enum LeaseCommand {
    /// Holds control until it is interrupted.
    ///
    /// Every control tick is answered: by nothing new, or by what a line on
    /// standard input says. The chair keeps its speed until the next line; when
    /// standard input ends, chair and arm stop.
    #[command(alias = "take", after_long_help = super::manual::LEASE)]
    Hold(LeaseHoldArgs),
}

/// Options of `wheelarm lease hold`.
#[derive(Args, Clone, Debug)]
pub struct LeaseHoldArgs {
    /// Name of the commander.
    #[arg(long, default_value = "hand", value_parser = wheelarm_options::choice::name)]
    pub name: String,
    /// Takes control over from whoever holds it.
    #[arg(long)]
    pub take: bool,
}

/// How often the server is asked whether control is still ours.
const LOOK: Duration = Duration::from_millis(500);
/// Silence after which the lines and Ctrl-C are looked at.
const PATIENCE: Duration = Duration::from_millis(100);

/// Runs `wheelarm lease …`.
///
/// # Errors
/// When control is refused or lost.
pub fn lease(link: &Client, command: &LeaseCommand) -> anyhow::Result<ExitCode> {
    let LeaseCommand::Hold(args) = command;
    let interrupted = listen()?;
    let mut turns = link.turns(&args.name, args.take, &[])?;
    println!(
        "{} is in control of {}; Ctrl-C gives it back",
        args.name,
        link.keys().sim()
    );
    let lines = lines();
    let robot = link.request(&v1::SceneRequest {})?.robot;
    let mut hand = Hand {
        limits: robot.and_then(|robot| robot.drive),
        ..Hand::default()
    };
    let mut looked = Instant::now();
    while !interrupted.load(Ordering::Acquire) && !hand.quits {
        hand.read(&lines);
        match turns.next(PATIENCE, &mut |_| {})? {
            Turn::Answer(_) => turns.answer(hand.command())?,
            Turn::Refused(refusal) => hand.refused(&refusal),
            Turn::Ended(_) | Turn::Silent(_) => {}
        }
        if looked.elapsed() > LOOK {
            looked = Instant::now();
            let status: v1::Status = link.request(&v1::StatusRequest {})?;
            if status.holder != args.name {
                match status.holder.as_str() {
                    "" => bail!("control ended: the server gave it up"),
                    other => bail!("{other:?} took control"),
                }
            }
        }
    }
    drop(turns);
    println!("{} gave control back", args.name);
    Ok(ExitCode::SUCCESS)
}

/// Becomes true on Ctrl-C, SIGTERM or SIGHUP.
fn listen() -> anyhow::Result<Arc<AtomicBool>> {
    let interrupted = Arc::new(AtomicBool::new(false));
    let told = Arc::clone(&interrupted);
    on_signals(move |_| told.store(true, Ordering::Release))?;
    Ok(interrupted)
}

/// Lines of standard input, as they come.
fn lines() -> Receiver<String> {
    let (sender, lines) = crossbeam_channel::unbounded();
    if std::io::stdin().is_terminal() {
        eprintln!("lines: drive LINEAR TURN | stop | open | close | quit");
    }
    std::thread::spawn(move || {
        // A line that is no text is one that is not understood, not the end.
        for line in std::io::stdin().lock().split(b'\n').map_while(Result::ok) {
            let line = String::from_utf8_lossy(&line).into_owned();
            if sender.send(line).is_err() {
                return;
            }
        }
    });
    lines
}

/// What the lines asked for.
#[derive(Debug, Default, PartialEq)]
struct Hand {
    /// Speed of the chair, m/s and rad/s, while it drives.
    drive: Option<[f64; 2]>,
    /// Goes out with the next command, once.
    next: v1::Command,
    quits: bool,
    /// What the chair can do, where the server tells it.
    limits: Option<v1::DriveDescription>,
    /// Why the newest command was refused, told once.
    told: String,
    /// No line comes any more.
    alone: bool,
}

impl Hand {
    fn read(&mut self, lines: &Receiver<String>) {
        loop {
            match lines.try_recv() {
                Ok(line) => {
                    if let Err(e) = self.take(&line) {
                        eprintln!("{e:#}");
                    }
                }
                Err(TryRecvError::Empty) => return,
                Err(TryRecvError::Disconnected) => {
                    if !self.alone && self.drive.is_some() {
                        eprintln!("standard input has ended: the chair stops");
                        self.stop();
                    }
                    self.alone = true;
                    return;
                }
            }
        }
    }

    /// A line that is wrong in itself is dropped, or it would be refused at every
    /// tick. Where only its moment was wrong (a tick that is over, a rate, a break
    /// before a `reset`), the next tick is answered with it again.
    fn refused(&mut self, refusal: &v1::Refusal) {
        let wrong = [v1::RefusalCode::Invalid, v1::RefusalCode::TooLong];
        let drops = wrong.contains(&refusal.code()) && self.drive.take().is_some();
        if self.told != refusal.reason {
            self.told.clone_from(&refusal.reason);
            let more = if drops { "; the line is dropped" } else { "" };
            eprintln!("refused: {}{more}", refusal.reason);
        }
    }

    fn stop(&mut self) {
        self.drive = None;
        self.next.base = Some(v1::BaseCommand::default());
        self.next.arm = Some(v1::ArmCommand {
            target: Some(v1::arm_command::Target::Hold(true)),
        });
    }

    fn take(&mut self, line: &str) -> anyhow::Result<()> {
        use v1::gripper_command::Target;
        let grip = |target| v1::GripperCommand {
            target: Some(target),
            max_force: None,
        };
        let words: Vec<&str> = line.split_whitespace().collect();
        self.told.clear();
        match words.as_slice() {
            [] => {}
            ["drive", linear, turn] => {
                let number = |text: &str| {
                    let read = text.parse::<f64>();
                    read.with_context(|| format!("{text:?} is not a number"))
                };
                let asked = [number(linear)?, number(turn)?];
                self.check(asked)?;
                self.drive = Some(asked);
            }
            ["stop"] => self.stop(),
            ["open"] => self.next.gripper = Some(grip(Target::Knuckle(0.0))),
            ["close"] => self.next.gripper = Some(grip(Target::Opening(0.0))),
            ["quit"] => self.quits = true,
            _ => bail!("{line:?} is not a command: drive LINEAR TURN, stop, open, close or quit"),
        }
        Ok(())
    }

    /// Refuses speeds beyond what the chair can do.
    fn check(&self, [linear, turn]: [f64; 2]) -> anyhow::Result<()> {
        let limits = self.limits.unwrap_or(v1::DriveDescription {
            forward_speed: f64::MAX,
            backward_speed: f64::MAX,
            turn_rate: f64::MAX,
            ..v1::DriveDescription::default()
        });
        let (forward, backward) = (limits.forward_speed, limits.backward_speed);
        if !(-backward..=forward).contains(&linear) {
            bail!(
                "LINEAR {linear} m/s: the chair drives from {} to {forward} m/s",
                -backward
            );
        }
        let rate = limits.turn_rate;
        if !(-rate..=rate).contains(&turn) {
            bail!("TURN {turn} rad/s: the chair turns at {rate} rad/s at most");
        }
        Ok(())
    }

    /// What the next tick is answered with.
    fn command(&mut self) -> v1::Command {
        let mut command = std::mem::take(&mut self.next);
        if let Some([linear, angular]) = self.drive {
            command.base = Some(v1::BaseCommand { linear, angular });
        }
        command
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_chair_stops_when_no_line_can_come_any_more() {
        let (sender, lines) = crossbeam_channel::unbounded();
        let mut hand = Hand::default();
        sender.send("drive 0.3 0".to_owned()).unwrap();
        sender.send("st\u{fffd}p".to_owned()).unwrap();
        hand.read(&lines);
        assert_eq!(hand.command().base.unwrap().linear, 0.3);
        drop(sender);
        hand.read(&lines);
        let command = hand.command();
        assert_eq!(command.base, Some(v1::BaseCommand::default()));
        assert!(command.arm.is_some());
        hand.read(&lines);
        assert_eq!(hand.command(), v1::Command::default());
    }

    #[test]
    fn a_line_beyond_the_limits_or_refused_is_dropped() {
        let mut hand = Hand {
            limits: Some(v1::DriveDescription {
                forward_speed: 0.5,
                backward_speed: 0.3,
                turn_rate: 1.0,
                ..v1::DriveDescription::default()
            }),
            ..Hand::default()
        };
        for wrong in ["drive 5 0", "drive -0.4 0", "drive 0 -1.1", "drive NaN 0"] {
            let told = hand.take(wrong).unwrap_err().to_string();
            assert!(told.contains("the chair"), "{told}");
        }
        hand.take("drive 0.5 1").unwrap();
        assert!(hand.command().base.is_some());
        let refusal = |code: v1::RefusalCode| v1::Refusal {
            code: code.into(),
            ..v1::Refusal::default()
        };
        for passing in [v1::RefusalCode::Answered, v1::RefusalCode::TooOld] {
            hand.refused(&refusal(passing));
            assert!(hand.command().base.is_some());
        }
        hand.refused(&refusal(v1::RefusalCode::Invalid));
        assert_eq!(hand.command(), v1::Command::default());
    }

    #[test]
    fn lines_become_commands_and_a_speed_lasts_until_the_next_line() {
        let mut hand = Hand::default();
        assert_eq!(hand.command(), v1::Command::default());
        hand.take("drive 0.3 -0.1").unwrap();
        for _ in 0..2 {
            let base = hand.command().base.unwrap();
            assert_eq!((base.linear, base.angular), (0.3, -0.1));
        }
        hand.take(" close ").unwrap();
        assert!(hand.command().gripper.is_some() && hand.command().gripper.is_none());
        hand.take("stop").unwrap();
        let stopped = hand.command();
        assert!(wheelarm_proto::check::stops(&stopped), "{stopped:?}");
        assert_eq!(hand.command().base, None);
        for wrong in ["drive", "drive fast 0", "fly", "stop now"] {
            assert!(hand.take(wrong).is_err(), "{wrong:?} was taken");
        }
        assert!(!hand.quits);
        hand.take("quit").unwrap();
        assert!(hand.quits);
    }
}
