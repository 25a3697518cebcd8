//! World packs of a service: finds the pack of a scenario, and stores packs that clients send.

use std::path::Path;
use std::sync::Arc;

use bytes::Bytes;
use wheelarm_pack::archive::MOST_ZIP_BYTES;
use wheelarm_pack::{Pack, PackName, Store as PackStore, from_hex, to_hex};
use wheelarm_proto::v1::FailureCode;
use wheelarm_proto::{Message, v1};

use super::denied::Denied;
use crate::sim::{PackRequest, Scenario, ScenePack};

/// Largest piece of a pack, bytes.
pub(super) const MOST_PIECE: usize = 256 << 10;
/// Largest number of packs in the folders of a server that receives packs.
const MOST_STORED: usize = 256;
/// Largest total size of the zip files in these folders, bytes.
const MOST_STORED_BYTES: u64 = 4 << 30;

/// Opens the pack of a scenario's scene, unless the scene is one of the assets or its pack is
/// open.
///
/// # Errors
/// When no pack has the name, or the requested digests, or when it is invalid; with the fix.
pub fn attach(assets: &Path, packs: &PackStore, scenario: &mut Scenario) -> Result<(), String> {
    let name = scenario.scene.clone();
    let opened = match &scenario.pack {
        ScenePack::Open(_) => return Ok(()),
        ScenePack::Search if is_of_assets(assets, &name) => return Ok(()),
        ScenePack::Search => packs.open(&name).map_err(|error| error.to_string())?,
        ScenePack::Exactly(wanted) => {
            let fits = |id: &PackName| wanted.fits(id);
            Some(packs.open_where(&name, fits).ok_or_else(|| {
                let found = packs.identities(&name);
                let found = match &found[..] {
                    [] => "no pack of that name".to_owned(),
                    found => found.join(", "),
                };
                format!(
                    "the scenario names the pack {wanted}, and the server finds {found}; put that \
                     pack into a folder of --packs ({}), send it with `wheelarm pack put`, or \
                     leave `packs` out to use the packs of the server",
                    folders(packs)
                )
            })?)
        }
    };
    let Some(pack) = opened else {
        let known: Vec<String> = packs.names().into_iter().collect();
        return Err(format!(
            "no scene named {name:?}: the assets have {}; packs in {}: {}",
            scenes(assets).join(", "),
            folders(packs),
            match known.is_empty() {
                true => "none".to_owned(),
                false => known.join(", "),
            }
        ));
    };
    scenario.pack = ScenePack::Open(Arc::new(pack));
    Ok(())
}

fn folders(packs: &PackStore) -> String {
    let folders = packs.folders().iter();
    let folders: Vec<String> = folders.map(|f| f.display().to_string()).collect();
    match folders.is_empty() {
        true => "no folder".to_owned(),
        false => folders.join(", "),
    }
}

fn is_of_assets(assets: &Path, name: &str) -> bool {
    assets.join(format!("scenes/{name}.toml")).is_file()
}

fn scenes(assets: &Path) -> Vec<String> {
    crate::scene::names(assets, "scenes").unwrap_or_default()
}

/// Logs each pack of the folders that cannot be used, and each that a scene of the assets
/// hides.
pub fn report(assets: &Path, packs: &PackStore) {
    for (name, path) in packs.candidates() {
        if is_of_assets(assets, &name) {
            tracing::warn!(
                "the pack {} is not used: {name:?} is a scene of the assets; rename the pack",
                path.display()
            );
        } else if let Err(error) = Pack::open(&path) {
            tracing::warn!("the pack {} is not used: {error}", path.display());
        }
    }
}

/// The identity of a pack as a message.
pub(super) fn to_proto(id: &PackName) -> v1::PackRef {
    v1::PackRef {
        name: id.name.clone(),
        version: id.version.clone(),
        physics_digest: to_hex(&id.physics),
        rendering_digest: to_hex(&id.rendering),
    }
}

/// The packs of a scenario as messages.
pub(super) fn refs(pack: &ScenePack) -> Vec<v1::PackRef> {
    match pack {
        ScenePack::Search => Vec::new(),
        ScenePack::Exactly(wanted) => vec![v1::PackRef {
            name: wanted.name.clone(),
            version: wanted.version.clone(),
            physics_digest: wanted.physics.as_ref().map(to_hex).unwrap_or_default(),
            rendering_digest: wanted.rendering.as_ref().map(to_hex).unwrap_or_default(),
        }],
        ScenePack::Open(pack) => vec![to_proto(pack.id())],
    }
}

/// The requested pack of a scenario for `scene`.
///
/// # Errors
/// [`Invalid`](wheelarm_proto::check::Invalid) when a digest or a name is not one.
pub(super) fn from_proto(
    scene: &str,
    packs: &[v1::PackRef],
) -> Result<ScenePack, wheelarm_proto::check::Invalid> {
    use wheelarm_proto::check::{self, Invalid};
    check::few("packs", packs, MOST_STORED)?;
    let mut found = ScenePack::Search;
    for pack in packs {
        check::name("pack name", &pack.name)?;
        let digest = |what, text: &str| match text {
            "" => Ok(None),
            text => from_hex(text).map(Some).ok_or_else(|| Invalid::Word {
                what,
                value: check::beginning(text),
                expected: "64 hexadecimal digits, or empty for any",
            }),
        };
        let wanted = PackRequest {
            name: pack.name.clone(),
            version: check::beginning(&pack.version),
            physics: digest("physics_digest", &pack.physics_digest)?,
            rendering: digest("rendering_digest", &pack.rendering_digest)?,
        };
        if pack.name == scene {
            found = ScenePack::Exactly(wanted);
        }
    }
    Ok(found)
}

/// Zip files of the packs of a scenario, for its recorders.
///
/// # Errors
/// When a pack cannot be compressed.
pub(super) fn files(pack: &ScenePack) -> Result<Vec<v1::PackFile>, String> {
    let ScenePack::Open(pack) = pack else {
        return Ok(Vec::new());
    };
    Ok(vec![v1::PackFile {
        pack: Some(to_proto(pack.id())),
        zip: pack.to_zip().map_err(|error| error.to_string())?.into(),
    }])
}

/// The packs that a server finds.
pub(super) fn list(packs: &PackStore, header: v1::Header) -> Bytes {
    let mut reply = v1::PacksReply {
        header: Some(header),
        ..v1::PacksReply::default()
    };
    for (_, path) in packs.candidates() {
        match Pack::open(&path) {
            Ok(pack) => reply.packs.push(to_proto(pack.id())),
            Err(error) => reply.problems.push(format!("{}: {error}", path.display())),
        }
    }
    reply.packs.sort_by(|a, b| a.name.cmp(&b.name));
    reply.encode_to_vec().into()
}

/// A pack that arrives in pieces. One at a time: another transfer replaces it.
#[derive(Debug, Default)]
pub(super) struct Upload {
    transfer: u64,
    digest: String,
    length: usize,
    bytes: Vec<u8>,
}

impl Upload {
    /// Adds a piece; returns the whole file with its last piece.
    ///
    /// # Errors
    /// When the piece is not the next one, or the file is too long.
    pub fn add(&mut self, request: v1::PackPutRequest) -> Result<Option<Vec<u8>>, Denied> {
        let denied = |words: String| Denied::new(FailureCode::Invalid, words);
        let length = usize::try_from(request.zip_length).unwrap_or(usize::MAX);
        if length == 0 || length > MOST_ZIP_BYTES {
            return Err(denied(format!(
                "a pack of {} bytes, expected 1 to {MOST_ZIP_BYTES}; simplify its meshes",
                request.zip_length
            )));
        }
        if request.piece.is_empty() || request.piece.len() > MOST_PIECE {
            return Err(denied(format!(
                "a piece of {} bytes, expected 1 to {MOST_PIECE}",
                request.piece.len()
            )));
        }
        if request.offset == 0 {
            *self = Self {
                transfer: request.transfer,
                digest: request.zip_digest.clone(),
                length,
                bytes: Vec::new(),
            };
        }
        let continues = self.transfer == request.transfer
            && self.digest == request.zip_digest
            && self.length == length
            && self.bytes.len() as u64 == request.offset;
        if !continues || self.bytes.len() + request.piece.len() > length {
            return Err(denied(format!(
                "a piece at {} of {length} bytes, expected one at {}; another transfer may have \
                 begun: begin again with offset 0",
                request.offset,
                self.bytes.len()
            )));
        }
        self.bytes.extend_from_slice(&request.piece);
        if self.bytes.len() < length {
            return Ok(None);
        }
        Ok(Some(std::mem::take(self).bytes))
    }

    /// Number of bytes that have arrived.
    pub fn received(&self) -> u64 {
        self.bytes.len() as u64
    }
}

/// Checks a received zip file and stores it in the first folder of packs.
///
/// # Errors
/// When it differs from its digest, is not a valid pack, or cannot be written.
pub(super) fn store(
    assets: &Path,
    packs: &PackStore,
    zip: &[u8],
    digest: &str,
) -> Result<v1::PackRef, Denied> {
    let denied = |words: String| Denied::new(FailureCode::Invalid, words);
    let found = to_hex(&wheelarm_proto::digest::of_message([zip]));
    if found != digest {
        return Err(denied(format!(
            "the received file has the digest {found}, expected {digest:?}; send it again"
        )));
    }
    let pack = Pack::from_zip(zip).map_err(|error| denied(error.to_string()))?;
    let name = &pack.id().name;
    if is_of_assets(assets, name) {
        return Err(denied(format!(
            "{name:?} is a scene of the assets; rename the pack"
        )));
    }
    let Some(folder) = packs.folders().first() else {
        return Err(denied(
            "this server has no folder for packs; start it with --packs DIR".to_owned(),
        ));
    };
    let stored = packs.candidates();
    let sizes = stored
        .iter()
        .filter_map(|(_, path)| std::fs::metadata(path).ok());
    let bytes: u64 = sizes
        .filter(|about| about.is_file())
        .map(|about| about.len())
        .sum();
    if stored.len() >= MOST_STORED || bytes + zip.len() as u64 > MOST_STORED_BYTES {
        return Err(denied(format!(
            "{} packs of {bytes} bytes are stored, at most {MOST_STORED} of together \
             {MOST_STORED_BYTES} bytes are accepted; remove some from {}",
            stored.len(),
            folders(packs)
        )));
    }
    let path = PackStore::put(folder, &pack).map_err(Denied::internal)?;
    tracing::info!("stored the pack {} in {}", pack.id(), path.display());
    Ok(to_proto(pack.id()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn piece(transfer: u64, offset: u64, length: u64, bytes: usize) -> v1::PackPutRequest {
        v1::PackPutRequest {
            transfer,
            zip_digest: "digest".into(),
            zip_length: length,
            offset,
            piece: vec![7; bytes].into(),
        }
    }

    #[test]
    fn pieces_in_order_make_the_file_and_others_are_rejected() {
        let mut upload = Upload::default();
        assert!(upload.add(piece(1, 10, 30, 10)).is_err());
        assert_eq!(upload.add(piece(1, 0, 30, 10)), Ok(None));
        assert_eq!(upload.received(), 10);
        assert!(upload.add(piece(1, 20, 30, 10)).is_err());
        assert!(upload.add(piece(2, 10, 30, 10)).is_err());
        assert!(upload.add(piece(1, 10, 40, 10)).is_err());
        assert!(upload.add(piece(1, 10, 30, 21)).is_err());
        assert_eq!(upload.add(piece(1, 10, 30, 20)), Ok(Some(vec![7; 30])));
        assert_eq!(upload.received(), 0);
        // A new transfer replaces the former one.
        assert_eq!(upload.add(piece(3, 0, 30, 10)), Ok(None));
        assert_eq!(upload.add(piece(4, 0, 10, 10)), Ok(Some(vec![7; 10])));
    }

    #[test]
    fn files_and_pieces_beyond_the_limits_are_rejected() {
        let mut upload = Upload::default();
        let most = MOST_ZIP_BYTES as u64;
        for request in [
            piece(1, 0, most + 1, 10),
            piece(1, 0, 0, 10),
            piece(1, 0, u64::MAX, 10),
            piece(1, 0, most, MOST_PIECE + 1),
            piece(1, 0, most, 0),
        ] {
            assert!(upload.add(request).is_err());
        }
        assert!(upload.add(piece(1, 0, most, MOST_PIECE)).is_ok());
    }

    #[test]
    fn digests_of_a_request_are_checked() {
        let mut pack = v1::PackRef {
            name: "flat".into(),
            ..v1::PackRef::default()
        };
        let any = from_proto("flat", std::slice::from_ref(&pack)).unwrap();
        assert!(matches!(any, ScenePack::Exactly(wanted) if wanted.physics.is_none()));
        let other = from_proto("home", std::slice::from_ref(&pack)).unwrap();
        assert_eq!(other, ScenePack::Search);
        pack.physics_digest = "ab".repeat(32);
        let exact = from_proto("flat", std::slice::from_ref(&pack)).unwrap();
        assert_eq!(refs(&exact), [pack.clone()]);
        pack.rendering_digest = "xy".into();
        assert!(from_proto("flat", &[pack]).is_err());
    }
}
