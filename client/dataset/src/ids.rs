//! Instance ids: 16 bits per pixel; recordings of the first contract have 8.

use wheelarm_proto::v1;

/// Least number of pixels of an instance that count as visible: fewer are only
/// a speck at any resolution that is recorded.
pub const VISIBLE_PIXELS: usize = 16;

/// Bytes of one id of an image.
#[must_use]
pub fn bytes(frame: &v1::CameraFrame) -> usize {
    match frame.segmentation_format() {
        v1::PixelFormat::IdU16 => 2,
        _ => 1,
    }
}

/// Ids from the bytes of an image with `each` bytes per id.
#[must_use]
pub fn read(bytes: &[u8], each: usize) -> Vec<u16> {
    match each {
        2 => {
            let (pairs, _) = bytes.as_chunks::<2>();
            pairs.iter().map(|&pair| u16::from_le_bytes(pair)).collect()
        }
        _ => bytes.iter().map(|&id| u16::from(id)).collect(),
    }
}

/// Ids as little-endian bytes, `each` bytes each.
#[must_use]
pub fn write(ids: &[u16], each: usize) -> Vec<u8> {
    match each {
        2 => ids.iter().flat_map(|id| id.to_le_bytes()).collect(),
        _ => ids.iter().map(|id| id.to_le_bytes()[0]).collect(),
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn ids_of_both_widths_are_read_as_they_were_written() {
        assert_eq!(
            super::read(&super::write(&[0, 7, 65535], 2), 2),
            [0, 7, 65535]
        );
        assert_eq!(super::read(&super::write(&[0, 7, 255], 1), 1), [0, 7, 255]);
    }
}
