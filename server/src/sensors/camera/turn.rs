//! Programs of one host open the graphics driver one after the other. Drivers do most of
//! it under a lock of their own, which goes around: of 32 programs that begin together
//! none was ready before 7 s had passed, one after the other they take 0.3 s each.

use std::fs::{File, OpenOptions, TryLockError};
use std::path::Path;
use std::time::Duration;

/// In the folder `XDG_RUNTIME_DIR`, which belongs to one user.
const FILE: &str = "wheelarm-graphics.lock";
/// Between two looks whether it is our turn.
const PAUSE: Duration = Duration::from_millis(5);
/// Looks after which a program opens the driver all the same: 20 s. Who has the turn
/// may hang.
const LOOKS: u32 = 4000;

/// The turn of this program, until it is dropped.
pub(super) struct Turn(Option<File>);

impl Turn {
    /// Waits for it; where there can be none it is everybody's.
    pub(super) fn wait() -> Self {
        let folder = std::env::var_os("XDG_RUNTIME_DIR");
        Self(folder.and_then(|folder| Self::of(&Path::new(&folder).join(FILE), LOOKS)))
    }

    fn of(path: &Path, looks: u32) -> Option<File> {
        let mut options = OpenOptions::new();
        let file = options.create(true).truncate(false).write(true).open(path);
        let file = file.ok()?;
        for look in 0..looks {
            match file.try_lock() {
                Ok(()) => return Some(file),
                Err(TryLockError::WouldBlock) if look + 1 < looks => std::thread::sleep(PAUSE),
                Err(_) => break,
            }
        }
        None
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
    fn without_a_folder_it_is_everybodys() {
        assert!(Turn::of(Path::new("/nowhere/at/all"), LOOKS).is_none());
    }
}
