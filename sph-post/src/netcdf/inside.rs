//! What lies inside: layers, static material, the failure surface, stress on sections.

use super::{coordinate, over_bins};
use crate::{
    analysis::{Analysis, Moment},
    section::Section,
};
use formats::results::{Dataset, Role, Variable};

/// A field over the cells of a section.
type Cells<'a> = Vec<(&'a Section, &'a [f64])>;

/// Adds everything to a file that has the coordinate of the profiles, of `count` bins from `first` on.
pub fn inside(a: &Analysis, d: &mut Dataset, first: i64, count: usize) {
    layers(a, d, first, count);
    flow(a, d, first, count);
    let sections: Vec<(&Moment, &Section)> =
        a.sections.iter().filter_map(|&k| Some((&a.moments[k], a.moments[k].section.as_ref()?))).collect();
    let rows = sections.iter().map(|s| s.1.rows).chain(a.moments.iter().map(|m| m.failure_plane.surface.len()));
    let rows = rows.max().unwrap_or(1).max(1);
    coordinate(a, d, "z", "height above the floor", 0, rows);
    failure(a, d, rows);
    self::sections(a, d, &sections, [first, count as i64], rows);
}

/// Tops of the horizontal layers, and where they began.
fn layers(a: &Analysis, d: &mut Dataset, first: i64, count: usize) {
    let Some(layers) = &a.layers else { return };
    let name = a.geometry.coordinate();
    d.dimension("layer", layers.count);
    let numbers = (1..=layers.count).map(|n| n as f64).collect();
    d.variable(Variable::new(
        "layer",
        Role::Coordinate,
        &["layer"],
        "number of the layer from the lowest",
        "1",
        numbers,
    ));
    let [low, high] = layers.heights;
    let edge = |n: usize| low + (high - low) * n as f64 / layers.count as f64;
    let tops = (1..=layers.count).map(edge).collect();
    let long = "top of the layer at the start, above the floor";
    d.variable(Variable::new("layer_top_start", Role::Data, &["layer"], long, "m", tops));
    let values = a.moments.iter().flat_map(|m| {
        (0..layers.count).flat_map(move |n| {
            let tops = m.layer_tops.as_ref().map(|tops| &tops[n][..]);
            let outside = if tops.is_some() { 0.0 } else { f64::NAN };
            over_bins(m.deposit.profile.first, tops.unwrap_or_default(), first, count, outside)
        })
    });
    let long = "top of the horizontal layer above the floor: below it lies as much volume as the layer and those below it have";
    let v = Variable::new("layer_top", Role::Data, &["t", "layer", name], long, "m", values.collect());
    d.variable(v.with("cell_methods", format!("{name}: mean")));
}

/// The height up to which the material stands.
fn flow(a: &Analysis, d: &mut Dataset, first: i64, count: usize) {
    if a.static_speed.is_nan() {
        return;
    }
    let g = &a.geometry;
    let name = g.coordinate();
    let values =
        a.moments.iter().flat_map(|m| over_bins(m.deposit.profile.first, &m.flow.height, first, count, 0.0)).collect();
    let long = "height above the floor below which everything is slower than static_speed";
    let v = Variable::new("static_height", Role::Data, &["t", name], long, "m", values);
    d.variable(v.with("cell_methods", format!("{name}: {}", method(a))));
    let long = "speed below which material counts as static";
    d.variable(Variable::new("static_speed", Role::Data, &[], long, "m s-1", vec![a.static_speed]));
}

/// How the sections come about: points, or means over the angle in 3-D.
fn method(a: &Analysis) -> &'static str {
    if a.geometry.space.dimension() == 3 && a.geometry.radial { "mean (over the angle)" } else { "point" }
}

/// The failure surface at every snapshot.
fn failure(a: &Analysis, d: &mut Dataset, rows: usize) {
    if !a.geometry.runs_outward {
        return;
    }
    let values = a.moments.iter().flat_map(|m| over_bins(0, &m.failure_plane.surface, 0, rows, f64::NAN)).collect();
    let from = if a.geometry.radial { "distance from the axis" } else { "place along +x" };
    let long = format!("failure surface: {from} at which the speed rises to a tenth of failure_top_speed");
    let v = Variable::new("failure_surface", Role::Data, &["t", "z"], &long, "m", values);
    d.variable(v.with("cell_methods", "z: point"));
}

/// Vertical stress and speed over height and distance, at the snapshots whose inside is shown.
fn sections(a: &Analysis, d: &mut Dataset, sections: &[(&Moment, &Section)], [first, count]: [i64; 2], rows: usize) {
    if sections.is_empty() {
        return;
    }
    let name = a.geometry.coordinate();
    d.dimension("t_section", sections.len());
    let times = sections.iter().map(|s| s.0.time).collect();
    let long = "time since the start of the run, of the sections";
    d.variable(Variable::new("t_section", Role::Coordinate, &["t_section"], long, "s", times));
    let mut add = |variable: &str, long: &str, unit: &str, cells: Cells| {
        let mut values = Vec::with_capacity(sections.len() * rows * count as usize);
        for (section, field) in cells {
            for j in 0..rows {
                let row = if j < section.rows { &field[j * section.bins..(j + 1) * section.bins] } else { &[] };
                values.extend(over_bins(section.first, row, first, count as usize, f64::NAN));
            }
        }
        let v = Variable::new(variable, Role::Data, &["t_section", "z", name], long, unit, values);
        d.variable(v.with("cell_methods", format!("z: point {name}: {}", method(a))));
    };
    let stress = sections.iter().map(|(_, s)| (*s, &s.stress_zz[..])).collect();
    add("section_stress_zz", "normal stress sigma_zz in a vertical section", "Pa", stress);
    let speed = sections.iter().map(|(_, s)| (*s, &s.speed[..])).collect();
    add("section_speed", "speed in a vertical section", "m s-1", speed);
    let sheared: Vec<_> = sections.iter().filter_map(|(m, s)| Some((*s, m.shear.as_ref()?))).collect();
    let rate = sheared.iter().map(|(s, shear)| (*s, &shear.rate[..])).collect();
    let long = "shear rate sqrt(2 D:D) of the deviator D of the rate of deformation, in a vertical section";
    add("section_shear_rate", long, "s-1", rate);
    if let Some(grains) = a.grains {
        let number = sheared.iter().filter_map(|(s, shear)| Some((*s, &shear.inertial.as_ref()?[..]))).collect();
        let long = "inertial number in a vertical section; missing where nothing is pressed";
        add("section_inertial_number", long, "1", number);
        for (name, long, unit, value) in [
            ("grain_diameter", "diameter of the grains that the inertial number is of", "m", grains.diameter),
            ("grain_density", "density of the grains that the inertial number is of", "kg m-3", grains.density),
        ] {
            d.variable(Variable::new(name, Role::Data, &[], long, unit, vec![value]));
        }
    }
}
