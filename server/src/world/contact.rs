//! Contacts and their forces.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use rapier3d::prelude::{Collider, ContactManifold, ContactPair, PhysicsWorld};
use rapier3d::utils::OrthonormalBasis;

use super::convert::from_vector;
use crate::snapshot::{BodyRef, Contact};

const KINDS: u32 = 32;

/// User data of a collider that identifies its body.
pub(super) fn tag(body: BodyRef) -> u128 {
    let (kind, index) = match body {
        BodyRef::Link(i) => (0, i),
        BodyRef::Object(i) => (1, i),
        BodyRef::Furniture(i) => (2, i),
        BodyRef::Person(i) => (3, i),
    };
    (kind << KINDS) | (index as u128)
}

/// Body of a collider's user data.
pub(super) fn body_of(tag: u128) -> BodyRef {
    let index = (tag & ((1 << KINDS) - 1)) as usize;
    match tag >> KINDS {
        0 => BodyRef::Link(index),
        1 => BodyRef::Object(index),
        3 => BodyRef::Person(index),
        _ => BodyRef::Furniture(index),
    }
}

/// Sum over the points of a pair.
#[derive(Default)]
struct Sum {
    force: Vector3<f64>,
    weighted_point: Vector3<f64>,
    weight: f64,
}

/// The pairs with contact force: the robot with anything but the floor, objects with
/// objects and furniture. Sorted by pair.
pub(super) fn contacts(physics: &PhysicsWorld) -> Vec<Contact> {
    let is_reported = |first, second| {
        !matches!(
            (first, second),
            (BodyRef::Link(_), BodyRef::Furniture(0))
                | (BodyRef::Furniture(_), BodyRef::Furniture(_))
        )
    };
    contacts_among(physics, physics.narrow_phase.contact_pairs(), is_reported)
}

/// The engine's pairs for which `wanted(first, second)` holds, sorted by pair; the
/// lesser body is the first.
pub(super) fn contacts_among<'a>(
    physics: &PhysicsWorld,
    pairs: impl Iterator<Item = &'a ContactPair>,
    wanted: impl Fn(BodyRef, BodyRef) -> bool,
) -> Vec<Contact> {
    let mut sums: BTreeMap<(BodyRef, BodyRef), Sum> = BTreeMap::new();
    for pair in pairs {
        let (Some(one), Some(other)) = (
            physics.colliders.get(pair.collider1),
            physics.colliders.get(pair.collider2),
        ) else {
            continue;
        };
        let (a, b) = (body_of(one.user_data), body_of(other.user_data));
        let (first, second) = if a <= b { (a, b) } else { (b, a) };
        if !wanted(first, second) {
            continue;
        }
        let friction = match is_articulated(physics, one) || is_articulated(physics, other) {
            true => Friction::PerPoint,
            false => Friction::PerManifold,
        };
        for manifold in pair.solver_manifolds() {
            let sign = if a <= b { 1.0 } else { -1.0 };
            let sum = sums.entry((first, second)).or_default();
            add(sum, physics, manifold, sign, friction);
        }
    }
    sums.into_iter()
        .filter(|(_, sum)| sum.weight > 0.0)
        .map(|((first, second), sum)| Contact {
            first,
            second,
            point: sum.weighted_point / sum.weight,
            force: sum.force,
        })
        .collect()
}

/// How the engine solves and stores the friction of a manifold.
#[derive(Clone, Copy)]
enum Friction {
    /// One constraint per point, for contacts of a robot link. The engine stores the
    /// impulse of all substeps.
    PerPoint,
    /// One constraint per manifold, stored at its first point, between free bodies. The
    /// engine stores the impulse of the last substep only.
    PerManifold,
}

/// Whether the collider belongs to a link of the robot's multibody; the person's
/// capsules do.
fn is_articulated(physics: &PhysicsWorld, collider: &Collider) -> bool {
    let link = |body| physics.multibody_joints.rigid_body_link(body);
    collider.parent().is_some_and(|body| link(body).is_some())
}

/// Adds the force on the manifold's second body, times `sign`.
fn add(
    sum: &mut Sum,
    physics: &PhysicsWorld,
    manifold: &ContactManifold,
    sign: f64,
    friction: Friction,
) {
    let dt = f64::from(physics.integration_parameters.dt);
    let substep = dt / physics.integration_parameters.num_solver_iterations as f64;
    let normal = from_vector(manifold.data.normal);
    // The basis in which the engine stores tangent impulses.
    let towards_first = -manifold.data.normal;
    let tangent = towards_first.orthonormal_vector();
    let bitangent = towards_first.cross(tangent);
    for (index, contact) in manifold.data.solver_contacts.iter().enumerate() {
        let Some(point) = manifold.points.get(contact.contact_indices()[0] as usize) else {
            continue;
        };
        let push = f64::from(point.data.impulse) / dt;
        match friction {
            Friction::PerPoint => {
                let [along, across] = [0, 1].map(|i| f64::from(point.data.tangent_impulse[i]));
                let drag = from_vector(tangent) * along + from_vector(bitangent) * across;
                sum.force -= drag * (sign / dt);
            }
            Friction::PerManifold if index == 0 => {
                let drag = from_vector(point.data.warmstart_tangent_world);
                sum.force -= drag * (sign / substep);
            }
            Friction::PerManifold => {}
        }
        if push > 0.0 {
            let (p1, p2) = manifold
                .data
                .solver_contact_world_points(contact, &physics.bodies);
            sum.force += normal * push * sign;
            sum.weighted_point += from_vector((p1 + p2) * 0.5) * push;
            sum.weight += push;
        }
    }
}
