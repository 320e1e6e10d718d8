//! Slices of wall time on this machine, one after the other: what a chain of jobs does, without a scheduler.

use crate::{failure::Failure, stage, status};
use formats::{exit, folder::RunFolder};

/// How a run is cut.
#[derive(Clone, Copy, Debug)]
pub struct Slices<'a> {
    /// Wall time of each, as `sph-run --wall-limit` takes it.
    pub wall: &'a str,
    /// So many at most.
    pub most: Option<u32>,
    /// More options of sph-run.
    pub options: &'a [String],
}

/// Prepares where needed, computes slice by slice until the run is done, and evaluates it.
///
/// # Errors
/// Code 75 where it was told to stop, or the slices are used up; that of a stage that failed.
pub fn run(programs: &stage::Programs, job: &stage::Job, slices: &Slices) -> Result<(), Failure> {
    stage::prepare(programs, job)?;
    let folder = RunFolder::new(job.folder);
    let mut options = vec!["--wall-limit".to_owned(), slices.wall.to_owned()];
    options.extend(slices.options.iter().cloned());
    let mut slice = 0;
    loop {
        slice += 1;
        let before = status::stop_of(&folder).and_then(|stop| stop.step);
        let Some(end) = stage::advance(programs, job, &options)? else { break };
        let stop = status::stop_of(&folder);
        let by_limit = stop.as_ref().is_some_and(|stop| stop.reason == "wall-limit");
        if end.status.success() || end.interrupted || !by_limit || stage::code(end.status) != exit::RESUMABLE {
            stage::passed("sph-run", end, job)?;
            break;
        }
        eprintln!("talus: slice {slice}: {}", status::Status::of(&folder)?.brief());
        if before.is_some() && stop.and_then(|stop| stop.step) == before {
            let message = format!("a slice of {} brings no step: take a longer one", slices.wall);
            return Err(Failure { code: exit::USAGE, message });
        }
        if slices.most.is_some_and(|most| slice >= most) {
            let message = format!("stopped after {slice} slices; go on with: {}", job.again);
            return Err(Failure { code: exit::RESUMABLE, message });
        }
    }
    stage::evaluate(programs, job)
}
