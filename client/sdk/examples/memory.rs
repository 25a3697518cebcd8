//! Records two seconds of every stream and the images of one camera to memory, and
//! compares the counts with the manifest of the episode.

use std::collections::BTreeMap;
use std::error::Error;
use std::time::{Duration, Instant};

use wheelarm_proto::topic::Sample;
use wheelarm_proto::{StreamId, TopicId, v1};
use wheelarm_sdk::{Client, Connect, Frame};

/// One episode in memory.
#[derive(Default)]
struct Memory {
    samples: BTreeMap<StreamId, Vec<Sample>>,
    images: BTreeMap<StreamId, Vec<Frame>>,
}

impl Memory {
    fn count(&self, stream: &StreamId) -> usize {
        let samples = self.samples.get(stream).map_or(0, Vec::len);
        samples + self.images.get(stream).map_or(0, Vec::len)
    }

    /// Whether it holds every sample that the manifest lists.
    fn is_complete(&self, stopped: &v1::EpisodeStopped) -> bool {
        let mut listed = stopped.manifest.iter();
        listed.all(|one| self.count(&StreamId::parse(&one.stream)) as u64 == one.count)
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [endpoint, sim, camera] = words.as_slice() else {
        return Err("give ENDPOINT SIM CAMERA, for example tcp/127.0.0.1:7447 sim gen3".into());
    };
    let client = Client::open(&Connect::to(endpoint, sim))?;
    // Subscribe before the episode begins, so that its first sample is received.
    let streams = client.streams(&[&TopicId::STATES[..], &[TopicId::Event]].concat())?;
    let images = client.camera(camera, 64)?;
    let started = client.request(&v1::EpisodeStartRequest {
        label: "memory".to_owned(),
        ..Default::default()
    })?;
    let begun = started.header.clone();
    let begun = begun.ok_or("an episode without a number")?;
    let mut memory = Memory::default();
    let mut stopped: Option<v1::EpisodeStopped> = None;
    let mut patience = Instant::now() + Duration::from_secs(60);
    while Instant::now() < patience {
        if stopped
            .as_ref()
            .is_some_and(|stopped| memory.is_complete(stopped))
        {
            break;
        }
        while let Some(frame) = images.next(Duration::ZERO)? {
            if frame.header.episode == begun.episode {
                let stream = StreamId::camera(&frame.camera);
                memory.images.entry(stream).or_default().push(frame);
            }
        }
        let Some(sample) = streams.next(Duration::from_millis(20))? else {
            continue;
        };
        let header = sample.header().cloned().unwrap_or_default();
        if header.episode == begun.episode {
            let stream = StreamId::from(sample.topic());
            memory.samples.entry(stream).or_default().push(sample);
        }
        if stopped.is_none() && header.stamp_nanos > begun.stamp_nanos + 2_000_000_000 {
            stopped = Some(client.stop_episode_of(&started, false)?);
            // The last samples are still in flight.
            patience = Instant::now() + Duration::from_secs(10);
        }
    }
    let stopped = stopped.ok_or("simulation time did not advance")?;
    for listed in &stopped.manifest {
        let received = memory.count(&StreamId::parse(&listed.stream));
        println!("{:<18} {received:>5} of {}", listed.stream, listed.count);
    }
    match memory.is_complete(&stopped) {
        true => Ok(()),
        false => Err("samples are missing".into()),
    }
}
