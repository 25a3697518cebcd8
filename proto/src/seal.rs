//! Seals of commands: a commander with a sealed lease proves with every command that it
//! knows the lease's secret, without sending it. Names and run IDs are public; the
//! secret is not.

use hmac::{Hmac, Mac};
use sha2::Sha256;

/// Length of the HMAC-SHA256, bytes.
const LENGTH: usize = 32;

/// Tag and length before the seal in an encoded command: field 20, length-delimited.
const START: [u8; 3] = [0xa2, 0x01, LENGTH as u8];

fn code(command: &[u8], secret: &str) -> Option<Hmac<Sha256>> {
    // HMAC accepts a key of any length, so this never fails.
    let mut code = Hmac::<Sha256>::new_from_slice(secret.as_bytes()).ok()?;
    code.update(command);
    Some(code)
}

/// Appends the field `seal` to an encoded `wheelarm.v1.Command` without one.
pub fn append(command: &mut Vec<u8>, secret: &str) {
    if let Some(code) = code(command, secret) {
        let seal = code.finalize().into_bytes();
        command.extend_from_slice(&START);
        command.extend_from_slice(&seal);
    }
}

/// Whether an encoded command ends with the seal for `secret`.
#[must_use]
pub fn is_sealed(command: &[u8], secret: &str) -> bool {
    let Some(at) = command.len().checked_sub(START.len() + LENGTH) else {
        return false;
    };
    let (sealed, end) = command.split_at(at);
    let (start, seal) = end.split_at(START.len());
    // The comparison takes constant time.
    start == START && code(sealed, secret).is_some_and(|code| code.verify_slice(seal).is_ok())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Message, v1};

    #[test]
    fn a_seal_is_the_last_field_of_its_command_and_proves_the_secret() {
        let command = v1::Command {
            commander: "anna".into(),
            phase_name: "lifting".into(),
            ..v1::Command::default()
        };
        let mut bytes = command.encode_to_vec();
        assert!(!is_sealed(&bytes, "secret"), "no seal");
        append(&mut bytes, "secret");
        assert!(is_sealed(&bytes, "secret"));
        assert!(!is_sealed(&bytes, "other"));
        let read = v1::Command::decode(bytes.as_slice()).unwrap();
        assert_eq!(read.seal, bytes[bytes.len() - LENGTH..]);
        // A decoded command is encoded identically.
        assert_eq!(read.encode_to_vec(), bytes);
        for at in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[at] ^= 1;
            assert!(
                !is_sealed(&damaged, "secret"),
                "a change of byte {at} was not detected"
            );
        }
        bytes.push(0);
        assert!(!is_sealed(&bytes, "secret"), "a byte was appended");
        assert!(!is_sealed(&[], "secret"));
    }

    #[test]
    fn the_code_is_the_one_of_rfc_4231() {
        let mut text = b"what do ya want for nothing?".to_vec();
        append(&mut text, "Jefe");
        let seal: String = text[text.len() - LENGTH..]
            .iter()
            .map(|byte| format!("{byte:02x}"))
            .collect();
        let known = "5bdcc146bf60754e6a042426089575c75a003f089d2739839dec58b964ec3843";
        assert_eq!(seal, known);
    }
}
