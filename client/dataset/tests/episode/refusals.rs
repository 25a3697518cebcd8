//! Rejections: overwriting a file, and samples of the wrong type.

use bytes::Bytes;
use wheelarm_dataset::finish::{FinishError, finish};
use wheelarm_dataset::log::{Closing, scan};
use wheelarm_dataset::writer::{EpisodeWriter, WriteError, WriterOptions};
use wheelarm_proto::{Message, v1};

use crate::recording::{camera_frame, record};
use crate::synthetic::{self, Random};

#[test]
fn an_existing_file_is_never_overwritten() {
    let dir = tempfile::tempdir().unwrap();
    let (log, _) = record(dir.path(), "twice", &WriterOptions::default(), 3);
    let started = synthetic::started("twice");
    let open = || {
        EpisodeWriter::open(
            dir.path(),
            &started,
            &synthetic::snapshot(),
            &WriterOptions::default(),
        )
    };
    assert!(matches!(open(), Err(WriteError::Unfinished(_))));

    // The file appears between the start and the end of a recording.
    let file = dir.path().join("twice.h5");
    std::fs::write(&file, "mine").unwrap();
    assert!(matches!(
        finish(&log, None),
        Err(FinishError::Exists { .. })
    ));
    assert_eq!(std::fs::read(&file).unwrap(), b"mine");
    assert!(log.exists(), "the log must stay");
    assert!(matches!(open(), Err(WriteError::Exists(_))));

    std::fs::remove_file(&file).unwrap();
    assert!(finish(&log, None).unwrap().account.complete());
    let names: Vec<_> = std::fs::read_dir(dir.path())
        .unwrap()
        .map(|e| e.unwrap().file_name())
        .collect();
    assert_eq!(names, ["twice.h5"], "nothing else may be left behind");
}

#[test]
fn samples_of_the_wrong_kind_are_refused_and_do_no_harm() {
    let dir = tempfile::tempdir().unwrap();
    let mut writer = EpisodeWriter::open(
        dir.path(),
        &synthetic::started("bad"),
        &synthetic::snapshot(),
        &WriterOptions::default(),
    )
    .unwrap();
    let mut r = Random(4);
    let good = camera_frame(&mut r, "gen3", 0);
    assert!(
        writer
            .offer("camera/gen3", good.slice(..good.len() - 1))
            .is_err()
    );
    let cut = v1::CameraFrame {
        color: Bytes::from_static(b"short"),
        ..v1::CameraFrame::decode(good.clone()).unwrap()
    };
    assert!(
        writer
            .offer("camera/gen3", cut.encode_to_vec().into())
            .is_err()
    );
    assert!(
        writer
            .offer("imu", Bytes::from_static(b"\xff\xff"))
            .is_err()
    );
    assert!(writer.offer("unknown", Bytes::new()).is_err());
    writer.offer("camera/gen3", good).unwrap();
    let log = writer.close(Closing::default()).unwrap();
    assert_eq!(scan(&log).unwrap().entries.len(), 1);
    assert!(!finish(&log, None).unwrap().account.complete());
}
