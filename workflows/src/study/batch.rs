//! Which runs are to do, cheapest first, several at a time; each result is on disk before the next run begins.

use super::{
    Options,
    definition::{Run, Study},
    duration, expression,
    numbers::PROCESSOR,
    results::{self, Line, Results},
};
use crate::{
    failure::Failure,
    launch, paths, stage,
    validate::{
        measure,
        record::{self, Earlier, Record, Sources},
    },
};
use formats::{disk, exit, folder::RunFolder, snapshot};
use serde_json::Value as Json;
use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard};
use std::time::Instant;

/// Runs what is to do. A run that fails leaves its exit code in the results, and the next one begins; in the end they make a failure,
/// unless breaking down is what is looked for. A stop on request ends them all.
pub fn run(study: &Study, results: &mut Results, options: &Options) -> Result<(), Failure> {
    let sources = Sources::of_programs()?;
    let commit = short(&sources);
    let mut queue: Vec<&Run> = study.runs.iter().filter(|run| wanted(run, options)).collect();
    queue.retain(|run| match options.evaluate {
        true => is_done(study, run),
        false => is_to_do(run, results.of(run), &commit, options.reuse),
    });
    queue.sort_by(|a, b| a.seconds.total_cmp(&b.seconds));
    queue.truncate(options.first.unwrap_or(usize::MAX));
    if queue.is_empty() {
        eprintln!("talus: {}: nothing is to do", study.words);
        return Ok(());
    }
    let all: f64 = queue.iter().map(|run| run.seconds).sum();
    eprintln!("talus: {}: {} runs, about {} on one rank", study.words, queue.len(), duration(all));
    let programs = stage::Programs::build()?;
    let folder = study.place.clone();
    std::fs::create_dir_all(&folder)
        .map_err(|e| Failure::cannot_write(format!("{}: cannot make the folder: {e}", folder.display())))?;
    let (count, failed) = (queue.len(), Mutex::new(0_usize));
    let queue: Mutex<VecDeque<(usize, &Run)>> = Mutex::new(queue.into_iter().enumerate().collect());
    let (results, ended) = (Mutex::new(results), Mutex::new(None));
    let spent = Mutex::new(0.0_f64);
    let budget = options.budget.map_or(f64::INFINITY, |budget| budget.as_secs_f64());
    let work = |programs: stage::Programs| -> Result<(), Failure> {
        while held(&ended).is_none()
            && *held(&spent) < budget
            && let Some((number, run)) = take(&queue)
        {
            eprintln!("talus: [{}/{count}] {}, about {}", number + 1, run.name, duration(run.seconds));
            let begun = Instant::now();
            let line = one(study, run, &programs, &sources, options)?;
            let took = duration(begun.elapsed().as_secs_f64());
            match line.exit {
                exit::DONE => eprintln!("talus: [{}/{count}] {} done in {took}", number + 1, run.name),
                exit::RESUMABLE => return Err(stopped(study)),
                code => {
                    *held(&failed) += usize::from(!(study.may_break_down && code == exit::NUMERICAL));
                    let log = log(study, run);
                    let log = paths::short(&log).display();
                    eprintln!("talus: [{}/{count}] {} failed with exit code {code}: see {log}", number + 1, run.name);
                }
            }
            *held(&spent) += line.measures.get(PROCESSOR).copied().unwrap_or_else(|| begun.elapsed().as_secs_f64());
            let mut results = held(&results);
            results.0.insert(run.name.clone(), line);
            results.write(study)?;
        }
        Ok(())
    };
    let programs = (0..options.jobs).map(|_| programs.again()).collect::<Result<Vec<_>, _>>()?;
    std::thread::scope(|scope| {
        for programs in programs {
            let (work, ended) = (&work, &ended);
            scope.spawn(move || {
                if let Err(failure) = work(programs) {
                    held(ended).get_or_insert(failure);
                }
            });
        }
    });
    match (ended.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner), *held(&failed)) {
        (Some(failure), _) => Err(failure),
        (None, 0) => Ok(()),
        (None, n) => {
            let message = format!("{n} of {count} runs failed; the others are kept");
            Err(Failure { code: exit::NUMERICAL, message })
        }
    }
}

fn wanted(run: &Run, options: &Options) -> bool {
    options.only.is_empty() || options.only.contains(&run.series)
}

/// Not there, of another scene, of other sources, or ended by something that was not the computation itself.
pub(super) fn is_to_do(run: &Run, line: Option<&Line>, commit: &str, reuse: bool) -> bool {
    let Some(line) = line else { return true };
    let same_sources = reuse || line.commit == commit;
    let computed = line.exit == exit::DONE || line.exit == exit::NUMERICAL && line.commit == commit;
    !(computed && same_sources && line.scene == results::hash(run))
}

fn stopped(study: &Study) -> Failure {
    let message = format!("stopped early; go on with: ./talus {}, and the same options", study.words);
    Failure { code: exit::RESUMABLE, message }
}

/// A worker that panicked leaves the rest to the others.
fn held<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

fn take<T>(queue: &Mutex<VecDeque<T>>) -> Option<T> {
    held(queue).pop_front()
}

fn short(sources: &Sources) -> String {
    format!("{}{}", sources.commit, if sources.changed { "+" } else { "" })
}

fn folder(study: &Study, run: &Run) -> PathBuf {
    study.place.join(&run.name)
}

/// What the stages said.
fn log(study: &Study, run: &Run) -> PathBuf {
    study.place.join(format!("{}.log", run.name))
}

/// Is there a finished run of the scene as it is now?
fn is_done(study: &Study, run: &Run) -> bool {
    let folder = RunFolder::new(folder(study, run));
    folder.done().is_file() && std::fs::read_to_string(folder.scene()).is_ok_and(|text| text == run.scene)
}

/// One run: begun, gone on with, or only evaluated, as its folder allows. What fails in the stages is in the line; what
/// fails here ends the study.
fn one(
    study: &Study,
    run: &Run,
    programs: &stage::Programs,
    sources: &Sources,
    options: &Options,
) -> Result<Line, Failure> {
    let (folder, log) = (folder(study, run), log(study, run));
    let scene = study.place.join(format!("{}.toml", run.name));
    disk::write_atomic(&scene, run.scene.as_bytes())
        .map_err(|e| Failure::cannot_write(format!("{}: {e}", scene.display())))?;
    let ranks = options.ranks.or((options.jobs > 1).then_some(1));
    let again = format!("./talus {}", study.words);
    let job = stage::Job { scene: &scene, folder: &folder, ranks, fresh: false, again: &again, log: Some(&log) };
    let begun = |ranks| Record::begun(sources, &run.scene, ranks);
    let (record, ended) = match record::earlier(&folder, &run.scene, sources) {
        Earlier::Done(record) if options.reuse || options.evaluate || record.sources == *sources => {
            (record, stage::run(programs, &job))
        }
        Earlier::Begun(record) => (record, stage::run(programs, &job)),
        _ => match afresh(programs, &job, &begun) {
            Ok(both) => both,
            Err(failure) => (begun(ranks.unwrap_or(1)), Err(failure)),
        },
    };
    let mut line = Line {
        particles: None,
        measures: BTreeMap::new(),
        seconds: record.seconds,
        ranks: record.ranks,
        commit: short(&record.sources),
        date: record.date,
        scene: results::hash(run),
        exit: exit::DONE,
    };
    match ended {
        Ok(()) => {
            let folder = RunFolder::new(&folder);
            let mut summary = measure::summary(&folder.post())?;
            study.numbers.add(&folder, &mut summary)?;
            line.particles = summary.get("particles").and_then(Json::as_u64);
            line.measures = measures(study, &summary);
        }
        Err(failure) => {
            line.exit = failure.code;
            note(&log, &failure);
        }
    }
    Ok(line)
}

type Ended = (Record, Result<(), Failure>);

fn afresh(programs: &stage::Programs, job: &stage::Job, begun: &dyn Fn(u32) -> Record) -> Result<Ended, Failure> {
    let started = Instant::now();
    stage::prepare(programs, &stage::Job { fresh: true, ..*job })?;
    let header = snapshot::read_header(&RunFolder::new(job.folder).initial())
        .map_err(|e| Failure { code: e.exit_code(), message: e.to_string() })?;
    let mut record = begun(launch::ranks(job.ranks, header.count));
    record.write(job.folder)?;
    let ended = stage::compute(programs, job);
    if ended.is_ok() {
        record.seconds = Some(started.elapsed().as_secs_f64());
        record.write(job.folder)?;
    }
    Ok((record, ended))
}

/// The failure's words, after what the stages said. The exit code is kept anyway, so a log that cannot be written is no
/// failure of its own.
fn note(log: &Path, failure: &Failure) {
    use std::io::Write;
    if let Ok(mut file) = std::fs::File::options().create(true).append(true).open(log) {
        let _ = writeln!(file, "talus: {failure}");
    }
}

/// The study's measures from `summary.json`; nothing where a key is missing, null, or no number.
pub(super) fn measures(study: &Study, summary: &Json) -> BTreeMap<String, f64> {
    let key = |name: &str| Some(summary.get(name).and_then(Json::as_f64).unwrap_or(f64::NAN));
    let of = |text: &str| expression::evaluate(text, &key).unwrap_or(f64::NAN);
    let values = study.measures.iter().map(|measure| (measure.title.clone(), of(&measure.expression)));
    values.filter(|(_, value)| value.is_finite()).collect()
}
