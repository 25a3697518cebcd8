//! The export formats by name, and the options that apply to each.

use clap::ValueEnum;

/// Formats of `export`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum FormatName {
    /// The HDF5 of WheelArm-Sim's recorder: 60 datasets per sample.
    WheelarmSim,
    /// WheelArm-Sim's final table of 117 columns, and folders of PNG images.
    Csv,
    /// LeRobot data set, version 3.0.
    Lerobot,
    /// robomimic HDF5 with MimicGen's additions.
    Robomimic,
    /// safetensors, a file per episode: fastest to read for training.
    Tensors,
    /// MCAP for Foxglove.
    Mcap,
    /// Bag for ROS 2, Jazzy and later: the folder LABEL with LABEL_0.mcap.
    Rosbag2,
}

/// Options of `export` that apply to a format; the command rejects the others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Capabilities {
    /// `--size`: images are scaled.
    pub scales: bool,
    /// `--action` and `--trim-idle`: it has rows of state and action.
    pub action_rows: bool,
    /// `--depth`: depth images are optional.
    pub depth: bool,
    /// `--images`: images can be stored in several ways.
    pub image_formats: bool,
    /// `--language`: columns of generated language.
    pub language: bool,
}

impl Capabilities {
    const NONE: Self = Self {
        scales: false,
        action_rows: false,
        depth: false,
        image_formats: false,
        language: false,
    };
}

impl FormatName {
    /// The options that apply to it.
    #[must_use]
    pub fn capabilities(self) -> Capabilities {
        match self {
            Self::WheelarmSim | Self::Mcap | Self::Rosbag2 => Capabilities::NONE,
            Self::Csv => Capabilities {
                action_rows: true,
                ..Capabilities::NONE
            },
            Self::Robomimic => Capabilities {
                scales: true,
                action_rows: true,
                ..Capabilities::NONE
            },
            Self::Tensors => Capabilities {
                scales: true,
                action_rows: true,
                depth: true,
                ..Capabilities::NONE
            },
            Self::Lerobot => Capabilities {
                scales: true,
                action_rows: true,
                depth: true,
                image_formats: true,
                language: true,
            },
        }
    }

    /// Its name on the command line.
    #[must_use]
    pub fn name(self) -> String {
        let value = self.to_possible_value();
        value.map_or_else(String::new, |value| value.get_name().to_owned())
    }

    /// The names of all formats, in the order of the command line.
    pub fn names() -> impl Iterator<Item = String> {
        Self::value_variants().iter().map(|format| format.name())
    }

    /// The formats to which an option applies, in words: `lerobot and tensors`.
    #[must_use]
    pub fn with(applies: impl Fn(Capabilities) -> bool) -> String {
        let formats = Self::value_variants().iter();
        let with = formats.filter(|format| applies(format.capabilities()));
        let names: Vec<String> = with.map(|format| format.name()).collect();
        match names.as_slice() {
            [] => String::new(),
            [one] => one.clone(),
            [several @ .., last] => format!("{} and {last}", several.join(", ")),
        }
    }
}
