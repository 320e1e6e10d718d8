//! Pictures of a study: measures over parameters, with published laws beside them.

use super::{
    definition::{Choice, Curve, Panel, Picture},
    paper::{Anchor, COLOURS, GRID, INK, Paper},
    table::Known,
};

/// Of the inside of a panel, pixels.
const INSIDE: [f64; 2] = [380.0, 320.0];
/// Room left of it, above it, and below it.
const MARGIN: [f64; 3] = [80.0, 16.0, 56.0];
/// Of a line of the legend.
const LINE: f64 = 20.0;
/// Dashes of the references, one after the other.
const DASHES: [&str; 4] = ["8 4", "2 3", "10 3 2 3", "5 5"];
/// Points along a reference.
const STEPS: usize = 100;

/// What is drawn once in the legend and by that look in every panel.
struct Look {
    label: String,
    colour: &'static str,
    /// Shape of its markers; none for references.
    marker: Option<usize>,
    dash: &'static str,
}

/// The picture.
pub fn png(known: &Known, picture: &Picture) -> Result<Vec<u8>, String> {
    let looks = looks(known, picture);
    let width = picture.panels.len() as f64 * (MARGIN[0] + INSIDE[0] + 14.0);
    let legend = LINE * looks.len().div_ceil(2) as f64;
    let mut paper = Paper::new([width.max(474.0), MARGIN[1] + INSIDE[1] + MARGIN[2] + legend + 8.0]);
    for (k, panel) in picture.panels.iter().enumerate() {
        let left = MARGIN[0] + k as f64 * (MARGIN[0] + INSIDE[0] + 14.0);
        draw(&mut paper, known, picture, panel, &looks, left)?;
    }
    for (k, look) in looks.iter().enumerate() {
        let column = (k % 2) as f64 * (width.max(474.0) - 40.0) / 2.0;
        let at = [20.0 + column, MARGIN[1] + INSIDE[1] + MARGIN[2] + LINE * (k / 2) as f64 + 6.0];
        paper.line(&[at, [at[0] + 30.0, at[1]]], look.colour, 1.8, look.dash);
        if let Some(shape) = look.marker {
            paper.marker([at[0] + 15.0, at[1]], shape, look.colour);
        }
        paper.text(&look.label, [at[0] + 38.0, at[1]], Anchor::Start);
    }
    paper.png()
}

fn curves<'a>(picture: &'a Picture, panel: &'a Panel) -> &'a [Curve] {
    if panel.curves.is_empty() { &picture.curves } else { &panel.curves }
}

fn looks(known: &Known, picture: &Picture) -> Vec<Look> {
    let mut looks: Vec<Look> = Vec::new();
    for curve in picture.panels.iter().flat_map(|panel| curves(picture, panel)) {
        if !looks.iter().any(|look| look.label == curve.label) {
            let k = looks.len();
            let colour = COLOURS[k % COLOURS.len()];
            looks.push(Look { label: curve.label.clone(), colour, marker: Some(k), dash: "" });
        }
    }
    let first = looks.len();
    for name in picture.panels.iter().flat_map(|panel| &panel.references) {
        let Some(reference) = known.study.references.iter().find(|r| r.name == *name) else { continue };
        if !looks.iter().any(|look| look.label == reference.label) {
            let dash = DASHES[(looks.len() - first) % DASHES.len()];
            // The first one, which is most often the experiment, in black.
            let colour = if looks.len() == first { INK } else { COLOURS[looks.len() % COLOURS.len()] };
            looks.push(Look { label: reference.label.clone(), colour, marker: None, dash });
        }
    }
    looks
}

fn draw(
    paper: &mut Paper,
    known: &Known,
    picture: &Picture,
    panel: &Panel,
    looks: &[Look],
    left: f64,
) -> Result<(), String> {
    let data: Vec<(&Curve, Vec<[f64; 2]>)> =
        curves(picture, panel).iter().map(|curve| (curve, points(known, panel, curve, picture.log))).collect();
    let all = || data.iter().flat_map(|(_, points)| points);
    if all().next().is_none() {
        let middle = [left + 0.5 * INSIDE[0], MARGIN[1] + 0.5 * INSIDE[1]];
        paper.text(&format!("{}: no values yet", panel.y.title), middle, Anchor::Middle);
        return Ok(());
    }
    let x = Axis::new(all().map(|p| p[0]), picture.log);
    // Of references only what lies over the data widens the axis.
    let references: Vec<_> =
        known.study.references.iter().filter(|reference| panel.references.contains(&reference.name)).collect();
    let laws = || {
        let sampled = |range: [f64; 2]| sampled(range, picture.log);
        references.iter().flat_map(move |r| {
            r.pieces(x.range).into_iter().map(move |piece| {
                let ends = sampled(piece);
                let last = ends.len() - 1;
                // Just inside: a branch does not hold at its upper end.
                let inside = move |(k, x): (usize, f64)| if k == last { x * (1.0 - 1e-9) } else { x };
                let points = ends.into_iter().enumerate().map(inside).map(|x| [x, r.at(x)]);
                (r.label.clone(), points.collect::<Vec<[f64; 2]>>())
            })
        })
    };
    let heights = all().map(|p| p[1]).chain(laws().flat_map(|(_, points)| points.into_iter().map(|p| p[1])));
    let y = Axis::new(heights.filter(|y| y.is_finite() && (!picture.log || *y > 0.0)), picture.log);
    let place = |[a, b]: [f64; 2]| [left + INSIDE[0] * x.at(a), MARGIN[1] + INSIDE[1] * (1.0 - y.at(b))];
    frame(paper, panel, [&x, &y], left);
    for (label, points) in laws() {
        let look = looks.iter().find(|look| look.label == label).ok_or("a reference without a look")?;
        let inside: Vec<[f64; 2]> = points.into_iter().filter(|p| p[1].is_finite()).map(place).collect();
        if inside.len() > 1 {
            paper.line(&inside, look.colour, 1.8, look.dash);
        }
    }
    for (curve, points) in &data {
        let look = looks.iter().find(|look| look.label == curve.label).ok_or("a curve without a look")?;
        let inside: Vec<[f64; 2]> = points.iter().map(|&p| place(p)).collect();
        paper.line(&inside, look.colour, 1.2, "");
        for &point in &inside {
            paper.marker(point, look.marker.unwrap_or(0), look.colour);
        }
    }
    Ok(())
}

fn points(known: &Known, panel: &Panel, curve: &Curve, log: bool) -> Vec<[f64; 2]> {
    let choice = Choice { series: curve.series.clone(), only: curve.only.clone() };
    let y = curve.y.as_ref().unwrap_or(&panel.y.expression);
    let mut points: Vec<[f64; 2]> = known
        .study
        .chosen(&choice)
        .into_iter()
        .filter(|run| known.line(run).is_some())
        .map(|run| [known.value(run, None, &panel.x.expression), known.value(run, None, y)])
        .filter(|[a, b]| a.is_finite() && b.is_finite() && (!log || *a > 0.0 && *b > 0.0))
        .collect();
    points.sort_by(|a, b| a[0].total_cmp(&b[0]));
    points
}

fn sampled([low, high]: [f64; 2], log: bool) -> Vec<f64> {
    let part = |k: usize| k as f64 / STEPS as f64;
    let at = |k: usize| match log {
        true => low * (high / low).powf(part(k)),
        false => low + (high - low) * part(k),
    };
    (0..=STEPS).map(at).collect()
}

/// An axis that holds some numbers.
#[derive(Clone, Copy, Debug)]
pub struct Axis {
    /// Its ends.
    pub range: [f64; 2],
    log: bool,
}

impl Axis {
    /// With some room.
    pub fn new(values: impl Iterator<Item = f64>, log: bool) -> Self {
        let ends = values.fold([f64::MAX, f64::MIN], |ends, v| [ends[0].min(v), ends[1].max(v)]);
        let range = match (log, ends) {
            (_, [low, high]) if low > high => [0.1, 1.0],
            (true, [low, high]) => [low / 1.25, high * 1.25],
            (false, [low, high]) => {
                let room = 0.06 * (high - low).max(0.1 * high.abs()).max(1e-12);
                // Zero is shown where it is near.
                let low = if low >= 0.0 && low < 0.5 * high { 0.0 } else { low - room };
                [low, high + room]
            }
        };
        Self { range, log }
    }

    /// Part of its way.
    pub fn at(&self, value: f64) -> f64 {
        let [low, high] = self.range;
        match self.log {
            true => (value / low).ln() / (high / low).ln(),
            false => (value - low) / (high - low),
        }
    }

    /// Round numbers along it.
    pub fn ticks(&self) -> Vec<f64> {
        let [low, high] = self.range;
        if self.log {
            let decades = low.log10().floor() as i32..=high.log10().ceil() as i32;
            let wide = high / low > 300.0;
            let steps: &[f64] = if wide { &[1.0] } else { &[1.0, 2.0, 5.0] };
            let all = decades.flat_map(|k| steps.iter().map(move |s| s * 10_f64.powi(k)));
            return all.filter(|v| (low..=high).contains(v)).collect();
        }
        let rough = (high - low) / 5.0;
        let power = 10_f64.powf(rough.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0].into_iter().map(|s| s * power).find(|s| *s >= rough).unwrap_or(power);
        let whole = (low / step).ceil() as i64..=(high / step).floor() as i64;
        whole.map(|k| k as f64 * step).collect()
    }
}

fn frame(paper: &mut Paper, panel: &Panel, [x, y]: [&Axis; 2], left: f64) {
    let (top, right, bottom) = (MARGIN[1], left + INSIDE[0], MARGIN[1] + INSIDE[1]);
    for tick in x.ticks() {
        let at = left + INSIDE[0] * x.at(tick);
        paper.line(&[[at, top], [at, bottom]], GRID, 0.8, "");
        paper.text(&super::template::tidy(tick).to_string(), [at, bottom + 13.0], Anchor::Middle);
    }
    for tick in y.ticks() {
        let at = bottom - INSIDE[1] * y.at(tick);
        paper.line(&[[left, at], [right, at]], GRID, 0.8, "");
        paper.text(&super::template::tidy(tick).to_string(), [left - 7.0, at], Anchor::End);
    }
    paper.line(&[[left, top], [right, top], [right, bottom], [left, bottom], [left, top]], INK, 1.0, "");
    paper.text(&panel.x.title, [0.5 * (left + right), bottom + 34.0], Anchor::Middle);
    paper.upward(&panel.y.title, [left - 58.0, 0.5 * (top + bottom)]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_hold_their_numbers_and_have_round_ticks() {
        let log = Axis::new([0.2, 30.0].into_iter(), true);
        assert!(log.at(0.2) > 0.0 && log.at(30.0) < 1.0 && (log.at(6.0_f64.sqrt()) - 0.5).abs() < 1e-9);
        assert_eq!(log.ticks(), [0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0]);
        let plain = Axis::new([1.0, 9.0].into_iter(), false);
        assert_eq!(plain.range[0], 0.0);
        assert_eq!(plain.ticks(), [0.0, 2.0, 4.0, 6.0, 8.0]);
        // A single number is no range of nothing.
        let one = Axis::new([5.0].into_iter(), false);
        assert!(one.at(5.0) > 0.0 && one.at(5.0) < 1.0);
    }
}
