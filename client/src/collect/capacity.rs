//! How many workers this host carries, and how much room its disk has.

use std::path::{Path, PathBuf};

use anyhow::bail;

use super::plan::Plan;

/// Memory of a worker without pictures, bytes: server 0.3 GB, recorder and
/// operator 0.1 GB (measured with the home scene), twice, for while an episode's
/// file is finished the next one runs; with room.
const WORKER_BYTES: f64 = 1e9;
/// Memory per pixel of all cameras, bytes: attachments, two batches in flight
/// and the recorder's queue (measured 65 at 1280x720), twice, with room.
const BYTES_PER_PIXEL: f64 = 160.0;
/// Workers per core: physics, operator and drawing take turns on one, and
/// compression uses a part of another. On 16 cores with a GPU 12 workers were
/// as fast as 16, and 8 slower.
const WORKERS_PER_CORE: f64 = 0.75;

/// Pipelines of a worker, each of which makes an episode.
pub const PIPELINES: usize = 2;

/// Workers per core beyond which a number of workers is a slip of the keyboard.
const MOST_PER_CORE: usize = 16;

/// What this host offers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Host {
    /// Cores that this process may use.
    pub cores: usize,
    /// Memory that is free for it, bytes; absent when unknown.
    pub memory: Option<u64>,
}

impl Host {
    /// Looks at this host: affinity, cgroup limits, free memory.
    #[must_use]
    pub fn look() -> Self {
        Self {
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            memory: memory(),
        }
    }

    /// Workers that it carries, at least 1; each keeps so many bytes of recordings in
    /// memory.
    #[must_use]
    pub fn workers(&self, plan: &Plan, kept: f64) -> usize {
        let by_cores = (self.cores as f64 * WORKERS_PER_CORE).ceil() as usize;
        let by_memory = self.memory.map_or(usize::MAX, |free| {
            (free as f64 * 0.9 / (worker_bytes(plan) + kept)) as usize
        });
        by_cores.min(by_memory).max(1)
    }
}

impl Host {
    /// Refuses a number of workers that this host cannot mean.
    ///
    /// # Errors
    /// With the greatest number that is taken.
    pub fn check(&self, workers: usize) -> anyhow::Result<()> {
        let most = self.cores.saturating_mul(MOST_PER_CORE);
        if workers > most {
            bail!(
                "{workers} workers on {} cores: --workers takes {most} at most here; without it there are as many as fit",
                self.cores
            );
        }
        Ok(())
    }
}

/// Memory that one worker needs, bytes.
#[must_use]
pub fn worker_bytes(plan: &Plan) -> f64 {
    let pixels: f64 = plan
        .cameras
        .iter()
        .map(|camera| f64::from(camera.size[0]) * f64::from(camera.size[1]))
        .sum();
    WORKER_BYTES + BYTES_PER_PIXEL * pixels
}

fn number(path: &str) -> Option<u64> {
    std::fs::read_to_string(path).ok()?.trim().parse().ok()
}

/// Free memory, bytes: what the kernel calls available, within the cgroup.
fn memory() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|l| l.strip_prefix("MemAvailable:"))?;
    let available = line
        .trim()
        .trim_end_matches("kB")
        .trim()
        .parse::<u64>()
        .ok()?
        * 1024;
    let v2 = "/sys/fs/cgroup/memory";
    let left = |limit: &str, used: &str| Some(number(limit)?.saturating_sub(number(used)?));
    let cgroup = left(&format!("{v2}.max"), &format!("{v2}.current")).or_else(|| {
        left(
            "/sys/fs/cgroup/memory/memory.limit_in_bytes",
            "/sys/fs/cgroup/memory/memory.usage_in_bytes",
        )
    });
    Some(cgroup.map_or(available, |left| left.min(available)))
}

/// Free bytes on the disk of `path`, or of the nearest folder above it that exists.
#[must_use]
pub fn free_disk(path: &Path) -> Option<u64> {
    let disk = rustix::fs::statvfs(existing(path)?).ok()?;
    Some(disk.f_bavail.saturating_mul(disk.f_frsize))
}

/// Whether files in `path` lie in memory.
#[must_use]
pub fn is_memory(path: &Path) -> bool {
    const TMPFS: u32 = 0x0102_1994;
    let found = existing(path).and_then(|path| rustix::fs::statfs(path).ok());
    found.is_some_and(|disk| disk.f_type as u32 == TMPFS)
}

/// Bytes of the files below a folder.
#[must_use]
pub fn size(folder: &Path) -> u64 {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    entries
        .filter_map(|entry| Some((entry.path(), entry.metadata().ok()?)))
        .map(|(path, found)| match found.is_dir() {
            true => size(&path),
            false => found.len(),
        })
        .sum()
}

/// The folder, or the nearest above it that exists.
fn existing(path: &Path) -> Option<PathBuf> {
    let mut path = std::path::absolute(path).ok()?;
    while !path.exists() {
        path = path.parent()?.to_owned();
    }
    Some(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn workers_are_bounded_by_cores_and_by_memory() {
        let text = "name = \"x\"\n[[camera]]\nname = \"gen3\"\nsize = [1000, 1000]\n[[task]]\nname = \"a\"\nepisodes = 7\n";
        let plan = Plan::parse("p.toml".as_ref(), text.to_owned()).unwrap();
        let workers = |cores, memory| Host { cores, memory }.workers(&plan, 0.0);
        assert_eq!(workers(1, Some(64 << 30)), 1);
        assert_eq!(workers(2, Some(64 << 30)), 2);
        assert_eq!(workers(16, Some(64 << 30)), 12);
        assert_eq!(workers(16, Some(3 << 30)), 2);
        assert_eq!(workers(16, Some(1 << 20)), 1);
        assert_eq!(workers(16, None), 12);
        let host = Host {
            cores: 16,
            memory: Some(64 << 30),
        };
        assert_eq!(host.workers(&plan, 8e9), 6);
        let host = Host {
            cores: 2,
            memory: None,
        };
        assert!(host.check(32).is_ok());
        let told = host.check(33).unwrap_err().to_string();
        assert!(told.contains("takes 32 at most"), "{told}");
    }
}
