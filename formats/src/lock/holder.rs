//! Who holds a lock, and whether it still runs.

use crate::provenance::{host, now, sha256};
use serde::{Deserialize, Serialize};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, SystemTime};
use std::{fmt, fs, process};

/// Who holds a lock.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Holder {
    /// Name of the machine.
    pub host: String,
    /// Number of its start (boot), so that a process number of an earlier one is not mistaken.
    pub boot: String,
    /// Where its process numbers hold: containers have numbers of their own.
    #[serde(default)]
    pub namespace: String,
    /// Process number.
    pub pid: u32,
    /// When the process started, in clock ticks since the machine's start.
    pub started: u64,
    /// When the lock was taken: UTC, RFC 3339.
    pub since: String,
    /// The batch job it belongs to. For people only: a job that was put back into the queue because its node no longer
    /// answered may still run there, so the same job is no proof that the earlier attempt has ended.
    #[serde(default)]
    pub job: Option<String>,
    /// Time between two beats; 0: it gives none.
    #[serde(default)]
    pub beat_milliseconds: u64,
    /// What tells this lock from any other.
    #[serde(default)]
    pub token: String,
}

impl Holder {
    /// This process, now.
    pub(super) fn this(job: Option<String>, beat: Duration) -> Self {
        let pid = process::id();
        Self {
            host: host(),
            boot: boot(),
            namespace: namespace(),
            pid,
            started: started(pid).unwrap_or(0),
            since: now(),
            job,
            beat_milliseconds: u64::try_from(beat.as_millis()).unwrap_or(u64::MAX).max(1),
            token: token(),
        }
    }

    /// Does it still run? `None`: on another machine, before a restart of this one, or in another container, which can't
    /// be asked from here.
    pub fn runs(&self) -> Option<bool> {
        let here =
            self.host == host() && self.boot == boot() && (self.namespace.is_empty() || self.namespace == namespace());
        here.then(|| started(self.pid) == Some(self.started))
    }
}

impl fmt::Display for Holder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "process {} on {}", self.pid, self.host)?;
        self.job.as_ref().map_or(Ok(()), |job| write!(f, " ({job})"))
    }
}

/// The machine's start.
fn boot() -> String {
    fs::read_to_string("/proc/sys/kernel/random/boot_id").unwrap_or_default().trim().into()
}

fn namespace() -> String {
    fs::read_link("/proc/self/ns/pid").map(|link| link.display().to_string()).unwrap_or_default()
}

/// When a process started, in clock ticks since the machine's start; `None` if there is no such process, or it has
/// ended and only waits to be collected.
fn started(pid: u32) -> Option<u64> {
    let text = fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    // The second field, the program's name, is in brackets and may hold anything; the third is the state.
    let mut fields = text[text.rfind(')')? + 1..].split_whitespace();
    if matches!(fields.next()?, "Z" | "X") {
        return None;
    }
    fields.nth(18)?.parse().ok()
}

/// 16 hexadecimal digits that no other lock has.
fn token() -> String {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let random = fs::read_to_string("/proc/sys/kernel/random/uuid").unwrap_or_default();
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    let seed = format!("{random} {} {} {count} {:?}", host(), process::id(), SystemTime::now());
    sha256(seed.as_bytes())[..16].to_owned()
}
