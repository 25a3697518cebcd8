//! `wheelarm home make`: own homes from plans, styles and layout seeds.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::ops::Range;
use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow};
use clap::Args;
use wheelarm_homes::home_places::PlaceRobot;
use wheelarm_homes::home_report::{Finding, Home, Posture, RobotFacts};
use wheelarm_homes::layout::{self, Catalog, CatalogError, LayoutError, Order, OwnHome};
use wheelarm_homes::own_home::{DEFAULT_STYLE, OwnHomeId};
use wheelarm_import::home_report::plan;
use wheelarm_import::write;
use wheelarm_options::choice::did_you_mean;
use wheelarm_options::packs::PackArgs;
use wheelarm_pack::Pack;
use wheelarm_proto::installed::{self, ASSETS_VARIABLE};

use crate::home_report::store;

/// Largest number of layouts of one command.
const MOST: u64 = 10_000;

/// Arguments of `wheelarm home make`.
#[derive(Args, Debug)]
pub struct MakeArgs {
    /// Plan, a file in assets/homes/plans.
    #[arg(value_name = "PLAN", required_unless_present = "list")]
    plan: Option<String>,
    /// Style, a file in assets/homes/styles; `all` takes them in turn, those that are held out
    /// for tests only with --held-out.
    #[arg(long, default_value = DEFAULT_STYLE)]
    style: String,
    /// Makes homes of plans and styles that are held out for tests. Train in none of them.
    #[arg(long)]
    held_out: bool,
    /// Seed of the layout: sizes, sides, order and small objects.
    #[arg(long, default_value_t = 0, value_name = "N")]
    layout_seed: u64,
    /// Range of seeds, for example 0..20; writes every layout that is ready.
    #[arg(long, value_name = "A..B", conflicts_with_all = ["layout_seed", "name"])]
    layout_seeds: Option<String>,
    /// Name of the pack and of its scene; by default PLAN-STYLE-N.
    #[arg(long)]
    name: Option<String>,
    /// Lists the plans and styles.
    #[arg(long)]
    list: bool,
    /// Checks the layouts and writes nothing.
    #[arg(long)]
    check: bool,
    /// Robot that must get everywhere, a folder in assets/robots.
    #[arg(long, default_value = "wheelarm")]
    robot: String,
    /// Folder of packs that receives the homes [default: the first of the folders below].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Folders of packs.
    #[command(flatten)]
    packs: PackArgs,
    /// Assets folder; by default the installed one.
    #[arg(long, env = ASSETS_VARIABLE, value_name = "DIR")]
    assets: Option<PathBuf>,
}

/// Runs `wheelarm home make` and returns its output.
///
/// # Errors
/// When a name is unknown, data is invalid, the only layout is rejected, or a pack cannot be
/// written.
pub fn run(args: &MakeArgs) -> anyhow::Result<String> {
    let assets = args.assets.clone().or_else(installed::assets);
    let assets = assets.with_context(|| {
        format!("no assets folder found; name it: export {ASSETS_VARIABLE}=…/assets")
    })?;
    let catalog = Catalog::read(&assets)?;
    let Some(plan) = args.plan.as_deref().filter(|_| !args.list) else {
        return list(&catalog);
    };
    let read = |posture| RobotFacts::read(&assets, &args.robot, posture);
    let (drives, starts) = (read(Posture::Travel)?, read(Posture::Home)?);
    let robot = PlaceRobot {
        drives: &drives,
        starts: &starts,
    };
    let folders = store(&args.packs);
    let folder = match (&args.out, folders.folders().first()) {
        (Some(out), _) => out.clone(),
        (None, Some(first)) => first.clone(),
        (None, None) => anyhow::bail!("no folder of packs is known; name one with --out"),
    };
    let seeds = match &args.layout_seeds {
        Some(text) => range(text)?,
        None => args.layout_seed..args.layout_seed.saturating_add(1),
    };
    let styles = styles(&catalog, plan, args)?;
    if styles.is_empty() {
        anyhow::bail!(
            "no style in {}/homes/styles; is the assets folder complete?",
            assets.display()
        );
    }
    let known_plan = known(catalog.plan(plan))?;
    let mut text = String::new();
    let mut results = Results::default();
    for seed in seeds {
        let style = styles[(seed % styles.len() as u64) as usize];
        let default = name_of(plan, style, seed);
        let name = args.name.as_deref().unwrap_or(&default);
        if wheelarm_proto::keys::check_name(name).is_err() {
            anyhow::bail!("invalid --name {name:?}: 1 to 64 letters, digits, `-` or `_`");
        }
        let order = Order {
            catalog: &catalog,
            plan: (plan, known_plan),
            style: (style, known(catalog.style(style))?),
            seed,
            name,
        };
        match layout::make(&order, robot) {
            Ok(home) => {
                results.add(&home);
                let ready = &home.ready;
                write!(
                    text,
                    "{name}  ready: {} of {} rooms entered, {} of {} surfaces reached",
                    ready.rooms, ready.rooms, ready.reached, ready.surfaces
                )?;
                if !args.check {
                    text.push_str(&written(&home, robot, &folder)?);
                }
                text.push('\n');
            }
            Err(LayoutError::Rejected { reason, .. }) if args.layout_seeds.is_some() => {
                *results.rejected.entry(reason.word()).or_default() += 1;
                writeln!(text, "{name}  rejected: {reason}")?;
            }
            Err(error) => return Err(error.into()),
        }
    }
    if args.layout_seeds.is_some() {
        text.push_str(&results.table(plan)?);
    } else if !args.check {
        let name = args.name.clone();
        let name = name.unwrap_or_else(|| name_of(plan, styles[0], args.layout_seed));
        let packs = match &args.out {
            Some(out) => format!(" --packs {}", out.display()),
            None => String::new(),
        };
        writeln!(
            text,
            "next: wheelarm-server{packs} --scene {name} --list-tasks"
        )?;
    }
    Ok(text)
}

fn name_of(plan: &str, style: &str, layout_seed: u64) -> String {
    OwnHomeId {
        plan: plan.to_owned(),
        style: style.to_owned(),
        layout_seed,
    }
    .to_string()
}

/// The styles to make. Those that are held out need `--held-out`, as a plan does.
fn styles<'a>(
    catalog: &'a Catalog,
    plan: &str,
    args: &'a MakeArgs,
) -> anyhow::Result<Vec<&'a str>> {
    let held_out = |what, name: &str| {
        format!(
            "the {what} {name:?} is held out for tests: add --held-out to make homes of it, and \
             train in none of them"
        )
    };
    if known(catalog.plan(plan))?.held_out && !args.held_out {
        anyhow::bail!(held_out("plan", plan));
    }
    if args.style != "all" {
        if known(catalog.style(&args.style))?.held_out && !args.held_out {
            anyhow::bail!(held_out("style", &args.style));
        }
        return Ok(vec![args.style.as_str()]);
    }
    let all = catalog.styles.iter();
    let all = all.filter(|(_, style)| args.held_out || !style.held_out);
    Ok(all.map(|(name, _)| name.as_str()).collect())
}

/// Writes a home with its places, its report and the plan image. Returns what was written.
fn written(home: &OwnHome, robot: PlaceRobot<'_>, folder: &Path) -> anyhow::Result<String> {
    let found = layout::with_places(home, robot)?;
    let places = found.pack.home().map_or(0, |home| home.place.len());
    let finding_home = Home::from_pack(&found.pack)?;
    let finding = Finding::new(&finding_home, robot.drives);
    let report = serde_json::to_string_pretty(&finding.report)?;
    let mut files = found.pack.files().clone();
    files.insert("report.json".to_owned(), format!("{report}\n").into_bytes());
    files.insert("plan.png".to_owned(), plan(&finding_home, &finding)?);
    let path = write(&Pack::from_files(files)?, folder)?;
    Ok(format!(", {places} places  {}", path.display()))
}

/// What a catalog has, or its error with the nearest name.
fn known<T>(found: Result<T, CatalogError>) -> anyhow::Result<T> {
    found.map_err(|error| match &error {
        CatalogError::Unknown { name, known, .. } => {
            anyhow!("{error}{}", did_you_mean(name, known.split(", ")))
        }
        _ => error.into(),
    })
}

/// A range `A..B`.
fn range(text: &str) -> anyhow::Result<Range<u64>> {
    let ends = text.split_once("..").and_then(|(from, until)| {
        let range = from.parse::<u64>().ok()?..until.parse::<u64>().ok()?;
        (range.start < range.end && range.end - range.start <= MOST).then_some(range)
    });
    ends.with_context(|| {
        format!(
            "invalid --layout-seeds {text:?}: two rising numbers, for example 0..20, at most {MOST}"
        )
    })
}

/// Numbers of a range of seeds.
#[derive(Debug, Default)]
struct Results {
    ready: usize,
    reached: usize,
    surfaces: usize,
    layouts: Vec<layout::Layout>,
    rejected: BTreeMap<&'static str, usize>,
}

impl Results {
    fn add(&mut self, home: &OwnHome) {
        self.ready += 1;
        self.reached += home.ready.reached;
        self.surfaces += home.ready.surfaces;
        let is_new = |known: &layout::Layout| home.layout.differs_from(known);
        if self.layouts.iter().all(is_new) {
            self.layouts.push(home.layout.clone());
        }
    }

    fn table(&self, plan: &str) -> anyhow::Result<String> {
        let rejected: usize = self.rejected.values().sum();
        let seeds = self.ready + rejected;
        let reasons: Vec<String> = self
            .rejected
            .iter()
            .map(|(word, count)| format!("{count} {word}"))
            .collect();
        let mut text = String::new();
        writeln!(text, "plan,seeds,ready,distinct,reached,surfaces,rejected")?;
        writeln!(
            text,
            "{plan},{seeds},{},{},{},{},{}",
            self.ready,
            self.layouts.len(),
            self.reached,
            self.surfaces,
            reasons.join(" ")
        )?;
        Ok(text)
    }
}

fn list(catalog: &Catalog) -> anyhow::Result<String> {
    let mut text = String::from("plans:\n");
    let held = |held_out: bool| if held_out { "  (held out)" } else { "" };
    for (name, plan) in &catalog.plans {
        let rooms = plan.room.len();
        writeln!(
            text,
            "  {name}  {rooms} rooms: {}{}",
            plan.title,
            held(plan.held_out)
        )?;
    }
    text.push_str("styles:\n");
    for (name, style) in &catalog.styles {
        writeln!(text, "  {name}  {}{}", style.title, held(style.held_out))?;
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn args(plan: &str, folder: &Path) -> MakeArgs {
        MakeArgs {
            plan: Some(plan.to_owned()),
            style: "nordic".to_owned(),
            held_out: false,
            layout_seed: 0,
            layout_seeds: None,
            name: None,
            list: false,
            check: false,
            robot: "wheelarm".to_owned(),
            out: Some(folder.to_owned()),
            packs: PackArgs::default(),
            assets: Some(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets")),
        }
    }

    #[test]
    fn unknown_plan_names_the_plans() {
        let folder = tempfile::tempdir().unwrap();
        let error = run(&args("castle", folder.path())).unwrap_err().to_string();
        assert!(
            error.contains("castle") && error.contains("studio"),
            "{error}"
        );
    }

    #[test]
    fn list_names_what_is_held_out() {
        let folder = tempfile::tempdir().unwrap();
        let mut args = args("studio", folder.path());
        args.list = true;
        let text = run(&args).unwrap();
        assert_eq!(text.matches("(held out)").count(), 4, "{text}");
    }

    #[test]
    fn held_out_plans_and_styles_are_made_on_request_only() {
        let folder = tempfile::tempdir().unwrap();
        let catalog = Catalog::read(&args("", folder.path()).assets.unwrap()).unwrap();
        let chosen = |plan: &str, style: &str, held_out| {
            let mut args = args(plan, folder.path());
            (args.style, args.held_out) = (style.to_owned(), held_out);
            let styles = styles(&catalog, plan, &args).map_err(|e| e.to_string())?;
            Ok::<_, String>(styles.join(" "))
        };
        assert_eq!(chosen("studio", "all", false).unwrap(), "country nordic");
        assert_eq!(
            chosen("loft", "all", true).unwrap(),
            "country modern nordic"
        );
        for (plan, style) in [("loft", "nordic"), ("studio", "modern")] {
            let error = chosen(plan, style, false).unwrap_err();
            assert!(error.contains("--held-out"), "{error}");
            assert_eq!(chosen(plan, style, true).unwrap(), style);
        }
    }

    #[test]
    fn range_of_seeds_is_checked() {
        assert_eq!(range("3..5").unwrap(), 3..5);
        for text in ["5..3", "a..b", "7", "0..99999999"] {
            assert!(range(text).is_err(), "{text}");
        }
    }
}
