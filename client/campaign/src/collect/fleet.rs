//! The workers: each simulates one episode after the other, with its own programs. A worker
//! has a slot and two pipelines: while one waits for a finished file, checks and publishes
//! it, the other has the permit to simulate.
//!
//! A worker killed by another program has run out of memory. Its slot retires if another
//! slot exists, and its episodes return to the queue with their seeds, so that memory never
//! decides which scenes a dataset has.

use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use parking_lot::{Condvar, Mutex};
use wheelarm_rollout::launcher::Panicked;

use super::attempt::{Outcome, Setup, attempt};
use super::capacity::{PIPELINES, free_disk, size, worker_bytes};
use super::episode::Episode;
use super::estimate::bytes;
use super::journal::{DEATHS, Done, Entry, Failed, Journal};
use super::progress::ProgressView;
use super::slot::{Part, Permit, Slot};
use super::stop::Stop;

/// Runs of the same attempt when its programs fail.
const TRIES: u32 = 3;
/// Broken episodes before the first finished one, after which the campaign ends: the host
/// is at fault, not the episode.
const BROKEN: usize = 2;

/// An episode to make.
#[derive(Clone, Debug)]
pub struct Job {
    /// The episode.
    pub episode: Episode,
    /// Number of the first attempt.
    pub attempt: u32,
    /// Servers that died or hung in that attempt before this run.
    pub deaths: u32,
    /// Simulated seconds expected, failed attempts included.
    pub expected: f64,
    /// Times that the only worker was killed during this episode.
    pub kills: u32,
}

/// Result of a run.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    /// Episodes made.
    pub done: usize,
    /// Episodes without remaining attempts.
    pub given_up: Vec<String>,
    /// Episodes whose programs failed repeatedly, with the last message.
    pub broken: Vec<(String, String)>,
    /// Attempts in which the physics or a server failed; the journal has their scenarios.
    pub entered: Vec<(String, String)>,
    /// Episodes discarded because the run ended.
    pub discarded: usize,
    /// Workers that another program killed and that retired.
    pub retired: usize,
    /// Reason of an early end.
    pub ended: Option<String>,
}

struct Shared<'a> {
    setup: &'a Setup,
    stop: &'a Stop,
    show: &'a ProgressView,
    jobs: Mutex<Jobs>,
    /// Notified when an episode returns to the queue, or none is running.
    changed: Condvar,
    journal: Journal,
    tally: Mutex<Tally>,
    /// Bytes of the longest episode.
    largest: f64,
    /// Number of pipelines that make an episode.
    busy: AtomicUsize,
    /// Number of slots that accept episodes.
    slots: Mutex<usize>,
}

/// Queue of episodes, and the number of running ones.
struct Jobs {
    waiting: VecDeque<Job>,
    taken: usize,
}

/// Makes all jobs with a worker in each slot, which has two pipelines.
#[must_use]
pub fn work(
    setup: &Setup,
    jobs: Vec<Job>,
    journal: Journal,
    slots: &[Slot],
    largest: f64,
    (stop, show): (&Stop, &ProgressView),
) -> Tally {
    let shared = Shared {
        setup,
        stop,
        show,
        jobs: Mutex::new(Jobs {
            waiting: jobs.into(),
            taken: 0,
        }),
        changed: Condvar::new(),
        journal,
        tally: Mutex::default(),
        largest,
        busy: AtomicUsize::new(0),
        slots: Mutex::new(slots.len()),
    };
    std::thread::scope(|scope| {
        let shared = &shared;
        let parts: Vec<_> = (0..PIPELINES * slots.len())
            .map(|number| slots[number % slots.len()].part())
            .collect();
        let threads: Vec<_> = (0..)
            .zip(parts)
            .map(|(pipeline, part)| scope.spawn(move || shared.run(pipeline, &part)))
            .collect();
        show.show_until(|| {
            threads
                .iter()
                .all(std::thread::ScopedJoinHandle::is_finished)
        });
    });
    shared.tally.into_inner()
}

/// A pipeline and its worker's slot.
#[derive(Clone, Copy)]
struct Place<'a> {
    pipeline: usize,
    slot: &'a Slot,
}

impl Shared<'_> {
    fn run(&self, pipeline: usize, part: &Part<'_>) {
        let place = Place {
            pipeline,
            slot: part.slot(),
        };
        while let Some((permit, job)) = self.next(place.slot) {
            let busy = 1 + self.busy.fetch_add(1, Ordering::AcqRel);
            let made = self
                .room(busy)
                .and_then(|()| self.episode(place, permit, &job));
            self.busy.fetch_sub(1, Ordering::AcqRel);
            let back = match made {
                Ok(None) => None,
                Ok(Some(killed)) => self.after_kill(place.slot, job, killed),
                Err(problem) => {
                    self.end(format!("{}: {problem:#}", job.episode.id));
                    None
                }
            };
            let mut jobs = self.jobs.lock();
            jobs.taken -= 1;
            if let Some(job) = back {
                jobs.waiting.push_front(job);
            }
            self.changed.notify_all();
        }
    }

    /// The next episode for a slot, with the permit to simulate. While episodes run, waits
    /// for one to return to an empty queue.
    fn next<'s>(&self, slot: &'s Slot) -> Option<(Permit<'s>, Job)> {
        /// Interval between checks of the end of the campaign.
        const CHECK_INTERVAL: Duration = Duration::from_millis(200);
        loop {
            let permit = slot.permit();
            let mut jobs = self.jobs.lock();
            if self.stop.is_requested() || slot.is_retired() {
                return None;
            }
            if let Some(job) = jobs.waiting.pop_front() {
                jobs.taken += 1;
                return Some((permit, job));
            }
            if jobs.taken == 0 {
                return None;
            }
            drop(permit);
            drop(jobs);
            // A waiting pipeline releases its process, which frees memory for the running ones.
            slot.rest();
            let mut jobs = self.jobs.lock();
            if jobs.waiting.is_empty() && jobs.taken > 0 {
                self.changed.wait_for(&mut jobs, CHECK_INTERVAL);
            }
        }
    }

    /// Reassigns an episode whose worker was killed: to another worker, or to the same one
    /// once if it is the only one.
    fn after_kill(&self, slot: &Slot, mut job: Job, killed: Killed) -> Option<Job> {
        job.attempt = killed.attempt;
        job.deaths = killed.deaths;
        let mut slots = self.slots.lock();
        if slot.is_retired() {
            return Some(job);
        }
        if *slots > 1 && slot.retire() {
            *slots -= 1;
            self.tally.lock().retired += 1;
            tracing::warn!(
                "{}: {}; most likely memory ran out: {} workers continue, and the episode is repeated with its seed",
                job.episode.id,
                killed.words,
                *slots
            );
            return Some(job);
        }
        job.kills += 1;
        if job.kills < DEATHS {
            return Some(job);
        }
        self.end(format!(
            "{}: {}, and no other worker ran; a worker needs {} of memory here: raise the job's memory limit, or make images smaller in the plan",
            job.episode.id,
            killed.words,
            bytes(worker_bytes(&self.setup.plan))
        ));
        None
    }

    /// Ends the run after the running episodes.
    fn end(&self, why: String) {
        self.tally.lock().ended.get_or_insert(why);
        self.stop.after_running();
    }

    /// Whether the disk has room for `busy` episodes that run at the same time.
    fn room(&self, busy: usize) -> anyhow::Result<()> {
        let need = busy as f64 * self.largest;
        let folder = &self.setup.folder;
        let check = |place: &Path, taken: u64| match free_disk(place) {
            Some(free) if ((free + taken) as f64) < need => anyhow::bail!(
                "{} has {} free, and the episodes that would run now need {}; free space and start again, nothing is lost",
                place.display(),
                bytes(free as f64),
                bytes(need)
            ),
            _ => Ok(()),
        };
        check(folder.root(), 0)?;
        // Running recordings already occupy their space.
        let scratch = folder.all_scratch();
        scratch.map_or(Ok(()), |scratch| check(scratch, size(scratch)))
    }

    /// Attempts an episode until it is done, dropped or the run ends. Returns `Killed` when
    /// another program killed its worker and the episode must be repeated.
    ///
    /// # Errors
    /// When the folder or the journal cannot be written, which ends the run.
    fn episode<'s>(
        &self,
        place: Place<'s>,
        permit: Permit<'s>,
        job: &Job,
    ) -> anyhow::Result<Option<Killed>> {
        let episode = &job.episode;
        let mut permit = Some(permit);
        for number in job.attempt..self.setup.plan.attempts {
            let deaths = if number == job.attempt { job.deaths } else { 0 };
            match self.tries(place, &mut permit, episode, (number, deaths))? {
                AttemptEnd::Done(done) => {
                    let words = format!(
                        "{} done: {:.1} s simulated in {:.1} s, {}",
                        episode.id,
                        done.seconds,
                        done.wall_seconds,
                        bytes(done.bytes as f64)
                    );
                    self.setup.folder.publish(&done)?;
                    let seconds = done.seconds;
                    self.journal.append(&Entry::Done(done))?;
                    self.setup.folder.clean(&episode.id)?;
                    self.tally.lock().done += 1;
                    self.show
                        .end(place.pipeline, seconds, job.expected, true, &words);
                    return Ok(None);
                }
                AttemptEnd::Again => {}
                AttemptEnd::Killed(killed) => return Ok(Some(killed)),
                AttemptEnd::Broken | AttemptEnd::Stopped => return Ok(None),
            }
            if self.stop.is_requested() && number + 1 < self.setup.plan.attempts {
                return Ok(None);
            }
        }
        self.tally.lock().given_up.push(episode.id.clone());
        Ok(None)
    }

    /// Writes a failed attempt to the journal and prints it.
    fn enter(&self, pipeline: usize, failed: Failed) -> anyhow::Result<()> {
        let (episode, seed, reason) = (&failed.episode, failed.seed, &failed.reason);
        let words = format!("{episode} failed with seed {seed}: {reason}");
        let seconds = failed.seconds;
        if failed.broken.is_some() {
            let entered = (episode.clone(), format!("seed {seed}: {reason}"));
            self.tally.lock().entered.push(entered);
        }
        self.journal.append(&Entry::Failed(failed))?;
        self.show.end(pipeline, seconds, 0.0, false, &words);
        Ok(())
    }

    /// One run of an attempt; a panic ends only that run.
    fn attempt(
        &self,
        place: Place<'_>,
        permit: Permit<'_>,
        episode: &Episode,
        number: u32,
    ) -> anyhow::Result<Outcome> {
        let activity = self.show.activity(place.pipeline);
        let held = (place.slot, permit);
        let run = || attempt(self.setup, (episode, number), held, self.stop, &activity);
        // Unwind safe: shared state is locked only for single steps.
        let made = catch_unwind(AssertUnwindSafe(run));
        made.unwrap_or_else(|cause| Err(Panicked::because_of(&*cause).into()))
    }

    /// One attempt, repeated when its programs fail; `deaths` servers died in it before.
    fn tries<'s>(
        &self,
        place: Place<'s>,
        permit: &mut Option<Permit<'s>>,
        episode: &Episode,
        (number, mut deaths): (u32, u32),
    ) -> anyhow::Result<AttemptEnd> {
        let seed = episode.seed_of(number);
        let mut last = String::new();
        for run in 0..TRIES {
            let mut title = format!("{} seed {seed}", episode.id);
            if run > 0 || deaths > 0 {
                title.push_str(" again");
            }
            let permit = match permit.take() {
                Some(permit) => permit,
                None => {
                    let permit = place.slot.permit();
                    // The end may have been requested while this pipeline waited.
                    if self.stop.is_requested() {
                        return Ok(AttemptEnd::Stopped);
                    }
                    permit
                }
            };
            self.show.begin(place.pipeline, title);
            match self.attempt(place, permit, episode, number) {
                Ok(Outcome::Done(done)) => return Ok(AttemptEnd::Done(done)),
                Ok(Outcome::Failed(failed)) => {
                    self.setup.folder.keep_failed(&episode.id, number)?;
                    self.enter(place.pipeline, failed)?;
                    return Ok(AttemptEnd::Again);
                }
                Ok(Outcome::Broke(failed)) => {
                    self.setup.folder.keep_failed(&episode.id, number)?;
                    // The signal that discards the episodes may have ended the server, too.
                    if self.stop.at_once() {
                        return Ok(AttemptEnd::Stopped);
                    }
                    deaths += 1;
                    last.clone_from(&failed.reason);
                    let death = deaths;
                    self.enter(place.pipeline, Failed { death, ..failed })?;
                    if self.stop.is_requested() {
                        return Ok(AttemptEnd::Stopped);
                    }
                    if deaths >= DEATHS {
                        return Ok(AttemptEnd::Again);
                    }
                }
                Ok(Outcome::Killed(words)) => {
                    self.setup.folder.clean(&episode.id)?;
                    if self.stop.at_once() {
                        return Ok(AttemptEnd::Stopped);
                    }
                    let line = format!("{} is repeated: {words}", episode.id);
                    self.show.end(place.pipeline, 0.0, 0.0, false, &line);
                    return Ok(AttemptEnd::Killed(Killed {
                        attempt: number,
                        deaths,
                        words,
                    }));
                }
                Ok(Outcome::Stopped) => {
                    self.setup.folder.clean(&episode.id)?;
                    self.tally.lock().discarded += 1;
                    return Ok(AttemptEnd::Stopped);
                }
                Err(problem) => {
                    last = without_log(&format!("{problem:#}"));
                    let words = format!("{} broke: {last}", episode.id);
                    self.show.end(place.pipeline, 0.0, 0.0, false, &words);
                    self.setup.folder.keep_failed(&episode.id, number)?;
                    // A full disk ends the run, with its fix.
                    self.room(self.busy.load(Ordering::Acquire))?;
                    if self.stop.is_requested() {
                        return Ok(AttemptEnd::Stopped);
                    }
                }
            }
        }
        let mut tally = self.tally.lock();
        tally.broken.push((episode.id.clone(), last.clone()));
        let hopeless = tally.done == 0 && tally.broken.len() >= BROKEN;
        drop(tally);
        if hopeless {
            self.end(format!(
                "no episode works on this host; the last error was: {last}"
            ));
        }
        Ok(AttemptEnd::Broken)
    }
}

/// An error message without the clauses that point to the log of the recording: a campaign
/// repeats the episode and keeps no log.
fn without_log(words: &str) -> String {
    let leads = |clause: &str| clause.contains(".h5.wal") || clause.contains("dataset recover");
    let mut dropped = false;
    let lines = words.lines().map(|line| {
        let clauses = line.split("; ").filter_map(|clause| {
            let (kept, _) = clause.split_once(". The recording").unwrap_or((clause, ""));
            dropped |= leads(clause);
            (!leads(kept)).then_some(kept)
        });
        clauses.collect::<Vec<_>>().join("; ")
    });
    let kept = lines.collect::<Vec<_>>().join("\n");
    match dropped {
        true => format!("{kept}; its log is not kept, the episode is repeated"),
        false => words.to_owned(),
    }
}

enum AttemptEnd {
    /// The episode is done.
    Done(Box<Done>),
    /// The attempt failed; the next one may run.
    Again,
    /// Another program killed the worker.
    Killed(Killed),
    Broken,
    Stopped,
}

/// An attempt whose worker another program killed.
struct Killed {
    /// The attempt, from 0.
    attempt: u32,
    /// Servers that died or hung in it.
    deaths: u32,
    /// Exit status of the worker, as text.
    words: String,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn removed_log_is_not_named() {
        for (words, kept) in [
            (
                "a.h5 cannot be written: No space left; the recording is still in a.h5.wal, `wheelarm dataset recover a.h5.wal` tries again",
                "a.h5 cannot be written: No space left",
            ),
            (
                "cannot append to the log after 9 good bytes: No space left; free space on the disk, then `wheelarm dataset recover LOG` keeps what was acknowledged; what was acknowledged is still in s/a.h5.wal",
                "cannot append to the log after 9 good bytes: No space left",
            ),
            (
                "making the file panicked; please report it. The recording is still in a.h5.wal, `wheelarm dataset recover a.h5.wal` tries again",
                "making the file panicked; please report it",
            ),
        ] {
            let text = without_log(words);
            assert_eq!(
                text,
                format!("{kept}; its log is not kept, the episode is repeated")
            );
        }
        let other = "output of the recorder:\nnone; at all";
        assert_eq!(without_log(other), other);
    }
}
