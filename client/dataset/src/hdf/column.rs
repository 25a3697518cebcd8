//! A column of a state stream: rows are gathered, and written chunk by chunk.

use hdf5::types::VarLenUnicode;
use hdf5::{Dataset, Extent, Group, H5Type, SimpleExtents};

use super::chunks::{Chunked, Filters};
use super::{Attributes, Blob, CHUNK_BYTES, CHUNK_ROWS, unicode};
use crate::columns::{Cell, ColumnInfo, Context, Kind};
use crate::compress::Deflate;

/// Writes one dataset row by row.
pub struct ColumnWriter {
    target: Target,
    written: usize,
}

enum Target {
    /// Numbers: raw little-endian rows of a chunk that fills up.
    Numbers(Numbers),
    Texts(Dataset, Vec<VarLenUnicode>),
    Blobs(Dataset, Vec<Blob>),
    /// A column without elements, for example object poses without objects.
    Nothing,
}

struct Numbers {
    chunked: Chunked,
    element: usize,
    rows: usize,
    width: usize,
    filled: usize,
    buffer: Vec<u8>,
    next: usize,
}

impl ColumnWriter {
    /// Creates the dataset of `column` with `count` samples and its attributes.
    ///
    /// # Errors
    /// Those of HDF5.
    pub fn create(
        group: &Group,
        column: &ColumnInfo,
        context: &Context,
        count: usize,
    ) -> hdf5::Result<Self> {
        let shape = column.shape(context);
        let width = column.width(context);
        let (target, data) = match column.kind {
            Kind::F64 => numbers::<f64>(group, column.name, &shape, width, count)?,
            Kind::U64 => numbers::<u64>(group, column.name, &shape, width, count)?,
            Kind::Flag => numbers::<u8>(group, column.name, &shape, width, count)?,
            Kind::Text => {
                let data = list::<VarLenUnicode>(group, column.name, count)?;
                (Target::Texts(data.clone(), Vec::new()), data)
            }
            Kind::Bytes => {
                let data = list::<Blob>(group, column.name, count)?;
                (Target::Blobs(data.clone(), Vec::new()), data)
            }
        };
        let attributes = Attributes::for_object(&data);
        attributes
            .text("units", column.unit)?
            .text("frame", column.frame)?;
        for axis in column.axes {
            if let Some((name, labels)) = axis.labels(context) {
                attributes.texts(name, &labels)?;
            }
            if let Some(units) = axis.units(column.unit, context) {
                attributes.texts("units_by_name", &units)?;
            }
        }
        Ok(Self { target, written: 0 })
    }

    /// Adds one sample. A cell of another kind than the column's is refused.
    ///
    /// # Errors
    /// Those of HDF5.
    pub fn push(&mut self, cell: Cell, deflate: &mut Deflate) -> hdf5::Result<()> {
        match (&mut self.target, cell) {
            (Target::Numbers(n), Cell::F64(values)) => {
                n.row(values.iter().flat_map(|v| v.to_le_bytes()), deflate)?;
            }
            (Target::Numbers(n), Cell::U64(values)) => {
                n.row(values.iter().flat_map(|v| v.to_le_bytes()), deflate)?;
            }
            (Target::Numbers(n), Cell::Flag(values)) => n.row(values.into_iter(), deflate)?,
            (Target::Texts(data, waiting), Cell::Text(value)) => {
                waiting.push(unicode(&value));
                if waiting.len() == CHUNK_ROWS {
                    rows(data, waiting, self.written + 1)?;
                }
            }
            (Target::Blobs(data, waiting), Cell::Bytes(value)) => {
                waiting.push(Blob::from_slice(&value));
                if waiting.len() == CHUNK_ROWS {
                    rows(data, waiting, self.written + 1)?;
                }
            }
            (Target::Nothing, _) => {}
            (_, cell) => {
                return Err(hdf5::Error::Internal(format!(
                    "a column received {cell:?}, which has another type"
                )));
            }
        }
        self.written += 1;
        Ok(())
    }

    /// Writes what is gathered and returns the number of rows.
    ///
    /// # Errors
    /// Those of HDF5.
    pub fn finish(mut self, deflate: &mut Deflate) -> hdf5::Result<usize> {
        match &mut self.target {
            Target::Numbers(n) => n.flush(deflate)?,
            Target::Texts(data, waiting) => rows(data, waiting, self.written)?,
            Target::Blobs(data, waiting) => rows(data, waiting, self.written)?,
            Target::Nothing => {}
        }
        Ok(self.written)
    }
}

impl Numbers {
    fn row(&mut self, bytes: impl Iterator<Item = u8>, deflate: &mut Deflate) -> hdf5::Result<()> {
        self.buffer.extend(bytes);
        self.filled += 1;
        // Rows of a wrong width would shift all later ones.
        let expected = self.filled * self.width * self.element;
        if self.buffer.len() != expected {
            return Err(hdf5::Error::Internal(format!(
                "{} bytes in {} rows of {}, expected {expected}",
                self.buffer.len(),
                self.filled,
                self.chunked.dataset().name()
            )));
        }
        if self.filled == self.rows {
            self.flush(deflate)?;
        }
        Ok(())
    }

    /// Writes the chunk; the last one is filled with zeros behind the end.
    fn flush(&mut self, deflate: &mut Deflate) -> hdf5::Result<()> {
        if self.filled == 0 {
            return Ok(());
        }
        self.buffer.resize(self.rows * self.width * self.element, 0);
        let mut out = Vec::new();
        deflate.append(&self.buffer, self.element, &mut out);
        self.chunked.write(self.next, &out)?;
        self.next += 1;
        self.filled = 0;
        self.buffer.clear();
        Ok(())
    }
}

fn numbers<T: H5Type>(
    group: &Group,
    name: &str,
    shape: &[usize],
    width: usize,
    count: usize,
) -> hdf5::Result<(Target, Dataset)> {
    let element = size_of::<T>();
    if width == 0 {
        let all: Vec<usize> = std::iter::once(count)
            .chain(shape.iter().copied())
            .collect();
        let data = group
            .new_dataset::<T>()
            .no_chunk()
            .shape(all)
            .create(name)?;
        return Ok((Target::Nothing, data));
    }
    let rows = (CHUNK_BYTES / (width * element)).clamp(1, CHUNK_ROWS);
    let filters = if element > 1 {
        Filters::ShuffleDeflate
    } else {
        Filters::Deflate
    };
    let chunked = Chunked::create::<T>(group, name, count, shape, rows, filters)?;
    let data = chunked.dataset().clone();
    let numbers = Numbers {
        chunked,
        element,
        rows,
        width,
        filled: 0,
        buffer: Vec::new(),
        next: 0,
    };
    Ok((Target::Numbers(numbers), data))
}

fn list<T: H5Type>(group: &Group, name: &str, count: usize) -> hdf5::Result<Dataset> {
    group
        .new_dataset::<T>()
        .chunk(CHUNK_ROWS)
        .shape(SimpleExtents::new([Extent::resizable(count)]))
        .create(name)
}

/// Writes gathered rows that end at row `end`.
fn rows<T: H5Type>(data: &Dataset, waiting: &mut Vec<T>, end: usize) -> hdf5::Result<()> {
    if !waiting.is_empty() {
        data.write_slice(waiting.as_slice(), end - waiting.len()..end)?;
        waiting.clear();
    }
    Ok(())
}
