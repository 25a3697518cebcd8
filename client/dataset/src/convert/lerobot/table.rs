//! Parquet files. A column defines its name, its type and its values at once; a file
//! takes the columns of its first rows and no others. Written by levels, as the format
//! stores them: Arrow, which would compute them, takes a minute to compile.

use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use anyhow::Context;
use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use parquet::data_type::{
    BoolType, ByteArray, ByteArrayType, DataType, DoubleType, FloatType, Int64Type,
};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::{Type, TypePtr};

use crate::publish;

type Group<'a> = SerializedRowGroupWriter<'a, File>;

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

/// A value that may be missing.
fn leaf(name: &str, physical: Physical, logical: Option<LogicalType>) -> anyhow::Result<TypePtr> {
    let leaf = Type::primitive_type_builder(name, physical).with_logical_type(logical);
    Ok(Arc::new(
        leaf.with_repetition(Repetition::OPTIONAL).build()?,
    ))
}

fn text(name: &str) -> anyhow::Result<TypePtr> {
    leaf(name, Physical::BYTE_ARRAY, Some(LogicalType::String))
}

/// Fields that may be missing together.
fn group(name: &str, fields: Vec<TypePtr>) -> anyhow::Result<TypePtr> {
    let group = Type::group_type_builder(name).with_fields(fields);
    Ok(Arc::new(
        group.with_repetition(Repetition::OPTIONAL).build()?,
    ))
}

/// A list whose elements have the type `element`.
fn list(name: &str, element: TypePtr) -> anyhow::Result<TypePtr> {
    let entries = Type::group_type_builder("list")
        .with_fields(vec![element])
        .with_repetition(Repetition::REPEATED)
        .build()?;
    let list = Type::group_type_builder(name)
        .with_fields(vec![Arc::new(entries)])
        .with_logical_type(Some(LogicalType::List))
        .with_repetition(Repetition::OPTIONAL);
    Ok(Arc::new(list.build()?))
}

/// Lists of lists of the lengths of `shape`, without a shape the value itself.
fn nested(
    name: &str,
    shape: &[usize],
    physical: Physical,
    logical: Option<LogicalType>,
) -> anyhow::Result<TypePtr> {
    anyhow::ensure!(
        !shape.contains(&0),
        "column {name}: its shape {shape:?} has no values"
    );
    match shape.split_first() {
        None => leaf(name, physical, logical),
        Some((_, inner)) => list(name, nested("element", inner, physical, logical)?),
    }
}

/// Repetition level of each of `count` values in lists of the lengths of `shape`: the
/// number of lists around the value that go on. 0 begins a row.
fn repetition(shape: &[usize], count: usize) -> Vec<i16> {
    (0..count)
        .map(|index| {
            let mut block = 1;
            let inner = shape.iter().rev().take_while(|&&length| {
                block *= length;
                index % block == 0
            });
            (shape.len() - inner.count()) as i16
        })
        .collect()
}

/// Writes the next column of the group.
fn write_leaf<T: DataType>(
    rows: &mut Group<'_>,
    values: &[T::T],
    definition: &[i16],
    repetition: &[i16],
) -> anyhow::Result<()> {
    let mut column = rows
        .next_column()?
        .context("more values than the file has columns")?;
    let levels = (Some(definition), Some(repetition));
    column
        .typed::<T>()
        .write_batch(values, levels.0, levels.1)?;
    Ok(column.close()?)
}

/// Writes values in full lists of the lengths of `shape`.
fn write_nested<T: DataType>(
    rows: &mut Group<'_>,
    shape: &[usize],
    values: &[T::T],
) -> anyhow::Result<()> {
    let present = vec![1 + 2 * shape.len() as i16; values.len()];
    write_leaf::<T>(rows, values, &present, &repetition(shape, values.len()))
}

fn byte_array(text: &str) -> ByteArray {
    ByteArray::from(text.as_bytes().to_vec())
}

impl Column {
    /// Rows of this column.
    fn rows(&self) -> usize {
        let of = |shape: &[usize], values: usize| values / shape.iter().product::<usize>().max(1);
        match &self.cells {
            Cells::F32(shape, values) => of(shape, values.len()),
            Cells::F64(shape, values) => of(shape, values.len()),
            Cells::I64(shape, values) => of(shape, values.len()),
            Cells::Text(shape, values) => of(shape, values.len()),
            Cells::Bool(values) => values.len(),
            Cells::Image(images) => images.len(),
            Cells::Annotation(rows, _) => rows.len(),
        }
    }

    fn data_type(&self) -> anyhow::Result<TypePtr> {
        let name = &self.name;
        match &self.cells {
            Cells::F32(shape, _) => nested(name, shape, Physical::FLOAT, None),
            Cells::F64(shape, _) => nested(name, shape, Physical::DOUBLE, None),
            Cells::I64(shape, _) => nested(name, shape, Physical::INT64, None),
            Cells::Bool(_) => leaf(name, Physical::BOOLEAN, None),
            Cells::Text(shape, _) => {
                nested(name, shape, Physical::BYTE_ARRAY, Some(LogicalType::String))
            }
            Cells::Image(_) => {
                let bytes = leaf("bytes", Physical::BYTE_ARRAY, None)?;
                group(name, vec![bytes, text("path")?])
            }
            Cells::Annotation(_, timed) => {
                let mut fields = vec![text("role")?, text("content")?, text("style")?];
                if *timed {
                    fields.push(leaf("timestamp", Physical::FLOAT, None)?);
                }
                fields.push(text("camera")?);
                fields.push(list("tool_calls", text("element")?)?);
                list(name, group("element", fields)?)
            }
        }
    }

    fn write(&self, rows: &mut Group<'_>) -> anyhow::Result<()> {
        match &self.cells {
            Cells::F32(shape, values) => write_nested::<FloatType>(rows, shape, values),
            Cells::F64(shape, values) => write_nested::<DoubleType>(rows, shape, values),
            Cells::I64(shape, values) => write_nested::<Int64Type>(rows, shape, values),
            Cells::Bool(values) => write_nested::<BoolType>(rows, &[], values),
            Cells::Text(shape, values) => {
                let values: Vec<ByteArray> = values.iter().map(|text| byte_array(text)).collect();
                write_nested::<ByteArrayType>(rows, shape, &values)
            }
            Cells::Image(images) => {
                let (present, begins) = (vec![2; images.len()], vec![0; images.len()]);
                let bytes = images.iter().map(|(bytes, _)| bytes.clone().into());
                let paths = images.iter().map(|(_, path)| byte_array(path));
                for values in [bytes.collect::<Vec<_>>(), paths.collect()] {
                    write_leaf::<ByteArrayType>(rows, &values, &present, &begins)?;
                }
                Ok(())
            }
            Cells::Annotation(lists, timed) => write_annotations(rows, lists, *timed),
        }
    }
}

/// Lists of `{role, content, style, [timestamp], camera, tool_calls}`, as LeRobot
/// 0.6 names them; no annotation calls a tool.
fn write_annotations(
    rows: &mut Group<'_>,
    lists: &[Vec<Annotation>],
    timed: bool,
) -> anyhow::Result<()> {
    /// Definition levels: no entry in the list, an entry without this field, a value.
    const EMPTY: i16 = 1;
    const MISSING: i16 = 3;
    const PRESENT: i16 = 4;
    // An empty list has one level too.
    let entries: Vec<Option<&Annotation>> = lists
        .iter()
        .flat_map(|list| {
            let empty = list.is_empty().then_some(None);
            list.iter().map(Some).chain(empty)
        })
        .collect();
    let begins: Vec<i16> = lists
        .iter()
        .flat_map(|list| (0..list.len().max(1)).map(|index| i16::from(index > 0)))
        .collect();
    let levels = |has: &dyn Fn(&Annotation) -> bool| -> Vec<i16> {
        let level = |entry: &Option<&Annotation>| match entry {
            None => EMPTY,
            Some(annotation) if has(annotation) => PRESENT,
            Some(_) => MISSING,
        };
        entries.iter().map(level).collect()
    };
    let present = levels(&|_| true);
    let all = || lists.iter().flatten();
    let texts: [fn(&Annotation) -> &str; 3] = [|a| a.role, |a| &a.content, |a| a.style];
    for text in texts {
        let values: Vec<ByteArray> = all().map(|a| byte_array(text(a))).collect();
        write_leaf::<ByteArrayType>(rows, &values, &present, &begins)?;
    }
    if timed {
        let times: Vec<f32> = all().map(|a| a.timestamp).collect();
        write_leaf::<FloatType>(rows, &times, &present, &begins)?;
    }
    let cameras = all().filter_map(|a| a.camera.as_deref());
    let cameras: Vec<ByteArray> = cameras.map(byte_array).collect();
    let named = levels(&|a| a.camera.is_some());
    write_leaf::<ByteArrayType>(rows, &cameras, &named, &begins)?;
    write_leaf::<ByteArrayType>(rows, &[], &levels(&|_| false), &begins)
}

fn schema(columns: &[Column]) -> anyhow::Result<TypePtr> {
    let fields: anyhow::Result<Vec<TypePtr>> = columns.iter().map(Column::data_type).collect();
    let schema = Type::group_type_builder("schema").with_fields(fields?);
    Ok(Arc::new(schema.build()?))
}

/// A Parquet file that grows by groups of rows.
pub struct Table {
    writer: SerializedFileWriter<File>,
    schema: TypePtr,
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
        let schema = schema(&first)?;
        let file = File::create_new(path).with_context(|| format!("{}", path.display()))?;
        let writer = SerializedFileWriter::new(file, schema.clone(), Arc::new(properties))?;
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
        let found = schema(&rows)?;
        anyhow::ensure!(
            found == self.schema,
            "columns {found:?} in a file of {:?}",
            self.schema
        );
        self.write(&rows)
    }

    fn write(&mut self, columns: &[Column]) -> anyhow::Result<()> {
        let count = columns.first().map_or(0, Column::rows);
        for column in columns {
            anyhow::ensure!(
                column.rows() == count,
                "column {} has {} rows, column {} has {count}",
                column.name,
                column.rows(),
                columns[0].name
            );
        }
        let mut rows = self.writer.next_row_group()?;
        for column in columns {
            column.write(&mut rows)?;
        }
        rows.close()?;
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
        assert_eq!(repetition(&[2, 2], 8), [0, 2, 1, 2, 0, 2, 1, 2]);
        assert_eq!(repetition(&[3], 6), [0, 1, 1, 0, 1, 1]);
        assert_eq!(repetition(&[1], 2), [0, 0]);
        assert_eq!(repetition(&[], 3), [0, 0, 0]);
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
        let longer = vec![
            column("a", Cells::F32(vec![2], vec![1.0, 2.0])),
            column("b", Cells::Bool(vec![true, false])),
        ];
        assert!(Table::create(&folder.path().join("u"), longer, &[]).is_err());
        table.close().unwrap();
    }
}
