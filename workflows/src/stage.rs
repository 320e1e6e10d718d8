//! The stages of a run, `sph-prep`, `sph-run`, `sph-post`: built once, then started one after the other.

use crate::launch::{self, Stop};
use crate::{failure::Failure, paths};
use formats::{
    exit,
    folder::RunFolder,
    scene::{Change, Scene, SceneError},
    snapshot,
};
use std::path::{Path, PathBuf};
use std::process::ExitStatus;
use xshell::{Shell, cmd};

/// The three programs.
#[derive(Debug)]
pub struct Programs {
    shell: Shell,
    folder: PathBuf,
}

/// What to run, and where.
#[derive(Clone, Copy, Debug)]
pub struct Job<'a> {
    /// Scene file.
    pub scene: &'a Path,
    /// Run folder.
    pub folder: &'a Path,
    /// Ranks, if the user chose.
    pub ranks: Option<u32>,
    /// Remove what is there?
    pub fresh: bool,
    /// The command that goes on after a failure.
    pub again: &'a str,
    /// Where the stages write what they say; standard error where it is none.
    pub log: Option<&'a Path>,
}

impl Programs {
    /// Builds them beside this program, in its own profile: `release` where `./talus` started it.
    pub fn build() -> Result<Self, Failure> {
        let shell = launch::shell()?;
        let own = std::env::current_exe().map_err(|e| Failure::no_input(format!("cannot find this program: {e}")))?;
        let lost = || Failure::no_input(format!("{}: not in a target folder", own.display()));
        let folder = own.parent().ok_or_else(lost)?;
        let target = folder.parent().ok_or_else(lost)?;
        // As this program itself was built: by `./talus`, or with the tests of the whole workspace.
        let what: &[&str] = match folder.ends_with("release") {
            true => &["--release", "-p", "sph-prep", "-p", "sph-run", "-p", "sph-post"],
            false => &["--workspace", "--bins"],
        };
        let programs = Self { folder: folder.to_path_buf(), shell };
        let built = ["sph-prep", "sph-run", "sph-post"].iter().all(|name| programs.path(name).is_file());
        if !built {
            eprintln!("talus: building sph-prep, sph-run and sph-post");
        }
        let quiet = built.then_some("--quiet");
        let cargo = cargo();
        let build = cmd!(programs.shell, "{cargo} build {quiet...} --target-dir {target} {what...}");
        let end = launch::wait(build, Stop::AtOnce)?;
        match end.status.success() {
            true => Ok(programs),
            false => Err(Failure {
                code: code(end.status),
                message: "the programs could not be built, see above; go on with: ./talus and the same words".into(),
            }),
        }
    }

    /// The same programs for another thread.
    pub fn again(&self) -> Result<Self, Failure> {
        Ok(Self { shell: launch::shell()?, folder: self.folder.clone() })
    }

    /// Those that lie in a folder already, built elsewhere.
    ///
    /// # Errors
    /// Where one of them is not there.
    pub fn installed(folder: &Path) -> Result<Self, Failure> {
        let folder = folder.canonicalize().map_err(|e| Failure::no_input(format!("{}: {e}", folder.display())))?;
        let programs = Self { folder, shell: launch::shell()? };
        match ["sph-prep", "sph-run", "sph-post"].iter().find(|name| !programs.path(name).is_file()) {
            None => Ok(programs),
            Some(name) => Err(Failure::no_input(format!("{}: there is no {name}", programs.folder.display()))),
        }
    }

    /// Where they lie.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Path of one of them.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }
}

/// The cargo that built this program, or the one on the path.
pub fn cargo() -> PathBuf {
    std::env::var_os("CARGO").map_or_else(|| "cargo".into(), PathBuf::from)
}

/// Runs the stages that are still to do: all of them in a new folder, the computation from its last checkpoint where
/// it was stopped, and only `sph-post` where it is done.
pub fn run(programs: &Programs, job: &Job) -> Result<(), Failure> {
    prepare(programs, job)?;
    compute(programs, job)
}

/// The first stage: leaves a folder prepared from the job's scene, which may be one that was there before. Of a run that is
/// there the scene may have changed in what sph-run takes up while it goes on.
pub fn prepare(programs: &Programs, job: &Job) -> Result<(), Failure> {
    let folder = RunFolder::new(job.folder);
    if job.fresh {
        remove(&folder)?;
    }
    match is_occupied(job.folder) {
        true => changes(&folder, job).map(|_| ()),
        false => sph_prep(programs, job),
    }
}

/// The stages after [`prepare`].
pub fn compute(programs: &Programs, job: &Job) -> Result<(), Failure> {
    if let Some(end) = advance(programs, job, &[])? {
        passed("sph-run", end, job)?;
    }
    evaluate(programs, job)
}

/// Computes, with these options of sph-run besides, until it ends or stops; none where the run is done.
pub fn advance(programs: &Programs, job: &Job, options: &[String]) -> Result<Option<launch::End>, Failure> {
    let folder = RunFolder::new(job.folder);
    let name = paths::short(job.folder).display().to_string();
    let changes = changes(&folder, job)?;
    for change in &changes {
        say(job, &format!("{name}: the scene has changed: {change}"));
    }
    if folder.done().is_file() && changes.is_empty() {
        say(job, &format!("{name} is done: only the results are made again (--fresh starts over)"));
        return Ok(None);
    }
    let header = snapshot::read_header(&folder.initial()).map_err(|e| Failure {
        code: e.exit_code(),
        message: format!("{e}; start over with: {} --fresh", job.again),
    })?;
    let ranks = launch::ranks(job.ranks, header.count);
    let plural = if ranks == 1 { "" } else { "s" };
    say(job, &format!("sph-run on {ranks} rank{plural}, {} particles", header.count));
    let command = launch::parallel(&programs.shell, &programs.path("sph-run"), ranks).arg(job.folder).args(options);
    let command = match changes.is_empty() {
        true => command,
        false => command.arg("--scene").arg(job.scene),
    };
    launch::wait_with(command, Stop::Gently, job.log).map(Some)
}

/// The last stage: results from what was computed, with the curves of a `measured.csv` beside the scene.
pub fn evaluate(programs: &Programs, job: &Job) -> Result<(), Failure> {
    say(job, "sph-post");
    let post = programs.path("sph-post");
    let measured = job.scene.with_file_name("measured.csv");
    let command = cmd!(programs.shell, "{post}").arg(job.folder);
    let command = match measured.is_file() {
        true => command.arg("--reference").arg(measured),
        false => command,
    };
    passed("sph-post", launch::wait_with(command, Stop::AtOnce, job.log)?, job)
}

/// What a run leaves for people: the snapshots' index, the history, and everything in `post/`.
pub fn results(folder: &Path) -> Vec<PathBuf> {
    let folder = RunFolder::new(folder);
    let mut made: Vec<PathBuf> =
        std::fs::read_dir(folder.post()).into_iter().flatten().flatten().map(|entry| entry.path()).collect();
    made.sort();
    [folder.series(), folder.history()].into_iter().filter(|path| path.is_file()).chain(made).collect()
}

/// News of a job; in the log, the stages speak for themselves.
fn say(job: &Job, news: &str) {
    if job.log.is_none() {
        eprintln!("talus: {news}");
    }
}

fn sph_prep(programs: &Programs, job: &Job) -> Result<(), Failure> {
    if let Some(parent) = job.folder.parent() {
        std::fs::create_dir_all(parent)
            .map_err(|e| Failure::cannot_write(format!("{}: cannot make the folder: {e}", parent.display())))?;
    }
    say(job, &format!("sph-prep {}", paths::short(job.scene).display()));
    let ranks = job.ranks.unwrap_or_else(launch::cores);
    let command = launch::parallel(&programs.shell, &programs.path("sph-prep"), ranks);
    let command = command.arg(job.scene).arg("-o").arg(job.folder);
    passed("sph-prep", launch::wait_with(command, Stop::AtOnce, job.log)?, job)
}

/// Is there anything in a folder?
pub fn is_occupied(folder: &Path) -> bool {
    folder.exists() && std::fs::read_dir(folder).map_or(true, |mut entries| entries.next().is_some())
}

/// What has changed in the scene since the run folder was made from it: a run is gone on with only where all of it may
/// change meanwhile.
fn changes(folder: &RunFolder, job: &Job) -> Result<Vec<Change>, Failure> {
    let name = paths::short(job.folder).display();
    let (then, now) = (std::fs::read_to_string(folder.scene()), std::fs::read_to_string(job.scene));
    let reason = match (then, now) {
        (Ok(_), Ok(_)) if !folder.initial().is_file() => "holds a preparation that did not finish".to_owned(),
        // Where a file is named, it may have changed under its name.
        (Ok(then), Ok(now)) if then == now && !["terrain", "obstacle"].iter().any(|table| now.contains(table)) => {
            return Ok(Vec::new());
        }
        (Ok(then), Ok(now)) => match compared(folder, job, &then, &now) {
            Ok(changes) => return Ok(changes),
            Err(error) => format!("cannot go on with the scene as it is now:\n{error}\n"),
        },
        (Err(_), _) => "is not a run folder (it has no scene.lock.toml)".to_owned(),
        (_, Err(_)) => "cannot be compared with the scene, which cannot be read".to_owned(),
    };
    let advice = match folder.scene().is_file() {
        true => format!("start over with: {} --fresh; or choose another folder with --out", job.again),
        false => "choose another folder with --out".to_owned(),
    };
    let link = if reason.ends_with('\n') { "" } else { "; " };
    Err(Failure::cannot_write(format!("{name} {reason}{link}{advice}")))
}

fn compared(folder: &RunFolder, job: &Job, then: &str, now: &str) -> Result<Vec<Change>, SceneError> {
    Scene::changes_in(folder, then, job.scene, &paths::short(job.scene).display().to_string(), now)
}

/// Removes an earlier run, and nothing that doesn't look like one.
fn remove(folder: &RunFolder) -> Result<(), Failure> {
    if !is_occupied(folder.path()) {
        return Ok(());
    }
    let name = paths::short(folder.path()).display();
    if !folder.scene().is_file() {
        return Err(Failure::cannot_write(format!(
            "{name} is not a run folder (it has no scene.lock.toml): not removed"
        )));
    }
    if folder.lock().exists() {
        let message = format!("{name} is in use (its file LOCK is there): stop that run, or remove the file, first");
        return Err(Failure { code: exit::LOCKED, message });
    }
    std::fs::remove_dir_all(folder.path())
        .map_err(|e| Failure::cannot_write(format!("{name}: cannot remove the earlier run: {e}")))
}

/// Hands on the exit code of a stage that failed, with the command that goes on. mpirun answers SIGTERM with
/// status 1 whatever its ranks say, so a stop on request is told by the request.
pub fn passed(stage: &str, end: launch::End, job: &Job) -> Result<(), Failure> {
    if end.status.success() {
        return Ok(());
    }
    let code = if end.interrupted { exit::RESUMABLE } else { code(end.status) };
    let what = match code {
        exit::RESUMABLE => "stopped early".to_owned(),
        code => format!("failed with exit code {code}, see above"),
    };
    Err(Failure { code, message: format!("{stage} {what}; go on with: {}", job.again) })
}

/// The exit code, or 128 plus the signal as shells count.
pub fn code(status: ExitStatus) -> i32 {
    use std::os::unix::process::ExitStatusExt;
    status.code().or_else(|| status.signal().map(|signal| 128 + signal)).unwrap_or(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn job<'a>(scene: &'a Path, folder: &'a Path) -> Job<'a> {
        Job { scene, folder, ranks: None, fresh: false, again: "./talus case x", log: None }
    }

    /// The scene of a case.
    fn scene() -> String {
        std::fs::read_to_string(paths::repository().join("workflows/cases/chute-mu-i/scene.toml")).unwrap()
    }

    #[test]
    fn a_folder_of_another_scene_is_not_touched() {
        let work = tempfile::tempdir().unwrap();
        let (file, folder) = (work.path().join("scene.toml"), work.path().join("run"));
        std::fs::write(&file, scene()).unwrap();
        std::fs::create_dir(&folder).unwrap();
        let run = RunFolder::new(&folder);
        std::fs::write(folder.join("thesis.txt"), "years").unwrap();
        let refused = |words: &[&str]| {
            let failure = changes(&run, &job(&file, &folder)).unwrap_err();
            assert_eq!(failure.code, exit::CANNOT_WRITE);
            assert!(words.iter().all(|word| failure.message.contains(word)), "{failure}");
        };
        refused(&["not a run folder"]);
        assert_eq!(remove(&run).unwrap_err().code, exit::CANNOT_WRITE);
        assert!(folder.join("thesis.txt").is_file());
        std::fs::write(run.scene(), scene()).unwrap();
        refused(&["did not finish", "; start over with: ./talus case x --fresh"]);
        std::fs::write(run.initial(), "").unwrap();
        assert_eq!(changes(&run, &job(&file, &folder)).unwrap(), []);
        let other = scene().replace("shifting = 0.1", "shifting = 0.2").replace("grain-density", "# grain-density");
        std::fs::write(run.scene(), other).unwrap();
        refused(&[
            "numerics.shifting: 0.1 now, 0.2 when",
            "material.mu-i.grain-density: ",
            "may not change\nstart over",
        ]);
        std::fs::write(&file, "spacing = ").unwrap();
        refused(&["not valid TOML"]);
        std::fs::write(run.lock(), "").unwrap();
        assert_eq!(remove(&run).unwrap_err().code, exit::LOCKED);
        std::fs::remove_file(run.lock()).unwrap();
        remove(&run).unwrap();
        assert!(!folder.exists());
    }

    #[test]
    fn a_scene_that_may_change_is_handed_on() {
        let work = tempfile::tempdir().unwrap();
        let (file, folder) = (work.path().join("scene.toml"), work.path().join("run"));
        std::fs::create_dir(&folder).unwrap();
        let run = RunFolder::new(&folder);
        std::fs::write(run.scene(), scene()).unwrap();
        std::fs::write(run.initial(), "").unwrap();
        std::fs::write(&file, format!("# looked at again\n{}", scene())).unwrap();
        assert_eq!(changes(&run, &job(&file, &folder)).unwrap(), []);
        std::fs::write(&file, scene().replace("[end]\n", "[end]\nat-rest = 0.01\n")).unwrap();
        let changes = changes(&run, &job(&file, &folder)).unwrap();
        assert_eq!(changes.iter().map(Change::to_string).collect::<Vec<_>>(), ["end.at-rest: 0.01, was not set"]);
    }

    #[test]
    fn the_code_of_a_stage_is_passed_on() {
        let shell = launch::shell().unwrap();
        let job = job(Path::new("s"), Path::new("r"));
        let end = |script: &str| launch::wait(cmd!(shell, "sh -c {script}").quiet(), Stop::Gently).unwrap();
        assert!(passed("sph-run", end("exit 0"), &job).is_ok());
        let failure = passed("sph-run", end("exit 70"), &job).unwrap_err();
        assert_eq!(failure.code, exit::NUMERICAL);
        assert_eq!(failure.message, "sph-run failed with exit code 70, see above; go on with: ./talus case x");
        let failure = passed("sph-run", end("exit 75"), &job).unwrap_err();
        assert!(failure.code == exit::RESUMABLE && failure.message.contains("stopped early"), "{failure}");
        assert_eq!(passed("sph-run", end("kill -9 $$"), &job).unwrap_err().code, 137);
        let stopped = launch::End { interrupted: true, ..end("exit 1") };
        assert_eq!(passed("sph-run", stopped, &job).unwrap_err().code, exit::RESUMABLE);
    }
}
