//! Converts the log's samples into `/streams`: columns of numbers, images.

use std::collections::BTreeMap;

use hdf5::{Dataset, Group};
use prost::Message;
use wheelarm_proto::{StreamId, v1};

use crate::calibration::{CONVENTION, PIXEL_CENTRE};
use crate::columns::{Axis, Cell, ColumnInfo, Context, Kind, Stream};
use crate::compress::Deflate;
use crate::depth::{Depth, MILLIMETRES_NOTE};
use crate::hdf::{Attributes, Chunked, ColumnWriter, Filters};
use crate::ids;
use crate::log::{Ahead, CameraParts, Entry, Scan};
use crate::pose;

use super::error::FinishError;

const fn number(name: &'static str, unit: &'static str) -> ColumnInfo {
    ColumnInfo {
        name,
        unit,
        frame: "",
        axes: &[],
        kind: Kind::U64,
    }
}

/// Columns of every stream: time and number of each sample.
pub(super) const HEADER_COLUMNS: [ColumnInfo; 3] = [
    number("stamp_nanos", "ns of simulation time"),
    number("sequence", "1 (counts up by one per sample and run)"),
    number("tick", "ticks of 1/240 s"),
];

const INTRINSICS: ColumnInfo = ColumnInfo {
    name: "intrinsics",
    unit: "pixels",
    frame: "image, from its left and top edge",
    axes: &[Axis::Components(&[
        "width", "height", "fx", "fy", "cx", "cy",
    ])],
    kind: Kind::F64,
};

const CAMERA_POSE: ColumnInfo = ColumnInfo {
    name: "pose",
    unit: "m (x y z), 1 (unit quaternion x y z w)",
    frame: "optical frame (z forward, x right, y down) in house",
    axes: &[Axis::Components(&["x", "y", "z", "qx", "qy", "qz", "qw"])],
    kind: Kind::F64,
};

pub(super) fn header_cells(stamp_nanos: u64, sequence: u64, tick: u64) -> [Cell; 3] {
    [stamp_nanos, sequence, tick].map(|v| Cell::U64(vec![v]))
}

/// Samples of one stream in the order of their sequence numbers, each once.
pub(super) fn samples<'a>(scan: &'a Scan, stream: usize) -> Vec<&'a Entry> {
    let by_sequence: BTreeMap<u64, &'a Entry> = scan
        .entries
        .iter()
        .rev()
        .filter(|e| usize::from(e.header.stream) == stream)
        .map(|e| (e.header.sequence, e))
        .collect();
    by_sequence.into_values().collect()
}

/// Writes a state stream and returns the number of irregular samples, whose
/// lists have another length than their columns.
pub(super) fn state(
    group: &Group,
    stream: &dyn Stream,
    context: &Context,
    scan: &Scan,
    entries: &[&Entry],
) -> Result<usize, FinishError> {
    let mut deflate = Deflate::default();
    let own = stream.columns();
    let all = HEADER_COLUMNS.iter().chain(&own);
    let mut columns = create(group, all, context, entries.len())?;
    let (mut irregular, mut buffer) = (0, Vec::new());
    for entry in entries {
        let payload = scan.payload(entry, &mut buffer)?;
        let (cells, regular) =
            stream
                .extract(payload, context)
                .map_err(|e| FinishError::Content {
                    stream: stream.name().to_owned(),
                    sequence: entry.header.sequence,
                    reason: e.to_string(),
                })?;
        irregular += usize::from(!regular);
        let h = &entry.header;
        let head = header_cells(h.stamp_nanos, h.sequence, h.tick);
        for (column, cell) in columns.iter_mut().zip(head.into_iter().chain(cells)) {
            column.push(cell, &mut deflate)?;
        }
    }
    for column in columns {
        column.finish(&mut deflate)?;
    }
    Ok(irregular)
}

/// Empty columns for `rows` rows.
fn create<'a>(
    group: &Group,
    columns: impl Iterator<Item = &'a ColumnInfo>,
    context: &Context,
    rows: usize,
) -> Result<Vec<ColumnWriter>, FinishError> {
    let made = columns.map(|column| Ok(ColumnWriter::create(group, column, context, rows)?));
    made.collect()
}

/// Writes a camera's images chunk by chunk unchanged from the log; `payloads`
/// are those of `entries`.
pub(super) fn camera(
    group: &Group,
    name: &str,
    depth: Depth,
    payloads: &mut Ahead,
    entries: &[&Entry],
) -> Result<(), FinishError> {
    let mut deflate = Deflate::default();
    let context = Context::default();
    let all = HEADER_COLUMNS.iter().chain([&INTRINSICS, &CAMERA_POSE]);
    let mut columns = create(group, all, &context, entries.len())?;
    let calibration = group.dataset(INTRINSICS.name)?;
    Attributes::for_object(&calibration)
        .set("pixel_centre", PIXEL_CENTRE)?
        .text("convention", CONVENTION)?;
    let mut images = None;
    for (index, entry) in entries.iter().enumerate() {
        let bad = |reason: &str| FinishError::Content {
            stream: StreamId::camera(name).to_string(),
            sequence: entry.header.sequence,
            reason: reason.to_owned(),
        };
        let payload = payloads.read().ok_or_else(|| bad("it was not read"))??;
        let parts = CameraParts::parse(payload).ok_or_else(|| bad("its parts do not add up"))?;
        let meta = v1::CameraFrame::decode(parts.meta).map_err(|e| bad(&e.to_string()))?;
        let i = meta.intrinsics.ok_or_else(|| bad("it has no intrinsics"))?;
        let each = ids::bytes(&meta);
        let images = match &images {
            Some(p) => p,
            None => images.insert(ImageDatasets::create(
                group,
                depth,
                entries.len(),
                &i,
                each,
            )?),
        };
        if images.id_bytes != each {
            return Err(bad("its ids have another width than those before"));
        }
        images.rgb.write(index, parts.rgb)?;
        if let Some(depth) = &images.depth {
            depth.write(index, parts.depth)?;
        }
        images.ids.write(index, parts.ids)?;

        let h = &entry.header;
        let cells = header_cells(h.stamp_nanos, h.sequence, h.tick)
            .into_iter()
            .chain([
                Cell::F64(numbers(&i).to_vec()),
                Cell::F64(pose::of_message(meta.pose.as_ref()).to_vec()),
            ]);
        for (column, cell) in columns.iter_mut().zip(cells) {
            column.push(cell, &mut deflate)?;
        }
    }
    for column in columns {
        column.finish(&mut deflate)?;
    }
    Ok(())
}

/// Columns of a sensor's images beside those of a camera.
const EXPOSURE: [ColumnInfo; 2] = [
    number(
        "exposure_nanos",
        "ns of simulation time (the stamp is that of the arrival)",
    ),
    number("exposure_tick", "ticks of 1/240 s"),
];

/// Writes the images of a sensor model, colour or depth, chunk by chunk.
pub(super) fn sensor(
    group: &Group,
    name: &str,
    payloads: &mut Ahead,
    entries: &[&Entry],
) -> Result<(), FinishError> {
    let mut deflate = Deflate::default();
    let context = Context::default();
    let own = [&INTRINSICS, &CAMERA_POSE].into_iter().chain(&EXPOSURE);
    let all = HEADER_COLUMNS.iter().chain(own);
    let mut columns = create(group, all, &context, entries.len())?;
    let calibration = group.dataset(INTRINSICS.name)?;
    Attributes::for_object(&calibration)
        .set("pixel_centre", PIXEL_CENTRE)?
        .text("convention", CONVENTION)?;
    let mut image = None;
    for (index, entry) in entries.iter().enumerate() {
        let bad = |reason: &str| FinishError::Content {
            stream: StreamId::sensor(name).to_string(),
            sequence: entry.header.sequence,
            reason: reason.to_owned(),
        };
        let payload = payloads.read().ok_or_else(|| bad("it was not read"))??;
        let parts = CameraParts::parse(payload).ok_or_else(|| bad("its parts do not add up"))?;
        let meta = v1::SensorFrame::decode(parts.meta).map_err(|e| bad(&e.to_string()))?;
        let i = meta.intrinsics.ok_or_else(|| bad("it has no intrinsics"))?;
        let colour = parts.depth.is_empty();
        let (of_colour, chunks) = match &image {
            Some(made) => made,
            None => {
                Attributes::for_object(group).text("camera", &meta.camera)?;
                let size = [i.height as usize, i.width as usize];
                let made = match colour {
                    true => rgb_dataset(group, entries.len(), size)?,
                    false => millimetres_dataset(group, entries.len(), size, "0 for no return")?,
                };
                image.insert((colour, made))
            }
        };
        if *of_colour != colour {
            return Err(bad("it changes between colour and depth"));
        }
        chunks.write(index, if colour { parts.rgb } else { parts.depth })?;
        let h = &entry.header;
        let exposure = [meta.exposure_nanos, meta.exposure_tick].map(|v| Cell::U64(vec![v]));
        let cells = header_cells(h.stamp_nanos, h.sequence, h.tick)
            .into_iter()
            .chain([
                Cell::F64(numbers(&i).to_vec()),
                Cell::F64(pose::of_message(meta.pose.as_ref()).to_vec()),
            ])
            .chain(exposure);
        for (column, cell) in columns.iter_mut().zip(cells) {
            column.push(cell, &mut deflate)?;
        }
    }
    for column in columns {
        column.finish(&mut deflate)?;
    }
    Ok(())
}

fn numbers(i: &v1::Intrinsics) -> [f64; 6] {
    [
        f64::from(i.width),
        f64::from(i.height),
        i.fx,
        i.fy,
        i.cx,
        i.cy,
    ]
}

fn rgb_dataset(group: &Group, count: usize, [h, w]: [usize; 2]) -> hdf5::Result<Chunked> {
    let rgb = Chunked::create::<u8>(group, "rgb", count, &[h, w, 3], 1, Filters::Deflate)?;
    describe(rgb.dataset(), "1 (0 to 255, sRGB)")?;
    Ok(rgb)
}

fn millimetres_dataset(
    group: &Group,
    count: usize,
    [h, w]: [usize; 2],
    note: &str,
) -> hdf5::Result<Chunked> {
    let shuffle = Filters::ShuffleDeflate;
    let d = Chunked::create::<u16>(group, "depth", count, &[h, w], 1, shuffle)?;
    describe(d.dataset(), "mm")?;
    Attributes::for_object(d.dataset())
        .set("scale", 0.001)?
        .set("invalid", 0_u16)?
        .text("note", &format!("metres = value * scale; {note}"))?;
    Ok(d)
}

struct ImageDatasets {
    rgb: Chunked,
    depth: Option<Chunked>,
    ids: Chunked,
    /// Bytes of one id.
    id_bytes: usize,
}

impl ImageDatasets {
    fn create(
        group: &Group,
        format: Depth,
        count: usize,
        intrinsics: &v1::Intrinsics,
        id_bytes: usize,
    ) -> hdf5::Result<Self> {
        let (h, w) = (intrinsics.height as usize, intrinsics.width as usize);
        let rgb = rgb_dataset(group, count, [h, w])?;
        let shuffle = Filters::ShuffleDeflate;
        let depth = match format {
            Depth::Metres => {
                let d = Chunked::create::<f32>(group, "depth", count, &[h, w], 1, shuffle)?;
                describe(d.dataset(), "m")?;
                let note = "+inf where nothing is hit";
                Attributes::for_object(d.dataset())
                    .set("scale", 1.0)?
                    .text("note", note)?;
                Some(d)
            }
            Depth::Millimetres => {
                let note = MILLIMETRES_NOTE;
                Some(millimetres_dataset(group, count, [h, w], note)?)
            }
            Depth::Nothing => None,
        };
        let ids = match id_bytes {
            2 => Chunked::create::<u16>(group, "ids", count, &[h, w], 1, shuffle)?,
            _ => Chunked::create::<u8>(group, "ids", count, &[h, w], 1, Filters::Deflate)?,
        };
        describe(
            ids.dataset(),
            "1 (instance id, 0 where nothing is hit; /initial_state/instances)",
        )?;
        Ok(Self {
            rgb,
            depth,
            ids,
            id_bytes,
        })
    }
}

fn describe(data: &Dataset, units: &str) -> hdf5::Result<()> {
    Attributes::for_object(data).text("units", units)?.text(
        "frame",
        "row-major from the top left; depth along the optical axis",
    )?;
    Ok(())
}

/// Writes the unchanged messages of a stream that this version does not know.
pub(super) fn unknown(group: &Group, scan: &Scan, entries: &[&Entry]) -> Result<(), FinishError> {
    const MESSAGE: ColumnInfo = ColumnInfo {
        name: "message",
        unit: "protobuf bytes of package wheelarm.v1",
        frame: "",
        axes: &[],
        kind: Kind::Bytes,
    };
    let mut deflate = Deflate::default();
    let context = Context::default();
    let all = HEADER_COLUMNS.iter().chain([&MESSAGE]);
    let mut columns = create(group, all, &context, entries.len())?;
    let mut buffer = Vec::new();
    for entry in entries {
        let h = &entry.header;
        let message = Cell::Bytes(scan.payload(entry, &mut buffer)?.to_vec());
        let cells = header_cells(h.stamp_nanos, h.sequence, h.tick);
        for (column, cell) in columns.iter_mut().zip(cells.into_iter().chain([message])) {
            column.push(cell, &mut deflate)?;
        }
    }
    for column in columns {
        column.finish(&mut deflate)?;
    }
    Ok(())
}
