//! `wheelarm collect --merge`: joins the folders of several shards or hosts into one
//! dataset, checks every file and lists missing episodes.
//!
//! The sources are not changed; files are linked, or copied between disks.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use wheelarm_dataset::publish;
use wheelarm_dataset::read::Episode as Recording;

use super::acceptance::check;
use super::card;
use super::episode::{Episode, episodes};
use super::failure_analysis::Loss;
use super::folder::{Folder, move_file, sha256};
use super::journal::{self, Done, Entry, Failed, Ledger};
use super::manifest::Manifest;
use super::plan::Plan;

/// Joins `sources` into `out`.
///
/// # Errors
/// When the folders belong to different plans or cannot be read. A damaged or absent file
/// is not an error: its episode counts as missing.
pub fn merge(sources: &[PathBuf], out: &Path) -> anyhow::Result<Manifest> {
    let mut wanted: Vec<Episode> = Vec::new();
    let mut plan: Option<Plan> = None;
    // Files that the target already contains belong to it, too.
    let filled = Folder::at(out).plan().is_file();
    for source in sources
        .iter()
        .map(PathBuf::as_path)
        .chain(filled.then_some(out))
    {
        let read = Plan::read(&Folder::at(source).plan()).with_context(|| {
            format!("{} is not a folder of `wheelarm collect`", source.display())
        })?;
        if let Some(known) = plan.as_ref().filter(|known| known.name != read.name) {
            bail!(
                "the folders are of different campaigns: {} is of {:?}, an earlier one of {:?}; \
                 merge them separately, or name another --out",
                source.display(),
                read.name,
                known.name
            );
        }
        add(&mut wanted, episodes(&read), source)?;
        // The largest plan is kept: a campaign may have grown.
        if plan
            .as_ref()
            .is_none_or(|p| p.episode_count() < read.episode_count())
        {
            plan = Some(read);
        }
    }
    let plan = plan.context("name a folder to merge")?;
    let folder = Folder::make(out)?;
    folder.keep_plan(&plan.text)?;
    let journal = journal::open_named(&folder.journal(), "merged")?;
    let mut ledger = Ledger::read(&folder.journal())?;
    let ours = |source: &Path| match (source.canonicalize(), out.canonicalize()) {
        (Ok(a), Ok(b)) => a == b,
        _ => false,
    };
    // An episode of the target counts only if its file is good.
    let by_id: BTreeMap<&str, &Episode> = wanted.iter().map(|e| (e.id.as_str(), e)).collect();
    ledger.done.retain(|id, done| match by_id.get(id.as_str()) {
        Some(episode) => report(check_episode(out, done, episode), out, id),
        None => false,
    });
    for source in sources.iter().filter(|source| !ours(source)) {
        let theirs = Ledger::read(&Folder::at(source).journal())?;
        for (journal, line) in &theirs.torn {
            tracing::warn!(
                "{}: line {line} is damaged: its episode counts as missing; run `wheelarm collect` \
                 on {} again before the merge",
                journal.display(),
                source.display()
            );
        }
        for mut failed in theirs.failed.into_values().flatten() {
            if !ledger.knows(&failed) {
                failed.loss = keep_failed(&folder, source, &failed).map(Box::new);
                journal.append(&Entry::Failed(failed.clone()))?;
                ledger.add(Entry::Failed(failed));
            }
        }
        for (id, done) in theirs.done {
            let Some(episode) = by_id.get(id.as_str()) else {
                continue;
            };
            if ledger.done.contains_key(&id)
                || !report(check_episode(source, &done, episode), source, &id)
            {
                continue;
            }
            add_file(&folder, &source.join(&done.file), &done)?;
            let entry = Entry::Done(Box::new(done));
            journal.append(&entry)?;
            ledger.add(entry);
        }
    }
    let manifest = Manifest::new(&plan.name, &wanted, &ledger);
    manifest.write(&folder)?;
    card::write(&folder, &plan, &manifest)?;
    Ok(manifest)
}

/// Adds the episodes of another plan; the same name must mean the same episode.
fn add(wanted: &mut Vec<Episode>, more: Vec<Episode>, source: &Path) -> anyhow::Result<()> {
    for episode in more {
        match wanted.iter().find(|known| known.id == episode.id) {
            Some(known) if known.settings != episode.settings => bail!(
                "the folders are of different campaigns: {} is\n  {}\nin {} and\n  {}\nin an earlier one",
                episode.id,
                episode.settings,
                source.display(),
                known.settings
            ),
            Some(_) => {}
            None => wanted.push(episode),
        }
    }
    Ok(())
}

/// Checks that the file of an episode matches its journal and the plan.
fn check_episode(root: &Path, done: &Done, episode: &Episode) -> anyhow::Result<()> {
    if done.settings != episode.settings {
        bail!(
            "it was made with\n  {}\nand the plan has\n  {}",
            done.settings,
            episode.settings
        );
    }
    let file = root.join(&done.file);
    let found = sha256(&file)?;
    if found != done.sha256 {
        bail!("its SHA-256 is {found}, expected {}", done.sha256);
    }
    let summary = Recording::open(&file)?.summary()?;
    check(&summary, episode, done.seed)?;
    if !summary.success {
        bail!("its task did not succeed");
    }
    Ok(())
}

/// Prints the problem of an episode. Returns whether it has none.
fn report(result: anyhow::Result<()>, root: &Path, id: &str) -> bool {
    match result {
        Ok(()) => true,
        Err(problem) => {
            eprintln!("{}: {id} is skipped: {problem:#}", root.display());
            false
        }
    }
}

/// Adds the kept recording of a failed attempt to the dataset. A damaged or absent one is
/// skipped with a message; the entry of the attempt remains.
fn keep_failed(folder: &Folder, source: &Path, failed: &Failed) -> Option<Loss> {
    let loss = failed.loss.as_ref()?;
    let name = format!("{}-attempt-{}", failed.episode, failed.attempt);
    let kept = || -> anyhow::Result<String> {
        let from = source.join(&loss.file);
        let found = sha256(&from)?;
        if found != loss.sha256 {
            bail!("its SHA-256 is {found}, expected {}", loss.sha256);
        }
        let existing = folder.root().join(&loss.file);
        if existing.is_file() && sha256(&existing)? == loss.sha256 {
            return Ok(loss.file.clone());
        }
        let staging = folder.stage(&name)?;
        let staged = staging.join(format!("{name}.h5"));
        link_or_copy(&from, &staged)?;
        let file = folder.keep_recording(&staged, &name)?;
        folder.clean(&name)?;
        Ok(file)
    };
    match kept() {
        Ok(file) => Some(Loss {
            file,
            ..Loss::clone(loss)
        }),
        Err(problem) => {
            report(Err(problem), source, &name);
            None
        }
    }
}

/// Links a file, or copies it between disks.
fn link_or_copy(from: &Path, staged: &Path) -> anyhow::Result<()> {
    if std::fs::hard_link(from, staged).is_err() {
        std::fs::copy(from, staged)
            .with_context(|| format!("copying {} to {}", from.display(), staged.display()))?;
        std::fs::File::open(staged)
            .and_then(|file| publish::sync_file(&file))
            .with_context(|| format!("syncing {}", staged.display()))?;
    }
    Ok(())
}

/// Adds a file to the dataset.
fn add_file(folder: &Folder, from: &Path, done: &Done) -> anyhow::Result<()> {
    let to = folder.file(&done.episode);
    if to.is_file() {
        if sha256(&to)? == done.sha256 {
            return Ok(());
        }
        // The existing file is damaged and replaced by a good one.
        let aside = folder.set_aside(&done.episode)?;
        eprintln!(
            "{} is a different file; it was moved to {}",
            to.display(),
            aside.display()
        );
    }
    let staging = folder.stage(&done.episode)?;
    let staged = staging.join(format!("{}.h5", done.episode));
    link_or_copy(from, &staged)?;
    move_file(&staged, &to)?;
    folder.clean(&done.episode)
}
