//! Reach: chooses a way to the thing from where the chair stands, moves the
//! hand before it and then straight in.

use nalgebra::{Isometry3, Translation3};
use wheelarm_proto::v1::Phase;

use super::motion::{Motion, Progress};
use super::{Act, Now, Skill, Step, lift};
use crate::goal::Goal;
use crate::ground::wrap;
use crate::tool_path::distance;
use crate::way::{self, MARGINS, Way};

/// Heights of a way over the things that are tried, metres.
const OVER: [f64; 5] = [0.08, 0.14, 0.20, 0.26, 0.32];
/// A way counts as refused within this, metres and radians.
const SAME: [f64; 2] = [0.01, 0.1];
/// Ways that are looked at from one stop.
const LOOKS: usize = 60;

#[derive(Clone, Debug)]
enum State {
    Aim,
    Before(Motion),
    In(Motion),
}

/// See the module.
#[derive(Clone, Debug)]
pub struct Reach {
    state: State,
}

impl Reach {
    /// Begins.
    #[must_use]
    pub fn new() -> Self {
        Self { state: State::Aim }
    }

    fn aim(&mut self, now: &mut Now<'_>) -> Step {
        let Some((way, stops)) = choose(now) else {
            return now.elsewhere("the arm cannot take it from here");
        };
        let stops: Vec<_> = stops
            .into_iter()
            .map(|pose| (pose, now.style.free_speed))
            .collect();
        self.state = State::Before(Motion::arched(now, &stops, now.style.arch));
        now.memory.way = Some(way);
        now.note(format!(
            "comes {}leaning {:.0}°, drawn back {:.0} mm, open {:.0} mm",
            if way.heading().is_some() {
                ""
            } else {
                "from above, "
            },
            way.lean.to_degrees(),
            way.back * 1e3,
            way.opening * 1e3
        ));
        Step::Going(Act {
            opening: Some(way.opening),
            ..Act::named(Phase::Reaching, "reaching")
        })
    }
}

impl Default for Reach {
    fn default() -> Self {
        Self::new()
    }
}

impl Skill for Reach {
    fn step(&mut self, now: &mut Now<'_>) -> Step {
        let (motion, name) = match &self.state {
            State::Aim => return self.aim(now),
            State::Before(motion) => (motion, "reaching"),
            State::In(motion) => (motion, "approaching"),
        };
        match motion.step(now) {
            Progress::Moving(tool) => Step::Going(Act {
                tool,
                ..Act::named(Phase::Reaching, name)
            }),
            Progress::Late(why) => {
                now.refuse_way();
                Step::Missed(format!("{name}: {why}"))
            }
            Progress::Arrived => match (&self.state, now.memory.way) {
                (State::Before(_), Some(way)) => {
                    let stop = (way.at, now.style.approach_speed);
                    self.state = State::In(Motion::new(now, &[stop]));
                    Step::Going(Act::named(Phase::Reaching, "approaching"))
                }
                _ => {
                    now.memory.rest = Some(now.thing());
                    Step::Done
                }
            },
        }
    }
}

/// The way that fits the chair best and the stops before it.
fn choose(now: &mut Now<'_>) -> Option<(Way, Vec<Isometry3<f64>>)> {
    let chair = now.seen.chair();
    let thing = now.thing();
    let start = now.scene.house_from_tool(now.seen);
    for margin in MARGINS {
        let standoff = now.style.grasp.standoff;
        let mut ways = way::ways(now.scene, now.goal, now.poses, standoff, margin);
        ways.retain(|way| {
            let at = thing.inv_mul(&way.at);
            !now.memory.refused.iter().any(|refused| {
                distance(refused, &at) < SAME[0]
                    && refused.rotation.angle_to(&at.rotation) < SAME[1]
            })
        });
        let rank = |way: &Way| {
            let off = way.heading().map_or(0.3, |h| wrap(h - chair.heading).abs());
            way.cost + (off / 0.3).powi(2)
        };
        ways.sort_by(|a, b| rank(a).total_cmp(&rank(b)));
        for way in ways.into_iter().take(LOOKS) {
            if let Some(stops) = way_to(now, &start, &way, margin) {
                return Some((way, stops));
            }
        }
    }
    None
}

/// Poses after the one before the thing: in, and what comes then; several
/// lists of which one will do.
fn way_in(now: &Now<'_>, way: &Way) -> Vec<Vec<Isometry3<f64>>> {
    let then = match now.goal {
        Goal::Lift { .. } | Goal::Put { .. } => {
            let height = lift::height(now.goal, now.style.grasp.lift);
            lift::ways_up(&now.scene.house_from_base(now.seen), &way.at, height)
        }
        Goal::Open { slide, .. } => {
            let axis = now.scene.slides[*slide].axis;
            vec![vec![Translation3::from(axis.scale(0.06)) * way.at]]
        }
    };
    then.into_iter()
        .map(|then| [&[way.at], &then[..]].concat())
        .collect()
}

/// Stops of a free way of the hand in `house`: straight, or over the things.
fn way_to(
    now: &mut Now<'_>,
    start: &Isometry3<f64>,
    way: &Way,
    margin: f64,
) -> Option<Vec<Isometry3<f64>>> {
    let above = |height: f64| Translation3::new(0.0, 0.0, height) * way.before;
    let around = now
        .scene
        .around(&[*start, way.before, above(0.2)], now.poses, None);
    // Straight, over the things, from nearer to the arm, or first back to
    // where the hand began.
    let home = now
        .memory
        .home
        .map(|home| now.scene.house_from_base(now.seen) * home);
    let mut routes = vec![vec![way.before]];
    routes.extend(OVER.map(|height| vec![above(height), way.before]));
    // Down from the side of the arm, which reaches higher there.
    let base = now.scene.house_from_base(now.seen);
    for height in OVER {
        let ways = lift::ways_up(&base, &way.before, height);
        let vias = ways.iter().skip(1).filter_map(|way| way.last());
        routes.extend(vias.map(|via| vec![*via, way.before]));
    }
    if let Some(home) = home {
        routes.extend(OVER.map(|height| vec![home, above(height), way.before]));
    }
    let then = way_in(now, way);
    routes.into_iter().find(|stops| {
        let line = [&[*start], &stops[..]].concat();
        around.hand_is_free(&now.scene.hand, way.opening, &line, margin)
            && then
                .iter()
                .any(|then| now.reaches(&[&stops[..], &then[..]].concat()))
    })
}
