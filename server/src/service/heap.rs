//! What the C library's allocator keeps of memory that is free.

/// Gives the kernel back what lies free in the heap, in some milliseconds. What a
/// scene and its shaders were made of is some 30 MB, spread over the heaps of as many
/// threads as made it, and nobody asks for as much again.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
#[expect(unsafe_code, reason = "the C library's call has no safe name")]
pub(super) fn give_back() {
    // SAFETY: `malloc_trim` takes a number, locks the heaps itself, and moves nothing
    // that is in use.
    unsafe {
        libc::malloc_trim(0);
    }
}

#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub(super) fn give_back() {}
