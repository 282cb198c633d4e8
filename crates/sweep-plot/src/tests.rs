//! Tests of figures drawn from sample files.

mod damaged;
mod designs;
mod drawing;
mod long;
mod metrics;

use std::path::Path;

use serde_json::Value;

use super::sample::{MapSample, SampleFile, boundary_sample, map_sample};
use super::*;

pub(super) fn draw(
    sample: SampleFile,
    options: &PlotOptions,
    output: &str,
) -> Result<Vec<u8>, PlotError> {
    let folder = tempfile::tempdir().unwrap();
    let input = sample.write(folder.path(), "input.parquet");
    let output = folder.path().join(output);
    render(&input, options, &CommonFigures, &output)?;
    Ok(std::fs::read(output).unwrap())
}

pub(super) fn draw_svg(sample: SampleFile, options: &PlotOptions) -> String {
    String::from_utf8(draw(sample, options, "figure.svg").unwrap()).unwrap()
}

pub(super) fn draw_page_data(sample: SampleFile, options: &PlotOptions) -> Value {
    page_data(&draw(sample, options, "figure.html").unwrap())
}

/// Returns the data that a page carries.
pub(super) fn page_data(page: &[u8]) -> Value {
    let page = std::str::from_utf8(page).unwrap();
    let data_start = page.find(r#"id="data">"#).unwrap() + r#"id="data">"#.len();
    serde_json::from_str(
        &page[data_start..data_start + page[data_start..].find("</script>").unwrap()],
    )
    .unwrap()
}

/// Decodes a curve of a page.
pub(super) fn decode_curve(series: &Value) -> Vec<f64> {
    use base64::Engine as _;
    let bytes =
        base64::engine::general_purpose::STANDARD.decode(series["y"].as_str().unwrap()).unwrap();
    bytes.chunks(4).map(|four| f64::from(f32::from_le_bytes(four.try_into().unwrap()))).collect()
}

pub(super) fn error_message(result: Result<Vec<u8>, PlotError>) -> String {
    result.unwrap_err().to_string()
}

fn map_of_three_axes() -> SampleFile {
    MapSample {
        axes: vec![
            ("unbalance_mass_kg", vec![0.2, 0.4, 0.6]),
            ("damping_n_s_per_m", vec![60.0, 100.0, 140.0]),
            ("peak_hz", vec![300.0, 350.0]),
        ],
        limit: 2.0,
        yaw: &|point| Some([0.02 * point[0] * point[2] / point[1], 0.01]),
        is_chaotic: &|_| false,
    }
    .sample()
}

pub(super) fn map_of_one_axis() -> SampleFile {
    MapSample {
        axes: vec![("damping_n_s_per_m", vec![60.0, 100.0, 140.0, 180.0])],
        limit: 2.0,
        yaw: &|point| (point[0] > 70.0).then(|| [2.0 / point[0], 0.01]),
        is_chaotic: &|_| false,
    }
    .sample()
}

#[test]
fn columns_have_units_words_and_provenance() {
    let folder = tempfile::tempdir().unwrap();
    let table = FigureTable::open(
        &map_sample().write(folder.path(), "map.parquet"),
        read::ModelKinds::default(),
    )
    .unwrap();
    assert_eq!((table.source.kind, table.rows), (FigureKind::MAP, 90));
    let column = |name: &str| table.column(name).unwrap();
    assert_eq!(
        column("damping_n_s_per_m").facts.unit(),
        "N s/m",
        "by the name where the file does not say"
    );
    assert_eq!(column("nonlinear_body_yaw").facts.unit(), "rad");
    assert_eq!(
        column("nonlinear_body_yaw").facts.metadata.description,
        "nonlinear_body_yaw, described"
    );
    assert_eq!(column("ratio_max").facts.unit(), "", "1 is no unit to show");
    let find_words = |name: &str| column(name).words().unwrap();
    let rows_without_verdict =
        (0..table.rows).filter(|&row| find_words("reliable").get(row).is_none()).count();
    assert_eq!(
        (find_words("reliable").names.join(" "), rows_without_verdict),
        ("false true".to_owned(), 2)
    );
    let diverged_rows =
        (0..table.rows).filter(|&row| find_words("status").get(row) == Some("diverged")).count();
    assert_eq!(diverged_rows, 1);
    assert_eq!(
        (table.source.ratio_limit(), table.source.run_name.as_deref()),
        (3.0, Some("sample"))
    );
    let rows_without_ratio =
        table.numbers("ratio_max").unwrap().iter().filter(|ratio| ratio.is_nan()).count();
    assert_eq!(rows_without_ratio, 2);
}

#[test]
fn the_same_file_gives_the_same_bytes() {
    for sample in [map_sample, map_of_three_axes, map_of_one_axis, boundary_sample] {
        for output in ["a.svg", "a.html"] {
            let figures = [0, 1].map(|_| draw(sample(), &PlotOptions::default(), output).unwrap());
            assert!(figures[0] == figures[1], "{output}");
        }
    }
    let figures = [0, 1].map(|_| draw(map_sample(), &PlotOptions::default(), "a.png").unwrap());
    assert!(figures[0] == figures[1], "a.png");
}

#[test]
fn a_map_labels_axes_sides_boundary_and_failures() {
    let figure = draw_svg(map_sample(), &PlotOptions::default());
    for phrase in [
        ">Unbalance mass (kg)<",
        ">Damping (N s/m)<",
        ">linear model unreliable<",
        ">linear model reliable<",
        ">boundary: ratio 3<",
        ">failed: no result<",
        ">undefined: no excitation<",
        ">sample · 90 points · 1 failed<",
    ] {
        assert!(figure.contains(phrase), "{phrase}");
    }
}

#[test]
fn the_boundary_of_a_map_follows_the_limit() {
    let data = draw_page_data(map_sample(), &PlotOptions::default());
    let limit_line = &data["layers"][0]["lines"][0];
    let coordinates: Vec<f64> = limit_line
        .as_array()
        .unwrap()
        .iter()
        .flat_map(|line| line.as_array().unwrap())
        .map(|value| value.as_f64().unwrap())
        .collect();
    assert!(coordinates.len() > 20);
    for point in coordinates.chunks(2) {
        // The logarithm of the sample's ratio is linear in both axes, so that interpolation is
        // exact.
        assert!((point[1] - (50.0 + 200.0 * point[0])).abs() < 0.01, "{point:?}");
    }
}

/// Returns the options for a figure of this column.
pub(crate) fn options_for_column(column: &str) -> PlotOptions {
    PlotOptions { quantity: vec![column.to_owned()], ..PlotOptions::default() }
}

#[test]
fn every_column_can_be_drawn() {
    let draw_column = |column| draw_svg(map_sample(), &options_for_column(column));
    for (figure, phrase) in [
        (draw_column("ratio_body_pitch"), ">Ratio of amplitudes: body pitch<"),
        (draw_column("nonlinear_body_yaw"), ">amplitude, nonlinear model (mrad)<"),
        (draw_column("linear_body_yaw"), ">amplitude, linear model (mrad)<"),
        (draw_column("min_gap_nonlinear_m"), ">least gap (mm)<"),
        (draw_column("fail_time_s"), ">fail time (s)<"),
        (draw_column("status"), ">diverged (1)<"),
    ] {
        assert!(figure.contains(phrase), "{phrase}");
    }
}

#[test]
fn a_page_contains_its_ticks() {
    let logarithmic_axis = SampleFile::default()
        .counts("point", 0..4)
        .numbers("damping_n_s_per_m", "N s/m", [1.0, 10.0, 100.0, 1000.0])
        .numbers("nonlinear_body_yaw", "rad", [0.1, 0.2, 0.3, 0.4])
        .numbers("ratio_max", "1", [1.0, 1.1, 1.2, 40.0])
        .words("status", [Some("ok"); 4]);
    let data = draw_page_data(logarithmic_axis, &PlotOptions::default());
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
fn a_third_axis_gives_panels_unless_it_is_fixed() {
    let figure = draw_svg(map_of_three_axes(), &PlotOptions::default());
    assert!(figure.contains(">Peak 300 Hz<") && figure.contains(">Peak 350 Hz<"));
    let options_at = |value| PlotOptions {
        fixed_values: vec![("peak_hz".to_owned(), value)],
        ..PlotOptions::default()
    };
    let figure_of_cut = draw_svg(map_of_three_axes(), &options_at(350.0));
    assert!(
        figure_of_cut.contains(">sample · 18 points · Peak 350 Hz<")
            && !figure_of_cut.contains(">Peak 300 Hz<")
    );
    assert!(
        error_message(draw(map_of_three_axes(), &options_at(351.0), "a.svg"))
            .contains("it has 300, 350")
    );
    assert_eq!(
        draw_page_data(map_of_three_axes(), &options_at(350.0))["first"]["rest"],
        serde_json::json!([1])
    );
}

#[test]
fn a_map_of_one_axis_has_curves_and_marks_failures() {
    let figure = draw_svg(map_of_one_axis(), &PlotOptions::default());
    for phrase in [">Damping (N s/m)<", ">body yaw<", ">unreliable from ratio 2 on<", ">diverged<"]
    {
        assert!(figure.contains(phrase), "{phrase}");
    }
    assert!(
        draw_svg(map_of_one_axis(), &options_for_column("min_gap_linear_m"))
            .contains(">Least gap (mm)<")
    );
}

#[test]
fn titles_name_the_channel() {
    for (column, title) in [
        ("nonlinear_body_yaw", "Amplitudes of both models: body yaw"),
        ("ratio_body_pitch", "Ratio of amplitudes: body pitch"),
        ("ratio_max", "Where the linear model can be trusted"),
    ] {
        let figure = draw_svg(map_of_one_axis(), &options_for_column(column));
        assert!(figure.contains(&format!(">{title}<")), "{column}: {figure}");
    }
    let two_columns = ["nonlinear_body_yaw", "nonlinear_body_pitch"].map(str::to_owned);
    let figure = draw_svg(
        map_of_one_axis(),
        &PlotOptions { quantity: two_columns.to_vec(), ..PlotOptions::default() },
    );
    assert!(figure.contains(">Amplitudes of both models<"), "{figure}");
}

#[test]
fn a_boundary_that_is_not_drawn_has_no_legend() {
    let draw_at_limit = |limit: f64| {
        let sample = MapSample {
            axes: vec![
                ("unbalance_mass_kg", vec![0.2, 0.4, 0.6]),
                ("damping_n_s_per_m", vec![60.0, 100.0, 140.0]),
            ],
            limit,
            yaw: &|point| Some([0.02 + 0.05 * point[0], 0.01]),
            is_chaotic: &|_| false,
        };
        draw_svg(sample.sample(), &PlotOptions::default())
    };
    assert!(draw_at_limit(4.0).contains(">boundary: ratio 4<"));
    let figure = draw_at_limit(40.0);
    assert!(!figure.contains(">boundary: ratio 40<"), "{figure}");
    assert!(figure.contains(">reliable: below 40<"), "{figure}");
}

#[test]
fn a_boundary_is_drawn_with_its_bracket() {
    assert!(
        draw_svg(boundary_sample(), &PlotOptions::default())
            .contains(">boundary: ratio 2, bracket shaded<")
    );
}

#[test]
fn a_boundary_by_a_condition_has_the_words_of_the_user() {
    let figure = |quantity: &str, limit: f64| {
        let settings =
            format!(r#"{{"quantity": "{quantity}", "limit": {limit}, "worse": "less"}}"#);
        draw_svg(
            boundary_sample().with_metadata("sweep.boundary", &settings),
            &PlotOptions::default(),
        )
    };
    let by_condition = figure("margin(ratio_max / 2 != 1 and nonlinear_tub_yaw != 0)", 0.0);
    for text in [">Where ratio_max", "nonlinear_tub_yaw != 0<", ">boundary: limit of ratio_max"] {
        assert!(by_condition.contains(text), "{text}: {by_condition}");
    }
    let by_expression = figure("ratio_max / nonlinear_tub_yaw", 1.5);
    for text in [
        ">Where ratio_max / nonlinear_tub_yaw = 1.5<",
        ">boundary: ratio_max / nonlinear_tub_yaw = 1.5, bracket shaded<",
    ] {
        assert!(by_expression.contains(text), "{text}: {by_expression}");
    }
    assert!(figure("nonlinear_tub_yaw", 1.5).contains(">Where tub yaw, nonlinear model = 1.5<"));
}

#[test]
fn a_png_is_twice_the_size_of_its_figure() {
    let image = draw(map_sample(), &PlotOptions::default(), "a.png").unwrap();
    assert_eq!(&image[..8], b"\x89PNG\r\n\x1a\n");
    assert_eq!(u32::from_be_bytes(image[16..20].try_into().unwrap()), 1760);
}

#[test]
fn a_page_is_self_contained() {
    let hostile_sample = || map_sample().with_metadata("note", "</script><img src=x> {{data}}");
    let page =
        String::from_utf8(draw(hostile_sample(), &PlotOptions::default(), "a.html").unwrap())
            .unwrap();
    let still_picture = "src=\"data:image/png;base64,iVBOR";
    assert_eq!(page.matches(still_picture).count(), 1, "a picture where scripts are switched off");
    let page = page.replace(still_picture, "");
    for external_reference in ["http:", "https:", "src=\"", "@import", "url("] {
        assert!(!page.contains(external_reference), "{external_reference}");
    }
    assert_eq!(page.matches("</script>").count(), 2, "data cannot end its element");
    assert!(page.contains("&lt;/script&gt;&lt;img src=x&gt; &#123;&#123;data}}"));
}

#[test]
fn a_figure_as_pdf_has_the_pages_size_and_its_title() {
    let document = draw(map_sample(), &PlotOptions::default(), "figure.pdf").unwrap();
    assert!(document.starts_with(b"%PDF-1.7\n"));
    assert!(document.ends_with(b"%%EOF\n"));
    let text = String::from_utf8_lossy(&document);
    let figure = draw_svg(map_sample(), &PlotOptions::default());
    let width = figure.split("width=\"").nth(1).unwrap().split('"').next().unwrap();
    let width_points = 0.75 * width.parse::<f64>().unwrap();
    assert!(text.contains(&format!("/MediaBox [0 0 {width_points} ")), "{width}");
    assert!(text.contains("/Title <FEFF"));
}

#[test]
fn errors_name_their_cause_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let default_options = PlotOptions::default();
    let unknown_axis = PlotOptions {
        fixed_values: vec![("body_mass_kg".to_owned(), 20.0)],
        ..PlotOptions::default()
    };
    let traces = PlotOptions { traces: Some(folder.path().to_owned()), ..PlotOptions::default() };
    let empty_map = || SampleFile::default().numbers("ratio_max", "1", []).words("status", []);
    let repeated_point = SampleFile::default()
        .numbers("damping_n_s_per_m", "", [60.0, 60.0])
        .numbers("nonlinear_body_yaw", "rad", [1.0, 1.0])
        .numbers("ratio_max", "1", [1.0, 1.0])
        .words("status", [Some("ok"), Some("ok")]);
    for (result, phrase) in [
        (draw(map_sample(), &default_options, "a.eps"), ".svg, .pdf, .png or .html"),
        (
            draw(map_sample(), &default_options, "input.parquet/a.svg"),
            "a part of that path is a file",
        ),
        (
            draw(map_sample(), &options_for_column("ratio_yow"), "a.svg"),
            "it has ratio_max, ratio_body_yaw",
        ),
        (
            draw(map_sample(), &options_for_column("ratio_yow"), "a.html"),
            "it has ratio_max, ratio_body_yaw",
        ),
        (draw(map_sample(), &unknown_axis, "a.svg"), "it has none"),
        (draw(map_sample(), &traces, "a.svg"), "maps drawn as .html"),
        (draw(map_sample(), &traces, "a.html"), "no trace files"),
        (draw(empty_map(), &default_options, "a.svg"), "the map has no rows"),
        (draw(repeated_point, &default_options, "a.svg"), "rows 0 and 1 are the same point"),
        (
            draw(SampleFile::default().numbers("x", "", [1.0]), &default_options, "a.svg"),
            "no file that has a figure: study, map, differences",
        ),
    ] {
        assert!(error_message(result).contains(phrase), "{phrase}");
    }
    let text = folder.path().join("text.parquet");
    std::fs::write(&text, "no Parquet").unwrap();
    for (input, phrase) in [
        (text.as_path(), "not a readable Parquet file"),
        (Path::new("/no/such"), "cannot open /no/such"),
    ] {
        let output = folder.path().join("a.svg");
        assert!(
            render(input, &default_options, &CommonFigures, &output)
                .unwrap_err()
                .to_string()
                .contains(phrase)
        );
        assert!(!output.exists());
    }
}
