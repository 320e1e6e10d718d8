//! What the result files say: names, units and meaning of every variable.

mod inside;
mod terrain;

pub use terrain::terrain;

use crate::{
    analysis::{Analysis, Moment},
    deposit::Fronts,
    history::History,
};
use formats::results::{Dataset, Role, Variable};

/// What the methods are taken from.
const REFERENCES: &str = "Surface: filled fraction sum(V W) = 1/2. Interpolation: first-order weighted least squares \
(Liu and Liu 2003). Reference run-out and height: Lube et al. 2004, J. Fluid Mech. 508, 175-199, through Yang et al. 2020, \
Eqs 45 and 46, of whose two heights the lower is taken. True and effective front, layers, basal stress: Yang et al. 2020, \
sections 3.8 to 3.12. Failure plane and energies: Szewc 2017, sections 5.4 and 5.5";

/// `post/results.nc`: everything the snapshots show, over time `t`.
pub fn results(a: &Analysis) -> Dataset {
    let mut d = common(a, "deposit, inside, stresses and energies from snapshots", 1);
    let times: Vec<f64> = a.moments.iter().map(|m| m.time).collect();
    d.dimension("t", times.len());
    d.variable(time(times));
    series(a, &mut d);
    profiles(a, &mut d);
    maps(a, &mut d);
    d
}

/// `post/history.nc`: the columns of the run's history over its own time `t`.
pub fn history(a: &Analysis, history: &History) -> Dataset {
    let mut d = common(a, "history written by the run", history.times().len());
    d.dimension("t", history.times().len());
    d.variable(time(history.times().to_vec()));
    for column in history.columns.iter().skip(1).filter(|c| is_name(&c.name)) {
        let long = column.name.replace('_', " ");
        d.variable(Variable::new(
            &column.name,
            Role::Data,
            &["t"],
            &long,
            &cf_unit(&column.unit),
            column.values.clone(),
        ));
    }
    if let Some(partition) = &a.partition {
        let unit =
            history.columns.iter().find(|c| c.name == "stress_work").map_or_else(String::new, |c| cf_unit(&c.unit));
        let long = "work of the stresses less what the material stores: dissipated by it";
        d.variable(Variable::new("plastic_work", Role::Data, &["t"], long, &unit, partition.plastic.clone()));
        let long = "change of kinetic, potential, stress and viscous work together, over the largest change of potential energy";
        d.variable(Variable::new("energy_closure", Role::Data, &["t"], long, "1", partition.closure.clone()));
    }
    d
}

fn is_name(name: &str) -> bool {
    name != "t"
        && name.starts_with(|c: char| c.is_ascii_alphabetic())
        && !name.contains(|c: char| !c.is_ascii_alphanumeric() && c != '_')
}

/// Units as CF writes them: `kg/m3` is `kg m-3`.
fn cf_unit(unit: &str) -> String {
    let mut parts = unit.split('/');
    let first = parts.next().unwrap_or("1");
    let mut text = if first == "1" && unit.contains('/') { String::new() } else { first.to_string() };
    for part in parts {
        let at = part.find(|c: char| c.is_ascii_digit()).unwrap_or(part.len());
        let power = if at == part.len() { "1" } else { &part[at..] };
        text.push_str(&format!(" {}-{power}", &part[..at]));
    }
    text.trim().to_string()
}

fn time(values: Vec<f64>) -> Variable {
    Variable::new("t", Role::Coordinate, &["t"], "time since the start of the run", "s", values)
}

/// Global attributes and the numbers of the scene.
fn common(a: &Analysis, what: &str, time_chunk: usize) -> Dataset {
    let g = &a.geometry;
    let mut d = Dataset { time_chunk, ..Dataset::default() };
    d.attribute("title", format!("{}: {what}", a.scene.title));
    d.attribute("source", "smoothed particle hydrodynamics of granular material");
    d.attribute("history", concat!("written by sph-post ", env!("CARGO_PKG_VERSION")));
    d.attribute("references", REFERENCES);
    d.attribute("space", g.space.name());
    d.attribute("kernel", g.kernel.name());
    d.attribute("scene_hash", a.hash.as_str());
    d.attribute("scene", a.text.as_str());
    d.attribute(
        "comment",
        "Tension is positive. Energies, forces and weights are of the modelled part (see modelled_share), \
         per metre of depth in plane strain.",
    );
    let mut number = |name: &str, long: &str, unit: &str, value: f64| {
        if value.is_finite() {
            d.variable(Variable::new(name, Role::Data, &[], long, unit, vec![value]));
        }
    };
    number("dx", "particle spacing", "m", g.dx);
    number("h_smoothing", "smoothing length", "m", g.h);
    number("floor", "height of the floor", "m", g.floor);
    number("r0", "extent of the body at the start, along the profile", "m", g.r0().unwrap_or(f64::NAN));
    number("height_0", "height of the material at the start", "m", g.height);
    number("time_scale", "square root of the initial height over gravity", "s", g.time_scale().unwrap_or(f64::NAN));
    number("basal_height", "height above the floor at which basal stresses are taken", "m", a.level);
    number("modelled_share", "share of the whole that is modelled, the rest follows by symmetry", "1", g.modelled());
    d
}

/// One number a snapshot.
fn series(a: &Analysis, d: &mut Dataset) {
    let per = if a.geometry.space == formats::space::Space::PlaneStrain { " m-1" } else { "" };
    let mut add = |name: &str, long: &str, unit: &str, value: &dyn Fn(&Moment) -> f64| {
        let values = a.moments.iter().map(value).collect();
        d.variable(Variable::new(name, Role::Data, &["t"], long, unit, values));
    };
    let from = if a.geometry.radial { "distance from the axis" } else { "place along +x, from x = 0" };
    let scaled = "relative to the initial extent, (front - r0)/r0; missing with several bodies, and where the body can \
                  spread both ways or runs towards -x";
    for (name, what, pick) in [
        (
            "furthest",
            "true front, that of stray particles: furthest particle and half a spacing",
            (|f| f.furthest) as fn(&Fronts) -> f64,
        ),
        ("mass", "contains 99.5 percent of the mass", |f| f.mass),
        (
            "thickness",
            "effective front, that of the deposit without a gap: edge where the thickness is half a spacing",
            |f| f.thickness,
        ),
    ] {
        add(&format!("front_{name}"), &format!("front, {from}: {what}"), "m", &|m| pick(&m.deposit.fronts));
        let value = |m: &Moment| a.scaled(pick(&m.deposit.fronts));
        add(&format!("runout_{name}"), &format!("run-out: {what}, {scaled}"), "1", &value);
    }
    let outward = a.geometry.runs_outward;
    let stray = |value: f64| if outward { value } else { f64::NAN };
    add("stray_particles", "particles beyond the effective front", "1", &|m| stray(m.deposit.strays.count as f64));
    add("stray_share", "mass of the particles beyond the effective front over that of all", "1", &|m| {
        stray(m.deposit.strays.share)
    });
    add("static_share", "volume of the particles slower than static_speed over that of all", "1", &|m| m.flow.share);
    let plane = "failure plane, through the places where the speed is a tenth of failure_top_speed";
    add("failure_angle", &format!("inclination to the horizontal of the {plane}"), "degree", &|m| {
        m.failure_plane.line.map_or(f64::NAN, |l| l.angle_deg)
    });
    add("failure_scatter", &format!("root mean square distance of the places from the {plane}"), "m", &|m| {
        m.failure_plane.line.map_or(f64::NAN, |l| l.scatter)
    });
    add("failure_top_speed", "largest speed of the material, strays left out", "m s-1", &|m| m.failure_plane.top_speed);
    add("height_centre", "largest height within two spacings of the centre", "m", &|m| m.deposit.height_centre);
    add("height_max", "largest height of the surface", "m", &|m| m.deposit.height_max);
    add("volume_ratio", "volume over the volume at the start", "1", &|m| m.deposit.volume_ratio);
    let joule = format!("J{per}");
    add("kinetic_energy", "kinetic energy", &joule, &|m| m.energy.kinetic);
    add("potential_energy", "potential energy, zero at the origin", &joule, &|m| m.energy.potential);
    add("elastic_energy", "elastic energy", &joule, &|m| m.energy.elastic);
    let newton = format!("N{per}");
    add("basal_force", "integral of the normal stress at the basal height", &newton, &|m| m.basal.force);
    add("weight_above", "weight of the material above the basal height", &newton, &|m| m.basal.weight);
    for (k, (suffix, what)) in
        [("", "within 2h"), ("_off_axis", "between 2h and 4h, all nearer left out")].into_iter().enumerate()
    {
        let long = format!("pressure at the basal height in the centre ({what}) over the largest");
        add(&format!("basal_centre_ratio{suffix}"), &long, "1", &|m| m.basal.dips[k].ratio);
        let long =
            format!("distance from the centre of the largest pressure at the basal height, for the centre {what}");
        add(&format!("basal_max_distance{suffix}"), &long, "m", &|m| m.basal.dips[k].radius);
    }
    add("step", "steps done", "1", &|m| m.step as f64);
}

/// Coordinate with the bounds of its cells, bins `first..first + count` of width dx.
fn coordinate(a: &Analysis, d: &mut Dataset, name: &str, long: &str, first: i64, count: usize) {
    let dx = a.geometry.dx;
    let edge = |k: usize| (first + k as i64) as f64 * dx;
    let middle = |k: usize| ((first + k as i64) as f64 + 0.5) * dx;
    d.dimension(name, count);
    let bounds = format!("{name}_bnds");
    let values = (0..count).map(middle).collect();
    d.variable(Variable::new(name, Role::Coordinate, &[name], long, "m", values).with("bounds", bounds.as_str()));
    let edges = (0..count).flat_map(|k| [edge(k), edge(k + 1)]).collect();
    let dimensions = vec![name.to_string(), "bnds".to_string()];
    d.variable(Variable { name: bounds, role: Role::Coordinate, dimensions, attributes: Vec::new(), values: edges });
}

/// Smallest range of bins that contains all `(first, count)`.
fn union(ranges: impl Iterator<Item = (i64, usize)>) -> (i64, usize) {
    let ends = ranges.map(|(first, count)| (first, first + count as i64));
    let (low, high) = ends.fold((i64::MAX, i64::MIN), |(l, h), (a, b)| (l.min(a), h.max(b)));
    (low, (high - low).max(1) as usize)
}

fn profiles(a: &Analysis, d: &mut Dataset) {
    let name = a.geometry.coordinate();
    let (first, count) = union(a.moments.iter().map(|m| (m.deposit.profile.first, m.deposit.profile.height.len())));
    d.dimension("bnds", 2);
    let long = if name == "r" { "distance from the axis" } else { "horizontal position" };
    coordinate(a, d, name, long, first, count);
    let mut add =
        |variable: &str, long: &str, unit: &str, method: &str, outside: f64, field: &dyn Fn(&Moment) -> &[f64]| {
            let row = |m: &Moment| over_bins(m.deposit.profile.first, field(m), first, count, outside);
            let values = a.moments.iter().flat_map(row).collect();
            let v = Variable::new(variable, Role::Data, &["t", name], long, unit, values);
            d.variable(v.with("cell_methods", format!("{name}: {method}")));
        };
    let three = a.geometry.space.dimension() == 3;
    let method = if three { "mean" } else { "point" };
    add("height", "height of the surface above the floor", "m", method, 0.0, &|m| &m.deposit.profile.height);
    add("thickness", "volume of material over area", "m", "mean", 0.0, &|m| &m.deposit.profile.thickness);
    let shear = if name == "r" {
        "shear stress sigma_rz at the basal height"
    } else {
        "shear stress sigma_xz at the basal height"
    };
    let none = f64::NAN;
    add("basal_normal_stress", "normal stress sigma_zz at the basal height", "Pa", method, none, &|m| {
        &m.basal.profile.normal
    });
    add("basal_shear_stress", shear, "Pa", method, none, &|m| &m.basal.profile.shear);
    let hydrostatic = "weight of the column above the basal height over its area, as a normal stress";
    add("hydrostatic_stress", hydrostatic, "Pa", method, none, &|m| &m.basal.profile.hydrostatic);
    inside::inside(a, d, first, count);
}

/// A row of bins from `begin` on, over `count` bins from `first` on, which is no later.
fn over_bins(begin: i64, row: &[f64], first: i64, count: usize, outside: f64) -> Vec<f64> {
    let skip = (begin - first) as usize;
    (0..count).map(move |k| k.checked_sub(skip).and_then(|k| row.get(k)).copied().unwrap_or(outside)).collect()
}

/// Height and basal stress over x and y, in 3-D.
fn maps(a: &Analysis, d: &mut Dataset) {
    let maps: Vec<_> = a.moments.iter().filter_map(|m| m.deposit.map.as_ref().zip(m.basal.map.as_ref())).collect();
    if maps.is_empty() {
        return;
    }
    let mut names = ["x", "y"];
    let ranges = [0, 1].map(|i| union(maps.iter().map(|(m, _)| (m.first[i], m.size[i]))));
    // Profiles along x have taken the name; the map's x spans other bins.
    if a.geometry.coordinate() == "x" {
        names[0] = "x_map";
    }
    for (i, long) in ["horizontal position", "horizontal position across"].into_iter().enumerate() {
        coordinate(a, d, names[i], long, ranges[i].0, ranges[i].1);
    }
    let [(x0, nx), (y0, ny)] = ranges;
    for (name, long, unit, outside, which) in [
        ("height_map", "height of the surface above the floor", "m", 0.0, 0),
        ("basal_normal_stress_map", "normal stress sigma_zz at the basal height", "Pa", f64::NAN, 1),
    ] {
        let mut values = vec![outside; maps.len() * nx * ny];
        for (t, (map, basal)) in maps.iter().enumerate() {
            let field = if which == 0 { &map.height } else { &basal.normal };
            for (c, value) in field.iter().enumerate() {
                let i = (map.first[0] - x0) as usize + c % map.size[0];
                let j = (map.first[1] - y0) as usize + c / map.size[0];
                values[(t * ny + j) * nx + i] = *value;
            }
        }
        let v = Variable::new(name, Role::Data, &["t", names[1], names[0]], long, unit, values);
        d.variable(v.with("cell_methods", format!("{}: {}: point", names[1], names[0])));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_spelt_as_cf_wants() {
        for (ours, cf) in [
            ("m/s", "m s-1"),
            ("J/m", "J m-1"),
            ("kg/m3", "kg m-3"),
            ("1", "1"),
            ("1/s", "s-1"),
            ("J", "J"),
            ("m/s2", "m s-2"),
        ] {
            assert_eq!(cf_unit(ours), cf);
        }
    }

    #[test]
    fn ranges_of_bins_are_joined() {
        assert_eq!(union([(0, 5), (-2, 3), (1, 7)].into_iter()), (-2, 10));
    }
}
