//! The ways that are tried: round by the front on several curves, and up to the lips or
//! down to the lap in several ends, the best first.

use std::f64::consts::{FRAC_PI_2, TAU};

use nalgebra::{Isometry3, Vector3};
use wheelarm_planning::footprint_check::wrap;
use wheelarm_proto::exact;

use super::plan::{AWAY, End, Plan, To, Way};

/// Headings of the hand at the mouth that are tried, against the chair's, degrees.
const HEADINGS: [f64; 15] = [
    -150.0, -135.0, -165.0, -120.0, -180.0, -142.5, -157.5, -105.0, -127.5, -172.5, -112.5, -90.0,
    -97.5, -187.5, -195.0,
];
/// How far the hand leans forward at the mouth, radians: level where that is free of the
/// person, else back, so that a cup under its straw stays before a broad chest; the tasks allow
/// 0.26.
const LIPS_LEANS: [f64; 3] = [0.0, -0.12, -0.23];
/// The hand turns by less than this on the way round, radians.
const MOST_TURN: f64 = 5.0;
/// Directions of an object's longest side in the lap: across the thighs, radians.
const ACROSS: [f64; 2] = [FRAC_PI_2, -FRAC_PI_2];
/// Forward leans of the hand there, which leave room for a belly, radians.
const LEANS: [f64; 3] = [0.0, 0.4, 0.7];
/// Places in the lap forward of its middle, in shares of its half length.
const FORWARD: [f64; 2] = [0.0, 0.5];
/// Distances of the grasp point from the arm's base on the way round, metres.
const ROUND: [f64; 4] = [0.45, 0.52, 0.60, 0.67];
/// Its height on the way round, metres over the floor.
const HEIGHTS: [f64; 3] = [1.06, 1.14, 1.21];
/// The same for a hand that points down.
const LAP_HEIGHTS: [f64; 3] = [0.98, 0.93, 1.04];
/// Whether the hand turns evenly on the way round, in its first half or in its second.
const TURNS: [[f64; 2]; 3] = [[0.0, 1.0], [0.0, 0.5], [0.5, 1.0]];
/// Number of checked parts of the curve.
const PARTS: usize = 16;

impl Plan<'_> {
    /// Ways that may do, the best first, from an end effector at `start`.
    pub fn ways(&self, start: &Isometry3<f64>) -> Vec<Way> {
        let heights = match self.to {
            To::Lips(_) => HEIGHTS,
            To::Lap(_) => LAP_HEIGHTS,
        };
        let [far, from, height] = self.polar(start);
        let mut ways = Vec::new();
        for [begun, done] in TURNS {
            for up in heights {
                for round in ROUND {
                    for end in self.ends(start) {
                        let [near, mut to, low] = self.polar(&self.at(start, end, AWAY));
                        // Round by the front, not over the person.
                        if to > 0.3 {
                            to -= TAU;
                        }
                        let mut corners =
                            vec![[far, from, height, 0.0, 0.0], [round, from, up, 0.0, 0.0]];
                        for part in 1..=PARTS {
                            let share = part as f64 / PARTS as f64;
                            let late = (2.0 * share - 1.0).max(0.0);
                            corners.push([
                                round + (near - round) * late,
                                from + (to - from) * share,
                                up + (low - up) * share,
                                end.turn * ((share - begun) / (done - begun)).clamp(0.0, 1.0),
                                end.lean * late,
                            ]);
                        }
                        ways.push(Way {
                            corners,
                            start: *start,
                            end,
                        });
                    }
                }
            }
        }
        // Level poses before leaning ones.
        if let To::Lips(_) = self.to {
            ways.sort_by(|a, b| a.end.lean.abs().total_cmp(&b.end.lean.abs()));
        }
        ways
    }

    /// Ends that may do for an end effector at `start`, the best first.
    fn ends(&self, start: &Isometry3<f64>) -> Vec<End> {
        let heading = |of: Vector3<f64>| exact::atan2(of.y, of.x);
        match self.to {
            To::Lips(_) => {
                let forward = heading(start.rotation * Vector3::z());
                // The shorter turn of the hand first, then the other way about.
                let turn = |to: &f64| wrap(to.to_radians() - forward);
                let short = HEADINGS.iter().map(turn);
                let long = short.clone().map(|turn| turn - TAU * turn.signum());
                let turns = short.chain(long.filter(|turn| turn.abs() < MOST_TURN));
                let end = |turn, lean| End {
                    turn,
                    lean,
                    forward: 0.0,
                };
                turns
                    .flat_map(|turn| LIPS_LEANS.map(|lean| end(turn, lean)))
                    .collect()
            }
            To::Lap(_) => {
                let long = heading(start.rotation * self.long);
                let mut ends = Vec::new();
                for lean in LEANS {
                    for forward in FORWARD {
                        ends.extend(ACROSS.map(|across| End {
                            turn: wrap(across - long),
                            lean,
                            forward,
                        }));
                    }
                }
                ends
            }
        }
    }
}
