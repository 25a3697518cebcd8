//! Imports a home with its places: `import_home FILE.sh3d NAME FOLDER [ASSETS]`. Without the
//! assets folder the pack has no places.

use std::path::Path;
use std::process::ExitCode;

use wheelarm_homes::home_places::{self, PlaceRobot};
use wheelarm_homes::home_report::{Posture, RobotFacts};
use wheelarm_import::{Options, import_file, write};

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
    let [file, name, folder, assets @ ..] = words else {
        return Err("usage: import_home FILE.sh3d NAME FOLDER [ASSETS]".into());
    };
    let options = Options {
        name: name.clone(),
        ..Options::default()
    };
    let imported = import_file(Path::new(file), &options)?;
    println!("{:#?}", imported.summary);
    let mut pack = imported.pack;
    if let Some(assets) = assets.first() {
        let read = |posture| RobotFacts::read(Path::new(assets), "wheelarm", posture);
        let (drives, starts) = (read(Posture::Travel)?, read(Posture::Home)?);
        let robot = PlaceRobot {
            drives: &drives,
            starts: &starts,
        };
        let found = home_places::add(&pack, robot)?;
        println!(
            "{} and {} of {} surfaces reached, without a place: {:#?}",
            found.reached, found.reached_within, found.surfaces, found.skipped
        );
        pack = found.pack;
    }
    println!("{}", pack.id());
    write(&pack, Path::new(folder))?;
    Ok(())
}
