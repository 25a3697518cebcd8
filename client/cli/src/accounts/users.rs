//! `wheelarm users`: adds, removes and lists users.

use std::path::PathBuf;

use clap::Subcommand;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use serde::Serialize;
use wheelarm_access::{About, Folder, Role, User};

use super::folder;
use super::secret::new_password;
use wheelarm_options::choice;

/// Subcommands of `wheelarm users`.
#[derive(Subcommand, Clone, Debug)]
pub enum UsersCommand {
    /// Adds a user.
    Add {
        /// Name: 1 to 64 letters, digits, `-` or `_`; part of the key expressions of the
        /// user's messages.
        #[arg(value_parser = choice::name)]
        name: String,
        /// Role: a viewer watches, an operator also drives, a recorder watches and records,
        /// an admin has every right.
        #[arg(long, value_parser = roles())]
        role: Role,
        /// An operator that also receives full images, as a policy does.
        #[arg(long, alias = "pictures")]
        images: bool,
        /// Also sets a password for the web page: typed, or a line of standard input.
        #[arg(long)]
        password: bool,
    },
    /// Removes a user and its keys from the folder. Within a second its connections and
    /// sessions end on running servers, routers and pages, and a chair that it drives
    /// brakes.
    Remove {
        /// User name.
        #[arg(value_parser = choice::name)]
        name: String,
    },
    /// Gives a user another role. Within a second its connections and sessions end; it
    /// connects again with the new role.
    Role {
        /// User name.
        #[arg(value_parser = choice::name)]
        name: String,
        /// The new role, as for `add`.
        #[arg(long, value_parser = roles())]
        role: Role,
        /// An operator that also receives full images, as a policy does.
        #[arg(long, alias = "pictures")]
        images: bool,
    },
    /// Lists the users.
    List {
        /// Prints one JSON list instead of lines.
        #[arg(long)]
        json: bool,
    },
    /// Sets a user's password: typed, or a line of standard input.
    Password {
        /// User name.
        #[arg(value_parser = choice::name)]
        name: String,
        /// Removes the password instead.
        #[arg(long)]
        none: bool,
    },
}

/// Effect of a change of a user on running servers.
const EFFECT: &str = "its connections and sessions end within a second";

fn check_images(role: Role, images: bool) -> anyhow::Result<()> {
    if images && role != Role::Operator {
        anyhow::bail!(
            "--images applies to operators only: the images of a {role} follow from its role"
        );
    }
    Ok(())
}

fn roles() -> impl TypedValueParser<Value = Role> {
    PossibleValuesParser::new(Role::ALL.map(Role::name))
        .try_map(|name| Role::from_name(&name).ok_or("unknown role"))
}

/// One user of the list.
#[derive(Serialize)]
struct Listed<'a> {
    name: &'a str,
    role: Role,
    #[serde(rename = "pictures")]
    images: bool,
    password: bool,
    /// Last day of validity of the newest keys.
    until: Option<String>,
}

/// Runs `wheelarm users`.
///
/// # Errors
/// When the folder or the user is invalid.
pub fn users(named: Option<&PathBuf>, command: &UsersCommand) -> anyhow::Result<()> {
    let folder = Folder::open(folder(named)?)?;
    let (file, mut users) = (folder.users_file(), folder.users()?);
    match command {
        UsersCommand::Add {
            name,
            role,
            images,
            password,
        } => {
            let mut user = User::new(name, *role)?;
            check_images(*role, *images)?;
            user.images = *images;
            users.add(user)?;
            if *password {
                users.set_password(name, Some(&new_password(name)?))?;
            }
            users.save(&file)?;
            println!("added {name}, {role}; servers and routers accept it after their next start");
            println!(
                "next: wheelarm keys user {name} --keys {}",
                folder.path().display()
            );
        }
        UsersCommand::Remove { name } => {
            users.remove(name)?;
            users.save(&file)?;
            folder.discard(name)?;
            println!("removed {name}; {EFFECT}");
        }
        UsersCommand::Role { name, role, images } => {
            check_images(*role, *images)?;
            users.set_role(name, *role, *images)?;
            users.save(&file)?;
            println!("{name} is {role}; {EFFECT}");
        }
        UsersCommand::List { json } => {
            let listed: Vec<Listed<'_>> = users
                .iter()
                .map(|user| Listed {
                    name: &user.name,
                    role: user.role,
                    images: user.images,
                    password: user.has_password(),
                    until: About::beside(&folder.bundle(&user.name)).map(|about| about.until),
                })
                .collect();
            if *json {
                println!("{}", serde_json::to_string_pretty(&listed)?);
                return Ok(());
            }
            for user in listed {
                println!(
                    "{:<20} {:<9} {:<12} keys {}",
                    user.name,
                    format!("{}{}", user.role, if user.images { "+" } else { "" }),
                    if user.password {
                        "password"
                    } else {
                        "no password"
                    },
                    user.until
                        .map_or("none".to_owned(), |day| format!("until {day}")),
                );
            }
        }
        UsersCommand::Password { name, none } => {
            if users.get(name).is_none() {
                // Fails before a password is typed.
                users.set_password(name, None)?;
            }
            let new = (!none).then(|| new_password(name)).transpose()?;
            users.set_password(name, new.as_deref())?;
            users.save(&file)?;
            println!(
                "{name}: {}; its sessions on pages end within a second",
                if *none { "no password" } else { "new password" }
            );
        }
    }
    Ok(())
}
