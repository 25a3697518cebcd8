//! A remote operator, recorder and viewer on links that are slow, freeze and break.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use wheelarm_dataset::read::Episode;
use wheelarm_proto::preview::PreviewLevel;
use wheelarm_proto::topic::Sample;
use wheelarm_proto::{TopicId, v1};
use wheelarm_sdk::{Client, Commander, Streams};
use wheelarm_teleop_web::ladder::Ladder;
use wheelarm_tests::{IdleCommander, Line, PATIENCE, Proxy, Recorder, Server, wait_until};
use zenoh::sample::SampleKind;

/// A remote link: 150 ms each way, 5 Mbit/s.
const DELAY: Duration = Duration::from_millis(150);
const BITS_PER_SECOND: f64 = 5e6;
/// Ticks between images at 10 Hz.
const TICKS_PER_IMAGE: u64 = 24;
/// Longest time between the last command and rest, s: 0.7 s, and some control ticks between
/// stamps. Simulation time passes no faster than wall time, so this holds on any machine.
const REST_SECS: f64 = 0.8;

/// State of the robot as a client beside the server observes it.
struct Observer {
    streams: Streams,
    /// Stamp of the newest accepted command, s.
    last_command: f64,
    now: f64,
    speed: f64,
    /// Greatest speed of an arm joint, rad/s.
    arm: f64,
}

impl Observer {
    fn new(client: &Client) -> Self {
        let wanted = [TopicId::Odometry, TopicId::JointState, TopicId::Applied];
        Self {
            streams: client.streams(&wanted).expect("the streams"),
            last_command: 0.0,
            now: 0.0,
            speed: 0.0,
            arm: 0.0,
        }
    }

    /// Receives the next sample of any stream.
    fn receive_next(&mut self) {
        let seconds =
            |h: &Option<v1::Header>| h.as_ref().map_or(0.0, |h| h.stamp_nanos as f64 * 1e-9);
        match self
            .streams
            .next(PATIENCE)
            .expect("no error")
            .expect("a sample")
        {
            Sample::Odometry(sample) => {
                self.now = seconds(&sample.header);
                let twist = sample.twist.unwrap_or_default();
                self.speed = twist.linear.unwrap_or_default().x;
            }
            Sample::JointState(sample) => {
                let arm = sample.velocities[4..10].iter();
                self.arm = arm.fold(0.0, |most, v| v.abs().max(most));
            }
            Sample::Applied(sample) if sample.base.is_some() && !sample.stale => {
                self.last_command = seconds(&sample.header);
            }
            _ => {}
        }
    }

    fn until(&mut self, what: &str, mut done: impl FnMut(&mut Self) -> bool) {
        wait_until(what, || {
            (0..20).any(|_| {
                self.receive_next();
                done(self)
            })
        });
    }
}

/// Drives at 20 Hz by the clock that the remote operator receives, for `seconds` of wall time.
fn drive(commander: &mut Commander, clock: &Streams, seconds: f64) {
    let mut sent = 0.0;
    let begun = std::time::Instant::now();
    while begun.elapsed().as_secs_f64() < seconds {
        let Ok(Some(Sample::Clock(clock))) = clock.next(Duration::from_millis(50)) else {
            continue;
        };
        let now = begun.elapsed().as_secs_f64();
        if now - sent < 0.05 {
            continue;
        }
        sent = now;
        let command = v1::Command {
            base: Some(v1::BaseCommand {
                linear: 0.3,
                angular: 0.0,
            }),
            ..Default::default()
        };
        let _ = commander.answer(&clock.header.unwrap_or_default(), command);
    }
}

#[test]
fn broken_link_of_a_remote_operator_stops_the_chair() {
    let args = ["--camera", "gen3=320x180@10", "--quality", "fast"];
    let server = Server::start("far", &args).expect("a server");
    let near = server.client();
    let commands = near
        .session()
        .declare_subscriber(near.keys().topic(TopicId::Command))
        .with(zenoh::handlers::FifoChannel::new(4096));
    let commands = zenoh::Wait::wait(commands).expect("the commands");
    let mut observer = Observer::new(&near);
    let proxy = Proxy::start(&server.endpoint, DELAY, BITS_PER_SECOND).expect("a proxy");
    let far = Client::open(&server.connect_through(&proxy.endpoint())).expect("a remote client");
    let clock = far.streams(&[TopicId::Clock]).expect("the clock");
    let mut commander = far.commander("far", false).expect("control");
    let preview = far.preview("gen3", PreviewLevel::Low).expect("a preview");

    drive(&mut commander, &clock, 2.0);
    observer.until("the chair drives", |o| o.speed > 0.15);
    assert!(preview.next(PATIENCE).expect("no error").is_some());

    // Frozen: the server receives no close; the age of the last command stops the chair.
    proxy.set(Line::Frozen);
    drive(&mut commander, &clock, 0.3);
    observer.until("the chair rests", |o| o.speed.abs() < 0.005);
    let seconds = observer.now - observer.last_command;
    assert!(
        seconds < REST_SECS,
        "at rest {seconds:.2} s after the last command"
    );
    assert!(observer.arm < 0.05, "the arm moves: {} rad/s", observer.arm);
    std::thread::sleep(Duration::from_millis(1500));
    let before = observer.now;
    proxy.set(Line::Open);
    // The delayed commands are too old and are rejected.
    observer.until("the delayed commands have arrived", |o| {
        o.now > before + 2.5
    });
    assert!(
        observer.last_command < before,
        "an old command was accepted"
    );
    drive(&mut commander, &clock, 2.5);
    observer.until("the chair drives again", |o| o.speed > 0.15);

    // Cut: control ends with the connection.
    drive(&mut commander, &clock, 0.3);
    proxy.set(Line::Cut);
    observer.until("the chair rests", |o| o.speed.abs() < 0.005);
    let seconds = observer.now - observer.last_command;
    assert!(
        seconds < REST_SECS,
        "at rest {seconds:.2} s after the last command"
    );
    let status = || near.request(&v1::StatusRequest {}).expect("a status");
    wait_until("control is free", || status().holder.is_empty());
    let held = observer.now;
    observer.until("a second passes", |o| o.now > held + 1.0);
    assert!(observer.arm < 0.05, "the arm moves: {} rad/s", observer.arm);

    // The client reconnects by itself, takes control again and drives.
    proxy.set(Line::Open);
    wait_until("control is back", || commander.acquire(false).is_ok());
    drive(&mut commander, &clock, 2.0);
    observer.until("the chair drives again", |o| o.speed > 0.15);
    assert!(preview.next(PATIENCE).expect("no error").is_some());

    let numbers: Vec<u64> = std::iter::from_fn(|| commands.try_recv().ok().flatten())
        .filter_map(|sample| {
            use wheelarm_proto::Message;
            let log = v1::CommandLog::decode(&*sample.payload().to_bytes()).ok()?;
            Some(log.command?.header?.sequence)
        })
        .collect();
    assert!(
        numbers.len() > 20,
        "{} commands were accepted",
        numbers.len()
    );
    assert!(numbers.is_sorted_by(|a, b| a < b), "{numbers:?}");
}

#[test]
fn recording_continues_after_cuts_and_states_the_missing_samples() {
    let server = Server::start("cuts", &["--no-cameras"]).expect("a server");
    let near = server.client();
    let status = || near.request(&v1::StatusRequest {}).expect("a status");
    let proxy = Proxy::start(&server.endpoint, Duration::ZERO, 1e9).expect("a proxy");
    let folder = tempfile::tempdir().expect("a folder");
    let through = proxy.endpoint();
    let mut recorder =
        Recorder::start_through(&through, &server, folder.path(), &["--episodes", "1"]);
    wait_until("the recorder is connected", || {
        !status().recorders.is_empty()
    });
    let request = v1::EpisodeStartRequest {
        label: "cuts".into(),
        require_recorders: 1,
        ..Default::default()
    };
    let _: v1::EpisodeStarted = near.request(&request).expect("a start");
    wait_until("the episode runs", || status().waiting_for.is_empty());
    // Short cuts, which the server's cache repairs, and one that is longer than the cache.
    for (open, cut) in [(1.0, 0.5), (1.0, 0.5), (1.0, 7.0), (1.5, 0.0)] {
        std::thread::sleep(Duration::from_secs_f64(open));
        if cut > 0.0 {
            proxy.set(Line::Cut);
            std::thread::sleep(Duration::from_secs_f64(cut));
            proxy.set(Line::Open);
        }
    }
    wait_until("the recorder is back", || !status().recorders.is_empty());
    let request = v1::EpisodeStopRequest::default();
    let stopped: v1::EpisodeStopped = near.request(&request).expect("an end");
    let (ended, text) = recorder.end();
    println!("{text}");
    assert_eq!(ended.code(), Some(3), "{text}");
    let episode = Episode::open(&folder.path().join("cuts.h5")).expect("a file");
    let summary = episode.summary().expect("a summary");
    let imu = |count: &&v1::StreamCount| count.stream == "imu";
    let expected = stopped.manifest.iter().find(imu).expect("its count");
    let sequence = episode.u64s("imu", "sequence").expect("numbers");
    assert_eq!(
        sequence.last(),
        Some(&expected.last),
        "the last sample is missing"
    );
    let account = summary.streams.iter().find(|s| s.stream == "imu");
    let lost = expected.count - sequence.len() as u64;
    let words = format!("imu: {lost} of {} samples are missing", expected.count);
    assert!(
        lost > 0 && text.contains(&words),
        "{words} is not in {text}"
    );
    assert!(
        format!("{account:?}").contains(&lost.to_string()),
        "{account:?}"
    );
}

#[test]
fn recorder_on_a_slow_link_receives_every_image_in_lock_step() {
    let cameras = ["gen3=640x360@10", "wheelchair=640x360@10"];
    let cameras = ["--camera", cameras[0], "--camera", cameras[1]];
    let rest = ["--quality", "fast", "--pacing", "lock-step"];
    let server = Server::start("crawl", &[&cameras[..], &rest].concat()).expect("a server");
    let near = server.client();
    let status = || near.request(&v1::StatusRequest {}).expect("a status");
    let tick = || status().header.unwrap_or_default().tick;
    // An image takes a second, uncompressed 4 s: longer than the transport waits for space
    // where it may not wait forever.
    let proxy = Proxy::start(&server.endpoint, Duration::ZERO, 4e6).expect("a proxy");
    let folder = tempfile::tempdir().expect("a folder");
    let through = proxy.endpoint();
    let mut recorder =
        Recorder::start_through(&through, &server, folder.path(), &["--episodes", "1"]);
    wait_until("the recorder is connected", || {
        !status().recorders.is_empty()
    });
    let losses = Arc::new(AtomicU64::new(0));
    let count = Arc::clone(&losses);
    let alive = near
        .session()
        .liveliness()
        .declare_subscriber(near.keys().recorder_alive("*"))
        .callback(move |token| {
            let is_lost = token.kind() == SampleKind::Delete;
            count.fetch_add(u64::from(is_lost), Ordering::Relaxed);
        });
    let _alive = zenoh::Wait::wait(alive).expect("the recorders' tokens");
    let idle = IdleCommander::start(&server.client());
    let request = v1::EpisodeStartRequest {
        label: "crawl".into(),
        commander: IdleCommander::NAME.into(),
        require_recorders: 1,
        ..Default::default()
    };
    let _: v1::EpisodeStarted = near.request(&request).expect("a start");
    let begun = tick();
    wait_until("images arrive", || tick() >= begun + 4 * TICKS_PER_IMAGE);
    // Samples in transit are lost, and the simulation waits for the recorder.
    proxy.set(Line::Cut);
    std::thread::sleep(Duration::from_millis(500));
    proxy.set(Line::Open);
    let cut = tick();
    wait_until("images arrive again", || {
        tick() >= cut + 3 * TICKS_PER_IMAGE
    });
    // Only the cut ended a connection; retransmissions do not.
    assert_eq!(losses.load(Ordering::Relaxed), 1);
    let request = v1::EpisodeStopRequest::default();
    let stopped: v1::EpisodeStopped = near.request(&request).expect("an end");
    drop(idle);
    let images = stopped.manifest.iter().find(|c| c.stream == "camera/gen3");
    let images = images.expect("its count").count;
    assert!(images >= 7, "{images} images");
    let (ended, text) = recorder.end();
    let whole = text.contains("crawl.h5: complete") && text.contains(" 0 missed");
    assert!(whole && ended.success(), "{text}");
}

#[test]
fn viewer_on_a_narrow_link_gets_low_previews_and_delays_no_other_client() {
    let args = ["--camera", "gen3=640x360@10", "--quality", "fast"];
    let server = Server::start("narrow", &args).expect("a server");
    let near = server.client();
    let tick = || {
        let status: v1::Status = near.request(&v1::StatusRequest {}).expect("a status");
        status.header.unwrap_or_default().tick
    };
    // Below what the medium level of this camera needs, about 2 Mbit/s.
    let proxy = Proxy::start(&server.endpoint, DELAY, 6e5).expect("a proxy");
    let far = Client::open(&server.connect_through(&proxy.endpoint())).expect("a remote client");
    let begun = std::time::Instant::now();
    let now = || begun.elapsed().as_secs_f64();
    let mut ladder = Ladder::new(now());
    assert_eq!(ladder.level(), PreviewLevel::Medium);
    let before = tick();
    let mut preview = far.preview("gen3", ladder.level()).expect("a subscription");
    let (mut received, mut low) = (0, 0);
    while low < 5 {
        assert!(
            begun.elapsed() < PATIENCE,
            "{received} images, {low} of them low"
        );
        let frame = preview.next(Duration::from_millis(200)).expect("no error");
        if let Some(frame) = frame {
            let arrived = SystemTime::now()
                .duration_since(UNIX_EPOCH)
                .expect("a clock");
            let latency = arrived.as_secs_f64() - frame.sent_unix_nanos as f64 * 1e-9;
            low += i32::from(frame.level() == PreviewLevel::Low.code());
            ladder.arrived(frame.header.unwrap_or_default().sequence, latency, now());
            received += 1;
        }
        if let Some(level) = ladder.decide(now()) {
            assert!(
                level < PreviewLevel::High,
                "the link does not carry {level:?}"
            );
            preview = far.preview("gen3", level).expect("a subscription");
            ladder.restart();
        }
    }
    // The simulation continued.
    let wall = begun.elapsed().as_secs_f64();
    assert!(
        tick() > before + 60,
        "{} ticks in {wall:.1} s",
        tick() - before
    );
}
