//! `wheelarm object`: imports meshes as objects of packs, and checks that the scripted operator
//! can lift them.

mod check;
mod find;
mod import;
mod tally;

use clap::Subcommand;

/// Commands of `wheelarm object`.
#[derive(Subcommand, Debug)]
pub enum ObjectCommand {
    /// Imports a mesh as an object of a pack, with collision shapes, mass and grasps.
    ///
    /// Reads GLB, glTF, OBJ with MTL, STL, MSH, COLLADA, URDF and MJCF. Prints units, size, mass,
    /// shapes, grasps and what is unusual. An object of the same name in the pack is replaced.
    Import(Box<import::ImportArgs>),
    /// Lets the scripted operator lift an object of a pack on a bench, again and again.
    ///
    /// An object that is lifted in nine of ten trials can be grasped by tasks; others become
    /// scenery: it is placed beside other objects.
    Check(check::CheckArgs),
}

/// Runs a command and returns its output.
///
/// # Errors
/// When the mesh or an option cannot be used, or the pack cannot be read or written.
pub fn run(command: &ObjectCommand) -> anyhow::Result<String> {
    match command {
        ObjectCommand::Import(args) => import::run(args),
        ObjectCommand::Check(args) => check::run(args),
    }
}
