//! Outlines of obstacles, seen from above.

use crate::analysis::Analysis;
use plotters::style::RGBColor;

/// Their colour.
pub const COLOUR: RGBColor = RGBColor(170, 0, 40);

/// The lines within the ranges of x and y, in units of `unit`, and their images behind planes of symmetry.
pub fn of_obstacles(a: &Analysis, unit: f64, ranges: [[f64; 2]; 2]) -> Vec<[[f64; 2]; 2]> {
    let signs = [[1.0, 1.0], [-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]];
    let symmetry = a.scene.symmetry;
    let images = signs.into_iter().filter(|signs| (0..2).all(|k| signs[k] > 0.0 || symmetry[k]));
    let images: Vec<[f64; 2]> = images.collect();
    let lines = a.scene.obstacles.iter().flat_map(|obstacle| obstacle.solid.outline());
    // What lies beyond a plane of symmetry is not there.
    let half = [0, 1].map(|k| [if symmetry[k] { 0.0 } else { f64::NEG_INFINITY }, f64::INFINITY]);
    let lines = lines.filter_map(|line| within(line, half)).flat_map(|line| {
        let image = move |signs: &[f64; 2]| line.map(|x| [0, 1].map(|k| signs[k] * x[k] / unit));
        images.iter().map(image).collect::<Vec<_>>()
    });
    lines.filter_map(|line| within(line, ranges)).collect()
}

/// The part of a line within the ranges of x and y.
fn within([a, b]: [[f64; 2]; 2], ranges: [[f64; 2]; 2]) -> Option<[[f64; 2]; 2]> {
    let (mut first, mut last) = (0.0_f64, 1.0_f64);
    for k in 0..2 {
        let (step, [low, high]) = (b[k] - a[k], ranges[k]);
        if step == 0.0 {
            if a[k] < low || a[k] > high {
                return None;
            }
            continue;
        }
        let (s, t) = ((low - a[k]) / step, (high - a[k]) / step);
        (first, last) = (first.max(s.min(t)), last.min(s.max(t)));
    }
    let at = |s: f64| [0, 1].map(|k| a[k] + s * (b[k] - a[k]));
    (first < last).then(|| [at(first), at(last)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_at_the_rim() {
        let rim = [[0.0, 2.0], [0.0, 1.0]];
        assert_eq!(within([[-1.0, 0.5], [3.0, 0.5]], rim), Some([[0.0, 0.5], [2.0, 0.5]]));
        assert_eq!(within([[0.5, 0.25], [0.5, 9.25]], rim), Some([[0.5, 0.25], [0.5, 1.0]]));
        assert_eq!(within([[0.0, 1.5], [2.0, 1.5]], rim), None);
        assert_eq!(
            within([[-1.0, 0.5], [3.0, 0.5]], [[0.0, f64::INFINITY], [f64::NEG_INFINITY, 1.0]]).unwrap()[0],
            [0.0, 0.5]
        );
    }
}
