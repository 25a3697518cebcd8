//! Passwords: Argon2id with the crate's default cost (19 MiB, two passes).

use argon2::password_hash::rand_core::OsRng;
use argon2::password_hash::{Output, PasswordHash, PasswordHasher, SaltString};
use argon2::{Algorithm, Argon2, Block, Params, Version};

use std::sync::{Mutex, PoisonError};

use super::AccessError;

/// Length of a password, characters: the minimum of NIST SP 800-63B, and a limit on the
/// work of hashing.
const LEAST: usize = 8;
const MOST: usize = 256;

/// Largest memory cost of a stored hash, KiB: a quarter of a gibibyte.
const MOST_MEMORY: u32 = 256 << 10;
/// Largest number of passes of a stored hash.
const MOST_PASSES: u32 = 16;

fn argon() -> Argon2<'static> {
    Argon2::new(Algorithm::Argon2id, Version::V0x13, Params::default())
}

/// The hash of a new password.
pub fn hash(password: &str) -> Result<String, AccessError> {
    let found = password.chars().count();
    if !(LEAST..=MOST).contains(&found) {
        return Err(AccessError::Password {
            least: LEAST,
            most: MOST,
            found,
        });
    }
    let salt = SaltString::generate(&mut OsRng);
    let hash = argon().hash_password(password.as_bytes(), &salt);
    hash.map(|hash| hash.to_string())
        .map_err(AccessError::crypto("cannot hash a password"))
}

/// Why a stored text is not an accepted hash.
pub fn check(stored: &str) -> Result<(), String> {
    let hash = PasswordHash::new(stored).map_err(|e| format!("it is not a hash ({e})"))?;
    if hash.algorithm != Algorithm::Argon2id.ident() {
        return Err(format!(
            "it is {}, but argon2id is required",
            hash.algorithm
        ));
    }
    let params = Params::try_from(&hash).map_err(|e| format!("its cost is invalid ({e})"))?;
    if params.m_cost() > MOST_MEMORY || params.t_cost() > MOST_PASSES {
        return Err(format!(
            "it costs {} KiB and {} passes, at most {MOST_MEMORY} and {MOST_PASSES} are accepted",
            params.m_cost(),
            params.t_cost()
        ));
    }
    if hash.hash.is_none() {
        return Err("it contains a salt but no hash".to_owned());
    }
    Ok(())
}

/// Whether a password matches a stored hash. Takes as long without one, so that the
/// time does not reveal which users exist.
pub fn verify(password: &str, stored: Option<&str>) -> bool {
    if password.chars().nth(MOST).is_some() {
        return false;
    }
    let parsed = stored.and_then(|stored| PasswordHash::new(stored).ok());
    match parsed {
        Some(hash) => is_of(password, &hash).unwrap_or(false),
        None => {
            let mut out = [0; Params::DEFAULT_OUTPUT_LEN];
            let hashed = hash_into(&argon(), password, &[0; 16], &mut out);
            // The work of a comparison, so that the time does not reveal whether a password is set.
            let _ = std::hint::black_box((hashed, out));
            false
        }
    }
}

fn is_of(password: &str, hash: &PasswordHash<'_>) -> Option<bool> {
    let version = hash.version.map_or(Ok(Version::V0x13), Version::try_from);
    let params = Params::try_from(hash).ok()?;
    let argon = Argon2::new(Algorithm::Argon2id, version.ok()?, params);
    let mut salt = [0; 64];
    let salt = hash.salt?.decode_b64(&mut salt).ok()?;
    let expected = hash.hash?;
    let mut out = [0; Output::MAX_LENGTH];
    let out = &mut out[..expected.len()];
    hash_into(&argon, password, salt, out)?;
    // The comparison takes constant time.
    Some(Output::new(out).ok()? == expected)
}

/// Hashes one password at a time in reused memory: hashing in parallel on many threads
/// leaves their blocks with the allocator (2.4 GB after 4,900 wrong passwords).
fn hash_into(argon: &Argon2<'_>, password: &str, salt: &[u8], out: &mut [u8]) -> Option<()> {
    static BLOCKS: Mutex<Vec<Block>> = Mutex::new(Vec::new());
    let mut blocks = BLOCKS.lock().unwrap_or_else(PoisonError::into_inner);
    let needed = argon.params().block_count();
    if blocks.len() < needed {
        blocks.resize(needed, Block::default());
    }
    let blocks = &mut blocks[..needed];
    argon
        .hash_password_into_with_memory(password.as_bytes(), salt, out, blocks)
        .ok()
}
