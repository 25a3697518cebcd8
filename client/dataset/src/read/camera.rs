//! Pictures of one camera, one frame at a time.

use hdf5::Dataset;
use hdf5::types::{IntSize, TypeDescriptor};
use ndarray::s;
use wheelarm_proto::v1;

use super::{Episode, ReadError, place};

/// One camera of an episode.
#[derive(Debug)]
pub struct Camera {
    name: String,
    rgb: Option<Dataset>,
    depth: Option<Dataset>,
    ids: Option<Dataset>,
    millimetres: bool,
    stamps: Vec<u64>,
    sequences: Vec<u64>,
    ticks: Vec<u64>,
    intrinsics: Vec<f64>,
    poses: Vec<f64>,
}

/// One picture.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Simulation time, nanoseconds.
    pub stamp_nanos: u64,
    /// Sequence number.
    pub sequence: u64,
    /// Physics tick.
    pub tick: u64,
    /// Width, pixels.
    pub width: usize,
    /// Height, pixels.
    pub height: usize,
    /// RGB8, row-major from the top left.
    pub rgb: Vec<u8>,
    /// Metres along the optical axis; +inf where nothing is hit.
    pub depth: Vec<f32>,
    /// Instance ids, 0 where nothing is hit.
    pub ids: Vec<u8>,
    /// Pinhole intrinsics, pixels.
    pub intrinsics: v1::Intrinsics,
    /// Optical frame in `house`: x y z, qx qy qz qw.
    pub pose: [f64; 7],
}

impl Camera {
    pub(super) fn open(episode: &Episode, name: &str) -> Result<Self, ReadError> {
        let stream = format!("camera/{name}");
        let column = |c: &str| episode.raw::<u64>(&place(&stream, c));
        // A camera without a single frame has no pictures: their size is unknown.
        let picture = |c: &str| episode.column(&stream, c).ok();
        let depth = picture("depth");
        let millimetres = depth
            .as_ref()
            .and_then(|d| d.dtype().and_then(|t| t.to_descriptor()).ok())
            == Some(TypeDescriptor::Unsigned(IntSize::U2));
        Ok(Self {
            stamps: column("stamp_nanos")?,
            sequences: column("sequence")?,
            ticks: column("tick")?,
            intrinsics: episode.raw(&place(&stream, "intrinsics"))?,
            poses: episode.raw(&place(&stream, "pose"))?,
            rgb: picture("rgb"),
            depth,
            ids: picture("ids"),
            millimetres,
            name: stream,
        })
    }

    /// Number of frames.
    #[must_use]
    pub fn len(&self) -> usize {
        self.stamps.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.stamps.is_empty()
    }

    /// Simulation times of the frames, nanoseconds.
    #[must_use]
    pub fn stamps(&self) -> &[u64] {
        &self.stamps
    }

    /// Reads frame `index`.
    ///
    /// # Errors
    /// When there is no such frame or it cannot be read.
    pub fn frame(&self, episode: &Episode, index: usize) -> Result<Frame, ReadError> {
        let failed = |e: hdf5::Error| episode.hdf5(&format!("{} frame {index}", self.name), e);
        let absent = || failed(hdf5::Error::Internal("there is no such frame".into()));
        let (Some(rgb), Some(depth), Some(ids)) = (&self.rgb, &self.depth, &self.ids) else {
            return Err(absent());
        };
        if index >= self.len() {
            return Err(absent());
        }
        let one = |list: &[u64]| list.get(index).copied().unwrap_or(0);
        let i = |k: usize| self.intrinsics.get(6 * index + k).copied().unwrap_or(0.0);
        let rgb = rgb
            .read_slice::<u8, _, ndarray::Ix3>(s![index, .., .., ..])
            .map_err(failed)?;
        let (height, width, _) = rgb.dim();
        let depth = if self.millimetres {
            let raw = depth
                .read_slice::<u16, _, ndarray::Ix2>(s![index, .., ..])
                .map_err(failed)?;
            raw.iter().map(|&mm| metres(mm)).collect()
        } else {
            depth
                .read_slice::<f32, _, ndarray::Ix2>(s![index, .., ..])
                .map_err(failed)?
                .into_raw_vec_and_offset()
                .0
        };
        let ids = ids
            .read_slice::<u8, _, ndarray::Ix2>(s![index, .., ..])
            .map_err(failed)?;
        let mut pose = [f64::NAN; 7];
        for (to, from) in pose.iter_mut().zip(self.poses.iter().skip(7 * index)) {
            *to = *from;
        }
        Ok(Frame {
            stamp_nanos: one(&self.stamps),
            sequence: one(&self.sequences),
            tick: one(&self.ticks),
            width,
            height,
            rgb: rgb.into_raw_vec_and_offset().0,
            depth,
            ids: ids.into_raw_vec_and_offset().0,
            intrinsics: v1::Intrinsics {
                width: width as u32,
                height: height as u32,
                fx: i(2),
                fy: i(3),
                cx: i(4),
                cy: i(5),
            },
            pose,
        })
    }
}

fn metres(millimetres: u16) -> f32 {
    if millimetres == 0 {
        f32::INFINITY
    } else {
        f32::from(millimetres) * 1e-3
    }
}
