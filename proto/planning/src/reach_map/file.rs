//! The file of a reach map, `reach.bin`: little endian, of one size.
//!
//! | bytes | content |
//! |---|---|
//! | 8 | `WHLREACH` |
//! | 4 | version, 1 |
//! | 28 | number of distances, heights, pitches, directions, each `u32`; bytes of the table `u32`; 8 zeros |
//! | 48 | first value and step of distances, heights and pitches, `f64` |
//! | 56 | chair_from_base: x, y, z, quaternion x, y, z, w, `f64` |
//! | 32 | digest of URDF and tool length |
//! | … | the table, one bit per entry |
//! | 32 | BLAKE3 of all that is before |

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use wheelarm_proto::digest::of_message;

use super::{DIRECTIONS, DISTANCES, HEIGHTS, PITCHES, ReachMap, TABLE_BYTES};

const MAGIC: &[u8; 8] = b"WHLREACH";
const VERSION: u32 = 1;
/// Bytes before the pose of the base.
const HEAD: usize = 8 + 4 + 28 + 48;
/// Numbers of the pose.
const POSE: usize = 7;
const DIGEST: usize = 32;

/// Size of `reach.bin`, bytes.
pub const FILE_BYTES: usize = HEAD + POSE * 8 + DIGEST + TABLE_BYTES + DIGEST;

/// Furthest mount of an arm from the chair's origin, metres.
const FURTHEST_MOUNT: f64 = 10.0;

/// Why bytes are not a reach map.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ReachMapError {
    /// Another size.
    Size(usize),
    /// Not a reach map, or of another version or other axes.
    Layout,
    /// Bytes have changed.
    Damaged,
    /// The pose of the arm's base is not a pose.
    Mount,
}

impl std::fmt::Display for ReachMapError {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        const FIX: &str = "; `cargo run --release -p wheelarm-tests --example reach_map` writes it";
        match self {
            Self::Size(bytes) => write!(
                out,
                "the reach map has {bytes} bytes, expected {FILE_BYTES}{FIX}"
            ),
            Self::Layout => write!(
                out,
                "the reach map is of another version than {VERSION}{FIX}"
            ),
            Self::Damaged => write!(out, "the reach map is damaged: its checksum differs{FIX}"),
            Self::Mount => write!(
                out,
                "the reach map has an arm's base that is not a pose within {FURTHEST_MOUNT} m{FIX}"
            ),
        }
    }
}

impl std::error::Error for ReachMapError {}

/// Everything up to the pose: the same in every file of this version.
fn head() -> Vec<u8> {
    let mut head = MAGIC.to_vec();
    head.extend(VERSION.to_le_bytes());
    let counts = [
        DISTANCES.2,
        HEIGHTS.2,
        PITCHES.2,
        DIRECTIONS,
        TABLE_BYTES,
        0,
        0,
    ];
    for count in counts {
        head.extend((count as u32).to_le_bytes());
    }
    for (first, step, _) in [DISTANCES, HEIGHTS, PITCHES] {
        head.extend(first.to_le_bytes());
        head.extend(step.to_le_bytes());
    }
    head
}

impl ReachMap {
    /// The content of `reach.bin`.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = head();
        let (at, turn) = (&self.mount.translation, &self.mount.rotation);
        for number in [at.x, at.y, at.z, turn.i, turn.j, turn.k, turn.w] {
            bytes.extend(number.to_le_bytes());
        }
        bytes.extend(self.source);
        bytes.extend(&self.table);
        let digest = of_message([&bytes[..]]);
        bytes.extend(digest);
        bytes
    }

    /// Reads the content of `reach.bin`.
    ///
    /// # Errors
    /// [`ReachMapError`] when the bytes are not a map of this version, or have changed.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, ReachMapError> {
        if bytes.len() != FILE_BYTES {
            return Err(ReachMapError::Size(bytes.len()));
        }
        let (content, digest) = bytes.split_at(FILE_BYTES - DIGEST);
        if content[..HEAD] != head()[..] {
            return Err(ReachMapError::Layout);
        }
        if digest != of_message([content]) {
            return Err(ReachMapError::Damaged);
        }
        let (pose, rest) = content[HEAD..].split_at(POSE * 8);
        let mut numbers = [0.0; POSE];
        for (number, bytes) in numbers.iter_mut().zip(pose.as_chunks::<8>().0) {
            *number = f64::from_le_bytes(*bytes);
        }
        let [x, y, z, i, j, k, w] = numbers;
        let rotation = Quaternion::new(w, i, j, k);
        let is_near = [x, y, z].iter().all(|v| v.abs() <= FURTHEST_MOUNT);
        let is_rotation = (rotation.norm() - 1.0).abs() < 1e-6;
        if !is_near || !is_rotation {
            return Err(ReachMapError::Mount);
        }
        let (source, table) = rest.split_at(DIGEST);
        let mut map = Self {
            mount: Isometry3::from_parts(
                Translation3::new(x, y, z),
                UnitQuaternion::new_unchecked(rotation),
            ),
            source: [0; DIGEST],
            table: table.to_vec(),
        };
        map.source.copy_from_slice(source);
        Ok(map)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn map() -> ReachMap {
        ReachMap {
            mount: Isometry3::new(Vector3::new(0.42, 0.36, 0.55), Vector3::z()),
            source: [3; 32],
            table: (0..TABLE_BYTES).map(|i| (i * 7) as u8).collect(),
        }
    }

    #[test]
    fn a_written_map_is_read_back() {
        let bytes = map().to_bytes();
        assert_eq!(bytes.len(), FILE_BYTES);
        assert!((70_000..100_000).contains(&FILE_BYTES));
        assert_eq!(ReachMap::from_bytes(&bytes), Ok(map()));
    }

    #[test]
    fn changed_and_cut_files_are_rejected() {
        let bytes = map().to_bytes();
        assert_eq!(
            ReachMap::from_bytes(&bytes[..100]),
            Err(ReachMapError::Size(100))
        );
        for at in (0..FILE_BYTES).step_by(97) {
            let mut changed = bytes.clone();
            changed[at] ^= 0x10;
            let expected = match at < HEAD {
                true => ReachMapError::Layout,
                false => ReachMapError::Damaged,
            };
            assert_eq!(ReachMap::from_bytes(&changed), Err(expected), "byte {at}");
        }
    }

    #[test]
    fn a_mount_that_is_not_a_pose_is_rejected() {
        for (number, value) in [(0, f64::NAN), (1, 11.0), (3, 0.5), (6, f64::INFINITY)] {
            let mut bytes = map().to_bytes();
            let at = HEAD + number * 8;
            bytes[at..at + 8].copy_from_slice(&f64::to_le_bytes(value));
            let end = FILE_BYTES - DIGEST;
            let digest = of_message([&bytes[..end]]);
            bytes[end..].copy_from_slice(&digest);
            assert_eq!(ReachMap::from_bytes(&bytes), Err(ReachMapError::Mount));
        }
    }
}
