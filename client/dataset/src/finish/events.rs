//! `/events`: events of several sources in the order of time.

use hdf5::Group;
use prost::Message;
use wheelarm_proto::v1;

use crate::columns::{Cell, Context, EVENT_COLUMNS, event_cells};
use crate::compress::Deflate;
use crate::hdf::ColumnWriter;

use super::streams::{HEADER_COLUMNS, header_cells};

/// One row of `/events`.
pub(super) struct Row {
    pub header: v1::Header,
    pub source: &'static str,
    pub kind: String,
    pub text: String,
}

impl Row {
    pub fn new(header: Option<v1::Header>, source: &'static str, kind: &str, text: &str) -> Self {
        Self {
            header: header.unwrap_or_default(),
            source,
            kind: kind.to_owned(),
            text: text.to_owned(),
        }
    }

    /// A sample of the event stream; `None` when it cannot be decoded.
    pub fn event(payload: &[u8]) -> Option<Self> {
        let event = v1::Event::decode(payload).ok()?;
        let kind = event.kind().word();
        Some(Self::new(event.header, "event", &kind, &event.text))
    }
}

/// Phase changes among the samples of the phase stream.
#[derive(Default)]
pub(super) struct Phases {
    last: Option<(i32, String)>,
}

impl Phases {
    /// A row when the phase differs from the one before.
    pub fn changed(&mut self, payload: &[u8]) -> Option<Row> {
        let sample = v1::PhaseSample::decode(payload).ok()?;
        let now = (sample.phase, sample.name);
        if self.last.as_ref() == Some(&now) {
            return None;
        }
        let number = now.0.to_string();
        let row = Row::new(
            sample.header,
            "phase",
            "phase",
            &format!("{number} {}", now.1),
        );
        self.last = Some(now);
        Some(row)
    }
}

/// Writes the rows, sorted by time; those of one tick keep their order.
pub(super) fn write(file: &Group, mut rows: Vec<Row>) -> hdf5::Result<usize> {
    rows.sort_by_key(|r| (r.header.tick, r.header.stamp_nanos));
    let group = file.create_group("events")?;
    let context = Context::default();
    let mut columns = Vec::new();
    for column in HEADER_COLUMNS.iter().chain(&EVENT_COLUMNS) {
        columns.push(ColumnWriter::create(&group, column, &context, rows.len())?);
    }
    let mut deflate = Deflate::default();
    for row in &rows {
        let head = header_cells(row.header.stamp_nanos, row.header.sequence, row.header.tick);
        let cells: Vec<Cell> = head
            .into_iter()
            .chain(event_cells(row.source, &row.kind, &row.text))
            .collect();
        for (column, cell) in columns.iter_mut().zip(cells) {
            column.push(cell, &mut deflate)?;
        }
    }
    for column in columns {
        column.finish(&mut deflate)?;
    }
    Ok(rows.len())
}
