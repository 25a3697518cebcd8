//! A campaign that is ended in every way on its way: nothing is done twice,
//! nothing is lost, nothing half-made is left.

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

    /// Its operator is at work on an episode below `out`.
    fn at_work(&self, out: &Path) -> bool {
        let staged = std::fs::read_dir(out.join("staging"));
        staged.is_ok_and(|entries| {
            let logs = entries.flatten().map(|e| e.path().join("operator.log"));
            let mut metadata = logs.filter_map(|log| std::fs::metadata(log).ok());
            // A campaign that was killed leaves such files as well.
            metadata.any(|m| m.len() > 0 && m.modified().is_ok_and(|t| t > self.begun))
        })
    }

    fn signal(&self, name: &str) {
        let line = format!("kill -{name} {}", self.child.id());
        let status = Command::new("sh").args(["-c", &line]).status();
        assert!(status.expect("a shell").success(), "{line}");
    }

    fn end(mut self) -> Output {
        // Its pipes hold far more than it prints.
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

fn wait_for(what: &str, mut there: impl FnMut() -> bool) {
    let since = Instant::now();
    while !there() {
        assert!(since.elapsed() < PATIENCE, "{what} never came");
        // Shorter than anything that is waited for lasts.
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// A folder with a plan in it, and where its dataset is to be.
fn planned(plan: &str) -> (tempfile::TempDir, PathBuf, PathBuf) {
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

/// Logs of recordings under way in the folders below `folder`.
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
fn a_campaign_that_is_stopped_killed_twice_and_interrupted_ends_complete() {
    ends_complete_however_it_is_ended("process");
}

#[test]
fn one_over_sockets_that_is_stopped_killed_twice_and_interrupted_ends_complete() {
    ends_complete_however_it_is_ended("socket");
}

fn ends_complete_however_it_is_ended(worker: &str) {
    let (folder, plan, out) = planned(PLAN);
    let one = one_worker(&plan, &out);
    // Recordings under way lie elsewhere.
    let scratch = folder.path().join("scratch");
    let elsewhere = scratch.to_str().expect("text");
    let args = [&one[..], &["--worker", worker, "--scratch", elsewhere]].concat();

    let dry = run(&[&args[..], &["--dry-run"]].concat());
    let text = printed(&dry);
    // 2 episodes of 17 s at 10 Hz beside 2 x 234.
    assert!(text.contains("340") && text.contains("468"), "{text}");
    assert!(text.contains(elsewhere), "{text}");
    assert!(!out.exists() && !scratch.exists(), "a dry run made folders");

    // SIGTERM throws the running episode away.
    let campaign = Campaign::start(&args);
    wait_for("an operator at work", || campaign.at_work(&out));
    wait_for("a recording", || logs(&scratch) == 1);
    assert_eq!(logs(&out.join("staging")), 0);
    let second = run(&args);
    assert!(printed(&second).contains("another"), "{}", printed(&second));
    campaign.signal("TERM");
    let ended = campaign.end();
    assert_eq!(ended.status.code(), Some(3), "{}", printed(&ended));
    let staged = std::fs::read_dir(out.join("staging")).expect("a folder");
    assert_eq!(staged.count(), 0, "something half-made is left");
    let left = std::fs::read_dir(&scratch).expect("a folder");
    assert_eq!(left.count(), 0, "a recording is left");

    // Killed while the first episode is made, and while the second is.
    for done in [0, 1] {
        let campaign = Campaign::start(&args);
        wait_for("the next episode", || {
            done_lines(&out).len() == done && campaign.at_work(&out) && logs(&scratch) == 1
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
    wait_for("an operator at work", || campaign.at_work(&out));
    campaign.signal("INT");
    let ended = campaign.end();
    let text = printed(&ended);
    assert_eq!(ended.status.code(), Some(0), "{text}");
    assert!(
        text.contains("2 of 2 episodes") && text.contains(": complete"),
        "{text}"
    );

    // What the killed ones left is gone too.
    let left = std::fs::read_dir(&scratch).expect("a folder");
    assert_eq!(left.count(), 0, "a recording is left");

    // Nothing was done twice, and the next run does nothing.
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
    manifest_is_true(&out);
    merging_checks_every_file(&out, &folder.path().join("merged"));
    another_plan_is_refused(&plan, &args);
}

#[test]
fn the_next_episode_runs_while_a_file_is_finished_and_both_can_be_thrown_away() {
    let plan = PLAN.replace("episodes = 2", "episodes = 3");
    let plan = plan.replace(
        "[[task]]",
        "[variation.language]\nseed = 40\nsentences = 2\n[[task]]",
    );
    let (_folder, plan, out) = planned(&plan);
    let args = one_worker(&plan, &out);
    let staged = || std::fs::read_dir(out.join("staging")).map_or(0, Iterator::count);
    let campaign = Campaign::start(&args);
    wait_for("two at the same time", || staged() == 2);
    campaign.signal("TERM");
    let ended = campaign.end();
    assert_eq!(ended.status.code(), Some(3), "{}", printed(&ended));
    assert_eq!(staged(), 0, "something half-made is left");
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
    manifest_is_true(&out);
    a_scene_is_said_and_done_in_two_ways(&out);
}

/// Two episodes with one scene, another sentence and another operator each.
fn a_scene_is_said_and_done_in_two_ways(out: &Path) {
    let mut done = done_lines(out);
    done.sort_by_key(|line| line["episode"].to_string());
    let said = |line: &Value| line["scenario"]["language"]["seed"].as_u64();
    let [first, second, third] = &done[..] else {
        panic!("{done:?}");
    };
    assert_eq!([first, second, third].map(said), [40, 41, 40].map(Some));
    assert_eq!(first["seed"], second["seed"]);
    assert_ne!(first["seed"], third["seed"]);
    assert_eq!(first["scenario"]["objects"], second["scenario"]["objects"]);
    assert_ne!(first["instruction"], second["instruction"]);
    assert_ne!(first["seconds"], second["seconds"], "the same run twice");
}

#[test]
fn a_worker_that_dies_and_one_that_hangs_are_entered_and_the_campaign_ends_complete() {
    let words = [
        "the worker died (signal: 6",
        "the worker stalled and sent nothing for 6 s",
    ];
    what_dies_and_what_hangs_is_entered("process", words, |out, _| {
        format!("--for\0{}\0", out.display())
    });
}

#[test]
fn a_server_that_dies_and_one_that_hangs_are_entered_and_the_campaign_ends_complete() {
    let words = [
        "the server died (signal: 6",
        "the server stalled and answered nothing for 6 s",
    ];
    what_dies_and_what_hangs_is_entered("socket", words, |_, staging| {
        let socket = std::fs::read_to_string(staging.join("socket"));
        let socket = socket.expect("where the server listens");
        format!("unixsock-stream/{socket}/server\0--scenario")
    });
}

/// `line` is what the command line of the simulation holds of a dataset's folder and
/// an episode's.
fn what_dies_and_what_hangs_is_entered(
    worker: &str,
    words: [&str; 2],
    line: impl Fn(&Path, &Path) -> String,
) {
    let (_folder, plan, out) = planned(PLAN);
    let one = one_worker(&plan, &out);
    let args = [&one[..], &["--worker", worker]].concat();
    let campaign = Campaign::start(&[&args[..], &["--patience", "6"]].concat());
    // One dies while the first episode is made, one hangs during the second.
    for (index, signal) in [(0, "ABRT"), (1, "STOP")] {
        let staging = out.join(format!("staging/pick_mustard-000{index}"));
        let other = out.join(format!("staging/pick_mustard-000{}", 1 - index));
        wait_for("an operator at work, and no file in the making", || {
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
    manifest_is_true(&out);
    // Both are in the ledger with what reproduces them, and both were done with
    // the same seed by a new server.
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
    // They are done: the next run has nothing to do.
    let again = run(&args);
    assert_eq!(again.status.code(), Some(0), "{}", printed(&again));
    assert!(left_behind(&out).is_empty());
}

/// SIGKILL that the campaign did not send is what a system without memory sends.
#[test]
fn a_worker_killed_for_memory_costs_no_seed() {
    let (_folder, plan, out) = planned(&PLAN.replace("episodes = 2", "episodes = 1"));
    let campaign = Campaign::start(&one_worker(&plan, &out));
    let log = out.join("staging/pick_mustard-0000/operator.log");
    wait_for("an operator at work", || {
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
    manifest_is_true(&out);
}

/// What stands in a folder's files, by their names.
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
fn one_process_records_what_three_record_and_its_second_episode_is_as_fresh() {
    let depth = PLAN.replace("[scenario]", "depth = \"u16\"\n[scenario]");
    let (folder, plan, _) = planned(&depth);
    let [process, socket] = ["process", "socket"].map(|worker| {
        let out = folder.path().join(worker);
        let args = [&one_worker(&plan, &out)[..], &["--worker", worker]].concat();
        let made = run(&args);
        assert_eq!(made.status.code(), Some(0), "{}", printed(&made));
        manifest_is_true(&out);
        // Rows and pictures, the file's own words left out: a run's id and times.
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
    assert!(process.0 == socket.0, "rows or pictures differ");
    assert!(
        process.1[0].len() > 5 && process.1 == socket.1,
        "{:?}",
        process.1
    );
}

fn manifest_is_true(out: &Path) {
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

fn merging_checks_every_file(out: &Path, merged: &Path) {
    let args = |to| ["--merge", out.to_str().expect("text"), "--out", to];
    let good = run(&args(merged.to_str().expect("text")));
    assert_eq!(good.status.code(), Some(0), "{}", printed(&good));
    manifest_is_true(merged);
    // One flipped byte, in the source alone: the merged file is another name
    // of the same one where the disk allows that.
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
    // A file of the target that is damaged is replaced by a good one.
    let file = merged.join("episodes/pick_mustard-0000.h5");
    std::fs::remove_file(&file).expect("the file");
    std::fs::write(&file, "damaged").expect("a file");
    let mended = run(&args(merged.to_str().expect("text")));
    assert_eq!(mended.status.code(), Some(0), "{}", printed(&mended));
    assert!(std::fs::metadata(&file).expect("the file").len() > 1000);
    // Another campaign's folder stays as it is.
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

fn another_plan_is_refused(plan: &Path, args: &[&str]) {
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
