//! `wheelarm new`: copies an embedded template under a name of the user.
//!
//! Templates are in `client/cli/templates`. A template is a list of layers; a file of a later
//! layer is appended to the file with the same path. `NAME` in paths and texts becomes the
//! name. Cameras and robots are copies of the shipped robot.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use clap::{Args, ValueEnum};
use wheelarm_proto::defaults::ROBOT;
use wheelarm_proto::installed::{self, ASSETS_VARIABLE};

/// Arguments of `wheelarm new`.
#[derive(Args, Debug)]
pub struct NewArgs {
    /// Kind of template.
    kind: Kind,
    /// Name: lower-case letters, digits and `_`, beginning with a letter.
    name: String,
    /// Folder in which the folder NAME is made; by default the working directory, for
    /// cameras and robots `robots` of the assets.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Assets, of which the shipped robot is copied; by default those of this program.
    #[arg(long, env = ASSETS_VARIABLE, value_name = "DIR")]
    assets: Option<PathBuf>,
}

/// Kinds of templates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Kind {
    /// An object with a room, a table and a task, as a world pack.
    Object,
    /// A task for every home, with a room to try it in, as a world pack.
    Task,
    /// A home with a table and a task, as a world pack.
    Scene,
    /// The shipped robot with one more camera.
    Camera,
    /// A copy of the shipped robot.
    Robot,
    /// A policy in Python that uses images.
    Policy,
    /// An input device in Python.
    Device,
}

/// A file of a template: path below the folder NAME, and text.
type File = (&'static str, &'static str);

/// Embeds files of `client/cli/templates/LAYER`.
macro_rules! layer {
    ($layer:literal: $($path:literal),+ $(,)?) => {
        &[$(($path, include_str!(concat!("../templates/", $layer, "/", $path)))),+]
    };
}

const ROOM: &[File] = layer!("room": "pack.toml", "home.toml", "kinds/table.toml");
const SCENE: &[File] =
    layer!("scene": "home.toml", "areas/NAME_table.toml", "tasks/take_mustard.toml");
const OBJECT: &[File] = layer!(
    "object": "home.toml", "areas/NAME_table.toml", "objects/NAME.toml", "tasks/pick_NAME.toml",
);
const TASK: &[File] = layer!("task": "tasks/NAME.toml");
const POLICY: &[File] = layer!("policy": "policy.py");
const DEVICE: &[File] = layer!("device": "device.py");
const CAMERA: &[File] = layer!("camera": "camera.urdf", "camera.toml");

/// Longest name, bytes.
const LONGEST: usize = 40;

/// Runs `wheelarm new` and returns its output.
///
/// # Errors
/// When the name is invalid, the folder exists already, or a file cannot be written.
pub fn run(args: &NewArgs) -> anyhow::Result<String> {
    let name = args.name.as_str();
    check_name(name)?;
    let files = match args.kind {
        Kind::Object => text_files(&[ROOM, OBJECT], name),
        Kind::Task => text_files(&[ROOM, SCENE, TASK], name),
        Kind::Scene => text_files(&[ROOM, SCENE], name),
        Kind::Policy => text_files(&[POLICY], name),
        Kind::Device => text_files(&[DEVICE], name),
        Kind::Camera | Kind::Robot => robot_files(&assets(args)?, name, args.kind)?,
    };
    let parent = match (&args.out, args.kind) {
        (Some(out), _) => out.clone(),
        (None, Kind::Camera | Kind::Robot) => assets(args)?.join("robots"),
        (None, _) => PathBuf::from("."),
    };
    let folder = parent.join(name);
    write_folder(&folder, &files)?;
    let mut text = String::new();
    for path in files.keys() {
        writeln!(text, "{}", folder.join(path).display())?;
    }
    writeln!(text, "\nnext:\n{}", next_commands(args.kind, name, &parent))?;
    Ok(text)
}

fn check_name(name: &str) -> anyhow::Result<()> {
    let begins = name.starts_with(|c: char| c.is_ascii_lowercase());
    let is_word = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
    ensure!(
        begins && name.chars().all(is_word) && name.len() <= LONGEST,
        "invalid name {name:?}: use at most {LONGEST} lower-case letters, digits and `_`, \
         beginning with a letter, for example my_mug"
    );
    Ok(())
}

/// The files of layers, in order.
fn text_files(layers: &[&[File]], name: &str) -> BTreeMap<String, Vec<u8>> {
    let mut files: BTreeMap<String, Vec<u8>> = BTreeMap::new();
    for (path, text) in layers.iter().copied().flatten() {
        let content = files.entry(path.replace("NAME", name)).or_default();
        content.extend_from_slice(text.replace("NAME", name).as_bytes());
    }
    files
}

fn assets(args: &NewArgs) -> anyhow::Result<PathBuf> {
    let named = args.assets.clone().or_else(installed::assets);
    named.with_context(|| {
        format!("no assets folder found: name it with --assets DIR or {ASSETS_VARIABLE}")
    })
}

/// The files of the shipped robot under another name, its meshes shared.
fn robot_files(assets: &Path, name: &str, kind: Kind) -> anyhow::Result<BTreeMap<String, Vec<u8>>> {
    let shipped = assets.join("robots").join(ROBOT);
    let read = |file: &str| {
        let path = shipped.join(file);
        fs::read(&path).with_context(|| format!("cannot read {}", path.display()))
    };
    let urdf = String::from_utf8(read(&format!("{ROBOT}.urdf"))?)?;
    let toml = String::from_utf8(read("robot.toml")?)?;
    let mut urdf = urdf
        .replace(
            "filename=\"meshes/",
            &format!("filename=\"../{ROBOT}/meshes/"),
        )
        .replace(
            &format!("<robot name=\"{ROBOT}\""),
            &format!("<robot name=\"{name}\""),
        );
    let mut toml = toml
        .replace(
            &format!("\nname = \"{ROBOT}\"\n"),
            &format!("\nname = \"{name}\"\n"),
        )
        .replace(&format!("\"{ROBOT}.urdf\""), &format!("\"{name}.urdf\""));
    if kind == Kind::Camera {
        let end = urdf.rfind("</robot>");
        let end = end.with_context(|| format!("{ROBOT}.urdf has no </robot>"))?;
        let [link, table] = [CAMERA[0], CAMERA[1]].map(|(_, text)| text.replace("NAME", name));
        urdf.insert_str(end, &link);
        toml.push_str(&table);
    }
    Ok(BTreeMap::from([
        (format!("{name}.urdf"), urdf.into_bytes()),
        ("robot.toml".to_owned(), toml.into_bytes()),
        ("reach.bin".to_owned(), read("reach.bin")?),
    ]))
}

/// Writes the files of a new folder.
fn write_folder(folder: &Path, files: &BTreeMap<String, Vec<u8>>) -> anyhow::Result<()> {
    if folder.exists() {
        bail!(
            "{} exists already: choose another name, or another folder with --out",
            folder.display()
        );
    }
    for (path, content) in files {
        let path = folder.join(path);
        let parent = path.parent().expect("a path with a folder");
        fs::create_dir_all(parent)
            .and_then(|()| fs::write(&path, content))
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(())
}

/// The commands that try a template.
fn next_commands(kind: Kind, name: &str, parent: &Path) -> String {
    let parent = parent.display();
    let pack = format!(
        "  wheelarm pack check {parent}/{name}\n  wheelarm evaluate --packs {parent} --scene {name}"
    );
    match kind {
        Kind::Object => format!("{pack} --task pick_{name} --seeds 0..5"),
        Kind::Task => format!("{pack} --task {name} --seeds 0..5"),
        Kind::Scene => format!("{pack} --task take_mustard --seeds 0..5"),
        Kind::Camera => format!("  wheelarm demo --robot {name} --camera 640x360@10"),
        Kind::Robot => {
            format!("  wheelarm evaluate --robot {name} --task pick_mustard --seeds 0..5")
        }
        Kind::Policy => format!(
            "  wheelarm demo --seeds 0..20 --camera 96x54@10 --no-sheet --out recorded\n  \
             wheelarm dataset export --format robomimic recorded --out {parent}/{name}/rows.hdf5\n  \
             wheelarm evaluate --task pick_mustard --seeds 0..5 --policy exec:\"python {parent}/{name}/policy.py\" --training-seeds"
        ),
        Kind::Device => format!(
            "  wheelarm-server --task pick_mustard --seed 3\n  python {parent}/{name}/device.py"
        ),
    }
}

#[cfg(test)]
mod tests {
    use wheelarm_pack::Pack;

    use super::*;

    fn root() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
    }

    fn new(kind: Kind, name: &str, out: &Path) -> anyhow::Result<String> {
        let (out, assets) = (Some(out.to_owned()), Some(root().join("assets")));
        run(&NewArgs {
            kind,
            name: name.to_owned(),
            out,
            assets,
        })
    }

    fn text(path: &Path) -> String {
        fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
    }

    #[test]
    fn every_kind_makes_a_folder_that_has_no_placeholder_left() {
        let folder = tempfile::tempdir().unwrap();
        for kind in Kind::value_variants() {
            let name = format!("my_{}", kind.to_possible_value().unwrap().get_name());
            let printed = new(*kind, &name, folder.path()).unwrap();
            assert!(printed.contains("next:\n  wheelarm"), "{printed}");
            for path in printed.lines().take_while(|line| !line.is_empty()) {
                assert!(!path.contains("NAME"), "{path}");
                if !path.ends_with(".bin") {
                    assert!(!text(Path::new(path)).contains("NAME"), "{path}");
                }
            }
        }
    }

    #[test]
    fn templates_of_homes_are_valid_packs_with_a_task() {
        let folder = tempfile::tempdir().unwrap();
        for (kind, name, task) in [
            (Kind::Object, "my_jar", "pick_my_jar"),
            (Kind::Task, "my_task", "my_task"),
            (Kind::Scene, "my_home", "take_mustard"),
        ] {
            new(kind, name, folder.path()).unwrap();
            let pack = Pack::open(&folder.path().join(name)).unwrap();
            assert!(pack.files().contains_key(&format!("tasks/{task}.toml")));
        }
    }

    #[test]
    fn a_robot_is_a_copy_with_shared_meshes_and_a_camera_has_its_link() {
        let folder = tempfile::tempdir().unwrap();
        new(Kind::Robot, "my_robot", folder.path()).unwrap();
        new(Kind::Camera, "my_camera", folder.path()).unwrap();
        let shipped = root().join("assets/robots").join(ROBOT);
        let robot = folder.path().join("my_robot");
        assert!(text(&robot.join("my_robot.urdf")).contains("<robot name=\"my_robot\""));
        assert!(!text(&robot.join("my_robot.urdf")).contains("filename=\"meshes/"));
        let lines = |path: &Path| text(path).lines().count();
        let toml = robot.join("robot.toml");
        assert_eq!(lines(&toml), lines(&shipped.join("robot.toml")));
        assert!(text(&toml).contains("\nname = \"my_robot\"\nurdf = \"my_robot.urdf\"\n"));
        let camera = folder.path().join("my_camera");
        let urdf = text(&camera.join("my_camera.urdf"));
        assert!(urdf.contains("<link name=\"my_camera_frame\"/>"));
        assert!(urdf.trim_end().ends_with("</robot>"));
        assert!(text(&camera.join("robot.toml")).contains("link = \"my_camera_frame\""));
    }

    #[test]
    fn wrong_names_and_existing_folders_are_refused_with_the_fix() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["", "My", "3d", "a-b", "../up", "a b", &"a".repeat(41)] {
            let error = new(Kind::Object, name, folder.path()).unwrap_err();
            assert!(error.to_string().contains("for example my_mug"), "{error}");
        }
        new(Kind::Policy, "mine", folder.path()).unwrap();
        let error = new(Kind::Policy, "mine", folder.path()).unwrap_err();
        assert!(error.to_string().contains("--out"), "{error}");
    }

    #[test]
    fn every_file_of_the_templates_is_embedded() {
        let layers = [
            ("room", ROOM),
            ("scene", SCENE),
            ("object", OBJECT),
            ("task", TASK),
            ("policy", POLICY),
            ("device", DEVICE),
            ("camera", CAMERA),
        ];
        let templates = root().join("client/cli/templates");
        let mut found = 0;
        for (layer, files) in layers {
            let mut folders = vec![templates.join(layer)];
            while let Some(folder) = folders.pop() {
                for entry in fs::read_dir(folder).unwrap().flatten() {
                    let path = entry.path();
                    if path.is_dir() {
                        folders.push(path);
                        continue;
                    }
                    let place = path.strip_prefix(templates.join(layer)).unwrap();
                    let is_embedded = files.iter().any(|(path, _)| Path::new(path) == place);
                    assert!(is_embedded, "{layer}/{}: add it to new.rs", place.display());
                    found += 1;
                }
            }
        }
        let embedded: usize = layers.iter().map(|(_, files)| files.len()).sum();
        assert_eq!(found, embedded);
        assert_eq!(fs::read_dir(templates).unwrap().count(), layers.len());
    }
}
