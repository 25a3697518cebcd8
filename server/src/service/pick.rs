//! The body at a pixel, from IDs and depth of the newest previewed images. A click
//! refers to the image that the user saw, even when the camera has moved since.

use std::collections::VecDeque;

use nalgebra::{Isometry3, Point3};
use parking_lot::Mutex;
use wheelarm_proto::check;
use wheelarm_proto::v1;
use wheelarm_proto::v1::FailureCode;

use super::denied::Denied;
use crate::sensors::camera::{Frame, Intrinsics};

/// Stored images per camera: 3 s at 10 Hz.
const KEPT: usize = 30;
/// Largest stored width, pixels; larger images are subsampled.
const WIDTH: u32 = 640;
/// Depth where nothing is hit.
const FAR: u16 = u16::MAX;
/// Largest share of the width within which a click snaps to an object.
const SNAP: f64 = 0.25;

/// One stored image.
struct StoredImage {
    tick: u64,
    width: usize,
    height: usize,
    /// Instance ids, row by row.
    ids: Vec<u16>,
    /// Depth along the optical axis, millimetres.
    depth: Vec<u16>,
    /// Lens of the whole image.
    lens: Intrinsics,
    house_from_optical: Isometry3<f64>,
}

/// The newest images of all cameras.
pub struct Picked {
    cameras: Vec<(String, Mutex<VecDeque<StoredImage>>)>,
}

impl Picked {
    /// Of these cameras, by their index.
    #[must_use]
    pub fn for_cameras(names: &[String]) -> Self {
        let cameras = names.iter().map(|name| (name.clone(), Mutex::default()));
        Self {
            cameras: cameras.collect(),
        }
    }

    /// Stores an image and drops the oldest.
    pub fn keep(&self, frame: &Frame, tick: u64) {
        let Some((_, kept)) = self.cameras.get(frame.camera) else {
            return;
        };
        let image = StoredImage::from_frame(frame, tick);
        let mut kept = kept.lock();
        if kept.len() == KEPT {
            kept.pop_front();
        }
        kept.push_back(image);
    }

    /// The body at the pixel of `request`; `instances` is the legend of the IDs, and
    /// `graspable` names the bodies that have grasps.
    ///
    /// # Errors
    /// [`Denied`] when the camera is unknown or the image is not stored any more.
    pub fn body_at(
        &self,
        request: &v1::PickRequest,
        instances: &[v1::Instance],
        graspable: &[String],
    ) -> Result<v1::PickReply, Denied> {
        let u = check::within("u", request.u, 0.0, 1.0)?;
        let v = check::within("v", request.v, 0.0, 1.0)?;
        let snap = check::within("snap", request.snap, 0.0, SNAP)?;
        let Some((_, kept)) = self
            .cameras
            .iter()
            .find(|(name, _)| *name == request.camera)
        else {
            let names: Vec<&str> = self.cameras.iter().map(|(name, _)| name.as_str()).collect();
            let words = format!(
                "no camera named {:?}; available: {}",
                check::beginning(&request.camera),
                names.join(", ")
            );
            return Err(Denied::new(FailureCode::Invalid, words));
        };
        let kept = kept.lock();
        let image = kept.iter().rev().find(|image| image.tick == request.tick);
        let Some(image) = image else {
            let known = match (kept.front(), kept.back()) {
                (Some(first), Some(last)) => format!("{} to {}", first.tick, last.tick),
                _ => "none".to_owned(),
            };
            let words = format!(
                "the image of tick {} is not stored (stored: {known}): point at a newer one",
                request.tick
            );
            return Err(Denied::new(FailureCode::Invalid, words));
        };
        let can_be_taken = |id: u16| {
            let instance = instances.iter().find(|i| i.id == u32::from(id));
            instance.is_some_and(|i| graspable.contains(&i.name))
        };
        let Some((x, y)) = image.nearest(u, v, snap, can_be_taken) else {
            return Ok(v1::PickReply::default());
        };
        Ok(image.reply_at(x, y, instances, graspable))
    }
}

impl StoredImage {
    fn from_frame(frame: &Frame, tick: u64) -> Self {
        let lens = frame.intrinsics;
        let width = lens.width.min(WIDTH);
        let height = (u64::from(lens.height) * u64::from(width) / u64::from(lens.width.max(1)))
            .max(1) as usize;
        let (ids_of, _) = frame.ids.as_chunks::<2>();
        let (depth_of, _) = frame.depth.as_chunks::<4>();
        let width = width as usize;
        let (mut ids, mut depth) = (Vec::new(), Vec::new());
        for y in 0..height {
            for x in 0..width {
                let column = (2 * x + 1) * lens.width as usize / (2 * width);
                let row = (2 * y + 1) * lens.height as usize / (2 * height);
                let at = row * lens.width as usize + column;
                ids.push(ids_of.get(at).map_or(0, |&id| u16::from_le_bytes(id)));
                let metres = depth_of
                    .get(at)
                    .map_or(f32::INFINITY, |&z| f32::from_le_bytes(z));
                let near = metres.is_finite() && metres < f32::from(FAR) * 1e-3;
                depth.push(if near { (metres * 1e3) as u16 } else { FAR });
            }
        }
        Self {
            tick,
            width,
            height,
            ids,
            depth,
            lens,
            house_from_optical: frame.world_from_optical,
        }
    }

    /// The selected pixel: the nearest one within `snap` of the width whose body is
    /// graspable, else the given one, unless nothing is hit there.
    fn nearest(
        &self,
        u: f64,
        v: f64,
        snap: f64,
        wanted: impl Fn(u16) -> bool,
    ) -> Option<(usize, usize)> {
        let x0 = ((u * self.width as f64) as usize).min(self.width.checked_sub(1)?);
        let y0 = ((v * self.height as f64) as usize).min(self.height.checked_sub(1)?);
        let reach = (snap * self.width as f64) as usize;
        let most = *self.ids.iter().max().unwrap_or(&0);
        let known: Vec<bool> = (0..=most).map(wanted).collect();
        let mut best = None;
        for y in y0.saturating_sub(reach)..(y0 + reach + 1).min(self.height) {
            for x in x0.saturating_sub(reach)..(x0 + reach + 1).min(self.width) {
                let id = self.ids[y * self.width + x];
                let away = x.abs_diff(x0).pow(2) + y.abs_diff(y0).pow(2);
                let nearer = best.is_none_or(|(least, _)| away < least);
                if known[usize::from(id)] && away <= reach * reach && nearer {
                    best = Some((away, (x, y)));
                }
            }
        }
        let here = self.ids[y0 * self.width + x0] != 0;
        best.map(|(_, at)| at).or(here.then_some((x0, y0)))
    }

    fn reply_at(
        &self,
        x: usize,
        y: usize,
        instances: &[v1::Instance],
        graspable: &[String],
    ) -> v1::PickReply {
        let at = y * self.width + x;
        let id = self.ids[at];
        let instance = instances.iter().find(|i| i.id == u32::from(id));
        let (u, v) = (
            (x as f64 + 0.5) / self.width as f64,
            (y as f64 + 0.5) / self.height as f64,
        );
        let z = f64::from(self.depth[at]) * 1e-3;
        let lens = self.lens;
        let point = Point3::new(
            (u * f64::from(lens.width) - lens.cx) / lens.fx * z,
            (v * f64::from(lens.height) - lens.cy) / lens.fy * z,
            z,
        );
        let point = self.house_from_optical * point;
        let name = instance.map_or("", |i| i.name.as_str());
        v1::PickReply {
            header: None,
            body: name.to_owned(),
            kind: instance.map_or(0, |i| i.kind),
            graspable: graspable.iter().any(|g| g == name),
            point: (self.depth[at] != FAR).then_some(v1::Vector3 {
                x: point.x,
                y: point.y,
                z: point.z,
            }),
            u,
            v,
            bounds: self.bounds(id),
        }
    }

    /// Left, upper, right and lower edge of the visible part of an instance, 0 to 1.
    fn bounds(&self, id: u16) -> Vec<f64> {
        let mut edges: Option<[usize; 4]> = None;
        for (at, _) in self.ids.iter().enumerate().filter(|(_, i)| **i == id) {
            let (x, y) = (at % self.width, at / self.width);
            let [left, top, right, bottom] = edges.unwrap_or([x, y, x, y]);
            edges = Some([left.min(x), top.min(y), right.max(x), bottom.max(y)]);
        }
        let Some([left, top, right, bottom]) = edges else {
            return Vec::new();
        };
        let (w, h) = (self.width as f64, self.height as f64);
        vec![
            left as f64 / w,
            top as f64 / h,
            (right + 1) as f64 / w,
            (bottom + 1) as f64 / h,
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An image of 1280 x 720 with an object of 40 x 20 pixels in the middle of the
    /// left half, 2 m away, in front of a wall at 3 m.
    fn frame() -> Frame {
        let (mut ids, mut depth) = (Vec::new(), Vec::new());
        for y in 0..720_u32 {
            for x in 0..1280_u32 {
                let object = (300..340).contains(&x) && (350..370).contains(&y);
                ids.extend(if object { 7_u16 } else { 1 }.to_le_bytes());
                depth.extend(if object { 2.0_f32 } else { 3.0 }.to_le_bytes());
            }
        }
        Frame {
            camera: 0,
            intrinsics: Intrinsics {
                width: 1280,
                height: 720,
                fx: 640.0,
                fy: 640.0,
                cx: 640.0,
                cy: 360.0,
            },
            world_from_optical: Isometry3::translation(10.0, 0.0, 0.0),
            rgb: Vec::new().into(),
            depth: depth.into(),
            ids: ids.into(),
            deflated: Default::default(),
        }
    }

    fn legend() -> Vec<v1::Instance> {
        let instance = |id, name: &str| v1::Instance {
            id,
            name: name.to_owned(),
            ..Default::default()
        };
        vec![instance(1, "wall"), instance(7, "cup")]
    }

    fn ask(picked: &Picked, tick: u64, u: f64, snap: f64) -> Result<v1::PickReply, Denied> {
        let request = v1::PickRequest {
            camera: "eye".to_owned(),
            tick,
            u,
            v: 0.5,
            snap,
        };
        picked.body_at(&request, &legend(), &["cup".to_owned()])
    }

    #[test]
    fn a_click_refers_to_the_image_of_its_tick() {
        let picked = Picked::for_cameras(&["eye".to_owned()]);
        picked.keep(&frame(), 24);
        let mut later = frame();
        later.world_from_optical = Isometry3::translation(20.0, 0.0, 0.0);
        picked.keep(&later, 48);
        let old = ask(&picked, 24, 0.25, 0.0).unwrap();
        assert_eq!((old.body.as_str(), old.graspable), ("cup", true));
        let point = old.point.unwrap();
        assert!((point.x - (10.0 - 1.0)).abs() < 0.01, "{point:?}");
        assert!((point.z - 2.0).abs() < 0.002, "{point:?}");
        let new = ask(&picked, 48, 0.25, 0.0).unwrap().point.unwrap();
        assert!((new.x - 19.0).abs() < 0.01, "{new:?}");
        for edge in old.bounds.iter().zip([300.0, 350.0, 340.0, 370.0]) {
            let side = if edge.1 > 345.0 && edge.1 != 340.0 {
                720.0
            } else {
                1280.0
            };
            assert!((edge.0 - edge.1 / side).abs() < 0.003, "{:?}", old.bounds);
        }
    }

    #[test]
    fn a_click_beside_an_object_snaps_only_within_the_ring() {
        let picked = Picked::for_cameras(&["eye".to_owned()]);
        picked.keep(&frame(), 24);
        // 40 pixels of 1280 beside its edge.
        let beside = 380.0 / 1280.0;
        assert_eq!(ask(&picked, 24, beside, 0.05).unwrap().body, "cup");
        let wall = ask(&picked, 24, beside, 0.02).unwrap();
        assert_eq!((wall.body.as_str(), wall.graspable), ("wall", false));
    }

    #[test]
    fn a_dropped_image_is_refused_with_the_stored_ticks() {
        let picked = Picked::for_cameras(&["eye".to_owned()]);
        for tick in 1..=40 {
            picked.keep(&frame(), 24 * tick);
        }
        let why = ask(&picked, 24, 0.5, 0.0).unwrap_err();
        assert!(why.words.contains("264 to 960"), "{}", why.words);
        assert!(ask(&picked, 264, 0.5, 0.0).is_ok());
        assert!(ask(&picked, 264, 1.5, 0.0).is_err());
        assert!(ask(&picked, 264, f64::NAN, 0.0).is_err());
    }
}
