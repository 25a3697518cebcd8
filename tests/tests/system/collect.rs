//! Campaigns that are stopped, killed and interrupted: they repeat no episode, lose no episode
//! and leave no partial files.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant, SystemTime};

use serde_json::Value;
use wheelarm_tests::{printed, program, root};

use super::faults_server::processes;

const PLAN: &str = r#"
name = "tiny"
[scenario]
quality = "fast"
[[scenario.cameras]]
name = "gen3"
width = 64
height = 48
[[task]]
name = "pick_mustard"
episodes = 2
seconds = 17.0
reference_samples = 234.0
"#;
const PATIENCE: Duration = Duration::from_secs(180);

fn collect(args: &[&str]) -> Command {
    let mut command = Command::new(program("wheelarm").expect("the client"));
    command.arg("collect").args(args);
    if !args.contains(&"--merge") {
        command.arg("--assets").arg(root().join("assets"));
    }
    command
}

fn run(args: &[&str]) -> Output {
    collect(args).output().expect("the client")
}

/// A running campaign; killed when dropped.
struct Campaign {
    child: Child,
    begun: SystemTime,
}

impl Campaign {
    fn start(args: &[&str]) -> Self {
        let mut command = collect(args);
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        Self {
            begun: SystemTime::now(),
            child: command.spawn().expect("the client"),
        }
    }

    /// Whether its expert drives an episode below `out`.
    fn is_driving(&self, out: &Path) -> bool {
        let staged = std::fs::read_dir(out.join("staging"));
        staged.is_ok_and(|entries| {
            let logs = entries.flatten().map(|e| e.path().join("operator.log"));
            let mut metadata = logs.filter_map(|log| std::fs::metadata(log).ok());
            // A killed campaign leaves such files as well.
            metadata.any(|m| m.len() > 0 && m.modified().is_ok_and(|t| t > self.begun))
        })
    }

    fn signal(&self, name: &str) {
        let line = format!("kill -{name} {}", self.child.id());
        let status = Command::new("sh").args(["-c", &line]).status();
        assert!(status.expect("a shell").success(), "{line}");
    }

    fn end(mut self) -> Output {
        // The pipes hold far more than the campaign prints.
        let status = self.child.wait().expect("its end");
        let read = |pipe: Option<&mut dyn std::io::Read>| {
            let mut bytes = Vec::new();
            pipe.expect("a pipe").read_to_end(&mut bytes).expect("text");
            bytes
        };
        Output {
            status,
            stdout: read(self.child.stdout.as_mut().map(|p| p as _)),
            stderr: read(self.child.stderr.as_mut().map(|p| p as _)),
        }
    }
}

impl Drop for Campaign {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn wait_for(what: &str, mut done: impl FnMut() -> bool) {
    let since = Instant::now();
    while !done() {
        assert!(
            since.elapsed() < PATIENCE,
            "timeout while waiting for {what}"
        );
        // Shorter than the awaited states last.
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Writes a plan; the temporary folder, the plan's file and the path of its dataset.
fn write_plan(plan: &str) -> (tempfile::TempDir, PathBuf, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let (file, out) = (folder.path().join("plan.toml"), folder.path().join("set"));
    std::fs::write(&file, plan).expect("a plan");
    (folder, file, out)
}

fn one_worker<'a>(plan: &'a Path, out: &'a Path) -> [&'a str; 5] {
    let text = |path: &'a Path| path.to_str().expect("text");
    [text(plan), "--out", text(out), "--workers", "1"]
}

/// Processes whose command line names `out`.
fn left_behind(out: &Path) -> Vec<String> {
    let entries = std::fs::read_dir("/proc").expect("processes").flatten();
    let lines = entries.filter_map(|e| std::fs::read(e.path().join("cmdline")).ok());
    let lines = lines.map(|line| String::from_utf8_lossy(&line).replace('\0', " "));
    let out = out.to_string_lossy();
    lines.filter(|line| line.contains(&*out)).collect()
}

fn done_lines(out: &Path) -> Vec<Value> {
    let text = std::fs::read_to_string(out.join("journal/shard-0-of-1.jsonl")).unwrap_or_default();
    let lines = text.lines().filter_map(|l| serde_json::from_str(l).ok());
    lines.filter(|v: &Value| v["kind"] == "done").collect()
}

fn files(out: &Path) -> BTreeMap<PathBuf, SystemTime> {
    let entries = std::fs::read_dir(out.join("episodes")).expect("the episodes");
    let paths = entries.map(|entry| entry.expect("a file"));
    paths
        .map(|e| {
            (
                e.path(),
                e.metadata().and_then(|m| m.modified()).expect("a time"),
            )
        })
        .collect()
}

/// Number of logs of unfinished recordings below `folder`.
fn logs(folder: &Path) -> usize {
    let Ok(entries) = std::fs::read_dir(folder) else {
        return 0;
    };
    let paths = entries.flatten().map(|entry| entry.path());
    paths
        .map(|path| match path.is_dir() {
            true => logs(&path),
            false => usize::from(path.extension().is_some_and(|e| e == "wal")),
        })
        .sum()
}

#[test]
fn interrupted_campaign_with_worker_processes_ends_complete() {
    check_interruptions("process");
}

#[test]
fn interrupted_campaign_with_servers_ends_complete() {
    check_interruptions("socket");
}

/// Ends a campaign by SIGTERM once, by SIGKILL twice and by SIGINT.
fn check_interruptions(worker: &str) {
    let (folder, plan, out) = write_plan(PLAN);
    let one = one_worker(&plan, &out);
    // Logs of unfinished recordings are written to another folder.
    let scratch = folder.path().join("scratch");
    let elsewhere = scratch.to_str().expect("text");
    let args = [&one[..], &["--worker", worker, "--scratch", elsewhere]].concat();

    let dry = run(&[&args[..], &["--dry-run"]].concat());
    let text = printed(&dry);
    // 2 episodes of 17 s at 10 Hz beside 2 x 234.
    assert!(text.contains("340") && text.contains("468"), "{text}");
    assert!(text.contains(elsewhere), "{text}");
    assert!(!out.exists() && !scratch.exists(), "a dry run made folders");

    // SIGTERM discards the running episode.
    let campaign = Campaign::start(&args);
    wait_for("an expert that drives", || campaign.is_driving(&out));
    wait_for("a recording", || logs(&scratch) == 1);
    assert_eq!(logs(&out.join("staging")), 0);
    let second = run(&args);
    assert!(printed(&second).contains("another"), "{}", printed(&second));
    campaign.signal("TERM");
    let ended = campaign.end();
    assert_eq!(ended.status.code(), Some(3), "{}", printed(&ended));
    let staged = std::fs::read_dir(out.join("staging")).expect("a folder");
    assert_eq!(staged.count(), 0, "partial files are left");
    let left = std::fs::read_dir(&scratch).expect("a folder");
    assert_eq!(left.count(), 0, "a recording is left");

    // Killed during the first episode, and during the second.
    for done in [0, 1] {
        let campaign = Campaign::start(&args);
        wait_for("the next episode", || {
            done_lines(&out).len() == done && campaign.is_driving(&out) && logs(&scratch) == 1
        });
        campaign.signal("KILL");
        campaign.end();
        wait_for("the end of its programs", || left_behind(&out).is_empty());
        assert_eq!(files(&out).len(), done);
        assert_eq!(logs(&scratch), 1);
    }
    let first = files(&out);

    // Ctrl-C lets the running episode finish: here it is the last one.
    let campaign = Campaign::start(&args);
    wait_for("an expert that drives", || campaign.is_driving(&out));
    campaign.signal("INT");
    let ended = campaign.end();
    let text = printed(&ended);
    assert_eq!(ended.status.code(), Some(0), "{text}");
    assert!(
        text.contains("2 of 2 episodes") && text.contains(": complete"),
        "{text}"
    );

    // The files of killed campaigns are removed too.
    let left = std::fs::read_dir(&scratch).expect("a folder");
    assert_eq!(left.count(), 0, "a recording is left");

    // No episode was repeated, and the next run does nothing.
    let both = files(&out);
    assert!(
        first
            .iter()
            .all(|(path, time)| both.get(path) == Some(time))
    );
    assert_eq!((both.len(), done_lines(&out).len()), (2, 2));
    let again = run(&args);
    assert_eq!(again.status.code(), Some(0), "{}", printed(&again));
    assert_eq!((files(&out), done_lines(&out).len()), (both, 2));
    check_manifest(&out);
    check_merge(&out, &folder.path().join("merged"));
    check_another_plan_is_rejected(&plan, &args);
}

#[test]
fn next_episode_runs_while_a_file_is_finished_and_both_can_be_discarded() {
    let plan = PLAN.replace("episodes = 2", "episodes = 3");
    let plan = plan.replace(
        "[[task]]",
        "[variation.language]\nseed = 40\nsentences = 2\n[[task]]",
    );
    let (_folder, plan, out) = write_plan(&plan);
    let args = one_worker(&plan, &out);
    let staged = || std::fs::read_dir(out.join("staging")).map_or(0, Iterator::count);
    let campaign = Campaign::start(&args);
    wait_for("two staged episodes", || staged() == 2);
    campaign.signal("TERM");
    let ended = campaign.end();
    assert_eq!(ended.status.code(), Some(3), "{}", printed(&ended));
    assert_eq!(staged(), 0, "partial files are left");
    let before = files(&out);
    assert_eq!(before.len(), done_lines(&out).len());
    assert!(before.len() < 3);

    let all = run(&args);
    let text = printed(&all);
    assert_eq!(all.status.code(), Some(0), "{text}");
    let after = files(&out);
    assert!(
        before
            .iter()
            .all(|(path, time)| after.get(path) == Some(time))
    );
    assert_eq!((after.len(), done_lines(&out).len()), (3, 3));
    check_manifest(&out);
    check_two_sentences_of_one_scene(&out);
}

/// Two episodes of one scene have different sentences and different trajectories.
fn check_two_sentences_of_one_scene(out: &Path) {
    let mut done = done_lines(out);
    done.sort_by_key(|line| line["episode"].to_string());
    let sentence_seed = |line: &Value| line["scenario"]["language"]["seed"].as_u64();
    let [first, second, third] = &done[..] else {
        panic!("{done:?}");
    };
    assert_eq!(
        [first, second, third].map(sentence_seed),
        [40, 41, 40].map(Some)
    );
    assert_eq!(first["seed"], second["seed"]);
    assert_ne!(first["seed"], third["seed"]);
    assert_eq!(first["scenario"]["objects"], second["scenario"]["objects"]);
    assert_ne!(first["instruction"], second["instruction"]);
    assert_ne!(first["seconds"], second["seconds"], "the same run twice");
}

#[test]
fn killed_and_stalled_workers_are_logged_and_the_campaign_ends_complete() {
    let words = [
        "the worker died (signal: 6",
        "the worker stalled and sent nothing for 6 s",
    ];
    check_failed_attempts("process", words, |out, _| {
        format!("--for\0{}\0", out.display())
    });
}

#[test]
fn killed_and_stalled_servers_are_logged_and_the_campaign_ends_complete() {
    let words = [
        "the server died (signal: 6",
        "the server stalled and answered nothing for 6 s",
    ];
    check_failed_attempts("socket", words, |_, staging| {
        let socket = std::fs::read_to_string(staging.join("socket"));
        let socket = socket.expect("the server's endpoint");
        format!("unixsock-stream/{socket}/server\0--scenario")
    });
}

/// `line` returns a part of the command line of the simulation process, from the folders of a
/// dataset and an episode.
fn check_failed_attempts(worker: &str, words: [&str; 2], line: impl Fn(&Path, &Path) -> String) {
    let (_folder, plan, out) = write_plan(PLAN);
    let one = one_worker(&plan, &out);
    let args = [&one[..], &["--worker", worker]].concat();
    let campaign = Campaign::start(&[&args[..], &["--patience", "6"]].concat());
    // One is killed during the first episode, one stalls during the second.
    for (index, signal) in [(0, "ABRT"), (1, "STOP")] {
        let staging = out.join(format!("staging/pick_mustard-000{index}"));
        let other = out.join(format!("staging/pick_mustard-000{}", 1 - index));
        wait_for("an expert that drives, and no file in work", || {
            let log = std::fs::metadata(staging.join("operator.log"));
            log.is_ok_and(|log| log.len() > 0) && !other.exists()
        });
        let servers = processes(&line(&out, &staging));
        assert_eq!(servers.len(), 1, "{servers:?}");
        let line = format!("kill -{signal} {}", servers[0]);
        let status = Command::new("sh").args(["-c", &line]).status();
        assert!(status.expect("a shell").success(), "{line}");
    }
    let ended = campaign.end();
    let text = printed(&ended);
    assert_eq!(ended.status.code(), Some(3), "{text}");
    assert!(text.contains("2 of 2 episodes"), "{text}");
    check_manifest(&out);
    // The manifest lists both attempts with the scenario that repeats them. A new server ran
    // both episodes with the same seed.
    let manifest = std::fs::read_to_string(out.join("manifest.json")).expect("a manifest");
    let manifest: Value = serde_json::from_str(&manifest).expect("JSON");
    let failed = manifest["failed_attempts"].as_array().expect("a list");
    assert_eq!(failed.len(), 2, "{failed:?}");
    for (index, (failed, words)) in failed.iter().zip(words).enumerate() {
        assert_eq!(failed["episode"], format!("pick_mustard-000{index}"));
        assert_eq!(failed["broken"], "server", "{failed}");
        assert_eq!(
            (&failed["attempt"], &failed["death"]),
            (&0.into(), &1.into())
        );
        let reason = failed["reason"].as_str().expect("a reason");
        assert!(reason.starts_with(words), "{failed}");
        assert!(text.contains(words), "{text}");
        let seed = &manifest["episodes"][index]["seed"];
        assert_eq!(&failed["scenario"]["seed"], seed, "{failed}");
        assert_eq!(failed["scenario"]["task"], "pick_mustard", "{failed}");
    }
    // Both episodes are complete: the next run does nothing.
    let again = run(&args);
    assert_eq!(again.status.code(), Some(0), "{}", printed(&again));
    assert!(left_behind(&out).is_empty());
}

/// The system sends SIGKILL when memory is short; the campaign does not.
#[test]
fn worker_killed_for_memory_is_repeated_with_the_same_seed() {
    let (_folder, plan, out) = write_plan(&PLAN.replace("episodes = 2", "episodes = 1"));
    let campaign = Campaign::start(&one_worker(&plan, &out));
    let log = out.join("staging/pick_mustard-0000/operator.log");
    wait_for("an expert that drives", || {
        std::fs::metadata(&log).is_ok_and(|log| log.len() > 0)
    });
    let workers = processes(&format!("--for\0{}\0", out.display()));
    assert_eq!(workers.len(), 1, "{workers:?}");
    let line = format!("kill -KILL {}", workers[0]);
    let status = Command::new("sh").args(["-c", &line]).status();
    assert!(status.expect("a shell").success(), "{line}");
    let ended = campaign.end();
    let text = printed(&ended);
    assert_eq!(ended.status.code(), Some(0), "{text}");
    assert!(
        text.contains("is repeated: the worker died (signal: 9"),
        "{text}"
    );
    let manifest = std::fs::read_to_string(out.join("manifest.json")).expect("a manifest");
    let manifest: Value = serde_json::from_str(&manifest).expect("JSON");
    assert_eq!(manifest["failed_attempts"], Value::Array(Vec::new()));
    assert_eq!(manifest["episodes"][0]["attempt"], 0, "{manifest}");
    check_manifest(&out);
}

/// Contents of the files below a folder, by relative path.
fn contents(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut open = vec![folder.to_owned()];
    while let Some(next) = open.pop() {
        for entry in std::fs::read_dir(&next).expect("a folder").flatten() {
            let path = entry.path();
            if path.is_dir() {
                open.push(path);
                continue;
            }
            let name = path.strip_prefix(folder).expect("below").to_owned();
            found.insert(name, std::fs::read(&path).expect("a file"));
        }
    }
    found
}

#[test]
fn worker_process_and_server_record_equal_episodes() {
    let depth = PLAN.replace("[scenario]", "depth = \"u16\"\n[scenario]");
    let (folder, plan, _) = write_plan(&depth);
    let [process, socket] = ["process", "socket"].map(|worker| {
        let out = folder.path().join(worker);
        let args = [&one_worker(&plan, &out)[..], &["--worker", worker]].concat();
        let made = run(&args);
        assert_eq!(made.status.code(), Some(0), "{}", printed(&made));
        check_manifest(&out);
        // Rows and images. The recording itself also holds the run's id and times.
        let text = folder.path().join(format!("{worker}-csv"));
        let episodes = out.join("episodes");
        let exported = Command::new(program("wheelarm-dataset").expect("the tool"))
            .args(["export", "--format", "csv"])
            .arg(&episodes)
            .arg("--out")
            .arg(&text)
            .output()
            .expect("the tool");
        assert!(exported.status.success(), "{}", printed(&exported));
        let hashes: Vec<Vec<u64>> = (0..2)
            .map(|index| {
                let file = episodes.join(format!("pick_mustard-000{index}.h5"));
                let file = hdf5::File::open(file).expect("an episode");
                let hashes = file.dataset("streams/state_hash/hash").expect("hashes");
                hashes.read_raw().expect("numbers")
            })
            .collect();
        (contents(&text), hashes)
    });
    assert!(process.0.len() > 200, "{} files", process.0.len());
    assert!(process.0 == socket.0, "rows or images differ");
    assert!(
        process.1[0].len() > 5 && process.1 == socket.1,
        "{:?}",
        process.1
    );
}

fn check_manifest(out: &Path) {
    let text = std::fs::read_to_string(out.join("manifest.json")).expect("a manifest");
    let manifest: Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(manifest["complete"], true);
    for (index, episode) in manifest["episodes"]
        .as_array()
        .expect("a list")
        .iter()
        .enumerate()
    {
        assert_eq!(episode["episode"], format!("pick_mustard-{index:04}"));
        assert_eq!(episode["missed"], 0);
        assert!(episode["success"] == true && episode["counts"]["camera/gen3"].as_u64() > Some(50));
        let file = out.join(episode["file"].as_str().expect("a path"));
        let recording = wheelarm_dataset::read::Episode::open(&file).expect("an episode");
        let summary = recording.summary().expect("a summary");
        assert!(summary.complete && summary.success);
        assert_eq!(Some(summary.seed), episode["seed"].as_u64());
    }
}

fn check_merge(out: &Path, merged: &Path) {
    let args = |to| ["--merge", out.to_str().expect("text"), "--out", to];
    let good = run(&args(merged.to_str().expect("text")));
    assert_eq!(good.status.code(), Some(0), "{}", printed(&good));
    check_manifest(merged);
    // One flipped byte, in the source only: the merged file may be a hard link to it.
    let file = out.join("episodes/pick_mustard-0001.h5");
    let mut bytes = std::fs::read(&file).expect("the file");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::remove_file(&file).expect("the file");
    std::fs::write(&file, bytes).expect("the file");
    let elsewhere = merged.with_file_name("elsewhere");
    let bad = run(&args(elsewhere.to_str().expect("text")));
    let text = printed(&bad);
    assert_eq!(bad.status.code(), Some(3), "{text}");
    assert!(
        text.contains("missing: pick_mustard-0001") && text.contains("SHA-256"),
        "{text}"
    );
    let again = run(&args(merged.to_str().expect("text")));
    assert_eq!(again.status.code(), Some(0), "{}", printed(&again));
    // A damaged file of the target is replaced by an intact one.
    let file = merged.join("episodes/pick_mustard-0000.h5");
    std::fs::remove_file(&file).expect("the file");
    std::fs::write(&file, "damaged").expect("a file");
    let mended = run(&args(merged.to_str().expect("text")));
    assert_eq!(mended.status.code(), Some(0), "{}", printed(&mended));
    assert!(std::fs::metadata(&file).expect("the file").len() > 1000);
    // The folder of another campaign stays unchanged.
    let other = merged.with_file_name("other");
    std::fs::create_dir(&other).expect("a folder");
    let plan = PLAN.replace("\"tiny\"", "\"other\"");
    std::fs::write(other.join("plan.toml"), &plan).expect("a plan");
    let refused = run(&args(other.to_str().expect("text")));
    let text = printed(&refused);
    assert!(text.contains("different campaigns"), "{text}");
    assert_eq!(
        std::fs::read_to_string(other.join("plan.toml")).expect("a plan"),
        plan
    );
}

fn check_another_plan_is_rejected(plan: &Path, args: &[&str]) {
    std::fs::write(plan, PLAN.replace("width = 64", "width = 32")).expect("a plan");
    let refused = run(args);
    let text = printed(&refused);
    assert_eq!(refused.status.code(), Some(1), "{text}");
    assert!(
        text.contains("another plan") && text.contains("64x48"),
        "{text}"
    );
    std::fs::write(plan, PLAN.replace("pick_mustard", "pick_custard")).expect("a plan");
    let text = printed(&run(args));
    assert!(
        text.contains("plan.toml:10") && text.contains("pick_mustard"),
        "{text}"
    );
}
