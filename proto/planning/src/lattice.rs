//! Moves of the chair between the poses of a grid: straight on, an arc of one heading, a
//! turn of one heading. A heading is not along the cells, so every move ends at the cell
//! whose direction suits best.

use std::f64::consts::TAU;
use std::sync::LazyLock;

use wheelarm_proto::exact;

use super::footprint_check::wrap;
use super::grid::{CELL, CellPose, Grid, HEADINGS, PoseSet};

/// Longest straight move, cells, and greatest angle between it and the heading, radians. The
/// chair has any heading within 10°, so that all directions near it belong to the heading.
const STRAIGHT: (f64, f64) = (4.3, 0.18);
/// The same of a move with an arc.
const ARC: (f64, f64) = (1.5, 0.42);

/// The moves at every heading.
pub(super) static LATTICE: LazyLock<Lattice> = LazyLock::new(Lattice::new);

/// See the module.
#[derive(Clone, Debug)]
pub(super) struct Lattice {
    pub headings: Vec<Moves>,
}

/// Moves forward from one heading; their reverse leads back.
#[derive(Clone, Debug)]
pub(super) struct Moves {
    /// Straight on.
    pub straights: Vec<Step>,
    /// To the next heading to the left, and to the right.
    pub arcs: [Vec<Step>; 2],
}

/// A move over cells.
#[derive(Clone, Debug)]
pub(super) struct Step {
    /// Cells that it passes, the last is its end.
    cells: Vec<[i32; 2]>,
    /// Metres.
    pub length: f64,
}

impl Lattice {
    fn new() -> Self {
        let bin = TAU / HEADINGS as f64;
        let moves = |heading: usize| {
            let angle = heading as f64 * bin;
            Moves {
                straights: Step::towards(angle, STRAIGHT),
                arcs: [0.5, -0.5].map(|side| Step::towards(angle + side * bin, ARC)),
            }
        };
        Self {
            headings: (0..HEADINGS).map(moves).collect(),
        }
    }
}

impl Step {
    /// The shortest moves in all directions near one.
    fn towards(angle: f64, (longest, off): (f64, f64)) -> Vec<Self> {
        let most = longest.ceil() as i32;
        let mut steps = Vec::new();
        for y in -most..=most {
            for x in -most..=most {
                let length = exact::hypot(f64::from(x), f64::from(y));
                // Others are several of the same.
                let is_shortest = divisor(x, y) == 1;
                let direction = exact::atan2(f64::from(y), f64::from(x));
                if is_shortest && length <= longest && wrap(direction - angle).abs() <= off {
                    steps.push(Self::over([x, y], length));
                }
            }
        }
        steps
    }

    /// The move over `x` and `y` cells.
    fn over([x, y]: [i32; 2], length: f64) -> Self {
        let count = x.abs().max(y.abs());
        let share = |of: i32, i: i32| (f64::from(of * i) / f64::from(count)).round() as i32;
        // The cells of the way back too, or a way could lead in one direction only.
        let mut cells: Vec<[i32; 2]> = (1..count)
            .flat_map(|i| {
                let ahead = [share(x, i), share(y, i)];
                [ahead, [x - share(x, count - i), y - share(y, count - i)]]
            })
            .collect();
        cells.dedup();
        cells.push([x, y]);
        Self {
            cells,
            length: length * 2.0 * CELL,
        }
    }

    /// The pose at its end, from `at` forward (`way` 1) or back (-1), with the heading
    /// unchanged; `None` where a cell on the way is blocked.
    pub(super) fn end(
        &self,
        grid: &Grid,
        blocked: &PoseSet,
        at: CellPose,
        way: i32,
    ) -> Option<CellPose> {
        let mut last = None;
        for cell in &self.cells {
            let to = grid.moved(at, cell.map(|cells| cells * way))?;
            if blocked.contains(grid, to) {
                return None;
            }
            last = Some(to);
        }
        last
    }
}

/// Greatest common divisor of the amounts.
fn divisor(a: i32, b: i32) -> i32 {
    if b == 0 { a.abs() } else { divisor(b, a % b) }
}
