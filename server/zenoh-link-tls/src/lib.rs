//! Zenoh's links over TLS, which take the place of the crate of this name.
//!
//! Zenoh reads a connection in one task and writes it in another. A TLS connection is
//! one state machine, so that both must not touch it at the same moment. Zenoh 1.10.2's
//! own crate lets them, and connections break and programs end by it
//! (eclipse-zenoh/zenoh#2557, open). Here a lock is between them: [`LinkUnicastTls`].
//!
//! `[patch.crates-io]` of the workspace names this crate. It offers what Zenoh asks of
//! that crate and what WheelArm uses: both sides show certificates of one authority that
//! is named, out of files. Settings that it does not offer are refused by name.
#![forbid(unsafe_code)]

use std::str::FromStr;

use async_trait::async_trait;
use zenoh_link_commons::LocatorInspector;
use zenoh_protocol::core::{Locator, Metadata, Reliability};
use zenoh_result::ZResult;

mod admission;
mod config;
mod link;
mod manager;
mod peer;
#[cfg(test)]
mod tests;

pub use admission::{Admission, admit};
pub use config::TlsConfigurator;
pub use link::LinkUnicastTls;
pub use manager::LinkManagerUnicastTls;

/// What an endpoint of this transport begins with.
pub const TLS_LOCATOR_PREFIX: &str = "tls";

/// What Zenoh asks about an address of this transport.
#[derive(Debug, Default, Clone, Copy)]
pub struct TlsLocatorInspector;

#[async_trait]
impl LocatorInspector for TlsLocatorInspector {
    fn protocol(&self) -> &str {
        TLS_LOCATOR_PREFIX
    }

    async fn is_multicast(&self, _locator: &Locator) -> ZResult<bool> {
        Ok(false)
    }

    fn is_reliable(&self, locator: &Locator) -> ZResult<bool> {
        match locator.metadata().get(Metadata::RELIABILITY) {
            Some(said) => Ok(Reliability::from_str(said)? == Reliability::Reliable),
            None => Ok(true),
        }
    }
}
