//! Own homes: layouts of authored plans as world packs.
//!
//! ```text
//! homes/plans ─► rooms (sizes, doors, windows) ─► furnish (rows, walls, middle) ─► draft
//! homes/styles ─► kinds (shapes) ─► dress (small objects, images) ─► compose ─► ready ─► Pack
//! ```
//! A plan names rooms with ranges of sizes, their neighbours and their furniture with anchors. A
//! layout seed samples sizes, sides, order and small objects. A layout is kept only when the
//! report calls it ready: the chair enters every room, and the arm reaches nine of ten surfaces.
//!
//! Equal data, plan, style and seed give equal bytes on every machine: whole centimetres, one
//! random stream, arithmetic of `wheelarm_proto::exact`. All loops are bounded.

mod check;
mod compose;
mod draft;
mod dress;
mod files;
mod furnish;
mod geometry;
mod kinds;
mod placed;
mod random;
mod ready;
mod rejected;
mod rooms;
mod shape;
mod walls;

#[cfg(test)]
mod tests;

use wheelarm_pack::{Pack, PackError};

use crate::home_places::{self, HomePlaces, NoPlaces, PlaceRobot};
use crate::home_report::{Home, NoHome};

pub use compose::Order;
pub use draft::{Layout, draft};
pub use files::{Catalog, CatalogError, PlanFile, StyleFile};
pub use ready::{REACHED, Ready};
pub use rejected::Rejected;

/// A home that cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum LayoutError {
    /// A file of the assets is malformed, or a name is unknown.
    #[error(transparent)]
    Catalog(#[from] CatalogError),
    /// The layout is not kept.
    #[error("layout seed {seed} of {plan} is rejected: {reason}; choose another seed")]
    Rejected {
        /// Name of the plan.
        plan: String,
        /// Seed.
        seed: u64,
        /// Why.
        reason: Rejected,
    },
    /// The layout exceeds a limit of packs.
    #[error(transparent)]
    Pack(#[from] PackError),
    /// The home has no report.
    #[error(transparent)]
    Home(#[from] NoHome),
    /// The home gets no places.
    #[error(transparent)]
    Places(#[from] Box<NoPlaces>),
}

/// An own home that is ready.
#[derive(Debug)]
pub struct OwnHome {
    /// Its layout.
    pub layout: Layout,
    /// Its check.
    pub ready: Ready,
    /// Its pack, without places.
    pub pack: Pack,
}

/// Makes a home and checks that it is ready.
///
/// # Errors
/// [`LayoutError::Rejected`] when it is not; otherwise when the data is invalid.
pub fn make(order: &Order<'_>, robot: PlaceRobot<'_>) -> Result<OwnHome, LayoutError> {
    let (name, plan) = order.plan;
    let rejected = |reason| LayoutError::Rejected {
        plan: name.to_owned(),
        seed: order.seed,
        reason,
    };
    check::check(order.catalog, name, plan)?;
    let layout = draft(order.catalog, name, plan, order.seed).map_err(rejected)?;
    let mut tables = compose::compose(order, &layout);
    let ready = ready::check(Home::from_pack(&tables.pack()?)?, robot).map_err(rejected)?;
    ready::put_start(&mut tables.home, &ready);
    Ok(OwnHome {
        layout,
        ready,
        pack: tables.pack()?,
    })
}

/// Adds the places of tasks.
///
/// # Errors
/// As [`home_places::add`].
pub fn with_places(home: &OwnHome, robot: PlaceRobot<'_>) -> Result<HomePlaces, LayoutError> {
    Ok(home_places::add(&home.pack, robot).map_err(Box::new)?)
}
