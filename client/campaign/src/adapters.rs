//! Assignment of graphics adapters to workers.

use std::process::Command;
use std::str::FromStr;

use anyhow::{Context, bail};
use wheelarm_rollout::launcher::required_program;

/// Options that select graphics adapters.
#[derive(clap::Args, Clone, Debug, Default)]
pub struct AdapterArgs {
    /// Graphics adapter by its index, its PCI id or a part of its name
    /// (`wheelarm-server --list-adapters`). Several, with commas between them, are assigned to
    /// the workers in turn; `all` is every GPU.
    #[arg(long, alias = "adapters", value_name = "INDEX|PCI-ID|NAME|all")]
    pub adapter: Option<Adapters>,
}

impl AdapterArgs {
    /// The adapter of each of `workers` workers; `None` for the server's choice.
    ///
    /// # Errors
    /// When the host's adapters cannot be listed, or it has none.
    pub fn of_workers(&self, workers: usize) -> anyhow::Result<Vec<Option<String>>> {
        match &self.adapter {
            Some(adapters) => adapters.spread(workers, listed),
            None => Ok(vec![None; workers]),
        }
    }

    /// The adapter of a program that runs alone; `None` for the server's choice.
    #[must_use]
    pub fn first(&self) -> Option<String> {
        match &self.adapter {
            Some(Adapters::These(names)) => names.first().cloned(),
            Some(Adapters::All) | None => None,
        }
    }

    /// Of one worker.
    #[must_use]
    pub fn only(adapter: Option<String>) -> Self {
        let these = |name| Adapters::These(vec![name]);
        Self {
            adapter: adapter.map(these),
        }
    }
}

/// A value of `--adapter`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Adapters {
    /// Every GPU of the host.
    All,
    /// These, by index, PCI id or a part of the name.
    These(Vec<String>),
}

impl FromStr for Adapters {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text.trim() == "all" {
            return Ok(Self::All);
        }
        let names: Vec<String> = text.split(',').map(|name| name.trim().to_owned()).collect();
        if names.iter().any(String::is_empty) {
            return Err(format!(
                "{text:?} is neither `all` nor indices, PCI ids or names separated by commas, for example 0,1"
            ));
        }
        Ok(Self::These(names))
    }
}

impl Adapters {
    /// The adapter of each of `workers` workers, in turn. `listed` gives the lines of
    /// `wheelarm-server --list-adapters`.
    ///
    /// # Errors
    /// When the host's adapters cannot be listed, or it has none.
    fn spread(
        &self,
        workers: usize,
        listed: impl FnOnce() -> anyhow::Result<String>,
    ) -> anyhow::Result<Vec<Option<String>>> {
        let names = match self {
            Self::These(names) => names.clone(),
            Self::All => gpus(&listed()?),
        };
        if names.is_empty() {
            bail!("this host has no graphics adapter; see wheelarm-server --list-adapters");
        }
        let in_turn = names.iter().cycle().take(workers);
        Ok(in_turn.map(|name| Some(name.clone())).collect())
    }
}

/// Indices of the GPUs among the lines of `--list-adapters`; without a GPU, of the first
/// adapter.
fn gpus(listed: &str) -> Vec<String> {
    let all: Vec<(&str, &str)> = listed
        .lines()
        .filter_map(|line| line.split_once(": "))
        .filter(|(index, _)| index.bytes().all(|c| c.is_ascii_digit()))
        .collect();
    let of = |kind: &str| -> Vec<String> {
        let lines = all.iter().filter(|(_, words)| words.contains(kind));
        lines.map(|(index, _)| (*index).to_owned()).collect()
    };
    let gpus = of("[GPU, ");
    match gpus.is_empty() {
        false => gpus,
        true => all
            .iter()
            .take(1)
            .map(|(index, _)| (*index).to_owned())
            .collect(),
    }
}

/// The output of `wheelarm-server --list-adapters`.
///
/// # Errors
/// When the program does not exist or lists no adapter, with its message.
pub fn listed() -> anyhow::Result<String> {
    let program = required_program("wheelarm-server")?;
    let output = Command::new(program).arg("--list-adapters").output();
    let output = output.context("starting wheelarm-server --list-adapters")?;
    if !output.status.success() {
        bail!("{}", String::from_utf8_lossy(&output.stderr).trim());
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    const LISTED: &str = "0: llvmpipe (LLVM 15.0.6, 256 bits) [CPU, llvmpipe Mesa 22, vulkan]\n\
        1: NVIDIA H100 [GPU, NVIDIA 570, vulkan, PCI 0000:1b:00.0]\n\
        2: NVIDIA H100 [GPU, NVIDIA 570, vulkan, PCI 0000:65:00.0]\n";

    #[test]
    fn workers_use_the_gpus_in_turn() {
        let names = |adapters: &str, workers| -> Vec<String> {
            let adapters: Adapters = adapters.parse().unwrap();
            let spread = adapters.spread(workers, || Ok(LISTED.to_owned())).unwrap();
            spread.into_iter().flatten().collect()
        };
        assert_eq!(names("all", 5), ["1", "2", "1", "2", "1"]);
        assert_eq!(names("2, 0", 3), ["2", "0", "2"]);
        assert_eq!(names("0000:65:00.0", 2), ["0000:65:00.0", "0000:65:00.0"]);
    }

    #[test]
    fn without_gpu_the_cpu_renders_and_without_adapter_it_fails() {
        let cpu = "0: llvmpipe (LLVM 15) [CPU, llvmpipe Mesa, vulkan]\n";
        let spread = Adapters::All.spread(2, || Ok(cpu.to_owned())).unwrap();
        assert_eq!(spread, [Some("0".to_owned()), Some("0".to_owned())]);
        let none = Adapters::All.spread(2, || Ok(String::new())).unwrap_err();
        assert!(none.to_string().contains("--list-adapters"), "{none}");
    }

    #[test]
    fn malformed_list_is_rejected() {
        for text in ["", "0,", ",1"] {
            let words = Adapters::from_str(text).unwrap_err();
            assert!(words.contains("for example 0,1"), "{words}");
        }
    }
}
