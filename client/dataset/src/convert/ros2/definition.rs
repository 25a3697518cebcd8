//! Which fields a message has, in the language of `.msg` files: the text that
//! is stored in a bag, and the hash by which ROS 2 identifies types.
//!
//! The hash is that of REP 2011, version 1: SHA-256 over the type's description as
//! JSON, fields in their order, without default values, and every type that is
//! used, sorted by name.

use std::collections::BTreeMap;
use std::fmt::Write;

use sha2::{Digest, Sha256};

/// Line between the definitions of a text.
const LINE: &str =
    "================================================================================";

/// The messages of a bag and their parts: full name, and fields as in the
/// `.msg` file without its comments.
const DEFINITIONS: [(&str, &str); 25] = [
    ("builtin_interfaces/msg/Time", "int32 sec\nuint32 nanosec\n"),
    (
        "std_msgs/msg/Header",
        "builtin_interfaces/Time stamp\nstring frame_id\n",
    ),
    ("std_msgs/msg/String", "string data\n"),
    ("rosgraph_msgs/msg/Clock", "builtin_interfaces/Time clock\n"),
    (
        "geometry_msgs/msg/Vector3",
        "float64 x\nfloat64 y\nfloat64 z\n",
    ),
    (
        "geometry_msgs/msg/Point",
        "float64 x\nfloat64 y\nfloat64 z\n",
    ),
    (
        "geometry_msgs/msg/Quaternion",
        "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n",
    ),
    (
        "geometry_msgs/msg/Pose",
        "Point position\nQuaternion orientation\n",
    ),
    (
        "geometry_msgs/msg/PoseStamped",
        "std_msgs/Header header\nPose pose\n",
    ),
    (
        "geometry_msgs/msg/PoseWithCovariance",
        "Pose pose\nfloat64[36] covariance\n",
    ),
    (
        "geometry_msgs/msg/Twist",
        "Vector3 linear\nVector3 angular\n",
    ),
    (
        "geometry_msgs/msg/TwistStamped",
        "std_msgs/Header header\nTwist twist\n",
    ),
    (
        "geometry_msgs/msg/TwistWithCovariance",
        "Twist twist\nfloat64[36] covariance\n",
    ),
    (
        "geometry_msgs/msg/Transform",
        "Vector3 translation\nQuaternion rotation\n",
    ),
    (
        "geometry_msgs/msg/TransformStamped",
        "std_msgs/Header header\nstring child_frame_id\nTransform transform\n",
    ),
    (
        "tf2_msgs/msg/TFMessage",
        "geometry_msgs/TransformStamped[] transforms\n",
    ),
    (
        "nav_msgs/msg/Odometry",
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n\
         geometry_msgs/TwistWithCovariance twist\n",
    ),
    (
        "sensor_msgs/msg/JointState",
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\n\
         float64[] effort\n",
    ),
    (
        "sensor_msgs/msg/Imu",
        "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\n\
         float64[9] orientation_covariance\ngeometry_msgs/Vector3 angular_velocity\n\
         float64[9] angular_velocity_covariance\ngeometry_msgs/Vector3 linear_acceleration\n\
         float64[9] linear_acceleration_covariance\n",
    ),
    (
        "sensor_msgs/msg/LaserScan",
        "std_msgs/Header header\nfloat32 angle_min\nfloat32 angle_max\n\
         float32 angle_increment\nfloat32 time_increment\nfloat32 scan_time\n\
         float32 range_min\nfloat32 range_max\nfloat32[] ranges\nfloat32[] intensities\n",
    ),
    (
        "sensor_msgs/msg/Image",
        "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\n\
         uint8 is_bigendian\nuint32 step\nuint8[] data\n",
    ),
    (
        "sensor_msgs/msg/RegionOfInterest",
        "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify\n",
    ),
    (
        "sensor_msgs/msg/CameraInfo",
        "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\n\
         float64[] d\nfloat64[9] k\nfloat64[9] r\nfloat64[12] p\nuint32 binning_x\n\
         uint32 binning_y\nRegionOfInterest roi\n",
    ),
    (
        "sensor_msgs/msg/PointField",
        "uint8 INT8=1\nuint8 UINT8=2\nuint8 INT16=3\nuint8 UINT16=4\nuint8 INT32=5\n\
         uint8 UINT32=6\nuint8 FLOAT32=7\nuint8 FLOAT64=8\nstring name\nuint32 offset\n\
         uint8 datatype\nuint32 count\n",
    ),
    (
        "sensor_msgs/msg/PointCloud2",
        "std_msgs/Header header\nuint32 height\nuint32 width\nPointField[] fields\n\
         bool is_bigendian\nuint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense\n",
    ),
];

/// The table of definitions; tests extend it.
type Known = fn(&str) -> Option<&'static str>;

fn known(name: &str) -> Option<&'static str> {
    let found = DEFINITIONS.iter().find(|(known, _)| *known == name);
    found.map(|(_, text)| *text)
}

/// Definition of a message in a bag: its own, then each that it uses.
///
/// # Panics
/// For a message that is not in the table; a test goes through all that are written.
pub fn description(name: &str) -> String {
    let mut text = fields_of(name, known).1.to_owned();
    for used in uses(name, known) {
        let (_, definition) = fields_of(&used, known);
        let short = used.replace("/msg/", "/");
        let _ = write!(text, "{LINE}\nMSG: {short}\n{definition}");
    }
    text
}

/// The hash of a message's type, for example `RIHS01_df66…`.
///
/// # Panics
/// As [`description`].
pub fn type_hash(name: &str) -> String {
    hash(name, known)
}

fn hash(name: &str, known: Known) -> String {
    let mut used = uses(name, known);
    used.sort();
    let used: Vec<_> = used.iter().map(|name| json(name, known)).collect();
    let whole = format!(
        r#"{{"type_description": {}, "referenced_type_descriptions": [{}]}}"#,
        json(name, known),
        used.join(", ")
    );
    let digest = Sha256::digest(whole);
    digest.iter().fold("RIHS01_".to_owned(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}

/// The description of one type.
fn json(name: &str, known: Known) -> String {
    let fields = fields_of(name, known).0.into_iter().map(|field| {
        let Field {
            name,
            id,
            capacity,
            nested,
        } = field;
        format!(
            r#"{{"name": "{name}", "type": {{"type_id": {id}, "capacity": {capacity}, "string_capacity": 0, "nested_type_name": "{nested}"}}}}"#
        )
    });
    let fields: Vec<_> = fields.collect();
    format!(
        r#"{{"type_name": "{name}", "fields": [{}]}}"#,
        fields.join(", ")
    )
}

/// All types that a type uses, each once, in the order in which they are met.
fn uses(name: &str, known: Known) -> Vec<String> {
    let mut found: Vec<String> = Vec::new();
    let mut waiting = vec![name.to_owned()];
    while let Some(next) = waiting.pop() {
        for field in fields_of(&next, known).0.into_iter().rev() {
            if !field.nested.is_empty() {
                waiting.push(field.nested);
            }
        }
        if next != name && !found.contains(&next) {
            found.push(next);
        }
    }
    found
}

/// A field as in the description of a type.
#[derive(Debug, PartialEq, Eq)]
struct Field {
    name: String,
    /// Number of its type, including its multiplicity.
    id: u8,
    /// Elements of an array.
    capacity: u64,
    /// Full name of a type that is not a basic one.
    nested: String,
}

/// The fields of a message, and its definition.
fn fields_of(name: &str, known: Known) -> (Vec<Field>, &'static str) {
    let text = known(name).unwrap_or_else(|| panic!("{name} is in the table of definitions"));
    let package = name.split('/').next().unwrap_or_default();
    let lines = text.lines().filter(|line| !line.contains('='));
    let fields = lines.filter_map(|line| {
        let mut words = line.split_whitespace();
        Some(field(words.next()?, words.next()?, package))
    });
    (fields.collect(), text)
}

/// Numbers of the basic types.
fn basic() -> BTreeMap<&'static str, u8> {
    BTreeMap::from([
        ("int8", 2),
        ("uint8", 3),
        ("int16", 4),
        ("uint16", 5),
        ("int32", 6),
        ("uint32", 7),
        ("int64", 8),
        ("uint64", 9),
        ("float32", 10),
        ("float64", 11),
        ("bool", 15),
        ("byte", 16),
        ("string", 17),
    ])
}

/// A field of a type such as `float64[9]`, `string[]` or `geometry_msgs/Pose`.
fn field(of: &str, name: &str, package: &str) -> Field {
    const NESTED: u8 = 1;
    const ARRAY: u8 = 48;
    const SEQUENCE: u8 = 144;
    let (element, many, capacity) = match of.split_once('[') {
        None => (of, 0, 0),
        Some((element, "]")) => (element, SEQUENCE, 0),
        Some((element, length)) => {
            let length = length.trim_end_matches(']').parse();
            (element, ARRAY, length.expect("the length of an array"))
        }
    };
    let (id, nested) = match (basic().get(element), element.split_once('/')) {
        (Some(&id), _) => (id, String::new()),
        (None, Some((package, name))) => (NESTED, format!("{package}/msg/{name}")),
        (None, None) => (NESTED, format!("{package}/msg/{element}")),
    };
    Field {
        name: name.to_owned(),
        id: id + many,
        capacity,
        nested,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Definitions outside of our bags, for the table of hashes.
    fn more(name: &str) -> Option<&'static str> {
        let text = match name {
            "builtin_interfaces/msg/Duration" => "int32 sec\nuint32 nanosec\n",
            "geometry_msgs/msg/Wrench" => "Vector3 force\nVector3 torque\n",
            "geometry_msgs/msg/WrenchStamped" => "std_msgs/Header header\nWrench wrench\n",
            "geometry_msgs/msg/QuaternionStamped" => {
                "std_msgs/Header header\nQuaternion quaternion\n"
            }
            "geometry_msgs/msg/Vector3Stamped" => "std_msgs/Header header\nVector3 vector\n",
            "sensor_msgs/msg/CompressedImage" => {
                "std_msgs/Header header\nstring format\nuint8[] data\n"
            }
            "trajectory_msgs/msg/JointTrajectoryPoint" => {
                "float64[] positions\nfloat64[] velocities\nfloat64[] accelerations\n\
                 float64[] effort\nbuiltin_interfaces/Duration time_from_start\n"
            }
            "trajectory_msgs/msg/JointTrajectory" => {
                "std_msgs/Header header\nstring[] joint_names\nJointTrajectoryPoint[] points\n"
            }
            other => return known(other),
        };
        Some(text)
    }

    #[test]
    fn type_hashes_equal_those_of_a_running_ros_2() {
        // Returned by rclpy on Jazzy and on Kilted, which agree in all of them; that of
        // LaserScan by rosbags 0.11.9 for Jazzy.
        let hashes = "
            sensor_msgs/msg/Image            d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47
            sensor_msgs/msg/CompressedImage  15640771531571185e2efc8a100baf923961a4d15d5569652e6cb6691e8e371a
            sensor_msgs/msg/CameraInfo       b3dfd68ff46c9d56c80fd3bd4ed22c7a4ddce8c8348f2f59c299e73118e7e275
            sensor_msgs/msg/JointState       a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e
            sensor_msgs/msg/Imu              7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b
            sensor_msgs/msg/LaserScan        64c191398013af96509d518dac71d5164f9382553fce5c1f8cca5be7924bd828
            sensor_msgs/msg/PointCloud2      9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5
            nav_msgs/msg/Odometry            3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0
            geometry_msgs/msg/Twist          9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a
            geometry_msgs/msg/TwistStamped   5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64
            geometry_msgs/msg/Pose           d501954e9476cea2996984e812054b68026ae0bfae789d9a10b23daf35cc90fa
            geometry_msgs/msg/PoseStamped    10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8
            geometry_msgs/msg/TransformStamped 0a241f87d04668d94099cbb5ba11691d5ad32c2f29682e4eb5653424bd275206
            geometry_msgs/msg/QuaternionStamped 381add86c6c3160644d228ca342182c7fd6c7fab11c7a85ad817a9cc22dbac6e
            geometry_msgs/msg/Vector3Stamped d4829622288cbb443886e7ea94ea5671a3b1be6bab4ad04224432a65f7d7887a
            geometry_msgs/msg/WrenchStamped  8dc3deaf06b2ab281f9f9a742a8961c328ca7cec16e3fd6586d3a5c83fa78f77
            rosgraph_msgs/msg/Clock          692f7a66e93a3c83e71765d033b60349ba68023a8c689a79e48078bcb5c58564
            trajectory_msgs/msg/JointTrajectory 179b33eba59d676f6d967ac71fe35e7ca2f64b2f3928f4a018cec115e213796e
            std_msgs/msg/String              df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18
            std_msgs/msg/Header              f49fb3ae2cf070f793645ff749683ac6b06203e41c891e17701b1cb597ce6a01
            tf2_msgs/msg/TFMessage           e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087";
        let mut count = 0;
        for line in hashes.lines().filter(|line| !line.trim().is_empty()) {
            let mut words = line.split_whitespace();
            let (name, wanted) = (words.next().unwrap(), words.next().unwrap());
            assert_eq!(hash(name, more), format!("RIHS01_{wanted}"), "{name}");
            count += 1;
        }
        assert_eq!(count, 21);
    }

    #[test]
    fn the_text_of_a_message_holds_each_that_it_uses_once() {
        assert_eq!(description("std_msgs/msg/String"), "string data\n");
        let text = description("nav_msgs/msg/Odometry");
        let parts: Vec<&str> = text.split(LINE).collect();
        let names: Vec<_> = parts[1..]
            .iter()
            .filter_map(|part| part.lines().nth(1))
            .collect();
        assert_eq!(
            names,
            [
                "MSG: std_msgs/Header",
                "MSG: builtin_interfaces/Time",
                "MSG: geometry_msgs/PoseWithCovariance",
                "MSG: geometry_msgs/Pose",
                "MSG: geometry_msgs/Point",
                "MSG: geometry_msgs/Quaternion",
                "MSG: geometry_msgs/TwistWithCovariance",
                "MSG: geometry_msgs/Twist",
                "MSG: geometry_msgs/Vector3",
            ]
        );
    }

    #[test]
    fn fields_are_parsed() {
        let of = |of: &str| {
            let field = field(of, "a", "geometry_msgs");
            (field.id, field.capacity, field.nested)
        };
        assert_eq!(of("float64[9]"), (59, 9, String::new()));
        assert_eq!(of("string[]"), (161, 0, String::new()));
        assert_eq!(of("Pose"), (1, 0, "geometry_msgs/msg/Pose".to_owned()));
        let nested = "sensor_msgs/msg/PointField".to_owned();
        assert_eq!(of("sensor_msgs/PointField[]"), (145, 0, nested));
        let (fields, _) = fields_of("sensor_msgs/msg/PointField", known);
        let names: Vec<_> = fields.iter().map(|field| field.name.as_str()).collect();
        assert_eq!(names, ["name", "offset", "datatype", "count"]);
    }
}
