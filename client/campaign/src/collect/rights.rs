//! Licenses, digests and splits of the world packs of a plan, checked before any episode is made.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use wheelarm_pack::{ObjectFile, Pack, Store, to_hex};
use wheelarm_proto::seeds::Purpose;

use super::plan::Plan;
use crate::worlds::{self, SHIPPED, SHIPPED_OBJECTS, Worlds};

/// Checks that the packs of the plan's scene and objects permit commercial use.
///
/// Returns a warning when one does not and the plan does not require it. A scene of the
/// assets has no pack.
///
/// # Errors
/// When the plan has `pack_license = "commercial"` and a part of a pack does not permit it, when the
/// plan is for training and a pack, or an object of it, is held out for tests, or when a pack is
/// not valid or not the one that the plan names.
pub fn check(
    path: &Path,
    plan: &Plan,
    assets: &Path,
    packs: &[PathBuf],
) -> anyhow::Result<Option<String>> {
    let scene = &plan.scenario().scene;
    let of_scene = Some(scene).filter(|scene| {
        let file = assets.join(format!("scenes/{scene}.toml"));
        !file.is_file()
    });
    let further = plan.scenario().packs.iter().map(|pack| &pack.name);
    let further = further.filter(|name| *name != scene);
    let further = further.chain(&plan.variation.homes);
    let mut problems = Vec::new();
    let sides = worlds::shipped()?;
    for name in of_scene.into_iter().chain(further) {
        let pack = Store::search(packs, assets).open(name);
        let pack = pack.with_context(|| format!("the pack {name:?} cannot be used"))?;
        let Some(pack) = pack else { continue };
        if pack.manifest().held_out && plan.purpose == Purpose::Train {
            bail!(
                "{}: the pack {name:?} is held out for tests, and the plan is for training; name \
                 another pack, or use a purpose of tests",
                path.display()
            );
        }
        if plan.purpose == Purpose::Train
            && let Some(what) = held_out_object(&sides, &pack)
        {
            bail!(
                "{}: {what} of the pack {name:?} is held out for tests ({SHIPPED}), and the plan is \
                 for training; write held_out = true in its table [stock], or name another pack",
                path.display()
            );
        }
        check_digest(path, plan, &pack)?;
        let Err(problem) = pack.check_commercial() else {
            continue;
        };
        if plan.commercial {
            let what = format!("{} requires pack_license = \"commercial\"", path.display());
            return Err(anyhow::Error::new(problem).context(what));
        }
        problems.push(problem.to_string());
    }
    Ok((!problems.is_empty()).then(|| problems.join("\n")))
}

/// An object that tasks may place, that training must not see, and that is not marked in its pack.
fn held_out_object(sides: &Worlds, pack: &Pack) -> Option<String> {
    let objects = pack.names("objects", "toml");
    let mut found = objects.filter_map(|name| {
        let text = pack.file(&format!("objects/{name}.toml"))?;
        let file: ObjectFile = toml::from_str(&String::from_utf8_lossy(text)).ok()?;
        let is_sampled = file.stock.is_some_and(|stock| !stock.held_out);
        let is_held_out =
            sides.is_held_out_object(name) || sides.held_out.categories.contains(&file.category);
        (is_sampled && is_held_out).then(|| format!("the object {name:?}, a {},", file.category))
    });
    found.next()
}

/// Rejects a pack with another physics digest than the plan names.
fn check_digest(path: &Path, plan: &Plan, pack: &Pack) -> anyhow::Result<()> {
    let own = to_hex(&pack.id().physics);
    let mut refs = plan.scenario().packs.iter();
    let named = refs.find(|named| named.name == pack.id().name);
    match named.map(|named| &named.physics_digest) {
        Some(wanted) if !wanted.is_empty() && *wanted != own => bail!(
            "{}: the pack {:?} has the physics digest {own}, expected {wanted} ({SHIPPED_OBJECTS}, or packs \
             of [scenario]); take the pack of this version of WheelArm",
            path.display(),
            pack.id().name
        ),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLAN: &str = "name = \"x\"\nscenario.scene = \"flat\"\n[[scenario.cameras]]\nname = \"gen3\"\nwidth = 64\nheight = 48\n[[task]]\nname = \"pick_jar\"\nepisodes = 2\n";

    /// A copy of the flat in which `from` is `to` in one file.
    fn packs(file: &str, from: &str, to: &str) -> tempfile::TempDir {
        let flat = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/flat");
        let mut files = wheelarm_pack::Pack::open(&flat).unwrap().files().clone();
        let text = String::from_utf8(files[file].clone()).unwrap();
        assert!(text.contains(from), "{file}");
        files.insert(file.to_owned(), text.replace(from, to).into_bytes());
        let folder = tempfile::tempdir().unwrap();
        let pack = wheelarm_pack::Pack::from_files(files).unwrap();
        pack.write_folder(&folder.path().join("flat")).unwrap();
        folder
    }

    #[test]
    fn only_plans_for_commercial_use_refuse_packs_and_the_others_warn() {
        let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets");
        let path = Path::new("p.toml");
        let check = |text: String, packs: &Path| {
            let plan = Plan::parse(path, text).unwrap();
            check(path, &plan, &assets, &[packs.to_owned()])
        };
        let commercial = format!("pack_license = \"commercial\"\n{PLAN}");
        for (license, permitted, words) in [
            ("CC0-1.0", true, ""),
            ("CC-BY-NC-4.0", false, "jar (CC-BY-NC-4.0)"),
            ("unknown", false, "jar (unknown)"),
            ("my own", false, "jar (my own)"),
        ] {
            let changed = format!("license = \"{license}\"");
            let folder = packs("objects/jar.toml", "license = \"CC0-1.0\"", &changed);
            let warning = check(PLAN.to_owned(), folder.path()).unwrap();
            assert_eq!(warning.is_none(), permitted, "{license}: {warning:?}");
            let refused = check(commercial.clone(), folder.path());
            assert_eq!(refused.is_ok(), permitted, "{license}");
            if let Err(problem) = refused {
                let text = format!("{problem:#}");
                assert!(text.starts_with("p.toml requires pack_license"), "{text}");
                assert!(
                    text.contains(words) && text.contains("remove or replace"),
                    "{text}"
                );
            }
        }
        let folder = packs("pack.toml", "format = 1", "format = 1\nheld_out = true");
        let train = PLAN.replace("\"x\"", "\"x\"\nfirst_seed = 10000");
        let refused = check(train, folder.path()).unwrap_err().to_string();
        assert!(refused.contains("held out for tests"), "{refused}");
        assert_eq!(check(PLAN.to_owned(), folder.path()).unwrap(), None);
        let train = || PLAN.replace("\"x\"", "\"x\"\nfirst_seed = 10000");
        let stock = "words = \"jar\", headroom = 0.3, depth = 0.2, yaw_deg = 180";
        for (more, permitted) in [("", false), (", held_out = true", true)] {
            let vase = format!("category = \"vase\"\nstock = {{ {stock}{more} }}");
            let folder = packs("objects/jar.toml", "category = \"jar\"", &vase);
            let checked = check(train(), folder.path()).map_err(|error| error.to_string());
            match permitted {
                true => assert_eq!(checked, Ok(None)),
                false => {
                    let error = checked.unwrap_err();
                    assert!(error.contains("held_out = true"), "{error}");
                }
            }
        }
        let named = PLAN.replace(
            "[[scenario.cameras]]",
            "[[scenario.packs]]\nname = \"flat\"\nphysics_digest = \"ab\"\n[[scenario.cameras]]",
        );
        let folder = packs("pack.toml", "format = 1", "format = 1");
        let error = check(named, folder.path()).unwrap_err().to_string();
        assert!(error.contains("expected ab"), "{error}");
        // A scene of the assets has no pack.
        let home = commercial.replace("\"flat\"", "\"home\"");
        assert_eq!(check(home, Path::new("nowhere")).unwrap(), None);
    }
}
