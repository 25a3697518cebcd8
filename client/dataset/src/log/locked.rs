//! Files that are locked while this program has them open.

use std::fs::{File, TryLockError};
use std::io;
use std::ops::{Deref, DerefMut};

/// A locked file. It is unlocked explicitly and not only by closing it: a program that
/// is being started has a copy of it for a moment, and a process that locks it then, this
/// program itself, would be refused.
#[derive(Debug)]
pub struct Locked(File);

impl Locked {
    /// Locks a file; on file systems without locks it is only kept open.
    ///
    /// # Errors
    /// The file, where another program has locked it.
    pub fn lock(file: File) -> Result<Self, File> {
        match file.try_lock() {
            Ok(()) => Ok(Self(file)),
            Err(TryLockError::WouldBlock) => Err(file),
            Err(TryLockError::Error(problem)) => {
                tracing::debug!("a file cannot be locked: {problem}");
                Ok(Self(file))
            }
        }
    }
}

impl Drop for Locked {
    fn drop(&mut self) {
        let unlocked: io::Result<()> = self.0.unlock();
        if let Err(problem) = unlocked {
            tracing::debug!("a file cannot be unlocked: {problem}");
        }
    }
}

impl Deref for Locked {
    type Target = File;

    fn deref(&self) -> &File {
        &self.0
    }
}

impl DerefMut for Locked {
    fn deref_mut(&mut self) -> &mut File {
        &mut self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lock_is_released_although_a_child_process_inherited_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log");
        let locked = Locked::lock(File::create(&path).unwrap()).unwrap();
        assert!(Locked::lock(File::open(&path).unwrap()).is_err());
        let copy = locked.try_clone().unwrap();
        drop(locked);
        assert!(Locked::lock(File::open(&path).unwrap()).is_ok());
        drop(copy);
    }
}
