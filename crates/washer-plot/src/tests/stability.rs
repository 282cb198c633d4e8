//! Stability files in, figures out; and their unstable speeds in figures of other files.

use std::path::Path;

use super::sample::{Sample, boundary, map};
use super::*;

/// Points of these unbalances over 200 to 300 rpm. Growth is above 0 from 230 to 250 rpm, by as
/// much as the unbalance.
pub(super) fn stability(masses: &[f64]) -> Sample {
    let rows: Vec<(f64, f64)> = masses
        .iter()
        .flat_map(|&mass| (0..=20).map(move |k| (mass, 200.0 + 5.0 * f64::from(k))))
        .collect();
    let growth = |&(mass, speed): &(f64, f64)| mass * (10.0 - (speed - 240.0).abs()) / 10.0;
    let is_in = |row: &(f64, f64)| growth(row) > 0.0;
    let mode = |value: f64| move |row: &(f64, f64)| if is_in(row) { value } else { f64::NAN };
    let words = |row: &(f64, f64)| Some(if is_in(row) { "quasi_periodic" } else { "stable" });
    Sample::default()
        .counts("point", rows.iter().map(|row| (row.0 * 10.0) as u64))
        .numbers("unbalance_mass_kg", "kg", rows.iter().map(|row| row.0))
        .numbers("speed_rpm", "rpm", rows.iter().map(|row| row.1))
        .numbers("growth_per_s", "1/s", rows.iter().map(growth))
        .words("kind", rows.iter().map(words))
        .numbers("mode_1_cpm", "1/min", rows.iter().map(mode(86.0)))
        .numbers("mode_2_cpm", "1/min", rows.iter().map(mode(202.0)))
        .numbers("nonlinear_tub_yaw", "rad", rows.iter().map(|row| 0.002 * row.0))
        .numbers("linear_tub_yaw", "rad", rows.iter().map(|row| 0.001 * row.0))
        .words("status", rows.iter().map(|_| Some("ok")))
        .metadata("sweep.plan", r#"{"name": "dwell"}"#)
}

fn page(sample: Sample, asked: &impl Asked) -> Value {
    carried(&draw(sample, asked, "figure.html").unwrap())["chart"].clone()
}

fn ranges(shades: &Value) -> Vec<[f64; 2]> {
    let ends = |range: &Value| [0, 1].map(|end| range[end].as_f64().unwrap());
    shades.as_array().unwrap().iter().map(ends).collect()
}

#[test]
fn growth_of_one_point_is_shaded_between_its_marked_edges() {
    let chart = page(stability(&[0.4]), &plain());
    assert_eq!(ranges(&chart["shades"]), [[230.0, 250.0]]);
    let marks: Vec<&str> =
        chart["marks"].as_array().unwrap().iter().map(|mark| mark[1].as_str().unwrap()).collect();
    assert_eq!(marks, ["230 rpm", "250 rpm"]);
    let figure = svg(stability(&[0.4]), &plain());
    for text in ["dwell · unbalance mass 0.4 kg", "a dwell at this speed is unstable", "230 rpm"] {
        assert!(figure.contains(text), "{text}");
    }
}

#[test]
fn several_points_have_a_curve_each_and_too_many_are_thinned() {
    let names = |masses: &[f64], at: Vec<(String, f64)>| -> Vec<String> {
        let options = Options { at, ..Options::default() };
        let chart = page(stability(masses), &options);
        let series = chart["panels"][0]["series"].as_array().unwrap().clone();
        series.iter().map(|one| one["name"].as_str().unwrap().to_owned()).collect()
    };
    assert_eq!(names(&[0.2, 0.4], Vec::new()), ["Unbalance mass 0.2 kg", "Unbalance mass 0.4 kg"]);
    let many: Vec<f64> = (1..=20).map(|k| 0.05 * f64::from(k)).collect();
    let shown = names(&many, Vec::new());
    assert_eq!((shown.len(), shown[5].as_str()), (6, "Unbalance mass 1 kg"));
    assert_eq!(names(&[0.2, 0.4], vec![("unbalance_mass_kg".to_owned(), 0.4)]), ["growth"]);
}

#[test]
fn responses_are_dashed_where_they_are_unstable() {
    let chart = page(stability(&[0.4]), &viewed(View::Responses));
    let series = chart["panels"][0]["series"].as_array().unwrap().clone();
    let told: Vec<(&str, bool)> = series
        .iter()
        .map(|one| (one["name"].as_str().unwrap(), one["dashed"].as_bool().unwrap()))
        .collect();
    assert_eq!(
        told,
        [
            ("linear model", false),
            ("nonlinear model, stable", false),
            ("nonlinear model, unstable", true)
        ]
    );
    assert_eq!(ranges(&chart["shades"]), [[230.0, 250.0]]);
    let two = message(draw(stability(&[0.2, 0.4]), &viewed(View::Responses), "a.svg"));
    assert!(two.contains("has 2 points") && two.contains("--at NAME=VALUE for unbalance"), "{two}");
}

#[test]
fn other_figures_shade_the_unstable_speeds() {
    let folder = tempfile::tempdir().unwrap();
    let path = stability(&[0.4]).write(folder.path(), "stability.parquet");
    let options = WasherFigures { stability: Some(path.clone()), ..WasherFigures::default() };
    let chart = page(trace(), &options);
    let file = trace().write(folder.path(), "trace.parquet");
    let table = Table::open(&file, KNOWN).unwrap();
    let (time, speed) = (table.numbers("time_s").unwrap(), table.numbers("speed_rpm").unwrap());
    let shades = ranges(&chart["shades"]);
    assert!(!shades.is_empty());
    for (time, speed) in time.iter().zip(speed) {
        let is_shaded = shades.iter().any(|[from, to]| (from..=to).contains(&time));
        let is_inside = (230.0..=250.0).contains(speed);
        let is_at_an_edge = (speed - 230.0).abs() < 1e-6 || (speed - 250.0).abs() < 1e-6;
        assert!(is_shaded == is_inside || is_at_an_edge, "{time} s, {speed} rpm");
    }
    let chart = page(modes(), &options);
    assert_eq!(ranges(&chart["shades"]), [[230.0, 250.0]]);
    let names: Vec<String> = chart["panels"][0]["series"]
        .as_array()
        .unwrap()
        .iter()
        .map(|one| one["name"].as_str().unwrap().to_owned())
        .collect();
    let sum = "sum of the frequencies of modes 1 and 2";
    assert!(names.iter().any(|name| name == sum), "{names:?}");
}

#[test]
fn a_map_takes_the_line_of_a_boundary_over_its_axes() {
    let over = |axes: [&str; 2]| {
        let [x, y] = axes.map(|name| format!(r#"{{"parameter": "{name}", "values": [1, 2]}}"#));
        let plan =
            format!(r#"{{"name": "dwell", "quantity": "growth_per_s", "axis": [{x}, {y}]}}"#);
        boundary().metadata("sweep.plan", &plan)
    };
    let folder = tempfile::tempdir().unwrap();
    let same = over(["unbalance_mass_kg", "damping_n_s_per_m"]).write(folder.path(), "a.parquet");
    let other = over(["unbalance_mass_kg", "tub_mass_kg"]).write(folder.path(), "b.parquet");
    let no_boundary = trace().write(folder.path(), "trace.parquet");
    let with = |path: &Path| Options { boundary: Some(path.to_owned()), ..Default::default() };
    let without = svg(map(), &plain());
    let figure = svg(map(), &with(&same));
    assert!(
        figure.contains(">traced boundary: no growth at any speed<"),
        "the legend names the line"
    );
    let dashed = |figure: &str| figure.matches("stroke-dasharray").count();
    // The line and its sign in the legend.
    assert_eq!(dashed(&figure), dashed(&without) + 2);
    for (path, format, said) in [
        (&other, "a.svg", "is a boundary over unbalance_mass_kg, tub_mass_kg"),
        (&no_boundary, "a.svg", "`sweep boundary` writes a boundary file"),
        (&same, "a.html", "`--boundary` is for maps drawn as .svg or .png"),
    ] {
        let refused = message(draw(map(), &with(path), format));
        assert!(refused.contains(said), "{refused}");
    }
    let own = svg(over(["unbalance_mass_kg", "damping_n_s_per_m"]), &plain());
    assert!(own.contains(">Where the machine may dwell at any speed<"), "the title");
}

/// A plan of the samples' machine, or of one with another tub.
fn plan(tub_mass_kg: f64, further: &str) -> String {
    format!(
        r#"{{"name": "one", {further} "spin": {{"peak_rpm": 300.0}}, "time": {{"end_s": 12.0}},
            "machine": {{"tub": {{"mass_kg": {tub_mass_kg:?}}}, "unbalance": {{"mass_kg": 0.4}},
                "dampers": [{{"damping_n_s_per_m": 120.0}}]}}}}"#
    )
}

#[test]
fn what_is_drawn_together_is_of_one_plan() {
    let folder = tempfile::tempdir().unwrap();
    let axes =
        r#""axis": [{"parameter": "unbalance_mass_kg"}, {"parameter": "damping_n_s_per_m"}],"#;
    let named = |file: Sample, tub: f64, name: &str| {
        let plan = plan(tub, axes);
        file.without("sweep.plan").metadata("sweep.plan", &plan).write(folder.path(), name)
    };
    let (own, other) = (24.0, 20.0);
    let map_of = || map().without("sweep.plan").metadata("sweep.plan", &plan(own, axes));
    let trace_of = || trace().metadata("sweep.plan", &plan(own, ""));
    let boundary =
        |tub, name| Options { boundary: Some(named(boundary(), tub, name)), ..Default::default() };
    svg(map_of(), &boundary(own, "b.parquet"));
    let said = message(draw(map_of(), &boundary(other, "c.parquet"), "a.svg"));
    assert!(said.contains("machine.tub.mass_kg 24.0 and 20.0"), "{said}");

    let stability_of = |tub, name| WasherFigures {
        stability: Some(named(stability(&[0.4]), tub, name)),
        ..Default::default()
    };
    svg(trace_of(), &stability_of(own, "s.parquet"));
    for file in [trace_of(), modes().metadata("sweep.plan", &plan(own, ""))] {
        let said = message(draw(file, &stability_of(other, "t.parquet"), "a.svg"));
        assert!(said.contains("`--stability`") && said.contains("24.0 and 20.0"), "{said}");
    }

    let modes_of = |tub, name, view| WasherFigures {
        modes: Some(named(modes(), tub, name)),
        view,
        ..Default::default()
    };
    for view in [None, Some(View::Passages)] {
        let same = svg(trace_of(), &modes_of(own, "m.parquet", view));
        assert!(!same.contains("another machine"));
        let warned = svg(trace_of(), &modes_of(other, "n.parquet", view));
        let said = "resonances of another machine: machine.tub.mass_kg 24.0 and 20.0";
        assert!(warned.contains(said), "the figure says so");
    }

    let traces = folder.path().join("traces");
    std::fs::create_dir(&traces).unwrap();
    let with = Options { traces: Some(traces.clone()), ..Default::default() };
    trace_of().write(&traces, "point-3.parquet");
    let carried = data(map_of(), &with);
    assert_eq!(carried["traces"].as_object().unwrap().keys().collect::<Vec<_>>(), ["29"]);
    let of_other = trace().metadata("sweep.plan", &plan(other, axes));
    of_other.write(&traces, "point-29.parquet");
    let said = message(draw(map_of(), &with, "a.html"));
    assert!(said.contains("point-29.parquet is of another plan than"), "{said}");
    // What says its point is of no other, whatever its number.
    let astray = trace().without("at").metadata("at", r#"{"unbalance_mass_kg": 7.0}"#);
    astray.write(&traces, "point-29.parquet");
    let said = message(draw(map_of(), &with, "a.html"));
    assert!(said.contains("belongs to no point of this map"), "{said}");
    // Its number alone: the plan's own unbalance and damping are those of the point.
    trace_of().without("at").write(&traces, "point-29.parquet");
    data(map_of(), &with);
    trace_of().without("at").write(&traces, "point-30.parquet");
    let said = message(draw(map_of(), &with, "a.html"));
    assert!(said.contains("damping_n_s_per_m 150.0 and 120.0"), "{said}");
}

#[test]
fn what_does_not_fit_is_refused_with_what_would() {
    let folder = tempfile::tempdir().unwrap();
    let one = stability(&[0.4]).write(folder.path(), "one.parquet");
    let two = stability(&[0.2, 0.7]).write(folder.path(), "two.parquet");
    let no_trace = trace().write(folder.path(), "trace.parquet");
    let with =
        |path: &Path| WasherFigures { stability: Some(path.to_owned()), ..Default::default() };
    let at = Options { at: vec![("tub_mass_kg".to_owned(), 1.0)], ..Default::default() };
    let value = Options { at: vec![("unbalance_mass_kg".to_owned(), 9.0)], ..Default::default() };
    for (result, said) in [
        (draw(trace(), &with(&no_trace), "a.svg"), "`sweep stability` writes a stability file"),
        (draw(stability(&[0.4]), &with(&one), "a.svg"), "`--stability` is for traces"),
        (draw(stability(&[0.4]), &viewed(View::Time), "a.svg"), "`--view` is for traces"),
        (draw(trace(), &viewed(View::Growth), "a.svg"), "`--view` is for stability files"),
        (draw(stability(&[0.4]), &at, "a.svg"), "it has unbalance_mass_kg"),
        (draw(stability(&[0.4]), &value, "a.svg"), "no such point"),
        (draw(modes(), &with(&two), "a.svg"), "two.parquet"),
    ] {
        let message = message(result);
        assert!(message.contains(said), "{said}: {message}");
    }
}
