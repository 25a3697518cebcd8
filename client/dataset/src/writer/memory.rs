//! Allocator settings for the memory of images.

/// Makes the allocator keep freed memory of images, up to 128 MiB of each
/// of its arenas, for later images. By default, glibc hands blocks of their
/// size back to the system, whose fresh pages then cost several times what is
/// written into them. It affects the whole process, from the first episode on.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
pub(super) fn keep() {
    use std::sync::Once;

    // About the budget between the threads of a writer.
    const KEPT: i32 = 128 << 20;
    // Larger blocks are mapped one by one; this is glibc's maximum.
    const BLOCK: i32 = 32 << 20;
    static ONCE: Once = Once::new();

    ONCE.call_once(|| {
        #[expect(
            unsafe_code,
            reason = "two calls into the C library that take numbers; what it refuses it leaves as it was"
        )]
        // SAFETY: `mallopt` may be called at any time, from one thread.
        unsafe {
            libc::mallopt(libc::M_MMAP_THRESHOLD, BLOCK);
            libc::mallopt(libc::M_TRIM_THRESHOLD, KEPT);
        }
    });
}

/// Other allocators keep their defaults.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub(super) fn keep() {}
