//! Efficiency over cores.

use super::planned::{Curve, Point, Set};
use crate::study::paper::{Anchor, COLOURS, GRID, INK, Paper};

const SIZE: [f64; 2] = [640.0, 420.0];
/// Left, top, right and bottom of the frame.
const FRAME: [f64; 4] = [64.0, 20.0, 620.0, 300.0];
/// Lowest efficiency shown.
const LEAST: f64 = 0.5;

/// A set's picture, as SVG: whole lines with this program's cost of a particle, dashed with Yang et al.'s, and what they measured
/// at 1024 cores as a bar.
pub fn efficiency(set: &Set) -> String {
    let [left, top, right, bottom] = FRAME;
    let cores: Vec<u64> = set.curves.first().map_or(Vec::new(), |curve| curve.points.iter().map(|p| p.cores).collect());
    let (first, last) = (cores.first().copied().unwrap_or(1) as f64, cores.last().copied().unwrap_or(2) as f64);
    let x = |cores: f64| left + 24.0 + (right - left - 48.0) * (cores / first).ln() / (last / first).ln().max(1e-9);
    let y = |efficiency: f64| bottom - (bottom - top) * (efficiency.clamp(LEAST, 1.05) - LEAST) / (1.05 - LEAST);
    let mut paper = Paper::new(SIZE);
    for tenth in 5..=10 {
        let at = y(f64::from(tenth) / 10.0);
        paper.line(&[[left, at], [right, at]], GRID, 1.0, "");
        paper.text(&format!("{} %", 10 * tenth), [left - 8.0, at], Anchor::End);
    }
    for &cores in &cores {
        paper.line(&[[x(cores as f64), bottom], [x(cores as f64), bottom + 5.0]], INK, 1.0, "");
        paper.text(&cores.to_string(), [x(cores as f64), bottom + 16.0], Anchor::Middle);
    }
    paper.line(&[[left, top], [left, bottom], [right, bottom], [right, top], [left, top]], INK, 1.0, "");
    paper.text("cores", [0.5 * (left + right), bottom + 34.0], Anchor::Middle);
    paper.upward(&format!("efficiency, {} test", set.name()), [16.0, 0.5 * (top + bottom)]);
    if cores.contains(&1024) {
        let [low, high] = measured(set.weak);
        paper.line(&[[x(1024.0) + 10.0, y(low)], [x(1024.0) + 10.0, y(high)]], INK, 5.0, "");
    }
    for (k, curve) in set.curves.iter().enumerate() {
        let colour = COLOURS[k % COLOURS.len()];
        let line = |of: fn(&Point) -> f64| -> Vec<[f64; 2]> {
            curve.points.iter().map(|point| [x(point.cores as f64), y(of(point))]).collect()
        };
        paper.line(&line(|point| point.slower), colour, 1.4, "5 4");
        paper.line(&line(|point| point.efficiency), colour, 1.8, "");
        for at in line(|point| point.efficiency) {
            paper.marker(at, k, colour);
        }
        let at = [left, bottom + 56.0 + 18.0 * k as f64];
        paper.line(&[at, [at[0] + 30.0, at[1]]], colour, 1.8, "");
        paper.marker([at[0] + 15.0, at[1]], k, colour);
        paper.text(&label(set, curve), [at[0] + 38.0, at[1]], Anchor::Start);
    }
    let note = "dashed: with the cost of a particle of Yang et al.'s code; bar: what they measured";
    paper.text(note, [left, SIZE[1] - 10.0], Anchor::Start);
    paper.svg()
}

/// What Yang et al. measured at 1024 cores, of both laws and all sizes: least and most.
pub fn measured(weak: bool) -> [f64; 2] {
    if weak { [0.942, 0.983] } else { [0.74, 0.90] }
}

/// `125 000 particles a core`.
pub fn label(set: &Set, curve: &Curve) -> String {
    let thousands = curve.size as f64 / 1000.0;
    match set.weak {
        true => format!("{thousands} thousand particles a core"),
        false => format!("{} million particles", thousands / 1000.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_are_drawn_where_they_belong() {
        let point =
            |cores: u64, efficiency: f64| Point { cores, row: serde_json::Value::Null, efficiency, slower: 1.0 };
        let curve = Curve { size: 125_000, points: vec![point(32, 1.0), point(1024, 0.5)] };
        let svg = efficiency(&Set { weak: true, curves: vec![curve] });
        assert!(svg.starts_with("<svg") && svg.contains("125 thousand particles a core"), "{svg}");
        // From the upper left, where all begin, to the lower right.
        assert!(svg.contains("88.0,45.5 596.0,300.0"), "{svg}");
        assert!(svg.contains("stroke-width=\"5\""), "what was measured is there");
    }
}
