//! Files that a program computes once and reads again at its next start, in the user's
//! cache folder. They save time only: a program that cannot read or write one computes
//! its content again.
//!
//! The variable [`VARIABLE`] names another folder, or `off` for none. An entry is a header
//! and its bytes: magic number, version of this form, key, length, BLAKE3 of key and bytes.
//! An entry with another header or checksum is removed. An entry is written to a temporary
//! file and renamed, so that other processes never see a part of it.

use std::ffi::OsStr;
use std::fs::{self, DirBuilder, File, OpenOptions, Permissions};
use std::io::{self, Read, Write};
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, SystemTime};

/// Environment variable of the folder; `off` switches the cache off.
pub const VARIABLE: &str = "WHEELARM_CACHE";

/// Largest total size of the entries, bytes. The oldest are removed.
pub const LIMIT: u64 = 512 << 20;

/// Start of every entry.
const MAGIC: [u8; 8] = *b"WARMCACH";
/// Version of the form of an entry.
const VERSION: u32 = 1;
/// Magic number, version, key, length, checksum.
const HEADER: usize = 8 + 4 + 32 + 8 + 32;
/// Largest entry, bytes.
const MOST: u64 = 256 << 20;
/// End of the names of entries, and of unfinished ones.
const ENTRY: &str = "wheelarm-entry";
const UNFINISHED: &str = "wheelarm-unfinished";
/// Age after which an unfinished entry was left behind by a killed process.
const LEFT_BEHIND: Duration = Duration::from_secs(3600);
/// Age of an entry after which reading it renews its time.
const RENEWED: Duration = Duration::from_secs(24 * 3600);

/// Identifies the bytes of an entry: the BLAKE3 hash of everything that determines them.
pub type Key = [u8; 32];

/// The key of bytes that are determined by `inputs`. `kind` names the form of the bytes
/// and its version, for example `texture 1`.
#[must_use]
pub fn key(kind: &str, inputs: &[&[u8]]) -> Key {
    let mut hash = blake3::Hasher::new();
    for part in std::iter::once(kind.as_bytes()).chain(inputs.iter().copied()) {
        // Lengths separate the parts.
        hash.update(&(part.len() as u64).to_le_bytes());
        hash.update(part);
    }
    hash.finalize().into()
}

/// The cache folder of this process: that of [`VARIABLE`], else `wheelarm` in
/// `XDG_CACHE_HOME` or in `~/.cache`. `None` when it is off or no folder is known.
#[must_use]
pub fn folder() -> Option<PathBuf> {
    let variable = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty());
    folder_from(
        variable(VARIABLE).as_deref(),
        variable("XDG_CACHE_HOME").as_deref(),
        variable("HOME").as_deref(),
    )
}

fn folder_from(
    named: Option<&OsStr>,
    caches: Option<&OsStr>,
    home: Option<&OsStr>,
) -> Option<PathBuf> {
    if let Some(named) = named {
        return (named != "off").then(|| PathBuf::from(named));
    }
    let absolute = |value: Option<&OsStr>| {
        let path = value.map(PathBuf::from);
        path.filter(|path| path.is_absolute())
    };
    let caches = absolute(caches).or_else(|| Some(absolute(home)?.join(".cache")));
    Some(caches?.join("wheelarm"))
}

/// Number and total size of entries.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Usage {
    /// Entries.
    pub entries: u64,
    /// Their total size, bytes.
    pub bytes: u64,
}

/// The entries of one folder. Every operation may fail without a consequence except time.
#[derive(Debug)]
pub struct Store {
    folder: Option<PathBuf>,
    limit: u64,
    /// A write failed: no further write is attempted.
    is_failed: AtomicBool,
    written: AtomicU64,
}

impl Store {
    /// The store in [`folder`].
    #[must_use]
    pub fn open() -> Self {
        Self::at(folder(), LIMIT)
    }

    /// A store in `folder`, which need not exist; `None` stores nothing. `limit` is the
    /// largest total size of the entries, bytes.
    #[must_use]
    pub fn at(folder: Option<PathBuf>, limit: u64) -> Self {
        Self {
            folder,
            limit,
            is_failed: AtomicBool::new(false),
            written: AtomicU64::new(0),
        }
    }

    /// The bytes of an entry, if it exists and is valid. Removes an invalid one.
    #[must_use]
    pub fn get(&self, key: &Key) -> Option<Vec<u8>> {
        let path = self.path(key)?;
        // A pipe would block, and a link leads to a file of another owner.
        if !fs::symlink_metadata(&path).ok()?.is_file() {
            let _ = fs::remove_file(&path);
            return None;
        }
        let mut file = File::open(&path).ok()?;
        let bytes = read(&mut file, key);
        match &bytes {
            Some(_) => renew(&file),
            // Another process may have replaced or removed it.
            None => drop(fs::remove_file(&path)),
        }
        bytes
    }

    /// Stores the bytes of an entry. Returns why they cannot be stored at the first failed
    /// attempt; later attempts do nothing.
    ///
    /// # Errors
    /// With folder, reason and fix, for example for a full disk.
    pub fn put(&self, key: &Key, bytes: &[u8]) -> Result<(), String> {
        let Some(folder) = &self.folder else {
            return Ok(());
        };
        let size = bytes.len() as u64;
        if self.is_failed.load(Ordering::Relaxed) || size > MOST.min(self.limit) {
            return Ok(());
        }
        let stored = self.write(folder, key, bytes);
        if let Err(error) = stored
            && !self.is_failed.swap(true, Ordering::Relaxed)
        {
            return Err(format!(
                "cannot write to the cache {}: {error}; starts take longer: free disk space, \
                 or set {VARIABLE} to another folder or to off",
                folder.display()
            ));
        }
        Ok(())
    }

    /// Number and size of the entries.
    ///
    /// # Errors
    /// When the folder exists and cannot be listed.
    pub fn usage(&self) -> io::Result<Usage> {
        let Some(folder) = &self.folder else {
            return Ok(Usage::default());
        };
        let mut usage = Usage::default();
        for entry in entries(folder)? {
            usage.entries += 1;
            usage.bytes += entry.size;
        }
        Ok(usage)
    }

    /// Removes all entries and returns their number and size. Other files stay.
    ///
    /// # Errors
    /// When the folder exists and cannot be listed, or an entry cannot be removed.
    pub fn clear(&self) -> io::Result<Usage> {
        let mut removed = Usage::default();
        let Some(folder) = &self.folder else {
            return Ok(removed);
        };
        for entry in entries(folder)? {
            match fs::remove_file(&entry.path) {
                Ok(()) => {
                    removed.entries += 1;
                    removed.bytes += entry.size;
                }
                // Another process has removed it.
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                Err(error) => return Err(error),
            }
        }
        Ok(removed)
    }

    fn path(&self, key: &Key) -> Option<PathBuf> {
        let name = format!("{}.{ENTRY}", blake3::Hash::from(*key).to_hex());
        Some(self.folder.as_ref()?.join(name))
    }

    fn write(&self, folder: &Path, key: &Key, bytes: &[u8]) -> io::Result<()> {
        let Some(path) = self.path(key) else {
            return Ok(());
        };
        if !folder.exists() {
            DirBuilder::new()
                .recursive(true)
                .mode(0o700)
                .create(folder)?;
            // The umask may be narrower at this moment.
            fs::set_permissions(folder, Permissions::from_mode(0o700))?;
        }
        let number = self.written.fetch_add(1, Ordering::Relaxed);
        let name = format!("{}-{number}-{self:p}.{UNFINISHED}", std::process::id());
        let unfinished = folder.join(name);
        let mut options = OpenOptions::new();
        options.write(true).create_new(true).mode(0o600);
        let write = || {
            write_entry(&mut options.open(&unfinished)?, key, bytes)?;
            fs::rename(&unfinished, &path)
        };
        if let Err(error) = write() {
            let _ = fs::remove_file(&unfinished);
            return Err(error);
        }
        self.remove_oldest(folder)
    }

    /// Removes the oldest entries beyond the limit, and unfinished ones of killed processes.
    fn remove_oldest(&self, folder: &Path) -> io::Result<()> {
        let mut all = entries(folder)?;
        let now = SystemTime::now();
        all.retain(|entry| {
            let age = now.duration_since(entry.changed).unwrap_or_default();
            let is_left = entry.is_unfinished && age > LEFT_BEHIND;
            if is_left {
                let _ = fs::remove_file(&entry.path);
            }
            !is_left
        });
        let mut size: u64 = all.iter().map(|entry| entry.size).sum();
        all.sort_by_key(|entry| entry.changed);
        for entry in all.iter().filter(|entry| !entry.is_unfinished) {
            if size <= self.limit {
                break;
            }
            match fs::remove_file(&entry.path) {
                // Another process may have removed it.
                Err(error) if error.kind() != io::ErrorKind::NotFound => {}
                _ => size -= entry.size,
            }
        }
        Ok(())
    }
}

fn write_entry(file: &mut File, key: &Key, bytes: &[u8]) -> io::Result<()> {
    file.write_all(&header(key, bytes))?;
    file.write_all(bytes)
}

fn header(key: &Key, bytes: &[u8]) -> [u8; HEADER] {
    let mut header = [0; HEADER];
    header[..8].copy_from_slice(&MAGIC);
    header[8..12].copy_from_slice(&VERSION.to_le_bytes());
    header[12..44].copy_from_slice(key);
    header[44..52].copy_from_slice(&(bytes.len() as u64).to_le_bytes());
    let mut hash = blake3::Hasher::new();
    hash.update(key).update(bytes);
    header[52..].copy_from_slice(hash.finalize().as_bytes());
    header
}

/// The bytes of an entry with this key, if it is valid.
fn read(file: &mut File, key: &Key) -> Option<Vec<u8>> {
    let size = file.metadata().ok()?.len();
    let length = size.checked_sub(HEADER as u64)?;
    if length > MOST {
        return None;
    }
    let mut found = [0; HEADER];
    file.read_exact(&mut found).ok()?;
    let mut bytes = Vec::with_capacity(usize::try_from(length).ok()?);
    file.take(length).read_to_end(&mut bytes).ok()?;
    (found == header(key, &bytes)).then_some(bytes)
}

/// Marks an entry as used, once a day.
fn renew(file: &File) {
    let now = SystemTime::now();
    let changed = file.metadata().and_then(|about| about.modified());
    let age = changed.map(|changed| now.duration_since(changed).unwrap_or_default());
    if age.is_ok_and(|age| age > RENEWED) {
        // In a read-only folder it stays old.
        let _ = file.set_modified(now);
    }
}

/// A file of a store.
struct Entry {
    path: PathBuf,
    size: u64,
    changed: SystemTime,
    is_unfinished: bool,
}

/// The files of a store; none when the folder does not exist. Other files are left out.
fn entries(folder: &Path) -> io::Result<Vec<Entry>> {
    let files = match fs::read_dir(folder) {
        Ok(files) => files,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(error),
    };
    let mut found = Vec::new();
    for file in files {
        let path = file?.path();
        let ending = path.extension().and_then(OsStr::to_str);
        let is_unfinished = match ending {
            Some(ENTRY) => false,
            Some(UNFINISHED) => true,
            _ => continue,
        };
        // Another process may have removed it.
        let Ok(about) = fs::symlink_metadata(&path) else {
            continue;
        };
        if about.is_file() {
            found.push(Entry {
                size: about.len(),
                changed: about.modified().unwrap_or(SystemTime::UNIX_EPOCH),
                path,
                is_unfinished,
            });
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn store(folder: &Path) -> Store {
        Store::at(Some(folder.to_owned()), LIMIT)
    }

    #[test]
    fn stored_bytes_are_returned_only_for_their_key() {
        let folder = tempfile::tempdir().unwrap();
        let store = store(&folder.path().join("new"));
        let [one, two] = [1, 2].map(|n: u8| key("test 1", &[&[n]]));
        assert_eq!(store.get(&one), None);
        store.put(&one, b"bytes").unwrap();
        assert_eq!(store.get(&one).as_deref(), Some(&b"bytes"[..]));
        assert_eq!(store.get(&two), None);
        let usage = store.usage().unwrap();
        assert_eq!(usage.entries, 1);
        assert_eq!(usage.bytes, (HEADER + 5) as u64);
        // Parts of a key do not run into each other.
        let keys = [
            key("a", &[b"b", b"c"]),
            key("a", &[b"bc"]),
            key("ab", &[b"c"]),
        ];
        assert!(keys[0] != keys[1] && keys[1] != keys[2] && keys[0] != keys[2]);
    }

    #[test]
    fn damaged_foreign_or_unfinished_entries_are_removed() {
        let folder = tempfile::tempdir().unwrap();
        let store = store(folder.path());
        let own = key("test 1", &[b"own"]);
        let path = store.path(&own).unwrap();
        let valid = |bytes: &[u8]| [&header(&own, bytes)[..], bytes].concat();
        let good = valid(b"some bytes");
        let changed = |at: usize| {
            let mut bytes = good.clone();
            bytes[at] ^= 1;
            bytes
        };
        let mut old = good.clone();
        old[8..12].copy_from_slice(&(VERSION + 1).to_le_bytes());
        let other = key("test 1", &[b"other"]);
        let foreign = [&header(&other, b"some bytes")[..], b"some bytes"].concat();
        let mut damaged: Vec<Vec<u8>> = (0..good.len()).map(changed).collect();
        damaged.extend([
            old,
            foreign,
            Vec::new(),
            b"text".to_vec(),
            good[..HEADER].to_vec(),
            good[..good.len() - 1].to_vec(),
            [&good[..], b"x"].concat(),
        ]);
        for bytes in damaged {
            fs::write(&path, &bytes).unwrap();
            assert_eq!(store.get(&own), None);
            assert!(!path.exists(), "{bytes:?}");
        }
        fs::write(&path, &good).unwrap();
        assert_eq!(store.get(&own).as_deref(), Some(&b"some bytes"[..]));
    }

    #[test]
    fn the_oldest_entries_are_removed_beyond_the_limit() {
        let folder = tempfile::tempdir().unwrap();
        let size = 1000 + HEADER as u64;
        let store = Store::at(Some(folder.path().to_owned()), 3 * size);
        let keys: Vec<Key> = (0..5u8).map(|n| key("test 1", &[&[n]])).collect();
        let day = Duration::from_secs(24 * 3600);
        let started = SystemTime::now();
        for (n, key) in keys.iter().enumerate() {
            store.put(key, &[7; 1000]).unwrap();
            let file = File::open(store.path(key).unwrap()).unwrap();
            // The second is the newest, the others are in order.
            let age = if n == 1 { 0 } else { 10 - n as u32 };
            file.set_modified(SystemTime::now() - age * day).unwrap();
        }
        let kept: Vec<bool> = keys.iter().map(|key| store.get(key).is_some()).collect();
        assert_eq!(kept, [false, true, false, true, true]);
        assert!(store.usage().unwrap().bytes <= 3 * size);
        // Reading the fourth has renewed it.
        let path = store.path(&keys[3]).unwrap();
        let renewed = fs::metadata(path).unwrap().modified().unwrap();
        assert!(renewed >= started);
        // One that does not fit at all is left out.
        let large = key("test 1", &[b"large"]);
        store.put(&large, &[7; 4000]).unwrap();
        assert_eq!(store.get(&large), None);
        assert!(store.get(&keys[1]).is_some());
    }

    #[test]
    fn clearing_leaves_other_files() {
        let folder = tempfile::tempdir().unwrap();
        let store = store(folder.path());
        store.put(&key("test 1", &[]), b"bytes").unwrap();
        let note = folder.path().join("note.txt");
        fs::write(&note, "mine").unwrap();
        let killed = folder.path().join(format!("1-2-3.{UNFINISHED}"));
        fs::write(&killed, "half").unwrap();
        let link = folder.path().join(format!("link.{ENTRY}"));
        std::os::unix::fs::symlink(&note, &link).unwrap();
        let removed = store.clear().unwrap();
        assert_eq!(removed.entries, 2);
        assert!(note.exists() && !killed.exists());
        assert_eq!(store.usage().unwrap(), Usage::default());
    }

    #[test]
    fn entries_of_killed_processes_are_removed_later() {
        let folder = tempfile::tempdir().unwrap();
        let store = store(folder.path());
        let [old, new] = ["old", "new"].map(|name| {
            let path = folder.path().join(format!("{name}.{UNFINISHED}"));
            fs::write(&path, "half").unwrap();
            path
        });
        let then = SystemTime::now() - 2 * LEFT_BEHIND;
        let file = OpenOptions::new().write(true).open(&old).unwrap();
        file.set_modified(then).unwrap();
        store.put(&key("test 1", &[]), b"bytes").unwrap();
        assert!(!old.exists() && new.exists());
    }

    #[test]
    fn a_folder_that_cannot_be_written_is_reported_once() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        fs::write(&file, "").unwrap();
        let store = store(&file.join("cache"));
        let own = key("test 1", &[]);
        let problem = store.put(&own, b"bytes").unwrap_err();
        assert!(
            problem.contains("cannot write to the cache") && problem.contains(VARIABLE),
            "{problem}"
        );
        assert_eq!(store.put(&own, b"bytes"), Ok(()));
        assert_eq!(store.get(&own), None);
    }

    #[test]
    fn a_full_disk_leaves_no_part_of_an_entry() {
        // The device `full` rejects every write as a full disk does.
        let folder = tempfile::tempdir().unwrap();
        let own = key("test 1", &[]);
        let mut full = OpenOptions::new().write(true).open("/dev/full").unwrap();
        let error = write_entry(&mut full, &own, b"bytes").unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::StorageFull);
        // An entry whose place is a folder cannot be renamed to it.
        let store = store(folder.path());
        fs::create_dir_all(store.path(&own).unwrap().join("x")).unwrap();
        assert!(store.put(&own, b"bytes").is_err());
        let left = fs::read_dir(folder.path()).unwrap().count();
        assert_eq!(left, 1);
    }

    #[test]
    fn processes_may_write_the_same_entry() {
        let folder = tempfile::tempdir().unwrap();
        let own = key("test 1", &[]);
        let bytes = vec![5; 200_000];
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    let store = store(folder.path());
                    for _ in 0..20 {
                        store.put(&own, &bytes).unwrap();
                        assert_eq!(store.get(&own).as_deref(), Some(&bytes[..]));
                    }
                });
            }
        });
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn the_folder_follows_the_environment() {
        let [named, off, caches, home] = ["/d/c", "off", "/x", "/h"].map(OsStr::new);
        let folder = |named, caches, home| {
            folder_from(named, caches, home).map(|path| path.display().to_string())
        };
        assert_eq!(
            folder(Some(named), Some(caches), Some(home)).as_deref(),
            Some("/d/c")
        );
        assert_eq!(folder(Some(off), Some(caches), Some(home)), None);
        assert_eq!(
            folder(None, Some(caches), Some(home)).as_deref(),
            Some("/x/wheelarm")
        );
        assert_eq!(
            folder(None, Some(OsStr::new("relative")), Some(home)).as_deref(),
            Some("/h/.cache/wheelarm")
        );
        assert_eq!(
            folder(None, None, Some(home)).as_deref(),
            Some("/h/.cache/wheelarm")
        );
        assert_eq!(folder(None, None, None), None);
        // A switched-off store neither stores nor fails.
        let store = Store::at(None, LIMIT);
        let own = key("test 1", &[]);
        assert_eq!(store.put(&own, b"bytes"), Ok(()));
        assert_eq!(store.get(&own), None);
        assert_eq!(store.clear().unwrap(), Usage::default());
    }
}
