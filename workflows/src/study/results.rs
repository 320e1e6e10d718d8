//! `results.csv` of a study: one line a run, sorted, so that a rerun changes its own line only.

use super::{
    definition::{Run, Study},
    template::Value,
};
use crate::{failure::Failure, paths};
use formats::disk;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// What a line holds beside the parameters.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Line {
    /// Material particles.
    pub particles: Option<u64>,
    /// Measures by name; what the run does not have is not there.
    pub measures: BTreeMap<String, f64>,
    /// Wall time of all stages, s; none where it was stopped on the way.
    pub seconds: Option<f64>,
    /// MPI ranks.
    pub ranks: u32,
    /// Commit of the programs, with `+` where something in them was not committed.
    pub commit: String,
    /// The day it began, UTC.
    pub date: String,
    /// Beginning of the scene's hash.
    pub scene: String,
    /// Exit code: 0, or that of the stage that failed.
    pub exit: i32,
}

/// Lines by name of the run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Results(pub BTreeMap<String, Line>);

/// Digits of a scene's hash that are kept.
pub const HASH_DIGITS: usize = 8;

/// The file of a study.
pub fn path(study: &Study) -> PathBuf {
    study.folder.join("results.csv")
}

/// Beginning of the hash of a run's scene as it is now.
pub fn hash(run: &Run) -> String {
    formats::scene::Scene::text_hash(&run.scene).chars().take(HASH_DIGITS).collect()
}

impl Results {
    /// Reads the file; no file is no results.
    pub fn read(study: &Study) -> Result<Self, Failure> {
        let path = path(study);
        let fault = |e: String| Failure::no_input(format!("{}: {e}", paths::short(&path).display()));
        match std::fs::read_to_string(&path) {
            Ok(text) => Self::parse(&text).map_err(fault),
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(Self::default()),
            Err(e) => Err(fault(e.to_string())),
        }
    }

    /// Writes it, whole or not at all; lines of runs the study no longer has are left out.
    pub fn write(&self, study: &Study) -> Result<(), Failure> {
        let path = path(study);
        disk::write_atomic(&path, self.text(study).as_bytes())
            .map_err(|e| Failure::cannot_write(format!("{}: {e}", paths::short(&path).display())))
    }

    /// The line of a run.
    pub fn of(&self, run: &Run) -> Option<&Line> {
        self.0.get(&run.name)
    }

    fn text(&self, study: &Study) -> String {
        let mut runs: Vec<&Run> = study.runs.iter().collect();
        runs.sort_by(|a, b| order(study, a).partial_cmp(&order(study, b)).unwrap_or(std::cmp::Ordering::Equal));
        let names = study.measures.iter().map(|measure| measure.title.as_str());
        let head: Vec<&str> = ["run", "series"]
            .into_iter()
            .chain(study.parameters.iter().map(String::as_str))
            .chain(["particles"])
            .chain(names)
            .chain(["wall_s", "ranks", "commit", "date", "scene", "exit"])
            .collect();
        let lines = runs.iter().filter_map(|run| Some(cells(study, run, self.of(run)?).join(",")));
        lines.fold(head.join(","), |text, line| text + "\n" + &line) + "\n"
    }

    fn parse(text: &str) -> Result<Self, String> {
        let mut lines = text.lines();
        let head: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
        let column = |name: &str| head.iter().position(|h| *h == name).ok_or(format!("there is no column `{name}`"));
        let [run, particles, wall] = [column("run")?, column("particles")?, column("wall_s")?];
        let [ranks, commit, date] = [column("ranks")?, column("commit")?, column("date")?];
        let [scene, exit] = [column("scene")?, column("exit")?];
        let mut results = Self::default();
        for (index, text) in lines.enumerate() {
            let cells: Vec<&str> = text.split(',').collect();
            let fault = |what: &str| format!("line {}: {what}", index + 2);
            if cells.len() != head.len() {
                return Err(fault(&format!("{} cells under {} headings", cells.len(), head.len())));
            }
            let numbers = (particles + 1..wall).filter(|&k| !cells[k].is_empty());
            let numbers = numbers.map(|k| Ok((head[k].to_owned(), cells[k].parse::<f64>().map_err(|e| (k, e))?)));
            let measures = numbers.collect::<Result<_, (usize, std::num::ParseFloatError)>>();
            let line = Line {
                particles: cells[particles].parse().ok(),
                measures: measures.map_err(|(k, e)| fault(&format!("{}: {e}", head[k])))?,
                seconds: cells[wall].parse().ok(),
                ranks: cells[ranks].parse().map_err(|_| fault("ranks: a whole number expected"))?,
                commit: cells[commit].into(),
                date: cells[date].into(),
                scene: cells[scene].into(),
                exit: cells[exit].parse().map_err(|_| fault("exit: a whole number expected"))?,
            };
            results.0.insert(cells[run].to_owned(), line);
        }
        Ok(results)
    }
}

/// Series in the order of the study, then parameters, numbers by size.
fn order<'a>(study: &Study, run: &'a Run) -> (usize, Vec<(f64, &'a str)>) {
    let series = study.series.iter().position(|series| *series == run.series).unwrap_or(0);
    let key = |(_, value): &'a (String, Value)| match value {
        Value::Number(number) => (*number, ""),
        Value::Text(text) => (0.0, text.as_str()),
    };
    (series, run.parameters.iter().map(key).collect())
}

fn cells(study: &Study, run: &Run, line: &Line) -> Vec<String> {
    let parameter = |name: &String| {
        run.parameters.iter().find(|(known, _)| known == name).map_or(String::new(), |(_, value)| value.to_string())
    };
    let measure = |name: &str| line.measures.get(name).map_or(String::new(), |value| significant(*value));
    [run.name.clone(), run.series.clone()]
        .into_iter()
        .chain(study.parameters.iter().map(parameter))
        .chain([line.particles.map_or(String::new(), |n| n.to_string())])
        .chain(study.measures.iter().map(|known| measure(&known.title)))
        .chain([
            line.seconds.map_or(String::new(), |seconds| format!("{seconds:.0}")),
            line.ranks.to_string(),
            line.commit.clone(),
            line.date.clone(),
            line.scene.clone(),
            line.exit.to_string(),
        ])
        .collect()
}

/// Six digits: finer ones change with every compiler.
pub fn significant(value: f64) -> String {
    let rounded: f64 = format!("{value:.5e}").parse().unwrap_or(value);
    match rounded != 0.0 && !(1e-3..1e7).contains(&rounded.abs()) {
        true => format!("{rounded:e}"),
        false => format!("{rounded}"),
    }
}
