// Output images, one plane after the other in a buffer of words: color without alpha,
// depth in metres, ids of 16 bits. Each invocation packs four neighbors in row order,
// so it writes whole words.

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
    // Color where nothing is hit, its alpha byte 0; another color where the background
    // is rendered.
    background: u32,
    // Edges are smoothed where this is not 0.
    smooth_edges: u32,
}

@group(0) @binding(0) var<uniform> planes: Planes;
@group(0) @binding(1) var color: texture_2d<f32>;
@group(0) @binding(2) var depth: texture_depth_2d;
@group(0) @binding(3) var<storage, read_write> packed: array<u32>;
@group(0) @binding(4) var wide: texture_2d<u32>;

const INFINITE: u32 = 0x7f800000u;
const HIDDEN: u32 = 0x800000u;

// near / reversed as bits, rounded to nearest as in IEEE 754, in integers: the division
// of a GPU may be off by some units in the last place. Infinite beyond the camera's
// range and where nothing is hit.
fn metres(reversed: u32) -> u32 {
    // 0 and values too small to distinguish from it.
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
    // Never a tie: the quotient of two 24-bit numbers cannot be one.
    quotient += u32(rest * 2u > below);
    let exponent = (planes.near >> 23u) + 127u - (reversed >> 23u) - less;
    let bits = (exponent << 23u) + (quotient - HIDDEN);
    return select(bits, INFINITE, bits > planes.far);
}

fn place(pixel: u32) -> vec2<u32> {
    let inside = min(pixel, planes.count - 1u);
    return vec2(inside % planes.width, inside / planes.width);
}

// A pixel as rendered.
struct Texel {
    // Its alpha byte in the highest bits.
    color: u32,
    reversed_depth: f32,
}

fn texel(at: vec2<u32>) -> Texel {
    let reversed = textureLoad(depth, at, 0);
    let drawn = bitcast<u32>(reversed) != 0u || (planes.background >> 24u) != 0u;
    let shown = select(planes.background, pack4x8unorm(textureLoad(color, at, 0)), drawn);
    return Texel(shown, reversed);
}

// Anti-aliasing: the rules and constants of `antialias.rs`.
const REACH: i32 = 8;
const LEAST_CONTRAST: i32 = 64;
const CONTRAST_SHIFT: u32 = 3u;
const BEND: f32 = 0.0001220703125;
const LEAST_BEND: f32 = 0.0000000298023223876953125;

// The nearest pixel inside the image.
fn inside(at: vec2<i32>) -> vec2<u32> {
    let last = vec2<i32>(i32(planes.width) - 1, i32(planes.count / planes.width) - 1);
    return vec2<u32>(clamp(at, vec2<i32>(0, 0), last));
}

// Whether reversed depth bends across a pixel: it is linear over a plane.
fn bends(here: f32, sum_x: f32, sum_y: f32) -> bool {
    let least = here * BEND + LEAST_BEND;
    return abs(sum_x - 2.0 * here) > least || abs(sum_y - 2.0 * here) > least;
}

// Luma of a color, 0 to 2040.
fn luma_of(c: u32) -> i32 {
    return i32(2u * (c & 0xffu) + 5u * ((c >> 8u) & 0xffu) + ((c >> 16u) & 0xffu));
}

fn luma(at: vec2<i32>) -> i32 {
    return luma_of(texel(inside(at)).color);
}

// Where the stair step ends in a direction, and the difference there.
fn end_of_step(at: vec2<i32>, along: vec2<i32>, across: vec2<i32>, sum: i32, gradient: i32) -> vec2<i32> {
    var difference = 0;
    for (var i = 1; i <= REACH; i++) {
        let p = at + along * i;
        difference = luma(p) + luma(p + across) - sum;
        if 2 * abs(difference) >= gradient {
            return vec2(i, difference);
        }
    }
    return vec2(REACH, difference);
}

// The color of a pixel on an edge, of the color `own`; `nswe` are its neighbours' lumas.
fn blended(at: vec2<u32>, own: u32, nswe: vec4<i32>) -> u32 {
    let p = vec2<i32>(at);
    let m = luma_of(own);
    let n = nswe.x;
    let s = nswe.y;
    let w = nswe.z;
    let e = nswe.w;
    let brightest = max(max(max(m, n), max(s, w)), e);
    let contrast = brightest - min(min(min(m, n), min(s, w)), e);
    if contrast < max(LEAST_CONTRAST, brightest >> CONTRAST_SHIFT) {
        return own;
    }
    let nw = luma(p + vec2(-1, -1));
    let ne = luma(p + vec2(1, -1));
    let sw = luma(p + vec2(-1, 1));
    let se = luma(p + vec2(1, 1));
    let across_rows = abs(nw + sw - 2 * w) + 2 * abs(n + s - 2 * m) + abs(ne + se - 2 * e);
    let across_columns = abs(nw + ne - 2 * n) + 2 * abs(w + e - 2 * m) + abs(sw + se - 2 * s);
    let horizontal = across_rows >= across_columns;
    let before = select(w, n, horizontal);
    let after = select(e, s, horizontal);
    let backwards = abs(before - m) >= abs(after - m);
    let side = select(after, before, backwards);
    let along = select(vec2<i32>(0, 1), vec2<i32>(1, 0), horizontal);
    let across = along.yx * select(1i, -1i, backwards);
    let gradient = abs(side - m);
    let back = end_of_step(p, -along, across, m + side, gradient);
    let ahead = end_of_step(p, along, across, m + side, gradient);
    let nearest = select(ahead, back, back.x <= ahead.x);
    if (nearest.y < 0) == (m < side) {
        return own;
    }
    let length = back.x + ahead.x - 1;
    let weight = u32(128 * (length - 2 * nearest.x + 1) / length);
    let other = texel(inside(p + across)).color;
    var mixed = own & 0xff000000u;
    for (var shift = 0u; shift < 24u; shift += 8u) {
        let sum = ((own >> shift) & 0xffu) * (256u - weight) + ((other >> shift) & 0xffu) * weight;
        mixed |= ((sum + 128u) >> 8u) << shift;
    }
    return mixed;
}

// Color and depth of the four from `four` on; their alpha bytes. An edge is where depth
// bends, where alpha bytes differ, or where `on_edge` says so.
fn pack_four(four: u32, on_edge: vec4<bool>) -> array<u32, 4> {
    var shown: array<u32, 4>;
    var left: Texel;
    var here: Texel;
    var right: Texel;
    for (var i = 0u; i < 4u; i++) {
        let at = place(four * 4u + i);
        if planes.smooth_edges == 0u {
            here = texel(at);
            shown[i] = here.color;
        } else {
            let p = vec2<i32>(at);
            // Neighbours in a row are read once.
            if i == 0u || at.x == 0u {
                here = texel(at);
                left = texel(inside(p - vec2(1, 0)));
            }
            right = texel(inside(p + vec2(1, 0)));
            let up = texel(inside(p - vec2(0, 1)));
            let down = texel(inside(p + vec2(0, 1)));
            let borders = (((here.color ^ left.color) | (here.color ^ right.color)
                | (here.color ^ up.color) | (here.color ^ down.color)) >> 24u) != 0u;
            let sum_x = left.reversed_depth + right.reversed_depth;
            let sum_y = up.reversed_depth + down.reversed_depth;
            shown[i] = here.color;
            if on_edge[i] || borders || bends(here.reversed_depth, sum_x, sum_y) {
                let nswe = vec4(
                    luma_of(up.color),
                    luma_of(down.color),
                    luma_of(left.color),
                    luma_of(right.color),
                );
                shown[i] = blended(at, here.color, nswe);
            }
        }
        packed[planes.depth + four * 4u + i] = metres(bitcast<u32>(here.reversed_depth));
        left = here;
        here = right;
    }
    let rgb = four * 3u;
    packed[rgb] = (shown[0] & 0xffffffu) | (shown[1] << 24u);
    packed[rgb + 1u] = ((shown[1] >> 8u) & 0xffffu) | (shown[2] << 16u);
    packed[rgb + 2u] = ((shown[2] >> 16u) & 0xffu) | (shown[3] << 8u);
    return array(shown[0] >> 24u, shown[1] >> 24u, shown[2] >> 24u, shown[3] >> 24u);
}

fn wide_id(at: vec2<i32>) -> u32 {
    return textureLoad(wide, inside(at), 0).x;
}

fn borders_wide(pixel: u32) -> bool {
    let p = vec2<i32>(place(pixel));
    let id = vec4(wide_id(p));
    return any(id != vec4(
        wide_id(p - vec2(1, 0)),
        wide_id(p + vec2(1, 0)),
        wide_id(p - vec2(0, 1)),
        wide_id(p + vec2(0, 1)),
    ));
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
    let id = pack_four(four, vec4(false));
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
    var on_edge = vec4(false);
    if planes.smooth_edges != 0u {
        for (var i = 0u; i < 4u; i++) {
            on_edge[i] = borders_wide(four * 4u + i);
        }
    }
    pack_four(four, on_edge);
    for (var pair = 0u; pair < 2u; pair++) {
        let low = textureLoad(wide, place(four * 4u + pair * 2u), 0).x;
        let high = textureLoad(wide, place(four * 4u + pair * 2u + 1u), 0).x;
        packed[planes.ids + four * 2u + pair] = low | (high << 16u);
    }
}
