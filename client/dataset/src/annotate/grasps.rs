//! The grasp that the hand used of an object's grasps: the one nearest to where its tool
//! was when the object began to be held. No operator publishes its choice.

use serde::Deserialize;
use wheelarm_language::kind_of;

use super::state::State;
use crate::pose;

/// A grasp that closed on an object.
#[derive(Clone, Debug, PartialEq)]
pub struct ChosenGrasp {
    /// Since when the object is held, simulation time, nanoseconds.
    pub stamp: u64,
    /// The object.
    pub object: String,
    /// Name and place in the object's file of the nearest grasp.
    pub name: String,
    /// Place in the object's file, from 0.
    pub index: usize,
    /// From it to the tool's grasp point, metres.
    pub distance: f64,
    /// Between its approach and the hand's, radians.
    pub angle: f64,
    /// The other grasps of the object's file, by their places.
    pub alternatives: Vec<usize>,
}

#[derive(Deserialize)]
struct ObjectFile {
    #[serde(default)]
    grasps: Vec<Grasp>,
}

#[derive(Deserialize)]
struct Grasp {
    name: String,
    point: [f64; 3],
    approach: [f64; 3],
    #[serde(default)]
    symmetric: bool,
}

#[derive(Deserialize)]
struct RobotFile {
    tool_length: f64,
}

/// Radians that count as much as a metre.
const TURN: f64 = 0.05;

/// The grasps of an episode by time; a hold that was lost for less than half a
/// second continues.
pub(super) fn grasps(state: &State) -> Vec<ChosenGrasp> {
    let text = |path: &str| {
        state
            .assets
            .iter()
            .find(|(p, _)| p.ends_with(path))
            .map(|(_, t)| t)
    };
    let robot: Option<RobotFile> = text("/robot.toml").and_then(|t| toml::from_str(t).ok());
    let length = robot.map_or(0.0, |robot| robot.tool_length);
    let mut out: Vec<ChosenGrasp> = Vec::new();
    let mut last: Option<(usize, u64)> = None;
    for (row, held) in state.held.iter().enumerate() {
        let Some(object) = *held else { continue };
        let stamp = state.stamps[row];
        let goes_on = last.is_some_and(|(o, t)| o == object && stamp - t < 500_000_000);
        last = Some((object, stamp));
        if goes_on {
            continue;
        }
        let name = &state.objects[object];
        let file = text(&format!("objects/{}.toml", kind_of(name)));
        let file: Option<ObjectFile> = file.and_then(|t| toml::from_str(t).ok());
        let listed = file.map_or(Vec::new(), |f| f.grasps);
        let hand = &state.hand[row];
        let own = &state.poses[row][object];
        let ahead = pose::turned(pose::orientation(hand), [0.0, 0.0, 1.0]);
        let tool = [0, 1, 2].map(|k| hand[k] + length * ahead[k] - own[k]);
        let [x, y, z, w] = pose::orientation(own);
        let back = |v| pose::turned([-x, -y, -z, w], v);
        let (tool, ahead) = (back(tool), back(ahead));
        let far = |grasp: &Grasp| {
            // Any turn about the object's z axis will do.
            let flat = |[x, y, z]: [f64; 3]| match grasp.symmetric {
                true => [x.hypot(y), 0.0, z],
                false => [x, y, z],
            };
            let (a, b) = (flat(tool), flat(grasp.point));
            let distance = (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt();
            let cos: f64 = match grasp.symmetric {
                true => {
                    let side =
                        ahead[0].hypot(ahead[1]) * grasp.approach[0].hypot(grasp.approach[1]);
                    side + ahead[2] * grasp.approach[2]
                }
                false => (0..3).map(|k| ahead[k] * grasp.approach[k]).sum(),
            };
            (distance, cos.clamp(-1.0, 1.0).acos())
        };
        let ranked = listed.iter().enumerate().map(|(i, grasp)| (i, far(grasp)));
        let cost = |(d, a): (f64, f64)| d + TURN * a;
        let best = ranked.min_by(|a, b| cost(a.1).total_cmp(&cost(b.1)));
        let Some((index, (distance, angle))) = best else {
            continue;
        };
        out.push(ChosenGrasp {
            stamp,
            object: name.clone(),
            name: listed[index].name.clone(),
            index,
            distance,
            angle,
            alternatives: (0..listed.len()).filter(|&i| i != index).collect(),
        });
    }
    out
}
