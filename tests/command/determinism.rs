//! A result file is a pure function of its input: the same bytes for any number of threads, on any
//! instruction set.

use std::fs;
use std::process::Command;

use crate::home::sweep_binary;

/// Three chunks of eight points, of trajectories long enough to differ where a bit did.
const GRID: &str = r#"
name = "determinism"
machine = "paper"

[spin]
profile = "triangular"
peak_rpm = 350.0
ramp_s = 0.6

[time]
end_s = 1.0
window_s = [0.4, 0.9]

[[axis]]
parameter = "unbalance_mass_kg"
range = { from = 0.05, to = 1.0, count = 3 }

[[axis]]
parameter = "damping_n_s_per_m"
range = { from = 60.0, to = 300.0, count = 8 }

[reliability]
ratio_limit = 2.0
channels = ["tub_front_y", "tub_front_z", "drum_front_y", "drum_front_z", "tub_yaw", "tub_pitch"]

[integrator]
"#;

/// Runs the grid and returns the result's bytes; `None` where this processor lacks the instruction
/// set.
fn bytes(integrator: &str, threads: u32, simd: &str) -> Option<Vec<u8>> {
    let home = tempfile::tempdir().expect("a temporary folder");
    let [grid, result] = ["grid.toml", "result.parquet"].map(|name| home.path().join(name));
    fs::write(&grid, format!("{GRID}{integrator}")).expect("the grid is written");
    let run = Command::new(sweep_binary())
        .args(["run", "--progress", "none", "--threads", &threads.to_string()])
        .arg(&grid)
        .arg("--out")
        .arg(&result)
        .env("SWEEP_SIMD", simd)
        .env_remove("SLURM_ARRAY_TASK_ID")
        .env_remove("JOB_COMPLETION_INDEX")
        .output()
        .expect("the command starts");
    let said = String::from_utf8_lossy(&run.stderr);
    if !run.status.success() && said.contains("expected one that this machine has") {
        eprintln!("this machine has no {simd}");
        return None;
    }
    assert!(run.status.success(), "{integrator}, {threads} threads, {simd}: {said}");
    Some(fs::read(result).expect("a finished run has an output"))
}

fn same_bytes(integrator: &str) {
    let one = bytes(integrator, 1, "scalar").expect("every machine runs scalars");
    for threads in [2, 4] {
        assert!(bytes(integrator, threads, "scalar").as_ref() == Some(&one), "{threads} threads");
    }
    for simd in ["avx2", "avx512", "neon"] {
        for threads in [1, 2, 4] {
            if let Some(other) = bytes(integrator, threads, simd) {
                assert!(other == one, "{simd} on {threads} threads");
            }
        }
    }
}

#[test]
fn same_bytes_for_1_2_and_4_threads_on_every_instruction_set_rk4() {
    same_bytes("method = \"rk4\"\nstep_s = 2e-4\n");
}

#[test]
fn same_bytes_for_1_2_and_4_threads_on_every_instruction_set_dopri5() {
    same_bytes("method = \"dopri5\"\nrtol = 1e-5\natol = 1e-8\n");
}

#[test]
fn same_bytes_for_1_2_and_4_threads_on_every_instruction_set_mass_scaled() {
    same_bytes("method = \"rk4-mass-scaled\"\naccuracy = 1e-3\n");
}
