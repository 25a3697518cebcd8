//! The end of one episode of each task as the chair's camera sees it, in one
//! picture. The episode is done once more for it, with the camera on: the same
//! bits again.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use anyhow::Context;
use wheelarm_dataset::sheet::grid::{Cell, grid};
use wheelarm_proto::{Message, v1};
use zenoh::Wait;
use zenoh::bytes::ZBytes;

use super::report::Report;
use super::{Entry, EvaluateArgs, Job};
use crate::local::LocalServer;
use crate::operate::run::{self as operate, OperateArgs};

/// Camera that takes the pictures.
const CAMERA: &str = "wheelchair";
/// Its size, pixels, and rate, Hz.
const SETTING: &str = "640x360@1";
/// Pictures in one row.
const COLUMNS: usize = 4;

/// Draws the grid; its path.
///
/// # Errors
/// When a program does not start or the picture cannot be written.
pub fn draw(args: &EvaluateArgs, report: &Report, entries: &[Entry]) -> anyhow::Result<PathBuf> {
    let mut cells = Vec::new();
    for task in &report.tasks {
        let own = || entries.iter().filter(|entry| entry.task == task.task);
        // A success shows best what the task is.
        let Some(entry) = own().find(|entry| entry.success).or_else(|| own().next()) else {
            continue;
        };
        let job = Job {
            task: entry.task.clone(),
            seed: entry.seed,
        };
        let frame = last_frame(args, &job)?;
        let intrinsics = frame.intrinsics.clone().unwrap_or_default();
        cells.push(Cell {
            width: intrinsics.width as usize,
            height: intrinsics.height as usize,
            rgb: frame.rgb.to_vec(),
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

/// The last picture of an episode.
fn last_frame(args: &EvaluateArgs, job: &Job) -> anyhow::Result<v1::CameraFrame> {
    let camera = format!("{CAMERA}={SETTING}");
    let server = LocalServer::start(&args.server(&job.task, job.seed, vec![camera]))?;
    let link = server.link()?;
    let newest: Arc<Mutex<Option<ZBytes>>> = Arc::default();
    let kept = Arc::clone(&newest);
    let subscriber = link
        .session()
        .declare_subscriber(link.keys().camera(CAMERA))
        .callback(move |sample| {
            let mut newest = kept.lock().unwrap_or_else(PoisonError::into_inner);
            *newest = Some(sample.payload().clone());
        })
        .wait()
        .map_err(|e| anyhow::anyhow!("subscribing to the camera {CAMERA}: {e}"))?;
    operate::run(&link, &OperateArgs::default(), &mut |_| {})
        .with_context(|| format!("{} seed {}", job.task, job.seed))?;
    drop(subscriber);
    server.stop(link)?;
    let newest = newest.lock().unwrap_or_else(PoisonError::into_inner).take();
    let payload = newest.with_context(|| format!("the camera {CAMERA} sent no picture"))?;
    Ok(v1::CameraFrame::decode(payload.to_bytes().as_ref())?)
}
