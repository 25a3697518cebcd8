//! `wheelarm cache`: place, size and removal of the user's cache.

use std::fmt::Write;
use std::path::PathBuf;

use anyhow::Context;
use clap::{Args, Subcommand};
use wheelarm_proto::cache::{self, Store, Usage};

/// Arguments of `wheelarm cache`.
#[derive(Args, Debug)]
pub struct CacheArgs {
    #[command(subcommand)]
    command: Option<CacheCommand>,
}

/// Commands of the cache.
#[derive(Subcommand, Debug)]
enum CacheCommand {
    /// Removes all entries.
    Clear,
}

/// Runs `wheelarm cache` and returns its output.
///
/// # Errors
/// When the folder cannot be listed, or an entry cannot be removed.
pub fn run(args: &CacheArgs) -> anyhow::Result<String> {
    report(args, cache::folder())
}

fn report(args: &CacheArgs, folder: Option<PathBuf>) -> anyhow::Result<String> {
    let Some(place) = &folder else {
        let variable = cache::VARIABLE;
        return Ok(format!(
            "the cache is off: {variable} is `off`, or no home folder is known\n"
        ));
    };
    let place = place.display().to_string();
    let store = Store::at(folder, cache::LIMIT);
    let megabytes = |bytes: u64| bytes as f64 * 1e-6;
    let size = |usage: Usage| {
        format!(
            "{} entries, {:.1} MB",
            usage.entries,
            megabytes(usage.bytes)
        )
    };
    let mut text = String::new();
    match args.command {
        None => {
            let usage = store
                .usage()
                .with_context(|| format!("cannot list the cache {place}"))?;
            let limit = megabytes(cache::LIMIT);
            writeln!(text, "{place}\n{}, at most {limit:.0} MB", size(usage))?;
        }
        Some(CacheCommand::Clear) => {
            let removed = store
                .clear()
                .with_context(|| format!("cannot clear the cache {place}"))?;
            writeln!(text, "{place}\nremoved {}", size(removed))?;
        }
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cache_is_shown_and_cleared() {
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("cache");
        let store = Store::at(Some(place.clone()), cache::LIMIT);
        let [show, clear] = [None, Some(CacheCommand::Clear)].map(|command| CacheArgs { command });
        let run = |args| report(args, Some(place.clone())).unwrap();
        assert!(run(&show).contains("0 entries, 0.0 MB"));
        store
            .put(&cache::key("test 1", &[]), &[1; 1_000_000])
            .unwrap();
        let text = run(&show);
        assert!(
            text.contains("1 entries, 1.0 MB") && text.contains("cache"),
            "{text}"
        );
        assert!(run(&clear).contains("removed 1 entries, 1.0 MB"));
        assert!(run(&show).contains("0 entries"));
        assert!(report(&show, None).unwrap().contains("off"));
        // A file in place of the folder.
        std::fs::write(folder.path().join("file"), "").unwrap();
        let problem = report(&clear, Some(folder.path().join("file"))).unwrap_err();
        assert!(problem.to_string().contains("cannot clear the cache"));
    }
}
