//! Labels as text and boxes: copies of recordings with the group `/labels`.

use std::path::Path;

use anyhow::bail;
use wheelarm_dataset::annotate::{self, Annotations, State};
use wheelarm_dataset::convert::batch::{self, each, failures};
use wheelarm_dataset::convert::{AlreadyThere, PendingFile, hold};
use wheelarm_dataset::label;
use wheelarm_dataset::read::Episode;

use super::arguments::{FAILED, FINE, Input};
use super::files::{beside, jobs, options, recordings};

pub fn annotate(input: &Input, out: &Path) -> anyhow::Result<u8> {
    let files = recordings(&input.files)?;
    let options = options(input, &files)?;
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
        let entry = (summary.label, start, labels.clone());
        let pending = match PendingFile::new(&beside(file, Some(out), "labels.h5")) {
            Ok(pending) => pending,
            Err(problem) => {
                let there = matches!(
                    problem.downcast_ref(),
                    Some(AlreadyThere::Before(_) | AlreadyThere::Again(_))
                );
                // The tables contain it anyway.
                return if there {
                    Ok((entry, Err(problem)))
                } else {
                    Err(problem)
                };
            }
        };
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
        Ok((entry, Ok(())))
    });
    let mut table: Vec<(String, u64, Annotations)> = Vec::new();
    let mut written = batch::Results::new();
    for (file, result) in results {
        let (entry, result) = match result {
            Ok((entry, result)) => (Some(entry), result),
            Err(problem) => (None, Err(problem)),
        };
        table.extend(entry);
        written.push((file, result));
    }
    let several = written.len() + input.files.left_out.len() > 1;
    let mut failed = failures(&written, several);
    if !table.is_empty() {
        let mut subtasks = Vec::new();
        annotate::write_subtasks(&mut subtasks, &table)?;
        let mut questions = Vec::new();
        annotate::write_questions(&mut questions, &table)?;
        for (name, text) in [("subtasks.csv", subtasks), ("questions.csv", questions)] {
            if let Err(problem) = hold(&out.join(name), &text) {
                eprintln!("{problem:#}");
                failed = true;
            }
        }
    }
    Ok(if failed { FAILED } else { FINE })
}
