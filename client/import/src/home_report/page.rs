//! The report as one HTML page to print, with the plan inside it.

use std::fmt::{self, Write};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use wheelarm_homes::home_report::HomeReport;
use wheelarm_homes::home_report::rooms::DIN_TURNING;
use wheelarm_homes::home_report::text::{
    advice, door_words, move_words, room_words, surface_name, surface_words,
};

const STYLE: &str = "body{font:11pt/1.4 sans-serif;max-width:60em;margin:2em auto;padding:0 1em;color:#222}\
h1{font-size:1.5em}h2{font-size:1.15em;margin-top:1.6em}table{border-collapse:collapse;width:100%}\
td,th{text-align:left;vertical-align:top;padding:.25em .6em;border-bottom:1px solid #ccc}\
td:first-child{width:38%}img{display:block;margin:auto;max-width:100%;max-height:40em;border:1px solid #ccc}\
.yes{color:#2b8a3e}.no{color:#c92a2a}.yes:before{content:\"✓ \"}.no:before{content:\"– \"}\
@page{margin:15mm}@media print{body{margin:0;max-width:none;font-size:9.5pt}\
h2{break-after:avoid}tr,img{break-inside:avoid}img{max-height:150mm}\
*{print-color-adjust:exact;-webkit-print-color-adjust:exact}}";

/// The page; `plan` is the PNG of the plan.
///
/// # Errors
/// None: writing to a string succeeds.
pub fn page(report: &HomeReport, plan: &[u8]) -> Result<String, fmt::Error> {
    let (robot, sum) = (&report.robot, &report.summary);
    let home = escaped(&report.home);
    let mut out = String::new();
    write!(
        out,
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{home}</title>\
<style>{STYLE}</style></head><body>\n<h1>{home}: what the robot reaches</h1>\n\
<p>The chair gets into <b>{} of {}</b> rooms and through <b>{} of {}</b> doors. \
The arm reaches <b>{} of {}</b> surfaces, and {} more from a start in their room. \
Places of {DIN_TURNING} m x {DIN_TURNING} m to turn: {}.</p>\n",
        sum.rooms_entered,
        sum.rooms,
        sum.doors_passed,
        sum.doors,
        sum.surfaces_reached,
        sum.surfaces,
        sum.surfaces_within,
        sum.turning_squares
    )?;
    if let Some(advice) = advice(report) {
        writeln!(out, "<p class=\"no\">{}</p>", escaped(&advice))?;
    }
    writeln!(
        out,
        "<p><img alt=\"Plan of the home\" src=\"data:image/png;base64,{}\"></p>\n\
<p>Blue floor: the middle of the driven wheels gets there. Green floor: the chair turns on the \
spot. Green surfaces are reached, orange ones are not; they have the numbers of the table below. \
A blue line leads from a stop of the chair to a surface. Figures in doors are clear widths in \
metres.</p>",
        STANDARD.encode(plan)
    )?;
    writeln!(
        out,
        "<h2>Needs</h2>\n<table><tr><th></th><th>DIN 18040-2</th><th>DIN 18040-2, wheelchair</th><th>robot {}, arm in posture {}</th></tr>\n\
<tr><td>clear width of doors</td><td>0.80 m</td><td>0.90 m</td><td>{:.2} m, straight on</td></tr>\n\
<tr><td>to turn</td><td>1.20 m x 1.20 m</td><td>{DIN_TURNING} m x {DIN_TURNING} m</td><td>circle of {:.2} m</td></tr></table>",
        escaped(&robot.name),
        robot.posture,
        robot.door,
        robot.turning_circle
    )?;
    let rooms = report.rooms.iter().map(|room| {
        let is_good = room.entered || room.outdoors;
        (room.name.clone(), room_words(room), is_good)
    });
    table(&mut out, "Rooms", rooms)?;
    let doors = report.doors.iter();
    let doors = doors.map(|door| {
        let is_good = door.passed || door.closed;
        (door.between.join(" - "), door_words(door), is_good)
    });
    table(&mut out, "Doors", doors)?;
    let surfaces = report.surfaces.iter().enumerate();
    let surfaces = surfaces.map(|(index, surface)| {
        let name = format!("{}. {}", index + 1, surface_name(surface));
        (name, surface_words(surface), surface.strip.is_some())
    });
    table(&mut out, "Surfaces", surfaces)?;
    for (title, slides) in [("Doors of furniture", false), ("Drawers", true)] {
        let leaves = report.leaves.iter().filter(|leaf| leaf.slides == slides);
        let leaves = leaves.map(|leaf| {
            let room = leaf.room.as_deref().unwrap_or("no room");
            let name = format!("{room}: {}", leaf.piece);
            (name, leaf.words(), leaf.stop.is_some())
        });
        table(&mut out, title, leaves)?;
    }
    let moves = report.to_move.iter();
    let moves = moves.map(|piece| (piece.piece.clone(), move_words(piece), true));
    table(&mut out, "What to move", moves)?;
    out.push_str("</body></html>\n");
    Ok(out)
}

/// A table of names and words under a heading; nothing for no rows.
fn table(
    out: &mut String,
    title: &str,
    rows: impl Iterator<Item = (String, String, bool)>,
) -> fmt::Result {
    let mut rows = rows.peekable();
    if rows.peek().is_none() {
        return Ok(());
    }
    write!(out, "<h2>{title}</h2>\n<table>\n")?;
    for (name, words, is_good) in rows {
        let class = if is_good { "yes" } else { "no" };
        let (name, words) = (escaped(&name), escaped(&words));
        writeln!(
            out,
            "<tr><td>{name}</td><td class=\"{class}\">{words}</td></tr>"
        )?;
    }
    out.push_str("</table>\n");
    Ok(())
}

/// Text for HTML. Names come from files.
fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            _ => out.push(letter),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_cannot_add_elements_to_the_page() {
        assert_eq!(
            escaped("<script src=\"a\">&"),
            "&lt;script src=&quot;a&quot;&gt;&amp;"
        );
    }
}
