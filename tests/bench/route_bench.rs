//! Nodes and time of route planning in the home: the reference (hybrid A* with the straight
//! distance, as the scripted operator searched before: three rough searches and six
//! complete ones) beside one search on the floor map with its distance field.
//!
//! With `--pack` the home is that of a world pack, and `--posture travel` stows the arm. The
//! bench then also shows pairs without a route, and those of 10 m and more.
//!
//! `route_bench [--assets DIR] [--pack DIR] [--posture home|travel] [--pairs N] [--reference N]`

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use anyhow::Result;
use clap::Parser;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use wheelarm_pack::Pack;
use wheelarm_planning::footprint_check::{FootprintCheck, Outline, Pose2};
use wheelarm_planning::hybrid_a_star::{DriveGoal, PathPreferences, Segment, has_path, search};
use wheelarm_planning::route_planner::{RouteError, RoutePlanner};
use wheelarm_server::robot::RobotModel;
use wheelarm_server::scene::Scene;
use wheelarm_server::tasks::collision_boxes;

#[derive(Parser)]
struct Options {
    /// Folder with robots and scenes.
    #[arg(long, default_value = "assets")]
    assets: PathBuf,
    /// Folder or file of a world pack; the home of the assets when absent.
    #[arg(long)]
    pack: Option<PathBuf>,
    /// Posture of the arm: `home` or `travel`.
    #[arg(long, default_value = "home")]
    posture: String,
    /// Random pairs of a start and a goal.
    #[arg(long, default_value_t = 200)]
    pairs: usize,
    /// Pairs that the reference searches too; it takes about a second each.
    #[arg(long, default_value_t = 20)]
    reference: usize,
}

/// Preferences of the scripted operator.
const WIDE: PathPreferences = PathPreferences {
    radius: 0.8,
    margin: 0.05,
};
const TIGHT: PathPreferences = PathPreferences {
    radius: 0.6,
    ..WIDE
};
/// Lengths of the last, straight segment, metres.
const STRAIGHTS: [f64; 3] = [0.35, 0.2, 0.08];
/// Nodes of a rough search of the reference.
const ROUGH: usize = 12_000;

fn main() -> Result<()> {
    let options = Options::parse();
    let model = RobotModel::load(&options.assets, "wheelarm")?;
    let scene = match &options.pack {
        Some(path) => Scene::from_pack(&options.assets, &Arc::new(Pack::open(path)?))?,
        None => Scene::load(&options.assets, "home")?,
    };
    let travel = model.settings.travel.as_ref();
    let travel = travel.filter(|_| options.posture == "travel");
    let outlines = travel.map_or(&model.settings.outlines, |travel| &travel.outlines);
    let outlines = outlines
        .iter()
        .map(|o| (o.top, Outline { sides: o.footprint }));
    let mut footprint = FootprintCheck::from_outlines(outlines);
    for obb in scene.furniture.iter().flat_map(collision_boxes) {
        footprint.put(obb.rectangle(), obb.heights());
    }
    let begin = Instant::now();
    let start = Pose2 {
        x: scene.start.translation.x,
        y: scene.start.translation.y,
        heading: 0.0,
    };
    let mut planner = RoutePlanner::new(footprint.clone(), Vec::new(), start, &[], WIDE.margin);
    let map = planner.map(WIDE.margin);
    let made = begin.elapsed();
    let begin = Instant::now();
    let parts = map.parts().sizes().len();
    println!(
        "floor map of {} poses in {:.1} ms, {parts} parts in {:.1} ms",
        map.grid().poses(),
        made.as_secs_f64() * 1e3,
        begin.elapsed().as_secs_f64() * 1e3
    );
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let [x0, x1, y0, y1] = footprint.extent();
    let mut place = |margin: f64| loop {
        let pose = Pose2 {
            x: random.random_range(x0..x1),
            y: random.random_range(y0..y1),
            heading: random.random_range(-3.0..3.0),
        };
        if footprint.is_free(&pose, margin) {
            return pose;
        }
    };
    let pairs: Vec<_> = (0..options.pairs)
        .map(|_| (place(0.1), place(0.05)))
        .collect();
    let mut times = Vec::new();
    // Without a way, without a path, and of 10 m and more: number and greatest time, ms.
    let mut special = [(0, 0.0_f64); 3];
    let (mut nodes, mut found) = (0, 0);
    let (mut costs, mut references, mut waited) = (Vec::new(), Vec::new(), 0.0);
    for (i, (start, stop)) in pairs.iter().enumerate() {
        let goals = STRAIGHTS.map(|length| DriveGoal {
            pose: stop.rolled(-length, 0.0),
            cost: length / 0.45 - 4.0 * length,
        });
        let begin = Instant::now();
        let mut planner =
            RoutePlanner::new(footprint.clone(), Vec::new(), *start, &[], WIDE.margin);
        let route = planner.route(&goals, &[WIDE.radius, TIGHT.radius]);
        let time = begin.elapsed().as_secs_f64() * 1e3;
        times.push(time);
        let kind = match &route {
            Err(RouteError::NotFound { .. }) => Some(1),
            Err(RouteError::NoWay | RouteError::Collides) => Some(0),
            Ok(found) if length(&found.path.segments) >= 10.0 => Some(2),
            Ok(_) => None,
        };
        if let Some(kind) = kind {
            special[kind].0 += 1;
            special[kind].1 = special[kind].1.max(time);
        }
        nodes += planner.nodes();
        found += usize::from(route.is_ok());
        if i < options.reference {
            let begin = Instant::now();
            let known = reference(&footprint, *start, &goals);
            waited += begin.elapsed().as_secs_f64();
            if let (Ok(route), Some(known)) = (route, known) {
                costs.push(route.path.cost);
                references.push(known);
            }
        }
    }
    times.sort_by(f64::total_cmp);
    let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize];
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    println!(
        "field: {found} of {} found, {:.0} nodes and {:.1} ms per pair (median {:.1}, 95 % {:.1}, greatest {:.0})",
        pairs.len(),
        nodes as f64 / pairs.len() as f64,
        mean(&times),
        at(0.5),
        at(0.95),
        at(1.0)
    );
    for ((number, greatest), name) in
        special
            .iter()
            .zip(["without a way", "without a path", "of 10 m and more"])
    {
        println!("pairs {name}: {number}, greatest {greatest:.1} ms");
    }
    println!(
        "reference: {:.0} ms per pair; {} pairs found by both: cost {:.2} s, field {:.2} s",
        waited / options.reference.min(pairs.len()).max(1) as f64 * 1e3,
        costs.len(),
        mean(&references),
        mean(&costs)
    );
    Ok(())
}

/// Length of a path, metres.
fn length(segments: &[Segment]) -> f64 {
    let rolled = segments.iter().map(|segment| match segment {
        Segment::Roll { length, .. } => length.abs(),
        Segment::Turn(_) => 0.0,
    });
    rolled.sum()
}

/// Cost of the best path of the reference, seconds.
fn reference(footprint: &FootprintCheck, start: Pose2, goals: &[DriveGoal]) -> Option<f64> {
    let mut best: Option<f64> = None;
    for goal in goals {
        if !has_path(footprint, start, goal.pose, &TIGHT, ROUGH) {
            continue;
        }
        for preferences in [WIDE, TIGHT] {
            if let Some(path) = search(footprint, start, goal.pose, &preferences) {
                let cost = path.cost + goal.cost;
                best = Some(best.map_or(cost, |best| best.min(cost)));
            }
        }
    }
    best
}
