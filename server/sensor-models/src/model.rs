//! Contents of a parameter file: one table per sensor.

use crate::color::ColorParameters;
use crate::delay::Delay;
use crate::depth::DepthParameters;
use crate::encoders::EncoderParameters;
use crate::error::BadParameter;
use crate::imu::ImuParameters;
use crate::odometry::OdometryParameters;
use crate::parameters::Reader;
use crate::scanner::ScannerParameters;

/// Folder of the parameter files, below the assets folder.
pub const FOLDER: &str = "sensors";

/// Largest strength of a model; 1 is as in its file.
pub const MAX_STRENGTH: f64 = 3.0;

/// Sensors of one device.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Model {
    /// A colour camera.
    pub color: Option<ColorParameters>,
    /// A depth camera beside it.
    pub depth: Option<DepthParameters>,
    /// An inertial measurement unit.
    pub imu: Option<ImuParameters>,
    /// A laser scanner.
    pub scanner: Option<ScannerParameters>,
    /// Wheel odometry.
    pub odometry: Option<OdometryParameters>,
    /// Encoders, torque sensors and the gripper's position.
    pub encoders: Option<EncoderParameters>,
    /// Latency between the command gate and the robot's control.
    pub command: Option<Delay>,
}

impl Model {
    /// Parses a parameter file; `file` is its path below the assets folder.
    ///
    /// # Errors
    /// [`BadParameter`] with file, line, key, value found and allowed values.
    pub fn read(file: &str, text: &str) -> Result<Self, BadParameter> {
        fn table<T>(
            reader: &mut Reader<'_>,
            name: &str,
            read: fn(&mut crate::parameters::Section<'_>) -> Result<T, BadParameter>,
        ) -> Result<Option<T>, BadParameter> {
            let Some(mut section) = reader.section(name)? else {
                return Ok(None);
            };
            let read = read(&mut section)?;
            section.end()?;
            Ok(Some(read))
        }
        let mut reader = Reader::new(file, text)?;
        let model = Self {
            color: table(&mut reader, "color", ColorParameters::read)?,
            depth: table(&mut reader, "depth", DepthParameters::read)?,
            imu: table(&mut reader, "imu", ImuParameters::read)?,
            scanner: table(&mut reader, "scanner", ScannerParameters::read)?,
            odometry: table(&mut reader, "odometry", OdometryParameters::read)?,
            encoders: table(&mut reader, "encoders", EncoderParameters::read)?,
            command: table(&mut reader, "command", |s| Delay::read(s, "delay"))?,
        };
        reader.end("a table color, depth, imu, scanner, odometry, encoders or command")?;
        Ok(model)
    }

    /// Whether it uses the images of a camera.
    #[must_use]
    pub fn uses_images(&self) -> bool {
        self.color.is_some() || self.depth.is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = r#"origin = "here"
license = "Apache-2.0"

[odometry]
radius = { value = 0.01, unit = "1", source = "guess: a tyre loses pressure" }
track = { value = 0.01, unit = "1", source = "guess" }
slip = { value = 0.002, unit = "√m", source = "guess" }
angle_step = { value = 1e-3, unit = "rad", source = "guess" }
"#;

    #[test]
    fn a_file_is_parsed() {
        let model = Model::read("sensors/odometry.toml", GOOD).unwrap();
        assert_eq!(model.odometry.unwrap().slip, 0.002);
        assert!(model.imu.is_none() && !model.uses_images());
    }

    #[test]
    fn errors_include_line_key_and_fix() {
        let cases = [
            (
                "\"guess: a tyre loses pressure\"",
                "\"\"",
                "5",
                "odometry.radius",
                "source",
            ),
            (
                ", source = \"guess: a tyre loses pressure\"",
                "",
                "5",
                "odometry.radius",
                "source",
            ),
            (
                "0.01, unit = \"1\", source = \"guess\"",
                "7.0, unit = \"1\", source = \"guess\"",
                "6",
                "odometry.track",
                "0 to 0.3",
            ),
            (
                "unit = \"√m\"",
                "unit = \"m\"",
                "7",
                "odometry.slip",
                "\"√m\"",
            ),
            ("slip =", "slap =", "4", "odometry.slip", "absent"),
            (
                "angle_step = {",
                "angle_stop = { value = 1, unit = \"1\", source = \"guess\" }\nangle_step = {",
                "8",
                "odometry.angle_stop",
                "not",
            ),
            ("[odometry]", "[odometer]", "4", "odometer", "imu"),
            (
                "origin = \"here\"",
                "origin = \"\"",
                "1",
                "origin",
                "licence",
            ),
            ("radius = {", "radius = [", "5", "(file)", "TOML"),
            (
                "{ value = 1e-3, unit = \"rad\", source = \"guess\" }",
                "0.001",
                "8",
                "odometry.angle_step",
                "source",
            ),
        ];
        for (good, bad, line, key, word) in cases {
            assert!(GOOD.contains(good), "{good}");
            let text = GOOD.replacen(good, bad, 1);
            let error = Model::read("sensors/odometry.toml", &text)
                .unwrap_err()
                .to_string();
            let place = format!("sensors/odometry.toml:{line}: `{key}`");
            assert!(
                error.starts_with(&place) && error.contains(word),
                "{bad}: {error}"
            );
        }
    }
}
