//! Soft objects: a tet mesh under a skin that touches the solids.
//!
//! A soft object is stepped before the engine: the solids are where they are
//! and go on as fast as they go, the contact forces act on the soft object at
//! the end of the tick and, reversed, on the solids during the engine's tick.
//! Every vertex of the skin is a contact point. No vertex is ever attached.

mod candidates;
mod contact_force;
mod elastic;
mod lanes;
#[cfg(test)]
mod laws;
mod ledger;
mod mobility;
mod motion;
mod rotation;
mod solver;
mod tank;

use nalgebra::{Isometry3, Matrix3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use rapier3d::prelude::PhysicsWorld;

use candidates::{Bristles, Skin, Spheres};
pub use elastic::{Elastic, Elasticity};
pub use ledger::Worst;
use ledger::{Energy, Ledger};
pub use motion::State;
use motion::{Acting, standing, step};
use rotation::Rotation;
use solver::Scratch;
use tank::Tank;

use super::health::{FARTHEST, SOFT_ENERGY, STORED_NORM, STORED_SPEED, within};
use crate::geometry::tetrahedra::Tetrahedra;
use crate::scene::{Body, Placement};
use crate::snapshot::{BodyRef, BodyState, Contact, SoftSkin};

/// One soft object of a scene.
pub(super) struct SoftObject {
    /// Index into `Scene::objects`.
    pub object: usize,
    body: Elastic,
    skin: Skin,
    spheres: Spheres,
    pub friction: f64,
    state: State,
    bristles: Bristles,
    /// Ticks in which it hardly moved and nothing that moves was near.
    still: u32,
    /// A tick has led to numbers that are not finite: it stays where it was.
    broken: bool,
    contacts: Vec<Contact>,
    tank: Tank,
    ledger: Ledger,
    scratch: Scratch,
}

/// What a saved world holds of a soft object.
pub(super) type Saved = (State, Bristles, Tank, u32, bool);

/// Speed of the fastest node at which an object hardly moves, m/s.
const HARDLY: f64 = 1e-4;
/// Ticks of hardly any motion after which an object sleeps: nothing of it changes
/// until something that can move comes near.
const SLEEPY: u32 = 120;

impl SoftObject {
    /// The object at its place; `None` when it is a rigid one.
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
            broken: false,
            contacts: Vec::new(),
            tank: Tank::default(),
            ledger: Ledger::default(),
            scratch: Scratch::default(),
        })
    }

    /// One tick of `h` seconds; pushes the solids that it touches.
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
        let acting = Acting {
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
            self.lie(physics, h);
        }
    }

    /// Whether it lies still and nothing that moves is near.
    fn sleeps(&mut self, physics: &PhysicsWorld, h: f64) -> bool {
        if !self.is_asleep() {
            return false;
        }
        if self
            .spheres
            .visit(&self.skin.room(&self.state, &self.body), physics)
        {
            self.still = 0;
            return false;
        }
        // A saved state does not hold them.
        if self.contacts.is_empty() {
            self.lie(physics, h);
        }
        true
    }

    /// Tells the contacts on which it lies.
    fn lie(&mut self, physics: &PhysicsWorld, h: f64) {
        let (skin, body, state) = (&self.skin, &self.body, &self.state);
        let around = (&self.spheres, physics);
        let near = skin.near(state, body, &self.bristles, around, self.friction, h);
        let forces = standing(body, state, &near.candidates, &near.solids, h);
        self.contacts = near.contacts(BodyRef::Object(self.object), &forces);
    }

    /// The worst that was seen of it.
    pub(super) fn worst(&self) -> Worst {
        Worst {
            unsettled: self.scratch.unsettled,
            solutions: self.scratch.solutions,
            steps: self.scratch.steps,
            ..self.ledger.worst()
        }
    }

    /// Whether its motion has led to numbers that are not finite.
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

    /// Whether nothing of it changes.
    pub(super) fn is_asleep(&self) -> bool {
        self.still >= SLEEPY
    }

    /// Gives one node a speed beyond all numbers, to see what happens.
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

    /// Takes out part of its motion, all of it with `keep` 0.
    pub(super) fn damp(&mut self, keep: f64) {
        self.tank.empty();
        self.ledger.restart();
        self.still = 0;
        for v in &mut self.state.velocity {
            *v = if keep == 0.0 {
                Vector3::zeros()
            } else {
                *v * keep
            };
        }
    }

    /// The frame that fits it best, and its mean motion.
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

    /// Where its skin is.
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

    /// What the next tick depends on.
    pub(super) fn save(&self) -> Saved {
        let (state, bristles, tank) = (&self.state, &self.bristles, &self.tank);
        let (state, bristles, tank) = (state.clone(), bristles.clone(), tank.clone());
        (state, bristles, tank, self.still, self.broken)
    }

    /// What is wrong with a saved state of this object.
    ///
    /// # Errors
    /// In words.
    pub(super) fn examine(
        &self,
        (state, bristles, tank, still, broken): &Saved,
    ) -> Result<(), String> {
        let own = &self.state;
        if state.position.len() != own.position.len()
            || state.velocity.len() != own.velocity.len()
            || state.rotations.len() != own.rotations.len()
        {
            return Err("the soft object has another number of nodes or cells".to_owned());
        }
        if *broken {
            return Err("the soft object is broken in it".to_owned());
        }
        let numbers = |all: &[Vector3<f64>]| all.iter().flatten().copied().collect::<Vec<_>>();
        within("the place of a node", &numbers(&state.position), FARTHEST)?;
        within(
            "the speed of a node",
            &numbers(&state.velocity),
            STORED_SPEED,
        )?;
        if *still >= SLEEPY && state.velocity.iter().any(|v| *v != Vector3::zeros()) {
            return Err("the soft object sleeps in it, and moves".to_owned());
        }
        let bristles: Vec<f64> = bristles.numbers().collect();
        within("a bristle of the soft object", &bristles, FARTHEST)?;
        within("the energy of a contact", &tank.numbers(), FARTHEST)?;
        if tank.owes() > SOFT_ENERGY {
            return Err(format!("its contacts owe {} J", tank.owes()));
        }
        let off = |rotation: &Rotation| {
            let norm = rotation.xyzw().iter().map(|x| x * x).sum::<f64>().sqrt();
            norm.is_nan() || (norm - 1.0).abs() > STORED_NORM
        };
        if state.rotations.iter().chain([&state.whole]).any(off) {
            return Err("a rotation of the soft object has not the norm 1".to_owned());
        }
        Ok(())
    }

    /// Takes over a saved state that has been examined.
    pub(super) fn restore(&mut self, (state, bristles, tank, still, broken): Saved) {
        self.state = state;
        self.bristles = bristles;
        self.tank = tank;
        self.still = still;
        self.broken = broken;
        self.contacts.clear();
        self.ledger.restart();
    }

    /// Numbers that take part in the state hash.
    pub(super) fn bits(&self) -> impl Iterator<Item = u64> + '_ {
        let nodes = self.state.position.iter().chain(&self.state.velocity);
        let nodes = nodes.flat_map(|v| [v.x, v.y, v.z]);
        let bristles = self.bristles.numbers();
        nodes.chain(bristles).map(f64::to_bits)
    }
}
