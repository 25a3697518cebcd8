// Pictures as they are handed out, one plane behind the other in a buffer of words:
// colour without alpha, depth in metres, ids of 16 bits. Each invocation packs four
// neighbours of the row-by-row order, so that it writes whole words.

struct Planes {
    // Pixels per row, and in all.
    width: u32,
    count: u32,
    // First words of depth and ids.
    depth: u32,
    ids: u32,
    // Bits of the nearest and the farthest depth, float32 metres.
    near: u32,
    far: u32,
    // Colour where nothing is hit, its alpha byte 0; another where that is drawn.
    background: u32,
}

@group(0) @binding(0) var<uniform> planes: Planes;
@group(0) @binding(1) var color: texture_2d<f32>;
@group(0) @binding(2) var depth: texture_depth_2d;
@group(0) @binding(3) var<storage, read_write> packed: array<u32>;
@group(0) @binding(4) var wide: texture_2d<u32>;

const INFINITE: u32 = 0x7f800000u;
const HIDDEN: u32 = 0x800000u;

// near / reversed as bits, rounded to the nearest as IEEE 754 says, by whole
// numbers: the division of a graphics card may be off by some units in the last
// place. Infinite beyond the camera's range and where nothing is hit.
fn metres(reversed: u32) -> u32 {
    // 0, and what is too small to be told from it.
    if (reversed >> 23u) == 0u {
        return INFINITE;
    }
    let above = (planes.near & (HIDDEN - 1u)) | HIDDEN;
    let below = (reversed & (HIDDEN - 1u)) | HIDDEN;
    let less = u32(above < below);
    var rest = (above << less) - below;
    var quotient = 1u;
    for (var i = 0; i < 23; i++) {
        rest <<= 1u;
        let fits = u32(rest >= below);
        rest -= below * fits;
        quotient = (quotient << 1u) | fits;
    }
    // Never a tie: the quotient of two numbers of 24 bits is none.
    quotient += u32(rest * 2u > below);
    let exponent = (planes.near >> 23u) + 127u - (reversed >> 23u) - less;
    let bits = (exponent << 23u) + (quotient - HIDDEN);
    return select(bits, INFINITE, bits > planes.far);
}

fn place(pixel: u32) -> vec2<u32> {
    let inside = min(pixel, planes.count - 1u);
    return vec2(inside % planes.width, inside / planes.width);
}

// Colour and depth of the four from `first` on; their alpha bytes.
fn pack_four(four: u32) -> array<u32, 4> {
    var shown: array<u32, 4>;
    for (var i = 0u; i < 4u; i++) {
        let at = place(four * 4u + i);
        let reversed = bitcast<u32>(textureLoad(depth, at, 0));
        let drawn = reversed != 0u || (planes.background >> 24u) != 0u;
        shown[i] = select(planes.background, pack4x8unorm(textureLoad(color, at, 0)), drawn);
        packed[planes.depth + four * 4u + i] = metres(reversed);
    }
    let rgb = four * 3u;
    packed[rgb] = (shown[0] & 0xffffffu) | (shown[1] << 24u);
    packed[rgb + 1u] = ((shown[1] >> 8u) & 0xffffu) | (shown[2] << 16u);
    packed[rgb + 2u] = ((shown[2] >> 16u) & 0xffu) | (shown[3] << 8u);
    return array(shown[0] >> 24u, shown[1] >> 24u, shown[2] >> 24u, shown[3] >> 24u);
}

fn number(group: vec3<u32>, groups: vec3<u32>, local: u32) -> u32 {
    return (group.y * groups.x + group.x) * 64u + local;
}

// Ids are the alpha bytes.
@compute @workgroup_size(64) fn pack(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let four = number(group, groups, local);
    if four * 4u >= planes.count {
        return;
    }
    let id = pack_four(four);
    packed[planes.ids + four * 2u] = id[0] | (id[1] << 16u);
    packed[planes.ids + four * 2u + 1u] = id[2] | (id[3] << 16u);
}

// Ids have a texture of their own.
@compute @workgroup_size(64) fn pack_wide(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let four = number(group, groups, local);
    if four * 4u >= planes.count {
        return;
    }
    pack_four(four);
    for (var pair = 0u; pair < 2u; pair++) {
        let low = textureLoad(wide, place(four * 4u + pair * 2u), 0).x;
        let high = textureLoad(wide, place(four * 4u + pair * 2u + 1u), 0).x;
        packed[planes.ids + four * 2u + pair] = low | (high << 16u);
    }
}
