//! Folders of world packs.

use std::path::PathBuf;

use clap::Args;
use wheelarm_proto::installed::PACKS_VARIABLE;
use wheelarm_proto::v1;

/// Folders of world packs for the servers that a command starts.
#[derive(Args, Clone, Debug, Default, PartialEq, Eq)]
pub struct PackArgs {
    /// Folder of world packs, whose homes are scenes; may be repeated [default: the user's,
    /// ~/.local/share/wheelarm/packs].
    #[arg(long, value_name = "DIR", env = PACKS_VARIABLE, value_delimiter = ':')]
    pub packs: Vec<PathBuf>,
}

/// Packs whose objects tasks may place.
#[derive(Args, Clone, Debug, Default, PartialEq, Eq)]
pub struct ObjectPackArgs {
    /// Packs whose objects the tasks of every home may place, separated by commas.
    #[arg(long, value_name = "PACKS", value_delimiter = ',')]
    pub objects: Vec<String>,
}

impl ObjectPackArgs {
    /// As a field of a scenario: any digests.
    #[must_use]
    pub fn refs(&self) -> Vec<v1::PackRef> {
        let named = |name: &String| v1::PackRef {
            name: name.clone(),
            ..v1::PackRef::default()
        };
        self.objects.iter().map(named).collect()
    }
}
