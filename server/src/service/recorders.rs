//! What the recorders told: readiness, credit, results.

use std::collections::{BTreeMap, BTreeSet};

use wheelarm_proto::{keys, v1};

/// Recorders by name.
#[derive(Debug, Default)]
pub struct Recorders {
    known: BTreeMap<String, v1::RecorderStatus>,
    /// Recorders that were lost in the running episode; they hold nobody up again.
    gone: BTreeSet<String>,
}

/// How many recorders are remembered.
const MAX_RECORDERS: usize = 64;

impl Recorders {
    /// Takes a status message; ones without a usable name are ignored.
    pub fn update(&mut self, status: v1::RecorderStatus) {
        if keys::check_name(&status.recorder).is_err() {
            return;
        }
        if self.known.len() >= MAX_RECORDERS && !self.known.contains_key(&status.recorder) {
            // The one that speaks of the oldest episode makes room.
            let episode = |s: &v1::RecorderStatus| s.header.as_ref().map_or(0, |h| h.episode);
            let oldest = self.known.values().min_by_key(|s| episode(s));
            if let Some(name) = oldest.map(|s| s.recorder.clone()) {
                self.known.remove(&name);
            }
        }
        self.known.insert(status.recorder.clone(), status);
    }

    /// Forgets a recorder whose connection ended.
    pub fn lost(&mut self, name: &str) {
        self.known.remove(name);
        self.gone.insert(name.to_owned());
    }

    /// An episode begins: everybody may take part.
    pub fn begin(&mut self) {
        self.gone.clear();
    }

    /// Number of recorders that are there.
    #[must_use]
    pub fn present(&self) -> usize {
        self.known.len()
    }

    /// Participants that were lost since the episode began.
    #[must_use]
    pub fn lost_of(&self, participants: &[String]) -> Vec<String> {
        let lost = participants.iter().filter(|name| self.gone.contains(*name));
        lost.cloned().collect()
    }

    /// All of them.
    #[must_use]
    pub fn all(&self) -> Vec<v1::RecorderStatus> {
        self.known.values().cloned().collect()
    }

    fn of_episode(&self, run_id: &str, episode: u64) -> impl Iterator<Item = &v1::RecorderStatus> {
        let run_id = run_id.to_owned();
        self.known.values().filter(move |s| {
            s.header
                .as_ref()
                .is_some_and(|h| h.episode == episode && h.run_id == run_id)
        })
    }

    /// Names of the recorders that are ready for an episode.
    #[must_use]
    pub fn ready(&self, run_id: &str, episode: u64) -> Vec<String> {
        self.of_episode(run_id, episode)
            .filter(|s| s.state == v1::RecorderState::Ready as i32)
            .map(|s| s.recorder.clone())
            .collect()
    }

    /// Recorders that could not start an episode, with their reasons.
    #[must_use]
    pub fn failed(&self, run_id: &str, episode: u64) -> Vec<(String, String)> {
        self.of_episode(run_id, episode)
            .filter(|s| s.state == v1::RecorderState::Failed as i32)
            .map(|s| (s.recorder.clone(), s.message.clone()))
            .collect()
    }

    /// The participant that has accepted fewest pictures, with its count.
    /// Participants that are gone or failed are not waited for.
    #[must_use]
    pub fn slowest(
        &self,
        run_id: &str,
        episode: u64,
        participants: &[String],
    ) -> Option<(String, u64)> {
        self.of_episode(run_id, episode)
            .filter(|s| s.state == v1::RecorderState::Ready as i32)
            .filter(|s| participants.contains(&s.recorder) && !self.gone.contains(&s.recorder))
            // A lost picture will never be accepted: it must not stop time.
            .map(|s| {
                (
                    s.recorder.clone(),
                    s.accepted_frames.saturating_add(s.missed),
                )
            })
            .min_by_key(|(_, accepted)| *accepted)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn status(name: &str, episode: u64, accepted: u64) -> v1::RecorderStatus {
        v1::RecorderStatus {
            header: Some(v1::Header {
                run_id: "r".into(),
                episode,
                ..Default::default()
            }),
            recorder: name.into(),
            state: v1::RecorderState::Ready as i32,
            accepted_frames: accepted,
            ..Default::default()
        }
    }

    #[test]
    fn credit_is_that_of_the_slowest_participant_of_this_episode() {
        let mut recorders = Recorders::default();
        recorders.update(status("a", 2, 10));
        recorders.update(status("b", 2, 7));
        recorders.update(status("old", 1, 0));
        recorders.update(status("guest", 2, 1));
        let participants = ["a".to_owned(), "b".to_owned(), "old".to_owned()];
        assert_eq!(
            recorders.slowest("r", 2, &participants),
            Some(("b".into(), 7))
        );
        recorders.lost("b");
        assert_eq!(
            recorders.slowest("r", 2, &participants),
            Some(("a".into(), 10))
        );
        assert_eq!(recorders.ready("r", 1), ["old"]);
        assert!(recorders.ready("other run", 2).is_empty());
    }
}
