//! `sph-run --check`: what of a run folder is sound, without MPI.

use formats::folder::RunFolder;
use formats::outputs::Index;
use formats::snapshot::FileError;
use formats::{checkpoint, exit, news};
use std::time::SystemTime;
use std::{fs, io};

/// Verifies all checkpoints and outputs, and lists them on standard output. The exit code: 65 where no checkpoint is
/// sound although there are some, or an output is damaged.
pub fn report(folder: &RunFolder) -> i32 {
    match list(folder, &mut io::stdout().lock()) {
        Ok(true) => exit::DONE,
        Ok(false) => exit::NO_INPUT,
        Err(error) => {
            news::fail(&error.to_string(), error.exit_code());
            error.exit_code()
        }
    }
}

/// Is what is there good to go on with?
fn list(folder: &RunFolder, out: &mut impl io::Write) -> Result<bool, FileError> {
    fs::metadata(folder.scene()).map_err(|error| FileError::reading(&folder.scene(), &error))?;
    let generations = checkpoint::generations(folder)?;
    let mut lines = Vec::new();
    let mut newest_sound = None;
    for &generation in &generations {
        let name = format!("gen-{generation:06}");
        lines.push(match checkpoint::verify(folder, generation) {
            Ok(manifest) => {
                newest_sound = Some(name.clone());
                let (step, time) = (manifest.step, manifest.time);
                let size = manifest.state_bytes as f64 / f64::from(1 << 20);
                let age = age(folder, generation);
                format!("{name}  step {step:>9}  t = {time:.6e} s  {size:>9.2} MiB  {age:>14} old  sound")
            }
            Err(error) => format!("{name}  {error}"),
        });
    }
    lines.push(match (&newest_sound, generations.is_empty()) {
        (Some(name), _) if folder.done().exists() => format!("the run is done; {name} is its end"),
        (Some(name), _) => format!("the next launch resumes from {name}"),
        (None, true) => "no checkpoint yet: the next launch starts at the beginning".into(),
        (None, false) => "no checkpoint is sound: the next launch refuses to start".into(),
    });
    let index = Index::read(folder)?.unwrap_or_default();
    let faults = index.faults(folder);
    lines.extend(faults.iter().map(ToString::to_string));
    let (segments, snapshots) = (index.segments.len(), index.snapshots().count());
    let state = if faults.is_empty() { "all sound".into() } else { format!("{} files damaged", faults.len()) };
    lines.push(format!("out: {segments} segments with {snapshots} snapshots, {state}"));
    // Nobody to tell where the reader has gone.
    let _ = writeln!(out, "{}", lines.join("\n"));
    Ok(faults.is_empty() && (newest_sound.is_some() || generations.is_empty()))
}

fn age(folder: &RunFolder, generation: u64) -> String {
    let written = fs::metadata(folder.generation(generation)).and_then(|facts| facts.modified());
    let age = written.ok().and_then(|at| SystemTime::now().duration_since(at).ok()).unwrap_or_default();
    humantime::format_duration(std::time::Duration::from_secs(age.as_secs())).to_string()
}
