//! What one core can do at most: a loop of fused multiply-adds on registers, in the widest vectors the processor has.

use std::hint::black_box;
use std::time::Instant;

/// Independent chains: enough to fill two units over a latency of four or five cycles. Each starts at a number the compiler
/// does not know, or it would compute one for all.
const CHAINS: usize = 12;
const ROUNDS: u64 = 1 << 20;
const TRIALS: usize = 20;

/// Operations per second of the loop in `f64`, an addition and a multiplication counting one each: the best of some trials.
pub fn measured() -> f64 {
    let (lanes, run) = widest();
    let trial = |_| {
        let begun = Instant::now();
        black_box(run(black_box(ROUNDS)));
        (2 * lanes * CHAINS) as f64 * ROUNDS as f64 / begun.elapsed().as_secs_f64()
    };
    (0..TRIALS).map(trial).fold(0.0, f64::max)
}

/// Numbers in a vector, and the loop.
#[cfg(target_arch = "x86_64")]
fn widest() -> (usize, fn(u64) -> f64) {
    if std::arch::is_x86_feature_detected!("avx512f") {
        // SAFETY: the processor has what the function is compiled for.
        (8, |rounds| unsafe { x86::by_8(rounds) })
    } else if std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma") {
        // SAFETY: as above.
        (4, |rounds| unsafe { x86::by_4(rounds) })
    } else {
        (4, separate)
    }
}

/// Numbers in a vector, and the loop.
#[cfg(not(target_arch = "x86_64"))]
fn widest() -> (usize, fn(u64) -> f64) {
    (4, separate)
}

/// As the compiler sees fit, without fusing.
fn separate(rounds: u64) -> f64 {
    let mut chains = [[0.0_f64; 4]; CHAINS];
    for (k, number) in chains.as_flattened_mut().iter_mut().enumerate() {
        *number = black_box(k as f64);
    }
    for _ in 0..rounds {
        for number in chains.as_flattened_mut() {
            *number = *number * 0.999_999 + 1e-6;
        }
    }
    chains.as_flattened().iter().sum()
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{CHAINS, black_box};
    use std::arch::x86_64::{
        _mm256_cvtsd_f64, _mm256_fmadd_pd, _mm256_set1_pd, _mm512_fmadd_pd, _mm512_reduce_add_pd, _mm512_set1_pd,
    };

    #[target_feature(enable = "avx512f")]
    pub fn by_8(rounds: u64) -> f64 {
        let (factor, term) = (_mm512_set1_pd(0.999_999), _mm512_set1_pd(1e-6));
        let mut chains = [factor; CHAINS];
        for (k, chain) in chains.iter_mut().enumerate() {
            *chain = _mm512_set1_pd(black_box(k as f64));
        }
        for _ in 0..rounds {
            for chain in &mut chains {
                *chain = _mm512_fmadd_pd(*chain, factor, term);
            }
        }
        chains.into_iter().map(|chain| _mm512_reduce_add_pd(chain)).sum()
    }

    #[target_feature(enable = "avx2,fma")]
    pub fn by_4(rounds: u64) -> f64 {
        let (factor, term) = (_mm256_set1_pd(0.999_999), _mm256_set1_pd(1e-6));
        let mut chains = [factor; CHAINS];
        for (k, chain) in chains.iter_mut().enumerate() {
            *chain = _mm256_set1_pd(black_box(k as f64));
        }
        for _ in 0..rounds {
            for chain in &mut chains {
                *chain = _mm256_fmadd_pd(*chain, factor, term);
            }
        }
        chains.into_iter().map(|chain| _mm256_cvtsd_f64(chain)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_core_does_between_a_tenth_and_a_thousand_billions() {
        let peak = measured();
        assert!((1e8..1e12).contains(&peak), "{peak:e}");
    }
}
