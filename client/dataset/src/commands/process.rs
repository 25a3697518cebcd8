//! Commands on many recordings.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::Context;
use sha2::{Digest, Sha256};
use wheelarm_dataset::align::{self, accuracy};
use wheelarm_dataset::convert::batch::{self, Numbers, each, failures, threads};
use wheelarm_dataset::convert::csv_table::CsvTable;
use wheelarm_dataset::convert::learning::RowOptions;
use wheelarm_dataset::convert::lerobot::{ImageFormat, LeRobot, LeRobotOptions};
use wheelarm_dataset::convert::mcap_log::McapLog;
use wheelarm_dataset::convert::robomimic::Robomimic;
use wheelarm_dataset::convert::rosbag2::Rosbag2;
use wheelarm_dataset::convert::tensors::Tensors;
use wheelarm_dataset::convert::wheelarm_sim::WheelarmSim;
use wheelarm_dataset::convert::{Capabilities, Format, FormatName, PendingFile, Recording};
use wheelarm_dataset::label::{self, Agreement, agreement};
use wheelarm_dataset::read::Episode;
use wheelarm_dataset::{composition, plot as plots, validate as check, view as pages};
use wheelarm_policy::ledger::Ledger;

use super::arguments::{FAILED, FINE, Files, Input, PARTIAL};
use super::files::{beside, check_image_path, jobs, options, recordings};
use super::parts;

/// Boundaries agree when they are this near, seconds.
const NEAR: f64 = 0.5;

fn code<T>(results: &batch::Results<T>) -> u8 {
    code_of(results, results.len() > 1)
}

fn code_of<T>(results: &batch::Results<T>, several: bool) -> u8 {
    if failures(results, several) {
        FAILED
    } else {
        FINE
    }
}

pub fn align(input: &Input, out: Option<&Path>, images: bool) -> anyhow::Result<u8> {
    let files = recordings(&input.files)?;
    let options = options(input, &files)?;
    let bar = batch::bar("images");
    let results = each(&files, jobs(&input.files), |_, file| {
        let recording = Recording::open(file, &options, &|_| true)?;
        let pending = PendingFile::new(&beside(file, out, "aligned.h5"))?;
        let rows = recording.aligned.stamps.len();
        if images {
            bar.inc_length((rows * recording.cameras.len()) as u64);
        }
        let tick = || bar.inc(1);
        align::write(
            pending.path(),
            &recording.episode,
            &recording.aligned,
            &recording.labels,
            images,
            &tick,
        )?;
        let path = pending.commit()?;
        let accuracies = accuracy::accuracy(&recording.episode)?;
        bar.suspend(|| {
            println!("{}: {rows} rows", path.display());
            for (stream, c) in &recording.aligned.coverage {
                let lost = c.valid.iter().filter(|v| !**v).count();
                // A stream without samples has no rows to lose.
                if lost > 0 && c.samples > 0 {
                    println!("  {stream}: {}", without_value(lost, c));
                }
            }
            println!("  {}", between_samples(&recording.aligned));
            for accuracy in &accuracies {
                println!("  {accuracy}");
            }
        });
        Ok(())
    });
    bar.finish_and_clear();
    Ok(code(&results))
}

/// Why rows of a stream have no value, with the fix.
fn without_value(lost: usize, coverage: &align::Coverage) -> String {
    match coverage.samples {
        1 => format!(
            "{lost} rows have no value: the stream has one sample, and a row needs one on both \
             sides; record for longer"
        ),
        samples if coverage.limit == 0 => format!(
            "{lost} rows have no value: the {samples} samples of the stream are all of one time, \
             and a row needs one on both sides; record for longer"
        ),
        _ => format!(
            "{lost} rows have no samples within {:.3} s on both sides",
            coverage.limit as f64 * 1e-9
        ),
    }
}

/// Which streams have rows that do not fall on a sample.
fn between_samples(aligned: &align::Aligned) -> String {
    let rows = aligned.stamps.len();
    let continuous = |stream: &str| {
        let mut columns = aligned.signals.iter().filter(|s| s.meta.stream == stream);
        columns.any(|s| s.rule != align::Rule::Nearest)
    };
    let coverage = aligned.coverage.iter().filter(|(s, _)| continuous(s));
    let streams = coverage.filter_map(|(stream, c)| {
        let rows = c.valid.iter().zip(&c.age).filter(|(v, a)| **v && **a > 0);
        let count = rows.count();
        (count > 0).then(|| format!("{stream} {count}"))
    });
    let streams: Vec<String> = streams.collect();
    if streams.is_empty() {
        format!("all {rows} rows coincide with samples: no value is interpolated")
    } else {
        format!(
            "rows between samples, of {rows}: {} (0 of the others)",
            streams.join(", ")
        )
    }
}

pub fn label(input: &Input, out: Option<&Path>) -> anyhow::Result<u8> {
    let files = recordings(&input.files)?;
    let options = options(input, &files)?;
    let results = each(&files, jobs(&input.files), |_, file| {
        let episode = Episode::open(file)?;
        let summary = episode.summary()?;
        let start = summary.span_nanos.0;
        let found = label::segments(&episode)?;
        let agreement = agreement(&episode, &found)?;
        let segments = options.corrections.apply(&summary.label, start, found);
        let [task, ..] = summary.task;
        Ok((summary.label, task, start, segments, agreement))
    });
    let mut table = Vec::new();
    let mut compared: BTreeMap<String, Vec<Agreement>> = BTreeMap::new();
    for (_, result) in &results {
        if let Ok((name, task, start, segments, agreement)) = result {
            table.push((name.clone(), *start, segments.clone()));
            if let Some(agreement) = agreement {
                if !agreement.within(NEAR) {
                    println!("{name}: {}", disagreement(agreement, *start));
                }
                compared
                    .entry(task.clone())
                    .or_default()
                    .push(agreement.clone());
            }
        }
    }
    // Without a row, write neither a table nor a file that would stop the next run.
    if table.is_empty() {
        return Ok(code(&results));
    }
    match out {
        Some(path) => {
            let pending = PendingFile::new(path)?;
            label::write(std::fs::File::create_new(pending.path())?, &table)?;
            println!("{}", pending.commit()?.display());
        }
        None => label::write(std::io::stdout().lock(), &table)?,
    }
    if !compared.is_empty() {
        for (task, episodes) in &compared {
            println!("  {task:<20} {}", agreed(episodes));
        }
        let all: Vec<Agreement> = compared.into_values().flatten().collect();
        println!("within {NEAR} s of the operator's phases: {}", agreed(&all));
    }
    Ok(code(&results))
}

/// Number of matching episodes, and the distances of their boundaries.
fn agreed(all: &[Agreement]) -> String {
    let differences = all.iter().filter_map(|a| a.differences.as_ref()).flatten();
    let worst = differences.fold(0.0_f64, |w, d| w.max(d.abs()));
    format!(
        "{:.1} % of {} episodes (worst boundary of those in the same order {worst:.3} s)",
        100.0 * label::share_within(all, NEAR),
        all.len()
    )
}

fn disagreement(a: &Agreement, start: u64) -> String {
    let list = |all: &[label::Segment]| {
        let each = all.iter().map(|s| {
            format!(
                "{} from {:.2} s",
                label::NAMES[usize::from(s.label).min(3)],
                s.from.saturating_sub(start) as f64 * 1e-9
            )
        });
        each.collect::<Vec<_>>().join(", ")
    };
    format!("published {}; found {}", list(&a.published), list(&a.found))
}

pub fn export(
    input: &Input,
    name: FormatName,
    out: &Path,
    set: LeRobotOptions,
) -> anyhow::Result<u8> {
    let LeRobotOptions { size, rows, .. } = set;
    let part = parts::own()?;
    let is_part = part.is_some();
    let (files, numbers) = match part {
        Some(part) => part,
        None => (recordings(&input.files)?, Numbers::ALL),
    };
    let (options, jobs) = (options(input, &files)?, jobs(&input.files));
    let processes = parts::worth(files.len(), jobs);
    // Files at once times threads of one file: the number of CPUs.
    let jobs = (jobs / numbers.step).max(1);
    let inner = (threads() / numbers.step / jobs.min(files.len().max(1))).max(1);
    let folder = out.to_owned();
    check_options(name, &set)?;
    let format: Box<dyn Format> = match name {
        FormatName::WheelarmSim => Box::new(WheelarmSim {
            out: folder,
            threads: inner,
        }),
        FormatName::Csv => Box::new(CsvTable {
            out: folder,
            rows,
            threads: inner,
        }),
        FormatName::Lerobot => Box::new(LeRobot::new(out, set, threads())?),
        FormatName::Robomimic => Box::new(Robomimic::new(out, size, rows, threads())?),
        FormatName::Tensors => Box::new(Tensors {
            out: folder,
            size,
            depth: set.depth,
            rows,
            threads: inner,
        }),
        FormatName::Mcap => Box::new(McapLog {
            out: folder,
            threads: inner,
        }),
        FormatName::Rosbag2 => Box::new(Rosbag2 {
            out: folder,
            threads: inner,
        }),
    };
    if processes > 1 && !is_part && !format.collects() {
        let (files, twice) = once_each(files);
        return Ok(parts::export(&files, processes)?.max(if twice { FAILED } else { FINE }));
    }
    let several = is_part || files.len() + input.files.left_out.len() > 1;
    let results = batch::export(&files, numbers, jobs, &options, format);
    Ok(code_of(&results, several))
}

type Applies = fn(Capabilities) -> bool;

/// Rejects options that have no effect in a format.
fn check_options(name: FormatName, options: &LeRobotOptions) -> anyhow::Result<()> {
    // Names every option: a new one does not compile until its formats are decided.
    let LeRobotOptions {
        size,
        rows,
        language,
        image_format,
        depth,
    } = options;
    let rules: [(bool, Applies, &str, &str); 5] = [
        (
            size.is_some(),
            |format| format.scales,
            "--size is",
            "this format keeps the recorded size",
        ),
        (
            *rows != RowOptions::default(),
            |format| format.action_rows,
            "--action and --trim-idle are",
            "this format has no rows of action",
        ),
        (
            *language,
            |format| format.language,
            "--language is",
            "`annotate` writes labels beside any recording",
        ),
        (
            *depth,
            |format| format.depth,
            "--depth is",
            "mcap and rosbag2 contain the depth sensors' images unchanged",
        ),
        (
            *image_format != ImageFormat::default(),
            |format| format.image_formats,
            "--images is",
            "the other formats have one way to store images",
        ),
    ];
    for (is_set, applies, option, instead) in rules {
        if is_set && !applies(name.capabilities()) {
            anyhow::bail!("{option} for {}; {instead}", FormatName::with(applies));
        }
    }
    Ok(())
}

/// Files without those whose label another one has, which are reported: processes that work
/// side by side would not know of each other's.
fn once_each(files: Vec<PathBuf>) -> (Vec<PathBuf>, bool) {
    let mut labels: BTreeMap<String, PathBuf> = BTreeMap::new();
    let (mut once, mut twice) = (Vec::new(), false);
    for file in files {
        // The export reports files that cannot be read.
        let label = Episode::open(&file).and_then(|episode| episode.label());
        match label
            .ok()
            .and_then(|label| labels.insert(label, file.clone()))
        {
            None => once.push(file),
            Some(other) => {
                twice = true;
                eprintln!(
                    "{} and {} are recordings of the same label: give another --out for one of them",
                    other.display(),
                    file.display()
                );
            }
        }
    }
    (once, twice)
}

pub fn validate(input: &Files) -> anyhow::Result<u8> {
    let files = recordings(input)?;
    let jobs = jobs(input);
    let inner = (threads() / jobs.min(files.len().max(1))).max(1);
    let bar = batch::bar("files");
    bar.set_length(files.len() as u64);
    let results = each(&files, jobs, |_, file| {
        let found = check::validate(file, inner);
        bar.inc(1);
        found
    });
    bar.finish_and_clear();
    let mut problems = 0;
    for (file, result) in &results {
        if let Ok(found) = result {
            let verdict = if found.problems.is_empty() {
                "ok"
            } else {
                "PROBLEMS"
            };
            print!("{}: {verdict}\n{found}", file.display());
            problems += usize::from(!found.problems.is_empty());
        }
    }
    println!(
        "{} of {} recordings are fine",
        results
            .iter()
            .filter(|r| r.1.as_ref().is_ok_and(|f| f.problems.is_empty()))
            .count(),
        results.len() + input.left_out.len()
    );
    Ok(match (failures(&results, true), problems) {
        (true, _) => FAILED,
        (false, 0) => FINE,
        (false, _) => PARTIAL,
    })
}

pub fn stats(input: &Files, plot: Option<&Path>, csv: Option<&Path>) -> anyhow::Result<u8> {
    plot.map_or(Ok(()), check_image_path)?;
    let files = recordings(input)?;
    let results = each(&files, jobs(input), |_, file| composition::figures(file));
    let figures: Vec<_> = results
        .iter()
        .filter_map(|r| r.1.as_ref().ok().cloned())
        .collect();
    if figures.is_empty() {
        return Ok(code(&results));
    }
    let rows = composition::gather(&figures);
    print!("{}", composition::table(&rows));
    if let Some(path) = plot {
        composition::plot(&rows, path)?;
        println!("{}", path.display());
    }
    if let Some(path) = csv {
        let pending = PendingFile::new(path)?;
        composition::csv(&rows, std::fs::File::create_new(pending.path())?)?;
        println!("{}", pending.commit()?.display());
    }
    Ok(code(&results))
}

/// Writes the training ledger of a policy that was trained on the recordings. `weights` is
/// the file of the policy, whose hash binds the ledger to it.
pub fn ledger(input: &Files, out: &Path, weights: Option<&Path>) -> anyhow::Result<u8> {
    let files = recordings(input)?;
    let results = each(&files, jobs(input), |_, file| {
        Ok(Episode::open(file)?.scenario()?)
    });
    let mut ledger = Ledger::default();
    let scenarios = results
        .iter()
        .filter_map(|(_, result)| result.as_ref().ok());
    scenarios.for_each(|scenario| ledger.add(scenario));
    let code = code(&results);
    // A ledger that leaves out an episode would declare too little.
    if code != FINE {
        return Ok(code);
    }
    if let Some(weights) = weights {
        let bytes = std::fs::read(weights)
            .with_context(|| format!("reading the policy {}", weights.display()))?;
        let digest = Sha256::digest(bytes);
        ledger.policy = digest.iter().map(|byte| format!("{byte:02x}")).collect();
    }
    std::fs::write(out, ledger.text()).with_context(|| format!("writing {}", out.display()))?;
    println!(
        "{}: {} episodes, hash {}",
        out.display(),
        files.len(),
        ledger.hash()
    );
    Ok(code)
}

pub fn plot(input: &Input, out: Option<&Path>) -> anyhow::Result<u8> {
    let files = recordings(&input.files)?;
    let options = options(input, &files)?;
    let results = each(&files, jobs(&input.files), |_, file| {
        let episode = Episode::open(file)?;
        let movement = beside(file, out, "movement.png");
        plots::movement(&episode, &movement)?;
        let synchronisation = beside(file, out, "synchronisation.png");
        plots::synchronisation(&episode, &options.align, &synchronisation)?;
        println!("{}\n{}", movement.display(), synchronisation.display());
        Ok(())
    });
    Ok(code(&results))
}

pub fn view(input: &Input, out: Option<&Path>) -> anyhow::Result<u8> {
    let files = recordings(&input.files)?;
    let options = options(input, &files)?;
    let jobs = jobs(&input.files);
    let inner = (threads() / jobs.min(files.len().max(1))).max(1);
    let bar = batch::bar("rows");
    let results = each(&files, jobs, |_, file| {
        let recording = Recording::open(file, &options, &pages::wants)?;
        bar.inc_length(recording.aligned.stamps.len() as u64);
        let page = beside(file, out, "html");
        pages::page(&recording, &page, inner, &|| bar.inc(1))?;
        bar.suspend(|| println!("{}", page.display()));
        Ok(())
    });
    bar.finish_and_clear();
    Ok(code(&results))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stream_that_is_too_short_is_reported_as_that_and_not_as_a_limit_of_zero() {
        let of = |samples, limit| {
            let coverage = align::Coverage {
                span: (0, 0),
                samples,
                limit,
                valid: vec![false; 4],
                age: vec![0; 4],
            };
            without_value(4, &coverage)
        };
        for (samples, limit) in [(1, 0), (3, 0), (1, 40_000_000)] {
            let words = of(samples, limit);
            assert!(
                words.contains("record for longer") && !words.contains("0.000"),
                "{words}"
            );
        }
        assert!(of(9, 42_000_000).contains("within 0.042 s"));
    }
}
