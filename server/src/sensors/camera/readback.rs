//! From textures to bytes: copies with padded rows, unpacked on the CPU.

use bytes::{Bytes, BytesMut};

use super::target::Target;

/// Bytes of the planes of one camera in its read buffer.
#[derive(Clone, Copy)]
pub(super) struct Layout {
    width: usize,
    height: usize,
    /// Bytes per row of four-byte pixels, padded to what copies want.
    row: usize,
    /// Bytes per row of two-byte ids when they have a plane of their own.
    id_row: Option<usize>,
}

impl Layout {
    pub(super) fn of(target: &Target) -> Self {
        let padded =
            |bytes: u32| bytes.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT) as usize;
        let lens = &target.spec.intrinsics;
        Self {
            width: lens.width as usize,
            height: lens.height as usize,
            row: padded(lens.width * 4),
            id_row: target.ids.as_ref().map(|_| padded(lens.width * 2)),
        }
    }

    fn plane(self) -> usize {
        self.row * self.height
    }

    pub(super) fn bytes(self) -> u64 {
        (2 * self.plane() + self.id_row.unwrap_or(0) * self.height) as u64
    }

    /// Appends the copies of a camera's textures to its read buffer.
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
            let (source, _) = source.as_chunks::<4>();
            let (target, _) = rgb[line(3)].as_chunks_mut::<3>();
            for (to, from) in target.iter_mut().zip(source) {
                *to = [from[0], from[1], from[2]];
            }
            match self.id_row {
                None => widen(&mut ids[line(2)], source.iter().map(|pixel| pixel[3])),
                Some(row) => {
                    let source = &bytes[2 * self.plane() + y * row..][..self.width * 2];
                    let (source, _) = source.as_chunks::<2>();
                    let (target, _) = ids[line(2)].as_chunks_mut::<2>();
                    for (to, from) in target.iter_mut().zip(source) {
                        *to = u16::from_ne_bytes(*from).to_le_bytes();
                    }
                }
            }
            let source = &depths[y * self.row..][..self.width * 4];
            let (source, _) = source.as_chunks::<4>();
            let (target, _) = depth[line(4)].as_chunks_mut::<4>();
            for (to, from) in target.iter_mut().zip(source) {
                // Reversed depth is near / z, 0 where nothing was drawn.
                let z = near / f32::from_ne_bytes(*from);
                *to = (if z > far { f32::INFINITY } else { z }).to_le_bytes();
            }
        }
        memory.give([rgb, depth, ids])
    }
}

/// Ids of the alpha byte as little-endian numbers of 16 bits.
fn widen(target: &mut [u8], source: impl Iterator<Item = u8>) {
    let (pairs, _) = target.as_chunks_mut::<2>();
    for (to, id) in pairs.iter_mut().zip(source) {
        *to = [id, 0];
    }
}

/// Memory of earlier frames, used again when nobody holds them any more:
/// fresh pages cost a fifth of the time that a picture takes to unpack.
#[derive(Default)]
pub(super) struct Memory {
    given: Vec<[Bytes; 3]>,
}

/// Frames that are remembered: those that a transport keeps for latecomers, and
/// those on their way.
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
