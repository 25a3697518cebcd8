//! The pixel convention, stated identically in every file with images.

/// Place of the centre of the pixel in column 0 and row 0, pixels.
pub const PIXEL_CENTRE: f64 = 0.5;

/// The convention of recordings and of all exports but MCAP, which has that of
/// its readers.
pub const CONVENTION: &str = "pixel edge: u, v, cx and cy count from the left and top edge of \
the image, the centre of the pixel in column i and row j is at (i + 0.5, j + 0.5), and a point \
x y z of the optical frame is seen at (fx x/z + cx, fy y/z + cy); OpenCV and ROS count from the \
centre of the first pixel: there cx and cy are smaller by 0.5";
