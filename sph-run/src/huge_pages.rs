//! Memory in huge pages: sweeps touch many places at once, more than the processor remembers pages of 4 kB.

use std::alloc::{GlobalAlloc, Layout, System};

/// The system's allocator, which asks for huge pages where much is taken at once. Elsewhere than on Linux it is the
/// system's alone; where huge pages are switched off, asking for them does nothing.
#[derive(Debug)]
pub struct HugePages;

const PAGE: usize = 2 << 20;
/// What is smaller than this stays in small pages, bytes.
const LARGE: usize = 2 * PAGE;

/// How much of it the system's allocator is asked for.
fn placed(layout: Layout) -> Layout {
    if layout.size() < LARGE { layout } else { layout.align_to(PAGE).expect("a huge page's size is a power of two") }
}

// SAFETY: all memory comes from the system's allocator and goes back to it, under the layout that `placed` makes of the
// caller's, the same each time; and a larger alignment than asked for serves the caller.
unsafe impl GlobalAlloc for HugePages {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller's promise, of a size above 0.
        let memory = unsafe { System.alloc(placed(layout)) };
        #[cfg(target_os = "linux")]
        if layout.size() >= LARGE && !memory.is_null() {
            // SAFETY: advice on memory that is ours; whether it is taken makes no difference to what is in it.
            unsafe { libc::madvise(memory.cast(), layout.size(), libc::MADV_HUGEPAGE) };
        }
        memory
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // SAFETY: it was allocated under this layout.
        unsafe { System.dealloc(memory, placed(layout)) }
    }

    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        if layout.size() < LARGE && size < LARGE {
            // SAFETY: both layouts are the caller's own.
            return unsafe { System.realloc(memory, layout, size) };
        }
        // SAFETY: the caller's promise that the size is above 0 and does not overflow with the alignment.
        let new = unsafe { self.alloc(Layout::from_size_align_unchecked(size, layout.align())) };
        if !new.is_null() {
            // SAFETY: two allocations, as long as the shorter of them.
            unsafe {
                std::ptr::copy_nonoverlapping(memory, new, layout.size().min(size));
                self.dealloc(memory, layout);
            }
        }
        new
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What was written is still there after memory grew and shrank across the border, and all of it can be given back.
    #[test]
    fn memory_keeps_what_is_in_it() {
        let sizes = [100, LARGE - 1, LARGE, 3 * LARGE, LARGE + 1, 64, LARGE];
        let layout = |size: usize| Layout::from_size_align(size, 8).unwrap();
        // SAFETY: within the allocated sizes.
        unsafe {
            let mut memory = HugePages.alloc(layout(sizes[0]));
            for (k, byte) in (0..64).zip(1u8..) {
                memory.add(k).write(byte);
            }
            for pair in sizes.windows(2) {
                memory = HugePages.realloc(memory, layout(pair[0]), pair[1]);
                memory.add(pair[1] - 1).write(memory.add(pair[1] - 1).read());
                assert!((0..63).zip(1u8..).all(|(k, byte)| memory.add(k).read() == byte), "{pair:?}");
                assert!(pair[1] < LARGE || (memory as usize).is_multiple_of(PAGE));
            }
            HugePages.dealloc(memory, layout(LARGE));
        }
    }
}
