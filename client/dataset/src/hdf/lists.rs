//! Memory that lists of variable length need.

use hdf5::Dataset;
use hdf5::types::TypeDescriptor;

/// Bytes of memory that the lists or texts of a dataset need when they are read;
/// `None` for a dataset of fixed-size elements. HDF5 goes through the elements one by
/// one, about 5 us each.
///
/// # Errors
/// Those of HDF5.
pub fn list_bytes(data: &Dataset) -> hdf5::Result<Option<u64>> {
    let kind = data.dtype()?;
    let has_lists = matches!(
        kind.to_descriptor()?,
        TypeDescriptor::VarLenArray(_)
            | TypeDescriptor::VarLenUnicode
            | TypeDescriptor::VarLenAscii
    );
    if !has_lists || data.size() == 0 {
        return Ok(None);
    }
    let space = data.space()?;
    let mut bytes: hdf5_sys::h5::hsize_t = 0;
    let status = hdf5::sync::sync(|| {
        #[expect(
            unsafe_code,
            reason = "H5Dvlen_get_buf_size has no safe wrapper; the three identifiers are open, and bytes is alive for the call"
        )]
        unsafe {
            hdf5_sys::h5d::H5Dvlen_get_buf_size(data.id(), kind.id(), space.id(), &raw mut bytes)
        }
    });
    if status < 0 {
        return Err(hdf5::Error::Internal(
            "its lists cannot be measured: the file is damaged".to_owned(),
        ));
    }
    Ok(Some(bytes))
}
