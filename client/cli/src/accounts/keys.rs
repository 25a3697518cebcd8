//! `wheelarm keys`: the authority, users' certificates, a router's configuration.

use std::collections::BTreeSet;
use std::path::PathBuf;

use anyhow::Context;
use clap::Subcommand;
use wheelarm_access::{Folder, Subjects, router};

use super::folder;
use wheelarm_options::choice;

/// Names of a server on its own host.
const HERE: [&str; 3] = ["localhost", "127.0.0.1", "::1"];

/// Subcommands of `wheelarm keys`.
#[derive(Subcommand, Clone, Debug)]
pub enum KeysCommand {
    /// Makes a new folder of keys: authority and server's certificate, without users.
    Init {
        /// Name or address of this host, as clients write it after tls/. May be repeated;
        /// the system's host name is included.
        #[arg(long, value_name = "NAME")]
        host: Vec<String>,
    },
    /// Makes the keys of a user.
    User {
        /// User name, added with `wheelarm users add`.
        #[arg(value_parser = choice::name)]
        name: String,
        /// Days of validity, 30 to 365.
        #[arg(long, default_value_t = 90)]
        days: u32,
    },
    /// Writes the configuration of `wheelarm router`, for a Zenoh router of your own
    /// (`zenohd -c FILE`).
    Router {
        /// Endpoint to listen on. May be repeated.
        #[arg(long, default_value = "tls/0.0.0.0:7447", value_parser = choice::endpoint)]
        listen: Vec<String>,
        /// File to write; standard output without it.
        #[arg(long, value_name = "FILE")]
        out: Option<PathBuf>,
    },
}

/// Runs `wheelarm keys`.
///
/// # Errors
/// When the folder or the user is invalid, or a file cannot be written.
pub fn keys(named: Option<&PathBuf>, command: &KeysCommand) -> anyhow::Result<()> {
    let path = folder(named)?;
    match command {
        KeysCommand::Init { host } => {
            let own = rustix::system::uname();
            let own = own.nodename().to_string_lossy().into_owned();
            let hosts: BTreeSet<String> = HERE
                .iter()
                .map(|host| (*host).to_owned())
                .chain([own].into_iter().filter(|name| !name.is_empty()))
                .chain(host.iter().cloned())
                .collect();
            let hosts: Vec<String> = hosts.into_iter().collect();
            let folder = Folder::init(path, &hosts)?;
            let shown = folder.path().display();
            println!(
                "made {shown}: a server with these keys is reached as {}",
                hosts.join(", ")
            );
            println!("next: wheelarm users add NAME --role operator --keys {shown}");
            println!("then: wheelarm-server --keys {shown}");
        }
        KeysCommand::User { name, days } => {
            let folder = Folder::open(path)?;
            let bundle = folder.issue(name, *days)?;
            println!("made {} for {days} days", bundle.display());
            println!(
                "copy that folder to {name} over an encrypted connection (scp -r); there: \
                 wheelarm --connect tls/HOST:7447 --keys {name} teleop"
            );
        }
        KeysCommand::Router { listen, out } => {
            let text = router(&Folder::open(path)?, listen, Subjects::Names)?;
            match out {
                None => println!("{text}"),
                Some(file) => {
                    std::fs::write(file, text)
                        .with_context(|| format!("writing {}", file.display()))?;
                    println!(
                        "made {}; restart a running router to apply it",
                        file.display()
                    );
                }
            }
        }
    }
    Ok(())
}
