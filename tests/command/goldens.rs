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
const SPIN: &str = "machine = \"paper\"\n\
    spin = { profile = \"triangular\", peak_rpm = 350.0, ramp_s = 0.6 }\n\
    time = { end_s = 1.0, window_s = [0.4, 0.9] }\n";

/// The axes of a map: three masses by three dampings.
const AXES: &str = "[[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [0.1, 0.4, 0.9]\n\
    [[axis]]\nparameter = \"damping_n_s_per_m\"\nrange = { from = 60.0, to = 300.0, count = 3 }\n";

/// The ranges of both parameters, for designs.
const BOX: &str = "[[axis]]\nparameter = \"unbalance_mass_kg\"\nrange = { from = 0.1, to = 0.9 }\n\
    [[axis]]\nparameter = \"damping_n_s_per_m\"\nrange = { from = 60.0, to = 300.0 }\n";

/// The method of all goldens but those of methods.
const RK4: &str = "integrator = { method = \"rk4\", step_s = 2e-4 }\n";

/// Metrics, which add columns to a map.
const METRICS: &str = "metrics = [\"cabinet_force\", \"clash_time\", \"static_sag\"]\n";

/// The maps whose numbers the readable record has, one for each kind of method.
const TABULATED: [&str; 3] = ["map by rk4", "map by additive", "map by rk4-mass-scaled"];

/// The greatest relative difference of a frequency from the record. Basis: the rounding of linear
/// algebra depends on the processor. Doubling it would find the same faults.
const MODES_TOLERANCE: f64 = 1e-9;

/// Returns the path of the record.
fn record_path() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/goldens.json")
}

/// Runs a command in `test_folder` and returns what it prints.
fn sweep(test_folder: &TempDir, words: &[&str]) -> Vec<u8> {
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

/// Returns the path of the readable record.
fn readable_record() -> PathBuf {
    record_path().with_extension("csv")
}

/// The file that a command has written for a grid, in its folder.
struct Golden {
    test_folder: TempDir,
    hash: String,
}

/// Runs a command for a grid.
fn golden(grid: &str, command: &[&str]) -> Golden {
    let test_folder = tempfile::tempdir().expect("a temporary folder");
    fs::write(test_folder.path().join("grid.toml"), grid).expect("the grid is written");
    let list = "unbalance_mass_kg,damping_n_s_per_m\n0.1,80\n0.7,211.5\n0.33,120\n";
    fs::write(test_folder.path().join("list.csv"), list).expect("the list is written");
    let (verb, options) = command.split_first().expect("a command has a name");
    sweep(&test_folder, &[&[*verb, "grid.toml", "--out", "out.parquet"], options].concat());
    let bytes =
        fs::read(test_folder.path().join("out.parquet")).expect("the command has written its file");
    Golden { test_folder, hash: blake3::hash(&bytes).to_hex().to_string() }
}

/// Returns the rows of some goldens as one table: the golden, then the columns of maps, with six
/// significant digits.
fn readable(goldens: &BTreeMap<&'static str, Golden>) -> String {
    let mut table = String::new();
    for name in TABULATED {
        let test_folder = &goldens[name].test_folder;
        sweep(test_folder, &["export", "out.parquet", "out.csv"]);
        let csv = fs::read_to_string(test_folder.path().join("out.csv"));
        let csv = csv.expect("the export is there");
        let lines = csv.lines().filter(|line| !line.starts_with('#'));
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
fn changes(before: &str, now: &str) -> String {
    let cells = |text: &str| -> Vec<Vec<String>> {
        text.lines().map(|line| line.split(',').map(str::to_owned).collect()).collect()
    };
    let before = cells(before);
    let now = cells(now);
    let Some(header) = now.first().filter(|header| before.first() == Some(*header)) else {
        return "the columns have changed".to_owned();
    };
    let mut text = String::new();
    for (column, name) in header.iter().enumerate() {
        let mut greatest = 0.0_f64;
        for (row, recorded_value) in now.iter().zip(&before).skip(1) {
            let share = match (row[column].parse::<f64>(), recorded_value[column].parse::<f64>()) {
                (Ok(computed_value), Ok(recorded_value)) => {
                    (computed_value - recorded_value).abs()
                        / recorded_value.abs().max(f64::MIN_POSITIVE)
                }
                _ => f64::from(u8::from(row[column] != recorded_value[column])),
            };
            greatest = greatest.max(share);
        }
        if greatest > 0.0 {
            text += &format!("  {name}: {greatest:.1e}\n");
        }
    }
    text
}

fn goldens() -> BTreeMap<&'static str, Golden> {
    let run: &[&str] = &["run", "--progress", "none"];
    let map =
        |integrator: &str| golden(&format!("{SPIN}integrator = {{ {integrator} }}\n{AXES}"), run);
    let design = |design: &str| golden(&format!("{SPIN}{RK4}design = {{ {design} }}\n{BOX}"), run);
    let judged = |criterion: &str| {
        golden(
            &format!("{METRICS}{SPIN}{RK4}reliability = {{ criterion = \"{criterion}\" }}\n{AXES}"),
            run,
        )
    };
    let point = ["--at", "unbalance_mass_kg=0.4", "--at", "damping_n_s_per_m=100"];
    let trace: &[&str] = &["trace", "--every", "0.02", "--states", "--forces"];
    let boundary: &[&str] = &["boundary", "--lattice", "2", "--tolerance", "2"];
    BTreeMap::from([
        ("map by rk4", map("method = \"rk4\", step_s = 2e-4")),
        ("map by dopri5", map("method = \"dopri5\", rtol = 1e-5, atol = 1e-8")),
        ("map by additive", map("method = \"additive\", rtol = 1e-4, atol = 1e-7")),
        ("map by rk4-mass-scaled", map("method = \"rk4-mass-scaled\", accuracy = 1e-3")),
        ("map by envelopes, with every metric", judged("envelope")),
        ("map by root mean squares, with every metric", judged("rms")),
        ("map of a latin hypercube", design("method = \"latin_hypercube\", points = 5, seed = 3")),
        ("map of sobol's sequence", design("method = \"sobol\", points = 8, seed = 3")),
        (
            "map of a list",
            golden(
                &format!("{SPIN}{RK4}design = {{ method = \"list\", file = \"list.csv\" }}\n"),
                run,
            ),
        ),
        ("boundary", golden(&format!("{SPIN}{RK4}{AXES}"), boundary)),
        ("trace", golden(&format!("{SPIN}{RK4}{AXES}"), &[trace, &point].concat())),
    ])
}

/// Returns the frequency and the damping of every mode at some speeds.
fn modes() -> Vec<f64> {
    let test_folder = tempfile::tempdir().expect("a temporary folder");
    let printed = sweep(&test_folder, &["modes", "--speed", "0:400:200", "--json"]);
    let modes_json: Value = serde_json::from_slice(&printed).expect("the modes are JSON");
    let modes = modes_json["modes"].as_array().expect("a list of modes");
    modes
        .iter()
        .flat_map(|mode| mode["at_speed"].as_array().expect("a list of speeds"))
        .flat_map(|at| {
            ["frequency_rpm", "damping_ratio"].map(|key| at[key].as_f64().expect("a number"))
        })
        .collect()
}

#[test]
fn bytes_change_only_with_the_version_of_the_numerics() {
    let goldens = goldens();
    let hashes: BTreeMap<&str, &str> =
        goldens.iter().map(|(name, golden)| (*name, golden.hash.as_str())).collect();
    let table = readable(&goldens);
    let recorded_table = fs::read_to_string(readable_record()).unwrap_or_default();
    let modes = modes();
    let now = json!({
        "version": VERSION,
        "numerics": NUMERICS_VERSION,
        "hashes": hashes,
        "modes": modes,
    });
    let update = std::env::var_os("UPDATE_GOLDENS").is_some();
    let text = fs::read_to_string(record_path()).unwrap_or_default();
    let recorded_value: Value = serde_json::from_str(&text).unwrap_or_default();
    let same_build = recorded_value["version"] == now["version"]
        && recorded_value["numerics"] == now["numerics"];

    let mut changed: Vec<&str> = hashes
        .iter()
        .filter(|(name, hash)| recorded_value["hashes"][**name] != ***hash)
        .map(|(name, _)| *name)
        .collect();
    let recorded = recorded_value["modes"].as_array().cloned().unwrap_or_default();
    let is_near = |recorded_value: &Value, computed_value: &f64| {
        recorded_value.as_f64().is_some_and(|recorded_value| {
            (recorded_value - computed_value).abs()
                <= MODES_TOLERANCE * recorded_value.abs().max(1e-3)
        })
    };
    if recorded.len() != modes.len()
        || !recorded
            .iter()
            .zip(&modes)
            .all(|(recorded_value, computed_value)| is_near(recorded_value, computed_value))
    {
        changed.push("modes");
    }
    if recorded_table != table {
        changed.push("tests/goldens.csv");
    }
    if changed.is_empty() && same_build {
        return;
    }
    assert!(
        !same_build,
        "these bytes have changed, and NUMERICS_VERSION is still {NUMERICS_VERSION}: {}.\n\
         Greatest relative changes in tests/goldens.csv:\n{}\
         If they were meant to, raise it and write the new hashes by\n\
         scripts/release/raise_numerics.sh",
        changed.join(", "),
        changes(&recorded_table, &table)
    );
    assert!(
        update,
        "tests/goldens.json is of sweep {}, numerics {}; this is sweep {VERSION}, numerics \
         {NUMERICS_VERSION}.\n\
         Write its hashes by UPDATE_GOLDENS=1 cargo test --release -p sweep --test command goldens",
        recorded_value["version"], recorded_value["numerics"]
    );
    fs::write(record_path(), format!("{now:#}\n")).expect("tests/goldens.json is written");
    fs::write(readable_record(), &table).expect("tests/goldens.csv is written");
}

#[test]
fn changes_of_numbers_are_told_by_column() {
    let before = "golden,point,ratio_max,method\nmap,0,1.50000e0,rk4\nmap,1,2.00000e0,rk4\n";
    let now = before.replace("2.00000e0,rk4", "2.20000e0,additive");
    assert_eq!(changes(before, before), "");
    assert_eq!(changes(before, &now), "  ratio_max: 1.0e-1\n  method: 1.0e0\n");
    assert_eq!(changes("golden,point\n", before), "the columns have changed");
}
