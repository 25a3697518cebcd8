//! The messages, filled from a recording. Values that a recording lacks are written as ROS defines
//! it: unknown covariances are zeros.

use wheelarm_proto::v1;

use super::cdr::Cdr;
use crate::calibration::PIXEL_CENTRE;
use crate::pose::Pose;

/// A message.
pub(in crate::convert) trait RosMessage {
    /// Full name of its type.
    const NAME: &'static str;

    /// Writes its fields in their order.
    fn write(&self, out: &mut Cdr);

    /// The encoded message.
    fn encoded(&self) -> Vec<u8> {
        let mut out = Cdr::new();
        self.write(&mut out);
        out.into_bytes()
    }
}

fn time(out: &mut Cdr, nanos: u64) {
    out.i32((nanos / 1_000_000_000) as i32);
    out.u32((nanos % 1_000_000_000) as u32);
}

fn header(out: &mut Cdr, nanos: u64, frame: &str) {
    time(out, nanos);
    out.text(frame);
}

/// `std_msgs/msg/String`.
pub(in crate::convert) struct Text(pub String);

impl RosMessage for Text {
    const NAME: &'static str = "std_msgs/msg/String";

    fn write(&self, out: &mut Cdr) {
        out.text(&self.0);
    }
}

/// `rosgraph_msgs/msg/Clock`: simulation time, nanoseconds.
pub(in crate::convert) struct Clock(pub u64);

impl RosMessage for Clock {
    const NAME: &'static str = "rosgraph_msgs/msg/Clock";

    fn write(&self, out: &mut Cdr) {
        time(out, self.0);
    }
}

/// `sensor_msgs/msg/JointState`; unknown numbers are an empty list.
pub(in crate::convert) struct JointState {
    pub stamp: u64,
    pub names: Vec<String>,
    /// rad or m.
    pub positions: Vec<f64>,
    /// rad/s or m/s.
    pub velocities: Vec<f64>,
    /// N·m or N.
    pub efforts: Vec<f64>,
}

impl RosMessage for JointState {
    const NAME: &'static str = "sensor_msgs/msg/JointState";

    fn write(&self, out: &mut Cdr) {
        header(out, self.stamp, "");
        out.texts(&self.names);
        out.f64_sequence(&self.positions);
        out.f64_sequence(&self.velocities);
        out.f64_sequence(&self.efforts);
    }
}

/// `sensor_msgs/msg/Imu`.
pub(in crate::convert) struct Imu {
    pub stamp: u64,
    pub frame: String,
    /// x y z w; `None` where the IMU does not report it.
    pub orientation: Option<[f64; 4]>,
    /// rad/s.
    pub angular_velocity: [f64; 3],
    /// m/s², with gravity.
    pub linear_acceleration: [f64; 3],
}

impl RosMessage for Imu {
    const NAME: &'static str = "sensor_msgs/msg/Imu";

    fn write(&self, out: &mut Cdr) {
        header(out, self.stamp, &self.frame);
        out.f64s(&self.orientation.unwrap_or([0.0, 0.0, 0.0, 1.0]));
        let mut covariance = [0.0; 9];
        if self.orientation.is_none() {
            // ROS's mark of unmeasured values.
            covariance[0] = -1.0;
        }
        out.f64s(&covariance);
        out.f64s(&self.angular_velocity);
        out.f64s(&[0.0; 9]);
        out.f64s(&self.linear_acceleration);
        out.f64s(&[0.0; 9]);
    }
}

/// `sensor_msgs/msg/LaserScan`. All rays are of one time.
pub(in crate::convert) struct LaserScan {
    pub stamp: u64,
    pub scanner: v1::ScannerDescription,
    /// Time between two scans, s; 0 where it is not known.
    pub period: f64,
    /// Metres; infinite as REP 117 says.
    pub ranges: Vec<f32>,
}

impl RosMessage for LaserScan {
    const NAME: &'static str = "sensor_msgs/msg/LaserScan";

    fn write(&self, out: &mut Cdr) {
        let scanner = &self.scanner;
        header(out, self.stamp, &scanner.frame);
        for value in [
            scanner.first_angle,
            scanner.last_angle(),
            scanner.angle_step,
            0.0,
            self.period,
            scanner.least_range,
            scanner.greatest_range,
        ] {
            out.f32(value as f32);
        }
        out.f32_sequence(&self.ranges);
        out.f32_sequence(&[]);
    }
}

/// `nav_msgs/msg/Odometry`.
pub(in crate::convert) struct Odometry {
    pub stamp: u64,
    pub frame: String,
    pub child: String,
    pub pose: Pose,
    /// vx vy vz, m/s, and wx wy wz, rad/s, in the child's frame.
    pub twist: [f64; 6],
}

impl RosMessage for Odometry {
    const NAME: &'static str = "nav_msgs/msg/Odometry";

    fn write(&self, out: &mut Cdr) {
        header(out, self.stamp, &self.frame);
        out.text(&self.child);
        out.f64s(&self.pose);
        out.f64s(&[0.0; 36]);
        out.f64s(&self.twist);
        out.f64s(&[0.0; 36]);
    }
}

/// `geometry_msgs/msg/PoseStamped`.
pub(in crate::convert) struct PoseStamped {
    pub stamp: u64,
    pub frame: String,
    pub pose: Pose,
}

impl RosMessage for PoseStamped {
    const NAME: &'static str = "geometry_msgs/msg/PoseStamped";

    fn write(&self, out: &mut Cdr) {
        header(out, self.stamp, &self.frame);
        out.f64s(&self.pose);
    }
}

/// `geometry_msgs/msg/TwistStamped`.
pub(in crate::convert) struct TwistStamped {
    pub stamp: u64,
    pub frame: String,
    /// vx vy vz, m/s, and wx wy wz, rad/s.
    pub twist: [f64; 6],
}

impl RosMessage for TwistStamped {
    const NAME: &'static str = "geometry_msgs/msg/TwistStamped";

    fn write(&self, out: &mut Cdr) {
        header(out, self.stamp, &self.frame);
        out.f64s(&self.twist);
    }
}

/// One frame in another one.
pub(in crate::convert) struct Transform {
    pub stamp: u64,
    pub parent: String,
    pub child: String,
    pub pose: Pose,
}

/// `tf2_msgs/msg/TFMessage`.
pub(in crate::convert) struct TFMessage(pub Vec<Transform>);

impl RosMessage for TFMessage {
    const NAME: &'static str = "tf2_msgs/msg/TFMessage";

    fn write(&self, out: &mut Cdr) {
        out.length(self.0.len());
        for transform in &self.0 {
            header(out, transform.stamp, &transform.parent);
            out.text(&transform.child);
            out.f64s(&transform.pose);
        }
    }
}

/// `sensor_msgs/msg/Image`, row by row from the top left, little-endian.
pub(in crate::convert) struct Image {
    pub stamp: u64,
    pub frame: String,
    pub width: u32,
    pub height: u32,
    /// `rgb8`, `32FC1` (metres), `16UC1` (millimetres or ids), `8UC1`.
    pub encoding: &'static str,
    pub data: Vec<u8>,
}

impl RosMessage for Image {
    const NAME: &'static str = "sensor_msgs/msg/Image";

    fn write(&self, out: &mut Cdr) {
        header(out, self.stamp, &self.frame);
        out.u32(self.height);
        out.u32(self.width);
        out.text(self.encoding);
        out.u8(0);
        out.u32((self.data.len() / (self.height as usize).max(1)) as u32);
        out.bytes(&self.data);
    }
}

/// `sensor_msgs/msg/CameraInfo` of a pinhole without distortion.
pub(in crate::convert) struct CameraInfo {
    pub stamp: u64,
    pub frame: String,
    /// Width, height, fx, fy, cx, cy in pixels, cx and cy from the image's edge as
    /// recordings count them; ROS counts from the centre of the first pixel.
    pub intrinsics: [f64; 6],
}

impl RosMessage for CameraInfo {
    const NAME: &'static str = "sensor_msgs/msg/CameraInfo";

    fn write(&self, out: &mut Cdr) {
        let [width, height, fx, fy, cx, cy] = self.intrinsics;
        let (cx, cy) = (cx - PIXEL_CENTRE, cy - PIXEL_CENTRE);
        header(out, self.stamp, &self.frame);
        out.u32(height as u32);
        out.u32(width as u32);
        out.text("plumb_bob");
        out.f64_sequence(&[0.0; 5]);
        out.f64s(&[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]);
        out.f64s(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
        out.f64s(&[fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0]);
        // Not binned; the region of interest is the whole image.
        (0..6).for_each(|_| out.u32(0));
        out.bool(false);
    }
}

/// `sensor_msgs/msg/PointCloud2` of points without order.
pub(in crate::convert) struct PointCloud2 {
    pub stamp: u64,
    pub frame: String,
    /// x y z of each, metres.
    pub points: Vec<[f32; 3]>,
}

impl RosMessage for PointCloud2 {
    const NAME: &'static str = "sensor_msgs/msg/PointCloud2";

    fn write(&self, out: &mut Cdr) {
        const FLOAT32: u8 = 7;
        const STEP: u32 = 12;
        let count = self.points.len() as u32;
        header(out, self.stamp, &self.frame);
        out.u32(1);
        out.u32(count);
        out.length(3);
        for (name, offset) in [("x", 0), ("y", 4), ("z", 8)] {
            out.text(name);
            out.u32(offset);
            out.u8(FLOAT32);
            out.u32(1);
        }
        out.bool(false);
        out.u32(STEP);
        out.u32(STEP * count);
        let bytes = self.points.iter().flatten().flat_map(|v| v.to_le_bytes());
        out.bytes(&bytes.collect::<Vec<u8>>());
        out.bool(true);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_is_encoded_as_ros_does() {
        assert_eq!(
            Text("hi".into()).encoded(),
            [0, 1, 0, 0, 3, 0, 0, 0, b'h', b'i', 0]
        );
        let joints = JointState {
            stamp: 3_000_000_007,
            names: vec!["abc".into()],
            positions: vec![1.5],
            velocities: vec![],
            efforts: vec![-2.0],
        };
        let mut wanted = vec![0, 1, 0, 0, 3, 0, 0, 0, 7, 0, 0, 0];
        // An empty frame, room, one name of four bytes.
        wanted.extend([1, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0]);
        wanted.extend([4, 0, 0, 0, b'a', b'b', b'c', 0]);
        // One position, at 32 without room before it; no velocity; one effort.
        wanted.extend([1, 0, 0, 0]);
        assert_eq!(wanted.len() - 4, 32);
        wanted.extend(1.5_f64.to_le_bytes());
        wanted.extend([0, 0, 0, 0, 1, 0, 0, 0]);
        wanted.extend((-2.0_f64).to_le_bytes());
        assert_eq!(joints.encoded(), wanted);
    }

    #[test]
    fn a_stamp_of_many_seconds_keeps_its_nanoseconds() {
        let bytes = Clock(86_400_999_999_999).encoded();
        assert_eq!(bytes[4..8], 86_400_i32.to_le_bytes());
        assert_eq!(bytes[8..], 999_999_999_u32.to_le_bytes());
    }
}
