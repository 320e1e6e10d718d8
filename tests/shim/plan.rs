//! What is to be done, and when.
//!
//! | variable | what |
//! |---|---|
//! | `TALUS_FAULT_FOLDER` | only calls on files below this folder count; absolute, without links |
//! | `TALUS_FAULT_LOG` | file outside of it, to which a line is appended for what was done, or for each call |
//! | `TALUS_FAULT_PROGRAM` | only in a program of this name; `sph-run` where it is not set |
//! | `TALUS_FAULT_RANK` | only on this MPI rank (0 without MPI); on all where it is not set |
//! | `TALUS_FAULT_CALLS` | names of [`Kind`], with commas; all that change something on the disk where it is not set |
//! | `TALUS_FAULT_FILES` | only paths in the folder of this form: `?` stands for one letter, `*` for any number of them; calls of MPI have the path `messages` |
//! | `TALUS_FAULT_AT` | the number of the call, from 1, counted in each process on its own |
//! | `TALUS_FAULT_DO` | `count`, `kill`, `torn`, `short`, `flip`, `suspend`, `sleep:MS`, `slow:MS`, `clock:S`, `fail:CODE`, `fail-on:CODE`, `full:CODE` |
//!
//! `torn`: killed after half of a write, else after the call; `short`: half is written, and said so; `clock`: the time of
//! day jumps so many seconds; `fail-on`, `slow`: at that call and all that follow; `full`: from there on no rank can write or allocate anything anywhere in the folder. CODE
//! as the system numbers it.

use crate::raw::{self, Place};
use libc::c_int;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicI64, AtomicU64, Ordering};
use std::time::Duration;

/// What a call does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Opens an existing file for reading.
    Open,
    Read,
    /// Opens for writing, makes, or empties.
    Create,
    Write,
    Truncate,
    Allocate,
    Sync,
    Rename,
    Link,
    Remove,
    /// Makes a folder.
    Folder,
    /// A message to another rank.
    Send,
    /// A reduction over all ranks.
    Reduce,
    /// A gathering from all ranks.
    Gather,
}

impl Kind {
    const ALL: [(&str, Self); 14] = [
        ("open", Self::Open),
        ("read", Self::Read),
        ("create", Self::Create),
        ("write", Self::Write),
        ("truncate", Self::Truncate),
        ("allocate", Self::Allocate),
        ("sync", Self::Sync),
        ("rename", Self::Rename),
        ("link", Self::Link),
        ("remove", Self::Remove),
        ("folder", Self::Folder),
        ("send", Self::Send),
        ("reduce", Self::Reduce),
        ("gather", Self::Gather),
    ];

    fn name(self) -> &'static str {
        Self::ALL.iter().find(|(_, kind)| *kind == self).map_or("", |(name, _)| name)
    }
}

/// What the caller of [`judge`] has to do.
pub enum Verdict {
    Go,
    Fail(c_int),
    /// Do it, or half of it, and end the process.
    EndAfter,
    Short,
    Flip,
}

#[derive(Clone, Copy)]
enum Deed {
    Count,
    Kill,
    Torn,
    Short,
    Flip,
    Suspend,
    Sleep(Duration),
    Slow(Duration),
    Clock(i64),
    Fail(c_int),
    FailOn(c_int),
    Full(c_int),
}

struct Plan {
    folder: String,
    /// Ends with a zero.
    log: String,
    rank: u64,
    calls: Vec<Kind>,
    files: String,
    at: u64,
    deed: Deed,
    /// The words it was asked for with.
    words: String,
}

/// What stands for a path where ranks exchange.
const MESSAGES: &str = "messages";

static COUNTED: AtomicU64 = AtomicU64::new(0);
static FAILING: AtomicBool = AtomicBool::new(false);
/// Seconds that the time of day is off.
static JUMPED: AtomicI64 = AtomicI64::new(0);

/// How far the time of day has jumped, s.
pub fn jumped() -> i64 {
    JUMPED.load(Ordering::SeqCst)
}

/// Counts a call and says what is to be done with it. `bytes`: how many it writes or reads, or the numbers in a message.
pub fn judge(kind: Kind, place: Place, bytes: usize) -> Verdict {
    static PLAN: OnceLock<Option<Plan>> = OnceLock::new();
    let Some(plan) = PLAN.get_or_init(Plan::read) else { return Verdict::Go };
    let fills = matches!((plan.deed, kind), (Deed::Full(_), Kind::Write | Kind::Allocate));
    if !fills && !plan.calls.contains(&kind) {
        return Verdict::Go;
    }
    let errno = raw::errno();
    let verdict = plan.judge(kind, place, bytes);
    raw::set_errno(errno);
    verdict.unwrap_or(Verdict::Go)
}

impl Plan {
    fn read() -> Option<Self> {
        let variable = |name: &str| std::env::var(format!("TALUS_FAULT_{name}")).ok();
        let program = variable("PROGRAM").unwrap_or_else(|| "sph-run".into());
        if raw::link("/proc/self/exe\0")?.rsplit('/').next() != Some(&program) {
            return None;
        }
        let rank = ["OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK"].iter().find_map(|name| std::env::var(name).ok());
        let rank = rank.map_or(Some(0), |rank| rank.parse().ok())?;
        let calls = variable("CALLS").unwrap_or_default();
        let wanted = |(name, kind): &(&str, Kind)| match calls.as_str() {
            "" => !matches!(kind, Kind::Open | Kind::Read | Kind::Send | Kind::Reduce | Kind::Gather),
            calls => calls.split(',').any(|call| call == *name),
        };
        let words = variable("DO")?;
        let (deed, number) = words.split_once(':').unwrap_or((&words, ""));
        let deed = match deed {
            "count" => Deed::Count,
            "kill" => Deed::Kill,
            "torn" => Deed::Torn,
            "short" => Deed::Short,
            "flip" => Deed::Flip,
            "suspend" => Deed::Suspend,
            "sleep" => Deed::Sleep(Duration::from_millis(number.parse().ok()?)),
            "slow" => Deed::Slow(Duration::from_millis(number.parse().ok()?)),
            "clock" => Deed::Clock(number.parse().ok()?),
            "fail" => Deed::Fail(number.parse().ok()?),
            "fail-on" => Deed::FailOn(number.parse().ok()?),
            "full" => Deed::Full(number.parse().ok()?),
            _ => return None,
        };
        let mut at = variable("AT").and_then(|at| at.parse().ok()).unwrap_or(0);
        if variable("RANK").is_some_and(|wanted| wanted.parse() != Ok(rank)) {
            // A disk that gets full on one rank is so for all.
            if !matches!(deed, Deed::Full(_)) {
                return None;
            }
            at = u64::MAX;
        }
        Some(Self {
            folder: variable("FOLDER")? + "/",
            log: variable("LOG")? + "\0",
            rank,
            calls: Kind::ALL.iter().filter(|kind| wanted(kind)).map(|(_, kind)| *kind).collect(),
            files: variable("FILES").unwrap_or_else(|| "*".into()),
            at,
            deed,
            words,
        })
    }

    fn judge(&self, kind: Kind, place: Place, bytes: usize) -> Option<Verdict> {
        let path = match place {
            Place::Ranks => MESSAGES.to_owned(),
            place => place.path()?.strip_prefix(&self.folder)?.to_owned(),
        };
        let path = path.as_str();
        if let Deed::Full(code) = self.deed {
            if matches!(kind, Kind::Write | Kind::Allocate) && raw::exists(&self.log) {
                return Some(Verdict::Fail(code));
            }
            if !self.calls.contains(&kind) {
                return None;
            }
        }
        if !fits(self.files.as_bytes(), path.as_bytes()) {
            return None;
        }
        let number = COUNTED.fetch_add(1, Ordering::SeqCst) + 1;
        if let Deed::Count = self.deed {
            let line = format!("{}\t{number}\t{}\t{bytes}\t{path}\n", self.rank, kind.name());
            raw::append(&self.log, &line);
            return None;
        }
        if let (true, Deed::FailOn(code)) = (FAILING.load(Ordering::SeqCst), self.deed) {
            return Some(Verdict::Fail(code));
        }
        if let (true, Deed::Slow(time)) = (number > self.at, self.deed) {
            std::thread::sleep(time);
        }
        if number != self.at {
            return None;
        }
        let (words, name, rank) = (&self.words, kind.name(), self.rank);
        raw::append(&self.log, &format!("struck: {words} at {name} of {path}, call {number}, rank {rank}\n"));
        match self.deed {
            Deed::Count => None,
            Deed::Kill => raw::kill(),
            Deed::Torn => Some(Verdict::EndAfter),
            Deed::Short => Some(Verdict::Short),
            Deed::Flip => Some(Verdict::Flip),
            Deed::Suspend => {
                raw::suspend();
                None
            }
            Deed::Clock(seconds) => {
                JUMPED.store(seconds, Ordering::SeqCst);
                None
            }
            Deed::Sleep(time) | Deed::Slow(time) => {
                std::thread::sleep(time);
                None
            }
            Deed::Fail(code) | Deed::Full(code) => Some(Verdict::Fail(code)),
            Deed::FailOn(code) => {
                FAILING.store(true, Ordering::SeqCst);
                Some(Verdict::Fail(code))
            }
        }
    }
}

/// Is a path of a form?
fn fits(form: &[u8], path: &[u8]) -> bool {
    match (form.split_first(), path.split_first()) {
        (None, None) => true,
        (Some((b'*', rest)), None) => fits(rest, path),
        (Some((b'*', rest)), Some((_, shorter))) => fits(rest, path) || fits(form, shorter),
        (Some((b'?', rest)), Some((_, shorter))) => fits(rest, shorter),
        (Some((letter, rest)), Some((first, shorter))) => letter == first && fits(rest, shorter),
        _ => false,
    }
}
