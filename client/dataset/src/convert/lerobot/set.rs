//! The set while it grows: its data files, tasks, episodes and statistics.

use std::collections::BTreeMap;
use std::path::PathBuf;

use super::layout::{FILE_BYTES, FOLDER_FILES, Layout};
use super::statistics::Gathered;
use super::table::{Column, Table};
use super::video_concat::{Place, VideoConcat};
use crate::convert::PendingFolder;
use crate::credits::PackCredits;

/// A data set while episodes are added.
pub(super) struct Set {
    /// Temporary folder.
    pub folder: PendingFolder,
    /// Images per second and cameras with their sizes; the first episode
    /// decides, the others must have the same.
    pub layout: Option<Layout>,
    /// The data file that is open.
    pub data: Option<Table>,
    /// Its number.
    pub file: usize,
    /// Videos, by feature.
    pub video_concats: BTreeMap<String, VideoConcat>,
    /// Videos that were begun.
    pub films: usize,
    /// Instructions in the order in which they first appeared.
    pub tasks: Vec<String>,
    /// Rows of `meta/episodes`.
    pub episodes: Vec<EpisodeRow>,
    /// Rows of all episodes.
    pub rows: usize,
    /// By feature, over all episodes.
    pub statistics: BTreeMap<String, Gathered>,
    /// Intrinsics of cameras for images of the set's size, with the episodes that
    /// have them: specimens of the robot differ.
    pub calibrations: Vec<(serde_json::Value, Vec<usize>)>,
    /// Authors and licenses of the world packs of all episodes.
    pub packs: Vec<PackCredits>,
}

/// One episode of the set.
pub(super) struct EpisodeRow {
    /// Its instruction.
    pub task: String,
    /// Its rows.
    pub length: usize,
    /// Number of its data file.
    pub file: usize,
    /// Rows of the set before it.
    pub from: usize,
    /// Label of the recording.
    pub label: String,
    /// Whether the task succeeded.
    pub success: bool,
    /// Its place in the videos, by feature.
    pub videos: BTreeMap<String, Place>,
    /// By feature.
    pub statistics: BTreeMap<String, Gathered>,
}

impl Set {
    /// An empty one.
    pub fn new(folder: PendingFolder) -> Self {
        Self {
            folder,
            layout: None,
            data: None,
            file: 0,
            video_concats: BTreeMap::new(),
            films: 0,
            tasks: Vec::new(),
            episodes: Vec::new(),
            rows: 0,
            statistics: BTreeMap::new(),
            calibrations: Vec::new(),
            packs: Vec::new(),
        }
    }

    /// Folder of videos until they are moved into the set.
    pub fn scratch(&self) -> PathBuf {
        self.folder.path().join(".films")
    }

    /// Index of a task, which is added when it is new.
    pub fn task(&mut self, instruction: &str) -> usize {
        let known = self.tasks.iter().position(|t| t == instruction);
        known.unwrap_or_else(|| {
            self.tasks.push(instruction.to_owned());
            self.tasks.len() - 1
        })
    }

    /// Appends rows to the open data file, or to a new one.
    pub fn append(&mut self, layout: &Layout, rows: Vec<Column>) -> anyhow::Result<()> {
        if let Some(table) = &mut self.data {
            return table.append(rows);
        }
        let (folder, file) = (self.file / FOLDER_FILES, self.file % FOLDER_FILES);
        let name = format!("data/chunk-{folder:03}/file-{file:03}.parquet");
        let footer = [("huggingface", layout.footer())];
        let table = Table::create(&self.folder.path().join(name), rows, &footer)?;
        self.data = Some(table);
        Ok(())
    }

    /// Adds an episode whose rows are appended.
    pub fn finish_episode(&mut self, episode: EpisodeRow) -> anyhow::Result<()> {
        for (name, values) in &episode.statistics {
            match self.statistics.get_mut(name) {
                Some(all) => all.merge(values),
                None => {
                    self.statistics.insert(name.clone(), values.clone());
                }
            }
        }
        self.rows += episode.length;
        self.episodes.push(episode);
        if self.data.as_ref().is_some_and(|t| t.bytes() > FILE_BYTES)
            && let Some(table) = self.data.take()
        {
            table.close()?;
            self.file += 1;
        }
        Ok(())
    }
}
