//! `wheelarm replay FILE --as-recorded`: renders the recorded states, of any version
//! of the physics, without computing them.

use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;

use anyhow::{Context, bail};
use wheelarm_dataset::read::Episode;
use wheelarm_proto::{StreamId, TopicId, v1};
use wheelarm_rollout::{Driver, Playback, free_label};

use super::args::ReplayArgs;
use super::assets;
use super::calibration;
use super::recording::{self, Recorded};
use super::script;

/// Records the states of the file again with new images; exit code 3 when the
/// new recording is not complete.
///
/// # Errors
/// When the file contains no states, or a program does not reply.
pub(super) fn run(args: &ReplayArgs, out: &Path, episode: &Episode) -> anyhow::Result<ExitCode> {
    let started = episode.started()?;
    let scenario = episode.scenario()?;
    let states = episode.states()?;
    if states.is_empty() {
        bail!(
            "{} contains no recorded state to render",
            args.file.display()
        );
    }
    let mut cameras = script::cameras(&scenario, args.width, args.height, &args.camera);
    calibration::as_recorded(&mut cameras, episode)?;
    check_rates(&cameras, scenario.state_rate_hz())?;
    let depth = script::depth(episode)?;
    let adapters = args.graphics.of_workers(1)?;
    let robot = episode.robot()?;
    let playback = Playback {
        scenario: v1::Scenario {
            cameras: cameras.clone(),
            ..scenario.clone()
        },
        instruction: started.instruction.clone(),
        states,
        check_robot: Arc::new(move |loaded| warn_of_another_robot(&robot, loaded)),
    };
    let count = playback.states.len();
    let finished = recording::run(
        args,
        &scenario,
        cameras,
        (depth, adapters[0].as_deref()),
        (
            free_label(out, &format!("{}-as-recorded", started.label)),
            Driver::Playback(Arc::new(playback)),
        ),
    )?;
    let recorded = Recorded::new(args, &finished)?.context("nothing was recorded")?;
    println!("rendered {count} recorded states into {}", recorded.line());
    let computed = episode.streams()?.into_iter();
    let computed: Vec<_> = computed.filter(|name| is_computed(name)).collect();
    if !computed.is_empty() {
        println!(
            "skipped streams, because nothing was computed: {}",
            computed.join(", ")
        );
    }
    Ok(recorded.code())
}

/// Prints the visible differences between the loaded robot and the recorded one.
fn warn_of_another_robot(recorded: &v1::RobotDescription, loaded: &v1::RobotDescription) {
    let differences = assets::rendering_differences(recorded, loaded);
    if !differences.is_empty() {
        eprintln!(
            "the loaded robot is rendered, which differs from the recorded one (use the recorded \
             assets with --assets):\n  {}",
            differences.join("\n  ")
        );
    }
}

/// Rejects cameras with images between the recorded states.
fn check_rates(cameras: &[v1::CameraSetting], state_rate: f64) -> anyhow::Result<()> {
    for camera in cameras {
        let states = state_rate / camera.rate_hz();
        if (states - states.round()).abs() > 1e-9 || states < 1.0 {
            bail!(
                "camera {:?} is to render {} images per second, but {state_rate} states per second \
                 were recorded; choose a rate that divides this: --camera {}={}x{}@{}",
                camera.name,
                camera.rate_hz(),
                camera.name,
                camera.width,
                camera.height,
                state_rate / states.ceil().max(1.0)
            );
        }
    }
    Ok(())
}

/// Streams that follow from a computation and not from a state.
///
/// Names every topic: a new stream does not compile until its source is decided.
fn is_computed(stream: &str) -> bool {
    let Some(topic) = StreamId::parse(stream).topic() else {
        return false;
    };
    match topic {
        TopicId::SensedJoint
        | TopicId::SensedOdometry
        | TopicId::SensedImu
        | TopicId::Scan
        | TopicId::SensedScan
        | TopicId::Disturbance
        | TopicId::Person
        | TopicId::StateHash => true,
        TopicId::JointState
        | TopicId::Pose
        | TopicId::Imu
        | TopicId::Odometry
        | TopicId::Clock
        | TopicId::Command
        | TopicId::Applied
        | TopicId::ObjectPose
        | TopicId::FurnitureJoint
        | TopicId::Deformable
        | TopicId::Contact
        | TopicId::Evaluation
        | TopicId::Phase
        | TopicId::Event
        | TopicId::Camera
        | TopicId::CompressedCamera
        | TopicId::Sensor
        | TopicId::Preview
        | TopicId::EpisodeStart
        | TopicId::EpisodeStop
        | TopicId::SentCommand
        | TopicId::Refusal
        | TopicId::Recorder => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rate_without_states_is_rejected_with_a_valid_one() {
        let camera = |rate| v1::CameraSetting {
            name: "gen3".into(),
            width: 64,
            height: 48,
            rate_hz: Some(rate),
            ..v1::CameraSetting::default()
        };
        assert!(check_rates(&[camera(10.0), camera(2.5), camera(5.0)], 10.0).is_ok());
        for (rate, cure) in [(30.0, "gen3=64x48@10"), (4.0, "gen3=64x48@3.33")] {
            let error = check_rates(&[camera(rate)], 10.0).unwrap_err().to_string();
            assert!(error.contains(cure), "{error}");
        }
    }
}
