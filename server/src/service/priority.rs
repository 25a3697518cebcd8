//! Thread priorities for busy CPUs.

/// Lowers the priority of this thread and of those that it starts, including the
/// driver's: commands, physics and recorders have priority.
pub(super) fn step_back() {
    const NICER: i32 = 5;
    let _ = rustix::process::nice(NICER);
}
