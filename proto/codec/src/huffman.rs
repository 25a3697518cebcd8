//! Huffman codes of deflate blocks that another encoder fills, computed before the
//! symbols are known (RFC 1951, 3.2.7).

/// Number of literals, end of block, and lengths.
pub const LITERALS: usize = 286;
/// Number of distances.
pub const DISTANCES: usize = 30;
/// Symbols of a block: literals and lengths, then distances.
pub const SYMBOLS: usize = LITERALS + DISTANCES;
/// Symbol that ends a block.
pub const END_OF_BLOCK: usize = 256;
/// Largest number of bits of a code; deflate allows 15.
pub const LONGEST: usize = 12;
/// Words that fit any header.
pub const HEADER_WORDS: usize = 73;

/// Number of symbols for code lengths, which a header stores in coded form.
const LENGTHS: usize = 19;
/// Their order in a header.
const ORDER: [usize; LENGTHS] = [
    16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15,
];

/// Coding of the symbols of a block. Every symbol has a code, including those that were
/// never counted.
#[derive(Clone, Debug)]
pub struct Block {
    /// Code of each symbol as stored in the stream, first bit lowest, and its number of
    /// bits from bit 16 on.
    pub codes: [u32; SYMBOLS],
    /// Block header, first bit lowest.
    pub header: [u32; HEADER_WORDS],
    /// Number of header bits.
    pub header_bits: u32,
}

impl Block {
    /// Codes for symbols with these expected counts; `last`: the block ends its stream.
    #[must_use]
    pub fn from_counts(counts: &[u32; SYMBOLS], last: bool) -> Self {
        let (literals, distances) = counts.split_at(LITERALS);
        let mut lengths = code_lengths(literals, LONGEST);
        lengths.extend(code_lengths(distances, LONGEST));
        let mut codes = [0; SYMBOLS];
        let (first, second) = codes.split_at_mut(LITERALS);
        assign(&lengths[..LITERALS], first);
        assign(&lengths[LITERALS..], second);

        let mut used = [0; LENGTHS];
        for &length in &lengths {
            used[usize::from(length)] += 1;
        }
        let of_lengths = code_lengths(&used, 7);
        let mut length_codes = [0; LENGTHS];
        assign(&of_lengths, &mut length_codes);
        let mut header = Bits::default();
        header.put(u32::from(last), 1);
        // Dynamic codes.
        header.put(2, 2);
        header.put((LITERALS - 257) as u32, 5);
        header.put((DISTANCES - 1) as u32, 5);
        header.put((LENGTHS - 4) as u32, 4);
        for symbol in ORDER {
            header.put(u32::from(of_lengths[symbol]), 3);
        }
        for length in lengths {
            let code = length_codes[usize::from(length)];
            header.put(code & 0xffff, code >> 16);
        }
        Self {
            codes,
            header: header.words,
            header_bits: header.count,
        }
    }
}

/// Bits in words, first bit lowest.
struct Bits {
    words: [u32; HEADER_WORDS],
    count: u32,
}

impl Default for Bits {
    fn default() -> Self {
        Self {
            words: [0; HEADER_WORDS],
            count: 0,
        }
    }
}

impl Bits {
    fn put(&mut self, value: u32, bits: u32) {
        let (word, shift) = (self.count as usize / 32, self.count % 32);
        let value = u64::from(value) << shift;
        self.words[word] |= value as u32;
        if let Some(next) = self.words.get_mut(word + 1) {
            *next |= (value >> 32) as u32;
        }
        self.count += bits;
    }
}

/// Number of bits of each symbol's code, at most `limit`, by Huffman's algorithm;
/// uncounted symbols count as one. Needs two symbols and a `limit` that can distinguish
/// all of them.
fn code_lengths(counts: &[u32], limit: usize) -> Vec<u8> {
    let total: u64 = counts.iter().map(|&count| u64::from(count)).sum();
    let mut least = (total >> limit).max(1);
    loop {
        let lengths = huffman(counts, least);
        if lengths.iter().all(|&length| usize::from(length) <= limit) {
            return lengths;
        }
        // Inaccurate counts of rare symbols cost less than too long a code.
        least *= 2;
    }
}

/// Huffman code lengths with a minimum count of `least`.
fn huffman(counts: &[u32], least: u64) -> Vec<u8> {
    let weight = |symbol: usize| u64::from(counts[symbol]).max(least);
    let mut leaves: Vec<usize> = (0..counts.len()).collect();
    leaves.sort_by_key(|&symbol| (weight(symbol), symbol));
    // Inner nodes, lightest first in order of creation: (weight, parent).
    let mut nodes: Vec<(u64, usize)> = Vec::with_capacity(counts.len());
    let mut parents = vec![0; counts.len()];
    let (mut leaf, mut node) = (0, 0);
    while nodes.len() + 1 < counts.len() {
        let made = nodes.len();
        let mut sum = 0;
        for _ in 0..2 {
            let next_leaf = leaves.get(leaf).map(|&symbol| weight(symbol));
            let next_node = nodes.get(node).map(|&(weight, _)| weight);
            match (next_leaf, next_node) {
                (Some(light), other) if other.is_none_or(|other| light <= other) => {
                    sum += light;
                    parents[leaves[leaf]] = made;
                    leaf += 1;
                }
                (_, Some(light)) => {
                    sum += light;
                    nodes[node].1 = made;
                    node += 1;
                }
                (_, None) => {}
            }
        }
        nodes.push((sum, 0));
    }
    // The last node is the root; every parent follows its children.
    let mut depths = vec![0_u8; nodes.len()];
    for i in (0..nodes.len().saturating_sub(1)).rev() {
        depths[i] = depths[nodes[i].1].saturating_add(1);
    }
    let depth = |&parent: &usize| depths[parent].saturating_add(1);
    parents.iter().map(depth).collect()
}

/// The codes that follow from their lengths (RFC 1951, 3.2.2), bit-reversed.
fn assign(lengths: &[u8], codes: &mut [u32]) {
    let mut of_bits = [0_u32; 16];
    for &length in lengths {
        of_bits[usize::from(length)] += 1;
    }
    let (mut next, mut code) = ([0_u32; 16], 0);
    for bits in 1..next.len() {
        next[bits] = code;
        code = (code + of_bits[bits]) << 1;
    }
    for (&length, code) in lengths.iter().zip(codes) {
        let next = &mut next[usize::from(length)];
        let bits = u32::from(length);
        *code = next.reverse_bits() >> (32 - bits) | bits << 16;
        *next += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counts(of: impl Fn(usize) -> u32) -> [u32; SYMBOLS] {
        std::array::from_fn(of)
    }

    /// Encodes with the codes and inflates with a standard inflater.
    fn inflated(block: &Block, symbols: &[usize], length: usize) -> Vec<u8> {
        let mut bits: Vec<bool> = Vec::new();
        let mut put = |value: u32, count: u32| bits.extend((0..count).map(|i| value >> i & 1 == 1));
        for (i, word) in block.header.iter().enumerate() {
            put(
                *word,
                block.header_bits.saturating_sub(32 * i as u32).min(32),
            );
        }
        for &symbol in symbols {
            put(block.codes[symbol] & 0xffff, block.codes[symbol] >> 16);
        }
        let byte = |bits: &[bool]| {
            (0..8)
                .map(|i| u8::from(bits.get(i) == Some(&true)) << i)
                .sum()
        };
        let stream: Vec<u8> = bits.chunks(8).map(byte).collect();
        let mut out = vec![0; length];
        let got = libdeflater::Decompressor::new().deflate_decompress(&stream, &mut out);
        assert_eq!(got, Ok(length));
        out
    }

    #[test]
    fn every_symbol_survives_a_round_trip() {
        let rare = counts(|_| 0);
        let steep = counts(|i| 1 << (i % 31).min(30));
        let one = counts(|i| if i == 65 { u32::MAX } else { 0 });
        let even = counts(|_| 1000);
        for counts in [rare, steep, one, even] {
            let block = Block::from_counts(&counts, true);
            assert!(block.codes.iter().all(|code| code >> 16 <= LONGEST as u32));
            let mut symbols: Vec<usize> = (0..256).collect();
            let mut expected: Vec<u8> = (0..=255).collect();
            // Three bytes at distances one to four: lengths and distances without extra
            // bits.
            for distance in 0..4 {
                symbols.extend([257, LITERALS + distance]);
                for _ in 0..3 {
                    expected.push(expected[expected.len() - 1 - distance]);
                }
            }
            symbols.push(END_OF_BLOCK);
            assert_eq!(inflated(&block, &symbols, expected.len()), expected);
        }
    }

    #[test]
    fn frequent_symbols_have_short_codes() {
        let counts = counts(|i| match i {
            0 => 1_000_000,
            1..=3 => 10_000,
            _ => 3,
        });
        let block = Block::from_counts(&counts, false);
        let bits = |symbol: usize| block.codes[symbol] >> 16;
        assert_eq!(bits(0), 1);
        assert!(bits(0) < bits(1) && bits(1) < bits(100));
        // Kraft's sum of a complete code is one.
        let sum: f64 = (0..LITERALS).map(|i| 0.5_f64.powi(bits(i) as i32)).sum();
        assert_eq!(sum, 1.0);
        let all = (LITERALS..SYMBOLS).map(|i| 0.5_f64.powi(bits(i) as i32));
        assert_eq!(all.sum::<f64>(), 1.0);
    }
}
