//! The subcommands and their options.

mod annotate;
mod arguments;
mod children;
mod examples;
mod files;
mod parts;
mod process;
mod supervise;
mod video;

use std::path::{Path, PathBuf};

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use wheelarm_dataset::convert::learning::RowOptions;
use wheelarm_dataset::convert::lerobot::{ImageFormat, LeRobotOptions};
use wheelarm_dataset::convert::{FormatName, Size};
use wheelarm_dataset::finish::finish;
use wheelarm_dataset::read::Episode;
use wheelarm_dataset::{info, sheet};
use wheelarm_policy::ActionKind;

use arguments::{FINE, Files, Input, PARTIAL, idle};

/// Looks at recorded episodes, checks them, and turns them into training data.
#[derive(Parser)]
#[command(name = "wheelarm-dataset", version = wheelarm_proto::program::version())]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Prints the content of an episode file.
    Info {
        /// The episode file.
        file: PathBuf,
    },
    /// Turns the log of an interrupted recording into an episode file.
    Recover {
        /// The log, LABEL.h5.wal.
        log: PathBuf,
        /// Folder for the file; beside the log without it.
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
    },
    /// Draws a contact sheet: both cameras over time, and plots.
    Sheet {
        /// The episode file.
        file: PathBuf,
        /// The image; FILE with the ending .png without it.
        #[arg(long, value_name = "PNG")]
        out: Option<PathBuf>,
    },
    /// Brings every stream onto one camera's stamps, in a file beside the raw one.
    Align {
        #[command(flatten)]
        input: Input,
        /// Folder for the files LABEL.aligned.h5; beside each recording without it.
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
        /// Leaves the images in the recording.
        #[arg(long, alias = "no-pictures")]
        no_images: bool,
    },
    /// Labels the phases 0 to 3 from motion and compares with the operator's.
    Label {
        #[command(flatten)]
        input: Input,
        /// The table of segments; printed without it.
        #[arg(long, value_name = "CSV")]
        out: Option<PathBuf>,
    },
    /// Labels as text and boxes: a copy of each recording with the group /labels,
    /// and tables of phases and questions.
    Annotate {
        #[command(flatten)]
        input: Input,
        /// Folder for LABEL.labels.h5, subtasks.csv and questions.csv.
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
    },
    /// Exports recordings for other programs.
    Export {
        #[command(flatten)]
        input: Input,
        /// The format.
        #[arg(long, value_enum)]
        format: FormatName,
        /// Folder; for lerobot the data set's folder, for robomimic its file.
        #[arg(long, value_name = "PATH")]
        out: PathBuf,
        /// Size of images in lerobot, robomimic and tensors, for example 320x180;
        /// as recorded without it.
        #[arg(long, value_name = "WxH")]
        size: Option<Size>,
        /// What an action is, in lerobot, robomimic, tensors and csv: next-pose and
        /// next-joints are the joints at the next image, applied those at this one.
        #[arg(long, value_name = "KIND", default_value = ActionKind::default().name(),
            value_parser = str::parse::<ActionKind>)]
        action: ActionKind,
        /// Leaves out the idle rows at both ends of each episode but for so many
        /// seconds; in lerobot, robomimic, tensors and csv.
        #[arg(long, value_name = "SECONDS", value_parser = idle)]
        trim_idle: Option<f64>,
        /// How lerobot keeps images: as video by ffmpeg (WHEELARM_FFMPEG, else on
        /// PATH), or as PNG.
        #[arg(
            long = "images",
            alias = "pictures",
            value_enum,
            default_value_t,
            value_name = "HOW"
        )]
        image_format: ImageFormat,
        /// Adds to lerobot what the depth sensors gave; exact depth is never in it.
        /// LeRobot reads depth videos from 0.6 on. Adds to tensors the same, and exact
        /// depth without a sensor.
        #[arg(long)]
        depth: bool,
        /// Adds the columns language_persistent and language_events to lerobot, which
        /// LeRobot reads from 0.6 on and older versions reject.
        #[arg(long)]
        language: bool,
    },
    /// Checks recordings; exit code 3 when one has problems.
    Validate {
        #[command(flatten)]
        input: Files,
    },
    /// Prints the content of a collection, per task.
    Stats {
        #[command(flatten)]
        input: Files,
        /// Also draws it.
        #[arg(long, value_name = "PNG")]
        plot: Option<PathBuf>,
        /// Also writes the table as CSV.
        #[arg(long, value_name = "CSV")]
        csv: Option<PathBuf>,
    },
    /// Writes the training ledger of a policy that is trained on the recordings: their seeds,
    /// homes, objects and sentences.
    Ledger {
        #[command(flatten)]
        input: Files,
        /// The ledger, for example FILE.ledger.json beside the policy FILE.safetensors.
        #[arg(long, value_name = "JSON")]
        out: PathBuf,
        /// File of the policy; the ledger is then valid for this file only.
        #[arg(long, value_name = "FILE")]
        weights: Option<PathBuf>,
    },
    /// Draws LABEL.movement.png and LABEL.synchronisation.png.
    Plot {
        #[command(flatten)]
        input: Input,
        /// Folder for the images; beside each recording without it.
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
    },
    /// Makes an HTML page of each episode: playable images, depth, plots.
    View {
        #[command(flatten)]
        input: Input,
        /// Folder for the pages LABEL.html; beside each recording without it.
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
    },
    /// Makes a video, MP4 or GIF, by ffmpeg: cameras side by side with
    /// instruction, phase and time.
    Video(video::Video),
}

/// Has a command done and returns the exit code.
///
/// # Errors
/// Errors that stop the whole command; a single file's problem does not.
pub fn main(mut cli: Cli) -> anyhow::Result<u8> {
    // It reads no HDF5, and may write for long.
    let reads = !matches!(cli.command, Command::Recover { .. });
    if reads && !parts::is_one() {
        let Some(order) = supervise::work_order()? else {
            return supervise::supervised(|| cli.recordings());
        };
        if let Some(files) = cli.files() {
            files.left_out = order.left_out;
            files.jobs = if order.alone { Some(1) } else { files.jobs };
        }
    }
    if parts::is_one() {
        supervise::keep_the_journal_of_parts();
    }
    if reads {
        supervise::end_when_stuck()?;
    }
    run(cli)
}

impl Cli {
    /// Reads the command line; the help of every command has an example.
    #[must_use]
    pub fn read() -> Self {
        let matches = examples::added(Self::command()).get_matches();
        Self::from_arg_matches(&matches).unwrap_or_else(|error| error.exit())
    }

    /// The recordings that a command takes several of.
    fn files(&mut self) -> Option<&mut Files> {
        match &mut self.command {
            Command::Info { .. } | Command::Recover { .. } | Command::Sheet { .. } => None,
            Command::Video(_) => None,
            Command::Validate { input }
            | Command::Stats { input, .. }
            | Command::Ledger { input, .. } => Some(input),
            Command::Align { input, .. }
            | Command::Label { input, .. }
            | Command::Annotate { input, .. }
            | Command::Export { input, .. }
            | Command::Plot { input, .. }
            | Command::View { input, .. } => Some(&mut input.files),
        }
    }

    /// All that it reads.
    fn recordings(&mut self) -> anyhow::Result<Vec<PathBuf>> {
        if let Some(files) = self.files() {
            return files::recordings(files);
        }
        Ok(match &self.command {
            Command::Info { file } | Command::Sheet { file, .. } => vec![file.clone()],
            Command::Video(options) => vec![options.file.clone()],
            _ => Vec::new(),
        })
    }
}

fn run(cli: Cli) -> anyhow::Result<u8> {
    match cli.command {
        Command::Info { file } => {
            let episode = Episode::open(&file)?;
            print!("{}", info::info(&episode)?);
            Ok(code(episode.summary()?.complete))
        }
        Command::Recover { log, out } => recover(&log, out.as_deref()),
        Command::Sheet { file, out } => {
            let out = out.unwrap_or_else(|| file.with_extension("png"));
            files::check_image_path(&out)?;
            sheet::sheet(&Episode::open(&file)?, &out)?;
            println!("{}", out.display());
            Ok(FINE)
        }
        Command::Align {
            input,
            out,
            no_images,
        } => process::align(&input, out.as_deref(), !no_images),
        Command::Label { input, out } => process::label(&input, out.as_deref()),
        Command::Annotate { input, out } => annotate::annotate(&input, &out),
        Command::Export {
            input,
            format,
            out,
            size,
            action,
            trim_idle,
            image_format,
            depth,
            language,
        } => {
            let set = LeRobotOptions {
                size,
                rows: RowOptions { action, trim_idle },
                language,
                image_format,
                depth,
            };
            process::export(&input, format, &out, set)
        }
        Command::Validate { input } => process::validate(&input),
        Command::Stats { input, plot, csv } => {
            process::stats(&input, plot.as_deref(), csv.as_deref())
        }
        Command::Ledger {
            input,
            out,
            weights,
        } => process::ledger(&input, &out, weights.as_deref()),
        Command::Plot { input, out } => process::plot(&input, out.as_deref()),
        Command::View { input, out } => process::view(&input, out.as_deref()),
        Command::Video(options) => video::video(options),
    }
}

fn recover(log: &Path, out: Option<&Path>) -> anyhow::Result<u8> {
    let finished = finish(log, out)?;
    let account = &finished.account;
    println!(
        "{}: {} samples of {} streams",
        finished.path.display(),
        account.total(|s| s.received),
        account.streams.len()
    );
    for line in account.problems.iter().chain(&finished.notes) {
        println!("  {line}");
    }
    Ok(code(account.complete()))
}

fn code(complete: bool) -> u8 {
    if complete { FINE } else { PARTIAL }
}

#[cfg(test)]
mod tests {
    use clap::ValueEnum;
    use wheelarm_dataset::convert::Capabilities;

    use super::*;

    #[test]
    fn help_of_an_export_option_names_the_formats_to_which_it_applies() {
        let cli = Cli::command();
        let export = cli.find_subcommand("export").expect("the subcommand");
        type Applies = fn(Capabilities) -> bool;
        let optional: [(&str, Applies); 6] = [
            ("size", |format| format.scales),
            ("action", |format| format.action_rows),
            ("trim_idle", |format| format.action_rows),
            ("image_format", |format| format.image_formats),
            ("depth", |format| format.depth),
            ("language", |format| format.language),
        ];
        for argument in export.get_arguments() {
            let help = argument.get_long_help().or(argument.get_help());
            let help = help.map(ToString::to_string).unwrap_or_default();
            let words: Vec<&str> = help
                .split(|c: char| !c.is_alphanumeric() && c != '-')
                .collect();
            let named = |format: &FormatName| words.contains(&format.name().as_str());
            let id = argument.get_id().as_str();
            match optional.iter().find(|(option, _)| *option == id) {
                Some((_, applies)) => {
                    for format in FormatName::value_variants() {
                        let expected = applies(format.capabilities());
                        assert_eq!(named(format), expected, "{id} of {format:?}: {help}");
                    }
                }
                // The path differs between formats; other options apply to all of them.
                None => assert!(
                    id == "out" || !FormatName::value_variants().iter().any(named),
                    "{id} is missing in the list of this test: {help}"
                ),
            }
        }
        let known = |option: &str| export.get_arguments().any(|a| a.get_id() == option);
        assert!(optional.iter().all(|(option, _)| known(option)));
    }
}
