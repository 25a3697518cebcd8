//! Fewer triangles for very detailed models: corners within one cell become one.

use std::collections::BTreeMap;

use crate::glb::Corner;

/// Triangles of a part above which it is simplified.
pub const MOST: usize = 6_000;

/// Simplifies a part to about [`MOST`] triangles or fewer.
#[must_use]
pub fn simplify(triangles: Vec<[Corner; 3]>, size: f64) -> Vec<[Corner; 3]> {
    let mut cells = 160.0;
    let mut simple = triangles;
    for _ in 0..5 {
        if simple.len() <= MOST {
            break;
        }
        simple = clustered(&simple, (size / cells).max(1.0e-4));
        cells *= 0.7;
    }
    simple
}

/// One corner for each cell: the mean of those in it.
fn clustered(triangles: &[[Corner; 3]], cell: f64) -> Vec<[Corner; 3]> {
    let key = |corner: &Corner| corner.0.map(|c| (c / cell).floor() as i64);
    let mut sums: BTreeMap<[i64; 3], ([f64; 3], f64)> = BTreeMap::new();
    for corner in triangles.iter().flatten() {
        let (sum, count) = sums.entry(key(corner)).or_insert(([0.0; 3], 0.0));
        for (total, c) in sum.iter_mut().zip(corner.0) {
            *total += c;
        }
        *count += 1.0;
    }
    let mut kept = Vec::new();
    for triangle in triangles {
        let [a, b, c] = [0, 1, 2].map(|k| key(&triangle[k]));
        if a == b || b == c || c == a {
            continue;
        }
        kept.push([0, 1, 2].map(|k| {
            let (sum, count) = sums
                .get(&key(&triangle[k]))
                .copied()
                .unwrap_or(([0.0; 3], 1.0));
            (sum.map(|total| total / count), triangle[k].1)
        }));
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn detailed_parts_become_simple_and_keep_their_size() {
        let side = 120;
        let at = |i: i32, j: i32| ([f64::from(i) * 0.01, f64::from(j) * 0.01, 0.0], None);
        let mut triangles = Vec::new();
        for i in 0..side {
            for j in 0..side {
                triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
                triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
            }
        }
        let simple = simplify(triangles, 1.2);
        assert!(
            simple.len() <= MOST && simple.len() > 500,
            "{}",
            simple.len()
        );
        let far = simple
            .iter()
            .flatten()
            .fold(0.0_f64, |most, c| most.max(c.0[0]));
        assert!(far > 1.15);
    }
}
