//! The picture of a chart: error over processor time, with the front.

use super::{
    definition::Chart,
    front::Rank,
    points::{Point, Points},
};
use crate::study::{
    chart::Axis,
    paper::{Anchor, COLOURS, GRID, INK, Paper},
    template::tidy,
};

/// Of the inside, pixels.
const INSIDE: [f64; 2] = [560.0, 400.0];
/// Room left of it, above it, right of it at least, and below it.
const MARGIN: [f64; 4] = [80.0, 14.0, 330.0, 56.0];
/// Of a line of the legend.
const LINE: f64 = 18.0;
/// Of a character of the legend, in the mean.
const CHARACTER: f64 = 7.0;
/// Of the legend, beside those of the fronts.
const MORE_LINES: usize = 9;
/// Of those that are not on the front.
const PALE: &str = "#c4c4c4";
/// Half of the side of what a marker takes.
const HALF: f64 = 6.0;

/// A rectangle: left, top, right, bottom.
type Box4 = [f64; 4];

/// Looks of base, options and pairs: shape of the marker, colour, and name.
const LOOKS: [(usize, &str, &str); 3] = [
    (3, INK, "default; dN: with resolution N"),
    (0, COLOURS[0], "one option changed"),
    (1, COLOURS[1], "two options changed"),
];

fn look(point: &Point) -> (usize, &'static str, &'static str) {
    LOOKS[if point.is_base() { 0 } else { 1 + usize::from(point.is_pair()) }]
}

/// The picture.
pub fn png(chart: &Chart, points: &Points) -> Result<Vec<u8>, String> {
    draw(chart, points).png()
}

fn draw(chart: &Chart, points: &Points) -> Paper {
    let of = |is: &dyn Fn(&&Point) -> bool| points.done.iter().filter(is).collect::<Vec<&Point>>();
    let front = of(&|point| point.is_front());
    let others = of(&|point| point.is_other_front());
    let told = MARGIN[1] + LINE * (front.len() + others.len() + MORE_LINES) as f64 + 10.0;
    let height = told.max(MARGIN[1] + INSIDE[1] + MARGIN[3]);
    let longest = front.iter().chain(&others).map(|point| point.label().chars().count()).max().unwrap_or(0);
    let right = MARGIN[2].max(56.0 + CHARACTER * longest as f64);
    let mut paper = Paper::new([MARGIN[0] + INSIDE[0] + right, height]);
    let x = Axis::new(points.done.iter().map(|p| p.cost[0]), true);
    let reference = chart.error.reference.filter(|r| points.done.iter().any(|p| p.error[0] < 1.5 * r));
    let errors = points.done.iter().flat_map(|p| [p.error[0], p.error[0] + p.error[1]]).chain(reference);
    let y = Axis::new(errors.filter(|e| *e > 0.0), true);
    let place = |cost: f64, error: f64| {
        let error = error.max(y.range[0]);
        [MARGIN[0] + INSIDE[0] * x.at(cost), MARGIN[1] + INSIDE[1] * (1.0 - y.at(error))]
    };
    frame(&mut paper, chart, [&x, &y]);
    if let Some(level) = reference {
        let [left, at] = place(x.range[0], level);
        paper.line(&[[left, at], [left + INSIDE[0], at]], COLOURS[2], 1.4, "7 4");
    }
    // Where both fronts are the same, that of the scene's own material hides the other.
    let of_all = staircase(&of(&|point| point.of_all == Rank::Front), &place, [&x, &y]);
    if !others.is_empty() {
        paper.line(&of_all, COLOURS[3], 1.4, "5 3");
    }
    let stairs = staircase(&front, &place, [&x, &y]);
    paper.line(&stairs, COLOURS[4], 2.2, "");
    let base: Vec<[f64; 2]> =
        points.done.iter().filter(|p| p.is_base()).map(|p| place(p.cost[0], p.error[0])).collect();
    paper.line(&base, INK, 1.0, "3 3");
    // Pale ones first, so that those that matter lie above.
    let mut order: Vec<&Point> = points.done.iter().collect();
    order.sort_by_key(|point| (!point.is_behind(), point.is_front(), point.is_base()));
    let (mut taken, mut lines): (Vec<Box4>, Vec<Box4>) = (Vec::new(), Vec::new());
    lines.extend(stairs.windows(2).chain(of_all.windows(2)).map(around));
    for point in &order {
        let at = place(point.cost[0], point.error[0]);
        let (shape, colour, _) = look(point);
        let is_pale = point.is_behind() && !point.is_base();
        let ends = [-1.0, 1.0].map(|side| place(point.cost[0], point.error[0] + side * point.error[1]));
        let width = if point.is_front() { 1.6 } else { 0.8 };
        paper.line(&ends, if is_pale { GRID } else { colour }, width, "");
        let colour = if is_pale { PALE } else { colour };
        match point.is_other() {
            true => paper.hollow(at, shape, colour),
            false => paper.marker(at, shape, colour),
        }
        if !is_pale {
            lines.push(around(&ends));
        }
        taken.push([at[0] - HALF, at[1] - HALF, at[0] + HALF, at[1] + HALF]);
    }
    let labels = front.iter().enumerate().map(|(k, point)| ((k + 1).to_string(), *point));
    let letters = others.iter().enumerate().map(|(k, point)| (letter(k), *point));
    let sizes = points.done.iter().filter(|p| p.is_base() && !p.is_front());
    let all = labels.chain(letters).chain(sizes.map(|point| (format!("d{}", point.resolution), point)));
    for (text, point) in all {
        let at = place(point.cost[0], point.error[0]);
        // Best where no line is either.
        let clear = [&taken[..], &lines].concat();
        if let Some(corner) = free(&text, at, &clear).or_else(|| free(&text, at, &taken)) {
            let middle = [0.5 * (corner[0] + corner[2]), 0.5 * (corner[1] + corner[3])];
            if let Some(line) = leader(at, &corner) {
                paper.line(&line, INK, 0.6, "");
            }
            paper.text(&text, middle, Anchor::Middle);
            taken.push(corner);
        }
    }
    legend(&mut paper, &front, &others, reference.is_some());
    paper
}

/// From a marker to its label, where that had to go farther away than the next one might be.
fn leader(at: [f64; 2], label: &Box4) -> Option<[[f64; 2]; 2]> {
    let nearest = [at[0].clamp(label[0], label[2]), at[1].clamp(label[1], label[3])];
    let far = (nearest[0] - at[0]).hypot(nearest[1] - at[1]);
    (far > 1.5 * HALF).then_some([at, nearest])
}

/// `a`, `b` and so on; after `z` comes `a2`.
fn letter(k: usize) -> String {
    let letter = char::from(b'a' + (k % 26) as u8);
    if k < 26 { letter.to_string() } else { format!("{letter}{}", k / 26 + 1) }
}

fn frame(paper: &mut Paper, chart: &Chart, [x, y]: [&Axis; 2]) {
    let (left, top) = (MARGIN[0], MARGIN[1]);
    let (right, bottom) = (left + INSIDE[0], top + INSIDE[1]);
    for tick in x.ticks() {
        let at = left + INSIDE[0] * x.at(tick);
        paper.line(&[[at, top], [at, bottom]], GRID, 0.8, "");
        paper.text(&tidy(tick).to_string(), [at, bottom + 13.0], Anchor::Middle);
    }
    for tick in y.ticks() {
        let at = bottom - INSIDE[1] * y.at(tick);
        paper.line(&[[left, at], [right, at]], GRID, 0.8, "");
        paper.text(&tidy(tick).to_string(), [left - 7.0, at], Anchor::End);
    }
    paper.line(&[[left, top], [right, top], [right, bottom], [left, bottom], [left, top]], INK, 1.0, "");
    paper.text("processor time of the solver [s]", [0.5 * (left + right), bottom + 34.0], Anchor::Middle);
    paper.upward(&chart.error.title, [left - 58.0, 0.5 * (top + bottom)]);
}

/// From the top at the cheapest to the right end at the best: nothing that was run lies left of it or below.
fn staircase(front: &[&Point], place: &impl Fn(f64, f64) -> [f64; 2], [x, y]: [&Axis; 2]) -> Vec<[f64; 2]> {
    let mut corners: Vec<[f64; 2]> = Vec::new();
    for point in front {
        let here = place(point.cost[0], point.error[0]);
        let above = corners.last().map_or(place(point.cost[0], y.range[1])[1], |last| last[1]);
        corners.extend([[here[0], above], here]);
    }
    if let Some(&[_, bottom]) = corners.last() {
        corners.push([place(x.range[1], y.range[1])[0], bottom]);
    }
    corners
}

/// What a line through two points takes.
fn around(ends: &[[f64; 2]]) -> Box4 {
    let [a, b] = [ends[0], ends[ends.len() - 1]];
    [a[0].min(b[0]) - 1.0, a[1].min(b[1]) - 1.0, a[0].max(b[0]) + 1.0, a[1].max(b[1]) + 1.0]
}

/// Where a label beside a marker covers nothing: the first free of some places, none where all are taken.
fn free(text: &str, [x, y]: [f64; 2], taken: &[Box4]) -> Option<Box4> {
    let (width, height) = (8.5 * text.chars().count() as f64, 14.0);
    let inside =
        |b: &Box4| b[0] > MARGIN[0] && b[1] > MARGIN[1] && b[2] < MARGIN[0] + INSIDE[0] && b[3] < MARGIN[1] + INSIDE[1];
    let apart = |a: &Box4, b: &Box4| a[2] <= b[0] || b[2] <= a[0] || a[3] <= b[1] || b[3] <= a[1];
    [0.0, 6.0, 14.0, 24.0, 36.0].into_iter().find_map(|gap| {
        let (dx, dy) = (HALF + gap + 0.5 * width, HALF + gap + 0.5 * height);
        let sides = [[-dx, dy], [dx, -dy], [-dx, -dy], [dx, dy], [-dx, 0.0], [dx, 0.0], [0.0, dy], [0.0, -dy]];
        let boxes = sides.map(|[a, b]| {
            let middle = [x + a, y + b];
            [middle[0] - 0.5 * width, middle[1] - 0.5 * height, middle[0] + 0.5 * width, middle[1] + 0.5 * height]
        });
        boxes.into_iter().find(|b| inside(b) && taken.iter().all(|other| apart(b, other)))
    })
}

fn legend(paper: &mut Paper, front: &[&Point], others: &[&Point], reference: bool) {
    let left = MARGIN[0] + INSIDE[0] + 14.0;
    let mut at = MARGIN[1] + 8.0 - LINE;
    let mut next = || {
        at += LINE;
        at
    };
    for (shape, colour, name) in LOOKS {
        let y = next();
        paper.marker([left + 10.0, y], shape, colour);
        paper.text(name, [left + 26.0, y], Anchor::Start);
    }
    let y = next();
    paper.marker([left + 10.0, y], 0, PALE);
    paper.text("dominated beyond the scatter", [left + 26.0, y], Anchor::Start);
    let y = next();
    paper.hollow([left + 10.0, y], 0, INK);
    paper.text("hollow: of another material", [left + 26.0, y], Anchor::Start);
    let y = next();
    paper.line(&[[left, y], [left + 20.0, y]], COLOURS[4], 2.2, "");
    paper.text("front of the scene's own material:", [left + 26.0, y], Anchor::Start);
    let entry = |paper: &mut Paper, y: f64, name: &str, point: &Point| {
        paper.text(name, [left + 20.0, y], Anchor::End);
        let mark = if point.level { "~ " } else { "" };
        paper.text(&format!("{mark}{}", point.label()), [left + 26.0, y], Anchor::Start);
    };
    for (k, point) in front.iter().enumerate() {
        entry(paper, next(), &(k + 1).to_string(), point);
    }
    if !others.is_empty() {
        let y = next();
        paper.line(&[[left, y], [left + 20.0, y]], COLOURS[3], 1.4, "5 3");
        paper.text("and with other materials:", [left + 26.0, y], Anchor::Start);
    }
    for (k, point) in others.iter().enumerate() {
        entry(paper, next(), &letter(k), point);
    }
    if front.iter().chain(others).any(|point| point.level) {
        paper.text("~ within the scatter of a cheaper one", [left + 26.0, next()], Anchor::Start);
    }
    if reference {
        let y = next();
        paper.line(&[[left, y], [left + 20.0, y]], COLOURS[2], 1.4, "7 4");
        paper.text("the reference is not known better", [left + 26.0, y], Anchor::Start);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_go_where_nothing_is() {
        let at = [300.0, 200.0];
        let marker = [294.0, 194.0, 306.0, 206.0];
        let first = free("12", at, &[marker]).unwrap();
        assert!(first[2] <= marker[0] && first[1] >= marker[3], "{first:?}");
        let second = free("12", at, &[marker, first]).unwrap();
        assert_ne!(first, second);
        // The second one is beside the marker still; where only a farther place is free, a line leads there.
        assert!(leader(at, &first).is_none() && leader(at, &second).is_none());
        let far = free("12", at, &[[274.0, 174.0, 326.0, 214.0]]).unwrap();
        assert!(far[1] > 214.0 && leader(at, &far).is_some(), "{far:?}");
        assert_eq!(leader(at, &[320.0, 190.0, 330.0, 210.0]), Some([at, [320.0, 200.0]]));
        let crowd: Vec<Box4> = vec![[0.0, 0.0, 1000.0, 1000.0]];
        assert_eq!(free("12", at, &crowd), None);
    }
}
