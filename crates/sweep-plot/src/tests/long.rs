//! Tests of files with more rows than a figure can show: memory, size of pages, and cells of
//! several points.

use base64::Engine as _;
use serde_json::Value;

use super::super::sample::{MapSample, SampleFile};
use super::super::*;
use super::{draw, draw_svg, page_data};

/// Returns the values from 0 in steps of 1.
fn integers_below(count: usize) -> Vec<f64> {
    (0..count).map(|k| k as f64).collect()
}

/// Returns a map of `counts` points whose ratio lies between half and twice the limit, except for
/// outliers.
fn long_map(counts: [usize; 2]) -> MapSample<'static> {
    MapSample {
        axes: vec![
            ("unbalance_mass_kg", integers_below(counts[0])), // the first varies slowest
            ("damping_n_s_per_m", integers_below(counts[1])),
        ],
        limit: 2.0,
        yaw: &|point| Some([0.01 * ratio_at(point), 0.01]),
        is_chaotic: &|_| false,
    }
}

/// Returns the ratio at a point of the map.
fn ratio_at(point: &[f64]) -> f64 {
    // The ratios of some points differ much from those of their neighbours, as in chaotic motion.
    let outlier_factor = if (point[0] * 31.0 + point[1] * 17.0) % 101.0 == 0.0 { 3.0 } else { 1.0 };
    outlier_factor * 4.0 / (1.0 + 3.0 * ((point[1] * 7.0 + point[0]) % 1000.0) / 1000.0)
}

fn render_to(input: &Path, name: &str) -> Vec<u8> {
    let output = input.with_file_name(name);
    render(input, &PlotOptions::default(), &CommonFigures, &output).unwrap();
    std::fs::read(output).unwrap()
}

fn decode_bits(text: &Value) -> Vec<bool> {
    let bytes = base64::engine::general_purpose::STANDARD.decode(text.as_str().unwrap()).unwrap();
    bytes.iter().flat_map(|byte| (0..8).map(move |bit| byte >> bit & 1 == 1)).collect()
}

fn decode_floats(text: &Value) -> Vec<f64> {
    let bytes = base64::engine::general_purpose::STANDARD.decode(text.as_str().unwrap()).unwrap();
    bytes.chunks(4).map(|b| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]]))).collect()
}

#[test]
fn memory_and_page_size_do_not_grow_with_the_rows() {
    const MAX_BYTES_ALLOCATED: u64 = 100 << 20;
    let folder = tempfile::tempdir().unwrap();
    let mut peaks: Vec<[u64; 3]> = Vec::new();
    for counts in [[724, 724], [1448, 1448]] {
        let input = long_map(counts).write_long(folder.path(), &format!("{}.parquet", counts[0]));
        peaks.push(["a.svg", "a.png", "a.html"].map(|name| {
            let mut written_bytes = 0;
            let heap =
                allocation_counter::measure(|| written_bytes = render_to(&input, name).len());
            let peak = heap.bytes_max;
            let phrase =
                format!("{counts:?} {name}: {peak} bytes at most, {written_bytes} written");
            println!("{phrase}");
            assert!(peak < MAX_BYTES_ALLOCATED && written_bytes < 10_000_000, "{phrase}");
            peak
        }));
    }
    for (peak_of_few, peak_of_many) in peaks[0].iter().zip(peaks[1]) {
        assert!(
            peak_of_many < peak_of_few + peak_of_few / 2,
            "four times the rows: {peak_of_few} bytes at most, then {peak_of_many}"
        );
    }
}

#[test]
fn a_cell_of_several_points_shows_the_worst_and_counts_them() {
    let folder = tempfile::tempdir().unwrap();
    let counts = [500, 600];
    let sample = long_map([500, 600]);
    let data = page_data(&render_to(&sample.write_long(folder.path(), "map.parquet"), "a.html"));
    let spans = |k: usize| -> Vec<[f64; 2]> {
        let spans = data["axes"][k]["spans"].as_array().unwrap();
        spans.iter().map(|span| [0, 1].map(|end| span[end].as_f64().unwrap())).collect()
    };
    let [xs, ys] = [spans(0), spans(1)];
    assert!(xs.len() < counts[0] && ys.len() < counts[1] && xs.len() * ys.len() > 20_000);
    let [count, reliable, unreliable] =
        ["points", "reliable", "unreliable"].map(|name| decode_floats(&data["counts"][name]));
    let worst_ratios = decode_floats(&data["columns"]["ratio_max"]["data"]);
    let index = decode_floats(&data["columns"]["point"]["data"]);
    let [gap, margin] = ["min_gap_nonlinear_m", "margin_n"]
        .map(|name| decode_floats(&data["columns"][name]["data"]));
    let is_divided = decode_bits(&data["layers"][0]["both"]);
    let values_in_span = |span: &[f64; 2]| (span[0] as usize..=span[1] as usize).map(|k| k as f64);
    let mut divided_cells = 0;
    for (i, x) in xs.iter().enumerate() {
        for (j, y) in ys.iter().enumerate() {
            let cell = i * ys.len() + j;
            let points = values_in_span(x).flat_map(|x| values_in_span(y).map(move |y| [x, y]));
            let ratios: Vec<f64> = points.map(|point| ratio_at(&point)).collect();
            let unreliable_count = ratios.iter().filter(|ratio| **ratio >= 2.0).count();
            let greatest = ratios.iter().copied().fold(0.0, f64::max);
            let counts_of_cell = [count[cell], reliable[cell], unreliable[cell]];
            let expected_counts = [ratios.len(), ratios.len() - unreliable_count, unreliable_count];
            assert_eq!(counts_of_cell, expected_counts.map(|count| count as f64));
            assert!((worst_ratios[cell] - greatest).abs() < 1e-6 * greatest);
            let least_gap = 0.01 - 0.1 * 0.01 * greatest;
            assert!((gap[cell] - least_gap).abs() < 1e-8, "the least gap of the cell");
            assert!((margin[cell] - 1.0 + 0.01 * greatest).abs() < 1e-6, "and its least margin");
            let index = index[cell] as usize;
            let worst_point =
                [index / counts[1], index % counts[1]].map(|index_on_axis| index_on_axis as f64);
            assert_eq!(ratio_at(&worst_point), greatest, "the point named is the worst one");
            assert_eq!(is_divided[cell], unreliable_count > 0 && unreliable_count < ratios.len());
            divided_cells += usize::from(is_divided[cell]);
        }
    }
    assert!(divided_cells > 100, "{divided_cells} cells hold both");
    let point_count: f64 = count.iter().sum();
    assert_eq!(point_count, 300_000.0);
    let figure = String::from_utf8(render_to(&folder.path().join("map.parquet"), "a.svg")).unwrap();
    assert!(figure.contains(">both: reliable and unreliable points<"));
    assert!(figure.contains("300000 points · a cell holds 2 by 2 points"));
}

#[test]
fn a_small_map_has_a_cell_for_every_point() {
    let data =
        page_data(&draw(long_map([30, 40]).sample(), &PlotOptions::default(), "a.html").unwrap());
    assert!(data["counts"].is_null() && data["axes"][0]["spans"].is_null());
    assert!(data["layers"][0]["both"].is_null() && data["layers"][0]["undefined"].is_null());
    assert!(!draw_svg(long_map([30, 40]).sample(), &PlotOptions::default()).contains("both:"));
}

#[test]
fn failed_points_are_hatched_in_cells_with_others() {
    let yaw = |point: &[f64]| (point[1] % 50.0 != 0.0).then_some([0.01, 0.01]);
    let map_with_failures = MapSample { yaw: &yaw, ..long_map([500, 600]) };
    let folder = tempfile::tempdir().unwrap();
    let input = map_with_failures.write_long(folder.path(), "map.parquet");
    let figure = String::from_utf8(render_to(&input, "a.svg")).unwrap();
    assert!(figure.contains(">some points failed<") && !figure.contains(">failed: no result<"));
    assert!(figure.contains("300000 points · 6000 failed"));
    let data = page_data(&render_to(&input, "a.html"));
    assert_eq!(decode_floats(&data["counts"]["failed"]).iter().sum::<f64>(), 6000.0);
    let legend_texts: Vec<&Value> =
        data["legend"].as_array().unwrap().iter().map(|entry| &entry[1]).collect();
    assert_eq!(legend_texts[..2], ["ok (294000)", "diverged (6000)"]);
}

#[test]
fn undefined_and_sensitive_points_are_marked_in_cells_with_others() {
    let is_at_rest = |point: &[f64]| point[1] % 50.0 == 7.0;
    let is_chaotic = |point: &[f64]| (point[0] + point[1]) % 40.0 == 0.0;
    let yaw = |point: &[f64]| Some(if is_at_rest(point) { [0.0, 0.0] } else { [0.01, 0.01] });
    let sample = MapSample { yaw: &yaw, is_chaotic: &is_chaotic, ..long_map([500, 600]) };
    let folder = tempfile::tempdir().unwrap();
    let input = sample.write_long(folder.path(), "map.parquet");
    let figure = String::from_utf8(render_to(&input, "a.svg")).unwrap();
    for phrase in [">some points undefined<", ">some points sensitive: chaotic<"] {
        assert!(figure.contains(phrase), "{phrase}");
    }
    assert!(!figure.contains("both:") && !figure.contains("failed"));
    let data = page_data(&render_to(&input, "a.html"));
    let all_points = (0..500).flat_map(|x| (0..600).map(move |y| [f64::from(x), f64::from(y)]));
    let sensitive_count = all_points.filter(|point| is_chaotic(point)).count();
    assert_eq!(
        decode_floats(&data["counts"]["sensitive"]).iter().sum::<f64>(),
        sensitive_count as f64
    );
    let [points, reliable] =
        ["points", "reliable"].map(|name| decode_floats(&data["counts"][name]));
    let undefined = decode_bits(&data["layers"][0]["undefined"]);
    for cell in 0..points.len() {
        assert_eq!(undefined[cell], reliable[cell] < points[cell], "cell {cell}");
    }
    // The linear model is never chaotic.
    let output = folder.path().join("linear.svg");
    render(&input, &super::options_for_column("linear_body_yaw"), &CommonFigures, &output).unwrap();
    assert!(!std::fs::read_to_string(output).unwrap().contains("sensitive"));
}

#[test]
fn sensitive_points_are_hatched_in_small_maps_too() {
    let is_chaotic = |point: &[f64]| point == [3.0, 4.0];
    let sample = MapSample { is_chaotic: &is_chaotic, ..long_map([30, 40]) };
    let figure = draw_svg(sample.sample(), &PlotOptions::default());
    assert!(figure.contains(">sensitive: motion is chaotic<"));
    // Without sensitive points the picture lacks the hatch and its legend entry.
    let figure_without = draw_svg(long_map([30, 40]).sample(), &PlotOptions::default());
    assert!(!figure_without.contains("sensitive") && figure.len() > figure_without.len());
    let data = page_data(&draw(sample.sample(), &PlotOptions::default(), "a.html").unwrap());
    let words = &data["codes"]["sensitive"]["words"];
    assert_eq!(*words, serde_json::json!(["false", "true"]));
}

#[test]
fn an_axis_of_too_many_values_is_drawn_by_its_range() {
    let one_axis = MapSample {
        axes: vec![("damping_n_s_per_m", integers_below(300_000))],
        ..long_map([1, 1])
    };
    let one_axis = MapSample { yaw: &|point| Some([0.02 - 1e-8 * point[0], 0.01]), ..one_axis };
    let folder = tempfile::tempdir().unwrap();
    let input = one_axis.write_long(folder.path(), "map.parquet");
    let figure = String::from_utf8(render_to(&input, "a.svg")).unwrap();
    assert!(figure.contains("300000 points · a cell holds many points and shows the worst"));
    assert!(render_to(&input, "a.html").len() < 10_000_000);
}

#[test]
fn a_curve_marks_the_cells_that_hold_both_verdicts() {
    // The ratio falls through the limit of 2, and exceeds it once more at one point.
    let yaw = |point: &[f64]| {
        let outlier_amplitude = if point[0] == 200_000.0 { 0.01 } else { 0.0 };
        Some([0.03 - 1e-7 * (point[0] - 2.5) + outlier_amplitude, 0.01])
    };
    let one_axis = MapSample {
        axes: vec![("damping_n_s_per_m", integers_below(240_000))],
        ..long_map([1, 1])
    };
    let folder = tempfile::tempdir().unwrap();
    let input = MapSample { yaw: &yaw, ..one_axis }.write_long(folder.path(), "map.parquet");
    let phrase = ">both: reliable and unreliable points<";
    let figure = String::from_utf8(render_to(&input, "a.svg")).unwrap();
    assert!(figure.contains(phrase));
    let data = page_data(&render_to(&input, "a.html"));
    let mixed_ranges = data["chart"]["panels"][0]["mixed"].as_array().unwrap();
    let ranges: Vec<[f64; 2]> =
        mixed_ranges.iter().map(|range| [0, 1].map(|end| range[end].as_f64().unwrap())).collect();
    for point in [100_002.5, 200_000.0] {
        assert!(ranges.iter().any(|[from, to]| *from <= point && point <= *to), "{ranges:?}");
    }
    assert!(ranges.len() == 2 && ranges.iter().all(|[from, to]| to - from < 50.0), "{ranges:?}");

    // Cells of one point cannot hold both verdicts.
    let few_points = vec![("damping_n_s_per_m", integers_below(240))];
    let few_points = MapSample { axes: few_points, yaw: &yaw, ..long_map([1, 1]) };
    assert!(!draw_svg(few_points.sample(), &PlotOptions::default()).contains(phrase));
}

#[test]
fn a_page_of_too_many_cuts_keeps_the_requested_one() {
    let axis_values = || [40, 40, 60, 3].map(integers_below);
    let axis_names = ["unbalance_mass_kg", "damping_n_s_per_m", "peak_hz", "body_mass_kg"];
    let sample = || MapSample {
        axes: axis_names.into_iter().zip(axis_values()).collect(),
        ..long_map([1, 1])
    };
    let folder = tempfile::tempdir().unwrap();
    let input = sample().write_long(folder.path(), "map.parquet");
    let page = render_to(&input, "a.html");
    assert!(page.len() < 10_000_000, "{}", page.len());
    let data = page_data(&page);
    assert!(data["counts"].is_null(), "what is shown is shown point by point");
    let count_values = |data: &Value, k: usize| data["axes"][k]["values"].as_array().unwrap().len();
    let [speed_count, mass_count] = [2, 3].map(|k| count_values(&data, k));
    let phrase = format!("{speed_count} of 60 values of peak");
    assert!(speed_count < 60 && data["subtitle"].as_str().unwrap().contains(&phrase));
    assert_eq!(mass_count, 3);

    let fixed_values = vec![("peak_hz".to_owned(), 17.0)];
    let options = PlotOptions { fixed_values, ..PlotOptions::default() };
    let output = folder.path().join("b.html");
    render(&input, &options, &CommonFigures, &output).unwrap();
    let data = page_data(&std::fs::read(output).unwrap());
    assert_eq!(data["axes"][2]["values"], serde_json::json!([17.0]));
}

#[test]
fn repeated_points_are_found_in_cells_of_several_points() {
    let folder = tempfile::tempdir().unwrap();
    // The last value of the first axis is repeated, which no grid has.
    let mut sample = long_map([500, 600]);
    sample.axes[0].1[499] = 498.0;
    let input = sample.write_long(folder.path(), "map.parquet");
    let result =
        render(&input, &PlotOptions::default(), &CommonFigures, &folder.path().join("a.svg"));
    let phrase = result.unwrap_err().to_string();
    assert!(phrase.contains("are the same point"), "{phrase}");
}

#[test]
fn scattered_rows_are_rejected_before_they_fill_the_memory() {
    const ROWS: usize = 300_000;
    const AXES: usize = 40;
    let mut sample = SampleFile::default().counts("point", 0..ROWS as u64);
    for axis in 0..AXES {
        let values = (0..ROWS).map(|k| (k * (axis + 1)) as f64);
        sample = sample.numbers(&format!("x{axis}"), "", values);
    }
    let sample = sample
        .numbers("nonlinear_body_yaw", "rad", (0..ROWS).map(|_| 0.01))
        .numbers("ratio_max", "1", (0..ROWS).map(|_| 1.0))
        .words("status", (0..ROWS).map(|_| Some("ok")));
    let folder = tempfile::tempdir().unwrap();
    let input = sample.write(folder.path(), "map.parquet");
    let mut phrase = String::new();
    let peak = allocation_counter::measure(|| {
        let result =
            render(&input, &PlotOptions::default(), &CommonFigures, &folder.path().join("a.svg"));
        phrase = result.unwrap_err().to_string();
    });
    assert!(phrase.contains("scattered"), "{phrase}");
    assert!(peak.bytes_max < 60 << 20, "{} bytes", peak.bytes_max);
}

#[test]
fn columns_with_the_same_name_are_drawn() {
    let with_repeated_name =
        long_map([30, 40]).sample().numbers("ratio_max", "1", (0..1200).map(|_| 1.0));
    let with_repeated_name = with_repeated_name.numbers("later", "1", (0..1200).map(|_| 1.0));
    for name in ["a.svg", "a.html"] {
        assert!(draw(with_repeated_name.clone(), &PlotOptions::default(), name).is_ok(), "{name}");
    }
}

#[test]
fn long_metadata_is_truncated_in_a_page() {
    let long_list = serde_json::to_string(&integers_below(100_000)).unwrap();
    let sample = long_map([3, 4]).sample().with_metadata("note", &long_list);
    let page = String::from_utf8(draw(sample, &PlotOptions::default(), "a.html").unwrap()).unwrap();
    let note_start = page.find("<dt>note</dt>").unwrap();
    let note = &page[note_start..note_start + page[note_start..].find("</dd>").unwrap()];
    assert!(note.len() < 20_000 && note.contains("characters in all; the file has them)"));
}
