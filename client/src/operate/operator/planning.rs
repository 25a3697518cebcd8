//! The operator's plans: where to stop and how to get there, how the hand
//! comes to the object.

use nalgebra::{Isometry3, Translation3};
use wheelarm_proto::v1::Phase;

use super::{Act, Doing, Operator, Outcome, Stage};
use crate::operate::drive::Drive;
use crate::operate::grasp::{self, HAND_MARGINS, Reach};
use crate::operate::ground::{Ground, Pose2};
use crate::operate::observation::Observation;
use crate::operate::route::{self, Piece, Route, RouteStyle};

/// Attempts at a stop from which the arm reaches.
const STOPS: usize = 4;
/// Places that are checked for reach and route per stop.
const PLACES: usize = 80;
/// Straight ways before a stop that are tried, metres.
const STRAIGHTS: [f64; 3] = [0.35, 0.2, 0.08];
/// Radii of arcs that are tried, as shares of the style's.
const ARCS: [f64; 2] = [1.0, 0.75];

impl Operator {
    pub(super) fn plan(&mut self, seen: &Observation, reach: &mut dyn Reach) -> Act {
        self.stops += 1;
        if self.stops > STOPS {
            return self.finish(Outcome::Failure(format!(
                "the arm reached the object from none of {STOPS} stops"
            )));
        }
        let chair = seen.chair();
        let ground = self.scene.ground(&seen.objects);
        let style = &self.style.grasp;
        let mut ways = Vec::new();
        let mut docks = Vec::new();
        for margin in HAND_MARGINS {
            ways = grasp::approaches(&self.scene, self.target, &seen.objects, style, margin);
            docks = grasp::docks(&self.scene, &ground, &chair, &ways, style);
            if !docks.is_empty() {
                break;
            }
        }
        let mut reasons = [0_usize; 2];
        let mut last_refused: Option<Pose2> = None;
        let mut looked = 0;
        for dock in &docks {
            if looked == PLACES {
                break;
            }
            // Neighbours of a place that did not do rarely do better.
            if last_refused.is_some_and(|pose| {
                pose.distance(&dock.chair) < 0.03 && pose.to(&dock.chair)[2].abs() < 0.05
            }) {
                continue;
            }
            looked += 1;
            if !grasp::can_do(
                &self.scene,
                &grasp::standing(&dock.chair),
                &dock.approach,
                style,
                reach,
            ) {
                reasons[0] += 1;
                last_refused = Some(dock.chair);
                continue;
            }
            let Some(route) = self.route(&ground, chair, dock.chair) else {
                reasons[1] += 1;
                last_refused = Some(dock.chair);
                continue;
            };
            let drive = Drive::new(chair, &route, &self.style.drive);
            self.notes.push(format!(
                "drives to ({:.2}, {:.2}) heading {:.0}° in {:.1} s",
                dock.chair.x,
                dock.chair.y,
                dock.chair.heading.to_degrees(),
                drive.duration()
            ));
            self.stage = Stage::Drive {
                drive,
                begun: seen.time,
            };
            return self.act(Phase::Navigating, "planning");
        }
        self.finish(Outcome::Failure(format!(
            "no place to stop for {:?}: {} ways to take it, {} free places, of {looked} looked at {} out of the arm's reach and {} without a route",
            self.scene.items[self.target].name,
            ways.len(),
            docks.len(),
            reasons[0],
            reasons[1]
        )))
    }

    /// The quickest route whose last part is straight, so that the chair
    /// arrives aligned, with wide or with tight arcs.
    fn route(&self, ground: &Ground, start: Pose2, goal: Pose2) -> Option<Vec<Piece>> {
        let mut best: Option<Route> = None;
        for length in STRAIGHTS {
            let before = goal.rolled(-length, 0.0);
            for tightness in ARCS {
                let style = RouteStyle {
                    radius: self.style.route.radius * tightness,
                    ..self.style.route
                };
                let Some(mut route) = route::find(ground, start, before, &style) else {
                    continue;
                };
                route.pieces.push(Piece::Roll {
                    length,
                    curvature: 0.0,
                });
                // A long straight part aligns better than a short one.
                route.cost += length / self.style.drive.speed - 4.0 * length;
                if best.as_ref().is_none_or(|best| route.cost < best.cost) {
                    best = Some(route);
                }
            }
        }
        best.map(|route| route.pieces)
    }

    pub(super) fn aim(&mut self, seen: &Observation, reach: &mut dyn Reach) -> Act {
        let style = self.style;
        let chair = seen.chair();
        let ways = HAND_MARGINS.into_iter().flat_map(|margin| {
            let objects = &seen.objects;
            let mut ways =
                grasp::approaches(&self.scene, self.target, objects, &style.grasp, margin);
            ways.sort_by(|a, b| grasp::off_axis(a, &chair).total_cmp(&grasp::off_axis(b, &chair)));
            ways.into_iter().map(move |way| (way, margin))
        });
        let ways: Vec<_> = ways.collect();
        let house_from_base = seen.house_from_chair * self.scene.chair_from_base;
        let now = house_from_base * seen.base_from_tool;
        for (way, margin) in ways {
            if !grasp::can_do(
                &self.scene,
                &seen.house_from_chair,
                &way,
                &style.grasp,
                reach,
            ) {
                continue;
            }
            let Some(stops) = self.way_to(&now, &way.before, seen, &house_from_base, margin, reach)
            else {
                continue;
            };
            let base_from_house = house_from_base.inverse();
            let stops: Vec<_> = stops
                .into_iter()
                .map(|pose| (base_from_house * pose, style.free_speed))
                .collect();
            self.approach = Some(way);
            self.start_move(seen, &stops, Doing::Reaching);
            return self.act(Phase::Reaching, "reaching");
        }
        self.notes
            .push("the arm cannot take it from here, looks for another place".to_owned());
        self.stage = Stage::Plan;
        self.act(Phase::Navigating, "planning")
    }

    /// Stops of a free way of the hand in `house`: straight, or over the things.
    fn way_to(
        &self,
        now: &Isometry3<f64>,
        end: &Isometry3<f64>,
        seen: &Observation,
        house_from_base: &Isometry3<f64>,
        margin: f64,
        reach: &mut dyn Reach,
    ) -> Option<Vec<Isometry3<f64>>> {
        let free = |a: &Isometry3<f64>, b: &Isometry3<f64>| {
            self.scene.hand_is_free(a, b, &seen.objects, None, margin)
        };
        let mut reaches =
            |pose: &Isometry3<f64>| reach.reach(&(house_from_base.inverse() * pose)).is_some();
        if free(now, end) && reaches(&now.lerp_slerp(end, 0.5)) {
            return Some(vec![*end]);
        }
        for height in [0.10, 0.16, 0.22, 0.28] {
            let above = Translation3::new(0.0, 0.0, height) * end;
            if free(now, &above) && free(&above, end) && reaches(&above) {
                return Some(vec![above, *end]);
            }
        }
        None
    }
}
