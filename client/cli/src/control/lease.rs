//! `wheelarm lease hold`: holds control and sends commands read from standard input.

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
    /// Replies to every control tick, with an empty command or with the command of a line
    /// on standard input. The chair keeps its speed until the next line. Chair and arm stop
    /// when standard input ends.
    #[command(alias = "take", after_long_help = super::manual::LEASE)]
    Hold(LeaseHoldArgs),
}

/// Options of `wheelarm lease hold`.
#[derive(Args, Clone, Debug)]
pub struct LeaseHoldArgs {
    /// Name of the commander.
    #[arg(long, alias = "name", default_value = "hand", value_parser = wheelarm_options::choice::name, value_name = "NAME")]
    pub commander: String,
    /// Takes control over from the commander that holds it.
    #[arg(long, alias = "force")]
    pub take: bool,
}

/// Interval between checks that this program still holds control.
const CHECK_INTERVAL: Duration = Duration::from_millis(500);
/// Wait for a tick, after which input lines and Ctrl-C are checked.
const PATIENCE: Duration = Duration::from_millis(100);

/// Runs `wheelarm lease …`.
///
/// # Errors
/// When control is denied or lost.
pub fn lease(client: &Client, command: &LeaseCommand) -> anyhow::Result<ExitCode> {
    let LeaseCommand::Hold(args) = command;
    let interrupted = listen()?;
    let mut turns = client.turns(&args.commander, args.take, &[])?;
    println!(
        "{} is in control of {}; Ctrl-C releases it",
        args.commander,
        client.keys().sim()
    );
    let lines = lines();
    let robot = client.request(&v1::SceneRequest {})?.robot;
    let mut console = Console {
        limits: robot.and_then(|robot| robot.drive),
        ..Console::default()
    };
    let mut checked = Instant::now();
    while !interrupted.load(Ordering::Acquire) && !console.quits {
        console.read(&lines);
        match turns.next(PATIENCE, &mut |_| {})? {
            Turn::Answer(_) => turns.answer(console.next_command())?,
            Turn::Refused(refusal) => console.refused(&refusal),
            Turn::Ended(_) | Turn::Silent(_) => {}
        }
        if checked.elapsed() > CHECK_INTERVAL {
            checked = Instant::now();
            let status: v1::Status = client.request(&v1::StatusRequest {})?;
            if status.holder != args.commander {
                match status.holder.as_str() {
                    "" => bail!("control ended: the server released it"),
                    other => bail!("{other:?} took control"),
                }
            }
        }
    }
    drop(turns);
    println!("{} released control", args.commander);
    Ok(ExitCode::SUCCESS)
}

/// Becomes true on Ctrl-C, SIGTERM or SIGHUP.
fn listen() -> anyhow::Result<Arc<AtomicBool>> {
    let interrupted = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&interrupted);
    on_signals(move |_| flag.store(true, Ordering::Release))?;
    Ok(interrupted)
}

/// Lines of standard input, as they come.
fn lines() -> Receiver<String> {
    let (sender, lines) = crossbeam_channel::unbounded();
    if std::io::stdin().is_terminal() {
        eprintln!("lines: drive LINEAR TURN | stop | open | close | quit");
    }
    std::thread::spawn(move || {
        // Invalid UTF-8 makes one line unknown and does not end the input.
        for line in std::io::stdin().lock().split(b'\n').map_while(Result::ok) {
            let line = String::from_utf8_lossy(&line).into_owned();
            if sender.send(line).is_err() {
                return;
            }
        }
    });
    lines
}

/// State of the commands that the input lines requested.
#[derive(Debug, Default, PartialEq)]
struct Console {
    /// Speed of the chair, m/s and rad/s, while it drives.
    drive: Option<[f64; 2]>,
    /// Sent once, with the next reply to a tick.
    next: v1::Command,
    quits: bool,
    /// Limits of the chair, if the server sends them.
    limits: Option<v1::DriveDescription>,
    /// Last printed reason of a refusal; each reason is printed once.
    last_reason: String,
    /// Standard input has ended.
    input_ended: bool,
}

impl Console {
    fn read(&mut self, lines: &Receiver<String>) {
        loop {
            match lines.try_recv() {
                Ok(line) => {
                    if let Err(e) = self.parse(&line) {
                        eprintln!("{e:#}");
                    }
                }
                Err(TryRecvError::Empty) => return,
                Err(TryRecvError::Disconnected) => {
                    if !self.input_ended && self.drive.is_some() {
                        eprintln!("standard input has ended: the chair stops");
                        self.stop();
                    }
                    self.input_ended = true;
                    return;
                }
            }
        }
    }

    /// Drops a speed that is itself invalid, because it would be refused at every tick.
    /// After a refusal of timing (a late tick, a rate, a pause before a `reset`) the next
    /// tick repeats it.
    fn refused(&mut self, refusal: &v1::Refusal) {
        let wrong = [v1::RefusalCode::Invalid, v1::RefusalCode::TooLong];
        let drops = wrong.contains(&refusal.code()) && self.drive.take().is_some();
        if self.last_reason != refusal.reason {
            self.last_reason.clone_from(&refusal.reason);
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

    fn parse(&mut self, line: &str) -> anyhow::Result<()> {
        use v1::gripper_command::Target;
        let grip = |target| v1::GripperCommand {
            target: Some(target),
            max_force: None,
        };
        let words: Vec<&str> = line.split_whitespace().collect();
        self.last_reason.clear();
        match words.as_slice() {
            [] => {}
            ["drive", linear, turn] => {
                let number = |text: &str| {
                    let read = text.parse::<f64>();
                    read.with_context(|| format!("{text:?} is not a number"))
                };
                let speeds = [number(linear)?, number(turn)?];
                self.check(speeds)?;
                self.drive = Some(speeds);
            }
            ["stop"] => self.stop(),
            ["open"] => self.next.gripper = Some(grip(Target::Knuckle(0.0))),
            ["close"] => self.next.gripper = Some(grip(Target::Opening(0.0))),
            ["quit"] => self.quits = true,
            _ => bail!("{line:?} is not a command: drive LINEAR TURN, stop, open, close or quit"),
        }
        Ok(())
    }

    /// Rejects speeds beyond the limits of the chair.
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

    /// Reply to the next tick.
    fn next_command(&mut self) -> v1::Command {
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
    fn chair_stops_when_standard_input_ends() {
        let (sender, lines) = crossbeam_channel::unbounded();
        let mut console = Console::default();
        sender.send("drive 0.3 0".to_owned()).unwrap();
        sender.send("st\u{fffd}p".to_owned()).unwrap();
        console.read(&lines);
        assert_eq!(console.next_command().base.unwrap().linear, 0.3);
        drop(sender);
        console.read(&lines);
        let command = console.next_command();
        assert_eq!(command.base, Some(v1::BaseCommand::default()));
        assert!(command.arm.is_some());
        console.read(&lines);
        assert_eq!(console.next_command(), v1::Command::default());
    }

    #[test]
    fn speed_beyond_the_limits_or_refused_is_dropped() {
        let mut console = Console {
            limits: Some(v1::DriveDescription {
                forward_speed: 0.5,
                backward_speed: 0.3,
                turn_rate: 1.0,
                ..v1::DriveDescription::default()
            }),
            ..Console::default()
        };
        for wrong in ["drive 5 0", "drive -0.4 0", "drive 0 -1.1", "drive NaN 0"] {
            let error = console.parse(wrong).unwrap_err().to_string();
            assert!(error.contains("the chair"), "{error}");
        }
        console.parse("drive 0.5 1").unwrap();
        assert!(console.next_command().base.is_some());
        let refusal = |code: v1::RefusalCode| v1::Refusal {
            code: code.into(),
            ..v1::Refusal::default()
        };
        for passing in [v1::RefusalCode::Answered, v1::RefusalCode::TooOld] {
            console.refused(&refusal(passing));
            assert!(console.next_command().base.is_some());
        }
        console.refused(&refusal(v1::RefusalCode::Invalid));
        assert_eq!(console.next_command(), v1::Command::default());
    }

    #[test]
    fn speed_lasts_until_the_next_line() {
        let mut console = Console::default();
        assert_eq!(console.next_command(), v1::Command::default());
        console.parse("drive 0.3 -0.1").unwrap();
        for _ in 0..2 {
            let base = console.next_command().base.unwrap();
            assert_eq!((base.linear, base.angular), (0.3, -0.1));
        }
        console.parse(" close ").unwrap();
        assert!(
            console.next_command().gripper.is_some() && console.next_command().gripper.is_none()
        );
        console.parse("stop").unwrap();
        let stopped = console.next_command();
        assert!(wheelarm_proto::check::stops(&stopped), "{stopped:?}");
        assert_eq!(console.next_command().base, None);
        for wrong in ["drive", "drive fast 0", "fly", "stop now"] {
            assert!(console.parse(wrong).is_err(), "{wrong:?} was accepted");
        }
        assert!(!console.quits);
        console.parse("quit").unwrap();
        assert!(console.quits);
    }
}
