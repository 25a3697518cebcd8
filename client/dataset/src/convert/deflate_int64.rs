//! Bytes as 64-bit little-endian integers, compressed for zlib: the layout in
//! which WheelArm-Sim keeps images is seven eighths zeros.
//!
//! A compressor that knows this looks at the bytes only, an eighth of the data.
//! A byte is a literal and one match for its zeros; the match goes on over bytes
//! that repeat those one element or one pixel before. RFC 1950, RFC 1951.

use std::cmp::Reverse;

/// Bytes in an element.
const ELEMENT: usize = 8;
/// Elements in the longest match, behind a literal and on its own.
const BEHIND_LITERAL: usize = 31;
const WHOLE: usize = 32;
/// Symbols of literals and lengths, and of distances.
const SYMBOLS: usize = 286;
const DISTANCES: usize = 10;
/// Ends a block.
const END: usize = 256;
/// Bits of the longest code.
const LONGEST: u8 = 15;
/// First length and extra bits of the symbols from 257 on; 258 has its own.
const LENGTHS: [(usize, u32); 28] = [
    (3, 0),
    (4, 0),
    (5, 0),
    (6, 0),
    (7, 0),
    (8, 0),
    (9, 0),
    (10, 0),
    (11, 1),
    (13, 1),
    (15, 1),
    (17, 1),
    (19, 2),
    (23, 2),
    (27, 2),
    (31, 2),
    (35, 3),
    (43, 3),
    (51, 3),
    (59, 3),
    (67, 4),
    (83, 4),
    (99, 4),
    (115, 4),
    (131, 5),
    (163, 5),
    (195, 5),
    (227, 5),
];

/// A literal, or a match of a length: back by an element, or by a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Token {
    Literal(u8),
    Near(u16),
    Far(u16),
}

impl Token {
    fn of(run: Run, more: usize) -> Self {
        // At most 256.
        let length = (ELEMENT * run.elements + more) as u16;
        if run.far {
            Self::Far(length)
        } else {
            Self::Near(length)
        }
    }
}

/// Elements that repeat those before them.
#[derive(Clone, Copy)]
struct Run {
    elements: usize,
    far: bool,
}

/// Compresses pieces of images; one per thread.
#[derive(Debug, Default)]
pub struct DeflateInt64 {
    bytes: Vec<u8>,
    tokens: Vec<Token>,
}

impl DeflateInt64 {
    /// Appends the zlib stream of `count` integers, those of `bytes` and then
    /// zeros, to `out`. `pixel` is how many bytes a pixel has: 3 or 4.
    pub fn append(&mut self, bytes: &[u8], count: usize, pixel: usize, out: &mut Vec<u8>) {
        self.bytes.clear();
        self.bytes.extend_from_slice(bytes);
        self.bytes.resize(count, 0);
        self.tokenise(pixel);
        // Deflate with a window of 32 KiB, compressed fast.
        out.extend([0x78, 0x01]);
        let mut bits = Bits::new(out);
        write(&self.tokens, pixel, &mut bits);
        bits.close();
        out.extend(adler(&self.bytes).to_be_bytes());
    }

    fn tokenise(&mut self, pixel: usize) {
        let bytes = self.bytes.as_slice();
        self.tokens.clear();
        let mut i = 0;
        while let Some(&byte) = bytes.get(i) {
            if i == 0 {
                self.tokens.push(Token::Literal(byte));
                self.tokens.extend([Token::Literal(0); ELEMENT - 1]);
                i = 1;
                continue;
            }
            let here = longest(bytes, i, i, pixel, WHOLE);
            if here.elements > 0 {
                self.tokens.push(Token::of(here, 0));
                i += here.elements;
                continue;
            }
            let behind = longest(bytes, i, i + 1, pixel, BEHIND_LITERAL);
            self.tokens.push(Token::Literal(byte));
            self.tokens.push(Token::of(behind, ELEMENT - 1));
            i += 1 + behind.elements;
        }
    }
}

/// The longest run from `from` on, in a match that begins in the element `at`.
fn longest(bytes: &[u8], at: usize, from: usize, pixel: usize, most: usize) -> Run {
    let run = |back: usize| {
        let there = bytes[from..].iter().zip(&bytes[from - back..]);
        there.take(most).take_while(|(a, b)| a == b).count()
    };
    let near = run(1);
    let far = if at >= pixel { run(pixel) } else { 0 };
    Run {
        elements: near.max(far),
        far: far > near,
    }
}

/// One block with codes of its own.
fn write(tokens: &[Token], pixel: usize, bits: &mut Bits<'_>) {
    // Distances of 8, 24 and 32 bytes.
    let (near, far) = match pixel {
        3 => ((5, 1, 1), (8, 7, 3)),
        _ => ((5, 1, 1), (9, 7, 3)),
    };
    let symbols: Vec<(usize, u32, u32)> = (0..=ELEMENT * WHOLE).map(length_symbol).collect();
    let mut counts = [0_u32; SYMBOLS];
    let mut ways = [0_u32; DISTANCES];
    counts[END] = 1;
    for token in tokens {
        match *token {
            Token::Literal(byte) => counts[usize::from(byte)] += 1,
            Token::Near(length) => {
                counts[symbols[usize::from(length)].0] += 1;
                ways[near.0] += 1;
            }
            Token::Far(length) => {
                counts[symbols[usize::from(length)].0] += 1;
                ways[far.0] += 1;
            }
        }
    }
    let lengths = code_lengths(&counts);
    // One or two distances, of one bit each.
    let way_lengths: [u8; DISTANCES] = std::array::from_fn(|k| u8::from(ways[k] > 0));
    let codes = codes(&lengths);
    let way_codes = self::codes(&way_lengths);

    // The last block, with codes of its own.
    bits.put(1, 1);
    bits.put(2, 2);
    bits.put((SYMBOLS - 257) as u32, 5);
    bits.put((DISTANCES - 1) as u32, 5);
    // The lengths of the codes have four bits each: 0 to 15, no runs.
    bits.put(19 - 4, 4);
    for k in 0..19 {
        bits.put(if k < 3 { 0 } else { 4 }, 3);
    }
    for &length in lengths.iter().chain(&way_lengths) {
        bits.put(u32::from(length).reverse_bits() >> 28, 4);
    }

    // Everything that a match writes, by its length.
    let whole = |(way, extra, width): (usize, u32, u32)| -> Vec<(u32, u32)> {
        let each = symbols.iter().map(|&(k, more, more_width)| {
            let parts = [
                (codes[k], u32::from(lengths[k])),
                (more, more_width),
                (way_codes[way], u32::from(way_lengths[way])),
                (extra, width),
            ];
            parts.iter().fold((0, 0), |(bits, count), part| {
                (bits | part.0 << count, count + part.1)
            })
        });
        each.collect()
    };
    let (near, far) = (whole(near), whole(far));
    for token in tokens {
        let (code, count) = match *token {
            Token::Literal(byte) => {
                let k = usize::from(byte);
                (codes[k], u32::from(lengths[k]))
            }
            Token::Near(length) => near[usize::from(length)],
            Token::Far(length) => far[usize::from(length)],
        };
        bits.put(code, count);
    }
    bits.put(codes[END], u32::from(lengths[END]));
}

/// Symbol, extra bits and their number of a match of `length` bytes.
fn length_symbol(length: usize) -> (usize, u32, u32) {
    let at = LENGTHS.partition_point(|l| l.0 <= length).max(1) - 1;
    let (first, width) = LENGTHS[at];
    (257 + at, length.saturating_sub(first) as u32, width)
}

/// Lengths of Huffman codes; 0 for values that do not occur.
fn code_lengths(counts: &[u32; SYMBOLS]) -> [u8; SYMBOLS] {
    let mut counts = *counts;
    loop {
        let lengths = huffman(&counts);
        if lengths.iter().all(|&l| l <= LONGEST) {
            return lengths;
        }
        // Flatter counts have shorter codes.
        for count in &mut counts {
            *count = count.div_ceil(2);
        }
    }
}

fn huffman(counts: &[u32; SYMBOLS]) -> [u8; SYMBOLS] {
    let mut leaves: Vec<(u32, usize)> = (0..SYMBOLS)
        .filter(|&k| counts[k] > 0)
        .map(|k| (counts[k], k))
        .collect();
    // The rarest at the end.
    leaves.sort_unstable_by_key(|&leaf| Reverse(leaf));
    let mut lengths = [0; SYMBOLS];
    // Nodes in the order of their making, which is that of their weights;
    // parents by number, leaves first.
    let count = leaves.len();
    let weights: Vec<u32> = leaves.iter().rev().map(|l| l.0).collect();
    let mut inner: Vec<u32> = Vec::with_capacity(count);
    let mut parent = vec![0; 2 * count];
    let (mut leaf, mut node) = (0, 0);
    while inner.len() + 1 < count {
        let mut weight = 0;
        for _ in 0..2 {
            let leaf_first = match (weights.get(leaf), inner.get(node)) {
                (Some(a), Some(b)) => a <= b,
                (Some(_), None) => true,
                (None, _) => false,
            };
            let child = if leaf_first {
                weight += weights[leaf];
                leaf += 1;
                leaf - 1
            } else {
                weight += inner[node];
                node += 1;
                count + node - 1
            };
            parent[child] = count + inner.len();
        }
        inner.push(weight);
    }
    let nodes = count + inner.len();
    let mut depth = vec![0_u8; nodes];
    for k in (0..nodes.saturating_sub(1)).rev() {
        depth[k] = depth[parent[k]].saturating_add(1);
    }
    for (k, (_, symbol)) in leaves.iter().rev().enumerate() {
        lengths[*symbol] = depth[k].max(1);
    }
    lengths
}

/// The canonical codes of lengths, first bit lowest.
fn codes<const N: usize>(lengths: &[u8; N]) -> [u32; N] {
    let mut counts = [0_u32; LONGEST as usize + 1];
    for &length in lengths.iter().filter(|&&l| l > 0) {
        counts[usize::from(length)] += 1;
    }
    let mut next = [0_u32; LONGEST as usize + 1];
    for length in 1..next.len() {
        next[length] = (next[length - 1] + counts[length - 1]) << 1;
    }
    lengths.map(|length| {
        if length == 0 {
            return 0;
        }
        let code = next[usize::from(length)];
        next[usize::from(length)] += 1;
        code.reverse_bits() >> (32 - u32::from(length))
    })
}

/// Bits, the lowest first.
struct Bits<'a> {
    out: &'a mut Vec<u8>,
    held: u64,
    count: u32,
}

impl<'a> Bits<'a> {
    fn new(out: &'a mut Vec<u8>) -> Self {
        Self {
            out,
            held: 0,
            count: 0,
        }
    }

    /// At most 32 bits.
    #[inline]
    fn put(&mut self, bits: u32, count: u32) {
        self.held |= u64::from(bits) << self.count;
        self.count += count;
        if self.count >= 32 {
            self.out.extend((self.held as u32).to_le_bytes());
            self.held >>= 32;
            self.count -= 32;
        }
    }

    fn close(self) {
        let bytes = self.held.to_le_bytes();
        let count = self.count.div_ceil(8) as usize;
        self.out.extend_from_slice(&bytes[..count]);
    }
}

/// Adler-32 of the integers.
fn adler(bytes: &[u8]) -> u32 {
    const MODULUS: u64 = 65_521;
    let (mut a, mut b) = (1_u64, 0_u64);
    for part in bytes.chunks(1 << 16) {
        for &byte in part {
            a += u64::from(byte);
            b += ELEMENT as u64 * a;
        }
        a %= MODULUS;
        b %= MODULUS;
    }
    (b << 16 | a) as u32
}

#[cfg(test)]
mod tests {
    use libdeflater::Decompressor;
    use proptest::prelude::*;

    use super::*;

    fn back(bytes: &[u8], count: usize, pixel: usize) -> Vec<u8> {
        let mut stream = Vec::new();
        DeflateInt64::default().append(bytes, count, pixel, &mut stream);
        let mut out = vec![0; ELEMENT * count];
        let length = Decompressor::new()
            .zlib_decompress(&stream, &mut out)
            .unwrap();
        assert_eq!(length, out.len());
        out
    }

    fn wide(bytes: &[u8], count: usize) -> Vec<u8> {
        let mut out: Vec<u8> = bytes
            .iter()
            .flat_map(|&b| [b, 0, 0, 0, 0, 0, 0, 0])
            .collect();
        out.resize(ELEMENT * count, 0);
        out
    }

    /// Bytes with runs, pixels that repeat, and noise.
    fn pieces() -> impl Strategy<Value = Vec<u8>> {
        let piece = (
            prop::collection::vec(any::<u8>(), 1..9),
            prop_oneof![Just(1_usize), 1_usize..90],
        );
        prop::collection::vec(piece, 1..40).prop_map(|pieces| {
            let all = pieces.into_iter().map(|(part, times)| part.repeat(times));
            all.flatten().collect::<Vec<u8>>()
        })
    }

    proptest! {
        #[test]
        fn compressed_bytes_are_read_back_as_integers(
            bytes in pieces(), zeros in 0_usize..300, pixel in 3_usize..5,
        ) {
            let count = bytes.len() + zeros;
            prop_assert_eq!(back(&bytes, count, pixel), wide(&bytes, count));
        }
    }

    #[test]
    fn codes_stay_within_their_longest_when_counts_grow_like_fibonaccis() {
        // Byte k occurs as often as the k-th Fibonacci number.
        let mut bytes = Vec::new();
        let (mut a, mut b) = (1_usize, 1_usize);
        for k in 0..22_u8 {
            for i in 0..a {
                // The second byte of a pair keeps runs away.
                bytes.extend([k, 100 + (i % 7) as u8]);
            }
            (a, b) = (b, a + b);
        }
        assert_eq!(back(&bytes, bytes.len(), 3), wide(&bytes, bytes.len()));
    }

    #[test]
    fn one_value_alone_can_be_compressed() {
        assert_eq!(back(&[7], 1, 3), wide(&[7], 1));
        assert_eq!(back(&[0; 5400], 5400, 4), wide(&[0; 5400], 5400));
    }
}
