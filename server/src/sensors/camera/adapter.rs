//! Finding a Vulkan adapter.

use std::fmt;

use super::RenderError;

/// A Vulkan adapter of this machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AdapterInfo {
    /// Name, for example `llvmpipe (LLVM 15.0.6, 256 bits)`.
    pub name: String,
    /// Driver and its version.
    pub driver: String,
    /// What kind of processor.
    pub kind: AdapterKind,
    /// `vulkan`.
    pub backend: String,
}

/// What an adapter computes with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum AdapterKind {
    /// A graphics card.
    DiscreteGpu,
    /// Graphics within the processor.
    IntegratedGpu,
    /// A part of a card that a host lends.
    VirtualGpu,
    /// Not said.
    Other,
    /// The processor itself.
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
            "{} [{kind}, {}, {}]",
            self.name, self.driver, self.backend
        )
    }
}

impl AdapterInfo {
    fn of(adapter: &wgpu::Adapter) -> Self {
        let info = adapter.get_info();
        Self {
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
        .map(|adapter| (AdapterInfo::of(&adapter), adapter))
        .collect()
}

/// All Vulkan adapters, as the loader lists them.
pub(super) fn list() -> Vec<AdapterInfo> {
    enumerate().into_iter().map(|(info, _)| info).collect()
}

/// The adapter with `wanted` in its name (any case), or the strongest kind.
pub(super) fn choose(wanted: Option<&str>) -> Result<(AdapterInfo, wgpu::Adapter), RenderError> {
    let mut found = enumerate();
    if found.is_empty() {
        return Err(RenderError::NoDriver);
    }
    let chosen = match wanted {
        Some(wanted) => {
            let lower = wanted.to_lowercase();
            found
                .iter()
                .position(|(info, _)| info.name.to_lowercase().contains(&lower))
                .ok_or_else(|| RenderError::UnknownAdapter {
                    wanted: wanted.to_owned(),
                    present: found
                        .iter()
                        .map(|(info, _)| info.to_string())
                        .collect::<Vec<_>>()
                        .join("; "),
                })?
        }
        // The first of the strongest kind.
        None => (0..found.len())
            .min_by_key(|&i| (found[i].0.kind, i))
            .unwrap_or(0),
    };
    Ok(found.swap_remove(chosen))
}
