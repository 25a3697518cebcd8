//! Anti-aliasing of finished images: smooths color along the edges of shapes. Depth and
//! IDs are unchanged. Four samples per pixel would halve the rate of a CPU adapter.
//!
//! A pixel is on an edge where a neighbor has another ID or where reversed depth bends.
//! Reversed depth is linear over a plane, so flat printed surfaces keep their bytes. On
//! an edge the length of the stair step is searched by luma. The color is blended
//! across the edge by the share of the pixel that the step covers (after Lottes, FXAA
//! 3.11).
//!
//! All arithmetic is on integers. `pack.wgsl` implements the same rules for images that
//! the GPU packs; `packing_tests` compares the two byte for byte.

/// Pixels searched in each direction of a stair step.
const REACH: i32 = 8;
/// Smallest luma contrast of an edge, of 2040.
const LEAST_CONTRAST: i32 = 64;
/// Or this share of the brightest neighbor, as a shift.
const CONTRAST_SHIFT: u32 = 3;
/// Second difference of reversed depth on an edge, as a share of the depth and at
/// least. Both products are exact, so that every adapter finds the same edges.
const BEND: f32 = 1.0 / 8192.0;
const LEAST_BEND: f32 = 1.0 / 33_554_432.0;

/// Color and reversed depth as rendered, four bytes per pixel.
#[derive(Clone, Copy)]
pub(super) struct Rendered<'a> {
    pub(super) colors: &'a [u8],
    pub(super) depths: &'a [u8],
    /// Bytes from one row to the next.
    pub(super) row: usize,
    pub(super) width: usize,
    pub(super) height: usize,
}

/// Overwrites the pixels of `rgb` that are on edges. `ids` are those of the image, two
/// bytes each.
pub(super) fn smooth(from: Rendered<'_>, ids: &[u8], rgb: &mut [u8]) {
    let (width, last) = (from.width, from.height - 1);
    let read = |y: usize, row: &mut Row| {
        let ids = &ids[y * width * 2..][..width * 2];
        row.read(from.depth_row(y), ids);
    };
    // Row above, this row, row below.
    let mut rows = [0, 0, last.min(1)].map(|y| {
        let mut row = Row::new(width);
        read(y, &mut row);
        row
    });
    let mut edges = vec![0; width.next_multiple_of(8)];
    for y in 0..from.height {
        find_edges(&rows, &mut edges[..width]);
        let line = &mut rgb[y * width * 3..][..width * 3];
        for (eight, edges) in edges.as_chunks::<8>().0.iter().enumerate() {
            if u64::from_ne_bytes(*edges) == 0 {
                continue;
            }
            for (k, _) in edges.iter().enumerate().filter(|(_, edge)| **edge != 0) {
                let x = eight * 8 + k;
                if let Some(blended) = from.blended(x as i32, y as i32) {
                    line[x * 3..][..3].copy_from_slice(&blended);
                }
            }
        }
        rows.rotate_left(1);
        read((y + 2).min(last), &mut rows[2]);
    }
}

/// Reversed depth and IDs of a row, with the first and the last pixel repeated.
struct Row {
    depths: Vec<f32>,
    ids: Vec<u16>,
}

impl Row {
    fn new(width: usize) -> Self {
        Self {
            depths: vec![0.0; width + 2],
            ids: vec![0; width + 2],
        }
    }

    fn read(&mut self, depths: &[u8], ids: &[u8]) {
        let width = self.depths.len() - 2;
        let from = depths.as_chunks::<4>().0.iter();
        for (to, from) in self.depths[1..=width].iter_mut().zip(from) {
            *to = f32::from_ne_bytes(*from);
        }
        let from = ids.as_chunks::<2>().0.iter();
        for (to, from) in self.ids[1..=width].iter_mut().zip(from) {
            *to = u16::from_le_bytes(*from);
        }
        self.depths[0] = self.depths[1];
        self.depths[width + 1] = self.depths[width];
        self.ids[0] = self.ids[1];
        self.ids[width + 1] = self.ids[width];
    }
}

/// Marks the pixels of the middle row that are on an edge. Slices have equal lengths,
/// so that the compiler vectorizes.
fn find_edges([above, here, below]: &[Row; 3], edges: &mut [u8]) {
    let count = edges.len();
    let (left, middle, right) = (
        &here.depths[..count],
        &here.depths[1..][..count],
        &here.depths[2..][..count],
    );
    let (up, down) = (&above.depths[1..][..count], &below.depths[1..][..count]);
    for (i, edge) in edges.iter_mut().enumerate() {
        let least = middle[i] * BEND + LEAST_BEND;
        let across = (left[i] + right[i]) - 2.0 * middle[i];
        let along = (up[i] + down[i]) - 2.0 * middle[i];
        *edge = u8::from((across.abs() > least) | (along.abs() > least));
    }
    let (left, middle, right) = (
        &here.ids[..count],
        &here.ids[1..][..count],
        &here.ids[2..][..count],
    );
    let (up, down) = (&above.ids[1..][..count], &below.ids[1..][..count]);
    for (i, edge) in edges.iter_mut().enumerate() {
        let id = middle[i];
        let differs = (left[i] ^ id) | (right[i] ^ id) | (up[i] ^ id) | (down[i] ^ id);
        *edge |= u8::from(differs != 0);
    }
}

/// Luma of a color, 0 to 2040.
fn luma([r, g, b, _]: [u8; 4]) -> i32 {
    2 * i32::from(r) + 5 * i32::from(g) + i32::from(b)
}

impl Rendered<'_> {
    fn depth_row(&self, y: usize) -> &[u8] {
        &self.depths[y * self.row..][..self.width * 4]
    }

    /// Luma of the pixel at a byte offset.
    fn luma(&self, at: usize) -> i32 {
        match self.colors.get(at..at + 4) {
            Some(&[r, g, b, a]) => luma([r, g, b, a]),
            _ => 0,
        }
    }

    /// The blended color of a pixel on an edge, if it differs.
    fn blended(&self, x: i32, y: i32) -> Option<[u8; 3]> {
        // Byte offsets of a column and of a row, clamped to the image.
        let column = |x: i32| x.clamp(0, self.width as i32 - 1) as usize * 4;
        let line = |y: i32| y.clamp(0, self.height as i32 - 1) as usize * self.row;
        let (west, middle, east) = (column(x - 1), column(x), column(x + 1));
        let (north, here, south) = (line(y - 1), line(y), line(y + 1));
        let m = self.luma(here + middle);
        let (n, s) = (self.luma(north + middle), self.luma(south + middle));
        let (w, e) = (self.luma(here + west), self.luma(here + east));
        let brightest = m.max(n).max(s).max(w).max(e);
        let contrast = brightest - m.min(n).min(s).min(w).min(e);
        if contrast < LEAST_CONTRAST.max(brightest >> CONTRAST_SHIFT) {
            return None;
        }
        let (nw, ne) = (self.luma(north + west), self.luma(north + east));
        let (sw, se) = (self.luma(south + west), self.luma(south + east));
        let across_rows =
            (nw + sw - 2 * w).abs() + 2 * (n + s - 2 * m).abs() + (ne + se - 2 * e).abs();
        let across_columns =
            (nw + ne - 2 * n).abs() + 2 * (w + e - 2 * m).abs() + (sw + se - 2 * s).abs();
        let horizontal = across_rows >= across_columns;
        let (before, after) = if horizontal { (n, s) } else { (w, e) };
        let backwards = (before - m).abs() >= (after - m).abs();
        let side = if backwards { before } else { after };
        let across = match (horizontal, backwards) {
            (true, true) => north + middle,
            (true, false) => south + middle,
            (false, true) => here + west,
            (false, false) => here + east,
        };
        let gradient = (side - m).abs();
        // How far the step extends and on which side of the edge's mean it ends. Beyond
        // the image border the last pixel repeats.
        let end = |direction: i32| {
            let mut difference = 0;
            for i in 1..=REACH {
                let (own, other) = if horizontal {
                    let at = column(x + i * direction);
                    (here + at, across - middle + at)
                } else {
                    let at = line(y + i * direction);
                    (at + middle, at + across - here)
                };
                difference = self.luma(own) + self.luma(other) - (m + side);
                if 2 * difference.abs() >= gradient {
                    return (i, difference);
                }
            }
            (REACH, difference)
        };
        let (back, ahead) = (end(-1), end(1));
        let (nearest, difference) = if back.0 <= ahead.0 { back } else { ahead };
        if (difference < 0) == (m < side) {
            return None;
        }
        let length = back.0 + ahead.0 - 1;
        let weight = 128 * (length - 2 * nearest + 1) / length;
        let mix = |k: usize| {
            let [own, other] = [here + middle, across].map(|at| i32::from(self.colors[at + k]));
            ((own * (256 - weight) + other * weight + 128) >> 8) as u8
        };
        Some([mix(0), mix(1), mix(2)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [usize; 2] = [61, 40];
    const LIGHT: u8 = 220;
    const DARK: u8 = 40;

    /// An image of a slanted edge: bright below, dark above; `depth` and `id` per side.
    fn slanted(
        depth: impl Fn(usize, usize, bool) -> f32,
        id: impl Fn(bool) -> u16,
    ) -> (Vec<u8>, Vec<u8>, Vec<u8>) {
        let [width, height] = SIZE;
        let (mut colors, mut depths, mut ids) = (Vec::new(), Vec::new(), Vec::new());
        for y in 0..height {
            for x in 0..width {
                let below = y as f64 + 0.5 > edge(x as f64 + 0.5);
                colors.extend([if below { LIGHT } else { DARK }; 4]);
                depths.extend(depth(x, y, below).to_ne_bytes());
                ids.extend(id(below).to_le_bytes());
            }
        }
        (colors, depths, ids)
    }

    fn edge(x: f64) -> f64 {
        17.3 + 0.21 * x
    }

    fn smoothed((colors, depths, ids): &(Vec<u8>, Vec<u8>, Vec<u8>)) -> Vec<u8> {
        let [width, height] = SIZE;
        let rendered = Rendered {
            colors,
            depths,
            row: width * 4,
            width,
            height,
        };
        let mut rgb: Vec<u8> = colors
            .as_chunks::<4>()
            .0
            .iter()
            .flat_map(|c| [c[0]; 3])
            .collect();
        smooth(rendered, ids, &mut rgb);
        rgb
    }

    /// Mean distance to the color of the covered share of each pixel, in the rows and
    /// columns where the edge is inside the image.
    fn error(values: impl Fn(usize, usize) -> u8) -> f64 {
        let [width, height] = SIZE;
        let mut sum = 0.0;
        for y in 0..height {
            for x in 0..width {
                let at = |k: i32| edge(x as f64 + (f64::from(k) + 0.5) / 16.0);
                let covered: f64 = (0..16)
                    .map(|k| (y as f64 + 1.0 - at(k)).clamp(0.0, 1.0))
                    .sum();
                let right = f64::from(DARK) + covered / 16.0 * f64::from(LIGHT - DARK);
                sum += (f64::from(values(x, y)) - right).abs();
            }
        }
        sum / width as f64
    }

    #[test]
    fn edge_pixels_get_the_color_of_their_covered_share() {
        let by_depth = slanted(|_, _, below| if below { 0.2 } else { 0.1 }, |_| 7);
        let by_id = slanted(|_, _, _| 0.2, |below| if below { 7 } else { 8 });
        for image in [by_depth, by_id] {
            let rgb = smoothed(&image);
            let width = SIZE[0];
            let before = error(|x, y| image.0[(y * width + x) * 4]);
            let after = error(|x, y| rgb[(y * width + x) * 3]);
            assert!(after < 0.4 * before, "{after} {before}");
            // Pixels away from the edge are unchanged.
            for (i, (color, rgb)) in image.0.chunks(4).zip(rgb.chunks(3)).enumerate() {
                let (x, y) = ((i % width) as f64, (i / width) as f64);
                if (y + 0.5 - edge(x + 0.5)).abs() > 1.5 {
                    assert_eq!(color[..3], *rgb, "{x} {y}");
                }
            }
        }
    }

    #[test]
    fn a_print_on_a_plane_keeps_its_bytes() {
        // Reversed depth of a plane is linear over the image.
        let plane = |x: usize, y: usize, _| 0.05 + 0.0007 * x as f32 + 0.0011 * y as f32;
        let image = slanted(plane, |_| 7);
        let [width, height] = SIZE;
        let rgb = smoothed(&image);
        for y in 1..height - 1 {
            for x in 1..width - 1 {
                let i = y * width + x;
                assert_eq!(image.0[i * 4..][..3], rgb[i * 3..][..3], "{x} {y}");
            }
        }
    }
}
