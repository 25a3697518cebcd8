//! Root attributes, `/scenario`, `/robot` and `/initial_state`.

use std::collections::BTreeSet;

use hdf5::{File, Group};
use prost::Message;
use wheelarm_proto::v1;

use crate::account::{Account, StreamAccount};
use crate::columns::Context;
use crate::depth::Depth;
use crate::ending::end_cause;
use crate::hdf::{self, Attributes};
use crate::log::{Preamble, Scan};
use crate::scenario_text::{pacing, quality, scenario_json};

/// Sets everything that describes the episode as a whole.
pub(super) fn attributes(
    file: &File,
    scan: &Scan,
    account: &Account,
    evaluation: Option<&v1::Evaluation>,
    context: &Context,
) -> hdf5::Result<()> {
    let preamble = &scan.preamble;
    let started = preamble.started.clone().unwrap_or_default();
    let scenario = started.scenario.clone().unwrap_or_default();
    let header = started.header.clone().unwrap_or_default();
    let stopped = scan.closing.as_ref().and_then(|c| c.stopped.as_ref());
    let at = Attributes::for_object(file);
    at.text("format", "wheelarm episode")?
        .text("schema_version", wheelarm_proto::SCHEMA_VERSION)?
        .text("label", &started.label)?
        .text("instruction", &started.instruction)?
        .text("task", scenario.task())?
        .text("activity", &started.activity)?
        .text("area", &started.area)?
        .text("scene", &scenario.scene)?
        .set("seed", scenario.seed())?
        .text("pacing", pacing(scenario.pacing))?
        .text("quality", quality(scenario.quality))?
        .text("adapter", &started.adapter)?
        .text("server_version", &started.version)?
        .set("physics_version", started.physics_version)?
        .set("as_recorded", started.as_recorded)?
        .text("recorder", &preamble.recorder)?
        .text("recorder_version", &preamble.software)?
        .text("run_id", &header.run_id)?
        .set("episode", header.episode)?
        .set("first_tick", header.tick)?
        .text(
            "depth_unit",
            match preamble.depth() {
                Depth::Metres => "m",
                Depth::Millimetres => "mm",
                Depth::Nothing => "none",
            },
        )?;

    at.set("complete", account.complete())?
        .set("partial", !account.complete())?
        .texts("problems", &account.problems)?
        .set("samples_received", account.total(|s| s.received))?
        .set("samples_recovered", account.total(|s| s.recovered))?
        .texts("objects", &context.objects)?;
    counts(
        &at,
        ["samples_expected", "samples_missed"],
        [account.total(|s| s.expected), account.total(|s| s.missed)],
        account.counted(),
    )?;
    let cameras: Vec<String> = started.cameras.clone();
    at.texts("cameras", &cameras)?;
    if let Some(stopped) = stopped {
        at.set("wall_seconds", stopped.wall_seconds)?;
        if let Some(last) = &stopped.header {
            at.set("last_tick", last.tick)?;
        }
    }

    let cause = stopped.map_or(v1::EndCause::Unspecified, v1::EpisodeStopped::cause);
    let anomalies = stopped.map(|s| s.anomalies.as_slice()).unwrap_or_default();
    let kinds = stopped
        .into_iter()
        .flat_map(v1::EpisodeStopped::anomaly_kinds);
    let kinds: Vec<String> = kinds.map(v1::AnomalyKind::word).collect();
    at.text("end_cause", end_cause(cause))?
        .texts("anomalies", anomalies)?
        .texts("anomaly_kinds", &kinds)?;

    // Without an evaluation the success of the task is unknown, and of an
    // unstable simulation no result is valid.
    let sound = cause != v1::EndCause::Physics;
    at.set("success", sound && evaluation.is_some_and(|e| e.success))?
        .text(
            "failure_reason",
            evaluation.map_or("", |e| e.failure.as_str()),
        )?
        .text(
            "failure_code",
            &evaluation.map_or_else(String::new, |e| e.failure_reason().word()),
        )?;
    if let Some(evaluation) = evaluation {
        at.set("task_seconds", evaluation.elapsed_seconds)?;
        let mut named = BTreeSet::new();
        for condition in &evaluation.conditions {
            if !named.insert(&condition.name) {
                continue;
            }
            at.set(&format!("condition {}", condition.name), condition.holds)?
                .set(
                    &format!("condition value {}", condition.name),
                    condition.value,
                )?;
        }
    }
    Ok(())
}

/// Sets one stream's account on its group.
pub(super) fn account(group: &Group, stream: &StreamAccount) -> hdf5::Result<()> {
    let at = Attributes::for_object(group);
    counts(
        &at,
        ["expected", "missed"],
        [stream.expected, stream.missed],
        stream.counted,
    )?;
    at.set("received", stream.received)?
        .set("recovered", stream.recovered)?
        .text("digest", &stream.digest)?
        .text("digest_published", &stream.published)?;
    Ok(())
}

/// Counts of the server's manifest; without it they are -1 for unknown, and
/// the lower bound is stored in `NAME_at_least`.
fn counts(
    at: &Attributes<'_>,
    names: [&str; 2],
    values: [u64; 2],
    counted: bool,
) -> hdf5::Result<()> {
    for (name, value) in names.into_iter().zip(values) {
        if counted {
            at.set(name, value)?;
        } else {
            at.set(name, -1_i64)?
                .set(&format!("{name}_at_least"), value)?;
        }
    }
    Ok(())
}

/// Writes `/scenario`.
pub(super) fn scenario(file: &File, scan: &Scan) -> hdf5::Result<()> {
    let group = file.create_group("scenario")?;
    let started = scan.preamble.started.clone().unwrap_or_default();
    let scenario = started.scenario.clone().unwrap_or_default();
    hdf::bytes(&group, "message", &scenario.encode_to_vec())?;
    let text = format!("{:#}", scenario_json(&scenario));
    hdf::text(&group, "text", &text)?;
    Attributes::for_object(&group)
        .text("message", "wheelarm.v1.Scenario")?
        .text("scene", &scenario.scene)?
        .text("task", scenario.task())?
        .text("robot", &scenario.robot)?
        .set("seed", scenario.seed())?
        .set("state_rate_hz", scenario.state_rate_hz())?
        .set("deformable_rate_hz", scenario.deformable_rate_hz())?
        .set("imu_rate_hz", scenario.imu_rate_hz())?
        .set("scan_rate_hz", scenario.scan_rate_hz())?
        .set("imu_noise", scenario.imu_noise())?;
    if let Some(appearance) = &scenario.appearance {
        Attributes::for_object(&group).text("look", &appearance.to_string())?;
    }
    hdf::bytes(&group, "episode_started", &started.encode_to_vec())?;
    if let Some(stopped) = scan.closing.as_ref().and_then(|c| c.stopped.as_ref()) {
        hdf::bytes(&group, "episode_stopped", &stopped.encode_to_vec())?;
    }
    Ok(())
}

/// Writes `/robot`: the received description, and what users look for in
/// it as attributes.
pub(super) fn robot(file: &File, robot: &v1::RobotDescription) -> hdf5::Result<()> {
    let group = file.create_group("robot")?;
    hdf::bytes(&group, "message", &robot.encode_to_vec())?;
    let joints: Vec<&str> = robot.joint_names().collect();
    let roles = robot.joints.iter().map(|joint| joint.role().as_str_name());
    let roles: Vec<&str> = roles.collect();
    let frames: Vec<&str> = robot.frame_names().collect();
    let parents: Vec<&str> = robot.frames.iter().map(|f| f.parent.as_str()).collect();
    let cameras: Vec<&str> = robot.cameras.iter().map(|c| c.name.as_str()).collect();
    let gripper = robot.gripper_or_default();
    let drive = robot.drive.unwrap_or_default();
    let mount = robot.arm_mount.unwrap_or_default();
    let (at, turned) = (
        mount.position.unwrap_or_default(),
        mount.orientation.unwrap_or_default(),
    );
    Attributes::for_object(&group)
        .text("message", "wheelarm.v1.RobotDescription")?
        .text("name", &robot.name)?
        .texts("joints", &joints)?
        .texts("joint_roles", &roles)?
        .texts("arm_joints", &robot.arm_joint_names())?
        .texts("frames", &frames)?
        .texts("frame_parents", &parents)?
        .texts("cameras", &cameras)?
        .text("root_link", &robot.root_link)?
        .text("arm_base_link", &robot.arm_base_link)?
        .text("end_effector_link", &robot.end_effector_link)?
        .numbers(
            "arm_mount",
            &[at.x, at.y, at.z, turned.x, turned.y, turned.z, turned.w],
        )?
        .set("tool_length", robot.tool_length)?
        .set("gripper_stroke", gripper.stroke)?
        .set("gripper_closed", gripper.closed)?
        .set("gripper_usual_force", gripper.usual_force)?
        .set("gripper_max_force", gripper.max_force)?
        .set("track", drive.track)?
        .set("wheel_radius", drive.wheel_radius)?;
    Ok(())
}

/// Writes `/packs`: the zip file of each world pack, for replays without its folder.
pub(super) fn packs(file: &File, preamble: &Preamble) -> hdf5::Result<()> {
    let packs = preamble.snapshot.iter().flat_map(|state| &state.packs);
    let packs: Vec<&v1::PackFile> = packs.collect();
    if packs.is_empty() {
        return Ok(());
    }
    let group = file.create_group("packs")?;
    for pack in packs {
        let about = pack.pack.clone().unwrap_or_default();
        let data = group
            .new_dataset::<u8>()
            .shape([pack.zip.len()])
            .create(about.name.as_str())?;
        if !pack.zip.is_empty() {
            data.write(&pack.zip[..])?;
        }
        Attributes::for_object(&data)
            .text("version", &about.version)?
            .text("physics_digest", &about.physics_digest)?
            .text("rendering_digest", &about.rendering_digest)?;
    }
    Ok(())
}

/// Writes `/initial_state`.
pub(super) fn initial_state(file: &File, preamble: &Preamble) -> hdf5::Result<()> {
    let group = file.create_group("initial_state")?;
    let default = v1::SnapshotReply::default();
    let state = preamble.snapshot.as_ref().unwrap_or(&default);
    let header = state.header.clone().unwrap_or_default();
    hdf::bytes(&group, "snapshot", &state.snapshot)?;
    hdf::bytes(&group, "furniture_urdf", state.furniture_urdf.as_bytes())?;
    Attributes::for_object(&group)
        .text("run_id", &header.run_id)?
        .set("episode", header.episode)?
        .set("sequence", header.sequence)?
        .set("stamp_nanos", header.stamp_nanos)?
        .set("tick", header.tick)?;

    let assets = group.create_group("assets")?;
    let paths: Vec<&str> = state.assets.iter().map(|a| a.path.as_str()).collect();
    let texts: Vec<&str> = state.assets.iter().map(|a| a.text.as_str()).collect();
    hdf::texts(&assets, "path", &paths)?;
    hdf::texts(&assets, "text", &texts)?;

    let instances = group.create_group("instances")?;
    let names: Vec<&str> = state.instances.iter().map(|i| i.name.as_str()).collect();
    type Column = (&'static str, fn(&v1::Instance) -> u32);
    let columns: [Column; 3] = [
        ("id", |i| i.id),
        ("kind", |i| u32::try_from(i.kind).unwrap_or_default()),
        ("part", |i| u32::try_from(i.part).unwrap_or_default()),
    ];
    for (name, of) in columns {
        let values: Vec<u32> = state.instances.iter().map(of).collect();
        let data = instances
            .new_dataset::<u32>()
            .shape([values.len()])
            .create(name)?;
        if !values.is_empty() {
            data.write(&values)?;
        }
    }
    hdf::texts(&instances, "name", &names)
}
