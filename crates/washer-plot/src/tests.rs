//! Tests of figures drawn from sample files.

mod damaged;
#[path = "../../sweep-plot/src/sample.rs"]
mod sample;
mod stability;

use std::io::Read as _;
use std::path::Path;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde_json::Value;

use self::sample::{SampleFile, map_sample};
use super::*;

/// Options with which a test draws.
trait DrawOptions {
    fn draw(&self, input: &Path, output: &Path) -> Result<(), PlotError>;
}

impl DrawOptions for PlotOptions {
    fn draw(&self, input: &Path, output: &Path) -> Result<(), PlotError> {
        sweep_plot::render(input, self, &WasherFigures::default(), output)
    }
}

impl DrawOptions for WasherFigures {
    fn draw(&self, input: &Path, output: &Path) -> Result<(), PlotError> {
        sweep_plot::render(input, &PlotOptions::default(), self, output)
    }
}

fn draw(
    sample: SampleFile,
    options: &impl DrawOptions,
    output: &str,
) -> Result<Vec<u8>, PlotError> {
    let folder = tempfile::tempdir().unwrap();
    let input = sample.write(folder.path(), "input.parquet");
    let output = folder.path().join(output);
    options.draw(&input, &output)?;
    Ok(std::fs::read(output).unwrap())
}

fn draw_svg(sample: SampleFile, options: &impl DrawOptions) -> String {
    String::from_utf8(draw(sample, options, "figure.svg").unwrap()).unwrap()
}

fn draw_page_data(sample: SampleFile, options: &impl DrawOptions) -> Value {
    page_data(&draw(sample, options, "figure.html").unwrap())
}

/// Returns the data that a page carries.
fn page_data(page: &[u8]) -> Value {
    let page = std::str::from_utf8(page).unwrap();
    let data_start = page.find(r#"id="data">"#).unwrap() + r#"id="data">"#.len();
    serde_json::from_str(
        &page[data_start..data_start + page[data_start..].find("</script>").unwrap()],
    )
    .unwrap()
}

/// Decodes a curve of a page.
fn decode_curve(text: &Value) -> Vec<f64> {
    let bytes = STANDARD.decode(text.as_str().unwrap()).unwrap();
    bytes.chunks(4).map(|four| f64::from(f32::from_le_bytes(four.try_into().unwrap()))).collect()
}

fn error_message(result: Result<Vec<u8>, PlotError>) -> String {
    result.unwrap_err().to_string()
}

/// Returns the default options.
fn default_options() -> PlotOptions {
    PlotOptions::default()
}

/// Returns a trace of twelve seconds of both models, to 300 rpm and back.
pub(crate) fn trace() -> SampleFile {
    let times_s: Vec<f64> = (0..=6000).map(|k| 0.002 * f64::from(k)).collect();
    let oscillation = |factor: f64| {
        times_s.iter().map(move |t| factor * (t / 12.0) * (20.0 * t).sin()).collect::<Vec<f64>>()
    };
    SampleFile::default()
        .numbers("time_s", "s", times_s.iter().copied())
        .numbers("speed_rpm", "rpm", times_s.iter().map(|t| 50.0 * (6.0 - (t - 6.0).abs())))
        .numbers("nonlinear_tub_yaw", "rad", oscillation(0.07))
        .numbers("nonlinear_drum_front_y", "m", oscillation(0.03))
        .numbers("linear_tub_yaw", "rad", oscillation(0.009))
        .numbers("linear_drum_front_y", "m", oscillation(0.02))
        .numbers("gap_nonlinear_m", "m", oscillation(0.002).into_iter().map(|g| 0.01 - g.abs()))
        .numbers("gap_linear_m", "m", oscillation(0.001).into_iter().map(|g| 0.01 - g.abs()))
        .with_metadata("at", r#"{"unbalance_mass_kg": 0.4, "damping_n_s_per_m": 120.0}"#)
}

/// Returns two modes that cross the speed at 100 and 200 rpm, and one far above.
pub(crate) fn modes() -> SampleFile {
    let rows: Vec<(f64, u64)> =
        (0..=30).flat_map(|k| (1..=3).map(move |mode| (20.0 * f64::from(k), mode))).collect();
    let frequency = |&(speed, mode): &(f64, u64)| match mode {
        1 => 110.0 - 0.1 * speed,
        2 => 190.0 + 0.05 * speed,
        _ => 4000.0,
    };
    SampleFile::default()
        .numbers("speed_rpm", "rpm", rows.iter().map(|row| row.0))
        .counts("mode", rows.iter().map(|row| row.1))
        .numbers("frequency_rpm", "rpm", rows.iter().map(frequency))
        .numbers("frequency_hz", "Hz", rows.iter().map(|row| frequency(row) / 60.0))
        .numbers("frequency_min_rpm", "rpm", rows.iter().map(|row| frequency(row) * 0.99))
        .numbers("frequency_max_rpm", "rpm", rows.iter().map(|row| frequency(row) * 1.01))
}

#[test]
fn a_trace_shows_requested_channels_and_passed_resonances() {
    let folder = tempfile::tempdir().unwrap();
    let options = WasherFigures {
        channels: vec!["drum_front_y".to_owned()],
        resonances_rpm: vec![150.0],
        modes: Some(modes().write(folder.path(), "modes.parquet")),
        ..WasherFigures::default()
    };
    let figure = draw_svg(trace(), &options);
    for phrase in
        [">Drum front, vertical<", ">Gap, drum to tub<", ">Spin (rpm)<", ">resonance speed passed<"]
    {
        assert!(figure.contains(phrase), "{phrase}");
    }
    assert!(!figure.contains("Tub yaw"));
    for speed in ["100 rpm", "150 rpm", "200 rpm"] {
        assert_eq!(
            figure.matches(&format!(">{speed}<")).count(),
            2,
            "{speed}: on the way up and down"
        );
    }
    assert!(
        figure.len() < 120_000,
        "6001 samples are thinned to what the picture shows: {}",
        figure.len()
    );
}

#[test]
fn a_trace_shows_forces_on_request() {
    let with_forces = || {
        trace().numbers("cabinet_force_y_nonlinear_n", "N", (0..=6000).map(f64::from)).numbers(
            "cabinet_force_y_linear_n",
            "N",
            (0..=6000).map(f64::from),
        )
    };
    let force =
        WasherFigures { channels: vec!["cabinet_force_y".to_owned()], ..WasherFigures::default() };
    let figure = draw_svg(with_forces(), &force);
    assert!(figure.contains(">Cabinet force y (N)<") && figure.contains(">linear model<"));
    assert!(!draw_svg(with_forces(), &default_options()).contains("Cabinet force"));
}

#[test]
fn a_trace_is_compared_with_another() {
    let folder = tempfile::tempdir().unwrap();
    let other_trace = SampleFile::default()
        .numbers("time_s", "s", [0.0, 6.0, 12.0])
        .numbers("nonlinear_tub_yaw", "rad", [0.0, 0.09, 0.0])
        .with_metadata("sweep.plan", r#"{"name": "another program"}"#);
    let options_against = |path| WasherFigures { against: Some(path), ..WasherFigures::default() };
    let data = draw_page_data(
        trace(),
        &options_against(other_trace.write(folder.path(), "other.parquet")),
    );
    let yaw_series = &data["chart"]["panels"][0]["series"];
    let name_and_grid = |k: usize| {
        (
            yaw_series[k]["name"].as_str().unwrap().to_owned(),
            yaw_series[k]["grid"].as_u64().unwrap(),
        )
    };
    assert_eq!(name_and_grid(0), ("input".to_owned(), 0), "by its file where it has no name");
    assert_eq!(
        (name_and_grid(1), yaw_series.as_array().unwrap().len()),
        (("another program".to_owned(), 1), 2)
    );
    assert!(
        draw_svg(trace(), &options_against(trace().write(folder.path(), "same.parquet")))
            .contains("difference 0.0e0 of")
    );
    let modes = options_against(modes().write(folder.path(), "modes.parquet"));
    assert!(
        error_message(draw(trace(), &modes, "a.svg"))
            .contains("this is a modes file; `sweep trace`")
    );
}

#[test]
fn a_campbell_diagram_stars_the_resonances() {
    let figure = draw_svg(modes(), &default_options());
    for phrase in [">100.0 rpm<", ">200.0 rpm<", ">frequency = spin speed<", "1 mode lies above"] {
        assert!(figure.contains(phrase), "{phrase}");
    }
}

fn with_view(view: FigureView) -> WasherFigures {
    WasherFigures { view: Some(view), ..WasherFigures::default() }
}

#[test]
fn the_variation_over_a_turn_is_half_the_range() {
    let figure = draw_svg(modes(), &with_view(FigureView::Variation));
    for phrase in [">Variation over a turn (± % of the mean)<", ">100.0 rpm<", ">200.0 rpm<"] {
        assert!(figure.contains(phrase), "{phrase}");
    }
    let data = draw_page_data(modes(), &with_view(FigureView::Variation));
    let series = data["chart"]["panels"][0]["series"].as_array().unwrap();
    // The third mode has no resonance.
    assert_eq!(series.len(), 2);
    for series in series {
        let curve = decode_curve(&series["y"]);
        assert!(curve.len() == 31 && curve.iter().all(|y| (y - 1.0).abs() < 1e-6), "{curve:?}");
    }
}

#[test]
fn mode_shapes_are_read_from_the_file() {
    let q = |i: usize, re: f64| if [5, 7].contains(&i) { [re, 0.0] } else { [0.0, 0.0] };
    let shape: serde_json::Map<String, Value> =
        (1..=10).map(|i| (format!("q{i}"), serde_json::json!(q(i, -0.3)))).collect();
    let modes_in_file = serde_json::json!([
        { "mode": 1, "name": "rocking, horizontal \
                   plane", "resonances": [{ "speed_rpm": 100.06, "shape": shape }] },
        { "name": "drum bending on its shaft", "resonances": [] },
    ]);
    let machine = serde_json::json!({ "machine": {
        "bearings": { "rear_x_m": -0.05 }, "tub": { "front_x_m": 0.45 },
        "drum": { "hinge_x_m": 0.15, "front_x_m": 0.45 },
    } });
    let file = || modes().with_metadata("sweep.plan", &machine.to_string());
    let with_shapes = || file().with_metadata("sweep.modes", &modes_in_file.to_string());
    let figure = draw_svg(with_shapes(), &with_view(FigureView::Shapes));
    for phrase in
        [">Rocking, horizontal plane,<", ">100.1 rpm<", ">horizontal, a quarter of a period later<"]
    {
        assert!(figure.contains(phrase), "{phrase}");
    }
    let figure_of_frequencies = draw_svg(with_shapes(), &default_options());
    assert!(figure_of_frequencies.contains(">100.1 rpm<"), "the same in all figures of a file");
    let page_data = draw_page_data(with_shapes(), &with_view(FigureView::Shapes));
    let panels = page_data["chart"]["panels"].as_array().unwrap();
    assert_eq!(panels.len(), 1);
    assert_eq!(decode_curve(&panels[0]["series"][2]["y"])[1], 1.0);
    assert!(
        error_message(draw(file(), &with_view(FigureView::Shapes), "a.svg"))
            .contains("holds no resonance")
    );
    assert!(
        error_message(draw(modes(), &with_view(FigureView::Shapes), "a.svg"))
            .contains("where the machine's parts are")
    );
}

#[test]
fn passages_are_drawn_for_rising_and_falling_speed() {
    let options = WasherFigures {
        channels: vec!["tub_yaw".to_owned()],
        resonances_rpm: vec![150.0],
        ..with_view(FigureView::Passages)
    };
    let figure = draw_svg(trace(), &options);
    for phrase in [
        ">Spin speed (rpm)<",
        ">nonlinear model, speed rising<",
        ">linear model, speed falling<",
        ">150 rpm<",
    ] {
        assert!(figure.contains(phrase), "{phrase}");
    }
    assert!(!figure.contains(">Gap, drum to tub<"));
    let data = draw_page_data(trace(), &options);
    let chart = &data["chart"];
    let panels = chart["panels"].as_array().unwrap();
    let yaw_panel = panels.iter().find(|panel| panel["name"] == "tub_yaw").unwrap();
    // The sample's amplitude grows with time and it oscillates faster than it turns, so that on the
    // way down the deviation is greatest at rest.
    let [up, down] = [0, 1].map(|series| decode_curve(&yaw_panel["series"][series]["y"]));
    assert!(up.is_sorted() && down.is_sorted_by(|a, b| a >= b) && up.len() > 10, "{up:?} {down:?}");
    let trace_at_constant_speed = SampleFile::default()
        .numbers("time_s", "s", [0.0, 1.0, 2.0])
        .numbers("speed_rpm", "rpm", [60.0, 60.0, 60.0])
        .numbers("nonlinear_tub_yaw", "rad", [0.0, 0.1, 0.0]);
    assert!(
        error_message(draw(trace_at_constant_speed, &with_view(FigureView::Passages), "a.svg"))
            .contains("no whole turn while")
    );
}

#[test]
fn a_live_page_contains_the_module_and_its_setup() {
    let slider =
        |name: &str, value| Slider { name: name.to_owned(), to: 2.0, value, ..Slider::default() };
    let live = Live {
        setup: vec![0.1, f64::INFINITY],
        sliders: vec![slider("unbalance_mass_kg", None), slider("tub_mass_kg", Some(1.5))],
        channels: vec!["tub_yaw".to_owned()],
        metrics: vec![["stop_2_force_nonlinear_n", "stop_2_force_linear_n"].map(str::to_owned)],
        instability_kinds: vec!["period_doubling".to_owned()],
        ..Live::default()
    };
    let options = WasherFigures { live: Some(live), ..WasherFigures::default() };
    let page = draw(map_sample(), &options, "a.html").unwrap();
    let live = &page_data(&page)["live"];
    let compressed_module = STANDARD.decode(live["module"].as_str().unwrap()).unwrap();
    let mut module = Vec::new();
    flate2::read::GzDecoder::new(&compressed_module[..]).read_to_end(&mut module).unwrap();
    assert_eq!(module[..8], *b"\0asm\x01\0\0\0");
    let setup = STANDARD.decode(live["setup"].as_str().unwrap()).unwrap();
    assert_eq!(setup, [0.1, f64::INFINITY].map(f64::to_le_bytes).concat());
    assert_eq!(live["sliders"][0]["axis"], true);
    assert_eq!(live["sliders"][1]["axis"], false);
    assert_eq!(live["sliders"][1]["words"], "Tub mass");
    assert_eq!(live["channels"][0]["unit"], "mrad");
    assert_eq!(live["metrics"][0]["words"], "Stop 2 force");
    assert_eq!(live["metrics"][0]["unit"], "N");
    assert_eq!(live["kinds"][0], "period doubling");
    assert!(String::from_utf8(page).unwrap().contains("id=\"worker\""));
    assert!(
        error_message(draw(map_sample(), &options, "a.svg"))
            .contains("`--live` is for maps drawn as .html")
    );
}

#[test]
fn a_page_contains_the_histories_of_a_folder() {
    let folder = tempfile::tempdir().unwrap();
    trace().write(folder.path(), "by-its-metadata.parquet");
    let trace_without_point = || {
        SampleFile::default().numbers("time_s", "s", [0.0, 1.0]).numbers(
            "nonlinear_tub_yaw",
            "rad",
            [0.0, 1.0],
        )
    };
    trace_without_point().write(folder.path(), "point-7.parquet");
    let options = PlotOptions { traces: Some(folder.path().to_owned()), ..PlotOptions::default() };
    let page_data = draw_page_data(map_sample(), &options);
    // Mass 0.4 is the fourth of ten values, damping 120 the third of nine.
    assert_eq!(page_data["traces"].as_object().unwrap().keys().collect::<Vec<_>>(), ["29", "7"]);
    let history = &page_data["traces"]["29"];
    let panel = |name: &str| {
        let mut panels = history["panels"].as_array().unwrap().iter();
        panels.find(|panel| panel["name"] == name).unwrap()
    };
    assert_eq!(panel("tub_yaw")["unit"], "mrad");
    assert_eq!(panel("drum_front_y")["words"], "Drum front, vertical");
    assert!(history.to_string().len() < 40_000, "6001 samples of seven columns are thinned");

    let trace_of_unknown_point = SampleFile::default().numbers("time_s", "s", [0.0, 1.0]).numbers(
        "nonlinear_tub_yaw",
        "rad",
        [0.0, 1.0],
    );
    trace_of_unknown_point.write(folder.path(), "point-90.parquet");
    assert!(
        error_message(draw(map_sample(), &options, "a.html"))
            .contains("belongs to no point of this map")
    );
}

#[test]
fn a_subtitle_names_each_setting_once() {
    let name = "long ".repeat(40);
    let plan = serde_json::json!({ "name": name, "set": { "damping_n_s_per_m": 120.0 } });
    let figure =
        draw_svg(trace().with_metadata("sweep.plan", &plan.to_string()), &default_options());
    let phrase = "…, damping_n_s_per_m = 120 · unbalance mass 0.4 kg · least gap";
    assert!(figure.contains(phrase), "{figure}");
}

#[test]
fn units_in_subtitles_keep_their_case() {
    let stability_file = SampleFile::default()
        .counts("point", [0, 0, 0])
        .numbers("damping_n_s_per_m", "N s/m", [140.0; 3])
        .numbers("speed_rpm", "rpm", [200.0, 210.0, 220.0])
        .numbers("growth_per_s", "1/s", [-0.1, 0.1, 0.2])
        .words("status", [Some("ok"); 3]);
    let figure = draw_svg(stability_file, &default_options());
    assert!(figure.contains(">damping 140 N s/m<"), "{figure}");
}
#[test]
fn a_decimated_trace_keeps_its_peaks() {
    const ROWS: usize = 400_000;
    let wave = |k: usize| if k == 123_457 { 9.0 } else { (k as f64 * 0.01).sin() };
    let trace = SampleFile::default()
        .numbers("time_s", "s", (0..ROWS).map(|k| k as f64 * 1e-3))
        .numbers("nonlinear_tub_yaw", "rad", (0..ROWS).map(wave))
        .numbers("linear_tub_yaw", "rad", (0..ROWS).map(|k| (k as f64 * 0.01).cos()))
        .numbers("gap_nonlinear_m", "m", (0..ROWS).map(|_| 0.01));
    let page = draw(trace, &default_options(), "a.html").unwrap();
    assert!(page.len() < 10_000_000, "{}", page.len());
    let data = page_data(&page);
    assert!(data["subtitle"].as_str().unwrap().contains("least and greatest of every 3 instants"));
    let yaw_curve = decode_curve(&data["chart"]["panels"][0]["series"][0]["y"]);
    assert_eq!(yaw_curve.iter().copied().fold(0.0, f64::max), 9000.0, "mrad");
    assert_eq!(yaw_curve.len(), decode_curve(&data["chart"]["grids"][0]).len());
}

#[test]
fn modes_files_with_too_many_rows_are_rejected() {
    const ROWS: usize = 500_000;
    let modes = SampleFile::default()
        .numbers("speed_rpm", "rpm", (0..ROWS).map(|k| k as f64))
        .counts("mode", (0..ROWS).map(|_| 1))
        .numbers("frequency_rpm", "rpm", (0..ROWS).map(|_| 100.0));
    let phrase = error_message(draw(modes, &default_options(), "a.svg"));
    assert!(
        phrase.contains("a modes file of 500000 rows is more than a figure can show"),
        "{phrase}"
    );
}

#[test]
fn options_without_effect_are_rejected() {
    let channel =
        |name: &str| WasherFigures { channels: vec![name.to_owned()], ..WasherFigures::default() };
    let resonances = WasherFigures { resonances_rpm: vec![100.0], ..WasherFigures::default() };
    let options_against =
        WasherFigures { against: Some("b.parquet".into()), ..with_view(FigureView::Passages) };
    for (result, phrase) in [
        (draw(map_sample(), &channel("body_yaw"), "a.svg"), "--quantity ratio_tub_yaw"),
        (draw(trace(), &channel("tub_pitch"), "a.svg"), "it has tub_yaw, drum_front_y"),
        (draw(map_sample(), &resonances, "a.svg"), "`--resonances` is for traces"),
        (draw(map_sample(), &with_view(FigureView::Time), "a.svg"), "`--view` is for traces"),
        (draw(trace(), &with_view(FigureView::Shapes), "a.svg"), "`--view` is for modes files"),
        (draw(trace(), &options_against, "a.svg"), "`--against` is for traces over time"),
        (
            draw(SampleFile::default().numbers("x", "", [1.0]), &default_options(), "a.svg"),
            "no file that has a figure: study, dwell, stability, modes, map",
        ),
    ] {
        assert!(error_message(result).contains(phrase), "{phrase}");
    }
}

#[test]
fn the_same_file_gives_the_same_bytes() {
    for sample in [trace, modes] {
        for output in ["a.svg", "a.html"] {
            let figures = [0, 1].map(|_| draw(sample(), &default_options(), output).unwrap());
            assert!(figures[0] == figures[1], "{output}");
        }
    }
}

#[test]
fn columns_with_the_same_name_are_drawn() {
    let times_s = || (0..50).map(f64::from);
    let trace = SampleFile::default()
        .numbers("time_s", "s", times_s())
        .numbers("nonlinear_tub_yaw", "rad", times_s())
        .numbers("nonlinear_tub_yaw", "rad", times_s())
        .numbers("speed_rpm", "rpm", times_s());
    assert!(draw(trace, &default_options(), "a.svg").is_ok());
}
