//! Memory in large pages: a ray in a big tree goes to places far apart, and with pages of 4 KiB the processor would have to
//! look up where nearly each of them is.

/// Asks for large pages where the next elements of a vector will lie, if they are many. To be called before they are
/// written, since it is then that pages are given out. Nothing but speed depends on it; elsewhere than on Linux it does
/// nothing.
pub(crate) fn advise<T>(vector: &mut Vec<T>) {
    let room = vector.spare_capacity_mut();
    #[cfg(target_os = "linux")]
    {
        const PAGE: usize = 1 << 21;
        let (start, size) = (room.as_mut_ptr() as usize, size_of_val(room));
        // Whole pages, within.
        let first = start.next_multiple_of(PAGE);
        let size = (start + size).saturating_sub(first) / PAGE * PAGE;
        if size > 0 {
            // SAFETY: the range lies within memory that the vector owns, and the advice changes nothing of what is in it.
            // That it may not be taken is no error.
            unsafe { libc::madvise(first as *mut libc::c_void, size, libc::MADV_HUGEPAGE) };
        }
    }
    #[cfg(not(target_os = "linux"))]
    let _ = room;
}
