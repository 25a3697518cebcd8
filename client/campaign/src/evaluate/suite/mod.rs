//! Suites: frozen files of cells for `wheelarm evaluate --suite`, and the check of their
//! results, `wheelarm evaluate verify`.

mod figures;
mod file;
mod hardware;
mod leaderboard;
mod ledger_check;
mod page;
mod report;
mod run;
#[cfg(test)]
mod test_suite;
mod verify;

pub use report::SuiteReport;
pub use run::run;
pub use verify::{VerifyArgs, run as verify};
