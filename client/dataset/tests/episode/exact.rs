//! Every number of every stream survives the file.

use wheelarm_dataset::columns::{Cell, Context, Kind, MAX_CONTACTS, header_of, streams};
use wheelarm_dataset::finish::finish;
use wheelarm_dataset::read::Episode;
use wheelarm_dataset::writer::WriterOptions;
use wheelarm_proto::{Message, v1};

use crate::recording::{bits, record};
use crate::synthetic;

/// Whether two cells are equal, NaN equal to NaN.
fn same(a: &Cell, b: &Cell) -> bool {
    let equal = |(a, b): (&f64, &f64)| a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan();
    match (a, b) {
        (Cell::F64(a), Cell::F64(b)) => a.len() == b.len() && a.iter().zip(b).all(equal),
        (a, b) => a == b,
    }
}

#[test]
fn every_stream_survives_the_file_bit_for_bit() {
    let dir = tempfile::tempdir().unwrap();
    // More samples than one chunk has rows.
    let (log, offered) = record(dir.path(), "exact", &WriterOptions::default(), 1100);
    let finished = finish(&log, None).unwrap();
    assert!(
        finished.account.complete(),
        "{:?}",
        finished.account.problems
    );
    assert!(!log.exists());

    let episode = Episode::open(&finished.path).unwrap();
    let context = Context {
        objects: synthetic::started("").objects,
        furniture_joints: synthetic::started("").joints,
        vertices: 4,
        conditions: episode.names("evaluation", "condition_holds").unwrap(),
        ..Context::from_description(&episode.robot().unwrap())
    };
    assert_eq!(context.conditions.len(), 3);
    for stream in streams() {
        let name = stream.name();
        let rows: Vec<Vec<Cell>> = offered[name]
            .iter()
            .map(|p| stream.extract(p, &context).unwrap().0)
            .collect();
        // A restored sample is stored identically: no column is lost.
        let samples = episode.samples(name).unwrap();
        for (i, row) in rows.iter().enumerate() {
            let again = samples.encoded(i).unwrap();
            let (cells, regular) = stream.extract(&again, &context).unwrap();
            assert!(regular, "{name}, sample {i}");
            for (column, (cell, was)) in stream.columns().iter().zip(cells.iter().zip(row)) {
                // A file holds so many contacts, and how many there were.
                let cut = |cell: &Cell| match cell {
                    Cell::U64(v) if column.name == "count" => {
                        Cell::U64(vec![v[0].min(MAX_CONTACTS as u64)])
                    }
                    cell => cell.clone(),
                };
                let what = format!("{name}/{}: {cell:?}, was {was:?}", column.name);
                assert!(same(&cut(cell), &cut(was)), "{what}");
            }
            let header = header_of(&again).unwrap();
            assert_eq!(header.sequence, 100 + i as u64, "{name}");
        }
        for (c, column) in stream.columns().into_iter().enumerate() {
            let cells = rows.iter().map(|row| &row[c]);
            let what = format!("{name}/{}", column.name);
            match column.kind {
                Kind::F64 => {
                    let all: Vec<f64> = cells
                        .flat_map(|c| match c {
                            Cell::F64(v) => v.clone(),
                            _ => Vec::new(),
                        })
                        .collect();
                    let read = episode.f64s(name, column.name).unwrap();
                    assert_eq!(read.shape()[0], 1100, "{what}");
                    assert_eq!(bits(read.as_slice().unwrap()), bits(&all), "{what}");
                }
                Kind::U64 => {
                    let all: Vec<u64> = cells
                        .flat_map(|c| match c {
                            Cell::U64(v) => v.clone(),
                            _ => Vec::new(),
                        })
                        .collect();
                    assert_eq!(episode.u64s(name, column.name).unwrap(), all, "{what}");
                }
                Kind::Flag => {
                    let all: Vec<bool> = cells
                        .flat_map(|c| match c {
                            Cell::Flag(v) => v.iter().map(|&b| b != 0).collect(),
                            _ => Vec::new(),
                        })
                        .collect();
                    assert_eq!(episode.flags(name, column.name).unwrap(), all, "{what}");
                }
                Kind::Text => {
                    let all: Vec<String> = cells
                        .map(|c| match c {
                            Cell::Text(v) => v.clone(),
                            _ => String::new(),
                        })
                        .collect();
                    assert_eq!(episode.texts(name, column.name).unwrap(), all, "{what}");
                }
                Kind::Bytes => {}
            }
        }
        let sequences: Vec<u64> = (100..1200).collect();
        assert_eq!(episode.u64s(name, "sequence").unwrap(), sequences);
    }
    // Replay reads the original messages.
    let sent: Vec<Vec<u8>> = offered["applied"].iter().map(|p| p.to_vec()).collect();
    let read: Vec<Vec<u8>> = episode
        .applied()
        .unwrap()
        .iter()
        .map(Message::encode_to_vec)
        .collect();
    assert_eq!(read, sent);
    assert_eq!(episode.state_hashes().unwrap().len(), 1100);
    assert_eq!(episode.snapshot().unwrap(), synthetic::snapshot());
    assert_eq!(episode.started().unwrap(), synthetic::started("exact"));
    assert_eq!(
        episode.scenario().unwrap(),
        synthetic::started("exact").scenario.unwrap()
    );
    let events = episode.texts("event", "source").unwrap();
    assert_eq!(events.iter().filter(|s| *s == "event").count(), 1100);

    for camera in ["gen3", "wheelchair"] {
        let sent = &offered[&format!("camera/{camera}")];
        let read = episode.camera(camera).unwrap();
        assert_eq!(read.len(), sent.len());
        for (i, payload) in sent.iter().enumerate() {
            let sent = v1::CameraFrame::decode(payload.clone()).unwrap();
            let frame = read.frame(&episode, i).unwrap();
            let depth: Vec<u8> = frame.depth.iter().flat_map(|d| d.to_le_bytes()).collect();
            assert_eq!(frame.rgb, sent.color);
            assert_eq!(depth, sent.depth);
            assert_eq!(
                wheelarm_dataset::ids::write(&frame.ids, 2),
                sent.segmentation
            );
            assert_eq!(Some(frame.intrinsics), sent.intrinsics);
            assert_eq!(frame.pose, [1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0]);
        }
    }
    let summary = episode.summary().unwrap();
    assert!(summary.complete && summary.success);
    assert_eq!(summary.conditions.len(), 2);
}
