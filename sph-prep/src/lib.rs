//! `sph-prep`: from a scene to the particles a run starts with, on any number of ranks.
//!
//! Rank 0 reads the scene and speaks; every rank checks it, makes its share of the particles, and writes it into the
//! one file of all ranks. What the run costs is told, and refused, before anything is allocated. Failures are agreed upon after each part, so that all ranks leave together.

pub mod advice;
pub mod chosen;
pub mod cli;
pub mod explain;
pub mod failure;
pub mod fill;
pub mod initial;
pub mod lattice;
pub mod memory;
pub mod output;
pub mod packing;
pub mod relax;
pub mod shape;
pub mod summary;
#[cfg(test)]
mod testing;
pub mod text;
pub mod wall;

use clap::Parser as _;
use cli::Arguments;
use failure::{Failure, agree};
use fill::Plan;
use formats::{
    about::{self, Asked},
    exit,
    news::{self, Level},
    provenance::{self, Entry},
    scene::{Fault, Scene, SceneError, Sources},
    schema::Kept,
    snapshot::{self, Header, Rows},
};
use memory::Load;
use mpi::{collective::SystemOperation, topology::SimpleCommunicator, traits::*};
use output::Staging;
use std::{ffi::OsString, io::Write, os::unix::ffi::OsStringExt, path::PathBuf};

/// Exit code of a panic, as in `sph-run`.
const PANIC: i32 = exit::NUMERICAL;

/// Runs the whole stage and returns the exit code, the same on all ranks. MPI is set up and wound up within.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> i32 {
    let Some(universe) = mpi::initialize() else {
        news::fail("MPI is running already; it can be started only once", exit::USAGE);
        return exit::USAGE;
    };
    // One rank that unwinds would leave the others waiting for ever.
    let print = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        print(panic);
        SimpleCommunicator::world().abort(PANIC);
    }));
    let world = universe.world();
    let talks = world.rank() == 0;
    let words: Vec<OsString> = arguments.into_iter().collect();
    if words.get(1).is_some_and(|word| word == "explain") {
        return if talks { explain(words.into_iter().skip(1)) } else { exit::DONE };
    }
    let arguments = match about::parse::<Arguments>(words) {
        Ok(Asked::Work(arguments)) => arguments,
        Ok(Asked::Text(text)) => {
            if talks {
                // Whoever closed the pipe has read enough.
                let _ = std::io::stdout().write_all(&text);
            }
            return exit::DONE;
        }
        Err(message) => {
            if talks {
                // Help goes to standard output, errors to standard error; a closed pipe is nobody's concern.
                let _ = message.print();
            }
            return if message.use_stderr() { exit::USAGE } else { exit::DONE };
        }
    };
    let mut text = String::new();
    match prepare(&arguments, &world, &mut text) {
        Ok(()) => {
            if talks {
                // A closed pipe does not undo the run folder.
                let _ = writeln!(std::io::stdout(), "{}", arguments.output.display());
            }
            exit::DONE
        }
        Err(failure) => {
            if talks {
                text::print(&failure, &text);
            }
            failure.exit_code()
        }
    }
}

/// Explains a scene on standard output; rank 0 alone. Returns the exit code.
fn explain(words: impl IntoIterator<Item = OsString>) -> i32 {
    let arguments = match explain::Arguments::try_parse_from(words) {
        Ok(arguments) => arguments,
        Err(message) => {
            let _ = message.print();
            return if message.use_stderr() { exit::USAGE } else { exit::DONE };
        }
    };
    let mut text = String::new();
    let scene = text::read(&arguments.scene).and_then(|found| {
        text = found;
        Ok(Scene::read(&arguments.scene.display().to_string(), &text)?)
    });
    match scene {
        Ok(scene) => {
            // Whoever closed the pipe has read enough.
            let smaller = Scene::smaller("", &text, &Sources::of(&arguments.scene));
            let advice = chosen::advice(&scene, smaller.as_ref());
            let _ = write!(std::io::stdout(), "{}", explain::text(&scene, advice.as_deref()));
            exit::DONE
        }
        Err(failure) => {
            text::print(&failure, &text);
            failure.exit_code()
        }
    }
}

/// Makes the run folder. `text` receives the scene's text, for messages. Collective.
///
/// # Errors
/// Any [`Failure`]; all ranks return one with the same exit code, and nothing is left behind.
fn prepare(arguments: &Arguments, comm: &SimpleCommunicator, text: &mut String) -> Result<(), Failure> {
    let talks = comm.rank() == 0;
    let says = |message: String| {
        if talks && !arguments.quiet {
            news::show(Level::Note, &message);
        }
    };
    *text = text::share(&arguments.scene, comm)?;
    let name = arguments.scene.display().to_string();
    // Files that the scene names are read by rank 0 alone, as it asks for them.
    let mut sources = Sources::of(&arguments.scene);
    let mut read = talks.then(|| Scene::read_with(&name, text, &sources));
    let bytes = text::broadcast(if talks { sources.to_bytes() } else { Vec::new() }, comm);
    if !talks {
        sources = Sources::from_bytes(&bytes);
        read = Some(Scene::read_with(&name, text, &sources));
    }
    let Some(scene) = read.transpose()? else { return Err(Failure::Elsewhere(PANIC)) };

    let staging = if talks { Staging::new(&arguments.output).map(Some) } else { Ok(None) };
    let staging = agree(comm, staging)?;

    let ranks = comm.size() as u64;
    let lattices = fill::lattices(&scene);
    let estimate = Load::of(&scene, &lattices);
    // Looked for only where somebody reads of it.
    let smaller = if talks && !arguments.quiet { Scene::smaller(&name, text, &sources) } else { None };
    let choices = || chosen::block(&scene) + &chosen::advice(&scene, smaller.as_ref()).unwrap_or_default();
    if let Err(failure) = memory::check(&scene, estimate, memory::room(comm), ranks) {
        // Even counting would take too long.
        says(summary::head(&scene, &summary::estimated(&scene, &lattices)));
        says(summary::cost(&scene, estimate, ranks));
        says(choices());
        return Err(failure);
    }

    let plan = Plan::new(&scene, comm);
    let bodies = bodies(&scene, &plan, comm);
    if let Some(empty) = bodies.iter().find(|b| b.particles == 0) {
        return Err(no_particles(arguments, text, empty).into());
    }
    says(summary::head(&scene, &bodies));
    says(summary::cost(&scene, Load { particles: plan.total(), ..estimate }, ranks));
    says(choices());
    if talks {
        let warnings = advice::warnings(&scene, &plan.lattices, &bodies);
        warnings.split_inclusive('\n').for_each(|warning| news::show(Level::Warning, warning));
    }
    let rows = plan.particles(&scene, snapshot::share(plan.total(), comm.rank() as u64, ranks));
    write(&scene, text, &sources, &rows, plan.total(), staging, comm)
}

fn bodies(scene: &Scene, plan: &Plan, comm: &SimpleCommunicator) -> Vec<summary::Body> {
    let count = scene.bodies.len();
    let mine: Vec<f64> = (0..count).map(|body| plan.volume(body, comm.rank() as u64)).collect();
    let mut volumes = vec![0.0; count];
    comm.all_reduce_into(&mine[..], &mut volumes[..], SystemOperation::sum());
    let particles: Vec<u64> = (0..count).map(|body| plan.body(body)).map(|ids| ids.end - ids.start).collect();
    let mut bodies = summary::bodies(scene, &plan.lattices, &particles, &volumes);
    bodies.iter_mut().enumerate().for_each(|(n, body)| body.left_out = plan.left_out(n));
    bodies
}

/// A body that falls through the lattice.
fn no_particles(arguments: &Arguments, text: &str, body: &summary::Body) -> SceneError {
    let (body, left_out) = (&body.name, body.left_out);
    let title = format!("[body.{body}]");
    let line = text.lines().position(|line| line.trim_start().starts_with(&title)).map_or(1, |at| at + 1);
    let mut message =
        "holds no particle; it must be larger than the spacing, on the positive side of planes of symmetry".to_string();
    if left_out > 0 {
        message = format!("lies in obstacles with all of its {left_out} particles; move it, or the obstacles");
    }
    let fault = Fault { line, column: 1, key: format!("body.{body}"), message };
    SceneError { file: arguments.scene.display().to_string(), faults: vec![fault] }
}

/// Writes everything, rank 0 the small files and all ranks the particles, and gives the folder its name.
fn write(
    scene: &Scene,
    text: &str,
    sources: &Sources,
    rows: &Rows,
    count: u64,
    staging: Option<Staging>,
    comm: &SimpleCommunicator,
) -> Result<(), Failure> {
    let path = staging.as_ref().map_or(Vec::new(), |s| s.folder().initial().into_os_string().into_vec());
    let path = PathBuf::from(OsString::from_vec(text::broadcast(path, comm)));
    let header = Header {
        title: scene.title.clone(),
        scene_hash: scene.hash_of(text),
        space: scene.space,
        kernel: scene.kernel,
        spacing: scene.spacing,
        h: scene.h(),
        gravity: scene.gravity,
        time: 0.0,
        step: 0,
        count,
    };
    let written = snapshot::write(&path, &header, rows, Kept::Everywhere, comm).map_err(Failure::from);
    agree(comm, written)?;
    let finished = staging.map_or(Ok(()), |staging| {
        let folder = staging.folder().clone();
        staging.write(&folder.scene(), text.as_bytes())?;
        sources.write(folder.path()).map_err(|error| Failure::output(folder.path(), &error))?;
        let entry = Entry { chosen: chosen::sentences(scene), ..Entry::this("sph-prep", comm.size() as usize) };
        provenance::append(&folder.provenance(), entry)?;
        staging.publish()
    });
    agree(comm, finished)
}
