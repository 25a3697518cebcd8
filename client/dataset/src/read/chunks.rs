//! Images as stored in the file: one compressed chunk each, read beside
//! HDF5 and its one lock, so that several threads read at once.

use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::Path;
use std::sync::Arc;

use hdf5::Dataset;
use hdf5::filters::Filter;

use crate::compress;

/// File offsets of a dataset's chunks, one sample in each.
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
        let element = if self.shuffled { self.element } else { 1 };
        compress::inflate(&raw, element, self.bytes)
            .map_err(|e| std::io::Error::other(format!("sample {index}: {e}")))
    }
}
