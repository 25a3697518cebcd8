//! A lock that serializes opening the graphics driver among the programs of a user.
//! Drivers hold an internal lock for most of that time: of 32 programs started together
//! none was ready before 7 s; one after the other they take 0.3 s each.

use std::fs::{File, OpenOptions, TryLockError};
use std::os::unix::fs::{FileExt, OpenOptionsExt};
use std::path::Path;
use std::time::Duration;

use rustix::fs::OFlags;

/// File in the folder `XDG_RUNTIME_DIR`; it contains the number of the turn.
const FILE: &str = "wheelarm-graphics.lock";
/// Polling interval.
const PAUSE: Duration = Duration::from_millis(5);
/// Polls per turn after which the driver is opened without the lock: 20 s. The holder
/// may hang.
const POLLS: u32 = 4000;
/// Longest wait in units of such turns: a waiting program reports nothing.
const MOST: u32 = 3;

/// The lock, held until it is dropped.
pub(super) struct DriverLock(Option<File>);

impl DriverLock {
    /// Waits for the lock; continues without it when no lock file is possible.
    pub(super) fn acquire() -> Self {
        let folder = std::env::var_os("XDG_RUNTIME_DIR");
        let folder = folder.filter(|folder| Path::new(folder).is_absolute());
        Self(folder.and_then(|folder| Self::lock(&Path::new(&folder).join(FILE), POLLS)))
    }

    fn lock(path: &Path, polls: u32) -> Option<File> {
        let mut options = OpenOptions::new();
        options.read(true).write(true).create(true).truncate(false);
        // In a shared folder the path may be anything.
        let careful = OFlags::NOFOLLOW | OFlags::NONBLOCK;
        options.custom_flags(careful.bits() as i32).mode(0o600);
        let file = options.open(path).ok()?;
        let mut patience = Patience::new(polls);
        loop {
            match file.try_lock() {
                Ok(()) => {
                    let next = number(&file).wrapping_add(1);
                    // Without the number, others wait for one turn at most.
                    let _ = file.write_at(&next.to_le_bytes(), 0);
                    return Some(file);
                }
                Err(TryLockError::WouldBlock) => {
                    if !patience.goes_on(number(&file)) {
                        return None;
                    }
                    std::thread::sleep(PAUSE);
                }
                Err(TryLockError::Error(_)) => return None,
            }
        }
    }
}

/// The number of the turn; 0 before the first.
fn number(file: &File) -> u32 {
    let mut bytes = [0; 4];
    match file.read_exact_at(&mut bytes, 0) {
        Ok(()) => u32::from_le_bytes(bytes),
        Err(_) => 0,
    }
}

/// Counts polls, restarted with each turn.
struct Patience {
    polls: u32,
    left: u32,
    in_all: u32,
    turn: u32,
}

impl Patience {
    fn new(polls: u32) -> Self {
        Self {
            polls,
            left: polls,
            in_all: polls.saturating_mul(MOST),
            turn: 0,
        }
    }

    fn goes_on(&mut self, turn: u32) -> bool {
        if self.turn != turn {
            self.turn = turn;
            self.left = self.polls;
        }
        self.left = self.left.saturating_sub(1);
        self.in_all = self.in_all.saturating_sub(1);
        self.left > 0 && self.in_all > 0
    }
}

impl Drop for DriverLock {
    fn drop(&mut self) {
        // Closing is not enough: a child process that is being started has a copy for a
        // moment. An error here means that closing must unlock it.
        if let Some(file) = &self.0 {
            let _ = file.unlock();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_program_holds_the_lock_and_waiting_is_bounded() {
        let name = format!("wheelarm_turn_{}", std::process::id());
        let path = std::env::temp_dir().join(name);
        let first = DriverLock(DriverLock::lock(&path, 1));
        assert_eq!(first.0.as_ref().map(number), Some(1));
        assert!(DriverLock::lock(&path, 3).is_none());
        let waiting = std::thread::spawn({
            let path = path.clone();
            move || DriverLock(DriverLock::lock(&path, POLLS)).0.is_some()
        });
        drop(first);
        assert!(waiting.join().unwrap());
        // The waiting thread has released the lock.
        assert_eq!(DriverLock::lock(&path, 1).as_ref().map(number), Some(3));
        // A symbolic link is rejected.
        let link = path.with_extension("link");
        std::os::unix::fs::symlink(&path, &link).unwrap();
        assert!(DriverLock::lock(&link, 1).is_none());
        std::fs::remove_file(link).unwrap();
        std::fs::remove_file(path).unwrap();
    }

    #[test]
    fn each_new_turn_restarts_the_wait() {
        let mut patience = Patience::new(3);
        let waits = [1, 1, 2, 2, 3, 3, 3].map(|turn| patience.goes_on(turn));
        assert_eq!(waits, [true, true, true, true, true, true, false]);
        // The total wait is bounded.
        let mut patience = Patience::new(3);
        assert_eq!((1..).take_while(|turn| patience.goes_on(*turn)).count(), 8);
    }

    #[test]
    fn without_a_folder_there_is_no_lock() {
        assert!(DriverLock::lock(Path::new("/nowhere/at/all"), POLLS).is_none());
    }
}
