//! World packs of an episode file.

use hdf5::Location;
use wheelarm_proto::v1;

use super::{Episode, ReadError, text};

/// Group of the packs.
const GROUP: &str = "packs";

impl Episode {
    /// The world packs with which the episode was made, as zip files; none for a scene of the
    /// assets, and in earlier recordings.
    ///
    /// # Errors
    /// When one of them cannot be read.
    pub fn packs(&self) -> Result<Vec<v1::PackFile>, ReadError> {
        if !self.file.link_exists(GROUP) {
            return Ok(Vec::new());
        }
        let group = self.file.group(GROUP).map_err(|e| self.hdf5(GROUP, e))?;
        let mut names = group.member_names().map_err(|e| self.hdf5(GROUP, e))?;
        names.sort();
        names.iter().map(|name| self.pack(name)).collect()
    }

    fn pack(&self, name: &str) -> Result<v1::PackFile, ReadError> {
        let path = format!("{GROUP}/{name}");
        let data = self.file.dataset(&path).map_err(|e| self.hdf5(&path, e))?;
        let about = |attribute: &str| {
            let place: &Location = &data;
            text(place, attribute).map_err(|e| self.hdf5(&format!("{path} {attribute}"), e))
        };
        Ok(v1::PackFile {
            pack: Some(v1::PackRef {
                name: name.to_owned(),
                version: about("version")?,
                physics_digest: about("physics_digest")?,
                rendering_digest: about("rendering_digest")?,
            }),
            zip: self.raw::<u8>(&path)?.into(),
        })
    }
}
