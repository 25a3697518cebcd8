//! Pictures as they lie in the file: one compressed chunk each, read beside
//! HDF5 and its one lock, so that several threads read at once.

use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::Path;
use std::sync::Arc;

use hdf5::Dataset;
use hdf5::filters::Filter;
use libdeflater::Decompressor;

/// Where the chunks of a dataset lie, one sample in each.
#[derive(Clone, Debug)]
pub struct ChunkMap {
    file: Arc<File>,
    /// Offset and length in the file, by sample.
    places: Vec<Option<(u64, usize)>>,
    shuffled: bool,
    element: usize,
    bytes: usize,
}

impl ChunkMap {
    /// The chunks of `data`; `None` when it is laid out otherwise (more
    /// samples in a chunk, other filters), and must be read through HDF5.
    pub fn new(path: &Path, data: &Dataset) -> Option<Self> {
        let shape = data.shape();
        let chunk = data.chunk()?;
        if chunk.first() != Some(&1) || chunk.get(1..) != shape.get(1..) {
            return None;
        }
        let shuffled = match data.filters().as_slice() {
            [Filter::Deflate(_)] => false,
            [Filter::Shuffle, Filter::Deflate(_)] => true,
            _ => return None,
        };
        let file = File::open(path).ok()?;
        let end = file.metadata().ok()?.len();
        let mut places = vec![None; *shape.first()?];
        for index in 0..data.num_chunks()? {
            let info = data.chunk_info(index)?;
            if info.filter_mask != 0 {
                return None;
            }
            if info.addr.checked_add(info.size).is_none_or(|e| e > end) {
                return None;
            }
            let row = usize::try_from(*info.offset.first()?).ok()?;
            *places.get_mut(row)? = Some((info.addr, usize::try_from(info.size).ok()?));
        }
        let element = data.dtype().ok()?.size();
        Some(Self {
            file: Arc::new(file),
            places,
            shuffled,
            element,
            bytes: element * shape.get(1..)?.iter().product::<usize>(),
        })
    }

    /// Bytes of one uncompressed sample.
    pub fn sample_bytes(&self) -> usize {
        self.bytes
    }

    /// The compressed chunk of a sample.
    pub fn raw(&self, index: usize) -> std::io::Result<Vec<u8>> {
        let missing = || std::io::Error::other(format!("sample {index} has no chunk"));
        let (offset, length) = self
            .places
            .get(index)
            .copied()
            .flatten()
            .ok_or_else(missing)?;
        let mut out = vec![0; length];
        self.file.read_exact_at(&mut out, offset)?;
        Ok(out)
    }

    /// The bytes of a sample, little-endian elements.
    pub fn sample(&self, index: usize) -> std::io::Result<Vec<u8>> {
        let raw = self.raw(index)?;
        let mut out = vec![0; self.bytes];
        let length = Decompressor::new()
            .zlib_decompress(&raw, &mut out)
            .map_err(|e| std::io::Error::other(format!("sample {index}: {e}")))?;
        if length != self.bytes {
            return Err(std::io::Error::other(format!(
                "sample {index} has {length} bytes, expected {}",
                self.bytes
            )));
        }
        Ok(if self.shuffled {
            unshuffle(&out, self.element)
        } else {
            out
        })
    }
}

/// Undoes HDF5's shuffle.
fn unshuffle(bytes: &[u8], element: usize) -> Vec<u8> {
    let mut out = vec![0; bytes.len()];
    match element {
        2 => gather::<2>(bytes, &mut out),
        4 => gather::<4>(bytes, &mut out),
        8 => gather::<8>(bytes, &mut out),
        _ => {
            let count = bytes.len() / element.max(1);
            for (k, plane) in bytes.chunks_exact(count.max(1)).take(element).enumerate() {
                for (to, &from) in out.chunks_exact_mut(element).zip(plane) {
                    to[k] = from;
                }
            }
        }
    }
    out
}

fn gather<const N: usize>(bytes: &[u8], out: &mut [u8]) {
    let count = bytes.len() / N;
    let planes: [&[u8]; N] = std::array::from_fn(|k| &bytes[k * count..(k + 1) * count]);
    for (i, to) in out.as_chunks_mut::<N>().0.iter_mut().enumerate() {
        *to = std::array::from_fn(|k| planes[k][i]);
    }
}
