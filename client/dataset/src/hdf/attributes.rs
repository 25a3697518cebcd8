//! Attributes in the types that h5py turns into str, int, float and bool.

use hdf5::Location;
use hdf5::types::VarLenUnicode;

use super::unicode;

/// Sets attributes on any group or dataset.
pub struct Attributes<'a>(&'a Location);

impl<'a> Attributes<'a> {
    /// Attributes of `place`.
    pub fn for_object(place: &'a Location) -> Self {
        Self(place)
    }

    /// Sets a text.
    ///
    /// # Errors
    /// Those of HDF5.
    pub fn text(&self, name: &str, value: &str) -> hdf5::Result<&Self> {
        let attribute = self.0.new_attr::<VarLenUnicode>().create(name)?;
        attribute.write_scalar(&unicode(value))?;
        Ok(self)
    }

    /// Sets a list of texts.
    ///
    /// # Errors
    /// Those of HDF5.
    pub fn texts<S: AsRef<str>>(&self, name: &str, list: &[S]) -> hdf5::Result<&Self> {
        let list: Vec<VarLenUnicode> = list.iter().map(|s| unicode(s.as_ref())).collect();
        let attribute = self
            .0
            .new_attr::<VarLenUnicode>()
            .shape([list.len()])
            .create(name)?;
        if !list.is_empty() {
            attribute.write(&list)?;
        }
        Ok(self)
    }

    /// Sets a list of numbers.
    ///
    /// # Errors
    /// Those of HDF5.
    pub fn numbers(&self, name: &str, list: &[f64]) -> hdf5::Result<&Self> {
        let attribute = self.0.new_attr::<f64>().shape([list.len()]).create(name)?;
        if !list.is_empty() {
            attribute.write(list)?;
        }
        Ok(self)
    }

    /// Sets a number or a truth value.
    ///
    /// # Errors
    /// Those of HDF5.
    pub fn set<T: hdf5::H5Type>(&self, name: &str, value: T) -> hdf5::Result<&Self> {
        self.0.new_attr::<T>().create(name)?.write_scalar(&value)?;
        Ok(self)
    }
}
