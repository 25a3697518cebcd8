//! Packs as folders and zip files: digests, bytes, limits, and what no pack may contain.

mod common;

use std::collections::BTreeMap;
use std::io::{Cursor, Write};

use common::{changed, files, flat};
use wheelarm_pack::{Manifest, Pack, PackError, Store, archive, from_hex, to_hex};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// A zip file with these entries, in this order.
fn zipped(entries: &[(&str, &[u8])]) -> Vec<u8> {
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Deflated);
    for (path, bytes) in entries {
        writer.start_file(*path, options).expect("an entry");
        writer.write_all(bytes).expect("its content");
    }
    writer.finish().expect("a zip file").into_inner()
}

fn zip_of(files: &BTreeMap<String, Vec<u8>>, prefix: &str) -> Vec<u8> {
    let paths: Vec<String> = files.keys().map(|path| format!("{prefix}{path}")).collect();
    let entries: Vec<(&str, &[u8])> = paths
        .iter()
        .zip(files.values())
        .map(|(path, bytes)| (path.as_str(), bytes.as_slice()))
        .collect();
    zipped(&entries)
}

#[test]
fn folder_and_zip_of_a_pack_are_equal_and_its_zip_has_the_same_bytes() {
    let pack = flat();
    let place = tempfile::tempdir().unwrap();
    let folder = place.path().join("flat");
    pack.write_folder(&folder).unwrap();
    let opened = Pack::open(&folder).unwrap();
    assert_eq!(opened.id(), pack.id());
    assert_eq!(opened.files(), pack.files());
    let zip = pack.to_zip().unwrap();
    assert_eq!(zip, opened.to_zip().unwrap());
    let file = place.path().join("flat.zip");
    pack.write_zip(&file).unwrap();
    assert_eq!(Pack::open(&file).unwrap().files(), pack.files());
    // A folder is never written over.
    assert!(pack.write_folder(&folder).is_err());
}

#[test]
fn a_folder_around_all_files_of_a_zip_is_removed() {
    let pack = Pack::from_zip(&zip_of(&files(), "anna/")).unwrap();
    assert_eq!(pack.id(), flat().id());
    let mut with_foreign = files();
    with_foreign.insert("__MACOSX/._home.toml".into(), vec![0; 10]);
    assert_eq!(
        Pack::from_zip(&zip_of(&with_foreign, "")).unwrap().id(),
        flat().id()
    );
}

#[test]
fn digests_follow_values_and_not_their_spelling() {
    let flat = flat().id().clone();
    for (path, from, to, physics, rendering) in [
        ("home.toml", "# 0: south", "# the south wall", false, false),
        ("home.toml", "yaw_deg = 90", "yaw_deg = 90.0", false, false),
        (
            "home.toml",
            "height = 2.5\n",
            "height = 2.50\n",
            false,
            false,
        ),
        ("home.toml", "yaw_deg = 90", "yaw_deg = 91", true, false),
        ("kinds/table.toml", "0.72]", "0.73]", true, false),
        (
            "kinds/table.toml",
            "category = \"table\"",
            "category = \"bench\"",
            true,
            false,
        ),
        ("meshes/leg.obj", "v 0.1 0 0", "v 0.2 0 0", false, true),
        ("materials/flat.toml", "0.6", "0.7", false, true),
        ("objects/jar.toml", "0.35", "0.36", true, false),
        ("tasks/pick_jar.toml", "the jar", "a jar", true, false),
        (
            "pack.toml",
            "author = \"WheelArm\"",
            "author = \"Anna\"",
            false,
            false,
        ),
        (
            "pack.toml",
            "version = \"1\"",
            "version = \"2\"",
            false,
            false,
        ),
    ] {
        let other = changed(path, from, to).unwrap();
        let other = other.id();
        assert_eq!(other.physics != flat.physics, physics, "{path}: {to}");
        assert_eq!(other.rendering != flat.rendering, rendering, "{path}: {to}");
    }
    let hex = to_hex(&flat.physics);
    assert_eq!((hex.len(), from_hex(&hex)), (64, Some(flat.physics)));
    assert_eq!(from_hex("12"), None);
    // On every machine.
    assert_eq!(&hex[..16], PHYSICS, "{hex}");
    // Names of files count too.
    let mut renamed = files();
    let mesh = renamed.remove("meshes/leg.obj").unwrap();
    renamed.insert("meshes/foot.obj".into(), mesh);
    let kind = String::from_utf8(renamed["kinds/table.toml"].clone()).unwrap();
    renamed.insert(
        "kinds/table.toml".into(),
        kind.replace("leg.obj", "foot.obj").into_bytes(),
    );
    let renamed = Pack::from_files(renamed).unwrap();
    assert_ne!(renamed.id().rendering, flat.rendering);
}

/// First digits of the physics digest of the flat.
const PHYSICS: &str = "6b1525dcf4a791dc";

#[test]
fn tables_written_by_a_program_are_read_again() {
    let pack = flat();
    let manifest: Manifest = pack.manifest().clone();
    let mut others = files();
    others.retain(|path, _| path.contains('/') && !path.starts_with("kinds/"));
    let again = Pack::from_tables(&manifest, pack.home(), pack.kinds(), others).unwrap();
    assert_eq!(again.home(), pack.home());
    assert_eq!(again.kinds(), pack.kinds());
    assert_eq!(again.furniture().unwrap(), pack.furniture().unwrap());
}

#[test]
fn incomplete_and_foreign_packs_are_rejected_with_the_fix() {
    let without = |path: &str| {
        let mut files = files();
        files.remove(path);
        Pack::from_files(files).unwrap_err().to_string()
    };
    assert!(without("pack.toml").starts_with("pack.toml is missing"));
    assert!(without("meshes/leg.obj").contains("add the mesh to the pack"));
    assert!(without("kinds/table.toml").contains("add the file to kinds"));
    for (from, to, words) in [
        ("format = 1", "format = 2", "format is 2, expected 1"),
        ("\"flat\"", "\"../flat\"", "name is \"../flat\""),
        ("\"1\"", "\"a b\"", "version is \"a b\""),
        ("\"CC0-1.0\"", "\"\"", "source[0].license is empty"),
        (
            "format = 1",
            "format = 1\nauthor = \"x\"",
            "unknown field `author`",
        ),
    ] {
        let error = changed("pack.toml", from, to).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
    let mut twice = files();
    twice.insert("kinds/Table.toml".into(), b"category = \"table\"".to_vec());
    let error = Pack::from_files(twice).unwrap_err().to_string();
    assert!(error.contains("other letters"), "{error}");
    let mut binary = files();
    binary.insert("home.toml".into(), vec![0xff, 0xfe, 0x00]);
    let error = Pack::from_files(binary).unwrap_err().to_string();
    assert!(error.contains("UTF-8"), "{error}");
    let nothing = BTreeMap::from([("pack.toml".to_owned(), files()["pack.toml"].clone())]);
    assert!(Pack::from_files(nothing).is_err());
    assert!(matches!(
        Pack::open(std::path::Path::new("/nonexistent/pack")),
        Err(PackError::File { .. })
    ));
}

#[test]
fn zip_files_with_foreign_paths_are_rejected() {
    for path in [
        "../evil.toml",
        "/etc/passwd",
        "kinds/../../evil.toml",
        "kinds/sub/evil.toml",
        "C:\\evil.toml",
        "kinds\\evil.toml",
        "evil.exe",
        "meshes/evil.gltf",
    ] {
        let mut files = files();
        files.insert(path.to_owned(), b"x = 1".to_vec());
        let error = Pack::from_zip(&zip_of(&files, "")).unwrap_err();
        assert!(matches!(error, PackError::Path { .. }), "{path}: {error}");
    }
}

#[test]
fn links_in_zip_files_and_folders_are_rejected() {
    let plain = Cursor::new(zip_of(&files(), ""));
    let mut writer = ZipWriter::new_append(plain).unwrap();
    writer
        .add_symlink(
            "textures/link.png",
            "/etc/passwd",
            SimpleFileOptions::default(),
        )
        .unwrap();
    let error = Pack::from_zip(&writer.finish().unwrap().into_inner()).unwrap_err();
    assert!(error.to_string().contains("link"), "{error}");
    let place = tempfile::tempdir().unwrap();
    let folder = place.path().join("flat");
    flat().write_folder(&folder).unwrap();
    std::os::unix::fs::symlink("/etc/passwd", folder.join("LICENSE")).unwrap();
    let error = Pack::open(&folder).unwrap_err();
    assert!(error.to_string().contains("link"), "{error}");
}

#[test]
fn zip_bombs_are_rejected_before_they_are_unpacked() {
    let zeros = vec![0; 20 << 20];
    let bomb = zipped(&[("pack.toml", b"format = 1"), ("plan.png", &zeros)]);
    assert!(bomb.len() < 100_000);
    let error = Pack::from_zip(&bomb).unwrap_err().to_string();
    assert!(error.contains("compression"), "{error}");
    let large = vec![0; archive::MOST_FILE_BYTES as usize + 1];
    let error = Pack::from_zip(&zipped(&[("plan.png", &large)])).unwrap_err();
    assert!(matches!(error, PackError::Large { .. }), "{error}");
    let names: Vec<String> = (0..archive::MOST_FILES + 1)
        .map(|i| format!("kinds/k{i}.toml"))
        .collect();
    let many: Vec<(&str, &[u8])> = names.iter().map(|name| (name.as_str(), &b""[..])).collect();
    let error = Pack::from_zip(&zipped(&many)).unwrap_err().to_string();
    assert!(error.contains("number of files"), "{error}");
}

#[test]
fn damaged_zip_files_are_rejected_at_every_byte() {
    let zip = flat().to_zip().unwrap();
    for length in (0..zip.len()).step_by(97) {
        assert!(Pack::from_zip(&zip[..length]).is_err(), "{length} bytes");
    }
    let flat = flat();
    for at in (0..zip.len()).step_by(31) {
        let mut damaged = zip.clone();
        damaged[at] ^= 0x5a;
        // Bytes of times and attributes change nothing.
        if let Ok(pack) = Pack::from_zip(&damaged) {
            assert_eq!(pack.files(), flat.files(), "byte {at}");
        }
    }
    assert!(Pack::from_zip(b"").is_err());
    // Two entries of one name.
    let mut twice = zipped(&[("kinds/aaaa.toml", b"a = 1"), ("kinds/bbbb.toml", b"a = 2")]);
    while let Some(at) = twice.windows(4).position(|four| four == b"bbbb") {
        twice[at..at + 4].copy_from_slice(b"aaaa");
    }
    let error = Pack::from_zip(&twice).unwrap_err().to_string();
    assert!(error.contains("different names"), "{error}");
}

#[test]
fn a_store_finds_packs_by_name_and_by_digest() {
    let place = tempfile::tempdir().unwrap();
    let [first, second] = ["first", "second"].map(|name| place.path().join(name));
    let one = flat();
    let other = changed("home.toml", "yaw_deg = 90", "yaw_deg = 45").unwrap();
    one.write_folder(&first.join("flat")).unwrap();
    let stored = Store::put(&second, &other).unwrap();
    assert_eq!(Store::put(&second, &other).unwrap(), stored);
    let name = stored.file_name().unwrap().to_string_lossy().into_owned();
    assert!(
        name.starts_with("flat@") && name.ends_with(".zip"),
        "{name}"
    );
    let store = Store::new(vec![place.path().join("none"), first.clone(), second]);
    assert_eq!(store.names().into_iter().collect::<Vec<_>>(), ["flat"]);
    assert_eq!(store.open("flat").unwrap().unwrap().id(), one.id());
    assert!(store.open("flats").unwrap().is_none());
    for pack in [&one, &other] {
        let found = store.open_where("flat", |id| id.physics == pack.id().physics);
        assert_eq!(found.unwrap().id(), pack.id());
    }
    assert!(store.open_where("flat", |_| false).is_none());
    // An invalid pack is an error by name, and passed over by digest.
    std::fs::write(first.join("flat/home.toml"), "origin = 3").unwrap();
    assert!(store.open("flat").is_err());
    let found = store.open_where("flat", |_| true).unwrap();
    assert_eq!(found.id(), other.id());
    // The name of a folder is the name of its pack.
    one.write_folder(&first.join("cottage")).unwrap();
    let error = store.open("cottage").unwrap_err().to_string();
    assert!(error.contains("rename the folder"), "{error}");
}
