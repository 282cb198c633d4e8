//! Tests of positions in figures: isolated points, names of regions, legends.

use super::super::sample::{MapSample, SampleFile, boundary_sample, map_sample};
use super::super::scene::{Outline, SceneItem};
use super::super::*;
use super::draw_svg;

/// Returns a boundary with one crossing at each of three masses, and two more at the last.
fn boundary_with_folds(axes: &str) -> SampleFile {
    let points = [(0.8, 200.0), (0.9, 230.0), (1.0, 248.1), (1.0, 251.2), (1.0, 271.4)];
    let damping = |offset: f64| points.map(|(_, damping)| damping + offset);
    SampleFile::default()
        .numbers("unbalance_mass_kg", "kg", points.map(|(mass, _)| mass))
        .numbers("damping_n_s_per_m", "N s/m", damping(0.0))
        .numbers("damping_low_n_s_per_m", "N s/m", damping(-0.1))
        .numbers("damping_high_n_s_per_m", "N s/m", damping(0.1))
        .with_metadata("sweep.plan", &format!(r#"{{"axis": [{axes}]}}"#))
}

/// Draws the sample map with this boundary file.
fn draw_over_map(file: SampleFile) -> String {
    let folder = tempfile::tempdir().unwrap();
    let boundary = Some(file.write(folder.path(), "boundary.parquet"));
    draw_svg(map_sample(), &PlotOptions { boundary, ..PlotOptions::default() })
}

const PLANNED_AXES: &str =
    r#"{"parameter": "unbalance_mass_kg"}, {"parameter": "damping_n_s_per_m"}"#;

#[test]
fn an_isolated_crossing_is_drawn_as_a_disc() {
    let folder = tempfile::tempdir().unwrap();
    let table = FigureTable::open(
        &boundary_with_folds("").write(folder.path(), "boundary.parquet"),
        read::ModelKinds::default(),
    )
    .unwrap();
    let chart = figures::boundary::boundary_chart(&table).unwrap();
    let scene = chart::draw_chart(&chart);
    let segments = Outline::circle([0.0, 0.0], 3.0).0.len();
    let is_disc = |item: &&SceneItem| match item {
        SceneItem::Fill { outline, .. } => outline.0.len() == segments,
        _ => false,
    };
    assert_eq!(scene.items.iter().filter(is_disc).count(), 2);
    // Over a map each disc has a light rim.
    let [with_isolated, without_isolated] = [
        boundary_with_folds(PLANNED_AXES),
        boundary_sample().with_metadata("sweep.plan", &format!(r#"{{"axis": [{PLANNED_AXES}]}}"#)),
    ];
    let count_discs = |file| draw_over_map(file).matches(r##"fill="#0b6b3a""##).count();
    assert_eq!((count_discs(without_isolated), count_discs(with_isolated)), (0, 2));
}

#[test]
fn a_legend_names_each_line_once() {
    let limit = r#"], "reliability": {"ratio_limit": 3.0}, "other": ["#;
    let figure = draw_over_map(boundary_with_folds(&format!("{PLANNED_AXES}{limit}")));
    for name in [">boundary: ratio 3<", ">traced boundary: ratio 3<"] {
        assert_eq!(figure.matches(name).count(), 1, "{name}");
    }
}

/// Returns the position of a text in a figure.
fn text_position(figure: &str, text: &str) -> [f64; 2] {
    let text_start = figure.find(&format!(">{text}<")).unwrap();
    let element = &figure[figure[..text_start].rfind("<text").unwrap()..text_start];
    ["x", "y"].map(|name| {
        let value_start = element.find(&format!(r#" {name}=""#)).unwrap() + name.len() + 3;
        element[value_start..].split('"').next().unwrap().parse().unwrap()
    })
}

#[test]
fn names_of_regions_avoid_the_curve_of_a_boundary_file() {
    const NAME: &str = "linear model reliable";
    let [_, y] = text_position(&draw_svg(map_sample(), &PlotOptions::default()), NAME);
    // The panel's 440 px represent 45 to 315 N s/m; the middle of the name is above its baseline.
    let damping_at_name = 315.0 - (y - 5.6 - frame::HEADING_HEIGHT) / 440.0 * 270.0;
    let masses = (1..=10).map(|k| 0.1 * f64::from(k));
    let constant = |offset: f64| (0..10).map(move |_| damping_at_name + offset);
    let boundary_line = SampleFile::default()
        .numbers("unbalance_mass_kg", "kg", masses)
        .numbers("damping_n_s_per_m", "N s/m", constant(0.0))
        .numbers("damping_low_n_s_per_m", "N s/m", constant(-0.1))
        .numbers("damping_high_n_s_per_m", "N s/m", constant(0.1))
        .with_metadata("sweep.plan", &format!(r#"{{"axis": [{PLANNED_AXES}]}}"#));
    let [_, moved_y] = text_position(&draw_over_map(boundary_line), NAME);
    assert!((moved_y - y).abs() > 16.0, "{moved_y} {y}");
}

#[test]
fn names_of_regions_avoid_the_line_between_them() {
    let axes = [("unbalance_mass_kg", 6, 0.28), ("friction_n", 6, 6.0)];
    let axis_values = |step: f64| (0..6).map(move |k| step * f64::from(k)).collect::<Vec<f64>>();
    let corner = MapSample {
        axes: axes.iter().map(|&(name, _, step)| (name, axis_values(step))).collect(),
        limit: 2.0,
        // The ratio exceeds the limit right of a line from the lower middle to the right edge.
        yaw: &|point| Some([0.01 * (2.0 + 2.0 * (point[0] - 0.7) - point[1] / 8.0).max(0.1), 0.01]),
        is_chaotic: &|_| false,
    };
    let figure = draw_svg(corner.sample(), &PlotOptions::default());
    let [_, y] = text_position(&figure, "linear model unreliable");
    // The panel ends at 512 px; a name in the middle of the region would cover the line.
    assert!(y > 480.0, "{y}");
}
