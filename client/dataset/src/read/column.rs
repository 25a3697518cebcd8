//! Columns of a stream as stored in the file, without knowledge of the expected
//! streams and columns.

use hdf5::types::{FloatSize, IntSize, TypeDescriptor};

use super::error::ReadError;
use super::{Episode, place, texts};

/// A column with its metadata.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ColumnMeta {
    /// Stream, `camera/NAME` for cameras.
    pub stream: String,
    /// Dataset name.
    pub name: String,
    /// Element type.
    pub kind: ElementKind,
    /// Samples.
    pub count: usize,
    /// Lengths of the trailing axes.
    pub shape: Vec<usize>,
    /// Unit as written.
    pub units: String,
    /// Frame as written.
    pub frame: String,
    /// Entries of a named axis.
    pub names: Vec<String>,
    /// Entries of the components' axis.
    pub components: Vec<String>,
}

/// Type of a column's elements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ElementKind {
    /// 64-bit floating point.
    F64,
    /// 64-bit unsigned integer.
    U64,
    /// 0 or 1.
    Flag,
    /// UTF-8.
    Text,
    /// Images, message bytes and everything else that is not a state.
    Other,
}

/// All values of one column, first axis = sample.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// Numbers.
    F64(Vec<f64>),
    /// Integers.
    U64(Vec<u64>),
    /// Truth values.
    Flag(Vec<u8>),
    /// Texts.
    Text(Vec<String>),
}

impl ColumnMeta {
    /// Elements per sample.
    #[must_use]
    pub fn width(&self) -> usize {
        self.shape.iter().product()
    }
}

impl Episode {
    /// The columns of a stream in the order of their names, without stamps,
    /// sequence numbers and ticks.
    ///
    /// # Errors
    /// When no such stream exists.
    pub fn columns(&self, stream: &str) -> Result<Vec<ColumnMeta>, ReadError> {
        let group = self.group(stream)?;
        let mut members = group.member_names().map_err(|e| self.hdf5(stream, e))?;
        members.sort();
        let mut out = Vec::new();
        for name in members {
            if matches!(name.as_str(), "stamp_nanos" | "sequence" | "tick") {
                continue;
            }
            let data = match group.dataset(&name) {
                Ok(data) => data,
                Err(_) if group.group(&name).is_ok() => continue,
                Err(problem) => return Err(self.hdf5(&place(stream, &name), problem)),
            };
            let shape = data.shape();
            let descriptor = data
                .dtype()
                .and_then(|t| t.to_descriptor())
                .map_err(|e| self.hdf5(&place(stream, &name), e))?;
            let kind = match descriptor {
                TypeDescriptor::Float(FloatSize::U8) => ElementKind::F64,
                TypeDescriptor::Unsigned(IntSize::U8) => ElementKind::U64,
                TypeDescriptor::Unsigned(IntSize::U1) if shape.len() < 3 => ElementKind::Flag,
                TypeDescriptor::VarLenUnicode => ElementKind::Text,
                _ => ElementKind::Other,
            };
            let words = |attribute: &str| super::text(&data, attribute).unwrap_or_default();
            out.push(ColumnMeta {
                stream: stream.to_owned(),
                kind,
                count: shape.first().copied().unwrap_or(0),
                shape: shape.get(1..).unwrap_or_default().to_vec(),
                units: words("units"),
                frame: words("frame"),
                names: texts(&data, "names").unwrap_or_default(),
                components: texts(&data, "components").unwrap_or_default(),
                name,
            });
        }
        Ok(out)
    }

    /// Reads a whole column.
    ///
    /// # Errors
    /// When it cannot be read, has another size than it must have, or holds neither
    /// numbers, flags nor texts.
    pub fn values(&self, meta: &ColumnMeta) -> Result<Values, ReadError> {
        let (stream, name) = (&meta.stream, &meta.name);
        Ok(match meta.kind {
            ElementKind::F64 => Values::F64(self.all(stream, name)?),
            ElementKind::U64 => Values::U64(self.all(stream, name)?),
            ElementKind::Flag => Values::Flag(self.all(stream, name)?),
            ElementKind::Text => Values::Text(self.texts(stream, name)?),
            ElementKind::Other => {
                return Err(self.hdf5(
                    &place(stream, name),
                    hdf5::Error::Internal("it contains neither numbers, flags nor texts".into()),
                ));
            }
        })
    }

    /// Stamps of a stream, nanoseconds of simulation time.
    ///
    /// # Errors
    /// When no such stream exists.
    pub fn stamps(&self, stream: &str) -> Result<Vec<u64>, ReadError> {
        self.raw(&place(stream, "stamp_nanos"))
    }

    /// Whether it is a copy with labels in words and boxes, the group `/labels`.
    #[must_use]
    pub fn is_labelled(&self) -> bool {
        self.file.link_exists("labels")
    }

    /// Whether the file has this stream.
    #[must_use]
    pub fn has(&self, stream: &str) -> bool {
        self.group(stream).is_ok()
    }
}
