//! A fast footprint check for searches: obstacles are sorted into cells, and only those
//! of the chair's cell are checked. The result is that of [`FootprintCheck::is_free`].

use super::footprint_check::{FootprintCheck, Outline, Pose2, Rectangle};

/// Side of a cell, metres.
const CELL: f64 = 0.5;

/// A footprint check with one margin.
pub(super) struct Nearby<'a> {
    levels: Vec<Level<'a>>,
    margin: f64,
}

struct Level<'a> {
    outline: Outline,
    /// Corner of the first cell, metres.
    corner: [f64; 2],
    /// Cells along x and y.
    count: [usize; 2],
    /// Obstacles that an outline with its centre in the cell can touch.
    cells: Vec<Vec<Rectangle>>,
    all: &'a [Rectangle],
}

impl<'a> Nearby<'a> {
    pub(super) fn new(footprint: &'a FootprintCheck, margin: f64) -> Self {
        let bounds = footprint.bounds();
        let finite = bounds.iter().all(|side| side.is_finite());
        let [x0, x1, y0, y1] = if finite { bounds } else { [0.0; 4] };
        let cells = |low: f64, high: f64| ((high - low) / CELL).ceil().clamp(1.0, 200.0) as usize;
        let count = [cells(x0, x1), cells(y0, y1)];
        let origin = Pose2 {
            x: 0.0,
            y: 0.0,
            heading: 0.0,
        };
        let levels = footprint.levels.iter().map(|level| {
            let reach = level.outline.rectangle_at(&origin, margin).radius();
            let cell = |i: usize| {
                let at = |low: f64, k: usize| low + (k as f64 + 0.5) * CELL;
                let around = Rectangle {
                    centre: [at(x0, i % count[0]), at(y0, i / count[0])],
                    half: [CELL / 2.0 + reach; 2],
                    along: [1.0, 0.0],
                };
                let near = level.obstacles.iter().filter(|o| o.overlaps(&around));
                near.copied().collect()
            };
            Level {
                outline: level.outline,
                corner: [x0, y0],
                count,
                cells: (0..count[0] * count[1]).map(cell).collect(),
                all: &level.obstacles,
            }
        });
        Self {
            levels: levels.collect(),
            margin,
        }
    }

    /// Whether the chair is collision-free at `pose`.
    pub(super) fn is_free(&self, pose: &Pose2) -> bool {
        self.levels.iter().all(|level| {
            let outline = level.outline.rectangle_at(pose, self.margin);
            let near = level.near(outline.centre);
            !near.iter().any(|o| o.overlaps(&outline))
        })
    }
}

impl Level<'_> {
    fn near(&self, at: [f64; 2]) -> &[Rectangle] {
        let cell = |i: usize| {
            let cell = ((at[i] - self.corner[i]) / CELL).floor();
            (cell >= 0.0 && cell < self.count[i] as f64).then_some(cell as usize)
        };
        match (cell(0), cell(1)) {
            (Some(x), Some(y)) => &self.cells[y * self.count[0] + x],
            _ => self.all,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheelarm_proto::exact;

    #[test]
    fn cells_give_the_result_of_the_complete_check() {
        let outline = |sides| Outline { sides };
        let mut footprint = FootprintCheck::from_outlines([
            (0.32, outline([-0.2, 0.8, -0.3, 0.4])),
            (1.5, outline([-0.2, 1.0, -0.3, 0.5])),
        ]);
        for i in 0..40 {
            let i = f64::from(i);
            let turn = i * 0.7;
            let obstacle = Rectangle {
                centre: [(i * 1.7) % 9.0, (i * 2.3) % 6.0],
                half: [0.1 + (i * 0.13) % 0.9, 0.05 + (i * 0.07) % 0.3],
                along: [exact::cos(turn), exact::sin(turn)],
            };
            footprint.put(obstacle, [(i * 0.11) % 0.6, 0.7]);
        }
        let mut free = 0;
        for margin in [0.0, 0.05] {
            let nearby = Nearby::new(&footprint, margin);
            for i in 0..4000 {
                let i = f64::from(i);
                let pose = Pose2 {
                    x: (i * 0.37) % 11.0 - 1.0,
                    y: (i * 0.53) % 8.0 - 1.0,
                    heading: (i * 0.71) % 6.0 - 3.0,
                };
                let is_free = footprint.is_free(&pose, margin);
                assert_eq!(nearby.is_free(&pose), is_free, "{pose:?}");
                free += usize::from(is_free);
            }
        }
        assert!((500..7500).contains(&free), "{free}");
    }
}
