//! A movement of the hand through poses in `house`, until it has arrived.

use nalgebra::Isometry3;

use super::Now;
use crate::habits::shapes;
use crate::tool_path::{Shape, ToolPath, distance};

/// The hand counts as arrived within this, metres and radians.
const ARRIVED: [f64; 2] = [0.006, 0.03];
/// Extra time for the hand to arrive, seconds.
const ARRIVAL_TIME: f64 = 2.5;

/// A movement of the hand under way.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    path: ToolPath,
    begun: f64,
}

/// State of a movement.
#[derive(Clone, Debug, PartialEq)]
pub enum Progress {
    /// Under way, with the target of this tick in `base_link`.
    Moving(Option<Isometry3<f64>>),
    /// There.
    Arrived,
    /// The time is over and the hand is not there: how far off it is.
    Late(String),
}

impl Motion {
    /// From where the hand is meant to be through `stops` in `house`, each
    /// with the peak speed of the leg to it, m/s.
    #[must_use]
    pub fn new(now: &Now<'_>, stops: &[(Isometry3<f64>, f64)]) -> Self {
        Self::shaped(now, stops, &Shape::default())
    }

    /// The same in the first of the profile's shapes whose poses in `house` are all
    /// `allowed`; straight when there is none.
    #[must_use]
    pub fn curved(
        now: &mut Now<'_>,
        stops: &[(Isometry3<f64>, f64)],
        shape: &Shape,
        mut allowed: impl FnMut(&mut Now<'_>, &[Isometry3<f64>]) -> bool,
    ) -> Self {
        for shape in shapes(shape) {
            let motion = Self::shaped(now, stops, &shape);
            let house_from_base = now.scene.house_from_base(now.observation);
            let poses = motion.path.poses().into_iter();
            let poses: Vec<_> = poses.map(|pose| house_from_base * pose).collect();
            if shape != Shape::default() && allowed(now, &poses) {
                return motion;
            }
        }
        Self::new(now, stops)
    }

    /// In a shape.
    pub(super) fn shaped(now: &Now<'_>, stops: &[(Isometry3<f64>, f64)], shape: &Shape) -> Self {
        let base_from_house = now.scene.house_from_base(now.observation).inverse();
        let stops: Vec<_> = stops
            .iter()
            .map(|(pose, speed)| (base_from_house * pose, *speed))
            .collect();
        let start = now
            .observation
            .base_from_desired
            .unwrap_or(now.observation.base_from_tool);
        Self {
            path: ToolPath::shaped(start, &stops, shape),
            begun: now.observation.time,
        }
    }

    /// Whether the last of its legs has begun.
    #[must_use]
    pub fn is_on_last_leg(&self, now: &Now<'_>) -> bool {
        now.observation.time - self.begun >= self.path.last_leg()
    }

    /// Moves on.
    #[must_use]
    pub fn step(&self, now: &Now<'_>) -> Progress {
        let time = now.observation.time - self.begun;
        let tool = &now.observation.base_from_tool;
        let end = self.path.end();
        let (off, turn) = (distance(tool, &end), tool.rotation.angle_to(&end.rotation));
        if time >= self.path.duration() {
            if off < ARRIVED[0] && turn < ARRIVED[1] {
                return Progress::Arrived;
            }
            if time > self.path.duration() + ARRIVAL_TIME {
                let problem = &now.observation.arm_problem;
                return Progress::Late(format!(
                    "the hand stays {:.0} mm and {turn:.2} rad off{}",
                    off * 1e3,
                    if problem.is_empty() {
                        String::new()
                    } else {
                        format!(" ({problem})")
                    }
                ));
            }
        }
        // The target of this tick takes effect during the next one.
        let under_way = time <= self.path.duration();
        Progress::Moving(under_way.then(|| self.path.at(time + 1.0 / 60.0)))
    }
}
