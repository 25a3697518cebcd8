//! Contact candidates between the skin of a deformable and the engine's solids.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Point3, Vector3};
use rapier3d::geometry::{ColliderHandle, Shape, TypedShape};
use rapier3d::parry::bounding_volume::BoundingSphere;
use rapier3d::prelude::{Collider, PhysicsWorld, RigidBodyHandle};
use serde::{Deserialize, Serialize};

use super::super::contact::body_of;
use super::super::convert::{from_pose, from_vector, point as to_engine, vector};
use super::contact_force::{ContactCandidate, ContactForce, Mobility};
use super::elastic::Elastic;
use super::mobility::Mobilities;
use super::motion::State;
use crate::geometry::plush;
use crate::geometry::tetrahedra::{Embedded, Tetrahedra};
use crate::snapshot::{BodyRef, Contact};

/// Pressure over depth of the skin's foundation, N/m³: 10 kPa compress it by 1 mm, so
/// that the flesh yields and not the skin.
const FOUNDATION: f64 = 1e7;
/// Points closer than this may touch within a tick, metres.
const MARGIN: f64 = 0.006;

/// A moving solid further away than this does not arrive within a tick, metres.
const VISIT: f64 = 0.05;

/// Vertex of the skin, index and generation of a collider.
type Key = (u32, u32, u32);

/// Where each touching vertex sticks to its solid, in the solid's frame, metres.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Bristles(BTreeMap<Key, [f64; 3]>);

impl Bristles {
    /// All numbers, for validation.
    pub(super) fn numbers(&self) -> impl Iterator<Item = f64> + '_ {
        self.0.values().flatten().copied()
    }
}

/// The skin: its vertices in the tet mesh, and the foundation under each.
#[derive(Clone, Debug)]
pub(super) struct Skin {
    places: Vec<Embedded>,
    stiffness: Vec<f64>,
    patches: Vec<Patch>,
}

/// The vertices in one cell.
#[derive(Clone, Debug)]
struct Patch {
    cell: usize,
    vertices: Vec<usize>,
    /// How far they may be outside the bounding box of the cell's corners, in units of
    /// its edges.
    beyond: f64,
}

/// The contact candidates of one tick, with their solids.
pub(super) struct TickCandidates {
    pub candidates: Vec<ContactCandidate>,
    /// The touched solids.
    pub solids: Vec<Mobility>,
    pub(super) sites: Vec<ContactSite>,
    /// Whether all solids within reach of a vertex are fixed or asleep.
    pub is_alone: bool,
}

/// The solid under a contact candidate.
pub(super) struct ContactSite {
    key: Key,
    /// Position of the vertex, metres.
    pub point: Vector3<f64>,
    pub collider: ColliderHandle,
    pub house_from_solid: Isometry3<f64>,
    body: Option<RigidBodyHandle>,
    reference: BodyRef,
}

/// A solid near the deformable.
struct Solid<'a> {
    handle: ColliderHandle,
    collider: &'a Collider,
    house_from_solid: Isometry3<f64>,
    low: Vector3<f64>,
    high: Vector3<f64>,
    friction: f64,
    linear: Vector3<f64>,
    angular: Vector3<f64>,
    centre: Vector3<f64>,
}

impl Skin {
    pub(super) fn new(tet_mesh: &Tetrahedra, skin: &plush::Skin) -> Self {
        let places = tet_mesh.embed(&skin.positions);
        Self {
            patches: patches(&places),
            places,
            stiffness: skin.areas().iter().map(|a| a * FOUNDATION).collect(),
        }
    }

    /// Positions of the vertices for node positions, or velocities for node velocities.
    pub(super) fn points(&self, body: &Elastic, of: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        self.places.iter().map(|e| place(e, body, of)).collect()
    }

    /// The bounding box of the skin.
    pub(super) fn room(&self, state: &State, body: &Elastic) -> Room {
        around(self.patches.iter().map(|p| p.room(body, &state.position)))
    }

    /// The vertices that may touch a solid within a tick of `h` seconds.
    pub(super) fn near(
        &self,
        state: &State,
        body: &Elastic,
        bristles: &Bristles,
        (spheres, physics): (&Spheres, &PhysicsWorld),
        friction: f64,
        h: f64,
    ) -> TickCandidates {
        let margin = MARGIN + state.fastest() * h;
        let boxes = self.patches.iter().map(|p| p.room(body, &state.position));
        let boxes: Vec<Room> = boxes.collect();
        let room = around(boxes.iter().copied());
        let mut near = TickCandidates {
            candidates: Vec::new(),
            solids: Vec::new(),
            sites: Vec::new(),
            is_alone: true,
        };
        let mut mobilities = Mobilities::new(physics);
        let mut vertices = Vec::new();
        for solid in solids(spheres, physics, &room, margin, friction) {
            let others = near.candidates.len();
            vertices.clear();
            for (patch, (from, to)) in self.patches.iter().zip(&boxes) {
                if (0..3).all(|a| to[a] >= solid.low[a] && from[a] <= solid.high[a]) {
                    vertices.extend_from_slice(&patch.vertices);
                }
            }
            vertices.sort_unstable();
            for &i in &vertices {
                let p = &place(&self.places[i], body, &state.position);
                if (0..3).any(|a| p[a] < solid.low[a] || p[a] > solid.high[a]) {
                    continue;
                }
                let Some((gap, normal)) = solid.gap(p, margin) else {
                    continue;
                };
                let number = mobilities.number(solid.collider.parent(), &mut near.solids);
                let (index, generation) = solid.handle.into_raw_parts();
                let key = (i as u32, index, generation);
                let anchor = bristles.0.get(&key).map(|local| {
                    let house = solid.house_from_solid * Point3::from(*local);
                    house.coords
                });
                near.candidates.push(ContactCandidate {
                    cell: self.places[i].cell,
                    weights: self.places[i].weights,
                    stiffness: self.stiffness[i],
                    friction: solid.friction,
                    normal,
                    gap,
                    anchor,
                    velocity: solid.linear + solid.angular.cross(&(p - solid.centre)),
                    solid: number,
                });
                near.sites.push(ContactSite {
                    key,
                    point: *p,
                    collider: solid.handle,
                    house_from_solid: solid.house_from_solid,
                    body: solid.collider.parent(),
                    reference: body_of(solid.collider.user_data),
                });
            }
            // A hand that waits beside the object does not touch it.
            near.is_alone &= others == near.candidates.len() || is_at_rest(solid.collider, physics);
        }
        near
    }

    /// Whether a moving solid may touch a vertex within a tick of `h` seconds; `room` is
    /// the bounding box of the skin.
    pub(super) fn is_visited(
        &self,
        (state, body): (&State, &Elastic),
        room: &Room,
        (spheres, physics): (&Spheres, &PhysicsWorld),
        h: f64,
    ) -> bool {
        let (low, high) = room;
        let moving = spheres.around(physics, room, VISIT);
        let mut moving = moving.filter(|(_, collider)| !is_at_rest(collider, physics));
        moving.any(|(handle, collider)| {
            let margin = (MARGIN + speed(collider, physics) * h).min(VISIT);
            reach(collider, physics, low, high, margin).is_some_and(|reach| {
                let solid = Solid::new(handle, collider, physics, reach, 0.0);
                self.patches.iter().any(|patch| {
                    let (from, to) = patch.room(body, &state.position);
                    let overlaps = |a: usize| to[a] >= solid.low[a] && from[a] <= solid.high[a];
                    let touches = |&i: &usize| {
                        let p = place(&self.places[i], body, &state.position);
                        (0..3).all(|a| p[a] >= solid.low[a] && p[a] <= solid.high[a])
                            && solid.distance(&p).0 <= margin
                    };
                    (0..3).all(overlaps) && patch.vertices.iter().any(touches)
                })
            })
        })
    }
}

/// Corners of a box, metres.
pub(super) type Room = (Vector3<f64>, Vector3<f64>);

/// The bounding box of boxes.
fn around(boxes: impl Iterator<Item = Room>) -> Room {
    let nothing = Vector3::repeat(f64::INFINITY);
    boxes.fold((nothing, -nothing), |(low, high), (from, to)| {
        (low.inf(&from), high.sup(&to))
    })
}

/// Whether a collider is fixed or asleep; a pushed body is not asleep.
fn is_at_rest(collider: &Collider, physics: &PhysicsWorld) -> bool {
    let body = collider.parent().and_then(|body| physics.bodies.get(body));
    body.is_none_or(|body| body.is_fixed() || body.is_sleeping())
}

/// Greatest speed of a point of a collider, m/s.
fn speed(collider: &Collider, physics: &PhysicsWorld) -> f64 {
    let body = collider.parent().and_then(|body| physics.bodies.get(body));
    body.map_or(0.0, |body| {
        let aabb = collider.compute_aabb();
        let far = f64::from((aabb.center() - body.center_of_mass()).length())
            + f64::from(aabb.half_extents().length());
        from_vector(body.linvel()).norm() + from_vector(body.angvel()).norm() * far
    })
}

/// Bounding spheres of all colliders, to skip distant ones.
#[derive(Clone, Debug, Default)]
pub(super) struct Spheres(Vec<(ColliderHandle, BoundingSphere)>);

impl Spheres {
    /// Updates the list. Shapes never change; colliders are only added.
    pub(super) fn update(&mut self, physics: &PhysicsWorld) {
        if self.0.len() != physics.colliders.len() {
            let sphere = |collider: &Collider| collider.shape().compute_local_bounding_sphere();
            let colliders = physics.colliders.iter();
            self.0 = colliders.map(|(h, c)| (h, sphere(c))).collect();
        }
    }

    /// The colliders that may overlap a box extended by `margin` metres, in the
    /// engine's order.
    fn around<'a>(
        &'a self,
        physics: &'a PhysicsWorld,
        (low, high): &'a Room,
        margin: f64,
    ) -> impl Iterator<Item = (ColliderHandle, &'a Collider)> + 'a {
        const ROUNDING: f64 = 1e-3;
        self.0.iter().filter_map(move |(handle, sphere)| {
            let collider = physics.colliders.get(*handle)?;
            let centre = from_vector(collider.position().transform_point(sphere.center));
            let away = centre - centre.sup(low).inf(high);
            let radius = f64::from(sphere.radius) + margin + ROUNDING;
            (away.norm_squared() <= radius * radius || !radius.is_finite())
                .then_some((*handle, collider))
        })
    }
}

/// The vertices of every cell with any.
fn patches(places: &[Embedded]) -> Vec<Patch> {
    let mut patches: BTreeMap<usize, Patch> = BTreeMap::new();
    for (vertex, at) in places.iter().enumerate() {
        let patch = patches.entry(at.cell).or_insert(Patch {
            cell: at.cell,
            vertices: Vec::new(),
            beyond: 0.0,
        });
        patch.vertices.push(vertex);
        let negative: f64 = at.weights.iter().filter(|w| **w < 0.0).sum();
        patch.beyond = patch.beyond.max(-negative);
    }
    patches.into_values().collect()
}

impl Patch {
    /// The bounding box of all its vertices.
    fn room(&self, body: &Elastic, position: &[Vector3<f64>]) -> Room {
        const ROUNDING: f64 = 1e-9;
        let [a, b, c, d] = body.cells[self.cell].nodes.map(|i| position[i]);
        let (low, high) = (a.inf(&b).inf(&c.inf(&d)), a.sup(&b).sup(&c.sup(&d)));
        let around = (high - low) * self.beyond + Vector3::repeat(ROUNDING);
        (low - around, high + around)
    }
}

/// Position of a vertex for node positions.
fn place(at: &Embedded, body: &Elastic, of: &[Vector3<f64>]) -> Vector3<f64> {
    let nodes = body.cells[at.cell].nodes.iter().zip(&at.weights);
    nodes.map(|(i, w)| of[*i] * *w).sum()
}

/// The solids whose bounding boxes overlap a box.
fn solids<'a>(
    spheres: &'a Spheres,
    physics: &'a PhysicsWorld,
    room: &'a Room,
    margin: f64,
    friction: f64,
) -> Vec<Solid<'a>> {
    let (low, high) = room;
    let mut solids = Vec::new();
    for (handle, collider) in spheres.around(physics, room, margin) {
        let Some((from, to)) = reach(collider, physics, low, high, margin) else {
            continue;
        };
        solids.push(Solid::new(handle, collider, physics, (from, to), friction));
    }
    solids
}

/// The bounding box of a collider, extended by `margin` metres, if it overlaps a box.
fn reach(
    collider: &Collider,
    physics: &PhysicsWorld,
    low: &Vector3<f64>,
    high: &Vector3<f64>,
    margin: f64,
) -> Option<Room> {
    let body = collider.parent().map(|b| &physics.bodies[b]);
    if !collider.is_enabled() || body.is_some_and(|b| !b.is_enabled()) {
        return None;
    }
    let aabb = collider.compute_aabb();
    let reach = Vector3::repeat(margin);
    let (from, to) = (
        from_vector(aabb.mins) - reach,
        from_vector(aabb.maxs) + reach,
    );
    (0..3)
        .all(|a| high[a] >= from[a] && low[a] <= to[a])
        .then_some((from, to))
}

impl<'a> Solid<'a> {
    /// A collider whose extended bounding box is `reach`; `friction` is that of the skin.
    fn new(
        handle: ColliderHandle,
        collider: &'a Collider,
        physics: &PhysicsWorld,
        (low, high): Room,
        friction: f64,
    ) -> Self {
        let body = collider.parent().map(|b| &physics.bodies[b]);
        let zero = Vector3::zeros();
        Self {
            handle,
            collider,
            house_from_solid: from_pose(collider.position()),
            low,
            high,
            // The larger coefficient applies, usually that of the plush.
            friction: friction.max(f64::from(collider.friction())),
            linear: body.map_or(zero, |b| from_vector(b.linvel())),
            angular: body.map_or(zero, |b| from_vector(b.angvel())),
            centre: body.map_or(zero, |b| from_vector(b.center_of_mass())),
        }
    }

    /// Signed distance of a point and the direction away from the solid; `None` beyond
    /// `margin`.
    fn gap(&self, p: &Vector3<f64>, margin: f64) -> Option<(f64, Vector3<f64>)> {
        let (distance, away) = self.distance(p);
        if distance > margin {
            return None;
        }
        let normal = away.try_normalize(1e-7)?;
        Some((distance, self.house_from_solid.rotation * normal))
    }

    /// Signed distance of a point, and a vector away from the solid in its own frame.
    fn distance(&self, p: &Vector3<f64>) -> (f64, Vector3<f64>) {
        let local = self
            .house_from_solid
            .inverse_transform_point(&Point3::from(*p));
        // Rounded like the engine's values, or a point on a face would have no normal.
        let local = to_engine(&local);
        let (core, radius): (&dyn Shape, _) = match self.collider.shape().as_typed_shape() {
            TypedShape::RoundCylinder(round) => (&round.inner_shape, round.border_radius),
            TypedShape::RoundCuboid(round) => (&round.inner_shape, round.border_radius),
            _ => (self.collider.shape(), 0.0),
        };
        let found = core.project_local_point(local, false);
        let away = from_vector(local - found.point);
        let side = if found.is_inside { -1.0 } else { 1.0 };
        (side * away.norm() - f64::from(radius), away * side)
    }
}

impl TickCandidates {
    /// The bristles after the tick.
    pub(super) fn bristles(&self, forces: &[ContactForce]) -> Bristles {
        let held = self.sites.iter().zip(forces).filter_map(|(site, contact)| {
            let local = site
                .house_from_solid
                .inverse_transform_point(&Point3::from(contact.anchor?));
            Some((site.key, local.coords.into()))
        });
        Bristles(held.collect())
    }

    /// The contacts of `own` in the tick, summed per body.
    pub(super) fn contacts(&self, own: BodyRef, forces: &[ContactForce]) -> Vec<Contact> {
        let mut sums: BTreeMap<BodyRef, (Vector3<f64>, Vector3<f64>, f64)> = BTreeMap::new();
        for (site, contact) in self.sites.iter().zip(forces) {
            let weight = contact.force.norm();
            if weight > 0.0 {
                let sum = sums.entry(site.reference).or_default();
                sum.0 += contact.force;
                sum.1 += site.point * weight;
                sum.2 += weight;
            }
        }
        let contact = |(other, (force, point, weight)): (BodyRef, _)| {
            let point: Vector3<f64> = point;
            let sign = if other < own { 1.0 } else { -1.0 };
            Contact {
                first: other.min(own),
                second: other.max(own),
                point: point / weight,
                force: force * sign,
            }
        };
        sums.into_iter().map(contact).collect()
    }

    /// Pushes the solids back, for the engine's next tick.
    pub(super) fn push(&self, physics: &mut PhysicsWorld, forces: &[ContactForce]) {
        for (site, contact) in self.sites.iter().zip(forces) {
            let Some(handle) = site.body else { continue };
            if contact.force == Vector3::zeros() {
                continue;
            }
            let body = &mut physics.bodies[handle];
            if body.is_dynamic() {
                body.add_force_at_point(vector(&-contact.force), vector(&site.point), true);
            }
        }
    }
}
