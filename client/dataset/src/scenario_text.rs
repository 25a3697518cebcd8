//! The scenario as readable JSON, for people and for tools without protobuf.

use serde_json::{Value, json};
use wheelarm_proto::settings::{LanguageSplit, Named, Starts};
use wheelarm_proto::v1;

/// The scenario with units in its keys.
#[must_use]
pub fn scenario_json(s: &v1::Scenario) -> Value {
    json!({
        "scene": s.scene,
        "task": s.task(),
        "seed": s.seed(),
        "robot": s.robot,
        "instruction": s.instruction(),
        "pacing": pacing(s.pacing),
        "quality": quality(s.quality),
        "state_rate_hz": s.state_rate_hz(),
        "deformable_rate_hz": s.deformable_rate_hz(),
        "imu_rate_hz": s.imu_rate_hz(),
        "imu_noise": s.imu_noise(),
        "cameras": s.cameras.iter().map(|c| json!({
            "name": c.name,
            "width_pixels": c.width,
            "height_pixels": c.height,
            "rate_hz": c.rate_hz(),
        })).collect::<Vec<_>>(),
        "objects": s.objects.iter().map(|o| json!({
            "name": o.name,
            "pose_in_house": o.pose.as_ref().map(pose),
            "mass_kg": o.mass,
            "friction": o.friction,
        })).collect::<Vec<_>>(),
        "slides": s.slides.iter().map(|slide| json!({
            "joint": slide.joint,
            "friction_newton": slide.friction,
            "damping_newton_second_per_metre": slide.damping,
            "position_m": slide.position,
        })).collect::<Vec<_>>(),
        "target": s.target(),
        "start_of_wheelchair_root_in_house": s.start.as_ref().map(pose),
        "starts": Starts::told(s.starts()).unwrap_or_default().name(),
        "arm_positions_rad": s.arm_positions,
        "knuckle_rad": s.knuckle,
        "variant": s.variant,
        "variant_share": s.variant_share,
        "language": s.language.as_ref().map(|l| json!({
            "seed": l.seed,
            "split": LanguageSplit::told(l.split()).unwrap_or_default().name(),
            "typo_share": l.typo_share,
            "politeness_share": l.politeness_share,
            "ambiguous_share": l.ambiguous_share,
            "template": l.template,
            "ambiguous": l.ambiguous,
            "question": l.question,
        })),
    })
}

fn pose(p: &v1::Pose) -> Value {
    json!({
        "position_m": p.position.map(|v| [v.x, v.y, v.z]),
        "quaternion_xyzw": p.orientation.map(|q| [q.x, q.y, q.z, q.w]),
    })
}

/// Name of a pacing.
#[must_use]
pub fn pacing(value: i32) -> &'static str {
    match v1::Pacing::try_from(value) {
        Ok(v1::Pacing::Unspecified | v1::Pacing::RealTime) => "real_time",
        Ok(v1::Pacing::LockStep) => "lock_step",
        Ok(v1::Pacing::Fast) => "fast",
        Err(_) => "unknown",
    }
}

/// Name of a quality tier.
#[must_use]
pub fn quality(value: i32) -> &'static str {
    match v1::RenderQuality::try_from(value) {
        Ok(v1::RenderQuality::Unspecified | v1::RenderQuality::Standard) => "standard",
        Ok(v1::RenderQuality::Fast) => "fast",
        Ok(v1::RenderQuality::High) => "high",
        Err(_) => "unknown",
    }
}
