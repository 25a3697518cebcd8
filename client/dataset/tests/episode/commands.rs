//! Manual commands: several in a tick, then none for a while.

use wheelarm_dataset::align::{AlignOptions, align};
use wheelarm_dataset::finish::finish;
use wheelarm_dataset::log::Closing;
use wheelarm_dataset::read::{Episode, Values};
use wheelarm_dataset::validate::validate;
use wheelarm_dataset::writer::{EpisodeWriter, WriterOptions};

use crate::recording::{bits, camera_frame};
use crate::synthetic::{self, Random};

#[test]
fn commands_of_one_tick_and_pauses_between_them_are_valid() {
    let dir = tempfile::tempdir().unwrap();
    let started = synthetic::started("byhand");
    let options = WriterOptions::default();
    let mut writer =
        EpisodeWriter::open(dir.path(), &started, &synthetic::snapshot(), &options).unwrap();
    let mut r = Random(3);
    // Several in a tick, then silence, as a person sends them.
    for (sequence, tick) in [0, 4, 4, 8, 8, 8, 12, 240].into_iter().enumerate() {
        let header = synthetic::header(sequence as u64, tick);
        let payload = r.message("command", header, 0);
        writer.offer("command", payload.into()).unwrap();
    }
    for (sequence, tick) in [0, 4, 4, 240].into_iter().enumerate() {
        let header = synthetic::header(sequence as u64, tick);
        writer
            .offer("clock", r.message("clock", header, 0).into())
            .unwrap();
    }
    let counts = [("command".to_owned(), 0, 8), ("clock".to_owned(), 0, 4)];
    let closing = Closing {
        stopped: Some(synthetic::stopped(240, &counts)),
        ..Default::default()
    };
    let finished = finish(&writer.close(closing).unwrap(), None).unwrap();
    let found = validate(&finished.path, 1).unwrap();
    let about = |stream: &str| -> Vec<&String> {
        let begins = |p: &&String| p.starts_with(stream);
        found.problems.iter().filter(begins).collect()
    };
    assert!(about("command: ").is_empty(), "{:?}", found.problems);
    // A stream with a rate of its own is still held to it.
    let [order, gap] = &about("clock: ")[..] else {
        panic!("{:?}", found.problems)
    };
    assert!(order.contains("do not rise at sample 2"), "{order}");
    assert!(gap.contains("1 gaps"), "{gap}");
}

#[test]
fn of_the_commands_of_one_tick_the_last_is_aligned() {
    let dir = tempfile::tempdir().unwrap();
    let started = synthetic::started("aligned");
    let options = WriterOptions::default();
    let mut writer =
        EpisodeWriter::open(dir.path(), &started, &synthetic::snapshot(), &options).unwrap();
    let mut r = Random(3);
    // As in real time by hand: more often than not several in a tick.
    let ticks = [0, 4, 4, 8, 8, 12, 16, 20, 20, 24, 24, 24, 28, 28, 48];
    for (sequence, tick) in ticks.into_iter().enumerate() {
        let header = synthetic::header(sequence as u64, tick);
        let payload = r.message("command", header, 0);
        writer.offer("command", payload.into()).unwrap();
    }
    // At the ticks 0, 24 and 48.
    for sequence in 0..3 {
        let payload = camera_frame(&mut r, "gen3", sequence);
        writer.offer("camera/gen3", payload).unwrap();
    }
    let counts = [
        ("command".to_owned(), 0, 15),
        ("camera/gen3".to_owned(), 0, 3),
    ];
    let closing = Closing {
        stopped: Some(synthetic::stopped(48, &counts)),
        ..Default::default()
    };
    let finished = finish(&writer.close(closing).unwrap(), None).unwrap();
    let episode = Episode::open(&finished.path).unwrap();
    let aligned = align(&episode, &AlignOptions::default(), &|_| true).unwrap();
    assert_eq!(aligned.coverage["command"].valid, [true; 3]);
    let mut compared = 0;
    for signal in aligned
        .signals
        .iter()
        .filter(|s| s.meta.stream == "command")
    {
        let width = signal.meta.width();
        let Values::F64(all) = episode.values(&signal.meta).unwrap() else {
            continue;
        };
        // The last of those that arrived at the image's tick.
        for (row, sample) in [0, 11, 14].into_iter().enumerate() {
            let there = &all[sample * width..(sample + 1) * width];
            assert_eq!(bits(signal.row(row)), bits(there), "{}", signal.meta.name);
        }
        compared += 1;
    }
    assert!(compared >= 3, "{compared} columns");
}
