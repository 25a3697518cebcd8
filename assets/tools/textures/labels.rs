//! Labels of the task objects, our own drawings: colour fields and stroke letters.

use wheelarm_proto::exact;

use super::noise::{blend, fractal, mix, ramp, scale};

type Stroke = &'static [(f32, f32)];

/// Polylines of a letter in a cell 1 wide and 1.5 high, from the lower left.
fn letter(c: char) -> &'static [Stroke] {
    match c {
        'A' => &[
            &[(0.0, 0.0), (0.5, 1.5), (1.0, 0.0)],
            &[(0.2, 0.55), (0.8, 0.55)],
        ],
        'C' => &[&[
            (0.95, 1.25),
            (0.7, 1.5),
            (0.3, 1.5),
            (0.0, 1.2),
            (0.0, 0.3),
            (0.3, 0.0),
            (0.7, 0.0),
            (0.95, 0.25),
        ]],
        'D' => &[&[
            (0.0, 0.0),
            (0.0, 1.5),
            (0.55, 1.5),
            (0.95, 1.1),
            (0.95, 0.4),
            (0.55, 0.0),
            (0.0, 0.0),
        ]],
        'E' => &[
            &[(0.9, 1.5), (0.0, 1.5), (0.0, 0.0), (0.9, 0.0)],
            &[(0.0, 0.78), (0.7, 0.78)],
        ],
        'F' => &[
            &[(0.9, 1.5), (0.0, 1.5), (0.0, 0.0)],
            &[(0.0, 0.78), (0.7, 0.78)],
        ],
        'G' => &[&[
            (0.95, 1.25),
            (0.7, 1.5),
            (0.3, 1.5),
            (0.0, 1.2),
            (0.0, 0.3),
            (0.3, 0.0),
            (0.7, 0.0),
            (0.95, 0.3),
            (0.95, 0.7),
            (0.55, 0.7),
        ]],
        'K' => &[
            &[(0.0, 0.0), (0.0, 1.5)],
            &[(0.9, 1.5), (0.05, 0.7)],
            &[(0.3, 0.95), (0.95, 0.0)],
        ],
        'L' => &[&[(0.0, 1.5), (0.0, 0.0), (0.85, 0.0)]],
        'M' => &[&[(0.0, 0.0), (0.0, 1.5), (0.5, 0.5), (1.0, 1.5), (1.0, 0.0)]],
        'O' => &[&[
            (0.3, 0.0),
            (0.0, 0.35),
            (0.0, 1.15),
            (0.3, 1.5),
            (0.7, 1.5),
            (1.0, 1.15),
            (1.0, 0.35),
            (0.7, 0.0),
            (0.3, 0.0),
        ]],
        'P' => &[&[
            (0.0, 0.0),
            (0.0, 1.5),
            (0.65, 1.5),
            (0.95, 1.2),
            (0.95, 0.95),
            (0.65, 0.68),
            (0.0, 0.68),
        ]],
        'R' => &[
            &[
                (0.0, 0.0),
                (0.0, 1.5),
                (0.65, 1.5),
                (0.95, 1.2),
                (0.95, 0.95),
                (0.65, 0.7),
                (0.0, 0.7),
            ],
            &[(0.45, 0.7), (0.95, 0.0)],
        ],
        'S' => &[&[
            (0.92, 1.28),
            (0.7, 1.5),
            (0.3, 1.5),
            (0.03, 1.25),
            (0.1, 0.95),
            (0.85, 0.6),
            (0.97, 0.28),
            (0.7, 0.0),
            (0.28, 0.0),
            (0.03, 0.22),
        ]],
        'T' => &[&[(0.0, 1.5), (1.0, 1.5)], &[(0.5, 1.5), (0.5, 0.0)]],
        'U' => &[&[
            (0.0, 1.5),
            (0.0, 0.35),
            (0.3, 0.0),
            (0.7, 0.0),
            (1.0, 0.35),
            (1.0, 1.5),
        ]],
        _ => &[],
    }
}

/// Middle and size of a word.
struct Place {
    cx: f32,
    cy: f32,
    width: f32,
    height: f32,
}

/// Ink 0 to 1 of a word at its place, strokes twice `weight` wide.
fn word(text: &str, u: f32, v: f32, place: Place, weight: f32) -> f32 {
    let Place {
        cx,
        cy,
        width,
        height,
    } = place;
    let count = text.chars().count() as f32;
    let pitch = width / count;
    let (x, y) = (u - (cx - width * 0.5), v - (cy - height * 0.5));
    if x < -0.05 || x > width + 0.05 || y < -0.05 || y > height + 0.05 {
        return 0.0;
    }
    // Ink ends here; letters further away need no appearance at their strokes.
    let reach = weight + 0.002;
    let mut nearest = f64::INFINITY;
    for (i, c) in text.chars().enumerate() {
        let left = i as f32 * pitch + pitch * 0.14;
        if x < left - 2.0 * reach || x > left + pitch * 0.72 + 2.0 * reach {
            continue;
        }
        for stroke in letter(c) {
            for ends in stroke.windows(2) {
                let spot = |p: (f32, f32)| (left + p.0 * pitch * 0.72, p.1 / 1.5 * height);
                nearest = nearest.min(to_segment((x, y), spot(ends[0]), spot(ends[1])));
            }
        }
    }
    1.0 - ramp(weight - 0.002, reach, nearest.sqrt() as f32)
}

/// Square of the distance of a point from a line between two.
fn to_segment(p: (f32, f32), a: (f32, f32), b: (f32, f32)) -> f64 {
    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
    let length = dx * dx + dy * dy;
    let t = if length > 0.0 {
        (((p.0 - a.0) * dx + (p.1 - a.1) * dy) / length).clamp(0.0, 1.0)
    } else {
        0.0
    };
    square(p.0 - a.0 - t * dx, p.1 - a.1 - t * dy)
}

/// Square of the length of a vector.
fn square(x: f32, y: f32) -> f64 {
    let (x, y) = (f64::from(x), f64::from(y));
    x * x + y * y
}

/// Length of a vector.
fn length(x: f32, y: f32) -> f32 {
    square(x, y).sqrt() as f32
}

/// 1 inside the ellipse, soft at its edge.
fn ellipse(u: f32, v: f32, cx: f32, cy: f32, rx: f32, ry: f32) -> f32 {
    let d = length((u - cx) / rx, (v - cy) / ry);
    1.0 - ramp(0.985, 1.015, d)
}

/// 1 between `low` and `high`.
fn band(x: f32, low: f32, high: f32) -> f32 {
    ramp(low - 0.003, low, x) * (1.0 - ramp(high, high + 0.003, x))
}

/// Rows of grey that read as small print.
fn small_print(u: f32, v: f32, left: f32, right: f32, low: f32, high: f32) -> f32 {
    let inside = band(u, left, right) * band(v, low, high);
    if inside <= 0.0 {
        return 0.0;
    }
    let rows = (v * 60.0).fract();
    let words = ramp(
        0.35,
        0.45,
        fractal(u, (v * 60.0).floor() / 60.0, 64, 60, 1, 301),
    );
    inside * ramp(0.3, 0.4, rows) * words
}

/// Yellow bottle, red oval with the word, brown seeds below.
pub(super) fn mustard(u: f32, v: f32) -> [f32; 3] {
    let yellow = [0.97, 0.78, 0.08];
    let red = [0.76, 0.09, 0.08];
    let cream = [0.99, 0.95, 0.80];
    let mut c = yellow;
    let field = ellipse(u, v, 0.5, 0.52, 0.44, 0.30);
    c = blend(c, cream, field);
    c = blend(c, red, ellipse(u, v, 0.5, 0.52, 0.415, 0.28));
    c = blend(
        c,
        cream,
        word(
            "MUSTARD",
            u,
            v,
            Place {
                cx: 0.5,
                cy: 0.54,
                width: 0.74,
                height: 0.17,
            },
            0.013,
        ),
    );
    c = blend(c, yellow, band(u, 0.25, 0.75) * band(v, 0.395, 0.407));
    let seeds = small_print(u, v, 0.33, 0.67, 0.33, 0.385);
    c = blend(c, cream, 0.8 * seeds);
    let leaf = ellipse(u, v, 0.42, 0.715, 0.09, 0.03).max(ellipse(u, v, 0.58, 0.715, 0.09, 0.03));
    c = blend(c, [0.20, 0.45, 0.16], leaf);
    blend(c, red, band(v, 0.075, 0.10).max(band(v, 0.115, 0.122)))
}

/// Red above, cream below, a gold disc between; once per image.
pub(super) fn soup(u: f32, v: f32) -> [f32; 3] {
    let red = [0.76, 0.08, 0.07];
    let cream = [0.97, 0.95, 0.90];
    let gold = [0.82, 0.64, 0.25];
    let metal = [0.80, 0.81, 0.83];
    let mut c = blend(cream, red, ramp(0.518, 0.522, v));
    c = blend(c, gold, band(v, 0.505, 0.522));
    c = blend(
        c,
        cream,
        word(
            "TOMATO",
            u,
            v,
            Place {
                cx: 0.5,
                cy: 0.75,
                width: 0.72,
                height: 0.17,
            },
            0.012,
        ),
    );
    c = blend(
        c,
        red,
        word(
            "SOUP",
            u,
            v,
            Place {
                cx: 0.5,
                cy: 0.22,
                width: 0.56,
                height: 0.18,
            },
            0.014,
        ),
    );
    let disc = ellipse(u, v, 0.5, 0.51, 0.095, 0.10);
    c = blend(c, gold, disc);
    c = blend(
        c,
        [0.85, 0.22, 0.12],
        ellipse(u, v, 0.5, 0.505, 0.062, 0.062),
    );
    c = blend(
        c,
        [0.22, 0.48, 0.18],
        ellipse(u, v, 0.5, 0.565, 0.03, 0.014),
    );
    c = blend(
        c,
        [0.3, 0.3, 0.3],
        0.6 * small_print(u, v, 0.02, 0.16, 0.08, 0.45),
    );
    blend(c, metal, 1.0 - band(v, 0.045, 0.955))
}

/// Red box, white word on a blue field, round crackers.
pub(super) fn crackers(u: f32, v: f32) -> [f32; 3] {
    let red = [0.80, 0.11, 0.10];
    let white = [0.97, 0.96, 0.93];
    let blue = [0.10, 0.20, 0.48];
    let mut c = scale(red, mix(0.9, 1.04, v));
    c = blend(c, white, band(v, 0.655, 0.905) * band(u, 0.06, 0.94));
    c = blend(c, blue, band(v, 0.67, 0.89) * band(u, 0.075, 0.925));
    c = blend(
        c,
        white,
        word(
            "CRACKERS",
            u,
            v,
            Place {
                cx: 0.5,
                cy: 0.78,
                width: 0.78,
                height: 0.12,
            },
            0.011,
        ),
    );
    for (x, y, r) in [(0.34, 0.33, 0.19), (0.66, 0.28, 0.19), (0.5, 0.45, 0.19)] {
        let inside = ellipse(u, v, x, y, r, r * 0.78);
        if inside <= 0.0 {
            continue;
        }
        let d = length((u - x) / r, (v - y) / (r * 0.78));
        let baked = blend([0.93, 0.74, 0.42], [0.72, 0.46, 0.20], ramp(0.55, 1.0, d));
        let crumb = 0.9 + 0.2 * fractal(u, v, 40, 40, 3, 311);
        let (a, b) = (((u - x) * 22.0).fract(), ((v - y) * 28.0).fract());
        let hole = ellipse(a.rem_euclid(1.0), b.rem_euclid(1.0), 0.5, 0.5, 0.16, 0.16)
            * (1.0 - ramp(0.6, 0.7, d));
        c = blend(c, scale(baked, crumb - 0.3 * hole), inside);
    }
    c = blend(c, white, 0.7 * small_print(u, v, 0.10, 0.5, 0.04, 0.09));
    blend(
        c,
        scale(red, 0.75),
        1.0 - band(u, 0.012, 0.988) * band(v, 0.012, 0.988),
    )
}

/// Blue tin with a yellow field.
pub(super) fn meat(u: f32, v: f32) -> [f32; 3] {
    let blue = [0.09, 0.22, 0.55];
    let yellow = [0.98, 0.80, 0.16];
    let mut c = scale(blue, mix(0.85, 1.1, v));
    c = blend(
        c,
        yellow,
        word(
            "MEAT",
            u,
            v,
            Place {
                cx: 0.5,
                cy: 0.70,
                width: 0.62,
                height: 0.24,
            },
            0.022,
        ),
    );
    let plate = ellipse(u, v, 0.5, 0.30, 0.36, 0.17);
    c = blend(c, [0.94, 0.92, 0.88], plate);
    let slice = ellipse(u, v, 0.47, 0.31, 0.22, 0.105);
    if slice > 0.0 {
        let pink = scale(
            [0.90, 0.52, 0.48],
            0.88 + 0.24 * fractal(u, v, 24, 24, 4, 321),
        );
        c = blend(c, pink, slice);
    }
    c = blend(c, [0.25, 0.50, 0.20], ellipse(u, v, 0.73, 0.29, 0.06, 0.04));
    blend(c, [0.82, 0.83, 0.85], 1.0 - band(v, 0.05, 0.95))
}

/// Red can with a white wave.
pub(super) fn coke(u: f32, v: f32) -> [f32; 3] {
    let red = [0.80, 0.05, 0.07];
    let white = [0.97, 0.97, 0.97];
    let mut c = scale(red, 0.94 + 0.1 * v);
    let wave = 0.30 + 0.07 * exact::sin(std::f32::consts::TAU * u);
    c = blend(c, white, band(v, wave - 0.035, wave + 0.02));
    c = blend(c, white, 0.9 * band(v, wave - 0.062, wave - 0.05));
    c = blend(
        c,
        white,
        word(
            "COLA",
            u,
            v,
            Place {
                cx: 0.5,
                cy: 0.63,
                width: 0.66,
                height: 0.22,
            },
            0.02,
        ),
    );
    blend(c, [0.80, 0.81, 0.83], 1.0 - band(v, 0.025, 0.975))
}

/// A word in one colour over another.
fn written(c: [f32; 3], ink: [f32; 3], text: &str, (u, v): (f32, f32), place: Place) -> [f32; 3] {
    let weight = place.height * 0.08;
    blend(c, ink, word(text, u, v, place, weight))
}

/// Yellow carton with a white field, a blue word and a cube.
pub(super) fn sugar(u: f32, v: f32) -> [f32; 3] {
    let yellow = [0.93, 0.76, 0.15];
    let white = [0.97, 0.96, 0.92];
    let blue = [0.12, 0.24, 0.55];
    let mut c = scale(yellow, mix(0.92, 1.03, v));
    c = blend(c, white, band(v, 0.53, 0.86) * band(u, 0.05, 0.95));
    c = blend(c, blue, band(v, 0.515, 0.53).max(band(v, 0.86, 0.875)));
    let place = Place {
        cx: 0.5,
        cy: 0.70,
        width: 0.80,
        height: 0.20,
    };
    c = written(c, blue, "SUGAR", (u, v), place);
    let cube = band(u, 0.36, 0.64) * band(v, 0.22, 0.40);
    c = blend(c, white, cube);
    let grain = 0.9 + 0.15 * fractal(u, v, 60, 60, 2, 331);
    c = blend(c, scale(white, grain), cube);
    c = blend(c, blue, 0.8 * small_print(u, v, 0.12, 0.88, 0.07, 0.17));
    blend(c, blue, band(v, 0.02, 0.045))
}

/// Cream paper with a red seal, for a bottle.
pub(super) fn bottle(u: f32, v: f32) -> [f32; 3] {
    let cream = [0.94, 0.91, 0.83];
    let ink = [0.28, 0.08, 0.12];
    let mut c = scale(cream, 0.96 + 0.06 * fractal(u, v, 30, 30, 3, 341));
    c = blend(c, ink, band(v, 0.90, 0.925).max(band(v, 0.075, 0.10)));
    let place = Place {
        cx: 0.5,
        cy: 0.68,
        width: 0.72,
        height: 0.22,
    };
    c = written(c, ink, "CLARET", (u, v), place);
    let seal = ellipse(u, v, 0.5, 0.36, 0.10, 0.10);
    c = blend(c, [0.62, 0.12, 0.14], seal);
    c = blend(c, cream, 0.6 * ellipse(u, v, 0.5, 0.36, 0.06, 0.06));
    blend(c, ink, 0.8 * small_print(u, v, 0.25, 0.75, 0.14, 0.23))
}

/// Blue tin with a white band, the word and two beans.
pub(super) fn coffee(u: f32, v: f32) -> [f32; 3] {
    let blue = [0.13, 0.25, 0.50];
    let white = [0.95, 0.94, 0.90];
    let brown = [0.30, 0.17, 0.09];
    let mut c = scale(blue, mix(0.88, 1.08, v));
    c = blend(c, white, band(v, 0.40, 0.74));
    c = blend(
        c,
        [0.80, 0.62, 0.22],
        band(v, 0.385, 0.40).max(band(v, 0.74, 0.755)),
    );
    let place = Place {
        cx: 0.5,
        cy: 0.57,
        width: 0.80,
        height: 0.20,
    };
    c = written(c, brown, "COFFEE", (u, v), place);
    for x in [0.42, 0.58] {
        c = blend(c, brown, ellipse(u, v, x, 0.24, 0.055, 0.08));
        let groove = band(u, x - 0.006, x + 0.006) * band(v, 0.17, 0.31);
        c = blend(c, scale(brown, 0.5), groove);
    }
    blend(c, white, 0.7 * small_print(u, v, 0.15, 0.85, 0.05, 0.12))
}
