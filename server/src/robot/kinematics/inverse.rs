//! Inverse kinematics: damped Newton-Raphson on the logarithm of the error
//! transform, in SI.
//!
//! The method is that of the paper (Lynch & Park 2017, section 6.2.2) with three
//! changes. The step is damped by the squared error (Sugihara 2011), so that it is
//! short near singularities and quadratic near the solution. Joints at a limit are
//! excluded from the step. A stagnating attempt restarts from a fixed sequence of joint
//! positions.

use std::fmt;

use nalgebra::{Isometry3, Matrix6, Vector6};
use wheelarm_proto::exact;

use super::screw::logarithm;
use super::{ArmKinematics, joint_word};

/// Position error at which a solution is exact, m.
const POSITION_TOLERANCE: f64 = 1e-9;
/// Rotation error at which a solution is exact, rad.
const ROTATION_TOLERANCE: f64 = 1e-9;
/// Errors that are accepted without further progress, m and rad.
const ACCEPTED: f64 = 1e-7;
/// Length that converts radians to metres, m: about half the arm.
const LENGTH: f64 = 0.3;
/// Largest change of a joint in one iteration, rad.
const LONGEST_STEP: f64 = 0.8;
/// Iterations of one attempt.
const ITERATIONS: usize = 60;
/// Iterations without progress after which an attempt ends.
const PATIENCE: usize = 8;
/// Attempts after the first.
const RESTARTS: usize = 40;

/// Additional starts of `solve_nearest`.
const STARTS: usize = 32;

/// Joint positions that reach a pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solution {
    /// From base to hand, rad; continuous ones within half a turn of the guess.
    pub joints: [f64; 6],
    /// Remaining distance, m.
    pub position_error: f64,
    /// Remaining angle, rad.
    pub rotation_error: f64,
    /// Newton iterations over all attempts.
    pub iterations: usize,
    /// Number of restarts.
    pub restarts: usize,
}

/// Why a pose is unreachable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reason {
    /// The target is further from the shoulder than the arm is long, m.
    TooFar {
        /// Distance of the target from the shoulder.
        distance: f64,
        /// Largest distance that the arm reaches.
        reach: f64,
    },
    /// The closest joint positions are at limits: flags from base to hand.
    Limits([bool; 6]),
    /// Within reach, but no joint positions were found.
    NoSolution,
    /// A streamed target that is reachable only with a jump of this joint (0 to 5) by
    /// this angle, rad.
    Jump(usize, f64),
}

/// An unreachable pose with the closest joint positions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unreachable {
    /// Why.
    pub reason: Reason,
    /// Closest joint positions, rad.
    pub closest: [f64; 6],
    /// Their distance from the target, m.
    pub position_error: f64,
    /// Their angle from the target, rad.
    pub rotation_error: f64,
}

impl fmt::Display for Unreachable {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.reason {
            Reason::TooFar { distance, reach } => write!(
                out,
                "unreachable: target is {distance:.3} m from the shoulder, the arm reaches {reach:.3} m"
            ),
            Reason::Limits(flags) => {
                let at_limit = (0..flags.len()).filter(|&joint| flags[joint]);
                let words: Vec<String> = at_limit.map(joint_word).collect();
                write!(
                    out,
                    "unreachable: limits of {}; closest is {:.1} mm and {:.2}° off",
                    words.join(", "),
                    self.position_error * 1e3,
                    self.rotation_error.to_degrees()
                )
            }
            Reason::NoSolution => write!(
                out,
                "unreachable: no joint positions found; closest is {:.1} mm and {:.2}° off",
                self.position_error * 1e3,
                self.rotation_error.to_degrees()
            ),
            Reason::Jump(joint, angle) => write!(
                out,
                "unreachable without a jump: {} would turn by {:.0}°",
                joint_word(joint),
                angle.to_degrees()
            ),
        }
    }
}

/// Result of an attempt.
struct Attempt {
    joints: [f64; 6],
    position_error: f64,
    rotation_error: f64,
    iterations: usize,
    /// Limits that block the attempt.
    blocked: [bool; 6],
}

impl Attempt {
    fn is_solved(&self) -> bool {
        self.position_error < ACCEPTED && self.rotation_error < ACCEPTED
    }

    fn error(&self) -> f64 {
        exact::hypot(self.position_error, LENGTH * self.rotation_error)
    }
}

impl ArmKinematics {
    /// Joint positions for a pose of the end effector in the arm's base,
    /// tried from `guess` first, then from a fixed sequence of positions.
    ///
    /// # Errors
    /// [`Unreachable`] with the reason and the closest joint positions.
    pub fn solve(
        &self,
        target: &Isometry3<f64>,
        guess: &[f64; 6],
    ) -> Result<Solution, Unreachable> {
        let distance = (target.translation.vector - self.shoulder.coords).norm();
        let mut best = self.attempt(target, guess);
        let mut iterations = best.iterations;
        let mut restarts = 0;
        // Beyond the arm's length (and the shoulder's small offset) restarts are
        // useless.
        let too_far = distance > self.reach + 0.02;
        while !best.is_solved() && !too_far && restarts < RESTARTS {
            restarts += 1;
            let attempt = self.attempt(target, &self.start(restarts));
            iterations += attempt.iterations;
            if attempt.error() < best.error() {
                best = attempt;
            }
        }
        let joints = self.nearest_turn(best.joints, guess);
        if best.is_solved() {
            return Ok(Solution {
                joints,
                position_error: best.position_error,
                rotation_error: best.rotation_error,
                iterations,
                restarts,
            });
        }
        let reason = if distance > self.reach {
            Reason::TooFar {
                distance,
                reach: self.reach,
            }
        } else if best.blocked.contains(&true) {
            Reason::Limits(best.blocked)
        } else {
            Reason::NoSolution
        };
        Err(Unreachable {
            reason,
            closest: joints,
            position_error: best.position_error,
            rotation_error: best.rotation_error,
        })
    }

    /// The solution that turns the joints least from `guess`, among those that
    /// `solve` and a fixed number of other starts find. Ten times slower.
    ///
    /// # Errors
    /// [`Unreachable`] with the reason and the closest joint positions.
    pub fn solve_nearest(
        &self,
        target: &Isometry3<f64>,
        guess: &[f64; 6],
    ) -> Result<Solution, Unreachable> {
        let turned = |joints: &[f64; 6]| {
            (0..6)
                .map(|i| (joints[i] - guess[i]).abs() / self.speed[i])
                .fold(0.0, f64::max)
        };
        let mut best = self.solve(target, guess)?;
        for n in 1..=STARTS {
            let attempt = self.attempt(target, &self.start(n));
            best.iterations += attempt.iterations;
            let joints = self.nearest_turn(attempt.joints, guess);
            if attempt.is_solved() && turned(&joints) < turned(&best.joints) {
                best = Solution {
                    joints,
                    position_error: attempt.position_error,
                    rotation_error: attempt.rotation_error,
                    ..best
                };
            }
        }
        Ok(best)
    }

    /// Like `solve`, for streamed targets: one attempt from `guess`, and each joint
    /// must end within `largest_change` rad of it.
    ///
    /// # Errors
    /// [`Unreachable`] with the reason and the closest joint positions.
    pub fn solve_local(
        &self,
        target: &Isometry3<f64>,
        guess: &[f64; 6],
        largest_change: f64,
    ) -> Result<Solution, Unreachable> {
        let attempt = self.attempt(target, guess);
        let joints = self.nearest_turn(attempt.joints, guess);
        let (joint, change) = (0..6)
            .map(|i| (i, (joints[i] - guess[i]).abs()))
            .fold((0, 0.0), |a, b| if b.1 > a.1 { b } else { a });
        let reason = if !attempt.is_solved() {
            if attempt.blocked.contains(&true) {
                Reason::Limits(attempt.blocked)
            } else {
                Reason::NoSolution
            }
        } else if change > largest_change {
            Reason::Jump(joint, change)
        } else {
            return Ok(Solution {
                joints,
                position_error: attempt.position_error,
                rotation_error: attempt.rotation_error,
                iterations: attempt.iterations,
                restarts: 0,
            });
        };
        Err(Unreachable {
            reason,
            closest: joints,
            position_error: attempt.position_error,
            rotation_error: attempt.rotation_error,
        })
    }

    /// Damped Newton-Raphson from one start.
    fn attempt(&self, target: &Isometry3<f64>, start: &[f64; 6]) -> Attempt {
        let mut joints = *start;
        self.clamp(&mut joints);
        let mut best = Attempt {
            joints,
            position_error: f64::INFINITY,
            rotation_error: f64::INFINITY,
            iterations: 0,
            blocked: [false; 6],
        };
        let mut blocked = [false; 6];
        let mut since_progress = 0;
        for iteration in 0..ITERATIONS {
            let (pose, jacobian) = self.forward_and_jacobian(&joints);
            let error = pose.inv_mul(target);
            let (angular, linear) = logarithm(&error);
            let (rotation_error, position_error) =
                (angular.norm(), error.translation.vector.norm());
            let size = exact::hypot(position_error, LENGTH * rotation_error);
            if size < 0.9 * best.error() {
                since_progress = 0;
            } else {
                since_progress += 1;
            }
            if size < best.error() {
                best = Attempt {
                    joints,
                    position_error,
                    rotation_error,
                    iterations: 0,
                    blocked,
                };
            }
            best.iterations = iteration + 1;
            let exact = position_error < POSITION_TOLERANCE && rotation_error < ROTATION_TOLERANCE;
            if exact || since_progress > PATIENCE {
                break;
            }
            blocked = self.advance(&mut joints, &jacobian, &angular, &linear);
        }
        best
    }

    /// One damped step within the limits. Returns the joints at a limit.
    fn advance(
        &self,
        joints: &mut [f64; 6],
        jacobian: &Matrix6<f64>,
        angular: &nalgebra::Vector3<f64>,
        linear: &nalgebra::Vector3<f64>,
    ) -> [bool; 6] {
        // Rows weighted so that radians and metres are comparable.
        let mut weighted = *jacobian;
        for column in 0..6 {
            for row in 0..3 {
                weighted[(row, column)] *= LENGTH;
            }
        }
        let twist = Vector6::new(
            angular.x * LENGTH,
            angular.y * LENGTH,
            angular.z * LENGTH,
            linear.x,
            linear.y,
            linear.z,
        );
        let damping = 0.05 * twist.norm_squared() + 1e-12;
        let normal = weighted.tr_mul(&weighted) + Matrix6::identity() * damping;
        let gradient = weighted.tr_mul(&twist);
        let mut blocked = [false; 6];
        let mut step = Vector6::zeros();
        // Each iteration may find more joints that would leave their range.
        for _ in 0..4 {
            let (mut matrix, mut vector) = (normal, gradient);
            for i in (0..6).filter(|&i| blocked[i]) {
                matrix.row_mut(i).fill(0.0);
                matrix.column_mut(i).fill(0.0);
                matrix[(i, i)] = 1.0;
                vector[i] = 0.0;
            }
            let Some(factors) = matrix.cholesky() else {
                return blocked;
            };
            step = factors.solve(&vector);
            let mut more = false;
            for i in 0..6 {
                let outward = (joints[i] <= self.lower[i] && step[i] < 0.0)
                    || (joints[i] >= self.upper[i] && step[i] > 0.0);
                if outward && !blocked[i] {
                    blocked[i] = true;
                    more = true;
                }
            }
            if !more {
                break;
            }
        }
        let longest = step.amax();
        let factor = if longest > LONGEST_STEP {
            LONGEST_STEP / longest
        } else {
            1.0
        };
        for i in 0..6 {
            joints[i] += factor * step[i];
        }
        self.clamp(joints);
        blocked
    }

    /// Start of restart `n`: the n-th point of a Halton sequence over the joint
    /// ranges, the same in every run.
    pub(in crate::robot) fn start(&self, n: usize) -> [f64; 6] {
        const BASES: [usize; 6] = [2, 3, 5, 7, 11, 13];
        let mut joints = [0.0; 6];
        for i in 0..6 {
            let (lower, upper) = if self.lower[i].is_finite() {
                (self.lower[i], self.upper[i])
            } else {
                (-std::f64::consts::PI, std::f64::consts::PI)
            };
            let (mut fraction, mut digit, mut rest) = (0.0, 1.0, n);
            while rest > 0 {
                digit /= BASES[i] as f64;
                fraction += digit * (rest % BASES[i]) as f64;
                rest /= BASES[i];
            }
            joints[i] = lower + fraction * (upper - lower);
        }
        joints
    }

    /// Clamps limited joints to their ranges.
    pub(in crate::robot) fn clamp(&self, joints: &mut [f64; 6]) {
        for (joint, (lower, upper)) in joints.iter_mut().zip(self.lower.iter().zip(&self.upper)) {
            *joint = exact::within(*joint, *lower, *upper);
        }
    }

    /// Shifts continuous joints by whole turns to within half a turn of `guess`.
    fn nearest_turn(&self, mut joints: [f64; 6], guess: &[f64; 6]) -> [f64; 6] {
        let turn = std::f64::consts::TAU;
        for i in 0..6 {
            if !self.lower[i].is_finite() && !self.upper[i].is_finite() {
                joints[i] -= turn * ((joints[i] - guess[i]) / turn).round();
            }
        }
        joints
    }
}
