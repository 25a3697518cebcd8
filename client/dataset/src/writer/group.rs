//! Groups records of state samples for the log: a transfer to another thread
//! costs more than such a record.

use super::threads::GROUP;
use crate::log::{RecordHeader, begin_record_in, finish_record};

/// Collected records.
#[derive(Default)]
pub(super) struct Group {
    data: Vec<u8>,
    count: u64,
    /// Buffer of one record.
    record: Vec<u8>,
}

impl Group {
    /// Adds the record of a sample, its unchanged message. Returns `true` when the group is
    /// large enough.
    pub fn add(&mut self, header: &RecordHeader, payload: &[u8]) -> bool {
        let mut record = begin_record_in(std::mem::take(&mut self.record), payload.len());
        record.extend_from_slice(payload);
        finish_record(&mut record, header);
        self.data.extend_from_slice(&record);
        self.count += 1;
        self.record = record;
        self.data.len() >= GROUP
    }

    /// The number of records and their bytes; `None` for an empty group.
    pub fn take(&mut self) -> Option<(u64, Vec<u8>)> {
        let count = std::mem::take(&mut self.count);
        (count > 0).then(|| (count, std::mem::take(&mut self.data)))
    }
}
