//! A plan as a table for people, and as JSON for scripts.

use super::cost::{Costs, Machine, Predicted};
use super::partition::{Load, Partition};
use super::places::Source;
use serde_json::{Value, json};
use std::fmt::Write as _;

/// Owned particles that a rank should have for each copy: below that the halo costs more than ranks bring (Yang et al. 2020
/// keep about that).
const OWNED_PER_COPY: f64 = 3.0;
/// Below this efficiency ranks are not advised either.
const WORTHWHILE: f64 = 0.7;

/// A number of ranks.
pub struct Row {
    pub partition: Partition,
    pub predicted: Predicted,
    /// With another cost of a particle.
    pub beside: Option<Predicted>,
}

/// All of a plan.
pub struct Table<'a> {
    pub source: &'a Source,
    pub costs: &'a Costs,
    pub machine: &'a Machine,
    pub rows: &'a [Row],
}

impl Row {
    fn ranks(&self) -> usize {
        self.partition.loads.len()
    }

    fn is_advised(&self) -> bool {
        OWNED_PER_COPY * self.partition.halo_share() <= 1.0 && self.predicted.efficiency >= WORTHWHILE
    }

    /// Bytes that a rank has to send and to receive at most in a step.
    fn bytes(&self) -> u64 {
        self.partition.bytes_per_copy() * self.partition.most(|load| load.copies.max(load.sent))
    }

    fn messages(&self) -> u64 {
        self.partition.exchanges.len() as u64 * self.partition.most(|load| load.messages)
    }

    /// Memory of a rank for its copies: their fields, and the two buffers of an exchange.
    fn halo_bytes(&self) -> u64 {
        let widest = self.partition.exchanges.iter().max().copied().unwrap_or(0) as u64;
        self.partition.most(|load| 8 * (widest * (load.copies + load.sent) + load.sent + 16 * load.copies))
    }
}

impl Table<'_> {
    /// Steps of the run from its start, if every step is as long as it may be.
    fn steps(&self) -> f64 {
        let scene = &self.source.scene;
        let step = scene.numerics.courant * scene.h() / scene.material.sound_speed();
        (scene.end.time / step).ceil()
    }

    pub fn text(&self) -> String {
        let Self { source, costs, machine, rows } = self;
        let mut text = format!(
            "{}: {} particles, {}\n\
             cost {:.3} us a particle and step ({}); latency {:.1} us, bandwidth {:.2} GB/s a rank, overlap {}\n\
             about {:.0} steps to the end\n\n",
            source.origin,
            source.count(),
            source.scene.space.name(),
            1e6 * costs.particle,
            costs.origin,
            1e6 * machine.latency,
            1e-9 * machine.bandwidth,
            machine.overlap,
            self.steps(),
        );
        let head = [
            "ranks",
            "owned",
            "max/mean",
            "halo/owned",
            "peers",
            "messages",
            "MB sent",
            "scheme",
            "halo",
            "grid of P",
            "ms/step",
            "efficiency",
            "whole run",
        ];
        let cells = rows.iter().map(|row| {
            let Row { partition, predicted, .. } = row;
            [
                row.ranks().to_string(),
                format!("{:.0}", partition.mean(|load| load.owned)),
                format!("{:.3}", partition.imbalance()),
                format!("{:.3}", partition.halo_share()),
                format!("{:.1} ({})", partition.mean(|load| load.peers), partition.most(|load| load.peers)),
                row.messages().to_string(),
                format!("{:.3}", 1e-6 * row.bytes() as f64),
                size(partition.scheme_bytes),
                size(row.halo_bytes()),
                size(partition.matrix_bytes),
                format!("{:.3}", 1e3 * predicted.step),
                format!("{:.1} %", 100.0 * predicted.efficiency),
                duration(self.steps() * predicted.step),
            ]
        });
        let all: Vec<[String; 13]> = std::iter::once(head.map(str::to_owned)).chain(cells).collect();
        let width = |column: usize| all.iter().map(|row| row[column].len()).max().unwrap_or(0);
        for row in &all {
            for (column, cell) in row.iter().enumerate() {
                let _ = write!(text, "{cell:>width$}  ", width = width(column));
            }
            text.truncate(text.trim_end().len());
            text.push('\n');
        }
        let _ = writeln!(
            text,
            "\npeers: mean (most); messages and MB: of the busiest rank in a step; scheme: memory of the partition on a rank \
             beyond its particles;\nhalo: memory of its copies; grid of P: what Yang et al.'s particle-in-cell matrix would \
             take on every rank\n\n{}",
            self.advice()
        );
        for fault in rows.iter().flat_map(|row| &row.partition.faults) {
            let _ = writeln!(text, "FAULT of the partition: {fault}");
        }
        text
    }

    /// How many ranks to ask for.
    fn advice(&self) -> String {
        let Some(best) = self.rows.iter().filter(|row| row.is_advised()).max_by_key(|row| row.ranks()) else {
            let least = self.rows.iter().map(Row::ranks).min().unwrap_or(1);
            return format!(
                "advice: fewer than {least} cores; already there a rank has fewer than {OWNED_PER_COPY} particles of its own for \
                 each copy, or efficiency is below {:.0} %",
                100.0 * WORTHWHILE
            );
        };
        let more = self.rows.iter().filter(|row| row.ranks() > best.ranks()).min_by_key(|row| row.ranks());
        let why = more.map_or_else(
            || "more may be worthwhile: ask for larger numbers".to_owned(),
            |row| {
                format!(
                    "{} have {:.1} at {:.0} %",
                    row.ranks(),
                    1.0 / row.partition.halo_share(),
                    100.0 * row.predicted.efficiency
                )
            },
        );
        let copies = best.partition.halo_share();
        let per_copy = if copies > 0.0 { format!("{:.1}", 1.0 / copies) } else { "no copies at all".into() };
        format!(
            "advice: ask for about {} cores: owned : halo is {per_copy} there (keep it above {OWNED_PER_COPY}), efficiency \
             {:.0} %; {why}",
            best.ranks(),
            100.0 * best.predicted.efficiency
        )
    }

    pub fn json(&self) -> String {
        let row = |row: &Row| -> Value {
            let Row { partition, predicted, beside } = row;
            let total = |of: fn(&Load) -> u64| partition.sum(of);
            json!({
                "ranks": row.ranks(),
                "owned": total(|load| load.owned),
                "owned-most": partition.most(|load| load.owned),
                "imbalance": partition.imbalance(),
                "levels": partition.levels,
                "copies": total(|load| load.copies),
                "copies-most": partition.most(|load| load.copies),
                "halo-share": partition.halo_share(),
                "images": total(|load| load.images),
                "walls": total(|load| load.walls),
                "walls-unique": partition.walls,
                "peers-mean": partition.mean(|load| load.peers),
                "peers-most": partition.most(|load| load.peers),
                "messages-most": row.messages(),
                "messages-mean": partition.exchanges.len() as f64 * partition.mean(|load| load.messages),
                "bytes-most": row.bytes(),
                "bytes-all": partition.bytes_per_copy() * total(|load| load.sent),
                "scheme-bytes": partition.scheme_bytes,
                "halo-bytes": row.halo_bytes(),
                "matrix-bytes": partition.matrix_bytes,
                "seconds-per-step": predicted.step,
                "seconds-computing": predicted.computing,
                "efficiency": predicted.efficiency,
                "overhead": predicted.overhead,
                "beside-seconds-per-step": beside.map(|beside| beside.step),
                "faults": partition.faults,
            })
        };
        let plan = json!({
            "origin": self.source.origin,
            "particles": self.source.count(),
            "space": self.source.scene.space.name(),
            "cost": self.costs.particle,
            "cost-origin": self.costs.origin,
            "latency": self.machine.latency,
            "bandwidth": self.machine.bandwidth,
            "overlap": self.machine.overlap,
            "steps": self.steps(),
            "advice": self.advice(),
            "rows": self.rows.iter().map(row).collect::<Vec<_>>(),
        });
        format!("{plan:#}\n")
    }
}

/// Bytes with a unit.
fn size(bytes: u64) -> String {
    let kilo = bytes as f64 / 1024.0;
    match kilo {
        _ if kilo < 1024.0 => format!("{kilo:.0} KiB"),
        _ if kilo < 1024.0 * 1024.0 => format!("{:.1} MiB", kilo / 1024.0),
        _ => format!("{:.1} GiB", kilo / 1024.0 / 1024.0),
    }
}

/// Time with a unit.
fn duration(seconds: f64) -> String {
    match seconds {
        _ if seconds < 100.0 => format!("{seconds:.1} s"),
        _ if seconds < 6000.0 => format!("{:.1} min", seconds / 60.0),
        _ => format!("{:.1} h", seconds / 3600.0),
    }
}
