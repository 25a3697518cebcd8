//! Memory layout and division of the data to deflate.

use std::ops::Range;

use super::super::planes::Planes;
use wheelarm_codec::huffman::{HEADER_WORDS, SYMBOLS};
use wheelarm_proto::settings::Depth;

/// Number of streams: colour, depth, IDs.
pub(super) const STREAMS: usize = 3;
/// Index of the depth stream.
pub(super) const DEPTH: usize = 1;
/// Blocks of each stream: similar data shares codes. The bytes of one significance of
/// depth and IDs are consecutive.
const BLOCKS: [usize; STREAMS] = [4, 8, 2];
/// All blocks.
pub(super) const ALL_BLOCKS: usize = BLOCKS[0] + BLOCKS[1] + BLOCKS[2];
/// Words of a block's codes, number of header bits, and header.
pub(super) const BLOCK: usize = SYMBOLS + 1 + HEADER_WORDS;

/// Bytes of a segment, which one workgroup processes.
pub(super) const SEGMENT: usize = 8192;
/// Pieces of a segment.
pub(super) const PIECES: usize = 128;
/// Largest number of words of a piece: no code has more than 12 bits.
pub(super) const SLOT: usize = 24;
// The slot fits a piece of only the longest codes, and no reference exceeds the largest
// length.
const _: () = assert!(SEGMENT / PIECES * 12 <= SLOT * 32 && SEGMENT / PIECES < 258);
/// Largest distance of a reference.
pub(super) const WINDOW: usize = 32_768;
/// Largest number of workgroups along an axis.
const MOST_GROUPS: usize = 65_535;

/// `Stream` in the shader.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Stream {
    source: u32,
    bytes: u32,
    segment: u32,
    segments: u32,
    block: u32,
    blocks: u32,
    result: u32,
    room: u32,
    candidates: [u32; 8],
    known: u32,
    element: u32,
    unused: [u32; 2],
}

/// `Params` in the shader.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct Params {
    pixels: u32,
    depth: u32,
    ids: u32,
    segments: u32,
    streams: [Stream; STREAMS],
}

/// The layout of an image.
#[derive(Clone, Copy)]
pub(super) struct Layout {
    pub params: Params,
    source: usize,
    result: usize,
}

impl Layout {
    /// Layout for the planes of a packed image with depth in its stored form; `None`
    /// for too many pixels, or none.
    pub fn for_planes(planes: Planes, depth: Depth) -> Option<Self> {
        if planes.pixels == 0 {
            return None;
        }
        let ranges = planes.ranges();
        let kept = match depth {
            Depth::Metres => 4,
            Depth::Millimetres => 2,
            Depth::Nothing => 0,
        };
        // Bytes per element; colour is not split.
        let elements = [1, kept, 2];
        let lengths = [3, kept, 2].map(|bytes| bytes * planes.pixels);
        let [_, depth, ids] = ranges.clone().map(|range| (range.start / 4) as u32);
        let width = planes.width as usize;
        // The pixel before, the row above and its neighbours; distances beyond the
        // window are dropped.
        let [pixel, row] = [3, 3 * width];
        let near: [&[usize]; STREAMS] = [
            &[
                pixel,
                row,
                row + pixel,
                row.saturating_sub(pixel),
                2 * pixel,
                2 * row,
            ],
            &[1, width, width + 1, width.saturating_sub(1)],
            &[1, width, width + 1, width.saturating_sub(1)],
        ];
        let (mut segments, mut blocks, mut source, mut result) = (0, 0, 0, 0);
        let mut streams = [bytemuck::Zeroable::zeroed(); STREAMS];
        for (i, stream) in streams.iter_mut().enumerate() {
            let bytes = lengths[i];
            let own = bytes.div_ceil(SEGMENT);
            // Room for a typical compression ratio; larger streams are left to the CPU.
            let room = match i {
                0 => bytes / 2,
                1 => bytes / 8 * 5,
                _ => bytes / 4,
            };
            let room = if bytes > 0 { (room + 4096) / 4 } else { 1 };
            let (mut candidates, mut known) = ([0; 8], 0);
            for &far in near[i].iter().filter(|far| (1..=WINDOW).contains(*far)) {
                candidates[known] = far as u32;
                known += 1;
            }
            *stream = Stream {
                source: source as u32,
                bytes: u32::try_from(bytes).ok()?,
                segment: segments as u32,
                segments: own as u32,
                block: blocks as u32,
                // Zero blocks mean an empty stream.
                blocks: BLOCKS[i].min(own) as u32,
                result: result as u32,
                room: room as u32,
                candidates,
                known: known as u32,
                element: elements[i] as u32,
                unused: [0; 2],
            };
            // A few bytes beyond the last one are read.
            source += bytes.div_ceil(4) + 10;
            segments += own;
            blocks += BLOCKS[i];
            result += room;
        }
        if segments > MOST_GROUPS {
            return None;
        }
        Some(Self {
            params: Params {
                pixels: planes.pixels as u32,
                depth,
                ids,
                segments: segments as u32,
                streams,
            },
            source,
            result,
        })
    }

    pub fn segments(&self) -> usize {
        self.params.segments as usize
    }

    /// Workgroups that arrange the bytes.
    pub fn arranging(&self) -> [u32; 2] {
        let groups = self.source.div_ceil(256);
        let across = groups.min(MOST_GROUPS);
        [across as u32, groups.div_ceil(across) as u32]
    }

    /// Bytes of `source`, `slots`, `lengths`, `report`, `result`.
    pub fn buffers(&self) -> [u64; 5] {
        let segments = self.segments();
        [
            self.source,
            segments * SLOT * PIECES,
            segments * (PIECES + 1),
            self.report(),
            self.result,
        ]
        .map(|words| words as u64 * 4)
    }

    /// Words of `report`.
    fn report(&self) -> usize {
        4 + 2 * self.segments() + ALL_BLOCKS * SYMBOLS
    }

    /// Offset in the read-back data at which the report ends and the results begin,
    /// bytes.
    pub fn results(&self) -> usize {
        self.report() * 4
    }

    /// Bytes to read back.
    pub fn bytes(&self) -> usize {
        self.results() + self.result * 4
    }

    /// Whether a block is the last of its stream.
    pub fn is_last(&self, block: usize) -> bool {
        let mut streams = self.params.streams.iter();
        streams.any(|stream| (stream.block + stream.blocks) as usize == block + 1)
    }

    /// Whether there is data to deflate.
    pub fn has_data(&self, stream: usize) -> bool {
        self.params.streams[stream].bytes > 0
    }

    /// Bytes of an element of a stream.
    pub fn element(&self, stream: usize) -> usize {
        self.params.streams[stream].element as usize
    }

    /// Bytes of a stream of `bits` bits.
    pub fn length(bits: u32) -> usize {
        (bits as usize).div_ceil(8)
    }

    /// The sums of a stream's segments: two each, and the bytes of the segment.
    pub fn sums(&self, stream: usize) -> impl Iterator<Item = (usize, usize)> {
        let stream = &self.params.streams[stream];
        let (first, bytes) = (stream.segment as usize, stream.bytes as usize);
        (0..stream.segments as usize).map(move |i| {
            let length = (bytes - i * SEGMENT).min(SEGMENT);
            (4 + 2 * (first + i), length)
        })
    }

    /// Counted symbols of a block.
    pub fn counts(&self, block: usize) -> Range<usize> {
        let from = 4 + 2 * self.segments() + block * SYMBOLS;
        from..from + SYMBOLS
    }

    /// Range of a stream's result in the read-back data, bytes, with all its room.
    pub fn result(&self, stream: usize) -> Range<usize> {
        let stream = &self.params.streams[stream];
        let from = self.results() + stream.result as usize * 4;
        from..from + stream.room as usize * 4
    }
}
