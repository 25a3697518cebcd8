//! Deflates images on the GPU that rendered them, in the form that HDF5 stores. A CPU
//! core takes ten milliseconds for an image of 1280x720, a GPU a fraction of one.
//!
//! The streams are plain zlib data of the exact bytes of the image, or of its depth in
//! millimetres. The compressed bytes are not part of the contract: adapters and
//! versions may find other references.

mod layout;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use bytes::Bytes;
use parking_lot::Mutex;
use wgpu::util::DeviceExt;
use wheelarm_codec::depth::to_millimetres;
use wheelarm_codec::huffman::{Block, SYMBOLS};
use wheelarm_proto::settings::Depth;

use super::planes::Planes;
use super::ring::Ring;
use super::timing::Timing;
use layout::{ALL_BLOCKS, BLOCK, DEPTH, Layout, PIECES, Params, SEGMENT, SLOT, STREAMS, WINDOW};

/// Colour, depth in its stored form and IDs as zlib streams of their shuffled bytes;
/// `None` for a plane that the GPU did not deflate or that exceeded its room.
pub type Deflated = [Option<Bytes>; STREAMS];

/// Hash bits for which a workgroup has memory, and that memory, bytes.
const HASHES: [(u32, u32); 3] = [(13, 23_804), (12, 15_612), (11, 11_516)];
/// Number of images after which the codes are fixed.
const CODES_LAST: u64 = 4;
/// Bytes by which a stream may exceed the last one, in addition to a quarter.
const SPARE: usize = 16 << 10;
/// One in this many images is inflated again and compared, in case of driver errors.
const CHECK_INTERVAL: u64 = 512;
/// The first images are always checked: learnt codes are used from the third at the
/// latest, because two images are in flight.
const FIRST_CHECKS: u32 = 4;

/// The pipelines for deflating.
pub(super) struct Deflater {
    layout: wgpu::BindGroupLayout,
    arrange: wgpu::ComputePipeline,
    parse: wgpu::ComputePipeline,
    sum: wgpu::ComputePipeline,
    place: wgpu::ComputePipeline,
}

impl Deflater {
    /// `None` when a workgroup has too little memory.
    pub(super) fn new(device: &wgpu::Device) -> Option<Self> {
        let most = device.limits().max_compute_workgroup_storage_size;
        let (bits, _) = HASHES.into_iter().find(|(_, bytes)| *bytes <= most)?;
        let source = format!(
            "const HASH_BITS = {bits}u;\nconst SEGMENT = {SEGMENT}u;\nconst PIECES = {PIECES}u;\n\
             const SLOT = {SLOT}u;\nconst WINDOW = {WINDOW}u;\nconst BLOCK = {BLOCK}u;\n\
             const SYMBOLS = {SYMBOLS}u;\n{}",
            include_str!("deflate.wgsl")
        );
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("deflate.wgsl"),
            source: wgpu::ShaderSource::Wgsl(source.into()),
        });
        let storage = |read_only| wgpu::BufferBindingType::Storage { read_only };
        let kinds = [
            wgpu::BufferBindingType::Uniform,
            storage(true),
            storage(false),
            storage(false),
            storage(false),
            storage(true),
            storage(false),
            storage(false),
        ];
        let entries: Vec<_> = (0..)
            .zip(kinds)
            .map(|(binding, ty)| wgpu::BindGroupLayoutEntry {
                binding,
                visibility: wgpu::ShaderStages::COMPUTE,
                ty: wgpu::BindingType::Buffer {
                    ty,
                    has_dynamic_offset: false,
                    min_binding_size: None,
                },
                count: None,
            })
            .collect();
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("deflate"),
            entries: &entries,
        });
        let whole = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("deflate"),
            bind_group_layouts: &[Some(&layout)],
            ..Default::default()
        });
        let pipeline = |entry| {
            device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(entry),
                layout: Some(&whole),
                module: &module,
                entry_point: Some(entry),
                compilation_options: wgpu::PipelineCompilationOptions {
                    // All memory is written before it is read.
                    zero_initialize_workgroup_memory: false,
                    ..Default::default()
                },
                cache: None,
            })
        };
        Some(Self {
            arrange: pipeline("arrange"),
            parse: pipeline("parse"),
            sum: pipeline("sum"),
            place: pipeline("place"),
            layout,
        })
    }

    /// Deflater of a camera whose packed images are in `packed`, with depth in the
    /// given form; `None` when they are too large for this adapter.
    pub(super) fn for_camera(
        &self,
        device: &wgpu::Device,
        planes: Planes,
        depth: Depth,
        packed: &wgpu::Buffer,
    ) -> Option<CameraDeflater> {
        let layout = Layout::for_planes(planes, depth)?;
        let most = device.limits().max_storage_buffer_binding_size;
        if layout.buffers().iter().any(|&bytes| bytes > most) {
            return None;
        }
        let params = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some("deflate"),
            contents: bytemuck::bytes_of::<Params>(&layout.params),
            usage: wgpu::BufferUsages::UNIFORM,
        });
        let buffer = |size, further| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("deflate"),
                size,
                usage: wgpu::BufferUsages::STORAGE | further,
                mapped_at_creation: false,
            })
        };
        let inside = wgpu::BufferUsages::empty();
        let read = wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        let [source, slots, lengths, report, result] = layout.buffers();
        let [source, slots, lengths] = [source, slots, lengths].map(|size| buffer(size, inside));
        let [report, result] = [report, result].map(|size| buffer(size, read));
        let codes = buffer(
            (ALL_BLOCKS * BLOCK * 4) as u64,
            wgpu::BufferUsages::COPY_DST,
        );
        let all = [
            &params, packed, &source, &slots, &lengths, &codes, &report, &result,
        ];
        let entries: Vec<_> = (0..)
            .zip(all)
            .map(|(binding, buffer)| wgpu::BindGroupEntry {
                binding,
                resource: buffer.as_entire_binding(),
            })
            .collect();
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("deflate"),
            layout: &self.layout,
            entries: &entries,
        });
        let [across, down] = layout.arranging();
        let segments = layout.segments() as u32;
        Some(CameraDeflater {
            depth,
            steps: [
                ("arrange", self.arrange.clone(), [across, down]),
                ("parse", self.parse.clone(), [segments, 1]),
                ("sum", self.sum.clone(), [STREAMS as u32, 1]),
                ("place", self.place.clone(), [segments, 1]),
            ],
            ring: Ring::new("deflated", layout.bytes() as u64),
            layout,
            group,
            codes,
            report,
            result,
            learnt: Mutex::default(),
            is_wrong: AtomicBool::new(false),
        })
    }
}

/// Deflater of the images of one camera.
pub(super) struct CameraDeflater {
    depth: Depth,
    layout: Layout,
    /// Read-back buffers.
    ring: Ring,
    steps: [(&'static str, wgpu::ComputePipeline, [u32; 2]); 4],
    group: wgpu::BindGroup,
    codes: wgpu::Buffer,
    report: wgpu::Buffer,
    result: wgpu::Buffer,
    learnt: Mutex<CodeStatistics>,
    /// It has produced a wrong stream.
    is_wrong: AtomicBool,
}

/// Read-back of the streams of an image.
#[derive(Clone)]
pub(super) struct Results {
    by: Arc<CameraDeflater>,
    pub(super) buffer: wgpu::Buffer,
    /// Bytes of each stream that are copied.
    copied: [usize; STREAMS],
}

impl Results {
    /// The streams of an image, from a mapped buffer; `exact` are its planes. `None`
    /// for streams that cannot be read: the image is complete without them.
    pub(super) fn streams(self, exact: &[Bytes; STREAMS]) -> Deflated {
        let Self { by, buffer, copied } = self;
        let mapped = match buffer.get_mapped_range(..) {
            Ok(mapped) => mapped,
            Err(problem) => {
                tracing::warn!(
                    "what the graphics adapter deflated cannot be read, the processor does it \
                     from now on: {problem}"
                );
                by.is_wrong.store(true, Ordering::Relaxed);
                return Deflated::default();
            }
        };
        let streams = by.read(&mapped, copied, exact);
        drop(mapped);
        by.ring.release(buffer);
        streams
    }
}

/// Statistics of previous images.
#[derive(Default)]
struct CodeStatistics {
    images: u64,
    /// New codes that are not uploaded yet.
    codes: Option<Vec<u32>>,
    /// Codes have been uploaded.
    has_codes: bool,
    /// Images that were checked among the first ones.
    appearances: u32,
    /// Bytes of the streams of the last image.
    bytes: [Option<usize>; STREAMS],
}

impl CameraDeflater {
    /// Whether its results can be used.
    pub(super) fn works(&self) -> bool {
        !self.is_wrong.load(Ordering::Relaxed)
    }

    /// Records the commands that deflate the packed image and copy the result to the
    /// returned buffer.
    pub(super) fn deflate(
        self: &Arc<Self>,
        (device, queue): (&wgpu::Device, &wgpu::Queue),
        encoder: &mut wgpu::CommandEncoder,
        timing: &Timing,
    ) -> Results {
        let mut learnt = self.learnt.lock();
        let codes = learnt.codes.take();
        let codes = match learnt.has_codes {
            true => codes,
            false => Some(codes.unwrap_or_else(|| self.codes(|_| [0; SYMBOLS]))),
        };
        if let Some(codes) = codes {
            queue.write_buffer(&self.codes, 0, bytemuck::cast_slice(&codes));
            learnt.has_codes = true;
        }
        let copied = std::array::from_fn(|i| {
            let room = self.layout.result(i).len();
            let likely = |bytes: usize| (bytes / 4 * 5 + SPARE).next_multiple_of(4);
            learnt.bytes[i].map_or(room, |bytes| room.min(likely(bytes)))
        });
        drop(learnt);
        timing.begins(encoder, "clear");
        encoder.clear_buffer(&self.report, 0, None);
        encoder.clear_buffer(&self.result, 0, None);
        for (name, pipeline, [x, y]) in &self.steps {
            timing.begins(encoder, name);
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_bind_group(0, &self.group, &[]);
            pass.set_pipeline(pipeline);
            pass.dispatch_workgroups(*x, *y, 1);
        }
        timing.begins(encoder, "copy deflated");
        let results = self.layout.results() as u64;
        let buffer = self.ring.take(device);
        encoder.copy_buffer_to_buffer(&self.report, 0, &buffer, 0, results);
        for (i, bytes) in copied.iter().enumerate() {
            let at = self.layout.result(i).start as u64;
            let size = Some(*bytes as u64);
            encoder.copy_buffer_to_buffer(&self.result, at - results, &buffer, at, size);
        }
        Results {
            by: Arc::clone(self),
            buffer,
            copied,
        }
    }

    fn read(&self, read: &[u8], copied: [usize; STREAMS], exact: &[Bytes; STREAMS]) -> Deflated {
        let report = |word: usize| {
            let bytes = read.get(word * 4..word * 4 + 4).unwrap_or_default();
            bytes.try_into().map_or(0, u32::from_le_bytes)
        };
        let number = self.learn(report);
        if !self.works() {
            return Deflated::default();
        }
        let streams: Deflated = std::array::from_fn(|i| {
            if !self.layout.has_data(i) {
                return None;
            }
            let length = Layout::length(report(i));
            let room = read.get(self.layout.result(i))?.get(..copied[i])?;
            let bytes = room.get(..length)?;
            let mut stream = Vec::with_capacity(length + 4);
            stream.extend_from_slice(bytes);
            stream.extend(self.adler(i, report).to_be_bytes());
            Some(Bytes::from(stream))
        });
        let is_whole = (0..STREAMS).all(|i| streams[i].is_some() || !self.layout.has_data(i));
        if self.is_due(number, is_whole) {
            let wrong = (0..STREAMS).any(|i| {
                let stream = streams[i].as_ref();
                stream.is_some_and(|stream| !self.is_right(i, stream, &exact[i]))
            });
            if wrong {
                tracing::warn!(
                    "the graphics adapter deflates images wrongly; the processor does it \
                     from now on"
                );
                self.is_wrong.store(true, Ordering::Relaxed);
                return Deflated::default();
            }
        }
        streams
    }

    /// Whether a stream decompresses to `exact`.
    fn is_right(&self, i: usize, stream: &Bytes, exact: &Bytes) -> bool {
        let mut millimetres = Vec::new();
        let expected = match i == DEPTH && self.depth == Depth::Millimetres {
            true => {
                to_millimetres(exact, &mut millimetres);
                &millimetres
            }
            false => &exact[..],
        };
        let again = wheelarm_codec::inflate(stream, self.layout.element(i), expected.len());
        again.is_ok_and(|again| again == expected)
    }

    /// Whether an image is to be checked: the first ones that were deflated completely,
    /// including some with learnt codes, and later ones at intervals.
    fn is_due(&self, number: u64, is_whole: bool) -> bool {
        let mut learnt = self.learnt.lock();
        let first = is_whole && learnt.appearances < FIRST_CHECKS;
        learnt.appearances += u32::from(first);
        first || number.is_multiple_of(CHECK_INTERVAL)
    }

    /// Updates the statistics with the symbols of an image; returns its number, from
    /// zero.
    fn learn(&self, report: impl Fn(usize) -> u32) -> u64 {
        let mut learnt = self.learnt.lock();
        let number = learnt.images;
        learnt.images += 1;
        learnt.bytes = std::array::from_fn(|i| Some(Layout::length(report(i))));
        if number.is_multiple_of(CODES_LAST) {
            let counts = |block: usize| {
                let mut words = self.layout.counts(block);
                std::array::from_fn(|_| words.next().map_or(0, &report))
            };
            learnt.codes = Some(self.codes(counts));
        }
        number
    }

    /// Codes and headers of all blocks in the shader's layout.
    fn codes(&self, counts: impl Fn(usize) -> [u32; SYMBOLS]) -> Vec<u32> {
        let mut words = Vec::with_capacity(ALL_BLOCKS * BLOCK);
        for i in 0..ALL_BLOCKS {
            let block = Block::from_counts(&counts(i), self.layout.is_last(i));
            words.extend(block.codes);
            words.push(block.header_bits);
            words.extend(block.header);
        }
        words
    }

    /// Adler-32 of a stream's bytes from the sums of its segments.
    fn adler(&self, stream: usize, report: impl Fn(usize) -> u32) -> u32 {
        const BASE: u64 = 65_521;
        let (mut a, mut b) = (1, 0);
        for (at, bytes) in self.layout.sums(stream) {
            b = (b + a * bytes as u64 + u64::from(report(at + 1))) % BASE;
            a = (a + u64::from(report(at))) % BASE;
        }
        (b << 16 | a) as u32
    }
}
