//! Processor time of this rank, and what of it went into calls of MPI, where a rank that waits may spin: what is left is
//! computation, however many ranks share a processor.

use std::cell::Cell;
use std::time::Duration;

thread_local! {
    static WAITED: Cell<Duration> = const { Cell::new(Duration::ZERO) };
}

/// Processor time of this thread so far; zero where the system does not tell.
pub fn time() -> Duration {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: the call writes one timespec, which is there.
    let told = unsafe { libc::clock_gettime(libc::CLOCK_THREAD_CPUTIME_ID, &mut time) } == 0;
    if told { Duration::new(time.tv_sec as u64, time.tv_nsec as u32) } else { Duration::ZERO }
}

/// Does something that waits for other ranks. Not within another of these.
pub fn waiting<T>(exchange: impl FnOnce() -> T) -> T {
    let before = time();
    let result = exchange();
    WAITED.set(WAITED.get() + time().saturating_sub(before));
    result
}

/// Processor time that [`waiting`] took so far.
pub fn waited() -> Duration {
    WAITED.get()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_counts_and_sleep_does_not() {
        let spin = || {
            let (begun, mut sum) = (time(), 0.0);
            while time() - begun < Duration::from_millis(5) {
                sum += std::hint::black_box(1.0);
            }
            sum
        };
        let (begun, waited_before) = (time(), waited());
        std::thread::sleep(Duration::from_millis(30));
        assert!(time() - begun < Duration::from_millis(20));
        spin();
        assert_eq!(waited(), waited_before);
        assert!(waiting(spin) > 0.0);
        assert!(waited() - waited_before >= Duration::from_millis(5) && time() - begun >= Duration::from_millis(10));
    }
}
