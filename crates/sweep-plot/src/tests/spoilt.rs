//! Files with cells that other writers, or runs that failed, leave: a figure or an error, always.

use std::time::{Duration, Instant};

use super::super::sample::Sample;
use super::super::*;
use super::{designs, one_axis, showing, three_axes};

/// How long a figure of a small file may take: a hundred times what the slowest of the intact ones
/// takes. A larger bound finds only loops that never end.
const LONGEST: Duration = Duration::from_secs(20);

/// Most bytes of a figure of a small file: three times the largest page of the intact ones.
const MOST_BYTES: usize = 3 << 20;

/// A design none of whose points has a result.
fn failed() -> Sample {
    designs::failed(24)
}

#[test]
fn a_design_all_of_whose_points_failed_has_figures_that_say_so() {
    let view = |view| super::svg(failed(), &Options { view: Some(view), ..Options::default() });
    let scatter = view(View::Scatter);
    assert!(scatter.contains(">failed: no result (24)<"), "{scatter}");
    let histogram = view(View::Histogram);
    assert!(histogram.contains(">no values to show<"), "{histogram}");
    assert!(histogram.contains("24 failed"), "{histogram}");
    let influence = view(View::Influence);
    assert!(influence.contains(">no two points have values that differ<"), "{influence}");
    assert!(influence.contains("0 with a value"), "{influence}");
    let page = super::data(failed(), &Options::default());
    let range = page["histogram"]["chart"]["xRange"].as_array().unwrap();
    assert!(range.iter().all(|end| end.as_f64().is_some_and(|end| end > 0.0)), "{range:?}");
}

#[test]
fn a_histogram_of_nothing_has_a_scale() {
    let folder = tempfile::tempdir().unwrap();
    let input = failed().write(folder.path(), "input.parquet");
    let source = opened(&input, &Options::default(), &CommonFigures).unwrap();
    let scatter = Scatter::read(source, &Options::default()).unwrap();
    let scale = chart::x_scale(&figures::histogram::chart(&scatter));
    assert!(scale.log && scale.from > 0.0 && scale.to > scale.from, "{scale:?}");
    assert!((2..=16).contains(&scale.ticks(9).len()));
}

/// Draws a sample in every form; gives how many of the forms are figures.
fn draw_all(name: &str, sample: &Sample, options: &Options) -> u64 {
    let mut drawn = 0;
    for output in ["a.svg", "a.png", "a.html"] {
        let begun = Instant::now();
        let result = super::draw(sample.clone(), options, output);
        let took = begun.elapsed();
        assert!(took < LONGEST, "{name}, {options:?}, {output}: {took:?}");
        match result {
            Ok(bytes) => {
                assert!(bytes.len() < MOST_BYTES, "{name}, {options:?}, {output}: {}", bytes.len());
                drawn += 1;
            }
            Err(error) => assert!(!error.to_string().is_empty()),
        }
    }
    drawn
}

/// `SEED=7 ROUNDS=100 cargo test --release -p sweep-plot --lib spoilt` tries other files.
#[test]
fn spoilt_files_have_a_figure_or_an_error() {
    let given = |name, usual| std::env::var(name).map_or(usual, |text| text.parse().unwrap());
    let (seed, rounds) = (given("SEED", 61), given("ROUNDS", 3));
    let mut numbers = fastrand::Rng::with_seed(seed);
    let views = [View::Scatter, View::Histogram, View::Influence]
        .map(|view| Options { view: Some(view), ..Options::default() });
    let mut drawn = 0_u64;
    for round in 0..rounds {
        let limit = ["0", "-1", "1e-300", "inf", "NaN", "2"][numbers.usize(..6)];
        let designs = [designs::failed(9), designs::points(2 + numbers.u32(..40))];
        for sample in designs {
            let sample = sample.spoilt(&mut numbers).limited("ratio_max", limit);
            let name = format!("SEED={seed}, round {round}, design");
            for options in
                views.iter().chain([&Options::default(), &showing("min_gap_nonlinear_m")])
            {
                drawn += draw_all(&name, &sample, options);
            }
        }
        let maps = [super::map(), three_axes(), one_axis(), super::boundary()];
        for (k, sample) in maps.into_iter().enumerate() {
            let sample = sample.spoilt(&mut numbers).limited("ratio_max", limit);
            let name = format!("SEED={seed}, round {round}, map {k}");
            drawn += draw_all(&name, &sample, &Options::default());
        }
    }
    // Errors alone would prove nothing.
    assert!(drawn > 10 * rounds, "{drawn}");
}
