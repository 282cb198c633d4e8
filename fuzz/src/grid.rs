//! Fuzz target of grid files, machine files and constants. An input gives either a plan whose
//! corners can be prepared and integrated, or a list of mistakes.

#![no_main]

mod input;

use std::path::Path;
use std::sync::OnceLock;

use input::Input;
use lane_ode::Simd;
use libfuzzer_sys::{Corpus, fuzz_target};
use sweep::{Job, Plan};
use tempfile::TempDir;
use washer_model::{Method, ModelKind, Point, Timing, prepare, simulate};

/// The greatest length of a list of mistakes (bytes). Basis: a list shows a limited number of
/// mistakes, each in a few lines. Doubling it finds fewer lists that are too long.
const MAX_LIST_LEN: usize = 200_000;

/// The end of the runs (s). Basis: some twenty steps, so that an input takes a fraction of a
/// millisecond. Doubling it halves the inputs in the same time.
const END_S: f64 = 2e-3;
/// The step of the runs (s). Basis: below the limit of stability for usual machines. Doubling it
/// lets more runs fail, which tests less.
const STEP_S: f64 = 1e-4;

fuzz_target!(|bytes: &[u8]| -> Corpus {
    let input = Input::new(bytes);
    let Ok(grid) = input.write(folder()) else { return Corpus::Reject };
    match sweep::load(&grid, &input.sets) {
        Ok(plan) => check_plan(&plan),
        Err(mistakes) => {
            let text = mistakes.to_string();
            assert!(text.contains("nothing was done"), "{text}");
            assert!(text.len() < MAX_LIST_LEN, "a list of mistakes of {} bytes", text.len());
        }
    }
    Corpus::Keep
});

/// Checks that the corners of a valid plan can be prepared and integrated.
fn check_plan(plan: &Plan) {
    assert!(plan.points() >= 1);
    assert_eq!(plan.axis_values(plan.points() - 1).len(), plan.axes.len());
    assert!(plan.window_s[0] < plan.window_s[1] && plan.window_s[1] <= plan.end_s);
    assert_eq!(Job::new(plan).hash(), Job::new(plan).hash());
    let machines: Vec<_> = (0..plan.corner_count().min(4))
        .map(|corner| {
            let input = sweep::point_input(plan, &plan.corner_values(corner));
            assert_eq!(input.machine.violations(), []);
            assert_eq!(input.spin.violations(), []);
            (input.machine, input.spin)
        })
        .collect();
    let end_s = END_S.min(plan.end_s);
    let timing = Timing { end_s, window_s: [0.0, end_s], checkpoints: 0 };
    let mut instruction_sets = Simd::ALL.into_iter();
    let simd = instruction_sets.find(|simd| simd.name() == "scalar").unwrap_or_else(Simd::widest);
    let prepared = prepare(simd, &machines, &timing);
    let points: Vec<&Point> = prepared.iter().filter_map(|point| point.as_ref().ok()).collect();
    for model in [ModelKind::Nonlinear, ModelKind::Linear] {
        let records = simulate(simd, model, &Method::rk4(STEP_S), &points);
        assert_eq!(records.len(), points.len());
        for record in records {
            let is_finite = record.amplitudes.iter().all(|amplitude| amplitude.is_finite());
            assert!(record.failure.is_some() || is_finite, "{record:?}");
        }
    }
}

fn folder() -> &'static Path {
    /// The folder of the input's files, which all inputs share.
    static FOLDER: OnceLock<TempDir> = OnceLock::new();
    FOLDER.get_or_init(|| tempfile::tempdir().expect("a temporary folder")).path()
}
