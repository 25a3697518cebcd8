//! Deflate and byte shuffle as HDF5's built-in filters expect them.
//!
//! At [`LEVEL`] chunks are deflated by ISA-L's igzip on processors for which it
//! has assembly, otherwise by libdeflate. Both write plain deflate: every reader
//! takes either, and no file says which it was.

use libdeflater::{CompressionLvl, Compressor};

/// Level of every chunk: measured as the best trade of speed and size.
pub const LEVEL: u8 = 1;

/// A plane of this many bytes or more is looked at before it is compressed.
const WORTH_A_LOOK: usize = 1 << 18;
/// Pieces of a plane that are looked at, and bytes of each.
const PIECES: usize = 16;
const PIECE: usize = 4096;
/// A plane that shrinks to more than this share is stored as it is.
const HARDLY_SHRINKS: f64 = 0.9;
/// Most bytes of a stored block (RFC 1951, 3.2.4).
const STORED_BLOCK: usize = 65_535;
/// Start of a zlib stream: deflate, 32 KiB window, fastest (RFC 1950, 2.2).
const ZLIB: [u8; 2] = [0x78, 0x01];

/// Compresses chunks; one per thread.
pub struct Deflate {
    coder: Coder,
    shuffled: Vec<u8>,
    /// Pieces that stand for a plane.
    pieces: Vec<u8>,
    /// Room for one stream; kept, because fresh memory of that size costs more
    /// than the copy out of it.
    stream: Vec<u8>,
}

impl Default for Deflate {
    fn default() -> Self {
        Self::at_level(LEVEL)
    }
}

impl Deflate {
    /// Compresses at a level from 1 to 12.
    #[must_use]
    pub fn at_level(level: u8) -> Self {
        Self::with(Coder {
            igzip: level == LEVEL && igzip::suits(),
            // `fastest()` is level 0, which only stores.
            libdeflate: Compressor::new(CompressionLvl::new(i32::from(level)).unwrap_or_default()),
        })
    }

    fn with(coder: Coder) -> Self {
        Self {
            coder,
            shuffled: Vec::new(),
            pieces: Vec::new(),
            stream: Vec::new(),
        }
    }

    /// Appends the zlib stream of `bytes` to `out`; `element` > 1 shuffles the
    /// bytes of elements of that size first. Returns the stream's length.
    ///
    /// The lowest bytes of float32 depth are often noise: a quarter of the work
    /// for a few percent of the size. Such planes at the beginning go into
    /// stored blocks of the same stream, which any reader takes.
    pub fn append(&mut self, bytes: &[u8], element: usize, out: &mut Vec<u8>) -> usize {
        let mut shuffled = std::mem::take(&mut self.shuffled);
        let source = if element > 1 {
            shuffle(bytes, element, &mut shuffled);
            shuffled.as_slice()
        } else {
            bytes
        };
        let begin = out.len();
        let noise = match element {
            0 | 1 => 0,
            _ => self.noise(source, source.len() / element),
        };
        out.extend(ZLIB);
        store(&source[..noise], out);
        out.extend_from_slice(deflated(
            &mut self.coder,
            &source[noise..],
            &mut self.stream,
        ));
        out.extend(libdeflater::adler32(source).to_be_bytes());
        self.shuffled = shuffled;
        out.len() - begin
    }

    /// Bytes of the first planes that hardly shrink.
    fn noise(&mut self, planes: &[u8], plane: usize) -> usize {
        if plane < WORTH_A_LOOK {
            return 0;
        }
        let is_noise = |plane: &&[u8]| {
            self.pieces.clear();
            for from in (0..PIECES).map(|i| i * (plane.len() / PIECES)) {
                self.pieces.extend_from_slice(&plane[from..from + PIECE]);
            }
            let shrunk = deflated(&mut self.coder, &self.pieces, &mut self.stream);
            shrunk.len() as f64 > HARDLY_SHRINKS * self.pieces.len() as f64
        };
        planes.chunks_exact(plane).take_while(is_noise).count() * plane
    }
}

/// What makes a deflate stream.
struct Coder {
    /// Whether igzip does it; what it cannot do, libdeflate does.
    igzip: bool,
    libdeflate: Compressor,
}

/// The deflate stream of `bytes`, in `room`.
fn deflated<'a>(coder: &mut Coder, bytes: &[u8], room: &'a mut Vec<u8>) -> &'a [u8] {
    let bound = coder.libdeflate.deflate_compress_bound(bytes.len());
    if room.len() < bound {
        room.resize(bound, 0);
    }
    let by_igzip = coder.igzip.then(|| igzip::deflate(bytes, room)).flatten();
    // With this much room libdeflate cannot fail; a stream without its deflate
    // part cannot be read, and whoever reads the file is told.
    let length = by_igzip
        .or_else(|| coder.libdeflate.deflate_compress(bytes, room).ok())
        .unwrap_or(0);
    &room[..length]
}

/// The deflate of Intel's ISA-L: on pictures two to four times as fast as
/// libdeflate's level 1, at up to 8 % more bytes (`make bench` measures it).
#[cfg(target_arch = "x86_64")]
mod igzip {
    use isal::{Codec, CompressionLevel};

    /// Whether this processor has what igzip's fast paths need.
    pub fn suits() -> bool {
        std::arch::is_x86_feature_detected!("avx2")
    }

    /// Length of the stream in `room`, or nothing where it cannot be made
    /// (without room, or longer than a number of 32 bits tells).
    pub fn deflate(bytes: &[u8], room: &mut [u8]) -> Option<usize> {
        u32::try_from(bytes.len().max(room.len())).ok()?;
        isal::compress_into(bytes, room, CompressionLevel::One, Codec::Deflate).ok()
    }
}

/// ISA-L is built for x86-64 alone.
#[cfg(not(target_arch = "x86_64"))]
mod igzip {
    pub fn suits() -> bool {
        false
    }

    pub fn deflate(_: &[u8], _: &mut [u8]) -> Option<usize> {
        None
    }
}

/// Appends `bytes` in stored blocks, none of them the last of the stream.
fn store(bytes: &[u8], out: &mut Vec<u8>) {
    for block in bytes.chunks(STORED_BLOCK) {
        let length = (block.len() as u16).to_le_bytes();
        out.push(0);
        out.extend(length);
        out.extend(length.map(|b| !b));
        out.extend_from_slice(block);
    }
}

/// HDF5's shuffle: first bytes of all elements, then second bytes, and so on.
/// Bytes behind the last whole element stay at the end.
fn shuffle(bytes: &[u8], element: usize, out: &mut Vec<u8>) {
    let count = bytes.len() / element;
    // Every byte is written below, so that what is there may stay.
    out.resize(bytes.len(), 0);
    let whole = count * element;
    match element {
        2 => planes::<2>(&bytes[..whole], &mut out[..whole]),
        4 => planes::<4>(&bytes[..whole], &mut out[..whole]),
        8 => planes::<8>(&bytes[..whole], &mut out[..whole]),
        n => {
            for (i, chunk) in bytes[..whole].chunks_exact(n).enumerate() {
                for (k, &b) in chunk.iter().enumerate() {
                    out[k * count + i] = b;
                }
            }
        }
    }
    out[whole..].copy_from_slice(&bytes[whole..]);
}

fn planes<const N: usize>(bytes: &[u8], out: &mut [u8]) {
    let count = bytes.len() / N;
    if count == 0 {
        return;
    }
    let mut planes: Vec<&mut [u8]> = out.chunks_exact_mut(count).collect();
    for (k, plane) in planes.iter_mut().enumerate() {
        for (to, from) in plane.iter_mut().zip(bytes.chunks_exact(N)) {
            *to = from[k];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn inflated(stream: &[u8], length: usize) -> Vec<u8> {
        let mut out = vec![0; length];
        let got = libdeflater::Decompressor::new().zlib_decompress(stream, &mut out);
        assert_eq!(got, Ok(length));
        out
    }

    /// One of each that this processor can run.
    fn each() -> Vec<Deflate> {
        let libdeflate = || Compressor::new(CompressionLvl::new(i32::from(LEVEL)).unwrap());
        [false, true]
            .into_iter()
            .filter(|&igzip| !igzip || igzip::suits())
            .map(|igzip| {
                Deflate::with(Coder {
                    igzip,
                    libdeflate: libdeflate(),
                })
            })
            .collect()
    }

    /// Numbers without a pattern.
    fn noise() -> impl Iterator<Item = u32> {
        let mut state = 1_u32;
        std::iter::repeat_with(move || {
            state ^= state << 13;
            state ^= state >> 17;
            state ^= state << 5;
            state
        })
    }

    #[test]
    fn planes_of_noise_are_stored_in_a_stream_that_reads_back() {
        const COUNT: usize = WORTH_A_LOOK + 5;
        for (noisy, stored) in [(0_u32, 0), (0xff, COUNT), (0xffff, 2 * COUNT), (0xff00, 0)] {
            let bytes: Vec<u8> = noise()
                .zip(0_u32..)
                .take(COUNT)
                .flat_map(|(n, i)| (n & noisy | (i >> 4) & !noisy).to_le_bytes())
                .collect();
            let mut shuffled = Vec::new();
            shuffle(&bytes, 4, &mut shuffled);
            for mut deflate in each() {
                let mut out = vec![9; 3];
                let length = deflate.append(&bytes, 4, &mut out);
                assert_eq!(length, out.len() - 3);
                assert_eq!(inflated(&out[3..], bytes.len()), shuffled, "{noisy:#x}");
                assert_eq!(deflate.noise(&shuffled, COUNT), stored, "{noisy:#x}");
                let begins_stored = out[3..6] == [0x78, 1, 0] && out[6..10] == [255, 255, 0, 0];
                assert_eq!(begins_stored, stored > 0, "{noisy:#x}");
                assert!(length > stored && length < bytes.len(), "{noisy:#x}");
            }
        }
    }

    #[test]
    fn noise_of_any_size_of_element_and_a_rest_read_back() {
        for element in [2, 8] {
            let bytes: Vec<u8> = noise()
                .flat_map(u32::to_le_bytes)
                .take(element * WORTH_A_LOOK + 1)
                .collect();
            let mut shuffled = Vec::new();
            shuffle(&bytes, element, &mut shuffled);
            for mut deflate in each() {
                let mut out = Vec::new();
                deflate.append(&bytes, element, &mut out);
                let planes = element * WORTH_A_LOOK;
                assert_eq!(deflate.noise(&shuffled, WORTH_A_LOOK), planes);
                assert_eq!(inflated(&out, bytes.len()), shuffled, "{element}");
            }
        }
    }

    #[test]
    fn bytes_and_small_chunks_are_compressed_as_they_are() {
        let bytes: Vec<u8> = noise().take(1000).flat_map(u32::to_le_bytes).collect();
        for (element, bytes) in [(1, bytes.as_slice()), (4, &bytes), (1, &[])] {
            let mut expected = bytes.to_vec();
            if element > 1 {
                shuffle(bytes, element, &mut expected);
            }
            for mut deflate in each() {
                let mut out = Vec::new();
                deflate.append(bytes, element, &mut out);
                assert_eq!(inflated(&out, bytes.len()), expected);
            }
        }
    }
}
