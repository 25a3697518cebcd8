//! Detects incompressible data: the lowest bytes of float32 depth are noise where the
//! surface is close or slanted, half of the work for a few percent of the size.

use std::ops::Range;

/// Size of a plane from which on it is sampled before it is compressed, bytes.
pub(super) const WORTH_A_LOOK: usize = 1 << 18;
/// Bytes that are judged together, and how many of them are looked at: three
/// rows and more of 1280 pixels, since what repeats does so from row to row.
const PIECE: usize = 1 << 15;
const LOOK: usize = 4096;
/// One in this many positions must repeat earlier data. With fewer repetitions deflate
/// is slowest and saves a tenth of the bytes, rarely a quarter.
const REPEATS: usize = 10;
/// Smallest match for deflate, bytes.
const WORD: usize = 4;

/// Consecutive bytes of a chunk that are treated alike.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Run {
    pub bytes: Range<usize>,
    /// Incompressible, and best stored.
    pub noise: bool,
}

/// Splits the planes of a shuffled chunk, `plane` bytes each. Higher bytes are more
/// regular than lower ones: after the first plane without noise none is sampled. A
/// chunk of small planes is one run.
pub(super) fn runs(planes: &[u8], plane: usize, out: &mut Vec<Run>) {
    out.clear();
    if plane >= WORTH_A_LOOK {
        let mut at = 0;
        for plane in planes.chunks_exact(plane) {
            let mut found = false;
            for piece in plane.chunks(PIECE) {
                let noise = is_noise(piece);
                found |= noise;
                add(out, at..at + piece.len(), noise);
                at += piece.len();
            }
            if !found {
                break;
            }
        }
    }
    let done = out.last().map_or(0, |run| run.bytes.end);
    if done < planes.len() || out.is_empty() {
        add(out, done..planes.len(), false);
    }
}

fn add(out: &mut Vec<Run>, bytes: Range<usize>, noise: bool) {
    match out.last_mut() {
        Some(last) if last.noise == noise => last.bytes.end = bytes.end,
        _ => out.push(Run { bytes, noise }),
    }
}

/// Whether almost nothing in the middle of `piece` repeats recent data, as deflate
/// would find it.
fn is_noise(piece: &[u8]) -> bool {
    let from = piece.len().saturating_sub(LOOK) / 2;
    let appearance = &piece[from..piece.len().min(from + LOOK)];
    let mut last = [[0; WORD]; 1 << 12];
    let mut repeats = 0;
    for word in appearance.array_windows::<WORD>() {
        let hash = u32::from_le_bytes(*word).wrapping_mul(0x9e37_79b1) >> 20;
        let last = &mut last[hash as usize];
        repeats += usize::from(last == word);
        *last = *word;
    }
    REPEATS * repeats < appearance.len()
}
