//! Metrics in figures: of the whole machine, and of single stops.

use serde_json::Value;

use super::sample::map;
use super::tests::{data, draw, message, one_axis, svg};
use super::*;

#[test]
fn single_stops_are_channels_of_their_quantity() {
    let with_stops = || {
        let rising = |from: f64| (0..90).map(move |k| from + f64::from(k));
        map()
            .numbers("stop_force_nonlinear_n", "N", rising(400.0))
            .numbers("stop_force_linear_n", "N", rising(0.0))
            .numbers("stop_1_force_nonlinear_n", "N", rising(400.0))
            .numbers("stop_1_force_linear_n", "N", rising(0.0))
            .numbers("stop_2_force_nonlinear_n", "N", rising(100.0))
            .numbers("stop_2_force_linear_n", "N", rising(0.0))
            .numbers("slip_margin_nonlinear_n", "N", rising(50.0))
    };
    let of = |quantity, channel: &str| PlotOptions {
        quantity,
        channels: vec![channel.to_owned()],
        ..PlotOptions::default()
    };
    let second = of(Quantity::StopForceNonlinear, "stop_2");
    let figure = svg(with_stops(), &second);
    assert!(figure.contains(">Greatest push of a stop, nonlinear model: stop 2<"));
    assert!(figure.contains(">greatest push in the window (N)<"));
    let data = data(with_stops(), &second);
    let layers = data["layers"].as_array().unwrap();
    let offered: Vec<_> = layers
        .iter()
        .filter(|layer| layer["group"] == "stop-force-nonlinear")
        .map(|layer| [&layer["channelWords"], &layer["column"]].map(|it| it.as_str().unwrap()))
        .collect();
    assert_eq!(
        offered,
        [
            ["all together", "stop_force_nonlinear_n"],
            ["stop 1", "stop_1_force_nonlinear_n"],
            ["stop 2", "stop_2_force_nonlinear_n"]
        ]
    );
    let row = data["rows"].as_array().unwrap().last().unwrap();
    assert_eq!(row["name"], "stop_2_force");
    assert_eq!(row["columns"][1], "stop_2_force_linear_n");
    for (options, expected) in [
        (of(Quantity::StopForceLinear, "stop_3"), "stop_1, stop_2"),
        (of(Quantity::SlipMarginNonlinear, "stop_1"), "belongs to no channel"),
    ] {
        let said = message(draw(with_stops(), &options, "a.svg"));
        assert!(said.contains(expected), "{said}");
    }
}

#[test]
fn over_one_axis_a_single_stop_has_a_panel() {
    let with_stops = || {
        ["stop_force", "stop_1_force", "stop_2_force"].into_iter().fold(
            one_axis(),
            |sample, name| {
                let rising = (0..4).map(|k| 400.0 + f64::from(k));
                let sample = sample.numbers(&format!("{name}_nonlinear_n"), "N", rising.clone());
                sample.numbers(&format!("{name}_linear_n"), "N", rising)
            },
        )
    };
    let asked = |channels: &[&str]| {
        let channels = channels.iter().map(|&channel| channel.to_owned()).collect();
        let quantity = Quantity::StopForceNonlinear;
        svg(with_stops(), &PlotOptions { quantity, channels, ..PlotOptions::default() })
    };
    let [of_all, of_second] =
        [">Greatest push of a stop (N)<", ">Greatest push of a stop: stop 2 (N)<"];
    let [all, second] = [asked(&[]), asked(&["stop_2"])];
    assert!(all.contains(of_all) && !all.contains(of_second));
    assert!(!second.contains(of_all) && second.contains(of_second));
}

#[test]
fn metrics_are_drawn_where_the_run_has_them() {
    let with_metrics = || {
        let rising = |from: f64| (0..90).map(move |k| from + f64::from(k));
        map()
            .numbers("cabinet_force_nonlinear_n", "N", rising(400.0))
            .numbers("cabinet_force_linear_n", "N", rising(300.0))
            .numbers("clash_time_nonlinear_s", "s", rising(0.0))
            .numbers("static_sag_m", "m", rising(0.0).map(|k| 0.013 + 1e-5 * k))
    };
    let asked = |quantity| PlotOptions { quantity, ..PlotOptions::default() };
    for (quantity, title, label) in [
        (
            Quantity::CabinetForceLinear,
            ">Greatest force on the cabinet, linear model<",
            ">greatest force in the window (N)<",
        ),
        (
            Quantity::ClashTimeNonlinear,
            ">Time of clash between drum and tub, nonlinear model<",
            ">time of clash in the window (s)<",
        ),
        (Quantity::StaticSag, ">Static sag of the tub<", ">static sag of the tub (mm)<"),
    ] {
        let figure = svg(with_metrics(), &asked(quantity));
        assert!(figure.contains(title) && figure.contains(label), "{title} {label}");
    }
    let data = data(with_metrics(), &asked(Quantity::StaticSag));
    let names = |list: &Value, of: fn(&Value) -> &Value| -> Vec<String> {
        let list = list.as_array().unwrap().iter();
        list.map(|entry| of(entry).as_str().unwrap().to_owned()).collect()
    };
    assert_eq!(data["first"]["group"], "static-sag");
    let offered = names(&data["quantities"], |entry| &entry[0]);
    assert!(offered.ends_with(&[
        "cabinet-force-nonlinear".to_owned(),
        "cabinet-force-linear".to_owned(),
        "clash-time-nonlinear".to_owned(),
        "static-sag".to_owned(),
        "status".to_owned()
    ]));
    let rows = names(&data["rows"], |row| &row["name"]);
    assert_eq!(rows[2..], ["gap", "cabinet_force", "clash_time", "static_sag"]);
    for output in ["a.svg", "a.html"] {
        let said = message(draw(map(), &asked(Quantity::StaticSag), output));
        let known = "`--quantity static-sag`";
        assert!(said.contains(known) && said.contains("it has ratio, nonlinear, linear"), "{said}");
    }
    let said = message(draw(one_axis(), &asked(Quantity::ClashTimeLinear), "a.svg"));
    assert!(said.contains("no such quantity"), "{said}");
    let force = (0..4).map(|k| 400.0 + f64::from(k));
    let curves = one_axis().numbers("cabinet_force_nonlinear_n", "N", force);
    let figure = svg(curves, &asked(Quantity::CabinetForceNonlinear));
    assert!(figure.contains(">Greatest force on the cabinet (N)<"));
}
