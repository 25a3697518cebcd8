//! Selects a Vulkan adapter by index, by PCI address, or by name, which several equal
//! GPUs share.

use std::fmt;

use super::RenderError;

/// A Vulkan adapter of this machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AdapterInfo {
    /// Index in the list, from 0.
    pub index: usize,
    /// PCI address, for example `0000:65:00.0`; empty if it has none.
    pub pci: String,
    /// Name, for example `llvmpipe (LLVM 15.0.6, 256 bits)`.
    pub name: String,
    /// Driver and its version.
    pub driver: String,
    /// Kind of processor.
    pub kind: AdapterKind,
    /// `vulkan`.
    pub backend: String,
}

/// Kind of an adapter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum AdapterKind {
    /// A dedicated GPU.
    DiscreteGpu,
    /// A GPU integrated in the CPU.
    IntegratedGpu,
    /// A virtual GPU of a host.
    VirtualGpu,
    /// Unknown.
    Other,
    /// The CPU itself.
    Cpu,
}

impl fmt::Display for AdapterInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = match self.kind {
            AdapterKind::DiscreteGpu => "GPU",
            AdapterKind::IntegratedGpu => "integrated GPU",
            AdapterKind::VirtualGpu => "virtual GPU",
            AdapterKind::Other => "other",
            AdapterKind::Cpu => "CPU",
        };
        write!(
            f,
            "{} [{kind}, {}, {}",
            self.name, self.driver, self.backend
        )?;
        match self.pci.as_str() {
            "" => f.write_str("]"),
            pci => write!(f, ", PCI {pci}]"),
        }
    }
}

impl AdapterInfo {
    fn from_adapter(index: usize, adapter: &wgpu::Adapter) -> Self {
        let info = adapter.get_info();
        Self {
            index,
            pci: info.device_pci_bus_id.to_lowercase(),
            driver: format!("{} {}", info.driver, info.driver_info)
                .trim()
                .to_owned(),
            kind: match info.device_type {
                wgpu::DeviceType::DiscreteGpu => AdapterKind::DiscreteGpu,
                wgpu::DeviceType::IntegratedGpu => AdapterKind::IntegratedGpu,
                wgpu::DeviceType::VirtualGpu => AdapterKind::VirtualGpu,
                wgpu::DeviceType::Cpu => AdapterKind::Cpu,
                wgpu::DeviceType::Other => AdapterKind::Other,
            },
            backend: info.backend.to_string(),
            name: info.name,
        }
    }
}

fn enumerate() -> Vec<(AdapterInfo, wgpu::Adapter)> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
        backends: wgpu::Backends::VULKAN,
        flags: wgpu::InstanceFlags::empty(),
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    });
    pollster::block_on(instance.enumerate_adapters(wgpu::Backends::VULKAN))
        .into_iter()
        .enumerate()
        .map(|(index, adapter)| (AdapterInfo::from_adapter(index, &adapter), adapter))
        .collect()
}

/// All Vulkan adapters, in the loader's order.
pub(super) fn list() -> Vec<AdapterInfo> {
    enumerate().into_iter().map(|(info, _)| info).collect()
}

/// The adapter that `wanted` names, or the first of the best kind.
pub(super) fn choose(wanted: Option<&str>) -> Result<(AdapterInfo, wgpu::Adapter), RenderError> {
    let mut found = enumerate();
    let infos: Vec<AdapterInfo> = found.iter().map(|(info, _)| info.clone()).collect();
    let chosen = chosen(&infos, wanted)?;
    Ok(found.swap_remove(chosen))
}

/// Index of the adapter that `wanted` names: an index, a PCI address (with or without
/// domain), or a part of a name in any case. Without it the first of the best kind.
fn chosen(found: &[AdapterInfo], wanted: Option<&str>) -> Result<usize, RenderError> {
    if found.is_empty() {
        return Err(RenderError::NoDriver);
    }
    let Some(wanted) = wanted else {
        let strongest = (0..found.len()).min_by_key(|&i| (found[i].kind, i));
        return Ok(strongest.unwrap_or_default());
    };
    let lower = wanted.trim().to_lowercase();
    let named = if !lower.is_empty() && lower.bytes().all(|c| c.is_ascii_digit()) {
        lower.parse().ok().filter(|&index| index < found.len())
    } else if is_pci(&lower) {
        let place = with_domain(&lower);
        found
            .iter()
            .position(|info| with_domain(&info.pci) == place)
    } else {
        let has = |info: &AdapterInfo| info.name.to_lowercase().contains(&lower);
        found.iter().position(has)
    };
    named.ok_or_else(|| RenderError::UnknownAdapter {
        wanted: wanted.to_owned(),
        present: found
            .iter()
            .map(|info| format!("{}: {info}", info.index))
            .collect::<Vec<_>>()
            .join("; "),
    })
}

/// Whether a text is a PCI address: `65:00.0` or `0000:65:00.0`.
fn is_pci(text: &str) -> bool {
    let hex = |part: &str, digits: std::ops::RangeInclusive<usize>| {
        digits.contains(&part.len()) && part.bytes().all(|c| c.is_ascii_hexdigit())
    };
    let Some((rest, function)) = text.rsplit_once('.') else {
        return false;
    };
    let parts: Vec<&str> = rest.split(':').collect();
    let place = match parts[..] {
        [bus, device] => hex(bus, 2..=2) && hex(device, 2..=2),
        // Some tools write the domain with eight digits.
        [domain, bus, device] => hex(domain, 4..=8) && hex(bus, 2..=2) && hex(device, 2..=2),
        _ => false,
    };
    place && hex(function, 1..=1)
}

/// A PCI address with its domain as a number.
fn with_domain(place: &str) -> (u32, &str) {
    match place.splitn(2, ':').collect::<Vec<_>>()[..] {
        [domain, rest] if domain.len() >= 4 => {
            (u32::from_str_radix(domain, 16).unwrap_or(u32::MAX), rest)
        }
        _ => (0, place),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn adapters() -> Vec<AdapterInfo> {
        let info = |index, name: &str, pci: &str, kind| AdapterInfo {
            index,
            name: name.to_owned(),
            pci: pci.to_owned(),
            driver: "driver 1".to_owned(),
            kind,
            backend: "vulkan".to_owned(),
        };
        vec![
            info(0, "llvmpipe (LLVM 15, 256 bits)", "", AdapterKind::Cpu),
            info(1, "NVIDIA H100", "0000:1b:00.0", AdapterKind::DiscreteGpu),
            info(2, "NVIDIA H100", "0001:65:00.0", AdapterKind::DiscreteGpu),
        ]
    }

    #[test]
    fn equal_gpus_are_selected_by_index_and_pci_address() {
        let all = adapters();
        for (wanted, index) in [
            (None, 1),
            (Some("2"), 2),
            (Some("0"), 0),
            (Some("0001:65:00.0"), 2),
            (Some("00000001:65:00.0"), 2),
            (Some("1B:00.0"), 1),
            (Some("h100"), 1),
            (Some("llvmpipe"), 0),
        ] {
            assert_eq!(chosen(&all, wanted).unwrap(), index, "{wanted:?}");
        }
    }

    #[test]
    fn an_unknown_adapter_is_reported_with_the_available_ones() {
        let all = adapters();
        for wanted in [
            "3",
            "65:00.0",
            "0000:ff:00.0",
            "radeon",
            "99999999999999999999",
        ] {
            let words = chosen(&all, Some(wanted)).unwrap_err().to_string();
            assert!(
                words.contains(wanted)
                    && words.contains("2: NVIDIA H100")
                    && words.contains("PCI 0001:65:00.0"),
                "{words}"
            );
        }
        assert!(matches!(chosen(&[], Some("0")), Err(RenderError::NoDriver)));
    }
}
