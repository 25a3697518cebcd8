//! Polygons of rooms: area, containment, and the check of an outline.

use crate::error::{PackError, Place};

/// Largest number of corners.
const MOST_CORNERS: usize = 512;
/// Smallest area of a room, m².
const LEAST_AREA: f64 = 0.01;

/// Signed area in m²: positive when the corners run counter-clockwise.
#[must_use]
pub fn area(outline: &[[f64; 2]]) -> f64 {
    edges(outline)
        .map(|(a, b)| 0.5 * (a[0] * b[1] - b[0] * a[1]))
        .sum()
}

/// Whether a point is inside the outline; points on an edge may be in or out.
#[must_use]
pub fn contains(outline: &[[f64; 2]], point: [f64; 2]) -> bool {
    let [x, y] = point;
    edges(outline)
        .filter(|(a, b)| (a[1] > y) != (b[1] > y))
        .filter(|(a, b)| x < a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]))
        .count()
        % 2
        == 1
}

/// Checks that an outline is a polygon of a room: 3 to 512 corners, no edge crosses or touches
/// another one, at least 0.01 m².
///
/// # Errors
/// [`PackError::Value`], for `home.toml`.
pub fn check_outline(room: &str, outline: &[[f64; 2]]) -> Result<(), PackError> {
    let place = Place::file("home.toml").entry("room", room).key("outline");
    check(&place, outline)
}

pub(crate) fn check(place: &Place, outline: &[[f64; 2]]) -> Result<(), PackError> {
    place.at_most(outline.len(), MOST_CORNERS, "leave corners out")?;
    for value in outline.iter().flatten() {
        place.within(*value, -50.0, 50.0, "m", "positions are metres")?;
    }
    let wrong = |found: String| {
        place.wrong(
            found,
            "a polygon that does not cross or touch itself",
            "list the corners in their order around the room, each once",
        )
    };
    if outline.len() < 3 {
        return Err(wrong(format!("a list of {} corners", outline.len())));
    }
    let edges: Vec<_> = edges(outline).collect();
    for (i, (a, b)) in edges.iter().enumerate() {
        if a == b {
            return Err(wrong(format!("a list that repeats corner {a:?}")));
        }
        for (j, (c, d)) in edges.iter().enumerate().skip(i + 1) {
            let next = j == i + 1 || (i == 0 && j + 1 == edges.len());
            let bad = if next {
                // Neighbours share a corner; they must not run back over each other.
                let (p, q, r) = if j == i + 1 { (a, b, d) } else { (c, d, b) };
                cross(p, q, r) == 0.0 && dot(q, p, r) > 0.0
            } else {
                meet(a, b, c, d)
            };
            if bad {
                return Err(wrong(format!(
                    "crossed or touched by itself: edge {i} by edge {j}"
                )));
            }
        }
    }
    let size = area(outline).abs();
    if size < LEAST_AREA {
        return Err(wrong(format!("a polygon of {size} m²")));
    }
    Ok(())
}

/// The edges, from corner to corner.
pub(crate) fn edges(outline: &[[f64; 2]]) -> impl Iterator<Item = ([f64; 2], [f64; 2])> + '_ {
    let next = outline.iter().cycle().skip(1);
    outline.iter().zip(next).map(|(a, b)| (*a, *b))
}

/// Twice the signed area of a triangle.
fn cross(a: &[f64; 2], b: &[f64; 2], c: &[f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Dot product of the directions from `at` to `a` and `b`.
fn dot(at: &[f64; 2], a: &[f64; 2], b: &[f64; 2]) -> f64 {
    (a[0] - at[0]) * (b[0] - at[0]) + (a[1] - at[1]) * (b[1] - at[1])
}

/// Whether two segments share a point.
fn meet(a: &[f64; 2], b: &[f64; 2], c: &[f64; 2], d: &[f64; 2]) -> bool {
    let sides = |p, q, r, s| {
        let (first, second) = (cross(p, q, r), cross(p, q, s));
        (first > 0.0 && second > 0.0) || (first < 0.0 && second < 0.0)
    };
    if sides(a, b, c, d) || sides(c, d, a, b) {
        return false;
    }
    let apart = |i: usize| a[i].max(b[i]) < c[i].min(d[i]) || c[i].max(d[i]) < a[i].min(b[i]);
    !(apart(0) || apart(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: [[f64; 2]; 4] = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]];

    #[test]
    fn area_has_the_sign_of_the_direction() {
        assert_eq!(area(&SQUARE), 2.0);
        let mut back = SQUARE;
        back.reverse();
        assert_eq!(area(&back), -2.0);
    }

    #[test]
    fn points_are_inside_or_outside_of_a_hollow_outline() {
        let outline = [
            [0.0, 0.0],
            [3.0, 0.0],
            [3.0, 3.0],
            [2.0, 3.0],
            [2.0, 1.0],
            [1.0, 1.0],
            [1.0, 3.0],
            [0.0, 3.0],
        ];
        for (point, inside) in [
            ([0.5, 2.0], true),
            ([1.5, 2.0], false),
            ([2.5, 2.0], true),
            ([1.5, 0.5], true),
            ([4.0, 0.5], false),
        ] {
            assert_eq!(contains(&outline, point), inside, "{point:?}");
        }
        assert!(check_outline("hall", &outline).is_ok());
    }

    #[test]
    fn crossing_touching_and_flat_outlines_are_rejected() {
        let cases: [&[[f64; 2]]; 6] = [
            &[[0.0, 0.0], [1.0, 1.0]],
            &[[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]],
            &[[0.0, 0.0], [2.0, 0.0], [1.0, 0.0], [1.0, 1.0]],
            &[[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [0.0, 1.0]],
            &[[0.0, 0.0], [0.1, 0.0], [0.0, 0.1]],
            &[[0.0, 0.0], [f64::NAN, 0.0], [0.0, 1.0]],
        ];
        for outline in cases {
            let message = check_outline("hall", outline).unwrap_err().to_string();
            assert!(
                message.starts_with("home.toml: room[hall].outline is "),
                "{message}"
            );
        }
    }
}
