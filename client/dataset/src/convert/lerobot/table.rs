//! The few shapes of Parquet columns that a LeRobot data set has, written
//! through the low-level writer: flat values, lists of any depth, pictures.

use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use anyhow::Context;
use parquet::basic::{Compression, ConvertedType, Repetition, Type as Physical};
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DoubleType, FloatType, Int64Type};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::{Type, TypePtr};

/// Type of a column's elements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Element {
    /// 32-bit floating point.
    F32,
    /// 64-bit floating point.
    F64,
    /// 64-bit integer.
    I64,
    /// Truth value.
    Bool,
    /// UTF-8.
    Text,
    /// A picture: `{bytes, path}`.
    Image,
}

/// One column.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Field {
    /// Name.
    pub name: String,
    /// Type of the elements.
    pub element: Element,
    /// Nested lists around it; 0 for a flat value.
    pub depth: usize,
}

/// Values of one column for some rows.
#[derive(Clone, Debug)]
pub enum Cells {
    /// Numbers, in rows of a fixed shape (empty for flat values).
    F32(Vec<usize>, Vec<f32>),
    /// Numbers, likewise.
    F64(Vec<usize>, Vec<f64>),
    /// Integers, likewise.
    I64(Vec<usize>, Vec<i64>),
    /// Truth values.
    Bool(Vec<bool>),
    /// Texts, or lists of one text when the field is a list.
    Text(Vec<String>),
    /// Encoded pictures with a name.
    Image(Vec<(Vec<u8>, String)>),
}

/// A Parquet file that grows by groups of rows.
pub struct Table {
    writer: SerializedFileWriter<File>,
    fields: Vec<Field>,
}

fn leaf(name: &str, element: Element) -> parquet::errors::Result<Type> {
    let (physical, converted) = match element {
        Element::F32 => (Physical::FLOAT, ConvertedType::NONE),
        Element::F64 => (Physical::DOUBLE, ConvertedType::NONE),
        Element::I64 => (Physical::INT64, ConvertedType::NONE),
        Element::Bool => (Physical::BOOLEAN, ConvertedType::NONE),
        Element::Text => (Physical::BYTE_ARRAY, ConvertedType::UTF8),
        Element::Image => (Physical::BYTE_ARRAY, ConvertedType::NONE),
    };
    Type::primitive_type_builder(name, physical)
        .with_repetition(Repetition::OPTIONAL)
        .with_converted_type(converted)
        .build()
}

fn field_type(field: &Field) -> parquet::errors::Result<TypePtr> {
    if field.element == Element::Image {
        let parts = vec![
            Arc::new(leaf("bytes", Element::Image)?),
            Arc::new(leaf("path", Element::Text)?),
        ];
        let group = Type::group_type_builder(&field.name)
            .with_repetition(Repetition::OPTIONAL)
            .with_fields(parts);
        return Ok(Arc::new(group.build()?));
    }
    let name = |depth: usize| {
        if depth == 0 {
            field.name.as_str()
        } else {
            "element"
        }
    };
    let mut inner = leaf(name(field.depth), field.element)?;
    for depth in (0..field.depth).rev() {
        let list = Type::group_type_builder("list")
            .with_repetition(Repetition::REPEATED)
            .with_fields(vec![Arc::new(inner)])
            .build()?;
        inner = Type::group_type_builder(name(depth))
            .with_repetition(Repetition::OPTIONAL)
            .with_converted_type(ConvertedType::LIST)
            .with_fields(vec![Arc::new(list)])
            .build()?;
    }
    Ok(Arc::new(inner))
}

impl Table {
    /// Creates a file; `metadata` stands in its footer, where Arrow finds it.
    ///
    /// # Errors
    /// When the file cannot be made.
    pub fn create(
        path: &Path,
        fields: Vec<Field>,
        metadata: &[(&str, String)],
    ) -> anyhow::Result<Self> {
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)?;
        }
        let mut types = Vec::new();
        for field in &fields {
            types.push(field_type(field)?);
        }
        let schema = Type::group_type_builder("schema")
            .with_fields(types)
            .build()?;
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
        let file = File::create_new(path).with_context(|| format!("{}", path.display()))?;
        Ok(Self {
            writer: SerializedFileWriter::new(file, Arc::new(schema), Arc::new(properties))?,
            fields,
        })
    }

    /// Bytes written so far.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.writer.bytes_written()
    }

    /// Appends rows, one entry of `cells` per field in their order.
    ///
    /// # Errors
    /// When the cells do not fit the fields or the disk is full.
    pub fn append(&mut self, cells: Vec<Cells>) -> anyhow::Result<()> {
        anyhow::ensure!(
            cells.len() == self.fields.len(),
            "{} columns for {} fields",
            cells.len(),
            self.fields.len()
        );
        let mut group = self.writer.next_row_group()?;
        for (field, cells) in self.fields.iter().zip(cells) {
            write(&mut group, field, cells).with_context(|| field.name.clone())?;
        }
        group.close()?;
        Ok(())
    }

    /// Writes the footer and makes the file durable.
    ///
    /// # Errors
    /// When the disk is full.
    pub fn close(self) -> anyhow::Result<()> {
        self.writer.into_inner()?.sync_all()?;
        Ok(())
    }
}

/// Definition and repetition levels of `count` values in rows of `shape`, every
/// list present and full.
fn levels(shape: &[usize], count: usize) -> (Vec<i16>, Option<Vec<i16>>) {
    let full = 2 * shape.len() as i16 + 1;
    let definition = vec![full; count];
    if shape.is_empty() {
        return (definition, None);
    }
    let repetition = (0..count).map(|index| {
        // The outermost axis whose index is not 0 again, counted from 1.
        let mut stride = 1;
        let mut level = 0;
        for (axis, &length) in shape.iter().enumerate().rev() {
            if !(index / stride).is_multiple_of(length.max(1)) {
                level = axis as i16 + 1;
                break;
            }
            stride *= length;
        }
        level
    });
    (definition, Some(repetition.collect()))
}

fn write(
    group: &mut SerializedRowGroupWriter<'_, File>,
    field: &Field,
    cells: Cells,
) -> anyhow::Result<()> {
    let missing = || anyhow::anyhow!("the schema has fewer columns than fields");
    let mut column = group.next_column()?.ok_or_else(missing)?;
    macro_rules! numbers {
        ($type:ty, $shape:expr, $values:expr) => {{
            anyhow::ensure!($shape.len() == field.depth, "a list of another depth");
            let (definition, repetition) = levels(&$shape, $values.len());
            column.typed::<$type>().write_batch(
                &$values,
                Some(&definition),
                repetition.as_deref(),
            )?;
        }};
    }
    match (field.element, cells) {
        (Element::F32, Cells::F32(shape, values)) => numbers!(FloatType, shape, values),
        (Element::F64, Cells::F64(shape, values)) => numbers!(DoubleType, shape, values),
        (Element::I64, Cells::I64(shape, values)) => numbers!(Int64Type, shape, values),
        (Element::Bool, Cells::Bool(values)) => numbers!(BoolType, [0_usize; 0], values),
        (Element::Text, Cells::Text(values)) => {
            let shape = vec![1; field.depth];
            let values: Vec<ByteArray> =
                values.iter().map(|t| ByteArray::from(t.as_str())).collect();
            numbers!(ByteArrayType, shape, values);
        }
        (Element::Image, Cells::Image(values)) => {
            let (bytes, paths): (Vec<ByteArray>, Vec<ByteArray>) = values
                .into_iter()
                .map(|(b, p)| (ByteArray::from(b), ByteArray::from(p.as_str())))
                .unzip();
            // Group and value are both optional and present.
            let definition = vec![2_i16; bytes.len()];
            column
                .typed::<ByteArrayType>()
                .write_batch(&bytes, Some(&definition), None)?;
            column.close()?;
            column = group.next_column()?.ok_or_else(missing)?;
            column
                .typed::<ByteArrayType>()
                .write_batch(&paths, Some(&definition), None)?;
        }
        (element, cells) => anyhow::bail!("{cells:?} are no values of {element:?}"),
    }
    column.close()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::levels;

    #[test]
    fn lists_start_where_their_row_starts() {
        assert_eq!(levels(&[3], 6), (vec![3; 6], Some(vec![0, 1, 1, 0, 1, 1])));
        assert_eq!(levels(&[3, 1, 1], 3), (vec![7; 3], Some(vec![0, 1, 1])));
        assert_eq!(levels(&[2, 2], 8).1, Some(vec![0, 2, 1, 2, 0, 2, 1, 2]));
        assert_eq!(levels(&[], 2), (vec![1; 2], None));
    }
}
