//! When a run counts as broken.

use wheelarm_server::sim::Simulation;
use wheelarm_server::world::WorstOfSoft;

/// What a run may show at the most.
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

/// What counts as exploded, in the numbers of the requirement. They are written
/// here once more on purpose: the server's guard (`world/health`) is itself under
/// test, and a threshold that moves there must not move here.
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

/// Looks at a run while it goes on.
#[derive(Debug)]
pub struct Judge {
    limits: Vec<f64>,
    broken: Vec<String>,
    contact: f64,
    joint: f64,
}

/// What was seen of a run.
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
    /// A judge who knows the robot's limits.
    #[must_use]
    pub fn new(sim: &Simulation) -> Self {
        let (model, roles) = (sim.model(), &sim.model().roles);
        let limit = |joint: usize| match roles.arm_index(joint) {
            Some(_) => MOST.arm_speed * model.joints[joint].limits.velocity,
            None => MOST.joint_speed,
        };
        Self {
            limits: roles.joints.iter().map(|told| limit(told.joint)).collect(),
            broken: Vec::new(),
            contact: 0.0,
            joint: 0.0,
        }
    }

    /// Looks at the present tick; says whether enough was seen.
    pub fn appearance(&mut self, sim: &Simulation) -> bool {
        let snapshot = sim.snapshot();
        let mut say = |what: String| self.broken.push(format!("tick {}: {what}", snapshot.tick));
        let model = sim.model();
        let joints = model.roles.joints.iter().map(|told| told.joint);
        for ((state, limit), joint) in sim.recorded_joints().iter().zip(&self.limits).zip(joints) {
            self.joint = self.joint.max(state.velocity.abs());
            // Written so that a number that is none counts.
            if !(state.velocity.abs() <= *limit
                && state.position.is_finite()
                && state.effort.is_finite())
            {
                let name = &model.joints[joint].name;
                say(format!("{name} turns with {} rad/s", state.velocity));
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
        // A state that breaks is thrown away, and the one before stays.
        if let Some(words) = sim.broken() {
            say(words.to_owned());
        }
        for body in snapshot.links.iter().chain(&snapshot.objects) {
            let finite = |v: &nalgebra::Vector3<f64>| v.iter().all(|x| x.is_finite());
            if !(finite(&body.pose.translation.vector)
                && finite(&body.linear)
                && finite(&body.angular))
            {
                say("a body is nowhere".to_owned());
            }
        }
        for worst in sim.worst_of_soft() {
            if worst.speed.is_nan() || worst.speed > MOST.node_speed {
                say(format!("a node goes with {} m/s", worst.speed));
            }
            if worst.energy.is_nan() || worst.energy > MOST.soft_energy {
                say(format!("{} J are in the soft object", worst.energy));
            }
        }
        !self.broken.is_empty()
    }

    /// What was seen.
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
