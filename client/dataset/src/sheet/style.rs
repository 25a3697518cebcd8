//! Colours, fonts, strokes and measures of the sheet, in pixels.

use plotters::chart::{ChartContext, MeshStyle};
use plotters::coord::Shift;
use plotters::coord::cartesian::Cartesian2d;
use plotters::coord::ranged1d::{Ranged, ValueFormatter};
use plotters::prelude::{BitMapBackend, DrawingArea, DrawingBackend};
use plotters::style::{FontStyle, IntoFont, RGBColor, TRANSPARENT, TextStyle, register_font};

/// The drawing area.
pub(crate) type Area<'a> = DrawingArea<BitMapBackend<'a>, Shift>;

pub const WIDTH: u32 = 2240;
pub const MARGIN: i32 = 48;
/// Left of the images: what the row shows.
pub const GUTTER: i32 = 128;
pub const GAP: i32 = 8;
pub const HEADER: i32 = 196;
pub const TIMES: i32 = 54;
pub const PLOTS: i32 = 520;
pub const COLUMNS: usize = 8;

pub const PAPER: RGBColor = RGBColor(250, 250, 248);
pub const INK: RGBColor = RGBColor(28, 32, 38);
pub const GREY: RGBColor = RGBColor(108, 114, 122);
pub const FAINT: RGBColor = RGBColor(222, 224, 226);
pub const GREEN: RGBColor = RGBColor(28, 135, 84);
pub const RED: RGBColor = RGBColor(192, 57, 43);
pub const AMBER: RGBColor = RGBColor(190, 120, 10);

pub const BLUE: RGBColor = RGBColor(31, 103, 180);
pub const ORANGE: RGBColor = RGBColor(222, 100, 20);
/// Distinct colours of lines (Okabe and Ito's palette, yellow left out).
pub const LINES: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(90, 90, 90),
];

/// Background of a phase by its number.
pub fn phase_colour(label: u64) -> RGBColor {
    match label {
        1 => RGBColor(221, 234, 248),
        2 => RGBColor(253, 235, 214),
        3 => RGBColor(250, 219, 216),
        4 => RGBColor(216, 240, 226),
        _ => PAPER,
    }
}

/// The font of all text.
pub const SANS_SERIF: &[u8] = epaint_default_fonts::UBUNTU_LIGHT;

/// Registers the fonts with plotters; may be called repeatedly.
pub fn register() -> bool {
    register_font("sans-serif", FontStyle::Normal, SANS_SERIF)
        .and(register_font(
            "monospace",
            FontStyle::Normal,
            epaint_default_fonts::HACK_REGULAR,
        ))
        .is_ok()
}

/// Text in the sheet's font.
pub fn text(size: u32, colour: RGBColor) -> TextStyle<'static> {
    ("sans-serif", size).into_font().color(&colour)
}

/// Grid, axes and words of a chart as all have them; what the axes are called is
/// still to be written.
pub fn strokes<'a, 'b, X, Y, DB>(
    chart: &'b mut ChartContext<'a, DB, Cartesian2d<X, Y>>,
) -> MeshStyle<'a, 'b, X, Y, DB>
where
    X: Ranged + ValueFormatter<X::ValueType>,
    Y: Ranged + ValueFormatter<Y::ValueType>,
    DB: DrawingBackend,
{
    let mut mesh = chart.configure_mesh();
    mesh.bold_line_style(FAINT)
        .light_line_style(TRANSPARENT)
        .axis_style(GREY)
        .label_style(text(19, GREY))
        .axis_desc_style(text(20, GREY));
    mesh
}
