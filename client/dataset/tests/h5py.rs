//! An independent reader: plain h5py reads an episode file and finds the
//! numbers that were put in. Skipped, and it says so, without h5py; the
//! variable `WHEELARM_PYTHON` names the interpreter.

#[path = "../examples/synthetic/mod.rs"]
mod synthetic;

use std::path::Path;
use std::process::Command;

use wheelarm_dataset::finish::finish;
use wheelarm_dataset::read::Episode;
use wheelarm_dataset::writer::{EpisodeWriter, WriterOptions};
use wheelarm_dataset::{depth::Depth, log::Closing, sheet::sheet};
use wheelarm_proto::{Message, StreamId, v1};

fn python() -> Option<String> {
    let python = std::env::var("WHEELARM_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let there = Command::new(&python)
        .args(["-c", "import h5py, numpy"])
        .output()
        .is_ok_and(|o| o.status.success());
    there.then_some(python)
}

#[test]
fn plain_h5py_reads_every_dataset_and_finds_the_same_pixels() {
    let Some(python) = python() else {
        wheelarm_proto::program::skipped("no python3 with h5py and numpy (set WHEELARM_PYTHON)");
        return;
    };
    let dir = tempfile::tempdir().unwrap();
    for depth in [Depth::Metres, Depth::Millimetres] {
        let label = format!("h5py_{depth:?}");
        let options = WriterOptions {
            depth,
            ..Default::default()
        };
        let mut writer = EpisodeWriter::open(
            dir.path(),
            &synthetic::started(&label),
            &synthetic::snapshot(),
            &options,
        )
        .unwrap();
        let mut r = synthetic::Random(11);
        for i in 0..70 {
            for stream in &StreamId::all([], [])
                .map(|s| s.to_string())
                .collect::<Vec<_>>()
            {
                let payload = r.message(stream, synthetic::header(i, 4 * i), 3);
                writer.offer(stream, payload.into()).unwrap();
            }
        }
        let mut sums = [0_u64; 2];
        for i in 0..4 {
            for camera in ["gen3", "wheelchair"] {
                let header = synthetic::header(i, 24 * i);
                let view = ([i as f64 * 0.1, 0.0, 1.4], 0.2, 0.3);
                let frame = synthetic::smooth::image(camera, header, (96, 54), view);
                if camera == "gen3" {
                    sums[0] += frame.color.iter().map(|&b| u64::from(b)).sum::<u64>();
                    let ids = wheelarm_dataset::ids::read(&frame.segmentation, 2);
                    sums[1] += ids.iter().map(|&id| u64::from(id)).sum::<u64>();
                }
                let stream = StreamId::camera(camera).to_string();
                writer.offer(&stream, frame.encode_to_vec().into()).unwrap();
            }
        }
        let counts: Vec<_> = StreamId::all(["gen3", "wheelchair"], [])
            .map(|s| (s.to_string(), 0, if s.is_camera() { 4 } else { 70 }))
            .collect();
        let stopped = Some(synthetic::stopped(280, &counts));
        let log = writer
            .close(Closing {
                stopped,
                ..Default::default()
            })
            .unwrap();
        let finished = finish(&log, None).unwrap();
        assert!(
            finished.account.complete(),
            "{:?}",
            finished.account.problems
        );

        let expected = serde_json::json!({
            "streams/camera/gen3/rgb": {"shape": [4, 54, 96, 3], "sum": sums[0]},
            "streams/camera/gen3/ids": {"shape": [4, 54, 96], "sum": sums[1]},
        });
        let json = dir.path().join("expected.json");
        std::fs::write(&json, expected.to_string()).unwrap();
        let script =
            Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/python/check_episode.py");
        let output = Command::new(&python)
            .arg(script)
            .arg(&finished.path)
            .arg(&json)
            .output()
            .unwrap();
        assert!(
            output.status.success(),
            "{}{}",
            String::from_utf8_lossy(&output.stdout),
            String::from_utf8_lossy(&output.stderr)
        );
    }
}

#[test]
fn the_sheet_shows_the_images_of_the_episode() {
    let dir = tempfile::tempdir().unwrap();
    let log = synthetic::smooth::record(dir.path(), "sheet", 3, (64, 36)).unwrap();
    let episode = Episode::open(&finish(&log, None).unwrap().path).unwrap();
    let out = dir.path().join("sheet.png");
    sheet(&episode, &out).unwrap();
    let decoder = png::Decoder::new(std::io::BufReader::new(std::fs::File::open(out).unwrap()));
    let mut reader = decoder.read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let size = reader.next_frame(&mut pixels).unwrap();
    assert!(size.width > 1000 && size.height > 1000, "{size:?}");

    // The mean colour of the first image is found at its tile.
    let frame = episode.camera("gen3").unwrap().frame(&episode, 0).unwrap();
    let mean = |rgb: &mut dyn Iterator<Item = &u8>| {
        let (sum, n) = rgb.fold((0_u64, 0_u64), |(s, n), &v| (s + u64::from(v), n + 1));
        sum as f64 / n as f64
    };
    let (x, y, w, h) = (180, 255, 230, 120);
    let tile: Vec<u8> = (y..y + h)
        .flat_map(|row| {
            let at = 3 * (row * size.width as usize + x);
            pixels[at..at + 3 * w].to_vec()
        })
        .collect();
    let (shown, taken) = (mean(&mut tile.iter()), mean(&mut frame.rgb.iter()));
    assert!((shown - taken).abs() < 6.0, "shown {shown}, taken {taken}");
    let _: v1::Scenario = episode.scenario().unwrap();
}
