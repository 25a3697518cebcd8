//! The end of one episode of each task in one picture: as the chair's camera
//! sees it and, small in a corner, as the hand's camera does. The episode is
//! done once more for it, with the cameras on: the same bits again.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use anyhow::Context;
use parking_lot::Mutex;
use wheelarm_dataset::sheet::grid::{Cell, grid};
use wheelarm_proto::v1;
use wheelarm_rollout::launcher::all_cameras;
use wheelarm_rollout::{Backend, Driver, Expert, Limits, Observer, Processes, Rollout};
use wheelarm_sdk::{Camera, Client, Frame};

use super::args::EvaluateArgs;
use super::entry::{Entry, Job};
use super::report::Report;
use super::scope::Scope;

/// Width and height of the larger picture, pixels.
const SIZE: [u32; 2] = [480, 270];
/// So many times smaller is the picture in the corner.
const SMALLER: usize = 3;
/// Pictures in one row.
const COLUMNS: usize = 4;
/// Longest wait for a picture that has been sent.
const PICTURE: Duration = Duration::from_secs(5);

/// Draws the grid; its path.
///
/// # Errors
/// When a program does not start or the picture cannot be written.
pub fn draw(
    args: &EvaluateArgs,
    scope: &Scope,
    report: &Report,
    entries: &[Entry],
) -> anyhow::Result<PathBuf> {
    let mut cells = Vec::new();
    for task in &report.tasks {
        let own = || {
            let own = entries.iter().filter(|entry| entry.task == task.task);
            own.filter(|entry| entry.broken.is_none())
        };
        // A success shows best what the task is.
        let Some(entry) = own().find(|entry| entry.success).or_else(|| own().next()) else {
            continue;
        };
        let job = Job {
            task: entry.task.clone(),
            seed: entry.seed,
            variation: scope.variation.clone(),
            policy: entry.policy.clone(),
            policy_files: entry.policy_files.clone(),
        };
        let [mut large, small] = last_pictures(args, &job)?;
        large.inset(&small.smaller(SMALLER));
        cells.push(Cell {
            width: large.width,
            height: large.height,
            rgb: large.rgb,
            title: task.task.clone(),
            note: match task.successes {
                0 => format!("0 of {}", task.episodes),
                good => format!("{good} of {}, {:.0} s", task.episodes, task.mean_seconds),
            },
            is_good: task.successes == task.episodes,
        });
    }
    let path = args.out.join("grid.png");
    grid(&cells, COLUMNS, &path)?;
    Ok(path)
}

/// A picture: RGB8, row-major from the top left.
#[derive(Clone, Debug, PartialEq)]
struct Picture {
    width: usize,
    height: usize,
    rgb: Vec<u8>,
}

impl From<Frame> for Picture {
    fn from(frame: Frame) -> Self {
        Self {
            width: frame.intrinsics.width as usize,
            height: frame.intrinsics.height as usize,
            rgb: frame.color.to_vec(),
        }
    }
}

impl Picture {
    /// A picture `times` smaller: each pixel is the mean of as many squared.
    fn smaller(&self, times: usize) -> Self {
        let (width, height) = (self.width / times, self.height / times);
        let mean = |row: usize, column: usize, colour: usize| {
            let pixels = (0..times * times).map(|i| {
                let (down, right) = (row * times + i / times, column * times + i % times);
                usize::from(self.rgb[3 * (down * self.width + right) + colour])
            });
            u8::try_from(pixels.sum::<usize>() / (times * times)).unwrap_or(u8::MAX)
        };
        let rgb = (0..3 * height * width).map(|i| mean(i / 3 / width, i / 3 % width, i % 3));
        Self {
            width,
            height,
            rgb: rgb.collect(),
        }
    }

    /// Puts a small picture into the lower right corner; one that does not fit
    /// is left out.
    fn inset(&mut self, small: &Self) {
        let (Some(left), Some(top)) = (
            self.width.checked_sub(small.width),
            self.height.checked_sub(small.height),
        ) else {
            return;
        };
        for (row, line) in small.rgb.chunks_exact(3 * small.width.max(1)).enumerate() {
            let to = 3 * ((top + row) * self.width + left);
            self.rgb[to..to + line.len()].copy_from_slice(line);
        }
    }
}

/// Names of the first camera on the chair and the first on the arm.
fn cameras(robot: &v1::RobotDescription) -> anyhow::Result<[&str; 2]> {
    let first = |mount: v1::CameraMount| {
        let camera = robot.cameras.iter().find(|camera| camera.mount() == mount);
        camera.map(|camera| camera.name.as_str())
    };
    let chair = first(v1::CameraMount::Chair).context("the robot has no camera on the chair")?;
    let arm = first(v1::CameraMount::Arm).context("the robot has no camera on the arm")?;
    Ok([chair, arm])
}

/// Keeps the newest images of the chair's and the arm's camera.
#[derive(Default)]
struct LastImages {
    cameras: Mutex<Vec<(String, Camera)>>,
    images: Mutex<Vec<anyhow::Result<Picture>>>,
}

impl Observer for LastImages {
    fn attach(&self, link: &Client) -> anyhow::Result<()> {
        let robot = link
            .request(&v1::SceneRequest {})?
            .robot
            .unwrap_or_default();
        for name in cameras(&robot)? {
            let camera = link.camera(name, 1)?;
            self.cameras.lock().push((name.to_owned(), camera));
        }
        Ok(())
    }

    fn detach(&self) {
        let cameras = std::mem::take(&mut *self.cameras.lock());
        let last = cameras.into_iter().map(|(name, camera)| {
            let frame = camera.next(PICTURE)?;
            let frame = frame.with_context(|| format!("the camera {name} sent no picture"))?;
            Ok(Picture::from(frame))
        });
        *self.images.lock() = last.collect();
    }
}

/// The last pictures of an episode.
fn last_pictures(args: &EvaluateArgs, job: &Job) -> anyhow::Result<[Picture; 2]> {
    let cameras_on = vec![all_cameras(SIZE[0], SIZE[1], 1.0)];
    let last = Arc::new(LastImages::default());
    let rollout = Rollout {
        scenario: args.scenario(Some(job), cameras_on),
        label: job.label(),
        driver: Driver::Expert(Expert {
            forced: job.variation.forced(job.seed),
            ..Expert::default()
        }),
        record: None,
        limits: Limits::default(),
        folder: None,
        observer: last.clone(),
    };
    let backend = Processes::new(args.assets.clone(), args.graphics.adapter.clone());
    let result = backend.run(&rollout).and_then(|result| Ok(result?));
    result.with_context(|| format!("{} seed {}", job.task, job.seed))?;
    let mut images = std::mem::take(&mut *last.images.lock()).into_iter();
    let mut next = || images.next().context("the episode sent no pictures")?;
    Ok([next()?, next()?])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_smaller_picture_is_the_mean_of_its_pixels() {
        let picture = Picture {
            width: 5,
            height: 2,
            rgb: (0..30).map(|i| if i % 3 == 0 { i } else { 7 }).collect(),
        };
        let small = picture.smaller(2);
        assert_eq!((small.width, small.height), (2, 1));
        assert_eq!(small.rgb, [9, 7, 7, 15, 7, 7]);
    }

    #[test]
    fn the_small_picture_stands_in_the_lower_right_corner() {
        let picture = |width: usize, height: usize, value: u8| Picture {
            width,
            height,
            rgb: vec![value; 3 * width * height],
        };
        let mut large = picture(4, 3, 1);
        large.inset(&picture(2, 1, 9));
        assert_eq!(large.rgb[..30], [1; 30]);
        assert_eq!(large.rgb[30..], [9; 6]);
        let mut tiny = picture(2, 1, 1);
        tiny.inset(&picture(4, 3, 9));
        assert_eq!(tiny, picture(2, 1, 1), "one that does not fit is left out");
    }
}
