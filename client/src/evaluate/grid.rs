//! The end of one episode of each task in one picture: as the chair's camera
//! sees it and, small in a corner, as the hand's camera does. The episode is
//! done once more for it, with the cameras on: the same bits again.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use anyhow::Context;
use wheelarm_dataset::sheet::grid::{Cell, grid};
use wheelarm_proto::{Message, v1};
use zenoh::bytes::ZBytes;

use super::report::Report;
use super::{Entry, EvaluateArgs, Job};
use wheelarm_operate::run::{self as operate, OperateOptions};
use wheelarm_rig::local::LocalServer;

/// Setting of all cameras; the smaller picture is made smaller by [`SMALLER`].
const CAMERAS: &str = "*=480x270@1";
/// So many times smaller is the picture in the corner.
const SMALLER: usize = 3;
/// Pictures in one row.
const COLUMNS: usize = 4;

/// Draws the grid; its path.
///
/// # Errors
/// When a program does not start or the picture cannot be written.
pub fn draw(args: &EvaluateArgs, report: &Report, entries: &[Entry]) -> anyhow::Result<PathBuf> {
    let mut cells = Vec::new();
    for task in &report.tasks {
        let own = || {
            let own = entries.iter().filter(|entry| entry.task == task.task);
            own.filter(|entry| entry.broken.is_empty())
        };
        // A success shows best what the task is.
        let Some(entry) = own().find(|entry| entry.success).or_else(|| own().next()) else {
            continue;
        };
        let job = Job {
            task: entry.task.clone(),
            seed: entry.seed,
        };
        let [large, small] = last_frames(args, &job)?;
        let (width, height) = size(&large);
        cells.push(Cell {
            width,
            height,
            rgb: inset(&large, &small),
            title: task.task.clone(),
            note: format!(
                "{} of {}, {:.0} s",
                task.successes, task.episodes, task.mean_seconds
            ),
            is_good: task.successes == task.episodes,
        });
    }
    let path = args.out.join("grid.png");
    grid(&cells, COLUMNS, &path)?;
    Ok(path)
}

fn size(frame: &v1::CameraFrame) -> (usize, usize) {
    let intrinsics = frame.intrinsics.unwrap_or_default();
    (intrinsics.width as usize, intrinsics.height as usize)
}

/// A picture `times` smaller: each pixel is the mean of as many squared.
fn smaller(frame: &v1::CameraFrame, times: usize) -> v1::CameraFrame {
    let (width, height) = size(frame);
    let (columns, rows) = (width / times, height / times);
    if frame.rgb.len() != 3 * width * height {
        return frame.clone();
    }
    let mean = |row: usize, column: usize, colour: usize| {
        let pixels = (0..times * times).map(|i| {
            let (down, right) = (row * times + i / times, column * times + i % times);
            usize::from(frame.rgb[3 * (down * width + right) + colour])
        });
        u8::try_from(pixels.sum::<usize>() / (times * times)).unwrap_or(u8::MAX)
    };
    let rgb = (0..3 * rows * columns).map(|i| mean(i / 3 / columns, i / 3 % columns, i % 3));
    let pixels = |count: usize| u32::try_from(count).unwrap_or_default();
    v1::CameraFrame {
        rgb: rgb.collect::<Vec<u8>>().into(),
        intrinsics: Some(v1::Intrinsics {
            width: pixels(columns),
            height: pixels(rows),
            ..frame.intrinsics.unwrap_or_default()
        }),
        ..frame.clone()
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

/// The large picture with the small one in its lower right corner.
fn inset(large: &v1::CameraFrame, small: &v1::CameraFrame) -> Vec<u8> {
    let mut rgb = large.rgb.to_vec();
    let ((width, height), (columns, rows)) = (size(large), size(small));
    if columns > width
        || rows > height
        || rgb.len() != 3 * width * height
        || small.rgb.len() != 3 * columns * rows
    {
        return rgb;
    }
    for (row, line) in small.rgb.chunks_exact(3 * columns.max(1)).enumerate() {
        let to = 3 * ((height - rows + row) * width + width - columns);
        rgb[to..to + line.len()].copy_from_slice(line);
    }
    rgb
}

/// The last pictures of an episode.
fn last_frames(args: &EvaluateArgs, job: &Job) -> anyhow::Result<[v1::CameraFrame; 2]> {
    let all = vec![CAMERAS.to_owned()];
    let server = LocalServer::start(&args.server(&job.task, job.seed, all))?;
    let link = server.link()?;
    let robot = link.ask(&v1::SceneRequest {})?.robot.unwrap_or_default();
    let names = cameras(&robot)?;
    let newest: [Arc<Mutex<Option<ZBytes>>>; 2] = Default::default();
    let mut subscribers = Vec::new();
    for (name, newest) in names.iter().zip(&newest) {
        let kept = Arc::clone(newest);
        let subscriber = link.subscribe(&link.keys().camera(name), move |sample| {
            let mut newest = kept.lock().unwrap_or_else(PoisonError::into_inner);
            *newest = Some(sample.payload().clone());
        })?;
        subscribers.push(subscriber);
    }
    operate::run(&link, &OperateOptions::default(), &mut |_| {})
        .with_context(|| format!("{} seed {}", job.task, job.seed))?;
    drop(subscribers);
    server.stop(link)?;
    let frame = |index: usize| -> anyhow::Result<v1::CameraFrame> {
        let mut newest = newest[index].lock().unwrap_or_else(PoisonError::into_inner);
        let name = names[index];
        let payload = newest.take();
        let payload = payload.with_context(|| format!("the camera {name} sent no picture"))?;
        Ok(v1::CameraFrame::decode(payload.to_bytes().as_ref())?)
    };
    Ok([frame(0)?, smaller(&frame(1)?, SMALLER)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_smaller_picture_is_the_mean_of_its_pixels() {
        let frame = v1::CameraFrame {
            intrinsics: Some(v1::Intrinsics {
                width: 5,
                height: 2,
                ..Default::default()
            }),
            rgb: (0..30)
                .map(|i| if i % 3 == 0 { i } else { 7 })
                .collect::<Vec<u8>>()
                .into(),
            ..Default::default()
        };
        let small = smaller(&frame, 2);
        assert_eq!(size(&small), (2, 1));
        assert_eq!(small.rgb[..], [9, 7, 7, 15, 7, 7]);
    }

    #[test]
    fn the_small_picture_stands_in_the_lower_right_corner() {
        let frame = |width: u32, height: u32, value: u8| v1::CameraFrame {
            intrinsics: Some(v1::Intrinsics {
                width,
                height,
                ..Default::default()
            }),
            rgb: vec![value; (3 * width * height) as usize].into(),
            ..Default::default()
        };
        let rgb = inset(&frame(4, 3, 1), &frame(2, 1, 9));
        assert_eq!(rgb[..30], [1; 30]);
        assert_eq!(rgb[30..], [9; 6]);
        // One that does not fit is left out.
        assert_eq!(inset(&frame(2, 1, 1), &frame(4, 3, 9)), [1; 6]);
    }
}
