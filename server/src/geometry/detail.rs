//! Level of detail of curves, and removal of degenerate triangles.

use wheelarm_proto::exact;

use super::TriMesh;

/// Level of detail of curves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Detail {
    /// At most 0.3 mm between a curve and its chords, 48 chords around.
    Full,
    /// At most 3 mm, 16 chords around: for distant views and shadow maps.
    Coarse,
}

impl Detail {
    /// Chords around a circle of `radius` metres.
    pub(super) fn chords(self, radius: f64) -> usize {
        let (error, least, most) = match self {
            Detail::Full => (0.0003, 12, 48),
            Detail::Coarse => (0.003, 6, 16),
        };
        let wanted = std::f64::consts::PI / exact::acos(1.0 - error / radius.max(2.0 * error));
        // Multiples of four keep the extreme points on the axes.
        (wanted / 4.0)
            .ceil()
            .clamp(least as f64 / 4.0, most as f64 / 4.0) as usize
            * 4
    }
}

/// Removes triangles with zero area (poles, full roundings).
pub(super) fn drop_slivers(mesh: &mut TriMesh) {
    let positions = &mesh.positions;
    mesh.indices = mesh
        .indices
        .chunks_exact(3)
        .filter(|t| {
            let [a, b, c] = [t[0], t[1], t[2]].map(|i| positions[i as usize].map(f64::from));
            let e: [f64; 3] = std::array::from_fn(|k| b[k] - a[k]);
            let f: [f64; 3] = std::array::from_fn(|k| c[k] - a[k]);
            let cross = [
                e[1] * f[2] - e[2] * f[1],
                e[2] * f[0] - e[0] * f[2],
                e[0] * f[1] - e[1] * f[0],
            ];
            cross.iter().map(|x| x * x).sum::<f64>() > 1e-20
        })
        .flatten()
        .copied()
        .collect();
}
