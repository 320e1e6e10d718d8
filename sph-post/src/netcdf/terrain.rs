//! `post/terrain.nc`: maps on the cells of the terrain's raster, in its coordinates.

use super::common;
use crate::{analysis::Analysis, terrain::Maps};
use formats::results::{Dataset, Role, Variable};

/// The maps of a landslide; none without a terrain, or in a section.
pub fn terrain(a: &Analysis) -> Option<Dataset> {
    let maps = a.maps.as_ref()?;
    let mut d = common(a, "thickness, speed and arrival on the terrain", 1);
    d.attribute("terrain_file", maps.terrain.file.as_str());
    let crs = maps.terrain.ground.crs.as_deref().map(crs);
    d.dimension("t", maps.times.len());
    d.dimension("bnds", 2);
    d.variable(super::time(maps.times.clone()));
    for (axis, name) in ["x", "y"].into_iter().enumerate() {
        coordinate(maps, &mut d, axis, name, crs.is_some());
    }
    let mut add = |name: &str, long: &str, unit: &str, method: &str, over_time: bool, values: Vec<f64>| {
        let dimensions: &[&str] = if over_time { &["t", "y", "x"] } else { &["y", "x"] };
        let mut v = Variable::new(name, Role::Data, dimensions, long, unit, values);
        if !method.is_empty() {
            v = v.with("cell_methods", method);
        }
        d.variable(if crs.is_some() { v.with("grid_mapping", "crs") } else { v });
    };
    let (thick, fast) = (
        "vertical thickness of the material: mass over area and the density at the start",
        "speed of the mean velocity of the column",
    );
    let all = |fields: &[Vec<f64>]| fields.concat();
    add("ground", "height of the ground", "m", "", false, maps.ground());
    add("thickness", thick, "m", "area: mean", true, all(&maps.thickness));
    add("speed", &format!("{fast}, where it is thick enough"), "m s-1", "", true, all(&maps.speed));
    let most = |what: &str| format!("largest {what}, of all snapshots");
    let largest = maps.largest(&maps.thickness);
    add("max_thickness", &most(thick), "m", "area: mean time: maximum", false, largest);
    add("max_speed", &most(fast), "m s-1", "time: maximum", false, maps.largest(&maps.speed));
    let long = "time at which the thickness first comes up to threshold_thickness, linear between snapshots";
    add("arrival_time", long, "s", "", false, maps.arrival());
    add("deposit_thickness", &format!("{thick}, at the end"), "m", "area: mean", false, maps.deposit());
    let long = "share of the mass that lies beyond the raster's edge, where the ground goes on level";
    d.variable(Variable::new("mass_beyond_edge", Role::Data, &["t"], long, "1", maps.beyond.clone()));
    let long = "thickness below which a cell counts as not reached, and has no speed: half a spacing";
    d.variable(Variable::new("threshold_thickness", Role::Data, &[], long, "m", vec![maps.least]));
    d.variables.extend(crs);
    Some(d)
}

fn coordinate(maps: &Maps, d: &mut Dataset, axis: usize, name: &str, projected: bool) {
    let (count, half) = (maps.size[axis], 0.5 * maps.terrain.ground.cell[axis]);
    d.dimension(name, count);
    let bounds = format!("{name}_bnds");
    let values: Vec<f64> = (0..count).map(|n| maps.coordinate(axis, n)).collect();
    let edges = values.iter().flat_map(|x| [x - half, x + half]).collect();
    let long = if axis == 0 { "easting, x of the raster" } else { "northing, y of the raster" };
    let mut v = Variable::new(name, Role::Coordinate, &[name], long, "m", values)
        .with("axis", if axis == 0 { "X" } else { "Y" })
        .with("bounds", bounds.as_str());
    if projected {
        v = v.with("standard_name", format!("projection_{name}_coordinate"));
    }
    d.variable(v);
    let dimensions = vec![name.to_string(), "bnds".to_string()];
    d.variable(Variable { name: bounds, role: Role::Coordinate, dimensions, attributes: Vec::new(), values: edges });
}

/// The grid mapping: in full for zones of UTM on WGS 84 and ETRS89, else what the raster says of it.
fn crs(text: &str) -> Variable {
    let v = Variable::new("crs", Role::Data, &[], "coordinate reference system of the raster", "1", vec![0.0]);
    let is_wkt = text.contains('[');
    let v = v.with(if is_wkt { "crs_wkt" } else { "spatial_ref" }, text);
    let code: u32 = text.strip_prefix("EPSG:").and_then(|code| code.trim().parse().ok()).unwrap_or(0);
    let (zone, south) = match code {
        32601..=32660 => (code - 32600, false),
        32701..=32760 => (code - 32700, true),
        25828..=25838 => (code - 25800, false),
        _ => return v,
    };
    // Both ellipsoids to the digits that matter here: GRS 80 for ETRS89.
    let flattening = if code < 30000 { 298.257_222_101 } else { 298.257_223_563 };
    v.with("grid_mapping_name", "transverse_mercator")
        .with("longitude_of_central_meridian", 6.0 * f64::from(zone) - 183.0)
        .with("latitude_of_projection_origin", 0.0)
        .with("scale_factor_at_central_meridian", 0.9996)
        .with("false_easting", 500_000.0)
        .with("false_northing", if south { 10_000_000.0 } else { 0.0 })
        .with("semi_major_axis", 6_378_137.0)
        .with("inverse_flattening", flattening)
}

#[cfg(test)]
mod tests {
    use super::*;
    use formats::results::Value;

    #[test]
    fn zones_of_utm_are_spelt_out_and_others_named() {
        let of = |text: &str, name: &str| crs(text).attributes.into_iter().find(|(n, _)| n == name).map(|(_, v)| v);
        assert_eq!(of("EPSG:32632", "longitude_of_central_meridian"), Some(Value::Number(9.0)));
        assert_eq!(of("EPSG:32719", "false_northing"), Some(Value::Number(1e7)));
        assert_eq!(of("EPSG:25832", "inverse_flattening"), Some(Value::Number(298.257_222_101)));
        assert_eq!(of("EPSG:2056", "spatial_ref"), Some(Value::Text("EPSG:2056".into())));
        assert_eq!(of("EPSG:2056", "grid_mapping_name"), None);
        assert!(of("PROJCS[\"x\"]", "crs_wkt").is_some());
    }
}
