//! The map as a picture: rows are failures, columns methods, a number in each cell.

use super::{
    definition::Map,
    judge::{Cell, Verdict, cell, short},
};
use crate::study::{
    paper::{Anchor, GRID, INK, Paper},
    results::Results,
};

/// Of a cell, pixels.
const SIZE: [f64; 2] = [50.0, 24.0];
/// Room for the titles of the rows, and of the columns.
const TITLES: [f64; 2] = [330.0, 250.0];
/// Below the map.
const LEGEND: f64 = 44.0;

/// Blue, yellow and vermilion differ for the colour-blind, and in grey; frames tell them apart again.
fn colour(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Holds => "#a9d3ee",
        Verdict::Degrades => "#f6df7d",
        Verdict::Fails => "#ee8055",
    }
}

/// The picture.
pub fn png(map: &Map, results: &Results) -> Result<Vec<u8>, String> {
    let (columns, rows) = (map.methods.len() as f64, map.rows.len() as f64);
    let size = [TITLES[0] + columns * SIZE[0] + 20.0, TITLES[1] + rows * SIZE[1] + LEGEND];
    let mut paper = Paper::new(size);
    for (j, method) in map.methods.iter().enumerate() {
        let x = TITLES[0] + (j as f64 + 0.5) * SIZE[0];
        paper.climbing(&method.title, [x, TITLES[1] - 6.0]);
    }
    for (i, row) in map.rows.iter().enumerate() {
        let y = TITLES[1] + i as f64 * SIZE[1];
        let title = format!("F{} {}", row.failure, row.title);
        paper.text(&title, [TITLES[0] - 8.0, y + 0.5 * SIZE[1]], Anchor::End);
        for (j, method) in map.methods.iter().enumerate() {
            let x = TITLES[0] + j as f64 * SIZE[0];
            draw(&mut paper, cell(map, results, row, &method.name), [x, y]);
        }
    }
    let y = TITLES[1] + rows * SIZE[1] + 12.0;
    let legend = [Verdict::Holds, Verdict::Degrades, Verdict::Fails];
    for (k, verdict) in legend.into_iter().enumerate() {
        let x = TITLES[0] + 150.0 * k as f64;
        filled(&mut paper, verdict, [x, y]);
        paper.text(verdict.word().trim_matches('*'), [x + SIZE[0] + 8.0, y + 0.5 * SIZE[1]], Anchor::Start);
    }
    let notes = "stop: broke down     ?: to do     -: no value";
    paper.text(notes, [TITLES[0] + 480.0, y + 0.5 * SIZE[1]], Anchor::Start);
    paper.png()
}

fn draw(paper: &mut Paper, cell: Cell, at: [f64; 2]) {
    if let Some(verdict) = cell.verdict() {
        filled(paper, verdict, at);
    } else {
        frame(paper, at, GRID, 1.0, "");
    }
    let text = match cell {
        Cell::Empty => return,
        Cell::ToDo => "?".into(),
        Cell::NoValue => "-".into(),
        Cell::Broke => "stop".into(),
        Cell::Judged(_, value) => short(value),
    };
    paper.text(&text, [at[0] + 0.5 * SIZE[0], at[1] + 0.5 * SIZE[1]], Anchor::Middle);
}

fn filled(paper: &mut Paper, verdict: Verdict, at: [f64; 2]) {
    paper.rectangle(at.map(|x| x + 1.0), SIZE.map(|s| s - 2.0), colour(verdict));
    match verdict {
        Verdict::Holds => {}
        Verdict::Degrades => frame(paper, at, INK, 1.0, "3 3"),
        Verdict::Fails => frame(paper, at, INK, 2.0, ""),
    }
}

fn frame(paper: &mut Paper, [x, y]: [f64; 2], colour: &str, width: f64, dash: &str) {
    let [left, top, right, bottom] = [x + 2.0, y + 2.0, x + SIZE[0] - 2.0, y + SIZE[1] - 2.0];
    paper.line(&[[left, top], [right, top], [right, bottom], [left, bottom], [left, top]], colour, width, dash);
}
