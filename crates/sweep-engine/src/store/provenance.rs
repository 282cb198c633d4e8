//! The facts that differ between runs of one plan: time, host and speed. They are stored beside the
//! result, not in it.

use std::fs;
use std::time::{SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};
use serde_json::json;

use super::plan_file::format_json;
use super::{Folder, Job, StoreError, Tally};
use sweep_files::regular;

/// The work of one process on a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Session {
    /// The start, in seconds since 1970 (UTC).
    pub started_unix_s: u64,
    /// The time from the start to the end of the work.
    pub wall_s: f64,
    /// The name of the host.
    pub host: String,
    /// The process id.
    pub pid: u32,
    /// The number of processors that the process may use.
    pub cpus: usize,
    /// The model of the processor, if the system reports it.
    pub cpu_model: Option<String>,
    /// The instruction set that the engine used.
    pub simd: String,
    /// The number of worker threads.
    pub threads: usize,
    /// The shard, as `I/N`; `None` for a whole run.
    pub shard: Option<String>,
    /// The number of computed points.
    pub points: u64,
    /// The number of computed points per second of `wall_s`.
    pub points_per_s: f64,
    /// The version of the program.
    pub version: String,
}

/// Returns the content of the sidecar: the counts of the result, this session, and the recorded
/// sessions of other processes. A killed process has no recorded session.
pub fn sidecar_content(
    folder: &Folder,
    job: &Job<'_>,
    tally: &Tally,
    session: Option<Session>,
) -> Result<Vec<u8>, StoreError> {
    let mut sessions = read_recorded_sessions(folder)?;
    sessions.extend(session);
    sessions.sort_by(|a, b| {
        (a.started_unix_s, &a.host, a.pid).cmp(&(b.started_unix_s, &b.host, b.pid))
    });
    let wall_s: f64 = sessions.iter().map(|session| session.wall_s).sum();
    let computed_points: u64 = sessions.iter().map(|session| session.points).sum();
    let mut sidecar = json!({
        "file": folder.output.file_name().unwrap_or_default().to_string_lossy(),
        "version": job.version,
        "numerics": job.numerics,
        "plan_hash": job.hash().to_hex().as_str(),
        "points": job.points,
        // The sum over the sessions, as if shards had run one after the other.
        "wall_s": wall_s,
        "points_per_s": if wall_s > 0.0 { computed_points as f64 / wall_s } else { 0.0 },
        "rows": tally,
        "sessions": sessions,
    });
    let last_session = json!(sessions.last());
    for key in ["host", "cpus", "cpu_model", "simd", "threads"] {
        sidecar[key] = last_session[key].clone();
    }
    Ok(format_json(&sidecar))
}

/// Reads the recorded sessions, without those that cannot be read.
fn read_recorded_sessions(folder: &Folder) -> Result<Vec<Session>, StoreError> {
    let mut sessions = Vec::new();
    for name in regular::file_names(&folder.path).map_err(StoreError::io("list", &folder.path))? {
        if name.to_str().is_some_and(is_session_name) {
            let text = regular::read_json(&folder.path.join(name)).unwrap_or_default();
            sessions.extend(serde_json::from_slice::<Session>(&text).ok());
        }
    }
    Ok(sessions)
}

/// Returns whether a name is that of a file that `OpenRun::record_session` writes.
pub(super) fn is_session_name(name: &str) -> bool {
    name.starts_with("session-") && name.ends_with(".json")
}

/// Returns the name of this host.
pub fn host_name() -> String {
    #[cfg(unix)]
    let name = rustix::system::uname().nodename().to_string_lossy().into_owned();
    #[cfg(not(unix))]
    let name = std::env::var("COMPUTERNAME").unwrap_or_default();
    if name.is_empty() { "unknown".into() } else { name }
}

/// Returns the model of the processor, if Linux reports it.
pub fn cpu_model() -> Option<String> {
    let text = fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}

/// Returns the seconds since 1970.
pub fn now_unix_s() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |duration| duration.as_secs())
}
