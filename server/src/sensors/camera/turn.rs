//! Programs of one user open the graphics driver one after the other. Drivers do most of
//! it under a lock of their own, which goes around: of 32 programs that begin together
//! none was ready before 7 s had passed, one after the other they take 0.3 s each.

use std::fs::{File, OpenOptions, TryLockError};
use std::os::unix::fs::{FileExt, OpenOptionsExt};
use std::path::Path;
use std::time::Duration;

use rustix::fs::OFlags;

/// In the folder `XDG_RUNTIME_DIR`; it holds the number of the turn.
const FILE: &str = "wheelarm-graphics.lock";
/// Between two looks whether it is our turn.
const PAUSE: Duration = Duration::from_millis(5);
/// Looks at one turn after which a program opens the driver all the same: 20 s. Who has
/// it may hang.
const LOOKS: u32 = 4000;
/// Turns of that length that are waited for at most: whoever waits tells nothing.
const MOST: u32 = 3;

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
                    let next = number(&file).wrapping_add(1);
                    // Where it cannot be told, others wait no longer than for one turn.
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

/// How often it is looked again, anew with each turn.
struct Patience {
    looks: u32,
    left: u32,
    in_all: u32,
    turn: u32,
}

impl Patience {
    fn of(looks: u32) -> Self {
        Self {
            looks,
            left: looks,
            in_all: looks.saturating_mul(MOST),
            turn: 0,
        }
    }

    fn goes_on(&mut self, turn: u32) -> bool {
        if self.turn != turn {
            self.turn = turn;
            self.left = self.looks;
        }
        self.left = self.left.saturating_sub(1);
        self.in_all = self.in_all.saturating_sub(1);
        self.left > 0 && self.in_all > 0
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
        assert_eq!(first.0.as_ref().map(number), Some(1));
        assert!(Turn::of(&path, 3).is_none());
        let waiting = std::thread::spawn({
            let path = path.clone();
            move || Turn(Turn::of(&path, LOOKS)).0.is_some()
        });
        drop(first);
        assert!(waiting.join().unwrap());
        // Whoever waited has let it go.
        assert_eq!(Turn::of(&path, 1).as_ref().map(number), Some(3));
        // A link to a file is none of ours.
        let link = path.with_extension("link");
        std::os::unix::fs::symlink(&path, &link).unwrap();
        assert!(Turn::of(&link, 1).is_none());
        std::fs::remove_file(link).unwrap();
        std::fs::remove_file(path).unwrap();
    }

    #[test]
    fn whoever_waits_for_many_goes_on_waiting() {
        let mut patience = Patience::of(3);
        let seen = [1, 1, 2, 2, 3, 3, 3].map(|turn| patience.goes_on(turn));
        assert_eq!(seen, [true, true, true, true, true, true, false]);
        // But not for ever.
        let mut patience = Patience::of(3);
        assert_eq!((1..).take_while(|turn| patience.goes_on(*turn)).count(), 8);
    }

    #[test]
    fn without_a_folder_it_is_everybodys() {
        assert!(Turn::of(Path::new("/nowhere/at/all"), LOOKS).is_none());
    }
}
