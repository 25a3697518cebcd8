//! Deflate and byte shuffle as in HDF5's built-in filters, and their inverse; depth in
//! the form of recordings.
//!
//! At [`LEVEL`] chunks are deflated by ISA-L's igzip on CPUs for which it has assembly,
//! otherwise by libdeflate. Both write standard deflate, which every reader accepts;
//! files do not record which was used.

#![warn(missing_docs)]

pub mod depth;
pub mod huffman;
mod igzip;
mod noise;
mod shuffle;

use libdeflater::{CompressionLvl, Compressor, Decompressor};

use igzip::Igzip;
use noise::Run;
use shuffle::{shuffle, unshuffle};

/// Level of every chunk: measured as the best tradeoff between speed and size.
pub const LEVEL: u8 = 1;

/// Largest number of bytes of a stored block (RFC 1951, 3.2.4).
const STORED_BLOCK: usize = 65_535;
/// Start of a zlib stream: deflate, 32 KiB window, fastest (RFC 1950, 2.2).
const ZLIB: [u8; 2] = [0x78, 0x01];

/// Compresses chunks; one per thread.
pub struct Deflate {
    coder: Coder,
    shuffled: Vec<u8>,
    runs: Vec<Run>,
    /// Buffer for one stream; reused, because fresh memory of that size costs more than
    /// the copy.
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
        let igzip = match level {
            LEVEL => Igzip::if_supported(),
            _ => None,
        };
        Self::with_coder(igzip.map_or_else(|| Coder::libdeflate(level), Coder::Igzip))
    }

    fn with_coder(coder: Coder) -> Self {
        Self {
            coder,
            shuffled: Vec::new(),
            runs: Vec::new(),
            stream: Vec::new(),
        }
    }

    /// Appends the zlib stream of `bytes` to `out`; `element` > 1 shuffles the bytes of
    /// elements of that size first. Returns the stream's length.
    ///
    /// Incompressible data is put into stored blocks of the same stream, which any
    /// reader accepts.
    pub fn append(&mut self, bytes: &[u8], element: usize, out: &mut Vec<u8>) -> usize {
        let source = if element > 1 {
            shuffle(bytes, element, &mut self.shuffled);
            self.shuffled.as_slice()
        } else {
            bytes
        };
        let plane = match element {
            0 | 1 => 0,
            _ => source.len() / element,
        };
        noise::runs(source, plane, &mut self.runs);
        self.coder.join(&mut self.runs);
        let begin = out.len();
        out.extend(ZLIB);
        for (i, run) in self.runs.iter().enumerate() {
            let (bytes, last) = (&source[run.bytes.clone()], i + 1 == self.runs.len());
            let deflated = match run.noise {
                true => None,
                false => self.coder.deflate(bytes, last, &mut self.stream),
            };
            match deflated {
                Some(deflated) => out.extend_from_slice(deflated),
                None => store(bytes, last, out),
            }
        }
        out.extend(libdeflater::adler32(source).to_be_bytes());
        out.len() - begin
    }
}

/// An invalid stream.
#[derive(Debug, thiserror::Error)]
pub enum InflateError {
    /// It cannot be inflated, or is too long.
    #[error("{0}")]
    Stream(#[from] libdeflater::DecompressionError),
    /// It is too short.
    #[error("it has {got} bytes, expected {expected}")]
    Length {
        /// Bytes in the stream.
        got: usize,
        /// Expected bytes.
        expected: usize,
    },
}

/// Inflates the zlib stream `stream` to `length` bytes and reverses the shuffle of
/// elements of `element` bytes (1: none).
///
/// # Errors
/// [`InflateError`].
pub fn inflate(stream: &[u8], element: usize, length: usize) -> Result<Vec<u8>, InflateError> {
    let mut out = vec![0; length];
    let got = Decompressor::new().zlib_decompress(stream, &mut out)?;
    match got {
        _ if got != length => Err(InflateError::Length {
            got,
            expected: length,
        }),
        _ if element > 1 => Ok(unshuffle(&out, element)),
        _ => Ok(out),
    }
}

/// A deflate encoder.
enum Coder {
    Igzip(Igzip),
    Libdeflate(Compressor),
}

impl Coder {
    fn libdeflate(level: u8) -> Self {
        // `fastest()` is level 0, which only stores.
        let level = CompressionLvl::new(i32::from(level)).unwrap_or_default();
        Self::Libdeflate(Compressor::new(level))
    }

    /// Merges runs that this encoder cannot split: libdeflate ends a stream with every
    /// call, so only noise at the beginning is stored.
    fn join(&self, runs: &mut Vec<Run>) {
        if let Self::Libdeflate(_) = self
            && let (Some(at), Some(end)) = (
                runs.iter().position(|run| !run.noise),
                runs.last().map(|run| run.bytes.end),
            )
        {
            runs.truncate(at + 1);
            runs[at].bytes.end = end;
        }
    }

    /// The deflate stream of `bytes` in `room`, ended if they are the `last`; `None`
    /// when it fails.
    fn deflate<'a>(&mut self, bytes: &[u8], last: bool, room: &'a mut Vec<u8>) -> Option<&'a [u8]> {
        // Stored blocks, and the bytes that end a stream at a whole byte.
        let bound = bytes.len() + 6 * (bytes.len() / STORED_BLOCK + 1) + 1024;
        let length = match self {
            Self::Igzip(igzip) => {
                if room.len() < bound {
                    room.resize(bound, 0);
                }
                igzip.deflate(bytes, last, room)
            }
            Self::Libdeflate(compressor) => {
                let bound = compressor.deflate_compress_bound(bytes.len());
                if room.len() < bound {
                    room.resize(bound, 0);
                }
                match last {
                    true => compressor.deflate_compress(bytes, room).ok(),
                    false => None,
                }
            }
        };
        length.map(|length| &room[..length])
    }
}

/// Appends `bytes` in stored blocks; the last one ends the stream if requested.
fn store(bytes: &[u8], last: bool, out: &mut Vec<u8>) {
    let mut rest = bytes;
    loop {
        let (block, more) = rest.split_at(rest.len().min(STORED_BLOCK));
        let length = (block.len() as u16).to_le_bytes();
        out.push(u8::from(last && more.is_empty()));
        out.extend(length);
        out.extend(length.map(|b| !b));
        out.extend_from_slice(block);
        if more.is_empty() {
            return;
        }
        rest = more;
    }
}

#[cfg(test)]
mod tests {
    use super::noise::WORTH_A_LOOK;
    use super::*;

    fn inflated(stream: &[u8], length: usize) -> Vec<u8> {
        let mut out = vec![0; length];
        let got = libdeflater::Decompressor::new().zlib_decompress(stream, &mut out);
        assert_eq!(got, Ok(length));
        out
    }

    /// One of each encoder that this CPU can run.
    fn each() -> Vec<Deflate> {
        let coders = Igzip::if_supported().map(Coder::Igzip);
        let coders = coders.into_iter().chain([Coder::libdeflate(LEVEL)]);
        coders.map(Deflate::with_coder).collect()
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
    fn planes_of_noise_are_stored_in_a_readable_stream() {
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
                noise::runs(&shuffled, COUNT, &mut deflate.runs);
                let of_noise = deflate.runs.iter().filter(|run| run.noise);
                let of_noise: usize = of_noise.map(|run| run.bytes.len()).sum();
                assert_eq!(of_noise, stored, "{noisy:#x}");
                let begins_stored = out[3..6] == [0x78, 1, 0] && out[6..10] == [255, 255, 0, 0];
                assert_eq!(begins_stored, stored > 0, "{noisy:#x}");
                assert!(length > stored && length < bytes.len(), "{noisy:#x}");
            }
        }
    }

    #[test]
    fn noise_in_the_middle_and_at_the_end_is_stored_if_the_encoder_can_continue() {
        let mut random = noise();
        let mut take = |count: usize| -> Vec<u8> {
            let words = random.by_ref().take(count / 4);
            words.flat_map(u32::to_le_bytes).collect()
        };
        let even = |count: usize| (0..count).map(|i| (i >> 7) as u8).collect::<Vec<u8>>();
        for last_is_noise in [false, true] {
            // Two planes, already shuffled; the second has noise too.
            let mut planes = even(100_000);
            planes.extend(take(200_000));
            planes.extend(even(300_000));
            planes.extend(take(200_000));
            planes.extend(match last_is_noise {
                true => take(400_000),
                false => even(400_000),
            });
            let half = planes.len() / 2;
            let bytes: Vec<u8> = (0..half)
                .flat_map(|i| [planes[i], planes[half + i]])
                .collect();
            let mut lengths = Vec::new();
            for mut deflate in each() {
                let mut out = Vec::new();
                lengths.push(deflate.append(&bytes, 2, &mut out));
                assert!(inflated(&out, bytes.len()) == planes);
            }
            let of_noise = if last_is_noise { 800_000 } else { 400_000 };
            for length in lengths {
                assert!(length < of_noise + 50_000, "{length}");
            }
        }
    }

    #[test]
    fn noise_with_any_element_size_and_a_remainder_is_readable() {
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
                noise::runs(&shuffled, WORTH_A_LOOK, &mut deflate.runs);
                let run = |bytes, noise| Run { bytes, noise };
                let expected = [run(0..planes, true), run(planes..planes + 1, false)];
                assert_eq!(deflate.runs, expected);
                assert_eq!(inflated(&out, bytes.len()), shuffled, "{element}");
            }
        }
    }

    #[test]
    fn bytes_and_small_chunks_are_compressed_without_splitting() {
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
                let back = inflate(&out, element, bytes.len());
                assert!(back.is_ok_and(|back| back == bytes));
                assert!(inflate(&out, element, bytes.len() + 1).is_err());
                assert!(inflate(&out[..out.len() - 1], element, bytes.len()).is_err());
            }
        }
    }
}
