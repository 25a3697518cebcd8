//! The event loop of teleoperation: feeds the model, executes its effects, renders.

use std::time::{Duration, Instant};
use wheelarm_proto::TopicId;

use anyhow::Context;
use crossbeam_channel::{Receiver, Sender, unbounded};

use crate::args::TeleopArgs;
use crate::keys::Key;
use crate::model::{Effect, Model, Operation, Settings};
use crate::terminal::{Screen, Typed, read_keys};
use crate::view::{self, Theme};
use wheelarm_proto::signals::Signals;
use wheelarm_sdk::{Client, Commander, Connect};
use wheelarm_teleop_web::pending_operation::{self, OperationEvent};
use wheelarm_teleop_web::preview::{self, PreviewArgs};
use wheelarm_teleop_web::send::Commands;
use wheelarm_teleop_web::watch::{ConnectionEvent, ServerConnection};

/// Streams that the screen shows.
const STREAMS: [TopicId; 11] = [
    TopicId::Pose,
    TopicId::JointState,
    TopicId::Odometry,
    TopicId::Evaluation,
    TopicId::Applied,
    TopicId::Contact,
    TopicId::Event,
    TopicId::Clock,
    TopicId::Phase,
    TopicId::Refusal,
    TopicId::EpisodeStop,
];
/// Time between two frames of the screen.
const FRAME: f64 = 1.0 / 12.0;
/// Time from the last command until the connection is closed.
const FAREWELL: Duration = Duration::from_millis(150);

enum Event {
    Connection(ConnectionEvent),
    Typed(Typed),
    Signal(&'static str),
    Operation(OperationEvent),
    Echo(f64),
}

/// How teleoperation ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// The person left.
    Left,
    /// By a signal or a lost terminal; the robot was stopped.
    Cut(&'static str),
}

struct Teleoperation {
    model: Model,
    events: Sender<Event>,
    client: Option<Client>,
    commands: Option<Commands>,
    began: Instant,
    ended: Option<Ended>,
    redraw: bool,
}

/// Operates until the person leaves, the terminal is lost or a signal arrives.
///
/// # Errors
/// When standard input is not a terminal, or the page's address cannot be bound.
pub fn run(connect: &Connect, args: &TeleopArgs) -> anyhow::Result<Ended> {
    let (events, receiver) = unbounded();
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .context("starting the runtime")?;
    let page = if args.no_page {
        None
    } else {
        let page = PreviewArgs {
            page: args.page,
            keys: None,
            host: Vec::new(),
        };
        Some(preview::open(&runtime, connect, &page)?)
    };
    watch_signals(&runtime, events.clone());
    let mut screen = Screen::open()?;
    read_keys(events.clone(), Event::Typed);
    let mut streams = STREAMS.to_vec();
    if args.target_hint {
        streams.push(TopicId::ObjectPose);
    }
    let mut teleoperation = Teleoperation {
        model: Model::new(settings(args)),
        events: events.clone(),
        client: None,
        commands: None,
        began: Instant::now(),
        ended: None,
        redraw: false,
    };
    if let Some(page) = &page {
        teleoperation.model.page = page.watch_url();
    }
    let connection = ServerConnection::open(connect.clone(), streams, events, Event::Connection);
    let theme = Theme {
        colours: std::env::var_os("NO_COLOR").is_none_or(|v| v.is_empty()),
    };
    let ended = teleoperation.work(&receiver, &mut screen, theme);
    // The robot stops before the screen is restored.
    teleoperation.farewell();
    drop(screen);
    drop(connection);
    drop(page);
    runtime.shutdown_timeout(Duration::from_millis(200));
    Ok(ended)
}

fn settings(args: &TeleopArgs) -> Settings {
    Settings {
        commander: args.commander.clone(),
        take: args.take,
        label: args.label.clone().unwrap_or_default(),
        instruction: args.instruction.clone().unwrap_or_default(),
        recorders: args.require_recorders,
        shell: args.reach_shell,
        dead_man: args.dead_man,
        target_hint: args.target_hint,
    }
}

fn watch_signals(runtime: &tokio::runtime::Runtime, events: Sender<Event>) {
    let listening = {
        let _inside = runtime.enter();
        Signals::listen_here().and_then(Signals::and_quit)
    };
    match listening {
        Ok(mut signals) => {
            runtime.spawn(async move {
                // A closed queue means that the program ends anyway.
                while events
                    .send(Event::Signal(signals.next().await.name()))
                    .is_ok()
                {}
            });
        }
        Err(error) => tracing::warn!("cannot listen to signals: {error}"),
    }
}

impl Teleoperation {
    fn now(&self) -> f64 {
        self.began.elapsed().as_secs_f64()
    }

    /// The loop: ends when the person leaves or the terminal is lost.
    fn work(&mut self, receiver: &Receiver<Event>, screen: &mut Screen, theme: Theme) -> Ended {
        let mut next_frame = 0.0_f64;
        loop {
            let now = self.now();
            let due = self.model.next_tick(now).min(next_frame.max(now));
            let wait = Duration::from_secs_f64((due - now).max(0.0));
            if let Ok(event) = receiver.recv_timeout(wait) {
                self.take(event);
                // Events that arrived meanwhile belong to the same frame.
                for event in receiver.try_iter().take(500) {
                    self.take(event);
                }
            }
            let now = self.now();
            let effects = self.model.tick(now);
            self.perform(effects);
            if let Some(ended) = self.ended {
                return ended;
            }
            if now >= next_frame {
                next_frame = now + FRAME;
                let model = &self.model;
                let cleared = if std::mem::take(&mut self.redraw) {
                    screen.clear()
                } else {
                    Ok(())
                };
                let drawn =
                    cleared.and_then(|()| screen.draw(|f| view::draw(f, model, theme, now)));
                if drawn.is_err() {
                    return Ended::Cut("the terminal is gone");
                }
            }
        }
    }

    fn take(&mut self, event: Event) {
        let now = self.now();
        match event {
            Event::Typed(Typed::Keys(keys)) => {
                for key in keys {
                    self.redraw |= key == Key::Ctrl('l');
                    let effects = self.model.key(&key, now);
                    self.perform(effects);
                }
            }
            Event::Typed(Typed::Gone) => self.ended = Some(Ended::Cut("the terminal is gone")),
            Event::Signal(name) => self.ended = Some(Ended::Cut(name)),
            Event::Connection(event) => {
                let effects = self.handle_connection(event, now);
                self.perform(effects);
            }
            Event::Operation(OperationEvent::Control(commander)) => self.take_control(*commander),
            Event::Operation(OperationEvent::Done(done)) => {
                let effects = self.model.done(done, now);
                self.perform(effects);
            }
            Event::Echo(delay) => self.model.echo(delay, now),
        }
    }

    fn handle_connection(&mut self, event: ConnectionEvent, now: f64) -> Vec<Effect> {
        match event {
            ConnectionEvent::Connected(client) => {
                self.client = Some(*client);
                self.model.connected(now)
            }
            ConnectionEvent::Sample(sample) => self.model.sample(*sample, now),
            ConnectionEvent::Robot(robot) => self.model.robot(&robot),
            ConnectionEvent::Status(status, round_trip) => {
                self.model.status(*status, round_trip, now)
            }
            ConnectionEvent::Silent => {
                self.model.silent(now);
                Vec::new()
            }
            ConnectionEvent::Lost(reason) => {
                self.model.lost(&reason, now);
                self.client = None;
                if let Some(commands) = self.commands.take() {
                    // Its thread may hang in the dead connection.
                    std::thread::spawn(move || commands.finish());
                }
                Vec::new()
            }
        }
    }

    fn take_control(&mut self, commander: Commander) {
        let Some(client) = &self.client else { return };
        let events = self.events.clone();
        let name = self.model.settings.commander.clone();
        let echoed = move |delay| {
            // A closed queue means that the program ends.
            let _ = events.send(Event::Echo(delay));
        };
        self.commands = Some(Commands::new(client, commander, name, echoed));
    }

    fn perform(&mut self, effects: Vec<Effect>) {
        for effect in effects {
            match effect {
                Effect::Send(header, command) => {
                    if let Some(commands) = &self.commands
                        && !commands.send(*header, *command)
                    {
                        let now = self.now();
                        self.model.silent(now);
                    }
                }
                Effect::Operation(operation) => {
                    if let Some(client) = &self.client {
                        let events = self.events.clone();
                        let name = self.model.settings.commander.clone();
                        // Two command channels of one client would block each other.
                        let leases = matches!(operation, Operation::Lease { .. });
                        let former = if leases { self.commands.take() } else { None };
                        pending_operation::run(
                            client.clone(),
                            name,
                            operation,
                            former,
                            move |event| {
                                // A closed queue means that the program ends.
                                let _ = events.send(Event::Operation(event));
                            },
                        );
                    }
                }
                Effect::Quit => self.ended = Some(Ended::Left),
            }
        }
    }

    /// Brakes the chair, holds the arm and releases control.
    fn farewell(&mut self) {
        let effects = {
            let now = self.now();
            self.model.stop_everything(now)
        };
        self.ended = None;
        self.perform(effects);
        if let Some(commands) = self.commands.take() {
            // The stop must leave before control is released.
            std::thread::sleep(FAREWELL);
            commands.finish();
        }
    }
}
