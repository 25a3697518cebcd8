//! Parquet files by Arrow. A column defines its name, its type and its values at
//! once; a file takes the columns of its first rows and no others.

use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use anyhow::Context;
use arrow_array::{
    Array, ArrayRef, BinaryArray, BooleanArray, Float32Array, Float64Array, Int64Array, ListArray,
    RecordBatch, StringArray, StructArray,
};
use arrow_buffer::OffsetBuffer;
use arrow_schema::{DataType, Field, Fields, Schema};
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_writer::ArrowWriterOptions;
use parquet::basic::Compression;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties};

use crate::publish;

/// A column for some rows.
#[derive(Clone, Debug)]
pub struct Column {
    /// Name.
    pub name: String,
    /// Type and values.
    pub cells: Cells,
}

/// Values of one column for some rows. Numbers and texts come in rows of a fixed
/// shape, which is empty for flat values.
#[derive(Clone, Debug)]
pub enum Cells {
    /// 32-bit floating point.
    F32(Vec<usize>, Vec<f32>),
    /// 64-bit floating point.
    F64(Vec<usize>, Vec<f64>),
    /// 64-bit integers.
    I64(Vec<usize>, Vec<i64>),
    /// Truth values.
    Bool(Vec<bool>),
    /// UTF-8.
    Text(Vec<usize>, Vec<String>),
    /// Encoded images with a name: `{bytes, path}`.
    Image(Vec<(Vec<u8>, String)>),
    /// Lists of annotations, with a time of their own or without.
    Annotation(Vec<Vec<Annotation>>, bool),
}

/// A row of LeRobot's language columns.
#[derive(Clone, Debug, PartialEq)]
pub struct Annotation {
    /// `user` or `assistant`.
    pub role: &'static str,
    /// One annotation.
    pub content: String,
    /// Kind of the annotation: `subtask`, `plan`, `vqa`, `trace`.
    pub style: &'static str,
    /// Start of its validity, seconds from the first row.
    pub timestamp: f32,
    /// Feature of the camera that it is about.
    pub camera: Option<String>,
}

impl Cells {
    fn array(self) -> ArrayRef {
        match self {
            Self::F32(shape, values) => nested(Arc::new(Float32Array::from(values)), &shape),
            Self::F64(shape, values) => nested(Arc::new(Float64Array::from(values)), &shape),
            Self::I64(shape, values) => nested(Arc::new(Int64Array::from(values)), &shape),
            Self::Bool(values) => Arc::new(BooleanArray::from(values)),
            Self::Text(shape, values) => nested(Arc::new(StringArray::from(values)), &shape),
            Self::Image(images) => {
                let bytes = images.iter().map(|(bytes, _)| bytes.as_slice());
                let paths = images.iter().map(|(_, path)| path.as_str());
                let parts: Vec<ArrayRef> = vec![
                    Arc::new(BinaryArray::from_iter_values(bytes)),
                    Arc::new(StringArray::from_iter_values(paths)),
                ];
                let fields = Fields::from(vec![
                    Field::new("bytes", DataType::Binary, true),
                    Field::new("path", DataType::Utf8, true),
                ]);
                Arc::new(StructArray::new(fields, parts, None))
            }
            Self::Annotation(rows, timed) => annotations(rows, timed),
        }
    }
}

/// Lists of `{role, content, style, [timestamp], camera, tool_calls}`, as LeRobot
/// 0.6 names them; no annotation calls a tool.
fn annotations(rows: Vec<Vec<Annotation>>, timed: bool) -> ArrayRef {
    let offsets = OffsetBuffer::from_lengths(rows.iter().map(Vec::len));
    let all: Vec<Annotation> = rows.into_iter().flatten().collect();
    let text = |of: fn(&Annotation) -> Option<&str>| -> ArrayRef {
        Arc::new(StringArray::from_iter(all.iter().map(of)))
    };
    let calls = Field::new("element", DataType::Utf8, true);
    let none = ListArray::new_null(Arc::new(calls), all.len());
    let mut columns: Vec<(&str, ArrayRef)> = vec![
        ("role", text(|s| Some(s.role))),
        ("content", text(|s| Some(&s.content))),
        ("style", text(|s| Some(s.style))),
    ];
    if timed {
        let times = Float32Array::from_iter_values(all.iter().map(|s| s.timestamp));
        columns.push(("timestamp", Arc::new(times)));
    }
    columns.push(("camera", text(|s| s.camera.as_deref())));
    columns.push(("tool_calls", Arc::new(none)));
    let fields = columns.iter();
    let fields: Fields = fields
        .map(|(name, array)| Field::new(*name, array.data_type().clone(), true))
        .collect();
    let arrays = columns.into_iter().map(|(_, array)| array).collect();
    let structs = StructArray::new(fields, arrays, None);
    let element = Field::new("element", structs.data_type().clone(), true);
    Arc::new(ListArray::new(
        Arc::new(element),
        offsets,
        Arc::new(structs),
        None,
    ))
}

/// Values in lists of lists of the lengths of `shape`, every list full.
fn nested(values: ArrayRef, shape: &[usize]) -> ArrayRef {
    shape.iter().rev().fold(values, |inner, &length| {
        let lists = inner.len() / length.max(1);
        let offsets = OffsetBuffer::from_lengths(std::iter::repeat_n(length, lists));
        let element = Field::new("element", inner.data_type().clone(), true);
        Arc::new(ListArray::new(Arc::new(element), offsets, inner, None))
    })
}

/// The columns as Arrow arrays.
fn batch(columns: Vec<Column>) -> anyhow::Result<RecordBatch> {
    let (mut fields, mut arrays) = (Vec::new(), Vec::new());
    for column in columns {
        let array = column.cells.array();
        fields.push(Field::new(column.name, array.data_type().clone(), true));
        arrays.push(array);
    }
    Ok(RecordBatch::try_new(Arc::new(Schema::new(fields)), arrays)?)
}

/// A Parquet file that grows by groups of rows.
pub struct Table {
    writer: ArrowWriter<File>,
    schema: Arc<Schema>,
}

impl Table {
    /// Creates a file of `first` rows; `metadata` is stored in its footer, where
    /// readers find it.
    ///
    /// # Errors
    /// When the columns differ in length or the file cannot be made.
    pub fn create(
        path: &Path,
        first: Vec<Column>,
        metadata: &[(&str, String)],
    ) -> anyhow::Result<Self> {
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)?;
        }
        let metadata = metadata
            .iter()
            .map(|(key, value)| KeyValue::new((*key).to_owned(), value.clone()))
            .collect();
        let properties = WriterProperties::builder()
            .set_compression(Compression::SNAPPY)
            .set_dictionary_enabled(false)
            .set_statistics_enabled(EnabledStatistics::Chunk)
            .set_key_value_metadata(Some(metadata))
            .set_created_by(format!("wheelarm-dataset {}", env!("CARGO_PKG_VERSION")))
            .build();
        // The Parquet types are sufficient; Arrow's own schema is not repeated.
        let options = ArrowWriterOptions::new()
            .with_properties(properties)
            .with_skip_arrow_metadata(true);
        let first = batch(first)?;
        let file = File::create_new(path).with_context(|| format!("{}", path.display()))?;
        let schema = first.schema();
        let writer = ArrowWriter::try_new_with_options(file, schema.clone(), options)?;
        let mut table = Self { writer, schema };
        table.write(&first)?;
        Ok(table)
    }

    /// Bytes written so far.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.writer.bytes_written()
    }

    /// Appends rows as a group of their own.
    ///
    /// # Errors
    /// When names, types or lengths differ from those of the first rows, or the
    /// disk is full.
    pub fn append(&mut self, rows: Vec<Column>) -> anyhow::Result<()> {
        let rows = batch(rows)?;
        anyhow::ensure!(
            rows.schema() == self.schema,
            "columns {:?} in a file of {:?}",
            rows.schema().fields(),
            self.schema.fields()
        );
        self.write(&rows)
    }

    fn write(&mut self, rows: &RecordBatch) -> anyhow::Result<()> {
        self.writer.write(rows)?;
        self.writer.flush()?;
        Ok(())
    }

    /// Writes the footer and makes the file durable.
    ///
    /// # Errors
    /// When the disk is full.
    pub fn close(self) -> anyhow::Result<()> {
        publish::sync_file(&self.writer.into_inner()?)?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_start_where_their_row_starts() {
        let values = || Arc::new(Int64Array::from_iter_values(0..8));
        let rows = nested(values(), &[2, 2]);
        assert_eq!(rows.len(), 2);
        let rows = rows.as_any().downcast_ref::<ListArray>().unwrap();
        let second = rows.value(1);
        let second = second.as_any().downcast_ref::<ListArray>().unwrap();
        let last = second.value(1);
        let last = last.as_any().downcast_ref::<Int64Array>().unwrap();
        assert_eq!(last.values(), &[6, 7]);
        assert_eq!(nested(values(), &[]).len(), 8);
    }

    #[test]
    fn file_has_exactly_the_columns_of_its_first_rows() {
        let folder = tempfile::tempdir().unwrap();
        let column = |name: &str, cells| Column {
            name: name.to_owned(),
            cells,
        };
        let first = vec![column("a", Cells::F32(vec![2], vec![1.0, 2.0]))];
        let mut table = Table::create(&folder.path().join("t"), first.clone(), &[]).unwrap();
        table.append(first).unwrap();
        let renamed = vec![column("b", Cells::F32(vec![2], vec![1.0, 2.0]))];
        assert!(table.append(renamed).is_err());
        let flat = vec![column("a", Cells::F32(vec![], vec![1.0]))];
        assert!(table.append(flat).is_err());
        table.close().unwrap();
    }
}
