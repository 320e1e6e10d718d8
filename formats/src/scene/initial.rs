//! `[initial]` of a scene: stress and arrangement of the particles at the start.

use super::{
    Initial, InitialStress, Lattice, Material,
    check::Setting,
    raw::{Allowed, Found, NOT_NEGATIVE, Table},
};
use crate::{space::Space, units::Dimension};

const JITTER: Allowed = Allowed { says: "in [0, 0.5), a fraction of the spacing", holds: |v| (0.0..0.5).contains(&v) };

/// Largest number of passes of relaxation.
const MOST_PASSES: u64 = 10_000;

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Zero,
    Pressure,
    Hydrostatic,
    K0,
}

/// The state at the start; None where it has a fault, or the law it depends on has.
pub(super) fn read(root: &Table<'_>, setting: &Setting<'_>, material: Option<&Material>) -> Option<Initial> {
    let table = root.child("initial");
    let stress = stress(&table, setting, material);
    let lattices =
        [("cubic", Lattice::Cubic), ("hexagonal", Lattice::Hexagonal), ("body-centred", Lattice::BodyCentred)];
    let lattice = table.choice("lattice", &lattices);
    if let (Some(lattice), Some(Space::PlaneStrain | Space::Axisymmetric)) = (&lattice, setting.space)
        && lattice.value == Lattice::BodyCentred
    {
        table.faults.at(lattice, "\"body-centred\" needs three dimensions; in a plane use \"hexagonal\"");
    }
    let jitter = table.number("jitter", Dimension::Number, &JITTER);
    let seed = table.count("seed");
    let relax = table.count("relax");
    if let Some(relax) = relax.as_ref().filter(|relax| relax.value > MOST_PASSES) {
        let source = table.faults.source(relax);
        table.faults.at(relax, format!("{source} is out of range; it must be from 0 to {MOST_PASSES}"));
    }
    table.finish();
    Some(Initial {
        stress: stress?,
        lattice: lattice.map_or(Lattice::Cubic, |found| found.value),
        jitter: jitter.map_or(0.0, |found| found.value),
        seed: seed.map_or(1, |found| found.value),
        relax: relax.map_or(0, |found| found.value),
    })
}

/// Released material has columns of its own, that follow the ground.
pub(super) fn on_terrain(root: &Table<'_>, initial: Option<&Initial>) {
    let Some(initial) = initial else { return };
    let table = root.child("initial");
    let fault = |key: &str, message: &str| table.faults.add(table.child_offset(key), &table.path_of(key), message);
    if initial.lattice != Lattice::Cubic {
        fault("lattice", "released material lies in columns that follow the ground: only \"cubic\" is possible");
    }
    if initial.relax > 0 {
        fault("relax", "released material is not relaxed; use jitter");
    }
}

fn stress(table: &Table<'_>, setting: &Setting<'_>, material: Option<&Material>) -> Option<InitialStress> {
    let kinds =
        [("zero", Kind::Zero), ("pressure", Kind::Pressure), ("hydrostatic", Kind::Hydrostatic), ("k0", Kind::K0)];
    let kind = table.choice("stress", &kinds);
    let pressure = table.number("pressure", Dimension::Stress, &NOT_NEGATIVE);
    let k0 = table.number("k0", Dimension::Number, &NOT_NEGATIVE);
    // Of a name that is not known nothing follows.
    let chosen = if table.has("stress") { kind.as_ref().map(|kind| kind.value) } else { Some(Kind::Zero) };
    if let Some(chosen) = chosen {
        let belongs_to = |key: &Option<Found<f64>>, wanted: Kind, name: &str| {
            if let (Some(key), true) = (key, chosen != wanted) {
                table.faults.at(key, format!("is used only with stress = \"{name}\"; set that, or drop this key"));
            }
        };
        belongs_to(&k0, Kind::K0, "k0");
        belongs_to(&pressure, Kind::Pressure, "pressure");
        if chosen == Kind::Pressure && !table.has("pressure") {
            let message = "missing; a stress such as \"600 Pa\" is needed with stress = \"pressure\"";
            table.faults.structure(table.offset, &table.path_of("pressure"), message);
        }
    }
    if let (Some(kind), Some(gravity)) = (&kind, setting.gravity)
        && matches!(kind.value, Kind::Hydrostatic | Kind::K0)
        && gravity[2] >= 0.0
    {
        let message = "needs gravity along -z: there is no weight to carry; use \"zero\", or give gravity";
        table.faults.at(kind, format!("{} {message}", table.faults.source(kind)));
    }
    if let (Some(kind), Some(true)) = (&kind, material.map(Material::is_fluid))
        && kind.value == Kind::K0
    {
        let message = "\"k0\" needs a law with a shear stress at rest, and this one is a fluid; use \"hydrostatic\"";
        table.faults.at(kind, message);
    }
    Some(match chosen? {
        Kind::Zero => InitialStress::Zero,
        Kind::Hydrostatic => InitialStress::Hydrostatic,
        Kind::Pressure => InitialStress::Pressure(pressure?.value),
        Kind::K0 => {
            let coefficient = match k0 {
                Some(found) => found.value,
                None => material?.elastic_k0(),
            };
            InitialStress::K0 { coefficient }
        }
    })
}
