//! The scenario at startup: a message in TOML, overridden by the command line. The rest
//! is as in [`Scenario::default`].

use wheelarm_proto::check::Invalid;
use wheelarm_proto::settings::Pacing;
use wheelarm_proto::v1;

use super::convert;
use crate::sim::Scenario;

/// Reads a scenario message from TOML: its fields by their names, `pacing` and
/// `quality` by the names of their values.
///
/// # Errors
/// With line, field and fix.
pub fn read(text: &str) -> Result<v1::Scenario, toml::de::Error> {
    toml::from_str(text)
}

/// The initial scenario of a server.
///
/// # Errors
/// [`Invalid`] that names the field.
pub fn scenario(request: &v1::Scenario) -> Result<Scenario, Invalid> {
    let mut start = Scenario::default();
    if let Some(pacing) = Pacing::from_proto(request.pacing()) {
        start.pacing = pacing;
    }
    convert::scenario_over(&start, request)
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheelarm_proto::settings::Quality;

    #[test]
    fn a_scenario_in_toml_equals_its_message() {
        let text = r#"
            task = "pick_bowl"
            seed = 7
            pacing = "lock-step"
            quality = "high"
            imu_rate_hz = 0.0

            [[cameras]]
            name = "room"
            width = 320
            height = 240

            [[objects]]
            name = "bowl"
            mass = 0.2
            friction = 0.5
            pose.position = { x = 1.0, y = 2.0, z = 0.8 }
            pose.orientation = { w = 1.0 }
        "#;
        let message = read(text).unwrap();
        let scenario = scenario(&message).unwrap();
        assert_eq!((scenario.scene.as_str(), scenario.seed), ("home", 7));
        assert_eq!(scenario.pacing, Pacing::LockStep);
        assert_eq!(scenario.quality, Quality::High);
        assert_eq!(scenario.imu_rate_hz, 0.0);
        assert_eq!(scenario.cameras.len(), 1);
        assert_eq!(scenario.cameras[0].rate_hz, 10.0);
        assert_eq!(scenario.objects[0].1.pose.translation.y, 2.0);
        // The reply of a server can be saved and started again.
        let message = convert::scenario(&scenario);
        let written = toml::to_string(&message).unwrap();
        assert_eq!(super::scenario(&read(&written).unwrap()), Ok(scenario));
    }

    #[test]
    fn a_wrong_field_is_named_with_the_fix() {
        for (text, words) in [
            ("sead = 7", "expected one of `scene`"),
            ("pacing = \"slow\"", "none of real-time, lock-step, fast"),
            (
                "[[cameras]]\nname = \"room\"\nsize = 3",
                "unknown field `size`",
            ),
        ] {
            let error = read(text).unwrap_err().to_string();
            assert!(error.contains(words) && error.contains("line"), "{error}");
        }
        let message = read("state_rate_hz = nan").unwrap();
        let error = scenario(&message).unwrap_err().to_string();
        assert!(error.contains("state_rate_hz"), "{error}");
    }
}
