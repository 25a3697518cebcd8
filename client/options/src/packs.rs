//! Folders of world packs.

use std::path::PathBuf;

use clap::Args;
use wheelarm_proto::installed::PACKS_VARIABLE;

/// Folders of world packs for the servers that a command starts.
#[derive(Args, Clone, Debug, Default, PartialEq, Eq)]
pub struct PackArgs {
    /// Folder of world packs, whose homes are scenes; may be repeated [default: the user's,
    /// ~/.local/share/wheelarm/packs].
    #[arg(long, value_name = "DIR", env = PACKS_VARIABLE, value_delimiter = ':')]
    pub packs: Vec<PathBuf>,
}
