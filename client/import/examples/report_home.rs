//! Reports on the home of a pack: `report_home PACK ASSETS ROBOT POSTURE FOLDER`.

use std::path::Path;
use std::process::ExitCode;

use wheelarm_import::home_report::{Finding, Home, RobotFacts, page, plan, text};

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    match run(&words) {
        Ok(text) => {
            println!("{text}");
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(words: &[String]) -> Result<String, Box<dyn std::error::Error>> {
    let [pack, assets, robot, posture, folder] = words else {
        return Err("usage: report_home PACK ASSETS ROBOT POSTURE FOLDER".into());
    };
    let home = Home::from_pack(&wheelarm_pack::Pack::open(Path::new(pack))?)?;
    let robot = RobotFacts::read(Path::new(assets), robot, posture.parse()?)?;
    let finding = Finding::new(&home, &robot);
    let png = plan(&home, &finding)?;
    let place = |ending: &str| Path::new(folder).join(format!("{}.{ending}", home.name));
    std::fs::write(place("png"), &png)?;
    std::fs::write(place("html"), page(&finding.report, &png)?)?;
    let json = serde_json::to_string_pretty(&finding.report)?;
    std::fs::write(place("json"), json)?;
    Ok(text(&finding.report)?)
}
