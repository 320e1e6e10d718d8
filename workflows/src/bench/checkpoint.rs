//! What a checkpoint costs, and a restart.

use super::{Spread, folder, processor, write};
use crate::validate::record::Sources;
use crate::{failure::Failure, launch, paths, stage};
use formats::folder::RunFolder;
use formats::{checkpoint, provenance};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;
use xshell::cmd;

/// Checkpoints written, and files of the same size by `dd`.
const TIMES: usize = 7;

/// Writes a number of checkpoints of a block of particles on each number of ranks, and as many files of the same size with
/// `dd`; restarts. Returns the page.
pub fn measure(particles: u64, ranks: &[u32]) -> Result<PathBuf, Failure> {
    let programs = stage::Programs::build()?;
    let sources = Sources::now()?;
    let place = paths::runs().join("bench").join("checkpoint");
    std::fs::create_dir_all(&place).map_err(|e| Failure::cannot_write(format!("{}: {e}", place.display())))?;
    let mut rows = String::new();
    let mut size = 0.0;
    for &ranks in ranks {
        let run = measured(&programs, &place, particles, ranks)?;
        size = run.megabytes;
        let rate = |seconds: &Spread| run.megabytes / seconds.median;
        let _ = writeln!(
            rows,
            "| {ranks} | {} | {} | {:.0} | {:.0} | {:.2} | {} | {:.2} | {:.0} | {:.2} % |",
            run.particles,
            run.checkpoint.text(2),
            rate(&run.checkpoint),
            rate(&run.dd),
            run.checkpoint.median / run.dd.median,
            run.step.text(2),
            run.restart,
            run.interval,
            100.0 * run.checkpoint.median / (run.checkpoint.median + run.interval),
        );
    }
    let day = &provenance::now()[..10];
    let changed = if sources.changed { ", with changes that are not committed" } else { "" };
    let text = format!(
        "# What a checkpoint costs\n\n\
         By `./talus bench checkpoint --particles {particles}`, {day}, commit {}{changed}, {}, {} cores. A block of particles in three \
         dimensions; a generation of {size:.0} MB is written, put on the disk (fsync), read back by other ranks and compared with memory, \
         and its bytes are hashed: all of that counts. `dd` writes as many bytes to the same disk, with fsync and nothing else. Medians \
         of {TIMES}, least and largest in brackets.\n\n\
         | ranks | particles | a checkpoint, s | MB/s | dd, MB/s | checkpoint : dd | a step, s | restart, s | interval, s | share |\n\
         |---|---|---|---|---|---|---|---|---|---|\n{rows}\n\
         *Restart*: from the start of the program to the first step, without writing: finding and verifying the newest generation, \
         reading, sharing out, building lists. *Interval*: what `--checkpoint-every auto` makes of that cost for a mean time \
         between failures of 24 h; *share*: of the wall time that then goes into checkpoints.\n",
        sources.commit,
        processor(),
        launch::cores(),
    );
    write(&folder().join("checkpoint.md"), &text)
}

struct Measured {
    particles: u64,
    megabytes: f64,
    checkpoint: Spread,
    dd: Spread,
    step: Spread,
    restart: f64,
    interval: f64,
}

fn measured(programs: &stage::Programs, place: &Path, particles: u64, ranks: u32) -> Result<Measured, Failure> {
    let shell = launch::shell()?;
    let folder = RunFolder::new(place.join(format!("ranks-{ranks}")));
    let _ = std::fs::remove_dir_all(folder.path());
    let scene = place.join("scene.toml");
    std::fs::write(&scene, block(particles)).map_err(|e| Failure::cannot_write(format!("{}: {e}", scene.display())))?;
    let job = stage::Job {
        scene: &scene,
        folder: folder.path(),
        ranks: Some(ranks),
        fresh: false,
        again: "./talus bench checkpoint",
        log: None,
    };
    stage::prepare(programs, &job)?;
    let sph_run = |options: &str| -> Result<f64, Failure> {
        let options: Vec<&str> = options.split(' ').collect();
        let begun = Instant::now();
        let command = launch::parallel(&shell, &programs.path("sph-run"), ranks).arg(folder.path()).args(options);
        let end = launch::wait(command, launch::Stop::AtOnce)?;
        match stage::code(end.status) {
            formats::exit::RESUMABLE => Ok(begun.elapsed().as_secs_f64()),
            code => Err(Failure { code, message: "sph-run failed, see above".into() }),
        }
    };
    let manifests = || -> Result<Vec<checkpoint::Manifest>, Failure> {
        let failure = |e: formats::snapshot::FileError| Failure { code: e.exit_code(), message: e.to_string() };
        let numbers = checkpoint::generations(&folder).map_err(failure)?;
        numbers.into_iter().map(|number| checkpoint::verify(&folder, number).map_err(failure)).collect()
    };
    let n = TIMES;
    sph_run(&format!("--quiet --checkpoint-every 1steps --checkpoint-keep {n} --stop-after-steps {n}"))?;
    let written = manifests()?;
    let seconds: Vec<f64> = written.iter().map(|manifest| manifest.write_seconds).collect();
    let bytes = written.iter().map(|manifest| manifest.state_bytes).max().unwrap_or(0);
    let mut dd = Vec::new();
    let (file, blocks) = (place.join("dd"), bytes.div_ceil(4 << 20).to_string());
    for _ in 0..TIMES {
        let begun = Instant::now();
        cmd!(shell, "dd if=/dev/zero of={file} bs=4M count={blocks} conv=fsync").quiet().ignore_stderr().run()?;
        dd.push(begun.elapsed().as_secs_f64() * bytes as f64 / (bytes.div_ceil(4 << 20) * (4 << 20)) as f64);
    }
    let _ = std::fs::remove_file(&file);
    // A launch that takes no step resumes, and writes a checkpoint whose own time is known.
    let whole = sph_run("--quiet --stop-after-steps 0")?;
    let last = manifests()?.last().map_or(0.0, |manifest| manifest.write_seconds);
    let steps: Vec<f64> = (0..3).map(|_| sph_run("--quiet --stop-after-steps 10")).collect::<Result<_, _>>()?;
    let step: Vec<f64> = steps.iter().map(|seconds| (seconds - whole) / 10.0).collect();
    let count = formats::snapshot::read_header(&folder.initial()).map_or(0, |header| header.count);
    let _ = std::fs::remove_dir_all(folder.path());
    let seconds = Spread::of(&seconds);
    Ok(Measured {
        particles: count,
        megabytes: bytes as f64 / 1e6,
        checkpoint: seconds,
        dd: Spread::of(&dd),
        step: Spread::of(&step),
        restart: whole - last,
        interval: checkpoint::interval(seconds.median, 24.0 * 3600.0),
    })
}

/// A cube of about so many particles that rests on a floor.
fn block(particles: u64) -> String {
    let side = (particles as f64).cbrt().round().max(4.0);
    format!(
        r#"title = "A block for measuring checkpoints"
space = "3d"
spacing = "10 mm"
[material.drucker-prager]
density = "2600 kg/m3"
young = "5.98 MPa"
poisson = 0.3
friction = "30 deg"
cohesion = "0 Pa"
[body.block]
box = {{ min = [0, 0, 0], max = [{0}, {0}, {0}] }}
[wall.floor]
axis = "z"
at = "0 m"
side = "above"
slip = "no-slip"
[end]
time = "1 s"
[output]
snapshots = "1 s"
history = "1 s"
"#,
        side * 0.01
    )
}
