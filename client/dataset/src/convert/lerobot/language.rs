//! LeRobot 0.6's language columns of an episode: a persistent annotation
//! (subtasks, the plan) is stored in every row of it, what happens at a time
//! (questions with answers, the way of the hand) in the row of that time.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use super::layout::{LANGUAGE, image_key};
use super::table::{Annotation, Cells, Column};
use crate::annotate::{self, State};
use crate::convert::learning::Learning;
use crate::convert::{Recording, Size};
use crate::label;

/// Language annotations of an episode.
pub(super) struct Spoken {
    persistent: Vec<Annotation>,
    events: Vec<Vec<Annotation>>,
}

impl Spoken {
    /// Annotations of the rows of `learning`, for images of these sizes.
    ///
    /// # Errors
    /// When the recording lacks the state that it is made of.
    pub fn read(
        recording: &Recording,
        learning: &Learning<'_>,
        cameras: &BTreeMap<String, Size>,
        rate: u32,
    ) -> anyhow::Result<Self> {
        let phases = label::runs(&recording.aligned.stamps, &recording.labels);
        let state = State::read(&recording.episode)?;
        let labels = annotate::annotate(&recording.episode, &state, &phases)?;
        let stamps: Vec<u64> = learning
            .rows
            .iter()
            .map(|&row| recording.aligned.stamps[row])
            .collect();
        let frame = |stamp: u64| stamps.partition_point(|&t| t < stamp);
        let seconds = |frame: usize| (frame as f64 / f64::from(rate)) as f32;
        let row = |role, style, content: String, timestamp, camera: Option<&String>| Annotation {
            role,
            content,
            style,
            timestamp,
            camera: camera.map(|camera| image_key(camera)),
        };
        let plan = labels.plan.iter().enumerate();
        let plan: Vec<String> = plan.map(|(i, step)| format!("{}. {step}", i + 1)).collect();
        let mut persistent = vec![row("assistant", "plan", plan.join("\n"), 0.0, None)];
        for subtask in &labels.subtasks {
            // What is trimmed away before the first row begins with it.
            let from = frame(subtask.from);
            if from < stamps.len() && frame(subtask.to) > 0 {
                let text = subtask.text.clone();
                persistent.push(row("assistant", "subtask", text, seconds(from), None));
            }
        }
        let mut events = vec![Vec::new(); stamps.len()];
        // LeRobot ties each question to a camera, so a question is exported with one whose
        // image shows what it is about; a question from memory would teach to invent.
        for question in &labels.questions {
            let exported = |camera: &&String| cameras.contains_key(*camera);
            let camera = question.cameras.iter().find(exported);
            if camera.is_none() {
                continue;
            }
            let at = frame(question.stamp);
            if question.stamp < stamps.first().copied().unwrap_or(0) {
                continue;
            }
            if let Some(event) = events.get_mut(at) {
                event.push(row("user", "vqa", question.question.clone(), 0.0, camera));
                event.push(row(
                    "assistant",
                    "vqa",
                    question.answer.clone(),
                    0.0,
                    camera,
                ));
            }
        }
        for trace in &labels.traces {
            let Some(size) = cameras.get(&trace.camera) else {
                continue;
            };
            for (frame, event) in events.iter_mut().enumerate() {
                let Some((source, index)) = recording.shown(&trace.camera, learning.rows[frame])?
                else {
                    continue;
                };
                let Some((width, height)) = source.size() else {
                    continue;
                };
                let scale = [
                    size.width as f64 / width as f64,
                    size.height as f64 / height as f64,
                ];
                let Some(pixels) = trace.pixels.get(index) else {
                    continue;
                };
                let (w, h) = (width as f64, height as f64);
                let inside = |p: &&[f64; 2]| (0.0..w).contains(&p[0]) && (0.0..h).contains(&p[1]);
                let points = pixels.iter().filter(inside);
                let points: Vec<Value> = points
                    .map(|p| json!([(p[0] * scale[0]).round(), (p[1] * scale[1]).round()]))
                    .collect();
                if !points.is_empty() {
                    let text = Value::Array(points).to_string();
                    event.push(row("assistant", "trace", text, 0.0, Some(&trace.camera)));
                }
            }
        }
        Ok(Self { persistent, events })
    }

    /// The columns of some rows.
    pub fn columns(&self, (first, count): (usize, usize)) -> Vec<Column> {
        let persistent = vec![self.persistent.clone(); count];
        let events = self.events[first..first + count].to_vec();
        let [always, at] = LANGUAGE.map(str::to_owned);
        vec![
            Column {
                name: always,
                cells: Cells::Annotation(persistent, true),
            },
            Column {
                name: at,
                cells: Cells::Annotation(events, false),
            },
        ]
    }
}
