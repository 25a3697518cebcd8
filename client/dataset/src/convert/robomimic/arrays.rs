//! Small arrays with their unit and frame.

use hdf5::{Dataset, Group, H5Type};

use crate::hdf::Attributes;

/// Unit and frame of a dataset; the frame is empty without one.
pub(super) type What<'a> = (&'a str, &'a str);

/// Numbers without a unit.
pub(super) const NUMBER: What<'static> = ("1", "");

/// Writes a small array whose first axis is the sample.
pub(super) fn rows<T: H5Type>(
    group: &Group,
    name: &str,
    what: What<'_>,
    all: &[T],
    shape: &[usize],
) -> anyhow::Result<Dataset> {
    let width: usize = shape.iter().product();
    let whole: Vec<usize> = std::iter::once(all.len() / width.max(1))
        .chain(shape.iter().copied())
        .collect();
    let data = group.new_dataset::<T>().shape(whole).create(name)?;
    if !all.is_empty() {
        data.write_raw(all)?;
    }
    describe(&data, what)?;
    Ok(data)
}

pub(super) fn describe(data: &Dataset, (units, frame): What<'_>) -> hdf5::Result<()> {
    Attributes::for_object(data)
        .text("units", units)?
        .text("frame", frame)?;
    Ok(())
}
