//! Authors and licenses of a data set with world packs: `README.md` in the form of the
//! Hugging Face data card, and `meta/world_packs.json`.

use std::path::Path;

use serde_json::Value;

use super::set::Set;
use crate::credits::{PackCredits, card_section};

/// Writes both files; none for a set without world packs, whose content is part of
/// WheelArm.
pub(super) fn write(folder: &Path, set: &Set) -> anyhow::Result<()> {
    if set.packs.is_empty() {
        return Ok(());
    }
    let credits: Value = set.packs.iter().map(PackCredits::json).collect();
    std::fs::write(
        folder.join("meta/world_packs.json"),
        format!("{credits:#}\n"),
    )?;
    let card = format!(
        "---\nlicense: other\nlicense_name: see-world-packs\ntask_categories:\n- robotics\n\
         tags:\n- LeRobot\n- WheelArm\n---\n\n# Episodes of WheelArm\n\n\
         {} episodes, {} frames, simulated; a LeRobot data set of version 3.0.\n\n{}",
        set.episodes.len(),
        set.rows,
        card_section(&set.packs)
    );
    std::fs::write(folder.join("README.md"), card)?;
    Ok(())
}
