//! Images of one camera, one frame at a time.

use hdf5::Dataset;
use hdf5::types::{IntSize, TypeDescriptor};
use ndarray::s;
use prost::Message;
use wheelarm_proto::{StreamId, v1};

use super::chunks::ChunkMap;
use super::error::ReadError;
use super::{Episode, held, place};
use crate::ids;

/// One camera of an episode.
#[derive(Debug)]
pub struct Camera {
    name: String,
    rgb: Option<Dataset>,
    depth: Option<Dataset>,
    ids: Option<Dataset>,
    maps: [Option<ChunkMap>; 3],
    millimetres: bool,
    /// Bytes of one id.
    id_bytes: usize,
    stamps: Vec<u64>,
    sequences: Vec<u64>,
    ticks: Vec<u64>,
    intrinsics: Vec<f64>,
    poses: Vec<f64>,
    /// Of a sensor: the camera, and stamp and tick of every exposure.
    sensor: Option<Sensor>,
}

#[derive(Debug)]
struct Sensor {
    camera: String,
    exposures: Vec<u64>,
    exposure_ticks: Vec<u64>,
}

/// One image.
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
    pub ids: Vec<u16>,
    /// Pinhole intrinsics, pixels.
    pub intrinsics: v1::Intrinsics,
    /// Optical frame in `house`: x y z, qx qy qz qw.
    pub pose: [f64; 7],
}

impl Episode {
    /// A camera's images.
    ///
    /// # Errors
    /// When no such camera exists.
    pub fn camera(&self, name: &str) -> Result<Camera, ReadError> {
        Camera::open(self, StreamId::camera(name).to_string())
    }

    /// Images of an image sensor: colour without depth or depth without colour,
    /// and no ids.
    ///
    /// # Errors
    /// When no such sensor exists.
    pub fn sensor(&self, name: &str) -> Result<Camera, ReadError> {
        let stream = StreamId::sensor(name).to_string();
        let camera = super::text(&*self.group(&stream)?, "camera").unwrap_or_default();
        let sensor = Sensor {
            camera,
            exposures: self.u64s(&stream, "exposure_nanos")?,
            exposure_ticks: self.u64s(&stream, "exposure_tick")?,
        };
        Ok(Camera {
            sensor: Some(sensor),
            ..Camera::open(self, stream)?
        })
    }
}

/// Refuses planes of an image that do not cover each other: three bytes of colour,
/// one depth, one id at every pixel of the same rows and columns.
fn same_size(
    episode: &Episode,
    stream: &str,
    planes: &[(&str, &Option<Dataset>)],
) -> Result<(), ReadError> {
    let mut first: Option<Vec<usize>> = None;
    for (name, data) in planes {
        let Some(data) = data else { continue };
        let shape = data.shape();
        let size = match (*name, shape.get(1..).unwrap_or_default()) {
            ("rgb", [height, width, 3]) => vec![*height, *width],
            ("depth" | "ids", [height, width]) => vec![*height, *width],
            (_, other) => other.to_vec(),
        };
        let expected = match &first {
            Some(first) => format!("{first:?} as the planes beside it"),
            None => "rows and columns".to_owned(),
        };
        if size.len() != 2 || first.as_ref().is_some_and(|first| *first != size) {
            let found = format!("images of {:?}", shape.get(1..).unwrap_or_default());
            return Err(episode.shape(&place(stream, name), found, expected));
        }
        first.get_or_insert(size);
    }
    Ok(())
}

impl Camera {
    fn open(episode: &Episode, stream: String) -> Result<Self, ReadError> {
        let column = |c: &str| episode.u64s(&stream, c);
        // A camera without a single frame has no images: their size is unknown.
        let image = |c: &str| -> Result<Option<Dataset>, ReadError> {
            let Ok(data) = episode.column(&stream, c) else {
                return Ok(None);
            };
            held(&data).map_err(|e| episode.hdf5(&place(&stream, c), e))?;
            episode.check_shape(&stream, c, &data)?;
            Ok(Some(data))
        };
        let depth = image("depth")?;
        let millimetres = depth
            .as_ref()
            .and_then(|d| d.dtype().and_then(|t| t.to_descriptor()).ok())
            == Some(TypeDescriptor::Unsigned(IntSize::U2));
        let (rgb, ids) = (image("rgb")?, image("ids")?);
        let planes = [("rgb", &rgb), ("depth", &depth), ("ids", &ids)];
        same_size(episode, &stream, &planes)?;
        let kind = ids.as_ref().and_then(|d| d.dtype().ok());
        let kind = kind.and_then(|t| t.to_descriptor().ok());
        let id_bytes = match kind {
            Some(TypeDescriptor::Unsigned(IntSize::U2)) => 2,
            _ => 1,
        };
        let map = |d: &Option<Dataset>| d.as_ref().and_then(|d| ChunkMap::new(episode.path(), d));
        let maps = [map(&rgb), map(&depth), map(&ids)];
        Ok(Self {
            maps,
            stamps: column("stamp_nanos")?,
            sequences: column("sequence")?,
            ticks: column("tick")?,
            intrinsics: episode.all(&stream, "intrinsics")?,
            poses: episode.all(&stream, "pose")?,
            rgb,
            depth,
            ids,
            millimetres,
            id_bytes,
            name: stream,
            sensor: None,
        })
    }

    /// Number of frames.
    #[must_use]
    pub fn len(&self) -> usize {
        self.stamps.len()
    }

    /// Whether the camera has no frames.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.stamps.is_empty()
    }

    /// Simulation times of the frames, nanoseconds.
    #[must_use]
    pub fn stamps(&self) -> &[u64] {
        &self.stamps
    }

    /// Width and height of the images, pixels; `None` without any.
    #[must_use]
    pub fn size(&self) -> Option<(usize, usize)> {
        match self
            .rgb
            .as_ref()
            .or(self.depth.as_ref())?
            .shape()
            .as_slice()
        {
            [_, height, width, 3] | [_, height, width] => Some((*width, *height)),
            _ => None,
        }
    }

    /// Whether the camera has colour.
    #[must_use]
    pub fn has_rgb(&self) -> bool {
        self.rgb.is_some()
    }

    /// Whether the camera has depth.
    #[must_use]
    pub fn has_depth(&self) -> bool {
        self.depth.is_some()
    }

    /// Whether the camera has instance IDs.
    #[must_use]
    pub fn has_ids(&self) -> bool {
        self.ids.is_some()
    }

    /// Of a sensor: the camera whose exact images it was made from.
    #[must_use]
    pub fn made_from(&self) -> Option<&str> {
        self.sensor.as_ref().map(|sensor| sensor.camera.as_str())
    }

    /// When the images were exposed, nanoseconds of simulation time: of a sensor
    /// before the stamps, which are arrival times.
    #[must_use]
    pub fn exposures(&self) -> &[u64] {
        match &self.sensor {
            Some(sensor) => &sensor.exposures,
            None => &self.stamps,
        }
    }

    /// Whether depth is stored as millimetres.
    #[must_use]
    pub fn millimetres(&self) -> bool {
        self.millimetres
    }

    /// Name of the stream, `camera/NAME` or `sensor/NAME`.
    #[must_use]
    pub fn stream(&self) -> &str {
        &self.name
    }

    /// The datasets `rgb`, `depth`, `ids` with their chunks, where they are
    /// stored one image to a chunk.
    #[must_use]
    pub fn image_chunks(&self) -> Vec<(&'static str, &Dataset, &ChunkMap)> {
        ["rgb", "depth", "ids"]
            .into_iter()
            .zip([&self.rgb, &self.depth, &self.ids])
            .zip(&self.maps)
            .filter_map(|((name, data), map)| Some((name, data.as_ref()?, map.as_ref()?)))
            .collect()
    }

    fn absent(&self, episode: &Episode, index: usize) -> ReadError {
        let why = hdf5::Error::Internal("no such image".into());
        episode.hdf5(&format!("{} frame {index}", self.name), why)
    }

    /// Little-endian bytes of one image of `which` (0 rgb, 1 depth, 2 ids).
    fn bytes(&self, episode: &Episode, which: usize, index: usize) -> Result<Vec<u8>, ReadError> {
        let failed = |e: hdf5::Error| episode.hdf5(&format!("{} frame {index}", self.name), e);
        if index >= self.len() {
            return Err(self.absent(episode, index));
        }
        if let Some(map) = &self.maps[which] {
            let read = map.sample(index);
            return read.map_err(|e| failed(hdf5::Error::Internal(e.to_string())));
        }
        let data = [&self.rgb, &self.depth, &self.ids][which];
        let data = data.as_ref().ok_or_else(|| {
            let plane = ["colour", "depth", "ids"][which];
            failed(hdf5::Error::Internal(format!("it has no {plane}")))
        })?;
        Ok(match (which, self.millimetres) {
            (0, _) => {
                data.read_slice::<u8, _, ndarray::Ix3>(s![index, .., .., ..])
                    .map_err(failed)?
                    .into_raw_vec_and_offset()
                    .0
            }
            (2, _) if self.id_bytes == 1 => {
                data.read_slice::<u8, _, ndarray::Ix2>(s![index, .., ..])
                    .map_err(failed)?
                    .into_raw_vec_and_offset()
                    .0
            }
            (2, _) => data
                .read_slice::<u16, _, ndarray::Ix2>(s![index, .., ..])
                .map_err(failed)?
                .iter()
                .flat_map(|v| v.to_le_bytes())
                .collect(),
            (_, true) => data
                .read_slice::<u16, _, ndarray::Ix2>(s![index, .., ..])
                .map_err(failed)?
                .iter()
                .flat_map(|v| v.to_le_bytes())
                .collect(),
            (_, false) => data
                .read_slice::<f32, _, ndarray::Ix2>(s![index, .., ..])
                .map_err(failed)?
                .iter()
                .flat_map(|v| v.to_le_bytes())
                .collect(),
        })
    }

    /// RGB8 of one image, row-major from the top left.
    ///
    /// # Errors
    /// When no such image exists or it cannot be read.
    pub fn rgb(&self, episode: &Episode, index: usize) -> Result<Vec<u8>, ReadError> {
        self.bytes(episode, 0, index)
    }

    /// Depth of one image, metres along the optical axis; +inf where nothing
    /// is hit.
    ///
    /// # Errors
    /// When no such image exists or it cannot be read.
    pub fn depth(&self, episode: &Episode, index: usize) -> Result<Vec<f32>, ReadError> {
        let bytes = self.bytes(episode, 1, index)?;
        Ok(if self.millimetres {
            let (pairs, _) = bytes.as_chunks::<2>();
            pairs
                .iter()
                .map(|&b| metres(u16::from_le_bytes(b)))
                .collect()
        } else {
            let (fours, _) = bytes.as_chunks::<4>();
            fours.iter().map(|&b| f32::from_le_bytes(b)).collect()
        })
    }

    /// Instance ids of one image, 0 where nothing is hit.
    ///
    /// # Errors
    /// When no such image exists or it cannot be read.
    pub fn ids(&self, episode: &Episode, index: usize) -> Result<Vec<u16>, ReadError> {
        let bytes = self.bytes(episode, 2, index)?;
        Ok(ids::read(&bytes, self.id_bytes))
    }

    /// Bytes of one instance id as it is stored: 2, and 1 in the first recordings.
    #[must_use]
    pub fn id_bytes(&self) -> usize {
        self.id_bytes
    }

    /// Intrinsics of one image: width, height, fx, fy, cx, cy in pixels.
    #[must_use]
    pub fn intrinsics(&self, index: usize) -> [f64; 6] {
        std::array::from_fn(|k| {
            self.intrinsics
                .get(6 * index + k)
                .copied()
                .unwrap_or(f64::NAN)
        })
    }

    /// Pose of the optical frame in `house`: x y z, qx qy qz qw.
    #[must_use]
    pub fn pose(&self, index: usize) -> [f64; 7] {
        std::array::from_fn(|k| self.poses.get(7 * index + k).copied().unwrap_or(f64::NAN))
    }

    /// Reads frame `index`.
    ///
    /// # Errors
    /// When no such frame exists or it cannot be read.
    pub fn frame(&self, episode: &Episode, index: usize) -> Result<Frame, ReadError> {
        let (width, height) = self.size().ok_or_else(|| self.absent(episode, index))?;
        let one = |list: &[u64]| list.get(index).copied().unwrap_or(0);
        let i = |k: usize| self.intrinsics.get(6 * index + k).copied().unwrap_or(0.0);
        Ok(Frame {
            stamp_nanos: one(&self.stamps),
            sequence: one(&self.sequences),
            tick: one(&self.ticks),
            width,
            height,
            rgb: self.rgb(episode, index)?,
            depth: match self.has_depth() {
                true => self.depth(episode, index)?,
                false => Vec::new(),
            },
            ids: self.ids(episode, index)?,
            intrinsics: v1::Intrinsics {
                width: width as u32,
                height: height as u32,
                fx: i(2),
                fy: i(3),
                cx: i(4),
                cy: i(5),
            },
            pose: self.pose(index),
        })
    }

    /// The original message of frame `index`, as the server encoded it; `None`
    /// when depth is stored in another format.
    ///
    /// # Errors
    /// As [`Camera::frame`].
    pub fn encoded(&self, episode: &Episode, index: usize) -> Result<Option<Vec<u8>>, ReadError> {
        if let Some(sensor) = &self.sensor {
            return self.encoded_sensor(episode, sensor, index).map(Some);
        }
        if self.millimetres || !self.has_depth() {
            return Ok(None);
        }
        let (run_id, number) = episode.run()?;
        let frame = self.frame(episode, index)?;
        let depth = frame.depth.iter().flat_map(|d| d.to_le_bytes());
        let [x, y, z, qx, qy, qz, qw] = frame.pose;
        // Messages with 8-bit ids had no formats.
        let stored = |format: v1::PixelFormat| match self.id_bytes {
            2 => format.into(),
            _ => v1::PixelFormat::Unspecified.into(),
        };
        let message = v1::CameraFrame {
            header: Some(v1::Header {
                run_id,
                episode: number,
                sequence: frame.sequence,
                stamp_nanos: frame.stamp_nanos,
                tick: frame.tick,
            }),
            camera: StreamId::parse(&self.name)
                .camera_name()
                .unwrap_or_default()
                .to_owned(),
            intrinsics: Some(frame.intrinsics),
            pose: Some(v1::Pose {
                position: Some(v1::Vector3 { x, y, z }),
                orientation: Some(v1::Quaternion {
                    x: qx,
                    y: qy,
                    z: qz,
                    w: qw,
                }),
            }),
            depth: depth.collect::<Vec<u8>>().into(),
            color: frame.rgb.into(),
            segmentation: ids::write(&frame.ids, self.id_bytes).into(),
            color_format: stored(v1::PixelFormat::Rgb8),
            depth_format: stored(v1::PixelFormat::DepthMetresF32),
            segmentation_format: stored(v1::PixelFormat::IdU16),
        };
        Ok(Some(message.encode_to_vec()))
    }
}

impl Camera {
    fn encoded_sensor(
        &self,
        episode: &Episode,
        sensor: &Sensor,
        index: usize,
    ) -> Result<Vec<u8>, ReadError> {
        let (run_id, number) = episode.run()?;
        let one = |values: &[u64]| values.get(index).copied().unwrap_or_default();
        let [width, height, fx, fy, cx, cy] = self.intrinsics(index);
        let [x, y, z, qx, qy, qz, qw] = self.pose(index);
        let unspecified = v1::PixelFormat::Unspecified;
        let plane = |there: bool, which: usize, format: v1::PixelFormat| match there {
            true => Ok((self.bytes(episode, which, index)?, format)),
            false => Ok((Vec::new(), unspecified)),
        };
        let (rgb, rgb_format) = plane(self.has_rgb(), 0, v1::PixelFormat::Rgb8)?;
        let millimetres = v1::PixelFormat::DepthMillimetresU16;
        let (depth, depth_format) = plane(self.has_depth(), 1, millimetres)?;
        let message = v1::SensorFrame {
            header: Some(v1::Header {
                run_id,
                episode: number,
                sequence: one(&self.sequences),
                stamp_nanos: one(&self.stamps),
                tick: one(&self.ticks),
            }),
            sensor: StreamId::parse(&self.name)
                .sensor_name()
                .unwrap_or_default()
                .to_owned(),
            intrinsics: Some(v1::Intrinsics {
                width: width as u32,
                height: height as u32,
                fx,
                fy,
                cx,
                cy,
            }),
            pose: Some(v1::Pose {
                position: Some(v1::Vector3 { x, y, z }),
                orientation: Some(v1::Quaternion {
                    x: qx,
                    y: qy,
                    z: qz,
                    w: qw,
                }),
            }),
            color: rgb.into(),
            depth: depth.into(),
            color_format: rgb_format.into(),
            depth_format: depth_format.into(),
            camera: sensor.camera.clone(),
            exposure_nanos: one(&sensor.exposures),
            exposure_tick: one(&sensor.exposure_ticks),
        };
        Ok(message.encode_to_vec())
    }
}

fn metres(millimetres: u16) -> f32 {
    if millimetres == 0 {
        f32::INFINITY
    } else {
        f32::from(millimetres) * 1e-3
    }
}
