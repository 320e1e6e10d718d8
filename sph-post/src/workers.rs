//! Threads that evaluate snapshots and draw pictures side by side. Each snapshot is evaluated by one of them alone, so numbers do not
//! depend on how many there are.

use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

/// Memory that evaluating a snapshot takes a particle, bytes: its rows, and what they are sorted into. Measured: 320, with 230 000
/// particles in three dimensions.
pub const BYTES_PER_PARTICLE: u64 = 400;

/// The threads; the machine's processors, as far as this process may use them, where nothing is asked for.
///
/// # Errors
/// Where the system gives no threads.
pub fn pool(asked: Option<usize>) -> std::io::Result<ThreadPool> {
    let number = match asked {
        Some(number) => number,
        None => std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
    };
    ThreadPoolBuilder::new().num_threads(number).build().map_err(std::io::Error::other)
}

/// How many snapshots of so many particles may be in memory at once, where so many bytes are free: half of these at most, and
/// one always.
fn at_once(particles: u64, free: Option<u64>) -> usize {
    let need = particles.max(1) * BYTES_PER_PARTICLE;
    free.map_or(usize::MAX, |free| usize::try_from(free / 2 / need).unwrap_or(usize::MAX)).max(1)
}

/// Does the same with each of some things that take the memory of a snapshot of so many particles, in the threads of the pool at
/// hand; the results in the order of the things, or the first error in that order.
///
/// # Errors
/// Those of the work.
pub fn each<T: Sync, U: Send, E: Send>(
    things: &[T],
    particles: u64,
    work: impl Fn(usize, &T) -> Result<U, E> + Sync,
) -> Result<Vec<U>, E> {
    let at_once = at_once(particles, formats::memory::available()).min(rayon::current_num_threads());
    let mut all = Vec::with_capacity(things.len());
    for (part, some) in things.chunks(at_once).enumerate() {
        let done: Vec<Result<U, E>> =
            some.par_iter().enumerate().map(|(k, thing)| work(part * at_once + k, thing)).collect();
        for one in done {
            all.push(one?);
        }
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_bounds_how_many_are_at_work() {
        assert_eq!(at_once(1_000_000, Some(8 << 30)), 10);
        assert_eq!((at_once(1 << 40, Some(1 << 30)), at_once(1, None)), (1, usize::MAX));
    }

    #[test]
    fn results_and_errors_come_in_order() {
        let pool = pool(Some(3)).unwrap();
        let things: Vec<usize> = (0..50).collect();
        let work = |k: usize, thing: &usize| {
            assert_eq!(k, *thing);
            std::thread::sleep(std::time::Duration::from_millis((7 * k % 5) as u64));
            if *thing % 20 == 17 { Err(*thing) } else { Ok(2 * thing) }
        };
        let doubled: Vec<usize> = (0..17).map(|n| 2 * n).collect();
        assert_eq!(pool.install(|| each(&things[..17], 1, work)), Ok(doubled));
        assert_eq!(pool.install(|| each(&things, 1, work)), Err(17));
    }
}
