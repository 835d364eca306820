//! Hints to the caches.
//!
//! Paths without order wait for memory more than they compute: facets, texels and tables that will be read some hundred
//! instructions later are asked for as soon as it is known which.

/// Tells the caches that `item` will be read soon. Reads nothing; elsewhere than on x86-64 it does nothing.
#[inline(always)]
pub fn prefetch<T>(item: &T) {
    #[cfg(target_arch = "x86_64")]
    for offset in (0..size_of::<T>().max(1)).step_by(64) {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        let line = std::ptr::from_ref(item).cast::<i8>().wrapping_add(offset);
        // SAFETY: part of the baseline (SSE), and a hint: it reads nothing, whatever the address.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(line) }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = item;
}

/// [`prefetch`] of an item of a slice; nothing where there is none.
#[inline(always)]
pub fn prefetch_at<T>(items: &[T], index: usize) {
    if let Some(item) = items.get(index) {
        prefetch(item);
    }
}
