//! The aligned file: rows instead of streams, with the images' chunks copied.

use hdf5::{Extent, Group, H5Type, SimpleExtents};

use super::{Aligned, Signal};
use crate::calibration::{CONVENTION, PIXEL_CENTRE};
use crate::hdf::{Attributes, Chunked, Filters, unicode};
use crate::read::{Camera, Episode, Summary, Values};

const ROWS: usize = 256;

/// Writes an aligned episode into a new file at `path`; images are copied
/// without being unpacked when `images` is set. `tick` is called for every
/// image.
///
/// # Errors
/// Those of HDF5 and of reading the recording.
pub fn write(
    path: &std::path::Path,
    episode: &Episode,
    aligned: &Aligned,
    labels: &[u8],
    images: bool,
    tick: &dyn Fn(),
) -> anyhow::Result<()> {
    let file = crate::hdf::unlocked().create_excl(path)?;
    let summary = episode.summary()?;
    root(&file, episode, aligned, &summary)?;
    let rows = aligned.stamps.len();
    numbers(&file, "stamp_nanos", &aligned.stamps, rows, &[])?;
    described(&file, "stamp_nanos", "ns of simulation time", "")?;
    let start = aligned.stamps.first().copied().unwrap_or(0);
    let time: Vec<f64> = aligned
        .stamps
        .iter()
        .map(|s| (s - start) as f64 * 1e-9)
        .collect();
    numbers(&file, "time", &time, rows, &[])?;
    described(&file, "time", "s since the first row", "")?;
    numbers(&file, "label", labels, rows, &[])?;
    described(
        &file,
        "label",
        "1 (0 navigating, 1 reaching, 2 grasping, 3 retracting)",
        "",
    )?;

    let streams = file.create_group("streams")?;
    for (name, coverage) in &aligned.coverage {
        let group = streams.create_group(name)?;
        Attributes::for_object(&group)
            .set("age_limit_seconds", coverage.limit as f64 * 1e-9)?
            .set("samples", coverage.samples as u64)?;
        let valid: Vec<u8> = coverage.valid.iter().map(|&v| u8::from(v)).collect();
        numbers(&group, "valid", &valid, rows, &[])?;
        described(
            &group,
            "valid",
            "1 (0: no samples near enough on both sides)",
            "",
        )?;
        numbers(&group, "age_nanos", &coverage.age, rows, &[])?;
        described(&group, "age_nanos", "ns to the nearest sample", "")?;
    }
    for signal in &aligned.signals {
        column(&streams.group(&signal.meta.stream)?, signal)?;
    }

    let cameras = streams.create_group("camera")?;
    for (name, frames) in &aligned.frames {
        let camera = episode.camera(name)?;
        let group = cameras.create_group(name)?;
        camera_columns(&group, &camera, frames)?;
        if images {
            copy_images(&group, &camera, frames, tick)?;
        }
    }
    if !aligned.sensors.is_empty() {
        let sensors = streams.create_group("sensor")?;
        for (name, frames) in &aligned.sensors {
            let sensor = episode.sensor(name)?;
            let group = sensors.create_group(name)?;
            camera_columns(&group, &sensor, frames)?;
            exposures(&group, &sensor, frames)?;
            if images {
                copy_images(&group, &sensor, frames, &|| {})?;
            }
        }
    }
    file.flush()?;
    Ok(())
}

/// Exposure times of the rows' images.
fn exposures(group: &Group, sensor: &Camera, frames: &[Option<usize>]) -> anyhow::Result<()> {
    let all = sensor.exposures();
    let of = |frame: &Option<usize>| frame.and_then(|i| all.get(i).copied()).unwrap_or(0);
    let rows: Vec<u64> = frames.iter().map(of).collect();
    numbers(group, "exposure_nanos", &rows, rows.len(), &[])?;
    described(
        group,
        "exposure_nanos",
        "ns of simulation time (0: no image)",
        "",
    )?;
    Ok(())
}

fn root(
    file: &hdf5::File,
    episode: &Episode,
    aligned: &Aligned,
    summary: &Summary,
) -> anyhow::Result<()> {
    let source = episode.path().file_name().unwrap_or_default();
    let [task, activity, area] = &summary.task;
    Attributes::for_object(file)
        .text("format", "wheelarm aligned episode")?
        .text("schema_version", wheelarm_proto::SCHEMA_VERSION)?
        .text("source", &source.to_string_lossy())?
        .text("reference", &aligned.reference)?
        .text("label", &summary.label)?
        .text("instruction", &summary.instruction)?
        .text("task", task)?
        .text("activity", activity)?
        .text("area", area)?
        .set("seed", summary.seed)?
        .set("success", summary.success)?
        .text("failure_reason", &summary.failure_reason)?
        .set("complete", summary.complete)?;
    Ok(())
}

fn described(group: &Group, name: &str, units: &str, frame: &str) -> hdf5::Result<()> {
    let data = group.dataset(name)?;
    Attributes::for_object(&data)
        .text("units", units)?
        .text("frame", frame)?;
    Ok(())
}

fn numbers<T: H5Type>(
    group: &Group,
    name: &str,
    all: &[T],
    rows: usize,
    shape: &[usize],
) -> hdf5::Result<()> {
    let extents =
        std::iter::once(Extent::fixed(rows)).chain(shape.iter().map(|&n| Extent::fixed(n)));
    let chunk: Vec<usize> = std::iter::once(ROWS.min(rows).max(1))
        .chain(shape.iter().copied())
        .collect();
    let data = group
        .new_dataset::<T>()
        .chunk(chunk)
        .shuffle()
        .deflate(crate::compress::LEVEL)
        .shape(SimpleExtents::new(extents))
        .create(name)?;
    if all.is_empty() {
        Ok(())
    } else {
        data.write_raw(all)
    }
}

fn column(group: &Group, signal: &Signal) -> hdf5::Result<()> {
    let meta = &signal.meta;
    let (name, rows, shape) = (meta.name.as_str(), meta.count, meta.shape.as_slice());
    match &signal.values {
        Values::F64(all) => numbers(group, name, all, rows, shape)?,
        Values::U64(all) => numbers(group, name, all, rows, shape)?,
        Values::Flag(all) => numbers(group, name, all, rows, shape)?,
        Values::Text(all) => {
            let all: Vec<_> = all.iter().map(|t| unicode(t)).collect();
            let data = group
                .new_dataset::<hdf5::types::VarLenUnicode>()
                .shape([rows])
                .create(name)?;
            data.write_raw(&all)?;
        }
    }
    let data = group.dataset(name)?;
    let attributes = Attributes::for_object(&data);
    attributes
        .text("units", &meta.units)?
        .text("frame", &meta.frame)?
        .text("interpolation", signal.how())?;
    if !meta.names.is_empty() {
        attributes.texts("names", &meta.names)?;
    }
    if !meta.components.is_empty() {
        attributes.texts("components", &meta.components)?;
    }
    Ok(())
}

fn camera_columns(group: &Group, camera: &Camera, frames: &[Option<usize>]) -> hdf5::Result<()> {
    let rows = frames.len();
    let stamps: Vec<u64> = frames
        .iter()
        .map(|f| f.map_or(0, |i| camera.stamps()[i]))
        .collect();
    let valid: Vec<u8> = frames.iter().map(|f| u8::from(f.is_some())).collect();
    let pose: Vec<f64> = frames
        .iter()
        .flat_map(|f| f.map_or([f64::NAN; 7], |i| camera.pose(i)))
        .collect();
    let intrinsics: Vec<f64> = frames
        .iter()
        .flat_map(|f| f.map_or([f64::NAN; 6], |i| camera.intrinsics(i)))
        .collect();
    numbers(group, "stamp_nanos", &stamps, rows, &[])?;
    described(
        group,
        "stamp_nanos",
        "ns of simulation time of the image",
        "",
    )?;
    numbers(group, "valid", &valid, rows, &[])?;
    described(group, "valid", "1 (0: no image near enough)", "")?;
    numbers(group, "pose", &pose, rows, &[7])?;
    let frame = "optical frame (z forward, x right, y down) in house";
    described(
        group,
        "pose",
        "m (x y z), 1 (unit quaternion x y z w)",
        frame,
    )?;
    numbers(group, "intrinsics", &intrinsics, rows, &[6])?;
    described(
        group,
        "intrinsics",
        "pixels (width, height, fx, fy, cx, cy)",
        "image, from its left and top edge",
    )?;
    let data = group.dataset("intrinsics")?;
    Attributes::for_object(&data)
        .set("pixel_centre", PIXEL_CENTRE)?
        .text("convention", CONVENTION)?;
    Ok(())
}

/// Copies compressed images; rows without one read as zeros.
fn copy_images(
    group: &Group,
    camera: &Camera,
    frames: &[Option<usize>],
    tick: &dyn Fn(),
) -> anyhow::Result<()> {
    for (name, data, chunks) in camera.image_chunks() {
        let shape = data.shape();
        let trailing = shape.get(1..).unwrap_or_default();
        let shuffled = data.filters().contains(&hdf5::filters::Filter::Shuffle);
        let filters = if shuffled {
            Filters::ShuffleDeflate
        } else {
            Filters::Deflate
        };
        let rows = frames.len();
        let copy = match data.dtype()?.size() {
            4 => Chunked::create::<f32>(group, name, rows, trailing, 1, filters)?,
            2 => Chunked::create::<u16>(group, name, rows, trailing, 1, filters)?,
            _ => Chunked::create::<u8>(group, name, rows, trailing, 1, filters)?,
        };
        for attribute in ["units", "frame", "note", "scale"] {
            if let Ok(text) = data
                .attr(attribute)
                .and_then(|a| a.read_scalar::<hdf5::types::VarLenUnicode>())
            {
                Attributes::for_object(copy.dataset()).text(attribute, text.as_str())?;
            }
        }
        for (row, frame) in frames.iter().enumerate() {
            if let Some(index) = frame {
                copy.write(row, &chunks.raw(*index)?)?;
            }
            if name == "rgb" {
                tick();
            }
        }
    }
    Ok(())
}
