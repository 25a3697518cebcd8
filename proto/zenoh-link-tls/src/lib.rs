//! Zenoh's links over TLS, in place of the crate of this name.
//!
//! Zenoh reads a connection in one task and writes it in another. A TLS connection is one
//! state machine that two tasks must not touch at the same time. Zenoh 1.10.2's own crate
//! allows it, so connections break and programs end (eclipse-zenoh/zenoh#2557, open). This
//! crate has a lock between them: [`LinkUnicastTls`] (docs/decisions/0001).
//!
//! `[patch.crates-io]` of the workspace names this crate. It offers the interface that Zenoh
//! needs and the features that WheelArm uses: both sides show certificates of one authority,
//! from files. Settings that it does not support are rejected by name.
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
            Some(text) => Ok(Reliability::from_str(text)? == Reliability::Reliable),
            None => Ok(true),
        }
    }
}
