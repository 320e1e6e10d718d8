//! `stability`: methods on scenes that are known to make SPH fail, each judged by one number. The keys of `tests/stability` are told
//! in its README.md; the map is docs/stability. Runs, resuming and results are those of a study.

mod definition;
mod judge;
mod page;
mod picture;
#[cfg(test)]
mod tests;

use crate::{
    failure::Failure,
    paths,
    study::{Options, batch, results::Results},
};
use definition::Map;
use formats::exit;

/// Runs what is not there yet, then draws the map.
pub fn carry_out(options: &Options) -> Result<(), Failure> {
    let map = Map::read(&paths::stability())?;
    let mut options = options.clone();
    options.only = map.rows_of(&options.only)?;
    let mut results = Results::read(&map.study)?;
    let ended = match options.draw {
        true => Ok(()),
        false => judged(&map, &options, batch::run(&map.study, &mut results, &options)),
    };
    // A run that failed is a result, and only the file has it: the runs' threads hold the lines.
    let results = if options.draw { results } else { Results::read(&map.study)? };
    for path in page::refresh(&map, &results)? {
        println!("{}", paths::short(&path).display());
    }
    ended
}

/// Here a computation that breaks down is what was asked for, and no failure of the command.
fn judged(map: &Map, options: &Options, ended: Result<(), Failure>) -> Result<(), Failure> {
    let Err(failure) = ended else { return Ok(()) };
    if failure.code == exit::RESUMABLE {
        let message = "stopped early; go on with: ./talus stability, and the same options".into();
        return Err(Failure { code: exit::RESUMABLE, message });
    }
    let results = Results::read(&map.study)?;
    let is_wanted = |series: &String| options.only.is_empty() || options.only.contains(series);
    let codes =
        map.study.runs.iter().filter(|run| is_wanted(&run.series)).filter_map(|run| Some(results.of(run)?.exit));
    match codes.filter(|code| ![exit::DONE, exit::NUMERICAL].contains(code)).count() {
        0 if failure.code == exit::NUMERICAL => Ok(()),
        _ => Err(failure),
    }
}
