//! Imports a home: `import_home FILE.sh3d NAME FOLDER`.

use std::path::Path;
use std::process::ExitCode;

use wheelarm_import::{Options, import_file, write};

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [file, name, folder] = words.as_slice() else {
        eprintln!("usage: import_home FILE.sh3d NAME FOLDER");
        return ExitCode::from(2);
    };
    let options = Options {
        name: name.clone(),
        ..Options::default()
    };
    let imported = match import_file(Path::new(file), &options) {
        Ok(imported) => imported,
        Err(error) => {
            eprintln!("error: {error}");
            return ExitCode::FAILURE;
        }
    };
    let summary = &imported.summary;
    println!("{} {summary:#?}", imported.pack.id());
    if let Err(error) = write(&imported.pack, Path::new(folder)) {
        eprintln!("error: {error}");
        return ExitCode::FAILURE;
    }
    ExitCode::SUCCESS
}
