//! The same job script run k times completes the run, and run once more it does nothing and ends with 0.
//!
//! - Under `sh` alone, stopped by USR1 and TERM to the script itself, in a folder whose name needs quotes.
//! - As jobs: what is handed to `sbatch`, `scontrol` and `scancel`, which are played by scripts here; the binary `slurm`
//!   has the real ones.
//! - As slices of wall time on this machine.

use formats::{exit, folder::RunFolder};
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;
use tests::trial::{appears, outputs, short, signal, state};
use tests::{Output, TIME_LIMIT, WorkFolder, computed, program, run_within, workflows};

/// Long enough to be met running.
fn scene() -> String {
    let longer = [("\"150 ms\"", "\"5 s\""), ("\"40 ms\"", "\"2 s\""), ("\"7 ms\"", "\"0.1 s\"")];
    longer.iter().fold(short::RINGS.to_owned(), |text, (old, new)| text.replace(old, new))
}

/// The folder of the programs built for the tests.
fn programs() -> PathBuf {
    program("sph-run").parent().unwrap().to_path_buf()
}

/// `./talus batch`, with these words.
fn batch(words: &[&str], programs: &Path) -> Command {
    let mut command = with_mpi(workflows());
    command.arg("batch").args(words).arg("--programs").arg(programs);
    command
}

/// The job script of a folder, started by `sh` with all that Open MPI needs here.
fn job(folder: &RunFolder) -> Command {
    let mut command = with_mpi("sh");
    command.arg(folder.path().join("job.sh"));
    command
}

fn with_mpi(program: impl AsRef<std::ffi::OsStr>) -> Command {
    let mut command = Command::new(program);
    for name in ["OMPI_ALLOW_RUN_AS_ROOT", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "OMPI_MCA_rmaps_base_oversubscribe"] {
        command.env(name, "1");
    }
    command.env("OMPI_MCA_hwloc_base_binding_policy", "none");
    for name in ["SLURM_JOB_ID", "SLURM_NTASKS", "TALUS_MPIRUN"] {
        command.env_remove(name);
    }
    command
}

/// A program that is a shell script.
fn play(folder: &Path, name: &str, script: &str) {
    fs::create_dir_all(folder).unwrap();
    let path = folder.join(name);
    fs::write(&path, format!("#!/bin/sh\n{script}\n")).unwrap();
    fs::set_permissions(path, fs::Permissions::from_mode(0o755)).unwrap();
}

/// Starts the job script and sends it a signal once the run has gone on for some steps.
fn interrupted(folder: &RunFolder, name: &str) -> Output {
    let before = fs::read_to_string(folder.history()).unwrap_or_default().lines().count();
    let further = || {
        let lines = fs::read_to_string(folder.history()).unwrap_or_default().lines().count();
        folder.lock().exists() && lines > before + 1
    };
    let log = fs::File::create(folder.path().with_extension(name)).unwrap();
    let mut child = job(folder).stdin(Stdio::null()).stdout(Stdio::null()).stderr(log).spawn().unwrap();
    let met = appears(Duration::from_secs(60), further);
    signal(name, child.id());
    let code = child.wait().unwrap().code().unwrap_or(-1);
    let stderr = fs::read_to_string(folder.path().with_extension(name)).unwrap();
    assert!(met, "it does not get on: {stderr}");
    Output { code, stdout: String::new(), stderr, timed_out: false }
}

#[test]
fn the_same_script_until_it_is_done_and_once_more() {
    let work = WorkFolder::new();
    let reference = computed(&work, "reference", &scene(), 1);
    let folder = RunFolder::new(work.join("a \"run's\" $folder"));
    let file = work.join("reference.toml");
    let out = folder.path().to_str().unwrap();
    let mut write = batch(&[file.to_str().unwrap(), "--out", out, "--ranks", "2", "--dry-run"], &programs());
    let written = run_within(TIME_LIMIT, &mut write).expect(exit::DONE);
    let script = fs::read_to_string(folder.path().join("job.sh")).unwrap();
    assert_eq!(script, written.stdout);
    assert!(!folder.scene().exists(), "it is the job that prepares");

    for (slice, name) in ["USR1", "TERM"].into_iter().enumerate() {
        let stopped = interrupted(&folder, name).expect(exit::RESUMABLE);
        let reason = fs::read_to_string(folder.to_continue()).unwrap();
        assert!(reason.contains("\"signal\"") && !folder.done().exists(), "slice {slice}: {reason}{stopped}");
        assert!(stopped.stderr.contains(&format!("told to stop ({name})")), "{stopped}");
    }
    let finished = run_within(TIME_LIMIT, &mut job(&folder)).expect(exit::DONE);
    assert!(folder.done().exists() && folder.post().join("summary.json").is_file(), "{finished}");
    assert_eq!(outputs(&reference), outputs(&folder));

    let before = state(folder.path());
    let again = run_within(TIME_LIMIT, &mut job(&folder)).expect(exit::DONE);
    assert_eq!(before, state(folder.path()), "{again}");
    assert_eq!(again.stderr.lines().count(), 1, "{again}");
}

/// A run folder with its script, and programs that are played.
struct Played {
    work: WorkFolder,
    folder: RunFolder,
}

impl Played {
    /// `sph_run`: what plays sph-run, in the run folder. Words for `./talus batch` besides.
    fn new(sph_run: &str, words: &[&str]) -> Self {
        let work = WorkFolder::new();
        let played = Self { folder: RunFolder::new(work.join("a run")), work };
        // The script looks once a second whether its program has ended.
        played.play("sleep", "exec /bin/sleep 0.05");
        played.play("mpirun", "shift 2; exec \"$@\"");
        played.play("sph-run", sph_run);
        played.play("sph-post", "echo evaluated");
        played.play("sph-prep", "mkdir prepared; cp scene.toml prepared/scene.lock.toml; touch prepared/initial.hdf");
        played.play("squeue", "case $* in *%o*--jobs*|*--jobs*%o) echo \"$SCRIPT\" ;; *) cat \"$QUEUE\" ;; esac");
        played.play(
            "scontrol",
            "[ \"$1\" != show ] || { echo \"RequeueExit = $REQUEUE_EXIT\"; exit; }; echo $* >>\"$ASKED\"",
        );
        played.play("scancel", "echo scancel $* >>\"$ASKED\"");
        played.play("sbatch", "echo sbatch $* >>\"$ASKED\"; wc -l <\"$ASKED\"");
        let scene = played.work.write("scene.toml", short::RINGS);
        let mut all = vec![scene.to_str().unwrap(), "--out", played.folder.path().to_str().unwrap(), "--ranks", "4"];
        all.extend(words);
        let mut command = batch(&all, &played.programs());
        played.set(&mut command);
        let written = run_within(TIME_LIMIT, &mut command).expect(exit::DONE);
        fs::write(played.work.join("said"), format!("{written}")).unwrap();
        played
    }

    fn play(&self, name: &str, script: &str) {
        play(&self.programs(), name, script);
    }

    fn programs(&self) -> PathBuf {
        self.work.join("programs")
    }

    fn script(&self) -> PathBuf {
        self.folder.path().canonicalize().unwrap_or_default().join("job.sh")
    }

    fn set(&self, command: &mut Command) {
        let path = std::env::var_os("PATH").unwrap_or_default();
        let mut folders = vec![self.programs()];
        folders.extend(std::env::split_paths(&path));
        command.env("PATH", std::env::join_paths(folders).unwrap());
        command.env("ASKED", self.work.join("asked")).env("QUEUE", self.work.join("queue"));
        command.env("SCRIPT", self.script());
        if !self.work.join("queue").exists() {
            self.work.write("queue", "");
        }
    }

    /// Runs the script as job 7 of a Slurm that puts jobs with these exit codes back by itself.
    fn as_job(&self, requeue_exit: &str) -> Output {
        let mut command = job(&self.folder);
        self.set(&mut command);
        let _ = fs::remove_file(self.work.join("asked"));
        command.env("SLURM_JOB_ID", "7").env("REQUEUE_EXIT", requeue_exit);
        run_within(TIME_LIMIT, &mut command)
    }

    /// What `sbatch`, `scontrol` and `scancel` were told.
    fn asked(&self) -> String {
        fs::read_to_string(self.work.join("asked")).unwrap_or_default()
    }
}

/// Plays a sph-run that stops with a checkpoint, each time one step further.
fn stops(reason: &str) -> String {
    let text = "{\\\"reason\\\":\\\"REASON\\\",\\\"step\\\":$n,\\\"time\\\":0.5}".replace("REASON", reason);
    format!("n=$(($(cat log/n || echo 0) + 1)); echo $n >log/n; echo \"{text}\" >CONTINUE; exit 75")
}

#[test]
fn a_stopped_job_goes_back_into_the_queue() {
    let played = Played::new(&stops("wall-limit"), &["--time", "04:00:00", "--partition", "low"]);
    let asked = played.asked();
    assert_eq!(asked, format!("sbatch --parsable {}\n", played.script().display()));
    let script = fs::read_to_string(played.script()).unwrap();
    for line in ["--requeue", "--ntasks=4", "--signal=B:USR1@120", "--time=04:00:00", "--partition=low"] {
        assert!(script.contains(&format!("\n#SBATCH {line}\n")), "{line}: {script}");
    }
    played.as_job("(null)").expect(exit::RESUMABLE);
    assert_eq!(played.asked(), "requeue 7\n");
    // A Slurm that does it by itself is not asked.
    played.as_job("3,75").expect(exit::RESUMABLE);
    assert_eq!(played.asked(), "");
    // Outside Slurm there is nobody to ask.
    played.play("scontrol", "echo asked >>\"$ASKED\"");
    let mut command = job(&played.folder);
    played.set(&mut command);
    run_within(TIME_LIMIT, &mut command).expect(exit::RESUMABLE);
    assert_eq!(played.asked(), "");
}

#[test]
fn a_person_who_stops_a_run_is_heard() {
    let played = Played::new(&stops("stop-file"), &[]);
    played.as_job("(null)").expect(exit::RESUMABLE);
    assert_eq!(played.asked(), "");
    // With 75 it would be put back.
    played.as_job("75").expect(exit::DONE);
    assert_eq!(played.asked(), "");
}

#[test]
fn slices_that_bring_nothing_end() {
    let played = Played::new("echo '{\"reason\":\"signal\",\"step\":9,\"time\":0.5}' >CONTINUE; exit 75", &[]);
    for code in [exit::RESUMABLE; 3] {
        played.as_job("75").expect(code);
    }
    let given_up = played.as_job("75").expect(exit::NUMERICAL);
    assert!(given_up.stderr.contains("brought nothing"), "{given_up}");
}

#[test]
fn a_chain_goes_on_and_is_cut_at_a_failure() {
    let played = Played::new(&stops("signal"), &["--chain", "3"]);
    let script = played.script();
    let submitted = format!(
        "sbatch --parsable {0}\nsbatch --parsable --dependency=afterany:1 {0}\nsbatch --parsable --dependency=afterany:2 {0}\n",
        script.display()
    );
    assert_eq!(played.asked(), submitted);
    assert!(fs::read_to_string(&script).unwrap().contains("\n#SBATCH --no-requeue\n"));
    played.as_job("(null)").expect(exit::RESUMABLE);
    // Slurm would put a job with 75 back even so.
    played.as_job("75").expect(exit::DONE);
    assert_eq!(played.asked(), "");
    // mpirun's own code after TERM, with the checkpoint written.
    played.play("sph-run", &stops("signal").replace("exit 75", "exit 1"));
    played.as_job("(null)").expect(exit::RESUMABLE);

    played.work.write("queue", &format!("8 {0}\n9 {0}\n10 /elsewhere/job.sh\n", script.display()));
    for code in [exit::NUMERICAL, 1] {
        played.play("sph-run", &format!("exit {code}"));
        played.as_job("(null)").expect(code);
        assert_eq!(played.asked(), "scancel 8\nscancel 9\n");
    }
    played.play("sph-run", "touch DONE");
    played.as_job("(null)").expect(exit::DONE);
    assert_eq!(played.asked(), "");
}

#[test]
fn a_run_is_not_submitted_twice() {
    let played = Played::new("exit 75", &["--dry-run"]);
    assert_eq!(played.asked(), "");
    let words = [played.folder.path().to_str().unwrap(), "--ranks", "4"];
    let again = || {
        let mut command = batch(&words, &played.programs());
        played.set(&mut command);
        run_within(TIME_LIMIT, &mut command)
    };
    played.work.write("queue", &format!("8 {}\n", played.script().display()));
    let refused = again().expect(exit::LOCKED);
    assert!(refused.stderr.contains("scancel 8") && played.asked().is_empty(), "{refused}");
    played.work.write("queue", "");
    assert_eq!(again().expect(exit::DONE).stdout, "1\n");
    played.play("sbatch", "echo 'sbatch: error: no such partition' >&2; exit 1");
    let failed = again().expect(exit::NO_INPUT);
    assert!(failed.stderr.contains("no such partition") && failed.stderr.contains("by hand: sbatch '"), "{failed}");
}

/// Local slices: with sph-run played until the last, which is the real one.
#[test]
fn slices_on_this_machine() {
    let work = WorkFolder::new();
    let reference = computed(&work, "reference", short::RINGS, 1);
    let (folder, programs) = (RunFolder::new(work.join("run")), work.join("programs"));
    let real = program("sph-run");
    for name in ["sph-prep", "sph-post"] {
        fs::create_dir_all(&programs).unwrap();
        std::os::unix::fs::symlink(program(name), programs.join(name)).unwrap();
    }
    // Twice 40 steps that end like a wall limit, then to the end.
    let count = work.join("count");
    let script = format!(
        "echo \"$*\" >>'{count}'; [ $(wc -l <'{count}') -gt 2 ] && exec '{real}' \"$@\"
         '{real}' \"$@\" --stop-after-steps 40; code=$?; sed -i s/steps/wall-limit/ \"$1/CONTINUE\"; exit $code",
        count = count.display(),
        real = real.display()
    );
    play(&programs, "sph-run", &script);
    let file = work.join("reference.toml");
    let words = |more: &[&'static str]| {
        let mut words = vec![file.to_str().unwrap().to_owned(), "--out".into(), folder.path().to_str().unwrap().into()];
        words.extend(["--local", "--slice", "10min", "--ranks", "1"].map(str::to_owned));
        words.extend(more.iter().map(|word| (*word).to_owned()));
        words
    };
    let go = |more: &[&'static str]| {
        let mut command = with_mpi(workflows());
        command.arg("batch").args(words(more)).arg("--programs").arg(&programs);
        run_within(TIME_LIMIT, &mut command)
    };
    let first = go(&["--slices", "1"]).expect(exit::RESUMABLE);
    assert!(first.stderr.contains("slice 1: ") && first.stderr.contains("step 40\n"), "{first}");
    let rest = go(&[]).expect(exit::DONE);
    assert!(rest.stderr.contains("slice 1: ") && rest.stderr.contains("step 80\n"), "{rest}");
    assert!(!rest.stderr.contains("slice 2: "), "{rest}");
    let called = fs::read_to_string(&count).unwrap();
    assert!(called.lines().count() == 3 && called.lines().all(|line| line.contains("--wall-limit 10min")), "{called}");
    assert_eq!(outputs(&reference), outputs(&folder));
    // Other codes end it.
    play(&programs, "sph-run", "exit 73");
    fs::remove_file(folder.done()).unwrap();
    go(&[]).expect(exit::CANNOT_WRITE);
}
