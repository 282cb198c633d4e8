//! What varies between runs of one plan: when, where, how fast. It is kept beside the result, not
//! in it.

use std::fs;
use std::time::{SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};
use serde_json::json;

use super::plan_file::pretty;
use super::{Folder, Job, StoreError, Tally};
use sweep_files::regular;

/// How one process worked on a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Session {
    /// Start, seconds since 1970 (UTC).
    pub started_unix_s: u64,
    /// From start to end of this process's work.
    pub wall_s: f64,
    /// Machine.
    pub host: String,
    /// Process id.
    pub pid: u32,
    /// Processors the process may use.
    pub cpus: usize,
    /// Processor model, where the system reports it.
    pub cpu_model: Option<String>,
    /// Instruction set the engine used.
    pub simd: String,
    /// Worker threads.
    pub threads: usize,
    /// Part of the run, as `I/N`; absent for a whole run.
    pub shard: Option<String>,
    /// Points computed.
    pub points: u64,
    /// Those, over `wall_s`.
    pub points_per_s: f64,
    /// Version of the program.
    pub version: String,
}

/// The sidecar: this session and those that were recorded before. Killed sessions left no record.
pub fn sidecar(
    folder: &Folder,
    job: &Job<'_>,
    tally: &Tally,
    session: Option<Session>,
) -> Result<Vec<u8>, StoreError> {
    let mut sessions = recorded(folder)?;
    sessions.extend(session);
    sessions.sort_by(|a, b| {
        (a.started_unix_s, &a.host, a.pid).cmp(&(b.started_unix_s, &b.host, b.pid))
    });
    let wall_s: f64 = sessions.iter().map(|session| session.wall_s).sum();
    let computed: u64 = sessions.iter().map(|session| session.points).sum();
    let mut sidecar = json!({
        "file": folder.output.file_name().unwrap_or_default().to_string_lossy(),
        "version": job.version,
        "numerics": job.numerics,
        "plan_hash": job.hash().to_hex().as_str(),
        "points": job.points,
        // Sum over the sessions, so shards count as if one after the other.
        "wall_s": wall_s,
        "points_per_s": if wall_s > 0.0 { computed as f64 / wall_s } else { 0.0 },
        "rows": tally,
        "sessions": sessions,
    });
    let last = json!(sessions.last());
    for key in ["host", "cpus", "cpu_model", "simd", "threads"] {
        sidecar[key] = last[key].clone();
    }
    Ok(pretty(&sidecar))
}

/// Sessions on record; one that cannot be read is left out.
fn recorded(folder: &Folder) -> Result<Vec<Session>, StoreError> {
    let mut sessions = Vec::new();
    for name in regular::names(&folder.path).map_err(StoreError::io("list", &folder.path))? {
        if name.to_str().is_some_and(is_session) {
            let text = regular::read_json(&folder.path.join(name)).unwrap_or_default();
            sessions.extend(serde_json::from_slice::<Session>(&text).ok());
        }
    }
    Ok(sessions)
}

/// Returns whether `OpenRun::record` writes files of this name.
pub(super) fn is_session(name: &str) -> bool {
    name.starts_with("session-") && name.ends_with(".json")
}

/// This machine's name.
pub fn host() -> String {
    #[cfg(unix)]
    let name = rustix::system::uname().nodename().to_string_lossy().into_owned();
    #[cfg(not(unix))]
    let name = std::env::var("COMPUTERNAME").unwrap_or_default();
    if name.is_empty() { "unknown".into() } else { name }
}

/// The processor's model, where Linux reports it.
pub fn cpu_model() -> Option<String> {
    let text = fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}

/// Seconds since 1970.
pub fn now_unix_s() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs())
}
