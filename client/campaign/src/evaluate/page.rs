//! The report as charts and as one self-contained HTML page: rates and intervals, progress,
//! time of success and causes of failure.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::Context;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use wheelarm_dataset::sheet::chart;

use super::entry::Entry;
use super::redraw::Redrawn;
use super::report::{Report, SHARES, TaskReport};

/// Kinds of ends with a separate colour; the others share one.
const KINDS: usize = 8;
/// Style of the pages.
pub const STYLE: &str = "
body { font: 16px/1.5 system-ui, sans-serif; max-width: 75rem; margin: 2rem auto; padding: 0 1rem; color: #1c2026; background: #fafaf8 }
h1, h2, h3 { line-height: 1.2 }
table { border-collapse: collapse; margin: 1rem 0; display: block; overflow-x: auto }
th, td { padding: .3rem .7rem; border-bottom: 1px solid #dee0e2; text-align: right; white-space: nowrap }
th:first-child, td:first-child { text-align: left }
td.words { text-align: left; white-space: normal }
img { max-width: 100%; border: 1px solid #dee0e2 }
figure { margin: 1rem 0 }
figcaption, .small { color: #5c626a; font-size: 14px }
.no { color: #a02c20 }
details { margin: .6rem 0 }
code { font-size: 13px }
";

/// Writes the charts and the page into a folder. Returns the path of the page.
///
/// # Errors
/// When a chart or a file cannot be written.
pub fn write(
    folder: &Path,
    report: &Report,
    entries: &[Entry],
    redrawn: &[Redrawn],
) -> anyhow::Result<PathBuf> {
    let charts = write_charts(folder, report, entries)?;
    let path = folder.join("report.html");
    let text = page(report, entries, &charts, redrawn)?;
    std::fs::write(&path, text).with_context(|| format!("writing {}", path.display()))?;
    Ok(path)
}

/// A chart with its caption.
struct Chart(PathBuf, &'static str);

fn write_charts(folder: &Path, report: &Report, entries: &[Entry]) -> anyhow::Result<Vec<Chart>> {
    let with = |tasks: &[TaskReport]| -> Vec<TaskReport> {
        let done = tasks.iter().filter(|task| task.episodes > 0);
        done.cloned().collect()
    };
    let tasks = with(&report.tasks);
    let mut charts = Vec::new();

    let (kinds, rows) = squares(&tasks, entries);
    let path = folder.join("outcomes.png");
    chart::squares(
        "How each episode ended, by task and seed",
        &kinds,
        &rows,
        &path,
    )?;
    charts.push(Chart(path, "Each square is an episode, in the order of the seeds; the number is the first seed of a line."));

    let path = folder.join("success.png");
    let lines: Vec<_> = tasks.iter().map(|task| stairs(task, entries)).collect();
    chart::shares_over_time("Share of episodes done, over simulated time", &lines, &path)?;
    charts.push(Chart(path, "How many episodes had succeeded when so much time had passed. A line ends at the rate of success."));

    let bars: Vec<_> = tasks
        .iter()
        .filter_map(|task| {
            let progress = task.progress.as_ref()?;
            let shares: Vec<f64> = progress.furthest.iter().map(|(_, share)| *share).collect();
            Some((task.task.clone(), progress.furthest.len(), shares))
        })
        .collect();
    // Tasks with the same steps share a chart, whose colours are the steps.
    let mut lengths: Vec<usize> = bars.iter().map(|(_, steps, _)| *steps).collect();
    let names = |steps: usize| {
        let of = |task: &&TaskReport| {
            task.progress
                .as_ref()
                .is_some_and(|p| p.furthest.len() == steps)
        };
        let mut names: Vec<Vec<String>> = tasks
            .iter()
            .filter(of)
            .filter_map(|task| task.progress.as_ref())
            .map(|p| p.furthest.iter().map(|(name, _)| name.clone()).collect())
            .collect();
        names.dedup();
        // Steps that differ at the same position: both names.
        let first = names.first().cloned().unwrap_or_default();
        (0..first.len())
            .map(|i| {
                let mut words: Vec<&str> = names.iter().map(|n| n[i].as_str()).collect();
                words.sort_unstable();
                words.dedup();
                words.join(" / ")
            })
            .collect::<Vec<String>>()
    };
    lengths.sort_unstable();
    lengths.dedup();
    for (number, steps) in lengths.into_iter().enumerate() {
        let path = folder.join(match number {
            0 => "progress.png".to_owned(),
            n => format!("progress-{}.png", n + 1),
        });
        let own = bars.iter().filter(|(_, count, _)| *count == steps);
        let rows: Vec<_> = own
            .map(|(name, _, shares)| (name.clone(), shares.clone()))
            .collect();
        chart::bars(
            "How far the episodes came, percent of them",
            &names(steps),
            &rows,
            &path,
        )?;
        charts.push(Chart(
            path,
            "Each episode counts at the furthest step that it reached.",
        ));
    }
    Ok(charts)
}

/// The kinds of ends, success first and then the most frequent, and each task's
/// episodes.
fn squares(tasks: &[TaskReport], entries: &[Entry]) -> (Vec<String>, Vec<chart::Squares>) {
    let mut counts: Vec<(String, usize)> = Vec::new();
    for entry in entries.iter().filter(|entry| !entry.success) {
        let cause = entry.cause();
        match counts.iter_mut().find(|(known, _)| *known == cause) {
            Some((_, count)) => *count += 1,
            None => counts.push((cause, 1)),
        }
    }
    counts.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    let mut kinds = vec!["success".to_owned()];
    kinds.extend(counts.into_iter().map(|(cause, _)| cause));
    let rows = tasks.iter().map(|task| {
        let own = entries.iter().filter(|entry| entry.task == task.task);
        let mut all: Vec<(u64, usize)> = own
            .map(|entry| {
                let cause = entry.cause();
                let kind = kinds.iter().position(|kind| *kind == cause);
                (
                    entry.seed,
                    if entry.success {
                        0
                    } else {
                        kind.unwrap_or(KINDS).min(KINDS)
                    },
                )
            })
            .collect();
        all.sort_unstable();
        (task.task.clone(), all)
    });
    let rows = rows.collect();
    if kinds.len() > KINDS + 1 {
        kinds.truncate(KINDS);
        kinds.push("others".to_owned());
    }
    (kinds, rows)
}

/// When the episodes of a task were done.
fn stairs(task: &TaskReport, entries: &[Entry]) -> chart::Steps {
    let own = entries.iter().filter(|e| e.task == task.task && e.success);
    let mut seconds: Vec<f64> = own.map(|entry| entry.seconds).collect();
    seconds.sort_by(f64::total_cmp);
    let share = |i: usize| (i + 1) as f64 / task.episodes as f64;
    let points = seconds.iter().enumerate().map(|(i, s)| (*s, share(i)));
    (task.task.clone(), points.collect())
}

fn page(
    report: &Report,
    entries: &[Entry],
    charts: &[Chart],
    redrawn: &[Redrawn],
) -> anyhow::Result<String> {
    let mut out = String::new();
    let title = format!(
        "{}: {} of {} episodes",
        report.policy, report.successes, report.episodes
    );
    writeln!(
        out,
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" \
         content=\"width=device-width, initial-scale=1\"><title>{0}</title><style>{STYLE}</style></head><body>\n<h1>{0}</h1>",
        escaped(&title)
    )?;
    let split = report
        .split
        .as_deref()
        .map_or(String::new(), |s| format!("split {s}, "));
    let settings = match report.settings.as_str() {
        "" => String::new(),
        words => format!(", {words}"),
    };
    writeln!(
        out,
        "<p>{}. Wilson 95 %: {}; Clopper-Pearson: {}.</p>",
        escaped(&format!("{split}seeds for {}{settings}", report.purpose)),
        percent(report.interval),
        percent(report.exact_interval)
    )?;
    table(&mut out, report)?;
    for Chart(path, words) in charts {
        writeln!(
            out,
            "<figure><img alt=\"{0}\" src=\"{1}\"><figcaption>{0}</figcaption></figure>",
            escaped(words),
            embedded(path)?
        )?;
    }
    failures(&mut out, report, entries, redrawn)?;
    numbers(&mut out, report, entries)?;
    out += "</body></html>\n";
    Ok(out)
}

fn table(out: &mut String, report: &Report) -> anyhow::Result<()> {
    out.push_str(
        "<table><tr><th>task<th>successes<th>rate<th>Wilson 95 %<th>Clopper-Pearson<th>progress, mean<th>median<th>time to success, s<th>median<th>knocked over<th>hard contacts<th>inference, ms<th>99 %<th>policy errors</tr>\n",
    );
    for task in report.tasks.iter().filter(|task| task.episodes > 0) {
        let number = |value: Option<f64>| value.map_or("–".to_owned(), |v| format!("{v:.1}"));
        let progress = task.progress.as_ref();
        let done = task.seconds_quantiles;
        writeln!(
            out,
            "<tr><td>{}<td>{}/{}<td>{:.1} %<td>{}<td>{}<td>{}<td>{}<td>{}<td>{}<td>{}<td>{}<td>{}<td>{}<td>{}</tr>",
            escaped(&task.task),
            task.successes,
            task.episodes,
            100.0 * task.rate,
            percent(task.interval),
            percent(task.exact_interval),
            match progress {
                // Those that broke have none.
                Some(p) if p.episodes < task.episodes => {
                    format!("{:.1} of {}", p.mean, p.episodes)
                }
                _ => number(progress.map(|p| p.mean)),
            },
            number(progress.map(|p| p.quantiles[2])),
            number(done.map(|_| task.mean_seconds)),
            number(done.map(|q| q[2])),
            task.knocked_over,
            task.hard_contacts[0],
            number(task.inference_ms.map(|(_, mean, _)| mean)),
            number(task.inference_ms.map(|(.., slow)| slow)),
            task.policy_errors.values().sum::<usize>(),
        )?;
    }
    out.push_str("</table>\n");
    let shares = SHARES
        .map(|share| format!("{:.0}", 100.0 * share))
        .join(", ");
    writeln!(
        out,
        "<p class=\"small\">Progress is the furthest step that was reached, percent of the way. Quantiles ({shares} %) stand in report.json.</p>"
    )?;
    Ok(())
}

/// Failures by cause, the most frequent first, with their contact sheets.
fn failures(
    out: &mut String,
    report: &Report,
    entries: &[Entry],
    redrawn: &[Redrawn],
) -> anyhow::Result<()> {
    let failed = report.tasks.iter().filter(|task| !task.causes.is_empty());
    let mut is_first = true;
    for task in failed {
        if std::mem::take(&mut is_first) {
            out.push_str("<h2>Failures by cause</h2>\n");
        }
        writeln!(out, "<h3>{}</h3>", escaped(&task.task))?;
        for (cause, seeds) in &task.causes {
            let of = |d: &&Redrawn| d.task == task.task && seeds.contains(&d.seed);
            let sheets: Vec<_> = redrawn.iter().filter(of).collect();
            let open = if sheets.is_empty() { "" } else { " open" };
            writeln!(
                out,
                "<details{open}><summary><span class=\"no\">{}</span>: {} of {}</summary>\n<table>",
                escaped(cause),
                seeds.len(),
                task.episodes
            )?;
            for seed in seeds {
                let of = |e: &&Entry| e.task == task.task && e.seed == *seed;
                let Some(entry) = entries.iter().find(of) else {
                    continue;
                };
                let progress = entry.course.as_ref().map_or(0, |course| course.percent);
                writeln!(
                    out,
                    "<tr><td>seed {seed}<td>{:.1} s<td>{progress} %<td class=\"words\">{}<td><code>{}</code></tr>",
                    entry.seconds,
                    escaped(&entry.why).replace('\n', "<br>"),
                    escaped(&entry.hash)
                )?;
            }
            out.push_str("</table>\n");
            for shown in sheets {
                let name = |path: &Path| {
                    let file = path.file_name().unwrap_or_default().to_string_lossy();
                    let folder = path.parent().and_then(Path::file_name).unwrap_or_default();
                    escaped(&format!("{}/{file}", folder.to_string_lossy()))
                };
                writeln!(
                    out,
                    "<figure><a href=\"{0}\"><img alt=\"contact sheet of seed {1}\" src=\"{2}\"></a><figcaption>seed {1}: <a href=\"{0}\">{0}</a>, drawn again at 720p ({3})</figcaption></figure>",
                    name(&shown.file),
                    shown.seed,
                    embedded(&shown.sheet)?,
                    escaped(&shown.states)
                )?;
            }
            out.push_str("</details>\n");
        }
    }
    Ok(())
}

/// Table of all episodes.
fn numbers(out: &mut String, report: &Report, entries: &[Entry]) -> anyhow::Result<()> {
    out.push_str("<details><summary>All episodes</summary><table><tr><th>task<th>seed<th>end<th>s<th>progress<th>state hash</tr>\n");
    for task in &report.tasks {
        let mut own: Vec<_> = entries.iter().filter(|e| e.task == task.task).collect();
        own.sort_by_key(|entry| entry.seed);
        for entry in own {
            let progress = entry.course.as_ref().map(|course| course.percent);
            writeln!(
                out,
                "<tr><td>{}<td>{}<td>{}<td>{:.1}<td>{}<td><code>{}</code></tr>",
                escaped(&entry.task),
                entry.seed,
                escaped(&entry.cause()),
                entry.seconds,
                progress.map_or("–".to_owned(), |percent| format!("{percent} %")),
                escaped(&entry.hash)
            )?;
        }
    }
    out.push_str("</table></details>\n");
    Ok(())
}

/// A chart as a data URL.
fn embedded(path: &Path) -> anyhow::Result<String> {
    let bytes = std::fs::read(path).with_context(|| format!("reading {}", path.display()))?;
    Ok(format!("data:image/png;base64,{}", STANDARD.encode(bytes)))
}

/// An interval of shares, in percent.
fn percent([low, high]: [f64; 2]) -> String {
    format!("{:.1} to {:.1} %", 100.0 * low, 100.0 * high)
}

/// Text with escaped markup: instructions and errors of policies are arbitrary.
pub fn escaped(words: &str) -> String {
    let mut out = String::with_capacity(words.len());
    for c in words.chars() {
        match c {
            '&' => out += "&amp;",
            '<' => out += "&lt;",
            '>' => out += "&gt;",
            '"' => out += "&quot;",
            '\'' => out += "&#39;",
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::scope::Scope;
    use crate::variation::Variation;

    fn entry(seed: u64, success: bool) -> Entry {
        let course = match success {
            true => r#"{"way":"lift","percent":100,"reached":[["done",9.0]]}"#,
            false => {
                r#"{"way":"lift","percent":40,"reached":[["touched",2.0]],"missing":"gripped"}"#
            }
        };
        let end = if success { "success" } else { "timeout" };
        let text = format!(
            r#"{{"task":"pick_bowl","seed":{seed},"success":{success},"why":"<script>alert(1)</script>","end":"{end}","course":{course},"conditions":[],"seconds":9.0,"factor":1.0,"hash":"ab{seed}","notes":[]}}"#
        );
        serde_json::from_str(&text).unwrap()
    }

    #[test]
    fn page_embeds_its_charts_and_escapes_the_causes_of_failures() {
        let folder = tempfile::tempdir().unwrap();
        let entries = [entry(0, true), entry(1, false), entry(2, false)];
        let scope = Scope {
            layout: false,
            split: None,
            seeds: 0..3,
            variation: Variation::default(),
        };
        let report = Report::new(&["pick_bowl".to_owned()], &entries, &scope);
        let path = write(folder.path(), &report, &entries, &[]).unwrap();
        let text = std::fs::read_to_string(path).unwrap();
        assert!(!text.contains("<script"), "text of a policy is escaped");
        assert!(
            text.contains("timeout, not both pads</span>: 2 of 3"),
            "{text}"
        );
        assert_eq!(text.matches("data:image/png;base64,").count(), 3);
        for words in ["1/3", "33.3 %", "ab2", "operator: 1 of 3"] {
            assert!(text.contains(words), "{words}");
        }
        // The page loads no other resources.
        assert!(!text.contains("src=\"http") && !text.contains("href=\"http"));
        for name in ["outcomes.png", "success.png", "progress.png"] {
            assert!(folder.path().join(name).is_file(), "{name}");
        }
    }

    #[test]
    fn many_kinds_of_ends_share_a_colour() {
        let entries: Vec<Entry> = (0..30)
            .map(|seed| Entry {
                end: format!("end {}", seed % 12),
                course: None,
                ..entry(seed, false)
            })
            .collect();
        let scope = Scope {
            layout: false,
            split: None,
            seeds: 0..30,
            variation: Variation::default(),
        };
        let report = Report::new(&["pick_bowl".to_owned()], &entries, &scope);
        let (kinds, rows) = squares(&report.tasks, &entries);
        assert_eq!(kinds.len(), KINDS + 1);
        assert_eq!(kinds.last().unwrap(), "others");
        assert!(rows[0].1.iter().all(|(_, kind)| *kind < kinds.len()));
    }
}
