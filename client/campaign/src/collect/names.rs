//! Checks the names of a plan against the assets before a campaign starts, because a server
//! would reject every episode with an unknown name.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use wheelarm_homes::own_home::OwnHomeId;
use wheelarm_options::choice::did_you_mean;
use wheelarm_pack::Store as PackStore;
use wheelarm_proto::person::NO_PERSON;

use super::plan::Plan;

/// Camera that every scene has, in addition to those of the robot.
const ROOM: &str = "room";
/// File in the folder of sensor models that is not a model.
const SURFACES: &str = "surfaces";

/// A name in a plan.
struct Named<'a> {
    /// Kind of the name, for messages.
    what: &'a str,
    name: &'a str,
    /// Defined names; empty when they cannot be listed.
    known: Vec<String>,
}

/// Error message for the first name in the plan at `path` that the folder `assets` does not
/// define, with the defined names. Tasks are checked by the server.
#[must_use]
pub fn unknown(path: &Path, plan: &Plan, assets: &Path, packs: &[PathBuf]) -> Option<String> {
    let named = |what, name, known| Named { what, name, known };
    let mut scenes = files(assets, "scenes");
    if !scenes.is_empty() {
        let found = PackStore::search(packs, assets).candidates();
        // A pack of objects is not a scene; a zip file is not opened here.
        let homes = found.into_iter().filter_map(|(name, path)| {
            let has_home = path.is_file() || path.join("home.toml").is_file();
            has_home.then_some(name)
        });
        scenes.extend(homes.collect::<BTreeSet<String>>());
    }
    let mut all: Vec<Named<'_>> = plan
        .variation
        .homes
        .iter()
        .chain([&plan.scenario().scene])
        .filter(|name| !is_own_home(assets, name, plan.scenario().layout_seed))
        .map(|name| named("scene", name, scenes.clone()))
        .collect();
    all.push(named(
        "robot",
        &plan.scenario().robot,
        folders(assets, "robots", "robot.toml"),
    ));
    let cameras = cameras(assets, &plan.scenario().robot);
    for camera in &plan.scenario().cameras {
        all.push(named("camera", &camera.name, cameras.clone()));
    }
    let person = plan.scenario().person.as_ref();
    if let Some(person) = person.filter(|person| person.body != NO_PERSON) {
        let bodies = folders(assets, "people", "person.toml");
        all.push(named("person", &person.body, bodies));
        let postures = tables(assets, "people/postures.toml");
        all.push(named("posture", &person.posture, postures));
    }
    for sensor in &plan.scenario().sensors {
        let mut models = files(assets, "sensors");
        models.retain(|model| model != SURFACES);
        all.push(named("sensor model", &sensor.model, models));
    }
    // An empty name is sampled, and names that cannot be listed are left to the server.
    let is_unknown = |named: &&Named<'_>| {
        let known = &named.known;
        !named.name.is_empty() && !known.is_empty() && !known.iter().any(|k| k == named.name)
    };
    all.iter().find(is_unknown).map(|unknown| {
        let line = line(&plan.text, unknown.name);
        format!(
            "{}{}: no {} {:?} in the assets; available: {}; correct the name{}",
            path.display(),
            line.map_or(String::new(), |line| format!(":{line}")),
            unknown.what,
            unknown.name,
            unknown.known.join(", "),
            did_you_mean(unknown.name, unknown.known.iter().map(String::as_str))
        )
    })
}

/// Whether a server makes a scene as an own home.
fn is_own_home(assets: &Path, scene: &str, layout_seed: Option<u64>) -> bool {
    let of_plan = layout_seed.map(|seed| OwnHomeId::of_scene(scene, "", seed));
    let id = OwnHomeId::from_name(scene).or(of_plan);
    id.is_some_and(|id| id.is_of(assets))
}

/// The first line of a plan that contains `name` as a string.
fn line(text: &str, name: &str) -> Option<usize> {
    let quoted = format!("\"{name}\"");
    let found = text.lines().position(|line| line.contains(&quoted));
    found.map(|before| before + 1)
}

/// Names of the entries of a folder of the assets, sorted.
fn listed(
    assets: &Path,
    folder: &str,
    name: impl Fn(&Path, String) -> Option<String>,
) -> Vec<String> {
    let entries = std::fs::read_dir(assets.join(folder)).into_iter().flatten();
    let paths = entries.flatten().map(|entry| entry.path());
    let mut names: Vec<String> = paths
        .filter_map(|path| name(&path, path.file_name()?.to_str()?.to_owned()))
        .collect();
    names.sort();
    names
}

/// Names of the TOML files in a folder.
fn files(assets: &Path, folder: &str) -> Vec<String> {
    listed(assets, folder, |_, name| {
        name.strip_suffix(".toml").map(str::to_owned)
    })
}

/// Names of the subfolders that contain `file`.
fn folders(assets: &Path, folder: &str, file: &str) -> Vec<String> {
    listed(assets, folder, |path, name| {
        path.join(file).is_file().then_some(name)
    })
}

fn read(assets: &Path, file: &str) -> Option<toml::Table> {
    std::fs::read_to_string(assets.join(file))
        .ok()?
        .parse()
        .ok()
}

/// Names of the tables in a file.
fn tables(assets: &Path, file: &str) -> Vec<String> {
    let all = read(assets, file).unwrap_or_default().into_iter();
    all.filter(|(_, value)| value.is_table())
        .map(|(name, _)| name)
        .collect()
}

/// Names of a robot's cameras and of the scene's; empty when they cannot be read.
fn cameras(assets: &Path, robot: &str) -> Vec<String> {
    let file = read(assets, &format!("robots/{robot}/robot.toml")).unwrap_or_default();
    let all = file.get("camera").and_then(toml::Value::as_array);
    let names = all.into_iter().flatten().filter_map(|camera| {
        let name = camera.get("name")?.as_str()?;
        Some(name.to_owned())
    });
    let mut names: Vec<String> = names.collect();
    if !names.is_empty() {
        names.push(ROOM.to_owned());
    }
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLAN: &str = "name = \"x\"\nscenario.scene = \"home\"\nscenario.person = { body = \"man_p50\", posture = \"hands_in_lap\" }\nscenario.sensors = [{ model = \"imu\" }, { model = \"kinova_vision\", camera = \"gen3\" }]\nscenario.cameras = [\n{ name = \"gen3\", width = 64, height = 48 },\n{ name = \"room\", width = 64, height = 48 },\n]\n[[task]]\nname = \"pick_mustard\"\nepisodes = 2\n";

    #[test]
    fn unknown_name_is_reported_with_its_line_and_the_defined_names() {
        let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets");
        let path = Path::new("p.toml");
        let check = |from: &str, to: &str| {
            let plan = Plan::parse(path, PLAN.replace(from, to)).unwrap();
            unknown(path, &plan, &assets, &[])
        };
        assert_eq!(check("", ""), None);
        assert_eq!(check("body = \"man_p50\", ", ""), None);
        assert_eq!(check("man_p50", "none"), None);
        for (from, to, line, words) in [
            (
                "home",
                "nohome",
                2,
                "no scene \"nohome\" in the assets; available: home, bench;",
            ),
            (
                "man_p50",
                "man_p51",
                3,
                "no person \"man_p51\" in the assets; available: boy_15",
            ),
            (
                "hands_in_lap",
                "asleep",
                3,
                "no posture \"asleep\" in the assets; available: ",
            ),
            (
                "\"imu\"",
                "\"nosuch\"",
                4,
                "no sensor model \"nosuch\" in the assets; available: chair_stereo",
            ),
            (
                "\"room\"",
                "\"rom\"",
                7,
                "no camera \"rom\" in the assets; available: gen3, wheelchair",
            ),
            (
                "home\"",
                "home\"\nscenario.robot = \"wheel\"",
                3,
                "no robot \"wheel\" in the assets; available: wheelarm, wheelarm_wide;",
            ),
        ] {
            let problem = check(from, to).unwrap();
            assert!(
                problem.starts_with(&format!("p.toml:{line}: ")),
                "{problem}"
            );
            assert!(problem.contains(words), "{problem}");
        }
    }
}
