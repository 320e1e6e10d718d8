//! Slurm on this machine alone: munged, slurmctld and slurmd on loopback, with ports and files of their own. They are
//! stopped when the cluster is dropped, and by the kernel should the test be killed.

use std::fs;
use std::net::TcpListener;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use tests::trial::appears;
use tests::{Output, TIME_LIMIT, WorkFolder, run_within};

/// A cluster of one node with 4 processors, and two partitions: `high` preempts `low`.
#[derive(Debug)]
pub struct Cluster {
    work: WorkFolder,
    daemons: Vec<Child>,
}

/// Where a daemon may lie; a user's path has not always these.
const FOLDERS: [&str; 4] = ["/usr/sbin", "/usr/local/sbin", "/usr/bin", "/usr/local/bin"];

fn find(name: &str) -> Option<PathBuf> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let folders = std::env::split_paths(&path).chain(FOLDERS.map(PathBuf::from));
    folders.map(|folder| folder.join(name)).find(|path| path.is_file())
}

/// A port that nobody listens on now.
fn free_port() -> u16 {
    TcpListener::bind("127.0.0.1:0").and_then(|listener| listener.local_addr()).expect("a free port").port()
}

fn settings(folder: &Path, host: &str) -> String {
    let (folder, controller, node) = (folder.display(), free_port(), free_port());
    format!(
        "ClusterName=talus
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={controller}
SlurmdPort={node}
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
CredType=cred/munge
AuthInfo=socket={folder}/munge.sock
CommunicationParameters=NoCtldInAddrAny,NoInAddrAny
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
SwitchType=switch/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SchedulerType=sched/backfill
SchedulerParameters=batch_sched_delay=0,sched_interval=2,bf_interval=2,sched_min_interval=0
PreemptType=preempt/partition_prio
PreemptMode=REQUEUE
JobRequeue=1
RequeueExit=75
KillWait=15
SlurmctldParameters=preempt_send_user_signal
SlurmdParameters=config_overrides
ReturnToService=2
NodeName={host} NodeAddr=127.0.0.1 CPUs=4 RealMemory=1000
PartitionName=low Nodes={host} Default=YES PriorityTier=1 PreemptMode=REQUEUE GraceTime=20 MaxTime=60 State=UP
PartitionName=high Nodes={host} PriorityTier=10 PreemptMode=OFF MaxTime=60 State=UP
"
    )
}

fn is_root() -> bool {
    use std::os::unix::fs::MetadataExt;
    fs::metadata("/proc/self").is_ok_and(|own| own.uid() == 0)
}

impl Cluster {
    /// Starts one; none, with the reason said, where Slurm is not installed.
    pub fn start() -> Option<Self> {
        let needed = ["munged", "slurmctld", "slurmd", "sbatch", "scontrol", "squeue", "scancel", "sinfo", "setpriv"];
        if let Some(missing) = needed.into_iter().find(|name| find(name).is_none()) {
            tests::left_out(&format!(
                "Slurm is not installed: there is no {missing} (Debian: slurmctld slurmd slurm-client munge)"
            ));
            return None;
        }
        if !is_root() {
            tests::left_out("a Slurm of one's own needs root: its daemons start jobs as other users");
            return None;
        }
        let work = WorkFolder::new();
        let host = fs::read_to_string("/proc/sys/kernel/hostname").expect("a host name");
        let host = host.trim().split('.').next().expect("a first part").to_owned();
        fs::set_permissions(work.path(), fs::Permissions::from_mode(0o755)).unwrap();
        for folder in ["state", "spool"] {
            fs::create_dir(work.join(folder)).unwrap();
        }
        work.write("slurm.conf", &settings(work.path(), &host));
        // Any bytes do; two processes on this machine share them.
        let key: Vec<u8> = (0..16).flat_map(|_| fs::read("/proc/sys/kernel/random/uuid").unwrap()).collect();
        fs::write(work.join("munge.key"), key).unwrap();
        fs::set_permissions(work.join("munge.key"), fs::Permissions::from_mode(0o600)).unwrap();
        let mut cluster = Self { work, daemons: Vec::new() };
        let place = |name: &str| cluster.work.join(name).display().to_string();
        let conf = place("slurm.conf");
        let munge = [
            "--foreground".to_owned(),
            "--force".to_owned(),
            format!("--key-file={}", place("munge.key")),
            format!("--socket={}", place("munge.sock")),
            format!("--pid-file={}", place("munged.pid")),
            format!("--log-file={}", place("munged.log")),
            format!("--seed-file={}", place("munged.seed")),
        ];
        cluster.daemon("munged", &munge);
        let socket = cluster.work.join("munge.sock");
        assert!(appears(Duration::from_secs(10), || socket.exists()), "munged does not start: {}", cluster.logs());
        cluster.daemon("slurmctld", &["-D", "-c", "-f", &conf].map(str::to_owned));
        cluster.daemon("slurmd", &["-D", "-c", "-f", &conf, "-N", &host].map(str::to_owned));
        let idle = || cluster.ask("sinfo", &["--noheader", "--format=%t"]).stdout.contains("idle");
        let up = appears(Duration::from_secs(20), || {
            std::thread::sleep(Duration::from_millis(50));
            idle()
        });
        assert!(up, "Slurm does not start: {}", cluster.logs());
        Some(cluster)
    }

    /// Puts into a command what it needs to reach this cluster.
    pub fn reach(&self, command: &mut Command) {
        command.env("SLURM_CONF", self.work.join("slurm.conf"));
        for (name, _) in std::env::vars_os() {
            let text = name.to_string_lossy();
            if (text.starts_with("SLURM_") && text != "SLURM_CONF") || text.starts_with("SBATCH_") {
                command.env_remove(name);
            }
        }
    }

    /// Asks one of Slurm's programs.
    pub fn ask(&self, program: &str, words: &[&str]) -> Output {
        let mut command = Command::new(find(program).expect("looked for at the start"));
        command.args(words);
        self.reach(&mut command);
        run_within(TIME_LIMIT, &mut command)
    }

    /// What `scontrol show job` says of a key; empty where it says nothing.
    pub fn job(&self, job: &str, key: &str) -> String {
        let said = self.ask("scontrol", &["show", "job", job]).stdout;
        let value = said.split_whitespace().find_map(|word| word.strip_prefix(key)?.strip_prefix('='));
        value.unwrap_or_default().to_owned()
    }

    /// Waits until a key of a job has a value that will do, and returns it.
    #[track_caller]
    pub fn wait_for(&self, job: &str, key: &str, good: impl Fn(&str) -> bool) -> String {
        let deadline = Instant::now() + Duration::from_secs(60);
        loop {
            let value = self.job(job, key);
            if good(&value) {
                return value;
            }
            let said = || self.ask("scontrol", &["show", "job", job]).stdout;
            assert!(Instant::now() < deadline, "{key} of job {job} stays {value}: {}\n{}", said(), self.logs());
            std::thread::sleep(Duration::from_millis(100));
        }
    }

    /// Ends of the daemons' logs.
    pub fn logs(&self) -> String {
        let end = |name: &str| {
            let text = fs::read_to_string(self.work.join(name)).unwrap_or_default();
            let lines: Vec<_> = text.lines().rev().take(20).collect();
            format!("--- {name}\n{}\n", lines.into_iter().rev().collect::<Vec<_>>().join("\n"))
        };
        ["munged.log", "slurmctld.log", "slurmd.log"].map(end).concat()
    }

    fn daemon(&mut self, name: &str, words: &[String]) {
        let mut command = Command::new(find("setpriv").expect("looked for at the start"));
        command.args(["--pdeathsig", "KILL", "--"]).arg(find(name).expect("looked for at the start")).args(words);
        self.reach(&mut command);
        command.current_dir(self.work.path()).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        self.daemons.push(command.spawn().unwrap_or_else(|e| panic!("cannot start {name}: {e}")));
    }
}

impl Drop for Cluster {
    fn drop(&mut self) {
        // Jobs first, or their processes stay behind.
        let jobs = self.ask("squeue", &["--noheader", "--format=%A"]).stdout;
        for job in jobs.split_whitespace() {
            self.ask("scancel", &["--full", "--signal=KILL", job]);
            self.ask("scancel", &[job]);
        }
        appears(Duration::from_secs(20), || {
            std::thread::sleep(Duration::from_millis(100));
            self.ask("squeue", &["--noheader", "--format=%A"]).stdout.trim().is_empty()
        });
        for daemon in self.daemons.iter_mut().rev() {
            let _ = Command::new("kill").args(["-s", "TERM", &daemon.id().to_string()]).status();
            let over = Instant::now() + Duration::from_secs(5);
            while matches!(daemon.try_wait(), Ok(None)) && Instant::now() < over {
                std::thread::sleep(Duration::from_millis(20));
            }
            let _ = daemon.kill();
            let _ = daemon.wait();
        }
    }
}
