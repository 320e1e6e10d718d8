use crate::{analysis::Analysis,failure::Failure};use std::path::*;pub fn pictures(_:&Analysis,_:&Path)->Result<Vec<PathBuf>,Failure>{Ok(vec![])}
