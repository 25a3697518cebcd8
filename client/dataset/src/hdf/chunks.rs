//! Datasets whose chunks were compressed by us and are written as they are.

use hdf5::{Dataset, Extent, Group, H5Type, SimpleExtents};

use crate::compress;

/// An extensible dataset, one chunk of `rows` samples at a time.
pub struct Chunked {
    data: Dataset,
    rows: usize,
    trailing: usize,
}

/// Which built-in filters a dataset has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Filters {
    Deflate,
    ShuffleDeflate,
}

impl Chunked {
    /// Creates a dataset of `count` samples of `shape`, `rows` in a chunk.
    ///
    /// # Errors
    /// Those of HDF5.
    pub fn create<T: H5Type>(
        group: &Group,
        name: &str,
        count: usize,
        shape: &[usize],
        rows: usize,
        filters: Filters,
    ) -> hdf5::Result<Self> {
        Self::create_at_level::<T>(group, name, count, shape, rows, (filters, compress::LEVEL))
    }

    /// The same with the level that the file shall name.
    ///
    /// # Errors
    /// Those of HDF5.
    pub fn create_at_level<T: H5Type>(
        group: &Group,
        name: &str,
        count: usize,
        shape: &[usize],
        rows: usize,
        (filters, level): (Filters, u8),
    ) -> hdf5::Result<Self> {
        let extents = std::iter::once(Extent::resizable(count))
            .chain(shape.iter().map(|&n| Extent::fixed(n)));
        let chunk: Vec<usize> = std::iter::once(rows).chain(shape.iter().copied()).collect();
        let mut builder = group.new_dataset::<T>().chunk(chunk);
        if filters == Filters::ShuffleDeflate {
            builder = builder.shuffle();
        }
        let data = builder
            .deflate(level)
            .shape(SimpleExtents::new(extents))
            .create(name)?;
        Ok(Self {
            data,
            rows,
            trailing: shape.len(),
        })
    }

    /// Creates a list of fixed length with `rows` elements in a chunk.
    ///
    /// # Errors
    /// Those of HDF5.
    pub fn create_fixed<T: H5Type>(
        group: &Group,
        name: &str,
        count: usize,
        rows: usize,
        (filters, level): (Filters, u8),
    ) -> hdf5::Result<Self> {
        let mut builder = group.new_dataset::<T>().chunk([rows]);
        if filters == Filters::ShuffleDeflate {
            builder = builder.shuffle();
        }
        Ok(Self {
            data: builder.deflate(level).shape([count]).create(name)?,
            rows,
            trailing: 0,
        })
    }

    /// Writes chunk number `index`; `bytes` are compressed already.
    ///
    /// # Errors
    /// Those of HDF5.
    pub fn write(&self, index: usize, bytes: &[u8]) -> hdf5::Result<()> {
        let mut offset = vec![0; 1 + self.trailing];
        offset[0] = (index * self.rows) as u64;
        let status = hdf5::sync::sync(|| {
            #[expect(
                unsafe_code,
                reason = "H5Dwrite_chunk has no safe wrapper; the offset has as many entries as the dataset has axes, and bytes is alive for the call"
            )]
            unsafe {
                hdf5_sys::h5d::H5Dwrite_chunk(
                    self.data.id(),
                    hdf5_sys::h5p::H5P_DEFAULT,
                    0,
                    offset.as_ptr(),
                    bytes.len(),
                    bytes.as_ptr().cast(),
                )
            }
        });
        if status < 0 {
            return Err(hdf5::Error::Internal(format!(
                "H5Dwrite_chunk of {} failed at sample {}, often because the disk is full",
                self.data.name(),
                offset[0]
            )));
        }
        Ok(())
    }

    /// The dataset, for its attributes.
    #[must_use]
    pub fn dataset(&self) -> &Dataset {
        &self.data
    }
}
