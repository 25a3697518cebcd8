//! Names beside dots that are close together: the position of each name, so that
//! none overlaps another one or a dot.

/// A rectangle in pixels: left, top, width, height.
pub type Box4 = (i32, i32, i32, i32);

/// Room that a dot takes, pixels each way.
const DOT: i32 = 8;
/// Room between two names, pixels.
const APART: i32 = 8;
/// Distances from a dot at which its name may be placed, pixels.
const DISTANCES: [i32; 8] = [12, 24, 40, 60, 84, 112, 144, 180];
/// Directions in which it may, in this order.
const DIRECTIONS: [(i32, i32); 8] = [
    (1, 0),
    (-1, 0),
    (0, -1),
    (0, 1),
    (1, -1),
    (1, 1),
    (-1, -1),
    (-1, 1),
];

fn overlap(a: Box4, b: Box4) -> bool {
    a.0 < b.0 + b.2 && b.0 < a.0 + a.2 && a.1 < b.1 + b.3 && b.1 < a.1 + a.3
}

/// Places of the names of `dots`, whose names have the sizes `sizes`, inside of
/// `room`; `None` for a name without a free position.
pub fn places(dots: &[(i32, i32)], sizes: &[(i32, i32)], room: (i32, i32)) -> Vec<Option<Box4>> {
    let taken: Vec<Box4> = dots
        .iter()
        .map(|d| (d.0 - DOT, d.1 - DOT, 2 * DOT, 2 * DOT))
        .collect();
    let mut out: Vec<Option<Box4>> = Vec::with_capacity(dots.len());
    for (&(x, y), &(w, h)) in dots.iter().zip(sizes) {
        let at = |distance: i32, (right, down): (i32, i32)| {
            let left = match right {
                1 => x + distance,
                -1 => x - distance - w,
                _ => x - w / 2,
            };
            let top = match down {
                1 => y + distance,
                -1 => y - distance - h,
                _ => y - h / 2,
            };
            (left, top, w, h)
        };
        let free = |b: &Box4| {
            let inside = b.0 >= 0 && b.1 >= 0 && b.0 + w <= room.0 && b.1 + h <= room.1;
            let wide = (b.0 - APART, b.1, w + 2 * APART, h);
            let named = || out.iter().flatten().any(|t| overlap(wide, *t));
            inside && !taken.iter().any(|t| overlap(*b, *t)) && !named()
        };
        let all = DISTANCES
            .iter()
            .flat_map(|&distance| DIRECTIONS.map(|direction| at(distance, direction)));
        let found = all.into_iter().find(free);
        out.push(found);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn four_cans_side_by_side_have_four_names() {
        let dots = [(100, 100), (108, 102), (116, 99), (124, 101)];
        let found = places(&dots, &[(60, 20); 4], (560, 400));
        assert!(found.iter().all(Option::is_some), "{found:?}");
    }

    proptest! {
        #[test]
        fn no_name_overlaps_another_or_a_dot(
            dots in prop::collection::vec((40..500_i32, 40..360_i32), 1..16),
            width in 20..90_i32,
        ) {
            let found = places(&dots, &vec![(width, 20); dots.len()], (560, 400));
            for (i, a) in found.iter().enumerate() {
                let Some(a) = *a else { continue };
                for b in found[i + 1..].iter().flatten() {
                    prop_assert!(!overlap(a, *b), "{a:?} {b:?}");
                }
                for d in &dots {
                    let inside = a.0 < d.0 && d.0 < a.0 + a.2 && a.1 < d.1 && d.1 < a.1 + a.3;
                    prop_assert!(!inside, "{a:?} hides {d:?}");
                }
            }
        }
    }
}
