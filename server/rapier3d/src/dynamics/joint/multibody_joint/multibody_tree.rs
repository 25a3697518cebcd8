//! Articulated-body dynamics by recursion over the kinematic tree of a multibody.
//!
//! The mass matrix comes from the composite-rigid-body algorithm. Its entry of two DoFs is
//! non-zero only where one of them moves the other, and elimination from the leaves to the
//! root creates no further entries: see R. Featherstone, "Efficient Factorization of the
//! Joint-Space Inertia Matrix for Branched Kinematic Trees" (2005), and chapters 6 and 8 of
//! "Rigid Body Dynamics Algorithms". The matrix of the semi-implicit Coriolis terms is not
//! symmetric but has the same pattern.
//!
//! The entries of row `k` are stored packed, one for each ancestor of DoF `k`, root first.
//! Because the ancestors of an ancestor are a prefix of that list, each step of an
//! elimination operates on contiguous slices.

use super::multibody_link::MultibodyLinkVec;
use crate::alloc_prelude::*;
use crate::dynamics::RigidBodySet;
use crate::math::{AngVector, AngularInertia, DIM, DMatrix, Jacobian, Real, SPATIAL_DIM, Vector};
#[cfg(feature = "dim3")]
use crate::utils::AngularInertiaOps;
use crate::utils::{CrossProduct, DotProduct, inv};
use na::SMatrix;

#[cfg(feature = "dim2")]
type AngMatrix = Real;
#[cfg(feature = "dim3")]
type AngMatrix = crate::math::Matrix;

/// The square matrix of an angular inertia.
#[inline]
fn ang_matrix(inertia: AngularInertia) -> AngMatrix {
    #[cfg(feature = "dim2")]
    return inertia;
    #[cfg(feature = "dim3")]
    return inertia.into_matrix();
}

/// `b·aᵀ + a·bᵀ` subtracted from twice `a·b` times the identity: the change of a rotational
/// inertia by a shift of its reference point.
#[inline]
fn shifted_inertia(a: Vector, b: Vector) -> AngMatrix {
    let twice = 2.0 * a.dot(b);
    #[cfg(feature = "dim2")]
    return twice;
    #[cfg(feature = "dim3")]
    {
        let (xy, xz, yz) = (
            -(a.x * b.y + b.x * a.y),
            -(a.x * b.z + b.x * a.z),
            -(a.y * b.z + b.y * a.z),
        );
        let diagonal = Vector::new(
            twice - 2.0 * a.x * b.x,
            twice - 2.0 * a.y * b.y,
            twice - 2.0 * a.z * b.z,
        );
        AngMatrix::from_cols(
            Vector::new(diagonal.x, xy, xz),
            Vector::new(xy, diagonal.y, yz),
            Vector::new(xz, yz, diagonal.z),
        )
    }
}

/// `-[a]×·[b]×`, which is `a·b` times the identity minus `b·aᵀ`.
#[inline]
fn minus_double_cross(a: Vector, b: Vector) -> AngMatrix {
    #[cfg(feature = "dim2")]
    return a.dot(b);
    #[cfg(feature = "dim3")]
    return AngMatrix::from_diagonal(Vector::splat(a.dot(b)))
        - AngMatrix::from_cols(b * a.x, b * a.y, b * a.z);
}

/// Derivative of the gyroscopic torque of a body together with the change of the axes that
/// move it: `[ω]×·I − I·[ω]× − [I·ω]×`.
#[inline]
fn gyroscopic_derivative(angvel: AngVector, inertia: AngMatrix) -> AngMatrix {
    #[cfg(feature = "dim2")]
    {
        let _ = (angvel, inertia);
        0.0
    }
    #[cfg(feature = "dim3")]
    {
        let momentum = inertia * angvel;
        let column = |axis: Vector| {
            angvel.cross(inertia * axis) - inertia * angvel.cross(axis) - momentum.cross(axis)
        };
        AngMatrix::from_cols(column(Vector::X), column(Vector::Y), column(Vector::Z))
    }
}

#[inline]
fn ang_cross(a: AngVector, b: AngVector) -> AngVector {
    #[cfg(feature = "dim2")]
    {
        let _ = (a, b);
        0.0
    }
    #[cfg(feature = "dim3")]
    return a.cross(b);
}

/// `mᵀ·v`.
#[inline]
fn tr_mul(m: AngMatrix, v: AngVector) -> AngVector {
    #[cfg(feature = "dim2")]
    return m * v;
    #[cfg(feature = "dim3")]
    return Vector::new(m.x_axis.dot(v), m.y_axis.dot(v), m.z_axis.dot(v));
}

/// A spatial vector: a velocity or a direction of motion, or a force and a torque.
#[derive(Copy, Clone, Debug, Default)]
pub(crate) struct Spatial {
    pub lin: Vector,
    pub ang: AngVector,
}

impl Spatial {
    pub fn new(lin: Vector, ang: AngVector) -> Self {
        Self { lin, ang }
    }

    #[inline]
    pub fn dot(&self, rhs: &Spatial) -> Real {
        self.lin.dot(rhs.lin) + self.ang.gdot(rhs.ang)
    }

    /// This force and torque at `at`, expressed at the origin.
    #[inline]
    fn force_at_origin(&self, at: Vector) -> Spatial {
        Spatial::new(self.lin, self.ang + at.gcross(self.lin))
    }

    /// This motion at `at`, expressed at the origin.
    #[inline]
    fn motion_at_origin(&self, at: Vector) -> Spatial {
        Spatial::new(self.lin - self.ang.gcross(at), self.ang)
    }

    /// This motion at the origin, expressed at `at`.
    #[inline]
    fn motion_at(&self, at: Vector) -> Spatial {
        Spatial::new(self.lin + self.ang.gcross(at), self.ang)
    }
}

/// Properties of all bodies that a link carries, with the link itself.
#[derive(Copy, Clone, Debug, Default)]
struct Composite {
    mass: Real,
    /// First moment of mass about the centre of mass of the link.
    moment: Vector,
    /// Rotational inertia about the centre of mass of the link.
    inertia: AngMatrix,
    /// Linear momentum.
    momentum: Vector,
    /// Angular part of the derivative of the Coriolis forces.
    coriolis: AngMatrix,
}

impl Composite {
    /// Adds a child of which the centre of mass is at `shift`.
    #[inline]
    fn add(&mut self, child: &Composite, shift: Vector) {
        self.mass += child.mass;
        self.moment += child.moment + shift * child.mass;
        self.inertia +=
            child.inertia + shifted_inertia(child.moment + shift * (0.5 * child.mass), shift);
        self.momentum += child.momentum;
        self.coriolis += child.coriolis + minus_double_cross(shift, child.momentum) * 2.0;
    }

    /// Force of an acceleration.
    #[inline]
    fn mul(&self, motion: &Spatial) -> Spatial {
        Spatial::new(
            motion.lin * self.mass + motion.ang.gcross(self.moment),
            self.inertia * motion.ang + self.moment.gcross(motion.lin),
        )
    }

    /// Force of an acceleration `rate` plus the derivative of the Coriolis forces by a motion
    /// `along`.
    #[inline]
    fn mul_coriolis(&self, rate: &Spatial, along: &Spatial) -> Spatial {
        let inertial = self.mul(rate);
        Spatial::new(
            inertial.lin + along.ang.gcross(self.momentum) * 2.0,
            inertial.ang + self.coriolis * along.ang,
        )
    }

    /// Product of the transpose of the derivative of the Coriolis forces with a motion; its
    /// linear part is zero.
    #[inline]
    fn tr_mul_coriolis(&self, along: &Spatial) -> AngVector {
        self.momentum.gcross(along.lin) * 2.0 + tr_mul(self.coriolis, along.ang)
    }
}

/// Place of a link in the tree; its comparison detects a change of the topology.
#[derive(Copy, Clone, Debug, PartialEq)]
struct LinkPlace {
    parent: usize,
    assembly_id: usize,
    ndofs: usize,
    kinematic: bool,
}

/// Which DoFs move which links, and where the entries of the matrices are stored.
#[derive(Clone, Debug, Default)]
pub(crate) struct TreePattern {
    places: Vec<LinkPlace>,
    ndofs: usize,
    /// Row `k` is `row_starts[k]..row_starts[k + 1]`.
    row_starts: Vec<u32>,
    /// Dynamic ancestors of each DoF, root first.
    ancestors: Vec<u32>,
    /// Link that each DoF belongs to.
    owners: Vec<u32>,
    /// Whether the DoF is part of the mass matrix: not kinematic.
    dynamic: Vec<bool>,
    /// The branch of link `i` is `branch_starts[i]..branch_starts[i + 1]`.
    branch_starts: Vec<u32>,
    /// DoFs that move each link, root first.
    branches: Vec<u32>,
}

impl TreePattern {
    fn place(links: &MultibodyLinkVec, i: usize) -> LinkPlace {
        let link = &links[i];
        LinkPlace {
            parent: link.parent_internal_id,
            assembly_id: link.assembly_id,
            ndofs: link.joint.ndofs(),
            kinematic: link.joint.kinematic,
        }
    }

    /// Whether this is the pattern of these links.
    pub fn fits(&self, links: &MultibodyLinkVec) -> bool {
        self.places.len() == links.len()
            && (0..links.len()).all(|i| self.places[i] == Self::place(links, i))
    }

    pub fn new(links: &MultibodyLinkVec) -> Self {
        let mut pattern = Self::default();
        let mut chains: Vec<Vec<u32>> = Vec::with_capacity(links.len());
        pattern.row_starts.push(0);
        pattern.branch_starts.push(0);

        for i in 0..links.len() {
            let place = Self::place(links, i);
            // The elimination order relies on this.
            assert!(
                place.assembly_id == pattern.ndofs && (i == 0 || place.parent < i),
                "Internal error: contiguity assumption on assembly_id does not hold."
            );
            let mut chain = match i {
                0 => Vec::new(),
                _ => chains[place.parent].clone(),
            };

            for dof in place.assembly_id..place.assembly_id + place.ndofs {
                if !place.kinematic {
                    let dynamic = chain.iter().filter(|k| pattern.dynamic[**k as usize]);
                    pattern.ancestors.extend(dynamic);
                }
                pattern.row_starts.push(pattern.ancestors.len() as u32);
                pattern.owners.push(i as u32);
                pattern.dynamic.push(!place.kinematic);
                chain.push(dof as u32);
            }

            pattern.ndofs += place.ndofs;
            pattern.branches.extend_from_slice(&chain);
            pattern.branch_starts.push(pattern.branches.len() as u32);
            pattern.places.push(place);
            chains.push(chain);
        }

        pattern
    }

    #[inline]
    fn row(&self, k: usize) -> core::ops::Range<usize> {
        self.row_starts[k] as usize..self.row_starts[k + 1] as usize
    }

    /// DoFs that move a link, root first.
    #[inline]
    pub fn branch(&self, link: usize) -> &[u32] {
        &self.branches[self.branch_starts[link] as usize..self.branch_starts[link + 1] as usize]
    }

    /// Factorizes a symmetric matrix `A = Lᵀ·D·L` in place, from the leaves to the root:
    /// `rows` becomes `L` and `diagonal` the inverse of `D`.
    /// A DoF without inertia gets the inverse 0, so that it does not move.
    fn factor_symmetric(&self, diagonal: &mut [Real], rows: &mut [Real]) {
        for k in (0..self.ndofs).rev() {
            if !self.dynamic[k] {
                diagonal[k] = 0.0;
                continue;
            }
            let inverse = inv(diagonal[k]);
            diagonal[k] = inverse;
            let range = self.row(k);
            let ancestors = &self.ancestors[range.clone()];
            let (above, row) = rows.split_at_mut(range.start);
            let row = &mut row[..ancestors.len()];
            for (p, a) in ancestors.iter().enumerate() {
                let a = *a as usize;
                let scaled = row[p] * inverse;
                diagonal[a] -= scaled * row[p];
                sub_scaled(&mut above[self.row(a)], scaled, &row[..p]);
            }
            for entry in row {
                *entry *= inverse;
            }
        }
    }

    /// Factorizes `A = U·D·L` in place like [`Self::factor_symmetric`]; `upper` has the entries
    /// above the diagonal, column by column.
    fn factor(&self, diagonal: &mut [Real], lower: &mut [Real], upper: &mut [Real]) {
        for k in (0..self.ndofs).rev() {
            if !self.dynamic[k] {
                diagonal[k] = 0.0;
                continue;
            }
            let inverse = inv(diagonal[k]);
            diagonal[k] = inverse;
            let range = self.row(k);
            let ancestors = &self.ancestors[range.clone()];
            let (above_lower, low) = lower.split_at_mut(range.start);
            let (above_upper, up) = upper.split_at_mut(range.start);
            let (low, up) = (&mut low[..ancestors.len()], &mut up[..ancestors.len()]);
            for (p, a) in ancestors.iter().enumerate() {
                let a = *a as usize;
                let scaled = up[p] * inverse;
                diagonal[a] -= scaled * low[p];
                let row = self.row(a);
                sub_scaled(&mut above_lower[row.clone()], scaled, &low[..p]);
                sub_scaled(&mut above_upper[row], low[p] * inverse, &up[..p]);
            }
            for entry in low.iter_mut().chain(up) {
                *entry *= inverse;
            }
        }
    }

    /// Solves `U·D·L·x = b` in place.
    fn solve(&self, inv_diagonal: &[Real], lower: &[Real], upper: &[Real], b: &mut [Real]) {
        let b = &mut b[..self.ndofs];
        for k in (0..self.ndofs).rev() {
            // A unit vector has non-zero entries on one branch only.
            let value = b[k];
            if value != 0.0 {
                let row = self.row(k);
                for (a, entry) in self.ancestors[row.clone()].iter().zip(&upper[row]) {
                    b[*a as usize] -= *entry * value;
                }
            }
        }
        for k in 0..self.ndofs {
            let row = self.row(k);
            let mut value = b[k] * inv_diagonal[k];
            for (a, entry) in self.ancestors[row.clone()].iter().zip(&lower[row]) {
                value -= *entry * b[*a as usize];
            }
            b[k] = value;
        }
    }

    /// Number of entries from one row of a dense matrix to the next.
    fn stride(&self) -> usize {
        self.ndofs.div_ceil(CHUNK) * CHUNK
    }

    /// Computes the dense inverse of a matrix from its factors, row by row from the root: row
    /// `k` of `L·A⁻¹ = D⁻¹·L⁻ᵀ` is 0 before its diagonal entry.
    fn invert(&self, inv_diagonal: &[Real], lower: &[Real], inverse: &mut [Real]) {
        let stride = self.stride();
        for k in 0..self.ndofs {
            let (above, rest) = inverse.split_at_mut(k * stride);
            let own = &mut rest[..stride];
            own.fill(0.0);
            let row = self.row(k);
            // The rows above are 0 after their diagonal up to where this loop has filled them.
            let width = (k + 1).div_ceil(CHUNK) * CHUNK;
            for (a, entry) in self.ancestors[row.clone()].iter().zip(&lower[row.clone()]) {
                let start = *a as usize * stride;
                sub_scaled(&mut own[..width], *entry, &above[start..start + width]);
            }
            let mut diagonal = inv_diagonal[k];
            for (a, entry) in self.ancestors[row.clone()].iter().zip(&lower[row]) {
                diagonal -= *entry * own[*a as usize];
            }
            own[k] = diagonal;
            for a in 0..k {
                above[a * stride + k] = own[a];
            }
        }
    }

    /// Product of a symmetric matrix with a vector.
    fn mul(&self, mass: &TreeMatrix, x: &[Real], out: &mut [Real]) {
        for k in 0..self.ndofs {
            let row = self.row(k);
            let mut value = mass.diagonal[k] * x[k];
            for (a, entry) in self.ancestors[row.clone()].iter().zip(&mass.rows[row]) {
                value += *entry * x[*a as usize];
                out[*a as usize] += *entry * x[k];
            }
            out[k] = value;
        }
    }

    /// The symmetric matrix with these entries; `None` if their number is another.
    pub fn to_dense(&self, mass: &TreeMatrix) -> Option<DMatrix> {
        if mass.diagonal.len() != self.ndofs || mass.rows.len() != self.ancestors.len() {
            return None;
        }
        let mut dense = DMatrix::zeros(self.ndofs, self.ndofs);
        for k in 0..self.ndofs {
            dense[(k, k)] = mass.diagonal[k];
            for e in self.row(k) {
                let a = self.ancestors[e] as usize;
                dense[(k, a)] = mass.rows[e];
                dense[(a, k)] = mass.rows[e];
            }
        }
        Some(dense)
    }
}

/// Entries of a symmetric matrix with the pattern of a tree.
#[cfg_attr(feature = "serde-serialize", derive(Serialize, Deserialize))]
#[derive(Clone, Debug, Default)]
pub(crate) struct TreeMatrix {
    diagonal: Vec<Real>,
    rows: Vec<Real>,
}

/// Subtracts `scale` times `x` from `y`.
#[inline]
fn sub_scaled(y: &mut [Real], scale: Real, x: &[Real]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y -= scale * *x;
    }
}

/// Entries that are computed side by side; the rows of a dense matrix have a multiple of it.
const CHUNK: usize = 8;

/// A DoF: the motion of its link per unit of its velocity.
#[derive(Copy, Clone, Debug, Default)]
struct Axis {
    /// At the centre of mass of the link.
    local: Spatial,
    /// At the origin, which is the centre of mass of the root.
    origin: Spatial,
    /// The part of its rate of change, at the origin, that all links of its subtree share.
    rate: Spatial,
}

/// Mass properties and forces of a link.
#[derive(Copy, Clone, Debug, Default)]
struct LinkDynamics {
    /// Centre of mass, from the origin.
    com: Vector,
    /// Centre of mass, from the one of the parent.
    shift: Vector,
    mass: Real,
    inertia: AngMatrix,
    composite: Composite,
    /// All forces on the link, the inertial ones with them, at its centre of mass.
    force: Spatial,
    /// Applied forces alone.
    applied: Spatial,
}

/// The dynamics of a multibody: everything that depends on the pattern of its tree.
///
/// It is computed from the links in each step, so it is not part of a serialized multibody.
#[derive(Clone, Debug, Default)]
pub(crate) struct MultibodyTree {
    pattern: TreePattern,
    axes: Vec<Axis>,
    links: Vec<LinkDynamics>,
    /// `L` of the mass matrix `M = Lᵀ·D·L` and the inverse of `D`, 0 for a kinematic DoF.
    lower: Vec<Real>,
    inv_diagonal: Vec<Real>,
    /// Dense inverse of the mass matrix, row by row.
    inverse: Vec<Real>,
    /// The same factors for the mass matrix with the Coriolis terms, which is `U·D·L`.
    acc_lower: Vec<Real>,
    acc_upper: Vec<Real>,
    acc_inv_diagonal: Vec<Real>,
    /// Armature and the implicit terms of damping and springs, of each DoF.
    pub diagonal: Vec<Real>,
    /// Generalized forces, and the part of them that does not depend on velocities.
    pub forces: Vec<Real>,
    pub pos_forces: Vec<Real>,
    /// Workspaces of [`TreePattern::mul`].
    products: [Vec<Real>; 2],
}

impl MultibodyTree {
    /// Computes the directions in which the DoFs move the links, from the poses of the links.
    pub fn update_axes(&mut self, links: &MultibodyLinkVec) {
        if !self.pattern.fits(links) {
            self.pattern = TreePattern::new(links);
            let (ndofs, entries) = (self.pattern.ndofs, self.pattern.ancestors.len());
            self.axes = vec![Axis::default(); ndofs];
            self.links = vec![LinkDynamics::default(); links.len()];
            self.lower = vec![0.0; entries];
            self.acc_lower = vec![0.0; entries];
            self.acc_upper = vec![0.0; entries];
            self.inv_diagonal = vec![0.0; ndofs];
            self.inverse = vec![0.0; ndofs * self.pattern.stride()];
            self.acc_inv_diagonal = vec![0.0; ndofs];
            self.diagonal = vec![0.0; ndofs];
            self.forces = vec![0.0; ndofs];
            self.pos_forces = vec![0.0; ndofs];
            self.products = [vec![0.0; ndofs], vec![0.0; ndofs]];
        }

        for i in 0..links.len() {
            let link = &links[i];
            let mut rotation = link.joint.data.local_frame1.rotation;
            if i != 0 {
                let parent = link.parent_internal_id;
                rotation = links[parent].local_to_world.rotation * rotation;
                self.links[i].shift = link.shift02 + link.shift23;
                self.links[i].com = self.links[parent].com + self.links[i].shift;
            }
            let com = self.links[i].com;

            let ndofs = link.joint.ndofs();
            if ndofs == 0 {
                continue;
            }
            let mut jacobian = SMatrix::<Real, SPATIAL_DIM, SPATIAL_DIM>::zeros();
            link.joint
                .jacobian(&rotation, &mut jacobian.columns_mut(0, ndofs));
            for dof in 0..ndofs {
                let column = jacobian.column(dof);
                let mut local = spatial(column.as_slice());
                local.lin += local.ang.gcross(link.shift23);
                let axis = &mut self.axes[link.assembly_id + dof];
                axis.local = local;
                axis.origin = local.motion_at_origin(com);
            }
        }
    }

    /// The Jacobian of the centre of mass of a link.
    pub fn fill_body_jacobian(&self, link: usize, out: &mut Jacobian<Real>) {
        out.fill(0.0);
        let com = self.links[link].com;
        for k in self.pattern.branch(link) {
            let k = *k as usize;
            let motion = self.axes[k].origin.motion_at(com);
            let column = &mut out.as_mut_slice()[k * SPATIAL_DIM..(k + 1) * SPATIAL_DIM];
            column[..DIM].copy_from_slice(motion.lin.as_ref());
            #[cfg(feature = "dim2")]
            {
                column[DIM] = motion.ang;
            }
            #[cfg(feature = "dim3")]
            column[DIM..].copy_from_slice(motion.ang.as_ref());
        }
    }

    /// DoFs that move a link, root first.
    pub fn branch(&self, link: usize) -> &[u32] {
        self.pattern.branch(link)
    }

    /// Adds to `out` the generalized force of a force and torque at the centre of mass of a
    /// link, times `scale`.
    pub fn add_generalized_force(
        &self,
        link: usize,
        force: &Spatial,
        scale: Real,
        out: &mut [Real],
    ) {
        let force = force.force_at_origin(self.links[link].com);
        let force = Spatial::new(force.lin * scale, force.ang * scale);
        for k in self.pattern.branch(link) {
            out[*k as usize] += self.axes[*k as usize].origin.dot(&force);
        }
    }

    /// Sum of the squares of the entries of the Jacobian of the centre of mass of a link.
    pub fn jacobian_norm_squared(&self, link: usize) -> Real {
        let com = self.links[link].com;
        let motions = self.pattern.branch(link).iter();
        let motions = motions.map(|k| self.axes[*k as usize].origin.motion_at(com));
        motions.map(|motion| motion.dot(&motion)).sum()
    }

    /// Assembles and factorizes the mass matrix, and the one with the Coriolis terms of a step
    /// of `dt`. The entries of `mass` are those of the first.
    ///
    /// [`Self::diagonal`] has what each DoF adds to its entry of the diagonal.
    pub fn update_mass(
        &mut self,
        dt: Real,
        links: &MultibodyLinkVec,
        bodies: &RigidBodySet,
        mass: &mut TreeMatrix,
    ) {
        let Self {
            pattern,
            axes,
            links: dynamics,
            lower,
            inv_diagonal,
            inverse,
            acc_lower,
            acc_upper,
            acc_inv_diagonal,
            diagonal,
            ..
        } = self;
        mass.diagonal.resize(pattern.ndofs, 0.0);
        mass.rows.resize(pattern.ancestors.len(), 0.0);

        for i in 0..links.len() {
            let rb = &bodies[links[i].rigid_body];
            let link = &mut dynamics[i];
            link.mass = rb.mprops.effective_mass().x;
            link.inertia = ang_matrix(rb.mprops.effective_angular_inertia());
            link.composite = Composite {
                mass: link.mass,
                moment: Default::default(),
                inertia: link.inertia,
                momentum: rb.vels.linvel * link.mass,
                coriolis: gyroscopic_derivative(rb.vels.angvel, link.inertia),
            };
        }
        for i in (1..links.len()).rev() {
            let (composite, shift) = (dynamics[i].composite, dynamics[i].shift);
            dynamics[links[i].parent_internal_id]
                .composite
                .add(&composite, shift);
        }

        for k in 0..pattern.ndofs {
            let owner = pattern.owners[k] as usize;
            let link = &dynamics[owner];
            let axis = axes[k].local;
            let rate = axis_rate(axis, owner, links, bodies);
            axes[k].rate = rate.motion_at_origin(link.com);
            if !pattern.dynamic[k] {
                mass.diagonal[k] = 0.0;
                continue;
            }

            let force = link.composite.mul(&axis);
            let acc_force = link.composite.mul_coriolis(&rate, &axis);
            let acc_torque = link.composite.tr_mul_coriolis(&axis) * dt;
            mass.diagonal[k] = axis.dot(&force) + diagonal[k];
            acc_inv_diagonal[k] = mass.diagonal[k] + axis.dot(&acc_force) * dt;

            let force = force.force_at_origin(link.com);
            let force_dt = Spatial::new(force.lin * dt, force.ang * dt);
            let acc_force = acc_force.force_at_origin(link.com);
            let acc_force = Spatial::new(acc_force.lin * dt, acc_force.ang * dt);
            let row = pattern.row(k);
            let entries = mass.rows[row.clone()]
                .iter_mut()
                .zip(&mut acc_lower[row.clone()])
                .zip(&mut acc_upper[row.clone()]);
            for (((entry, low), up), a) in entries.zip(&pattern.ancestors[row]) {
                let ancestor = &axes[*a as usize];
                *entry = ancestor.origin.dot(&force);
                *up = *entry + ancestor.origin.dot(&acc_force);
                *low = *entry + ancestor.rate.dot(&force_dt) + ancestor.origin.ang.gdot(acc_torque);
            }
        }

        lower.copy_from_slice(&mass.rows);
        inv_diagonal.copy_from_slice(&mass.diagonal);
        pattern.factor_symmetric(inv_diagonal, lower);
        pattern.invert(inv_diagonal, lower, inverse);
        pattern.factor(acc_inv_diagonal, acc_lower, acc_upper);
    }

    /// Sets the forces on a link, at its centre of mass: those applied to it, and `inertial`,
    /// the ones of its acceleration at constant generalized velocities.
    pub fn set_forces(&mut self, link: usize, applied: Spatial, inertial: Spatial) {
        let link = &mut self.links[link];
        link.applied = applied;
        link.force = Spatial::new(applied.lin + inertial.lin, applied.ang + inertial.ang);
    }

    /// Computes the generalized forces of all links into `forces`, and with `separate` those of
    /// the applied forces alone into `pos_forces`.
    pub fn update_generalized_forces(&mut self, links: &MultibodyLinkVec, separate: bool) {
        for i in (1..links.len()).rev() {
            let LinkDynamics {
                shift,
                force,
                applied,
                ..
            } = self.links[i];
            let parent = &mut self.links[links[i].parent_internal_id];
            let force = force.force_at_origin(shift);
            parent.force.lin += force.lin;
            parent.force.ang += force.ang;
            if separate {
                let applied = applied.force_at_origin(shift);
                parent.applied.lin += applied.lin;
                parent.applied.ang += applied.ang;
            }
        }
        for k in 0..self.pattern.ndofs {
            let link = &self.links[self.pattern.owners[k] as usize];
            let axis = &self.axes[k].local;
            self.forces[k] = axis.dot(&link.force);
            if separate {
                self.pos_forces[k] = axis.dot(&link.applied);
            }
        }
    }

    /// Solves `M·x = b` in place; `x` is 0 for a kinematic DoF.
    pub fn solve(&self, b: &mut [Real]) {
        let lower = &self.lower;
        self.pattern.solve(&self.inv_diagonal, lower, lower, b);
    }

    /// Column `k` of `M⁻¹`.
    pub fn inverse_column(&self, k: usize) -> &[Real] {
        let start = k * self.pattern.stride();
        &self.inverse[start..start + self.pattern.ndofs]
    }

    /// Computes `M⁻¹·b` for a vector of which only the entries of `dofs` differ from 0.
    pub fn mul_inverse(
        &self,
        dofs: impl Iterator<Item = usize> + Clone,
        b: &[Real],
        out: &mut [Real],
    ) {
        let stride = self.pattern.stride();
        for (block, out) in out[..self.pattern.ndofs].chunks_mut(CHUNK).enumerate() {
            let mut sums = [0.0; CHUNK];
            for k in dofs.clone() {
                let start = k * stride + block * CHUNK;
                let column = self.inverse[start..].first_chunk::<CHUNK>();
                let column = column.expect("rows of whole chunks");
                for i in 0..CHUNK {
                    sums[i] += column[i] * b[k];
                }
            }
            out.copy_from_slice(&sums[..out.len()]);
        }
    }

    /// Solves the system with the Coriolis terms in place.
    pub fn solve_acc(&self, b: &mut [Real]) {
        self.pattern
            .solve(&self.acc_inv_diagonal, &self.acc_lower, &self.acc_upper, b);
    }

    /// Whether a step with these accelerations adds more kinetic energy than the generalized
    /// forces do work; `None` if an acceleration is not finite.
    pub fn adds_energy(
        &mut self,
        dt: Real,
        mass: &TreeMatrix,
        velocities: &[Real],
        accelerations: &[Real],
    ) -> Option<bool> {
        if !accelerations.iter().all(|x| x.is_finite()) {
            return None;
        }
        let [m_v, m_a] = &mut self.products;
        self.pattern.mul(mass, velocities, m_v);
        self.pattern.mul(mass, accelerations, m_a);
        let (mut energy_delta, mut work, mut kinetic_energy) = (0.0, 0.0, 0.0);
        for k in (0..self.pattern.ndofs).filter(|k| self.pattern.dynamic[*k]) {
            let (v, a) = (velocities[k], accelerations[k]);
            energy_delta += dt * v * m_a[k] + 0.5 * dt * dt * a * m_a[k];
            work += dt * v * self.forces[k] + 0.5 * dt * dt * a * self.pos_forces[k];
            kinetic_energy += 0.5 * v * m_v[k];
        }
        // Margin: a small fraction of the current kinetic energy to absorb
        // discretization error on healthy steps.
        let energy_margin = 1.0e-2 * kinetic_energy + 1.0e-8;
        Some(energy_delta - work - energy_margin > 0.0)
    }

    /// The pattern, if it is the one of these links.
    pub fn pattern(&self, links: &MultibodyLinkVec) -> Option<&TreePattern> {
        self.pattern.fits(links).then_some(&self.pattern)
    }
}

/// The rate of change of the axis of a DoF of link `owner`, at the centre of mass of the link,
/// so that for each link with velocity `v` that the DoF moves, `rate − v × axis` is the
/// derivative of the acceleration of that link at constant generalized velocities.
fn axis_rate(
    axis: Spatial,
    owner: usize,
    links: &MultibodyLinkVec,
    bodies: &RigidBodySet,
) -> Spatial {
    let link = &links[owner];
    let vels = &bodies[link.rigid_body].vels;
    let parent_angvel = match owner {
        0 => Default::default(),
        _ => {
            bodies[links[link.parent_internal_id].rigid_body]
                .vels
                .angvel
        }
    };
    let joint_lin = axis.lin - axis.ang.gcross(link.shift23);
    let turning = ang_cross(parent_angvel, axis.ang);
    let lin = parent_angvel.gcross(joint_lin) * 2.0
        + turning.gcross(link.shift23)
        + axis.ang.gcross(vels.angvel.gcross(link.shift23))
        + vels.angvel.gcross(axis.ang.gcross(link.shift23))
        - axis.ang.gcross(vels.linvel) * 2.0;
    Spatial::new(lin, turning + ang_cross(vels.angvel, axis.ang))
}

/// The spatial vector with these components, linear ones first.
#[inline]
fn spatial(components: &[Real]) -> Spatial {
    #[cfg(feature = "dim2")]
    return Spatial::new(Vector::new(components[0], components[1]), components[2]);
    #[cfg(feature = "dim3")]
    return Spatial::new(
        Vector::new(components[0], components[1], components[2]),
        Vector::new(components[3], components[4], components[5]),
    );
}
