//! Reading lists and texts of variable length in bounded memory.

use hdf5::types::VarLenUnicode;
use hdf5::{Dataset, H5Type};

use super::Blob;

/// Memory for the lists of one block, bytes, where no list is longer than this by
/// [`FEWEST`].
const BLOCK: u64 = 256 << 20;
/// Fewest rows of a block.
const FEWEST: u64 = 64;

/// A list or a text, as HDF5 hands it out.
pub(crate) trait List: H5Type {
    /// Bytes of its elements.
    fn bytes(&self) -> u64;
}

impl List for Blob {
    fn bytes(&self) -> u64 {
        self.len() as u64
    }
}

impl List for VarLenUnicode {
    fn bytes(&self) -> u64 {
        self.len() as u64
    }
}

/// Reads a one-dimensional dataset of lists from a file of `length` bytes. Many rows can
/// refer to the same stored list, so it is read in blocks, and rejected where its lists
/// need more memory than the file has bytes. A single list is stored unchanged.
///
/// # Errors
/// Those of HDF5, and where the lists are too long.
pub(crate) fn read_lists<T: List>(data: &Dataset, length: u64) -> hdf5::Result<Vec<T>> {
    let &[rows] = data.shape().as_slice() else {
        return Err(hdf5::Error::Internal(format!(
            "the file is damaged: lists of {} dimensions, expected 1",
            data.ndim()
        )));
    };
    let block = usize::try_from(FEWEST.max(BLOCK / length.max(1))).unwrap_or(usize::MAX);
    let mut lists = Vec::with_capacity(rows);
    let mut bytes = 0;
    while lists.len() < rows {
        let end = rows.min(lists.len().saturating_add(block));
        let read = data.read_slice_1d::<T, _>(lists.len()..end)?;
        bytes += read.iter().map(List::bytes).sum::<u64>();
        if bytes > length {
            return Err(hdf5::Error::Internal(format!(
                "its lists need more than {length} bytes, which is what the file has: the file was \
                 changed or is damaged; leave it out, or copy it again from where it was recorded"
            )));
        }
        lists.extend(read);
    }
    Ok(lists)
}
