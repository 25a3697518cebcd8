//! The exact image that is the input of sensor models.

/// A pinhole lens without distortion; the centre of the first pixel is at (0.5, 0.5).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Focal lengths along x and y, pixels.
    pub focal: [f64; 2],
    /// Principal point from the top left corner, pixels.
    pub principal: [f64; 2],
}

/// One exact image, row-major from the top left.
#[derive(Clone, Copy, Debug)]
pub struct Exact<'a> {
    /// Its lens.
    pub lens: Lens,
    /// Tick of the exposure.
    pub tick: u64,
    /// sRGB, 3 bytes per pixel.
    pub rgb: &'a [u8],
    /// Metres along the optical axis, little-endian f32; `+inf` for none.
    pub depth: &'a [u8],
    /// Instance ids, little-endian u16.
    pub ids: &'a [u8],
}
