//! How the table declares a column: its name, unit, frame and axes, and the two
//! ways between its values and the message.

use super::{Axis, Codec, Column, Context, TextCodec, Values};

pub(super) const fn f64s<M>(
    name: &'static str,
    unit: &'static str,
    frame: &'static str,
    axes: &'static [Axis],
    codec: Codec<M, f64>,
) -> Column<M> {
    Column {
        name,
        unit,
        frame,
        axes,
        values: Values::F64(codec),
    }
}

pub(super) const fn u64s<M>(
    name: &'static str,
    unit: &'static str,
    codec: Codec<M, u64>,
) -> Column<M> {
    Column {
        name,
        unit,
        frame: "",
        axes: &[],
        values: Values::U64(codec),
    }
}

pub(super) const fn flags<M>(
    name: &'static str,
    axes: &'static [Axis],
    codec: Codec<M, u8>,
) -> Column<M> {
    Column {
        name,
        unit: "1",
        frame: "",
        axes,
        values: Values::Flag(codec),
    }
}

pub(super) const fn text<M>(name: &'static str, codec: TextCodec<M>) -> Column<M> {
    Column {
        name,
        unit: "1",
        frame: "",
        axes: &[],
        values: Values::Text(codec),
    }
}

pub(super) const fn message<M>() -> Column<M> {
    Column {
        name: "message",
        unit: "protobuf bytes of package wheelarm.v1",
        frame: "",
        axes: &[],
        values: Values::Message,
    }
}

/// Numbers that other columns of the stream contain too: nothing is restored.
pub(super) const fn derived<M, T>(take: fn(&M, &Context, &mut Vec<T>)) -> Codec<M, T> {
    fn nothing<M, T>(_: &mut M, _: &Context, _: &[T]) {}
    Codec {
        take,
        put: nothing::<M, T>,
    }
}

/// A text that other columns of the stream contain too.
pub(super) const fn derived_text<M>(take: fn(&M) -> String) -> TextCodec<M> {
    fn nothing<M>(_: &mut M, _: String) -> Result<(), String> {
        Ok(())
    }
    TextCodec {
        take,
        put: nothing::<M>,
    }
}

/// Both ways of a repeated field of numbers.
macro_rules! list {
    ($field:ident) => {
        Codec {
            take: |m, _, o| o.extend(&m.$field),
            put: |m, _, v| m.$field = v.to_vec(),
        }
    };
}

/// Both ways of a repeated field of single precision, which double precision has exactly.
macro_rules! singles {
    ($field:ident) => {
        Codec {
            take: |m, _, o| o.extend(m.$field.iter().map(|x| f64::from(*x))),
            put: |m, _, v| m.$field = v.iter().map(|&x| x as f32).collect(),
        }
    };
}

/// Both ways of a field with one number.
macro_rules! number {
    ($field:ident) => {
        Codec {
            take: |m, _, o| o.push(m.$field),
            put: |m, _, v| m.$field = v.first().copied().unwrap_or_default(),
        }
    };
}

/// Both ways of a field with one whole number.
macro_rules! whole {
    ($field:ident) => {
        Codec {
            take: |m, _, o| o.push(u64::from(m.$field)),
            put: |m, _, v| {
                let number = v.first().copied().unwrap_or_default();
                m.$field = number.try_into().unwrap_or_default();
            },
        }
    };
}

/// Both ways of a truth value.
macro_rules! flag {
    ($field:ident) => {
        Codec {
            take: |m, _, o| o.push(u8::from(m.$field)),
            put: |m, _, v| m.$field = v.first().is_some_and(|&v| v != 0),
        }
    };
}

/// Both ways of a part: a vector, a quaternion, a pose or a twist.
macro_rules! part {
    ($field:ident, $take:path, $put:path) => {
        Codec {
            take: |m, _, o| $take(m.$field.as_ref(), o),
            put: |m, _, v| m.$field = $put(v),
        }
    };
}

/// Both ways of a text.
macro_rules! words {
    ($field:ident) => {
        TextCodec {
            take: |m| m.$field.clone(),
            put: |m, text| {
                m.$field = text;
                Ok(())
            },
        }
    };
}

pub(super) use {flag, list, number, part, singles, whole, words};
