//! The few ways in which this crate writes HDF5: compressed chunks written
//! directly, columns of rows, texts, attributes. The only module with calls
//! into the C library that the `hdf5` crate does not wrap.

mod attributes;
mod chunks;
mod column;
mod lists;

pub use attributes::Attributes;
pub use chunks::{Chunked, Filters};
pub use column::ColumnWriter;
pub(crate) use lists::{List, read_lists};

use hdf5::Group;
use hdf5::types::{VarLenArray, VarLenUnicode};

/// First bytes of every HDF5 file of ours.
pub(crate) const SIGNATURE: &[u8; 8] = b"\x89HDF\r\n\x1a\n";
/// Rows of one chunk of a state stream.
pub const CHUNK_ROWS: usize = 1024;
/// Greatest chunk of a state stream, bytes.
const CHUNK_BYTES: usize = 1 << 20;

/// Opens and creates files without HDF5's lock, for those that this program alone
/// knows: a program that is started meanwhile inherits the open file, and the
/// lock would then stay on the finished file for as long as that program lives.
#[must_use]
pub(crate) fn unlocked() -> hdf5::FileBuilder {
    let mut builder = hdf5::File::with_options();
    builder.with_fapl(|access| access.file_locking(false));
    builder
}

/// Adds texts, by name, as attributes of the root of a file that this program alone
/// knows.
///
/// # Errors
/// Those of HDF5, also where an attribute exists already.
pub fn add_texts(file: &std::path::Path, texts: &[(&str, &str)]) -> hdf5::Result<()> {
    let file = unlocked().open_rw(file)?;
    let attributes = Attributes::for_object(&file);
    for (name, text) in texts {
        attributes.text(name, text)?;
    }
    file.close()
}

/// UTF-8 of variable length; NUL, which ends text in HDF5, becomes U+FFFD.
#[must_use]
pub fn unicode(text: &str) -> VarLenUnicode {
    text.replace('\0', "\u{fffd}")
        .parse()
        .unwrap_or_else(|_| VarLenUnicode::new())
}

/// Writes a list of texts as a dataset.
///
/// # Errors
/// Those of HDF5.
pub fn texts<S: AsRef<str>>(group: &Group, name: &str, list: &[S]) -> hdf5::Result<()> {
    let list: Vec<VarLenUnicode> = list.iter().map(|s| unicode(s.as_ref())).collect();
    let data = group
        .new_dataset::<VarLenUnicode>()
        .shape([list.len()])
        .create(name)?;
    if !list.is_empty() {
        data.write(&list)?;
    }
    Ok(())
}

/// Writes one text as a scalar dataset.
///
/// # Errors
/// Those of HDF5.
pub fn text(group: &Group, name: &str, value: &str) -> hdf5::Result<()> {
    let data = group.new_dataset::<VarLenUnicode>().create(name)?;
    data.write_scalar(&unicode(value))
}

/// Writes bytes as a compressed dataset.
///
/// # Errors
/// Those of HDF5.
pub fn bytes(group: &Group, name: &str, value: &[u8]) -> hdf5::Result<()> {
    if value.is_empty() {
        group.new_dataset::<u8>().shape([0]).create(name)?;
        return Ok(());
    }
    let data = group
        .new_dataset::<u8>()
        .chunk(value.len().min(CHUNK_BYTES))
        .deflate(crate::compress::LEVEL)
        .shape([value.len()])
        .create(name)?;
    data.write(value)
}

/// Bytes of variable length, one list per sample.
pub type Blob = VarLenArray<u8>;
