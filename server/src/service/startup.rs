//! The scenario at start-up: a message, written as TOML, with what the command
//! line says over it. What neither says is as in [`Scenario::default`].

use wheelarm_proto::check::Invalid;
use wheelarm_proto::settings::Pacing;
use wheelarm_proto::v1;

use super::convert;
use crate::sim::Scenario;

/// Reads a scenario message from TOML: its fields by their names, `pacing` and
/// `quality` by the names of their values.
///
/// # Errors
/// With line, field and what would be right.
pub fn read(text: &str) -> Result<v1::Scenario, toml::de::Error> {
    toml::from_str(text)
}

/// The scenario that a server is to start with.
///
/// # Errors
/// [`Invalid`] that names the field.
pub fn scenario(asked: &v1::Scenario) -> Result<Scenario, Invalid> {
    let mut start = Scenario::default();
    if let Some(pacing) = Pacing::told(asked.pacing()) {
        start.pacing = pacing;
    }
    convert::scenario_over(&start, asked)
}

#[cfg(test)]
mod tests {
    use super::*;
    use wheelarm_proto::settings::Quality;

    #[test]
    fn a_scenario_in_toml_is_what_the_message_says() {
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
        // What a server answers can be written down and started again.
        let told = convert::scenario(&scenario);
        let written = toml::to_string(&told).unwrap();
        assert_eq!(super::scenario(&read(&written).unwrap()), Ok(scenario));
    }

    #[test]
    fn a_wrong_field_is_named_with_the_cure() {
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
