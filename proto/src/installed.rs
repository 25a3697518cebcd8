//! Location of the assets folder, in a checkout and installed.

use std::path::{Path, PathBuf};

/// Environment variable with the path of the assets folder.
pub const ASSETS_VARIABLE: &str = "WHEELARM_ASSETS";

/// Environment variable with folders of world packs, separated as in `PATH`.
pub const PACKS_VARIABLE: &str = "WHEELARM_PACKS";

/// The assets folder of the working directory.
const HERE: &str = "assets";

/// Whether a folder is an assets folder of WheelArm: it contains scenes and robots.
#[must_use]
pub fn is_assets(folder: &Path) -> bool {
    folder.join("scenes").is_dir() && folder.join("robots").is_dir()
}

/// The assets folder of this program, without an explicit path.
///
/// Search order: `<program>/../share/wheelarm/assets`, as in a wheel, a Debian package,
/// an archive and a container image; `assets` in a folder above the program, as in a
/// checkout; `assets` in the working directory. The working directory is last, so that
/// an unrelated folder there does not replace the installed assets.
#[must_use]
pub fn assets() -> Option<PathBuf> {
    let program = std::env::current_exe().unwrap_or_default();
    candidates(&program).find(|folder| is_assets(folder))
}

/// Resolves a path. If it does not exist and begins with `assets`, it is looked up in
/// the folder that `WHEELARM_ASSETS` names, else in [`assets`]. So
/// `assets/campaigns/small.toml` works without a checkout.
#[must_use]
pub fn file_or_asset(named: &Path) -> PathBuf {
    let named_folder = std::env::var_os(ASSETS_VARIABLE).map(PathBuf::from);
    match named_folder.or_else(assets) {
        Some(folder) => file_or_asset_of(&folder, named),
        None => named.to_owned(),
    }
}

/// [`file_or_asset`] with a given assets folder.
fn file_or_asset_of(folder: &Path, named: &Path) -> PathBuf {
    let inside = named.strip_prefix("assets").map(|path| folder.join(path));
    match inside {
        Ok(inside) if !named.exists() && inside.exists() => inside,
        _ => named.to_owned(),
    }
}

/// Warning about an assets folder in the working directory that is not used in place of
/// `used`.
#[must_use]
pub fn unused_assets(used: &Path) -> Option<String> {
    unused_in(Path::new(HERE), used)
}

fn unused_in(here: &Path, used: &Path) -> Option<String> {
    let same = || std::fs::canonicalize(here).ok() == std::fs::canonicalize(used).ok();
    (is_assets(here) && !same()).then(|| {
        format!(
            "the assets in use are {}; those in ./assets are not used: name them with --assets \
             assets or {ASSETS_VARIABLE}",
            used.display()
        )
    })
}

/// Candidate assets folders of `program`; relative ones to the working directory.
fn candidates(program: &Path) -> impl Iterator<Item = PathBuf> {
    let shared = program.ancestors().nth(2);
    let shared = shared.map(|prefix| prefix.join("share/wheelarm/assets"));
    let above = program.ancestors().skip(1);
    let above = above.map(|folder| folder.join("assets"));
    let here = std::iter::once(PathBuf::from(HERE));
    shared.into_iter().chain(above).chain(here)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first of the candidates below `prefix` that is an assets folder.
    fn found(prefix: &Path, program: &str) -> Option<PathBuf> {
        candidates(&prefix.join(program))
            .find(|folder| folder.starts_with(prefix) && is_assets(folder))
    }

    fn make(folder: &Path) {
        std::fs::create_dir_all(folder.join("scenes")).unwrap();
        std::fs::create_dir_all(folder.join("robots")).unwrap();
    }

    #[test]
    fn an_installed_program_finds_its_share_before_a_folder_above() {
        let home = tempfile::tempdir().unwrap();
        let prefix = home.path().join("v");
        std::fs::create_dir_all(prefix.join("bin")).unwrap();
        assert_eq!(found(home.path(), "v/bin/wheelarm-server"), None);
        // Not an assets folder: it has no robots.
        std::fs::create_dir_all(home.path().join("v/assets/scenes")).unwrap();
        assert_eq!(found(home.path(), "v/bin/wheelarm-server"), None);
        make(&home.path().join("assets"));
        assert_eq!(
            found(home.path(), "v/bin/wheelarm-server"),
            Some(home.path().join("assets"))
        );
        let share = prefix.join("share/wheelarm/assets");
        make(&share);
        assert_eq!(found(home.path(), "v/bin/wheelarm-server"), Some(share));
    }

    #[test]
    fn folder_in_the_working_directory_does_not_replace_installed_assets() {
        let prefix = tempfile::tempdir().unwrap();
        let program = prefix.path().join("bin/wheelarm-server");
        let last = candidates(&program).last();
        assert_eq!(last, Some(PathBuf::from(HERE)));
        let [used, other] = ["share/wheelarm/assets", "assets"].map(|path| {
            let path = prefix.path().join(path);
            make(&path);
            path
        });
        assert_eq!(unused_in(&used, &used), None);
        let warning = unused_in(&other, &used).unwrap();
        assert!(warning.contains("--assets assets"), "{warning}");
    }

    #[test]
    fn a_program_of_a_checkout_finds_the_assets_above() {
        let checkout = tempfile::tempdir().unwrap();
        make(&checkout.path().join("assets"));
        assert_eq!(
            found(checkout.path(), "target/release/wheelarm-server"),
            Some(checkout.path().join("assets"))
        );
    }

    #[test]
    fn a_named_asset_is_found_without_a_checkout() {
        let folder = tempfile::tempdir().unwrap();
        let plans = folder.path().join("campaigns");
        std::fs::create_dir_all(&plans).unwrap();
        std::fs::write(plans.join("mine.toml"), "").unwrap();
        let there = |named: &str| file_or_asset_of(folder.path(), Path::new(named));
        assert_eq!(there("assets/campaigns/mine.toml"), plans.join("mine.toml"));
        for named in ["assets/campaigns/other.toml", "mine.toml", "/assets/x"] {
            assert_eq!(there(named), Path::new(named));
        }
    }
}
