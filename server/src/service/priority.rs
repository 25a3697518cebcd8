//! Who comes first on a scarce processor.

/// Lowers the priority of this thread and of those that it starts, the driver's
/// among them: on a scarce processor commands, physics and recorders come first, and
/// take the processor as soon as they wake (kernels from 6.12; before, at the end of a
/// slice of some milliseconds).
pub(super) fn step_back() {
    const NICER: i32 = 5;
    if let Ok(nice) = rustix::process::nice(NICER) {
        long_slices(nice);
    }
}

/// Asks for slices of 0.1 s, the longest, for this thread and those that it starts:
/// what wakes and has shorter ones does not wait for the end of theirs.
#[cfg(target_os = "linux")]
#[expect(unsafe_code, reason = "no safe wrapper has this system call")]
fn long_slices(nice: i32) {
    let wanted = libc::sched_attr {
        size: std::mem::size_of::<libc::sched_attr>() as u32,
        sched_policy: libc::SCHED_OTHER as u32,
        sched_flags: 0,
        sched_nice: nice,
        sched_priority: 0,
        sched_runtime: 100_000_000,
        sched_deadline: 0,
        sched_period: 0,
    };
    let this_thread = 0;
    // SAFETY: the kernel reads `size` bytes of a structure that lives longer. Where it
    // refuses, slices stay what they were.
    unsafe {
        libc::syscall(libc::SYS_sched_setattr, this_thread, &raw const wanted, 0);
    }
}

#[cfg(not(target_os = "linux"))]
fn long_slices(_nice: i32) {}
