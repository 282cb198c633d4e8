//! Tests of damaged files, which other writers or failed runs leave: each gives a figure or an
//! error.

use super::sample::{SampleFile, has_figure, number_from_environment};
use super::stability::stability;
use super::*;

/// Maximum size of a figure of a small file, bytes. Basis: four times the largest page of the
/// intact files.
const MAX_BYTES: usize = 8 << 20;

/// Returns a dwell file with states once a turn.
fn dwells() -> SampleFile {
    let rows: Vec<[f64; 3]> = (0..6)
        .flat_map(|k| (0..2).flat_map(move |motion| (0..4).map(move |turn| [k, motion, turn])))
        .map(|row| row.map(f64::from))
        .collect();
    let column = |value: fn(&[f64; 3]) -> f64| rows.iter().map(value);
    let kinds = ["periodic", "chaotic", "quasi_periodic", ""];
    SampleFile::default()
        .counts("point", rows.iter().map(|_| 0))
        .numbers("unbalance_mass_kg", "kg", column(|_| 0.4))
        .numbers("speed_rpm", "rpm", column(|row| 200.0 + 10.0 * row[0]))
        .numbers("motion", "1", column(|row| row[1]))
        .numbers("turn", "1", column(|row| row[2]))
        .words("kind", rows.iter().map(|row| Some(kinds[row[0] as usize % 4])))
        .numbers("growth_per_s", "1/s", column(|row| row[0] - 3.0))
        .numbers("nonlinear_tub_yaw", "rad", column(|row| 0.01 * (1.0 + row[1])))
        .numbers("linear_tub_yaw", "rad", column(|_| 0.005))
        .numbers("periodic_tub_yaw", "rad", column(|_| 0.008))
        .numbers("q5_rad", "rad", column(|row| 0.001 * row[2]))
        .numbers("q6_rad", "rad", column(|row| 0.002 * row[2]))
        .words("status", rows.iter().map(|_| Some("ok")))
}

/// Draws randomly damaged files. `SEED=7 ROUNDS=100 cargo test --release -p washer-plot --lib
/// damaged` tries other ones.
#[test]
fn damaged_files_have_a_figure_or_an_error() {
    let seed = number_from_environment("SEED", 61);
    let rounds = number_from_environment("ROUNDS", 2);
    let mut random = fastrand::Rng::with_seed(seed);
    let sample_with_views =
        |sample: fn() -> SampleFile, views: &'static [FigureView]| (sample, views);
    let one_point: fn() -> SampleFile = || stability(&[0.4]);
    let files = [
        sample_with_views(
            trace,
            &[FigureView::Time, FigureView::Passages, FigureView::Profiles, FigureView::Spectrum],
        ),
        sample_with_views(
            modes,
            &[FigureView::Frequencies, FigureView::Variation, FigureView::Shapes],
        ),
        sample_with_views(one_point, &[FigureView::Growth, FigureView::Responses]),
        sample_with_views(dwells, &[FigureView::Growth, FigureView::Sections]),
    ];
    let folder = tempfile::tempdir().unwrap();
    let stability_path = stability(&[0.4]).write(folder.path(), "stability.parquet");
    let with_stability =
        WasherFigures { stability: Some(stability_path.clone()), ..WasherFigures::default() };
    let mut figure_count = 0_u64;
    for round in 0..rounds {
        for (k, (sample, views)) in files.iter().enumerate() {
            let sample = sample().with_damage(&mut random);
            let views = views.iter().map(|view| with_view(*view));
            for options in views.chain([WasherFigures::default(), with_stability.clone()]) {
                for output in ["a.svg", "a.html"] {
                    let name = format!("SEED={seed}, round {round}, file {k}, {output}");
                    let name = format!("{name}, {:?}", options.view);
                    let draw = || draw(sample.clone(), &options, output);
                    figure_count += u64::from(has_figure(&name, MAX_BYTES, draw));
                }
            }
        }
    }
    // Errors alone would not show that figures are drawn.
    assert!(figure_count > 4 * rounds, "{figure_count}");
}
