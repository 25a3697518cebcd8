//! The report of a suite as one self-contained HTML page with an SVG chart.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use super::super::page::{STYLE, escaped};
use super::figures::{CellFigures, Kept, Row};
use super::file::{BASE, Suite};
use super::report::SuiteReport;

/// Sizes of the chart, pixels.
const WIDTH: f64 = 760.0;
const LABELS: f64 = 130.0;
const RIGHT: f64 = 150.0;
const LINE: f64 = 26.0;
const TOP: f64 = 34.0;
/// Colors of bars: the base, and strengths 1 to 3.
const COLORS: [&str; 4] = ["#9aa7b5", "#8fb3d9", "#4a86c5", "#c9a36a"];

/// Bar chart of the rates with their intervals, as SVG.
#[must_use]
pub fn chart(suite: &Suite, report: &SuiteReport) -> String {
    let height = TOP + LINE * report.cells.len() as f64 + 30.0;
    let x = |share: f64| LABELS + share * (WIDTH - LABELS - RIGHT);
    let bottom = height - 26.0;
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" width=\"{WIDTH}\" \
         font-family=\"system-ui, sans-serif\" font-size=\"13\" role=\"img\" aria-label=\"success by cell\">\n\
         <rect width=\"{WIDTH}\" height=\"{height}\" fill=\"#ffffff\"/>\n\
         <text x=\"{LABELS}\" y=\"18\">Success by cell, Wilson 95 %</text><text x=\"{}\" y=\"18\">kept of base</text>\n",
        WIDTH - RIGHT + 16.0
    );
    // Writing into a string cannot fail.
    for percent in (0..=100).step_by(20) {
        let x = x(f64::from(percent) / 100.0);
        let _ = writeln!(
            out,
            "<line x1=\"{x}\" x2=\"{x}\" y1=\"{}\" y2=\"{bottom}\" stroke=\"#dee0e2\"/><text x=\"{x}\" y=\"{}\" text-anchor=\"middle\" fill=\"#5c626a\">{percent} %</text>",
            TOP - 6.0,
            bottom + 17.0
        );
    }
    for (index, cell) in report.cells.iter().enumerate() {
        let top = TOP + LINE * index as f64;
        let middle = top + LINE / 2.0 - 3.0;
        let strength = suite.cell(&cell.cell).map_or(0, |cell| cell.strength);
        let color = COLORS[(strength as usize).min(COLORS.len() - 1)];
        let [low, high] = cell.interval.map(x);
        let _ = writeln!(
            out,
            "<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{}</text>\
             <rect x=\"{LABELS}\" y=\"{top}\" width=\"{:.1}\" height=\"{}\" fill=\"{color}\"/>\
             <path d=\"M{low:.1} {middle}H{high:.1}M{low:.1} {}v8M{high:.1} {}v8\" stroke=\"#1c2026\" fill=\"none\"/>\
             <text x=\"{}\" y=\"{}\">{}</text>",
            LABELS - 8.0,
            middle + 4.0,
            escaped(&cell.cell),
            x(cell.rate) - LABELS,
            LINE - 6.0,
            middle - 4.0,
            middle - 4.0,
            WIDTH - RIGHT + 16.0,
            middle + 4.0,
            cell.kept.as_ref().map_or("–".to_owned(), kept)
        );
    }
    if let Some(base) = report.cell(BASE) {
        let x = x(base.rate);
        let _ = writeln!(
            out,
            "<line x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{}\" y2=\"{bottom}\" stroke=\"#a02c20\" stroke-dasharray=\"4 3\"/>",
            TOP - 6.0
        );
    }
    out + "</svg>\n"
}

/// A kept share with its interval.
pub fn kept(kept: &Kept) -> String {
    let [low, high] = kept.interval;
    format!("{:.2} ({low:.2} to {high:.2})", kept.share)
}

/// The page.
#[must_use]
pub fn page(suite: &Suite, report: &SuiteReport, chart: &str) -> String {
    let policy = &report.identity.policy;
    let title = format!("{}: {}", suite.name, policy.name);
    let mut out = format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\
         <title>{0}</title><style>{STYLE}</style></head><body>\n<h1>{0}</h1>\n",
        escaped(&title)
    );
    identity(&mut out, report);
    out += "<figure>";
    out += chart;
    out += "<figcaption>The dashed line is the base. Whiskers are Wilson's interval at 95 %. Kept: successes of the cell over those of its reference on the same tasks and seeds, with a paired bootstrap interval.</figcaption></figure>\n";
    cells(&mut out, report);
    tasks(&mut out, report);
    causes(&mut out, report);
    rows(&mut out, &report.rows);
    out + "</body></html>\n"
}

fn identity(out: &mut String, report: &SuiteReport) {
    let policy = &report.identity.policy;
    let ledger = match &policy.ledger {
        None => "undeclared".to_owned(),
        Some(hash) if policy.undeclared.is_empty() => hash.clone(),
        Some(hash) => {
            let kinds = policy.undeclared.iter().map(|kind| kind.name());
            format!(
                "{hash}, undeclared: {}",
                kinds.collect::<Vec<_>>().join(", ")
            )
        }
    };
    *out += "<table>";
    for (name, value) in [
        ("suite hash", report.identity.suite.hash.clone()),
        ("policy weights", policy.weights.clone()),
        ("policy files", policy.files.clone()),
        ("training ledger", ledger),
        (
            "physics version",
            report.identity.physics_version.to_string(),
        ),
    ] {
        let _ = writeln!(
            out,
            "<tr><td>{name}<td class=\"words\"><code>{}</code></tr>",
            escaped(&value)
        );
    }
    for session in &report.sessions {
        let line = format!("{}; {}", session.program, session.hardware.line());
        let _ = writeln!(
            out,
            "<tr><td>session<td class=\"words\">{}</tr>",
            escaped(&line)
        );
    }
    *out += "</table>\n";
}

fn cells(out: &mut String, report: &SuiteReport) {
    *out += "<table><tr><th>cell<th>successes<th>rate<th>Wilson 95 %<th>kept<th>compared with<th>pairs<th>broken</tr>\n";
    for cell in &report.cells {
        let [low, high] = cell.interval;
        let (share, against, pairs) = match &cell.kept {
            Some(of) => (kept(of), escaped(&of.against), of.pairs.to_string()),
            None => ("–".to_owned(), "–".to_owned(), "–".to_owned()),
        };
        let _ = writeln!(
            out,
            "<tr><td>{}<td>{}/{}<td>{:.1} %<td>{:.1} to {:.1} %<td>{share}<td>{against}<td>{pairs}<td>{}</tr>",
            escaped(&cell.cell),
            cell.successes,
            cell.episodes,
            100.0 * cell.rate,
            100.0 * low,
            100.0 * high,
            cell.broken
        );
    }
    *out += "</table>\n";
}

/// Successes by task and cell.
fn tasks(out: &mut String, report: &SuiteReport) {
    let names: BTreeMap<&String, ()> = report
        .cells
        .iter()
        .flat_map(|cell| cell.tasks.keys().map(|task| (task, ())))
        .collect();
    *out += "<h2>Successes by task</h2>\n<table><tr><th>task";
    for cell in &report.cells {
        let _ = write!(out, "<th>{}", escaped(&cell.cell));
    }
    *out += "</tr>\n";
    for task in names.keys() {
        let _ = write!(out, "<tr><td>{}", escaped(task));
        for cell in &report.cells {
            let _ = match cell.tasks.get(*task) {
                Some([successes, episodes]) => write!(out, "<td>{successes}/{episodes}"),
                None => write!(out, "<td>–"),
            };
        }
        *out += "</tr>\n";
    }
    *out += "</table>\n";
}

/// Failures by cause, the worst cell first.
fn causes(out: &mut String, report: &SuiteReport) {
    *out += "<h2>Failures by cause, the worst cell first</h2>\n<table><tr><th>cell<th>failures<th>causes</tr>\n";
    let mut worst: Vec<&CellFigures> = report.cells.iter().collect();
    worst.sort_by(|a, b| a.rate.total_cmp(&b.rate));
    for cell in worst.iter().filter(|cell| !cell.causes.is_empty()) {
        let mut causes: Vec<(&String, &usize)> = cell.causes.iter().collect();
        causes.sort_by_key(|(_, count)| std::cmp::Reverse(**count));
        let words = causes
            .iter()
            .map(|(cause, count)| format!("{cause}: {count}"));
        let _ = writeln!(
            out,
            "<tr><td>{}<td>{}<td class=\"words\">{}</tr>",
            escaped(&cell.cell),
            cell.episodes - cell.successes,
            escaped(&words.collect::<Vec<_>>().join("; "))
        );
    }
    *out += "</table>\n";
}

fn rows(out: &mut String, rows: &[Row]) {
    *out += "<details><summary>All episodes</summary><table><tr><th>cell<th>task<th>seed<th>end<th>s<th>progress<th>state<th>sentence</tr>\n";
    for row in rows {
        let _ = writeln!(
            out,
            "<tr><td>{}<td>{}<td>{}<td>{}<td>{:.1}<td>{}<td><code>{}</code><td class=\"words\">{}</tr>",
            escaped(&row.cell),
            escaped(&row.task),
            row.seed,
            escaped(&row.cause),
            row.milliseconds as f64 * 1e-3,
            row.progress
                .map_or("–".to_owned(), |percent| format!("{percent} %")),
            escaped(&row.state),
            escaped(&row.instruction)
        );
    }
    *out += "</table></details>\n";
}

#[cfg(test)]
mod tests {
    use super::super::test_suite::{identity, rows, suite};
    use super::*;

    #[test]
    fn page_has_a_bar_for_every_cell_loads_nothing_and_escapes_sentences() {
        let suite = suite();
        let report = SuiteReport::new(&suite, identity(&suite), Vec::new(), rows(&suite));
        let chart = chart(&suite, &report);
        // The background and two bars.
        assert_eq!(chart.matches("<rect").count(), 1 + 2);
        assert!(
            chart.contains("start-2") && chart.contains("0.67 ("),
            "{chart}"
        );
        let page = page(&suite, &report, &chart);
        for words in [
            "small: hold",
            "<td>3/4<td>75.0 %",
            "take it &amp; go",
            "timeout: 2",
            "<td>pick_bowl<td>2/2<td>1/2",
        ] {
            assert!(page.contains(words), "{words}: {page}");
        }
        assert!(!page.contains("src=") && !page.contains("href="));
    }
}
