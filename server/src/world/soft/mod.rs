//! Deformables: a tetrahedral mesh under a skin that touches the solids.
//!
//! A deformable is stepped before the engine: the solids keep their velocity, the
//! contact forces act on the deformable at the end of the tick and, reversed, on the
//! solids during the engine's tick. Every vertex of the skin is a contact point. No
//! vertex is ever attached.

mod candidates;
mod contact_force;
mod elastic;
mod energy_audit;
mod lanes;
#[cfg(test)]
mod laws;
mod mobility;
mod motion;
mod rotation;
mod solver;
mod tank;

use nalgebra::{Isometry3, Matrix3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use rapier3d::prelude::PhysicsWorld;

use candidates::{Bristles, Room, Skin, Spheres};
pub use elastic::{Elastic, Elasticity};
pub use energy_audit::WorstValues;
use energy_audit::{Energy, EnergyAudit};
pub use motion::State;
use motion::{TickLoads, standing, step};
use rotation::Rotation;
use solver::Scratch;
use tank::Tank;

use super::health::{FARTHEST, SOFT_ENERGY, STORED_NORM, STORED_SPEED, within};
use crate::geometry::tetrahedra::Tetrahedra;
use crate::scene::{Body, Placement};
use crate::snapshot::{BodyRef, BodyState, Contact, SoftSkin};

/// One deformable of a scene.
pub(super) struct SoftObject {
    /// Index into `Scene::objects`.
    pub object: usize,
    body: Elastic,
    skin: Skin,
    spheres: Spheres,
    pub friction: f64,
    state: State,
    bristles: Bristles,
    /// Ticks without noticeable motion of the object or of bodies within reach.
    still: u32,
    /// Bounding box of the skin while it sleeps.
    room: Option<Room>,
    /// A tick gave non-finite numbers: the object keeps its former state.
    broken: bool,
    contacts: Vec<Contact>,
    tank: Tank,
    ledger: EnergyAudit,
    scratch: Scratch,
}

/// Saved state of a deformable.
pub(super) type SavedState = (State, Bristles, Tank, u32, bool);

/// Node speed below which an object is at rest, m/s. An object that was set down creeps
/// more slowly for seconds, by 0.1 mm in total; one that topples is faster within 0.5 s.
const HARDLY: f64 = 1e-3;
/// Ticks at rest after which an object sleeps: its state is constant until a moving
/// body is within reach.
const SLEEPY: u32 = 120;

impl SoftObject {
    /// The object as placed; `None` when it is rigid.
    pub(super) fn placed(object: usize, body: &Body, placement: &Placement) -> Option<Self> {
        let soft = body.soft.as_ref()?;
        let skin = soft.plush.skin(soft.skin_pitch);
        let tet_mesh = Tetrahedra::tet_mesh(&soft.plush, soft.tet_pitch);
        let material = Elasticity {
            young_modulus: soft.young_modulus,
            poisson_ratio: soft.poisson_ratio,
            damping: soft.damping,
        };
        let elastic = Elastic::new(&tet_mesh, &material, placement.mass);
        Some(Self {
            object,
            state: State::placed(&elastic, &placement.pose),
            skin: Skin::new(&tet_mesh, &skin),
            body: elastic,
            spheres: Spheres::default(),
            friction: placement.friction,
            bristles: Bristles::default(),
            still: 0,
            room: None,
            broken: false,
            contacts: Vec::new(),
            tank: Tank::default(),
            ledger: EnergyAudit::default(),
            scratch: Scratch::default(),
        })
    }

    /// One tick of `h` seconds; pushes the touched solids.
    pub(super) fn step(&mut self, physics: &mut PhysicsWorld, gravity: f64, h: f64) {
        self.spheres.update(physics);
        if self.broken || self.sleeps(physics, h) {
            return;
        }
        let before = self.state.clone();
        let near = self.skin.near(
            &self.state,
            &self.body,
            &self.bristles,
            (&self.spheres, &*physics),
            self.friction,
            h,
        );
        let fall = Vector3::z() * -gravity;
        let masses = &self.body.masses;
        let kinetic = before.kinetic_energy(&self.body);
        let height = gravity * self.body.mass * self.body.centre(&before.position).z;
        let (tank, physics_before) = (&mut self.tank, &*physics);
        let mut passage = None;
        let acting = TickLoads {
            candidates: &near.candidates,
            solids: &near.solids,
            load: |i: usize| fall * masses[i],
            held: &[],
            soften: |elastic: f64, contacts: f64| {
                passage = tank.pass(physics_before, kinetic + elastic + height);
                tank.share(passage, contacts)
            },
        };
        let done = step(&self.body, &mut self.state, acting, h, &mut self.scratch);
        let forces = &done.forces;
        if !self.state.is_finite() || forces.iter().any(|p| !p.is_finite()) {
            self.state = before;
            self.damp(0.0);
            self.contacts.clear();
            self.broken = true;
            return;
        }
        let energy = Energy {
            kinetic,
            elastic: done.elastic,
            height,
            contacts: forces.iter().map(|p| p.energy[0]).sum(),
        };
        let speed = self.state.fastest();
        let ledger = &mut self.ledger;
        ledger.enter(energy, passage, &near.candidates, &done, speed);
        let inner = kinetic + done.elastic + height;
        self.tank.enter(inner, &near, forces, h);
        self.bristles = near.bristles(forces);
        self.contacts = near.contacts(BodyRef::Object(self.object), forces);
        near.push(physics, forces);
        if near.is_alone && speed < HARDLY {
            self.still += 1;
        } else {
            self.still = 0;
        }
        if self.still == SLEEPY {
            self.damp(0.0);
            self.still = SLEEPY;
            self.compute_resting_contacts(physics, h);
        }
    }

    /// Whether it is at rest and no moving body is near.
    fn sleeps(&mut self, physics: &PhysicsWorld, h: f64) -> bool {
        if !self.is_asleep() {
            return false;
        }
        let (skin, state, body) = (&self.skin, &self.state, &self.body);
        let room = self.room.get_or_insert_with(|| skin.room(state, body));
        if skin.is_visited((state, body), room, (&self.spheres, physics), h) {
            self.still = 0;
            self.room = None;
            return false;
        }
        // They are not part of a saved state.
        if self.contacts.is_empty() {
            self.compute_resting_contacts(physics, h);
        }
        true
    }

    /// Computes the contacts of the resting object.
    fn compute_resting_contacts(&mut self, physics: &PhysicsWorld, h: f64) {
        let (skin, body, state) = (&self.skin, &self.body, &self.state);
        let around = (&self.spheres, physics);
        let near = skin.near(state, body, &self.bristles, around, self.friction, h);
        let forces = standing(body, state, &near.candidates, &near.solids, h);
        self.contacts = near.contacts(BodyRef::Object(self.object), &forces);
    }

    /// Its worst audit values.
    pub(super) fn worst(&self) -> WorstValues {
        WorstValues {
            unsettled: self.scratch.unsettled,
            solutions: self.scratch.solutions,
            steps: self.scratch.steps,
            ..self.ledger.worst()
        }
    }

    /// Whether its motion gave non-finite numbers.
    pub(super) fn is_broken(&self) -> bool {
        self.broken
    }

    /// Speed of its fastest node, m/s.
    pub(super) fn fastest_node(&self) -> f64 {
        let squares = self.state.velocity.iter().map(Vector3::norm_squared);
        squares.fold(0.0, f64::max).sqrt()
    }

    /// Its elastic and kinetic energy, J.
    pub(super) fn energy(&self) -> f64 {
        let (elastic, kinetic) = self.state.energy(&self.body);
        elastic + kinetic
    }

    /// Whether its state is constant.
    pub(super) fn is_asleep(&self) -> bool {
        self.still >= SLEEPY
    }

    /// Sets the speed of one node to a non-finite value, for tests.
    #[cfg(test)]
    pub(super) fn spoil(&mut self) {
        self.state.velocity[0].x = f64::INFINITY;
    }

    /// kg.
    pub(super) fn mass(&self) -> f64 {
        self.body.mass
    }

    /// Its contacts in the last tick.
    pub(super) fn contacts(&self) -> &[Contact] {
        &self.contacts
    }

    /// Reduces its motion to the share `keep`.
    pub(super) fn damp(&mut self, keep: f64) {
        self.tank.empty();
        self.ledger.restart();
        self.still = 0;
        self.room = None;
        for v in &mut self.state.velocity {
            *v = if keep == 0.0 {
                Vector3::zeros()
            } else {
                *v * keep
            };
        }
    }

    /// The best-fitting frame, and its mean motion.
    pub(super) fn frame(&self) -> BodyState {
        let [x, y, z, w] = self.state.whole.xyzw();
        let rotation = UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
        let centre = self.body.centre(&self.state.position);
        let rest = self.body.centre(&self.body.rest);
        let origin = centre - rotation * rest;
        let mean = self.body.centre(&self.state.velocity);
        let (mut spin, mut inertia) = (Vector3::zeros(), Matrix3::zeros());
        for i in 0..self.body.nodes() {
            let (r, m) = (self.state.position[i] - centre, self.body.masses[i]);
            spin += r.cross(&(self.state.velocity[i] - mean)) * m;
            inertia += (Matrix3::identity() * r.norm_squared() - r * r.transpose()) * m;
        }
        let angular = inertia.try_inverse().unwrap_or_default() * spin;
        BodyState {
            pose: Isometry3::from_parts(Translation3::from(origin), rotation),
            linear: mean + angular.cross(&(origin - centre)),
            angular,
        }
    }

    /// Positions of its skin.
    pub(super) fn skin(&self) -> SoftSkin {
        let points = self.skin.points(&self.body, &self.state.position);
        let (elastic_energy, kinetic_energy) = self.state.energy(&self.body);
        SoftSkin {
            elastic_energy,
            kinetic_energy,
            object: self.object,
            vertices: points.iter().map(|p| Point3::from(p.cast())).collect(),
        }
    }

    /// The state that the next tick depends on.
    pub(super) fn save(&self) -> SavedState {
        let (state, bristles, tank) = (&self.state, &self.bristles, &self.tank);
        let (state, bristles, tank) = (state.clone(), bristles.clone(), tank.clone());
        (state, bristles, tank, self.still, self.broken)
    }

    /// Validates a saved state of this object.
    ///
    /// # Errors
    /// With a description of the problem.
    pub(super) fn examine(
        &self,
        (state, bristles, tank, still, broken): &SavedState,
    ) -> Result<(), String> {
        let own = &self.state;
        if state.position.len() != own.position.len()
            || state.velocity.len() != own.velocity.len()
            || state.rotations.len() != own.rotations.len()
        {
            return Err("the soft object has a different number of nodes or cells".to_owned());
        }
        if *broken {
            return Err("the state of the soft object is broken".to_owned());
        }
        let numbers = |all: &[Vector3<f64>]| all.iter().flatten().copied().collect::<Vec<_>>();
        within(
            "the position of a node",
            &numbers(&state.position),
            FARTHEST,
        )?;
        within(
            "the speed of a node",
            &numbers(&state.velocity),
            STORED_SPEED,
        )?;
        if *still >= SLEEPY && state.velocity.iter().any(|v| *v != Vector3::zeros()) {
            return Err("the soft object is asleep but moves".to_owned());
        }
        let bristles: Vec<f64> = bristles.numbers().collect();
        within("a bristle of the soft object", &bristles, FARTHEST)?;
        within("the energy of a contact", &tank.numbers(), FARTHEST)?;
        if tank.owes() > SOFT_ENERGY {
            return Err(format!("its contacts have a deficit of {} J", tank.owes()));
        }
        let off = |rotation: &Rotation| {
            let norm = rotation.xyzw().iter().map(|x| x * x).sum::<f64>().sqrt();
            norm.is_nan() || (norm - 1.0).abs() > STORED_NORM
        };
        if state.rotations.iter().chain([&state.whole]).any(off) {
            return Err("a rotation of the soft object does not have the norm 1".to_owned());
        }
        Ok(())
    }

    /// Restores a validated state.
    pub(super) fn restore(&mut self, (state, bristles, tank, still, broken): SavedState) {
        self.state = state;
        self.bristles = bristles;
        self.tank = tank;
        self.still = still;
        self.broken = broken;
        self.room = None;
        self.contacts.clear();
        self.ledger.restart();
    }

    /// Numbers included in the state hash.
    pub(super) fn bits(&self) -> impl Iterator<Item = u64> + '_ {
        let nodes = self.state.position.iter().chain(&self.state.velocity);
        let nodes = nodes.flat_map(|v| [v.x, v.y, v.z]);
        let bristles = self.bristles.numbers();
        let still = [u64::from(self.still)];
        nodes.chain(bristles).map(f64::to_bits).chain(still)
    }
}
