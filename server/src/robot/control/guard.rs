//! Limits of the motion near a seated person. `sim/person_guard` computes them before
//! each control tick from the state of that tick; this module applies them to every
//! motion: arm intents, the chair and the gripper.

use wheelarm_proto::exact;

use super::BaseIntent;
use crate::robot::ArmSettings;

/// Iterations over the arm's limits: a motion between two parts of the body needs more
/// than one.
const PASSES: usize = 6;
/// Share of the braking that a planned approach assumes: the rest covers the ticks in
/// which the chair still accelerates.
pub const PLANNED_BRAKING: f64 = 0.6;
/// Below this squared norm, (m/rad)², a joint motion does not move the point.
const NO_LEVER: f64 = 1e-4;
/// Smallest allowed lead, m, of the commanded grasp point over the measured one: an arm
/// sags by less under its payload.
const LEAST_LEAD: f64 = 0.006;
/// Largest lead of a joint, rad.
const JOINT_LEAD: f64 = 0.05;

/// The limits of one control tick.
#[derive(Clone, Debug, PartialEq)]
pub struct Guard {
    /// Largest speed of the grasp point, m/s.
    pub tool_speed: f64,
    /// Measured positions of the arm's joints, rad.
    pub measured: [f64; 6],
    /// Limits of points of the arm and of a held object.
    pub arm: Vec<ArmBound>,
    /// Limits of points of the person on the chair.
    pub chair: Vec<ChairBound>,
    /// Forward and turn deceleration assumed by the limits of the chair, m/s², rad/s².
    pub chair_braking: [f64; 2],
    /// Motion of the chair that relieves the person; `None` without contact force.
    pub retreat: Option<BaseIntent>,
    /// Limit of the fingers; `None` away from the person.
    pub fingers: Option<FingerBound>,
}

/// One point of the arm near the person.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArmBound {
    /// Speed towards the person per joint speed, m/rad.
    pub row: [f64; 6],
    /// Largest speed towards the person, m/s; negative: the point backs off.
    pub speed: f64,
    /// Largest lead of the commanded point over the measured one, m.
    pub lead: f64,
}

/// One point of the person near furniture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChairBound {
    /// Speed towards the furniture per forward speed (1) and turn rate (m).
    pub row: [f64; 2],
    /// Remaining distance to the stop, m.
    pub left: f64,
}

impl ChairBound {
    /// Distance that this point still moves towards the furniture while the chair
    /// brakes from `motion` at `braking`, m/s² and rad/s², m. A component that leads
    /// away is not counted: it may end first.
    fn stop_distance(&self, motion: &BaseIntent, braking: [f64; 2]) -> f64 {
        let parts = [motion.linear, motion.angular];
        let way = |i: usize| {
            let towards = (self.row[i] * parts[i]).max(0.0);
            towards * parts[i].abs() / (2.0 * braking[i])
        };
        way(0) + way(1)
    }

    fn speed(&self, motion: &BaseIntent) -> f64 {
        self.row[0] * motion.linear + self.row[1] * motion.angular
    }
}

/// Limits of the fingers near the person.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FingerBound {
    /// Largest knuckle speed of closing, rad/s.
    pub closing: f64,
    /// Largest knuckle speed of opening, rad/s.
    pub opening: f64,
    /// Largest force at each pad, N.
    pub force: f64,
}

fn dot(one: &[f64; 6], other: &[f64; 6]) -> f64 {
    one.iter().zip(other).map(|(a, b)| a * b).sum()
}

impl Guard {
    /// Changes joint speeds, rad/s, as little as possible to satisfy every limit,
    /// within `lower` and `upper`. When the limits contradict each other, nothing moves
    /// towards the person.
    pub(super) fn bound(&self, velocity: &mut [f64; 6], lower: &[f64; 6], upper: &[f64; 6]) {
        for _ in 0..PASSES {
            let mut kept = true;
            for bound in &self.arm {
                let over = dot(&bound.row, velocity) - bound.speed;
                let lever = dot(&bound.row, &bound.row);
                if over > 1e-9 && lever > NO_LEVER {
                    kept = false;
                    for (v, row) in velocity.iter_mut().zip(&bound.row) {
                        *v -= row * over / lever;
                    }
                }
            }
            for i in 0..6 {
                velocity[i] = exact::within(velocity[i], lower[i], upper[i]);
            }
            if kept {
                return;
            }
        }
        let mut share: f64 = 1.0;
        for bound in &self.arm {
            let speed = dot(&bound.row, velocity);
            if speed > 1e-9 && speed > bound.speed {
                share = share.min(bound.speed.max(0.0) / speed);
            }
        }
        for v in velocity {
            *v *= share;
        }
    }

    /// Reduces the lead of the commanded joint positions, rad, over the measured ones
    /// to the allowed one. `tool_way` is the displacement of the grasp point, m, for a
    /// change of the joints. The force of a lead is reduced by the smallest change of
    /// the energy of the `drives`. A released arm catches up with a lead at the lead
    /// divided by the servo's time constant, damping / stiffness.
    pub(super) fn shorten_lead(
        &self,
        position: &mut [f64; 6],
        drives: &ArmSettings,
        tool_way: impl Fn(&[f64; 6]) -> f64,
    ) {
        let start: [f64; 6] = std::array::from_fn(|i| position[i] - self.measured[i]);
        let mut lead = start;
        let (stiffness, damping) = (&drives.stiffness, &drives.damping);
        let times = damping.iter().zip(stiffness).map(|(d, k)| d / k);
        let lead_time = times.fold(0.0, f64::max);
        let most = LEAST_LEAD.max(self.tool_speed * lead_time);
        let joint = lead.iter().fold(0.0_f64, |most, part| most.max(part.abs()));
        let excess = (tool_way(&lead) / most).max(joint / JOINT_LEAD);
        if excess > 1.0 {
            lead = lead.map(|part| part / excess);
        }
        for _ in 0..PASSES {
            let mut kept = true;
            for bound in &self.arm {
                let over = dot(&bound.row, &lead) - bound.lead;
                let soft: [f64; 6] = std::array::from_fn(|i| bound.row[i] / stiffness[i]);
                let give = dot(&bound.row, &soft);
                if over > 1e-6 && dot(&bound.row, &bound.row) > NO_LEVER {
                    kept = false;
                    for (part, soft) in lead.iter_mut().zip(&soft) {
                        *part -= soft * over / give;
                    }
                }
            }
            if kept {
                break;
            }
        }
        if lead != start {
            *position = std::array::from_fn(|i| self.measured[i] + lead[i]);
        }
    }

    /// The wanted motion of the chair reduced to the limits, while it moves at `now`.
    /// Both speeds are scaled alike, so the chair stays on its curve.
    pub(super) fn of_chair(&self, wanted: BaseIntent, now: BaseIntent) -> BaseIntent {
        if let Some(retreat) = self.free_retreat() {
            let backs_off = wanted.linear * retreat.linear + wanted.angular * retreat.angular;
            let least = retreat.linear * retreat.linear + retreat.angular * retreat.angular;
            if backs_off < least {
                return retreat;
            }
        }
        // Motion that still accelerates or reverses would brake too late.
        let braking = self.chair_braking;
        let late = |bound: &ChairBound| bound.stop_distance(&now, braking) > bound.left;
        if self.chair.iter().any(late) {
            return BaseIntent::default();
        }
        let braking = braking.map(|part| part * PLANNED_BRAKING);
        let mut share: f64 = 1.0;
        for bound in &self.chair {
            let way = bound.stop_distance(&wanted, braking);
            if way > bound.left {
                share = share.min((bound.left / way).sqrt());
            }
        }
        BaseIntent {
            linear: wanted.linear * share,
            angular: wanted.angular * share,
        }
    }

    /// The retreat, limited by other furniture; `None` without contact force or without
    /// a free direction.
    fn free_retreat(&self) -> Option<BaseIntent> {
        let mut retreat = self.retreat?;
        for _ in 0..PASSES {
            for bound in self.chair.iter().filter(|bound| bound.left <= 0.0) {
                let speed = bound.speed(&retreat);
                let lever = bound.row[0] * bound.row[0] + bound.row[1] * bound.row[1];
                if speed > 0.0 && lever > NO_LEVER {
                    retreat.linear -= bound.row[0] * speed / lever;
                    retreat.angular -= bound.row[1] * speed / lever;
                }
            }
        }
        let blocked = |bound: &ChairBound| bound.left <= 0.0 && bound.speed(&retreat) > 1e-4;
        let way = exact::hypot(retreat.linear, retreat.angular);
        (way > 1e-3 && !self.chair.iter().any(blocked)).then_some(retreat)
    }
}
