//! `wheelarm home report`: what a robot reaches in the home of a pack.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::Args;
use wheelarm_import::home_report::{Finding, Home, Posture, RobotFacts, page, plan, text};
use wheelarm_options::choice::did_you_mean;
use wheelarm_options::packs::PackArgs;
use wheelarm_pack::{Pack, Store};
use wheelarm_proto::installed::{self, ASSETS_VARIABLE};

/// Posture in which the scripted operator drives far; the default of reports and imports.
pub(crate) const DRIVING_POSTURE: &str = "travel";

/// Arguments of `wheelarm home report`.
#[derive(Args, Debug)]
pub struct ReportArgs {
    /// Name of a home in the folders of packs, or the folder or zip file of a pack.
    #[arg(value_name = "NAME|PACK")]
    home: String,
    /// Robot, a folder in assets/robots.
    #[arg(long, default_value = "wheelarm")]
    robot: String,
    /// Posture of the arm while the chair drives: travel or home.
    #[arg(long, default_value = DRIVING_POSTURE)]
    posture: Posture,
    /// Prints the report as JSON.
    #[arg(long)]
    json: bool,
    /// Writes report.json, report.html, report.txt and plan.png into this folder.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Folders of packs.
    #[command(flatten)]
    packs: PackArgs,
    /// Assets folder; by default the installed one.
    #[arg(long, env = ASSETS_VARIABLE, value_name = "DIR")]
    assets: Option<PathBuf>,
}

/// The packs of the folders, as servers search them.
pub(crate) fn store(packs: &PackArgs) -> Store {
    Store::search(&packs.packs, &installed::assets().unwrap_or_default())
}

/// Runs `wheelarm home report` and returns its output.
///
/// # Errors
/// When the pack or the robot cannot be read, or a file cannot be written. A home that the
/// chair cannot enter is not an error.
pub fn run(args: &ReportArgs) -> anyhow::Result<String> {
    let assets = args.assets.clone().or_else(installed::assets);
    let assets = assets.with_context(|| {
        format!("no assets folder found; name it: export {ASSETS_VARIABLE}=…/assets")
    })?;
    let home = Home::from_pack(&open(&args.home, &store(&args.packs))?)?;
    let robot = RobotFacts::read(&assets, &args.robot, args.posture)?;
    let finding = Finding::new(&home, &robot);
    let words = text(&finding.report)?;
    let json = format!("{}\n", serde_json::to_string_pretty(&finding.report)?);
    let mut output = match args.json {
        true => json.clone(),
        false => words.clone(),
    };
    if let Some(folder) = &args.out {
        std::fs::create_dir_all(folder)
            .with_context(|| format!("cannot make the folder {}", folder.display()))?;
        let png = plan(&home, &finding)?;
        let html = page(&finding.report, &png)?;
        let files: [(&str, &[u8]); 4] = [
            ("report.json", json.as_bytes()),
            ("report.html", html.as_bytes()),
            ("report.txt", words.as_bytes()),
            ("plan.png", &png),
        ];
        for (name, bytes) in files {
            let path = folder.join(name);
            std::fs::write(&path, bytes)
                .with_context(|| format!("cannot write {}", path.display()))?;
        }
        if !args.json {
            writeln!(
                output,
                "\nwritten: {}",
                folder.join("report.html").display()
            )?;
        }
    }
    Ok(output)
}

/// The pack of this name in the folders, or at this path.
fn open(home: &str, store: &Store) -> anyhow::Result<Pack> {
    let path = Path::new(home);
    if path.exists() {
        return Ok(Pack::open(path)?);
    }
    let pack = store.open(home)?;
    pack.with_context(|| {
        let names: Vec<String> = store.names().into_iter().collect();
        let folders = store.folders().iter();
        let folders: Vec<String> = folders.map(|f| f.display().to_string()).collect();
        format!(
            "no pack {home:?} in {}; available: {}; name a folder with --packs, or import a home with `wheelarm home import FILE.sh3d`{}",
            folders.join(", "),
            match names.is_empty() {
                true => "none".to_owned(),
                false => names.join(", "),
            },
            did_you_mean(home, names.iter().map(String::as_str))
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_home_names_folders_and_the_next_step() {
        let folder = tempfile::tempdir().unwrap();
        let error = open("nowhere", &Store::new(vec![folder.path().to_owned()])).unwrap_err();
        let words = error.to_string();
        assert!(words.contains("nowhere"), "{words}");
        assert!(words.contains("wheelarm home import"), "{words}");
    }

    #[test]
    fn report_of_a_pack_is_printed_and_written() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let folder = tempfile::tempdir().unwrap();
        let mut args = ReportArgs {
            home: root.join("tests/data/flat").display().to_string(),
            robot: "wheelarm".to_owned(),
            posture: Posture::Travel,
            json: false,
            out: Some(folder.path().join("out")),
            packs: PackArgs::default(),
            assets: Some(root.join("assets")),
        };
        let text = run(&args).unwrap();
        assert!(
            text.contains("rooms") && text.contains("surfaces"),
            "{text}"
        );
        assert!(text.contains("report.html"), "{text}");
        for name in ["report.json", "report.html", "report.txt", "plan.png"] {
            let bytes = std::fs::read(folder.path().join("out").join(name)).unwrap();
            assert!(bytes.len() > 100, "{name}");
        }
        args.json = true;
        let json: serde_json::Value = serde_json::from_str(&run(&args).unwrap()).unwrap();
        assert_eq!(json["robot"]["posture"], "travel");
    }
}
