//! Test of the bytes of results by every method and command against recorded hashes, which change
//! only together with the version of the numerics.
//!
//! `scripts/release/raise_numerics.sh` raises that version and writes the new hashes. Beside them,
//! `tests/goldens.csv` has the numbers of some maps, so that a diff shows what a change has moved.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::test_folder::sweep_binary;
use serde_json::{Value, json};
use sweep::{NUMERICS_VERSION, VERSION};
use tempfile::TempDir;

/// The spin and the window of every golden: a run-up that is short, but passes the lowest
/// resonances.
const SPIN_AND_WINDOW: &str = "machine = \"paper\"\n\
    spin = { profile = \"triangular\", peak_rpm = 350.0, ramp_s = 0.6 }\n\
    time = { end_s = 1.0, window_s = [0.4, 0.9] }\n";

/// The axes of a map: three masses by three dampings.
const MAP_AXES: &str = "[[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [0.1, 0.4, 0.9]\n\
    [[axis]]\nparameter = \"damping_n_s_per_m\"\nrange = { from = 60.0, to = 300.0, count = 3 }\n";

/// The ranges of both parameters, for designs.
const RANGES: &str = "[[axis]]\nparameter = \"unbalance_mass_kg\"\n\
    range = { from = 0.1, to = 0.9 }\n\
    [[axis]]\nparameter = \"damping_n_s_per_m\"\nrange = { from = 60.0, to = 300.0 }\n";

/// The `integrator` line of all goldens except those that compare methods.
const RK4_SECTION: &str = "integrator = { method = \"rk4\", step_s = 2e-4 }\n";

/// The line of a grid that adds metrics, which are further columns of a map.
const METRICS_LINE: &str = "metrics = [\"cabinet_force\", \"clash_time\", \"static_sag\"]\n";

/// The names of the maps whose numbers are in the readable record, one for each kind of method.
const TABULATED_MAPS: [&str; 3] = ["map by rk4", "map by additive", "map by rk4-mass-scaled"];

/// The greatest relative difference of a frequency from the record. Basis: the rounding of linear
/// algebra depends on the processor. Doubling it would find the same faults.
const MAX_RELATIVE_MODE_DIFFERENCE: f64 = 1e-9;

/// Returns the path of the record of hashes and modes.
fn record_path() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/goldens.json")
}

/// Runs a command in `test_folder` and returns what it prints.
fn run_sweep(test_folder: &TempDir, words: &[&str]) -> Vec<u8> {
    let command_output = Command::new(sweep_binary())
        .args(words)
        .current_dir(test_folder.path())
        .env_remove("SLURM_ARRAY_TASK_ID")
        .env_remove("SLURM_CPUS_PER_TASK")
        .env_remove("JOB_COMPLETION_INDEX")
        .output()
        .expect("the command starts");
    assert!(
        command_output.status.success(),
        "{words:?}: {}",
        String::from_utf8_lossy(&command_output.stderr)
    );
    command_output.stdout
}

/// Returns the path of the readable record, a table of numbers.
fn readable_record_path() -> PathBuf {
    record_path().with_extension("csv")
}

/// A file that a command has written for a grid: its folder and its hash.
struct Golden {
    test_folder: TempDir,
    hash_hex: String,
}

/// Runs a command for a grid and returns the file that it has written.
fn compute_golden(grid: &str, command: &[&str]) -> Golden {
    let test_folder = tempfile::tempdir().expect("a temporary folder");
    fs::write(test_folder.path().join("grid.toml"), grid).expect("the grid is written");
    let list_text = "unbalance_mass_kg,damping_n_s_per_m\n0.1,80\n0.7,211.5\n0.33,120\n";
    fs::write(test_folder.path().join("list.csv"), list_text).expect("the list is written");
    let (verb, options) = command.split_first().expect("a command has a name");
    run_sweep(&test_folder, &[&[*verb, "grid.toml", "--out", "out.parquet"], options].concat());
    let bytes =
        fs::read(test_folder.path().join("out.parquet")).expect("the command has written its file");
    Golden { test_folder, hash_hex: blake3::hash(&bytes).to_hex().to_string() }
}

/// Returns the rows of some goldens as one table: the golden, then the columns of maps, with six
/// significant digits.
fn goldens_table(goldens: &BTreeMap<&'static str, Golden>) -> String {
    let mut table = String::new();
    for name in TABULATED_MAPS {
        let test_folder = &goldens[name].test_folder;
        run_sweep(test_folder, &["export", "out.parquet", "out.csv"]);
        let csv_text = fs::read_to_string(test_folder.path().join("out.csv"));
        let csv_text = csv_text.expect("the export is there");
        let lines = csv_text.lines().filter(|line| !line.starts_with('#'));
        for (k, line) in lines.enumerate() {
            let cells: Vec<String> = line.split(',').map(round_cell).collect();
            match k {
                0 if table.is_empty() => table = format!("golden,{}\n", cells.join(",")),
                0 => {}
                _ => table += &format!("{name},{}\n", cells.join(",")),
            }
        }
    }
    table
}

/// Returns a number with six significant digits, and any other text as it is.
fn round_cell(cell: &str) -> String {
    match cell.parse::<f64>() {
        Ok(number) if number.fract() != 0.0 => format!("{number:.5e}"),
        _ => cell.to_owned(),
    }
}

/// Returns the greatest relative change of each column between two readable records, a line each.
fn changes_by_column(table_before: &str, table_now: &str) -> String {
    let cells_by_row = |text: &str| -> Vec<Vec<String>> {
        text.lines().map(|line| line.split(',').map(str::to_owned).collect()).collect()
    };
    let table_before = cells_by_row(table_before);
    let table_now = cells_by_row(table_now);
    let Some(header) = table_now.first().filter(|header| table_before.first() == Some(*header))
    else {
        return "the columns have changed".to_owned();
    };
    let mut changes_text = String::new();
    for (column, name) in header.iter().enumerate() {
        let mut greatest_change = 0.0_f64;
        for (row, recorded_value) in table_now.iter().zip(&table_before).skip(1) {
            let relative_change =
                match (row[column].parse::<f64>(), recorded_value[column].parse::<f64>()) {
                    (Ok(computed_value), Ok(recorded_value)) => {
                        (computed_value - recorded_value).abs()
                            / recorded_value.abs().max(f64::MIN_POSITIVE)
                    }
                    _ => f64::from(u8::from(row[column] != recorded_value[column])),
                };
            greatest_change = greatest_change.max(relative_change);
        }
        if greatest_change > 0.0 {
            changes_text += &format!("  {name}: {greatest_change:.1e}\n");
        }
    }
    changes_text
}

fn compute_goldens() -> BTreeMap<&'static str, Golden> {
    let run_words: &[&str] = &["run", "--progress", "none"];
    let map_golden = |integrator: &str| {
        compute_golden(
            &format!("{SPIN_AND_WINDOW}integrator = {{ {integrator} }}\n{MAP_AXES}"),
            run_words,
        )
    };
    let design_golden = |design: &str| {
        compute_golden(
            &format!("{SPIN_AND_WINDOW}{RK4_SECTION}design = {{ {design} }}\n{RANGES}"),
            run_words,
        )
    };
    let criterion_golden = |criterion: &str| {
        compute_golden(
            &format!(
                "{METRICS_LINE}{SPIN_AND_WINDOW}{RK4_SECTION}\
                 reliability = {{ criterion = \"{criterion}\" }}\n{MAP_AXES}"
            ),
            run_words,
        )
    };
    let point_options = ["--at", "unbalance_mass_kg=0.4", "--at", "damping_n_s_per_m=100"];
    let trace_words: &[&str] = &["trace", "--every", "0.02", "--states", "--forces"];
    let boundary_words: &[&str] = &["boundary", "--lattice", "2", "--tolerance", "2"];
    BTreeMap::from([
        ("map by rk4", map_golden("method = \"rk4\", step_s = 2e-4")),
        ("map by dopri5", map_golden("method = \"dopri5\", rtol = 1e-5, atol = 1e-8")),
        ("map by additive", map_golden("method = \"additive\", rtol = 1e-4, atol = 1e-7")),
        ("map by rk4-mass-scaled", map_golden("method = \"rk4-mass-scaled\", accuracy = 1e-3")),
        ("map by envelopes, with every metric", criterion_golden("envelope")),
        ("map by root mean squares, with every metric", criterion_golden("rms")),
        (
            "map of a latin hypercube",
            design_golden("method = \"latin_hypercube\", points = 5, seed = 3"),
        ),
        ("map of sobol's sequence", design_golden("method = \"sobol\", points = 8, seed = 3")),
        (
            "map of a list",
            compute_golden(
                &format!(
                    "{SPIN_AND_WINDOW}{RK4_SECTION}\
                     design = {{ method = \"list\", file = \"list.csv\" }}\n"
                ),
                run_words,
            ),
        ),
        (
            "boundary",
            compute_golden(&format!("{SPIN_AND_WINDOW}{RK4_SECTION}{MAP_AXES}"), boundary_words),
        ),
        (
            "trace",
            compute_golden(
                &format!("{SPIN_AND_WINDOW}{RK4_SECTION}{MAP_AXES}"),
                &[trace_words, &point_options].concat(),
            ),
        ),
    ])
}

/// Returns the frequency and the damping of every mode at some speeds.
fn compute_modes() -> Vec<f64> {
    let test_folder = tempfile::tempdir().expect("a temporary folder");
    let stdout_bytes = run_sweep(&test_folder, &["modes", "--speed", "0:400:200", "--json"]);
    let modes_json: Value = serde_json::from_slice(&stdout_bytes).expect("the modes are JSON");
    let mode_list = modes_json["modes"].as_array().expect("a list of modes");
    mode_list
        .iter()
        .flat_map(|mode| mode["at_speed"].as_array().expect("a list of speeds"))
        .flat_map(|speed_json| {
            ["frequency_rpm", "damping_ratio"]
                .map(|key| speed_json[key].as_f64().expect("a number"))
        })
        .collect()
}

#[test]
fn bytes_change_only_with_the_version_of_the_numerics() {
    let goldens = compute_goldens();
    let hashes: BTreeMap<&str, &str> =
        goldens.iter().map(|(name, golden)| (*name, golden.hash_hex.as_str())).collect();
    let table = goldens_table(&goldens);
    let recorded_table = fs::read_to_string(readable_record_path()).unwrap_or_default();
    let computed_modes = compute_modes();
    let current_record = json!({
        "version": VERSION,
        "numerics": NUMERICS_VERSION,
        "hashes": hashes,
        "modes": computed_modes,
    });
    let updates_record = std::env::var_os("UPDATE_GOLDENS").is_some();
    let record_text = fs::read_to_string(record_path()).unwrap_or_default();
    let record_json: Value = serde_json::from_str(&record_text).unwrap_or_default();
    let is_same_build = record_json["version"] == current_record["version"]
        && record_json["numerics"] == current_record["numerics"];

    let mut changed_names: Vec<&str> = hashes
        .iter()
        .filter(|(name, hash)| record_json["hashes"][**name] != ***hash)
        .map(|(name, _)| *name)
        .collect();
    let recorded_modes = record_json["modes"].as_array().cloned().unwrap_or_default();
    let is_same_mode_value = |recorded_value: &Value, computed_value: &f64| {
        recorded_value.as_f64().is_some_and(|recorded_value| {
            (recorded_value - computed_value).abs()
                <= MAX_RELATIVE_MODE_DIFFERENCE * recorded_value.abs().max(1e-3)
        })
    };
    if recorded_modes.len() != computed_modes.len()
        || !recorded_modes.iter().zip(&computed_modes).all(|(recorded_value, computed_value)| {
            is_same_mode_value(recorded_value, computed_value)
        })
    {
        changed_names.push("modes");
    }
    if recorded_table != table {
        changed_names.push("tests/goldens.csv");
    }
    if changed_names.is_empty() && is_same_build {
        return;
    }
    assert!(
        !is_same_build,
        "these bytes have changed, and NUMERICS_VERSION is still {NUMERICS_VERSION}: {}.\n\
         Greatest relative changes in tests/goldens.csv:\n{}\
         If they were meant to, raise it and write the new hashes by\n\
         scripts/release/raise_numerics.sh",
        changed_names.join(", "),
        changes_by_column(&recorded_table, &table)
    );
    assert!(
        updates_record,
        "tests/goldens.json is of sweep {}, numerics {}; this is sweep {VERSION}, numerics \
         {NUMERICS_VERSION}.\n\
         Write its hashes by UPDATE_GOLDENS=1 cargo test --release -p sweep --test command goldens",
        record_json["version"], record_json["numerics"]
    );
    fs::write(record_path(), format!("{current_record:#}\n"))
        .expect("tests/goldens.json is written");
    fs::write(readable_record_path(), &table).expect("tests/goldens.csv is written");
}

#[test]
fn changes_of_numbers_are_told_by_column() {
    let table_before = "golden,point,ratio_max,method\nmap,0,1.50000e0,rk4\nmap,1,2.00000e0,rk4\n";
    let table_now = table_before.replace("2.00000e0,rk4", "2.20000e0,additive");
    assert_eq!(changes_by_column(table_before, table_before), "");
    assert_eq!(
        changes_by_column(table_before, &table_now),
        "  ratio_max: 1.0e-1\n  method: 1.0e0\n"
    );
    assert_eq!(changes_by_column("golden,point\n", table_before), "the columns have changed");
}
