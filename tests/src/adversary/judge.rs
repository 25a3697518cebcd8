//! When a run counts as broken.

use wheelarm_server::sim::Simulation;
use wheelarm_server::world::WorstOfSoft;

/// Upper limits of a valid run.
struct Most {
    /// Speed of a node of a soft object, m/s.
    node_speed: f64,
    /// Energy of a soft object beside that of its height, J.
    soft_energy: f64,
    /// Speed of an arm joint, in units of its limit.
    arm_speed: f64,
    /// Speed of any other joint, rad/s.
    joint_speed: f64,
    /// Force of a contact, N.
    contact: f64,
    /// Friction of a point of a soft contact, in units of its limit.
    friction: f64,
    /// Change of a solid's speed by a soft object in a tick, m/s.
    kick: f64,
}

/// Thresholds of an exploded run, from the requirement. They are duplicated on purpose:
/// the server's guard (`world/health`) is itself under test, so a change of its thresholds
/// must not change these.
const MOST: Most = Most {
    node_speed: 20.0,
    soft_energy: 20.0,
    arm_speed: 5.0,
    joint_speed: 60.0,
    contact: 30_000.0,
    friction: 1.001,
    kick: 0.5,
};

/// Rounding in a law, in its unit.
const ROUNDING: f64 = 1e-6;

/// Checks a run at every control tick.
#[derive(Debug)]
pub struct Judge {
    limits: Vec<f64>,
    broken: Vec<String>,
    contact: f64,
    joint: f64,
}

/// Result of a run.
#[derive(Clone, Debug)]
pub struct Verdict {
    /// Physics ticks that were run.
    pub ticks: u64,
    /// Why it counts as exploded; empty when it does not.
    pub broken: Vec<String>,
    /// Laws of soft contacts that did not hold; empty when all did.
    pub unlawful: Vec<String>,
    /// Hardest contact, N.
    pub contact: f64,
    /// Fastest joint, rad/s.
    pub joint: f64,
    /// The worst of the soft object, where there is one.
    pub soft: Option<WorstOfSoft>,
}

impl Judge {
    /// A judge with the limits of the robot.
    #[must_use]
    pub fn new(sim: &Simulation) -> Self {
        let (model, roles) = (sim.model(), &sim.model().roles);
        let limit = |joint: usize| match roles.arm_index(joint) {
            Some(_) => MOST.arm_speed * model.joints[joint].limits.velocity,
            None => MOST.joint_speed,
        };
        Self {
            limits: roles.joints.iter().map(|role| limit(role.joint)).collect(),
            broken: Vec::new(),
            contact: 0.0,
            joint: 0.0,
        }
    }

    /// Checks the present tick; returns whether the run is broken.
    pub fn observe(&mut self, sim: &Simulation) -> bool {
        let snapshot = sim.snapshot();
        let mut say = |what: String| self.broken.push(format!("tick {}: {what}", snapshot.tick));
        let model = sim.model();
        let joints = model.roles.joints.iter().map(|role| role.joint);
        for ((state, limit), joint) in sim.recorded_joints().iter().zip(&self.limits).zip(joints) {
            self.joint = self.joint.max(state.velocity.abs());
            // Written so that NaN counts as broken.
            if !(state.velocity.abs() <= *limit
                && state.position.is_finite()
                && state.effort.is_finite())
            {
                let name = &model.joints[joint].name;
                say(format!("{name} turns at {} rad/s", state.velocity));
            }
        }
        for contact in &snapshot.contacts {
            let force = contact.force.norm();
            self.contact = self.contact.max(force);
            if force.is_nan() || force > MOST.contact {
                say(format!(
                    "{:?} presses {:?} with {force} N",
                    contact.first, contact.second
                ));
            }
        }
        // The simulation discards a broken state and keeps the previous one.
        if let Some(words) = sim.broken() {
            say(words.to_owned());
        }
        for body in snapshot.links.iter().chain(&snapshot.objects) {
            let finite = |v: &nalgebra::Vector3<f64>| v.iter().all(|x| x.is_finite());
            if !(finite(&body.pose.translation.vector)
                && finite(&body.linear)
                && finite(&body.angular))
            {
                say("a body has a pose that is not finite".to_owned());
            }
        }
        for worst in sim.worst_of_soft() {
            if worst.speed.is_nan() || worst.speed > MOST.node_speed {
                say(format!("a node moves at {} m/s", worst.speed));
            }
            if worst.energy.is_nan() || worst.energy > MOST.soft_energy {
                say(format!("{} J are in the soft object", worst.energy));
            }
        }
        !self.broken.is_empty()
    }

    /// The result.
    #[must_use]
    pub fn verdict(self, sim: &Simulation) -> Verdict {
        let soft = sim.worst_of_soft().first().copied();
        Verdict {
            ticks: sim.snapshot().tick,
            broken: self.broken,
            unlawful: soft.map(unlawful).unwrap_or_default(),
            contact: self.contact,
            joint: self.joint,
            soft,
        }
    }
}

fn unlawful(worst: WorstOfSoft) -> Vec<String> {
    let laws = [
        (
            worst.normal >= -ROUNDING,
            format!("a contact pulls with {} N", -worst.normal),
        ),
        (
            worst.friction <= MOST.friction + ROUNDING,
            format!("friction is {} times its limit", worst.friction),
        ),
        (
            worst.kick <= MOST.kick + ROUNDING,
            format!("a solid is {} m/s faster after a tick", worst.kick),
        ),
        (
            worst.rise <= 0.0,
            format!("{} J too much came from nowhere in a tick", worst.rise),
        ),
        (
            worst.window_rise <= 0.0,
            format!(
                "{} J too much came from nowhere in half a second",
                worst.window_rise
            ),
        ),
    ];
    let broken = laws.into_iter().filter(|(kept, _)| !kept);
    broken.map(|(_, what)| what).collect()
}
