//! Passwords: Argon2id with the crate's usual cost (19 MiB, two passes).

use argon2::password_hash::rand_core::OsRng;
use argon2::password_hash::{Output, PasswordHash, PasswordHasher, SaltString};
use argon2::{Algorithm, Argon2, Block, Params, Version};

use std::sync::{Mutex, PoisonError};

use super::AccessError;

/// Characters that a password has: as NIST SP 800-63B asks at least, and a bound
/// on what anybody can make us hash.
const LEAST: usize = 8;
const MOST: usize = 256;

/// Most memory that a stored hash may ask for, KiB: a quarter of a gibibyte.
const MOST_MEMORY: u32 = 256 << 10;
/// Most passes that a stored hash may ask for.
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
        .map_err(AccessError::crypto("hashing a password"))
}

/// Why a stored text is no hash that is taken.
pub fn check(stored: &str) -> Result<(), String> {
    let hash = PasswordHash::new(stored).map_err(|e| format!("it is no hash ({e})"))?;
    if hash.algorithm != Algorithm::Argon2id.ident() {
        return Err(format!("it is {}, and argon2id is taken", hash.algorithm));
    }
    let params = Params::try_from(&hash).map_err(|e| format!("its cost is none ({e})"))?;
    if params.m_cost() > MOST_MEMORY || params.t_cost() > MOST_PASSES {
        return Err(format!(
            "it costs {} KiB and {} passes, at most {MOST_MEMORY} and {MOST_PASSES} are taken",
            params.m_cost(),
            params.t_cost()
        ));
    }
    if hash.hash.is_none() {
        return Err("it holds a salt and no hash".to_owned());
    }
    Ok(())
}

/// Whether a password is the one of a stored hash. Takes as long without one, so
/// that nobody learns by time who is a user.
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
            // Whatever comes of it, there is no such password.
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
    // The comparison takes the same time for every content.
    Some(Output::new(out).ok()? == expected)
}

/// Hashes one password at a time in memory that is kept: the blocks of many threads that
/// each hash on their own stay with the allocator (2.4 GB after 4,900 wrong passwords).
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
