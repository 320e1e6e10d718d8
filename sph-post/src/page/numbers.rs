//! What was measured, as tables.

use super::html::{number, quantity, table};
use crate::analysis::Analysis;
use formats::space::Space;

/// Run-outs, heights and what else one number says of the last snapshot, with the law for such columns where there is one.
pub fn deposit(a: &Analysis) -> String {
    let (g, last) = (&a.geometry, a.last());
    let law = g.law();
    let fronts = &last.deposit.fronts;
    let known = |value: Option<f64>, ours: f64| match (value, &law) {
        (Some(value), Some(law)) if ours.is_finite() => {
            format!("{} ({}; {:+.1} %)", number(value), law.source, 100.0 * (ours / value - 1.0))
        }
        _ => String::new(),
    };
    let scaled = |v: f64| if v.is_finite() { number(v) } else { String::new() };
    let over_r0 = |length: f64| g.r0().map_or(f64::NAN, |r0| length / r0);
    let front = |name: &str, at: f64| {
        let ours = a.scaled(at);
        let law = law.as_ref().and_then(|l| l.run_out);
        vec![name.to_string(), quantity(at, "m"), scaled(ours), known(law, ours)]
    };
    let height = last.deposit.height_centre;
    let one = |name: &str, value: String| vec![name.to_string(), value, String::new(), String::new()];
    let mut rows = vec![
        front("front, true: furthest particle", fronts.furthest),
        front("front, 99.5 % of the mass", fronts.mass),
        front("front, effective: thickness dx/2", fronts.thickness),
        vec![
            "height at the centre".into(),
            quantity(height, "m"),
            scaled(over_r0(height)),
            known(law.as_ref().and_then(|l| l.height), over_r0(height)),
        ],
        vec![
            "height anywhere".into(),
            quantity(last.deposit.height_max, "m"),
            scaled(over_r0(last.deposit.height_max)),
            String::new(),
        ],
        one("volume over that of the start", number(last.deposit.volume_ratio)),
    ];
    if g.runs_outward {
        let strays = last.deposit.strays;
        let text = format!("{}; {:.2} % of the mass", strays.count, 100.0 * strays.share);
        rows.push(one("stray particles beyond the effective front", text));
    }
    rows.push(one("static share of the volume", number(last.flow.share)));
    rows.push(one(
        &format!("force over weight, {} above the floor", quantity(a.level, "m")),
        number(last.basal.ratio()),
    ));
    if let Some(m) = a.failure.map(|k| &a.moments[k])
        && let Some(line) = m.failure_plane.line
    {
        rows.push(one(&format!("failure plane at {}", quantity(m.time, "s")), format!("{:.1}\u{b0}", line.angle_deg)));
    }
    let scale = g.time_scale().map_or(String::new(), |t| format!(", {:.2} T", last.time / t));
    let count = a.moments.len();
    let text = format!("<p>The last of {count} snapshots, at t = {}{scale}.</p>\n", quantity(last.time, "s"));
    let length = if g.runs_outward { "run-out, or over the initial extent" } else { "over the initial extent" };
    text + &table(&["quantity", "value", length, "law (deviation from it)"], &rows)
}

/// The energies at the start, when the kinetic one is largest, and in the end; each over the potential energy at the start.
pub fn energies(a: &Analysis) -> String {
    let start = a.start_potential();
    let unit = if a.geometry.space == Space::PlaneStrain { "J/m" } else { "J" };
    let floor = a.moments[0].energy.above_floor(&a.geometry, 0.0);
    let (times, columns): (Vec<f64>, Vec<(&str, Vec<f64>)>) = match &a.partition {
        Some(p) => (
            p.times.clone(),
            vec![
                ("kinetic", p.kinetic.clone()),
                ("potential, from the floor", p.potential.iter().map(|e| e + floor).collect()),
                ("elastic", p.elastic.clone()),
                ("plastic work", p.plastic.clone()),
                ("viscous work", p.viscous.clone()),
            ],
        ),
        None => (
            a.moments.iter().map(|m| m.time).collect(),
            vec![
                ("kinetic", a.moments.iter().map(|m| m.energy.kinetic).collect()),
                ("potential, from the floor", a.moments.iter().map(|m| m.energy.potential + floor).collect()),
                ("elastic", a.moments.iter().map(|m| m.energy.elastic).collect()),
            ],
        ),
    };
    let kinetic = &columns[0].1;
    let peak = (0..times.len()).max_by(|&i, &k| kinetic[i].total_cmp(&kinetic[k])).unwrap_or(0);
    let places = [0, peak, times.len() - 1];
    let share = |e: f64| if start > 0.0 { format!("{} ({:.1} %)", number(e), 100.0 * e / start) } else { number(e) };
    let row = |name: &str, value: &dyn Fn(usize) -> f64| -> Vec<String> {
        std::iter::once(format!("{name} ({unit})")).chain(places.map(|k| share(value(k)))).collect()
    };
    let mut rows: Vec<Vec<String>> = columns.iter().map(|(name, values)| row(name, &|k| values[k])).collect();
    rows.push(row("sum", &|k| columns.iter().map(|c| c.1[k]).sum()));
    if let Some(p) = &a.partition {
        let percent = places.map(|k| format!("{:.3} %", 100.0 * p.closure[k]));
        rows.push(std::iter::once("error of the sum".to_string()).chain(percent).collect());
    }
    let headings = [
        "energy (% of the potential energy at the start)".to_string(),
        format!("start, t = {}", quantity(times[0], "s")),
        format!("kinetic peak, t = {}", quantity(times[peak], "s")),
        format!("end, t = {}", quantity(times[times.len() - 1], "s")),
    ];
    let headings: Vec<&str> = headings.iter().map(String::as_str).collect();
    let remark = if a.partition.is_some() {
        "<p>The error of the sum is over the largest change of the potential energy.</p>\n"
    } else {
        "<p>The history does not tell the work that was done: what is missing in the sum was dissipated.</p>\n"
    };
    table(&headings, &rows) + remark
}
