//! Draws the model. Nothing is decided here, and nothing is asked of the
//! terminal but its size.
//!
//! Colours come from the terminal's own sixteen and stand on its own
//! background, so that they can be read on dark and on light; every colour
//! says what a word beside it says too. With `NO_COLOR` there are none.

mod forms;
mod help;
mod panels;

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Borders, Clear, Paragraph};

use super::model::Model;

/// Two columns from this width on, characters.
const WIDE: u16 = 96;
/// Rows that the controls take in two columns.
const CONTROLS: u16 = 13;

/// Styles, with or without colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Theme {
    /// Colours are wanted.
    pub colours: bool,
}

impl Theme {
    fn coloured(self, colour: Color) -> Style {
        if self.colours {
            Style::new().fg(colour)
        } else {
            Style::new()
        }
    }

    fn good(self) -> Style {
        self.coloured(Color::Green)
    }

    fn bad(self) -> Style {
        self.coloured(Color::Red).add_modifier(Modifier::BOLD)
    }

    fn warning(self) -> Style {
        self.coloured(Color::Magenta).add_modifier(Modifier::BOLD)
    }

    fn title(self) -> Style {
        self.coloured(Color::Blue).add_modifier(Modifier::BOLD)
    }

    fn strong(self) -> Style {
        Style::new().add_modifier(Modifier::BOLD)
    }

    fn quiet(self) -> Style {
        Style::new().add_modifier(Modifier::DIM)
    }

    fn key(self) -> Style {
        self.coloured(Color::Cyan).add_modifier(Modifier::BOLD)
    }

    fn latched(self) -> Style {
        self.strong().add_modifier(Modifier::REVERSED)
    }
}

/// Draws everything; `now` in seconds of the model's clock.
pub fn draw(frame: &mut Frame<'_>, model: &Model, theme: Theme, now: f64) {
    let area = frame.area();
    let [top, body, bottom] = Layout::vertical([
        Constraint::Length(panels::header_rows(area.width)),
        Constraint::Min(0),
        Constraint::Length(2),
    ])
    .areas(area);
    frame.render_widget(
        Paragraph::new(panels::header(model, theme, now, area.width)),
        top,
    );
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

/// A box in the middle for a form or the help.
fn overlay(frame: &mut Frame<'_>, area: Rect, title: &str, lines: Vec<Line<'_>>, theme: Theme) {
    let width = area.width.min(84);
    let height = area
        .height
        .min(u16::try_from(lines.len() + 2).unwrap_or(u16::MAX));
    let here = Rect {
        x: area.x + (area.width - width) / 2,
        y: area.y + (area.height - height) / 2,
        width,
        height,
    };
    let block = Block::bordered()
        .border_style(theme.title())
        .title(Span::styled(format!(" {title} "), theme.title()));
    frame.render_widget(Clear, here);
    frame.render_widget(Paragraph::new(lines).block(block), here);
}

#[cfg(test)]
mod tests;
