//! Labels in words and boxes: copies of recordings with the group `/labels`.

use std::fs::File;
use std::path::Path;

use anyhow::bail;
use wheelarm_dataset::annotate::{self, Annotations, State};
use wheelarm_dataset::convert::PendingFile;
use wheelarm_dataset::convert::batch::{each, failures};
use wheelarm_dataset::label;
use wheelarm_dataset::read::Episode;

use super::arguments::{FAILED, FINE, Input};
use super::files::{beside, jobs, options, recordings};

pub fn annotate(input: &Input, out: &Path) -> anyhow::Result<u8> {
    let (files, options) = (recordings(&input.files)?, options(input)?);
    let results = each(&files, jobs(&input.files), |_, file| {
        let episode = Episode::open(file)?;
        if episode.is_labelled() {
            bail!(
                "{} has the group /labels already; name the recording that it is a copy of, LABEL.h5",
                file.display()
            );
        }
        let summary = episode.summary()?;
        let start = summary.span_nanos.0;
        let found = label::segments(&episode)?;
        let phases = options.corrections.apply(&summary.label, start, found);
        let state = State::read(&episode)?;
        let labels = annotate::annotate(&episode, &state, &phases)?;
        let boxes = annotate::boxes(&episode, &state)?;
        let pending = PendingFile::new(&beside(file, Some(out), "labels.h5"))?;
        std::fs::copy(file, pending.path())?;
        annotate::write(pending.path(), &state, &labels, &boxes)?;
        let path = pending.commit()?;
        println!(
            "{}: {} phases, {} questions, {} contacts, {} grasps, boxes in {} cameras",
            path.display(),
            labels.subtasks.len(),
            labels.questions.len(),
            labels.contacts.len(),
            labels.grasps.len(),
            boxes.len()
        );
        Ok((summary.label, start, labels))
    });
    let mut table: Vec<(String, u64, Annotations)> = Vec::new();
    table.extend(
        results
            .iter()
            .filter_map(|(_, result)| result.as_ref().ok().cloned()),
    );
    if !table.is_empty() {
        let subtasks = PendingFile::new(&out.join("subtasks.csv"))?;
        annotate::write_subtasks(File::create_new(subtasks.path())?, &table)?;
        subtasks.commit()?;
        let questions = PendingFile::new(&out.join("questions.csv"))?;
        annotate::write_questions(File::create_new(questions.path())?, &table)?;
        questions.commit()?;
    }
    Ok(if failures(&results) { FAILED } else { FINE })
}
