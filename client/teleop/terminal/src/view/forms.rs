//! The forms over the screen.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};

use super::theme::{Theme, overlay};
use crate::form::{Field, Form, START_FIELDS};
use crate::model::Model;

/// Width of a field's text, characters.
const FIELD: usize = 60;

fn field<'a>(field: &Field, focused: bool, theme: Theme) -> Vec<Span<'a>> {
    let (before, after) = field.halves();
    // The part around the cursor is shown.
    let keep = before.chars().count().saturating_sub(FIELD - 1);
    let before: String = before.chars().skip(keep).collect();
    let room = FIELD.saturating_sub(before.chars().count());
    let mut rest = after.chars();
    if !focused {
        let after: String = rest.take(room).collect();
        return vec![Span::raw(format!("{before}{after}"))];
    }
    let under = rest.next().unwrap_or(' ');
    let after: String = rest.take(room.saturating_sub(1)).collect();
    vec![
        Span::styled(before, theme.strong()),
        Span::styled(under.to_string(), theme.latched()),
        Span::styled(after, theme.strong()),
    ]
}

fn named<'a>(name: &str, text: &Field, focused: bool, theme: Theme) -> Line<'a> {
    let mark = if focused { ">" } else { " " };
    let mut line = vec![Span::styled(format!(" {mark} {name:<12}"), theme.key())];
    line.extend(field(text, focused, theme));
    Line::from(line)
}

fn problem_line<'a>(problem: &str, theme: Theme) -> Line<'a> {
    Line::from(Span::styled(format!(" {problem}"), theme.bad()))
}

/// Renders a form over the screen.
pub fn draw(frame: &mut Frame<'_>, area: Rect, form: &Form, model: &Model, theme: Theme) {
    match form {
        Form::Start {
            fields,
            focus,
            problem,
        } => {
            let mut lines: Vec<_> = (0..fields.len())
                .map(|i| named(START_FIELDS[i], &fields[i], i == *focus, theme))
                .collect();
            let connected = model.situation.status.as_ref();
            let connected = connected.map_or(0, |s| s.recorders.len());
            lines.push(Line::default());
            lines.push(Line::from(format!(
                " recorders that must be ready; {connected} connected now; 0 practises: nothing is kept"
            )));
            lines.push(problem_line(problem, theme));
            overlay(frame, area, "start an episode", lines, theme);
        }
        Form::Reset {
            tasks,
            chosen,
            seed,
            problem,
        } => {
            let mut lines: Vec<_> = tasks
                .iter()
                .enumerate()
                .map(|(i, task)| {
                    let says = task.instructions.first().cloned().unwrap_or_default();
                    let text = format!("   {:<16} {says}", task.name);
                    let style = if i == *chosen {
                        theme.latched()
                    } else {
                        Default::default()
                    };
                    Line::from(Span::styled(text, style))
                })
                .collect();
            lines.push(Line::default());
            lines.push(named("seed", seed, true, theme));
            lines.push(problem_line(problem, theme));
            overlay(frame, area, "set up a task (↑ ↓)", lines, theme);
        }
        Form::Take { holder } => {
            let lines = vec![
                Line::from(format!(" {holder} holds control of this robot.")),
                Line::from(" Take control? That client stops and is notified."),
                Line::default(),
                Line::from(" y takes control   n leaves it"),
            ];
            overlay(frame, area, "control", lines, theme);
        }
        Form::Leave => {
            let lines = vec![
                Line::from(" An episode runs. The robot has stopped."),
                Line::default(),
                Line::from(" s finishes it and keeps it"),
                Line::from(" d discards it"),
                Line::from(" r leaves it running, as does Ctrl-C again"),
                Line::from(" Esc goes back"),
            ];
            overlay(frame, area, "leave", lines, theme);
        }
    }
}
