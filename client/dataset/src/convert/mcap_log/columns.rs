//! Numbers of one stream as the messages take them.

use std::collections::BTreeMap;

use wheelarm_proto::v1;

use crate::read::{ElementKind, Episode, Values};

/// Numeric columns of one stream by name: width and values.
#[derive(Default)]
pub(super) struct Columns {
    all: BTreeMap<String, (usize, Vec<f64>)>,
    pub names: Vec<String>,
    pub headers: Headers,
}

#[derive(Clone, Default)]
pub(super) struct Headers {
    pub stamps: Vec<u64>,
    sequence: Vec<u64>,
    tick: Vec<u64>,
}

impl Headers {
    pub fn of(episode: &Episode, stream: &str) -> anyhow::Result<Self> {
        Ok(Self {
            stamps: episode.stamps(stream)?,
            sequence: episode.u64s(stream, "sequence")?,
            tick: episode.u64s(stream, "tick")?,
        })
    }

    pub fn header(&self, i: usize) -> Option<v1::Header> {
        Some(v1::Header {
            stamp_nanos: self.stamps[i],
            sequence: self.sequence.get(i).copied().unwrap_or(0),
            tick: self.tick.get(i).copied().unwrap_or(0),
            ..Default::default()
        })
    }
}

impl Columns {
    pub fn of(episode: &Episode, stream: &str) -> anyhow::Result<Self> {
        let mut out = Self {
            headers: Headers::of(episode, stream)?,
            ..Self::default()
        };
        for meta in episode.columns(stream)? {
            if meta.kind == ElementKind::F64
                && let Values::F64(values) = episode.values(&meta)?
            {
                if out.names.is_empty() {
                    out.names.clone_from(&meta.names);
                }
                out.all.insert(meta.name.clone(), (meta.width(), values));
            }
        }
        Ok(out)
    }

    pub fn row(&self, column: &str, i: usize) -> &[f64] {
        match self.all.get(column) {
            Some((width, values)) => values.get(i * width..(i + 1) * width).unwrap_or(&[]),
            None => &[],
        }
    }
}
