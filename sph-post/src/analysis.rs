//! Goes through the snapshots of a run, one at a time.

use crate::{
    basal::{Basal, Level},
    deposit::Deposit,
    energy::Energy,
    failure::Failure,
    geometry::Geometry,
    history::History,
    sample::Sampler,
    scatter::Scatter,
};
use formats::{
    folder::RunFolder,
    scene::Scene,
    snapshot::{self, FileError},
};
use std::path::{Path, PathBuf};

/// Snapshots that are shown as particles: these many, spread over the run.
const PANELS: usize = 6;

/// What one snapshot shows.
#[derive(Clone, Debug)]
pub struct Moment {
    /// Time, s.
    pub time: f64,
    /// Steps done.
    pub step: u64,
    /// Number of particles.
    pub particles: usize,
    /// Surface and run-out.
    pub deposit: Deposit,
    /// Stresses near the floor.
    pub basal: Basal,
    /// Energies.
    pub energy: Energy,
    /// The particles, thinned for a picture, where this snapshot is shown.
    pub scatter: Option<Scatter>,
}

/// A run, evaluated.
#[derive(Clone, Debug)]
pub struct Analysis {
    /// The scene.
    pub scene: Scene,
    /// Its text.
    pub text: String,
    /// The SHA-256 of its text.
    pub hash: String,
    /// What of it matters here.
    pub geometry: Geometry,
    /// Height above the floor at which basal stresses were taken, m.
    pub level: f64,
    /// At least one, ascending in time.
    pub moments: Vec<Moment>,
    /// What the run wrote while it went on, if it has begun.
    pub history: Option<History>,
}

impl Analysis {
    /// Evaluates all snapshots of a run, with the particles of the start where no snapshot shows them.
    ///
    /// # Errors
    /// Whatever is missing, damaged, or belongs to another scene.
    pub fn of(folder: &RunFolder, level: Level) -> Result<Self, Failure> {
        let no_run = |what: &str| Failure::NoRun { path: folder.path().display().to_string(), what: what.into() };
        if !folder.path().is_dir() {
            return Err(no_run("no such folder"));
        }
        let path = folder.scene();
        let text = match std::fs::read_to_string(&path) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                return Err(no_run("it has no scene.lock.toml"));
            }
            Err(error) => return Err(FileError::reading(&path, &error).into()),
        };
        let scene = Scene::read(&path.display().to_string(), &text)?;
        let hash = Scene::hash(&text);
        let files = files(folder, &hash)?;
        let geometry = Geometry::new(&scene);
        let level = level.height(&geometry);
        let shown = spread(files.len(), PANELS);
        let mut moments = Vec::with_capacity(files.len());
        for (number, file) in files.iter().enumerate() {
            moments.push(moment(&geometry, file, level, shown.contains(&number))?);
        }
        let history = History::read(&folder.history())?;
        Ok(Self { scene, text, hash, geometry, level, moments, history })
    }

    /// The last snapshot.
    pub fn last(&self) -> &Moment {
        // `of` leaves at least one.
        &self.moments[self.moments.len() - 1]
    }

    /// Run-out relative to the start: (front - r0)/r0, where r0 is the body's initial extent and the front is measured
    /// from where it began. NaN where fronts don't say how far the body ran ([`Geometry::runs_outward`]): with several
    /// bodies, with one that can spread both ways, and with one that runs towards -x.
    pub fn scaled(&self, front: f64) -> f64 {
        match self.geometry.extent {
            Some([begin, end]) if self.geometry.runs_outward => (front - end) / (end - begin),
            _ => f64::NAN,
        }
    }
}

fn moment(geometry: &Geometry, file: &Path, level: f64, shown: bool) -> Result<Moment, Failure> {
    let (header, rows) = snapshot::read(file)?;
    let sampler = Sampler::new(geometry, &rows);
    let deposit = Deposit::new(geometry, &rows, &sampler);
    let basal = Basal::new(geometry, &rows, &sampler, &deposit, level);
    Ok(Moment {
        time: header.time,
        step: header.step,
        particles: rows.len(),
        energy: Energy::new(geometry, &rows),
        scatter: shown.then(|| Scatter::new(geometry, &rows)),
        deposit,
        basal,
    })
}

/// The files to evaluate, ascending in time; at least one. All belong to the scene of this hash.
fn files(folder: &RunFolder, hash: &str) -> Result<Vec<PathBuf>, Failure> {
    let mut numbered: Vec<(u64, PathBuf)> = Vec::new();
    let out = folder.out();
    match std::fs::read_dir(&out) {
        Ok(entries) => {
            for entry in entries {
                let entry = entry.map_err(|error| FileError::reading(&out, &error))?;
                if let Some(number) = entry.file_name().to_str().and_then(number) {
                    numbered.push((number, entry.path()));
                }
            }
        }
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
        Err(error) => return Err(FileError::reading(&out, &error).into()),
    }
    numbered.sort();
    let mut files: Vec<PathBuf> = numbered.into_iter().map(|(_, path)| path).collect();
    let begins_late = match files.first() {
        None => true,
        Some(first) => snapshot::read_header(first)?.time > 0.0 && folder.initial().exists(),
    };
    if begins_late {
        files.insert(0, folder.initial());
    }
    let mut before = f64::NEG_INFINITY;
    for path in &files {
        let header = snapshot::read_header(path)?;
        let damaged = |what| FileError::Damaged { path: path.display().to_string(), what };
        if header.scene_hash != hash {
            let what = "it belongs to another scene than scene.lock.toml beside it".into();
            return Err(FileError::WrongKind { path: path.display().to_string(), what }.into());
        }
        if header.count == 0 {
            return Err(damaged("it has no particles".into()).into());
        }
        if header.time <= before {
            let what =
                format!("its time, {} s, does not come after that of the snapshot before, {before} s", header.time);
            return Err(damaged(what).into());
        }
        before = header.time;
    }
    Ok(files)
}

/// The number in `snapshot-000012.hdf`.
fn number(name: &str) -> Option<u64> {
    let digits = name.strip_prefix("snapshot-")?.strip_suffix(".hdf")?;
    (digits.len() >= 6 && digits.bytes().all(|b| b.is_ascii_digit())).then(|| digits.parse().ok())?
}

/// Up to `wanted` of `0..count`, evenly spread, with the first and the last.
pub fn spread(count: usize, wanted: usize) -> Vec<usize> {
    if count <= wanted {
        return (0..count).collect();
    }
    (0..wanted).map(|i| (i * (count - 1) + (wanted - 1) / 2) / (wanted - 1)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_snapshots_are_told_from_others() {
        assert_eq!(number("snapshot-000012.hdf"), Some(12));
        assert_eq!(number("snapshot-1000000.hdf"), Some(1_000_000));
        for name in ["snapshot-12.hdf", "snapshot-000012.hdf.tmp", "snapshot-00001x.hdf", "snapshot.hdf.series"] {
            assert_eq!(number(name), None, "{name}");
        }
    }

    #[test]
    fn what_is_shown_spans_the_run() {
        assert_eq!(spread(3, 6), [0, 1, 2]);
        assert_eq!(spread(21, 6), [0, 4, 8, 12, 16, 20]);
        let s = spread(19, 6);
        assert_eq!((s.len(), s[0], s[5]), (6, 0, 18));
    }
}
