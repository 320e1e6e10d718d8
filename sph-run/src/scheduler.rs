//! How much wall time a batch job has left: what Slurm, PBS, Torque and LSF say in the environment, or when asked.
//!
//! No answer never ends a run: it goes on without a limit, and a warning says why.

use std::io::Read;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// How long a scheduler may take to answer.
const TIME_TO_ANSWER: Duration = Duration::from_secs(10);
/// PBS renews `resources_used` at most this late (`$max_check_poll` of its daemon).
const USED_IS_LATE_BY: Duration = Duration::from_secs(120);

/// Wall time a job may still use.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Allowance {
    /// From the moment it was asked for.
    pub left: Duration,
    /// Who says so, for the log.
    pub source: String,
}

/// What was found out about the time left.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TimeLeft {
    /// None outside a job, in a job without a limit, and where it could not be found out.
    pub allowance: Option<Allowance>,
    /// Why the answer is missing or doubtful, for people.
    pub warning: Option<String>,
}

impl TimeLeft {
    fn known(left: Duration, source: &str) -> Self {
        Self { allowance: Some(Allowance { left, source: source.into() }), warning: None }
    }
    fn unknown(why: impl Into<String>) -> Self {
        Self { allowance: None, warning: Some(why.into()) }
    }
}

/// The time left of the job this process runs in. `environment` looks up a variable, `query` runs a command and gives
/// its standard output or says what went wrong (mostly [`ask`]), `now` is the time of day. Ask once, at the start.
pub fn time_left(
    environment: impl Fn(&str) -> Option<String>,
    query: impl Fn(&[&str]) -> Result<String, String>,
    now: SystemTime,
) -> TimeLeft {
    match Job::of(&environment) {
        Some(Job::Slurm(id)) => slurm(&id, environment("SLURM_JOB_END_TIME"), query, now),
        Some(Job::Pbs(id)) => pbs(&id, environment("PBS_WALLTIME"), query, now),
        Some(Job::Lsf(id)) => lsf(&id, query),
        None => TimeLeft::default(),
    }
}

/// The job this process runs in: `slurm 1234`, `slurm 1230_4`, `pbs 99.server`, `lsf 77[3]`; none outside a job.
pub fn job_id(environment: impl Fn(&str) -> Option<String>) -> Option<String> {
    Job::of(&environment).map(|job| match job {
        Job::Slurm(id) => format!("slurm {id}"),
        Job::Pbs(id) => format!("pbs {id}"),
        Job::Lsf(id) => format!("lsf {id}"),
    })
}

/// Runs a command and gives its standard output. Bounded: one that takes more than ten seconds is ended.
///
/// # Errors
/// What went wrong, for people.
pub fn ask(command: &[&str]) -> Result<String, String> {
    ask_within(TIME_TO_ANSWER, command)
}

fn ask_within(limit: Duration, command: &[&str]) -> Result<String, String> {
    let (name, arguments) = command.split_first().ok_or("no command")?;
    let mut child = Command::new(name)
        .args(arguments)
        .env("LC_ALL", "C")
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .map_err(|error| format!("{name} can't be started: {error}"))?;
    let answer = answer_of(&mut child, limit, name);
    if answer.is_err() {
        let _ = child.kill();
    }
    let _ = child.wait();
    answer
}

fn answer_of(child: &mut Child, limit: Duration, name: &str) -> Result<String, String> {
    let started = Instant::now();
    let late = || format!("{name} gave no answer within {} s", limit.as_secs_f64());
    let mut pipe = child.stdout.take().ok_or("no pipe")?;
    let (send, receive) = mpsc::channel();
    // Left alone where it is late: a grandchild may hold the pipe open for ever.
    std::thread::spawn(move || {
        let mut bytes = Vec::new();
        let _ = pipe.read_to_end(&mut bytes);
        let _ = send.send(bytes);
    });
    let bytes = receive.recv_timeout(limit).map_err(|_| late())?;
    loop {
        match child.try_wait().map_err(|error| format!("{name}: {error}"))? {
            Some(status) if status.success() => return Ok(String::from_utf8_lossy(&bytes).into_owned()),
            Some(status) => return Err(format!("{name} failed: {status}")),
            None if started.elapsed() > limit => return Err(late()),
            None => std::thread::sleep(Duration::from_millis(5)),
        }
    }
}

enum Job {
    Slurm(String),
    Pbs(String),
    Lsf(String),
}

impl Job {
    fn of(environment: &impl Fn(&str) -> Option<String>) -> Option<Self> {
        let get = |name: &str| environment(name).map(|v| v.trim().to_owned()).filter(|v| !v.is_empty());
        if let Some(id) = get("SLURM_JOB_ID") {
            // The last task of an array carries the number of the whole array, which names all its tasks.
            let task = get("SLURM_ARRAY_JOB_ID").zip(get("SLURM_ARRAY_TASK_ID"));
            return Some(Self::Slurm(task.map_or(id, |(array, task)| format!("{array}_{task}"))));
        }
        if let Some(id) = get("PBS_JOBID") {
            return Some(Self::Pbs(id));
        }
        let id = get("LSB_JOBID")?;
        Some(Self::Lsf(match get("LSB_JOBINDEX") {
            Some(index) if index != "0" => format!("{id}[{index}]"),
            _ => id,
        }))
    }
}

/// The end of the job in its environment (Slurm 22.05 and later), else `squeue`.
fn slurm(
    id: &str,
    end: Option<String>,
    query: impl Fn(&[&str]) -> Result<String, String>,
    now: SystemTime,
) -> TimeLeft {
    if let Some(end) = end.and_then(|text| text.trim().parse().ok()) {
        // An end that has passed is that of another job, or of one whose limit was extended.
        if let Some(left) = until(end, now).filter(|left| !left.is_zero()) {
            return TimeLeft::known(left, "SLURM_JOB_END_TIME");
        }
    }
    let answer = match query(&["squeue", "-h", "-j", id, "-o", "%L"]) {
        Ok(answer) => answer,
        Err(why) => return TimeLeft::unknown(format!("the time left to job {id} is unknown: {why}")),
    };
    let words: Vec<&str> = answer.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    // Several lines: the parts of a heterogeneous job.
    match words.iter().filter_map(|word| clock(word)).min() {
        Some(left) => TimeLeft::known(left, "squeue"),
        None if words.contains(&"UNLIMITED") => TimeLeft::default(),
        None => TimeLeft::unknown(format!("the time left to job {id} is unknown: squeue says {:?}", answer.trim())),
    }
}

/// `qstat -f`: Torque says what is left; PBS the limit, the start and, some time late, what is used.
fn pbs(
    id: &str,
    limit: Option<String>,
    query: impl Fn(&[&str]) -> Result<String, String>,
    now: SystemTime,
) -> TimeLeft {
    let limit = limit.and_then(|text| clock(&text));
    let answer = match (query(&["qstat", "-f", id]), limit) {
        (Ok(answer), _) => answer,
        (Err(why), Some(left)) => {
            let warning = format!("what job {id} has used is unknown: {why}; its limit is counted from now");
            return TimeLeft { warning: Some(warning), ..TimeLeft::known(left, "PBS_WALLTIME") };
        }
        (Err(why), None) => return TimeLeft::unknown(format!("the time left to job {id} is unknown: {why}")),
    };
    let value = |name: &str| {
        answer.lines().find_map(|line| line.trim().strip_prefix(name)?.trim_start().strip_prefix('=').map(str::trim))
    };
    if let Some(left) = value("Walltime.Remaining").and_then(clock) {
        return TimeLeft::known(left, "qstat");
    }
    let Some(limit) = value("Resource_List.walltime").and_then(clock).or(limit) else {
        // Whoever answers with a whole job but no limit has none.
        return match value("job_state") {
            Some(_) => TimeLeft::default(),
            None => TimeLeft::unknown(format!("the time left to job {id} is unknown: qstat names no such job")),
        };
    };
    let started = value("stime").or_else(|| value("start_time")).and_then(|text| seconds(text, &query));
    let used = match started.map(|start| now.duration_since(UNIX_EPOCH + start)) {
        Some(Ok(used)) => used,
        _ => match value("resources_used.walltime").and_then(clock) {
            Some(used) => used + USED_IS_LATE_BY,
            None => return TimeLeft::unknown(format!("what job {id} has used is unknown: qstat does not say")),
        },
    };
    TimeLeft::known(limit.saturating_sub(used), "qstat")
}

/// `bjobs`: `11:59 L`, hours and minutes up to the run limit; `E` up to an estimate; `-` without either.
fn lsf(id: &str, query: impl Fn(&[&str]) -> Result<String, String>) -> TimeLeft {
    let answer = match query(&["bjobs", "-noheader", "-o", "time_left", id]) {
        Ok(answer) => answer,
        Err(why) => return TimeLeft::unknown(format!("the time left to job {id} is unknown: {why}")),
    };
    let mut words = answer.split_whitespace();
    let (time, kind) = (words.next().unwrap_or(""), words.next().unwrap_or("L"));
    // With seconds where the site sets LSB_HMS_TIME_FORMAT.
    let with_seconds = if time.matches(':').count() == 1 { format!("{time}:00") } else { time.to_owned() };
    match (time, kind, clock(&with_seconds)) {
        ("-", ..) => TimeLeft::default(),
        (_, "L", Some(left)) => TimeLeft::known(left, "bjobs"),
        (_, "E", Some(left)) => TimeLeft::known(left, "bjobs (the job's estimate)"),
        _ => TimeLeft::unknown(format!("the time left to job {id} is unknown: bjobs says {:?}", answer.trim())),
    }
}

/// `days-hours:minutes:seconds`, of which the leading parts may be missing.
fn clock(text: &str) -> Option<Duration> {
    let (days, rest) = text.trim().split_once('-').unwrap_or(("0", text.trim()));
    let parts: Vec<u64> = rest.split(':').map(|part| part.parse().ok()).collect::<Option<_>>()?;
    if parts.len() > 3 {
        return None;
    }
    let day: u64 = days.parse::<u64>().ok()?.checked_mul(86_400)?;
    let rest = parts.iter().try_fold(0u64, |sum, part| sum.checked_mul(60)?.checked_add(*part))?;
    Some(Duration::from_secs(day.checked_add(rest)?))
}

/// From now until a time in seconds since 1970; zero if it has passed.
fn until(end: u64, now: SystemTime) -> Option<Duration> {
    let now = now.duration_since(UNIX_EPOCH).ok()?;
    Some(Duration::from_secs(end).saturating_sub(now))
}

/// A time of day in seconds since 1970, as such or as `Tue Feb 19 12:47:56 2019` in the time zone of this machine.
fn seconds(text: &str, query: &impl Fn(&[&str]) -> Result<String, String>) -> Option<Duration> {
    let number = |text: &str| text.split_whitespace().next()?.parse().ok();
    let seconds = number(text).or_else(|| number(&query(&["date", "--date", text, "+%s"]).ok()?));
    seconds.map(Duration::from_secs)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `qstat -f` of Torque.
    const TORQUE: &str = "Job Id: 67048.xena.example.org
    Job_Name = column
    Job_Owner = user@xena.example.org
    resources_used.cput = 00:35:53
    resources_used.walltime = 00:35:58
    job_state = R
    Error_Path = xena.example.org:/users/user/experiments/a-very-long-name-of-a
        -folder/column.e67048
    Resource_List.nodes = 1:ppn=2
    Resource_List.walltime = 03:00:00
    etime = Mon Feb 18 16:19:19 2019
    start_time = Tue Feb 19 12:47:56 2019
    Walltime.Remaining = 8598
    start_count = 1
";
    /// `qstat -f` of PBS Professional.
    const PBS: &str = "Job Id: 69301.mycluster
    Job_Name = column
    resources_used.cput = 4090:56:03
    resources_used.walltime = 64:26:16
    job_state = R
    ctime = Wed Apr 10 17:10:29 2013
    exec_vnode = (b141:ncpus=16)+(b142:ncpus=16)+(b143:ncpus=16)+(b144:ncpus=16
\t)
    Resource_List.walltime = 72:00:00
    stime = Wed Apr 17 09:10:24 2013
";

    fn now() -> SystemTime {
        UNIX_EPOCH + Duration::from_secs(1_700_000_000)
    }

    /// The answer in a given environment to given commands.
    fn found(environment: &[(&str, &str)], answers: &[(&str, &str)]) -> TimeLeft {
        let get = |list: &[(&str, &str)], key: &str| list.iter().find(|e| e.0 == key).map(|e| e.1.to_owned());
        time_left(
            |name| get(environment, name),
            |command| get(answers, &command.join(" ")).ok_or_else(|| format!("{} can't be started", command[0])),
            now(),
        )
    }

    #[track_caller]
    fn left(found: &TimeLeft, seconds: u64, source: &str) {
        let allowance = Allowance { left: Duration::from_secs(seconds), source: source.into() };
        assert_eq!(found.allowance, Some(allowance), "{found:?}");
    }

    #[track_caller]
    fn doubtful(found: &TimeLeft, word: &str) {
        assert!(found.allowance.is_none() && found.warning.as_ref().is_some_and(|w| w.contains(word)), "{found:?}");
    }

    #[test]
    fn outside_a_job_there_is_no_limit() {
        assert_eq!(found(&[], &[]), TimeLeft::default());
        assert_eq!(found(&[("SLURM_JOB_END_TIME", "1700000100")], &[]), TimeLeft::default());
        assert_eq!(job_id(|_| None), None);
    }

    #[test]
    fn slurm_from_its_environment_or_squeue() {
        let job = ("SLURM_JOB_ID", "1234");
        let squeue = |says: &str| found(&[job], &[("squeue -h -j 1234 -o %L", says)]);
        left(&found(&[job, ("SLURM_JOB_END_TIME", "1700000600")], &[]), 600, "SLURM_JOB_END_TIME");
        left(&squeue("9:59\n"), 599, "squeue");
        left(&squeue("3:59:30\n"), 4 * 3600 - 30, "squeue");
        left(&squeue("1-02:03:04\n"), 86_400 + 7200 + 184, "squeue");
        left(&squeue("2:00\n1:30\n"), 90, "squeue");
        // Past: the environment of a job whose limit was extended since.
        let past = [job, ("SLURM_JOB_END_TIME", "1699999999")];
        left(&found(&past, &[("squeue -h -j 1234 -o %L", "5:00\n")]), 300, "squeue");
        doubtful(&found(&past, &[]), "squeue can't be started");
        assert_eq!(squeue("UNLIMITED\n"), TimeLeft::default());
        for nonsense in ["NOT_SET\n", "INVALID\n", "", "1:2:3:4", "soon", "-1:00", "99999999999999999999:00"] {
            doubtful(&squeue(nonsense), "squeue says");
        }
    }

    #[test]
    fn a_task_of_an_array_asks_for_itself() {
        let array = [("SLURM_JOB_ID", "1200"), ("SLURM_ARRAY_JOB_ID", "1200"), ("SLURM_ARRAY_TASK_ID", "7")];
        left(&found(&array, &[("squeue -h -j 1200_7 -o %L", "1:00\n")]), 60, "squeue");
    }

    #[test]
    fn torque_says_what_is_left() {
        let job = ("PBS_JOBID", "67048.xena.example.org");
        left(&found(&[job], &[("qstat -f 67048.xena.example.org", TORQUE)]), 8598, "qstat");
    }

    #[test]
    fn pbs_from_the_start_or_from_what_is_used() {
        let job = ("PBS_JOBID", "69301.mycluster");
        let (limit, used) = (72 * 3600, 64 * 3600 + 26 * 60 + 16);
        let qstat = ("qstat -f 69301.mycluster", PBS);
        let date = ("date --date Wed Apr 17 09:10:24 2013 +%s", "1699990000\n");
        left(&found(&[job], &[qstat, date]), limit - 10_000, "qstat");
        // Without a start: what is used, which is up to two minutes old.
        left(&found(&[job], &[qstat]), limit - used - 120, "qstat");
        let number = PBS.replace("Wed Apr 17 09:10:24 2013", "1699990000 (Tue Nov 14 19:26:40 UTC 2023)");
        left(&found(&[job], &[(qstat.0, &number)]), limit - 10_000, "qstat");
        // A job beyond its limit has nothing left.
        let late = PBS.replace("Wed Apr 17 09:10:24 2013", "1600000000");
        left(&found(&[job], &[(qstat.0, &late)]), 0, "qstat");
        let unlimited = PBS.replace("Resource_List.walltime", "Resource_List.place");
        assert_eq!(found(&[job], &[(qstat.0, &unlimited)]), TimeLeft::default());
        left(&found(&[job, ("PBS_WALLTIME", "259200")], &[(qstat.0, &unlimited), date]), limit - 10_000, "qstat");
        doubtful(&found(&[job], &[(qstat.0, "")]), "no such job");
        doubtful(&found(&[job], &[]), "qstat can't be started");
        let alone = found(&[job, ("PBS_WALLTIME", "3600")], &[]);
        left(&alone, 3600, "PBS_WALLTIME");
        assert!(alone.warning.is_some());
    }

    #[test]
    fn lsf_in_hours_and_minutes() {
        let bjobs = |says: &str| found(&[("LSB_JOBID", "77")], &[("bjobs -noheader -o time_left 77", says)]);
        left(&bjobs("11:59 L\n"), 12 * 3600 - 60, "bjobs");
        left(&bjobs("0:12 L\n"), 720, "bjobs");
        left(&bjobs("00:11:59 L\n"), 719, "bjobs");
        left(&bjobs("1:00 E\n"), 3600, "bjobs (the job's estimate)");
        assert_eq!(bjobs("-\n"), TimeLeft::default());
        for nonsense in ["0:0 X\n", "", "Job <77> is not found\n"] {
            doubtful(&bjobs(nonsense), "bjobs says");
        }
        let array = [("LSB_JOBID", "77"), ("LSB_JOBINDEX", "3")];
        left(&found(&array, &[("bjobs -noheader -o time_left 77[3]", "0:01 L")]), 60, "bjobs");
    }

    #[test]
    fn jobs_have_names() {
        let name = |list: &[(&str, &str)]| {
            job_id(|key| list.iter().find(|e| e.0 == key).map(|e| e.1.to_owned())).unwrap_or_default()
        };
        assert_eq!(name(&[("SLURM_JOB_ID", "1234"), ("PBS_JOBID", "5")]), "slurm 1234");
        assert_eq!(name(&[("SLURM_JOB_ID", ""), ("PBS_JOBID", "99.server")]), "pbs 99.server");
        assert_eq!(name(&[("LSB_JOBID", "77"), ("LSB_JOBINDEX", "0")]), "lsf 77");
        assert_eq!(name(&[("LSB_JOBID", "77"), ("LSB_JOBINDEX", "3")]), "lsf 77[3]");
    }

    #[test]
    fn commands_are_bounded() {
        assert_eq!(ask(&["echo", "9:59"]), Ok("9:59\n".into()));
        assert!(ask(&["false"]).unwrap_err().contains("failed"));
        assert!(ask(&["no-such-command-anywhere"]).unwrap_err().contains("can't be started"));
        // One that hangs, and one whose child holds the pipe.
        let started = Instant::now();
        for script in ["exec sleep 30", "sleep 30 & exit 0"] {
            let error = ask_within(Duration::from_millis(200), &["sh", "-c", script]).unwrap_err();
            assert!(error.contains("no answer"), "{error}");
        }
        assert!(started.elapsed() < Duration::from_secs(10));
    }

    #[test]
    fn a_time_of_day_is_read_by_date() {
        let seconds = seconds("Tue Feb 19 12:47:56 2019 UTC", &|command: &[&str]| ask(command));
        assert_eq!(seconds, Some(Duration::from_secs(1_550_580_476)));
    }
}
