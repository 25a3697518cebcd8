//! The workers: each simulates one episode after the other, with programs of
//! its own. A worker has a slot and two pipelines: while one waits for a finished
//! file, checks and publishes it, the other has the permit to simulate.
//!
//! A worker that something else kills has run out of memory. Its slot retires while
//! there is another one, and its episodes go back to the queue with their seeds: memory
//! never decides which scenes a dataset has.

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
use super::progress::Show;
use super::slot::{Part, Permit, Slot};
use super::stop::Stop;

/// Runs of the same attempt when its programs break.
const TRIES: u32 = 3;
/// Episodes that break before the first one is done, after which the campaign
/// is ended: it is the host, not the episode.
const BROKEN: usize = 2;

/// An episode to be made.
#[derive(Clone, Debug)]
pub struct Job {
    /// Which one.
    pub episode: Episode,
    /// The attempt to begin with.
    pub attempt: u32,
    /// Servers that died or hung in that attempt before this run.
    pub deaths: u32,
    /// Simulated seconds expected, failed attempts included.
    pub expected: f64,
    /// Times that the only worker was killed while it made this episode.
    pub kills: u32,
}

/// What a run came to.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    /// Episodes made.
    pub done: usize,
    /// Episodes whose attempts are used up.
    pub given_up: Vec<String>,
    /// Episodes whose programs broke again and again, with the last words.
    pub broken: Vec<(String, String)>,
    /// Attempts in which the physics or a server broke; they are in the journal
    /// with the scenario.
    pub entered: Vec<(String, String)>,
    /// Episodes thrown away because the run was ended.
    pub discarded: usize,
    /// Workers that something else killed and that did not go on.
    pub retired: usize,
    /// Why the run ended early.
    pub ended: Option<String>,
}

struct Shared<'a> {
    setup: &'a Setup,
    stop: &'a Stop,
    show: &'a Show,
    jobs: Mutex<Jobs>,
    /// An episode came back, or none is made any more.
    changed: Condvar,
    journal: Journal,
    tally: Mutex<Tally>,
    /// Bytes of the longest episode.
    largest: f64,
    /// Pipelines that make an episode.
    busy: AtomicUsize,
    /// Slots that take episodes.
    slots: Mutex<usize>,
}

/// Episodes to be made, and how many are being made.
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
    (stop, show): (&Stop, &Show),
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
        show.draw_until(|| {
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

    /// The next episode for a slot, with the permit to simulate. Where none waits but
    /// some are made, one of them may come back.
    fn next<'s>(&self, slot: &'s Slot) -> Option<(Permit<'s>, Job)> {
        /// How often it is looked whether the campaign is to end.
        const LOOK: Duration = Duration::from_millis(200);
        loop {
            let permit = slot.permit();
            let mut jobs = self.jobs.lock();
            if self.stop.asked() || slot.is_retired() {
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
            // What waits takes no memory from those that work.
            slot.rest();
            let mut jobs = self.jobs.lock();
            if jobs.waiting.is_empty() && jobs.taken > 0 {
                self.changed.wait_for(&mut jobs, LOOK);
            }
        }
    }

    /// What becomes of an episode whose worker something else killed: another worker
    /// makes it, or the same where there is no other, once more.
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
                "{}: {}; most likely memory ran out: {} workers go on, and the episode is made again with its seed",
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

    /// No other episode begins.
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
                "{} has {} free, and the episodes that would run now need {}; make room and start again, nothing is lost",
                place.display(),
                bytes(free as f64),
                bytes(need)
            ),
            _ => Ok(()),
        };
        check(folder.root(), 0)?;
        // What runs already is there already.
        let scratch = folder.all_scratch();
        scratch.map_or(Ok(()), |scratch| check(scratch, size(scratch)))
    }

    /// Attempts an episode until it is done, dropped or the run ends. How its worker was
    /// killed, if something else did that: the episode is to be made again.
    ///
    /// # Errors
    /// When the folder or the journal cannot be written: that ends the run.
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
                Tried::Done(done) => {
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
                Tried::Again => {}
                Tried::Killed(killed) => return Ok(Some(killed)),
                Tried::Broken | Tried::Stopped => return Ok(None),
            }
            if self.stop.asked() && number + 1 < self.setup.plan.attempts {
                return Ok(None);
            }
        }
        self.tally.lock().given_up.push(episode.id.clone());
        Ok(None)
    }

    /// Enters an attempt that failed, and says so.
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

    /// One run of an attempt; a panic costs no more than that run.
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
        // What it shares with others is locked for single steps alone.
        let made = catch_unwind(AssertUnwindSafe(run));
        made.unwrap_or_else(|cause| Err(Panicked::because_of(&*cause).into()))
    }

    /// One attempt, again when its programs break; servers may have died in it
    /// before.
    fn tries<'s>(
        &self,
        place: Place<'s>,
        permit: &mut Option<Permit<'s>>,
        episode: &Episode,
        (number, mut deaths): (u32, u32),
    ) -> anyhow::Result<Tried> {
        let seed = episode.seed_of(number);
        let mut last = String::new();
        for run in 0..TRIES {
            let mut title = format!("{} seed {seed}", episode.id);
            if run > 0 || deaths > 0 {
                title.push_str(" once more");
            }
            let permit = match permit.take() {
                Some(permit) => permit,
                None => {
                    let permit = place.slot.permit();
                    // The end may have come while another simulated.
                    if self.stop.asked() {
                        return Ok(Tried::Stopped);
                    }
                    permit
                }
            };
            self.show.begin(place.pipeline, title);
            match self.attempt(place, permit, episode, number) {
                Ok(Outcome::Done(done)) => return Ok(Tried::Done(done)),
                Ok(Outcome::Failed(failed)) => {
                    self.setup.folder.keep_failed(&episode.id, number)?;
                    self.enter(place.pipeline, failed)?;
                    return Ok(Tried::Again);
                }
                Ok(Outcome::Broke(failed)) => {
                    self.setup.folder.keep_failed(&episode.id, number)?;
                    // Whoever throws everything away may have ended the server, too.
                    if self.stop.at_once() {
                        return Ok(Tried::Stopped);
                    }
                    deaths += 1;
                    last.clone_from(&failed.reason);
                    let death = deaths;
                    self.enter(place.pipeline, Failed { death, ..failed })?;
                    if self.stop.asked() {
                        return Ok(Tried::Stopped);
                    }
                    if deaths >= DEATHS {
                        return Ok(Tried::Again);
                    }
                }
                Ok(Outcome::Killed(words)) => {
                    self.setup.folder.clean(&episode.id)?;
                    if self.stop.at_once() {
                        return Ok(Tried::Stopped);
                    }
                    let line = format!("{} is made again: {words}", episode.id);
                    self.show.end(place.pipeline, 0.0, 0.0, false, &line);
                    return Ok(Tried::Killed(Killed {
                        attempt: number,
                        deaths,
                        words,
                    }));
                }
                Ok(Outcome::Stopped) => {
                    self.setup.folder.clean(&episode.id)?;
                    self.tally.lock().discarded += 1;
                    return Ok(Tried::Stopped);
                }
                Err(problem) => {
                    last = without_log(&format!("{problem:#}"));
                    let words = format!("{} broke: {last}", episode.id);
                    self.show.end(place.pipeline, 0.0, 0.0, false, &words);
                    self.setup.folder.keep_failed(&episode.id, number)?;
                    // A disk that was full stays full: that ends the run, with its cure.
                    self.room(self.busy.load(Ordering::Acquire))?;
                    if self.stop.asked() {
                        return Ok(Tried::Stopped);
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
                "nothing works on this host; the last words were: {last}"
            ));
        }
        Ok(Tried::Broken)
    }
}

/// The words of a problem without those that lead to the log of the recording: a
/// campaign makes the episode again and keeps no log.
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
        true => format!("{kept}; its log is not kept, the episode is made again"),
        false => words.to_owned(),
    }
}

enum Tried {
    /// It is done.
    Done(Box<Done>),
    /// The task was not done.
    Again,
    /// Something else killed the worker.
    Killed(Killed),
    Broken,
    Stopped,
}

/// An attempt whose worker something else killed.
struct Killed {
    /// The attempt, from 0.
    attempt: u32,
    /// Servers that died or hung in it.
    deaths: u32,
    /// How the worker ended.
    words: String,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_that_is_removed_is_not_named() {
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
            let told = without_log(words);
            assert_eq!(
                told,
                format!("{kept}; its log is not kept, the episode is made again")
            );
        }
        let other = "the recorder said:\nnothing; at all";
        assert_eq!(without_log(other), other);
    }
}
