//! The states of a recording as the messages they were, for showing them again.

use std::collections::BTreeMap;

use ndarray::{ArrayD, Axis};
use wheelarm_proto::v1;

use super::Episode;
use super::error::ReadError;

impl Episode {
    /// Every recorded state of robot, objects and furniture, with what was
    /// applied and judged, oldest first: what the query `show` takes.
    ///
    /// # Errors
    /// When a stream is absent or cannot be read.
    pub fn states(&self) -> Result<Vec<v1::ShowRequest>, ReadError> {
        let ticks = self.u64s("joint_state", "tick")?;
        let joints =
            ["position", "velocity", "effort"].map(|column| self.f64s("joint_state", column));
        let [positions, velocities, efforts] = joints;
        let (positions, velocities, efforts) = (positions?, velocities?, efforts?);
        let openings = self.f64s("joint_state", "opening").ok();
        let (robot, roles) = self.roles()?;
        let poses = Rows::read(self, "pose", &["pose", "twist"])?;
        let objects = Rows::read(self, "object_pose", &["pose", "twist"])?;
        let furniture = Rows::read(self, "furniture_joint", &["position", "velocity"])?;
        let mut evaluations = self.evaluations()?;
        let mut shapes = self.shapes()?;
        let mut phases = self.phases()?;
        let mut contacts = self.contacts()?;
        let odometry = Rows::read(self, "odometry", &["pose", "twist"])?;
        let mut imu = self.imu()?.into_iter().peekable();
        let mut applied = self.applied()?.into_iter().peekable();
        let mut commands = self.commands()?.into_iter().peekable();
        let not_after = |header: Option<&v1::Header>, tick| header.is_none_or(|h| h.tick <= tick);
        // The first recordings did not tell it; it follows from the knuckle.
        let opening = |i: usize| match &openings {
            Some(openings) => row(openings, i).first().copied(),
            None => robot.opening(*row(&positions, i).get(roles.knuckle)?),
        };
        let states = ticks.iter().enumerate().map(|(i, &tick)| {
            let frames = |rows: &Rows| -> Vec<(v1::Pose, v1::Twist)> {
                let [poses, twists] = [0, 1].map(|column| rows.row(column, tick));
                let twists = twists.chunks(6).map(twist);
                poses.chunks(7).map(pose).zip(twists).collect()
            };
            v1::ShowRequest {
                tick,
                joints: Some(v1::JointState {
                    header: None,
                    positions: row(&positions, i),
                    velocities: row(&velocities, i),
                    efforts: row(&efforts, i),
                    opening: opening(i),
                }),
                poses: Some(v1::PoseSet {
                    header: None,
                    frames: frames(&poses)
                        .into_iter()
                        .map(|(pose, twist)| v1::FramePose {
                            pose: Some(pose),
                            twist: Some(twist),
                        })
                        .collect(),
                }),
                objects: Some({
                    let (poses, twists) = frames(&objects).into_iter().unzip();
                    v1::ObjectPoses {
                        header: None,
                        poses,
                        twists,
                    }
                }),
                furniture: Some(v1::FurnitureJoints {
                    header: None,
                    positions: furniture.row(0, tick),
                    velocities: furniture.row(1, tick),
                }),
                deformable: shapes.remove(&tick),
                applied_samples: std::iter::from_fn(|| {
                    applied.next_if(|a| not_after(a.header.as_ref(), tick))
                })
                .collect(),
                commands: std::iter::from_fn(|| {
                    commands.next_if(|c| not_after(c.header.as_ref(), tick))
                })
                .collect(),
                evaluation: evaluations.remove(&tick),
                phase: phases.remove(&tick),
                odometry: frames(&odometry).pop().map(|(pose, twist)| v1::Odometry {
                    header: None,
                    pose: Some(pose),
                    twist: Some(twist),
                }),
                contacts: contacts.remove(&tick),
                imu_samples: std::iter::from_fn(|| {
                    imu.next_if(|sample| not_after(sample.header.as_ref(), tick))
                })
                .collect(),
            }
        });
        Ok(states.collect())
    }

    fn evaluations(&self) -> Result<BTreeMap<u64, v1::Evaluation>, ReadError> {
        let stream = "evaluation";
        let ticks = self.u64s(stream, "tick")?;
        let [success, done] = ["success", "done"].map(|column| self.flags(stream, column));
        let (success, done) = (success?, done?);
        let elapsed = self.f64s(stream, "elapsed")?;
        let failures = self.texts(stream, "failure")?;
        let names = self.names(stream, "condition_holds").unwrap_or_default();
        let holds = self.flags(stream, "condition_holds")?;
        let required = self.flags(stream, "condition_required")?;
        let values = self.f64s(stream, "condition_value")?;
        let samples = ticks.into_iter().enumerate().map(|(i, tick)| {
            let values = row(&values, i);
            let at = i * names.len();
            let conditions = names.iter().enumerate().map(|(k, name)| v1::Condition {
                name: name.clone(),
                holds: holds.get(at + k).copied().unwrap_or_default(),
                value: values.get(k).copied().unwrap_or_default(),
                required: required.get(at + k).copied().unwrap_or_default(),
                predicate: name.split('(').next().unwrap_or_default().to_owned(),
            });
            let evaluation = v1::Evaluation {
                success: success.get(i).copied().unwrap_or_default(),
                done: done.get(i).copied().unwrap_or_default(),
                failure: failures.get(i).cloned().unwrap_or_default(),
                conditions: conditions.collect(),
                elapsed_seconds: row(&elapsed, i).first().copied().unwrap_or_default(),
                ..v1::Evaluation::default()
            };
            (tick, evaluation)
        });
        Ok(samples.collect())
    }

    fn phases(&self) -> Result<BTreeMap<u64, v1::PhaseSample>, ReadError> {
        let ticks = self.u64s("phase", "tick")?;
        let labels = self.u64s("phase", "label")?;
        let names = self.texts("phase", "name")?;
        let samples = ticks.into_iter().zip(labels).zip(names);
        let samples = samples.map(|((tick, label), name)| {
            let phase = i32::try_from(label).unwrap_or_default();
            let sample = v1::PhaseSample {
                header: None,
                phase,
                name,
            };
            (tick, sample)
        });
        Ok(samples.collect())
    }

    fn contacts(&self) -> Result<BTreeMap<u64, v1::Contacts>, ReadError> {
        let stream = "contact";
        let ticks = self.u64s(stream, "tick")?;
        let pads = self.f64s(stream, "pad_force")?;
        let pairs = self.texts(stream, "pairs")?;
        let [points, forces] = ["point", "force"].map(|column| self.f64s(stream, column));
        let (points, forces) = (points?, forces?);
        let samples = ticks.into_iter().enumerate().map(|(i, tick)| {
            let pairs = pairs.get(i).map(String::as_str).unwrap_or_default();
            // What cannot be read was written by nobody of ours: no contacts.
            let pairs: Vec<[String; 2]> = serde_json::from_str(pairs).unwrap_or_default();
            let (points, forces) = (row(&points, i), row(&forces, i));
            let places = points.chunks(3).zip(forces.chunks(3));
            let contacts = pairs.into_iter().zip(places);
            let contacts = contacts.map(|([first, second], (point, force))| v1::Contact {
                first,
                second,
                point: Some(vector(point)),
                force: Some(vector(force)),
            });
            let sample = v1::Contacts {
                header: None,
                pad_forces: row(&pads, i),
                contacts: contacts.collect(),
            };
            (tick, sample)
        });
        Ok(samples.collect())
    }

    fn imu(&self) -> Result<Vec<v1::Imu>, ReadError> {
        let ticks = self.u64s("imu", "tick")?;
        let orientations = self.f64s("imu", "orientation")?;
        let turns = self.f64s("imu", "angular_velocity")?;
        let accelerations = self.f64s("imu", "linear_acceleration")?;
        let samples = ticks.into_iter().enumerate().map(|(i, tick)| v1::Imu {
            header: Some(v1::Header {
                tick,
                ..v1::Header::default()
            }),
            orientation: Some(quaternion(&row(&orientations, i))),
            angular_velocity: Some(vector(&row(&turns, i))),
            linear_acceleration: Some(vector(&row(&accelerations, i))),
        });
        Ok(samples.collect())
    }

    fn shapes(&self) -> Result<BTreeMap<u64, v1::Deformable>, ReadError> {
        let stream = "deformable";
        let ticks = self.u64s(stream, "tick")?;
        if ticks.is_empty() {
            return Ok(BTreeMap::new());
        }
        let vertices = self.f64s(stream, "vertex")?;
        let elastic = self.f64s(stream, "elastic_energy")?;
        let kinetic = self.f64s(stream, "kinetic_energy")?;
        let objects = self.texts(stream, "object")?;
        let samples = ticks.into_iter().enumerate().map(|(i, tick)| {
            let first = |column: &ArrayD<f64>| row(column, i).first().copied().unwrap_or_default();
            let shape = v1::Deformable {
                header: None,
                object: objects.get(i).cloned().unwrap_or_default(),
                // Narrowing is exact: they were float32 when they were published.
                vertices: row(&vertices, i).into_iter().map(|v| v as f32).collect(),
                elastic_energy: first(&elastic),
                kinetic_energy: first(&kinetic),
            };
            (tick, shape)
        });
        Ok(samples.collect())
    }
}

/// Columns of a stream by tick.
struct Rows {
    index: BTreeMap<u64, usize>,
    columns: Vec<ArrayD<f64>>,
}

impl Rows {
    fn read(episode: &Episode, stream: &str, columns: &[&str]) -> Result<Self, ReadError> {
        let ticks = episode.u64s(stream, "tick")?;
        let columns = columns.iter().map(|column| episode.f64s(stream, column));
        Ok(Self {
            index: ticks
                .into_iter()
                .enumerate()
                .map(|(i, tick)| (tick, i))
                .collect(),
            columns: columns.collect::<Result<_, _>>()?,
        })
    }

    /// All numbers of the sample at `tick`; nothing where there is none.
    fn row(&self, column: usize, tick: u64) -> Vec<f64> {
        let index = self.index.get(&tick);
        index.map_or_else(Vec::new, |&i| row(&self.columns[column], i))
    }
}

fn row(column: &ArrayD<f64>, sample: usize) -> Vec<f64> {
    match column.shape().first() {
        Some(&count) if sample < count => {
            column.index_axis(Axis(0), sample).iter().copied().collect()
        }
        _ => Vec::new(),
    }
}

fn vector(v: &[f64]) -> v1::Vector3 {
    let at = |i: usize| v.get(i).copied().unwrap_or_default();
    v1::Vector3 {
        x: at(0),
        y: at(1),
        z: at(2),
    }
}

/// Position and quaternion x y z w.
fn pose(v: &[f64]) -> v1::Pose {
    v1::Pose {
        position: Some(vector(v)),
        orientation: Some(quaternion(v.get(3..).unwrap_or_default())),
    }
}

/// x y z w.
fn quaternion(v: &[f64]) -> v1::Quaternion {
    let at = |i: usize| v.get(i).copied().unwrap_or_default();
    v1::Quaternion {
        x: at(0),
        y: at(1),
        z: at(2),
        w: at(3),
    }
}

/// Linear, then angular.
fn twist(v: &[f64]) -> v1::Twist {
    v1::Twist {
        linear: Some(vector(v)),
        angular: Some(vector(v.get(3..).unwrap_or_default())),
    }
}
