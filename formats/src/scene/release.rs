//! Released material: what lies on the terrain, by a thickness or up to a surface, within a polygon or everywhere.

use super::{
    Body, Shape, Terrain,
    check::{AXES, Setting},
    fit::{REACH, TOLERANCE},
    geometry::bounds,
    raw::{Found, POSITIVE, Table},
    terrain::raster,
};
use crate::{raster::Grid, space::Space, units::Dimension};
use std::sync::Arc;

/// Material on the ground.
#[derive(Clone, Debug, PartialEq)]
pub struct Release {
    /// Its corners, m; without any it lies wherever its thickness is not 0.
    pub polygon: Vec<[f64; 2]>,
    /// How thick it lies.
    pub depth: Depth,
    /// What it lies on.
    pub ground: Arc<Grid>,
}

/// Thickness of released material, vertical.
#[derive(Clone, Debug, PartialEq)]
pub enum Depth {
    /// The same everywhere, m.
    Constant(f64),
    /// From a raster, m; 0 where it has no data.
    Raster(Arc<Grid>),
    /// Up to this surface, where it lies above the ground and has data, m.
    Surface(Arc<Grid>),
}

impl Release {
    /// Vertical thickness at a place, m; 0 where nothing lies.
    pub fn thickness(&self, x: f64, y: f64) -> f64 {
        if !self.polygon.is_empty() && !is_inside(&self.polygon, x, y) {
            return 0.0;
        }
        let within = |grid: &Grid| {
            let (low, high) = grid.extent();
            (low[0]..=high[0]).contains(&x) && (low[1]..=high[1]).contains(&y)
        };
        match &self.depth {
            Depth::Constant(depth) => *depth,
            Depth::Raster(grid) if within(grid) => grid.at(x, y),
            Depth::Surface(grid) if within(grid) && !grid.is_missing(x, y) => {
                (grid.at(x, y) - self.ground.at(x, y)).max(0.0)
            }
            Depth::Raster(_) | Depth::Surface(_) => 0.0,
        }
    }

    /// The largest thickness of its rasters, or the one that it has everywhere, m.
    pub fn thickest(&self) -> f64 {
        match &self.depth {
            Depth::Constant(depth) => *depth,
            Depth::Raster(grid) => grid.range()[1].max(0.0),
            Depth::Surface(grid) => {
                let known = (0..grid.values.len()).filter(|&c| !grid.missing[c]);
                known.map(|c| grid.values[c] - self.ground.values[c]).fold(0.0, f64::max)
            }
        }
    }

    /// Lower and upper end along x and y, m.
    fn footprint(&self) -> [[f64; 2]; 2] {
        let mut ends = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        let grid = match &self.depth {
            Depth::Constant(_) => None,
            Depth::Raster(grid) | Depth::Surface(grid) => Some(grid),
        };
        if let Some(grid) = grid {
            let (low, high) = grid.extent();
            let thick = |c: &usize| match &self.depth {
                Depth::Surface(_) => !grid.missing[*c] && grid.values[*c] > self.ground.values[*c],
                _ => grid.values[*c] > 0.0,
            };
            for c in (0..grid.values.len()).filter(thick) {
                for (a, n) in [c % grid.size[0], c / grid.size[0]].into_iter().enumerate() {
                    let at = grid.first[a] + n as f64 * grid.cell[a];
                    ends[a][0] = ends[a][0].min((at - grid.cell[a]).max(low[a]));
                    ends[a][1] = ends[a][1].max((at + grid.cell[a]).min(high[a]));
                }
            }
        }
        if !self.polygon.is_empty() {
            for a in 0..2 {
                let corners = || self.polygon.iter().map(|p| p[a]);
                let (low, high) =
                    (corners().fold(f64::INFINITY, f64::min), corners().fold(f64::NEG_INFINITY, f64::max));
                ends[a] = if grid.is_none() { [low, high] } else { [ends[a][0].max(low), ends[a][1].min(high)] };
            }
        }
        ends
    }

    /// Lower and upper corner of a box around it, m; empty where nothing lies.
    pub fn bounds(&self, space: Space) -> ([f64; 3], [f64; 3]) {
        let [x, mut y] = self.footprint();
        if space != Space::ThreeD {
            y = [0.0; 2];
        }
        let (mut bottom, mut top) = (f64::INFINITY, f64::NEG_INFINITY);
        // The surface has its extremes at cells, at the edge of the footprint, or just beyond.
        let g = &self.ground;
        let cells = |a: usize, ends: [f64; 2]| {
            let place = |v: f64| ((v - g.first[a]) / g.cell[a]).clamp(0.0, (g.size[a] - 1) as f64);
            place(ends[0]).floor() as usize..=place(ends[1]).ceil() as usize
        };
        if x[0] <= x[1] && y[0] <= y[1] {
            for j in cells(1, y) {
                for i in cells(0, x) {
                    let z = g.values[j * g.size[0] + i];
                    let depth = match &self.depth {
                        Depth::Constant(depth) => *depth,
                        Depth::Raster(grid) => grid.values[j * g.size[0] + i],
                        Depth::Surface(grid) => grid.values[j * g.size[0] + i] - z,
                    };
                    bottom = bottom.min(z);
                    top = top.max(z + depth.max(0.0));
                }
            }
        }
        ([x[0], y[0], bottom], [x[1], y[1], top])
    }

    /// Its volume on the positive side of planes of symmetry, m3; m2 in plane strain. Of a whole raster that of its cells; else
    /// by columns a quarter of `spacing`, or of a cell, wide.
    pub fn volume(&self, space: Space, symmetry: [bool; 2], spacing: f64) -> f64 {
        if let (Depth::Raster(grid), true, Space::ThreeD, [false, false]) =
            (&self.depth, self.polygon.is_empty(), space, symmetry)
        {
            // Where the outermost cells hold something, the halves of them beyond their middles are left out.
            let edge = |n: usize, count: usize| if n == 0 || n + 1 == count { 0.5 } else { 1.0 };
            let share = |c: usize| edge(c % grid.size[0], grid.size[0]) * edge(c / grid.size[0], grid.size[1]);
            let sum: f64 = grid.values.iter().enumerate().map(|(c, depth)| depth * share(c)).sum();
            return sum * grid.cell[0] * grid.cell[1];
        }
        let (low, high) = self.bounds(space);
        let axes = |a: usize| {
            let from = if symmetry[a] { low[a].max(0.0) } else { low[a] };
            let width = (high[a] - from).max(0.0);
            let count = (4.0 * width / spacing.min(self.ground.cell[a])).ceil().max(1.0);
            (from, width / count, count as u64)
        };
        let (x0, dx, nx) = axes(0);
        let (y0, dy, ny) = if space == Space::ThreeD { axes(1) } else { (-0.5, 1.0, 1) };
        let row = |j: u64| {
            let y = y0 + (j as f64 + 0.5) * dy;
            (0..nx).map(|i| self.thickness(x0 + (i as f64 + 0.5) * dx, y)).sum::<f64>()
        };
        (0..ny).map(row).sum::<f64>() * dx * dy
    }
}

/// Is a point inside of a polygon? By the number of sides that a ray along x crosses.
fn is_inside(polygon: &[[f64; 2]], x: f64, y: f64) -> bool {
    let mut inside = false;
    for (k, &[ax, ay]) in polygon.iter().enumerate() {
        let [bx, by] = polygon[(k + 1) % polygon.len()];
        if (ay > y) != (by > y) && x < ax + (y - ay) / (by - ay) * (bx - ax) {
            inside = !inside;
        }
    }
    inside
}

/// Reads `[body.NAME.release]`.
pub(super) fn read(table: Table<'_>, setting: &Setting<'_>) -> Option<Shape> {
    if !table.is_there() {
        return None;
    }
    let faults = table.faults;
    let polygon = table.points("polygon", Dimension::Length);
    let constant = table.number("thickness", Dimension::Length, &POSITIVE);
    let (thickness, surface) = (table.text("thickness-file"), table.text("surface-file"));
    let given: Vec<_> =
        ["thickness", "thickness-file", "surface-file"].into_iter().filter(|key| table.has(key)).collect();
    let mut right = !table.has("polygon") || polygon.is_some();
    match given.as_slice() {
        [_] => {}
        [] => {
            let message = "has no thickness; one of thickness, thickness-file, surface-file is needed";
            faults.structure(table.offset, &table.path, message);
        }
        [_, second, ..] => {
            let message = format!("has several thicknesses ({}); exactly one is needed", given.join(", "));
            faults.structure(table.child_offset(second), &table.path, message);
            right = false;
        }
    }
    if constant.is_some() && !table.has("polygon") {
        let message = "missing; with a thickness that is the same everywhere an array of points [x, y] is needed";
        faults.structure(table.offset, &table.path_of("polygon"), message);
        right = false;
    }
    if let Some(polygon) = &polygon
        && polygon.value.len() < 3
    {
        faults.at(polygon, format!("has {} points; at least three are needed", polygon.value.len()));
        right = false;
    }
    let terrain = setting.terrain.as_ref();
    if terrain.is_none() && !setting.has_terrain {
        let message = "released material lies on a terrain; add a table [terrain], or use a box";
        faults.add(table.offset, &table.path, message);
    }
    let depth = match (&constant, &thickness, &surface) {
        (Some(constant), ..) => Some(Depth::Constant(constant.value)),
        (_, Some(file), _) => same_grid(&table, file, setting).and_then(|mut grid| {
            // No data, no material.
            (0..grid.values.len()).filter(|&c| grid.missing[c]).for_each(|c| grid.values[c] = 0.0);
            let negative = grid.values.iter().copied().find(|v| *v < 0.0);
            if let Some(negative) = negative {
                let message = format!("{}: it has a thickness of {negative} m; it must be 0 or greater", file.value);
                faults.at(file, message);
            }
            negative.is_none().then(|| Depth::Raster(Arc::new(grid)))
        }),
        (.., Some(file)) => same_grid(&table, file, setting).map(|mut grid| {
            let up = terrain.map_or(0.0, |terrain| terrain.origin[2]);
            grid.values.iter_mut().for_each(|v| *v -= up);
            Depth::Surface(Arc::new(grid))
        }),
        _ => None,
    };
    table.finish();
    let polygon = polygon.map_or(Vec::new(), |found| found.value);
    let shape = Shape::Release(Release { polygon, depth: depth?, ground: terrain?.ground.clone() });
    right.then_some(shape)
}

/// A raster on the grid of the terrain, in the coordinates of the scene along x and y.
fn same_grid(table: &Table<'_>, file: &Found<String>, setting: &Setting<'_>) -> Option<Grid> {
    let grid = raster(table, file, setting.sources)?;
    let terrain = setting.terrain.as_ref()?;
    let grid = grid.shifted(terrain.origin, false);
    match terrain.ground.difference(&grid) {
        None => Some(grid),
        Some(difference) => {
            let message = format!("{}: its grid is not that of {}: {difference}", file.value, terrain.file);
            table.faults.at(file, format!("{message}; resample it, for example with gdalwarp"));
            None
        }
    }
}

/// Lower and upper surface of a shape above a place, m; none where it does not stand.
fn column(shape: &Shape, space: Space, x: f64, y: f64) -> Option<[f64; 2]> {
    if let Shape::Release(release) = shape {
        let (ground, depth) = (release.ground.at(x, y), release.thickness(x, y));
        return (depth > 0.0).then_some([ground, ground + depth]);
    }
    let (low, high) = bounds(shape, space);
    let inside = |a: usize, v: f64| (low[a]..=high[a]).contains(&v);
    if !inside(0, x) || (space == Space::ThreeD && !inside(1, y)) {
        return None;
    }
    match shape {
        Shape::Cylinder { base, radius, .. } => {
            ((x - base[0]).hypot(y - base[1]) < *radius).then_some([low[2], high[2]])
        }
        Shape::Wedge { corner, size, .. } => {
            let part = 1.0 - (x - corner[0]).abs() / size[0];
            (part > 0.0).then_some([low[2], low[2] + part * size[2]])
        }
        Shape::Box { .. } | Shape::Release(_) => Some([low[2], high[2]]),
    }
}

/// Most places that are looked at in a shape.
const MOST_PLACES: f64 = 4e6;

/// The columns of the lattice in a box, or some of them where there are many.
fn places(low: [f64; 3], high: [f64; 3], space: Space, dx: f64) -> impl Iterator<Item = [f64; 2]> {
    let cells = |a: usize| ((high[a] - low[a]) / dx).ceil().max(1.0);
    let three = space == Space::ThreeD;
    let many = cells(0) * if three { cells(1) } else { 1.0 };
    let stride = dx * (many / MOST_PLACES).sqrt().max(1.0);
    let count = |a: usize| ((high[a] - low[a]) / stride).ceil().max(1.0) as u64;
    let (nx, ny) = (count(0), if three { count(1) } else { 1 });
    let at = move |a: usize, n: u64| (low[a] + (n as f64 + 0.5) * stride).min(high[a]);
    (0..ny).flat_map(move |j| (0..nx).map(move |i| [at(0, i), if three { at(1, j) } else { 0.0 }]))
}

/// Do two shapes of which one is released share a volume? Looked at column by column.
pub(super) fn overlap(a: &Shape, b: &Shape, space: Space, dx: f64) -> bool {
    let ((l, h), (m, n)) = (bounds(a, space), bounds(b, space));
    let (low, high) = ([0, 1, 2].map(|k| l[k].max(m[k])), [0, 1, 2].map(|k| h[k].min(n[k])));
    if space.axes().iter().any(|&k| low[k] >= high[k]) {
        return false;
    }
    places(low, high, space, dx).any(|[x, y]| {
        let both = column(a, space, x, y).zip(column(b, space, x, y));
        both.is_some_and(|(p, q)| p[1].min(q[1]) - p[0].max(q[0]) > TOLERANCE * dx)
    })
}

/// Why a body does not fit the terrain, if it does not.
pub(super) fn misfit(body: &Body, terrain: &Terrain, space: Space, dx: f64, setting: &Setting<'_>) -> Option<String> {
    let (mut low, high) = bounds(&body.shape, space);
    // Nothing is kept on the negative side of planes of symmetry.
    (0..2).filter(|&a| setting.symmetry[a]).for_each(|a| low[a] = low[a].max(0.0));
    let (first, last) = terrain.ground.extent();
    let axes = if space == Space::ThreeD { 2 } else { 1 };
    if space == Space::PlaneStrain && !(first[1]..=last[1]).contains(&0.0) {
        let (from, to) = (first[1], last[1]);
        return Some(format!("the section y = 0 lies beyond the terrain, which reaches from y = {from} m to {to} m"));
    }
    let reach = REACH * setting.h_over_dx * dx;
    for [x, y] in places(low, high, space, dx) {
        let Some([foot, _]) = column(&body.shape, space, x, y) else { continue };
        let at = [x, y];
        if let Some(a) = (0..axes).find(|&a| at[a] < first[a] - TOLERANCE * dx || at[a] > last[a] + TOLERANCE * dx) {
            let (name, from, to) = (AXES[a], first[a], last[a]);
            let message = format!("reaches beyond the terrain's edge, to {name} = {} m", at[a]);
            return Some(format!("{message}; the middles of its cells reach from {from} m to {to} m"));
        }
        let around = [[0.0, 0.0], [reach, 0.0], [-reach, 0.0], [0.0, reach], [0.0, -reach]];
        let near = &around[..if axes == 2 { 5 } else { 3 }];
        if near.iter().any(|d| terrain.ground.is_missing(x + d[0], y + d[1])) {
            let message = format!("lies on cells of the terrain without data, or near them, at x = {x} m, y = {y} m");
            return Some(format!("{message}; fill them, for example with gdal_fillnodata"));
        }
        let ground = terrain.ground.at(x, y);
        if foot < ground - TOLERANCE * dx {
            let message = format!("reaches {} m below the terrain at x = {x} m, y = {y} m", ground - foot);
            return Some(format!("{message}; raise it, or use a release, which lies on the terrain"));
        }
    }
    None
}

impl Release {
    /// Why it holds no particle, if it holds none.
    pub(super) fn emptiness(&self, space: Space, dx: f64) -> Option<String> {
        let (low, high) = self.bounds(space);
        let thickest = places(low, high, space, dx).map(|[x, y]| self.thickness(x, y)).fold(0.0, f64::max);
        (thickest < 0.5 * dx).then(|| {
            format!(
                "holds no particle: it is nowhere thicker than {thickest} m, and half the spacing is {} m",
                0.5 * dx
            )
        })
    }
}
