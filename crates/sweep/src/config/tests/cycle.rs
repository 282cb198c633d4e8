//! Tests of cycles (tables of the spin's speed over time) that are read from files.

use std::path::Path;

use washer_model::Spin;

use super::super::load;
use crate::plan::Plan;

const TIME_SECTION: &str = "[time]\nend_s = 50\n";

/// Loads a grid whose spin is read from a file with this text.
fn load_cycle(spin_keys: &str, cycle_text: &str) -> Result<Plan, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("grids/grid.toml");
    std::fs::create_dir(folder.path().join("grids")).unwrap();
    std::fs::create_dir(folder.path().join("cycles")).unwrap();
    std::fs::write(folder.path().join("cycles/cycle.csv"), cycle_text).unwrap();
    let grid_text = format!("[spin]\nfile = \"../cycles/cycle.csv\"\n{spin_keys}{TIME_SECTION}");
    std::fs::write(&path, grid_text).unwrap();
    load(Path::new(&path), &[]).map_err(|diagnostics| diagnostics.to_string())
}

fn spin_table(plan: &Plan) -> (&[f64], &[f64]) {
    match &plan.model.spin {
        Spin::Table { time_s, speed_rpm } => (time_s, speed_rpm),
        Spin::Ramped { .. } => panic!("a cycle is a table"),
    }
}

#[test]
fn a_cycle_is_read_with_its_units() {
    for text in [
        "time_s,speed_rpm\n0,0\n30,300\n60,0\n",
        "Time [min];Speed [Hz]\n0;0\n0,5;5\n1;0\n",
        "t_ms\tn_rpm\tvalve\n0\t0\topen\n30000\t300\tshut\n60000\t0\topen\n",
        "Program 7\ntime,drum speed\ns,1/min\n0,0\n30,300\n60,0\n",
    ] {
        let plan = load_cycle("", text).unwrap();
        assert_eq!(spin_table(&plan), (&[0.0, 30.0, 60.0][..], &[0.0, 300.0, 0.0][..]), "{text}");
    }
    let smooth_plan =
        load_cycle("joints = \"smooth\"\n", "time_s,speed_rpm\n0,0\n30,300\n").unwrap();
    let (times, speeds) = spin_table(&smooth_plan);
    assert_eq!(
        (times[0], speeds[0], times.last(), speeds.last()),
        (0.0, 0.0, Some(&30.0), Some(&300.0))
    );
    assert!(times.len() > 50 && speeds.is_sorted());
}

#[test]
fn a_plan_contains_the_points_of_its_cycle() {
    let cycle_text = "time_s,speed_rpm\n0,0\n30,300\n60,0\n";
    let plan = load_cycle("", cycle_text).unwrap();
    let changed_plan = load_cycle("", &cycle_text.replace("300", "301")).unwrap();
    assert_ne!(plan.to_json()["spin"], changed_plan.to_json()["spin"]);
    assert_eq!(plan.to_json()["spin"]["speed_rpm"][1], 300.0);
}

#[test]
fn mistakes_in_a_cycle_are_reported() {
    for (cycle_text, message_part) in [
        ("time_s,speed_rpm\n0,0\n30,300\n20,0\n", "time goes from 30 s to 20 s"),
        ("time_s,speed_rpm\n3,0\n30,300\n", "begins at 3 s"),
        ("time_s,speed_rpm\n0,0\n30,\n", "a row without its speed"),
        ("time_s,speed_rpm\n0,0\n,5\n", "the cycle's time goes from 0 s"),
        ("time_s,speed_rpm\n0,0\n30,1e6\n", "1000000 rpm is out of range"),
        ("time,speed\n0,0\n30,300\n", "has no column of time with its unit"),
        ("time_s,speed\n0,0\n30,300\n", "its columns are [\"time_s\", \"speed\"]"),
        ("time_s,speed_rpm\n", "has no rows"),
        ("time_s,speed_rpm\n0,0\n30,fast\n", "`fast` is not a number"),
        ("time_s [ms],speed_rpm\n0,0\n30,300\n", "names two units"),
    ] {
        let refusal = load_cycle("", cycle_text).unwrap_err();
        assert!(refusal.contains(message_part), "{message_part}: {refusal}");
    }
    let refusal = load_cycle("peak_rpm = 300\n", "time_s,speed_rpm\n0,0\n").unwrap_err();
    assert!(refusal.contains("`peak_rpm` does not belong"), "{refusal}");
    let refusal = load_cycle("joints = \"round\"\n", "time_s,speed_rpm\n0,0\n").unwrap_err();
    assert!(refusal.contains("unknown joints"), "{refusal}");
    let cycle_rows: String = (0..20_001).map(|k| format!("{k},5\n")).collect();
    let refusal = load_cycle("", &format!("time_s,speed_rpm\n{cycle_rows}")).unwrap_err();
    assert!(refusal.contains("20001 rows"), "{refusal}");
}
