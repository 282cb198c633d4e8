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
fn result_bytes(integrator: &str, threads: u32, simd: &str) -> Option<Vec<u8>> {
    let test_folder = tempfile::tempdir().expect("a temporary folder");
    let [grid_path, result_path] =
        ["grid.toml", "result.parquet"].map(|name| test_folder.path().join(name));
    fs::write(&grid_path, format!("{GRID}{integrator}")).expect("the grid is written");
    let run_output = Command::new(sweep_binary())
        .args(["run", "--progress", "none", "--threads", &threads.to_string()])
        .arg(&grid_path)
        .arg("--out")
        .arg(&result_path)
        .env("SWEEP_SIMD", simd)
        .env_remove("SLURM_ARRAY_TASK_ID")
        .env_remove("JOB_COMPLETION_INDEX")
        .output()
        .expect("the command starts");
    let messages = String::from_utf8_lossy(&run_output.stderr);
    if !run_output.status.success() && messages.contains("expected one that this machine has") {
        eprintln!("this machine has no {simd}");
        return None;
    }
    assert!(run_output.status.success(), "{integrator}, {threads} threads, {simd}: {messages}");
    Some(fs::read(result_path).expect("a finished run has an output"))
}

fn assert_same_bytes(integrator: &str) {
    let single_thread_bytes =
        result_bytes(integrator, 1, "scalar").expect("every machine runs scalars");
    for threads in [2, 4] {
        assert!(
            result_bytes(integrator, threads, "scalar").as_ref() == Some(&single_thread_bytes),
            "{threads} threads"
        );
    }
    for simd in ["avx2", "avx512", "neon"] {
        for threads in [1, 2, 4] {
            if let Some(other_bytes) = result_bytes(integrator, threads, simd) {
                assert!(other_bytes == single_thread_bytes, "{simd} on {threads} threads");
            }
        }
    }
}

#[test]
fn same_bytes_for_1_2_and_4_threads_on_every_instruction_set_rk4() {
    assert_same_bytes("method = \"rk4\"\nstep_s = 2e-4\n");
}

#[test]
fn same_bytes_for_1_2_and_4_threads_on_every_instruction_set_dopri5() {
    assert_same_bytes("method = \"dopri5\"\nrtol = 1e-5\natol = 1e-8\n");
}

#[test]
fn same_bytes_for_1_2_and_4_threads_on_every_instruction_set_mass_scaled() {
    assert_same_bytes("method = \"rk4-mass-scaled\"\naccuracy = 1e-3\n");
}

/// A generator of random numbers (Marsaglia's xorshift).
struct RandomNumbers(u64);

impl RandomNumbers {
    fn next_unit(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next_unit()
    }
}

/// Returns the number in an environment variable, or a default.
fn from_environment(name: &str, default: u64) -> u64 {
    std::env::var(name).map_or(default, |text| text.parse().expect("it is a number"))
}

/// Returns the text of a random machine's file. The bits of `element_bits`, from the lowest one,
/// add friction, stops, bushings, stiffening springs and a second unbalance.
fn random_machine_file(element_bits: u64, numbers: &mut RandomNumbers) -> String {
    let machine_template = include_str!("../../crates/sweep/tests/held/m_fine17.toml");
    let (machine_without_bushings, _) =
        machine_template.split_once("[[bushings]]").expect("the file's last element");
    let is_not_cubic = |line: &&str| !line.starts_with("cubic");
    let mut machine_text: String = machine_without_bushings
        .lines()
        .filter(is_not_cubic)
        .map(|line| format!("{line}\n"))
        .collect();
    let mut random_text = |low: f64, high: f64| format!("{}", numbers.between(low, high));
    if element_bits & 1 != 0 {
        let friction = format!("[[dampers]]\nfriction_n = {}", random_text(5.0, 60.0));
        machine_text = machine_text.replace("[[dampers]]", &friction);
    }
    if element_bits & 8 != 0 {
        let cubic = format!("[[springs]]\ncubic_n_per_m3 = {}", random_text(1e5, 3e6));
        machine_text = machine_text.replace("[[springs]]", &cubic);
    }
    if element_bits & 2 != 0 {
        for side in [1, -1] {
            let clearance = random_text(0.004, 0.02);
            let stiffness = random_text(1e4, 1e5);
            machine_text += &format!(
                "\n[[stops]]\ntub_m = [0.35, 0.0, {}]\ndirection = [0.0, 0.1, {side}]\n\
                 clearance_m = {clearance}\nstiffness_n_per_m = {stiffness}\n\
                 damping_n_s_per_m = {}\n",
                0.28 * f64::from(side),
                random_text(0.0, 300.0)
            );
        }
    }
    if element_bits & 4 != 0 {
        machine_text += &format!(
            "\n[[bushings]]\ntub_m = [0.45, 0.0, 0.0]\nstiffness_n_per_m = [0.0, {}, {}]\n\
             cubic_n_per_m3 = [0.0, 1e7, 5e6]\ndamping_n_s_per_m = [0.0, 10.0, 15.0]\n",
            random_text(500.0, 2e3),
            random_text(500.0, 2e3)
        );
    }
    if element_bits & 16 != 0 {
        machine_text += &format!(
            "\n[[further_unbalances]]\nmass_kg = {}\nx_m = {}\nradius_m = 0.18\n",
            random_text(0.05, 0.3),
            random_text(0.1, 0.3)
        );
    }
    machine_text
}

/// Returns the rows of a result as text, without the point's number.
fn exported_rows(folder: &std::path::Path, name: &str) -> Vec<String> {
    let command_output = Command::new(sweep_binary())
        .current_dir(folder)
        .args(["export", name, "rows.csv"])
        .output()
        .expect("the command starts");
    assert!(command_output.status.success(), "{}", String::from_utf8_lossy(&command_output.stderr));
    let csv_text = fs::read_to_string(folder.join("rows.csv")).expect("it was written");
    let lines = csv_text.lines().filter(|line| !line.starts_with('#'));
    let row_without_point = |line: &str| line.split_once(',').map(|(_, rest)| rest.to_owned());
    lines.filter_map(row_without_point).collect()
}

/// The bytes of random machines with random elements do not depend on the number of threads, and
/// rows do not depend on the other points and speeds of a run. SEED selects other machines, and
/// SECONDS sets the duration; from 60 s on, all commands and the slow metrics are tested.
#[test]
fn rows_of_random_machines_do_not_depend_on_other_points() {
    let time_since_epoch = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    let seed = from_environment("SEED", time_since_epoch.expect("it is after 1970").as_secs());
    let seconds = from_environment("SECONDS", 5);
    println!("SEED={seed} SECONDS={seconds}");
    let start_instant = std::time::Instant::now();
    let mut numbers = RandomNumbers(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
    let mut compared_count = 0;
    let is_thorough = seconds >= 60;
    while compared_count == 0 || start_instant.elapsed().as_secs() < seconds {
        let element_bits = (32.0 * numbers.next_unit()) as u64;
        let test_folder = tempfile::tempdir().expect("a temporary folder");
        fs::write(
            test_folder.path().join("m.toml"),
            random_machine_file(element_bits, &mut numbers),
        )
        .expect("it is written");
        let masses_kg: [f64; 3] = core::array::from_fn(|k| {
            let mass_from_kg = 0.2 + 0.2 * k as f64;
            numbers.between(mass_from_kg, mass_from_kg + 0.15)
        });
        let speeds_rpm: [f64; 3] = core::array::from_fn(|k| {
            let lowest_speed_rpm = if is_thorough { 230.0 } else { 80.0 };
            (lowest_speed_rpm + 15.0 * (k as f64 + numbers.next_unit())).round()
        });
        let mut metrics = vec!["cabinet_force", "clash_time", "static_sag", "damper_speed"];
        if element_bits & 2 != 0 {
            metrics.extend(["stop_force", "stop_contact"]);
        }
        if is_thorough {
            metrics.extend(["growth", "dwell"]);
        }
        // Only the slow metrics need this section.
        let stability_section = match is_thorough {
            true => format!("[stability]\nspeed_rpm = \"{}\"\n", speeds_rpm[1]),
            false => String::new(),
        };
        let grid_text = |masses_kg: &[f64]| {
            format!(
                "machine = \"m.toml\"\nmetrics = {metrics:?}\n[spin]\nprofile = \"ramp\"\n\
                 peak_rpm = 250.0\nramp_s = 2.0\n[time]\nend_s = 2.5\nwindow_s = [1.0, 2.5]\n\
                 {stability_section}[[axis]]\nparameter = \"unbalance_mass_kg\"\n\
                 values = {masses_kg:?}\n"
            )
        };
        fs::write(test_folder.path().join("all.toml"), grid_text(&masses_kg))
            .expect("it is written");
        let outer_masses_kg = [masses_kg[0], masses_kg[2]];
        fs::write(test_folder.path().join("few.toml"), grid_text(&outer_masses_kg))
            .expect("it is written");
        let damping_axis =
            "[[axis]]\nparameter = \"damping_n_s_per_m\"\nvalues = [40.0, 150.0, 260.0]\n";
        let plane_grid = grid_text(&masses_kg)
            .replace(&format!("metrics = {metrics:?}\n"), "")
            .replace(&stability_section, "");
        let plane_grid = plane_grid + damping_axis;
        fs::write(test_folder.path().join("plane.toml"), plane_grid).expect("it is written");
        let three_speeds = speeds_rpm.map(|speed| speed.to_string()).join(",");
        let middle_speed = speeds_rpm[1].to_string();
        let search_options = ["--starts", "1", "--longest", "2"];
        // Each command runs with all points. Commands that have rows also run with a part of the
        // points and speeds.
        let commands_with_arguments: [(&str, Vec<&str>, Vec<&str>); 4] = [
            ("run", vec!["all.toml"], vec!["few.toml"]),
            (
                "stability",
                vec!["all.toml", "--speed", &three_speeds],
                vec!["few.toml", "--speed", &middle_speed],
            ),
            (
                "dwell",
                [&["all.toml", "--speed", three_speeds.as_str()][..], &search_options].concat(),
                [&["few.toml", "--speed", middle_speed.as_str()][..], &search_options].concat(),
            ),
            ("boundary", vec!["plane.toml"], Vec::new()),
        ];
        let first_command_index = (4.0 * numbers.next_unit()) as usize;
        for k in 0..commands_with_arguments.len() {
            if compared_count > 0 && start_instant.elapsed().as_secs() >= seconds {
                break;
            }
            let (verb, all_points_arguments, few_points_arguments) =
                &commands_with_arguments[(first_command_index + k) % commands_with_arguments.len()];
            let result_of_command = |options: &[&str], threads: &str, name: &str| {
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
                    "{verb} {options:?} of {element_bits:05b}: {messages}"
                );
                fs::read(test_folder.path().join(out)).expect("it was written")
            };
            let single_thread_bytes = result_of_command(all_points_arguments, "1", "one");
            for threads in ["2", "5"] {
                let other_bytes = result_of_command(all_points_arguments, threads, "other");
                assert!(
                    other_bytes == single_thread_bytes,
                    "{verb} of {element_bits:05b} on {threads} threads, SEED={seed}"
                );
            }
            if few_points_arguments.is_empty() {
                compared_count += 1;
                continue;
            }
            result_of_command(few_points_arguments, "2", "alone");
            let [all_rows, few_rows] = ["one", "alone"]
                .map(|name| exported_rows(test_folder.path(), &format!("{verb}-{name}.parquet")));
            assert!(few_rows.len() > 1, "{verb} has rows");
            for row in &few_rows {
                assert!(
                    all_rows.contains(row),
                    "{verb} of {element_bits:05b} beside others, SEED={seed}: {row}"
                );
            }
            compared_count += few_rows.len() - 1;
        }
    }
    println!(
        "{compared_count} rows are the same in {:.0} s",
        start_instant.elapsed().as_secs_f64()
    );
}
