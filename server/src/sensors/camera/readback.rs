//! From textures to bytes: packed on the GPU and shared as they are, or copied with
//! padded rows and packed on the CPU.

use std::sync::Arc;

use bytes::{Bytes, BytesMut};
use parking_lot::Mutex;
use wheelarm_proto::settings::Depth;

use super::antialias::{self, Rendered};
use super::deflate::{Deflated, Results};
use super::geometry::Order;
use super::packing::{CameraPacker, Packer};
use super::ring::Ring;
use super::target::Target;
use super::timing::Timing;

/// Number of pixels from which the GPU deflates an image faster than the CPU can
/// request it.
const WORTH_IT: usize = 65_536;

/// Transfers the images of one camera to the CPU.
pub(super) struct ReadBack {
    ring: Ring,
    way: Way,
}

/// Buffers through which an image is read.
#[derive(Clone)]
pub(super) struct Buffers {
    planes: wgpu::Buffer,
    deflated: Option<Results>,
}

impl Buffers {
    /// Requests mapping after they are written.
    pub(super) fn map(&self) {
        let results = self.deflated.iter().map(|results| &results.buffer);
        for buffer in results.chain([&self.planes]) {
            buffer.map_async(wgpu::MapMode::Read, .., |_| {});
        }
    }
}

/// Colour, depth and IDs, exact and deflated.
pub(super) type Image = ([Bytes; 3], Deflated);

enum Way {
    Packed(Box<CameraPacker>),
    Unpacked(Layout, [f64; 2], Mutex<Memory>),
}

impl ReadBack {
    /// Uses `packer` if possible; `background` is the colour where nothing is hit.
    pub(super) fn new(
        device: &wgpu::Device,
        target: &Target,
        packer: Option<&Arc<Packer>>,
        background: wgpu::Color,
    ) -> Self {
        let for_camera = |packer: &Arc<Packer>| packer.for_camera(device, target, background);
        let packed = packer.and_then(for_camera);
        let way = match packed {
            Some(packed) => Way::Packed(Box::new(packed)),
            None => Way::Unpacked(
                Layout::from_target(target),
                target.spec.range,
                Mutex::default(),
            ),
        };
        let bytes = match &way {
            Way::Packed(packed) => packed.planes.bytes(),
            Way::Unpacked(layout, ..) => layout.bytes(),
        };
        Self {
            ring: Ring::new(&target.spec.name, bytes),
            way,
        }
    }

    /// The best order of rendering for this read-back.
    pub(super) fn order(&self) -> Order {
        match self.is_packed() {
            true => Order::Finish,
            false => Order::Depth,
        }
    }

    /// Whether it fills in the background where nothing was rendered.
    pub(super) fn has_background(&self, target: &Target) -> bool {
        self.is_packed() && !target.is_averaged()
    }

    /// Whether the CPU has nothing left to do.
    pub(super) fn is_packed(&self) -> bool {
        matches!(self.way, Way::Packed(_))
    }

    /// Whether the GPU deflates images faster than the CPU.
    pub(super) fn deflates(&self) -> bool {
        match &self.way {
            Way::Packed(packed) => packed.planes.pixels >= WORTH_IT,
            Way::Unpacked(..) => false,
        }
    }

    /// Records the copies of the rendered image to the returned buffers, and `deflated`
    /// with depth in that form, if requested and possible.
    pub(super) fn copy(
        &self,
        (device, queue): (&wgpu::Device, &wgpu::Queue),
        encoder: &mut wgpu::CommandEncoder,
        target: &Target,
        deflated: Option<Depth>,
        timing: &Timing,
    ) -> Buffers {
        let planes = self.ring.take(device);
        let mut buffers = Buffers {
            planes,
            deflated: None,
        };
        match &self.way {
            Way::Packed(packed) => {
                packed.pack(encoder, &buffers.planes, timing);
                let deflater = deflated.and_then(|depth| packed.deflater(device, depth));
                let on = (device, queue);
                buffers.deflated = deflater.map(|deflater| deflater.deflate(on, encoder, timing));
            }
            Way::Unpacked(layout, ..) => {
                timing.begins(encoder, "copy");
                layout.copy(encoder, target, &buffers.planes);
            }
        }
        buffers
    }

    /// The image in mapped buffers.
    pub(super) fn image(&self, buffers: Buffers) -> Result<Image, String> {
        let buffer = buffers.planes;
        match &self.way {
            Way::Packed(packed) => {
                let all = self.ring.lend(buffer)?;
                let planes = packed.planes.ranges().map(|range| all.slice(range));
                let deflated = buffers.deflated.map(|results| results.streams(&planes));
                Ok((planes, deflated.unwrap_or_default()))
            }
            Way::Unpacked(layout, range, memory) => {
                let mapped = buffer.get_mapped_range(..).map_err(|e| e.to_string())?;
                let planes = layout.unpack(&mapped, *range, &mut memory.lock());
                drop(mapped);
                self.ring.release(buffer);
                Ok((planes, Deflated::default()))
            }
        }
    }

    #[cfg(test)]
    pub(super) fn ring(&self) -> &Ring {
        &self.ring
    }
}

/// Bytes of the planes of one camera in its read buffer.
#[derive(Clone, Copy)]
pub(super) struct Layout {
    width: usize,
    height: usize,
    /// Bytes per row of four-byte pixels, padded for copies.
    row: usize,
    /// Bytes per row of two-byte IDs, if they have a separate plane.
    id_row: Option<usize>,
    smooth_edges: bool,
}

impl Layout {
    pub(super) fn from_target(target: &Target) -> Self {
        let padded =
            |bytes: u32| bytes.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT) as usize;
        let lens = &target.spec.intrinsics;
        Self {
            width: lens.width as usize,
            height: lens.height as usize,
            row: padded(lens.width * 4),
            id_row: target.ids.as_ref().map(|_| padded(lens.width * 2)),
            smooth_edges: target.smooth_edges,
        }
    }

    fn plane(self) -> usize {
        self.row * self.height
    }

    pub(super) fn bytes(self) -> u64 {
        (2 * self.plane() + self.id_row.unwrap_or(0) * self.height) as u64
    }

    /// Records the copies of a camera's textures to its read buffer.
    pub(super) fn copy(
        self,
        encoder: &mut wgpu::CommandEncoder,
        target: &Target,
        buffer: &wgpu::Buffer,
    ) {
        let mut plane = |texture: &wgpu::Texture, aspect, offset: usize, row: usize| {
            encoder.copy_texture_to_buffer(
                wgpu::TexelCopyTextureInfo {
                    texture,
                    mip_level: 0,
                    origin: wgpu::Origin3d::ZERO,
                    aspect,
                },
                wgpu::TexelCopyBufferInfo {
                    buffer,
                    layout: wgpu::TexelCopyBufferLayout {
                        offset: offset as u64,
                        bytes_per_row: Some(row as u32),
                        rows_per_image: Some(self.height as u32),
                    },
                },
                texture.size(),
            );
        };
        let all = wgpu::TextureAspect::All;
        plane(&target.color.texture, all, 0, self.row);
        let depth = wgpu::TextureAspect::DepthOnly;
        plane(&target.depth.texture, depth, self.plane(), self.row);
        if let (Some(ids), Some(row)) = (&target.ids, self.id_row) {
            plane(&ids.texture, all, 2 * self.plane(), row);
        }
    }

    /// Colour, depth in metres and ids from the bytes of a read buffer.
    pub(super) fn unpack(
        self,
        bytes: &[u8],
        [near, far]: [f64; 2],
        memory: &mut Memory,
    ) -> [Bytes; 3] {
        let pixels = self.width * self.height;
        let [mut rgb, mut depth, mut ids] = memory.take([pixels * 3, pixels * 4, pixels * 2]);
        let (near, far) = (near as f32, far as f32);
        let (colors, depths) = bytes.split_at(self.plane());
        for y in 0..self.height {
            let line = |width: usize| y * self.width * width..(y + 1) * self.width * width;
            let source = &colors[y * self.row..][..self.width * 4];
            let ids = &mut ids[line(2)];
            split_pixels(source, &mut rgb[line(3)], ids);
            if let Some(row) = self.id_row {
                let source = &bytes[2 * self.plane() + y * row..][..self.width * 2];
                let (source, _) = source.as_chunks::<2>();
                let (target, _) = ids.as_chunks_mut::<2>();
                for (to, from) in target.iter_mut().zip(source) {
                    *to = u16::from_ne_bytes(*from).to_le_bytes();
                }
            }
            let source = &depths[y * self.row..][..self.width * 4];
            let (source, _) = source.as_chunks::<4>();
            let (target, _) = depth[line(4)].as_chunks_mut::<4>();
            for (to, from) in target.iter_mut().zip(source) {
                // Reversed depth is near / z, 0 where nothing was rendered.
                let z = near / f32::from_ne_bytes(*from);
                *to = (if z > far { f32::INFINITY } else { z }).to_le_bytes();
            }
        }
        if self.smooth_edges {
            let rendered = Rendered {
                colors,
                depths,
                row: self.row,
                width: self.width,
                height: self.height,
            };
            antialias::smooth(rendered, &ids, &mut rgb);
        }
        memory.give([rgb, depth, ids])
    }
}

/// Splits colour and alpha, which is a 16-bit number: four pixels at a time, as three
/// words and two.
fn split_pixels(pixels: &[u8], rgb: &mut [u8], ids: &mut [u8]) {
    let (fours, rest) = pixels.as_chunks::<16>();
    let (rgb_fours, rgb_rest) = rgb.as_chunks_mut::<12>();
    let (id_fours, id_rest) = ids.as_chunks_mut::<8>();
    for ((from, rgb), ids) in fours.iter().zip(rgb_fours).zip(id_fours) {
        let all = u128::from_le_bytes(*from);
        let [a, b, c, d] = [0, 32, 64, 96].map(|shift| (all >> shift) as u32);
        let words = [
            a & 0x00ff_ffff | b << 24,
            b >> 8 & 0xffff | c << 16,
            c >> 16 & 0xff | d << 8,
        ];
        for (to, word) in rgb.as_chunks_mut::<4>().0.iter_mut().zip(words) {
            *to = word.to_le_bytes();
        }
        let pairs = [a >> 24 | b >> 24 << 16, c >> 24 | d >> 24 << 16];
        for (to, pair) in ids.as_chunks_mut::<4>().0.iter_mut().zip(pairs) {
            *to = pair.to_le_bytes();
        }
    }
    let (rest, _) = rest.as_chunks::<4>();
    let rgb_rest = rgb_rest.as_chunks_mut::<3>().0.iter_mut();
    let id_rest = id_rest.as_chunks_mut::<2>().0.iter_mut();
    for (([r, g, b, id], rgb), ids) in rest.iter().zip(rgb_rest).zip(id_rest) {
        *rgb = [*r, *g, *b];
        *ids = [*id, 0];
    }
}

/// Memory of earlier frames that is reused when no reader holds them: fresh pages cost
/// a fifth of the time to unpack an image.
#[derive(Default)]
pub(super) struct Memory {
    given: Vec<[Bytes; 3]>,
}

/// Number of stored frames: those in the transport's cache and those in flight.
const REMEMBERED: usize = 12;

impl Memory {
    fn take(&mut self, sizes: [usize; 3]) -> [BytesMut; 3] {
        let free = |frame: &[Bytes; 3]| {
            frame
                .iter()
                .zip(sizes)
                .all(|(b, size)| b.is_unique() && b.len() == size)
        };
        if let Some(i) = self.given.iter().position(free) {
            let frame = self.given.swap_remove(i).map(Bytes::try_into_mut);
            if let [Ok(a), Ok(b), Ok(c)] = frame {
                return [a, b, c];
            }
        }
        sizes.map(BytesMut::zeroed)
    }

    fn give(&mut self, frame: [BytesMut; 3]) -> [Bytes; 3] {
        let frame = frame.map(BytesMut::freeze);
        if self.given.len() == REMEMBERED {
            self.given.remove(0);
        }
        self.given.push(frame.clone());
        frame
    }
}

/// An image that is read or being read.
pub(super) enum Reading<'scope> {
    Done(ReadResult),
    UnderWay(std::thread::ScopedJoinHandle<'scope, ReadResult>),
}

pub(super) type ReadResult = Result<Image, String>;

impl Reading<'_> {
    /// The image, or why it could not be read.
    pub fn wait(self) -> ReadResult {
        match self {
            Self::Done(read) => read,
            Self::UnderWay(job) => job
                .join()
                .unwrap_or_else(|_| Err("cannot read an image".into())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_number_of_pixels_is_split() {
        for count in [1, 3, 4, 5, 8, 225] {
            let pixels: Vec<u8> = (0..count * 4).map(|i| (i * 37 + i / 7) as u8).collect();
            let (mut rgb, mut ids) = (vec![0; count * 3], vec![1; count * 2]);
            split_pixels(&pixels, &mut rgb, &mut ids);
            let all = pixels.as_chunks::<4>().0;
            let colour: Vec<u8> = all.iter().flat_map(|p| [p[0], p[1], p[2]]).collect();
            let alpha: Vec<u8> = all.iter().flat_map(|p| [p[3], 0]).collect();
            assert_eq!((rgb, ids), (colour, alpha), "{count}");
        }
    }
}
