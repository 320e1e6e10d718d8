//! `[terrain]` of a scene: a floor of any height z(x, y), from a raster.

use super::{
    Slip,
    check::AXES,
    raw::{Found, Table, values},
    sources::Sources,
};
use crate::{raster::Grid, space::Space, units::Dimension};
use std::{path::Path, sync::Arc};

/// A floor of any height.
#[derive(Clone, Debug, PartialEq)]
pub struct Terrain {
    /// The raster's file, as the scene names it.
    pub file: String,
    /// What has the coordinates 0 in the scene, in those of the raster, m.
    pub origin: [f64; 3],
    /// What it does to sliding.
    pub slip: Slip,
    /// Heights in the coordinates of the scene, m. In plane strain the section along y = 0 counts.
    pub ground: Arc<Grid>,
}

/// Lattice coordinates are kept in 21 bits with sign.
pub(super) const MOST_CELLS: f64 = (1u64 << 20) as f64;

impl Terrain {
    /// Height of the ground, m.
    pub fn height(&self, x: f64, y: f64) -> f64 {
        self.ground.at(x, y)
    }

    /// Unit normal of the ground, upwards. In plane strain, and where y is no coordinate, nothing points along y.
    pub fn normal(&self, space: Space, x: f64, y: f64) -> [f64; 3] {
        normal(&self.ground, space, x, y)
    }
}

/// Unit normal of a surface.
pub fn normal(ground: &Grid, space: Space, x: f64, y: f64) -> [f64; 3] {
    let [a, b] = ground.gradient(x, y);
    let b = if space == Space::ThreeD { b } else { 0.0 };
    let length = (1.0 + a * a + b * b).sqrt();
    [-a / length, -b / length, 1.0 / length]
}

/// The terrain; None where there is none, or it has a fault.
pub(super) fn read(root: &Table<'_>, space: Option<Space>, spacing: Option<f64>, sources: &Sources) -> Option<Terrain> {
    let table = root.child("terrain");
    if !table.is_there() {
        return None;
    }
    let file = table.needed_text("file", "the name of a raster");
    let origin = table.vector("origin", Dimension::Length);
    let slip = table.needed_choice("slip", &[("no-slip", Slip::NoSlip), ("free-slip", Slip::FreeSlip)]);
    let crs = table.text("crs");
    let mut right = !table.has("origin") || origin.is_some();
    if space == Some(Space::Axisymmetric) {
        let message =
            "there is no terrain in the space \"axisymmetric\"; use \"3d\", or \"plane-strain\" for a section";
        table.faults.add(table.offset, &table.path, message);
        right = false;
    }
    let at = origin.as_ref().map_or([0.0; 3], values);
    let ground = file.as_ref().and_then(|file| raster(&table, file, sources));
    table.finish();
    let (file, mut ground) = (file?, ground?.shifted(at, true));
    if let Some(spacing) = spacing
        && let Some(message) = too_far(&ground, spacing)
    {
        root.faults.at(&file, message);
        right = false;
    }
    let beside = || {
        let bytes = sources.get(Path::new(&file.value).with_extension("prj").to_str()?).ok()?;
        Some(String::from_utf8_lossy(&bytes).trim().to_string())
    };
    ground.crs = crs.map(|crs| crs.value).or_else(|| ground.crs.take()).or_else(beside);
    let terrain = Terrain { file: file.value, origin: at, slip: slip?.value, ground: Arc::new(ground) };
    right.then_some(terrain)
}

/// The raster that a key names, in its own coordinates.
pub(super) fn raster(table: &Table<'_>, file: &Found<String>, sources: &Sources) -> Option<Grid> {
    let read =
        sources.get(&file.value).and_then(|bytes| Grid::read(&bytes).map_err(|what| format!("{}: {what}", file.value)));
    read.map_err(|message| table.faults.at(file, message)).ok()
}

fn too_far(ground: &Grid, spacing: f64) -> Option<String> {
    let (low, high) = ground.extent();
    let [bottom, top] = ground.range();
    let furthest = |a: usize| {
        let ends = if a < 2 { [low[a], high[a]] } else { [bottom, top] };
        ends.map(f64::abs).into_iter().fold(0.0, f64::max)
    };
    let axis = (0..3).find(|&a| furthest(a) / spacing >= MOST_CELLS)?;
    let corner = [low[0], low[1], bottom].map(f64::floor);
    let message = format!("reaches {:.3e} spacings from 0 along {}", furthest(axis) / spacing, AXES[axis]);
    Some(format!("{message}; it must be fewer than 2^20: set terrain.origin to a point of it, e.g. {corner:?}"))
}
