//! Mount and projection of a camera. Optical frames have z forward, x right, y down.
//! Pixel (column i, row j) covers [i, i+1] x [j, j+1], its centre is (i + 0.5, j +
//! 0.5), the top left corner of the image is (0, 0).

use nalgebra::Isometry3;
use wheelarm_proto::exact;

use super::RenderError;
use super::scene::Binding;
use crate::robot::{CameraMount, RobotModel};
use crate::scene::Scene;

/// Largest width and height, pixels.
const MAX_SIDE: u32 = 8192;

/// Pinhole projection: `u = fx x / z + cx`, `v = fy y / z + cy`, pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intrinsics {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Focal length along x, pixels.
    pub fx: f64,
    /// Focal length along y, pixels.
    pub fy: f64,
    /// Principal point from the left edge, pixels.
    pub cx: f64,
    /// Principal point from the top edge, pixels.
    pub cy: f64,
}

impl Intrinsics {
    /// Principal point in the middle, square pixels, `horizontal_fov` radians wide.
    #[must_use]
    pub fn centred([width, height]: [u32; 2], horizontal_fov: f64) -> Self {
        let focal = f64::from(width) * 0.5 / exact::tan(horizontal_fov * 0.5);
        Self {
            width,
            height,
            fx: focal,
            fy: focal,
            cx: f64::from(width) * 0.5,
            cy: f64::from(height) * 0.5,
        }
    }

    /// The same lens at another size: scaled by the width; another aspect ratio crops
    /// or extends equally above and below.
    #[must_use]
    pub fn resized(&self, [width, height]: [u32; 2]) -> Self {
        let scale = f64::from(width) / f64::from(self.width);
        Self {
            width,
            height,
            fx: self.fx * scale,
            fy: self.fy * scale,
            cx: self.cx * scale,
            cy: f64::from(height) * 0.5 + (self.cy - f64::from(self.height) * 0.5) * scale,
        }
    }
}

/// A camera.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraSpec {
    /// Name, as in topics and datasets.
    pub name: String,
    /// The body that it is fixed to.
    pub binding: Binding,
    /// body_from_optical; world_from_optical for [`Binding::World`].
    pub mount: Isometry3<f64>,
    /// Lens.
    pub intrinsics: Intrinsics,
    /// Nearest and farthest depth, metres. Nearer surfaces are clipped; farther ones
    /// are rendered with depth `+inf`.
    pub range: [f64; 2],
}

impl CameraSpec {
    /// A camera of the robot at `size` pixels.
    ///
    /// # Errors
    /// When the robot lacks the link.
    pub fn on_robot(
        robot: &RobotModel,
        mount: &CameraMount,
        size: [u32; 2],
    ) -> Result<Self, RenderError> {
        let link = robot
            .links
            .iter()
            .position(|l| l.name == mount.link)
            .ok_or_else(|| RenderError::UnknownLink {
                camera: mount.name.clone(),
                link: mount.link.clone(),
            })?;
        let native = Intrinsics {
            width: mount.size[0],
            height: mount.size[1],
            fx: mount.focal[0],
            fy: mount.focal[1],
            cx: mount.principal[0],
            cy: mount.principal[1],
        };
        Ok(Self {
            name: mount.name.clone(),
            binding: Binding::Link(link),
            mount: mount.pose,
            intrinsics: native.resized(size),
            range: mount.range,
        })
    }

    /// The scene's room camera at `size` pixels, named `room`.
    #[must_use]
    pub fn room(scene: &Scene, size: [u32; 2]) -> Self {
        Self {
            name: "room".into(),
            binding: Binding::World,
            mount: scene.room_camera.pose,
            intrinsics: Intrinsics::centred(size, scene.room_camera.horizontal_fov),
            range: [0.05, 100.0],
        }
    }

    /// The default cameras of the robot in its own order, then the room camera.
    ///
    /// # Errors
    /// When the robot lacks a link.
    pub fn all(
        robot: &RobotModel,
        scene: &Scene,
        size: [u32; 2],
    ) -> Result<Vec<Self>, RenderError> {
        let mut specs = robot
            .settings
            .cameras
            .iter()
            .filter(|mount| !mount.on_request)
            .map(|mount| Self::on_robot(robot, mount, size))
            .collect::<Result<Vec<_>, _>>()?;
        specs.push(Self::room(scene, size));
        Ok(specs)
    }

    pub(super) fn check(&self) -> Result<(), RenderError> {
        let bad = |reason: String| {
            Err(RenderError::BadCamera {
                camera: self.name.clone(),
                reason,
            })
        };
        let lens = &self.intrinsics;
        if !(1..=MAX_SIDE).contains(&lens.width) || !(1..=MAX_SIDE).contains(&lens.height) {
            return bad(format!(
                "size is {}x{}, expected 1 to {MAX_SIDE} pixels each way",
                lens.width, lens.height
            ));
        }
        let positive = |x: f64| x.is_finite() && x > 0.0;
        if !positive(lens.fx) || !positive(lens.fy) {
            return bad(format!(
                "focal length is {} x {} pixels, expected positive numbers",
                lens.fx, lens.fy
            ));
        }
        if !lens.cx.is_finite() || !lens.cy.is_finite() {
            return bad(format!(
                "principal point is ({}, {}), expected finite numbers",
                lens.cx, lens.cy
            ));
        }
        let [near, far] = self.range;
        if !positive(near) || far.is_nan() || far <= near {
            return bad(format!(
                "range is {near} to {far} m, expected 0 < near < far"
            ));
        }
        let m = &self.mount;
        if !(m.translation.vector.iter().chain(m.rotation.coords.iter())).all(|x| x.is_finite()) {
            return bad("its pose is not finite".into());
        }
        Ok(())
    }
}
