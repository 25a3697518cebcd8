//! Checks of this host: programs, graphics driver, libraries, disk, terminal.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use super::finding::Finding;
use wheelarm_proto::program::version;
use wheelarm_rollout::launcher::find_program;

/// Cores that a server with two cameras and a recorder need for real time.
const CORES: usize = 4;
/// A recording of two RGB-D cameras at 1280x720 and 10 Hz, bytes/s: 3.24 MB
/// per pair of images, measured.
const BYTES_PER_SECOND: u64 = 32_400_000;
/// Disk space below which the check fails, and from which it passes, minutes of recording.
const MINUTES: [u64; 2] = [2, 30];
/// Longest run of another program.
const PATIENCE: Duration = Duration::from_secs(20);

pub fn inspect(out: &Path, report: &mut dyn FnMut(Finding)) {
    report(Finding::ok("wheelarm", format!("version {}", version())));
    report(cores());
    #[cfg(feature = "hdf5")]
    report(hdf5());
    report(disk(out));
    for finding in programs() {
        report(finding);
    }
    report(terminal());
    report(congestion());
}

/// Whether the kernel allows BBR, which keeps `wheelarm drive` fast under packet loss.
fn congestion() -> Finding {
    let what = "packet loss";
    let setting = "/proc/sys/net/ipv4/tcp_allowed_congestion_control";
    let allowed = std::fs::read_to_string(setting).unwrap_or_default();
    if allowed.split_whitespace().any(|name| name == "bbr") {
        return Finding::ok(what, "BBR is allowed");
    }
    let cure = "`wheelarm drive` is slower over links that lose packets: modprobe tcp_bbr && \
                sysctl -w net.ipv4.tcp_allowed_congestion_control=\"reno cubic bbr\"";
    Finding::warn(what, "BBR is not allowed", cure)
}

fn cores() -> Finding {
    let what = "CPU cores";
    match std::thread::available_parallelism() {
        Ok(n) if n.get() >= CORES => Finding::ok(what, n.to_string()),
        Ok(n) => Finding::warn(
            what,
            n.to_string(),
            format!(
                "below {CORES} the simulation of two 1280x720 cameras may run slower than real time: use smaller images (--camera gen3=640x360@10) or lock-step pacing"
            ),
        ),
        Err(error) => Finding::warn(what, error.to_string(), "the speed cannot be predicted"),
    }
}

#[cfg(feature = "hdf5")]
fn hdf5() -> Finding {
    let (major, minor, patch) = hdf5::library_version();
    let version = format!("version {major}.{minor}.{patch}");
    if !hdf5::filters::deflate_available() {
        Finding::fail(
            "HDF5 library",
            format!("{version}, without deflate: it cannot read episodes"),
            "use a release's programs, or an HDF5 with zlib: apt-get install libhdf5-dev, then build again",
        )
    } else if (major, minor) >= (1, 10) {
        Finding::ok("HDF5 library", version)
    } else {
        Finding::fail(
            "HDF5 library",
            version,
            "install HDF5 1.10 or newer: apt-get install libhdf5-dev, then build again",
        )
    }
}

/// The nearest existing ancestor folder.
fn existing(folder: &Path) -> PathBuf {
    let absolute = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
    absolute
        .ancestors()
        .find(|f| f.is_dir())
        .unwrap_or(Path::new("/"))
        .to_owned()
}

fn disk(out: &Path) -> Finding {
    let what = "disk for --out";
    let folder = existing(out);
    let place = folder.display();
    if let Err(error) = tempfile::tempfile_in(&folder) {
        return Finding::fail(
            what,
            format!("{place} cannot be written: {error}"),
            "choose a writable folder with --out",
        );
    }
    let space = match rustix::fs::statvfs(&folder) {
        Ok(space) => space.f_bavail.saturating_mul(space.f_frsize),
        Err(error) => {
            return Finding::warn(
                what,
                format!("{place}: {error}"),
                "check the free space with df",
            );
        }
    };
    let minutes = space / BYTES_PER_SECOND / 60;
    let found = format!(
        "{:.1} GB free in {place}: {minutes} min of two 1280x720 cameras at 10 Hz",
        space as f64 * 1e-9
    );
    let cure = "free some space, choose another --out, smaller images, or `record --depth u16`";
    if minutes < MINUTES[0] {
        Finding::fail(what, found, cure)
    } else if minutes < MINUTES[1] {
        Finding::warn(what, found, cure)
    } else {
        Finding::ok(what, found)
    }
}

/// Standard output of a program, or its standard error when it fails.
fn output_of(program: &Path, argument: &str) -> Result<String, String> {
    let mut child = Command::new(program)
        .arg(argument)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|e| e.to_string())?;
    let since = Instant::now();
    while matches!(child.try_wait(), Ok(None)) {
        if since.elapsed() > PATIENCE {
            // It hangs; its output is discarded.
            let _ = child.kill();
            let _ = child.wait();
            return Err(format!(
                "it did not end within {:.0} s",
                PATIENCE.as_secs_f64()
            ));
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    let output = child.wait_with_output().map_err(|e| e.to_string())?;
    if output.status.success() {
        Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
    } else {
        let errors = String::from_utf8_lossy(&output.stderr);
        Err(errors.trim().to_owned())
    }
}

fn programs() -> Vec<Finding> {
    let Some(server) = find_program("wheelarm-server") else {
        return vec![Finding::warn(
            "wheelarm-server",
            "neither beside this program nor on PATH",
            "needed only where the simulation runs: cargo build --release --workspace",
        )];
    };
    let mut findings = Vec::new();
    let ours = version();
    findings.push(match output_of(&server, "--version") {
        Ok(text) if text.ends_with(&format!(" {ours}")) => {
            Finding::ok("wheelarm-server", format!("version {ours}"))
        }
        Ok(text) => Finding::warn(
            "wheelarm-server",
            format!("{text}, this program is {ours}"),
            "build both from the same sources: cargo build --release --workspace",
        ),
        Err(error) => Finding::fail(
            "wheelarm-server",
            format!("{} does not run: {error}", server.display()),
            "build it again: cargo build --release --workspace",
        ),
    });
    findings.push(match output_of(&server, "--list-adapters") {
        Ok(adapters) => adapter(&adapters),
        Err(error) => Finding::warn(
            "graphics driver",
            error.lines().next().unwrap_or("none").to_owned(),
            "apt-get install mesa-vulkan-drivers libvulkan1 (renders on the CPU), or the GPU maker's Vulkan driver; without one: wheelarm-server --no-cameras",
        ),
    });
    findings.push(match output_of(&server, "--list-tasks") {
        Ok(tasks) => Finding::ok("assets", format!("{} tasks", tasks.lines().count())),
        Err(error) => Finding::warn(
            "assets",
            error.lines().next().unwrap_or("not found").to_owned(),
            "name the assets folder: export WHEELARM_ASSETS=…/assets",
        ),
    });
    findings
}

/// The graphics adapters with their indices, by which `--adapter` and `--adapters`
/// choose.
fn adapter(adapters: &str) -> Finding {
    let what = "graphics driver";
    let is_cpu = |line: &&str| {
        let line = line.to_lowercase();
        line.contains("llvmpipe") || line.contains("lavapipe") || line.contains("cpu")
    };
    let all: Vec<&str> = adapters.lines().collect();
    let found = all.join("; ");
    match all.iter().any(|line| !is_cpu(line)) {
        true => Finding::ok(what, found),
        false => Finding::warn(
            what,
            found,
            "images are rendered on the CPU, which is enough for small ones; for more, install the GPU maker's Vulkan driver",
        ),
    }
}

fn terminal() -> Finding {
    let locale = ["LC_ALL", "LC_CTYPE", "LANG"]
        .iter()
        .filter_map(|name| std::env::var(name).ok())
        .find(|value| !value.is_empty())
        .unwrap_or_default();
    let term = std::env::var("TERM").unwrap_or_default();
    let found = format!(
        "TERM={} locale {}",
        if term.is_empty() { "(unset)" } else { &term },
        if locale.is_empty() {
            "(unset)"
        } else {
            &locale
        }
    );
    let folded = locale.to_lowercase().replace('-', "");
    if term.is_empty() || term == "dumb" {
        Finding::warn(
            "terminal",
            found,
            "teleop needs a terminal that can place text: over SSH use ssh -t",
        )
    } else if !folded.contains("utf8") {
        Finding::warn(
            "terminal",
            found,
            "arrows and accents may be garbled: export LANG=C.UTF-8",
        )
    } else {
        Finding::ok("terminal", found)
    }
}

#[cfg(test)]
mod tests {
    use super::super::finding::Level;
    use super::*;

    #[test]
    fn unwritable_folder_is_a_failure() {
        let finding = disk(Path::new("/proc/nowhere"));
        assert_eq!(finding.level, Level::Fail, "{finding}");
        let finding = disk(&std::env::temp_dir().join("not/there/yet"));
        assert!(finding.found.contains("GB free"), "{finding}");
    }

    #[test]
    fn cpu_adapter_is_a_warning_and_gpu_is_ok() {
        assert_eq!(adapter("llvmpipe (LLVM 15), Mesa, Cpu").level, Level::Warn);
        let both = "0: llvmpipe (LLVM 15), Cpu\n1: NVIDIA H200, PCI 0000:1b:00.0";
        let finding = adapter(both);
        assert_eq!(finding.level, Level::Ok);
        assert!(
            finding.found.contains("1: NVIDIA H200, PCI 0000:1b:00.0"),
            "{finding}"
        );
    }
}
