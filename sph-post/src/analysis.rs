//! Goes through the snapshots of a run, one a thread.

use crate::{
    basal::{Basal, Level},
    deposit::Deposit,
    energy::Energy,
    failure::Failure,
    failure_plane::{FailurePlane, FailureTime},
    field::Field,
    flow::{Flow, StaticSpeed},
    geometry::Geometry,
    health::{Health, Start},
    history::History,
    layers::Layers,
    partition::Partition,
    reference::Reference,
    sample::Sampler,
    scatter::Scatter,
    section::{self, Section},
    shear::{Grains, Shear},
    terrain::{self, Gatherer, Maps},
    workers,
};
use formats::{
    folder::RunFolder,
    outputs::Index,
    scene::Scene,
    snapshot::{self, FileError},
};
use std::path::{Path, PathBuf};

/// Snapshots that are shown as particles coloured by speed: these many, spread over the run.
const PANELS: usize = 6;

/// Times at which the inside of the material is shown, in T = sqrt(H0/g); the end of the run is the last one.
const SHOWN: [f64; 5] = [0.0, 0.5, 1.0, 1.5, 2.0];

/// What to evaluate.
#[derive(Clone, Debug)]
pub struct Choices {
    /// Height at which basal stresses are taken.
    pub basal_height: Level,
    /// Number of layers particles are marked by.
    pub layers: usize,
    /// Speed below which material is static.
    pub static_speed: StaticSpeed,
    /// When the failure plane is taken.
    pub failure_time: FailureTime,
    /// What particles are coloured by, besides their speed.
    pub colours: Vec<&'static Field>,
    /// Diameter of the grains for the inertial number, m, where the law's is not meant or there is none.
    pub grain_diameter: Option<f64>,
    /// Curves that were measured.
    pub reference: Option<Reference>,
}

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
    /// Tops of the horizontal layers in the bins of the profile, m; none where the start is not known.
    pub layer_tops: Option<Vec<Vec<f64>>>,
    /// What stands and what flows.
    pub flow: Flow,
    /// The failure surface.
    pub failure_plane: FailurePlane,
    /// The particles, thinned for a picture, where this snapshot is shown.
    pub scatter: Option<Scatter>,
    /// Speed and stress inside, at the times of [`Analysis::sections`].
    pub section: Option<Section>,
    /// How fast it shears there.
    pub shear: Option<Shear>,
}

/// A run, evaluated.
#[derive(Clone, Debug)]
pub struct Analysis {
    /// The scene.
    pub scene: Scene,
    /// Its text.
    pub text: String,
    /// Its hash ([`Scene::hash`]).
    pub hash: String,
    /// What of it matters here.
    pub geometry: Geometry,
    /// Height above the floor at which basal stresses were taken, m.
    pub level: f64,
    /// At least one, ascending in time.
    pub moments: Vec<Moment>,
    /// The snapshots shown by the speed of the particles: spread over the run.
    pub spread: Vec<usize>,
    /// The snapshots whose inside is shown: near 0, 0.5, 1, 1.5 and 2 T, and the last; without a T as `spread`.
    pub sections: Vec<usize>,
    /// The snapshot nearest to the time at which the failure plane is taken; none where that is unknown.
    pub failure: Option<usize>,
    /// The fields of [`Scatter::fields`].
    pub colours: Vec<&'static Field>,
    /// The grains, where they are known.
    pub grains: Option<Grains>,
    /// Curves that were measured.
    pub reference: Option<Reference>,
    /// Layers of the particles, if the start is known.
    pub layers: Option<Layers>,
    /// Speed below which material counts as static, m/s; NaN where it is unknown.
    pub static_speed: f64,
    /// What the run wrote while it went on, if it has begun.
    pub history: Option<History>,
    /// Maps on the terrain, in three dimensions.
    pub maps: Option<Maps>,
    /// Where the energy went, if the history tells.
    pub partition: Option<Partition>,
    /// How sound it is.
    pub health: Health,
}

impl Analysis {
    /// Evaluates all snapshots of a run in the threads of the pool at hand, with the particles of the start where no snapshot shows them.
    ///
    /// # Errors
    /// Whatever is missing, damaged, or belongs to another scene.
    pub fn of(folder: &RunFolder, choices: Choices) -> Result<Self, Failure> {
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
        let hash = scene.hash_of(&text);
        let index = Index::read(folder)?.unwrap_or_default();
        let files = files(folder, &index, &hash)?;
        let geometry = Geometry::new(&scene);
        let level = choices.basal_height.height(&geometry);
        let static_speed = choices.static_speed.value(&geometry);
        let times: Vec<f64> = files.iter().map(|f| f.0).collect();
        let shown = spread(files.len(), PANELS);
        let sections = geometry.time_scale().map_or_else(|| shown.clone(), |scale| at_times(&times, &SHOWN, scale));
        let failure = Some(choices.failure_time.value(&geometry)).filter(|t| t.is_finite()).map(|t| nearest(&times, t));
        let layers = start(folder, &files)?
            .map(|start| Layers::new(&geometry, &terrain::places_levelled(&scene, start), choices.layers));
        let grains = Grains::of(&geometry, choices.grain_diameter);
        let colours = &choices.colours[..];
        let gatherer = Gatherer::new(&scene);
        let particles = snapshot::read_header(&files[0].1)?.count;
        let evaluated = workers::each(&files, particles, |number, (_, file)| {
            let inside = sections.contains(&number);
            let drawn = inside || shown.contains(&number) || failure == Some(number);
            let first = (number + 1 == files.len()).then_some(&files[0].1);
            let wanted = Wanted { level, static_speed, layers: layers.as_ref(), inside, drawn, grains, colours, first };
            moment(&scene, &geometry, file, &wanted, gatherer.as_ref())
        })?;
        let (mut moments, mut on_ground, mut health) = (Vec::new(), Vec::new(), Health::default());
        for (moment, layer, seen) in evaluated {
            moments.push(moment);
            on_ground.extend(layer);
            health = health.and_then(seen);
        }
        let maps = gatherer.map(|gatherer| gatherer.maps(on_ground));
        let history = History::read(folder, &index)?;
        let partition = history.as_ref().and_then(Partition::of);
        Ok(Self {
            scene,
            text,
            hash,
            geometry,
            level,
            moments,
            spread: shown,
            sections,
            failure,
            colours: choices.colours,
            grains,
            reference: choices.reference,
            layers,
            static_speed,
            history,
            maps,
            partition,
            health,
        })
    }

    /// The last snapshot.
    pub fn last(&self) -> &Moment {
        // `of` leaves at least one.
        &self.moments[self.moments.len() - 1]
    }

    /// Potential energy at the start, measured from the floor: what energies are scaled with. From the history where there is one.
    pub fn start_potential(&self) -> f64 {
        let energy = &self.moments[0].energy;
        let first = self.history.as_ref().and_then(|h| h.column("potential_energy")?.first().copied());
        energy.above_floor(&self.geometry, first.unwrap_or(energy.potential))
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

/// What is wanted of one snapshot.
struct Wanted<'a> {
    level: f64,
    static_speed: f64,
    layers: Option<&'a Layers>,
    /// Keep the section?
    inside: bool,
    /// Keep the particles for pictures?
    drawn: bool,
    grains: Option<Grains>,
    colours: &'a [&'static Field],
    /// The first snapshot, of the last one.
    first: Option<&'a PathBuf>,
}

fn moment(
    scene: &Scene,
    geometry: &Geometry,
    file: &Path,
    wanted: &Wanted,
    gatherer: Option<&Gatherer>,
) -> Result<(Moment, Option<terrain::Layer>, Health), Failure> {
    let (header, rows) = snapshot::read(file)?;
    let on_ground = gatherer.map(|gatherer| gatherer.layer(header.time, &rows));
    let energy = Energy::new(geometry, &rows);
    let rows = terrain::levelled(scene, rows);
    let sampler = Sampler::new(geometry, &rows);
    let deposit = Deposit::new(geometry, &rows, &sampler);
    let basal = Basal::new(geometry, &rows, &sampler, &deposit, wanted.level);
    let health = match wanted.first {
        None => Health::at(scene, geometry, &rows, &sampler),
        Some(first) => {
            let start = Start::of(&terrain::levelled(scene, snapshot::read(first)?.1));
            Health::at_end(scene, geometry, &rows, &sampler, wanted.static_speed, &start)
        }
    };
    let section = Section::new(geometry, &rows, &sampler, &deposit.profile);
    let layers = wanted.layers.filter(|layers| layers.are_of(&rows));
    let plane = section::plane(geometry, &rows);
    let moment = Moment {
        time: header.time,
        step: header.step,
        particles: rows.len(),
        energy,
        layer_tops: layers.map(|layers| layers.tops(geometry, &rows, &deposit.profile)),
        flow: Flow::new(geometry, &rows, &section, wanted.static_speed),
        failure_plane: FailurePlane::new(geometry, &rows, &deposit, &section, plane),
        scatter: wanted.drawn.then(|| Scatter::new(geometry, &rows, layers, deposit.fronts.thickness, wanted.colours)),
        shear: wanted.inside.then(|| Shear::new(geometry, &rows, &sampler, &section, wanted.grains)),
        section: wanted.inside.then_some(section),
        deposit,
        basal,
    };
    Ok((moment, on_ground, health))
}

/// Where the particles were at the start: from the file `sph-prep` made, else from a snapshot of that time.
fn start(folder: &RunFolder, files: &[(f64, PathBuf)]) -> Result<Option<Vec<[f64; 3]>>, Failure> {
    let initial = folder.initial();
    let path = match files.first() {
        _ if initial.exists() => &initial,
        Some((time, path)) if *time <= 0.0 => path,
        _ => return Ok(None),
    };
    Ok(Some(snapshot::read(path)?.1.position))
}

/// Times and files to evaluate, ascending in time; at least one. All belong to the scene of this hash. Snapshots that
/// were moved away are left out.
fn files(folder: &RunFolder, index: &Index, hash: &str) -> Result<Vec<(f64, PathBuf)>, Failure> {
    let snapshots = index.snapshots().map(|(number, _)| folder.snapshot(number));
    let mut files: Vec<PathBuf> = snapshots.filter(|path| path.exists()).collect();
    let begins_late = match files.first() {
        None => true,
        Some(first) => snapshot::read_header(first)?.time > 0.0 && folder.initial().exists(),
    };
    if begins_late {
        files.insert(0, folder.initial());
    }
    let mut before = f64::NEG_INFINITY;
    let mut timed = Vec::with_capacity(files.len());
    for path in files {
        let header = snapshot::read_header(&path)?;
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
        timed.push((header.time, path));
    }
    Ok(timed)
}

/// Up to `wanted` of `0..count`, evenly spread, with the first and the last.
pub fn spread(count: usize, wanted: usize) -> Vec<usize> {
    if count <= wanted {
        return (0..count).collect();
    }
    (0..wanted).map(|i| (i * (count - 1) + (wanted - 1) / 2) / (wanted - 1)).collect()
}

/// The place of the time nearest to `wanted` among at least one that ascend.
pub fn nearest(times: &[f64], wanted: f64) -> usize {
    let after = times.partition_point(|t| *t < wanted).min(times.len() - 1);
    let before = after.saturating_sub(1);
    if wanted - times[before] < times[after] - wanted { before } else { after }
}

/// The places of the times nearest to `wanted`, in units of `scale`, and the last one; each once. A wanted time that no
/// time is within half a unit of has none.
pub fn at_times(times: &[f64], wanted: &[f64], scale: f64) -> Vec<usize> {
    let near = |w: &f64| {
        let place = nearest(times, w * scale);
        ((times[place] - w * scale).abs() <= 0.5 * scale).then_some(place)
    };
    let mut places: Vec<usize> = wanted.iter().filter_map(near).chain([times.len() - 1]).collect();
    places.sort_unstable();
    places.dedup();
    places
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_times_are_found_once() {
        let times = [0.0, 0.1, 0.2, 0.3, 0.9, 2.0];
        assert_eq!([-1.0, 0.04, 0.06, 0.5, 0.7, 9.0].map(|t| nearest(&times, t)), [0, 0, 1, 3, 4, 5]);
        assert_eq!(at_times(&times, &[0.0, 0.5, 1.0, 1.5, 2.0], 0.2), [0, 1, 2, 3, 5]);
        assert_eq!(at_times(&times, &[0.0, 1.9, 3.0], 0.2), [0, 3, 5]);
        assert_eq!(at_times(&[0.3], &[0.0, 0.5], 0.1), [0]);
    }

    #[test]
    fn what_is_shown_spans_the_run() {
        assert_eq!(spread(3, 6), [0, 1, 2]);
        assert_eq!(spread(21, 6), [0, 4, 8, 12, 16, 20]);
        let s = spread(19, 6);
        assert_eq!((s.len(), s[0], s[5]), (6, 0, 18));
    }
}
