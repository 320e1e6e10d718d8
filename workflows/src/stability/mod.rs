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

/// Runs what is not there yet, then draws the map.
pub fn carry_out(options: &Options) -> Result<(), Failure> {
    let map = Map::read(&paths::stability())?;
    let mut options = options.clone();
    options.only = map.rows_of(&options.only)?;
    let mut results = Results::read(&map.study)?;
    let ended = match options.draw {
        true => Ok(()),
        false => batch::run(&map.study, &mut results, &options),
    };
    for path in page::refresh(&map, &results)? {
        println!("{}", paths::short(&path).display());
    }
    ended
}
