//! The videos of one feature while the set grows: an episode each, joined without
//! coding them again once they are as large as a file is meant to be.

use std::path::Path;

use super::layout::{FOLDER_FILES, VIDEO_BYTES};
use super::video::Ffmpeg;
use crate::publish;

/// Place of an episode in the videos of a feature.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    /// Number of the video.
    pub file: usize,
    /// Frames before it there.
    pub from: usize,
}

/// Videos of a feature.
#[derive(Debug, Default)]
pub(super) struct VideoConcat {
    /// Name and frames of the episodes that are not in a video of the set yet.
    parts: Vec<(String, usize)>,
    bytes: u64,
    frames: usize,
    file: usize,
}

impl VideoConcat {
    /// Adds an episode's video, a file of the scratch folder.
    pub fn add(&mut self, name: String, frames: usize, bytes: u64) -> Place {
        let place = Place {
            file: self.file,
            from: self.frames,
        };
        self.parts.push((name, frames));
        self.frames += frames;
        self.bytes += bytes;
        place
    }

    /// Whether the video is as large as one is meant to be.
    pub fn is_full(&self) -> bool {
        self.bytes > VIDEO_BYTES
    }

    /// Writes the videos added since the last call into a video of the set.
    ///
    /// # Errors
    /// When it cannot be joined or written.
    pub fn close(
        &mut self,
        ffmpeg: &Ffmpeg,
        scratch: &Path,
        set: &Path,
        key: &str,
        rate: u32,
    ) -> anyhow::Result<()> {
        let (folder, number) = (self.file / FOLDER_FILES, self.file % FOLDER_FILES);
        let to = set.join(format!(
            "videos/{key}/chunk-{folder:03}/file-{number:03}.mp4"
        ));
        if let Some(folder) = to.parent() {
            std::fs::create_dir_all(folder)?;
        }
        let parts = std::mem::take(&mut self.parts);
        match parts.as_slice() {
            [] => return Ok(()),
            [(one, frames)] => {
                std::fs::rename(scratch.join(one), &to)?;
                ffmpeg.check(&to, *frames, rate)?;
            }
            all => {
                ffmpeg.join(scratch, all, rate, &to)?;
                for (name, _) in all {
                    std::fs::remove_file(scratch.join(name))?;
                }
            }
        }
        publish::sync_file(&std::fs::File::open(&to)?)?;
        *self = Self {
            file: self.file + 1,
            ..Self::default()
        };
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn episodes_are_concatenated_until_a_video_is_full() {
        let mut videos_of_feature = VideoConcat::default();
        assert_eq!(
            videos_of_feature.add("a".into(), 7, 10),
            Place { file: 0, from: 0 }
        );
        assert!(!videos_of_feature.is_full());
        let second = videos_of_feature.add("b".into(), 5, VIDEO_BYTES);
        assert_eq!(second, Place { file: 0, from: 7 });
        assert!(videos_of_feature.is_full());
    }
}
