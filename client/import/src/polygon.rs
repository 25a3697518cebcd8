//! Polygons in the plane. Only operations with the same bits on every machine are used.

/// A point, metres.
pub type Point = [f64; 2];

/// Twice the signed area of a triangle; positive when it turns counter-clockwise.
#[must_use]
pub fn cross(a: Point, b: Point, c: Point) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Distance of two points, metres.
#[must_use]
pub fn distance(a: Point, b: Point) -> f64 {
    let (x, y) = (b[0] - a[0], b[1] - a[1]);
    (x * x + y * y).sqrt()
}

/// Signed area, square metres; positive when counter-clockwise.
#[must_use]
pub fn area(polygon: &[Point]) -> f64 {
    let Some(&first) = polygon.first() else {
        return 0.0;
    };
    let sides = polygon.windows(2);
    0.5 * sides
        .map(|side| cross(first, side[0], side[1]))
        .sum::<f64>()
}

/// Whether a point is inside.
#[must_use]
pub fn contains(polygon: &[Point], point: Point) -> bool {
    let mut inside = false;
    for (i, &a) in polygon.iter().enumerate() {
        let b = polygon[(i + 1) % polygon.len()];
        if (a[1] > point[1]) != (b[1] > point[1]) {
            let x = a[0] + (point[1] - a[1]) * (b[0] - a[0]) / (b[1] - a[1]);
            inside ^= point[0] < x;
        }
    }
    inside
}

/// Smallest and largest coordinates.
#[must_use]
pub fn bounds(points: &[Point]) -> (Point, Point) {
    let mut low = [f64::INFINITY; 2];
    let mut high = [f64::NEG_INFINITY; 2];
    for point in points {
        for axis in 0..2 {
            low[axis] = low[axis].min(point[axis]);
            high[axis] = high[axis].max(point[axis]);
        }
    }
    (low, high)
}

/// Distance of a point from a side, metres.
#[must_use]
pub fn distance_to_side(point: Point, a: Point, b: Point) -> f64 {
    let (x, y) = (b[0] - a[0], b[1] - a[1]);
    let length = x * x + y * y;
    if length <= 0.0 {
        return distance(point, a);
    }
    let along = ((point[0] - a[0]) * x + (point[1] - a[1]) * y) / length;
    let along = along.clamp(0.0, 1.0);
    distance(point, [a[0] + along * x, a[1] + along * y])
}

/// Distance of a point from the outline, metres.
#[must_use]
pub fn distance_to_outline(polygon: &[Point], point: Point) -> f64 {
    let sides = (0..polygon.len()).map(|i| (polygon[i], polygon[(i + 1) % polygon.len()]));
    sides.fold(f64::INFINITY, |least, (a, b)| {
        least.min(distance_to_side(point, a, b))
    })
}

/// The convex hull, counter-clockwise, without corners on its sides.
#[must_use]
pub fn convex_hull(points: &[Point]) -> Vec<Point> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    sorted.dedup();
    if sorted.len() < 3 {
        return sorted;
    }
    let mut hull: Vec<Point> = Vec::new();
    let chain = |hull: &mut Vec<Point>, point: Point, base: usize| {
        while hull.len() >= base + 2
            && cross(hull[hull.len() - 2], hull[hull.len() - 1], point) <= 0.0
        {
            hull.pop();
        }
        hull.push(point);
    };
    for &point in &sorted {
        chain(&mut hull, point, 0);
    }
    let base = hull.len() - 1;
    for &point in sorted.iter().rev().skip(1) {
        chain(&mut hull, point, base);
    }
    hull.pop();
    hull
}

/// Removes the corners of a convex polygon that cost the least area, until at most `most`
/// remain and each removal would cost more than `slack` square metres.
pub fn reduce(hull: &mut Vec<Point>, most: usize, slack: f64) {
    while hull.len() > 3 {
        let count = hull.len();
        let cost = |i: usize| {
            let (before, after) = (hull[(i + count - 1) % count], hull[(i + 1) % count]);
            0.5 * cross(before, hull[i], after).abs()
        };
        let least = (0..count).min_by(|&a, &b| cost(a).total_cmp(&cost(b)));
        match least {
            Some(index) if count > most || cost(index) < slack => {
                hull.remove(index);
            }
            _ => return,
        }
    }
}

/// Removes repeated corners and corners that are within `tolerance` metres of the line
/// between their neighbours.
#[must_use]
pub fn cleaned(polygon: &[Point], tolerance: f64) -> Vec<Point> {
    let mut corners = polygon.to_vec();
    loop {
        let count = corners.len();
        if count <= 3 {
            return corners;
        }
        let flat = (0..count).find(|&i| {
            let (before, after) = (corners[(i + count - 1) % count], corners[(i + 1) % count]);
            let corner = corners[i];
            // Repeated, between its neighbours, or the tip of a spike without area.
            distance(corner, after) <= tolerance
                || distance_to_side(corner, before, after) <= tolerance
                || distance_to_side(before, corner, after) <= tolerance
                || distance_to_side(after, corner, before) <= tolerance
        });
        match flat {
            Some(index) => {
                corners.remove(index);
            }
            None => return corners,
        }
    }
}

/// Whether no two sides cross.
#[must_use]
pub fn is_simple(polygon: &[Point]) -> bool {
    let count = polygon.len();
    for i in 0..count {
        for j in i + 2..count {
            if i == 0 && j == count - 1 {
                continue;
            }
            let (a, b) = (polygon[i], polygon[i + 1]);
            let (c, d) = (polygon[j], polygon[(j + 1) % count]);
            let crosses = cross(a, b, c) * cross(a, b, d) < 0.0;
            if crosses && cross(c, d, a) * cross(c, d, b) < 0.0 {
                return false;
            }
        }
    }
    true
}

/// The part of `polygon` outside all `others`, as polygons without holes: bands between the
/// heights of corners and crossings, joined where their slanted sides continue.
#[must_use]
pub fn outside(polygon: &[Point], others: &[&[Point]]) -> Vec<Vec<Point>> {
    let mut heights: Vec<f64> = polygon.iter().map(|p| p[1]).collect();
    let all: Vec<&[Point]> = std::iter::once(polygon)
        .chain(others.iter().copied())
        .collect();
    heights.extend(others.iter().flat_map(|other| other.iter().map(|p| p[1])));
    let sides: Vec<(Point, Point)> = all
        .iter()
        .flat_map(|p| (0..p.len()).map(|i| (p[i], p[(i + 1) % p.len()])))
        .collect();
    for (i, &(a, b)) in sides.iter().enumerate() {
        for &(c, d) in &sides[i + 1..] {
            let (one, two) = (cross(c, d, a), cross(c, d, b));
            if one * two < 0.0 && cross(a, b, c) * cross(a, b, d) < 0.0 {
                let share = one / (one - two);
                heights.push(a[1] + share * (b[1] - a[1]));
            }
        }
    }
    heights.sort_by(f64::total_cmp);
    heights.dedup_by(|a, b| (*a - *b).abs() < 1.0e-6);
    let mut finished: Vec<Vec<Point>> = Vec::new();
    // Open pieces: left side upwards, right side upwards.
    let mut open: Vec<(Vec<Point>, Vec<Point>)> = Vec::new();
    for band in heights.windows(2) {
        let (low, high) = (band[0], band[1]);
        let mut next = Vec::new();
        for (left, right) in intervals(polygon, others, low, high) {
            let continued = open.iter().position(|(l, r)| {
                let near =
                    |side: &[Point], x: f64| side.last().is_some_and(|p| (p[0] - x).abs() < 1.0e-6);
                near(l, left[0]) && near(r, right[0])
            });
            let (mut l, mut r) = match continued {
                Some(index) => open.swap_remove(index),
                None => (vec![[left[0], low]], vec![[right[0], low]]),
            };
            l.push([left[1], high]);
            r.push([right[1], high]);
            next.push((l, r));
        }
        finished.extend(open.drain(..).map(close));
        open = next;
    }
    finished.extend(open.drain(..).map(close));
    finished.retain(|piece| piece.len() >= 3 && area(piece).abs() > 1.0e-3);
    finished
}

/// Pieces that touch along a level side, joined where one outline without a hole results.
/// `is_valid` accepts the joined outline.
#[must_use]
pub fn joined(mut pieces: Vec<Vec<Point>>, is_valid: impl Fn(&[Point]) -> bool) -> Vec<Vec<Point>> {
    let mut first = 0;
    while first < pieces.len() {
        let others = first + 1..pieces.len();
        let found = others.into_iter().find_map(|other| {
            let whole = join(&pieces[first], &pieces[other])?;
            is_valid(&whole).then_some((other, whole))
        });
        match found {
            Some((other, whole)) => {
                pieces.remove(other);
                pieces[first] = whole;
            }
            None => first += 1,
        }
    }
    pieces
}

/// One outline of two counter-clockwise ones that touch along one level side.
fn join(a: &[Point], b: &[Point]) -> Option<Vec<Point>> {
    const LEVEL: f64 = 1.0e-6;
    const LEAST: f64 = 0.02;
    let side = |of: &[Point], i: usize| (of[i], of[(i + 1) % of.len()]);
    let is_level = |(p, q): (Point, Point)| (p[1] - q[1]).abs() < LEVEL;
    let mut shared: Option<Vec<Point>> = None;
    for i in 0..a.len() {
        let (from, to) = side(a, i);
        for j in 0..b.len() {
            let (start, end) = side(b, j);
            let meets = is_level((from, to)) && is_level((start, end)) && is_level((from, start));
            // The sides run against each other.
            let (low, high) = (from[0].min(to[0]), from[0].max(to[0]));
            let low = low.max(start[0].min(end[0]));
            let high = high.min(start[0].max(end[0]));
            let against = (to[0] - from[0]) * (end[0] - start[0]) < 0.0;
            if !meets || !against || high - low < LEAST {
                continue;
            }
            if shared.is_some() {
                return None;
            }
            let (first, last) = if to[0] > from[0] {
                (low, high)
            } else {
                (high, low)
            };
            let mut whole = a[..=i].to_vec();
            whole.push([first, from[1]]);
            whole.extend((1..=b.len()).map(|k| b[(j + k) % b.len()]));
            whole.push([last, from[1]]);
            whole.extend_from_slice(&a[i + 1..]);
            shared = Some(whole);
        }
    }
    let whole = cleaned(&shared?, LEVEL);
    let lost = area(a) + area(b) - area(&whole);
    (lost.abs() < 1.0e-6 && is_simple(&whole)).then_some(whole)
}

fn close((left, mut right): (Vec<Point>, Vec<Point>)) -> Vec<Point> {
    right.extend(left.into_iter().rev());
    cleaned(&right, 1.0e-6)
}

/// Intervals of a band that are inside `polygon` and outside `others`: x of the left and of the
/// right side, each at the lower and the upper height.
fn intervals(
    polygon: &[Point],
    others: &[&[Point]],
    low: f64,
    high: f64,
) -> Vec<([f64; 2], [f64; 2])> {
    let middle = 0.5 * (low + high);
    let mut sides: Vec<(f64, [f64; 2])> = Vec::new();
    for shape in std::iter::once(&polygon).chain(others) {
        for (i, &a) in shape.iter().enumerate() {
            let b = shape[(i + 1) % shape.len()];
            if (a[1] > middle) != (b[1] > middle) {
                let at = |y: f64| a[0] + (y - a[1]) * (b[0] - a[0]) / (b[1] - a[1]);
                sides.push((at(middle), [at(low), at(high)]));
            }
        }
    }
    sides.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut found: Vec<([f64; 2], [f64; 2])> = Vec::new();
    for pair in sides.windows(2) {
        if pair[1].0 - pair[0].0 < 1.0e-6 {
            continue;
        }
        let point = [0.5 * (pair[0].0 + pair[1].0), middle];
        let is_free = contains(polygon, point) && !others.iter().any(|o| contains(o, point));
        if !is_free {
            continue;
        }
        match found.last_mut() {
            Some(last) if last.1 == pair[0].1 => last.1 = pair[1].1,
            _ => found.push((pair[0].1, pair[1].1)),
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(side: f64) -> Vec<Point> {
        vec![[0.0, 0.0], [side, 0.0], [side, side], [0.0, side]]
    }

    #[test]
    fn hull_has_only_its_corners() {
        let mut points = square(2.0);
        points.extend([[1.0, 1.0], [1.0, 0.0], [0.5, 1.5]]);
        assert_eq!(convex_hull(&points), square(2.0));
        assert!((area(&square(2.0)) - 4.0).abs() < 1e-12);
    }

    #[test]
    fn reduced_hull_loses_little_area() {
        let circle: Vec<Point> = (0..64)
            .map(|i| {
                let (s, c) = wheelarm_proto::exact::sin_cos(f64::from(i) * 0.098_174_77);
                [c, s]
            })
            .collect();
        let mut hull = convex_hull(&circle);
        reduce(&mut hull, 12, 0.0);
        assert_eq!(hull.len(), 12);
        assert!(area(&hull) > 0.93 * area(&circle));
    }

    #[test]
    fn room_around_another_loses_its_area() {
        let outer = square(4.0);
        let inner = [[1.0, 1.0], [2.0, 1.0], [2.0, 3.0], [1.0, 3.0]];
        let pieces = outside(&outer, &[&inner]);
        let sum: f64 = pieces.iter().map(|piece| area(piece).abs()).sum();
        assert!((sum - 14.0).abs() < 1e-9, "{pieces:?}");
        for piece in &pieces {
            assert!(is_simple(piece));
            assert!(!contains(piece, [1.5, 2.0]));
        }
        assert_eq!(outside(&outer, &[]).len(), 1);
    }

    #[test]
    fn pieces_beside_a_corner_become_one_and_a_ring_two() {
        let outer = square(4.0);
        let corner = [[3.0, 3.0], [4.0, 3.0], [4.0, 4.0], [3.0, 4.0]];
        let island = [[1.0, 1.0], [2.0, 1.0], [2.0, 3.0], [1.0, 3.0]];
        for (other, count) in [(corner, 1), (island, 2)] {
            let pieces = joined(outside(&outer, &[&other]), is_simple);
            assert_eq!(pieces.len(), count, "{pieces:?}");
            let sum: f64 = pieces.iter().map(|piece| area(piece)).sum();
            assert!((sum - (16.0 - area(&other))).abs() < 1e-9);
            assert!(pieces.iter().all(|piece| is_simple(piece)));
            assert!(!pieces.iter().any(|piece| contains(piece, [1.5, 2.0])) || count == 1);
        }
    }

    #[test]
    fn spikes_and_repeated_corners_are_removed() {
        let mut room = square(3.0);
        room.splice(2..2, [[3.0, 2.0], [5.0, 2.0], [3.0, 2.0]]);
        assert_eq!(cleaned(&room, 1e-3), square(3.0));
    }

    #[test]
    fn crossing_sides_are_found() {
        assert!(is_simple(&square(1.0)));
        let bow = [[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]];
        assert!(!is_simple(&bow));
    }
}
