//! The parts of the screen as lines of text.

use ratatui::text::{Line, Span};
use wheelarm_proto::v1;

use super::theme::{Theme, WIDE};
use crate::drive::DIRECTIONS;
use crate::model::{Control, Model};
use wheelarm_teleop_web::arm::{self, label, pointing};
use wheelarm_teleop_web::watch::Connection;

/// A value older than this is shown as stale, s.
const STALE: f64 = 2.0;

/// A number without a negative zero.
fn number(value: f64, digits: usize) -> String {
    let text = format!("{value:.digits$}");
    match text.strip_prefix('-') {
        Some(rest) if rest.bytes().all(|b| matches!(b, b'0' | b'.')) => rest.to_owned(),
        _ => text,
    }
}

fn pair<'a>(name: &'static str, value: impl Into<String>, theme: Theme) -> Line<'a> {
    Line::from(vec![
        Span::styled(format!("{name:<9}"), theme.quiet()),
        Span::raw(value.into()),
    ])
}

/// Rows of the header at a width.
pub fn header_rows(width: u16) -> u16 {
    if width >= WIDE { 1 } else { 2 }
}

/// The top of the screen: connection, control, pace, address of the page.
pub fn header<'a>(model: &Model, theme: Theme, now: f64, width: u16) -> Vec<Line<'a>> {
    let situation = &model.situation;
    let connection = match &situation.connection {
        Connection::Opening => Span::styled("○ connecting", theme.warning()),
        Connection::Open => Span::styled("● connected", theme.good()),
        Connection::Silent(since) => Span::styled(
            format!("◌ no answer for {:.1} s", now - since),
            theme.warning(),
        ),
        Connection::Lost(since, _) => Span::styled(
            format!("○ LINK LOST {:.0} s ago, trying again", now - since),
            theme.bad(),
        ),
    };
    let control = match &model.control {
        Control::Ours => Span::styled("control is yours", theme.good()),
        Control::Held(holder) => Span::styled(format!("{holder} HOLDS CONTROL (!)"), theme.bad()),
        Control::Requested => Span::styled("asking for control", theme.warning()),
        Control::None => Span::styled("no control", theme.quiet()),
    };
    let paused = situation.status.as_ref().is_some_and(|s| s.paused);
    let pace = if paused {
        Span::styled("PAUSED (p)", theme.warning())
    } else {
        Span::raw(format!("{:.2}x time", situation.factor))
    };
    let gap = || Span::raw("   ");
    let first = vec![
        Span::styled("wheelarm", theme.title()),
        gap(),
        connection,
        gap(),
        control,
    ];
    let second = vec![
        pace,
        gap(),
        Span::raw(if model.page.is_empty() {
            String::new()
        } else {
            format!("see {}", model.page)
        }),
    ];
    if header_rows(width) == 1 {
        let mut line = first;
        line.push(gap());
        line.extend(second);
        vec![Line::from(line)]
    } else {
        vec![Line::from(first), Line::from(second)]
    }
}

/// Alarms, in the order of the top of the screen.
pub fn alarms<'a>(model: &Model, theme: Theme) -> Vec<Line<'a>> {
    let alarms = model.situation.alarms().into_iter();
    alarms
        .map(|words| Line::from(Span::styled(format!("!! {words} "), theme.alarm())))
        .collect()
}

/// The last line: actions that are possible now.
pub fn hints<'a>(model: &Model, theme: Theme) -> Line<'a> {
    let words: &[(&str, &str)] = if model.form.is_some() {
        &[("Enter", "does it"), ("Tab", "next"), ("Esc", "back")]
    } else if model.situation.episode().is_some() {
        &[
            ("→", "finish"),
            ("←", "redo"),
            ("d", "discard"),
            ("k", "chair stops"),
            ("Esc", "all stops"),
            ("?", "keys"),
            ("Ctrl-C", "leave"),
        ]
    } else {
        &[
            ("s", "start episode"),
            ("t", "task and seed"),
            ("k", "chair stops"),
            ("Esc", "all stops"),
            ("?", "keys"),
            ("Ctrl-C", "leave"),
        ]
    };
    let spans = words.iter().flat_map(|(key, word)| {
        [
            Span::styled((*key).to_owned(), theme.key()),
            Span::raw(format!(" {word}   ")),
        ]
    });
    Line::from(spans.collect::<Vec<_>>())
}

/// The keys of chair, arm and gripper, with their current functions.
pub fn controls<'a>(model: &Model, theme: Theme) -> Vec<Line<'a>> {
    let mut lines = chair_keys(model, theme);
    lines.push(Line::default());
    lines.extend(hand_keys(model, theme));
    lines.extend(gripper_keys(model, theme));
    lines
}

fn chair_keys<'a>(model: &Model, theme: Theme) -> Vec<Line<'a>> {
    let drive_key = |key: char| {
        let direction = DIRECTIONS.iter().find(|(k, _)| *k == key).map(|(_, d)| *d);
        let latched = direction.is_some() && direction == model.drive.direction;
        let style = if latched {
            theme.latched()
        } else {
            theme.key()
        };
        Span::styled(format!(" {key} "), style)
    };
    let pad = |keys: [char; 3], speed: &'static str, words: String| {
        let mut line = vec![Span::raw(" ")];
        line.extend(keys.map(drive_key));
        line.push(Span::raw("   "));
        line.push(Span::styled(speed, theme.key()));
        line.push(Span::raw(words));
        Line::from(line)
    };
    let direction = match model.drive.direction {
        Some(_) => {
            let [linear, angular] = model.drive.commanded_speeds();
            Span::styled(
                format!("drives {linear:.2} m/s {angular:.2} rad/s"),
                theme.latched(),
            )
        }
        None => Span::styled("stands", theme.quiet()),
    };
    let [linear, angular] = model.drive.speeds;
    vec![
        Line::from(vec![Span::styled("chair  ", theme.strong()), direction]),
        pad(['u', 'i', 'o'], "q z", "  both speeds ±10 %".to_owned()),
        pad(['j', 'k', 'l'], "w x", format!("  {linear:.2} m/s")),
        pad(['m', ',', '.'], "e c", format!("  {angular:.2} rad/s")),
    ]
}

fn hand_keys<'a>(model: &Model, theme: Theme) -> Vec<Line<'a>> {
    let [translation, rotation] = model.arm.steps;
    let (mode, step, style) = if model.arm.turning {
        ("TURN", format!("{rotation:.3} rad"), theme.latched())
    } else {
        let step = format!("{:.1} mm", translation * 1e3);
        ("move", step, theme.strong())
    };
    let mut lines = vec![Line::from(vec![
        Span::styled("hand   ", theme.strong()),
        Span::styled(format!("{mode} {step}"), style),
        Span::raw("   "),
        Span::styled("Space", theme.key()),
        Span::raw(" move/turn"),
    ])];
    let (tool, mount) = (model.situation.base_from_tool, model.situation.mount());
    let arm_key = |(key, axis, sign): (char, usize, f64)| {
        let word = label(axis, sign, model.arm.turning, tool.as_ref(), mount.as_ref());
        [
            Span::styled(format!(" {key} "), theme.key()),
            Span::raw(format!("{word:<11}")),
        ]
    };
    // Opposite keys are side by side: v n, h f, g b.
    for (first, second) in [(1, 0), (3, 2), (4, 5)] {
        let mut line = vec![Span::raw(" ")];
        line.extend(arm_key(arm::KEYS[first]));
        line.extend(arm_key(arm::KEYS[second]));
        lines.push(Line::from(line));
    }
    lines
}

fn gripper_keys<'a>(model: &Model, theme: Theme) -> [Line<'a>; 2] {
    let key = |text: &'static str| Span::styled(text, theme.key());
    [
        Line::from(vec![
            Span::raw("  "),
            key("r"),
            Span::raw(" close gripper   "),
            key("y"),
            Span::raw(" open   "),
            key("- ="),
            Span::raw(" step size"),
        ]),
        Line::from(vec![
            Span::raw("  "),
            key("a"),
            Span::raw(" reach shell "),
            if model.arm.shell {
                Span::styled("on", theme.warning())
            } else {
                Span::raw("off")
            },
        ]),
    ]
}

/// Events, newest last.
pub fn log<'a>(model: &Model, theme: Theme, now: f64, rows: usize) -> Vec<Line<'a>> {
    let happenings = &model.situation.happenings;
    let newest = happenings
        .iter()
        .skip(happenings.len().saturating_sub(rows));
    let lines = newest.map(|h| {
        let style = if h.bad {
            theme.bad()
        } else {
            Default::default()
        };
        Line::from(vec![
            Span::styled(format!("{:>5.0} s ", h.at - now), theme.quiet()),
            Span::styled(h.text.clone(), style),
        ])
    });
    lines.collect()
}

/// Episode, task, robot, recorders and connection.
pub fn state<'a>(model: &Model, theme: Theme, now: f64) -> Vec<(&'static str, Vec<Line<'a>>)> {
    vec![
        ("episode", episode(model, theme)),
        ("task", task(model, theme)),
        ("robot", robot(model, theme)),
        ("recorders", recorders(model, theme)),
        ("link", connection(model, theme, now)),
    ]
}

fn episode<'a>(model: &Model, theme: Theme) -> Vec<Line<'a>> {
    let situation = &model.situation;
    let mut lines = Vec::new();
    match situation.episode() {
        Some(running) => {
            let number = running.header.as_ref().map_or(0, |h| h.episode);
            lines.push(Line::from(vec![
                Span::styled(format!("RUNS {number} "), theme.good()),
                Span::raw(format!(
                    "{}  {:.1} s",
                    running.label,
                    situation.episode_clock().unwrap_or_default()
                )),
            ]));
            lines.push(pair("says", running.instruction.clone(), theme));
        }
        None => {
            lines.push(Line::from(Span::styled("none runs", theme.warning())));
            let says = situation.scenario().map(|s| s.instruction().to_owned());
            lines.push(pair("says", says.unwrap_or_default(), theme));
        }
    }
    let waits = situation.status.as_ref().map(|s| s.waiting_for.clone());
    if let Some(waits) = waits.filter(|w| !w.is_empty()) {
        lines.push(pair("waits for", waits, theme));
    }
    lines
}

fn task<'a>(model: &Model, theme: Theme) -> Vec<Line<'a>> {
    let scenario = model.situation.scenario();
    let name = scenario.map_or_else(String::new, |s| {
        if s.task().is_empty() {
            format!("no task in {}", s.scene)
        } else {
            format!("{}, seed {}", s.task(), s.seed())
        }
    });
    let Some(evaluation) = &model.situation.evaluation else {
        return vec![Line::from(name)];
    };
    let result = if evaluation.success {
        Span::styled("SUCCESS", theme.good())
    } else if !evaluation.failure.is_empty() {
        Span::styled(format!("FAILED: {}", evaluation.failure), theme.bad())
    } else {
        Span::raw(format!("{:.1} s", evaluation.elapsed_seconds))
    };
    let mut lines = vec![Line::from(vec![Span::raw(format!("{name}   ")), result])];
    for condition in &evaluation.conditions {
        lines.push(self::condition(condition, theme));
    }
    lines
}

fn condition<'a>(condition: &v1::Condition, theme: Theme) -> Line<'a> {
    let mark = match (condition.holds, condition.required) {
        (true, _) => Span::styled(" yes ", theme.good()),
        (false, true) => Span::styled(" NO  ", theme.bad()),
        (false, false) => Span::styled(" no  ", theme.warning()),
    };
    Line::from(vec![
        mark,
        Span::raw(format!(
            "{} ({})",
            condition.name,
            number(condition.value, 3)
        )),
    ])
}

fn robot<'a>(model: &Model, theme: Theme) -> Vec<Line<'a>> {
    let situation = &model.situation;
    let unknown = || "unknown".to_owned();
    let [speed, rate] = situation.chair_speed;
    let chair = situation.chair().map_or_else(unknown, |[x, y, heading]| {
        let heading = number(heading.to_degrees(), 1);
        format!("x {x:.3}  y {y:.3} m  heading {heading}°")
    });
    let hand = situation
        .hand()
        .map_or_else(unknown, |[forward, left, up]| {
            format!(
                "forward {}  left {}  up {} m, points {}",
                number(forward, 3),
                number(left, 3),
                number(up, 3),
                situation
                    .base_from_tool
                    .zip(situation.mount())
                    .map_or("", |(tool, mount)| pointing(&tool, &mount))
            )
        });
    let opening = situation.opening();
    let gripper = opening.map_or_else(unknown, |opening| {
        let [left, right] = situation.pad_force;
        format!("open {:.1} mm  pads {left:.1} {right:.1} N", opening * 1e3)
    });
    let mut lines = vec![
        pair("chair", chair, theme),
        pair(
            "",
            format!(
                "speed {} m/s  turns {} rad/s",
                number(speed, 2),
                number(rate, 2)
            ),
            theme,
        ),
        pair("hand", hand, theme),
        pair("gripper", gripper, theme),
    ];
    if model.settings.target_hint
        && let Some(target) = situation.target()
    {
        let [ahead, left, up] = target.from_hand;
        let [x, y, z] = target.place;
        lines.push(pair(
            "target",
            format!(
                "{} ahead {}  left {}  up {} m of the pads",
                target.name,
                number(ahead, 3),
                number(left, 3),
                number(up, 3)
            ),
            theme,
        ));
        lines.push(pair(
            "",
            format!("at x {x:.3}  y {y:.3}  z {z:.3} m"),
            theme,
        ));
    }
    lines
}

fn recorders<'a>(model: &Model, theme: Theme) -> Vec<Line<'a>> {
    let all = model.situation.status.as_ref().map(|s| &s.recorders);
    let Some(all) = all.filter(|r| !r.is_empty()) else {
        return vec![Line::from(Span::styled(
            "none: nothing is recorded (start `wheelarm record`)",
            theme.warning(),
        ))];
    };
    let lines = all.iter().map(|recorder| {
        let (word, style) = match recorder.state() {
            _ if recorder.silent_seconds.is_some() => ("DOES NOT ANSWER", theme.bad()),
            v1::RecorderState::Ready => ("recording", theme.good()),
            v1::RecorderState::Finishing => ("finishing", theme.strong()),
            v1::RecorderState::Finished if recorder.complete => ("complete", theme.good()),
            v1::RecorderState::Finished if recorder.path.is_empty() => {
                ("discarded", theme.strong())
            }
            v1::RecorderState::Finished => ("PARTIAL", theme.bad()),
            v1::RecorderState::Failed => ("FAILED", theme.bad()),
            v1::RecorderState::Idle => ("ready", theme.strong()),
            v1::RecorderState::Unspecified => ("unknown", theme.warning()),
        };
        let missed = if recorder.missed > 0 {
            theme.bad()
        } else {
            Default::default()
        };
        let file = recorder.path.rsplit('/').next().unwrap_or_default();
        let more = if recorder.message.is_empty() {
            file.to_owned()
        } else {
            recorder
                .message
                .strip_prefix(word)
                .unwrap_or(&recorder.message)
                .to_owned()
        };
        Line::from(vec![
            Span::raw(format!("{:<10} ", recorder.recorder)),
            Span::styled(format!("{word}  "), style),
            Span::raw(format!("{} images  ", recorder.accepted_frames)),
            Span::styled(format!("{} missed  ", recorder.missed), missed),
            Span::raw(more),
        ])
    });
    lines.collect()
}

fn connection<'a>(model: &Model, theme: Theme, now: f64) -> Vec<Line<'a>> {
    let milliseconds = |seconds: f64| format!("{:.1} ms", seconds * 1e3);
    let round_trip = model
        .situation
        .round_trip
        .map_or_else(|| "unknown".to_owned(), milliseconds);
    let echo = match model.echo {
        Some((delay, at)) if now - at < STALE => milliseconds(delay),
        Some((delay, at)) => format!("{} ({:.0} s ago)", milliseconds(delay), now - at),
        None => "nothing sent yet".to_owned(),
    };
    let mut lines = vec![pair(
        "round trip",
        format!(" {round_trip}   command taken after {echo}"),
        theme,
    )];
    let refused = model.refused;
    let style = if refused > 0 {
        theme.warning()
    } else {
        Default::default()
    };
    let mut line = vec![
        Span::styled(format!("{:<9}", "refused"), theme.quiet()),
        Span::styled(format!("{refused} of yours"), style),
    ];
    if let Some(status) = &model.situation.status {
        line.push(Span::raw(format!(", {} in all", status.refused)));
    }
    if let Some((at, reason)) = &model.last_refusal {
        line.push(Span::raw(format!("; {:.0} s ago: {reason}", now - at)));
    }
    lines.push(Line::from(line));
    lines
}
