//! Errors of the contact sheet.

use plotters::prelude::*;

use crate::read::ReadError;

/// Error of the plotting library.
pub(crate) type DrawError =
    DrawingAreaErrorKind<<BitMapBackend<'static> as DrawingBackend>::ErrorType>;

/// Why no contact sheet was written.
#[derive(Debug, thiserror::Error)]
pub enum SheetError {
    /// The episode cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The drawing library failed.
    #[error("cannot draw the sheet: {0}")]
    Draw(#[from] DrawError),
    /// The fonts in this program are not readable.
    #[error("cannot use the built-in fonts")]
    Fonts,
    /// The PNG cannot be written.
    #[error("{path} cannot be written: {source}")]
    Write {
        /// The file.
        path: String,
        /// The reason.
        source: png::EncodingError,
    },
}
