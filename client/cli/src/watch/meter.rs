//! Measures one stream: rate, jitter, latency, gaps, bytes. No I/O.

use std::collections::VecDeque;

use wheelarm_proto::v1;

/// Window for rates and delays, s.
const WINDOW: f64 = 5.0;

/// One arrival.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Arrival {
    at: f64,
    bytes: usize,
    stamp: f64,
}

/// Figures of one stream over the last seconds.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Figures {
    /// Samples since the start (count).
    pub samples: u64,
    /// Samples per second of wall time, Hz; `None` below two samples.
    pub rate_hz: Option<f64>,
    /// Mean time between two arrivals, s.
    pub interval_mean: Option<f64>,
    /// Standard deviation of the time between two arrivals, s.
    pub jitter: Option<f64>,
    /// Greatest time between two arrivals, s.
    pub interval_max: Option<f64>,
    /// Mean delay in excess of the fastest sample, s: simulation stamps
    /// carry no wall time, so only the growth of the delay can be measured.
    pub delay_mean: Option<f64>,
    /// Greatest delay in excess of the fastest sample, s.
    pub delay_max: Option<f64>,
    /// Payload per second of wall time, bytes/s.
    pub bytes_per_second: Option<f64>,
    /// Samples that were published but did not arrive (count).
    pub missed: u64,
    /// Samples that arrived twice or out of order (count).
    pub disordered: u64,
    /// Messages that could not be read (count).
    pub unreadable: u64,
}

/// Measures one stream.
#[derive(Clone, Debug, Default)]
pub struct Meter {
    run: String,
    next: Option<u64>,
    arrivals: VecDeque<Arrival>,
    samples: u64,
    missed: u64,
    disordered: u64,
    unreadable: u64,
}

impl Meter {
    /// Adds the header of a message of `bytes` that arrived at `now`, s.
    pub fn add(&mut self, header: &v1::Header, bytes: usize, now: f64) {
        if header.run_id != self.run {
            // A restarted server restarts its sequence numbers.
            self.run.clone_from(&header.run_id);
            self.next = None;
            self.arrivals.clear();
        }
        match self.next {
            Some(next) if header.sequence > next => self.missed += header.sequence - next,
            Some(next) if header.sequence < next => self.disordered += 1,
            _ => {}
        }
        self.next = self.next.max(Some(header.sequence + 1));
        self.samples += 1;
        self.arrivals.push_back(Arrival {
            at: now,
            bytes,
            stamp: header.stamp_nanos as f64 * 1e-9,
        });
        self.drop_old(now);
    }

    /// Counts a message that could not be decoded.
    pub fn count_unreadable(&mut self) {
        self.unreadable += 1;
    }

    fn drop_old(&mut self, now: f64) {
        while self.arrivals.front().is_some_and(|a| now - a.at > WINDOW) {
            self.arrivals.pop_front();
        }
    }

    /// The figures at `now`, s; `factor` is simulated seconds per wall second.
    #[must_use]
    pub fn figures(&self, now: f64, factor: f64) -> Figures {
        let mut figures = Figures {
            samples: self.samples,
            missed: self.missed,
            disordered: self.disordered,
            unreadable: self.unreadable,
            ..Figures::default()
        };
        let recent: Vec<_> = self
            .arrivals
            .iter()
            .filter(|a| now - a.at <= WINDOW)
            .collect();
        let (Some(first), Some(last)) = (recent.first(), recent.last()) else {
            return figures;
        };
        let span = last.at - first.at;
        if recent.len() < 2 || span <= 0.0 {
            return figures;
        }
        let count = (recent.len() - 1) as f64;
        let gaps: Vec<f64> = recent.windows(2).map(|w| w[1].at - w[0].at).collect();
        let mean = span / count;
        let variance = gaps.iter().map(|g| (g - mean).powi(2)).sum::<f64>() / count;
        let bytes: usize = recent.iter().skip(1).map(|a| a.bytes).sum();
        figures.rate_hz = Some(count / span);
        figures.interval_mean = Some(mean);
        figures.jitter = Some(variance.sqrt());
        figures.interval_max = gaps.into_iter().reduce(f64::max);
        figures.bytes_per_second = Some(bytes as f64 / span);
        // While the simulation keeps its rate, arrival times and stamps advance at the same pace.
        if factor > 0.5 {
            let delays: Vec<f64> = recent.iter().map(|a| a.at - a.stamp / factor).collect();
            let least = delays.iter().copied().fold(f64::INFINITY, f64::min);
            let extra = delays.iter().map(|d| d - least);
            figures.delay_mean = Some(extra.clone().sum::<f64>() / delays.len() as f64);
            figures.delay_max = extra.reduce(f64::max);
        }
        figures
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(run: &str, sequence: u64) -> v1::Header {
        v1::Header {
            run_id: run.to_owned(),
            sequence,
            stamp_nanos: sequence * 100_000_000,
            ..Default::default()
        }
    }

    #[test]
    fn steady_stream_has_no_jitter() {
        let mut meter = Meter::default();
        for i in 0..20 {
            meter.add(&header("a", i), 1000, i as f64 * 0.1);
        }
        let figures = meter.figures(2.0, 1.0);
        assert!((figures.rate_hz.unwrap() - 10.0).abs() < 1e-9);
        assert!(figures.jitter.unwrap() < 1e-9);
        assert!(figures.delay_max.unwrap() < 1e-9);
        assert!((figures.bytes_per_second.unwrap() - 10_000.0).abs() < 1e-6);
        assert_eq!((figures.samples, figures.missed), (20, 0));
    }

    #[test]
    fn gaps_repeats_and_late_samples_are_distinguished() {
        let mut meter = Meter::default();
        for (sequence, at) in [(0, 0.0), (1, 0.1), (4, 0.4), (3, 0.45), (5, 0.8)] {
            meter.add(&header("a", sequence), 10, at);
        }
        let figures = meter.figures(0.8, 1.0);
        assert_eq!((figures.missed, figures.disordered), (2, 1));
        // The last sample arrived 0.3 s later than its stamp predicts.
        assert!((figures.delay_max.unwrap() - 0.3).abs() < 1e-9);
        // A restarted server does not count as a gap.
        meter.add(&header("b", 900), 10, 1.0);
        assert_eq!(meter.figures(1.0, 1.0).missed, 2);
    }

    #[test]
    fn stopped_stream_has_no_rate() {
        let mut meter = Meter::default();
        meter.add(&header("a", 0), 10, 0.0);
        meter.add(&header("a", 1), 10, 0.1);
        assert_eq!(meter.figures(60.0, 1.0).rate_hz, None);
    }
}
