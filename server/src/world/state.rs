//! Saving, restoring and hashing a world.

use rapier3d::prelude::PhysicsWorld;
use serde::{Deserialize, Serialize};
use wheelarm_proto::PHYSICS_VERSION;
use wheelarm_proto::random::Fnv1a;

use super::pad_friction::Bristles;
use super::seat::Seated;
use super::signals::Signals;
use super::soft::{self, SoftObject};
use super::{World, WorldError};
use crate::robot::control::Targets;
use crate::snapshot::PersonState;

/// State that a tick changes, for writing.
#[derive(Serialize)]
struct EncodedState<'a> {
    /// First, so that it can be decoded in any version.
    physics_version: u32,
    fingerprint: u64,
    tick: u64,
    targets: Targets,
    wheel_angles: [f64; 4],
    wheel_leads: [f64; 2],
    wheel_rates: [f64; 2],
    signals: &'a Signals,
    bristles: Bristles,
    soft: Vec<soft::SavedState>,
    physics: &'a PhysicsWorld,
}

/// State that a tick changes, for reading.
#[derive(Deserialize)]
pub(super) struct DecodedState {
    /// Checked before the rest is decoded.
    _physics_version: u32,
    pub(super) fingerprint: u64,
    pub(super) tick: u64,
    pub(super) targets: Targets,
    pub(super) wheel_angles: [f64; 4],
    pub(super) wheel_leads: [f64; 2],
    pub(super) wheel_rates: [f64; 2],
    pub(super) signals: Signals,
    pub(super) bristles: Bristles,
    pub(super) soft: Vec<soft::SavedState>,
    pub(super) physics: PhysicsWorld,
    /// Follows the rest if a person sits in the chair.
    #[serde(skip)]
    pub(super) person: Option<PersonState>,
}

impl World {
    /// Serializes the whole state. A world created from the same scenario continues
    /// from it with identical bits.
    #[must_use]
    pub fn save(&self) -> Vec<u8> {
        let written = EncodedState {
            physics_version: PHYSICS_VERSION,
            fingerprint: self.fingerprint,
            tick: self.tick,
            targets: self.targets,
            wheel_angles: self.wheels.angles,
            wheel_leads: self.wheels.led,
            wheel_rates: self.wheels.rolling,
            signals: &self.signals,
            bristles: self.grip.state(),
            soft: self.soft.iter().map(SoftObject::save).collect(),
            physics: &self.physics,
        };
        // Writing to memory fails only for types that cannot be serialized, which the
        // tests would detect.
        let mut bytes = postcard::to_stdvec(&written).unwrap_or_default();
        // A chair without a person is stored as before persons existed.
        if let Some(seated) = &self.seated {
            bytes.extend(postcard::to_stdvec(&seated.state()).unwrap_or_default());
        }
        bytes
    }

    /// The state of deformables in [`World::save`], for tests that damage it.
    #[cfg(test)]
    pub(crate) fn saved_soft(&self) -> Vec<u8> {
        let soft: Vec<soft::SavedState> = self.soft.iter().map(SoftObject::save).collect();
        postcard::to_stdvec(&soft).expect("plain data")
    }

    /// Restores a saved state.
    ///
    /// # Errors
    /// When the bytes are not a saved state, belong to another world or physics
    /// version, or are invalid; the world is unchanged.
    pub fn restore(&mut self, bytes: &[u8]) -> Result<(), WorldError> {
        let read = self.read(bytes)?;
        self.examine(&read)
            .map_err(|problem| WorldError::Damaged { problem })?;
        self.take(read);
        Ok(())
    }

    /// Restores a state that this world has saved or validated before. Validation would
    /// compare it with the present state, in which a body may be disabled or a joint
    /// invalid.
    ///
    /// # Errors
    /// As [`World::restore`] for bytes that are not a saved state of this world.
    pub fn put_back(&mut self, bytes: &[u8]) -> Result<(), WorldError> {
        let read = self.read(bytes)?;
        self.take(read);
        Ok(())
    }

    fn read(&self, bytes: &[u8]) -> Result<DecodedState, WorldError> {
        let (found, _) = postcard::take_from_bytes::<u32>(bytes)?;
        if found != PHYSICS_VERSION {
            return Err(WorldError::OtherPhysics { found });
        }
        let (mut read, mut rest) = postcard::take_from_bytes::<DecodedState>(bytes)?;
        if self.seated.is_some() && read.fingerprint == self.fingerprint {
            let (person, after) = postcard::take_from_bytes::<PersonState>(rest)?;
            (read.person, rest) = (Some(person), after);
        }
        if !rest.is_empty() {
            let problem = format!("{} bytes after its end", rest.len());
            return Err(WorldError::Damaged { problem });
        }
        let other = |found| WorldError::OtherWorld {
            expected: self.fingerprint,
            found,
        };
        if read.fingerprint != self.fingerprint {
            return Err(other(read.fingerprint));
        }
        let same_bodies = self.physics.bodies.iter().map(|(handle, _)| handle);
        let same_colliders = self.physics.colliders.iter().map(|(handle, _)| handle);
        if !same_bodies.eq(read.physics.bodies.iter().map(|(handle, _)| handle))
            || read.soft.len() != self.soft.len()
            || read.signals.len() != self.signals.len()
            || !same_colliders.eq(read.physics.colliders.iter().map(|(handle, _)| handle))
        {
            return Err(other(!self.fingerprint));
        }
        Ok(read)
    }

    fn take(&mut self, read: DecodedState) {
        for (soft, saved) in self.soft.iter_mut().zip(read.soft) {
            soft.restore(saved);
        }
        self.tick = read.tick;
        self.targets = read.targets;
        self.wheels.angles = read.wheel_angles;
        self.wheels.led = read.wheel_leads;
        self.wheels.rolling = read.wheel_rates;
        self.signals = read.signals;
        self.grip.restore(read.bristles);
        self.physics = read.physics;
        if let (Some(seated), Some(person)) = (&mut self.seated, read.person) {
            seated.restore(&self.physics, person, read.tick);
        }
    }

    /// Hash of all poses, velocities, bristles and soft nodes (FNV-1a over their bits).
    #[must_use]
    pub fn hash(&self) -> u64 {
        let mut hash = Fnv1a::default();
        hash.add(&self.tick.to_le_bytes());
        for (_, body) in self.physics.bodies.iter() {
            let (t, r) = (body.translation(), body.rotation());
            let (v, w) = (body.linvel(), body.angvel());
            for x in [
                t.x, t.y, t.z, r.x, r.y, r.z, r.w, v.x, v.y, v.z, w.x, w.y, w.z,
            ] {
                hash.add(&x.to_bits().to_le_bytes());
            }
        }
        for bits in self.grip.state().bits() {
            hash.add(&bits.to_le_bytes());
        }
        for bits in self.soft.iter().flat_map(SoftObject::bits) {
            hash.add(&bits.to_le_bytes());
        }
        for bits in self.seated.iter().flat_map(Seated::bits) {
            hash.add(&bits.to_le_bytes());
        }
        hash.0
    }
}
