//! The gateway: the hub thread and the web site.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use anyhow::{Context, bail};
use parking_lot::Mutex;
use tokio::net::TcpListener;
use tokio::sync::Semaphore;
use tokio_rustls::TlsAcceptor;
use tokio_rustls::rustls::ServerConfig;
use tokio_rustls::rustls::crypto::ring;
use wheelarm_access::{Folder, User, Users, Watch};
use wheelarm_proto::keys;
use wheelarm_sdk::Connect;

use crate::audit::Audit;
use crate::feed::Feeds;
use crate::files::Files;
use crate::hub::{Event, Hub};
use crate::pipe::Shared;
use crate::registry::Registry;
use crate::session::{Sessions, secret};
use crate::site::{self, LogIn, Site, Token};
use crate::visitor::{Role, Visitor};

/// Options of a gateway.
#[derive(Clone, Debug)]
pub struct Options {
    /// The server.
    pub connect: Connect,
    /// Where the page is served; another port is taken when it is in use.
    pub listen: SocketAddr,
    /// Name under which the operator's commands are sent.
    pub commander: String,
    /// File of the audit log.
    pub audit: Option<PathBuf>,
    /// Folder of the page's files, for development of the page.
    pub files: Option<PathBuf>,
    /// Folder of a recorder on this host: pages show the size of the recording.
    pub recordings: Option<PathBuf>,
    /// Folder of keys and users: enables TLS and password login. Without it only this host
    /// gets access, by a token.
    pub keys: Option<PathBuf>,
    /// Host names by which browsers reach this host, beside those of the loopback interface.
    pub names: Vec<String>,
    /// Serves a page for watching only: no user may drive, whatever the role. Without keys
    /// every user of this host may watch.
    pub watch_only: bool,
}

/// A gateway at work, until it is dropped or finished.
pub struct Gateway {
    address: SocketAddr,
    /// Host and port of the URLs.
    host: String,
    is_encrypted: bool,
    tokens: Option<[String; 2]>,
    hub: Hub,
    thread: Option<std::thread::JoinHandle<()>>,
    task: tokio::task::AbortHandle,
}

impl Gateway {
    /// Opens it within a runtime.
    ///
    /// # Errors
    /// When the address cannot be bound, or is not allowed without keys.
    pub async fn open(options: &Options) -> anyhow::Result<Self> {
        if options.keys.is_none() && !options.listen.ip().is_loopback() {
            bail!(
                "{} can be reached from other machines, which needs certificates and users: make \
                 them with `wheelarm keys init` and name their folder with --keys, or listen on \
                 127.0.0.1 and come through an SSH tunnel",
                options.listen
            );
        }
        let most = match options.watch_only {
            true => Role::Viewer,
            false => Role::Admin,
        };
        let folder = options.keys.as_deref().map(Folder::open).transpose()?;
        let tls = folder.as_ref().map(acceptor).transpose()?;
        // A wrong file of users is an error before anything is opened.
        folder.as_ref().map(Folder::users).transpose()?;
        keys::check_name(&options.commander)?;
        let audit = Audit::open(options.audit.as_deref())?;
        let listener = match TcpListener::bind(options.listen).await {
            Err(error) if error.kind() == std::io::ErrorKind::AddrInUse => {
                TcpListener::bind(SocketAddr::new(options.listen.ip(), 0)).await
            }
            bound => bound,
        };
        let listener = listener.with_context(|| {
            format!(
                "listening on {}; choose another address with --page ADDRESS:PORT",
                options.listen
            )
        })?;
        let address = listener
            .local_addr()
            .context("reading the page's address")?;
        let tokens = [
            secret().context("drawing a token")?,
            secret().context("drawing a token")?,
        ];
        let visitor = |name: &str, role| Visitor {
            name: name.to_owned(),
            role,
        };
        let visitors = [
            visitor(&options.commander, Role::Operator),
            visitor("viewer", Role::Viewer),
        ];
        let (hub, thread) = Hub::start(&options.connect, audit, options.recordings.clone());
        let shared = Arc::new(Shared {
            feeds: Feeds::new(hub.client.clone()),
            hub: hub.clone(),
            sessions: Sessions::default(),
            registry: Registry::default(),
        });
        let users = folder.map(|folder| users_of(&folder, most, &shared));
        let users = users.transpose()?;
        let site = Site {
            shared,
            files: Files {
                folder: options.files.clone(),
            },
            address,
            tls,
            names: options.names.clone(),
            attempts: Mutex::default(),
            gate: Semaphore::new(1),
            began: Instant::now(),
            everybody: visitors
                .last()
                .filter(|_| options.watch_only && users.is_none())
                .cloned(),
            // With users, token links are not issued.
            tokens: match users {
                Some(_) => Vec::new(),
                None if options.watch_only => Vec::new(),
                None => tokens
                    .iter()
                    .zip(visitors.clone())
                    .map(|(secret, visitor)| Token {
                        secret: secret.clone(),
                        visitor,
                    })
                    .collect(),
            },
            users: users.map(|users| Arc::new(users) as Arc<dyn LogIn>),
        };
        let task = tokio::spawn(site::serve(listener, Arc::new(site)));
        Ok(Self {
            host: host(address, &options.names),
            address,
            is_encrypted: options.keys.is_some(),
            tokens: (options.keys.is_none() && !options.watch_only).then_some(tokens),
            hub,
            thread: Some(thread),
            task: task.abort_handle(),
        })
    }

    /// Where it listens.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// What to open in a browser to drive; where all only watch, to watch.
    #[must_use]
    pub fn drive_url(&self) -> String {
        self.url(0)
    }

    /// What to open in a browser to watch.
    #[must_use]
    pub fn watch_url(&self) -> String {
        self.url(1)
    }

    fn url(&self, which: usize) -> String {
        match &self.tokens {
            Some(tokens) => format!("http://{}/?token={}", self.host, tokens[which]),
            None if self.is_encrypted => format!("https://{}/", self.host),
            None => format!("http://{}", self.host),
        }
    }

    /// Brakes the chair, holds the arm, gives control back, and ends.
    pub fn finish(mut self) {
        self.end();
    }

    fn end(&mut self) {
        self.hub.send(Event::End);
        if let Some(thread) = self.thread.take() {
            // A panic of the thread has been printed already.
            let _ = thread.join();
        }
        self.task.abort();
    }
}

impl Drop for Gateway {
    fn drop(&mut self) {
        self.end();
    }
}

/// Host of the page's URL: the first given name where other machines connect, otherwise
/// the address; the machine's own name where the address is the wildcard.
fn host(address: SocketAddr, names: &[String]) -> String {
    let (ip, port) = (address.ip(), address.port());
    match names.first().filter(|_| !ip.is_loopback()) {
        Some(name) => format!("{name}:{port}"),
        None if ip.is_unspecified() => {
            let machine = rustix::system::uname();
            format!("{}:{port}", machine.nodename().to_string_lossy())
        }
        None => address.to_string(),
    }
}

/// Users of a folder of keys, with at most the rights of `most`.
struct FolderUsers {
    watch: Watch,
    most: Role,
}

impl LogIn for FolderUsers {
    fn verify(&self, name: &str, password: &str) -> Option<(Role, User)> {
        let users = self.watch.reread();
        let users = users
            .inspect_err(|e| tracing::error!("users cannot be read, so logins are rejected: {e}"));
        let user = users.ok()?.verify(name, password)?.clone();
        let role = match user.role {
            wheelarm_access::Role::Viewer | wheelarm_access::Role::Recorder => Role::Viewer,
            wheelarm_access::Role::Operator => Role::Operator,
            wheelarm_access::Role::Admin => Role::Admin,
        };
        Some((role.min(self.most), user))
    }

    fn users(&self) -> Arc<Users> {
        self.watch.reread().unwrap_or_else(|_| self.watch.users())
    }
}

/// The users of a folder; sessions of changed or removed users end.
fn users_of(folder: &Folder, most: Role, shared: &Arc<Shared>) -> anyhow::Result<FolderUsers> {
    let shared = Arc::clone(shared);
    let watch = Watch::start(
        folder,
        move |users| shared.sessions.keep(users),
        |why| tracing::error!("the users stay as they were: {why}"),
    )?;
    Ok(FolderUsers { watch, most })
}

/// TLS configuration from a folder of keys.
fn acceptor(folder: &Folder) -> anyhow::Result<TlsAcceptor> {
    let identity = folder.server_identity()?;
    let config = ServerConfig::builder_with_provider(Arc::new(ring::default_provider()))
        .with_safe_default_protocol_versions()
        .context("setting up TLS")?
        .with_no_client_auth()
        .with_single_cert(identity.certificates, identity.key)
        .context("taking the server's certificate")?;
    Ok(TlsAcceptor::from(Arc::new(config)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_for_other_machines_has_the_host_name_in_its_url() {
        let names = ["lab.example".to_owned()];
        let named = |ip: [u8; 4], names| host(SocketAddr::from((ip, 7460)), names);
        assert_eq!(named([0, 0, 0, 0], &names), "lab.example:7460");
        // A browser cannot open every address at once.
        let machine = rustix::system::uname();
        let machine = machine.nodename().to_string_lossy();
        assert_eq!(named([0, 0, 0, 0], &[]), format!("{machine}:7460"));
        assert_eq!(named([192, 0, 2, 1], &[]), "192.0.2.1:7460");
        assert_eq!(named([127, 0, 0, 1], &names), "127.0.0.1:7460");
    }
}
