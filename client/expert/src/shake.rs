//! A test of a grasp: the hand moves to and fro with the object.

use wheelarm_proto::v1;

/// Speed of the hand, m/s.
const SPEED: f64 = 0.3;
/// Control ticks of one stroke, of the whole test, and of the rest after it, at 60 Hz.
const STROKE: u32 = 12;
const SHAKEN: u32 = 180;
const REST: u32 = 30;
/// Largest motion of the object in the hand, metres.
const SLIP: f64 = 0.020;

/// The command of a tick of the test; `None` after its end.
#[must_use]
pub fn command(tick: u32) -> Option<v1::Command> {
    if tick >= SHAKEN + REST {
        return None;
    }
    // Half a stroke first: the hand stays about its place.
    let stroke = (tick + STROKE / 2) / STROKE;
    let speed = if stroke.is_multiple_of(2) {
        SPEED
    } else {
        -SPEED
    };
    let twist = v1::Twist {
        linear: Some(v1::Vector3 {
            x: 0.0,
            y: speed,
            z: 0.0,
        }),
        angular: Some(v1::Vector3::default()),
    };
    let target = match tick < SHAKEN {
        true => v1::arm_command::Target::Twist(v1::CartesianTwist {
            frame: v1::CommandFrame::BaseLink.into(),
            twist: Some(twist),
        }),
        false => v1::arm_command::Target::Hold(true),
    };
    Some(v1::Command {
        arm: Some(v1::ArmCommand {
            target: Some(target),
        }),
        phase: v1::Phase::Retracting.into(),
        phase_name: "shaking".to_owned(),
        ..v1::Command::default()
    })
}

/// The failure of a grasp whose object moved so far in the hand, metres.
#[must_use]
pub fn verdict(moved: f64) -> Option<String> {
    (moved > SLIP).then(|| format!("slipped: {:.0} mm in the hand when shaken", moved * 1e3))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hand_returns_to_its_place_and_rests() {
        let mut sum = 0.0;
        let mut last = None;
        for tick in 0.. {
            let Some(command) = command(tick) else {
                break;
            };
            last = command.arm.and_then(|arm| arm.target);
            if let Some(v1::arm_command::Target::Twist(twist)) = &last {
                sum += twist.twist.and_then(|t| t.linear).unwrap_or_default().y;
            }
        }
        assert!(sum.abs() <= SPEED * f64::from(STROKE), "{sum}");
        assert_eq!(last, Some(v1::arm_command::Target::Hold(true)));
    }

    #[test]
    fn object_that_slips_by_centimetres_fails() {
        assert_eq!(verdict(0.004), None);
        assert!(verdict(0.032).unwrap().starts_with("slipped"));
    }
}
