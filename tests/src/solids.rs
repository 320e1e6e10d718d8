//! STL files for scenes with obstacles.

use crate::WorkFolder;
use std::fs;

type Point = [f64; 3];

/// A prism whose foot is a polygon, counter-clockwise and convex, from one height to another; text or binary.
pub fn prism(work: &WorkFolder, name: &str, foot: &[[f64; 2]], [low, high]: [f64; 2], binary: bool) {
    let at = |n: usize, z: f64| [foot[n % foot.len()][0], foot[n % foot.len()][1], z];
    let mut triangles: Vec<[Point; 3]> = Vec::new();
    for n in 0..foot.len() {
        triangles.push([at(n, low), at(n + 1, low), at(n + 1, high)]);
        triangles.push([at(n, low), at(n + 1, high), at(n, high)]);
    }
    for n in 1..foot.len() - 1 {
        triangles.push([at(0, high), at(n, high), at(n + 1, high)]);
        triangles.push([at(0, low), at(n + 1, low), at(n, low)]);
    }
    fs::write(work.join(name), if binary { as_binary(&triangles) } else { as_text(&triangles) }).expect("an STL file");
}

/// A box.
pub fn block(work: &WorkFolder, name: &str, low: Point, high: Point) {
    let foot = [[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]];
    prism(work, name, &foot, [low[2], high[2]], true);
}

/// The foot of an upright cylinder, as a polygon of so many corners.
pub fn round(centre: [f64; 2], radius: f64, corners: usize) -> Vec<[f64; 2]> {
    let angle = |n: usize| std::f64::consts::TAU * n as f64 / corners as f64;
    (0..corners).map(|n| [centre[0] + radius * angle(n).cos(), centre[1] + radius * angle(n).sin()]).collect()
}

fn as_binary(triangles: &[[Point; 3]]) -> Vec<u8> {
    let mut bytes = vec![b' '; 80];
    bytes.extend((triangles.len() as u32).to_le_bytes());
    for t in triangles {
        bytes.extend([0; 12]);
        t.iter().flatten().for_each(|&x| bytes.extend((x as f32).to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}

fn as_text(triangles: &[[Point; 3]]) -> Vec<u8> {
    let mut text = "solid made for a test\n".to_string();
    for t in triangles {
        text += "facet normal 0 0 0\nouter loop\n";
        t.iter().for_each(|[x, y, z]| text += &format!("vertex {x} {y} {z}\n"));
        text += "endloop\nendfacet\n";
    }
    (text + "endsolid\n").into_bytes()
}
