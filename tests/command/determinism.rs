//! Tests that the bytes of a result depend on the input alone, not on the number of threads nor on
//! the instruction set.

use std::fs;
use std::process::Command;

use crate::test_folder::sweep_binary;

/// A grid of three chunks of eight points. The trajectories are so long that a wrong bit shows.
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

/// Runs the grid and returns the bytes of the result; `None` if this processor lacks the
/// instruction set.
fn bytes(integrator: &str, threads: u32, simd: &str) -> Option<Vec<u8>> {
    let test_folder = tempfile::tempdir().expect("a temporary folder");
    let [grid, result] = ["grid.toml", "result.parquet"].map(|name| test_folder.path().join(name));
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
    let messages = String::from_utf8_lossy(&run.stderr);
    if !run.status.success() && messages.contains("expected one that this machine has") {
        eprintln!("this machine has no {simd}");
        return None;
    }
    assert!(run.status.success(), "{integrator}, {threads} threads, {simd}: {messages}");
    Some(fs::read(result).expect("a finished run has an output"))
}

fn same_bytes(integrator: &str) {
    let single_thread_bytes = bytes(integrator, 1, "scalar").expect("every machine runs scalars");
    for threads in [2, 4] {
        assert!(
            bytes(integrator, threads, "scalar").as_ref() == Some(&single_thread_bytes),
            "{threads} threads"
        );
    }
    for simd in ["avx2", "avx512", "neon"] {
        for threads in [1, 2, 4] {
            if let Some(other) = bytes(integrator, threads, simd) {
                assert!(other == single_thread_bytes, "{simd} on {threads} threads");
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

/// A generator of random numbers (Marsaglia's xorshift).
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }
}

/// Returns the number in an environment variable, or a default.
fn from_environment(name: &str, default: u64) -> u64 {
    std::env::var(name).map_or(default, |text| text.parse().expect("it is a number"))
}

/// Returns a random machine's file, with the elements of `kinds`' bits: friction, stops, bushings,
/// stiffening springs, a second unbalance.
fn machine(kinds: u64, numbers: &mut Numbers) -> String {
    let template = include_str!("../../crates/sweep/tests/held/m_fine17.toml");
    let (bare, _) = template.split_once("[[bushings]]").expect("the file's last element");
    let is_kept = |line: &&str| !line.starts_with("cubic");
    let mut text: String = bare.lines().filter(is_kept).map(|line| format!("{line}\n")).collect();
    let mut number = |low: f64, high: f64| format!("{}", numbers.between(low, high));
    if kinds & 1 != 0 {
        let friction = format!("[[dampers]]\nfriction_n = {}", number(5.0, 60.0));
        text = text.replace("[[dampers]]", &friction);
    }
    if kinds & 8 != 0 {
        let cubic = format!("[[springs]]\ncubic_n_per_m3 = {}", number(1e5, 3e6));
        text = text.replace("[[springs]]", &cubic);
    }
    if kinds & 2 != 0 {
        for side in [1, -1] {
            let clearance = number(0.004, 0.02);
            let stiffness = number(1e4, 1e5);
            text += &format!(
                "\n[[stops]]\ntub_m = [0.35, 0.0, {}]\ndirection = [0.0, 0.1, {side}]\n\
                 clearance_m = {clearance}\nstiffness_n_per_m = {stiffness}\n\
                 damping_n_s_per_m = {}\n",
                0.28 * f64::from(side),
                number(0.0, 300.0)
            );
        }
    }
    if kinds & 4 != 0 {
        text += &format!(
            "\n[[bushings]]\ntub_m = [0.45, 0.0, 0.0]\nstiffness_n_per_m = [0.0, {}, {}]\n\
             cubic_n_per_m3 = [0.0, 1e7, 5e6]\ndamping_n_s_per_m = [0.0, 10.0, 15.0]\n",
            number(500.0, 2e3),
            number(500.0, 2e3)
        );
    }
    if kinds & 16 != 0 {
        text += &format!(
            "\n[[further_unbalances]]\nmass_kg = {}\nx_m = {}\nradius_m = 0.18\n",
            number(0.05, 0.3),
            number(0.1, 0.3)
        );
    }
    text
}

/// Returns the rows of a result as text, without the point's number.
fn rows(folder: &std::path::Path, name: &str) -> Vec<String> {
    let command_output = Command::new(sweep_binary())
        .current_dir(folder)
        .args(["export", name, "rows.csv"])
        .output()
        .expect("the command starts");
    assert!(command_output.status.success(), "{}", String::from_utf8_lossy(&command_output.stderr));
    let text = fs::read_to_string(folder.join("rows.csv")).expect("it was written");
    let lines = text.lines().filter(|line| !line.starts_with('#'));
    let without_point = |line: &str| line.split_once(',').map(|(_, rest)| rest.to_owned());
    lines.filter_map(without_point).collect()
}

/// The bytes of random machines with random elements do not depend on the number of threads, and
/// rows do not depend on the other points and speeds of a run. SEED selects other machines, and
/// SECONDS sets the duration; from 60 s on, all commands and the slow metrics are tested.
#[test]
fn rows_of_random_machines_do_not_depend_on_other_points() {
    let clock = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    let seed = from_environment("SEED", clock.expect("it is after 1970").as_secs());
    let seconds = from_environment("SECONDS", 5);
    println!("SEED={seed} SECONDS={seconds}");
    let begin = std::time::Instant::now();
    let mut numbers = Numbers(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
    let mut compared = 0;
    let is_thorough = seconds >= 60;
    while compared == 0 || begin.elapsed().as_secs() < seconds {
        let kinds = (32.0 * numbers.next()) as u64;
        let test_folder = tempfile::tempdir().expect("a temporary folder");
        fs::write(test_folder.path().join("m.toml"), machine(kinds, &mut numbers))
            .expect("it is written");
        let masses: [f64; 3] = core::array::from_fn(|k| {
            let third = 0.2 + 0.2 * k as f64;
            numbers.between(third, third + 0.15)
        });
        let speeds: [f64; 3] = core::array::from_fn(|k| {
            let fast = if is_thorough { 230.0 } else { 80.0 };
            (fast + 15.0 * (k as f64 + numbers.next())).round()
        });
        let mut metrics = vec!["cabinet_force", "clash_time", "static_sag", "damper_speed"];
        if kinds & 2 != 0 {
            metrics.extend(["stop_force", "stop_contact"]);
        }
        if is_thorough {
            metrics.extend(["growth", "dwell"]);
        }
        // Only the slow metrics need this section.
        let stability = match is_thorough {
            true => format!("[stability]\nspeed_rpm = \"{}\"\n", speeds[1]),
            false => String::new(),
        };
        let grid = |masses: &[f64]| {
            format!(
                "machine = \"m.toml\"\nmetrics = {metrics:?}\n[spin]\nprofile = \"ramp\"\n\
                 peak_rpm = 250.0\nramp_s = 2.0\n[time]\nend_s = 2.5\nwindow_s = [1.0, 2.5]\n\
                 {stability}[[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = {masses:?}\n"
            )
        };
        fs::write(test_folder.path().join("all.toml"), grid(&masses)).expect("it is written");
        let few = [masses[0], masses[2]];
        fs::write(test_folder.path().join("few.toml"), grid(&few)).expect("it is written");
        let second = "[[axis]]\nparameter = \"damping_n_s_per_m\"\nvalues = [40.0, 150.0, 260.0]\n";
        let plane =
            grid(&masses).replace(&format!("metrics = {metrics:?}\n"), "").replace(&stability, "");
        let plane = plane + second;
        fs::write(test_folder.path().join("plane.toml"), plane).expect("it is written");
        let three = speeds.map(|speed| speed.to_string()).join(",");
        let single_thread_bytes = speeds[1].to_string();
        let search = ["--starts", "1", "--longest", "2"];
        // Each command runs with other points; commands with rows of points and speeds also run
        // with a single point.
        let commands: [(&str, Vec<&str>, Vec<&str>); 4] = [
            ("run", vec!["all.toml"], vec!["few.toml"]),
            (
                "stability",
                vec!["all.toml", "--speed", &three],
                vec!["few.toml", "--speed", &single_thread_bytes],
            ),
            (
                "dwell",
                [&["all.toml", "--speed", three.as_str()][..], &search].concat(),
                [&["few.toml", "--speed", single_thread_bytes.as_str()][..], &search].concat(),
            ),
            ("boundary", vec!["plane.toml"], Vec::new()),
        ];
        let first = (4.0 * numbers.next()) as usize;
        for k in 0..commands.len() {
            if compared > 0 && begin.elapsed().as_secs() >= seconds {
                break;
            }
            let (verb, together, alone) = &commands[(first + k) % commands.len()];
            let make = |options: &[&str], threads: &str, name: &str| {
                let out = &format!("{verb}-{name}.parquet");
                let command_output = Command::new(sweep_binary())
                    .current_dir(test_folder.path())
                    .arg(verb)
                    .args(options)
                    .args(["--fresh", "--progress", "none", "--threads", threads, "--out", out])
                    .env_remove("SLURM_ARRAY_TASK_ID")
                    .env_remove("JOB_COMPLETION_INDEX")
                    .output()
                    .expect("the command starts");
                let messages = String::from_utf8_lossy(&command_output.stderr);
                assert!(
                    command_output.status.success(),
                    "{verb} {options:?} of {kinds:05b}: {messages}"
                );
                fs::read(test_folder.path().join(out)).expect("it was written")
            };
            let whole = make(together, "1", "one");
            for threads in ["2", "5"] {
                let other = make(together, threads, "other");
                assert!(other == whole, "{verb} of {kinds:05b} on {threads} threads, SEED={seed}");
            }
            if alone.is_empty() {
                compared += 1;
                continue;
            }
            make(alone, "2", "alone");
            let [all, alone] = ["one", "alone"]
                .map(|name| rows(test_folder.path(), &format!("{verb}-{name}.parquet")));
            assert!(alone.len() > 1, "{verb} has rows");
            for row in &alone {
                assert!(
                    all.contains(row),
                    "{verb} of {kinds:05b} beside others, SEED={seed}: {row}"
                );
            }
            compared += alone.len() - 1;
        }
    }
    println!("{compared} rows are the same in {:.0} s", begin.elapsed().as_secs_f64());
}
