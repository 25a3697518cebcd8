//! Restores the samples of a stream as messages from columns,
//! by the table of columns.

use std::path::PathBuf;

use wheelarm_proto::{StreamId, Topic, v1};

use super::error::ReadError;
use super::{Episode, Values};
use crate::columns::{self, Cell, Context, Kind, Stream};

/// A stream's samples, in memory.
pub struct Samples {
    path: PathBuf,
    table: &'static dyn Stream,
    context: Context,
    stamps: Vec<u64>,
    sequences: Vec<u64>,
    ticks: Vec<u64>,
    /// One per column of the table; `None` where the file does not have it.
    columns: Vec<Option<Stored>>,
}

/// Content of a column.
enum Stored {
    /// Values, with their number per sample.
    Values(Values, usize),
    /// Encoded messages.
    Messages(Vec<Vec<u8>>),
}

impl Stored {
    /// The cell of a sample; `None` behind the last one.
    fn cell(&self, i: usize) -> Option<Cell> {
        fn part<T: Clone>(all: &[T], width: usize, i: usize) -> Option<Vec<T>> {
            all.get(i * width..(i + 1) * width).map(<[T]>::to_vec)
        }
        match self {
            Self::Values(Values::F64(all), width) => part(all, *width, i).map(Cell::F64),
            Self::Values(Values::U64(all), width) => part(all, *width, i).map(Cell::U64),
            Self::Values(Values::Flag(all), width) => part(all, *width, i).map(Cell::Flag),
            Self::Values(Values::Text(all), _) => all.get(i).cloned().map(Cell::Text),
            Self::Messages(all) => all.get(i).cloned().map(Cell::Bytes),
        }
    }
}

impl Episode {
    /// The samples of a state stream as messages.
    ///
    /// # Errors
    /// When the file does not hold the stream, or this version does not know it.
    pub fn samples(&self, stream: &str) -> Result<Samples, ReadError> {
        let table =
            columns::for_stream(&StreamId::parse(stream)).ok_or_else(|| ReadError::Content {
                path: self.path().to_owned(),
                what: stream.to_owned(),
                reason: "this version knows no such state stream".to_owned(),
            })?;
        let stored = self.columns(stream)?;
        let mut messages = self.encoded(stream)?;
        let mut context = Context::default();
        let mut columns = Vec::new();
        for column in table.columns() {
            columns.push(match (column.kind, &mut messages) {
                (Kind::Bytes, Some(messages)) => Some(Stored::Messages(std::mem::take(messages))),
                // The messages contain the values of the other columns.
                (_, Some(_)) | (Kind::Bytes, None) => None,
                (_, None) => match stored.iter().find(|meta| meta.name == column.name) {
                    Some(meta) => {
                        column
                            .axes
                            .iter()
                            .for_each(|axis| axis.learn(&meta.names, &mut context));
                        Some(Stored::Values(self.values(meta)?, meta.width()))
                    }
                    None => None,
                },
            });
        }
        Ok(Samples {
            path: self.path().to_owned(),
            table,
            context,
            stamps: self.stamps(stream)?,
            sequences: self.u64s(stream, "sequence")?,
            ticks: self.u64s(stream, "tick")?,
            columns,
        })
    }

    /// All samples of a topic with their ticks, oldest first.
    ///
    /// # Errors
    /// When the file does not have it.
    pub fn messages_of<M: Topic>(&self) -> Result<Vec<(u64, M)>, ReadError> {
        let samples = self.samples(M::NAME)?;
        let all = samples.ticks.iter().enumerate();
        all.map(|(i, &tick)| Ok((tick, samples.message(i)?)))
            .collect()
    }
}

impl Samples {
    /// Names that only the file knows: joints, frames, objects, conditions.
    #[must_use]
    pub fn context(&self) -> &Context {
        &self.context
    }

    /// Stamps of the samples, nanoseconds of simulation time.
    #[must_use]
    pub fn stamps(&self) -> &[u64] {
        &self.stamps
    }

    /// The encoded message of sample `i`: as it was published, or with stamp,
    /// sequence number and tick in its header where the file holds columns instead.
    ///
    /// # Errors
    /// When no such sample exists, or its values make no message.
    pub fn encoded(&self, i: usize) -> Result<Vec<u8>, ReadError> {
        let content = |reason: String| ReadError::Content {
            path: self.path.clone(),
            what: format!("{}, sample {i}", self.table.name()),
            reason,
        };
        let stamp_nanos = self.stamps.get(i).copied();
        let header = v1::Header {
            stamp_nanos: stamp_nanos.ok_or_else(|| content("there is none".to_owned()))?,
            sequence: self.sequences.get(i).copied().unwrap_or_default(),
            tick: self.ticks.get(i).copied().unwrap_or_default(),
            ..v1::Header::default()
        };
        let cells = self.columns.iter();
        let cells = cells.map(|column| column.as_ref()?.cell(i)).collect();
        let encoded = self.table.restore(header, cells, &self.context);
        encoded.map_err(|problem| content(problem.to_string()))
    }

    /// The message of sample `i`.
    ///
    /// # Errors
    /// As [`Samples::encoded`], and when the stream is of another topic.
    pub fn message<M: Topic>(&self, i: usize) -> Result<M, ReadError> {
        let encoded = self.encoded(i)?;
        M::decode(encoded.as_slice()).map_err(|source| ReadError::Message {
            path: self.path.clone(),
            what: self.table.name().to_owned(),
            source,
        })
    }
}
