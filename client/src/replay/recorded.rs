//! `wheelarm replay FILE --as-recorded`: draws the recorded states anew, whatever
//! version of the physics made them. Nothing is computed, so nothing can differ.

use std::path::Path;
use std::process::ExitCode;

use anyhow::{Context, bail};
use wheelarm_dataset::read::Episode;
use wheelarm_link::Link;
use wheelarm_proto::v1;
use wheelarm_rollout::free_label;

use super::args::ReplayArgs;
use super::assets;
use super::calibration;
use super::rig::Rig;
use super::script;

/// Records the states of the file again with new pictures; exit code 3 when the
/// new recording is not complete.
///
/// # Errors
/// When the file holds no states, or a program does not answer.
pub(super) fn run(args: &ReplayArgs, out: &Path, episode: &Episode) -> anyhow::Result<ExitCode> {
    let started = episode.started()?;
    let scenario = episode.scenario()?;
    let states = episode.states()?;
    let Some((first, others)) = states.split_first() else {
        bail!(
            "{} holds no recorded state that could be drawn",
            args.file.display()
        );
    };
    let mut cameras = script::cameras(&scenario, args.width, args.height, &args.camera);
    calibration::as_recorded(&mut cameras, episode)?;
    check_rates(&cameras, scenario.state_rate_hz())?;
    let depth = script::depth(episode)?;
    let adapters = args.graphics.of_workers(1)?;
    let mut rig = Rig::start(
        args,
        &scenario,
        cameras.clone(),
        depth,
        adapters[0].as_deref(),
    )?;
    let request = v1::ResetRequest {
        scenario: Some(v1::Scenario {
            cameras,
            pacing: v1::Pacing::LockStep.into(),
            quality: v1::RenderQuality::Unspecified.into(),
            ..scenario
        }),
        playback: true,
        ..v1::ResetRequest::default()
    };
    let link = &rig.link;
    link.ask(&request).with_context(|| rig.server.tail())?;
    if let Some(loaded) = link.ask(&v1::SceneRequest {})?.robot {
        let told = assets::drawn_otherwise(&episode.robot()?, &loaded);
        if !told.is_empty() {
            eprintln!(
                "the loaded robot is drawn, which is another than the recorded one (take the \
                 recorded assets with --assets):\n  {}",
                told.join("\n  ")
            );
        }
    }
    link.ask(first).with_context(|| {
        "the recorded states do not fit the assets; replay with those of the recording: --assets"
    })?;
    let request = v1::EpisodeStartRequest {
        label: free_label(out, &format!("{}-as-recorded", started.label)),
        instruction: Some(started.instruction.clone()),
        require_recorders: rig.recorders(),
        ..v1::EpisodeStartRequest::default()
    };
    let begun = link.ask(&request).with_context(|| rig.server.tail())?;
    let shown = show(link, others);
    // What broke off is not worth a file.
    link.stop_episode_of(&begun, shown.is_err())?;
    shown?;
    let recorded = rig.recorded(&begun)?.context("nothing was recorded")?;
    println!(
        "drew {} recorded states into {}",
        states.len(),
        recorded.line()
    );
    let computed = episode.streams()?.into_iter();
    let computed: Vec<_> = computed.filter(|name| is_computed(name)).collect();
    if !computed.is_empty() {
        println!(
            "left out, for nothing was computed: {}",
            computed.join(", ")
        );
    }
    rig.stop()?;
    Ok(recorded.code())
}

fn show(link: &Link, states: &[v1::ShowRequest]) -> anyhow::Result<()> {
    for state in states {
        link.ask(state)
            .with_context(|| format!("showing the state of tick {}", state.tick))?;
    }
    Ok(())
}

/// Pictures can be drawn only where a state was recorded.
fn check_rates(cameras: &[v1::CameraSetting], state_rate: f64) -> anyhow::Result<()> {
    for camera in cameras {
        let states = state_rate / camera.rate_hz();
        if (states - states.round()).abs() > 1e-9 || states < 1.0 {
            bail!(
                "camera {:?} is to take {} pictures a second, but {state_rate} states a second \
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
fn is_computed(stream: &str) -> bool {
    stream.starts_with("sensed_") || matches!(stream, "disturbance" | "state_hash" | "person")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_without_states_is_refused_with_one_that_has_them() {
        let camera = |rate| v1::CameraSetting {
            name: "gen3".into(),
            width: 64,
            height: 48,
            rate_hz: Some(rate),
            ..v1::CameraSetting::default()
        };
        assert!(check_rates(&[camera(10.0), camera(2.5), camera(5.0)], 10.0).is_ok());
        for (rate, cure) in [(30.0, "gen3=64x48@10"), (4.0, "gen3=64x48@3.33")] {
            let told = check_rates(&[camera(rate)], 10.0).unwrap_err().to_string();
            assert!(told.contains(cure), "{told}");
        }
    }
}
