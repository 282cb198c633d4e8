//! What a run will take, as `check` tells it.

use crate::store::read::NameCounts;

/// What a run will take. Every number is an estimate.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// Instruction set.
    pub simd: String,
    /// Worker threads.
    pub threads: usize,
    /// Time from start to end, if the threads have a core each to themselves.
    pub wall_s: f64,
    /// Time of one core for one point.
    pub core_s_per_point: f64,
    /// Points that were integrated for it, by status.
    pub sampled: NameCounts,
    /// How far, of the plan's `end_s`.
    pub sampled_s: f64,
    /// Memory at its peak.
    pub memory_bytes: f64,
    /// Disk for the run's folder.
    pub disk_bytes: f64,
    /// Disk for the result, at most.
    pub result_bytes: f64,
    /// How the method goes about it, in words.
    pub method: String,
}

/// A size with three digits.
pub fn size(bytes: f64) -> String {
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
    fn sizes_read_as_people_say_them() {
        let said = [0.0, 999.0, 1234.0, 56.7e6, 999.96e6, 2e9, 3e15].map(size);
        assert_eq!(
            said,
            ["0 bytes", "999 bytes", "1.2 kB", "56.7 MB", "1.0 GB", "2.0 GB", "3000 TB"]
        );
    }
}
