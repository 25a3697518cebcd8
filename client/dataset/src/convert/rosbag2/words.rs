//! Streams without a standard message: a JSON object per sample, with the columns
//! as the recording names them.

use serde_json::{Map, Value};

use crate::read::{ColumnMeta, ElementKind, Episode, ReadError, Values};

/// The columns of a stream, in memory.
pub(super) struct Words(Vec<(ColumnMeta, Values)>);

impl Words {
    /// Reads the columns of numbers, flags and texts of a stream.
    ///
    /// # Errors
    /// When one cannot be read.
    pub fn read(episode: &Episode, stream: &str) -> Result<Self, ReadError> {
        let columns = episode.columns(stream)?.into_iter();
        let columns = columns.filter(|meta| meta.kind != ElementKind::Other);
        let columns = columns.map(|meta| {
            let values = episode.values(&meta)?;
            Ok((meta, values))
        });
        Ok(Self(columns.collect::<Result<_, ReadError>>()?))
    }

    /// A sample: every column with its name; along a named axis an object, along
    /// another one a list; a non-number is `null`.
    pub fn sample(&self, i: usize) -> String {
        let mut all = Map::new();
        for (meta, values) in &self.0 {
            let place = i * meta.width();
            let value = shaped(meta, &meta.shape, &mut |k| element(values, place + k), 0);
            all.insert(meta.name.clone(), value);
        }
        Value::Object(all).to_string()
    }
}

/// The elements from `place` on in the remaining shape.
fn shaped(
    meta: &ColumnMeta,
    shape: &[usize],
    element: &mut dyn FnMut(usize) -> Value,
    place: usize,
) -> Value {
    let Some((&count, rest)) = shape.split_first() else {
        return element(place);
    };
    let width: usize = rest.iter().product();
    let parts: Vec<Value> = (0..count)
        .map(|k| shaped(meta, rest, element, place + k * width))
        .collect();
    let is_named = shape.len() == meta.shape.len() && meta.names.len() == count;
    if is_named {
        Value::Object(meta.names.iter().cloned().zip(parts).collect())
    } else {
        Value::Array(parts)
    }
}

fn element(values: &Values, k: usize) -> Value {
    match values {
        Values::F64(all) => all.get(k).map_or(Value::Null, |&v| Value::from(v)),
        Values::U64(all) => all.get(k).map_or(Value::Null, |&v| Value::from(v)),
        Values::Flag(all) => all.get(k).map_or(Value::Null, |&v| Value::from(v != 0)),
        Values::Text(all) => all.get(k).map_or(Value::Null, |v| Value::from(v.as_str())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_has_the_names_and_shapes_of_its_columns() {
        let meta = |name: &str, kind, shape: &[usize], names: &[&str]| ColumnMeta {
            stream: "s".to_owned(),
            name: name.to_owned(),
            kind,
            count: 2,
            shape: shape.to_vec(),
            units: String::new(),
            frame: String::new(),
            names: names.iter().map(|&n| n.to_owned()).collect(),
            components: Vec::new(),
        };
        let point: Vec<f64> = (0..8).map(f64::from).chain([f64::NAN; 4]).collect();
        let words = Words(vec![
            (
                meta("point", ElementKind::F64, &[2, 3], &[]),
                Values::F64(point),
            ),
            (
                meta("holds", ElementKind::Flag, &[2], &["a", "b"]),
                Values::Flag(vec![1, 0, 0, 1]),
            ),
            (
                meta("hash", ElementKind::U64, &[], &[]),
                Values::U64(vec![1, u64::MAX]),
            ),
            (
                meta("name", ElementKind::Text, &[], &[]),
                Values::Text(vec!["\"x\"".to_owned(), "y".to_owned()]),
            ),
        ]);
        let wanted = |text: &str| serde_json::from_str::<Value>(text).unwrap();
        let sample = |i: usize| wanted(&words.sample(i));
        assert_eq!(
            sample(0),
            wanted(
                r#"{"point": [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]],
                "holds": {"a": true, "b": false}, "hash": 1, "name": "\"x\""}"#
            )
        );
        assert_eq!(
            sample(1),
            wanted(
                r#"{"point": [[6.0, 7.0, null], [null, null, null]],
                "holds": {"a": false, "b": true}, "hash": 18446744073709551615, "name": "y"}"#
            )
        );
    }
}
