//! The observations of a policy: samples and images of one tick, as in exported datasets.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use wheelarm_expert::run::DriverError;
use wheelarm_policy::{Observed, state};
use wheelarm_proto::robot::Roles;
use wheelarm_proto::topic::Sample;
use wheelarm_proto::{TopicId, v1};
use wheelarm_sdk::{Camera, Client, ClientError, Frame, SensorImages};

/// Streams of a state row, and of the state of the task.
pub(crate) const STREAMS: [TopicId; 6] = [
    TopicId::JointState,
    TopicId::Pose,
    TopicId::Odometry,
    TopicId::SensedJoint,
    TopicId::SensedOdometry,
    TopicId::Evaluation,
];
/// Images of a camera that may be queued.
const KEPT: usize = 4;

/// A camera of a policy: the images of its sensor models, otherwise the exact images.
struct View {
    wanted: v1::PolicyCamera,
    exact: Option<Camera>,
    color: Option<Sensor>,
    depth: Option<Sensor>,
}

/// A sensor on a camera.
struct Sensor {
    name: String,
    images: SensorImages,
    newest: Option<v1::SensorFrame>,
}

/// Collects the observations of a policy.
pub(crate) struct Collector {
    roles: Roles,
    views: Vec<View>,
    joints: v1::JointState,
    poses: v1::PoseSet,
    odometry: v1::Odometry,
    sensed_joints: v1::SensedJoints,
    sensed_odometry: v1::SensedOdometry,
    /// The newest evaluation.
    pub evaluation: v1::Evaluation,
    /// Odometry at the first moment.
    start: Option<[f64; 7]>,
    /// The newest last.
    moments: VecDeque<v1::PolicyStep>,
    history: usize,
}

impl Collector {
    /// Subscribes to the cameras of a policy.
    ///
    /// # Errors
    /// [`ClientError::NoCamera`] and other errors of a subscription.
    pub fn open(client: &Client, spec: &v1::PolicySpec, roles: Roles) -> Result<Self, ClientError> {
        let sensors = match spec.cameras.is_empty() {
            true => Vec::new(),
            false => client.request(&v1::SensorsRequest {})?.sensors,
        };
        let view = |wanted: &v1::PolicyCamera| {
            let sensor = |is_depth: bool| {
                let mut on = sensors.iter().filter(|sensor| sensor.camera == wanted.name);
                let found = on.find(|sensor| sensor.depth == is_depth);
                let open = |given: &v1::SensorProgress| {
                    Ok::<_, ClientError>(Sensor {
                        name: given.sensor.clone(),
                        images: client.sensor(&given.sensor, KEPT)?,
                        newest: None,
                    })
                };
                found.map(open).transpose()
            };
            let color = sensor(false)?;
            let depth = if wanted.depth { sensor(true)? } else { None };
            let is_exact = color.is_none() || wanted.depth && depth.is_none();
            let exact = is_exact.then(|| client.camera(&wanted.name, KEPT));
            Ok(View {
                wanted: wanted.clone(),
                exact: exact.transpose()?,
                color,
                depth,
            })
        };
        Ok(Self {
            roles,
            sensed_joints: v1::SensedJoints::default(),
            sensed_odometry: v1::SensedOdometry::default(),
            views: spec
                .cameras
                .iter()
                .map(view)
                .collect::<Result<_, ClientError>>()?,
            joints: v1::JointState::default(),
            poses: v1::PoseSet::default(),
            odometry: v1::Odometry::default(),
            evaluation: v1::Evaluation::default(),
            start: None,
            moments: VecDeque::new(),
            history: spec.history.max(1) as usize,
        })
    }

    /// Adds a sample; ignores streams outside of [`STREAMS`].
    pub fn take(&mut self, sample: Sample) {
        match sample {
            Sample::JointState(s) => self.joints = s,
            Sample::Pose(s) => self.poses = s,
            Sample::Odometry(s) => self.odometry = s,
            Sample::SensedJoint(s) => self.sensed_joints = s,
            Sample::SensedOdometry(s) => self.sensed_odometry = s,
            Sample::Evaluation(s) => self.evaluation = s,
            _ => {}
        }
    }

    /// Stores the observation at `now`, the stamp of an image. Returns whether it is the
    /// first moment; `None` while a sensor has not sent an image yet.
    ///
    /// # Errors
    /// [`DriverError::Scene`] when a sample or an image is missing.
    pub fn observe(
        &mut self,
        client: &Client,
        now: &v1::Header,
        patience: Duration,
    ) -> Result<Option<bool>, DriverError> {
        let is_first = self.start.is_none();
        let deadline = Instant::now() + patience;
        let has_sensors = |view: &View| view.color.is_some() || view.depth.is_some();
        let given = match self.views.iter().any(has_sensors) {
            true => client.request(&v1::SensorsRequest {})?.sensors,
            false => Vec::new(),
        };
        let mut images = Vec::with_capacity(self.views.len());
        let mut is_missing = false;
        for view in &mut self.views {
            match view.observe(&given, now, deadline)? {
                Some(image) => images.push(image),
                None => is_missing = true,
            }
        }
        if is_missing {
            return Ok(None);
        }
        let state_values = self.state(now)?;
        let moment = v1::PolicyStep {
            state_values,
            images,
        };
        while self.moments.len() + 1 < self.history {
            self.moments.push_back(moment.clone());
        }
        self.moments.push_back(moment);
        while self.moments.len() > self.history {
            self.moments.pop_front();
        }
        Ok(Some(is_first))
    }

    /// The stored moments, the newest last.
    pub fn moments(&self) -> Vec<v1::PolicyStep> {
        self.moments.iter().cloned().collect()
    }

    fn state(&mut self, now: &v1::Header) -> Result<Vec<f64>, DriverError> {
        // Sensor models publish where they are on, with every other sample of a tick.
        let has_encoders = self.sensed_joints.header.is_some();
        let has_odometry = self.sensed_odometry.header.is_some();
        let headers = [
            ("joint_state", &self.joints.header, true),
            ("pose", &self.poses.header, true),
            ("odometry", &self.odometry.header, true),
            ("sensed_joint", &self.sensed_joints.header, has_encoders),
            (
                "sensed_odometry",
                &self.sensed_odometry.header,
                has_odometry,
            ),
        ];
        for (stream, header, _) in headers.into_iter().filter(|(.., is_on)| *is_on) {
            let tick = header.as_ref().map(|header| header.tick);
            if tick != Some(now.tick) {
                return Err(DriverError::Scene(format!(
                    "the newest sample of `{stream}` is not of tick {} but of {tick:?}: policies \
                     need the state at 60 Hz",
                    now.tick
                )));
            }
        }
        let lacks = |what: &str| DriverError::Scene(format!("the server's samples lack {what}"));
        let of = |all: &[f64]| -> Option<([f64; 6], f64)> {
            Some((self.roles.arm_of(all)?, *all.get(self.roles.knuckle)?))
        };
        let (mut joints, knuckle) = of(&self.joints.positions).ok_or_else(|| lacks("joints"))?;
        let (mut velocities, turning) =
            of(&self.joints.velocities).ok_or_else(|| lacks("joint velocities"))?;
        if has_encoders {
            let arm = |all: &[f64]| all.try_into().map_err(|_| lacks("sensed joints"));
            joints = arm(&self.sensed_joints.positions)?;
            velocities = arm(&self.sensed_joints.velocities)?;
        }
        let hand = self.poses.frames.get(self.roles.end_effector);
        let hand = hand.and_then(|frame| values(frame.pose.as_ref()));
        let odometry = match has_odometry {
            true => self.sensed_odometry.pose.as_ref(),
            false => self.odometry.pose.as_ref(),
        };
        let odometry = values(odometry).ok_or_else(|| lacks("odometry"))?;
        let observed = Observed {
            joints,
            velocities,
            knuckle: [knuckle, turning],
            hand: hand.ok_or_else(|| lacks("the pose of the hand"))?,
            odometry,
            start: *self.start.get_or_insert(odometry),
        };
        Ok(state(&observed).to_vec())
    }
}

/// Position and quaternion of a pose.
fn values(pose: Option<&v1::Pose>) -> Option<[f64; 7]> {
    let (p, q) = (pose?.position?, pose?.orientation?);
    Some([p.x, p.y, p.z, q.x, q.y, q.z, q.w])
}

impl View {
    /// The image at a tick; `None` while a sensor has not sent any.
    fn observe(
        &mut self,
        given: &[v1::SensorProgress],
        now: &v1::Header,
        deadline: Instant,
    ) -> Result<Option<v1::PolicyImage>, DriverError> {
        let mut image = match &self.exact {
            Some(camera) => exact(&self.wanted, camera, now, deadline)?,
            None => v1::PolicyImage::default(),
        };
        for sensor in [&mut self.color, &mut self.depth].into_iter().flatten() {
            if !sensor.wait(given, now, deadline)? {
                return Ok(None);
            }
        }
        if let Some(color) = &self.color {
            image.color = color.plane(&self.wanted, |frame| frame.color.clone())?;
        }
        if let Some(depth) = &self.depth {
            let millimetres = depth.plane(&self.wanted, |frame| frame.depth.clone())?;
            let all = millimetres.chunks_exact(2);
            let metres = all.map(|b| metres(u16::from_le_bytes([b[0], b[1]])));
            image.depth = metres.flat_map(f32::to_le_bytes).collect();
        }
        Ok(Some(v1::PolicyImage {
            camera: self.wanted.name.clone(),
            width: self.wanted.width,
            height: self.wanted.height,
            ..image
        }))
    }
}

/// Depth in metres; infinite without a return.
fn metres(millimetres: u16) -> f32 {
    match millimetres {
        0 => f32::INFINITY,
        _ => f32::from(millimetres) * 1e-3,
    }
}

impl Sensor {
    /// Waits for the newest image at `now`; returns whether one exists.
    fn wait(
        &mut self,
        given: &[v1::SensorProgress],
        now: &v1::Header,
        deadline: Instant,
    ) -> Result<bool, DriverError> {
        let Some(progress) = given.iter().find(|progress| progress.sensor == self.name) else {
            let words = format!("the sensor {:?} is gone", self.name);
            return Err(DriverError::Scene(words));
        };
        if progress.images == 0 {
            return Ok(false);
        }
        loop {
            let header = self.newest.as_ref().and_then(|frame| frame.header.as_ref());
            if header.is_some_and(|h| h.episode == now.episode && h.sequence >= progress.newest) {
                return Ok(true);
            }
            let left = deadline.saturating_duration_since(Instant::now());
            match self.images.next(left)? {
                Some(frame) => self.newest = Some(frame),
                None => {
                    return Err(DriverError::Scene(format!(
                        "image {} of the sensor {:?} did not arrive",
                        progress.newest, self.name
                    )));
                }
            }
        }
    }

    /// A plane of the newest image, which must have the requested size.
    fn plane(
        &self,
        wanted: &v1::PolicyCamera,
        plane: fn(&v1::SensorFrame) -> bytes::Bytes,
    ) -> Result<bytes::Bytes, DriverError> {
        let frame = self.newest.clone().unwrap_or_default();
        let size = frame.intrinsics.as_ref().map(|i| [i.width, i.height]);
        match size.unwrap_or_default() {
            found if found == [wanted.width, wanted.height] => Ok(plane(&frame)),
            [width, height] => Err(DriverError::Scene(format!(
                "the sensor {:?} sends images of {width}x{height}, the policy needs {}x{}: \
                 make it for that size, or remove this sensor model",
                self.name, wanted.width, wanted.height
            ))),
        }
    }
}

/// The exact image of a camera at a tick.
fn exact(
    wanted: &v1::PolicyCamera,
    camera: &Camera,
    now: &v1::Header,
    deadline: Instant,
) -> Result<v1::PolicyImage, DriverError> {
    loop {
        let left = deadline.saturating_duration_since(Instant::now());
        let Some(frame) = camera.next(left)? else {
            return Err(DriverError::Scene(format!(
                "no image of camera {:?} arrived for tick {}",
                wanted.name, now.tick
            )));
        };
        let header = &frame.header;
        if (header.episode, header.tick) != (now.episode, now.tick) {
            continue;
        }
        let (width, height) = (frame.intrinsics.width, frame.intrinsics.height);
        if (width, height) != (wanted.width, wanted.height) {
            return Err(DriverError::Scene(format!(
                "camera {:?} sends images of {width}x{height}, the policy needs {}x{}: \
                 start the server with --camera {0}={}x{}",
                wanted.name, wanted.width, wanted.height, wanted.width, wanted.height
            )));
        }
        let depth = if wanted.depth {
            depth(&frame)
        } else {
            Vec::new()
        };
        return Ok(v1::PolicyImage {
            color: frame.color,
            depth: depth.into(),
            ..Default::default()
        });
    }
}

/// Depth as little-endian float32, m.
fn depth(frame: &Frame) -> Vec<u8> {
    frame
        .depth
        .iter()
        .flat_map(|metres| metres.to_le_bytes())
        .collect()
}
