//! The help: all keys.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};

use super::theme::{Theme, overlay};

/// Every key and what it does; the guide shows the same list.
const KEYS: [(&str, &str); 22] = [
    ("u i o", "chair: ahead and left, ahead, ahead and right"),
    ("j k l", "chair: turn left, STOP, turn right"),
    ("m , .", "chair: back to the left, back, back to the right"),
    (
        "",
        "a direction stays until k, Esc, another one, or the end",
    ),
    (
        "q z  w x  e c",
        "both speeds, forward speed, turn rate: ±10 %",
    ),
    ("", ""),
    ("v n", "hand forward, back"),
    ("h f", "hand left, right"),
    ("g b", "hand up, down"),
    (
        "Space",
        "the same keys turn the hand about its own axes, or move it",
    ),
    ("- =", "finer, coarser steps (of moving or of turning)"),
    ("r y", "close, open the gripper by one step"),
    (
        "a",
        "reach shell on or off: keeps the hand 0.41 to 0.87 m from the shoulder",
    ),
    ("Esc", "EVERYTHING STOPS: the chair brakes, the arm holds"),
    ("", ""),
    ("s", "start an episode: label, instruction, recorders"),
    ("→", "finish the episode and keep it"),
    ("← ←", "redo: throw it away, set up the same again, start"),
    ("d d", "discard the episode"),
    ("t", "set up another task or seed"),
    ("p", "pauses or resumes time"),
    ("!  Ctrl-C", "take control from another client; leave"),
];

/// Renders the list over the screen.
pub fn draw(frame: &mut Frame<'_>, area: Rect, theme: Theme) {
    let mut lines: Vec<Line<'_>> = KEYS
        .iter()
        .map(|(keys, words)| {
            Line::from(vec![
                Span::styled(format!(" {keys:<14}"), theme.key()),
                Span::raw(*words),
            ])
        })
        .collect();
    lines.push(Line::default());
    lines.push(Line::from(Span::styled(
        " any key goes back",
        theme.quiet(),
    )));
    overlay(frame, area, "keys", lines, theme);
}
