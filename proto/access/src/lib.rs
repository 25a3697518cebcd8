//! Access control: users with roles and passwords, certificates of a private authority,
//! and the transport's rules for them.
//!
//! [`Users`] is the file `users.toml`; [`Folder`] the folder of keys around it;
//! [`access_control`] and [`router`] create the transport's configuration; [`Watch`]
//! follows the file, so that a change takes effect while servers run. This crate opens
//! no connection, and prints no password or private key.

#![warn(missing_docs)]

mod authority;
mod error;
mod folder;
mod password;
mod role;
mod rules;
mod transport;
mod users;
mod watch;

pub use authority::{LONGEST_DAYS, SHORTEST_DAYS};
pub use error::AccessError;
pub use folder::{About, Folder, SERVER, ServerIdentity};
pub use role::Role;
pub use rules::{Flow, Grant, Kind, grants, grants_of_servers};
pub use transport::{Subjects, access_control, guards, router, tls};
pub use users::{User, Users};
pub use watch::{Subject, Watch, follow};
