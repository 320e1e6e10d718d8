//! The page on scaling.

use super::number;
use super::picture::{label, measured};
use super::planned::{Looked, Set, YANGS_COST};
use super::runs::{Ran, Real};
use crate::bench::page::Heading;
use serde_json::Value;
use std::fmt::Write;

/// What is on it.
pub struct Page<'a> {
    pub heading: &'a Heading,
    pub real: &'a Real,
    pub partitions: &'a [Looked],
    pub predicted: &'a [Set],
    pub migrated: &'a [Value],
    pub quick: bool,
}

/// The page.
pub fn scaling(page: &Page) -> String {
    let mut text = String::from("# Scaling\n\n");
    let small = if page.quick { " Small and few: these figures only show that everything works." } else { "" };
    let _ = write!(
        text,
        "{}{small} The tests are those of Yang et al. (2020, sections 3.2 to 3.6): a column of 0.2 x 0.05 x 0.1 m between a wall \
         behind it and two beside it. Efficiencies at many cores are predictions: how they are made, and how to make \
         others, is in [docs/scaling.md](../../docs/scaling.md).\n\n",
        page.heading.text()
    );
    real(&mut text, page.real);
    for set in page.predicted {
        predicted(&mut text, set, page.real.cost);
    }
    partitions(&mut text, page.partitions);
    migrated(&mut text, page.migrated);
    text
}

fn real(text: &mut String, real: &Real) {
    let _ = write!(
        text,
        "## Really run here\n\n\
         On more ranks than cores, so wall times mean nothing; processor time does: of all ranks together, calls of MPI left out. \
         What it is over that of the fewest ranks stands beside what the plan has for the copies (a copy costs a \
         share of an owned particle, see docs/scaling.md).\n\n"
    );
    let head = "| ranks | particles | halo : owned | processor time, us a particle-step | over the fewest ranks | planned | outputs |\n\
                |---|---|---|---|---|---|---|\n";
    for (title, runs) in [("Strong: the same particles on more ranks.", &real.strong), ("Weak.", &real.weak)] {
        let _ = write!(text, "{title}\n\n{head}");
        for run in runs {
            let first = &runs[0];
            let outputs = match (run.particles == first.particles, run.outputs == first.outputs) {
                (true, true) => "the same bits",
                (true, false) => "**differ**",
                (false, _) => "-",
            };
            let Ran { ranks, particles, cost, .. } = run;
            let _ = writeln!(
                text,
                "| {ranks} | {particles:.0} | {:.3} | {:.3} | {:.3} | {:.3} | {outputs} |",
                run.halo_share(),
                1e6 * cost,
                cost / first.cost,
                run.overhead() / first.overhead(),
            );
        }
        text.push('\n');
    }
    let _ = write!(
        text,
        "An owned particle costs {:.3} us a step here, walls and images told apart: the cost below.\n\n",
        real.cost
    );
}

fn predicted(text: &mut String, set: &Set, cost: f64) {
    let cores: Vec<u64> = set.curves.first().map_or(Vec::new(), |curve| curve.points.iter().map(|p| p.cores).collect());
    let [first, last] = [cores.first(), cores.last()].map(|cores| cores.copied().unwrap_or(0));
    let [low, high] = measured(set.weak).map(|share| 100.0 * share);
    let _ = write!(
        text,
        "## Predicted: {} scaling\n\n![Efficiency over cores]({})\n\n\
         Efficiency relative to {first} cores. Yang et al. measured {low:.1} to {high:.1} % at 1024 cores, with exchange partly \
         hidden behind computation and with about {YANGS_COST} us a particle and step; here it is {cost:.3} us, so the same \
         exchange weighs {:.0} times as much. Above 100 % where finer particles have fewer wall particles beside them. Samples of \
         large cases stand for material in disorder, whose halo is as thick as the reach; on the lattice of the start it is \
         thinner by about a quarter.\n\n\
         | case | {last} cores | with {YANGS_COST} us a particle | ms a step | max/mean owned | halo : owned | messages a step, most | MB a step, most |\n\
         |---|---|---|---|---|---|---|---|\n",
        set.name(),
        set.picture(),
        YANGS_COST / cost,
    );
    for curve in &set.curves {
        let Some(point) = curve.points.last() else { continue };
        let row = &point.row;
        let _ = writeln!(
            text,
            "| {} | {:.1} % | {:.1} % | {:.2} | {:.3} | {:.3} | {} | {:.2} |",
            label(set, curve),
            100.0 * point.efficiency,
            100.0 * point.slower,
            1e3 * number(row, "seconds-per-step"),
            number(row, "imbalance"),
            number(row, "halo-share"),
            number(row, "messages-most"),
            1e-6 * number(row, "bytes-most"),
        );
    }
    text.push('\n');
}

fn partitions(text: &mut String, looked: &[Looked]) {
    text.push_str(
        "## Partitions, computed for real\n\n\
         By the code that shares out a run, with all particles. Scheme: memory of a rank beyond its particles and their copies; \
         grid: what the particle-in-cell matrix of Yang et al. takes on every rank (cells of h, four bytes each).\n\n\
         | state | particles | ranks | a rank | max/mean owned | levels | halo : owned | peers, mean (most) | messages a step, mean | MB a step, mean | scheme | grid | invariants |\n\
         |---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for Looked { state, particles, row } in looked {
        let of = |name: &str| number(row, name);
        let faults = row["faults"].as_array().map_or(0, Vec::len);
        let _ = writeln!(
            text,
            "| {state} | {particles} | {} | {:.0} | {:.3} | {} | {:.3} | {:.1} ({}) | {:.1} | {:.2} | {:.0} KiB | {:.1} MiB | {} |",
            of("ranks"),
            of("owned") / of("ranks"),
            of("imbalance"),
            of("levels"),
            of("halo-share"),
            of("peers-mean"),
            of("peers-most"),
            of("messages-mean"),
            1e-6 * of("bytes-all") / of("ranks"),
            of("scheme-bytes") / 1024.0,
            of("matrix-bytes") / 1024.0 / 1024.0,
            if faults == 0 { "hold".to_owned() } else { format!("**{}**", row["faults"]) },
        );
    }
    text.push('\n');
}

fn migrated(text: &mut String, cases: &[Value]) {
    text.push_str(
        "## Migration: from slices to boxes\n\n\
         Yang et al.'s stress case: particles lie on the ranks in slices and go to their boxes, from neighbour to neighbour, or by one \
         exchange among all ranks (which no run makes). They needed 8 rounds on 1024 cores, a third of the time of \
         MPI_ALLTOALLV. Where there are times both ways were really gone here, on more ranks than cores, and led to the \
         same particles; the other lines are counted.\n\n\
         | ranks | particles | astray | rounds | sent from neighbour to neighbour | bytes | bytes, busiest rank | s | bytes, all to all | messages, all to all | s |\n\
         |---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for case in cases {
        let of = |name: &str| number(case, name);
        let time = |name: &str| case[name].as_f64().map_or_else(|| "-".to_owned(), |seconds| format!("{seconds:.2}"));
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {} | {:.1} MB | {:.1} MB | {} | {:.1} MB | {} | {} |",
            of("ranks"),
            of("particles"),
            of("strays"),
            of("rounds"),
            of("sent"),
            1e-6 * of("bytes"),
            1e-6 * of("bytes-busiest"),
            time("seconds"),
            1e-6 * of("all-bytes"),
            of("all-messages"),
            time("all-seconds"),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn ran(ranks: u32, cost: f64, digest: &str) -> Ran {
        let plan = json!({"rows": [{"halo-share": 0.25, "overhead": 1.0 + 0.05 * f64::from(ranks - 1)}]});
        let outputs = vec![("snapshot-0.hdf".to_owned(), digest.to_owned())];
        Ran { ranks, particles: 1000.0, cost, outputs, plan }
    }

    #[test]
    fn other_bits_show() {
        let strong = vec![ran(1, 1e-6, "a"), ran(2, 1.5e-6, "a"), ran(4, 1e-6, "b")];
        let mut text = String::new();
        real(&mut text, &Real { strong, weak: Vec::new(), cost: 0.9 });
        assert!(text.contains("| 2 | 1000 | 0.250 | 1.500 | 1.500 | 1.050 | the same bits |"), "{text}");
        assert!(text.contains("| 4 | 1000 | 0.250 | 1.000 | 1.000 | 1.150 | **differ** |"), "{text}");
    }

    #[test]
    fn broken_invariants_show_and_what_was_not_timed_does_not() {
        let mut text = String::new();
        let row = |faults: Value| json!({"ranks": 4, "owned": 400, "imbalance": 1.05, "faults": faults});
        let looked = |faults: Value| Looked { state: "start", particles: 400.0, row: row(faults) };
        partitions(&mut text, &[looked(json!([])), looked(json!(["3 nodes"]))]);
        assert!(text.contains("| start | 400 | 4 | 100 | 1.050 |") && text.contains("| hold |"), "{text}");
        assert!(text.contains("**[\"3 nodes\"]**"), "{text}");
        migrated(&mut text, &[json!({"ranks": 1024, "rounds": 9, "strays": 5})]);
        assert!(text.contains("| 5 | 9 |") && text.contains("| - |"), "{text}");
    }
}
