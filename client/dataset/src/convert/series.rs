//! Messages over time for log formats: metadata that is known before the
//! first is made, and all of them in the order of time.

use super::batch::parallel;

/// Messages that are made together: about half a second.
const BLOCK: usize = 512;

/// Encodes the message of a sample with a stamp.
type Make<'a> = Box<dyn Fn(usize, u64) -> anyhow::Result<Vec<u8>> + Sync + 'a>;

/// Messages of one source; `K` is the metadata of a format.
pub(super) struct Series<'a, K> {
    /// Topic.
    pub topic: String,
    /// Metadata of the messages.
    pub kind: K,
    /// Stamps of the messages, nanoseconds of simulation time.
    pub stamps: Vec<u64>,
    make: Make<'a>,
}

impl<'a, K> Series<'a, K> {
    /// One message per stamp; `make` takes the number of the sample and its stamp.
    pub fn new(
        topic: impl Into<String>,
        kind: K,
        stamps: Vec<u64>,
        make: impl Fn(usize, u64) -> anyhow::Result<Vec<u8>> + Sync + 'a,
    ) -> Self {
        Self {
            topic: topic.into(),
            kind,
            stamps,
            make: Box::new(make),
        }
    }
}

/// A message in its place.
pub(super) struct Placed<'a> {
    /// Number of its series.
    pub series: usize,
    /// Number of its sample there.
    pub sample: usize,
    /// Its stamp, nanoseconds.
    pub stamp: u64,
    /// The encoded message.
    pub bytes: &'a [u8],
}

/// Makes every message in the order of time, those of one stamp in the order of
/// their series, and hands each over; returns how many there were.
///
/// # Errors
/// The first one of a message or of `put`.
pub(super) fn in_order<K: Sync>(
    all: &[Series<'_, K>],
    threads: usize,
    mut put: impl FnMut(Placed<'_>) -> anyhow::Result<()>,
) -> anyhow::Result<usize> {
    let order = order(all);
    for block in order.chunks(BLOCK) {
        let messages = parallel(block.len(), threads, |at| {
            let (stamp, series, sample) = block[at];
            (all[series].make)(sample, stamp)
        })?;
        for (&(stamp, series, sample), bytes) in block.iter().zip(&messages) {
            put(Placed {
                series,
                sample,
                stamp,
                bytes,
            })?;
        }
    }
    Ok(order.len())
}

/// Every sample in the order of time: stamp, series, sample.
fn order<K>(all: &[Series<'_, K>]) -> Vec<(u64, usize, usize)> {
    let each = all.iter().enumerate().flat_map(|(k, series)| {
        let stamps = series.stamps.iter().enumerate();
        stamps.map(move |(i, &stamp)| (stamp, k, i))
    });
    let mut order: Vec<_> = each.collect();
    order.sort_unstable();
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_ordered_by_time_and_then_by_series() {
        let series = |name: &'static str, stamps: &[u64]| {
            let make = move |i: usize, stamp: u64| Ok(format!("{name}{i}@{stamp}").into_bytes());
            Series::new(name, (), stamps.to_vec(), make)
        };
        let all = [series("a", &[1, 3, 3]), series("b", &[0, 3])];
        let mut collected = Vec::new();
        let count = in_order(&all, 2, |m| {
            assert_eq!(m.sample, usize::from(m.bytes[1] - b'0'));
            collected.push(String::from_utf8(m.bytes.to_vec())?);
            Ok(())
        });
        assert_eq!(count.unwrap(), 5);
        assert_eq!(collected, ["b0@0", "a0@1", "a1@3", "a2@3", "b1@3"]);
    }
}
