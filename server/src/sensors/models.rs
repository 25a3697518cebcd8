//! The sensor models of a scenario: parameter files and cameras.

use std::collections::BTreeSet;
use std::path::Path;

use nalgebra::Translation3;
use wheelarm_sensor_models::depth::DepthParameters;
use wheelarm_sensor_models::model::FOLDER;
use wheelarm_sensor_models::{BadParameter, Model, Surface, Surfaces, surface};

use super::camera::{CameraSpec, Intrinsics, RenderScene};
use crate::scene::{self, SceneError};

/// A sensor model of a scenario.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorSetting {
    /// File below assets/sensors, without `.toml`.
    pub model: String,
    /// Camera whose images it uses; empty for a model without camera.
    pub camera: String,
    /// Seed of its noise; `None`: the scenario's.
    pub seed: Option<u64>,
    /// 0 to [`MAX_STRENGTH`](wheelarm_sensor_models::model::MAX_STRENGTH).
    pub strength: f64,
}

/// A sensor model with its parameters.
#[derive(Clone, Debug)]
pub struct Device {
    /// Camera whose images it uses; empty for a model without camera.
    pub camera: String,
    /// Seed of its noise.
    pub seed: u64,
    /// 0 is perfect, 1 is as in the file.
    pub strength: f64,
    /// Its parameters.
    pub model: Model,
}

/// Errors of the sensor models of a scenario.
#[derive(Debug, thiserror::Error)]
pub enum SensorError {
    /// Unreadable file.
    #[error(transparent)]
    File(#[from] SceneError),
    /// Invalid content.
    #[error(transparent)]
    Parameter(Box<BadParameter>),
    /// Unknown model.
    #[error("unknown sensor model {model:?}; available: {known}")]
    Unknown {
        /// The model.
        model: String,
        /// Available models.
        known: String,
    },
    /// Unknown camera.
    #[error(
        "the sensor model {model:?} uses images of the unknown camera {camera:?}; available: {known}"
    )]
    Camera {
        /// The model.
        model: String,
        /// The camera.
        camera: String,
        /// Available cameras.
        known: String,
    },
    /// A camera for a model without one.
    #[error(
        "the sensor model {model:?} uses no images, but its `camera` is {camera:?}; leave it out"
    )]
    NoCamera {
        /// The model.
        model: String,
        /// The camera.
        camera: String,
    },
    /// Two models with the same output.
    #[error("two sensor models make {stream:?}; leave one out")]
    Twice {
        /// Output of both.
        stream: String,
    },
}

impl From<BadParameter> for SensorError {
    fn from(problem: BadParameter) -> Self {
        Self::Parameter(Box::new(problem))
    }
}

/// The files of the settings, below the assets folder.
#[must_use]
pub fn files(settings: &[SensorSetting]) -> Vec<String> {
    let mut all: BTreeSet<_> = settings
        .iter()
        .map(|setting| format!("{FOLDER}/{}.toml", setting.model))
        .collect();
    if !all.is_empty() {
        all.insert(surface::FILE.to_owned());
    }
    all.into_iter().collect()
}

/// Reads the parameters of all settings. `cameras` are the available ones, `seed` is
/// the scenario's.
///
/// # Errors
/// [`SensorError`] that names the file or the setting and the fix.
pub fn load(
    assets: &Path,
    settings: &[SensorSetting],
    cameras: &[&str],
    seed: u64,
) -> Result<Vec<Device>, SensorError> {
    let mut made = BTreeSet::new();
    let mut devices = Vec::new();
    for setting in settings {
        let (model, camera) = (setting.model.clone(), setting.camera.clone());
        let file = format!("{FOLDER}/{model}.toml");
        let known = names(assets);
        if !known.is_empty() && !known.contains(&model) {
            let known = known.into_iter().collect::<Vec<_>>().join(", ");
            return Err(SensorError::Unknown { model, known });
        }
        let text = scene::texts(assets, std::slice::from_ref(&file))?;
        let parameters = Model::read(&file, text.first().map_or("", |t| &t.text))?;
        let is_known = cameras.contains(&camera.as_str());
        match parameters.uses_images() {
            true if !is_known => {
                let known = cameras.join(", ");
                return Err(SensorError::Camera {
                    model,
                    camera,
                    known,
                });
            }
            false if !camera.is_empty() => return Err(SensorError::NoCamera { model, camera }),
            _ => {}
        }
        for stream in made_by(&parameters, &camera) {
            if !made.insert(stream.clone()) {
                return Err(SensorError::Twice { stream });
            }
        }
        devices.push(Device {
            camera,
            seed: setting.seed.unwrap_or(seed),
            strength: setting.strength,
            model: parameters,
        });
    }
    Ok(devices)
}

/// Names of the available models; none when the folder cannot be read.
fn names(assets: &Path) -> BTreeSet<String> {
    let entries = std::fs::read_dir(assets.join(FOLDER));
    let files = entries.into_iter().flatten().flatten();
    let stems = files.filter_map(|file| {
        let name = file.file_name().into_string().ok()?;
        name.strip_suffix(".toml").map(str::to_owned)
    });
    stems
        .filter(|stem| surface::FILE != format!("{FOLDER}/{stem}.toml"))
        .collect()
}

/// Name of the colour sensor on a camera.
#[must_use]
pub fn color_name(camera: &str) -> String {
    format!("{camera}_color")
}

/// Name of the depth sensor on a camera.
#[must_use]
pub fn depth_name(camera: &str) -> String {
    format!("{camera}_depth")
}

/// The view of a depth sensor on a camera: its own lens at its own mount. Depth is
/// exact from the camera's near plane to the sensor's range.
#[must_use]
pub fn depth_view(camera: &CameraSpec, depth: &DepthParameters) -> CameraSpec {
    let [x, y, z] = depth.offset;
    let lens = &depth.lens;
    CameraSpec {
        name: depth_name(&camera.name),
        mount: camera.mount * Translation3::new(x, y, z),
        intrinsics: Intrinsics {
            width: lens.width as u32,
            height: lens.height as u32,
            fx: lens.focal[0],
            fy: lens.focal[1],
            cx: lens.principal[0],
            cy: lens.principal[1],
        },
        range: [camera.range[0], depth.range[1].max(2.0 * camera.range[0])],
        binding: camera.binding,
    }
}

/// Outputs of a model.
fn made_by(model: &Model, camera: &str) -> Vec<String> {
    let all = [
        (model.color.is_some(), color_name(camera)),
        (model.depth.is_some(), depth_name(camera)),
        (model.imu.is_some(), "sensed_imu".to_owned()),
        (model.scanner.is_some(), "sensed_scan".to_owned()),
        (model.odometry.is_some(), "sensed_odometry".to_owned()),
        (model.encoders.is_some(), "sensed_joint".to_owned()),
        (model.command.is_some(), "the delay of commands".to_owned()),
    ];
    let made = all.into_iter().filter(|(has, _)| *has);
    made.map(|(_, name)| name).collect()
}

/// The class of each instance ID: that of the material with the largest visible area.
///
/// # Errors
/// When the table of materials cannot be read.
pub fn surfaces(assets: &Path, scene: &RenderScene) -> Result<Vec<Surface>, SensorError> {
    let file = surface::FILE.to_owned();
    let text = scene::texts(assets, std::slice::from_ref(&file))?;
    let table = Surfaces::read(text.first().map_or("", |t| &t.text))?;
    let ids = scene.instances.iter().map(|(id, _)| usize::from(*id));
    let mut classes = vec![Surface::Matte; ids.max().map_or(1, |most| most + 1)];
    for (id, class) in classes.iter_mut().enumerate() {
        let items = scene.items.iter();
        let shown = items.filter(|item| usize::from(item.instance) == id);
        *class =
            table.of_instance(shown.map(|item| (item.material.name.as_str(), area(&item.mesh))));
    }
    Ok(classes)
}

/// Area of a mesh, m².
fn area(mesh: &crate::geometry::TriMesh) -> f64 {
    let corner = |i: u32| mesh.positions.get(i as usize).copied().unwrap_or_default();
    let triangles = mesh.indices.chunks_exact(3);
    let areas = triangles.map(|t| {
        let [a, b, c] = [0, 1, 2].map(|k| nalgebra::Vector3::from(corner(t[k])));
        f64::from((b - a).cross(&(c - a)).norm() / 2.0)
    });
    areas.sum()
}
