//! Deflate and byte shuffle as HDF5's built-in filters expect them.

use libdeflater::{CompressionLvl, Compressor};

/// Level of every chunk: measured as the best trade of speed and size.
pub const LEVEL: u8 = 1;

/// Compresses chunks; one per thread.
pub struct Deflate {
    deflate: Compressor,
    shuffled: Vec<u8>,
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
        Self {
            // `fastest()` is level 0, which only stores.
            deflate: Compressor::new(CompressionLvl::new(i32::from(level)).unwrap_or_default()),
            shuffled: Vec::new(),
            stream: Vec::new(),
        }
    }

    /// Appends the zlib stream of `bytes` to `out`; `element` > 1 shuffles the
    /// bytes of elements of that size first. Returns the stream's length.
    pub fn append(&mut self, bytes: &[u8], element: usize, out: &mut Vec<u8>) -> usize {
        let source = if element > 1 {
            shuffle(bytes, element, &mut self.shuffled);
            self.shuffled.as_slice()
        } else {
            bytes
        };
        let bound = self.deflate.zlib_compress_bound(source.len());
        if self.stream.len() < bound {
            self.stream.resize(bound, 0);
        }
        // With this much room it cannot fail; an empty stream would be no
        // picture, and whoever reads the file would be told.
        let length = self
            .deflate
            .zlib_compress(source, &mut self.stream)
            .unwrap_or(0);
        out.extend_from_slice(&self.stream[..length]);
        length
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
