//! Images in the formats of a file: depth in millimetres or none, ids of
//! 8 and 16 bits.

use wheelarm_dataset::depth::Depth;
use wheelarm_dataset::finish::finish;
use wheelarm_dataset::log::Closing;
use wheelarm_dataset::read::Episode;
use wheelarm_dataset::writer::{EpisodeWriter, WriterOptions};
use wheelarm_proto::{Message, v1};

use crate::recording::{camera_frame, record};
use crate::synthetic::{self, Random};

#[test]
fn depth_in_millimetres_is_the_rounded_depth_in_metres() {
    let dir = tempfile::tempdir().unwrap();
    let options = WriterOptions {
        depth: Depth::Millimetres,
        ..Default::default()
    };
    let (log, offered) = record(dir.path(), "mm", &options, 7);
    let episode = Episode::open(&finish(&log, None).unwrap().path).unwrap();
    let camera = episode.camera("gen3").unwrap();
    for (i, payload) in offered["camera/gen3"].iter().enumerate() {
        let sent = v1::CameraFrame::decode(payload.clone()).unwrap();
        let read = camera.frame(&episode, i).unwrap();
        for (bytes, &metres) in sent.depth.chunks_exact(4).zip(&read.depth) {
            let exact = f32::from_le_bytes(bytes.try_into().unwrap());
            let same = exact.is_infinite() && metres.is_infinite();
            assert!(same || (exact - metres).abs() <= 5.1e-4, "{exact} {metres}");
        }
    }
    assert_eq!(episode.summary().unwrap().depth_unit, "mm");
}

#[test]
fn without_depth_colour_and_ids_are_stored_unchanged() {
    let dir = tempfile::tempdir().unwrap();
    let options = WriterOptions {
        depth: Depth::Nothing,
        ..Default::default()
    };
    let (log, offered) = record(dir.path(), "colour", &options, 7);
    let finished = finish(&log, None).unwrap();
    let episode = Episode::open(&finished.path).unwrap();
    let camera = episode.camera("gen3").unwrap();
    assert!(camera.has_rgb() && !camera.has_depth());
    assert_eq!(camera.len(), offered["camera/gen3"].len());
    for (i, payload) in offered["camera/gen3"].iter().enumerate() {
        let sent = v1::CameraFrame::decode(payload.clone()).unwrap();
        let read = camera.frame(&episode, i).unwrap();
        assert_eq!(read.rgb, sent.color);
        assert!(read.depth.is_empty());
        assert!(camera.encoded(&episode, i).unwrap().is_none());
    }
    let error = camera.depth(&episode, 0).unwrap_err().to_string();
    assert!(error.contains("depth"), "{error}");
    assert_eq!(episode.summary().unwrap().depth_unit, "none");
}

#[test]
fn images_with_ids_of_8_bits_are_read_like_those_of_16() {
    let dir = tempfile::tempdir().unwrap();
    let mut r = Random(5);
    let wide = v1::CameraFrame::decode(camera_frame(&mut r, "gen3", 0)).unwrap();
    let ids = wheelarm_dataset::ids::read(&wide.segmentation, 2);
    // As the first contract sent it: 8 bits, and no word on formats.
    let narrow = v1::CameraFrame {
        segmentation: wheelarm_dataset::ids::write(&ids, 1).into(),
        color_format: 0,
        depth_format: 0,
        segmentation_format: 0,
        ..wide.clone()
    };
    for (label, frame, each) in [("narrow", narrow, 1), ("wide", wide, 2)] {
        let started = synthetic::started(label);
        let options = WriterOptions::default();
        let mut writer =
            EpisodeWriter::open(dir.path(), &started, &synthetic::snapshot(), &options).unwrap();
        let sent = frame.encode_to_vec();
        writer.offer("camera/gen3", sent.clone().into()).unwrap();
        let log = writer.close(Closing::default()).unwrap();
        let episode = Episode::open(&finish(&log, None).unwrap().path).unwrap();
        let camera = episode.camera("gen3").unwrap();
        assert_eq!(camera.id_bytes(), each);
        assert_eq!(camera.ids(&episode, 0).unwrap(), ids);
        // The message is restored bit for bit: its digest matches.
        assert_eq!(camera.encoded(&episode, 0).unwrap(), Some(sent));
    }
}
