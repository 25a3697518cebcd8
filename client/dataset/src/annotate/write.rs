//! Labels in an episode file: the group `/labels`.

use std::path::Path;

use hdf5::{Group, H5Type};
use wheelarm_language::space;

use super::boxes::CameraBoxes;
use super::contacts::Interval;
use super::labels::Annotations;
use super::questions::{KINDS, Question};
use super::shapes;
use super::state::{HELD, OPEN, OPEN_TURN, State};
use super::subtasks::Subtask;
use super::trace::STEPS;
use crate::hdf::{Attributes, texts};
use crate::ids::VISIBLE_PIXELS;

/// Layout of the group.
const VERSION: u64 = 2;

/// Adds the group `/labels` to a copy of the recording at `path`.
///
/// # Errors
/// Those of HDF5, and when the file has labels already.
pub fn write(
    path: &Path,
    state: &State,
    labels: &Annotations,
    boxes: &[CameraBoxes],
) -> hdf5::Result<()> {
    let file = crate::hdf::unlocked().open_rw(path)?;
    let group = file.create_group("labels")?;
    Attributes::for_object(&group)
        .set("version", VERSION)?
        .set("held_newton", HELD)?
        .set("open_metres", OPEN)?
        .set("open_radians", OPEN_TURN)?
        .set("side_step_metres", space::STEP)?
        .set("visible_pixels", VISIBLE_PIXELS as u64)?
        .text(
            "definitions",
            "left, right, front and behind: of who sits in the chair while it stands at the area and looks \
             at it; held: both finger tips press it with held_newton or more; within reach: the origin lies \
             within the outer radius of robot.toml's reach; open: the joint stands at open_metres (open_radians of what turns) or more; \
             visible share: pixels of the object's id over those of the union of the hulls of its projected \
             parts; cameras of a question: those whose images at its time show what question and answer are \
             about with at least visible_pixels pixels each, none for a question from memory",
        )?;
    phases(&group.create_group("phases")?, labels)?;
    texts(&group, "plan", &labels.plan)?;
    questions(&group.create_group("questions")?, labels)?;
    contacts(&group.create_group("contacts")?, labels)?;
    grasps(&group.create_group("grasps")?, labels)?;
    objects(&group.create_group("objects")?, state)?;
    let traces = group.create_group("trace")?;
    for trace in &labels.traces {
        let flat: Vec<f64> = trace.pixels.iter().flatten().flatten().copied().collect();
        array(
            &traces,
            &trace.camera,
            &flat,
            &[trace.pixels.len(), STEPS, 2],
            "pixels (column, row)",
        )?;
    }
    let places = group.create_group("boxes")?;
    for found in boxes {
        camera_boxes(
            &places.create_group(&found.camera)?,
            found,
            state.objects.len(),
        )?;
    }
    Ok(())
}

fn array<T: H5Type>(
    group: &Group,
    name: &str,
    values: &[T],
    shape: &[usize],
    unit: &str,
) -> hdf5::Result<()> {
    let data = group.new_dataset::<T>().shape(shape).create(name)?;
    if !values.is_empty() {
        data.write_raw(values)?;
    }
    Attributes::for_object(&data).text("units", unit)?;
    Ok(())
}

fn column<T: H5Type>(group: &Group, name: &str, values: &[T], unit: &str) -> hdf5::Result<()> {
    array(group, name, values, &[values.len()], unit)
}

const NANOS: &str = "ns of simulation time";

fn phases(group: &Group, labels: &Annotations) -> hdf5::Result<()> {
    let all = &labels.subtasks;
    let stamps = |f: fn(&Subtask) -> u64| all.iter().map(f).collect::<Vec<_>>();
    column(group, "from_nanos", &stamps(|s| s.from), NANOS)?;
    column(group, "to_nanos", &stamps(|s| s.to), NANOS)?;
    column(
        group,
        "label",
        &stamps(|s| u64::from(s.label)),
        "1 (0 navigating to 3 retracting)",
    )?;
    let words = |f: fn(&Subtask) -> &str| all.iter().map(f).collect::<Vec<_>>();
    texts(group, "subtask", &words(|s| &s.text))?;
    texts(group, "object", &words(|s| &s.object))?;
    texts(group, "place", &words(|s| &s.place))?;
    texts(group, "held", &words(|s| &s.held))
}

fn questions(group: &Group, labels: &Annotations) -> hdf5::Result<()> {
    let all = &labels.questions;
    Attributes::for_object(group).texts("kinds", &KINDS)?;
    let numbers = |f: fn(&Question) -> u64| all.iter().map(f).collect::<Vec<_>>();
    column(group, "stamp_nanos", &numbers(|q| q.stamp), NANOS)?;
    column(group, "tick", &numbers(|q| q.tick), "ticks of 1/240 s")?;
    column(
        group,
        "kind",
        &numbers(|q| q.kind as u64),
        "1 (place in the attribute kinds)",
    )?;
    let words = |f: fn(&Question) -> String| all.iter().map(f).collect::<Vec<_>>();
    texts(group, "question", &words(|q| q.question.clone()))?;
    texts(group, "answer", &words(|q| q.answer.clone()))?;
    texts(group, "arguments", &words(|q| q.arguments.to_string()))?;
    texts(group, "value", &words(|q| q.value.to_string()))?;
    texts(group, "cameras", &words(|q| q.cameras.join(" ")))
}

fn contacts(group: &Group, labels: &Annotations) -> hdf5::Result<()> {
    let all = &labels.contacts;
    let stamps = |f: fn(&Interval) -> u64| all.iter().map(f).collect::<Vec<_>>();
    column(group, "from_nanos", &stamps(|c| c.from), NANOS)?;
    column(group, "to_nanos", &stamps(|c| c.to), NANOS)?;
    let peaks: Vec<f64> = all.iter().map(|c| c.peak).collect();
    column(group, "peak_force", &peaks, "N")?;
    for (i, name) in ["first", "second"].into_iter().enumerate() {
        let bodies: Vec<&str> = all.iter().map(|c| c.bodies[i].as_str()).collect();
        texts(group, name, &bodies)?;
    }
    Ok(())
}

fn grasps(group: &Group, labels: &Annotations) -> hdf5::Result<()> {
    let all = &labels.grasps;
    Attributes::for_object(group).text(
        "source",
        "nearest grasp of the object's file when it began to be held; no operator publishes its choice",
    )?;
    column(
        group,
        "stamp_nanos",
        &all.iter().map(|g| g.stamp).collect::<Vec<_>>(),
        NANOS,
    )?;
    column(
        group,
        "index",
        &all.iter().map(|g| g.index as u64).collect::<Vec<_>>(),
        "1 (place in the object's file)",
    )?;
    column(
        group,
        "distance",
        &all.iter().map(|g| g.distance).collect::<Vec<_>>(),
        "m",
    )?;
    column(
        group,
        "angle",
        &all.iter().map(|g| g.angle).collect::<Vec<_>>(),
        "rad",
    )?;
    texts(
        group,
        "object",
        &all.iter().map(|g| g.object.as_str()).collect::<Vec<_>>(),
    )?;
    texts(
        group,
        "name",
        &all.iter().map(|g| g.name.as_str()).collect::<Vec<_>>(),
    )?;
    let others = all.iter().map(|g| format!("{:?}", g.alternatives));
    texts(group, "alternatives", &others.collect::<Vec<_>>())
}

fn objects(group: &Group, state: &State) -> hdf5::Result<()> {
    texts(group, "name", &state.objects)?;
    let extents = state.objects.iter().map(|name| {
        let bounds = shapes::bounds(&shapes::parts(state, name));
        bounds.unwrap_or([[f64::NAN; 3]; 2])
    });
    let flat: Vec<f64> = extents.flatten().flatten().collect();
    array(
        group,
        "box",
        &flat,
        &[state.objects.len(), 2, 3],
        "m (least and greatest corner in the object's frame)",
    )
}

fn camera_boxes(group: &Group, found: &CameraBoxes, objects: usize) -> hdf5::Result<()> {
    let images = found.share.len() / objects.max(1);
    let corners = "pixels (left, top, right, bottom)";
    let flat = |all: &[[f64; 4]]| all.iter().flatten().copied().collect::<Vec<_>>();
    array(
        group,
        "visible",
        &flat(&found.visible),
        &[images, objects, 4],
        corners,
    )?;
    array(
        group,
        "projected",
        &flat(&found.projected),
        &[images, objects, 4],
        corners,
    )?;
    array(
        group,
        "visible_share",
        &found.share,
        &[images, objects],
        "1",
    )
}
