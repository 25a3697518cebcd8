//! Arrays of numpy in msgpack, in the form of openpi: a map whose keys are bytes. The input
//! is untrusted: sizes are checked before an allocation.

use rmpv::Value;

/// Rows of a reply.
#[derive(Clone, Debug, PartialEq)]
pub struct Rows {
    /// Number of rows.
    pub count: usize,
    /// Numbers of each.
    pub size: usize,
    /// One row after the other.
    pub values: Vec<f32>,
}

/// Most levels of a message.
const DEEPEST: usize = 16;
/// Most numbers of a reply.
const MOST: usize = 1 << 20;

/// Reads exactly one message.
pub(super) fn read(mut bytes: &[u8]) -> Result<Value, String> {
    let value = rmpv::decode::read_value_with_max_depth(&mut bytes, DEEPEST)
        .map_err(|e| format!("it is not msgpack: {e}"))?;
    match bytes.is_empty() {
        true => Ok(value),
        false => Err(format!("{} bytes follow the message", bytes.len())),
    }
}

/// The value at a key of a map.
pub(super) fn at<'a>(map: &'a Value, key: &str) -> Option<&'a Value> {
    let fits = |known: &Value| match known {
        Value::String(words) => words.as_bytes() == key.as_bytes(),
        Value::Binary(bytes) => bytes == key.as_bytes(),
        _ => false,
    };
    let entry = map.as_map()?.iter().find(|(known, _)| fits(known));
    entry.map(|(_, value)| value)
}

/// The rows of a reply: at `key` of a map, or the reply itself.
///
/// # Errors
/// The problem of the reply.
pub fn rows(bytes: &[u8], key: &str) -> Result<Rows, String> {
    let answer = read(bytes)?;
    let is_array = at(&answer, "__ndarray__").is_some();
    let array = match (answer.is_map() && !is_array, at(&answer, key)) {
        (true, Some(array)) => array,
        (true, None) => {
            return Err(format!(
                "it has no key {key:?}; its keys are {}",
                keys(&answer)
            ));
        }
        (false, _) => &answer,
    };
    let (shape, values) = numbers(array)?;
    let (count, size) = match shape.as_slice() {
        [size] => (1, *size),
        [count, size] => (*count, *size),
        _ => {
            return Err(format!(
                "its rows have the shape {shape:?}, expected [rows, numbers]"
            ));
        }
    };
    Ok(Rows {
        count,
        size,
        values,
    })
}

/// Keys of a map, for messages.
fn keys(map: &Value) -> String {
    let names = map.as_map().into_iter().flatten();
    let mut words: Vec<String> = names.map(|(key, _)| key.to_string()).take(8).collect();
    words.sort();
    match words.is_empty() {
        true => "none".to_owned(),
        false => words.join(", "),
    }
}

/// Shape and numbers of an array, or of lists of numbers in lists.
fn numbers(array: &Value) -> Result<(Vec<usize>, Vec<f32>), String> {
    if let Some(list) = array.as_array() {
        return listed(list);
    }
    let missing = |what: &str| format!("its array has no {what}");
    let data = at(array, "data").and_then(Value::as_slice);
    let data = data.ok_or_else(|| missing("data"))?;
    let dtype = at(array, "dtype").and_then(Value::as_str);
    let dtype = dtype.ok_or_else(|| missing("dtype"))?;
    let sides = at(array, "shape").and_then(Value::as_array);
    let sides = sides.ok_or_else(|| missing("shape"))?;
    let side = |side: &Value| side.as_u64().and_then(|side| usize::try_from(side).ok());
    let shape: Vec<usize> = sides
        .iter()
        .map(side)
        .collect::<Option<_>>()
        .ok_or_else(|| missing("shape of whole numbers"))?;
    let count = shape
        .iter()
        .try_fold(1_usize, |all, side| all.checked_mul(*side));
    let count = count.filter(|count| *count <= MOST);
    let count = count.ok_or_else(|| format!("its array has the shape {shape:?}"))?;
    macro_rules! all {
        ($kind:ty, $from:ident) => {
            data.chunks_exact(size_of::<$kind>())
                .map(|bytes| {
                    let mut own = [0; size_of::<$kind>()];
                    own.copy_from_slice(bytes);
                    <$kind>::$from(own) as f32
                })
                .collect()
        };
    }
    let values: Vec<f32> = match dtype {
        "<f4" => all!(f32, from_le_bytes),
        "<f8" => all!(f64, from_le_bytes),
        ">f4" => all!(f32, from_be_bytes),
        ">f8" => all!(f64, from_be_bytes),
        "<i4" => all!(i32, from_le_bytes),
        "<i8" => all!(i64, from_le_bytes),
        "<i2" => all!(i16, from_le_bytes),
        "|u1" => data.iter().map(|byte| f32::from(*byte)).collect(),
        other => {
            return Err(format!(
                "its array is of the type {other:?}; floats of 4 or 8 bytes are expected"
            ));
        }
    };
    if values.len() != count {
        return Err(format!(
            "its array of the shape {shape:?} and type {dtype} has {} bytes",
            data.len()
        ));
    }
    Ok((shape, values))
}

fn listed(list: &[Value]) -> Result<(Vec<usize>, Vec<f32>), String> {
    let number = |value: &Value| value.as_f64().map(|number| number as f32);
    if let Some(values) = list.iter().map(number).collect::<Option<Vec<f32>>>() {
        return Ok((vec![values.len()], values));
    }
    let mut all = Vec::new();
    let mut size = None;
    for row in list {
        let row = row.as_array().map(|row| row.iter().map(number));
        let row = row.and_then(Iterator::collect::<Option<Vec<f32>>>);
        let row = row.ok_or("its rows are not numbers")?;
        if *size.get_or_insert(row.len()) != row.len() {
            return Err("its rows are of several lengths".to_owned());
        }
        all.extend(row);
    }
    Ok((vec![list.len(), size.unwrap_or(0)], all))
}

/// An array of bytes.
pub(super) fn bytes(shape: &[usize], data: Vec<u8>) -> Value {
    array("|u1", shape, data)
}

/// An array of float32.
pub(super) fn floats(values: &[f32]) -> Value {
    let data = values.iter().flat_map(|value| value.to_le_bytes());
    array("<f4", &[values.len()], data.collect())
}

fn array(dtype: &str, shape: &[usize], data: Vec<u8>) -> Value {
    let key = |name: &str| Value::Binary(name.as_bytes().to_vec());
    let shape = shape.iter().map(|side| Value::from(*side as u64));
    Value::Map(vec![
        (key("__ndarray__"), Value::Boolean(true)),
        (key("data"), Value::Binary(data)),
        (key("dtype"), Value::from(dtype)),
        (key("shape"), Value::Array(shape.collect())),
    ])
}
