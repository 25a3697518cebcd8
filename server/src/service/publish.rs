//! Converts the state at a control tick into messages.

use std::collections::BTreeSet;

use wheelarm_proto::{MAX_CONTACTS, exact, v1};

use super::command_gate::GateOutput;
use super::convert;
use super::disturbance;
use super::outbox::Outbox;
use super::person;
use crate::robot::control::{RobotControl, Targets};
use crate::sensors::imu;
use crate::sensors::signals::Signals;
use crate::sim::Simulation;
use crate::snapshot::{BodyRef, Contact};

/// Publishes the accepted commands and what was applied at `tick`.
pub fn applied(
    outbox: &Outbox,
    episode: u64,
    tick: u64,
    taken: &GateOutput,
    targets: &Targets,
    control: &RobotControl,
) {
    let (arm, base, gripper) = convert::applied_groups(&taken.input);
    outbox.put(
        episode,
        tick,
        v1::Applied {
            header: None,
            arm,
            base,
            gripper,
            joint_positions: targets.arm_position.to_vec(),
            joint_velocities: targets.arm_velocity.to_vec(),
            wheel_velocities: targets.wheel_velocity.to_vec(),
            knuckle: targets.knuckle_position,
            desired_pose: Some(convert::pose(&control.desired_pose())),
            stale: taken.stopped.any(),
            arm_problem: control.arm_problem().unwrap_or_default().to_owned(),
            arm_problem_code: convert::arm_problem(control.arm_problem_kind()).into(),
        },
    );
    for command in &taken.commands {
        let log = v1::CommandLog {
            header: None,
            command: Some(command.clone()),
            loop_age_ticks: command
                .answers_tick
                .map(|answered| tick.saturating_sub(answered)),
        };
        outbox.put(episode, tick, log);
    }
}

/// Publishes the disturbance of the coming control tick; nothing when the scenario has
/// none.
pub fn disturbance(outbox: &Outbox, episode: u64, sim: &Simulation) {
    if let Some(disturbance) = sim.disturbance() {
        let message = disturbance::message(&disturbance, sim);
        outbox.put(episode, sim.snapshot().tick, message);
    }
}

/// Publishes IMU measurements.
pub fn imu(outbox: &Outbox, episode: u64, samples: &[imu::Sample]) {
    for sample in samples {
        outbox.put(
            episode,
            sample.tick,
            v1::Imu {
                header: None,
                orientation: Some(convert::quaternion(&sample.orientation)),
                angular_velocity: Some(convert::vector(&sample.angular_velocity)),
                linear_acceleration: Some(convert::vector(&sample.linear_acceleration)),
            },
        );
    }
}

/// Publishes the sensor model's output for IMU measurements at `rate` Hz.
pub fn sensed_imu(
    outbox: &Outbox,
    episode: u64,
    samples: &[imu::Sample],
    rate: f64,
    signals: &mut Signals,
) {
    for sample in samples {
        let Some([angular_velocity, linear_acceleration]) = signals.imu(sample, rate) else {
            return;
        };
        outbox.put(
            episode,
            sample.tick,
            v1::SensedImu {
                header: None,
                angular_velocity: Some(convert::vector(&angular_velocity.into())),
                linear_acceleration: Some(convert::vector(&linear_acceleration.into())),
            },
        );
    }
}

/// Publishes the state streams of the present tick. `clock` is last, so that a
/// client that receives it has received everything.
pub fn state(
    outbox: &Outbox,
    episode: u64,
    sim: &Simulation,
    signals: &Signals,
    phase: (i32, &str),
    real_time_factor: f64,
) {
    let tick = sim.snapshot().tick;
    let put = StatePublisher {
        outbox,
        episode,
        tick,
    };
    if sim.state_due() {
        put.joints(sim);
        put.poses(sim);
        put.robot_sensors(sim, signals);
        put.objects(sim);
        put.furniture(sim);
        put.contacts(sim);
        if let Some(message) = person::state(sim) {
            outbox.put(episode, tick, message);
        }
        outbox.put(episode, tick, convert::evaluation(sim.evaluation()));
        let (phase, name) = phase;
        let sample = v1::PhaseSample {
            header: None,
            phase,
            name: name.to_owned(),
        };
        outbox.put(episode, tick, sample);
    }
    if sim.deformable_due() {
        put.deformable(sim);
    }
    if let Some(ranges) = sim.scan_due() {
        put.scan(sim, signals, ranges);
    }
    if let Some(hash) = sim.hash_due() {
        outbox.put(episode, tick, v1::StateHash { header: None, hash });
    }
    outbox.put(
        episode,
        tick,
        v1::Clock {
            header: None,
            real_time_factor,
        },
    );
}

/// A pose on the floor.
fn planar([x, y]: [f64; 2], heading: f64) -> v1::Pose {
    let (z_sin, z_cos) = exact::sin_cos(heading / 2.0);
    v1::Pose {
        position: Some(v1::Vector3 { x, y, z: 0.0 }),
        orientation: Some(v1::Quaternion {
            x: 0.0,
            y: 0.0,
            z: z_sin,
            w: z_cos,
        }),
    }
}

/// A velocity on the floor.
fn planar_twist(linear: f64, angular: f64) -> v1::Twist {
    let vector = |x, z| v1::Vector3 { x, y: 0.0, z };
    v1::Twist {
        linear: Some(vector(linear, 0.0)),
        angular: Some(vector(0.0, angular)),
    }
}

struct StatePublisher<'a> {
    outbox: &'a Outbox,
    episode: u64,
    tick: u64,
}

impl StatePublisher<'_> {
    fn joints(&self, sim: &Simulation) {
        let joints = sim.recorded_joints();
        let message = v1::JointState {
            header: None,
            positions: joints.iter().map(|j| j.position).collect(),
            velocities: joints.iter().map(|j| j.velocity).collect(),
            efforts: joints.iter().map(|j| j.effort).collect(),
            opening: Some(sim.opening()),
        };
        self.outbox.put(self.episode, self.tick, message);
    }

    fn poses(&self, sim: &Simulation) {
        let frames = sim
            .recorded_frames()
            .iter()
            .map(convert::frame_pose)
            .collect();
        let message = v1::PoseSet {
            header: None,
            frames,
        };
        self.outbox.put(self.episode, self.tick, message);
        let odometry = sim.odometry();
        let message = v1::Odometry {
            header: None,
            pose: Some(planar(odometry.position, odometry.heading)),
            twist: Some(planar_twist(odometry.linear, odometry.angular)),
        };
        self.outbox.put(self.episode, self.tick, message);
    }

    fn robot_sensors(&self, sim: &Simulation, signals: &Signals) {
        let joints = signals.joints(sim.snapshot(), sim.model(), sim.opening());
        if let Some(joints) = joints {
            let message = v1::SensedJoints {
                header: None,
                positions: joints.positions,
                velocities: joints.velocities,
                efforts: joints.efforts,
                opening: joints.opening,
            };
            self.outbox.put(self.episode, self.tick, message);
        }
        if let Some(odometry) = signals.odometry() {
            let message = v1::SensedOdometry {
                header: None,
                pose: Some(planar(odometry.position, odometry.heading)),
                twist: Some(planar_twist(odometry.linear, odometry.angular)),
            };
            self.outbox.put(self.episode, self.tick, message);
        }
    }

    fn objects(&self, sim: &Simulation) {
        let objects = &sim.snapshot().objects;
        let message = v1::ObjectPoses {
            header: None,
            poses: objects.iter().map(|o| convert::pose(&o.pose)).collect(),
            twists: objects.iter().map(convert::body_twist).collect(),
        };
        self.outbox.put(self.episode, self.tick, message);
    }

    fn furniture(&self, sim: &Simulation) {
        let joints = &sim.snapshot().furniture_joints;
        let message = v1::FurnitureJoints {
            header: None,
            positions: joints.iter().map(|j| j.position).collect(),
            velocities: joints.iter().map(|j| j.velocity).collect(),
        };
        self.outbox.put(self.episode, self.tick, message);
    }

    fn scan(&self, sim: &Simulation, signals: &Signals, ranges: Vec<f32>) {
        let limits = sim.model().settings.scanner.as_ref().map(|s| s.range);
        if let Some(ranges) = limits.and_then(|limits| signals.scan(self.tick, &ranges, limits)) {
            let message = v1::SensedScan {
                header: None,
                ranges,
            };
            self.outbox.put(self.episode, self.tick, message);
        }
        let message = v1::Scan {
            header: None,
            ranges,
        };
        self.outbox.put(self.episode, self.tick, message);
    }

    /// The first deformable; a scene has one at most.
    fn deformable(&self, sim: &Simulation) {
        let snapshot = sim.snapshot();
        let Some(soft) = snapshot.skins.first() else {
            return;
        };
        let message = v1::Deformable {
            header: None,
            object: convert::body_name(BodyRef::Object(soft.object), sim.model(), sim.scene()),
            vertices: soft.vertices.iter().flat_map(|p| [p.x, p.y, p.z]).collect(),
            elastic_energy: soft.elastic_energy,
            kinetic_energy: soft.kinetic_energy,
        };
        self.outbox.put(self.episode, self.tick, message);
    }

    fn contacts(&self, sim: &Simulation) {
        let contacts = &sim.snapshot().contacts;
        let name = |body| convert::body_name(body, sim.model(), sim.scene());
        let message = v1::Contacts {
            header: None,
            pad_forces: sim.pad_forces().to_vec(),
            contact_count: contacts.len().try_into().unwrap_or(u32::MAX),
            contacts: by_priority(contacts)
                .into_iter()
                .take(MAX_CONTACTS)
                .map(|c| v1::Contact {
                    first: name(c.first),
                    second: name(c.second),
                    point: Some(convert::vector(&c.point)),
                    force: Some(convert::vector(&c.force)),
                })
                .collect(),
        };
        self.outbox.put(self.episode, self.tick, message);
    }
}

/// Contacts of the robot, of objects that it touches and of the person first, each
/// group by force.
fn by_priority(contacts: &[Contact]) -> Vec<&Contact> {
    let robot = |body: BodyRef| matches!(body, BodyRef::Link(_));
    let touched: BTreeSet<BodyRef> = contacts
        .iter()
        .filter(|c| robot(c.first) || robot(c.second))
        .flat_map(|c| [c.first, c.second])
        .filter(|body| matches!(body, BodyRef::Object(_)))
        .collect();
    let comes_first = |body: BodyRef| match body {
        BodyRef::Link(_) | BodyRef::Person(_) => true,
        BodyRef::Object(_) => touched.contains(&body),
        BodyRef::Furniture(_) => false,
    };
    let mut sorted: Vec<&Contact> = contacts.iter().collect();
    sorted.sort_by(|a, b| {
        let is_first = |c: &Contact| comes_first(c.first) || comes_first(c.second);
        let strength = b.force.norm().total_cmp(&a.force.norm());
        let group = is_first(b).cmp(&is_first(a)).then(strength);
        group.then_with(|| (a.first, a.second).cmp(&(b.first, b.second)))
    });
    sorted
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    /// 20 heavy objects rest on the table. A light object is held above a foot.
    #[test]
    fn contacts_of_robot_held_object_and_person_come_before_resting_objects() {
        let contact = |first, second, force| Contact {
            first,
            second,
            point: Vector3::zeros(),
            force: Vector3::new(0.0, 0.0, force),
        };
        let (pad, held) = (BodyRef::Link(30), BodyRef::Object(20));
        let mut contacts: Vec<Contact> = (0..20)
            .map(|i| contact(BodyRef::Object(i), BodyRef::Furniture(3), 10.0 + i as f64))
            .collect();
        contacts.push(contact(held, BodyRef::Furniture(4), 0.2));
        contacts.push(contact(pad, held, 0.1));
        contacts.push(contact(BodyRef::Furniture(3), BodyRef::Person(16), 0.3));
        let sorted = by_priority(&contacts);
        let pairs = |range: std::ops::Range<usize>| -> Vec<(BodyRef, BodyRef)> {
            let among = sorted[range].iter();
            among.map(|c| (c.first, c.second)).collect()
        };
        let expected = [
            (BodyRef::Furniture(3), BodyRef::Person(16)),
            (held, BodyRef::Furniture(4)),
            (pad, held),
            (BodyRef::Object(19), BodyRef::Furniture(3)),
        ];
        assert_eq!(pairs(0..4), expected);
        assert_eq!(sorted.len(), contacts.len());
    }
}
