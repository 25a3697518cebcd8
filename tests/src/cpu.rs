//! Processor time of benches.

/// Processor time of this thread, seconds; 0 where the system does not report it.
#[must_use]
pub fn thread_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let nanos = stat.split(' ').next().and_then(|n| n.parse::<f64>().ok());
    nanos.unwrap_or(0.0) * 1e-9
}
