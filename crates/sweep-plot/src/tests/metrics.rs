//! Tests of columns that belong to no channel: metrics of the machine and of its parts.

use serde_json::Value;

use super::super::sample::{SampleFile, map_sample};
use super::{draw, draw_page_data, draw_svg, error_message, map_of_one_axis, options_for_column};

/// Returns a map with columns whose bad direction is greater, and others whose is less.
fn map_with_metrics() -> SampleFile {
    let rising_values = |from: f64| (0..90).map(move |k| from + f64::from(k));
    map_sample()
        .numbers("cabinet_force_nonlinear_n", "N", rising_values(400.0))
        .with_worse("greater", None)
        .numbers("cabinet_force_linear_n", "N", rising_values(300.0))
        .with_worse("greater", None)
        .numbers("stop_2_force_nonlinear_n", "N", rising_values(0.0))
        .with_worse("greater", None)
        .numbers("slip_margin_nonlinear_n", "N", rising_values(-45.0))
        .with_worse("less", Some(0.0))
        .numbers("static_sag_m", "m", rising_values(0.0).map(|k| 0.013 + 1e-5 * k))
        .with_worse("greater", None)
}

#[test]
fn metrics_are_drawn_by_their_column_names() {
    for (column, title, label) in [
        ("cabinet_force_linear_n", "Cabinet force, linear model", "cabinet force (N)"),
        ("stop_2_force_nonlinear_n", "Stop 2 force, nonlinear model", "stop 2 force (N)"),
        ("static_sag_m", "Static sag", "static sag (mm)"),
        ("slip_margin_nonlinear_n", "Slip margin, nonlinear model", "slip margin (N)"),
    ] {
        let figure = draw_svg(map_with_metrics(), &options_for_column(column));
        for phrase in [title, label] {
            assert!(figure.contains(&format!(">{phrase}<")), "{phrase}");
        }
    }
    let figure_of_margin =
        draw_svg(map_with_metrics(), &options_for_column("slip_margin_nonlinear_n"));
    assert!(
        figure_of_margin.contains(">boundary: slip margin 0 N<")
            && figure_of_margin.contains(">slip margin below")
    );
    let data = draw_page_data(map_with_metrics(), &options_for_column("static_sag_m"));
    let values_of_key = |list: &Value, key: &str| -> Vec<String> {
        let list = list.as_array().unwrap().iter();
        list.map(|entry| entry[key].as_str().unwrap_or_default().to_owned()).collect()
    };
    assert_eq!(data["first"]["column"], "static_sag_m");
    let layer_columns = values_of_key(&data["layers"], "column");
    assert_eq!(layer_columns[..3], ["ratio_max", "ratio_body_yaw", "ratio_body_pitch"]);
    assert_eq!(
        layer_columns[layer_columns.len() - 2..],
        ["slip_margin_nonlinear_n", "static_sag_m"]
    );
    let bad_directions = values_of_key(&data["layers"], "worse");
    assert_eq!(bad_directions[bad_directions.len() - 2..], ["less", "greater"]);
    let row_names = values_of_key(&data["rows"], "name");
    let expected_names = [
        "least_gap",
        "margin",
        "fail_time",
        "cabinet_force",
        "stop_2_force",
        "slip_margin",
        "static_sag",
    ];
    assert_eq!(row_names[2..], expected_names);
    for output in ["a.svg", "a.html"] {
        let phrase = error_message(draw(map_sample(), &options_for_column("static_sag_m"), output));
        assert!(
            phrase.contains("`--quantity static_sag_m`") && phrase.contains("status"),
            "{phrase}"
        );
    }
}

#[test]
fn a_two_sided_verdict_names_the_ratio_of_each_side() {
    let map_with_two_limits = || {
        let least_ratios = (0..90).map(|k| 0.3 + 0.01 * f64::from(k));
        map_sample().numbers("ratio_min", "1", least_ratios).with_worse("less", Some(0.5))
    };
    let [figure_of_max, least_ratios] = ["ratio_max", "ratio_min"]
        .map(|name| draw_svg(map_with_two_limits(), &options_for_column(name)));
    assert!(
        figure_of_max.contains(">ratio above 3<")
            && !figure_of_max.contains("linear model reliable")
    );
    assert!(figure_of_max.contains(">Where the linear model under-estimates<"));
    assert!(least_ratios.contains(">Where the linear model over-estimates<"));
    assert!(
        least_ratios.contains(">boundary: ratio 0.5<")
            && least_ratios.contains(">ratio below 0.5<")
    );
}

#[test]
fn metrics_have_a_panel_in_maps_of_one_axis() {
    let rising_values = (0..4).map(|k| 400.0 + f64::from(k));
    let with_force = || {
        let sample =
            map_of_one_axis().numbers("stop_2_force_nonlinear_n", "N", rising_values.clone());
        sample.numbers("stop_2_force_linear_n", "N", rising_values.clone())
    };
    let figure = draw_svg(with_force(), &options_for_column("stop_2_force_linear_n"));
    assert!(figure.contains(">Stop 2 force (N)<") && figure.contains(">linear model<"));
    assert!(
        !draw_svg(with_force(), &options_for_column("ratio_max")).contains(">Stop 2 force (N)<")
    );
    let phrase =
        error_message(draw(map_of_one_axis(), &options_for_column("clash_time_linear_s"), "a.svg"));
    assert!(phrase.contains("no such column"), "{phrase}");
}
