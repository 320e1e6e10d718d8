//! `sph-run`: time stepping on MPI.

use clap::Parser;
use formats::exit;
use formats::folder::RunFolder;
use formats::h5::Communicator;
use formats::scene::Scene;
use mpi::traits::Communicator as _;
use sph_run::cli::Cli;
use sph_run::dispatch;
use sph_run::error::RunError;
use sph_run::limits::Limits;
use sph_run::parallel::agree::{agree, share_text};
use sph_run::resume::Start;
use sph_run::run::{Outcome, Run};

fn main() {
    let signalled = Limits::watch_signals();
    let Some(universe) = mpi::initialize() else {
        eprintln!("sph-run: MPI can't be initialised");
        std::process::exit(exit::USAGE);
    };
    let comm = universe.world();
    abort_all_ranks_on_panic();
    let code = match Cli::try_parse() {
        Ok(cli) => launch(&comm, &cli, signalled),
        Err(error) => {
            if comm.rank() == 0 {
                let _ = error.print();
            }
            error.exit_code()
        }
    };
    drop(universe);
    std::process::exit(code);
}

/// A rank that panics while others wait for it would hang the job.
fn abort_all_ranks_on_panic() {
    let report = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        report(info);
        mpi::topology::SimpleCommunicator::world().abort(exit::NUMERICAL);
    }));
}

fn launch(comm: &Communicator, cli: &Cli, signalled: std::sync::Arc<std::sync::atomic::AtomicBool>) -> i32 {
    let folder = RunFolder::new(&cli.run);
    let limits = Limits::new(signalled, &folder);
    match run(comm, cli, &folder, limits) {
        Ok(outcome) => {
            if comm.rank() == 0 {
                println!("{}", folder.path().display());
            }
            match outcome {
                Outcome::Done => exit::DONE,
                Outcome::Stopped => exit::RESUMABLE,
            }
        }
        Err(error) => {
            if comm.rank() == 0 {
                eprintln!("sph-run: error: {error}");
            }
            error.exit_code()
        }
    }
}

fn run(comm: &Communicator, cli: &Cli, folder: &RunFolder, limits: Limits) -> Result<Outcome, RunError> {
    let text = share_text(comm, || read_scene(folder))?;
    let scene = Scene::read(&folder.scene().display().to_string(), &text)?;
    let lock = agree(comm, || lock(folder))?;
    let done = share_text(comm, || Ok(String::from(if folder.done().exists() { "done" } else { "" })))?;
    if done == "done" && !cli.new {
        if comm.rank() == 0 && !cli.quiet {
            eprintln!("sph-run: nothing to do, the run is done");
        }
        return Ok(Outcome::Done);
    }
    let start = share_text(comm, || {
        if cli.new && (folder.done().exists() || folder.checkpoints().exists() || folder.history().exists()) {
            return Err(RunError::HasBegun { path: folder.path().into() });
        }
        Ok(Start::find(folder, cli.quiet)?.to_json().to_string())
    })?;
    let start = serde_json::from_str(&start).ok().and_then(|v| Start::from_json(&v));
    let Some(start) = start else {
        return Err(RunError::Input { path: folder.checkpoints(), message: "its manifest can't be understood".into() });
    };
    let scene_hash = Scene::hash(&text);
    let outcome = dispatch::resolve(&scene, Run { comm, cli, folder, scene: &scene, scene_hash, start, limits });
    drop(lock);
    outcome
}

fn read_scene(folder: &RunFolder) -> Result<String, RunError> {
    let path = folder.scene();
    std::fs::read_to_string(&path).map_err(|e| RunError::Input {
        path,
        message: format!("{e}\nhelp: make a run folder with: sph-prep scene.toml -o {}", folder.path().display()),
    })
}

fn lock(folder: &RunFolder) -> Result<formats::lock::RunLock, RunError> {
    Ok(formats::lock::RunLock::acquire(&folder.lock())?)
}
