//! Resumes a campaign: results of earlier runs, leftovers of a killed one, remaining jobs.

use std::collections::BTreeMap;

use anyhow::bail;
use wheelarm_rollout::damaged_line;

use super::episode::Episode;
use super::estimate::Estimate;
use super::fleet::Job;
use super::folder::Folder;
use super::journal::{Entry, Journal, Ledger};

/// The journal entries of the episodes `mine` whose files exist, and warnings about the
/// others.
///
/// # Errors
/// When the journals cannot be read, or are of another plan.
pub fn ledger(folder: &Folder, mine: &[Episode]) -> anyhow::Result<(Ledger, Vec<String>)> {
    let mut ledger = Ledger::read(&folder.journal())?;
    let torn = ledger
        .torn
        .iter()
        .map(|(journal, line)| damaged_line(journal, *line));
    let mut warnings: Vec<String> = torn.collect();
    let by_id: BTreeMap<&str, &Episode> = mine.iter().map(|e| (e.id.as_str(), e)).collect();
    for done in ledger.done.values() {
        if let Some(episode) = by_id.get(done.episode.as_str())
            && done.settings != episode.settings
        {
            bail!(
                "{} contains {} of another plan: it was made with\n  {}\nand the plan has\n  {}\nChoose another --out, or restore the plan",
                folder.root().display(),
                done.episode,
                done.settings,
                episode.settings
            );
        }
    }
    ledger.done.retain(|id, done| {
        let size = std::fs::metadata(folder.file(id)).map(|m| m.len());
        let exists = size.is_ok_and(|size| size == done.bytes);
        if !exists && by_id.contains_key(id.as_str()) {
            warnings.push(format!(
                "{} is absent or has another size, it counts as missing",
                folder.file(id).display()
            ));
        }
        exists && by_id.contains_key(id.as_str())
    });
    for (id, attempts) in &mut ledger.failed {
        let settings = by_id.get(id.as_str()).map(|episode| &episode.settings);
        attempts.retain(|failed| Some(&failed.settings) == settings);
    }
    Ok((ledger, warnings))
}

/// Cleans up after a killed run: enters finished files and removes partial ones. A file
/// without a journal entry is moved aside if a journal line is damaged, which may have
/// been its own.
///
/// # Errors
/// When more such files exist than damaged lines, or the disk fails.
pub fn settle(
    folder: &Folder,
    mine: &[Episode],
    journal: &Journal,
    ledger: &mut Ledger,
) -> anyhow::Result<()> {
    let mut torn = ledger.torn.len();
    let mut finished = Vec::new();
    for episode in mine {
        if ledger.done.contains_key(&episode.id) {
            continue;
        }
        let done = folder.resume(&episode.id)?;
        if let Some(done) = done.filter(|done| done.settings == episode.settings) {
            finished.push(Entry::Done(Box::new(done)));
            continue;
        }
        let file = folder.file(&episode.id);
        if !file.exists() {
            continue;
        }
        if torn == 0 {
            bail!(
                "{} exists, but no journal has an entry for it; move it away",
                file.display()
            );
        }
        torn -= 1;
        let aside = folder.set_aside(&episode.id)?;
        tracing::warn!(
            "{} has no journal entry, most likely because of the damaged line: it was moved to \
             {} and the episode is repeated",
            file.display(),
            aside.display()
        );
    }
    // Kept recordings of failed attempts without a journal entry.
    let journals = Ledger::read(&folder.journal())?;
    let listed = journals.failed.values().flatten();
    let listed: Vec<&str> = listed
        .filter_map(|f| f.loss.as_ref())
        .map(|loss| loss.file.as_str())
        .collect();
    for aside in
        folder.set_orphans_aside(mine.iter().map(|episode| episode.id.as_str()), &listed)?
    {
        tracing::warn!(
            "{}: the recording of a failed attempt without a journal entry, most likely of a killed \
             run; the attempt is repeated",
            aside.display()
        );
    }
    // Last, because the first append drops a cut line.
    for entry in finished {
        journal.append(&entry)?;
        ledger.add(entry);
    }
    mine.iter()
        .try_for_each(|episode| folder.clean(&episode.id))
}

/// The remaining jobs.
#[must_use]
pub fn jobs(mine: &[Episode], ledger: &Ledger, estimate: &Estimate) -> Vec<Job> {
    mine.iter()
        .filter(|episode| !ledger.done.contains_key(&episode.id))
        .map(|episode| {
            let share = estimate.shares.iter().find(|s| s.task == episode.task);
            let (attempt, deaths) = ledger.next_attempt(&episode.id);
            Job {
                attempt,
                deaths,
                expected: share.map_or(0.0, |s| s.seconds.0 / s.success),
                kills: 0,
                episode: episode.clone(),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collect::episode::{Shard, episodes};
    use crate::collect::journal;
    use crate::collect::plan::Plan;

    #[test]
    fn damaged_journal_line_costs_only_its_episode() {
        let root = tempfile::tempdir().unwrap();
        let folder = Folder::make(root.path()).unwrap();
        let plan = "name = \"x\"\n[[task]]\nname = \"a\"\nepisodes = 2\n";
        let plan = Plan::parse("p.toml".as_ref(), plan.to_owned()).unwrap();
        let mine = episodes(&plan);
        let entry = |episode: &Episode| {
            let file = Folder::file_name(&episode.id);
            serde_json::json!({
                "kind": "done", "episode": episode.id, "task": "a", "attempt": 0,
                "seed": episode.seed, "settings": episode.settings, "file": file,
                "sha256": "", "bytes": 3, "success": true, "instruction": "", "seconds": 1.0,
                "wall_seconds": 1.0, "counts": {}, "missed": 0, "finished_unix_millis": 0,
                "origin": ["", ""], "scenario": null,
            })
            .to_string()
        };
        let [first, second] = [entry(&mine[0]), entry(&mine[1])];
        let text = format!("{first}\n{second}\n");
        let journal = folder.journal().join("shard-0-of-1.jsonl");
        let mut orphans = 0;
        // Whole, then cut anywhere in the second line.
        for (cut, aside) in [(text.len(), 0), (first.len() + 2, 1), (text.len() - 2, 2)] {
            std::fs::write(&journal, &text[..cut]).unwrap();
            for episode in &mine {
                std::fs::write(folder.file(&episode.id), "abc").unwrap();
            }
            // Kept by a run that was killed before it wrote its entry.
            let kept = root.path().join("failed_episodes");
            std::fs::create_dir_all(&kept).unwrap();
            let orphan = kept.join(format!("{}-attempt-0.h5", mine[0].id));
            std::fs::write(&orphan, "lost").unwrap();
            let others = kept.join("other-attempt-0.h5");
            std::fs::write(&others, "of another shard").unwrap();
            let open = journal::open(&folder.journal(), Shard::WHOLE).unwrap();
            let (mut known, warnings) = ledger(&folder, &mine).unwrap();
            settle(&folder, &mine, &open, &mut known).unwrap();
            let is_whole = cut == text.len();
            assert_eq!(known.done.len(), 1 + usize::from(is_whole), "cut at {cut}");
            assert_eq!(warnings.len(), usize::from(!is_whole), "{warnings:?}");
            assert!(warnings.iter().all(|w| w.contains("line 2 is damaged")));
            assert_eq!(folder.file(&mine[1].id).exists(), is_whole);
            // The file itself is never lost.
            let failed = std::fs::read_dir(root.path().join("failed")).unwrap();
            orphans += 1;
            assert_eq!(failed.count(), aside + orphans);
            assert!(!orphan.exists() && others.exists());
        }
        // Without a damaged line the origin of such a file is unknown.
        std::fs::write(&journal, format!("{first}\n")).unwrap();
        std::fs::write(folder.file(&mine[1].id), "abc").unwrap();
        let open = journal::open(&folder.journal(), Shard::WHOLE).unwrap();
        let (mut known, _) = ledger(&folder, &mine).unwrap();
        let error = settle(&folder, &mine, &open, &mut known).unwrap_err();
        assert!(error.to_string().contains("move it away"), "{error}");
    }
}
