//! The short table for people.

use crate::analysis::Analysis;
use std::fmt::Write;

/// A few lines on the last snapshot: run-out, height, volume, basal force.
pub fn table(a: &Analysis) -> String {
    let (g, last) = (&a.geometry, a.last());
    let mut text = String::new();
    let mut line = |name: &str, value: String| {
        let _ = writeln!(text, "  {name:<36}{value}");
    };
    let scaled = |v: f64| if v.is_nan() { String::new() } else { format!("   ({v:.3} r0)") };
    let front = |v: f64| format!("{v:.5} m{}", scaled(a.scaled(v)));
    let length = |v: f64| format!("{v:.5} m{}", g.r0().map_or(String::new(), |r0| scaled(v / r0)));
    let scale = g.time_scale().map_or(String::new(), |t| format!("   ({:.2} T)", last.time / t));
    line("snapshots, particles", format!("{}, {}", a.moments.len(), last.particles));
    line("time of the last one", format!("{:.5} s{scale}", last.time));
    line("run-out, furthest particle", front(last.deposit.fronts.furthest));
    line("run-out, 99.5 % of the mass", front(last.deposit.fronts.mass));
    line("run-out, thickness dx/2", front(last.deposit.fronts.thickness));
    line("height at the centre", length(last.deposit.height_centre));
    line("height anywhere", length(last.deposit.height_max));
    line("volume / volume at the start", format!("{:.4}", last.deposit.volume_ratio));
    let carried = if last.basal.weight == 0.0 { "none above".into() } else { format!("{:.4}", last.basal.ratio()) };
    line(&format!("force / weight at {:.4} m", a.level), carried);
    text.insert_str(0, &format!("{}\n", a.scene.title));
    if a.moments.iter().any(|m| m.deposit.volume_ratio > 1.1) {
        text.push_str("  note: the material swelled by more than 10 %; see `volume_ratio` in results.nc\n");
    }
    text
}
