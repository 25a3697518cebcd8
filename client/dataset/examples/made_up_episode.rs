//! Writes a made-up episode of 20 s into a folder, for trying out readers and
//! the contact sheet without a simulation.
//!
//! `cargo run --release --example made_up_episode -- DIR`

mod synthetic;

use std::path::PathBuf;

fn main() -> anyhow::Result<()> {
    let dir = std::env::args()
        .nth(1)
        .map_or_else(|| PathBuf::from("data"), PathBuf::from);
    let log = synthetic::smooth::record(&dir, "made_up", 20, (640, 360))?;
    let finished = wheelarm_dataset::finish::finish(&log, None)?;
    println!("{}", finished.path.display());
    Ok(())
}
