//! Capacity of this host: workers that fit, and free disk space.

use std::path::{Path, PathBuf};

use anyhow::bail;

use super::plan::Plan;

/// Memory of a worker without images, bytes: server 0.3 GB, recorder and operator 0.1 GB
/// (measured with the home scene), twice, because the next episode runs while a file is
/// finished; with a margin.
const WORKER_BYTES: f64 = 1e9;
/// Memory per pixel of all cameras, bytes: attachments, two batches in flight
/// and the recorder's queue (measured 65 at 1280x720), twice, with a margin.
const BYTES_PER_PIXEL: f64 = 160.0;
/// Workers per core: physics, operator and rendering alternate on one, and
/// compression uses a part of another. On 16 cores with a GPU 12 workers were
/// as fast as 16, and 8 slower.
const WORKERS_PER_CORE: f64 = 0.75;

/// Pipelines of a worker, each of which makes an episode.
pub const PIPELINES: usize = 2;

/// Workers per core above which a number of workers is treated as a typing error.
const MOST_PER_CORE: usize = 16;

/// Resources of this host.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Host {
    /// Cores that this process may use.
    pub cores: usize,
    /// Free memory, bytes; absent when unknown.
    pub memory: Option<u64>,
}

impl Host {
    /// Measures this host: affinity, cgroup limits, free memory.
    #[must_use]
    pub fn measure() -> Self {
        Self {
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            memory: memory(),
        }
    }

    /// Workers that fit, at least 1; each keeps `kept` bytes of recordings in memory.
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
    /// Rejects a number of workers far above the cores of this host.
    ///
    /// # Errors
    /// Names the greatest accepted number.
    pub fn check(&self, workers: usize) -> anyhow::Result<()> {
        let most = self.cores.saturating_mul(MOST_PER_CORE);
        if workers > most {
            bail!(
                "{workers} workers on {} cores: --jobs is at most {most} here; leave it out to use as many as fit",
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
        .scenario()
        .cameras
        .iter()
        .map(|camera| f64::from(camera.width) * f64::from(camera.height))
        .sum();
    WORKER_BYTES + BYTES_PER_PIXEL * pixels
}

/// Free memory, bytes: what the kernel calls available, within the control groups of this
/// process.
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
    let left = left_in_groups(Path::new("/"));
    Some(left.map_or(available, |left| left.min(available)))
}

/// Files of a control group of one version with its limits, use and statistics, and the
/// statistic that counts file pages which the kernel drops first.
struct GroupFiles {
    limits: &'static [&'static str],
    used: &'static str,
    dropped: &'static str,
}

const VERSION_1: GroupFiles = GroupFiles {
    limits: &["memory.limit_in_bytes"],
    used: "memory.usage_in_bytes",
    dropped: "total_inactive_file",
};
/// Beyond `memory.high` a group is slowed down until it cannot work.
const VERSION_2: GroupFiles = GroupFiles {
    limits: &["memory.max", "memory.high"],
    used: "memory.current",
    dropped: "inactive_file",
};

impl GroupFiles {
    /// Memory that a group still allows, bytes; absent without a limit.
    fn left(&self, group: &Path) -> Option<u64> {
        let text = |name: &str| std::fs::read_to_string(group.join(name)).ok();
        let number = |name: &str| text(name)?.trim().parse::<u64>().ok();
        let limit = self.limits.iter().filter_map(|name| number(name)).min()?;
        let stat = text("memory.stat").unwrap_or_default();
        let dropped = stat.lines().find_map(|line| {
            let value = line.strip_prefix(self.dropped)?.strip_prefix(' ')?;
            value.trim().parse::<u64>().ok()
        });
        let used = number(self.used)?.saturating_sub(dropped.unwrap_or(0));
        Some(limit.saturating_sub(used))
    }
}

/// Memory that all control groups of this process still allow, bytes: the least of its own
/// and those above it, of version 1 and 2, as systemd, Slurm and containers nest them.
/// Absent without a limit. `root` is the folder of `/proc` and the groups.
fn left_in_groups(root: &Path) -> Option<u64> {
    let text = |path: &str| std::fs::read_to_string(root.join(path)).unwrap_or_default();
    let (groups, mounts) = (text("proc/self/cgroup"), text("proc/self/mountinfo"));
    // ID:CONTROLLERS:PATH, of version 2 without controllers.
    let own = |is_own: &dyn Fn(&str) -> bool| {
        groups.lines().find_map(|line| {
            let (controllers, path) = line.split_once(':')?.1.split_once(':')?;
            is_own(controllers).then_some(path)
        })
    };
    let left = mounts.lines().filter_map(|line| {
        // ID PARENT DEVICE ROOT MOUNT OPTIONS... - TYPE SOURCE OPTIONS
        let (place, system) = line.split_once(" - ")?;
        let mut place = place.split(' ').skip(3);
        let (top, mount) = (place.next()?, place.next()?);
        let mut system = system.split(' ');
        let (kind, options) = (system.next()?, system.nth(1).unwrap_or_default());
        let holds = |list: &str| list.split(',').any(|name| name == "memory");
        let (files, path) = match kind {
            "cgroup2" => (VERSION_2, own(&|controllers: &str| controllers.is_empty())?),
            "cgroup" if holds(options) => (VERSION_1, own(&holds)?),
            _ => return None,
        };
        // A container may see a part of the tree alone, in which it is the top.
        let below = Path::new(path).strip_prefix(top).unwrap_or(Path::new(""));
        let mount = root.join(mount.trim_start_matches('/'));
        let group = mount.join(below);
        let up = group
            .ancestors()
            .take_while(|group| group.starts_with(&mount));
        up.filter_map(|group| files.left(group)).min()
    });
    left.min()
}

/// Free bytes on the disk of `path`, or of the nearest folder above it that exists.
#[must_use]
pub fn free_disk(path: &Path) -> Option<u64> {
    let disk = rustix::fs::statvfs(existing(path)?).ok()?;
    Some(disk.f_bavail.saturating_mul(disk.f_frsize))
}

/// Whether files in `path` are stored in memory.
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

    /// Files of a machine, by path.
    fn machine(files: &[(&str, &str)]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for (path, text) in files {
            let path = folder.path().join(path);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        folder
    }

    #[test]
    fn smallest_limit_of_nested_control_groups_counts() {
        let unlimited = "9223372036854771712\n";
        // Slurm on version 1: the limit is that of the job, above the step.
        let slurm = machine(&[
            (
                "proc/self/cgroup",
                "5:cpu,cpuacct:/\n3:memory:/slurm/job_7/step_0\n0::/\n",
            ),
            (
                "proc/self/mountinfo",
                "30 25 0:26 / /sys/fs/cgroup/unified rw - cgroup2 cgroup2 rw\n\
                 33 25 0:29 / /sys/fs/cgroup/memory rw,nosuid shared:9 - cgroup cgroup rw,memory\n",
            ),
            ("sys/fs/cgroup/memory/memory.limit_in_bytes", unlimited),
            ("sys/fs/cgroup/memory/memory.usage_in_bytes", "8000000000\n"),
            (
                "sys/fs/cgroup/memory/slurm/job_7/memory.limit_in_bytes",
                "1000\n",
            ),
            (
                "sys/fs/cgroup/memory/slurm/job_7/memory.usage_in_bytes",
                "400\n",
            ),
            (
                "sys/fs/cgroup/memory/slurm/job_7/memory.stat",
                "cache 9\ntotal_inactive_file 100\n",
            ),
            (
                "sys/fs/cgroup/memory/slurm/job_7/step_0/memory.limit_in_bytes",
                unlimited,
            ),
            (
                "sys/fs/cgroup/memory/slurm/job_7/step_0/memory.usage_in_bytes",
                "400\n",
            ),
        ]);
        assert_eq!(left_in_groups(slurm.path()), Some(700));
        // Version 2, where the root has no limit and an inner group the smaller one.
        let nested = machine(&[
            ("proc/self/cgroup", "0::/user.slice/job\n"),
            (
                "proc/self/mountinfo",
                "30 25 0:26 / /sys/fs/cgroup rw - cgroup2 cgroup2 rw,nsdelegate\n",
            ),
            ("sys/fs/cgroup/user.slice/memory.max", "5000\n"),
            ("sys/fs/cgroup/user.slice/memory.current", "4500\n"),
            ("sys/fs/cgroup/user.slice/job/memory.max", "max\n"),
            ("sys/fs/cgroup/user.slice/job/memory.high", "900\n"),
            ("sys/fs/cgroup/user.slice/job/memory.current", "600\n"),
            (
                "sys/fs/cgroup/user.slice/job/memory.stat",
                "anon 1\ninactive_file 50\n",
            ),
        ]);
        assert_eq!(left_in_groups(nested.path()), Some(350));
        // A container: its group is the top of what is mounted.
        let container = machine(&[
            ("proc/self/cgroup", "0::/docker/abc\n"),
            (
                "proc/self/mountinfo",
                "30 25 0:26 /docker/abc /sys/fs/cgroup ro - cgroup2 cgroup rw\n",
            ),
            ("sys/fs/cgroup/memory.max", "2000\n"),
            ("sys/fs/cgroup/memory.current", "500\n"),
        ]);
        assert_eq!(left_in_groups(container.path()), Some(1500));
        let without = machine(&[("proc/self/cgroup", "0::/\n")]);
        assert_eq!(left_in_groups(without.path()), None);
    }

    #[test]
    fn workers_are_bounded_by_cores_and_by_memory() {
        let text = "name = \"x\"\n[[scenario.cameras]]\nname = \"gen3\"\nwidth = 1000\nheight = 1000\n[[task]]\nname = \"a\"\nepisodes = 7\n";
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
        let error = host.check(33).unwrap_err().to_string();
        assert!(error.contains("is at most 32"), "{error}");
    }
}
