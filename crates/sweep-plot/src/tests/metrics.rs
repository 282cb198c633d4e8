//! Tests of columns that belong to no channel: metrics of the machine and of its parts.

use serde_json::Value;

use super::super::sample::{SampleFile, map};
use super::{data, draw, message, one_axis, showing, svg};

/// Returns a map with columns whose bad direction is greater, and others whose is less.
fn with_metrics() -> SampleFile {
    let rising = |from: f64| (0..90).map(move |k| from + f64::from(k));
    map()
        .numbers("cabinet_force_nonlinear_n", "N", rising(400.0))
        .bad("greater", None)
        .numbers("cabinet_force_linear_n", "N", rising(300.0))
        .bad("greater", None)
        .numbers("stop_2_force_nonlinear_n", "N", rising(0.0))
        .bad("greater", None)
        .numbers("slip_margin_nonlinear_n", "N", rising(-45.0))
        .bad("less", Some(0.0))
        .numbers("static_sag_m", "m", rising(0.0).map(|k| 0.013 + 1e-5 * k))
        .bad("greater", None)
}

#[test]
fn metrics_are_drawn_by_their_column_names() {
    for (column, title, label) in [
        ("cabinet_force_linear_n", "Cabinet force, linear model", "cabinet force (N)"),
        ("stop_2_force_nonlinear_n", "Stop 2 force, nonlinear model", "stop 2 force (N)"),
        ("static_sag_m", "Static sag", "static sag (mm)"),
        ("slip_margin_nonlinear_n", "Slip margin, nonlinear model", "slip margin (N)"),
    ] {
        let figure = svg(with_metrics(), &showing(column));
        for phrase in [title, label] {
            assert!(figure.contains(&format!(">{phrase}<")), "{phrase}");
        }
    }
    let margin = svg(with_metrics(), &showing("slip_margin_nonlinear_n"));
    assert!(
        margin.contains(">boundary: slip margin 0 N<") && margin.contains(">slip margin below")
    );
    let data = data(with_metrics(), &showing("static_sag_m"));
    let names = |list: &Value, key: &str| -> Vec<String> {
        let list = list.as_array().unwrap().iter();
        list.map(|entry| entry[key].as_str().unwrap_or_default().to_owned()).collect()
    };
    assert_eq!(data["first"]["column"], "static_sag_m");
    let offered = names(&data["layers"], "column");
    assert_eq!(offered[..3], ["ratio_max", "ratio_body_yaw", "ratio_body_pitch"]);
    assert_eq!(offered[offered.len() - 2..], ["slip_margin_nonlinear_n", "static_sag_m"]);
    let worse = names(&data["layers"], "worse");
    assert_eq!(worse[worse.len() - 2..], ["less", "greater"]);
    let rows = names(&data["rows"], "name");
    let expected = [
        "least_gap",
        "margin",
        "fail_time",
        "cabinet_force",
        "stop_2_force",
        "slip_margin",
        "static_sag",
    ];
    assert_eq!(rows[2..], expected);
    for output in ["a.svg", "a.html"] {
        let phrase = message(draw(map(), &showing("static_sag_m"), output));
        assert!(
            phrase.contains("`--quantity static_sag_m`") && phrase.contains("status"),
            "{phrase}"
        );
    }
}

#[test]
fn a_two_sided_verdict_names_the_ratio_of_each_side() {
    let two_sided = || {
        let least = (0..90).map(|k| 0.3 + 0.01 * f64::from(k));
        map().numbers("ratio_min", "1", least).bad("less", Some(0.5))
    };
    let [most, least] = ["ratio_max", "ratio_min"].map(|name| svg(two_sided(), &showing(name)));
    assert!(most.contains(">ratio above 3<") && !most.contains("linear model reliable"));
    assert!(most.contains(">Where the linear model under-estimates<"));
    assert!(least.contains(">Where the linear model over-estimates<"));
    assert!(least.contains(">boundary: ratio 0.5<") && least.contains(">ratio below 0.5<"));
}

#[test]
fn metrics_have_a_panel_in_maps_of_one_axis() {
    let rising = (0..4).map(|k| 400.0 + f64::from(k));
    let curves = || {
        let sample = one_axis().numbers("stop_2_force_nonlinear_n", "N", rising.clone());
        sample.numbers("stop_2_force_linear_n", "N", rising.clone())
    };
    let figure = svg(curves(), &showing("stop_2_force_linear_n"));
    assert!(figure.contains(">Stop 2 force (N)<") && figure.contains(">linear model<"));
    assert!(!svg(curves(), &showing("ratio_max")).contains(">Stop 2 force (N)<"));
    let phrase = message(draw(one_axis(), &showing("clash_time_linear_s"), "a.svg"));
    assert!(phrase.contains("no such column"), "{phrase}");
}
