//! Makes own homes: `make_home ASSETS PLAN STYLE FIRST LAST FOLDER`. Writes the pack and the plan
//! image of each layout that is ready.

use std::path::Path;
use std::process::ExitCode;

use wheelarm_import::home_places::PlaceRobot;
use wheelarm_import::home_report::{Finding, Home, Posture, RobotFacts, plan};
use wheelarm_import::layout::{self, Catalog, Order};
use wheelarm_import::write;

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    match run(&words) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(words: &[String]) -> Result<(), Box<dyn std::error::Error>> {
    let [assets, plan_name, style, first, last, folder] = words else {
        return Err("usage: make_home ASSETS PLAN STYLE FIRST LAST FOLDER".into());
    };
    let (assets, folder) = (Path::new(assets), Path::new(folder));
    let catalog = Catalog::read(assets)?;
    let read = |posture| RobotFacts::read(assets, "wheelarm", posture);
    let (drives, starts) = (read(Posture::Travel)?, read(Posture::Home)?);
    let robot = PlaceRobot {
        drives: &drives,
        starts: &starts,
    };
    for seed in first.parse()?..last.parse::<u64>()? {
        let name = format!("{plan_name}-{seed}");
        let order = Order {
            catalog: &catalog,
            plan: (plan_name, catalog.plan(plan_name)?),
            style: (style, catalog.style(style)?),
            seed,
            name: &name,
        };
        let made = match layout::make(&order, robot) {
            Ok(made) => made,
            Err(error) => {
                println!("{error}");
                continue;
            }
        };
        let found = layout::with_places(&made, robot)?;
        println!("{name}: {:?}; skipped {:?}", made.ready, found.skipped);
        let path = write(&found.pack, folder)?;
        let home = Home::from_pack(&found.pack)?;
        let png = plan(&home, &Finding::new(&home, &drives))?;
        std::fs::write(path.with_extension("png"), png)?;
    }
    Ok(())
}
