//! A policy for the tests: it holds the robot, and on some seeds it misbehaves.
//!
//! `wheelarm-test-policy MISBEHAVIOUR…`, for the seeds from 0 on: `well`, `shape`,
//! `nan`, `huge`, `words`, `silent`, `dies`, `keys`, `sways` (its speed depends on
//! the number of observations in a request, like the last bits of a network); or at once
//! `unfit` and `crash`.

use wheelarm_proto::v1;
use wheelarm_sdk::Connect;
use wheelarm_sdk::policy::{NAME_VARIABLE, POLICY_VARIABLE, PolicyService, serve};

/// Columns of hand and knuckle in a row of state.
const HAND: std::ops::Range<usize> = 14..23;
const KNUCKLE: usize = 12;

struct Misbehaves {
    how: Vec<String>,
}

impl PolicyService for Misbehaves {
    fn spec(&self) -> v1::PolicySpec {
        v1::PolicySpec {
            name: "test".to_owned(),
            rate_hz: if self.how == ["unfit"] { 7.0 } else { 10.0 },
            chunk: 5,
            execute: 5,
            max_batch: 4,
            ..Default::default()
        }
    }

    fn reset(&mut self, _: &v1::PolicyResetRequest) {}

    fn infer(&mut self, request: &v1::InferRequest) -> v1::InferReply {
        let together = request.observations.len();
        let chunks = request.observations.iter();
        let chunks = chunks.map(|o| self.chunk(o, together)).collect();
        v1::InferReply { chunks }
    }
}

impl Misbehaves {
    fn chunk(&self, observation: &v1::PolicyObservation, together: usize) -> v1::PolicyChunk {
        let state = &observation.steps[0].state_values;
        let mut row: Vec<f32> = state[HAND].iter().map(|&v| v as f32).collect();
        row.extend([state[KNUCKLE] as f32, 0.0, 0.0]);
        let mut chunk = v1::PolicyChunk {
            episode_key: observation.episode_key.clone(),
            tick: observation.tick,
            rows: 5,
            values: row.repeat(5),
            problem: String::new(),
        };
        let how = self.how.get(observation.seed as usize);
        match how.map_or("well", String::as_str) {
            "shape" => chunk.rows = u32::MAX,
            "nan" => chunk.values[17] = f32::NAN,
            "huge" => chunk.values[10] = 1e9,
            "words" => chunk.problem = "it is dark here".to_owned(),
            "keys" => chunk.tick += 1,
            "sways" if observation.tick >= observation.seed * 48 + 480 => {
                chunk.problem = "far enough".to_owned();
            }
            "sways" => {
                let speed = 0.1 * together as f32;
                chunk.values.chunks_mut(12).for_each(|row| row[10] = speed);
            }
            "silent" => std::thread::sleep(std::time::Duration::from_secs(3600)),
            "dies" => {
                eprintln!("error: the network is on fire");
                std::process::exit(1);
            }
            _ => {}
        }
        chunk
    }
}

fn main() -> anyhow::Result<()> {
    let how: Vec<String> = std::env::args().skip(1).collect();
    if how == ["crash"] {
        anyhow::bail!("no such file: weights.safetensors");
    }
    let connect = Connect::to(&std::env::var(POLICY_VARIABLE)?, "sim");
    let mut policy = Misbehaves { how };
    serve(&mut policy, &std::env::var(NAME_VARIABLE)?, &connect, || {})?;
    Ok(())
}
