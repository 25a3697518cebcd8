//! `wheelarm users`: who there is.

use std::path::PathBuf;

use clap::Subcommand;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use serde::Serialize;
use wheelarm_access::{About, Folder, Role, User};

use super::folder;
use super::secret::new_password;
use wheelarm_options::choice;

/// What `wheelarm users` does.
#[derive(Subcommand, Clone, Debug)]
pub enum UsersCommand {
    /// Adds a user.
    Add {
        /// Name: 1 to 64 letters, digits, `-` or `_`; it stands in the keys of what
        /// the user sends.
        #[arg(value_parser = choice::name)]
        name: String,
        /// What the user may do: viewer watches, operator also drives, recorder
        /// watches and records, admin may do everything.
        #[arg(long, value_parser = roles())]
        role: Role,
        /// An operator that also takes full pictures, as a policy does.
        #[arg(long)]
        pictures: bool,
        /// Also sets a password, for the web page: typed, or a line of standard
        /// input.
        #[arg(long)]
        password: bool,
    },
    /// Removes a user and the keys of that name in the folder. Within a second its
    /// connections and sessions end, on servers, routers and pages that run; what it
    /// drives brakes.
    Remove {
        /// Who.
        #[arg(value_parser = choice::name)]
        name: String,
    },
    /// Gives a user another role. Within a second its connections and sessions end; it
    /// connects again with the new role.
    Role {
        /// Who.
        #[arg(value_parser = choice::name)]
        name: String,
        /// The new role, as for `add`.
        #[arg(long, value_parser = roles())]
        role: Role,
        /// An operator that also takes full pictures, as a policy does.
        #[arg(long)]
        pictures: bool,
    },
    /// Lists the users.
    List {
        /// One JSON list instead of lines.
        #[arg(long)]
        json: bool,
    },
    /// Sets a user's password: typed, or a line of standard input.
    Password {
        /// Who.
        #[arg(value_parser = choice::name)]
        name: String,
        /// Takes the password away instead.
        #[arg(long)]
        none: bool,
    },
}

/// What follows a change of a user that servers know.
const AT_ONCE: &str = "its connections and sessions end within a second";

fn check_pictures(role: Role, pictures: bool) -> anyhow::Result<()> {
    if pictures && role != Role::Operator {
        anyhow::bail!("--pictures is for operators: a {role} has its role's already");
    }
    Ok(())
}

fn roles() -> impl TypedValueParser<Value = Role> {
    PossibleValuesParser::new(Role::ALL.map(Role::name))
        .try_map(|name| Role::from_name(&name).ok_or("no role"))
}

/// A user in a list.
#[derive(Serialize)]
struct Listed<'a> {
    name: &'a str,
    role: Role,
    pictures: bool,
    password: bool,
    /// Last day of the newest keys.
    until: Option<String>,
}

/// Runs `wheelarm users`.
///
/// # Errors
/// With the cure.
pub fn users(named: Option<&PathBuf>, command: &UsersCommand) -> anyhow::Result<()> {
    let folder = Folder::open(folder(named)?)?;
    let (file, mut users) = (folder.users_file(), folder.users()?);
    match command {
        UsersCommand::Add {
            name,
            role,
            pictures,
            password,
        } => {
            let mut user = User::new(name, *role)?;
            check_pictures(*role, *pictures)?;
            user.pictures = *pictures;
            users.add(user)?;
            if *password {
                users.set_password(name, Some(&new_password(name)?))?;
            }
            users.save(&file)?;
            println!(
                "added {name}, {role}; servers and routers let it in when they are started again"
            );
            println!(
                "next: wheelarm keys user {name} --keys {}",
                folder.path().display()
            );
        }
        UsersCommand::Remove { name } => {
            users.remove(name)?;
            users.save(&file)?;
            folder.discard(name)?;
            println!("removed {name}; {AT_ONCE}");
        }
        UsersCommand::Role {
            name,
            role,
            pictures,
        } => {
            check_pictures(*role, *pictures)?;
            users.set_role(name, *role, *pictures)?;
            users.save(&file)?;
            println!("{name} is {role}; {AT_ONCE}");
        }
        UsersCommand::List { json } => {
            let listed: Vec<Listed<'_>> = users
                .iter()
                .map(|user| Listed {
                    name: &user.name,
                    role: user.role,
                    pictures: user.pictures,
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
                    format!("{}{}", user.role, if user.pictures { "+" } else { "" }),
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
                // Told before anything is typed.
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
