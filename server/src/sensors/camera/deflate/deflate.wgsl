// Deflates the planes of a packed image (RFC 1951). HASH_BITS and the constants of
// `layout.rs` (segments, pieces, blocks) are prepended.
//
// Each plane is a stream of its own. A workgroup processes one segment, an invocation
// one piece. No piece refers to later bytes, so all run in parallel. The codes are
// fixed beforehand, from the counts of an earlier image; the counts of this one serve
// later images.
//
//   arrange   orders the bytes for deflation
//   parse     encodes pieces to bits, each in its own slot
//   sum       finds the first bit of each segment
//   place     copies bits from their slots to the stream

const STREAMS = 3u;
const PIECE = SEGMENT / PIECES;
// Shortest match that is worth a reference, bytes.
const LEAST = 4u;
const CANDIDATES = 6u;
// A match of this many bytes ends the search.
const ENOUGH = 32u;
const LITERALS = 286u;
const END_OF_BLOCK = 256u;
// Places of the length of a block's header and of the header, behind its codes.
const HEADER_BITS = SYMBOLS;
const HEADER_AT = SYMBOLS + 1u;
// The sums of Adler-32 (RFC 1950).
const ADLER = 65521u;
// A zlib stream's first two bytes: deflate, 32 KiB, fastest.
const ZLIB = 0x0178u;
// Two rows in a word.
const TABLE = 1u << (HASH_BITS - 1u);
// A place has 15 bits: no segment looks farther back than WINDOW - SEGMENT.
const TAG_BITS = 1u;
const SAME = CANDIDATES * SEGMENT / 32u;

struct Stream {
    // First word of its bytes in `source`, and their number.
    source: u32,
    bytes: u32,
    // Segments and blocks: the first, and how many.
    segment: u32,
    segments: u32,
    block: u32,
    blocks: u32,
    // First word of the result, and how many there is room for.
    result: u32,
    room: u32,
    // Likely match distances, bytes, and their number.
    candidates: array<vec4<u32>, 2>,
    known: u32,
    // Bytes of an element.
    element: u32,
}

struct Params {
    // Pixels; first words of depth and ids in `packed`.
    pixels: u32,
    depth: u32,
    ids: u32,
    segments: u32,
    streams: array<Stream, STREAMS>,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> packed: array<u32>;
@group(0) @binding(2) var<storage, read_write> source: array<u32>;
@group(0) @binding(3) var<storage, read_write> slots: array<u32>;
// Bits of each piece; then of each segment, later the bit where it begins.
@group(0) @binding(4) var<storage, read_write> lengths: array<u32>;
@group(0) @binding(5) var<storage, read> codes: array<u32>;
// Bits of each stream, two sums of each segment's bytes, symbols of each block.
@group(0) @binding(6) var<storage, read_write> counts: array<atomic<u32>>;
@group(0) @binding(7) var<storage, read_write> result: array<atomic<u32>>;

fn sums_at(segment: u32) -> u32 {
    return 4u + 2u * segment;
}

fn counts_at(block: u32) -> u32 {
    return 4u + 2u * params.segments + block * SYMBOLS;
}

fn stream_of(segment: u32) -> u32 {
    return u32(segment >= params.streams[1].segment) + u32(segment >= params.streams[2].segment);
}

// The block of a stream's segment, counted from its first.
fn block_of(s: u32, segment: u32) -> u32 {
    return segment * params.streams[s].blocks / params.streams[s].segments;
}

fn begins_block(s: u32, segment: u32) -> bool {
    return segment == 0u || block_of(s, segment - 1u) != block_of(s, segment);
}

fn ends_block(s: u32, segment: u32) -> bool {
    return segment + 1u == params.streams[s].segments
        || block_of(s, segment + 1u) != block_of(s, segment);
}

// Byte `at` of depth or ids as HDF5 shuffles them: first the first byte of all.
fn shuffled(first: u32, size: u32, at: u32) -> u32 {
    let byte = at % params.pixels * size + at / params.pixels;
    return (packed[first + byte / 4u] >> (byte % 4u * 8u)) & 0xffu;
}

// Metres, by their bits, as 16-bit millimetres, rounded to the nearest: 0 where nothing
// was hit or it is too far, at least 1 where something was. By whole numbers, as
// `wheelarm-codec` does it by IEEE 754: a graphics card may round a product otherwise.
fn millimetres(metres: u32) -> u32 {
    // Nothing, or infinite, not a number, negative.
    if metres == 0u || metres >= 0x7f800000u {
        return 0u;
    }
    // A thousand times 24 bits: 33 bits or 34, of which the upper 24 stay.
    let mantissa = (metres & 0x7fffffu) | 0x800000u;
    let low = (mantissa & 0xfffu) * 1000u;
    let high = (mantissa >> 12u) * 1000u + (low >> 12u);
    let less = 9u + u32(high >= 0x200000u);
    let rest = low & ((1u << less) - 1u);
    let half = 1u << (less - 1u);
    var product = (high << (12u - less)) | ((low & 0xfffu) >> less);
    product += u32(rest > half || (rest == half && (product & 1u) == 1u));
    // Less than half a millimetre; more than 65 535 of them.
    let exponent = (metres >> 23u) + less;
    if exponent < 125u {
        return 1u;
    }
    if exponent > 142u || (exponent == 142u && product >= 131071u * 128u) {
        return 0u;
    }
    let shift = 150u - exponent;
    return max((product + (1u << (shift - 1u))) >> shift, 1u);
}

// Byte `at` of depth as it is kept, shuffled.
fn depth_byte(at: u32) -> u32 {
    if params.streams[1].element == 4u {
        return shuffled(params.depth, 4u, at);
    }
    let value = millimetres(packed[params.depth + at % params.pixels]);
    return (value >> (at / params.pixels * 8u)) & 0xffu;
}

@compute @workgroup_size(256) fn arrange(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let word = (group.y * groups.x + group.x) * 256u + local;
    if word >= arrayLength(&source) {
        return;
    }
    let s = u32(word >= params.streams[1].source) + u32(word >= params.streams[2].source);
    let at = (word - params.streams[s].source) * 4u;
    let bytes = params.streams[s].bytes;
    var all = 0u;
    for (var i = 0u; i < 4u; i++) {
        if at + i >= bytes {
            break;
        }
        var byte = 0u;
        switch s {
            case 0u: { byte = (packed[at / 4u] >> (i * 8u)) & 0xffu; }
            case 1u: { byte = depth_byte(at + i); }
            default: { byte = shuffled(params.ids, 2u, at + i); }
        }
        all |= byte << (i * 8u);
    }
    source[word] = all;
}

// Of five bytes, the last in the lowest byte of `fifth`.
fn hash(four: u32, fifth: u32) -> u32 {
    return (four ^ ((fifth & 0xffu) * 0x85ebca6bu)) * 0x9e3779b1u;
}

// Row of a hash in the table, and the tag that tells it from others there. It saves
// most useless look-ups.
fn row(hash: u32) -> u32 {
    return hash >> (32u - HASH_BITS);
}

fn tag(hash: u32) -> u32 {
    return (hash >> (32u - HASH_BITS - TAG_BITS)) & ((1u << TAG_BITS) - 1u);
}

// The four bytes from byte `i` of the first word on.
fn four_of(low: u32, high: u32, i: u32) -> u32 {
    if i == 0u {
        return low;
    }
    return (low >> (i * 8u)) | (high << (32u - i * 8u));
}

// A bit for each byte that is 0.
fn zeros(word: u32) -> u32 {
    var any = word | (word >> 4u);
    any |= any >> 2u;
    any |= any >> 1u;
    let none = ~any & 0x01010101u;
    return (none | (none >> 7u) | (none >> 14u) | (none >> 21u)) & 15u;
}

// Per row the last position before the segment, counted from one and from the start of
// the window, and its tag: 16 bits. Small, so that several workgroups share a
// processor: all wait for memory.
var<workgroup> last: array<atomic<u32>, TABLE>;
// Per candidate one bit per byte of the segment: is it equal to the earlier byte?
var<workgroup> same: array<u32, SAME>;
// Per symbol its code (12 bits), the code's length (4 bits) and its count.
var<workgroup> symbols: array<atomic<u32>, SYMBOLS>;
// Two sums of the segment's bytes; its bits.
var<workgroup> sums: array<atomic<u32>, 3>;

// Number of equal bytes from `at` and from `before` on, at most `most`. Sixteen at a
// time: each look-up waits for memory.
fn alike(at: u32, before: u32, most: u32) -> u32 {
    var count = 0u;
    while count < most {
        let there = (before + count) / 4u;
        let here = (at + count) / 4u;
        let a = vec4(source[there], source[there + 1u], source[there + 2u], source[there + 3u]);
        let b = vec4(source[here], source[here + 1u], source[here + 2u], source[here + 3u]);
        var differ = shifted(a, source[there + 4u], before % 4u)
            ^ shifted(b, source[here + 4u], at % 4u);
        if any(differ != vec4(0u)) {
            var i = 0u;
            while differ[i] == 0u {
                i++;
            }
            count += i * 4u + countTrailingZeros(differ[i]) / 8u;
            break;
        }
        count += 16u;
    }
    return min(count, most);
}

// The sixteen bytes from byte `i` of `words` on; `next` follows them.
fn shifted(words: vec4<u32>, next: u32, i: u32) -> vec4<u32> {
    if i == 0u {
        return words;
    }
    return (words >> vec4(i * 8u)) | (vec4(words.yzw, next) << vec4(32u - i * 8u));
}

// Records a position under its hash, in the row's first or second half. The first are
// recorded before the second, so the greatest word is the last position.
fn note(half: u32, hash: u32, place: u32) {
    let at = row(hash);
    if (at & 1u) != half {
        return;
    }
    let entry = (place << TAG_BITS) | tag(hash);
    if half == 0u {
        atomicMax(&last[at / 2u], entry);
    } else {
        atomicMax(&last[at / 2u], (entry << 16u) | (atomicLoad(&last[at / 2u]) & 0xffffu));
    }
}

// Position recorded last under a hash, or 0.
fn noted(hash: u32) -> u32 {
    let at = row(hash);
    let entry = (atomicLoad(&last[at / 2u]) >> ((at & 1u) * 16u)) & 0xffffu;
    return select(0u, entry >> TAG_BITS, (entry & ((1u << TAG_BITS) - 1u)) == tag(hash));
}

// The candidate's bit, when enough bytes from `at` of the segment on match it for a
// reference.
fn worth(candidate: u32, at: u32) -> u32 {
    let differ = ~same[candidate * (SEGMENT / 32u) + at / 32u] >> (at % 32u);
    return u32((differ & 15u) == 0u) << candidate;
}

// Number of bytes from `at` of the segment on that match a candidate.
fn repeats(candidate: u32, at: u32, most: u32) -> u32 {
    var word = candidate * (SEGMENT / 32u) + at / 32u;
    var differ = ~same[word] >> (at % 32u);
    if differ != 0u {
        return min(countTrailingZeros(differ), most);
    }
    var count = 32u - at % 32u;
    while count < most {
        word += 1u;
        differ = ~same[word];
        if differ != 0u {
            count += countTrailingZeros(differ);
            break;
        }
        count += 32u;
    }
    return min(count, most);
}

// Bits that are not yet written to a slot.
struct Bits {
    slot: u32,
    words: u32,
    waiting: u32,
    count: u32,
}

// Less than 32 of them.
fn put(bits: ptr<function, Bits>, value: u32, count: u32) {
    (*bits).waiting |= value << (*bits).count;
    (*bits).count += count;
    if (*bits).count >= 32u {
        slots[(*bits).slot + (*bits).words * PIECES] = (*bits).waiting;
        (*bits).words += 1u;
        (*bits).count -= 32u;
        (*bits).waiting = value >> (count - (*bits).count);
    }
}

// A symbol, and further bits behind it.
fn put_symbol(bits: ptr<function, Bits>, symbol: u32, value: u32, more: u32) {
    let code = atomicAdd(&symbols[symbol], 1u << 16u);
    let count = (code >> 12u) & 15u;
    put(bits, (code & 0xfffu) | (value << count), count + more);
}

@compute @workgroup_size(256) fn parse(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let s = stream_of(group.x);
    let segment = group.x - params.streams[s].segment;
    let first = params.streams[s].source * 4u;
    let begin = segment * SEGMENT;
    let end = min(begin + SEGMENT, params.streams[s].bytes);
    let block = params.streams[s].block + block_of(s, segment);
    let words = params.streams[s].source + begin / 4u;
    let candidates = params.streams[s].known;
    for (var i = local; i < TABLE; i += 256u) {
        atomicStore(&last[i], 0u);
    }
    for (var i = local; i < SYMBOLS; i += 256u) {
        let code = codes[block * BLOCK + i];
        atomicStore(&symbols[i], (code & 0xfffu) | ((code >> 16u) << 12u));
    }
    if local < 3u {
        atomicStore(&sums[local], 0u);
    }
    workgroupBarrier();

    // The window before the segment, four bytes at a time. Of a run of equal hashes
    // only the last counts.
    let start = max(begin + SEGMENT, WINDOW) - WINDOW;
    for (var half = 0u; half < 2u; half++) {
        for (var word = start / 4u + local; word < begin / 4u; word += 256u) {
            let low = source[params.streams[s].source + word];
            let high = source[params.streams[s].source + word + 1u];
            let place = word * 4u - start + 1u;
            let b = hash(four_of(low, high, 1u), high >> 8u);
            let d = hash(four_of(low, high, 3u), high >> 24u);
            let a = hash(low, high);
            let c = hash(four_of(low, high, 2u), high >> 16u);
            if a != b {
                note(half, a, place);
            }
            if b != c {
                note(half, b, place + 1u);
            }
            if c != d {
                note(half, c, place + 2u);
            }
            note(half, d, place + 3u);
        }
        workgroupBarrier();
    }

    // 32 bytes each: their sums, and where they match a candidate.
    let own = begin + local * 32u;
    var sum = 0u;
    var weighted = 0u;
    for (var i = 0u; i < 32u && own + i < end; i++) {
        let value = (source[words + local * 8u + i / 4u] >> (i % 4u * 8u)) & 0xffu;
        sum += value;
        weighted += value * (end - own - i);
    }
    atomicAdd(&sums[0], sum);
    atomicAdd(&sums[1], weighted % ADLER);
    for (var candidate = 0u; candidate < CANDIDATES; candidate++) {
        let far = params.streams[s].candidates[candidate / 4u][candidate % 4u];
        var bits = 0u;
        if candidate < candidates && own >= far && own < end {
            let before = first + own - far;
            var low = source[before / 4u];
            for (var i = 0u; i < 8u; i++) {
                let high = source[before / 4u + i + 1u];
                let differ = source[words + local * 8u + i] ^ four_of(low, high, before % 4u);
                bits |= zeros(differ) << (i * 4u);
                low = high;
            }
        }
        same[candidate * (SEGMENT / 32u) + local] = bits;
    }
    workgroupBarrier();

    if local < PIECES {
        var bits = Bits(group.x * SLOT * PIECES + local, 0u, 0u, 0u);
        var at = local * PIECE;
        let behind = min(at + PIECE, end - begin);
        while at < behind {
            let most = behind - at;
            let low = source[words + at / 4u];
            let high = source[words + at / 4u + 1u];
            var length = 0u;
            var distance = 0u;
            // Read together, because each read waits for memory.
            var any = (worth(0u, at) | worth(1u, at)) | (worth(2u, at) | worth(3u, at))
                | (worth(4u, at) | worth(5u, at));
            while any != 0u {
                let i = countTrailingZeros(any);
                any &= any - 1u;
                let found = repeats(i, at, most);
                if found > length {
                    length = found;
                    distance = params.streams[s].candidates[i / 4u][i % 4u];
                }
            }
            if length < ENOUGH && most >= LEAST {
                let own = hash(four_of(low, high, at % 4u), high >> (at % 4u * 8u));
                let place = noted(own);
                if place > 0u {
                    let before = start + place - 1u;
                    let found = alike(first + begin + at, first + before, most);
                    // Mostly the distance is longer.
                    if found >= LEAST && found > length + u32(length >= LEAST) {
                        length = found;
                        distance = begin + at - before;
                    }
                }
            }
            // A literal, or a length and a distance.
            var symbol = (low >> (at % 4u * 8u)) & 0xffu;
            var more = 0u;
            let refers = length >= LEAST;
            length = select(1u, length, refers);
            let long = length - 3u;
            if refers {
                more = max(firstLeadingBit(long | 1u), 2u) - 2u;
                symbol = 257u + more * 4u + (long >> more);
            }
            put_symbol(&bits, symbol, long & ((1u << more) - 1u), more);
            if refers {
                let far = distance - 1u;
                let more = max(firstLeadingBit(far | 1u), 1u) - 1u;
                let symbol = LITERALS + more * 2u + (far >> more);
                put_symbol(&bits, symbol, far & ((1u << more) - 1u), more);
            }
            at += length;
        }
        if bits.count > 0u {
            slots[bits.slot + bits.words * PIECES] = bits.waiting;
        }
        lengths[group.x * PIECES + local] = bits.words * 32u + bits.count;
        atomicAdd(&sums[2], bits.words * 32u + bits.count);
    }
    workgroupBarrier();
    if local == 0u {
        var bits = atomicLoad(&sums[2]);
        if begins_block(s, segment) {
            bits += codes[block * BLOCK + HEADER_BITS];
        }
        if ends_block(s, segment) {
            bits += codes[block * BLOCK + END_OF_BLOCK] >> 16u;
        }
        lengths[params.segments * PIECES + group.x] = bits;
        atomicStore(&counts[sums_at(group.x)], atomicLoad(&sums[0]) % ADLER);
        atomicStore(&counts[sums_at(group.x) + 1u], atomicLoad(&sums[1]) % ADLER);
    }
    for (var i = local; i < SYMBOLS; i += 256u) {
        let count = atomicLoad(&symbols[i]) >> 16u;
        if count > 0u {
            atomicAdd(&counts[counts_at(block) + i], count);
        }
    }
}

var<workgroup> parts: array<u32, 256>;

// The sum of the values of all invocations up to this one.
fn up_to(local: u32, value: u32) -> u32 {
    parts[local] = value;
    workgroupBarrier();
    for (var far = 1u; far < 256u; far *= 2u) {
        var before = 0u;
        if local >= far {
            before = parts[local - far];
        }
        workgroupBarrier();
        parts[local] += before;
        workgroupBarrier();
    }
    return parts[local];
}

@compute @workgroup_size(256) fn sum(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let s = group.x;
    let segments = params.streams[s].segments;
    let each = (segments + 255u) / 256u;
    let start = min(local * each, segments);
    let behind = min(start + each, segments);
    let first = params.segments * PIECES + params.streams[s].segment;
    var bits = 0u;
    for (var i = start; i < behind; i++) {
        bits += lengths[first + i];
    }
    // Behind the first bytes of zlib.
    let all = 16u + up_to(local, bits);
    if local == 255u {
        atomicStore(&counts[s], all);
    }
    var at = all - bits;
    for (var i = start; i < behind; i++) {
        let length = lengths[first + i];
        lengths[first + i] = at;
        at += length;
    }
}

// Adds a word to the stream `s`, of which bits beyond `count` are 0.
fn lay(s: u32, at: u32, value: u32, count: u32) {
    let room = params.streams[s].room;
    let word = at / 32u;
    let shift = at % 32u;
    let first = params.streams[s].result + word;
    if word < room {
        atomicOr(&result[first], value << shift);
    }
    if shift + count > 32u && word + 1u < room {
        atomicOr(&result[first + 1u], value >> (32u - shift));
    }
}

@compute @workgroup_size(256) fn place(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let s = stream_of(group.x);
    let segment = group.x - params.streams[s].segment;
    let block = (params.streams[s].block + block_of(s, segment)) * BLOCK;
    let begin = lengths[params.segments * PIECES + group.x];
    let header = select(0u, codes[block + HEADER_BITS], begins_block(s, segment));
    var rest = 0u;
    if local < PIECES {
        rest = lengths[group.x * PIECES + local];
    }
    var at = begin + header + up_to(local, rest) - rest;
    if local == 0u && segment == 0u {
        lay(s, 0u, ZLIB, 16u);
    }
    if local == 255u && ends_block(s, segment) {
        let code = codes[block + END_OF_BLOCK];
        lay(s, at, code & 0xffffu, code >> 16u);
    }
    if local < PIECES {
        var slot = group.x * SLOT * PIECES + local;
        while rest > 0u {
            let count = min(rest, 32u);
            lay(s, at, slots[slot], count);
            slot += PIECES;
            at += count;
            rest -= count;
        }
    } else if begins_block(s, segment) {
        // The other half of the workgroup, a word of the header at a time.
        for (var i = local - PIECES; i * 32u < header; i += PIECES) {
            lay(s, begin + i * 32u, codes[block + HEADER_AT + i], min(header - i * 32u, 32u));
        }
    }
}
