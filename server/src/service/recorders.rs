//! State of the recorders: readiness, credit, results.

use std::collections::{BTreeMap, BTreeSet};
use std::time::{Duration, Instant};

use wheelarm_proto::limits::CREDIT_IMAGES;
use wheelarm_proto::schema::OtherVersion;
use wheelarm_proto::{CREDIT_TICKS, keys, v1};

/// Recorders by name.
#[derive(Debug, Default)]
pub struct Recorders {
    /// Statuses of the last episodes of each recorder, newest last.
    known: BTreeMap<String, Vec<v1::RecorderStatus>>,
    /// Recorders whose liveliness token exists. Statuses of others are stored, since a
    /// token may arrive after the first status, but are not used.
    alive: BTreeSet<String>,
    /// When each recorder last sent a status.
    last_status: BTreeMap<String, Instant>,
    /// Recorders whose connection ended, and when; they may return.
    away: BTreeMap<String, Instant>,
    /// Recorders lost in the running episode; they are not waited for again.
    gone: BTreeSet<String>,
    /// Recorders of another version that were reported, [`MAX_RECORDERS`] at most.
    strange: BTreeSet<String>,
    /// Sessions that claimed a recorder's name, by name, [`MAX_RECORDERS`] at most.
    claims: BTreeMap<String, Claim>,
}

/// A session's claim on a recorder's name.
#[derive(Debug)]
struct Claim {
    session: String,
    since: Instant,
}

/// How long a recorder may be away before it is lost. A suspended one reconnects at
/// once; a killed one does not.
pub(super) const AWAY: Duration = Duration::from_secs(5);

/// How long the results of a recorder that ended are listed: a client of a busy machine
/// polls seldom, and without them reports a complete file as lost.
const LISTED: Duration = Duration::from_secs(120);

/// States in which a recorder is done with an episode.
const OVER: [v1::RecorderState; 2] = [v1::RecorderState::Finished, v1::RecorderState::Failed];

/// A recorder sends its status every half second. After this silence its process or
/// host is suspended. It may resume: in lock-step time waits for it, but the start and
/// end of an episode do not.
pub(super) const SILENT: Duration = Duration::from_secs(3);

/// How long a claimed name waits for its recorder's liveliness token.
const CLAIM: Duration = Duration::from_secs(10);

/// Largest number of recorders stored.
const MAX_RECORDERS: usize = 64;

/// Largest number of liveliness tokens. Recorders that never sent a status are dropped
/// first.
const MAX_ALIVE: usize = 256;

/// Episodes stored per recorder: the current one and those being written to files.
const MAX_EPISODES: usize = 3;

fn id(status: &v1::RecorderStatus) -> (&str, u64) {
    let header = status.header.as_ref();
    header.map_or(("", 0), |h| (&h.run_id, h.episode))
}

impl Recorders {
    /// Gives the name of a recorder to a session. Of two recorders with the same name
    /// the first to ask gets it.
    ///
    /// # Errors
    /// When another session has the name, or the name is not valid in a key.
    pub fn claim(&mut self, name: &str, session: &str, now: Instant) -> Result<(), String> {
        keys::check_name(name).map_err(|e| e.to_string())?;
        let holds = |claim: &Claim, is_alive: bool| {
            is_alive || now.saturating_duration_since(claim.since) < CLAIM
        };
        if let Some(claim) = self.claims.get(name)
            && claim.session != session
            && holds(claim, self.alive.contains(name))
        {
            return Err(format!(
                "the recorder's name {name:?} is taken: another recorder of this name is \
                 connected or just starting; choose another --name"
            ));
        }
        let alive = &self.alive;
        self.claims
            .retain(|name, claim| holds(claim, alive.contains(name)));
        if self.claims.len() >= MAX_RECORDERS && !self.claims.contains_key(name) {
            return Err(format!(
                "{MAX_RECORDERS} recorders are connected or starting; end one of them"
            ));
        }
        let session = session.to_owned();
        let since = now;
        self.claims
            .insert(name.to_owned(), Claim { session, since });
        Ok(())
    }

    /// Stores a status; one without a valid name is ignored.
    pub fn update(&mut self, status: v1::RecorderStatus, now: Instant) {
        if keys::check_name(&status.recorder).is_err() {
            return;
        }
        if self.known.len() >= MAX_RECORDERS && !self.known.contains_key(&status.recorder) {
            // Recorders without token make room first, then the one with the oldest
            // episode.
            let newest = |all: &[v1::RecorderStatus]| all.last().map_or(0, |s| id(s).1);
            let known = self.known.iter();
            let oldest = known.min_by_key(|(name, all)| (self.alive.contains(*name), newest(all)));
            if let Some(name) = oldest.map(|(name, _)| name.clone()) {
                self.forget(&name);
            }
        }
        self.last_status.insert(status.recorder.clone(), now);
        let episodes = self.known.entry(status.recorder.clone()).or_default();
        match episodes.iter_mut().find(|s| id(s) == id(&status)) {
            Some(old) => *old = status,
            None => episodes.push(status),
        }
        if episodes.len() > MAX_EPISODES {
            episodes.remove(0);
        }
    }

    /// Logs once why a recorder is ignored.
    pub fn warn_once(&mut self, name: &str, other: &OtherVersion) {
        let room = self.strange.len() < MAX_RECORDERS;
        if room && keys::check_name(name).is_ok() && self.strange.insert(name.to_owned()) {
            tracing::warn!("recorder {name:?} is ignored: {other}");
        }
    }

    /// Handles the end of a recorder's connection: it has [`AWAY`] to return.
    pub fn disconnected(&mut self, name: &str, now: Instant) {
        self.alive.remove(name);
        // A restarted recorder gets its name back at once.
        self.claims.remove(name);
        if self.known.contains_key(name) {
            self.away.entry(name.to_owned()).or_insert(now);
        }
    }

    /// Handles the arrival of a recorder's token.
    pub fn token_appeared(&mut self, name: &str) {
        if keys::check_name(name).is_err() {
            return;
        }
        self.away.remove(name);
        if self.alive.len() >= MAX_ALIVE && !self.alive.contains(name) {
            // Recorders that never sent a status make room.
            let mut silent = self.alive.iter().filter(|n| !self.known.contains_key(*n));
            match silent.next().cloned() {
                Some(silent) => self.alive.remove(&silent),
                None => {
                    tracing::warn!("more than {MAX_ALIVE} recorders: {name} is ignored");
                    return;
                }
            };
        }
        self.alive.insert(name.to_owned());
    }

    /// Whether a recorder's connection has ended.
    #[must_use]
    pub fn is_away(&self, name: &str) -> bool {
        self.away.contains_key(name)
    }

    fn forget(&mut self, name: &str) {
        self.known.remove(name);
        self.last_status.remove(name);
    }

    /// How long a connected recorder has sent no status; zero for an unknown one.
    fn silence(&self, name: &str, now: Instant) -> Duration {
        let last = self
            .last_status
            .get(name)
            .filter(|_| self.alive.contains(name));
        last.map_or(Duration::ZERO, |last| now.saturating_duration_since(*last))
    }

    /// Whether a connected recorder is silent.
    #[must_use]
    pub fn is_silent(&self, name: &str, now: Instant) -> bool {
        self.silence(name, now) > SILENT
    }

    /// Removes the recorders that were away for too long.
    pub fn expire(&mut self, now: Instant) {
        let late = |since: &Instant, limit| now.saturating_duration_since(*since) > limit;
        let lost = self.away.iter().filter(|(_, since)| late(since, AWAY));
        self.gone.extend(lost.map(|(name, _)| name.clone()));
        let known = &self.known;
        let has_result = |name: &String| {
            let mut episodes = known.get(name).into_iter().flatten();
            episodes.any(|status| OVER.contains(&status.state()))
        };
        let forgotten = self.away.extract_if(.., |name, since| {
            late(since, if has_result(name) { LISTED } else { AWAY })
        });
        for (name, _) in forgotten.collect::<Vec<_>>() {
            self.forget(&name);
        }
    }

    /// Begins an episode: every connected recorder may take part.
    pub fn begin(&mut self) {
        self.gone.clear();
        for name in std::mem::take(&mut self.away).into_keys() {
            self.forget(&name);
        }
    }

    fn there(&self) -> impl Iterator<Item = &Vec<v1::RecorderStatus>> {
        let there = self
            .known
            .iter()
            .filter(|(name, _)| self.alive.contains(*name));
        there.map(|(_, episodes)| episodes)
    }

    /// Number of connected recorders that are not silent.
    #[must_use]
    pub fn present(&self, now: Instant) -> usize {
        let names = self.known.keys().filter(|name| self.alive.contains(*name));
        names.filter(|name| !self.is_silent(name, now)).count()
    }

    /// Connected recorders that are silent.
    #[must_use]
    pub fn silent(&self, now: Instant) -> Vec<String> {
        let names = self.known.keys().filter(|name| self.is_silent(name, now));
        names.cloned().collect()
    }

    /// Participants that were lost since the episode began.
    #[must_use]
    pub fn lost_of(&self, participants: &[String]) -> Vec<String> {
        let lost = participants.iter().filter(|name| self.gone.contains(*name));
        lost.cloned().collect()
    }

    /// All recorders: the newest status of each, after those of earlier episodes that
    /// are still being written. A recorder that has just left is listed with its files,
    /// because clients poll. A silent one includes the time of its silence.
    #[must_use]
    pub fn all(&self, run_id: &str, now: Instant) -> Vec<v1::RecorderStatus> {
        let mut all = Vec::new();
        for episodes in self.there() {
            if let Some((newest, earlier)) = episodes.split_last() {
                let of_run = earlier.iter().filter(|s| {
                    let (run, episode) = id(s);
                    run == run_id && episode > 0
                });
                all.extend(of_run.cloned());
                all.push(newest.clone());
            }
        }
        let left = self.away.keys().filter_map(|name| self.known.get(name));
        let left = left.flatten().filter(|status| {
            let (run, episode) = id(status);
            run == run_id && episode > 0 && OVER.contains(&status.state())
        });
        all.extend(left.cloned());
        for status in &mut all {
            let silence = self.silence(&status.recorder, now);
            status.silent_seconds = (silence > SILENT).then_some(silence.as_secs_f64());
        }
        all
    }

    fn of_episode(&self, run_id: &str, episode: u64) -> impl Iterator<Item = &v1::RecorderStatus> {
        let run_id = run_id.to_owned();
        let all = self.known.values().flatten();
        all.filter(move |s| id(s) == (run_id.as_str(), episode))
    }

    /// Names of the recorders that are ready for an episode.
    #[must_use]
    pub fn ready(&self, run_id: &str, episode: u64) -> Vec<String> {
        self.of_episode(run_id, episode)
            .filter(|s| {
                s.state == v1::RecorderState::Ready as i32 && self.alive.contains(&s.recorder)
            })
            .map(|s| s.recorder.clone())
            .collect()
    }

    /// Recorders that could not start an episode, with their reasons.
    #[must_use]
    pub fn failed(&self, run_id: &str, episode: u64) -> Vec<(String, String)> {
        self.of_episode(run_id, episode)
            .filter(|s| s.state == v1::RecorderState::Failed as i32)
            // A recorder that failed may have left since; it had a token.
            .filter(|s| self.alive.contains(&s.recorder) || self.is_away(&s.recorder))
            .map(|s| (s.recorder.clone(), s.message.clone()))
            .collect()
    }

    /// Participants that record the episode, without those that left or failed.
    fn at_work(
        &self,
        run_id: &str,
        episode: u64,
        participants: &[String],
    ) -> impl Iterator<Item = &v1::RecorderStatus> {
        self.of_episode(run_id, episode)
            .filter(|s| s.state == v1::RecorderState::Ready as i32)
            .filter(|s| participants.contains(&s.recorder) && !self.gone.contains(&s.recorder))
    }

    /// Whether a responsive participant has not received the whole episode.
    #[must_use]
    pub fn is_anyone_recording(
        &self,
        run_id: &str,
        episode: u64,
        participants: &[String],
        now: Instant,
    ) -> bool {
        self.at_work(run_id, episode, participants)
            .any(|status| !self.is_silent(&status.recorder, now))
    }

    /// Participants not known to have the whole episode.
    #[must_use]
    pub fn unconfirmed(&self, run_id: &str, episode: u64, participants: &[String]) -> Vec<String> {
        use v1::RecorderState::{Finished, Finishing};
        let has = |name: &String| {
            self.of_episode(run_id, episode)
                .any(|s| s.recorder == *name && [Finishing, Finished].contains(&s.state()))
        };
        let without = participants.iter().filter(|name| !has(name));
        without.cloned().collect()
    }

    /// The participant that is farthest behind `published`, if it exceeds its credit.
    #[must_use]
    pub fn without_credit(
        &self,
        run_id: &str,
        episode: u64,
        participants: &[String],
        published: Progress,
    ) -> Option<String> {
        self.at_work(run_id, episode, participants)
            .map(|status| (status, published.beyond(status)))
            .filter(|(_, share)| *share >= 1.0)
            .max_by(|(_, a), (_, b)| a.total_cmp(b))
            .map(|(status, _)| status.recorder.clone())
    }
}

/// Progress of an episode.
#[derive(Clone, Copy, Debug)]
pub(super) struct Progress {
    /// Images of all cameras, including those being rendered.
    pub images: u64,
    /// The present tick.
    pub tick: u64,
}

impl Progress {
    /// How far this exceeds the credit of a recorder; from 1 on time waits. Older
    /// recorders send no credit: only images count, and every missing sample counts as
    /// one.
    fn beyond(self, status: &v1::RecorderStatus) -> f64 {
        let older = status.accepted_frames.saturating_add(status.missed);
        let frames = status.credit_frames.unwrap_or(older);
        let tick = status.credit_tick.unwrap_or(self.tick);
        let images = self.images.saturating_sub(frames) as f64 / CREDIT_IMAGES as f64;
        let ticks = self.tick.saturating_sub(tick) as f64 / CREDIT_TICKS as f64;
        images.max(ticks)
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
        let now = Instant::now();
        let mut recorders = Recorders::default();
        for name in ["a", "b", "old", "guest"] {
            recorders.token_appeared(name);
        }
        recorders.update(status("a", 2, 10), now);
        recorders.update(status("b", 2, 7), now);
        recorders.update(status("old", 1, 0), now);
        recorders.update(status("guest", 2, 1), now);
        // A file finished late does not hide the current recording.
        let mut late = status("a", 1, 99);
        late.state = v1::RecorderState::Finished as i32;
        recorders.update(late, now);
        let participants = ["a".to_owned(), "b".to_owned(), "old".to_owned()];
        let waits = |recorders: &Recorders, images| {
            let published = Progress { images, tick: 0 };
            recorders.without_credit("r", 2, &participants, published)
        };
        assert_eq!(waits(&recorders, 12), None);
        assert_eq!(waits(&recorders, 13).as_deref(), Some("b"));
        recorders.disconnected("b", now);
        recorders.expire(now + AWAY);
        let still = waits(&recorders, 13);
        assert_eq!(still.as_deref(), Some("b"), "an absent recorder may return");
        recorders.token_appeared("b");
        let later = now + 9 * AWAY;
        recorders.update(status("a", 2, 10), later);
        recorders.update(status("b", 2, 7), later);
        recorders.expire(later);
        assert!(recorders.lost_of(&participants).is_empty());
        recorders.disconnected("b", now);
        recorders.expire(later);
        assert_eq!(recorders.lost_of(&participants), ["b"]);
        assert_eq!(waits(&recorders, 15), None);
        assert_eq!(waits(&recorders, 16).as_deref(), Some("a"));
        assert!(recorders.is_anyone_recording("r", 2, &participants, later));
        assert_eq!(recorders.ready("r", 1), ["old"]);
        assert!(recorders.ready("other run", 2).is_empty());
    }

    #[test]
    fn time_waits_for_a_recorder_that_misses_samples() {
        let now = Instant::now();
        let mut recorders = Recorders::default();
        recorders.token_appeared("a");
        let with_credit = |frames, tick| v1::RecorderStatus {
            // Samples accepted after a gap do not count.
            credit_frames: Some(frames),
            credit_tick: Some(tick),
            missed: 3,
            ..status("a", 1, 9)
        };
        recorders.update(with_credit(4, 100), now);
        let participants = ["a".to_owned()];
        let waits = |recorders: &Recorders, images, tick| {
            let published = Progress { images, tick };
            let name = recorders.without_credit("r", 1, &participants, published);
            name.is_some()
        };
        assert!(!waits(&recorders, 9, 100 + CREDIT_TICKS - 1));
        assert!(waits(&recorders, 10, 100), "images");
        assert!(waits(&recorders, 0, 100 + CREDIT_TICKS), "time");
        assert!(!waits(&recorders, 0, 3), "playback may start at any tick");
        let both = ["a".to_owned(), "b".to_owned()];
        recorders.token_appeared("b");
        let behind = v1::RecorderStatus {
            recorder: "b".into(),
            ..with_credit(9, 50)
        };
        recorders.update(behind, now);
        let published = Progress {
            images: 9,
            tick: 100 + CREDIT_TICKS,
        };
        let farthest = recorders.without_credit("r", 1, &both, published);
        assert_eq!(farthest.as_deref(), Some("b"));
        // An older recorder sends neither.
        recorders.update(status("a", 1, 4), now);
        assert!(!waits(&recorders, 9, 9 * CREDIT_TICKS));
        assert!(waits(&recorders, 10, 0));
    }

    #[test]
    fn a_silent_connected_recorder_is_reported_and_not_lost() {
        let now = Instant::now();
        let mut recorders = Recorders::default();
        let participants = ["hung".to_owned(), "well".to_owned()];
        for name in ["hung", "well"] {
            recorders.token_appeared(name);
            recorders.update(status(name, 1, 0), now);
        }
        let tick = Duration::from_millis(1);
        assert_eq!(recorders.silent(now + SILENT), [""; 0]);
        let silent = now + SILENT + tick;
        recorders.update(status("well", 1, 0), silent);
        assert_eq!(recorders.silent(silent), ["hung"]);
        assert_eq!(recorders.present(silent), 1);
        let listed = recorders.all("r", silent);
        let seconds: Vec<_> = listed.iter().map(|s| s.silent_seconds.is_some()).collect();
        assert_eq!(seconds, [true, false]);
        recorders.expire(silent);
        assert!(recorders.lost_of(&participants).is_empty(), "it may resume");
        // The end of an episode does not wait for it; its name is reported.
        let mut finishing = status("well", 1, 0);
        finishing.set_state(v1::RecorderState::Finishing);
        recorders.update(finishing, silent);
        assert!(!recorders.is_anyone_recording("r", 1, &participants, silent));
        assert_eq!(recorders.unconfirmed("r", 1, &participants), ["hung"]);

        // It resumes.
        recorders.update(status("hung", 1, 0), silent);
        assert_eq!(recorders.silent(silent), [""; 0]);
        assert_eq!(recorders.present(silent), 2);
        assert!(recorders.is_anyone_recording("r", 1, &participants, silent));
    }

    #[test]
    fn a_recorder_that_left_is_listed_with_its_file_for_a_while() {
        let now = Instant::now();
        let mut recorders = Recorders::default();
        recorders.token_appeared("disk");
        let mut last = status("disk", 1, 5);
        recorders.update(last.clone(), now);
        last.set_state(v1::RecorderState::Finished);
        recorders.update(last.clone(), now);
        let run = id(&last).0.to_owned();
        recorders.disconnected("disk", now);
        assert_eq!(
            (recorders.present(now), recorders.all(&run, now)),
            (0, vec![last])
        );
        assert!(recorders.all("another run", now).is_empty());
        let moment = Duration::from_millis(1);
        recorders.token_appeared("killed");
        recorders.update(status("killed", 1, 5), now);
        recorders.disconnected("killed", now);
        recorders.expire(now + AWAY + moment);
        assert_eq!(
            recorders.all(&run, now).len(),
            1,
            "a busy client polls seldom"
        );
        let both = ["disk", "killed"].map(str::to_owned);
        assert_eq!(recorders.lost_of(&both), both, "neither is waited for");
        assert!(!recorders.is_away("killed"));
        recorders.expire(now + LISTED + moment);
        assert!(recorders.all(&run, now).is_empty());
    }

    #[test]
    fn of_two_recorders_of_one_name_the_second_is_refused() {
        let now = Instant::now();
        let mut recorders = Recorders::default();
        assert_eq!(recorders.claim("disk", "a", now), Ok(()));
        let refused = recorders.claim("disk", "b", now).unwrap_err();
        assert!(refused.contains("choose another --name"), "{refused}");
        assert_eq!(recorders.claim("other", "b", now), Ok(()));
        assert_eq!(recorders.claim("disk", "a", now), Ok(()), "claimed twice");
        recorders.token_appeared("disk");
        assert!(recorders.claim("disk", "b", now + 9 * CLAIM).is_err());
        // The name is free when its recorder left or never appeared.
        recorders.disconnected("disk", now);
        assert_eq!(recorders.claim("disk", "b", now), Ok(()));
        assert!(recorders.claim("disk", "c", now + CLAIM / 2).is_err());
        assert_eq!(recorders.claim("disk", "c", now + CLAIM), Ok(()));
        assert!(recorders.claim("a/b", "c", now).is_err());
        for number in 0..2 * MAX_RECORDERS {
            let _ = recorders.claim(&format!("r{number}"), "c", now + CLAIM);
        }
        assert_eq!(recorders.claims.len(), MAX_RECORDERS);
    }

    #[test]
    fn statuses_without_a_token_are_not_used() {
        let now = Instant::now();
        let mut recorders = Recorders::default();
        recorders.update(status("stranger", 1, 0), now);
        let mut failed = status("liar", 1, 0);
        failed.state = v1::RecorderState::Failed as i32;
        recorders.update(failed, now);
        assert_eq!(recorders.present(now), 0);
        assert!(recorders.ready("r", 1).is_empty());
        assert!(recorders.failed("r", 1).is_empty());
        recorders.token_appeared("stranger");
        assert_eq!(
            recorders.ready("r", 1),
            ["stranger"],
            "the token arrived late"
        );
        recorders.token_appeared("liar");
        recorders.disconnected("liar", Instant::now());
        assert_eq!(recorders.failed("r", 1).len(), 1, "it had a token and left");
    }

    #[test]
    fn recorders_without_token_do_not_displace_a_recorder() {
        let now = Instant::now();
        let mut recorders = Recorders::default();
        recorders.token_appeared("real");
        recorders.update(status("real", 1, 0), now);
        for number in 0..2 * MAX_ALIVE {
            recorders.update(status(&format!("stranger-{number}"), 9, 0), now);
        }
        assert_eq!(recorders.ready("r", 1), ["real"]);
        assert!(recorders.known.len() <= MAX_RECORDERS);
        for number in 0..2 * MAX_ALIVE {
            recorders.token_appeared(&format!("token-{number}"));
        }
        recorders.token_appeared("not a name");
        assert_eq!(recorders.alive.len(), MAX_ALIVE);
        assert_eq!(recorders.ready("r", 1), ["real"]);
        // Nor do their tokens block a new one.
        recorders.token_appeared("late");
        recorders.update(status("late", 1, 0), now);
        assert_eq!(recorders.ready("r", 1), ["late", "real"]);
    }
}
