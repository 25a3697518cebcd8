//! The report on a home ([`wheelarm_homes::home_report`]) as an image of its plan and as a page.

mod page;
mod plan;

pub use wheelarm_homes::home_report::*;

pub use page::page;
pub use plan::{PlanError, plan};
