//! Tests of damaged files, which other writers or failed runs leave: each gives a figure or an
//! error.

use super::super::sample::{SampleFile, has_figure, number_from_environment};
use super::super::*;
use super::{designs, map_of_one_axis, map_of_three_axes, options_for_column};

/// Maximum size of a figure of a small file, bytes. Basis: three times the largest page of the
/// intact files.
const MAX_BYTES: usize = 3 << 20;

/// Returns a design without a result.
fn failed_design() -> SampleFile {
    designs::failed_design(24)
}

#[test]
fn figures_of_a_failed_design_state_the_failure() {
    let draw_view = |view| {
        super::draw_svg(
            failed_design(),
            &PlotOptions { view: Some(view), ..PlotOptions::default() },
        )
    };
    let scatter = draw_view(DesignView::Scatter);
    assert!(scatter.contains(">failed: no result (24)<"), "{scatter}");
    let histogram = draw_view(DesignView::Histogram);
    assert!(histogram.contains(">no values to show<"), "{histogram}");
    assert!(histogram.contains("24 failed"), "{histogram}");
    let influence = draw_view(DesignView::Influence);
    assert!(influence.contains(">no two points have values that differ<"), "{influence}");
    assert!(influence.contains("0 with a value"), "{influence}");
    let page = super::draw_page_data(failed_design(), &PlotOptions::default());
    let x_range = page["histogram"]["chart"]["xRange"].as_array().unwrap();
    assert!(x_range.iter().all(|end| end.as_f64().is_some_and(|end| end > 0.0)), "{x_range:?}");
}

#[test]
fn a_histogram_without_values_has_a_scale() {
    let folder = tempfile::tempdir().unwrap();
    let input = failed_design().write(folder.path(), "input.parquet");
    let source = open_source(&input, &PlotOptions::default(), &CommonFigures).unwrap();
    let scatter = Scatter::read(source, &PlotOptions::default()).unwrap();
    let scale = chart::chart_x_scale(&figures::histogram::histogram_chart(&scatter));
    assert!(scale.is_log && scale.from > 0.0 && scale.to > scale.from, "{scale:?}");
    assert!((2..=16).contains(&scale.ticks(9).len()));
}

/// Draws a file in every format. Returns the number of formats with a figure.
fn draw_all(name: &str, sample: &SampleFile, options: &PlotOptions) -> u64 {
    let drawn_formats = ["a.svg", "a.png", "a.html"].into_iter().filter(|output| {
        let name = format!("{name}, {options:?}, {output}");
        has_figure(&name, MAX_BYTES, || super::draw(sample.clone(), options, output))
    });
    drawn_formats.count() as u64
}

/// Draws randomly damaged files. `SEED=7 ROUNDS=100 cargo test --release -p sweep-plot --lib
/// damaged` tries other ones.
#[test]
fn damaged_files_have_a_figure_or_an_error() {
    let seed = number_from_environment("SEED", 61);
    let rounds = number_from_environment("ROUNDS", 3);
    let mut random = fastrand::Rng::with_seed(seed);
    let views = [DesignView::Scatter, DesignView::Histogram, DesignView::Influence]
        .map(|view| PlotOptions { view: Some(view), ..PlotOptions::default() });
    let mut figure_count = 0_u64;
    for round in 0..rounds {
        let limit = ["0", "-1", "1e-300", "inf", "NaN", "2"][random.usize(..6)];
        let designs = [designs::failed_design(9), designs::design(2 + random.u32(..40))];
        for sample in designs {
            let sample = sample.with_damage(&mut random).with_limit("ratio_max", limit);
            let name = format!("SEED={seed}, round {round}, design");
            for options in views
                .iter()
                .chain([&PlotOptions::default(), &options_for_column("min_gap_nonlinear_m")])
            {
                figure_count += draw_all(&name, &sample, options);
            }
        }
        let maps =
            [super::map_sample(), map_of_three_axes(), map_of_one_axis(), super::boundary_sample()];
        for (k, sample) in maps.into_iter().enumerate() {
            let sample = sample.with_damage(&mut random).with_limit("ratio_max", limit);
            let name = format!("SEED={seed}, round {round}, map {k}");
            figure_count += draw_all(&name, &sample, &PlotOptions::default());
        }
    }
    // Errors alone would not show that figures are drawn.
    assert!(figure_count > 10 * rounds, "{figure_count}");
}
