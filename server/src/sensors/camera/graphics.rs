//! A graphics device, its pipelines and the parts of scenes that renderers share: drivers
//! take long to start and to compile, and most of a scene stays the same.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use parking_lot::Mutex;
use wheelarm_proto::cache::Store;

use super::RenderError;
use super::adapter::{self, AdapterInfo, AdapterKind};
use super::ambient_occlusion::LastHome;
use super::driver_lock::DriverLock;
use super::mesh_cache::MeshCache;
use super::packing::{Packer, Packing};
use super::part_cache::PartCache;
use super::patterns::PatternCache;
use super::pipelines::Pipelines;
use super::tier::Tier;
use super::timing;

/// An adapter shared by renderers, opened with the first of them, and a cache of what
/// their scenes have in common. A failed device is not reused.
#[derive(Clone)]
pub struct Graphics {
    wanted: Option<String>,
    /// `None`: the default of the adapter.
    packing: Option<Packing>,
    /// For [`Renderer::spent`](super::Renderer::spent).
    timed: bool,
    kept: Arc<Mutex<CachedParts>>,
    last_home: Arc<LastHome>,
    meshes: Arc<MeshCache>,
    parts: Arc<PartCache>,
    patterns: Arc<PatternCache>,
}

impl Default for Graphics {
    fn default() -> Self {
        Self {
            wanted: None,
            packing: None,
            timed: false,
            kept: Arc::default(),
            last_home: Arc::default(),
            meshes: Arc::default(),
            parts: Arc::new(PartCache::over(Store::at(None, 0))),
            patterns: Arc::default(),
        }
    }
}

#[derive(Default)]
struct CachedParts {
    opened: Option<OpenDevice>,
    pipelines: Vec<(Tier, Arc<Pipelines>)>,
    packer: Option<Arc<Packer>>,
}

/// Parts of an opened device.
type Parts = (OpenDevice, Arc<Pipelines>, Option<Arc<Packer>>);

/// A device and the slot for its errors.
#[derive(Clone)]
pub(super) struct OpenDevice {
    pub(super) info: AdapterInfo,
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    pub(super) failure: Arc<Mutex<Option<String>>>,
    /// It has failed before.
    pub(super) broken: Arc<AtomicBool>,
}

impl fmt::Debug for Graphics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Graphics")
            .field("wanted", &self.wanted)
            .finish_non_exhaustive()
    }
}

impl Graphics {
    /// The adapter that `wanted` names: its index in the list, its PCI ID, or a part of
    /// its name; without it the best one.
    #[must_use]
    pub fn for_adapter(wanted: Option<&str>) -> Self {
        Self {
            wanted: wanted.map(str::to_owned),
            ..Self::default()
        }
    }

    /// The same with images packed on the GPU; by default a CPU adapter packs on the
    /// CPU.
    #[must_use]
    pub fn packing(self, packing: Packing) -> Self {
        Self {
            packing: Some(packing),
            ..self
        }
    }

    /// The same with timing of each part of an image, if the adapter supports it: for
    /// benchmarks.
    #[must_use]
    pub fn timed(self) -> Self {
        Self {
            timed: true,
            ..self
        }
    }

    /// The same with entries of a store on disk, for the first scene of a process.
    #[must_use]
    pub fn caching(self, store: Store) -> Self {
        Self {
            parts: Arc::new(PartCache::over(store)),
            ..self
        }
    }

    /// Opens the device for a later renderer, which waits for it. On failure the
    /// renderer tries again.
    pub fn open_ahead(&self) {
        let mut kept = self.kept.lock();
        if kept.opened.is_none() {
            kept.opened = self.open_device().ok();
        }
    }

    fn packing_on(&self, kind: AdapterKind) -> Packing {
        self.packing.unwrap_or(match kind {
            AdapterKind::Cpu => Packing::Processor,
            _ => Packing::Adapter,
        })
    }

    /// The device and the pipelines of all tests in this process, and caches of its own.
    #[cfg(test)]
    pub(super) fn for_test() -> Self {
        use std::sync::OnceLock;
        static KEPT: OnceLock<Arc<Mutex<CachedParts>>> = OnceLock::new();
        Self {
            kept: Arc::clone(KEPT.get_or_init(Arc::default)),
            ..Self::default()
        }
    }

    /// A separate device for a test.
    #[cfg(test)]
    pub(super) fn device(&self) -> Result<OpenDevice, RenderError> {
        self.open_device()
    }

    /// Ambient light of the home that was rendered last.
    pub(super) fn last_home(&self) -> &LastHome {
        &self.last_home
    }

    /// Meshes of recent scenes.
    #[must_use]
    pub fn meshes(&self) -> &MeshCache {
        &self.meshes
    }

    /// Buffers of bodies of recent scenes.
    pub(super) fn parts(&self) -> &PartCache {
        &self.parts
    }

    /// The uploaded images of the latest scene.
    pub(super) fn patterns(&self) -> &PatternCache {
        &self.patterns
    }

    /// The device, the pipelines of a tier, and the packer if the adapter packs.
    pub(super) fn open(&self, tier: Tier) -> Result<Parts, RenderError> {
        let mut kept = self.kept.lock();
        let broken = |opened: &OpenDevice| opened.broken.load(Ordering::Acquire);
        if kept.opened.as_ref().is_some_and(broken) {
            *kept = CachedParts::default();
        }
        let opened = match &kept.opened {
            Some(opened) => opened.clone(),
            None => kept.opened.insert(self.open_device()?).clone(),
        };
        let known = kept.pipelines.iter().find(|(of, _)| *of == tier);
        let pipelines = match known {
            Some((_, pipelines)) => Arc::clone(pipelines),
            None => {
                let pipelines = Arc::new(Pipelines::new(&opened.device, tier));
                kept.pipelines.push((tier, Arc::clone(&pipelines)));
                pipelines
            }
        };
        let packs = self.packing_on(opened.info.kind) == Packing::Adapter;
        let packer = packs.then(|| {
            let new = || Arc::new(Packer::new(&opened.device));
            Arc::clone(kept.packer.get_or_insert_with(new))
        });
        Ok((opened, pipelines, packer))
    }

    fn open_device(&self) -> Result<OpenDevice, RenderError> {
        open(self.wanted.as_deref(), self.timed)
    }
}

fn open(adapter: Option<&str>, timed: bool) -> Result<OpenDevice, RenderError> {
    // Held until the device is open.
    let lock = DriverLock::acquire();
    let (info, chosen) = adapter::choose(adapter)?;
    let mut features = wgpu::Features::INDIRECT_FIRST_INSTANCE & chosen.features();
    if timed {
        features |= timing::FEATURES & chosen.features();
    }
    let (device, queue) = pollster::block_on(chosen.request_device(&wgpu::DeviceDescriptor {
        required_features: features,
        required_limits: wgpu::Limits {
            max_buffer_size: chosen.limits().max_buffer_size,
            // Images beyond ten million pixels need larger bindings.
            max_storage_buffer_binding_size: chosen.limits().max_storage_buffer_binding_size,
            max_compute_workgroup_storage_size: chosen.limits().max_compute_workgroup_storage_size,
            ..Default::default()
        },
        ..Default::default()
    }))
    .map_err(|e| RenderError::Device {
        adapter: info.name.clone(),
        reason: e.to_string(),
    })?;
    drop(lock);
    let failure = Arc::new(Mutex::new(None));
    device.on_uncaptured_error(Arc::new({
        let failure = failure.clone();
        move |error: wgpu::Error| {
            let mut slot = failure.lock();
            slot.get_or_insert(error.to_string());
        }
    }));
    Ok(OpenDevice {
        info,
        device,
        queue,
        failure,
        broken: Arc::default(),
    })
}
