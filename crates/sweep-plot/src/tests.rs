//! Files in, figures out.

mod designs;
mod drawing;
mod long;
mod metrics;
mod stability;

use std::io::Read as _;
use std::path::Path;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde_json::Value;

use super::sample::{MapSample, Sample, boundary, map, modes, trace};
use super::*;

pub(super) fn draw(
    sample: Sample,
    options: &PlotOptions,
    output: &str,
) -> Result<Vec<u8>, PlotError> {
    let folder = tempfile::tempdir().unwrap();
    let input = sample.write(folder.path(), "input.parquet");
    let output = folder.path().join(output);
    render(&input, options, &output)?;
    Ok(std::fs::read(output).unwrap())
}

pub(super) fn svg(sample: Sample, options: &PlotOptions) -> String {
    String::from_utf8(draw(sample, options, "figure.svg").unwrap()).unwrap()
}

pub(super) fn data(sample: Sample, options: &PlotOptions) -> Value {
    carried(&draw(sample, options, "figure.html").unwrap())
}

/// What a page carries as its data.
pub(super) fn carried(page: &[u8]) -> Value {
    let page = std::str::from_utf8(page).unwrap();
    let start = page.find(r#"id="data">"#).unwrap() + r#"id="data">"#.len();
    serde_json::from_str(&page[start..start + page[start..].find("</script>").unwrap()]).unwrap()
}

/// A curve as a page carries it.
pub(super) fn curve(series: &Value) -> Vec<f64> {
    use base64::Engine as _;
    let bytes =
        base64::engine::general_purpose::STANDARD.decode(series["y"].as_str().unwrap()).unwrap();
    bytes.chunks(4).map(|four| f64::from(f32::from_le_bytes(four.try_into().unwrap()))).collect()
}

pub(super) fn message(result: Result<Vec<u8>, PlotError>) -> String {
    result.unwrap_err().to_string()
}

fn three_axes() -> Sample {
    MapSample {
        axes: vec![
            ("unbalance_mass_kg", vec![0.2, 0.4, 0.6]),
            ("damping_n_s_per_m", vec![60.0, 100.0, 140.0]),
            ("spin_peak_rpm", vec![300.0, 350.0]),
        ],
        limit: 2.0,
        yaw: &|at| Some([0.02 * at[0] * at[2] / at[1], 0.01]),
        chaotic: &|_| false,
    }
    .sample()
}

pub(super) fn one_axis() -> Sample {
    MapSample {
        axes: vec![("damping_n_s_per_m", vec![60.0, 100.0, 140.0, 180.0])],
        limit: 2.0,
        yaw: &|at| (at[0] > 70.0).then(|| [2.0 / at[0], 0.01]),
        chaotic: &|_| false,
    }
    .sample()
}

#[test]
fn columns_come_with_units_words_and_provenance() {
    let folder = tempfile::tempdir().unwrap();
    let table = Table::open(&map().write(folder.path(), "map.parquet")).unwrap();
    assert_eq!((table.source.kind, table.rows), (Kind::Map, 90));
    let column = |name: &str| table.column(name).unwrap();
    assert_eq!(
        column("damping_n_s_per_m").facts.unit,
        "N s/m",
        "by the name where the file does not say"
    );
    assert_eq!(column("nonlinear_tub_yaw").facts.unit, "rad");
    assert_eq!(column("nonlinear_tub_yaw").facts.description, "nonlinear_tub_yaw, said");
    assert_eq!(column("ratio_max").facts.unit, "", "1 is no unit to show");
    let words = |name: &str| column(name).words().unwrap();
    let without = (0..table.rows).filter(|&row| words("reliable").get(row).is_none()).count();
    assert_eq!((words("reliable").names.join(" "), without), ("false true".to_owned(), 2));
    let diverged =
        (0..table.rows).filter(|&row| words("status").get(row) == Some("diverged")).count();
    assert_eq!(diverged, 1);
    assert_eq!(
        (table.source.ratio_limit(), table.source.run_name.as_deref()),
        (3.0, Some("sample"))
    );
    let undefined =
        table.numbers("ratio_max").unwrap().iter().filter(|ratio| ratio.is_nan()).count();
    assert_eq!(undefined, 2);
}

#[test]
fn the_same_file_gives_the_same_bytes() {
    for sample in [map, three_axes, one_axis, trace, modes, boundary] {
        for output in ["a.svg", "a.html"] {
            let twice = [0, 1].map(|_| draw(sample(), &PlotOptions::default(), output).unwrap());
            assert!(twice[0] == twice[1], "{output}");
        }
    }
    let twice = [0, 1].map(|_| draw(map(), &PlotOptions::default(), "a.png").unwrap());
    assert!(twice[0] == twice[1], "a.png");
}

#[test]
fn a_map_names_axes_sides_boundary_and_failures() {
    let figure = svg(map(), &PlotOptions::default());
    for said in [
        ">Unbalance mass (kg)<",
        ">Damping (N s/m)<",
        ">linear model unreliable<",
        ">linear model reliable<",
        ">boundary: ratio 3<",
        ">failed: no result<",
        ">undefined: no excitation<",
        ">sample · 90 points · 1 failed<",
    ] {
        assert!(figure.contains(said), "{said}");
    }
}

#[test]
fn the_boundary_is_where_the_ratio_is_at_its_limit() {
    let data = data(map(), &PlotOptions::default());
    let line = &data["layers"][0]["lines"][0];
    let points: Vec<f64> = line
        .as_array()
        .unwrap()
        .iter()
        .flat_map(|line| line.as_array().unwrap())
        .map(|v| v.as_f64().unwrap())
        .collect();
    assert!(points.len() > 20);
    for at in points.chunks(2) {
        // The sample's log ratio is linear in both axes, so interpolation between points is exact.
        assert!((at[1] - (50.0 + 200.0 * at[0])).abs() < 0.01, "{at:?}");
    }
}

/// A figure of this column.
pub(crate) fn showing(column: &str) -> PlotOptions {
    PlotOptions { quantity: vec![column.to_owned()], ..PlotOptions::default() }
}

#[test]
fn every_quantity_has_its_figure() {
    let shown = |column| svg(map(), &showing(column));
    for (figure, said) in [
        (shown("ratio_tub_pitch"), ">Ratio of amplitudes: tub pitch<"),
        (shown("nonlinear_tub_yaw"), ">amplitude, nonlinear model (mrad)<"),
        (shown("linear_tub_yaw"), ">amplitude, linear model (mrad)<"),
        (shown("min_gap_nonlinear_m"), ">least gap (mm)<"),
        (shown("fail_time_s"), ">fail time (s)<"),
        (shown("status"), ">diverged (1)<"),
    ] {
        assert!(figure.contains(said), "{said}");
    }
}

#[test]
fn a_page_carries_its_ticks() {
    let log = Sample::default()
        .counts("point", 0..4)
        .numbers("damping_n_s_per_m", "N s/m", [1.0, 10.0, 100.0, 1000.0])
        .numbers("nonlinear_tub_yaw", "rad", [0.1, 0.2, 0.3, 0.4])
        .numbers("ratio_max", "1", [1.0, 1.1, 1.2, 40.0])
        .words("status", [Some("ok"); 4]);
    let data = data(log, &PlotOptions::default());
    let steps = data["ticks"]["steps"].as_array().unwrap();
    assert!(steps.contains(&serde_json::json!([0.05, 2])), "5 hundredths, two decimals");
    assert_eq!(
        data["chart"]["xTicks"][0],
        serde_json::json!([[1.0, "1"], [10.0, "10"], [100.0, "100"], [1000.0, "1000"]])
    );
    assert!(data["chart"]["panels"][0]["ticks"].is_array(), "ratios span decades");
    assert!(data["chart"]["panels"][1]["ticks"].is_null(), "amplitudes are even");
}

#[test]
fn a_third_axis_is_drawn_side_by_side_or_cut() {
    let figure = svg(three_axes(), &PlotOptions::default());
    assert!(figure.contains(">Spin peak 300 rpm<") && figure.contains(">Spin peak 350 rpm<"));
    let at = |value| PlotOptions {
        at: vec![("spin_peak_rpm".to_owned(), value)],
        ..PlotOptions::default()
    };
    let cut = svg(three_axes(), &at(350.0));
    assert!(
        cut.contains(">sample · 18 points · Spin peak 350 rpm<")
            && !cut.contains(">Spin peak 300 rpm<")
    );
    assert!(message(draw(three_axes(), &at(351.0), "a.svg")).contains("it has 300, 350"));
    assert_eq!(data(three_axes(), &at(350.0))["first"]["rest"], serde_json::json!([1]));
}

#[test]
fn one_axis_is_drawn_as_curves_with_failures_marked() {
    let figure = svg(one_axis(), &PlotOptions::default());
    for said in [">Damping (N s/m)<", ">tub yaw<", ">unreliable from ratio 2 on<", ">diverged<"] {
        assert!(figure.contains(said), "{said}");
    }
    assert!(svg(one_axis(), &showing("min_gap_linear_m")).contains(">Least gap (mm)<"));
}

#[test]
fn a_trace_shows_the_asked_channels_and_the_resonances_passed() {
    let folder = tempfile::tempdir().unwrap();
    let options = PlotOptions {
        channels: vec!["drum_front_y".to_owned()],
        resonances_rpm: vec![150.0],
        modes: Some(modes().write(folder.path(), "modes.parquet")),
        ..PlotOptions::default()
    };
    let figure = svg(trace(), &options);
    for said in
        [">Drum front, vertical<", ">Gap, drum to tub<", ">Spin (rpm)<", ">resonance speed passed<"]
    {
        assert!(figure.contains(said), "{said}");
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
fn a_trace_shows_forces_and_states_when_asked() {
    let with_forces = || {
        trace().numbers("cabinet_force_y_nonlinear_n", "N", (0..=6000).map(f64::from)).numbers(
            "cabinet_force_y_linear_n",
            "N",
            (0..=6000).map(f64::from),
        )
    };
    let force =
        PlotOptions { channels: vec!["cabinet_force_y".to_owned()], ..PlotOptions::default() };
    let figure = svg(with_forces(), &force);
    assert!(figure.contains(">Cabinet force y (N)<") && figure.contains(">linear model<"));
    assert!(!svg(with_forces(), &PlotOptions::default()).contains("Cabinet force"));
}

#[test]
fn a_trace_is_held_against_another() {
    let folder = tempfile::tempdir().unwrap();
    let other = Sample::default()
        .numbers("time_s", "s", [0.0, 6.0, 12.0])
        .numbers("nonlinear_tub_yaw", "rad", [0.0, 0.09, 0.0])
        .metadata("sweep.plan", r#"{"name": "another program"}"#);
    let against = |path| PlotOptions { against: Some(path), ..PlotOptions::default() };
    let data = data(trace(), &against(other.write(folder.path(), "other.parquet")));
    let yaw = &data["chart"]["panels"][0]["series"];
    let named =
        |k: usize| (yaw[k]["name"].as_str().unwrap().to_owned(), yaw[k]["grid"].as_u64().unwrap());
    assert_eq!(named(0), ("input".to_owned(), 0), "by its file where it has no name");
    assert_eq!((named(1), yaw.as_array().unwrap().len()), (("another program".to_owned(), 1), 2));
    assert!(
        svg(trace(), &against(trace().write(folder.path(), "same.parquet")))
            .contains("difference 0.0e0 of")
    );
    let modes = against(modes().write(folder.path(), "modes.parquet"));
    assert!(
        message(draw(trace(), &modes, "a.svg")).contains("this is a modes file; `sweep trace`")
    );
}

#[test]
fn a_campbell_diagram_stars_the_resonances() {
    let figure = svg(modes(), &PlotOptions::default());
    for said in [">100.0 rpm<", ">200.0 rpm<", ">frequency = spin speed<", "1 mode lies above"] {
        assert!(figure.contains(said), "{said}");
    }
}

fn viewed(view: View) -> PlotOptions {
    PlotOptions { view: Some(view), ..PlotOptions::default() }
}

#[test]
fn the_variation_over_a_turn_is_half_of_least_to_greatest() {
    let figure = svg(modes(), &viewed(View::Variation));
    for said in [">Variation over a turn (± % of the mean)<", ">100.0 rpm<", ">200.0 rpm<"] {
        assert!(figure.contains(said), "{said}");
    }
    let data = data(modes(), &viewed(View::Variation));
    let series = data["chart"]["panels"][0]["series"].as_array().unwrap();
    // The third mode meets no speed.
    assert_eq!(series.len(), 2);
    for series in series {
        let curve = curve(series);
        assert!(curve.len() == 31 && curve.iter().all(|y| (y - 1.0).abs() < 1e-6), "{curve:?}");
    }
}

#[test]
fn mode_shapes_are_those_of_the_file() {
    let q = |i: usize, re: f64| if [5, 7].contains(&i) { [re, 0.0] } else { [0.0, 0.0] };
    let shape: serde_json::Map<String, Value> =
        (1..=10).map(|i| (format!("q{i}"), serde_json::json!(q(i, -0.3)))).collect();
    let facts = serde_json::json!([
        { "mode": 1, "name": "rocking, horizontal \
                   plane", "resonances": [{ "speed_rpm": 100.06, "shape": shape }] },
        { "name": "drum bending on its shaft", "resonances": [] },
    ]);
    let machine = serde_json::json!({ "machine": {
        "bearings": { "rear_x_m": -0.05 }, "tub": { "front_x_m": 0.45 },
        "drum": { "hinge_x_m": 0.15, "front_x_m": 0.45 },
    } });
    let file = || modes().metadata("sweep.plan", &machine.to_string());
    let with_shapes = || file().metadata("sweep.modes", &facts.to_string());
    let figure = svg(with_shapes(), &viewed(View::Shapes));
    for said in
        [">Rocking, horizontal plane,<", ">100.1 rpm<", ">horizontal, a quarter of a period later<"]
    {
        assert!(figure.contains(said), "{said}");
    }
    let stars = svg(with_shapes(), &PlotOptions::default());
    assert!(stars.contains(">100.1 rpm<"), "the same in all figures of a file");
    let carried = data(with_shapes(), &viewed(View::Shapes));
    let panels = carried["chart"]["panels"].as_array().unwrap();
    assert_eq!(panels.len(), 1);
    assert_eq!(curve(&panels[0]["series"][2])[1], 1.0);
    assert!(message(draw(file(), &viewed(View::Shapes), "a.svg")).contains("holds no resonance"));
    assert!(
        message(draw(modes(), &viewed(View::Shapes), "a.svg"))
            .contains("where the machine's parts are")
    );
}

#[test]
fn passages_are_drawn_over_speed_both_ways() {
    let options = PlotOptions {
        channels: vec!["tub_yaw".to_owned()],
        resonances_rpm: vec![150.0],
        ..viewed(View::Passages)
    };
    let figure = svg(trace(), &options);
    for said in [
        ">Spin speed (rpm)<",
        ">nonlinear model, speed rising<",
        ">linear model, speed falling<",
        ">150 rpm<",
    ] {
        assert!(figure.contains(said), "{said}");
    }
    assert!(!figure.contains(">Gap, drum to tub<"));
    let data = data(trace(), &options);
    let chart = &data["chart"];
    let panels = chart["panels"].as_array().unwrap();
    let yaw = panels.iter().find(|panel| panel["name"] == "tub_yaw").unwrap();
    // The sample swings faster than it turns and grows with time: on the way down it is at its end
    // at rest.
    let [up, down] = [0, 1].map(|series| curve(&yaw["series"][series]));
    assert!(up.is_sorted() && down.is_sorted_by(|a, b| a >= b) && up.len() > 10, "{up:?} {down:?}");
    let still = Sample::default()
        .numbers("time_s", "s", [0.0, 1.0, 2.0])
        .numbers("speed_rpm", "rpm", [60.0, 60.0, 60.0])
        .numbers("nonlinear_tub_yaw", "rad", [0.0, 0.1, 0.0]);
    assert!(message(draw(still, &viewed(View::Passages), "a.svg")).contains("no whole turn while"));
}

#[test]
fn a_boundary_is_drawn_with_its_bracket() {
    assert!(
        svg(boundary(), &PlotOptions::default()).contains(">boundary: ratio 2, bracket shaded<")
    );
}

#[test]
fn a_png_is_twice_the_size_of_its_figure() {
    let image = draw(map(), &PlotOptions::default(), "a.png").unwrap();
    assert_eq!(&image[..8], b"\x89PNG\r\n\x1a\n");
    assert_eq!(u32::from_be_bytes(image[16..20].try_into().unwrap()), 1760);
}

#[test]
fn a_page_needs_nothing_but_itself() {
    let hostile = || map().metadata("note", "</script><img src=x> {{data}}");
    let page =
        String::from_utf8(draw(hostile(), &PlotOptions::default(), "a.html").unwrap()).unwrap();
    let still = "src=\"data:image/png;base64,iVBOR";
    assert_eq!(page.matches(still).count(), 1, "a picture where scripts are switched off");
    let page = page.replace(still, "");
    for outside in ["http:", "https:", "src=\"", "@import", "url("] {
        assert!(!page.contains(outside), "{outside}");
    }
    assert_eq!(page.matches("</script>").count(), 2, "data cannot end its element");
    assert!(page.contains("&lt;/script&gt;&lt;img src=x&gt; &#123;&#123;data}}"));
}

#[test]
fn a_live_page_carries_the_module_and_its_setup() {
    let slider =
        |name: &str, value| Slider { name: name.to_owned(), to: 2.0, value, ..Slider::default() };
    let live = Live {
        setup: vec![0.1, f64::INFINITY],
        sliders: vec![slider("unbalance_mass_kg", None), slider("tub_mass_kg", Some(1.5))],
        channels: vec!["tub_yaw".to_owned()],
        metrics: vec![["stop_2_force_nonlinear_n", "stop_2_force_linear_n"].map(str::to_owned)],
        kinds: vec!["period_doubling".to_owned()],
        ..Live::default()
    };
    let options = PlotOptions { live: Some(live), ..PlotOptions::default() };
    let page = draw(map(), &options, "a.html").unwrap();
    let live = &carried(&page)["live"];
    let packed = STANDARD.decode(live["module"].as_str().unwrap()).unwrap();
    let mut module = Vec::new();
    flate2::read::GzDecoder::new(&packed[..]).read_to_end(&mut module).unwrap();
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
        message(draw(map(), &options, "a.svg")).contains("`--live` is for maps drawn as .html")
    );
}

#[test]
fn a_page_takes_the_time_histories_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    trace().write(folder.path(), "by-its-metadata.parquet");
    let plain = || {
        Sample::default().numbers("time_s", "s", [0.0, 1.0]).numbers(
            "nonlinear_tub_yaw",
            "rad",
            [0.0, 1.0],
        )
    };
    plain().write(folder.path(), "point-7.parquet");
    let options = PlotOptions { traces: Some(folder.path().to_owned()), ..PlotOptions::default() };
    let carried = data(map(), &options);
    // Mass 0.4 is the fourth of ten, damping 120 the third of nine.
    assert_eq!(carried["traces"].as_object().unwrap().keys().collect::<Vec<_>>(), ["29", "7"]);
    let history = &carried["traces"]["29"];
    let panel = |name: &str| {
        let mut panels = history["panels"].as_array().unwrap().iter();
        panels.find(|panel| panel["name"] == name).unwrap()
    };
    assert_eq!(panel("tub_yaw")["unit"], "mrad");
    assert_eq!(panel("drum_front_y")["words"], "Drum front, vertical");
    assert!(history.to_string().len() < 40_000, "6001 samples of seven columns are thinned");

    let unknown = Sample::default().numbers("time_s", "s", [0.0, 1.0]).numbers(
        "nonlinear_tub_yaw",
        "rad",
        [0.0, 1.0],
    );
    unknown.write(folder.path(), "point-90.parquet");
    assert!(message(draw(map(), &options, "a.html")).contains("belongs to no point of this map"));
}

#[test]
fn mistakes_are_told_apart_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let none = PlotOptions::default();
    let channel =
        |name: &str| PlotOptions { channels: vec![name.to_owned()], ..PlotOptions::default() };
    let at = PlotOptions { at: vec![("tub_mass_kg".to_owned(), 20.0)], ..PlotOptions::default() };
    let resonances = PlotOptions { resonances_rpm: vec![100.0], ..PlotOptions::default() };
    let traces = PlotOptions { traces: Some(folder.path().to_owned()), ..PlotOptions::default() };
    let empty = || Sample::default().numbers("ratio_max", "1", []).words("status", []);
    let doubled = Sample::default()
        .numbers("damping_n_s_per_m", "", [60.0, 60.0])
        .numbers("nonlinear_tub_yaw", "rad", [1.0, 1.0])
        .numbers("ratio_max", "1", [1.0, 1.0])
        .words("status", [Some("ok"), Some("ok")]);
    for (result, said) in [
        (draw(map(), &none, "a.pdf"), ".svg, .png or .html"),
        (draw(map(), &none, "input.parquet/a.svg"), "a part of that path is a file"),
        (draw(map(), &showing("ratio_yow"), "a.svg"), "it has ratio_max, ratio_tub_yaw"),
        (draw(map(), &showing("ratio_yow"), "a.html"), "it has ratio_max, ratio_tub_yaw"),
        (draw(map(), &channel("tub_yaw"), "a.svg"), "--quantity ratio_tub_yaw"),
        (draw(trace(), &channel("tub_pitch"), "a.svg"), "it has tub_yaw, drum_front_y"),
        (draw(map(), &at, "a.svg"), "it has none"),
        (draw(map(), &resonances, "a.svg"), "`--resonances` is for traces"),
        (draw(map(), &viewed(View::Time), "a.svg"), "`--view` is for traces"),
        (draw(trace(), &viewed(View::Shapes), "a.svg"), "`--view` is for modes files"),
        (
            draw(
                trace(),
                &PlotOptions { against: Some("b.parquet".into()), ..viewed(View::Passages) },
                "a.svg",
            ),
            "`--against` is for traces over time",
        ),
        (draw(map(), &traces, "a.svg"), "maps drawn as .html"),
        (draw(map(), &traces, "a.html"), "no trace files"),
        (draw(empty(), &none, "a.svg"), "the map has no rows"),
        (draw(doubled, &none, "a.svg"), "rows 0 and 1 are the same point"),
        (
            draw(Sample::default().numbers("x", "", [1.0]), &none, "a.svg"),
            "no map, trace, modes, boundary or stability file",
        ),
    ] {
        assert!(message(result).contains(said), "{said}");
    }
    let text = folder.path().join("text.parquet");
    std::fs::write(&text, "no Parquet").unwrap();
    for (input, said) in [
        (text.as_path(), "not a readable Parquet file"),
        (Path::new("/no/such"), "cannot open /no/such"),
    ] {
        let output = folder.path().join("a.svg");
        assert!(render(input, &none, &output).unwrap_err().to_string().contains(said));
        assert!(!output.exists());
    }
}
