//! One run in five slices, by two jobs and a chain of jobs of a real Slurm, which end by the wall limit, by a requeue, by a job of
//! a higher partition, by the wall limit again with the next job of the chain to go on, and at the end: it leaves the
//! same bytes in out/ as the uninterrupted run. The last job of the chain finds nothing to do.

use crate::cluster::Cluster;
use formats::{exit, folder::RunFolder, journal::Event};
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::process::Command;
use std::time::Duration;
use tests::trial::{appears, outputs, short};
use tests::{TIME_LIMIT, WorkFolder, computed, program, run_within, workflows};

/// Reasons of the stops so far, in order.
fn stops(folder: &RunFolder) -> Vec<String> {
    Event::all(folder).into_iter().filter(|event| event.event == "stop").map(|event| event.what).collect()
}

/// Waits until a launch after so many stops computes; returns the job that the journal names.
#[track_caller]
fn computes(folder: &RunFolder, stopped: usize) -> String {
    let launches =
        |events: &[Event]| events.iter().filter(|event| ["start", "resume"].contains(&&*event.event)).count();
    let met = appears(Duration::from_secs(60), || {
        std::thread::sleep(Duration::from_millis(20));
        launches(&Event::all(folder)) == stopped + 1
    });
    let events = Event::all(folder);
    assert!(met && stops(folder).len() == stopped, "{events:?}\n{}", logs(folder));
    events.iter().rfind(|event| event.event != "checkpoint").and_then(|event| event.job.clone()).expect("a job")
}

/// What the jobs of a run said.
fn logs(folder: &RunFolder) -> String {
    let mut text = String::new();
    for entry in fs::read_dir(folder.log()).into_iter().flatten().flatten() {
        if entry.file_name().to_string_lossy().starts_with("job-") {
            text += &format!("--- {:?}\n{}", entry.path(), fs::read_to_string(entry.path()).unwrap_or_default());
        }
    }
    text
}

#[test]
fn five_slices_leave_the_bytes_of_an_uninterrupted_run() {
    let Some(cluster) = Cluster::start() else { return };
    let work = WorkFolder::new();
    let longer = [("\"150 ms\"", "\"10 s\""), ("\"40 ms\"", "\"2 s\""), ("\"7 ms\"", "\"50 ms\"")];
    let scene = longer.iter().fold(short::RINGS.to_owned(), |text, (old, new)| text.replace(old, new));
    let reference = computed(&work, "reference", &scene, 1);
    let folder = RunFolder::new(work.join("a run"));

    // While there is the file `slow` a checkpoint at every step makes the run last; a job that finds the file `limit`
    // takes it away and has to end 12 s from then.
    let mpirun = work.join("bin/mpirun");
    fs::create_dir(work.join("bin")).unwrap();
    let slow = work.write("slow", "");
    let script = format!(
        "#!/bin/sh\nPATH=${{PATH#*:}}\ncase $* in\n*sph-run*) [ ! -f {0:?} ] || exec mpirun \"$@\" --checkpoint-every 1steps ;;\nesac\nexec mpirun \"$@\"\n",
        slow
    );
    fs::write(&mpirun, script).unwrap();
    fs::set_permissions(&mpirun, fs::Permissions::from_mode(0o755)).unwrap();
    let limit = work.write("limit", "");
    // Later versions of Slurm give a job its end in this variable by themselves; minutes are the least limit there is.
    let setup = format!(
        "PATH={:?}:$PATH
if rm {limit:?} 2>/dev/null; then
    scontrol update jobid=\"$SLURM_JOB_ID\" EndTime=\"$(date -d '+12 sec' +%Y-%m-%dT%H:%M:%S)\"
    SLURM_JOB_END_TIME=$(date -d \"$(squeue --noheader --jobs=\"$SLURM_JOB_ID\" --format=%e)\" +%s)
    export SLURM_JOB_END_TIME
fi
",
        work.join("bin")
    );
    let setup = work.write("setup.sh", &setup);
    let submit = |words: &[&str]| {
        let mut command = Command::new(workflows());
        command
            .arg("batch")
            .arg(work.join("reference.toml"))
            .arg("--out")
            .arg(folder.path())
            .arg("--setup")
            .arg(&setup);
        command.arg("--programs").arg(program("sph-run").parent().unwrap());
        command.args(["--ranks", "2", "--time", "10", "--partition", "low"]).args(words);
        for name in ["OMPI_MCA_rmaps_base_oversubscribe", "OMPI_ALLOW_RUN_AS_ROOT", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM"] {
            command.env(name, "1");
        }
        command.env("OMPI_MCA_hwloc_base_binding_policy", "none").env_remove("TALUS_MPIRUN");
        cluster.reach(&mut command);
        let said = run_within(TIME_LIMIT, &mut command).expect(exit::DONE).stdout;
        said.split_whitespace().map(str::to_owned).collect::<Vec<_>>()
    };
    let back = |job: &str, restarts: &str| {
        cluster.wait_for(job, "Restarts", |value| value == restarts);
        cluster.wait_for(job, "JobState", |value| value == "PENDING");
    };
    // A job that was put back waits two minutes otherwise. Slurm may set that time a moment later: so again and again.
    let now = |job: &str| {
        let started = appears(Duration::from_secs(60), || {
            cluster.ask("scontrol", &["update", &format!("jobid={job}"), "StartTime=now"]);
            std::thread::sleep(Duration::from_millis(300));
            cluster.job(job, "JobState") == "RUNNING"
        });
        assert!(started, "job {job} does not start: {}", cluster.logs());
    };
    let cancel = |job: &str| {
        cluster.ask("scancel", &[job]).expect(0);
        cluster.wait_for(job, "JobState", |value| value == "CANCELLED");
    };

    // Slice 1: its wall limit, seen by sph-run itself. Code 75 puts the job back.
    let jobs = submit(&["--warning", "0"]);
    let job = jobs[0].as_str();
    assert_eq!(computes(&folder, 0), format!("slurm {job}"));
    back(job, "1");
    assert_eq!(stops(&folder), ["wall-limit"], "{}", logs(&folder));
    assert_eq!(cluster.job(job, "ExitCode"), "75:0");
    assert!(!limit.exists() && !logs(&folder).contains("told to stop"), "{}", logs(&folder));

    // Slice 2: put back by hand while it runs, which ends it by TERM.
    now(job);
    assert_eq!(computes(&folder, 1), format!("slurm {job}"));
    cluster.ask("scontrol", &["requeue", job]).expect(0);
    back(job, "2");
    assert_eq!(stops(&folder), ["wall-limit", "signal"], "{}", logs(&folder));
    assert!(logs(&folder).contains("DUE TO JOB REQUEUE"), "{}", logs(&folder));
    cancel(job);

    // Slice 3: of a job that is warned, until another one needs all processors, in the partition that comes first.
    let jobs = submit(&["--warning", "30"]);
    let job = jobs[0].as_str();
    assert_eq!(computes(&folder, 2), format!("slurm {job}"));
    let high = ["--parsable", "--partition=high", "--exclusive", "--time=1", "--output=/dev/null", "--wrap=true"];
    let high = cluster.ask("sbatch", &high).expect(0).stdout.trim().to_owned();
    cluster.wait_for(job, "PreemptTime", |value| value != "None");
    back(job, "1");
    cluster.wait_for(&high, "JobState", |value| value == "COMPLETED");
    assert_eq!(stops(&folder), ["wall-limit", "signal", "signal"], "{}", logs(&folder));
    let said = fs::read_to_string(folder.log().join(format!("job-{job}.txt"))).unwrap();
    assert!(said.contains("told to stop (USR1)") && !said.contains("DUE TO"), "{said}");
    cancel(job);

    // Slice 4: the first job of a chain, up to its wall limit; then fast to the end.
    fs::write(&limit, "").unwrap();
    let chain = submit(&["--chain", "3", "--warning", "0"]);
    assert_eq!(cluster.job(&chain[1], "Dependency"), format!("afterany:{}(unfulfilled)", chain[0]));
    assert_eq!(computes(&folder, 3), format!("slurm {}", chain[0]));
    fs::remove_file(&slow).unwrap();
    cluster.wait_for(&chain[0], "JobState", |value| value == "COMPLETED");
    assert_eq!(stops(&folder), ["wall-limit", "signal", "signal", "wall-limit"], "{}", logs(&folder));

    // Slice 5: the next job goes on by itself, and ends the run; the last one does nothing.
    assert_eq!(computes(&folder, 4), format!("slurm {}", chain[1]));
    for job in &chain {
        cluster.wait_for(job, "JobState", |value| value == "COMPLETED");
        assert_eq!((cluster.job(job, "ExitCode").as_str(), cluster.job(job, "Restarts").as_str()), ("0:0", "0"));
    }
    let launches = Event::all(&folder).iter().filter(|event| ["start", "resume"].contains(&&*event.event)).count();
    assert_eq!((launches, stops(&folder).len()), (5, 4), "{}", logs(&folder));
    assert!(folder.done().exists() && folder.post().join("summary.json").is_file(), "{}", logs(&folder));
    let last = fs::read_to_string(folder.log().join(format!("job-{}.txt", chain[2]))).unwrap();
    assert!(last.lines().count() == 1 && last.contains("done"), "{last}");
    assert_eq!(outputs(&reference), outputs(&folder));
}
