//! GPU time of each part of the rendering, by timestamps.

use std::collections::VecDeque;
use std::time::Duration;

use parking_lot::Mutex;

/// Required features of the adapter.
pub(super) const FEATURES: wgpu::Features =
    wgpu::Features::TIMESTAMP_QUERY.union(wgpu::Features::TIMESTAMP_QUERY_INSIDE_ENCODERS);

/// Largest number of parts of a submission, and its end.
const MOST: u32 = 64;
const BYTES: u64 = MOST as u64 * 8;

/// Inserts timestamps at the beginning of parts; does nothing on a device without
/// timing.
#[derive(Default)]
pub(super) struct Timing(Option<Mutex<Clock>>);

struct Clock {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    /// Seconds per timestamp tick.
    tick: f64,
    /// Parts of the commands being recorded.
    parts: Vec<&'static str>,
    /// Submissions that are not read: their parts and timestamps.
    pending: VecDeque<(Vec<&'static str>, wgpu::Buffer)>,
    /// Total times, in the order of first use.
    spent: Vec<(&'static str, Duration)>,
}

impl Timing {
    /// For a device that may have timing.
    pub(super) fn new(device: &wgpu::Device, queue: &wgpu::Queue) -> Self {
        if !device.features().contains(FEATURES) {
            return Self::default();
        }
        Self(Some(Mutex::new(Clock {
            queries: device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("timing"),
                ty: wgpu::QueryType::Timestamp,
                count: MOST,
            }),
            resolved: device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("timing"),
                size: BYTES,
                usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            }),
            tick: f64::from(queue.get_timestamp_period()) * 1e-9,
            parts: Vec::new(),
            pending: VecDeque::new(),
            spent: Vec::new(),
        })))
    }

    /// Begins `part` and ends the previous one. Parts beyond the limit are merged.
    pub(super) fn begins(&self, encoder: &mut wgpu::CommandEncoder, part: &'static str) {
        let Some(mut clock) = self.0.as_ref().map(Mutex::lock) else {
            return;
        };
        let at = clock.parts.len() as u32;
        if at + 1 < MOST {
            encoder.write_timestamp(&clock.queries, at);
            clock.parts.push(part);
        }
    }

    /// Ends the last part and the recording.
    pub(super) fn ends(&self, device: &wgpu::Device, encoder: &mut wgpu::CommandEncoder) {
        let Some(mut clock) = self.0.as_ref().map(Mutex::lock) else {
            return;
        };
        let parts = std::mem::take(&mut clock.parts);
        let end = parts.len() as u32;
        encoder.write_timestamp(&clock.queries, end);
        encoder.resolve_query_set(&clock.queries, 0..end + 1, &clock.resolved, 0);
        let read = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("timing"),
            size: BYTES,
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        encoder.copy_buffer_to_buffer(&clock.resolved, 0, &read, 0, BYTES);
        clock.pending.push_back((parts, read));
    }

    /// Adds the times of the oldest submission, which is complete.
    pub(super) fn read(&self, device: &wgpu::Device) {
        let Some(mut clock) = self.0.as_ref().map(Mutex::lock) else {
            return;
        };
        let Some((parts, buffer)) = clock.pending.pop_front() else {
            return;
        };
        buffer.map_async(wgpu::MapMode::Read, .., |_| {});
        if device.poll(wgpu::PollType::wait_indefinitely()).is_err() {
            return;
        }
        let Ok(mapped) = buffer.get_mapped_range(..) else {
            return;
        };
        let stamps: Vec<u64> = mapped
            .as_chunks::<8>()
            .0
            .iter()
            .map(|bytes| u64::from_le_bytes(*bytes))
            .collect();
        for (part, stamps) in parts.into_iter().zip(stamps.windows(2)) {
            let ticks = stamps[1].saturating_sub(stamps[0]);
            let taken = Duration::from_secs_f64(ticks as f64 * clock.tick);
            match clock.spent.iter_mut().find(|(known, _)| *known == part) {
                Some((_, spent)) => *spent += taken,
                None => clock.spent.push((part, taken)),
            }
        }
    }

    /// Time of each part since the last call.
    pub(super) fn spent(&self) -> Vec<(&'static str, Duration)> {
        let clock = self.0.as_ref().map(Mutex::lock);
        clock.map_or_else(Vec::new, |mut clock| std::mem::take(&mut clock.spent))
    }
}
