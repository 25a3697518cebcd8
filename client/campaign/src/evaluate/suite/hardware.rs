//! The machine that runs a suite.

use serde::{Deserialize, Serialize};

use crate::adapters;

/// A machine.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hardware {
    /// Operating system and architecture.
    pub system: String,
    /// Name of the CPU.
    pub processor: String,
    /// CPU cores that the program may use.
    pub cores: usize,
    /// Graphics adapters, as `wheelarm-server --list-adapters` lists them; empty where none was
    /// used.
    pub adapters: Vec<String>,
}

impl Hardware {
    /// This machine.
    ///
    /// # Errors
    /// When `renders` and the adapters cannot be listed.
    pub fn here(renders: bool) -> anyhow::Result<Self> {
        let listed = match renders {
            true => adapters::listed()?,
            false => String::new(),
        };
        Ok(Self {
            system: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            processor: processor().unwrap_or_else(|| "unknown".to_owned()),
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            adapters: listed.lines().map(str::to_owned).collect(),
        })
    }

    /// In one line.
    #[must_use]
    pub fn line(&self) -> String {
        let adapters = match self.adapters.is_empty() {
            true => String::new(),
            false => format!(", {}", self.adapters.join("; ")),
        };
        format!("{}, {} cores{adapters}", self.processor, self.cores)
    }
}

/// Name of the CPU; absent where the system does not publish it.
fn processor() -> Option<String> {
    let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}
