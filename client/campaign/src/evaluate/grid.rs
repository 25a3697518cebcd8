//! One image with the end of one episode of each task: the image of the chair's camera with
//! that of the hand's camera in its corner. The episode is repeated with the cameras on,
//! which reproduces it bit for bit.

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

/// Width and height of the larger image, pixels.
const SIZE: [u32; 2] = [480, 270];
/// Factor by which the image in the corner is smaller.
const SMALLER: usize = 3;
/// Images per row.
const COLUMNS: usize = 4;
/// Longest wait for an image that was sent.
const IMAGE_PATIENCE: Duration = Duration::from_secs(5);

/// Writes the grid. Returns its path.
///
/// # Errors
/// When a program does not start or the image cannot be written.
pub fn write(
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
        // A success shows the task best.
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
        let [mut large, small] = last_images(args, &job)?;
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

/// An image: RGB8, row-major from the top left.
#[derive(Clone, Debug, PartialEq)]
struct RgbImage {
    width: usize,
    height: usize,
    rgb: Vec<u8>,
}

impl From<Frame> for RgbImage {
    fn from(frame: Frame) -> Self {
        Self {
            width: frame.intrinsics.width as usize,
            height: frame.intrinsics.height as usize,
            rgb: frame.color.to_vec(),
        }
    }
}

impl RgbImage {
    /// An image `times` smaller: each pixel is the mean of `times` squared pixels.
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

    /// Copies a small image into the lower right corner; ignores one that does not fit.
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
    images: Mutex<Vec<anyhow::Result<RgbImage>>>,
}

impl Observer for LastImages {
    fn attach(&self, client: &Client) -> anyhow::Result<()> {
        let robot = client
            .request(&v1::SceneRequest {})?
            .robot
            .unwrap_or_default();
        for name in cameras(&robot)? {
            let camera = client.camera(name, 1)?;
            self.cameras.lock().push((name.to_owned(), camera));
        }
        Ok(())
    }

    fn detach(&self) {
        let cameras = std::mem::take(&mut *self.cameras.lock());
        let last = cameras.into_iter().map(|(name, camera)| {
            let frame = camera.next(IMAGE_PATIENCE)?;
            let frame = frame.with_context(|| format!("the camera {name} sent no image"))?;
            Ok(RgbImage::from(frame))
        });
        *self.images.lock() = last.collect();
    }
}

/// The last images of an episode.
fn last_images(args: &EvaluateArgs, job: &Job) -> anyhow::Result<[RgbImage; 2]> {
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
    let backend =
        Processes::new(args.assets.clone(), args.graphics.first()).with_packs(&args.packs.packs);
    let result = backend.run(&rollout).and_then(|result| Ok(result?));
    result.with_context(|| format!("{} seed {}", job.task, job.seed))?;
    let mut images = std::mem::take(&mut *last.images.lock()).into_iter();
    let mut next = || images.next().context("the episode sent no images")?;
    Ok([next()?, next()?])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scaled_image_is_the_mean_of_its_pixels() {
        let image = RgbImage {
            width: 5,
            height: 2,
            rgb: (0..30).map(|i| if i % 3 == 0 { i } else { 7 }).collect(),
        };
        let small = image.smaller(2);
        assert_eq!((small.width, small.height), (2, 1));
        assert_eq!(small.rgb, [9, 7, 7, 15, 7, 7]);
    }

    #[test]
    fn small_image_is_copied_into_the_lower_right_corner() {
        let image = |width: usize, height: usize, value: u8| RgbImage {
            width,
            height,
            rgb: vec![value; 3 * width * height],
        };
        let mut large = image(4, 3, 1);
        large.inset(&image(2, 1, 9));
        assert_eq!(large.rgb[..30], [1; 30]);
        assert_eq!(large.rgb[30..], [9; 6]);
        let mut tiny = image(2, 1, 1);
        tiny.inset(&image(4, 3, 9));
        assert_eq!(tiny, image(2, 1, 1), "one that does not fit is ignored");
    }
}
