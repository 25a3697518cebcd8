//! Differences between the loaded assets and those of a recording, field by field, which a
//! replay prints before it diverges.

use std::collections::BTreeMap;
use std::fmt;

use toml::{Table, Value};
use wheelarm_proto::v1;

/// Tables of `robot.toml` without an effect on motion: appearance and noise.
const MOTIONLESS_TABLES: [&str; 3] = ["camera", "material", "imu"];
/// Most listed changes.
const MAX_LISTED: usize = 12;
/// Most printed characters of a value.
const MAX_VALUE: usize = 60;

/// A place in an asset that differs.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Change {
    /// Path below the assets folder.
    path: String,
    /// Field of a TOML file, line of another; empty for the whole file.
    place: String,
    /// Recorded value; absent if it did not exist.
    was: Option<String>,
    /// Loaded value; absent if it does not exist.
    is: Option<String>,
}

impl Change {
    /// Whether the change affects the motion of the robot: a changed or removed number of its
    /// `robot.toml`.
    pub fn moves_the_robot(&self) -> bool {
        let first = self.place.split(['.', '[']).next().unwrap_or_default();
        self.path.ends_with("/robot.toml")
            && self.was.is_some()
            && !MOTIONLESS_TABLES.contains(&first)
    }
}

impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let shorten = |value: &Option<String>| match value {
            Some(value) if value.chars().count() > MAX_VALUE => {
                value.chars().take(MAX_VALUE).chain("…".chars()).collect()
            }
            Some(value) => value.clone(),
            None => "nothing".to_owned(),
        };
        let (was, is) = (shorten(&self.was), shorten(&self.is));
        write!(
            f,
            "{}: {} is {is}, recorded was {was}",
            self.path, self.place
        )
    }
}

/// The first changes, one per line.
pub(super) fn lines(changes: &[Change]) -> String {
    let mut lines: Vec<String> = changes
        .iter()
        .take(MAX_LISTED)
        .map(|change| format!("  {change}"))
        .collect();
    if changes.len() > MAX_LISTED {
        lines.push(format!("  and {} more", changes.len() - MAX_LISTED));
    }
    lines.join("\n")
}

/// The differences. Files without a recorded text are ignored, because early recordings
/// contain fewer.
pub(super) fn changes(recorded: &[v1::AssetText], loaded: &[v1::AssetText]) -> Vec<Change> {
    let loaded: BTreeMap<&str, &str> = loaded
        .iter()
        .map(|asset| (asset.path.as_str(), asset.text.as_str()))
        .collect();
    let mut changes = Vec::new();
    for asset in recorded {
        let mut found = Collector {
            path: &asset.path,
            changes: &mut changes,
        };
        match loaded.get(asset.path.as_str()) {
            None => found.add("the file", Some("present".to_owned()), None),
            Some(text) if *text == asset.text => {}
            Some(text) => found.texts(&asset.text, text),
        }
    }
    changes
}

/// Collects the changes of one file.
struct Collector<'a> {
    path: &'a str,
    changes: &'a mut Vec<Change>,
}

impl Collector<'_> {
    fn add(&mut self, place: &str, was: Option<String>, is: Option<String>) {
        self.changes.push(Change {
            path: self.path.to_owned(),
            place: place.to_owned(),
            was,
            is,
        });
    }

    fn texts(&mut self, was: &str, is: &str) {
        let tables = (was.parse::<Table>(), is.parse::<Table>());
        if let (true, (Ok(was), Ok(is))) = (self.path.ends_with(".toml"), tables) {
            return self.tables("", &was, &is);
        }
        let (mut was, mut is) = (was.lines(), is.lines());
        for line in 1.. {
            match (was.next(), is.next()) {
                (None, None) => return,
                (was, is) if was == is => {}
                (was, is) => {
                    let text = |line: Option<&str>| line.map(|line| line.trim().to_owned());
                    return self.add(&format!("line {line}"), text(was), text(is));
                }
            }
        }
    }

    fn tables(&mut self, at: &str, was: &Table, is: &Table) {
        let keys = was
            .keys()
            .chain(is.keys().filter(|k| !was.contains_key(*k)));
        for key in keys {
            let place = match at {
                "" => key.clone(),
                at => format!("{at}.{key}"),
            };
            self.values(&place, was.get(key), is.get(key));
        }
    }

    fn values(&mut self, place: &str, was: Option<&Value>, is: Option<&Value>) {
        match (was, is) {
            (Some(Value::Table(was)), Some(Value::Table(is))) => self.tables(place, was, is),
            (Some(Value::Array(was)), Some(Value::Array(is))) if was.len() == is.len() => {
                for (index, (was, is)) in was.iter().zip(is).enumerate() {
                    let name = was.get("name").and_then(Value::as_str);
                    let entry = name.map_or_else(|| index.to_string(), ToOwned::to_owned);
                    self.values(&format!("{place}[{entry}]"), Some(was), Some(is));
                }
            }
            (was, is) if was == is => {}
            (was, is) => {
                let text = |value: Option<&Value>| value.map(ToString::to_string);
                self.add(place, text(was), text(is));
            }
        }
    }
}

/// Differences of the loaded robot from the recorded one that affect the rendering of its
/// states: mount of the arm, joints and frames.
pub(super) fn rendering_differences(
    was: &v1::RobotDescription,
    is: &v1::RobotDescription,
) -> Vec<String> {
    let mut differences = Vec::new();
    let numbers = |pose: Option<&v1::Pose>| {
        let pose = pose.copied().unwrap_or_default();
        let (x, q) = (
            pose.position.unwrap_or_default(),
            pose.orientation.unwrap_or_default(),
        );
        [x.x, x.y, x.z, q.x, q.y, q.z, q.w]
    };
    let [old, new] = [was, is].map(|robot| numbers(robot.arm_mount.as_ref()));
    if old.iter().zip(&new).any(|(a, b)| (a - b).abs() > 1e-9) {
        differences.push(format!(
            "arm_mount (x y z, m, and quaternion x y z w) is {new:?}, recorded was {old:?}"
        ));
    }
    let names = |robot: &v1::RobotDescription| {
        let joints: Vec<String> = robot.joints.iter().map(|j| j.name.clone()).collect();
        let frames: Vec<String> = robot.frames.iter().map(|f| f.name.clone()).collect();
        [("joints", joints), ("frames", frames)]
    };
    for ((what, old), (_, new)) in names(was).into_iter().zip(names(is)) {
        if old != new {
            differences.push(format!(
                "{what} are {}, recorded were {}",
                new.join(", "),
                old.join(", ")
            ));
        }
    }
    differences
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(path: &str, text: &str) -> v1::AssetText {
        v1::AssetText {
            path: path.into(),
            text: text.into(),
        }
    }

    #[test]
    fn changed_field_is_named_and_comments_are_ignored() {
        let path = "robots/wheelarm/robot.toml";
        let was = "[drive]\ntrack = 0.57\n[[camera]]\nname = \"gen3\"\nrange = [0.05, 10.0]";
        let is = "# Wider.\n[drive]\ntrack = 0.6\n[[camera]]\nname = \"gen3\"\nrange = [0.05, 9.0]\n[new]\na = 1";
        let found = changes(&[text(path, was)], &[text(path, is)]);
        let differences = lines(&found);
        for words in [
            "drive.track is 0.6, recorded was 0.57",
            "camera[gen3].range[1] is 9.0, recorded was 10.0",
            "new is { a = 1 }, recorded was nothing",
        ] {
            assert!(differences.contains(words), "{differences}");
        }
        let moving: Vec<_> = found.iter().filter(|c| c.moves_the_robot()).collect();
        assert_eq!(moving.len(), 1, "{moving:?}");
        assert_eq!(moving[0].place, "drive.track");
        let noted = format!("# As it was.\n{was}");
        assert_eq!(changes(&[text(path, was)], &[text(path, &noted)]), []);
    }

    #[test]
    fn changed_file_is_named_with_its_line_and_missing_one_as_missing() {
        let [old, new] = ["<robot>\n<link/>", "<robot>\n<joint/>"];
        let found = changes(&[text("a.urdf", old)], &[text("a.urdf", new)]);
        assert_eq!(
            lines(&found),
            "  a.urdf: line 2 is <joint/>, recorded was <link/>"
        );
        let found = changes(&[text("a.urdf", old)], &[]);
        assert_eq!(
            lines(&found),
            "  a.urdf: the file is nothing, recorded was present"
        );
    }

    #[test]
    fn changed_mount_is_named() {
        let mounted = |z: f64| v1::RobotDescription {
            arm_mount: Some(v1::Pose {
                position: Some(v1::Vector3 { x: 0.1, y: 0.0, z }),
                orientation: None,
            }),
            ..v1::RobotDescription::default()
        };
        assert_eq!(
            rendering_differences(&mounted(0.5), &mounted(0.5)),
            Vec::<String>::new()
        );
        let differences = rendering_differences(&mounted(0.5), &mounted(0.6));
        assert!(
            differences.len() == 1 && differences[0].starts_with("arm_mount"),
            "{differences:?}"
        );
    }
}
