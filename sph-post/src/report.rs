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
    line("run-out, true: furthest particle", front(last.deposit.fronts.furthest));
    line("run-out, 99.5 % of the mass", front(last.deposit.fronts.mass));
    line("run-out, effective: thickness dx/2", front(last.deposit.fronts.thickness));
    if g.runs_outward {
        let strays = last.deposit.strays;
        line("stray particles beyond it", format!("{}   ({:.2} % of the mass)", strays.count, 100.0 * strays.share));
    }
    line("height at the centre", length(last.deposit.height_centre));
    line("height anywhere", length(last.deposit.height_max));
    line("volume / volume at the start", format!("{:.4}", last.deposit.volume_ratio));
    let carried = if last.basal.weight == 0.0 { "none above".into() } else { format!("{:.4}", last.basal.ratio()) };
    line(&format!("force / weight at {:.4} m", a.level), carried);
    if let Some(m) = a.failure.map(|k| &a.moments[k])
        && let Some(plane) = m.failure_plane.line
    {
        line(&format!("failure plane at {:.4} s", m.time), format!("{:.1} deg", plane.angle_deg));
    }
    if let Some(partition) = &a.partition {
        let shares =
            format!("{:.3}   (error of the sum {:.2e})", partition.dissipated(a.start_potential()), partition.error());
        line("dissipated / potential at the start", shares);
    }
    text.insert_str(0, &format!("{}\n", a.scene.title));
    if a.moments.iter().any(|m| m.deposit.volume_ratio > 1.1) {
        text.push_str("  note: the material swelled by more than 10 %; see `volume_ratio` in results.nc\n");
    }
    text
}
