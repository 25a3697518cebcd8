//! Records of state samples that go to the log together: a hand-over to another thread
//! costs more than such a record.

use super::threads::GROUP;
use crate::log::{RecordHeader, begin_record_in, finish_record};

/// Records in the making.
#[derive(Default)]
pub(super) struct Group {
    data: Vec<u8>,
    count: u64,
    /// Memory of one record.
    record: Vec<u8>,
}

impl Group {
    /// Adds the record of a sample: the message as it came. `true` when the group is
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

    /// How many there are, and their bytes; `None` where there are none.
    pub fn take(&mut self) -> Option<(u64, Vec<u8>)> {
        let count = std::mem::take(&mut self.count);
        (count > 0).then(|| (count, std::mem::take(&mut self.data)))
    }
}
