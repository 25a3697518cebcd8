//! The fastest format for training: a safetensors file per episode, with the rows of
//! a policy and the images as they are in memory, neither compressed nor scaled
//! to a range. Episodes are independent, so all processors write, and a trainer
//! maps the files and copies them to the GPU.

use std::path::PathBuf;

use safetensors::tensor::{Dtype, TensorView};
use serde_json::{Value, json};
use wheelarm_language::kind_of;
use wheelarm_policy::ledger::Ledger;
use wheelarm_policy::worlds::Used;
use wheelarm_policy::{STATE, state_names, state_units};

use super::batch::parallel;
use super::csv_table::{State, state_columns};
use super::learning::{self, Learning, RowOptions};
use super::{Format, PendingFile, Recording, Sees, Size, Written, scaled};
use super::{intrinsics, keypoint_targets};

/// Version of the layout.
pub const LAYOUT: &str = "wheelarm-tensors/1";
/// Streams of WheelArm-Sim's 112 values; without them that table is left out.
const TABLE: [&str; 3] = ["joint_state", "pose", "imu"];

/// Writes a file `LABEL.safetensors` per episode.
///
/// | tensor | shape and type | what |
/// |---|---|---|
/// | `states` | N × 27, f32 | rows of state |
/// | `actions` | N × 9 or 12, f32 | rows of action |
/// | `seconds` | N, f64 | simulation time |
/// | `phase`, `incident`, `success` | N, u8 | label 0 to 3; error on purpose 0 to 3; the task holds |
/// | `expert` | N, u8 | 0 where a policy commanded, whose actions are not demonstrations|
/// | `aims` | N × 2 (3 + 2 cameras), f32 | positions of the task's object and goal ([`super::keypoint_targets`]); only where objects are recorded |
/// | `things` | N × objects (3 + 2 cameras), f32 | positions of every object and slide of the home, in the order of `thing_names`; with `aims` |
/// | `table` | N × 112, f32 | WheelArm-Sim's columns, NaN without a sample; only with an IMU in the recording |
/// | `pictures.CAMERA` | N × height × width × 3, u8 | the robot's observation, sRGB |
/// | `depth.CAMERA` | N × height × width, u16 | with [`Tensors::depth`]: millimetres, 0 where nothing is |
///
/// The metadata has one key, `wheelarm`, whose text is JSON: the layout, label,
/// instruction, task, seed, success, rate, names and units, cameras, training ledger, what it uses
/// of homes, objects, words and looks (`world`); `thing` is the target of
/// `thing_names` that the task is about.
#[derive(Clone, Debug)]
pub struct Tensors {
    /// Folder of the files.
    pub out: PathBuf,
    /// Images are scaled to this size; as recorded without it.
    pub size: Option<Size>,
    /// With depth: of a depth sensor if present, else exact.
    pub depth: bool,
    /// Options of the rows.
    pub rows: RowOptions,
    /// Threads that read the images of one episode.
    pub threads: usize,
}

impl Format for Tensors {
    fn wants(&self, stream: &str) -> bool {
        TABLE.contains(&stream) || learning::reads(stream)
    }

    fn add(&self, recording: &Recording, tick: &(dyn Fn() + Sync)) -> anyhow::Result<Written> {
        let sees = match self.depth {
            true => Sees::ColourAndDepth,
            false => Sees::Colour,
        };
        let (rate, learning) = Learning::on_grid(recording, &self.rows, sees)?;
        let rows = learning.rows.as_slice();
        let name = format!("{}.safetensors", recording.summary.label);
        let file = PendingFile::new(&self.out.join(name))?;
        let count = rows.len();
        let stamps = &recording.aligned.stamps;
        let seconds = rows.iter().map(|&row| stamps[row] as f64 * 1e-9);
        let bytes = |row: &dyn Fn(usize) -> u8| rows.iter().map(|&r| row(r)).collect();
        let incidents = learning.incidents.iter().map(|&code| code as u8).collect();
        let width = self.rows.action.size();
        let mut tensors = vec![
            of_f32("states", &learning.states, STATE),
            of_f32("actions", &learning.actions, width),
            Tensor {
                name: "seconds".to_owned(),
                dtype: Dtype::F64,
                shape: vec![count],
                bytes: seconds.flat_map(f64::to_le_bytes).collect(),
            },
            of_bytes("phase", bytes(&|row| recording.labels[row])),
            of_bytes("incident", incidents),
            of_bytes(
                "expert",
                learning.by_policy.iter().map(|p| u8::from(!p)).collect(),
            ),
            of_bytes("success", bytes(&|row| u8::from(learning.success(row)))),
        ];
        let has_table = !recording.aligned.whole_rows(&TABLE, &[]).is_empty();
        if has_table {
            let state = State::read(recording)?;
            let table: Vec<Vec<f64>> = rows.iter().map(|&row| state.row(row)).collect();
            tensors.push(of_f32("table", &table, table[0].len()));
        }
        let cameras = learning::cameras(recording, self.size);
        for (number, (camera, to)) in cameras.iter().enumerate() {
            let images = parallel(count, self.threads, |i| {
                let (source, index) = recording.observed(camera, rows[i])?;
                let (width, height) = source.size().unwrap_or_default();
                let rgb = source.rgb(&recording.episode, index)?;
                if number == 0 {
                    tick();
                }
                Ok(scaled(rgb, Size { width, height }, *to))
            })?;
            tensors.push(Tensor {
                name: format!("pictures.{camera}"),
                dtype: Dtype::U8,
                shape: vec![count, to.height, to.width, 3],
                bytes: images.concat(),
            });
            if self.depth {
                tensors.push(self.depths(recording, camera, rows, *to)?);
            }
        }
        let names: Vec<&str> = cameras.keys().map(String::as_str).collect();
        let mut notes = learning.notes;
        let keypoints = keypoint_targets::read(recording, rows, &names)
            .inspect_err(|problem| notes.push(format!("no keypoint targets (aims): {problem}")))
            .ok();
        if let Some(keypoints) = &keypoints {
            let width = keypoint_targets::names(names.iter().copied()).len();
            tensors.push(of_f32("aims", &keypoints.rows, width));
            let width = width / keypoint_targets::POINTS.len() * keypoints.objects.len();
            tensors.push(of_f32("things", &keypoints.of_objects, width));
        }
        let has = Has {
            table: has_table,
            keypoints,
        };
        let about = self.about(recording, rate, &has).to_string();
        let views = tensors.iter().map(|t| {
            let view = TensorView::new(t.dtype, t.shape.clone(), &t.bytes)?;
            Ok((t.name.as_str(), view))
        });
        let views = views.collect::<Result<Vec<_>, safetensors::SafeTensorError>>()?;
        let metadata = [("wheelarm".to_owned(), about)].into();
        std::fs::write(file.path(), safetensors::serialize(views, Some(metadata))?)?;
        Ok(Written {
            path: file.commit()?,
            samples: count,
            notes,
        })
    }
}

impl Tensors {
    /// Depth of one camera in every row, from the nearest pixel of the image.
    fn depths(
        &self,
        recording: &Recording,
        camera: &str,
        rows: &[usize],
        to: Size,
    ) -> anyhow::Result<Tensor> {
        let is_sensed = recording.depth_sensors().contains_key(camera);
        let images = parallel(rows.len(), self.threads, |i| {
            let (source, index) = match is_sensed {
                true => recording.sensed_depth(camera, rows[i])?,
                false => recording.image(camera, rows[i])?,
            };
            let (width, height) = source.size().unwrap_or_default();
            let metres = source.depth(&recording.episode, index)?;
            let mut out = Vec::with_capacity(to.width * to.height * 2);
            for y in 0..to.height {
                let row = (2 * y + 1) * height / (2 * to.height) * width;
                for x in 0..to.width {
                    let metres_here = metres[row + (2 * x + 1) * width / (2 * to.width)];
                    // Beyond 16 bits, and without a hit: 0.
                    let millimetres = (metres_here * 1e3).round();
                    let is_valid = (0.0..=f32::from(u16::MAX)).contains(&millimetres);
                    let stored = if is_valid { millimetres as u16 } else { 0 };
                    out.extend(stored.to_le_bytes());
                }
            }
            Ok(out)
        })?;
        Ok(Tensor {
            name: format!("depth.{camera}"),
            dtype: Dtype::U16,
            shape: vec![rows.len(), to.height, to.width],
            bytes: images.concat(),
        })
    }

    fn about(&self, recording: &Recording, rate: u32, has: &Has) -> Value {
        let (summary, kind) = (&recording.summary, self.rows.action);
        let [task, activity, area] = &summary.task;
        let table = has.table.then(|| state_columns(&recording.robot));
        let cameras = learning::cameras(recording, self.size);
        let cameras = cameras.keys().map(String::as_str);
        let names = has
            .keypoints
            .as_ref()
            .map(|_| keypoint_targets::names(cameras));
        json!({
            "layout": LAYOUT,
            "label": summary.label,
            "instruction": summary.instruction,
            "task": task, "activity": activity, "area": area,
            "seed": summary.seed,
            "success": summary.success,
            "rate_hz": rate,
            "robot": recording.robot.name,
            "action": kind.name(),
            "state_names": state_names(&recording.robot),
            "state_units": state_units().collect::<Vec<_>>(),
            "action_names": kind.names(&recording.robot),
            "action_units": kind.units().collect::<Vec<_>>(),
            "table_names": table,
            "aim_names": names,
            "thing": has.keypoints.as_ref().map(|keypoints| &keypoints.object),
            "thing_names": has.keypoints.as_ref().map(|keypoints| &keypoints.objects),
            "calibration": intrinsics::cameras(recording, self.size),
            "ledger": ledger(recording),
            "world": world(recording),
        })
    }
}

/// The training ledger of one episode; null where its scenario cannot be read.
fn ledger(recording: &Recording) -> Value {
    let Ok(scenario) = recording.episode.scenario() else {
        return Value::Null;
    };
    let mut ledger = Ledger::default();
    ledger.add(&scenario);
    serde_json::from_str(&ledger.text()).unwrap_or_default()
}

/// What an episode uses of homes, objects, words and looks; null where its scenario cannot be
/// read.
fn world(recording: &Recording) -> Value {
    #[derive(serde::Deserialize)]
    struct ObjectFile {
        #[serde(default)]
        category: String,
    }
    let Ok(scenario) = recording.episode.scenario() else {
        return Value::Null;
    };
    let mut used = Used::from_scenario(&scenario);
    let assets = recording.episode.snapshot();
    let assets = assets.map_or_else(|_| Vec::new(), |snapshot| snapshot.assets);
    let categories = used.objects.iter().filter_map(|name| {
        let path = format!("objects/{}.toml", kind_of(name));
        let asset = assets.iter().find(|asset| asset.path == path)?;
        let file: ObjectFile = toml::from_str(&asset.text).ok()?;
        (!file.category.is_empty()).then_some(file.category)
    });
    used.categories = categories.collect();
    used.categories.sort();
    used.categories.dedup();
    json!(used)
}

/// Tensors that not every episode has.
struct Has {
    table: bool,
    keypoints: Option<keypoint_targets::KeypointTargets>,
}

struct Tensor {
    name: String,
    dtype: Dtype,
    shape: Vec<usize>,
    bytes: Vec<u8>,
}

fn of_bytes(name: &str, bytes: Vec<u8>) -> Tensor {
    Tensor {
        name: name.to_owned(),
        dtype: Dtype::U8,
        shape: vec![bytes.len()],
        bytes,
    }
}

fn of_f32(name: &str, rows: &[Vec<f64>], width: usize) -> Tensor {
    let values = rows.iter().flatten();
    Tensor {
        name: name.to_owned(),
        dtype: Dtype::F32,
        shape: vec![rows.len(), width],
        bytes: values.flat_map(|&v| (v as f32).to_le_bytes()).collect(),
    }
}
