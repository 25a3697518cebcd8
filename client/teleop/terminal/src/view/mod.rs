//! Renders the model. The view makes no decisions and reads only the size of the
//! terminal.
//!
//! Colors are the terminal's own sixteen on its own background, so that they are
//! readable on dark and on light; each color repeats the meaning of a word beside
//! it. `NO_COLOR` disables colors.

mod forms;
mod help;
mod panels;
mod theme;

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Borders, Paragraph, Wrap};

use crate::model::Model;
pub use theme::Theme;
use theme::WIDE;

/// Rows of the controls in two columns.
const CONTROLS: u16 = 13;

/// Renders everything; `now` in seconds of the model's clock.
pub fn draw(frame: &mut Frame<'_>, model: &Model, theme: Theme, now: f64) {
    let area = frame.area();
    let alarms = panels::alarms(model, theme);
    let width = usize::from(area.width.max(1));
    // A line that wraps between words may need one row more. The rest of the screen keeps
    // half of the rows.
    let rows = alarms
        .iter()
        .map(|line| line.width().div_ceil(width) + usize::from(line.width() > width))
        .sum::<usize>();
    let rows = u16::try_from(rows).unwrap_or(u16::MAX);
    let [top, alarm, body, bottom] = Layout::vertical([
        Constraint::Length(panels::header_rows(area.width)),
        Constraint::Length(rows.min(area.height / 2)),
        Constraint::Min(0),
        Constraint::Length(2),
    ])
    .areas(area);
    frame.render_widget(
        Paragraph::new(panels::header(model, theme, now, area.width)),
        top,
    );
    frame.render_widget(Paragraph::new(alarms).wrap(Wrap { trim: true }), alarm);
    if area.width >= WIDE {
        wide(frame, body, model, theme, now);
    } else {
        narrow(frame, body, model, theme, now);
    }
    frame.render_widget(Paragraph::new(message(model, theme)), bottom);
    if let Some(form) = &model.form {
        forms::draw(frame, area, form, model, theme);
    } else if model.help {
        help::draw(frame, area, theme);
    }
}

fn panel<'a>(title: &'a str, lines: Vec<Line<'a>>, theme: Theme) -> Paragraph<'a> {
    let block = Block::new()
        .borders(Borders::TOP)
        .border_style(theme.quiet())
        .title(Span::styled(format!(" {title} "), theme.title()));
    Paragraph::new(lines).block(block)
}

fn wide(frame: &mut Frame<'_>, area: Rect, model: &Model, theme: Theme, now: f64) {
    let [left, _, right] = Layout::horizontal([
        Constraint::Length(46),
        Constraint::Length(2),
        Constraint::Min(0),
    ])
    .areas(area);
    let [controls, log] =
        Layout::vertical([Constraint::Length(CONTROLS), Constraint::Min(0)]).areas(left);
    frame.render_widget(
        panel("keys", panels::controls(model, theme), theme),
        controls,
    );
    let rows = usize::from(log.height.saturating_sub(1));
    frame.render_widget(
        panel("what happened", panels::log(model, theme, now, rows), theme),
        log,
    );
    let sections = panels::state(model, theme, now);
    stack(frame, right, sections, theme);
}

fn narrow(frame: &mut Frame<'_>, area: Rect, model: &Model, theme: Theme, now: f64) {
    let mut sections = panels::state(model, theme, now);
    sections.push(("keys", panels::controls(model, theme)));
    sections.push(("what happened", panels::log(model, theme, now, 6)));
    stack(frame, area, sections, theme);
}

/// Sections below each other, each as high as its lines, until the room ends.
fn stack(
    frame: &mut Frame<'_>,
    area: Rect,
    sections: Vec<(&'static str, Vec<Line<'_>>)>,
    theme: Theme,
) {
    let mut rest = area;
    for (title, lines) in sections {
        let wanted = u16::try_from(lines.len() + 1).unwrap_or(u16::MAX);
        let height = wanted.min(rest.height);
        if height < 2 {
            return;
        }
        let [here, below] =
            Layout::vertical([Constraint::Length(height), Constraint::Min(0)]).areas(rest);
        frame.render_widget(panel(title, lines, theme), here);
        rest = below;
    }
}

fn message<'a>(model: &'a Model, theme: Theme) -> Vec<Line<'a>> {
    let mut line = Vec::new();
    if let Some(busy) = model.busy {
        line.push(Span::styled(format!("{busy} … "), theme.warning()));
    }
    match &model.message {
        Some(m) if m.bad => line.push(Span::styled(&m.text, theme.bad())),
        Some(m) => line.push(Span::styled(&m.text, theme.strong())),
        None => {}
    }
    vec![Line::from(line), panels::hints(model, theme)]
}

#[cfg(test)]
mod tests;
