//! Trivial policies, as baselines.

use wheelarm_policy::{ActionKind, STATE};
use wheelarm_proto::v1;

use super::interface::{Policy, PolicyError};

/// Columns of a state row: knuckle, hand pose, odometry.
const KNUCKLE: usize = 12;
const HAND: std::ops::Range<usize> = 14..23;
const ODOMETRY: std::ops::Range<usize> = 23..27;

fn spec(name: &str, history: u32, rate_hz: f64) -> v1::PolicySpec {
    v1::PolicySpec {
        name: name.to_owned(),
        rate_hz,
        history,
        chunk: 1,
        execute: 1,
        action: v1::PolicyAction::NextPose.into(),
        ..Default::default()
    }
}

/// Keeps the hand and the chair at rest.
#[derive(Debug)]
pub struct Hold(v1::PolicySpec);

impl Default for Hold {
    fn default() -> Self {
        Self(spec("hold", 1, 10.0))
    }
}

/// Repeats the previous motion: hand, knuckle and chair keep their velocities, the hand
/// keeps its rotation.
#[derive(Debug)]
pub struct Repeat(v1::PolicySpec);

impl Default for Repeat {
    fn default() -> Self {
        Self(spec("repeat", 2, 10.0))
    }
}

impl Policy for Hold {
    fn spec(&self) -> &v1::PolicySpec {
        &self.0
    }

    fn reset(&self, _: v1::PolicyResetRequest) -> Result<(), PolicyError> {
        Ok(())
    }

    fn infer(&self, observation: v1::PolicyObservation) -> Result<v1::PolicyChunk, PolicyError> {
        let state = newest(&observation, 0)?;
        let mut row = state[HAND].to_vec();
        row.extend([state[KNUCKLE], 0.0, 0.0]);
        Ok(chunk(&observation, &row))
    }
}

impl Policy for Repeat {
    fn spec(&self) -> &v1::PolicySpec {
        &self.0
    }

    fn reset(&self, _: v1::PolicyResetRequest) -> Result<(), PolicyError> {
        Ok(())
    }

    fn infer(&self, observation: v1::PolicyObservation) -> Result<v1::PolicyChunk, PolicyError> {
        let [before, now] = [newest(&observation, 1)?, newest(&observation, 0)?];
        let rate = self.0.rate_hz;
        let mut row = now[HAND].to_vec();
        for (k, value) in row.iter_mut().enumerate().take(3) {
            *value += now[HAND.start + k] - before[HAND.start + k];
        }
        let [x, y, cos, sin] = [0, 1, 2, 3].map(|k| now[ODOMETRY.start + k]);
        let [x0, y0, cos0, sin0] = [0, 1, 2, 3].map(|k| before[ODOMETRY.start + k]);
        let forward = (x - x0) * cos0 + (y - y0) * sin0;
        let turn = wheelarm_proto::exact::atan2(sin * cos0 - cos * sin0, cos * cos0 + sin * sin0);
        row.extend([
            2.0 * now[KNUCKLE] - before[KNUCKLE],
            forward * rate,
            turn * rate,
        ]);
        Ok(chunk(&observation, &row))
    }
}

/// The state of `ago` moments before the newest.
fn newest(observation: &v1::PolicyObservation, ago: usize) -> Result<&[f64], PolicyError> {
    let moment = observation.steps.iter().rev().nth(ago);
    let state = moment.map(|moment| moment.state_values.as_slice());
    state.filter(|state| state.len() == STATE).ok_or_else(|| {
        PolicyError::Rejected(format!("the observation has no {STATE} values of state"))
    })
}

fn chunk(observation: &v1::PolicyObservation, row: &[f64]) -> v1::PolicyChunk {
    debug_assert_eq!(row.len(), ActionKind::NextPose.size());
    v1::PolicyChunk {
        episode_key: observation.episode_key.clone(),
        tick: observation.tick,
        rows: 1,
        values: row.iter().map(|&value| value as f32).collect(),
        problem: String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moment(hand_x: f64, knuckle: f64, odometry: [f64; 4]) -> v1::PolicyStep {
        let mut state = vec![0.0; STATE];
        state[HAND.start] = hand_x;
        state[KNUCKLE] = knuckle;
        state[ODOMETRY].copy_from_slice(&odometry);
        v1::PolicyStep {
            state_values: state,
            images: Vec::new(),
        }
    }

    #[test]
    fn hold_policy_stays_and_repeat_policy_continues() {
        let turned = [0.0, 0.03, 0.995, 0.0998];
        let observation = v1::PolicyObservation {
            steps: vec![
                moment(0.1, 0.2, [0.0, 0.0, 1.0, 0.0]),
                moment(0.3, 0.25, turned),
            ],
            ..Default::default()
        };
        let hold = Hold::default().infer(observation.clone()).unwrap();
        assert_eq!(hold.values[9..], [0.25, 0.0, 0.0]);
        assert_eq!(hold.values[0], 0.3);
        let repeat = Repeat::default().infer(observation).unwrap();
        assert!((repeat.values[0] - 0.5).abs() < 1e-6, "{repeat:?}");
        assert!((repeat.values[9] - 0.3).abs() < 1e-6, "{repeat:?}");
        assert!(repeat.values[10].abs() < 1e-6, "{repeat:?}");
        assert!((repeat.values[11] - 1.0).abs() < 1e-3, "{repeat:?}");
        assert!(Hold::default().infer(Default::default()).is_err());
    }
}
