//! Returns free heap memory to the kernel.

/// Returns free heap memory to the kernel within milliseconds: about 30 MB after scene
/// and shaders are set up, spread over the heaps of all threads.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
#[expect(unsafe_code, reason = "the C library's call has no safe name")]
pub(super) fn trim() {
    // SAFETY: `malloc_trim` takes a number, locks the heaps itself, and does not move
    // memory in use.
    unsafe {
        libc::malloc_trim(0);
    }
}

#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub(super) fn trim() {}
