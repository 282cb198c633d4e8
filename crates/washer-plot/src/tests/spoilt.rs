//! Files with cells that other writers, or runs that failed, leave: a figure or an error, always.

use std::time::{Duration, Instant};

use super::sample::Sample;
use super::stability::stability;
use super::*;

/// How long a figure of a small file may take: a hundred times what the slowest of the intact ones
/// takes. A larger bound finds only loops that never end.
const LONGEST: Duration = Duration::from_secs(20);

/// Most bytes of a figure of a small file: four times the largest page of the intact ones.
const MOST_BYTES: usize = 8 << 20;

/// Motions of held speeds with their states once a turn.
fn dwells() -> Sample {
    let rows: Vec<[f64; 3]> = (0..6)
        .flat_map(|k| (0..2).flat_map(move |motion| (0..4).map(move |turn| [k, motion, turn])))
        .map(|row| row.map(f64::from))
        .collect();
    let of = |value: fn(&[f64; 3]) -> f64| rows.iter().map(value);
    let kinds = ["periodic", "chaotic", "quasi_periodic", ""];
    Sample::default()
        .counts("point", rows.iter().map(|_| 0))
        .numbers("unbalance_mass_kg", "kg", of(|_| 0.4))
        .numbers("speed_rpm", "rpm", of(|row| 200.0 + 10.0 * row[0]))
        .numbers("motion", "1", of(|row| row[1]))
        .numbers("turn", "1", of(|row| row[2]))
        .words("kind", rows.iter().map(|row| Some(kinds[row[0] as usize % 4])))
        .numbers("growth_per_s", "1/s", of(|row| row[0] - 3.0))
        .numbers("nonlinear_tub_yaw", "rad", of(|row| 0.01 * (1.0 + row[1])))
        .numbers("linear_tub_yaw", "rad", of(|_| 0.005))
        .numbers("periodic_tub_yaw", "rad", of(|_| 0.008))
        .numbers("q5_rad", "rad", of(|row| 0.001 * row[2]))
        .numbers("q6_rad", "rad", of(|row| 0.002 * row[2]))
        .words("status", rows.iter().map(|_| Some("ok")))
}

/// `SEED=7 ROUNDS=100 cargo test --release -p washer-plot --lib spoilt` tries other files.
#[test]
fn spoilt_files_have_a_figure_or_an_error() {
    let given = |name, usual| std::env::var(name).map_or(usual, |text| text.parse().unwrap());
    let (seed, rounds) = (given("SEED", 61), given("ROUNDS", 2));
    let mut numbers = fastrand::Rng::with_seed(seed);
    let of = |sample: fn() -> Sample, views: &'static [View]| (sample, views);
    let one_point: fn() -> Sample = || stability(&[0.4]);
    let files = [
        of(trace, &[View::Time, View::Passages, View::Profiles, View::Spectrum]),
        of(modes, &[View::Frequencies, View::Variation, View::Shapes]),
        of(one_point, &[View::Growth, View::Responses]),
        of(dwells, &[View::Growth, View::Sections]),
    ];
    let folder = tempfile::tempdir().unwrap();
    let unstable = stability(&[0.4]).write(folder.path(), "stability.parquet");
    let with_unstable =
        WasherFigures { stability: Some(unstable.clone()), ..WasherFigures::default() };
    let mut drawn = 0_u64;
    for round in 0..rounds {
        for (k, (sample, views)) in files.iter().enumerate() {
            let sample = sample().spoilt(&mut numbers);
            let views = views.iter().map(|view| viewed(*view));
            for options in views.chain([WasherFigures::default(), with_unstable.clone()]) {
                for output in ["a.svg", "a.html"] {
                    let name = format!("SEED={seed}, round {round}, file {k}, {output}");
                    let name = format!("{name}, {:?}", options.view);
                    let begun = Instant::now();
                    let result = draw(sample.clone(), &options, output);
                    let took = begun.elapsed();
                    assert!(took < LONGEST, "{name}: {took:?}");
                    match result {
                        Ok(bytes) => {
                            assert!(bytes.len() < MOST_BYTES, "{name}: {} bytes", bytes.len());
                            drawn += 1;
                        }
                        Err(error) => assert!(!error.to_string().is_empty(), "{name}"),
                    }
                }
            }
        }
    }
    // Errors alone would prove nothing.
    assert!(drawn > 4 * rounds, "{drawn}");
}
