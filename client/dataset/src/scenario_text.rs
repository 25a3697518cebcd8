//! The scenario as readable JSON, for people and for tools without protobuf: in
//! the words of the message, which are those of the TOML that
//! `wheelarm-server --scenario` accepts. `scenario.proto` gives the units.

use serde_json::Value;
use wheelarm_proto::settings::{Named, Pacing, Quality};
use wheelarm_proto::v1;

/// The scenario; absent fields are left out.
#[must_use]
pub fn scenario_json(s: &v1::Scenario) -> Value {
    let mut value = serde_json::to_value(s).unwrap_or_default();
    leave_out_absent(&mut value);
    value
}

/// TOML cannot express an absent value, so the JSON does not either.
fn leave_out_absent(value: &mut Value) {
    match value {
        Value::Object(fields) => {
            fields.retain(|_, field| !field.is_null());
            fields.values_mut().for_each(leave_out_absent);
        }
        Value::Array(items) => items.iter_mut().for_each(leave_out_absent),
        _ => {}
    }
}

/// Name of a pacing; real time where none is set.
#[must_use]
pub fn pacing(value: i32) -> &'static str {
    let code = v1::Pacing::try_from(value);
    code.map_or("unknown", |code| {
        Pacing::from_proto(code).unwrap_or(Pacing::RealTime).name()
    })
}

/// Name of a quality; standard where none is set.
#[must_use]
pub fn quality(value: i32) -> &'static str {
    let code = v1::RenderQuality::try_from(value);
    code.map_or("unknown", |code| {
        Quality::from_proto(code)
            .unwrap_or(Quality::Standard)
            .name()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shown_scenario_is_valid_input_of_a_server() {
        let pose = v1::Pose {
            position: Some(v1::Vector3 {
                x: -3.79,
                y: 0.1 + 0.2,
                z: 0.8,
            }),
            orientation: Some(v1::Quaternion {
                w: 1.0,
                ..v1::Quaternion::default()
            }),
        };
        let scenario = v1::Scenario {
            scene: "home".into(),
            task: Some("pick_bowl".into()),
            seed: Some(7),
            cameras: vec![v1::CameraSetting {
                name: "gen3".into(),
                width: 320,
                height: 180,
                rate_hz: Some(10.0),
                ..v1::CameraSetting::default()
            }],
            pacing: v1::Pacing::LockStep.into(),
            quality: v1::RenderQuality::Fast.into(),
            starts: v1::Starts::Anywhere.into(),
            objects: vec![v1::ObjectPlacement {
                name: "bowl".into(),
                pose: Some(pose),
                mass: Some(0.2),
                friction: None,
            }],
            arm_positions: vec![0.5; 7],
            knuckle: Some(0.0),
            ..v1::Scenario::default()
        };
        let shown = scenario_json(&scenario);
        assert_eq!(shown["pacing"], "lock-step");
        assert_eq!(shown["objects"][0]["mass"], 0.2);
        assert_eq!(shown["objects"][0].get("friction"), None);
        let pasted = toml::to_string(&shown).unwrap();
        assert_eq!(toml::from_str(&pasted), Ok(scenario));
        // Also where nothing is set.
        let nothing = toml::to_string(&scenario_json(&v1::Scenario::default())).unwrap();
        assert_eq!(toml::from_str(&nothing), Ok(v1::Scenario::default()));
    }
}
