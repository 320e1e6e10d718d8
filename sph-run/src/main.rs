//! `sph-run`: time stepping on MPI.

use formats::about::{self, Asked};
use formats::folder::RunFolder;
use formats::h5::Communicator;
use formats::news::{self, Level, tell};
use formats::scene::{Scene, Sources};
use formats::{exit, lock};
use mpi::traits::Communicator as _;
use sph_run::cli::{self, Cli, Wanted};
use sph_run::deadline::Deadline;
use sph_run::error::RunError;
use sph_run::huge_pages::HugePages;
use sph_run::lanes::Instructions;
use sph_run::limits::Limits;
use sph_run::parallel::agree::{agree, share_bytes, share_text};
use sph_run::resume::{Past, Start, read_scene};
use sph_run::run::{Outcome, Run};
use sph_run::{check, dispatch, parallel, plan, scheduler};
use std::io::Write as _;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc;
use std::time::{Duration, Instant};

#[global_allocator]
static ALLOCATOR: HugePages = HugePages;

fn main() {
    let begun = Instant::now();
    let signalled = Limits::watch_signals();
    let cli = match about::parse::<Cli>(std::env::args_os()) {
        Ok(Asked::Work(cli)) => Ok(cli),
        Ok(Asked::Text(text)) => {
            // Whoever closed the pipe has read enough.
            let _ = std::io::stdout().write_all(&text);
            std::process::exit(exit::DONE);
        }
        Err(error) => Err(error),
    };
    if let Ok(Cli { check: true, run, .. }) = &cli {
        once(|| check::report(&RunFolder::new(run)));
    }
    if let Ok(Cli { run, plan: options @ plan::Options { plan: true, .. }, .. }) = &cli {
        once(|| plan::report(run, options));
    }
    let patience = cli.as_ref().map_or(cli::MPI_PATIENCE, |cli| cli.mpi_patience);
    let starting = end_unless_started_within(patience);
    let Some(universe) = mpi::initialize() else {
        news::fail("MPI can't be initialised", exit::USAGE);
        std::process::exit(exit::USAGE);
    };
    drop(starting);
    let comm = universe.world();
    abort_all_ranks_on_panic();
    let code = match cli {
        Ok(Cli { plan: plan::Options { migration: Some(particles), .. }, .. }) => {
            plan::migration::report(&comm, particles)
        }
        Ok(cli) => launch(&comm, &cli, signalled, begun),
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

/// Does what needs no MPI, and ends. Of the processes that mpirun started only the first does it.
fn once(work: impl FnOnce() -> i32) -> ! {
    let rank = ["OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK"].iter().find_map(|name| std::env::var(name).ok());
    std::process::exit(if rank.is_none_or(|rank| rank == "0") { work() } else { exit::DONE })
}

/// Ends this process where MPI does not come up until what is returned is dropped: a rank that is killed or stopped as it
/// starts may leave the others waiting for ever, and with them the whole job. Nothing has been done by then.
fn end_unless_started_within(patience: Duration) -> mpsc::Sender<()> {
    let (starting, wait) = mpsc::channel();
    std::thread::spawn(move || {
        if wait.recv_timeout(patience) == Err(mpsc::RecvTimeoutError::Timeout) {
            let seconds = patience.as_secs();
            let message =
                format!("MPI has not started within {seconds} s: a rank is missing; the same command tries again");
            news::fail(&message, exit::RESUMABLE);
            signal_hook::low_level::exit(exit::RESUMABLE);
        }
    });
    starting
}

/// A rank that panics while others wait for it would hang the job.
fn abort_all_ranks_on_panic() {
    let report = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        report(info);
        mpi::topology::SimpleCommunicator::world().abort(exit::NUMERICAL);
    }));
}

fn launch(comm: &Communicator, cli: &Cli, signalled: Arc<AtomicBool>, begun: Instant) -> i32 {
    let folder = RunFolder::new(&cli.run);
    let limits = Limits::new(signalled, &folder);
    match run(comm, cli, &folder, limits, begun) {
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
                news::fail(&error.to_string(), error.exit_code());
            }
            error.exit_code()
        }
    }
}

/// What this rank computes pairs with, where all ranks have what is asked for. Collective.
fn instructions(comm: &Communicator, wanted: Wanted) -> Result<Instructions, RunError> {
    let here = wanted.here().map_err(RunError::NoSuchInstructions);
    let mut lacking = [u64::from(here.is_err())];
    parallel::Reduce::sum(comm, &mut lacking);
    match lacking {
        [0] => here,
        [ranks] => Err(here.err().unwrap_or_else(|| {
            let message =
                format!("--instructions: the processors of {ranks} ranks lack them; auto takes what there is");
            RunError::NoSuchInstructions(message)
        })),
    }
}

/// The scene, and the files that it names, which rank 0 alone reads. Collective.
fn share_scene(comm: &Communicator, folder: &RunFolder, text: &str) -> Result<Scene, RunError> {
    let (path, root) = (folder.scene(), comm.rank() == 0);
    let mut sources = Sources::of(&path);
    if root {
        // Its faults are those of all ranks.
        let _ = Scene::read_with(&path.display().to_string(), text, &sources);
    }
    let bytes = share_bytes(comm, || Ok(sources.to_bytes()))?;
    if !root {
        sources = Sources::from_bytes(&bytes);
    }
    Ok(Scene::read_with(&path.display().to_string(), text, &sources)?)
}

fn run(
    comm: &Communicator,
    cli: &Cli,
    folder: &RunFolder,
    limits: Limits,
    begun: Instant,
) -> Result<Outcome, RunError> {
    let instructions = instructions(comm, cli.instructions)?;
    // Before the lock, whose folder need not be there.
    agree(comm, || read_scene(&folder.scene()))?;
    let lock = agree(comm, || {
        let job = scheduler::job_id(|name| std::env::var(name).ok());
        let terms = lock::Terms { patience: cli.lock_patience, job };
        Ok(lock::RunLock::acquire_on(&folder.lock(), &terms, |news| tell(Level::Note, news))?)
    })?;
    let deadline = agree(comm, || Ok(Deadline::find(cli.wall_limit, begun, cli.quiet)))?.unwrap_or_default();
    let mut past = Past::default();
    let start = share_text(comm, || {
        Ok(match Start::find(folder, cli, comm.size() as u64)? {
            Some((start, then)) => {
                past = then;
                start.to_json().to_string()
            }
            None => String::new(),
        })
    })?;
    if start.is_empty() {
        return Ok(Outcome::Done);
    }
    let start = serde_json::from_str(&start).ok().and_then(|value| Start::from_json(&value));
    let Some(start) = start else {
        return Err(RunError::Input { path: folder.checkpoints(), message: "its manifest can't be understood".into() });
    };
    let scene = share_scene(comm, folder, &start.scene)?;
    let scene_hash = scene.hash_of(&start.scene);
    let lock = lock.as_ref();
    let run = Run { comm, cli, folder, scene: &scene, scene_hash, start, past, limits, instructions, deadline, lock };
    let outcome = dispatch::resolve(&scene, run);
    if outcome.is_err() {
        // Whatever failed: to have lost the folder to another launch explains it, and has an exit code of its own.
        agree(comm, || match lock.map_or(Ok(()), lock::RunLock::still_ours) {
            Err(lost @ lock::LockError::Lost { .. }) => Err(lost.into()),
            _ => Ok(()),
        })?;
    }
    outcome
}
