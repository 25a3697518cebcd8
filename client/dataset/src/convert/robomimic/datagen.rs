//! MimicGen's additions: the hand, its target and every object as matrices, and
//! signals of finished subtasks. All poses are in `house`: MimicGen moves the
//! hand with the object, which needs one frame for both.

use hdf5::Group;
use hdf5::types::VarLenUnicode;

use super::arrays::{NUMBER, What, rows};
use crate::align::Signal;
use crate::convert::Recording;
use crate::convert::learning::Learning;
use crate::hdf::unicode;
use crate::label;
use crate::pose;

const POSE: What<'static> = ("m (translation), 1 (4x4 homogeneous matrix)", "house");

pub(super) fn write(
    group: &Group,
    recording: &Recording,
    learning: &Learning<'_>,
    here: &[usize],
) -> anyhow::Result<()> {
    let info = group.create_group("datagen_info")?;
    let matrices = |f: &dyn Fn(usize) -> pose::Pose| {
        here.iter()
            .flat_map(|&r| pose::matrix(&f(r)))
            .collect::<Vec<f64>>()
    };
    let mount = recording.arm_mount()?;
    let in_house = |row: usize, in_base: &[f64]| {
        let base = pose::compose(&pose::from_row(learning.chair(row)), &mount);
        pose::compose(&base, &pose::from_row(in_base))
    };
    let hand = matrices(&|r| in_house(r, learning.effector(r)));
    rows(&info, "eef_pose", POSE, &hand, &[4, 4])?;
    let target: &Signal = recording.need("applied", "desired_pose")?;
    let target = matrices(&|r| in_house(r, target.row(r)));
    rows(&info, "target_pose", POSE, &target, &[4, 4])?;
    let knuckle: Vec<f64> = here.iter().map(|&r| learning.knuckle_target(r)).collect();
    let what = ("rad (knuckle)", "");
    rows(&info, "gripper_action", what, &knuckle, &[1])?;
    let objects = info.create_group("object_poses")?;
    if let Some(signal) = recording.aligned.signal("object_pose", "pose") {
        for (i, name) in signal.meta.names.iter().enumerate() {
            let one = |r: usize| pose::from_row(signal.row(r).get(7 * i..7 * i + 7).unwrap_or(&[]));
            rows(&objects, name, POSE, &matrices(&one), &[4, 4])?;
        }
    }
    let signals = info.create_group("subtask_term_signals")?;
    for (number, phase) in label::NAMES.iter().enumerate().take(3) {
        // 1 from the moment the phase is over for the last time.
        let last = here
            .iter()
            .rposition(|&r| usize::from(recording.labels[r]) == number);
        let over: Vec<i64> = (0..here.len())
            .map(|i| i64::from(last.is_some_and(|l| i > l)))
            .collect();
        rows(&signals, phase, NUMBER, &over, &[])?;
    }
    let instruction = group.new_dataset::<VarLenUnicode>().create("instruction")?;
    instruction.write_scalar(&unicode(&recording.summary.instruction))?;
    Ok(())
}
