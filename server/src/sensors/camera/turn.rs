//! Programs of one user open the graphics driver one after the other. Drivers do most of
//! it under a lock of their own, which goes around: of 32 programs that begin together
//! none was ready before 7 s had passed, one after the other they take 0.3 s each.

use std::fs::{File, OpenOptions, TryLockError};
use std::os::unix::fs::{FileExt, OpenOptionsExt};
use std::path::Path;
use std::time::Duration;

use rustix::fs::OFlags;

/// In the folder `XDG_RUNTIME_DIR`; it holds who has the turn.
const FILE: &str = "wheelarm-graphics.lock";
/// Between two looks whether it is our turn.
const PAUSE: Duration = Duration::from_millis(5);
/// Looks at one holder of the turn after which a program opens the driver all the same:
/// 20 s. Who has the turn may hang.
const LOOKS: u32 = 4000;

/// The turn of this program, until it is dropped.
pub(super) struct Turn(Option<File>);

impl Turn {
    /// Waits for it; where there can be none it is everybody's.
    pub(super) fn wait() -> Self {
        let folder = std::env::var_os("XDG_RUNTIME_DIR");
        let folder = folder.filter(|folder| Path::new(folder).is_absolute());
        Self(folder.and_then(|folder| Self::of(&Path::new(&folder).join(FILE), LOOKS)))
    }

    fn of(path: &Path, looks: u32) -> Option<File> {
        let mut options = OpenOptions::new();
        options.read(true).write(true).create(true).truncate(false);
        // In a folder of everybody's it may be anything.
        let careful = OFlags::NOFOLLOW | OFlags::NONBLOCK;
        options.custom_flags(careful.bits() as i32).mode(0o600);
        let file = options.open(path).ok()?;
        let mut patience = Patience::of(looks);
        loop {
            match file.try_lock() {
                Ok(()) => {
                    // Where it cannot be told, others wait no longer than for one holder.
                    let _ = file.write_at(&std::process::id().to_le_bytes(), 0);
                    return Some(file);
                }
                Err(TryLockError::WouldBlock) => {
                    let mut holder = [0; 4];
                    let _ = file.read_at(&mut holder, 0);
                    if !patience.goes_on(holder) {
                        return None;
                    }
                    std::thread::sleep(PAUSE);
                }
                Err(TryLockError::Error(_)) => return None,
            }
        }
    }
}

/// How often it is looked again, anew with each holder.
struct Patience {
    looks: u32,
    left: u32,
    holder: [u8; 4],
}

impl Patience {
    fn of(looks: u32) -> Self {
        Self {
            looks,
            left: looks,
            holder: [0; 4],
        }
    }

    fn goes_on(&mut self, holder: [u8; 4]) -> bool {
        if self.holder != holder {
            self.holder = holder;
            self.left = self.looks;
        }
        self.left = self.left.saturating_sub(1);
        self.left > 0
    }
}

impl Drop for Turn {
    fn drop(&mut self) {
        // Not by being closed alone: a program that is being started has a copy for a
        // moment. What cannot be unlocked is when it is closed.
        if let Some(file) = &self.0 {
            let _ = file.unlock();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_has_it_at_a_time_and_nobody_waits_for_ever() {
        let name = format!("wheelarm_turn_{}", std::process::id());
        let path = std::env::temp_dir().join(name);
        let first = Turn(Turn::of(&path, 1));
        assert!(first.0.is_some());
        assert!(Turn::of(&path, 3).is_none());
        let waiting = std::thread::spawn({
            let path = path.clone();
            move || Turn(Turn::of(&path, LOOKS)).0.is_some()
        });
        drop(first);
        assert!(waiting.join().unwrap());
        // Whoever waited has let it go.
        assert!(Turn::of(&path, 1).is_some());
        std::fs::remove_file(path).unwrap();
    }

    #[test]
    fn whoever_waits_for_many_goes_on_waiting() {
        let mut patience = Patience::of(3);
        let seen = [1, 1, 2, 2, 3, 3, 3, 3].map(|holder| patience.goes_on([holder; 4]));
        assert_eq!(seen, [true, true, true, true, true, true, false, false]);
    }

    #[test]
    fn without_a_folder_it_is_everybodys() {
        assert!(Turn::of(Path::new("/nowhere/at/all"), LOOKS).is_none());
    }
}
