//! Tests of damaged files, which other writers or failed runs leave: each gives a figure or an
//! error.

use super::super::sample::{SampleFile, has_figure, number_from_environment};
use super::super::*;
use super::{designs, one_axis, showing, three_axes};

/// Maximum size of a figure of a small file, bytes. Basis: three times the largest page of the
/// intact files.
const MAX_BYTES: usize = 3 << 20;

/// Returns a design without a result.
fn failed() -> SampleFile {
    designs::failed(24)
}

#[test]
fn figures_of_a_failed_design_state_the_failure() {
    let view =
        |view| super::svg(failed(), &PlotOptions { view: Some(view), ..PlotOptions::default() });
    let scatter = view(DesignView::Scatter);
    assert!(scatter.contains(">failed: no result (24)<"), "{scatter}");
    let histogram = view(DesignView::Histogram);
    assert!(histogram.contains(">no values to show<"), "{histogram}");
    assert!(histogram.contains("24 failed"), "{histogram}");
    let influence = view(DesignView::Influence);
    assert!(influence.contains(">no two points have values that differ<"), "{influence}");
    assert!(influence.contains("0 with a value"), "{influence}");
    let page = super::data(failed(), &PlotOptions::default());
    let range = page["histogram"]["chart"]["xRange"].as_array().unwrap();
    assert!(range.iter().all(|end| end.as_f64().is_some_and(|end| end > 0.0)), "{range:?}");
}

#[test]
fn a_histogram_without_values_has_a_scale() {
    let folder = tempfile::tempdir().unwrap();
    let input = failed().write(folder.path(), "input.parquet");
    let source = open_source(&input, &PlotOptions::default(), &CommonFigures).unwrap();
    let scatter = Scatter::read(source, &PlotOptions::default()).unwrap();
    let scale = chart::x_scale(&figures::histogram::chart(&scatter));
    assert!(scale.log && scale.from > 0.0 && scale.to > scale.from, "{scale:?}");
    assert!((2..=16).contains(&scale.ticks(9).len()));
}

/// Draws a file in every format. Returns the number of formats with a figure.
fn draw_all(name: &str, sample: &SampleFile, options: &PlotOptions) -> u64 {
    let drawn = ["a.svg", "a.png", "a.html"].into_iter().filter(|output| {
        let name = format!("{name}, {options:?}, {output}");
        has_figure(&name, MAX_BYTES, || super::draw(sample.clone(), options, output))
    });
    drawn.count() as u64
}

/// Draws randomly damaged files. `SEED=7 ROUNDS=100 cargo test --release -p sweep-plot --lib
/// damaged` tries other ones.
#[test]
fn damaged_files_have_a_figure_or_an_error() {
    let seed = number_from_environment("SEED", 61);
    let rounds = number_from_environment("ROUNDS", 3);
    let mut numbers = fastrand::Rng::with_seed(seed);
    let views = [DesignView::Scatter, DesignView::Histogram, DesignView::Influence]
        .map(|view| PlotOptions { view: Some(view), ..PlotOptions::default() });
    let mut drawn = 0_u64;
    for round in 0..rounds {
        let limit = ["0", "-1", "1e-300", "inf", "NaN", "2"][numbers.usize(..6)];
        let designs = [designs::failed(9), designs::points(2 + numbers.u32(..40))];
        for sample in designs {
            let sample = sample.damaged(&mut numbers).limited("ratio_max", limit);
            let name = format!("SEED={seed}, round {round}, design");
            for options in
                views.iter().chain([&PlotOptions::default(), &showing("min_gap_nonlinear_m")])
            {
                drawn += draw_all(&name, &sample, options);
            }
        }
        let maps = [super::map(), three_axes(), one_axis(), super::boundary()];
        for (k, sample) in maps.into_iter().enumerate() {
            let sample = sample.damaged(&mut numbers).limited("ratio_max", limit);
            let name = format!("SEED={seed}, round {round}, map {k}");
            drawn += draw_all(&name, &sample, &PlotOptions::default());
        }
    }
    // Errors alone would not show that figures are drawn.
    assert!(drawn > 10 * rounds, "{drawn}");
}
