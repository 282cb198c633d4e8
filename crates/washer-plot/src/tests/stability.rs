//! Tests of figures of stability files, and of unstable speeds in other figures.

use std::path::Path;

use super::sample::{SampleFile, boundary_sample, map_sample};
use super::*;

/// Returns points of these unbalances over 200 to 300 rpm. Growth exceeds 0 from 230 to 250 rpm, in
/// proportion to the unbalance.
pub(super) fn stability(masses: &[f64]) -> SampleFile {
    let rows: Vec<(f64, f64)> = masses
        .iter()
        .flat_map(|&mass| (0..=20).map(move |k| (mass, 200.0 + 5.0 * f64::from(k))))
        .collect();
    let growth = |&(mass, speed): &(f64, f64)| mass * (10.0 - (speed - 240.0).abs()) / 10.0;
    let is_unstable = |row: &(f64, f64)| growth(row) > 0.0;
    let frequency_while_unstable =
        |value: f64| move |row: &(f64, f64)| if is_unstable(row) { value } else { f64::NAN };
    let kind_name =
        |row: &(f64, f64)| Some(if is_unstable(row) { "quasi_periodic" } else { "stable" });
    SampleFile::default()
        .counts("point", rows.iter().map(|row| (row.0 * 10.0) as u64))
        .numbers("unbalance_mass_kg", "kg", rows.iter().map(|row| row.0))
        .numbers("speed_rpm", "rpm", rows.iter().map(|row| row.1))
        .numbers("growth_per_s", "1/s", rows.iter().map(growth))
        .words("kind", rows.iter().map(kind_name))
        .numbers("mode_1_cpm", "1/min", rows.iter().map(frequency_while_unstable(86.0)))
        .numbers("mode_2_cpm", "1/min", rows.iter().map(frequency_while_unstable(202.0)))
        .numbers("nonlinear_tub_yaw", "rad", rows.iter().map(|row| 0.002 * row.0))
        .numbers("linear_tub_yaw", "rad", rows.iter().map(|row| 0.001 * row.0))
        .words("status", rows.iter().map(|_| Some("ok")))
        .with_metadata("sweep.plan", r#"{"name": "dwell"}"#)
}

fn draw_chart(sample: SampleFile, options: &impl DrawOptions) -> Value {
    page_data(&draw(sample, options, "figure.html").unwrap())["chart"].clone()
}

fn ranges(shaded_ranges: &Value) -> Vec<[f64; 2]> {
    let range_ends = |range: &Value| [0, 1].map(|end| range[end].as_f64().unwrap());
    shaded_ranges.as_array().unwrap().iter().map(range_ends).collect()
}

#[test]
fn growth_of_one_point_is_shaded_between_its_marked_edges() {
    let chart = draw_chart(stability(&[0.4]), &default_options());
    assert_eq!(ranges(&chart["shades"]), [[230.0, 250.0]]);
    let marks: Vec<&str> =
        chart["marks"].as_array().unwrap().iter().map(|mark| mark[1].as_str().unwrap()).collect();
    assert_eq!(marks, ["230 rpm", "250 rpm"]);
    let figure = draw_svg(stability(&[0.4]), &default_options());
    for text in [
        "dwell · unbalance mass 0.4 kg",
        "speeds at which the periodic response is unstable",
        "230 rpm",
    ] {
        assert!(figure.contains(text), "{text}");
    }
}

#[test]
fn each_point_has_a_curve_up_to_a_maximum() {
    let curve_names = |masses: &[f64], fixed_values: Vec<(String, f64)>| -> Vec<String> {
        let options = PlotOptions { fixed_values, ..PlotOptions::default() };
        let chart = draw_chart(stability(masses), &options);
        let series = chart["panels"][0]["series"].as_array().unwrap().clone();
        series.iter().map(|curve| curve["name"].as_str().unwrap().to_owned()).collect()
    };
    assert_eq!(
        curve_names(&[0.2, 0.4], Vec::new()),
        ["Unbalance mass 0.2 kg", "Unbalance mass 0.4 kg"]
    );
    let many_masses: Vec<f64> = (1..=20).map(|k| 0.05 * f64::from(k)).collect();
    let shown_names = curve_names(&many_masses, Vec::new());
    assert_eq!((shown_names.len(), shown_names[5].as_str()), (6, "Unbalance mass 1 kg"));
    assert_eq!(curve_names(&[0.2, 0.4], vec![("unbalance_mass_kg".to_owned(), 0.4)]), ["growth"]);
}

#[test]
fn unstable_responses_are_dashed() {
    let chart = draw_chart(stability(&[0.4]), &with_view(FigureView::Responses));
    let series = chart["panels"][0]["series"].as_array().unwrap().clone();
    let names_and_styles: Vec<(&str, bool)> = series
        .iter()
        .map(|curve| (curve["name"].as_str().unwrap(), curve["dashed"].as_bool().unwrap()))
        .collect();
    assert_eq!(
        names_and_styles,
        [
            ("linear model", false),
            ("nonlinear model, stable", false),
            ("nonlinear model, unstable", true)
        ]
    );
    assert_eq!(ranges(&chart["shades"]), [[230.0, 250.0]]);
    let error =
        error_message(draw(stability(&[0.2, 0.4]), &with_view(FigureView::Responses), "a.svg"));
    assert!(
        error.contains("has 2 points") && error.contains("--at NAME=VALUE for unbalance"),
        "{error}"
    );
}

#[test]
fn other_figures_shade_unstable_speeds() {
    let folder = tempfile::tempdir().unwrap();
    let path = stability(&[0.4]).write(folder.path(), "stability.parquet");
    let options = WasherFigures { stability: Some(path.clone()), ..WasherFigures::default() };
    let chart = draw_chart(trace(), &options);
    let file = trace().write(folder.path(), "trace.parquet");
    let table = FigureTable::open(&file, MODEL_KINDS).unwrap();
    let times_s = table.numbers("time_s").unwrap();
    let speeds_rpm = table.numbers("speed_rpm").unwrap();
    let shaded_ranges = ranges(&chart["shades"]);
    assert!(!shaded_ranges.is_empty());
    for (time_s, speed_rpm) in times_s.iter().zip(speeds_rpm) {
        let is_shaded = shaded_ranges.iter().any(|[from, to]| (from..=to).contains(&time_s));
        let is_inside = (230.0..=250.0).contains(speed_rpm);
        let is_at_an_edge = (speed_rpm - 230.0).abs() < 1e-6 || (speed_rpm - 250.0).abs() < 1e-6;
        assert!(is_shaded == is_inside || is_at_an_edge, "{time_s} s, {speed_rpm} rpm");
    }
    let chart = draw_chart(modes(), &options);
    assert_eq!(ranges(&chart["shades"]), [[230.0, 250.0]]);
    let names: Vec<String> = chart["panels"][0]["series"]
        .as_array()
        .unwrap()
        .iter()
        .map(|curve| curve["name"].as_str().unwrap().to_owned())
        .collect();
    let sum_name = "sum of the frequencies of modes 1 and 2";
    assert!(names.iter().any(|name| name == sum_name), "{names:?}");
}

#[test]
fn a_map_shows_the_curve_of_a_boundary_over_its_axes() {
    let boundary_over = |axes: [&str; 2]| {
        let [x, y] = axes.map(|name| format!(r#"{{"parameter": "{name}", "values": [1, 2]}}"#));
        let plan =
            format!(r#"{{"name": "dwell", "quantity": "growth_per_s", "axis": [{x}, {y}]}}"#);
        boundary_sample().with_metadata("sweep.plan", &plan)
    };
    let folder = tempfile::tempdir().unwrap();
    let same_axes =
        boundary_over(["unbalance_mass_kg", "damping_n_s_per_m"]).write(folder.path(), "a.parquet");
    let other_axes =
        boundary_over(["unbalance_mass_kg", "tub_mass_kg"]).write(folder.path(), "b.parquet");
    let no_boundary = trace().write(folder.path(), "trace.parquet");
    let with_boundary =
        |path: &Path| PlotOptions { boundary: Some(path.to_owned()), ..Default::default() };
    let figure_without = draw_svg(map_sample(), &default_options());
    let figure = draw_svg(map_sample(), &with_boundary(&same_axes));
    assert!(
        figure.contains(">traced boundary: no growth at any speed<"),
        "the legend names the line"
    );
    let count_dashed = |figure: &str| figure.matches("stroke-dasharray").count();
    // The legend has a symbol of the line.
    assert_eq!(count_dashed(&figure), count_dashed(&figure_without) + 2);
    for (path, format, phrase) in [
        (&other_axes, "a.svg", "is a boundary over unbalance_mass_kg, tub_mass_kg"),
        (&no_boundary, "a.svg", "`sweep boundary` writes a boundary file"),
        (&same_axes, "a.html", "`--boundary` is for maps drawn as .svg, .pdf or .png"),
    ] {
        let error = error_message(draw(map_sample(), &with_boundary(path), format));
        assert!(error.contains(phrase), "{error}");
    }
    let figure_of_boundary =
        draw_svg(boundary_over(["unbalance_mass_kg", "damping_n_s_per_m"]), &default_options());
    assert!(figure_of_boundary.contains(">Where the machine may dwell at any speed<"), "the title");
}

/// Returns a plan of the samples' machine with this mass of the tub.
fn plan(tub_mass_kg: f64, further: &str) -> String {
    format!(
        r#"{{"name": "one", {further} "spin": {{"peak_rpm": 300.0}}, "time": {{"end_s": 12.0}},
            "machine": {{"tub": {{"mass_kg": {tub_mass_kg:?}}}, "unbalance": {{"mass_kg": 0.4}},
                "dampers": [{{"damping_n_s_per_m": 120.0}}]}}}}"#
    )
}

#[test]
fn files_of_different_plans_are_not_drawn_together() {
    let folder = tempfile::tempdir().unwrap();
    let axes =
        r#""axis": [{"parameter": "unbalance_mass_kg"}, {"parameter": "damping_n_s_per_m"}],"#;
    let write_with_plan = |file: SampleFile, tub: f64, name: &str| {
        let plan = plan(tub, axes);
        file.without_metadata("sweep.plan")
            .with_metadata("sweep.plan", &plan)
            .write(folder.path(), name)
    };
    let own_mass = 24.0;
    let other_mass = 20.0;
    let map_with_plan = || {
        map_sample()
            .without_metadata("sweep.plan")
            .with_metadata("sweep.plan", &plan(own_mass, axes))
    };
    let trace_with_plan = || trace().with_metadata("sweep.plan", &plan(own_mass, ""));
    let options_with_boundary = |tub, name| PlotOptions {
        boundary: Some(write_with_plan(boundary_sample(), tub, name)),
        ..Default::default()
    };
    draw_svg(map_with_plan(), &options_with_boundary(own_mass, "b.parquet"));
    let phrase = error_message(draw(
        map_with_plan(),
        &options_with_boundary(other_mass, "c.parquet"),
        "a.svg",
    ));
    assert!(phrase.contains("machine.tub.mass_kg 24.0 and 20.0"), "{phrase}");

    let options_with_stability = |tub, name| WasherFigures {
        stability: Some(write_with_plan(stability(&[0.4]), tub, name)),
        ..Default::default()
    };
    draw_svg(trace_with_plan(), &options_with_stability(own_mass, "s.parquet"));
    for file in [trace_with_plan(), modes().with_metadata("sweep.plan", &plan(own_mass, ""))] {
        let phrase =
            error_message(draw(file, &options_with_stability(other_mass, "t.parquet"), "a.svg"));
        assert!(phrase.contains("`--stability`") && phrase.contains("24.0 and 20.0"), "{phrase}");
    }

    let options_with_modes = |tub, name, view| WasherFigures {
        modes: Some(write_with_plan(modes(), tub, name)),
        view,
        ..Default::default()
    };
    for view in [None, Some(FigureView::Passages)] {
        let figure = draw_svg(trace_with_plan(), &options_with_modes(own_mass, "m.parquet", view));
        assert!(!figure.contains("another machine"));
        let figure_with_note =
            draw_svg(trace_with_plan(), &options_with_modes(other_mass, "n.parquet", view));
        let phrase = "resonances of another machine: machine.tub.mass_kg 24.0 and 20.0";
        assert!(figure_with_note.contains(phrase), "the figure says so");
    }

    let traces = folder.path().join("traces");
    std::fs::create_dir(&traces).unwrap();
    let with_traces = PlotOptions { traces: Some(traces.clone()), ..Default::default() };
    trace_with_plan().write(&traces, "point-3.parquet");
    let page_data = draw_page_data(map_with_plan(), &with_traces);
    assert_eq!(page_data["traces"].as_object().unwrap().keys().collect::<Vec<_>>(), ["29"]);
    let other_trace = trace().with_metadata("sweep.plan", &plan(other_mass, axes));
    other_trace.write(&traces, "point-29.parquet");
    let phrase = error_message(draw(map_with_plan(), &with_traces, "a.html"));
    assert!(phrase.contains("point-29.parquet is of another plan than"), "{phrase}");
    // A file whose metadata give its point belongs to that point only, in spite of the number in
    // its name.
    let trace_elsewhere =
        trace().without_metadata("at").with_metadata("at", r#"{"unbalance_mass_kg": 7.0}"#);
    trace_elsewhere.write(&traces, "point-29.parquet");
    let phrase = error_message(draw(map_with_plan(), &with_traces, "a.html"));
    assert!(phrase.contains("belongs to no point of this map"), "{phrase}");
    // A file with its number alone has the point's unbalance and damping in its plan.
    trace_with_plan().without_metadata("at").write(&traces, "point-29.parquet");
    draw_page_data(map_with_plan(), &with_traces);
    trace_with_plan().without_metadata("at").write(&traces, "point-30.parquet");
    let phrase = error_message(draw(map_with_plan(), &with_traces, "a.html"));
    assert!(phrase.contains("damping_n_s_per_m 150.0 and 120.0"), "{phrase}");
}

#[test]
fn files_that_do_not_fit_an_option_are_rejected() {
    let folder = tempfile::tempdir().unwrap();
    let one_point = stability(&[0.4]).write(folder.path(), "one.parquet");
    let two_points = stability(&[0.2, 0.7]).write(folder.path(), "two.parquet");
    let no_trace = trace().write(folder.path(), "trace.parquet");
    let with_stability =
        |path: &Path| WasherFigures { stability: Some(path.to_owned()), ..Default::default() };
    let unknown_axis =
        PlotOptions { fixed_values: vec![("tub_mass_kg".to_owned(), 1.0)], ..Default::default() };
    let unknown_value = PlotOptions {
        fixed_values: vec![("unbalance_mass_kg".to_owned(), 9.0)],
        ..Default::default()
    };
    for (result, phrase) in [
        (
            draw(trace(), &with_stability(&no_trace), "a.svg"),
            "`sweep stability` writes a stability file",
        ),
        (
            draw(stability(&[0.4]), &with_stability(&one_point), "a.svg"),
            "`--stability` is for traces",
        ),
        (draw(stability(&[0.4]), &with_view(FigureView::Time), "a.svg"), "`--view` is for traces"),
        (draw(trace(), &with_view(FigureView::Growth), "a.svg"), "`--view` is for stability files"),
        (draw(stability(&[0.4]), &unknown_axis, "a.svg"), "it has unbalance_mass_kg"),
        (draw(stability(&[0.4]), &unknown_value, "a.svg"), "no such point"),
        (draw(modes(), &with_stability(&two_points), "a.svg"), "two.parquet"),
    ] {
        let message = error_message(result);
        assert!(message.contains(phrase), "{phrase}: {message}");
    }
}
