//! Whether the assets hold what a plan names: told before anything starts, where a
//! server would refuse every episode of it.

use std::path::Path;

use wheelarm_proto::person::NO_PERSON;

use super::plan::Plan;

/// The camera that every scene has, beside those of the robot.
const ROOM: &str = "room";
/// A file among the sensor models that is none.
const SURFACES: &str = "surfaces";

/// A name in a plan.
struct Named<'a> {
    /// What it names, in words.
    what: &'a str,
    name: &'a str,
    /// Those that there are; none where they cannot be told.
    known: Vec<String>,
}

/// The first name in the plan at `path` that the folder `assets` does not hold, with
/// those that it holds; of tasks only a server knows.
#[must_use]
pub fn unknown(path: &Path, plan: &Plan, assets: &Path) -> Option<String> {
    let named = |what, name, known| Named { what, name, known };
    let mut all = vec![
        named("scene", &plan.scenario().scene, files(assets, "scenes")),
        named(
            "robot",
            &plan.scenario().robot,
            folders(assets, "robots", "robot.toml"),
        ),
    ];
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
    // What is empty is drawn, and what cannot be listed is left to the server.
    let is_unknown = |named: &&Named<'_>| {
        let known = &named.known;
        !named.name.is_empty() && !known.is_empty() && !known.iter().any(|k| k == named.name)
    };
    all.iter().find(is_unknown).map(|unknown| {
        let line = line(&plan.text, unknown.name);
        format!(
            "{}{}: the assets hold no {} {:?} (known: {}); correct the name",
            path.display(),
            line.map_or(String::new(), |line| format!(":{line}")),
            unknown.what,
            unknown.name,
            unknown.known.join(", ")
        )
    })
}

/// The first line of a plan that has `name` as a text.
fn line(text: &str, name: &str) -> Option<usize> {
    let quoted = format!("\"{name}\"");
    let found = text.lines().position(|line| line.contains(&quoted));
    found.map(|before| before + 1)
}

/// Names of what lies in a folder of the assets, sorted.
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

/// Names of the folders in a folder that hold `file`.
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

/// Names of a robot's cameras, and that of the scene; none where they cannot be read.
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
    fn a_name_that_the_assets_lack_is_told_with_its_line_and_those_that_there_are() {
        let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets");
        let path = Path::new("p.toml");
        let told = |from: &str, to: &str| {
            let plan = Plan::parse(path, PLAN.replace(from, to)).unwrap();
            unknown(path, &plan, &assets)
        };
        assert_eq!(told("", ""), None);
        assert_eq!(told("body = \"man_p50\", ", ""), None);
        assert_eq!(told("man_p50", "none"), None);
        for (from, to, line, words) in [
            ("home", "nohome", 2, "no scene \"nohome\" (known: home)"),
            (
                "man_p50",
                "man_p51",
                3,
                "no person \"man_p51\" (known: boy_15",
            ),
            (
                "hands_in_lap",
                "asleep",
                3,
                "no posture \"asleep\" (known: ",
            ),
            (
                "\"imu\"",
                "\"nosuch\"",
                4,
                "no sensor model \"nosuch\" (known: chair_stereo",
            ),
            (
                "\"room\"",
                "\"rom\"",
                7,
                "no camera \"rom\" (known: gen3, wheelchair",
            ),
            (
                "home\"",
                "home\"\nscenario.robot = \"wheel\"",
                3,
                "no robot \"wheel\" (known: wheelarm, wheelarm_wide)",
            ),
        ] {
            let told = told(from, to).unwrap();
            assert!(told.starts_with(&format!("p.toml:{line}: ")), "{told}");
            assert!(told.contains(words), "{told}");
        }
    }
}
