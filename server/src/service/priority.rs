//! Who comes first on a scarce processor.

/// Lowers the priority of this thread and of those that it starts, the driver's
/// among them: on a scarce processor commands, physics and recorders come first.
pub(super) fn step_back() {
    const NICER: i32 = 5;
    let _ = rustix::process::nice(NICER);
}
