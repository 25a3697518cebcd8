//! World packs of a service: finds the pack of a scenario, and stores packs that clients send.

use std::path::Path;
use std::sync::Arc;

use bytes::Bytes;
use parking_lot::Mutex;
use wheelarm_homes::own_home::{self, OwnHomeId};
use wheelarm_pack::{Pack, PackName, Store as PackStore, from_hex, to_hex};
use wheelarm_proto::cache::Store as Cache;
use wheelarm_proto::v1::FailureCode;
use wheelarm_proto::{Message, v1};

use super::denied::Denied;
use crate::scene::did_you_mean;
use crate::sim::{ObjectPack, PackRequest, Scenario, ScenePack};

/// Largest number of packs in the folders of a server that receives packs.
const MOST_STORED: usize = 256;
/// Largest total size of the zip files in these folders, bytes.
const MOST_STORED_BYTES: u64 = 4 << 30;

/// Opens the packs of a scenario: that of its scene, unless the scene is one of the assets, and
/// those of its objects.
///
/// # Errors
/// When no pack has the name, or the requested digests, or when it is invalid; with the fix.
pub fn attach(assets: &Path, packs: &PackStore, scenario: &mut Scenario) -> Result<(), String> {
    attach_scene(assets, packs, scenario)?;
    let mut objects = Vec::new();
    for pack in std::mem::take(&mut scenario.object_packs) {
        let pack = match pack {
            ObjectPack::Open(pack) => pack,
            ObjectPack::Requested(wanted) => Arc::new(requested(packs, &wanted)?),
        };
        // The home of an earlier scenario may still be named: its objects belong to it.
        if pack.home().is_none() {
            objects.push(ObjectPack::Open(pack));
        }
    }
    scenario.object_packs = objects;
    Ok(())
}

/// The pack of a request.
fn requested(packs: &PackStore, wanted: &PackRequest) -> Result<Pack, String> {
    let name = &wanted.name;
    if let Some(pack) = packs.open_where(name, |id| wanted.fits(id)) {
        return Ok(pack);
    }
    let found = packs.identities(name);
    let found = match &found[..] {
        [] => "no pack of that name".to_owned(),
        found => found.join(", "),
    };
    Err(format!(
        "the scenario names the pack {wanted}, and the server finds {found}; put that pack into a \
         folder of --packs ({}), send it with `wheelarm pack put`, or leave `packs` out to use \
         the packs of the server",
        folders(packs)
    ))
}

/// The own home of a scenario: the requested pack where the server has it, as in a replay, else
/// one that is made now.
fn made_home(
    assets: &Path,
    packs: &PackStore,
    scenario: &Scenario,
    id: &OwnHomeId,
) -> Result<Pack, String> {
    let wanted = match &scenario.pack {
        ScenePack::Exactly(wanted) => Some(wanted),
        ScenePack::Search | ScenePack::Open(_) => None,
    };
    if let Some(wanted) = wanted
        && wanted.physics.is_some()
        && let Some(pack) = packs.open_where(&wanted.name, |id| wanted.fits(id))
    {
        return Ok(pack);
    }
    let made = own_home::make(assets, id, &scenario.robot, &Cache::open());
    let made = made.map_err(|error| format!("cannot make the home {id}: {error}"))?;
    if let Some(reason) = made.not_kept {
        tracing::warn!("{reason}");
    }
    match wanted {
        Some(wanted) if !wanted.fits(made.pack.id()) => Err(format!(
            "the scenario names the pack {wanted}, and this server makes {}: its version, its \
             assets or the robot differ; put the recorded pack into a folder of --packs \
             (`wheelarm pack extract FILE`), or leave `packs` out",
            made.pack.id()
        )),
        _ => Ok(made.pack),
    }
}

fn attach_scene(assets: &Path, packs: &PackStore, scenario: &mut Scenario) -> Result<(), String> {
    let name = scenario.scene.clone();
    if let (Some(seed), ScenePack::Search | ScenePack::Exactly(_)) =
        (scenario.layout_seed, &scenario.pack)
    {
        let id = OwnHomeId::of_scene(&scenario.scene, &scenario.home_style, seed);
        let pack = made_home(assets, packs, scenario, &id)?;
        scenario.pack = ScenePack::Open(Arc::new(pack));
        return Ok(());
    }
    let opened = match &scenario.pack {
        ScenePack::Open(_) => return Ok(()),
        ScenePack::Search if is_of_assets(assets, &name) => return Ok(()),
        ScenePack::Search => packs.open(&name).map_err(|error| error.to_string())?,
        ScenePack::Exactly(wanted) => Some(requested(packs, wanted)?),
    };
    let named = OwnHomeId::from_name(&name).filter(|id| id.is_of(assets));
    if let (None, Some(id)) = (&opened, named) {
        let pack = made_home(assets, packs, scenario, &id)?;
        scenario.pack = ScenePack::Open(Arc::new(pack));
        (scenario.layout_seed, scenario.home_style) = (Some(id.layout_seed), id.style);
        return Ok(());
    }
    let Some(pack) = opened else {
        let known: Vec<String> = packs.names().into_iter().collect();
        let scenes = scenes(assets);
        let all: Vec<String> = scenes.iter().chain(&known).cloned().collect();
        return Err(format!(
            "no scene named {name:?}: the assets have {}; own homes are PLAN-STYLE-SEED, \
             for example studio-nordic-3; packs in {}: {}{}",
            scenes.join(", "),
            folders(packs),
            match known.is_empty() {
                true => "none; name their folder with --packs".to_owned(),
                false => known.join(", "),
            },
            did_you_mean(&name, &all)
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

/// A requested pack as a message.
fn request_to_proto(wanted: &PackRequest) -> v1::PackRef {
    v1::PackRef {
        name: wanted.name.clone(),
        version: wanted.version.clone(),
        physics_digest: wanted.physics.as_ref().map(to_hex).unwrap_or_default(),
        rendering_digest: wanted.rendering.as_ref().map(to_hex).unwrap_or_default(),
    }
}

/// The packs of a scenario as messages, that of its scene first.
pub(super) fn refs(scene: &ScenePack, objects: &[ObjectPack]) -> Vec<v1::PackRef> {
    let scene = match scene {
        ScenePack::Search => None,
        ScenePack::Exactly(wanted) => Some(request_to_proto(wanted)),
        ScenePack::Open(pack) => Some(to_proto(pack.id())),
    };
    let objects = objects.iter().map(|pack| match pack {
        ObjectPack::Requested(wanted) => request_to_proto(wanted),
        ObjectPack::Open(pack) => to_proto(pack.id()),
    });
    scene.into_iter().chain(objects).collect()
}

/// The requested packs of a scenario for `scene`: that of the scene, and all others.
///
/// # Errors
/// [`Invalid`](wheelarm_proto::check::Invalid) when a digest or a name is not one.
pub(super) fn from_proto(
    scene: &str,
    packs: &[v1::PackRef],
) -> Result<(ScenePack, Vec<ObjectPack>), wheelarm_proto::check::Invalid> {
    use wheelarm_proto::check::{self, Invalid};
    check::few("packs", packs, MOST_STORED)?;
    let mut found = ScenePack::Search;
    let mut objects: Vec<ObjectPack> = Vec::new();
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
        } else if !objects.iter().any(|other| other.fits(&wanted)) {
            objects.push(ObjectPack::Requested(wanted));
        }
    }
    Ok((found, objects))
}

/// Zip files of the packs of a scenario, for its recorders.
///
/// # Errors
/// When a pack cannot be compressed.
pub(super) fn files(scenario: &Scenario) -> Result<Vec<v1::PackFile>, String> {
    let scene = match &scenario.pack {
        ScenePack::Open(pack) => Some(pack),
        ScenePack::Search | ScenePack::Exactly(_) => None,
    };
    let objects = scenario.object_packs.iter().filter_map(|pack| match pack {
        ObjectPack::Open(pack) => Some(pack),
        ObjectPack::Requested(_) => None,
    });
    let file = |pack: &Arc<Pack>| {
        Ok(v1::PackFile {
            pack: Some(to_proto(pack.id())),
            zip: pack.to_zip().map_err(|error| error.to_string())?.into(),
        })
    };
    scene.into_iter().chain(objects).map(file).collect()
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

/// Held while a pack is stored: two at once could exceed the limits together.
static STORING: Mutex<()> = Mutex::new(());

/// Checks a received zip file and stores it in the first folder of packs that is not a pack
/// itself. An equal pack is stored again, so that it is the newest of its name.
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
    check_digest(zip, digest)?;
    let pack = Pack::from_zip(zip).map_err(|error| denied(error.to_string()))?;
    let name = &pack.id().name;
    if is_of_assets(assets, name) {
        return Err(denied(format!(
            "{name:?} is a scene of the assets; rename the pack"
        )));
    }
    let Some(folder) = packs.folder_to_fill() else {
        return Err(denied(format!(
            "this server has no folder for packs ({}); start it with --packs DIR, where DIR is \
             not a pack itself",
            folders(packs)
        )));
    };
    let _turn = STORING.lock();
    let replaced = PackStore::stored_path(folder, &pack);
    let (mut count, mut bytes) = (0, 0);
    for (_, path) in packs.candidates() {
        if path == replaced {
            continue;
        }
        count += 1;
        let about = std::fs::metadata(&path).ok();
        bytes += about.filter(|about| about.is_file()).map_or(0, |a| a.len());
    }
    if count >= MOST_STORED || bytes + zip.len() as u64 > MOST_STORED_BYTES {
        return Err(denied(format!(
            "{count} packs of {bytes} bytes are stored, at most {MOST_STORED} of together \
             {MOST_STORED_BYTES} bytes are accepted; remove some from {}",
            folders(packs)
        )));
    }
    let path = PackStore::put(folder, &pack).map_err(Denied::internal)?;
    tracing::info!("stored the pack {} in {}", pack.id(), path.display());
    Ok(to_proto(pack.id()))
}

/// Compares a received file with its digest: BLAKE3, or SHA-256 after `sha256:`.
fn check_digest(zip: &[u8], digest: &str) -> Result<(), Denied> {
    let found = match digest.strip_prefix("sha256:") {
        Some(_) => format!("sha256:{}", to_hex(&wheelarm_proto::digest::sha256(zip))),
        None => to_hex(&wheelarm_proto::digest::of_message([zip])),
    };
    if found == digest {
        return Ok(());
    }
    let wanted = wheelarm_proto::check::beginning(digest);
    Err(Denied::new(
        FailureCode::Invalid,
        format!("the received file has the digest {found}, expected {wanted:?}; send it again"),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digests_of_a_request_are_checked() {
        let mut pack = v1::PackRef {
            name: "flat".into(),
            ..v1::PackRef::default()
        };
        let (any, objects) = from_proto("flat", std::slice::from_ref(&pack)).unwrap();
        assert!(matches!(any, ScenePack::Exactly(wanted) if wanted.physics.is_none()));
        assert!(objects.is_empty());
        let twice = [pack.clone(), pack.clone()];
        let (other, objects) = from_proto("home", &twice).unwrap();
        assert_eq!((other, objects.len()), (ScenePack::Search, 1));
        pack.physics_digest = "ab".repeat(32);
        let (exact, _) = from_proto("flat", std::slice::from_ref(&pack)).unwrap();
        assert_eq!(refs(&exact, &objects)[0], pack);
        assert_eq!(refs(&exact, &objects)[1].name, "flat");
        pack.rendering_digest = "xy".into();
        assert!(from_proto("flat", &[pack]).is_err());
    }

    /// The flat of the tests under another version, as a zip file with its digest.
    fn flat(version: &str) -> (Vec<u8>, String) {
        let flat = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/data/flat");
        let mut files = Pack::open(Path::new(flat)).unwrap().files().clone();
        let manifest = String::from_utf8(files["pack.toml"].clone()).unwrap();
        let manifest = manifest.replace("version = \"1\"", &format!("version = \"{version}\""));
        let home = String::from_utf8(files["home.toml"].clone()).unwrap();
        let height = format!("height = 2.5{}", version.len());
        files.insert("pack.toml".into(), manifest.into_bytes());
        files.insert(
            "home.toml".into(),
            home.replace("height = 2.5", &height).into_bytes(),
        );
        let zip = Pack::from_files(files).unwrap().to_zip().unwrap();
        let digest = to_hex(&wheelarm_proto::digest::of_message([&zip[..]]));
        (zip, digest)
    }

    fn assets() -> std::path::PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets")
    }

    #[test]
    fn one_pack_stored_by_many_at_once_is_whole_and_alone() {
        let folder = tempfile::tempdir().unwrap();
        let packs = PackStore::new(vec![folder.path().to_owned()]);
        let (zip, digest) = flat("1");
        std::thread::scope(|scope| {
            for _ in 0..6 {
                scope.spawn(|| store(&assets(), &packs, &zip, &digest).unwrap());
            }
        });
        let entries: Vec<_> = std::fs::read_dir(folder.path()).unwrap().collect();
        assert_eq!(entries.len(), 1, "{entries:?}");
        assert_eq!(packs.open("flat").unwrap().unwrap().id().version, "1");
    }

    #[test]
    fn the_pack_stored_last_is_used_also_when_it_was_stored_before() {
        let folder = tempfile::tempdir().unwrap();
        let packs = PackStore::new(vec![folder.path().to_owned()]);
        for version in ["1", "22", "333", "1", "22"] {
            let (zip, digest) = flat(version);
            // Modification times of some file systems have steps of 10 ms.
            std::thread::sleep(std::time::Duration::from_millis(20));
            store(&assets(), &packs, &zip, &digest).unwrap();
            assert_eq!(packs.open("flat").unwrap().unwrap().id().version, version);
        }
        assert_eq!(packs.candidates().len(), 3);
    }

    #[test]
    fn full_store_accepts_what_it_has_and_rejects_the_rest_with_the_fix() {
        let folder = tempfile::tempdir().unwrap();
        let packs = PackStore::new(vec![folder.path().to_owned()]);
        let (zip, digest) = flat("1");
        store(&assets(), &packs, &zip, &digest).unwrap();
        for number in 1..MOST_STORED {
            std::fs::write(folder.path().join(format!("other{number}.zip")), "x").unwrap();
        }
        store(&assets(), &packs, &zip, &digest).unwrap();
        let (other, of_other) = flat("22");
        let problem = store(&assets(), &packs, &other, &of_other).unwrap_err();
        assert!(problem.words.contains("remove some from"), "{problem:?}");
        assert_eq!(packs.candidates().len(), MOST_STORED);
    }

    #[test]
    fn folder_that_is_a_pack_itself_receives_no_pack() {
        let folder = tempfile::tempdir().unwrap();
        let (zip, _) = flat("1");
        let own = folder.path().join("flat");
        Pack::from_zip(&zip).unwrap().write_folder(&own).unwrap();
        let (other, of_other) = flat("22");
        let packs = PackStore::new(vec![own.clone()]);
        let problem = store(&assets(), &packs, &other, &of_other).unwrap_err();
        assert!(problem.words.contains("--packs DIR"), "{problem:?}");
        assert!(Pack::open(&own).is_ok());
        let more = folder.path().join("more");
        let packs = PackStore::new(vec![own, more.clone()]);
        store(&assets(), &packs, &other, &of_other).unwrap();
        assert_eq!(std::fs::read_dir(more).unwrap().count(), 1);
        assert!(store(&assets(), &packs, &zip, &of_other).is_err());
        let sha = format!("sha256:{}", to_hex(&wheelarm_proto::digest::sha256(&zip)));
        store(&assets(), &packs, &zip, &sha).unwrap();
        assert!(store(&assets(), &packs, &zip, "sha256:").is_err());
    }
}
