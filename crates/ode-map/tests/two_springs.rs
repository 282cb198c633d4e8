//! Tests of the example `two_springs` against an independent program, and of every command.

#![allow(clippy::unwrap_used, reason = "a test fails where it must")]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;
use arrow_array::{Array, RecordBatch};

/// Returns the example, which cargo builds beside this test.
fn program_path() -> PathBuf {
    let test_path = std::env::current_exe().unwrap();
    let target_folder = test_path.parent().and_then(Path::parent).unwrap();
    target_folder.join("examples").join(format!("two_springs{}", std::env::consts::EXE_SUFFIX))
}

fn grid_text(integrator: &str, axes: &str) -> String {
    format!(
        "name = \"springs\"\ntime = {{ end_s = 400, window_s = [300, 400] }}\n\
         integrator = {integrator}\n{axes}"
    )
}

const AXES: &str = "[[axis]]\nparameter = \"forcing\"\nvalues = [0.002, 0.005, 0.01, 0.02, 0.03]\n\
    [[axis]]\nparameter = \"forcing_rad_per_s\"\n\
    values = [0.7, 0.8, 0.9, 1.0, 1.1, 1.2, 1.3, 1.4, 1.5]\n";

struct GridFolder(tempfile::TempDir);

impl GridFolder {
    fn new(grid: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("grid.toml"), grid).unwrap();
        Self(folder)
    }

    fn run_command(&self, arguments: &str) -> Output {
        let mut command = Command::new(program_path());
        command.current_dir(self.0.path()).args(arguments.split(' ')).output().unwrap()
    }

    /// Runs a command, which must succeed, and returns its standard output and error.
    fn run_successfully(&self, arguments: &str) -> String {
        let output = self.run_command(arguments);
        let text = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
        assert!(output.status.success(), "{arguments}: {}", text.concat());
        text.concat()
    }

    fn read_bytes(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.0.path().join(name)).unwrap()
    }

    fn read_rows(&self, name: &str) -> RecordBatch {
        let file = sweep_files::ParquetFile::open(&self.0.path().join(name)).unwrap();
        file.batches((0..file.schema().fields().len()).collect()).unwrap().next().unwrap().unwrap()
    }
}

fn read_number(rows: &RecordBatch, name: &str, row: usize) -> Option<f64> {
    let column = rows.column_by_name(name).unwrap().as_primitive::<Float64Type>();
    column.is_valid(row).then(|| column.value(row))
}

/// Returns the greatest difference from the reference, relative to the peak.
fn greatest_difference(integrator: &str) -> f64 {
    let folder = GridFolder::new(&grid_text(integrator, AXES));
    folder.run_successfully("run grid.toml --out x.parquet --progress none");
    let rows = folder.read_rows("x.parquet");
    let reference_text = include_str!("../testdata/two_springs.json");
    let reference: serde_json::Value = serde_json::from_str(reference_text).unwrap();
    let expected_rows = reference["rows"].as_array().unwrap();
    assert_eq!(rows.num_rows(), expected_rows.len());
    let mut difference = 0.0_f64;
    for (row, expected) in expected_rows.iter().enumerate() {
        for key in ["forcing", "forcing_rad_per_s"] {
            assert_eq!(read_number(&rows, key, row), expected[key].as_f64());
        }
        for (k, name) in ["x1", "x2"].into_iter().enumerate() {
            let amplitude =
                |model: &str| read_number(&rows, &format!("{model}_{name}"), row).unwrap();
            let expected_peak = expected["nonlinear"][k].as_f64().unwrap();
            difference = difference.max((amplitude("nonlinear") / expected_peak - 1.0).abs());
            let expected_linear_peak = expected["linear"][k].as_f64().unwrap();
            difference = difference.max(
                (amplitude("linear") - expected_linear_peak).abs() / expected_linear_peak.max(1e-9),
            );
        }
        assert_eq!(read_number(&rows, "ratio_x2", row), None, "its linear motion is zero");
        let expected_ratio = expected["ratio"].as_f64().unwrap();
        difference = difference
            .max((read_number(&rows, "ratio_x1", row).unwrap() / expected_ratio - 1.0).abs());
    }
    difference
}

#[test]
fn every_method_agrees_with_the_independent_program() {
    for integrator in [
        "{ method = \"rk4\", step_s = 5e-3 }",
        "{ method = \"dopri5\", rtol = 1e-11, atol = 1e-15 }",
        "{ method = \"rk4-halved\", accuracy = 1e-8 }",
    ] {
        let difference = greatest_difference(integrator);
        assert!(difference < 1e-6, "{integrator}: {difference:e}");
    }
}

const FAST_INTEGRATOR: &str = "{ method = \"rk4\", step_s = 0.05 }";

#[test]
fn all_mistakes_are_reported_together_with_their_places_and_suggestions() {
    let invalid_grid =
        grid_text("{ method = \"rk5\" }", "[[axis]]\nparameter = \"forcin\"\nvalues = [1, 1]\n");
    let output = GridFolder::new(&invalid_grid).run_command("check grid.toml");
    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{text}");
    for message_part in ["did you mean `rk4`", "did you mean `forcing`", "grid.toml:6", "is twice"]
    {
        assert!(text.contains(message_part), "no {message_part} in {text}");
    }
}

#[test]
fn merged_shards_have_the_same_bytes_as_one_run() {
    let folder = GridFolder::new(&grid_text(FAST_INTEGRATOR, AXES));
    folder.run_successfully("run grid.toml --out whole.parquet --threads 1 --progress none");
    for shard in ["1/2", "2/2"] {
        folder.run_successfully(&format!(
            "run grid.toml --out x.parquet --shard {shard} --progress none"
        ));
    }
    assert!(
        folder
            .run_successfully("status grid.toml --out x.parquet")
            .contains("complete, to be merged")
    );
    folder.run_successfully("merge grid.toml --out x.parquet");
    assert!(folder.read_bytes("whole.parquet") == folder.read_bytes("x.parquet"));
}

#[test]
fn every_command_works() {
    let axes = "[[axis]]\nparameter = \"forcing_rad_per_s\"\nvalues = [1.05, 1.1]\n\
                [[axis]]\nparameter = \"forcing\"\n\
                range = { from = 0.001, to = 0.05, count = 9 }\n";
    let folder = GridFolder::new(&format!(
        "{}[reliability]\nratio_limit = 1.02\n",
        grid_text(FAST_INTEGRATOR, axes)
    ));
    assert!(folder.run_successfully("check grid.toml").contains("18"));
    folder.run_successfully("run grid.toml --out x.parquet --progress none");
    assert!(folder.run_successfully("show x.parquet").contains("below ratio 1.02"));
    assert!(
        folder
            .run_successfully("show x.parquet --top 1 --by ratio_x1")
            .contains("forcing_rad_per_s")
    );
    folder.run_successfully("plot x.parquet -o x.svg");
    assert!(String::from_utf8(folder.read_bytes("x.svg")).unwrap().starts_with("<svg"));
    folder.run_successfully("export x.parquet x.csv");
    assert!(String::from_utf8(folder.read_bytes("x.csv")).unwrap().contains("nonlinear_x1"));
    folder.run_successfully("require x.parquet count(status=='ok')==18");
    let violated_output = folder.run_command("require x.parquet ratio_x1<1");
    assert_eq!(violated_output.status.code(), Some(4), "{violated_output:?}");
    folder.run_successfully("run grid.toml --set zeta_1=0.02 --out y.parquet --progress none");
    assert!(folder.run_successfully("compare x.parquet y.parquet").contains("zeta_1"));
    let boundary_text =
        folder.run_successfully("boundary grid.toml --out b.parquet --progress none");
    assert!(boundary_text.contains("crossing"), "{boundary_text}");
    folder.run_successfully("plot x.parquet --boundary b.parquet -o y.svg");
    let parameters_text = folder.run_successfully("parameters grid.toml");
    assert!(
        parameters_text.contains("omega_1_rad_per_s") && parameters_text.contains("window_to_s"),
        "{parameters_text}"
    );
    let schema: serde_json::Value =
        serde_json::from_str(&folder.run_successfully("schema")).unwrap();
    assert!(schema["properties"]["set"]["properties"]["zeta_2"].is_object());
}

#[test]
fn a_study_finds_the_resonance_that_a_fine_map_shows() {
    let axis = "[[axis]]\nparameter = \"forcing_rad_per_s\"\n\
                range = { from = 0.7, to = 1.5, count = 401 }\n";
    let folder = GridFolder::new(&grid_text(FAST_INTEGRATOR, axis));
    folder.run_successfully("run grid.toml --out x.parquet --progress none");
    let rows = folder.read_rows("x.parquet");
    let linear_x1 = |row| read_number(&rows, "linear_x1", row).unwrap();
    let highest_row =
        (0..rows.num_rows()).max_by(|a, b| linear_x1(*a).total_cmp(&linear_x1(*b))).unwrap();
    let resonance = read_number(&rows, "forcing_rad_per_s", highest_row).unwrap();
    let write_file =
        |name: &str, text: &str| std::fs::write(folder.0.path().join(name), text).unwrap();
    write_file("point.toml", &grid_text(FAST_INTEGRATOR, ""));
    write_file(
        "study.toml",
        "grid = \"point.toml\"\ncandidates = 160\npopulation = 16\n\
         [[objective]]\nmaximise = \"linear_x1\"\n\
         [[parameter]]\nname = \"forcing_rad_per_s\"\nfrom = 0.7\nto = 1.5\n",
    );
    for threads in [1, 2] {
        let arguments = format!("optimise study.toml --threads {threads} --progress none --out");
        let text = folder.run_successfully(&format!("{arguments} {threads}.parquet"));
        assert!(text.contains("feasible  160 of 160\n"), "{text}");
    }
    assert!(folder.read_bytes("1.parquet") == folder.read_bytes("2.parquet"));
    let best_point = folder.run_successfully(
        "show 1.parquet --where on_front --json --columns forcing_rad_per_s,linear_x1",
    );
    let best_point: serde_json::Value = serde_json::from_str(&best_point).unwrap();
    let frequency = best_point[0]["forcing_rad_per_s"].as_f64().unwrap();
    assert!((frequency - resonance).abs() <= 0.003, "{frequency} for {resonance}");
    assert!(best_point[0]["linear_x1"].as_f64().unwrap() >= linear_x1(highest_row), "{best_point}");
}

#[test]
fn a_design_has_its_number_of_points() {
    let design = "[design]\nmethod = \"sobol\"\npoints = 16\n\
                  [[axis]]\nparameter = \"zeta_1\"\nrange = { from = 0.005, to = 0.05 }\n";
    let folder = GridFolder::new(&grid_text(FAST_INTEGRATOR, design));
    folder.run_successfully("run grid.toml --out x.parquet --progress none");
    assert_eq!(folder.read_rows("x.parquet").num_rows(), 16);
}
