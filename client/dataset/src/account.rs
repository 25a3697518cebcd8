//! Account of an episode: expected and recorded samples, and completeness.

use std::collections::BTreeMap;

use wheelarm_proto::v1;

use crate::coverage::Coverage;
use crate::log::{Closing, Scan};

/// One stream's account.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct StreamAccount {
    /// Stream name; cameras as `camera/NAME`.
    pub stream: String,
    /// Samples that the server published, by its manifest; without a manifest
    /// those from the first to the last one received, which are the least.
    pub expected: u64,
    /// The manifest arrived: `expected` and `missed` are exact.
    pub counted: bool,
    /// Samples in the file.
    pub received: u64,
    /// `expected` that are not in the file.
    pub missed: u64,
    /// Samples that arrived late because they were sent again.
    pub recovered: u64,
    /// Digest of the recorded samples, as the recorder computed it; empty when the
    /// log was never closed.
    pub digest: String,
    /// Digest of the published samples; empty without a manifest.
    pub published: String,
}

/// The account of a whole episode.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Account {
    /// One entry per stream, in the order of the log's streams.
    pub streams: Vec<StreamAccount>,
    /// Why the file is partial; empty when it is complete.
    pub problems: Vec<String>,
}

impl Account {
    /// The manifest arrived and every sample of it is recorded.
    #[must_use]
    pub fn complete(&self) -> bool {
        self.problems.is_empty()
    }

    /// The manifest arrived: the number of missing samples is known.
    #[must_use]
    pub fn counted(&self) -> bool {
        self.streams.iter().all(|s| s.counted)
    }

    /// Sum over the streams.
    #[must_use]
    pub fn total(&self, of: impl Fn(&StreamAccount) -> u64) -> u64 {
        self.streams.iter().map(of).sum()
    }

    /// The account of a log.
    #[must_use]
    pub fn from_scan(scan: &Scan) -> Self {
        let mut coverage = vec![Coverage::default(); scan.preamble.streams.len()];
        for entry in &scan.entries {
            coverage[usize::from(entry.header.stream)].insert(entry.header.sequence);
        }
        let default = Closing::default();
        let closing = scan.closing.as_ref().unwrap_or(&default);
        let manifest: Option<BTreeMap<&str, &v1::StreamCount>> = closing
            .stopped
            .as_ref()
            .map(|s| s.manifest.iter().map(|c| (c.stream.as_str(), c)).collect());
        let mut problems = of_log(scan, closing);
        let mut streams = Vec::new();
        for (name, coverage) in scan.preamble.streams.iter().zip(&coverage) {
            let listed = manifest
                .as_ref()
                .map(|manifest| manifest.get(name.as_str()).copied());
            let (account, found) = of_stream(name, coverage, listed, closing);
            problems.extend(found);
            streams.push(account);
        }
        for (name, count) in manifest.iter().flatten() {
            if count.count > 0 && !scan.preamble.streams.iter().any(|s| s == name) {
                problems.push(format!(
                    "{name}: {} samples were published that the start of the episode did not announce",
                    count.count
                ));
                streams.push(StreamAccount {
                    stream: (*name).to_owned(),
                    expected: count.count,
                    counted: true,
                    missed: count.count,
                    published: hex(&count.digest),
                    ..Default::default()
                });
            }
        }
        Self { streams, problems }
    }
}

/// Problems of the log as a whole.
fn of_log(scan: &Scan, closing: &Closing) -> Vec<String> {
    let mut problems = Vec::new();
    if let Some(damage) = &scan.damage {
        problems.push(format!("{} bytes of the log are lost: {damage}", scan.lost));
    }
    if scan.closing.is_none() {
        problems.push("the recorder ended before it closed the log".to_owned());
    }
    if !closing.reason.is_empty() {
        problems.push(closing.reason.clone());
    }
    if scan.closing.is_some() && closing.stopped.is_none() {
        let words = "the server's manifest did not come: how many samples are missing is unknown";
        problems.push(words.to_owned());
    }
    problems
}

/// One stream's account and its problems. `listed` is its entry of the
/// server's manifest, if that arrived.
fn of_stream(
    name: &str,
    coverage: &Coverage,
    listed: Option<Option<&v1::StreamCount>>,
    closing: &Closing,
) -> (StreamAccount, Vec<String>) {
    let sent_again = closing.recovered.iter().rfind(|r| r.stream == name);
    let mut problems = Vec::new();
    let expected = match listed {
        Some(Some(count)) => count.count,
        // A stream without a manifest entry has no published samples.
        Some(None) => 0,
        None => coverage.received() + coverage.gaps(),
    };
    let there = match listed {
        Some(Some(count)) if count.count > 0 => coverage.within(count.first, count.last),
        Some(_) => 0,
        None => coverage.received(),
    };
    let received = closing.received.iter().find(|r| r.stream == name);
    let published = match listed {
        Some(Some(count)) => hex(&count.digest),
        _ => String::new(),
    };
    let account = StreamAccount {
        stream: name.to_owned(),
        counted: listed.is_some(),
        digest: received.map_or_else(String::new, |r| hex(&r.digest)),
        published,
        expected,
        received: coverage.received(),
        missed: expected.saturating_sub(there),
        recovered: sent_again.map_or(0, |r| r.count),
    };
    if account.missed > 0 {
        problems.push(format!(
            "{name}: {} of {expected} samples are missing",
            account.missed
        ));
    }
    if account.received > there {
        problems.push(format!(
            "{name}: {} samples are recorded that the manifest does not list",
            account.received - there
        ));
    }
    let doubtful = received.map_or(0, |r| r.doubtful);
    let is_known = [&account.digest, &account.published]
        .iter()
        .all(|d| !d.is_empty());
    let whole = account.missed == 0 && account.received == there;
    let compressed = received.map_or(&[][..], |r| &r.compressed);
    let published_compressed = listed.flatten().map_or(&[][..], |c| &c.compressed_digest);
    let other_compressed = ![compressed, published_compressed]
        .iter()
        .any(|d| d.is_empty())
        && compressed != published_compressed;
    if doubtful > 0 {
        problems.push(format!(
            "{name}: {doubtful} samples arrived with two contents: another publisher writes into this stream"
        ));
    } else if is_known && whole && (account.digest != account.published || other_compressed) {
        problems.push(format!(
            "{name}: it differs from what the server published (digests differ): another publisher wrote into this stream"
        ));
    }
    (account, problems)
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}
