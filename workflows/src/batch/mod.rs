//! `batch`: a run in slices, as jobs of Slurm or as wall time on this machine.

mod local;
mod script;
mod slurm;

use crate::{cases, cases::Case, failure::Failure, paths, stage};
use formats::{
    disk, exit,
    folder::RunFolder,
    scene::{Scene, Sources},
};
use std::path::{Path, PathBuf};

/// How a run is put into jobs.
#[derive(Clone, Debug, clap::Args)]
pub struct Options {
    /// Run folder; runs/NAME where it is left out.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// MPI ranks; needed with Slurm, else the machine's cores (fewer for small scenes).
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    ranks: Option<u32>,
    /// Jobs of Slurm: the default.
    #[arg(long, conflicts_with_all = ["local", "slice", "slices"])]
    slurm: bool,
    /// Slices on this machine, without a scheduler.
    #[arg(long, requires = "slice", conflicts_with_all = slurm::ONLY)]
    local: bool,
    /// Wall time of a local slice, such as 10min.
    #[arg(long, value_name = "TIME", requires = "local")]
    slice: Option<String>,
    /// Stop after so many local slices (exit code 75) even if the run is not done.
    #[arg(long, value_name = "N", requires = "local", value_parser = clap::value_parser!(u32).range(1..))]
    slices: Option<u32>,
    /// Use sph-prep, sph-run and sph-post of this folder instead of building them.
    #[arg(long, value_name = "DIR")]
    programs: Option<PathBuf>,
    /// Options for sph-run, after `--`, such as `-- --checkpoint-every 30min`.
    #[arg(last = true, value_name = "SPH-RUN OPTION")]
    options: Vec<String>,
    #[command(flatten)]
    wishes: slurm::Wishes,
}

/// Starts a case, a scene file or a run folder in slices.
pub fn carry_out(name: &str, options: &Options) -> Result<(), Failure> {
    let (case, folder) = target(name, options.out.as_deref())?;
    let programs = || match &options.programs {
        Some(folder) => stage::Programs::installed(&paths::from_caller(folder)),
        None => stage::Programs::build(),
    };
    if let (true, Some(slice)) = (options.local, &options.slice) {
        let again = again(name, options);
        let job = stage::Job {
            scene: &case.scene,
            folder: &folder,
            ranks: options.ranks,
            fresh: false,
            again: &again,
            log: None,
        };
        let slices = local::Slices { wall: slice, most: options.slices, options: &options.options };
        return local::run(&programs()?, &job, &slices);
    }
    let ranks = options.ranks.ok_or_else(|| {
        Failure::usage("how many ranks? Name them with --ranks N: a job cannot take them from this machine's cores")
    })?;
    let run = queued(&case, &folder)?;
    let script = options.wishes.script(&run, programs()?.folder(), ranks, &case.name, &options.options)?;
    slurm::submit(&RunFolder::new(run), &script, &options.wishes)
}

/// What to run, and where: an existing run folder stands for itself.
fn target(name: &str, out: Option<&Path>) -> Result<(Case, PathBuf), Failure> {
    let there = paths::from_caller(Path::new(name));
    let folder = RunFolder::new(&there);
    let scene = [scene_of_job(&there), folder.scene()].into_iter().find(|path| path.is_file());
    if let (true, Some(scene), None) = (there.is_dir(), scene, out) {
        let name = there.canonicalize().unwrap_or(there.clone());
        let name = name.file_name().unwrap_or_default().to_string_lossy().into_owned();
        return Ok((Case { title: name.clone(), name, scene }, there));
    }
    let case = cases::find(name)?;
    let folder = match out {
        Some(folder) => paths::from_caller(folder),
        None => paths::runs().join(&case.name),
    };
    Ok((case, folder))
}

/// The words that start the same local slices once more.
fn again(name: &str, options: &Options) -> String {
    let mut words = vec!["./talus".to_owned(), "batch".to_owned(), name.to_owned(), "--local".to_owned()];
    let path = |path: &PathBuf| path.display().to_string();
    let valued = [
        ("--slice", options.slice.clone()),
        ("--slices", options.slices.map(|n| n.to_string())),
        ("--ranks", options.ranks.map(|n| n.to_string())),
        ("--out", options.out.as_ref().map(path)),
        ("--programs", options.programs.as_ref().map(path)),
    ];
    for (option, value) in valued {
        words.extend(value.into_iter().flat_map(|value| [option.to_owned(), value]));
    }
    if !options.options.is_empty() {
        words.push("--".to_owned());
        words.extend(options.options.iter().cloned());
    }
    words.iter().map(|word| script::shell_word(word)).collect::<Vec<_>>().join(" ")
}

/// The scene a job prepares its run from: a copy, so that it may be edited while the job waits in the queue.
fn scene_of_job(folder: &Path) -> PathBuf {
    folder.join("scene.toml")
}

/// Leaves a run folder that a job can go on in: `sph-prep` is left to the job, for it may need more memory than a login
/// node has; faults of the scene are found here. Its absolute path.
fn queued(case: &Case, folder: &Path) -> Result<PathBuf, Failure> {
    let text = std::fs::read_to_string(&case.scene)
        .map_err(|e| Failure::no_input(format!("{}: cannot read the scene: {e}", case.scene.display())))?;
    let name = paths::short(&case.scene).display().to_string();
    let scene = Scene::read_with(&name, &text, &Sources::of(&case.scene));
    let scene = scene.map_err(|faults| Failure { code: exit::USAGE, message: faults.to_string() })?;
    let cannot = |e: std::io::Error| Failure::cannot_write(format!("{}: cannot make it: {e}", folder.display()));
    let write = || {
        let written = disk::write_atomic(&scene_of_job(folder), text.as_bytes());
        written.map_err(|e| Failure { code: e.exit_code(), message: e.to_string() })
    };
    let shown = paths::short(folder).display();
    let advice = "choose another folder with --out, or remove this one";
    match std::fs::read_to_string(RunFolder::new(folder).scene()) {
        // The job itself compares: it hands what has changed to sph-run.
        Ok(then) => match Scene::changes_in(&RunFolder::new(folder), &then, &case.scene, &name, &text) {
            Ok(changes) if changes.is_empty() => drop(std::fs::remove_file(scene_of_job(folder))),
            Ok(changes) => {
                changes.iter().for_each(|change| eprintln!("talus: {shown}: the scene has changed: {change}"));
                write()?;
            }
            Err(error) => {
                let what = format!("{shown} cannot go on with the scene as it is now:\n{error}\n{advice}");
                return Err(Failure::cannot_write(what));
            }
        },
        // The job has the text of the scene, not the files beside it.
        Err(_) if !scene.files.is_empty() => {
            let advice = format!("prepare it first: sph-prep {name} -o {shown}; then the same command");
            return Err(Failure::usage(format!(
                "{name} names files, which a job cannot find from its folder; {advice}"
            )));
        }
        // Nothing is prepared yet.
        Err(_) if scene_of_job(folder).is_file() => write()?,
        Err(_) if stage::is_occupied(folder) => {
            return Err(Failure::cannot_write(format!(
                "{shown} is not a run folder (it has no scene.lock.toml); {advice}"
            )));
        }
        Err(_) => {
            std::fs::create_dir_all(folder).map_err(cannot)?;
            write()?;
        }
    }
    std::fs::create_dir_all(RunFolder::new(folder).log()).map_err(cannot)?;
    folder.canonicalize().map_err(cannot)
}
