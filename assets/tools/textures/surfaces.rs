//! Floors, walls, boards and cloth.

use wheelarm_proto::exact;

use super::noise::{blend, fractal, hash, mix, noise, ramp, scale};

/// Light at the upper left edge of a raised field, shade at the lower right:
/// `x` and `y` in 0..1 of the field, `width` of the bevel.
fn bevel(x: f32, y: f32, width_x: f32, width_y: f32) -> f32 {
    let edge = |t: f32, w: f32| 1.0 - ramp(0.0, w, t);
    0.06 * (edge(x, width_x) + edge(1.0 - y, width_y))
        - 0.09 * (edge(1.0 - x, width_x) + edge(y, width_y))
}

/// Dark line between fields: 1 in the joint, 0 inside.
fn joint(x: f32, y: f32, width_x: f32, width_y: f32) -> f32 {
    let near = |t: f32, w: f32| 1.0 - ramp(w * 0.5, w, t.min(1.0 - t));
    near(x, width_x).max(near(y, width_y))
}

/// Rings of wood seen along a board: brightness 0 to 1, grain along u.
fn grain(u: f32, v: f32, seed: u32) -> f32 {
    let warp = fractal(u, v, 2, 4, 3, seed);
    let rings = exact::sin(std::f32::consts::TAU * (v * 11.0 + warp * 1.7)) * 0.5 + 0.5;
    let streaks = fractal(u, v, 3, 48, 3, seed + 11);
    let fibre = fractal(u, v, 6, 160, 2, seed + 7);
    0.24 * rings + 0.2 * warp + 0.34 * streaks + 0.22 * fibre
}

/// Floor boards along u, six rows, each with its own tone.
pub(super) fn planks(u: f32, v: f32) -> [f32; 3] {
    const ROWS: f32 = 6.0;
    let row = (v * ROWS).floor();
    let shift = hash(row as i32, 3, 11);
    let along = (u * 2.0 + shift * 2.0).rem_euclid(2.0);
    let board = along.floor();
    let (x, y) = (along.fract(), (v * ROWS).fract());
    let id = row as i32 * 2 + board as i32;
    let wood = grain((u + hash(id, 0, 5)).fract(), v + hash(id, 1, 5), 31);
    let tone = 0.80 + 0.17 * hash(id, 2, 5) - 0.16 * (wood - 0.5);
    let warm = 0.04 * (hash(id, 4, 5) - 0.5);
    let light = tone + bevel(x, y, 0.004, 0.03) * 0.8;
    let gap = joint(x, y, 0.0035, 0.022);
    let c = [light + warm, light * 0.975, light * 0.94 - warm];
    blend(c, scale(c, 0.38), gap)
}

/// Four by four glazed tiles with grey joints.
pub(super) fn tiles(u: f32, v: f32) -> [f32; 3] {
    let (a, b) = (u * 4.0, v * 4.0);
    let (x, y) = (a.fract(), b.fract());
    let tone = 0.93
        + 0.05 * (hash(a as i32, b as i32, 2) - 0.5)
        + 0.03 * (fractal(u, v, 8, 8, 4, 21) - 0.5)
        + bevel(x, y, 0.04, 0.04);
    let grout = 0.66 + 0.08 * (noise(u, v, 128, 128, 4) - 0.5);
    blend(
        [tone; 3],
        [grout, grout * 0.98, grout * 0.95],
        joint(x, y, 0.022, 0.022),
    )
}

/// Rolled wall paint: faint clouds and a fine stipple.
pub(super) fn plaster(u: f32, v: f32) -> [f32; 3] {
    let clouds = fractal(u, v, 3, 3, 4, 51) - 0.5;
    let here = fractal(u, v, 64, 64, 3, 57);
    let above = fractal(u + 0.002, v + 0.002, 64, 64, 3, 57);
    let tone = 0.955 + 0.035 * clouds + 0.16 * (here - above);
    [tone, tone * 0.997, tone * 0.99]
}

/// A board with its grain along u.
pub(super) fn wood(u: f32, v: f32) -> [f32; 3] {
    let g = grain(u, v, 71);
    let pores = ramp(0.80, 0.92, noise(u, v, 20, 240, 77)) * 0.10;
    let tone = 1.0 - 0.30 * g - pores;
    [tone, tone * (0.985 - 0.03 * g), tone * (0.96 - 0.07 * g)]
}

/// Woven cloth.
pub(super) fn fabric(u: f32, v: f32) -> [f32; 3] {
    const THREADS: f32 = 64.0;
    let (a, b) = (u * THREADS, v * THREADS);
    let round = |t: f32| 1.0 - (2.0 * t.fract() - 1.0).powi(2);
    let over = (a.floor() + b.floor()).rem_euclid(2.0) < 1.0;
    let (across, along) = if over { (b, a) } else { (a, b) };
    let yarn = hash(across.floor() as i32, i32::from(over), 3) - 0.5;
    let tone = 0.70
        + 0.20 * round(across)
        + 0.07 * round(along)
        + 0.10 * yarn
        + 0.10 * (fractal(u, v, 6, 6, 4, 91) - 0.5);
    [tone; 3]
}

/// Pale stone with grey veins.
pub(super) fn marble(u: f32, v: f32) -> [f32; 3] {
    let vein = |n: i32, seed: u32, width: f32| {
        let (a, b) = (
            fractal(u, v, n, n, 5, seed),
            fractal(u, v, n, n, 3, seed + 31),
        );
        1.0 - ramp(0.0, width, (a - b).abs())
    };
    let veins = 0.34 * vein(3, 101, 0.035) + 0.16 * vein(7, 131, 0.03);
    let tone = 0.95 - veins + 0.06 * (fractal(u, v, 4, 4, 5, 151) - 0.5);
    [tone, tone, tone * 1.005]
}

/// Eight by eight squares.
pub(super) fn checker(u: f32, v: f32) -> [f32; 3] {
    let dark = ((u * 8.0).floor() + (v * 8.0).floor()).rem_euclid(2.0) < 1.0;
    let tone = if dark { 0.42 } else { 0.95 };
    [tone + 0.03 * (noise(u, v, 64, 64, 6) - 0.5); 3]
}

/// Metal brushed along u.
pub(super) fn brushed(u: f32, v: f32) -> [f32; 3] {
    let fine = noise(u, v, 4, 256, 161) - 0.5;
    let coarse = noise(u, v, 2, 48, 167) - 0.5;
    [0.90 + 0.12 * fine + 0.08 * coarse; 3]
}

/// Foliage: leaves over leaves over shade.
pub(super) fn leaves(u: f32, v: f32) -> [f32; 3] {
    let mut color = scale([0.55, 0.75, 0.45], 0.45 + 0.3 * fractal(u, v, 8, 8, 3, 181));
    for layer in 0..4 {
        let n = 9 + layer;
        let (cx, cy) = ((u * n as f32).floor() as i32, (v * n as f32).floor() as i32);
        for (dx, dy) in [
            (-1, -1),
            (0, -1),
            (1, -1),
            (-1, 0),
            (0, 0),
            (1, 0),
            (-1, 1),
            (0, 1),
            (1, 1),
        ] {
            let (x, y) = (cx + dx, cy + dy);
            let (kx, ky) = (x.rem_euclid(n), y.rem_euclid(n));
            let seed = 191 + 10 * layer as u32;
            let px = u * n as f32 - (x as f32 + hash(kx, ky, seed + 1));
            let py = v * n as f32 - (y as f32 + hash(kx, ky, seed + 2));
            // No leaf reaches so far: 0.62² + 0.26² is 0.452.
            if px * px + py * py > 0.46 {
                continue;
            }
            let angle = hash(kx, ky, seed) * std::f32::consts::TAU;
            let (s, c) = exact::sin_cos(angle);
            let (along, across) = (px * c + py * s, py * c - px * s);
            let width = 0.26 * (1.0 - (along / 0.62).powi(2));
            if along.abs() < 0.62 && across.abs() < width {
                let rib = 1.0 - ramp(0.0, 0.03, across.abs());
                let tone = 0.62
                    + 0.09 * layer as f32
                    + 0.12 * hash(kx, ky, seed + 3)
                    + 0.35 * across
                    + 0.12 * rib;
                color = [tone * 0.80, tone, tone * 0.66];
            }
        }
    }
    color
}

/// Sixteen spines on a shelf, full height.
pub(super) fn books(u: f32, v: f32) -> [f32; 3] {
    const EDGES: [f32; 17] = [
        0.0, 0.055, 0.125, 0.17, 0.25, 0.30, 0.385, 0.43, 0.50, 0.575, 0.62, 0.69, 0.735, 0.81,
        0.87, 0.925, 1.0,
    ];
    const CLOTH: [[f32; 3]; 8] = [
        [0.62, 0.22, 0.20],
        [0.22, 0.35, 0.52],
        [0.86, 0.80, 0.68],
        [0.25, 0.42, 0.32],
        [0.80, 0.58, 0.25],
        [0.36, 0.26, 0.38],
        [0.92, 0.90, 0.86],
        [0.18, 0.20, 0.24],
    ];
    let i = EDGES.partition_point(|e| *e <= u).clamp(1, 16) - 1;
    let (start, end) = (EDGES[i], EDGES[i + 1]);
    let x = (u - start) / (end - start);
    let cloth = CLOTH[(hash(i as i32, 0, 211) * 8.0) as usize % 8];
    let round = 0.72 + 0.36 * (1.0 - (2.0 * x - 1.0).powi(2));
    let mut c = scale(cloth, round * (0.95 + 0.1 * fractal(u, v, 48, 48, 2, 221)));
    let band = |at: f32, w: f32| 1.0 - ramp(w, w + 0.004, (v - at).abs());
    let gold = [0.85, 0.72, 0.42];
    let ink = if cloth[0] + cloth[1] > 1.4 {
        [0.25, 0.2, 0.2]
    } else {
        gold
    };
    c = blend(
        c,
        scale(ink, round),
        0.8 * band(0.86, 0.006).max(band(0.14, 0.006)),
    );
    let title = band(0.5, 0.16 + 0.1 * hash(i as i32, 1, 211));
    let letter = ramp(0.35, 0.5, noise(u, v, 1, 90, 231 + i as u32))
        * ramp(0.2, 0.24, 0.5 - (x - 0.5).abs());
    c = blend(c, scale(ink, round), 0.7 * title * letter);
    blend(
        c,
        [0.06, 0.05, 0.05],
        1.0 - ramp(0.0, 0.003, (u - start).min(end - u)),
    )
}

/// Eight soft stripes along v.
pub(super) fn stripes(u: f32, v: f32) -> [f32; 3] {
    let t = (u * 8.0).fract();
    let wide = ramp(0.24, 0.26, (t - 0.5).abs());
    let thread = 0.05 * (noise(u, v, 128, 128, 241) - 0.5);
    let tone = mix(0.62, 0.95, wide) + thread;
    [tone; 3]
}
