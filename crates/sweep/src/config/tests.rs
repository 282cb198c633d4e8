//! Tests of whole messages about mistakes, of defaults and precedence, and of arbitrary input.
//!
//! Each file of `testdata/broken` is a grid with mistakes, and its snapshot is in the same folder.
//! A first line `# args: --set NAME=VALUE ...` has the arguments of the command line. With `--at`
//! the grid is loaded as a single point.

mod again;
mod bounds;
mod cycle;
mod lists;
mod planes;
mod plausible;
mod points;
mod sheet;
mod tolerance;

use std::path::{Path, PathBuf};

use proptest::prelude::*;
use washer_model::{Machine, Profile, Spin};
use washer_row::{Measures, Metric};

use super::*;
use crate::method::{METHODS, rk4, rk4_mass_scaled};
use crate::plan::{AxisValues, point_input};
use sweep_engine::design::{Design, DesignRule};
use sweep_engine::plan::NumberSources;

/// The decoder of the fuzzer's inputs.
#[path = "../../../../fuzz/src/input.rs"]
mod fuzz_input;

fn testdata_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("testdata")
}

fn sweep_paths() -> Vec<PathBuf> {
    toml_paths(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../sweeps"))
}

fn toml_paths(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut paths: Vec<_> =
        entries.filter(|path| path.extension().is_some_and(|x| x == "toml")).collect();
    paths.sort();
    paths
}

/// Loads a grid with the arguments in its first line.
fn load_with_arguments(path: &Path) -> Result<Plan, Diagnostics> {
    let text = std::fs::read_to_string(path).unwrap();
    let first_line = text.lines().next().unwrap_or_default();
    let arguments: Vec<_> =
        first_line.strip_prefix("# args: ").unwrap_or_default().split_whitespace().collect();
    let values_of_option = |option: &str| -> Vec<String> {
        arguments
            .chunks(2)
            .filter(|pair| pair[0] == option)
            .map(|pair| pair[1].to_owned())
            .collect()
    };
    let set_values = values_of_option("--set");
    let at_values = values_of_option("--at");
    if at_values.is_empty() {
        load(path, &set_values)
    } else {
        WasherGridInput::file(path.to_owned(), set_values)
            .load_point(&at_values)
            .map(|(plan, _)| plan)
    }
}

/// Writes the text of a grid to a file in a temporary folder and loads it.
pub(super) fn load_text(text: impl AsRef<[u8]>, sets: &[&str]) -> Result<Plan, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("grid.toml");
    std::fs::write(&path, text).unwrap();
    let set_values: Vec<_> = sets.iter().map(|&set| set.to_owned()).collect();
    load(&path, &set_values).map_err(|diagnostics| diagnostics.to_string())
}

pub(super) const MINIMAL_GRID: &str =
    "[spin]\nprofile = \"triangular\"\npeak_rpm = 350\nramp_s = 50\n[time]\nend_s = 50\n";

#[test]
fn broken_files_are_refused_with_these_messages() {
    let broken_paths = toml_paths(&testdata_folder().join("broken"));
    assert!(broken_paths.len() >= 40, "{} broken files", broken_paths.len());
    let mut settings = insta::Settings::clone_current();
    settings.set_snapshot_path(testdata_folder().join("broken"));
    settings.set_prepend_module_to_snapshot(false);
    settings.set_omit_expression(true);
    let mut accepted_names = Vec::new();
    settings.bind(|| {
        for path in broken_paths {
            let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
            match load_with_arguments(&path) {
                Ok(_) => accepted_names.push(name),
                Err(mistakes) => {
                    let folder_prefix = format!("{}/", testdata_folder().join("broken").display());
                    insta::assert_snapshot!(name, mistakes.to_string().replace(&folder_prefix, ""));
                }
            }
        }
    });
    assert_eq!(accepted_names, [""; 0], "accepted, but broken");
}

#[test]
fn every_sweep_of_the_repository_loads() {
    let paths = sweep_paths();
    assert!(paths.len() >= 6);
    for path in paths {
        let plan = load(&path, &[]).unwrap_or_else(|mistakes| panic!("{mistakes}"));
        assert_eq!(Some(plan.name.as_str()), path.file_stem().and_then(|stem| stem.to_str()));
    }
}

#[test]
fn omitted_keys_have_their_defaults() {
    let plan = load_text(MINIMAL_GRID, &[]).unwrap();
    assert_eq!(plan.name, "grid");
    assert_eq!(plan.model.machine, Machine::paper());
    assert_eq!(
        plan.model.spin,
        Spin::Ramped { profile: Profile::Triangular, peak_rpm: 350.0, ramp_s: 50.0 }
    );
    assert_eq!((plan.end_s, plan.window_s), (50.0, [0.0, 50.0]));
    assert_eq!(plan.integrator, rk4_mass_scaled(1e-3));
    assert_eq!(plan.points(), 1);
    assert_eq!(plan.reliability.limits, 2.0.into());
    let channels: Vec<_> = plan.reliability.channels.iter().map(|channel| channel.name).collect();
    assert_eq!(
        channels,
        ["tub_front_y", "tub_front_z", "drum_front_y", "drum_front_z", "tub_yaw", "tub_pitch"]
    );
    let adaptive_method = |name: &str, rtol: f64, atol: f64| {
        let method = METHODS.iter().find(|method| method.name == name).unwrap();
        method.with_settings(|setting| if setting.key == "rtol" { rtol } else { atol })
    };
    let method_of_grid = |text: &str| {
        load_text(format!("{MINIMAL_GRID}[integrator]\n{text}"), &[]).unwrap().integrator
    };
    assert_eq!(method_of_grid("method = \"rk4\""), rk4(2e-4));
    assert_eq!(method_of_grid("method = \"dopri5\""), adaptive_method("dopri5", 1e-6, 1e-9));
    assert_eq!(
        method_of_grid("method = \"additive\"\nrtol = 1e-8"),
        adaptive_method("additive", 1e-8, 1e-9)
    );
    assert_eq!(method_of_grid("accuracy = 1e-4"), rk4_mass_scaled(1e-4));
}

#[test]
fn a_starter_grid_is_the_documented_one() {
    let starter_plan = load_text(include_str!("../commands/starter.toml"), &[]).unwrap();
    assert_eq!(starter_plan.points(), 16);
    let minimal_plan = load_text(MINIMAL_GRID, &[]).unwrap();
    assert_eq!(
        (starter_plan.integrator, starter_plan.reliability),
        (minimal_plan.integrator, minimal_plan.reliability)
    );
    assert_eq!(starter_plan.model, minimal_plan.model);
}

#[test]
fn criterion_and_metrics_are_part_of_the_plan_unless_they_are_the_default() {
    let minimal_plan = load_text(MINIMAL_GRID, &[]).unwrap();
    assert_eq!(minimal_plan.model.measures, Measures { dampers: 2, ..Measures::default() });
    let explicit_plan =
        load_text(format!("{MINIMAL_GRID}[reliability]\ncriterion = \"peak\"\n"), &[]).unwrap();
    assert_eq!(explicit_plan.to_json(), minimal_plan.to_json());
    let extended_grid = format!(
        "metrics = [\"static_sag\", \"cabinet_force\"]\n{MINIMAL_GRID}[reliability]\ncriterion \
         = \"rms\"\n"
    );
    let extended_plan = load_text(extended_grid, &[]).unwrap();
    assert_eq!(extended_plan.model.measures.metrics, [Metric::StaticSag, Metric::CabinetForce]);
    let plan_json = extended_plan.to_json();
    assert_eq!(plan_json["reliability"]["criterion"], "rms");
    assert_eq!(plan_json["metrics"], serde_json::json!(["static_sag", "cabinet_force"]));
}

#[test]
fn later_layers_override_earlier_ones() {
    let grid = format!(
        "{MINIMAL_GRID}[set]\ndamping_n_s_per_m = 100\nunbalance_mass_kg = 0.2\n\
         spin_peak_rpm = 600\n"
    );
    let plan =
        load_text(&grid, &["unbalance_mass_kg=0.3", "damper_2_damping_n_s_per_m=90"]).unwrap();
    assert_eq!(plan.model.machine.unbalance.mass_kg, 0.3);
    let dampings = plan.model.machine.dampers.iter().map(|damper| damper.damping_n_s_per_m);
    assert_eq!(dampings.collect::<Vec<_>>(), [100.0, 90.0]);
    assert_eq!(
        plan.model.spin,
        Spin::Ramped { profile: Profile::Triangular, peak_rpm: 600.0, ramp_s: 50.0 }
    );
    // An axis of one damper overrides a constant for all of them.
    let damper_axis = "[[axis]]\nparameter = \"damper_1_damping_n_s_per_m\"\nvalues = [50, 60]\n";
    let plan = load_text(format!("{grid}{damper_axis}"), &[]).unwrap();
    let dampings = point_input(&plan, &plan.axis_values(1))
        .machine
        .dampers
        .iter()
        .map(|damper| damper.damping_n_s_per_m)
        .collect::<Vec<_>>();
    assert_eq!(dampings, [60.0, 100.0]);
}

#[test]
fn a_point_may_lie_between_grid_points() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../sweeps/fig12.toml");
    let load_at = |assignments: &[&str]| {
        WasherGridInput::file(path.clone(), Vec::new())
            .load_point(&assignments.iter().map(|&text| text.to_owned()).collect::<Vec<_>>())
            .map(|(plan, _)| plan)
    };
    let plan =
        load_at(&["damping_n_s_per_m=99.5", "unbalance_mass_kg=0.4", "tub_mass_kg=25"]).unwrap();
    assert_eq!((plan.points(), plan.model.machine.tub.mass_kg), (1, 25.0));
    assert!(plan.model.machine.dampers.iter().all(|damper| damper.damping_n_s_per_m == 99.5));
    assert_eq!(load_at(&["unbalance_mass_kg=0.4"]).unwrap_err().count(), 1);
    assert_eq!(load_at(&[]).unwrap_err().count(), 2);
}

#[test]
fn a_written_machine_reads_back_the_same_bits() {
    let mut machine = Machine::paper();
    machine.tub.mass_kg = 23.87 + 1e-13;
    machine.springs[1].free_length_m = Some(0.1);
    machine.springs.truncate(3);
    machine.dampers.clear();
    let mut with_all_elements = super::machine::machine_with_every_element();
    with_all_elements.springs[2].cubic_n_per_m3 = 2e6;
    with_all_elements.dampers[0].friction_n = 45.5;
    with_all_elements.dampers[0].friction_linear_speed_m_per_s = Some(0.31);
    with_all_elements.dampers[1].friction_speed_m_per_s = 0.02;
    with_all_elements.stops[0].direction = [0.0, 0.6, -0.8];
    with_all_elements.stops[0].softness_m = 2e-4;
    with_all_elements.bushings[0].damping_n_s_per_m = [0.0, 12.0, 12.0];
    with_all_elements.bushings[0].cubic_n_per_m3[1] = 5e6;
    with_all_elements.further_unbalances[0].radius_m = -0.2;
    let foot_positions = [[0.5, -0.45, 0.26], [0.5, -0.45, -0.26], [-0.1, -0.45, 0.01]];
    with_all_elements.feet = foot_positions.map(|foot_m| washer_model::Foot { foot_m }).to_vec();
    with_all_elements.cabinet = Some(washer_model::Cabinet { mass_kg: 31.5, ..Default::default() });
    for machine in [machine, Machine::paper(), with_all_elements] {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(
            folder.path().join("machine.toml"),
            machine_file(&machine, &NumberSources::default()),
        )
        .unwrap();
        let grid_path = folder.path().join("grid.toml");
        std::fs::write(&grid_path, format!("machine = \"machine.toml\"\n{MINIMAL_GRID}")).unwrap();
        assert_eq!(load(&grid_path, &[]).unwrap().model.machine, machine);
    }
}

/// Returns the message about mistakes in the built-in machine's file after a change of its text. It
/// is empty if there are none.
fn machine_mistakes(change: impl FnOnce(String) -> String, sets: &[&str]) -> String {
    let folder = tempfile::tempdir().unwrap();
    let machine_text = change(machine_file(&Machine::paper(), &NumberSources::default()));
    std::fs::write(folder.path().join("machine.toml"), machine_text).unwrap();
    let grid_path = folder.path().join("grid.toml");
    std::fs::write(&grid_path, format!("machine = \"machine.toml\"\n{MINIMAL_GRID}")).unwrap();
    let set_values: Vec<_> = sets.iter().map(|&set| set.to_owned()).collect();
    load(&grid_path, &set_values).map_or_else(|mistakes| mistakes.to_string(), |_| String::new())
}

#[test]
fn mistakes_in_elements_are_reported_with_their_place() {
    let mistakes_with_section =
        |text: &'static str| machine_mistakes(|file| format!("{file}{text}"), &[]);
    let damper_section = "[[dampers]]\ncabinet_m = [0, -0.3, 0]\ntub_m = [0, -0.1, 0]\n\
                  damping_n_s_per_m = 0\n";
    let mistakes_with_damper =
        |text: &str| machine_mistakes(|file| format!("{file}{damper_section}{text}"), &[]);
    let message = mistakes_with_damper("friction_n = -40\nfriction_linear_speed_m_per_s = 0.3\n");
    assert!(message.contains("expected a number, 0 or greater"), "{message}");
    let message =
        mistakes_with_damper("friction_n = 40\nfriction_linear_speed_m_per_s = \"atuo\"\n");
    assert!(message.contains("did you mean `auto`?"), "{message}");
    assert_eq!(
        mistakes_with_damper("friction_n = 40\nfriction_linear_speed_m_per_s = \"auto\"\n"),
        ""
    );
    let message = mistakes_with_damper("friction_n = 40\nfriction_speed_m_per_s = 0\n");
    assert!(message.contains("a number from 1e-6 to 1000"), "{message}");
    assert_eq!(mistakes_with_damper("friction_n = 40\nfriction_linear_speed_m_per_s = 0.3\n"), "");

    let message = mistakes_with_section(
        "[[stops]]\ntub_m = [0.4, 0, 0.2]\nclearance_m = 0.01\nstiffness_n_per_m = 4e4\n",
    );
    assert!(message.contains("`direction` is missing in"), "{message}");
    let mistakes_with_stop = |direction: &str| {
        let stop_section = format!(
            "[[stops]]\ntub_m = [0.4, 0, 0.2]\ndirection = {direction}\nclearance_m = \
             0.01\nstiffness_n_per_m = 4e4\n"
        );
        machine_mistakes(|file| format!("{file}{stop_section}"), &[])
    };
    assert!(mistakes_with_stop("[0, 0]").contains("`direction` has 2 numbers"));
    assert!(mistakes_with_stop("[0, 0, 0]").contains("stop 1 has no direction"));
    assert_eq!(mistakes_with_stop("[0, 3, -4]"), "", "any length is made 1");

    let unbalance_section = "[[further_unbalances]]\nmass_kg = 0.2\nx_m = 0.1\nradius_m = 0\n";
    let message = machine_mistakes(|file| format!("{file}{unbalance_section}"), &[]);
    assert!(message.contains("unbalance 2 is on the drum's axis"), "{message}");
    assert!(message.contains("radius_m = 0"), "{message}");
    let message =
        mistakes_with_section("[[bushings]]\ntub_m = [0.4, 0, 0]\nstiffness_n_per_m = 600\n");
    assert!(message.contains("an array of numbers"), "{message}");

    // Options set numbers only of elements that the machine has.
    assert_eq!(machine_mistakes(|file| file, &["friction_n=50"]), "");
    let message = machine_mistakes(|file| file, &["stop_1_clearance_m=0.01"]);
    assert!(message.contains("the machine has 0 stops"), "{message}");
    let message = machine_mistakes(|file| file, &["unbalance_2_mass_kg=0.01"]);
    assert!(message.contains("the machine has 1 unbalance, numbered from 1"), "{message}");
}

#[test]
fn a_machine_has_at_most_a_thousand_springs() {
    let load_with_springs = |spring_count: usize| {
        let mut machine = Machine::paper();
        machine.springs = vec![machine.springs[0]; spring_count];
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(
            folder.path().join("machine.toml"),
            machine_file(&machine, &NumberSources::default()),
        )
        .unwrap();
        let grid_path = folder.path().join("grid.toml");
        std::fs::write(&grid_path, format!("machine = \"machine.toml\"\n{MINIMAL_GRID}")).unwrap();
        load(&grid_path, &[]).map_err(|mistakes| mistakes.to_string())
    };
    assert_eq!(load_with_springs(1000).unwrap().model.machine.springs.len(), 1000);
    assert!(load_with_springs(1001).unwrap_err().contains("the machine has 1001 springs"));
}

#[test]
fn the_canonical_plan_distinguishes_plans_and_keeps_every_bit() {
    let plan_json =
        |grid: &str, sets: &[&str]| load_text(grid, sets).unwrap().to_json().to_string();
    let reordered_grid =
        "[time]\nend_s = 5e1\n[spin]\nramp_s = 50.0\npeak_rpm = 3.5e2\nprofile = \"triangular\"\n";
    assert_eq!(plan_json(MINIMAL_GRID, &[]), plan_json(reordered_grid, &[]));
    assert_eq!(plan_json(MINIMAL_GRID, &[]), plan_json(MINIMAL_GRID, &["tub_mass_kg=23.87"]));
    let unrounded_mass_kg = 0.1 + 0.2;
    assert_ne!(
        plan_json(MINIMAL_GRID, &["tub_mass_kg=0.3"]),
        plan_json(MINIMAL_GRID, &[&format!("tub_mass_kg={unrounded_mass_kg}")])
    );
    assert!(
        plan_json(MINIMAL_GRID, &[&format!("tub_mass_kg={unrounded_mass_kg}")])
            .contains("0.30000000000000004")
    );
}

#[test]
fn a_byte_order_mark_and_windows_line_ends_are_ignored() {
    let windows_text = format!("\u{feff}{}", MINIMAL_GRID.replace('\n', "\r\n"));
    assert_eq!(load_text(windows_text, &[]).unwrap(), load_text(MINIMAL_GRID, &[]).unwrap());
}

#[test]
fn files_that_cannot_be_read_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let refusal_message = |path: &Path| load(path, &[]).unwrap_err().to_string();
    let missing_file_message = refusal_message(&folder.path().join("missing.toml"));
    assert!(
        missing_file_message.contains("missing.toml")
            && missing_file_message.contains("sweep init"),
        "{missing_file_message}"
    );
    assert!(refusal_message(folder.path()).contains("cannot read the grid file"));
    assert!(
        load_text(b"name = \"\xff\"", &[])
            .unwrap_err()
            .contains("not UTF-8 text: the first bad byte is number 9")
    );
    assert!(load_text(b"\xff\xfen\0a\0", &[]).unwrap_err().contains("UTF-16"));
    assert!(load_text(vec![b'#'; 1 << 20], &[]).unwrap_err().contains("longer than 896 KiB"));
    for blank in ["", " \n\t\n", "\u{feff}"] {
        assert!(load_text(blank, &[]).unwrap_err().contains("is empty"), "{blank:?}");
    }
}

#[test]
fn files_with_many_mistakes_have_short_messages() {
    let lines = (0..100_000).map(|k| format!("k{k}=1\n"));
    let message = load_text(lines.collect::<String>(), &[]).unwrap_err();
    assert!(message.contains("100002 mistakes (100 shown)"), "{}", &message[message.len() - 200..]);
    let message = load_text("]".repeat(896 << 10), &[]).unwrap_err();
    assert!(message.len() < 10_000, "{}", message.len());
    let message = load_text("a = 1\n".repeat(100_000), &[]).unwrap_err();
    assert!(message.contains("100000 mistakes (100 shown)"), "{}", &message[message.len() - 200..]);
    let times = "1,".repeat(20_000);
    let speeds = "2,".repeat(20_000);
    let table_grid = format!(
        "[spin]\nprofile = \"table\"\ntime_s = [{times}]\nspeed_rpm = [{speeds}]\n[time]\nend_s = \
         9\n"
    );
    assert!(load_text(table_grid, &[]).unwrap_err().contains("20000 mistakes (100 shown)"));
    let values_key = format!("values = [{}]", "nan,".repeat(200_000));
    let axis_grid = format!("{MINIMAL_GRID}[[axis]]\nparameter = \"tub_mass_kg\"\n{values_key}\n");
    let message = load_text(axis_grid, &[]).unwrap_err();
    assert!(message.len() < 100_000, "{}", message.len());
}

#[test]
fn the_largest_grid_takes_no_memory() {
    let axis_text = |name: &str, count: u64| {
        format!(
            "[[axis]]\nparameter = \"{name}\"\nrange = {{ from = 1.0, to = 2.0, count = {count} \
             }}\n"
        )
    };
    let grid = format!(
        "{MINIMAL_GRID}{}{}",
        axis_text("tub_mass_kg", 1_000_000),
        axis_text("shaft_mass_kg", 1_000_000)
    );
    let plan = load_text(grid, &[]).unwrap();
    assert_eq!(plan.points(), 1_000_000_000_000);
    assert_eq!(plan.axis_values(plan.points() - 1), [2.0, 2.0]);
    let max_u64 = "18446744073709551615";
    let grid = format!(
        "{MINIMAL_GRID}{}{}",
        axis_text("tub_mass_kg", 1_000_000),
        axis_text("shaft_mass_kg", 1_000_001)
    );
    assert!(load_text(grid, &[]).unwrap_err().contains("too many grid points"));
    let grid = format!("{MINIMAL_GRID}{}", axis_text("tub_mass_kg", 1))
        .replace("count = 1 ", &format!("count = {max_u64} "));
    assert!(load_text(grid, &[]).unwrap_err().contains("out of range"));
}

#[test]
fn axis_values_keep_the_order_of_the_file() {
    let grid =
        format!("{MINIMAL_GRID}[[axis]]\nparameter = \"tub_mass_kg\"\nvalues = [3, 1, 0x10]\n");
    let plan = load_text(grid, &[]).unwrap();
    assert_eq!(plan.axes[0].values, AxisValues::List(vec![3.0, 1.0, 16.0]));
}

/// Texts that mutations insert into a valid grid.
const INSERTIONS: [&str; 24] = [
    "nan",
    "inf",
    "-1",
    "1e999",
    "0",
    "\"",
    "[",
    "]",
    "{",
    "}",
    "=",
    ".",
    ",",
    "\n",
    "#",
    "[[axis]]\n",
    "[set]\n",
    "true",
    "1979-05-27",
    "\u{feff}",
    "é",
    "'''",
    "spring_1_tub_y_m",
    "99999999999999999999",
];

/// Asserts that the text of a grid gives a plan with valid machines at all corners of the axes'
/// ranges, or is refused with a message.
fn assert_loads_or_explains(grid_bytes: &[u8]) {
    match load_text(grid_bytes, &[]) {
        Ok(plan) => {
            for corner in 0..plan.corner_count() {
                let input = point_input(&plan, &plan.corner_values(corner));
                assert_eq!(input.machine.violations(), []);
                assert_eq!(input.spin.violations(), []);
            }
            assert!(plan.window_s[0] < plan.window_s[1] && plan.window_s[1] <= plan.end_s);
        }
        Err(mistakes) => assert!(mistakes.contains("nothing was done")),
    }
}

#[test]
fn the_fuzzers_corpus_loads_or_is_explained() {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus");
    let mut loaded_count = 0;
    for entry in std::fs::read_dir(corpus).unwrap() {
        let bytes = std::fs::read(entry.unwrap().path()).unwrap();
        let fuzz_input = fuzz_input::Input::new(&bytes);
        let folder = tempfile::tempdir().unwrap();
        match load(&fuzz_input.write(folder.path()).unwrap(), &fuzz_input.sets) {
            Ok(plan) => {
                loaded_count += 1;
                assert_eq!(
                    point_input(&plan, &plan.axis_values(plan.points() - 1)).machine.violations(),
                    []
                );
            }
            Err(mistakes) => assert!(mistakes.to_string().contains("nothing was done")),
        }
    }
    assert!(loaded_count >= 2, "the seeds themselves are sound");
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 256,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn any_bytes_load_or_are_explained(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        assert_loads_or_explains(&bytes);
    }

    #[test]
    fn any_text_loads_or_is_explained(text in "(\\PC|\n){0,200}") {
        assert_loads_or_explains(text.as_bytes());
    }

    #[test]
    fn any_mutation_of_a_valid_grid_loads_or_is_explained(
        grid_index in 0_usize..5,
        edits in prop::collection::vec(
            (any::<prop::sample::Index>(), 0_usize..20, 0_usize..INSERTIONS.len(), any::<bool>()),
            1..5,
        ),
    ) {
        let mut text = match grid_index {
            0 => include_str!("../commands/starter.toml").to_owned(),
            k => std::fs::read_to_string(&sweep_paths()[k]).unwrap(),
        };
        for (position, deleted_length, insertion_index, inserts_text) in edits {
            let boundaries: Vec<_> = text.char_indices().map(|(index, _)| index).collect();
            if boundaries.is_empty() { break; }
            let start_index = *position.get(&boundaries);
            let end_index = boundaries
                .iter()
                .copied()
                .find(|&index| index >= start_index + deleted_length)
                .unwrap_or(text.len());
            let replacement = if inserts_text { INSERTIONS[insertion_index] } else { "" };
            text.replace_range(start_index..end_index, replacement);
        }
        assert_loads_or_explains(text.as_bytes());
    }

    #[test]
    fn any_constant_loads_or_is_explained(
        name in "[a-z_0-9=.]{0,40}",
        value in "\\PC{0,20}",
        uses_known_name in any::<bool>(),
    ) {
        let name = if uses_known_name { "damping_n_s_per_m" } else { name.as_str() };
        let assignment = format!("{name}={value}");
        if let Err(mistakes) = load_text(MINIMAL_GRID, &[&assignment]) {
            assert!(mistakes.contains("nothing was done"));
        }
    }

    #[test]
    fn any_number_of_a_machine_file_loads_or_is_explained(
        line_number in 0_usize..60,
        value in any::<f64>(),
    ) {
        let machine_text = machine_file(&Machine::paper(), &NumberSources::default());
        let mut lines: Vec<String> = machine_text.lines().map(str::to_owned).collect();
        let line_index = line_number % lines.len();
        if let Some((key, rest)) = lines[line_index].clone().split_once(" = ") {
            let is_array = rest.starts_with('[');
            lines[line_index] = if is_array { format!("{key} = [{value:?}, 1.0, \
                                             1.0]") } else { format!("{key} = {value:?}") };
        }
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("machine.toml"), lines.join("\n")).unwrap();
        let grid_path = folder.path().join("grid.toml");
        std::fs::write(&grid_path, format!("machine = \"machine.toml\"\n{MINIMAL_GRID}")).unwrap();
        match load(&grid_path, &[]) {
            Ok(plan) => assert_eq!(plan.model.machine.violations(), []),
            Err(mistakes) => assert!(mistakes.count() >= 1),
        }
    }
}

#[test]
fn a_design_is_ranges_and_a_number_of_points() {
    let axis_texts = "[[axis]]\nparameter = \"unbalance_mass_kg\"\n\
                range = { from = 0.1, to = 1.0 }\n\
                [[axis]]\nparameter = \"bearing_stiffness_n_per_m\"\nrange = { from = 1e6, to = \
                1e9, spacing = \"log\" }\n";
    let plan_with_design = |design: &str| {
        load_text(format!("{MINIMAL_GRID}[design]\n{design}\n{axis_texts}"), &[]).unwrap()
    };
    let sobol_plan = plan_with_design("method = \"sobol\"\npoints = 64\nseed = 3");
    assert_eq!(
        sobol_plan.design,
        Some(Design::Spread { rule: DesignRule::Sobol, points: 64, seed: 3 })
    );
    let latin_plan = plan_with_design("method = \"latin_hypercube\"\npoints = 64");
    assert_eq!(
        (latin_plan.points(), latin_plan.to_json()["design"]["seed"].as_u64()),
        (64, Some(0))
    );
    assert_ne!(latin_plan.axis_values(0), sobol_plan.axis_values(0));
    assert_eq!(latin_plan.to_json()["axis"][0]["range"].get("count"), None);
    assert_eq!(load_text(MINIMAL_GRID, &[]).unwrap().to_json().get("design"), None);
}

#[test]
fn a_plan_with_a_list_depends_on_the_content_of_its_file() {
    let folder = tempfile::tempdir().unwrap();
    let grid_path = folder.path().join("grid.toml");
    std::fs::write(
        &grid_path,
        format!("{MINIMAL_GRID}[design]\nmethod = \"list\"\nfile = \"points.csv\"\n"),
    )
    .unwrap();
    let load_list = |csv: &str| {
        std::fs::write(folder.path().join("points.csv"), csv).unwrap();
        load(&grid_path, &[]).unwrap()
    };
    let list_text =
        "\u{feff}# by hand\n\"unbalance_mass_kg\", spin_ramp_s\r\n0.25, 5e1\r\n\r\n0.5, 40\r\n";
    let plan = load_list(list_text);
    assert_eq!(plan.points(), 2);
    assert_eq!(
        [plan.axis_values(0), plan.axis_values(1)],
        [[0.25, 50.0], [0.5, 40.0]].map(Vec::from)
    );
    assert_eq!(
        point_input(&plan, &plan.axis_values(1)).spin,
        Spin::Ramped { profile: Profile::Triangular, peak_rpm: 350.0, ramp_s: 40.0 }
    );
    let changed_plan = load_list(&list_text.replace("40", "41"));
    assert_ne!(plan.to_json()["design"]["hash"], changed_plan.to_json()["design"]["hash"]);
    assert_eq!(plan.to_json()["axis"], changed_plan.to_json()["axis"]);
    let point_plan = WasherGridInput::file(grid_path, Vec::new())
        .load_point(&["unbalance_mass_kg=0.1".into(), "spin_ramp_s=9".into()])
        .unwrap()
        .0;
    assert_eq!((point_plan.points(), point_plan.design), (1, None));
}

#[test]
fn a_name_from_the_command_line_replaces_an_invalid_file_name() {
    let grid_lines = include_str!("../../../../sweeps/quick.toml").lines();
    let unnamed_lines =
        grid_lines.filter(|line| !line.starts_with("name")).map(|line| format!("{line}\n"));
    let input = WasherGridInput::text("my grid", unnamed_lines.collect(), Vec::new());
    let refusal = input.load().unwrap_err().to_string();
    assert!(refusal.contains("or pass `--name`"), "{refusal}");
    assert_eq!(input.with_name(Some("mine".to_owned())).load().unwrap().name, "mine");
}
