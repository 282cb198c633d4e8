//! The estimate of a run's time and memory, as `check` shows it.

use crate::store::read::NameCounts;

/// The estimated time, memory and disk space of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// The instruction set.
    pub simd: String,
    /// The number of worker threads.
    pub threads: usize,
    /// The time from start to end, if each thread has a core for itself.
    pub wall_s: f64,
    /// The time of one core for one point.
    pub core_s_per_point: f64,
    /// The numbers of points that were integrated for the estimate, by status.
    pub sampled: NameCounts,
    /// The time up to which they were integrated; at most the plan's `end_s`.
    pub sampled_s: f64,
    /// The peak memory.
    pub memory_bytes: f64,
    /// The disk space of the run's folder.
    pub disk_bytes: f64,
    /// An upper bound of the disk space of the result.
    pub result_bytes: f64,
    /// The steps of the method, in words.
    pub method: String,
}

/// Formats a size with three digits.
pub fn size(bytes: f64) -> String {
    /// The units, each 1000 times the one before.
    const UNITS: [&str; 5] = ["bytes", "kB", "MB", "GB", "TB"];
    let mut scaled = bytes;
    let mut unit = 0;
    while scaled >= 999.5 && unit + 1 < UNITS.len() {
        scaled /= 1e3;
        unit += 1;
    }
    let digits = if unit == 0 || scaled >= 99.95 { 0 } else { 1 };
    format!("{scaled:.digits$} {}", UNITS[unit])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_have_readable_units() {
        let formatted = [0.0, 999.0, 1234.0, 56.7e6, 999.96e6, 2e9, 3e15].map(size);
        assert_eq!(
            formatted,
            ["0 bytes", "999 bytes", "1.2 kB", "56.7 MB", "1.0 GB", "2.0 GB", "3000 TB"]
        );
    }
}
