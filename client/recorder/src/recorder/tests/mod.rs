//! A recorder fed by hand: every way in which an episode can go.

use std::path::Path;

use super::super::episode::Report;
use super::*;
use wheelarm_dataset::read::Episode;
use wheelarm_proto::{Message, stamp_nanos};

mod compressed;
mod credit;
mod opening;

fn header(episode: u64, sequence: u64, tick: u64) -> v1::Header {
    v1::Header {
        run_id: "run".into(),
        episode,
        sequence,
        stamp_nanos: stamp_nanos(tick),
        tick,
    }
}

fn started(episode: u64, label: &str) -> v1::EpisodeStarted {
    v1::EpisodeStarted {
        header: Some(header(episode, 0, 0)),
        label: label.into(),
        streams: vec!["imu".into(), "state_hash".into(), "clock".into()],
        cameras: vec!["gen3".into()],
        ..Default::default()
    }
}

fn state(running: Option<v1::EpisodeStarted>, ended: Vec<v1::EpisodeStopped>) -> Input {
    Input::State(Ok(v1::EpisodeState {
        header: Some(header(0, 0, 0)),
        running,
        ended,
    }))
}

/// The server reports a running episode.
fn runs(started: v1::EpisodeStarted) -> Input {
    let run = started.header.clone().unwrap_or_default().run_id;
    let mut reply = state(Some(started), Vec::new());
    if let Input::State(Ok(reply)) = &mut reply {
        reply.header.get_or_insert_default().run_id = run;
    }
    reply
}

/// The server reports an ended episode.
fn ended(stopped: v1::EpisodeStopped) -> Input {
    state(None, vec![stopped])
}

fn snapshot(episode: u64) -> Input {
    Input::Snapshot(Ok(v1::SnapshotReply {
        header: Some(header(episode, 0, 0)),
        snapshot: Bytes::from_static(b"state"),
        ..Default::default()
    }))
}

fn hash(episode: u64, sequence: u64) -> Input {
    let message = v1::StateHash {
        header: Some(header(episode, sequence, sequence)),
        hash: sequence * 7,
    };
    Input::Sample {
        stream: "state_hash".into(),
        payload: message.encode_to_vec().into(),
    }
}

fn image(episode: u64, sequence: u64) -> Input {
    let message = v1::CameraFrame {
        header: Some(header(episode, sequence, 24 * sequence)),
        camera: "gen3".into(),
        intrinsics: Some(v1::Intrinsics {
            width: 4,
            height: 2,
            ..Default::default()
        }),
        color: vec![9; 24].into(),
        depth: vec![0; 32].into(),
        segmentation: vec![1; 8].into(),
        ..Default::default()
    };
    Input::Sample {
        stream: "camera/gen3".into(),
        payload: message.encode_to_vec().into(),
    }
}

fn stopped(episode: u64, hashes: u64, images: u64) -> v1::EpisodeStopped {
    let count = |stream: &str, count: u64| v1::StreamCount {
        stream: stream.into(),
        first: 0,
        last: count.saturating_sub(1),
        count,
        ..Default::default()
    };
    v1::EpisodeStopped {
        header: Some(header(episode, 0, 480)),
        manifest: vec![
            count("state_hash", hashes),
            count("camera/gen3", images),
            count("imu", 0),
        ],
        ..Default::default()
    }
}

/// A recorder in a folder of its own, with a clock that the test moves.
struct Bench {
    recorder: Recorder,
    dir: tempfile::TempDir,
    now: Instant,
    /// Unanswered requests.
    requests: Vec<Missing>,
}

impl Bench {
    fn new() -> Self {
        let dir = tempfile::tempdir().unwrap();
        let options = WriterOptions {
            recorder: "r".into(),
            ..Default::default()
        };
        Self {
            recorder: Recorder::new(dir.path().to_owned(), options),
            dir,
            now: Instant::now(),
            requests: Vec::new(),
        }
    }

    fn feed(&mut self, input: Input) -> Vec<Output> {
        let mut out = self.recorder.handle(input, self.now);
        out.extend(self.recorder.flush());
        self.make_files(out)
    }

    /// Answers all requests without samples, then advances the clock.
    fn wait(&mut self, time: Duration) -> Vec<Output> {
        let mut out = Vec::new();
        for missing in std::mem::take(&mut self.requests) {
            let answered = Input::Answered(missing);
            out.extend(self.recorder.handle(answered, self.now));
        }
        self.now += time;
        out.extend(self.recorder.tick(self.now));
        let requests = out.iter().filter_map(|output| match output {
            Output::RequestSamples { missing, .. } => Some(missing.clone()),
            _ => None,
        });
        self.requests.extend(requests);
        self.make_files(out)
    }

    /// Writes files at once instead of on a thread; drops these outputs.
    fn make_files(&mut self, mut out: Vec<Output>) -> Vec<Output> {
        while let Some(place) = out.iter().position(|o| matches!(o, Output::Finish(_))) {
            let Output::Finish(finishing) = out.remove(place) else {
                continue;
            };
            out.retain(
                |o| !matches!(o, Output::Status(s) if s.state() == v1::RecorderState::Finishing),
            );
            out.extend(self.recorder.handle(Input::Done(finishing.run()), self.now));
        }
        out
    }

    fn state(&self) -> v1::RecorderState {
        self.recorder.status().state()
    }

    fn open(&mut self, episode: u64, label: &str) {
        let out = self.feed(runs(started(episode, label)));
        assert!(matches!(out[..], [Output::RequestSnapshot]), "{out:?}");
        self.feed(snapshot(episode));
        assert_eq!(self.state(), v1::RecorderState::Ready);
    }

    fn files(&self) -> Vec<String> {
        let mut names: Vec<String> = std::fs::read_dir(self.dir.path())
            .unwrap()
            .map(|e| e.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }
}

fn report(out: &[Output]) -> &Report {
    out.iter()
        .find_map(|o| match o {
            Output::Finished(report) => Some(report),
            _ => None,
        })
        .unwrap_or_else(|| panic!("nothing was finished: {out:?}"))
}

fn hashes(path: &Path) -> Vec<(u64, u64)> {
    Episode::open(path).unwrap().state_hashes().unwrap()
}

#[test]
fn a_recorder_that_shuts_down_begins_no_episode() {
    let mut b = Bench::new();
    assert!(b.feed(Input::Shutdown).is_empty());
    let out = b.feed(runs(started(1, "a")));
    assert!(out.is_empty(), "{out:?}");
}

#[test]
fn a_taken_label_is_refused_at_once_with_the_next_free_label() {
    let mut b = Bench::new();
    for file in [
        "a-1.h5",
        "a-4.h5",
        "a-9.h5.wal",
        "b-30.h5",
        "a.h5",
        "a-x.h5",
    ] {
        std::fs::write(b.dir.path().join(file), "").unwrap();
    }
    for (episode, label) in [(1, "a-1"), (2, "a-9"), (3, "a")] {
        let out = b.feed(runs(started(episode, label)));
        let [Output::Status(status), Output::Failed(words)] = &out[..] else {
            panic!("{label}: {out:?}")
        };
        assert_eq!(status.state(), v1::RecorderState::Failed);
        assert_eq!(status.free_label, "a-10");
        assert!(words.ends_with("the next free label is a-10"), "{words}");
    }
    b.open(4, "a-10");
    assert_eq!(b.recorder.status().free_label, "");
}

#[test]
fn a_practice_episode_is_left_out() {
    let mut b = Bench::new();
    let mut practice = started(1, "a");
    practice.practice = true;
    assert!(b.feed(runs(practice)).is_empty());
    assert!(b.feed(hash(1, 0)).is_empty());
    let mut over = stopped(1, 1, 0);
    over.discard = true;
    assert!(b.feed(ended(over)).is_empty());
    assert!(b.files().is_empty());
    b.open(2, "a");
}

#[test]
fn samples_that_overtake_the_start_are_kept_and_credit_counts_images() {
    let mut b = Bench::new();
    b.feed(hash(1, 0));
    b.feed(image(1, 0));
    b.feed(runs(started(1, "a")));
    b.feed(hash(1, 1));
    let out = b.feed(snapshot(1));
    let credit: Vec<u64> = out
        .iter()
        .filter_map(|o| match o {
            Output::Status(s) => Some(s.accepted_frames),
            _ => None,
        })
        .collect();
    assert_eq!(credit, [0, 1], "readiness, then one image");
    assert_eq!(b.feed(image(1, 1)).len(), 1, "credit after each image");
    assert!(
        b.feed(image(1, 1)).is_empty(),
        "a repeated sample adds no credit"
    );
    // One sample is still in flight when the episode ends.
    let out = b.feed(ended(stopped(1, 3, 2)));
    assert!(out.is_empty(), "it must wait for the manifest: {out:?}");
    let out = b.feed(hash(1, 2));
    let done = report(&out);
    assert!(done.complete, "{:?}", done.problems);
    assert_eq!((done.frames, done.samples, done.missed), (2, 5, 0));
    assert_eq!(hashes(&done.path), [(0, 0), (1, 7), (2, 14)]);
    assert_eq!(b.recorder.status().state(), v1::RecorderState::Finished);
    assert_eq!(b.recorder.status().accepted_frames, 2);
    assert!(b.recorder.status().complete);
    assert_eq!(b.files(), ["a.h5"]);
}

#[test]
fn missing_samples_are_awaited_for_a_while_and_then_counted() {
    let mut b = Bench::new();
    b.open(1, "gap");
    b.feed(hash(1, 0));
    b.feed(hash(1, 3));
    assert_eq!(b.feed(image(1, 0)).len(), 1);
    assert_eq!(b.recorder.status().missed, 2);
    b.feed(ended(stopped(1, 5, 1)));
    let requests: Vec<_> = b
        .wait(MANIFEST_PATIENCE / 2)
        .into_iter()
        .map(|output| match output {
            Output::RequestSamples { missing: m, .. } => (m.stream, m.first, m.last),
            other => panic!("{other:?}"),
        })
        .collect();
    let gap = |first, last| ("state_hash".to_owned(), first, Some(last));
    assert_eq!(requests, [gap(1, 2), gap(4, 4)]);
    let out = b.wait(MANIFEST_PATIENCE);
    assert_eq!((report(&out).complete, report(&out).missed), (false, 3));
    assert_eq!(b.recorder.status().missed, 3);
}

#[test]
fn an_existing_file_fails_before_the_simulation_advances() {
    let mut b = Bench::new();
    let file = b.dir.path().join("mine.h5");
    std::fs::write(&file, "mine").unwrap();
    let out = b.feed(runs(started(1, "mine")));
    assert!(matches!(out[..], [Output::Status(_), Output::Failed(_)]));
    assert_eq!(b.state(), v1::RecorderState::Failed);
    assert!(b.recorder.status().message.contains("choose another label"));
    b.feed(snapshot(1));
    b.feed(image(1, 0));
    b.feed(ended(stopped(1, 0, 1)));
    assert_eq!(std::fs::read(&file).unwrap(), b"mine");
    assert_eq!(b.files(), ["mine.h5"]);
    // The next episode is recorded normally.
    b.open(2, "next");
    b.feed(hash(2, 0));
    let out = b.feed(ended(stopped(2, 1, 0)));
    assert!(report(&out).complete);
}

#[test]
fn a_removed_log_is_reported_at_once_and_saved() {
    for whole_folder in [false, true] {
        let mut b = Bench::new();
        b.open(1, "gone");
        for sequence in 0..3 {
            b.feed(hash(1, sequence));
        }
        let log = b.dir.path().join("gone.h5.wal");
        let written = || wheelarm_dataset::log::scan(&log).map_or(0, |scan| scan.entries.len());
        while written() < 3 {
            std::thread::yield_now();
        }
        match whole_folder {
            true => std::fs::remove_dir_all(b.dir.path()).unwrap(),
            false => std::fs::remove_file(&log).unwrap(),
        }
        // Without a sample, the elapsed time shows it.
        let out = loop {
            let out = b.wait(Duration::ZERO);
            if !out.is_empty() {
                break out;
            }
            std::thread::yield_now();
        };
        let [Output::Status(status), Output::Failed(words)] = &out[..] else {
            panic!("{out:?}")
        };
        assert_eq!(status.state(), v1::RecorderState::Failed);
        let saved = format!(
            "what was acknowledged is saved in {}: `wheelarm",
            log.display()
        );
        assert!(words.contains("was removed or replaced"), "{words}");
        assert!(words.contains(&saved), "{words}");
        let finished = wheelarm_dataset::finish::finish(&log, None).unwrap();
        assert_eq!(hashes(&finished.path), [(0, 0), (1, 7), (2, 14)]);
    }
}

#[test]
fn a_discarded_episode_leaves_no_file() {
    let mut b = Bench::new();
    b.open(1, "bad");
    b.feed(hash(1, 0));
    let discard = v1::EpisodeStopped {
        discard: true,
        ..stopped(1, 1, 0)
    };
    let out = b.feed(ended(discard));
    assert!(matches!(out[..], [Output::Status(_), Output::Discarded(_)]));
    assert!(b.files().is_empty(), "{:?}", b.files());
    b.open(2, "bad");
}

#[test]
fn an_early_end_leaves_a_partial_file_that_says_why() {
    let gone = |b: &mut Bench| {
        let out = b.feed(Input::ServerLost);
        assert!(out.is_empty(), "it may come back: {out:?}");
        b.wait(AWAY_PATIENCE / 2);
        assert_eq!(b.state(), v1::RecorderState::Ready);
        b.wait(AWAY_PATIENCE)
    };
    let shutdown = |b: &mut Bench| b.feed(Input::Shutdown);
    // The next one began, and the end of this one is forgotten.
    let forgotten = |b: &mut Bench| b.feed(runs(started(20, "next")));
    type Way = fn(&mut Bench) -> Vec<Output>;
    for (way, words) in [
        (gone as Way, "server went away"),
        (shutdown, "recorder was stopped"),
        (forgotten, "the server reports no end of the episode"),
    ] {
        let mut b = Bench::new();
        b.open(1, "cut");
        b.feed(hash(1, 0));
        b.feed(hash(1, 3));
        let out = way(&mut b);
        let done = report(&out);
        assert!(!done.complete && !done.counted);
        assert_eq!(done.missed, 2, "at least");
        assert!(done.problems[0].contains(words), "{:?}", done.problems);
        let unknown = |p: &String| p.contains("how many samples are missing is unknown");
        assert!(done.problems.iter().any(unknown), "{:?}", done.problems);
        assert_eq!(hashes(&done.path), [(0, 0), (3, 21)]);
    }
}

#[test]
fn an_episode_continues_when_the_server_returns() {
    let mut b = Bench::new();
    b.open(1, "stall");
    b.feed(hash(1, 0));
    for second in 1..4 {
        assert!(b.feed(Input::ServerLost).is_empty());
        b.wait(AWAY_PATIENCE / 2);
        assert!(b.feed(runs(started(1, "stall"))).is_empty());
        // It was back: the next absence is a new one.
        b.wait(Duration::from_secs(1));
        b.feed(hash(1, second * 10));
    }
    let out = b.feed(ended(stopped(1, 40, 0)));
    assert!(out.is_empty(), "{out:?}");
    let out = b.wait(MANIFEST_PATIENCE);
    let done = report(&out);
    assert!(done.counted, "{:?}", done.problems);
    assert_eq!((done.samples, done.missed), (4, 36));
}

#[test]
fn an_episode_ends_before_the_next_begins_in_any_order_of_hints() {
    let mut b = Bench::new();
    b.open(1, "former");
    b.feed(hash(1, 0));
    // Hint: the start of the second, without the end of the first.
    let out = b.feed(Input::Hint);
    assert!(matches!(out[..], [Output::RequestState]), "{out:?}");
    let out = b.feed(state(Some(started(2, "next")), vec![stopped(1, 1, 0)]));
    assert!(report(&out).complete, "{out:?}");
    assert!(
        out.iter().any(|o| matches!(o, Output::RequestSnapshot)),
        "{out:?}"
    );
    b.feed(snapshot(2));
    b.feed(hash(2, 0));
    // The second is discarded and the third begins at once.
    let discard = v1::EpisodeStopped {
        discard: true,
        ..stopped(2, 1, 0)
    };
    let all = vec![stopped(1, 1, 0), discard];
    let out = b.feed(state(Some(started(3, "third")), all));
    let discarded = |o: &Output| matches!(o, Output::Discarded(label) if label == "next");
    assert!(out.iter().any(discarded), "{out:?}");
    assert_eq!(b.files(), ["former.h5"]);
}

#[test]
fn hints_only_cause_a_request_and_one_request_is_pending_at_a_time() {
    let mut b = Bench::new();
    b.open(1, "requests");
    b.feed(hash(1, 0));
    assert!(matches!(b.feed(Input::Hint)[..], [Output::RequestState]));
    for _ in 0..1000 {
        assert!(b.feed(Input::Hint).is_empty());
    }
    // Requested again because of the hints after the request.
    assert!(b.feed(runs(started(1, "requests"))).is_empty());
    let out = b.wait(HINT_PAUSE);
    assert!(matches!(out[..], [Output::RequestState]), "{out:?}");
    b.feed(Input::State(Err("no answer".into())));
    let out = b.wait(STATE_RETRY);
    assert!(matches!(out[..], [Output::RequestState]), "{out:?}");
    assert!(b.feed(runs(started(1, "requests"))).is_empty());
    assert_eq!(b.state(), v1::RecorderState::Ready);
    assert!(report(&b.feed(ended(stopped(1, 1, 0)))).complete);
}

#[test]
fn samples_of_another_publisher_are_found_by_the_digest() {
    use wheelarm_proto::digest::{StreamDigest, of_message};
    let encoded = |input: &Input| match input {
        Input::Sample { payload, .. } => of_message([&payload[..]]),
        other => panic!("{other:?}"),
    };
    let true_ones: Vec<_> = (0..3).map(|i| encoded(&hash(1, i))).collect();
    let mut end = stopped(1, 3, 0);
    end.manifest[0].digest = StreamDigest::from_messages(&true_ones).to_vec();
    let forged = |tick: u64| {
        let message = v1::StateHash {
            header: Some(header(1, 2, tick)),
            hash: 666,
        };
        Input::Sample {
            stream: "state_hash".into(),
            payload: message.encode_to_vec().into(),
        }
    };
    // All original, one late; one replaced; one forged before the original arrived.
    for (third, more, words) in [
        (hash(1, 2), None, ""),
        (forged(2), None, "digests differ"),
        (forged(2), Some(hash(1, 2)), "two contents"),
    ] {
        let mut b = Bench::new();
        b.open(1, "digest");
        b.feed(hash(1, 0));
        b.feed(third);
        b.feed(more.unwrap_or_else(|| hash(1, 0)));
        b.feed(hash(1, 1));
        let out = b.feed(ended(end.clone()));
        let done = report(&out);
        assert_eq!(done.complete, words.is_empty(), "{:?}", done.problems);
        let named = |p: &String| p.contains("state_hash: ") && p.contains(words);
        assert_eq!(done.problems.iter().any(named), !words.is_empty());
    }
}

#[test]
fn an_unannounced_episode_is_reported_as_not_recorded() {
    let mut b = Bench::new();
    // Episodes that ended before the recorder joined are not reported.
    assert!(b.feed(ended(stopped(4, 1, 0))).is_empty());
    b.open(5, "five");
    b.feed(hash(5, 0));
    let discard = v1::EpisodeStopped {
        discard: true,
        ..stopped(7, 1, 0)
    };
    let all = vec![
        stopped(4, 1, 0),
        stopped(5, 1, 0),
        stopped(6, 9, 0),
        discard,
    ];
    let out = b.feed(state(Some(started(8, "eight")), all.clone()));
    assert!(report(&out).complete);
    let failed = |out: &[Output]| -> Vec<String> {
        let words = |o: &Output| match o {
            Output::Failed(words) => Some(words.clone()),
            _ => None,
        };
        out.iter().filter_map(words).collect()
    };
    let [words] = &failed(&out)[..] else {
        panic!("{out:?}")
    };
    assert!(
        words.starts_with("episode 6 of this server was over"),
        "{words}"
    );
    // Once is enough.
    let again = b.feed(state(Some(started(8, "eight")), all));
    assert!(failed(&again).is_empty(), "{again:?}");
}

#[test]
fn an_episode_that_ends_before_it_opens_is_dropped() {
    let mut b = Bench::new();
    b.feed(runs(started(1, "short")));
    b.feed(ended(stopped(1, 0, 0)));
    // Its snapshot may still be under way.
    assert_eq!(b.wait(Duration::from_secs(1)).len(), 0);
    b.feed(Input::Snapshot(Err("no episode is running".into())));
    b.open(2, "next");
}

#[test]
fn the_snapshot_is_requested_until_it_arrives_or_the_episode_fails() {
    let mut b = Bench::new();
    b.feed(runs(started(1, "slow")));
    let out = b.feed(Input::Snapshot(Err("no route".into())));
    assert!(
        matches!(out[..], [Output::RequestState]),
        "is it over? {out:?}"
    );
    let again = b.wait(SNAPSHOT_RETRY + Duration::from_millis(1));
    assert!(matches!(again[..], [Output::RequestSnapshot]));
    b.feed(snapshot(7));
    assert_eq!(b.state(), v1::RecorderState::Idle, "of another episode");
    let out = b.wait(SNAPSHOT_PATIENCE);
    assert!(matches!(out.last(), Some(Output::Failed(_))), "{out:?}");
    assert_eq!(b.state(), v1::RecorderState::Failed);
}

#[test]
fn the_next_episode_begins_while_a_bounded_number_of_files_is_written() {
    let mut b = Bench::new();
    let mut made = Vec::new();
    let mut record = |b: &mut Bench, episode: u64| {
        b.open(episode, &format!("e{episode}"));
        b.feed(hash(episode, 0));
        let out = b.recorder.handle(ended(stopped(episode, 1, 0)), b.now);
        made.extend(out.into_iter().filter_map(|o| match o {
            Output::Finish(finishing) => Some(finishing),
            _ => None,
        }));
    };
    record(&mut b, 1);
    assert_eq!(b.state(), v1::RecorderState::Finishing);
    record(&mut b, 2);
    // Two files are being made: the third episode waits, its samples are kept.
    let out = b.feed(runs(started(3, "e3")));
    assert!(out.is_empty(), "{out:?}");
    b.feed(hash(3, 0));
    let first = Input::Done(made.remove(0).run());
    let out = b.feed(first);
    assert!(report(&out).complete);
    assert!(matches!(
        out[..],
        [
            Output::Status(_),
            Output::Finished(_),
            Output::RequestSnapshot
        ]
    ));
    b.feed(snapshot(3));
    assert_eq!(b.state(), v1::RecorderState::Ready);
    let second = Input::Done(made.remove(0).run());
    let out = b.feed(second);
    let Output::Status(status) = &out[0] else {
        panic!("{out:?}")
    };
    assert_eq!(status.header.as_ref().unwrap().episode, 2);
    assert_eq!(b.state(), v1::RecorderState::Ready, "of episode 3");
    let out = b.feed(ended(stopped(3, 1, 0)));
    assert!(report(&out).complete);
    assert!(b.recorder.is_done());
    assert_eq!(b.files(), ["e1.h5", "e2.h5", "e3.h5"]);
}

#[test]
fn a_restarted_server_ends_the_episode_and_its_first_one_is_recorded() {
    let mut b = Bench::new();
    b.open(1, "cut");
    b.feed(hash(1, 0));
    b.now += Duration::from_secs(1);
    b.feed(Input::ServerLost);
    let other = v1::EpisodeState {
        header: Some(v1::Header {
            run_id: "another run".into(),
            ..Default::default()
        }),
        ..Default::default()
    };
    b.feed(Input::State(Ok(other)));
    let out = b.wait(FAREWELL_PATIENCE);
    assert!(report(&out).problems[0].contains("server went away"));
    let mut again = started(1, "after");
    again.header.as_mut().unwrap().run_id = "another run".into();
    let out = b.feed(runs(again));
    assert!(matches!(out[..], [Output::RequestSnapshot]), "{out:?}");
}

#[test]
fn a_recorder_with_a_limit_begins_no_episode_beyond_it() {
    let mut b = Bench::new();
    b.recorder =
        Recorder::new(b.dir.path().to_owned(), WriterOptions::default()).with_limit(Some(1));
    b.open(1, "one");
    b.feed(hash(1, 0));
    b.recorder.handle(ended(stopped(1, 1, 0)), b.now);
    assert!(b.feed(runs(started(2, "two"))).is_empty());
}
