//! `[obstacle.NAME]` of a scene: fixed solid bodies, from STL files.

use super::{
    Body, PeriodicAxis, Slip, Wall,
    check::{AXES, Setting},
    raw::{POSITIVE, Table, values},
    terrain::MOST_CELLS,
};
use crate::{
    space::Space,
    stl::{self, Solid},
    units::Dimension,
};
use std::sync::Arc;

/// A fixed solid body that the material meets.
#[derive(Clone, Debug, PartialEq)]
pub struct Obstacle {
    /// For messages.
    pub name: String,
    /// The file, as the scene names it.
    pub file: String,
    /// What it does to sliding.
    pub slip: Slip,
    /// Its surface in the coordinates of the scene, m.
    pub solid: Arc<Solid>,
}

/// Over a terrain lattice coordinates along z are kept in so many bits less: see [`super::WallLattice`].
pub(super) const MOST_LAYERS: f64 = MOST_CELLS / 4.0;
/// Numbers of a file may be so far apart, in spacings.
const COARSEST: f64 = 0.05;

/// All obstacles; None where one has a fault.
pub(super) fn read(
    root: &Table<'_>,
    setting: &Setting<'_>,
    bodies: Option<&[Body]>,
    walls: Option<&[Wall]>,
    relaxes: bool,
) -> Option<Vec<Obstacle>> {
    let tables = root.named("obstacle");
    let one = |(name, table)| obstacle(name, table, setting, bodies.unwrap_or(&[]), walls.unwrap_or(&[]), relaxes);
    // Each is read before any is given up.
    tables.into_iter().map(one).collect::<Vec<_>>().into_iter().collect()
}

fn obstacle(
    name: String,
    table: Table<'_>,
    setting: &Setting<'_>,
    bodies: &[Body],
    walls: &[Wall],
    relaxes: bool,
) -> Option<Obstacle> {
    let file = table.needed_text("file", "the name of an STL file");
    let scale = table.number("scale", Dimension::Number, &POSITIVE);
    let at = table.vector("at", Dimension::Length);
    let slip = table.needed_choice("slip", &[("no-slip", Slip::NoSlip), ("free-slip", Slip::FreeSlip)]);
    let whole = (!table.has("scale") || scale.is_some()) && (!table.has("at") || at.is_some());
    let (faults, path, offset) = (table.faults, table.path.clone(), table.offset);
    if let Some(space @ (Space::PlaneStrain | Space::Axisymmetric)) = setting.space {
        let message = format!("there are no solids in the space \"{}\"; use \"3d\"", space.name());
        faults.add(offset, &path, message);
        table.finish();
        return None;
    }
    table.finish();
    let file = file?;
    let (scale, at) = (scale.map_or(1.0, |scale| scale.value), at.as_ref().map_or([0.0; 3], values));
    let told = |what: String| format!("{}: {what}", file.value);
    let triangles = setting.sources.get(&file.value).and_then(|bytes| stl::read(&bytes).map_err(told));
    let (triangles, step) = triangles.map_err(|message| faults.at(&file, message)).ok()?;
    if !whole {
        return None;
    }
    let solid = Solid::placed(&triangles, scale, at).map_err(|what| faults.at(&file, told(what))).ok()?;
    let obstacle = Obstacle { name, file: file.value.clone(), slip: slip?.value, solid: Arc::new(solid) };
    let place = Place { setting, walls, spacing: setting.spacing? };
    let misfit = place.too_coarse(step * scale).or_else(|| place.misfit(&obstacle.solid));
    let misfit =
        misfit.or_else(|| bodies.iter().filter(|_| relaxes).find_map(|body| place.is_relaxed_into(&obstacle, body)));
    if let Some(misfit) = misfit {
        faults.at(&file, told(misfit));
        return None;
    }
    Some(obstacle)
}

/// What an obstacle must fit.
struct Place<'a> {
    setting: &'a Setting<'a>,
    walls: &'a [Wall],
    spacing: f64,
}

impl Place<'_> {
    fn too_coarse(&self, step: f64) -> Option<String> {
        (step > COARSEST * self.spacing).then(|| {
            format!(
                "its numbers are {step:.2e} m apart where its coordinates are largest, more than a twentieth of the spacing: \
                 write it near its own origin, and move it with `at`"
            )
        })
    }

    fn misfit(&self, solid: &Solid) -> Option<String> {
        let (low, high, dx) = (solid.low, solid.high, self.spacing);
        let size = [0, 1, 2].map(|a| high[a] - low[a]);
        if size.iter().any(|&size| size < dx) {
            let message =
                format!("is {} m x {} m x {} m large, less than the spacing of {dx} m", size[0], size[1], size[2]);
            return Some(format!("{message}; is `scale` right? A file in millimetres takes scale = 0.001"));
        }
        let most = |a: usize| if a == 2 && self.setting.has_terrain { MOST_LAYERS } else { MOST_CELLS };
        if let Some(a) = (0..3).find(|&a| low[a].abs().max(high[a].abs()) / dx >= most(a)) {
            let message =
                format!("reaches {:.3e} spacings from 0 along {}", low[a].abs().max(high[a].abs()) / dx, AXES[a]);
            return Some(format!("{message}; it must be fewer than {}: see `scale` and `at`", most(a)));
        }
        self.outside(solid).map(|what| {
            let ends = |a: usize| format!("{} from {} to {}", AXES[a], low[a], high[a]);
            format!(
                "lies {what}, where there is no material: {} m; see `scale` and `at`",
                [0, 1, 2].map(ends).join(", ")
            )
        })
    }

    /// Where the whole solid lies, if that is outside of the scene.
    fn outside(&self, solid: &Solid) -> Option<String> {
        let (low, high) = (solid.low, solid.high);
        if let Some(wall) = self.walls.iter().find(|wall| {
            let foremost = if wall.side > 0.0 { high[wall.axis] } else { low[wall.axis] };
            wall.side * (foremost - wall.at) <= 0.0
        }) {
            return Some(format!("behind the wall {} = {} m", AXES[wall.axis], wall.at));
        }
        if let Some(a) = (0..2).find(|&a| self.setting.symmetry[a] && high[a] <= 0.0) {
            return Some(format!("on the negative side of the plane of symmetry {} = 0", AXES[a]));
        }
        for (a, ends) in self.setting.periodic.iter().enumerate() {
            let Some([from, to]) = *ends else { continue };
            let length = PeriodicAxis::new([from, to]).length;
            if low[a] < from - length || high[a] > to + length || high[a] <= from || low[a] >= to {
                return Some(format!(
                    "out of the period, {} m to {} m along {}, by its length or more",
                    from, to, AXES[a]
                ));
            }
        }
        let ground = &self.setting.terrain.as_ref()?.ground;
        let (first, last) = ground.extent();
        if let Some(a) = (0..2).find(|&a| high[a] <= first[a] || low[a] >= last[a]) {
            return Some(format!(
                "beyond the terrain, which reaches from {} m to {} m along {}",
                first[a], last[a], AXES[a]
            ));
        }
        (high[2] <= ground.range()[0])
            .then(|| format!("below the lowest point of the terrain, {} m", ground.range()[0]))
    }

    /// Bodies are relaxed between their own faces.
    fn is_relaxed_into(&self, obstacle: &Obstacle, body: &Body) -> Option<String> {
        let (low, high) = body.shape.bounds(Space::ThreeD);
        let solid = &obstacle.solid;
        let apart = (0..3).any(|a| solid.high[a] <= low[a] || solid.low[a] >= high[a]);
        (!apart).then(|| {
            format!("may reach into body `{}`, which is relaxed as if it were not there; drop initial.relax", body.name)
        })
    }
}
