//! The plan of a report as a PNG: rooms, walls, furniture, the floor that the chair drives
//! on, surfaces that the arm reaches (green) or not (orange), stops, and widths of doors.

use std::sync::OnceLock;

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{FontStyle, register_font};
use wheelarm_homes::home_report::Finding;
use wheelarm_homes::home_report::home::{Home, Owner, Solid};
use wheelarm_planning::footprint_check::Rectangle;

use crate::polygon;

/// Largest side of the image, pixels.
const LARGEST: f64 = 1600.0;
/// Most pixels per metre.
const FINEST: f64 = 120.0;
/// Free border, metres.
const BORDER: f64 = 0.4;
/// Solids above this height are not drawn, metres.
const HEAD: f64 = 1.5;

const PAPER: RGBColor = WHITE;
const INK: RGBColor = RGBColor(50, 50, 50);
const ROOM: RGBColor = RGBColor(245, 237, 224);
const DRIVEN: RGBColor = RGBColor(199, 229, 250);
const TURNS: RGBColor = RGBColor(158, 219, 168);
const WALL: RGBColor = RGBColor(68, 68, 68);
const PIECE: RGBColor = RGBColor(185, 179, 170);
const REACHED: RGBColor = RGBColor(47, 158, 68);
const MISSED: RGBColor = RGBColor(232, 116, 30);
const STOP: RGBColor = RGBColor(24, 100, 171);
const PASSED: RGBColor = RGBColor(43, 138, 62);
const BLOCKED: RGBColor = RGBColor(201, 42, 42);

/// Why no plan was drawn.
#[derive(Debug, thiserror::Error)]
pub enum PlanError {
    /// Drawing failed.
    #[error("cannot draw the plan: {0}")]
    Draw(String),
    /// Encoding failed.
    #[error("cannot encode the plan: {0}")]
    Png(#[from] png::EncodingError),
}

/// From metres in `house` to pixels.
#[derive(Clone, Copy, Debug)]
struct View {
    /// Left and upper end, metres.
    corner: [f64; 2],
    /// Pixels per metre.
    scale: f64,
    size: (u32, u32),
}

impl View {
    fn new(home: &Home) -> Self {
        let corners = home
            .rooms
            .iter()
            .flat_map(|room| room.outline.iter().copied());
        let walls = home.solids.iter().filter(|s| s.owner == Owner::Building);
        let walls = walls.map(|solid| solid.outline.centre);
        let start = [
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::INFINITY,
            f64::NEG_INFINITY,
        ];
        let b = corners.chain(walls).fold(start, |b, [x, y]| {
            [b[0].min(x), b[1].max(x), b[2].min(y), b[3].max(y)]
        });
        let b = match b.iter().all(|side| side.is_finite()) {
            true => b,
            false => [0.0, 1.0, 0.0, 1.0],
        };
        let [width, height] = [b[1] - b[0], b[3] - b[2]].map(|side| side + 2.0 * BORDER);
        let scale = FINEST.min(LARGEST / width.max(height));
        let pixels = |length: f64| (length * scale).ceil().clamp(64.0, LARGEST) as u32;
        Self {
            corner: [b[0] - BORDER, b[3] + BORDER],
            scale,
            size: (pixels(width), pixels(height)),
        }
    }

    fn at(&self, [x, y]: [f64; 2]) -> (i32, i32) {
        let pixel = |length: f64| (length * self.scale).round().clamp(-1e6, 1e6) as i32;
        (pixel(x - self.corner[0]), pixel(self.corner[1] - y))
    }

    fn corners(&self, rectangle: &Rectangle) -> Vec<(i32, i32)> {
        let [c, s] = rectangle.along;
        let [a, b] = rectangle.half;
        [[-a, -b], [a, -b], [a, b], [-a, b]]
            .map(|[u, v]| {
                let [x, y] = rectangle.centre;
                self.at([x + c * u - s * v, y + s * u + c * v])
            })
            .to_vec()
    }

    fn letters(&self) -> u32 {
        (self.scale * 0.16).clamp(11.0, 20.0) as u32
    }
}

type Paper<'a> = DrawingArea<BitMapBackend<'a>, Shift>;

/// Draws the plan.
///
/// # Errors
/// [`PlanError`] when drawing or encoding fails.
pub fn plan(home: &Home, finding: &Finding) -> Result<Vec<u8>, PlanError> {
    register_font_once();
    let view = View::new(home);
    let (width, height) = view.size;
    let mut pixels = vec![0; width as usize * height as usize * 3];
    {
        let paper = BitMapBackend::with_buffer(&mut pixels, view.size).into_drawing_area();
        draw(&paper, &view, home, finding).map_err(|e| PlanError::Draw(e.to_string()))?;
        paper
            .present()
            .map_err(|e| PlanError::Draw(e.to_string()))?;
    }
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.write_header()?.write_image_data(&pixels)?;
    Ok(bytes)
}

type Drawn = Result<(), Box<dyn std::error::Error + Send + Sync>>;

fn draw(paper: &Paper<'_>, view: &View, home: &Home, finding: &Finding) -> Drawn {
    let report = &finding.report;
    paper.fill(&PAPER)?;
    for room in &home.rooms {
        let corners: Vec<_> = room.outline.iter().map(|at| view.at(*at)).collect();
        paper.draw(&Polygon::new(corners, ROOM.filled()))?;
    }
    let half = finding.floor.driven.side() / 2.0;
    for place in finding.floor.driven.places() {
        let [x, y] = place.at;
        let ends = [view.at([x - half, y - half]), view.at([x + half, y + half])];
        let colour = if place.turns { TURNS } else { DRIVEN };
        paper.draw(&plotters::element::Rectangle::new(ends, colour.filled()))?;
    }
    let low = home
        .solids
        .iter()
        .filter(|solid| solid.heights[0] < HEAD && solid.heights[1] > 0.03);
    let (walls, pieces): (Vec<&Solid>, Vec<&Solid>) = low.partition(|s| s.owner == Owner::Building);
    for (solids, colour) in [(pieces, PIECE), (walls, WALL)] {
        for solid in solids {
            paper.draw(&Polygon::new(view.corners(&solid.outline), colour.filled()))?;
        }
    }
    for (surface, found) in home.surfaces.iter().zip(&report.surfaces) {
        let mut corners: Vec<_> = surface.corners().iter().map(|at| view.at(*at)).collect();
        let colour = if found.strip.is_some() {
            REACHED
        } else {
            MISSED
        };
        paper.draw(&Polygon::new(corners.clone(), colour.mix(0.8).filled()))?;
        corners.extend(corners.first().copied());
        paper.draw(&PathElement::new(corners, INK.stroke_width(1)))?;
    }
    for strip in report
        .surfaces
        .iter()
        .filter_map(|found| found.strip.as_ref())
    {
        if let Some([x, y, _]) = strip.stops.get(strip.stops.len() / 2) {
            let (stop, edge) = (view.at([*x, *y]), view.at([strip.edge[0], strip.edge[1]]));
            paper.draw(&PathElement::new(vec![stop, edge], STOP.stroke_width(2)))?;
            paper.draw(&Circle::new(stop, 4, STOP.filled()))?;
        }
    }
    words(paper, view, home, finding)
}

/// Names of rooms and widths of doors.
fn words(paper: &Paper<'_>, view: &View, home: &Home, finding: &Finding) -> Drawn {
    let report = &finding.report;
    let style = |colour: RGBColor| {
        let font = ("sans-serif", view.letters()).into_font().color(&colour);
        font.pos(Pos::new(HPos::Center, VPos::Center))
    };
    for (room, found) in home.rooms.iter().zip(&report.rooms) {
        let share = format!("{:.0} %", found.driven * 100.0);
        let (x, y) = view.at(middle(&room.outline));
        let line = view.letters() as i32;
        paper.draw(&Text::new(legible(&room.name), (x, y), style(INK)))?;
        paper.draw(&Text::new(share, (x, y + line), style(INK)))?;
    }
    for (index, surface) in home.surfaces.iter().enumerate() {
        let number = (index + 1).to_string();
        let style = style(PAPER);
        paper.draw(&Text::new(number, view.at(surface.centre), style))?;
    }
    for door in &report.doors {
        let colour = if door.passed { PASSED } else { BLOCKED };
        let width = match door.closed {
            true => "closed".to_owned(),
            false => format!("{:.2}", door.clear_width),
        };
        paper.draw(&Text::new(width, view.at(door.at), style(colour)))?;
    }
    Ok(())
}

/// The place inside an outline that is farthest from it, of some on a grid.
fn middle(outline: &[[f64; 2]]) -> [f64; 2] {
    const STEPS: i32 = 24;
    let (low, high) = polygon::bounds(outline);
    let mut best = (0.0, low);
    for i in 1..STEPS {
        for j in 1..STEPS {
            let share = [i, j].map(|step| f64::from(step) / f64::from(STEPS));
            let at = [0, 1].map(|axis| low[axis] + share[axis] * (high[axis] - low[axis]));
            let far = polygon::distance_to_outline(outline, at);
            if polygon::contains(outline, at) && far > best.0 + 1.0e-6 {
                best = (far, at);
            }
        }
    }
    best.1
}

/// Words without characters that the font lacks.
fn legible(words: &str) -> String {
    let is_known = |letter: &char| (' '..'\u{250}').contains(letter);
    words.chars().filter(is_known).take(40).collect()
}

fn register_font_once() {
    static DONE: OnceLock<()> = OnceLock::new();
    DONE.get_or_init(|| {
        // A rejected font leads to an error of the first text.
        let font = epaint_default_fonts::UBUNTU_LIGHT;
        let _ = register_font("sans-serif", FontStyle::Normal, font);
    });
}
