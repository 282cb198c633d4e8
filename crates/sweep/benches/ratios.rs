//! Ratios of times, which are published: `cargo bench --bench ratios [-- ROUNDS]` writes them as
//! Markdown. Subjects take turns, round by round, so that a slow moment of the computer affects all
//! of them. Figures are medians over the rounds.
#![allow(clippy::print_stdout)]

use std::path::Path;
use std::process::Command;
use std::time::Instant;

use lane_ode::{Cancel, Simd};
use washer_model::{
    BumpStop, Bushing, HeldSpeed, Machine, Method, MethodKind, ModelKind, Point, Profile, Spin,
    StartRule, StepSelector, Timing, capped_method, find_attractors, find_responses, prepare,
    simulate,
};

/// Number of trajectories of a kernel. Basis: the number of lanes of AVX-512. Doubling it takes two
/// passes of the widest kernel.
const TRAJECTORY_COUNT: usize = 8;

/// Step (s) of the kernels. Basis: it is stable on the paper's machine. Doubling it is not.
const STEP_S: f64 = 2.5e-4;

/// Number of rounds, of which medians are reported. Doubling it doubles the time.
const DEFAULT_ROUNDS: usize = 5;

fn main() {
    // Cargo adds the argument `--bench`, which is not a number.
    let rounds = std::env::args()
        .skip(1)
        .find_map(|argument| argument.parse().ok())
        .unwrap_or(DEFAULT_ROUNDS);
    measure_trajectories(rounds);
    let coarsest_level_s = measure_methods(rounds);
    measure_threads(rounds, coarsest_level_s);
    measure_boundaries(rounds);
    measure_responses(rounds, coarsest_level_s / 1287.0);
    measure_motions(rounds);
    measure_elements(rounds);
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}

/// Prints a table with the median of each subject, and returns the medians. The header has the
/// greatest relative distance of a round from its median.
fn print_table(unit: &str, subjects: &[String], rounds: &[Vec<f64>]) -> Vec<f64> {
    let medians: Vec<f64> = rounds.iter().map(|values| median(values)).collect();
    let greatest_deviation = rounds
        .iter()
        .zip(&medians)
        .flat_map(|(values, median)| values.iter().map(move |value| (value / median - 1.0).abs()))
        .fold(0.0, f64::max);
    println!("| {unit}, rounds within {:.0} % | |\n|---|---|", 1e2 * greatest_deviation);
    for (subject, median) in subjects.iter().zip(&medians) {
        println!("| {subject} | {median:.3} |");
    }
    println!();
    medians
}

/// Measures trajectories of both models on one core, with every instruction set.
fn measure_trajectories(rounds: usize) {
    let scenario = (
        Machine::paper(),
        Spin::Ramped { profile: Profile::Triangular, peak_rpm: 350.0, ramp_s: 50.0 },
    );
    let timing = Timing { end_s: 50.0, window_s: [30.0, 50.0], checkpoints: 0 };
    let points: Vec<Point> = prepare(Simd::widest(), &vec![scenario; TRAJECTORY_COUNT], &timing)
        .into_iter()
        .map(|point| point.expect("the paper's machine has an equilibrium"))
        .collect();
    let points: Vec<_> = points.iter().collect();
    let available: Vec<_> = Simd::ALL.into_iter().filter(|simd| simd.is_available()).collect();
    let models = [("nonlinear", ModelKind::Nonlinear), ("linear", ModelKind::Linear)];
    let subjects: Vec<_> = available
        .iter()
        .flat_map(|&simd| models.map(|(name, model)| (simd, name, model)))
        .collect();
    let mut times = vec![Vec::new(); subjects.len()];
    for _ in 0..rounds {
        for (&(simd, _, model), times) in subjects.iter().zip(&mut times) {
            let start_instant = Instant::now();
            let records = simulate(simd, model, &Method::rk4(STEP_S), &points);
            times.push(start_instant.elapsed().as_secs_f64() * 1e3 / TRAJECTORY_COUNT as f64);
            assert!(records.iter().all(|record| record.failure.is_none()));
        }
    }
    println!(
        "One core, {TRAJECTORY_COUNT} trajectories of 50 s by RK4 at {STEP_S:e} s, with peaks:\n"
    );
    let names: Vec<_> =
        subjects.iter().map(|(simd, name, _)| format!("{name}, {}", simd.name())).collect();
    let medians = print_table("ms a trajectory", &names, &times);
    let median_ms = |simd: Simd, name: &str| {
        subjects
            .iter()
            .position(|subject| subject.0 == simd && subject.1 == name)
            .map(|at| medians[at])
    };
    println!("| ratio | |\n|---|---|");
    for (name, _) in models {
        for simd in available.iter().filter(|simd| **simd != Simd::Scalar) {
            if let (Some(wide), Some(scalar)) =
                (median_ms(*simd, name), median_ms(Simd::Scalar, name))
            {
                println!("| {name}: {} against scalar | {:.2} |", simd.name(), scalar / wide);
            }
        }
    }
    println!();
}

/// Measures plain steps and the fast method on one core, on the whole grid of Fig. 12. Returns the
/// time (s) of a trajectory of each model by the fast method at 1e-3.
fn measure_methods(rounds: usize) -> f64 {
    let spin = Spin::Ramped { profile: Profile::Triangular, peak_rpm: 350.0, ramp_s: 50.0 };
    let end_s = 50.0;
    let window_s = [30.0, 50.0];
    let mut scenarios = Vec::new();
    for mass in 0..39 {
        for damping in 0..33 {
            let mut machine = Machine::paper();
            machine.unbalance.mass_kg = 0.05 + 0.025 * f64::from(mass);
            for damper in &mut machine.dampers {
                damper.damping_n_s_per_m = 60.0 + 7.5 * f64::from(damping);
            }
            scenarios.push((machine, spin.clone()));
        }
    }
    let points: Vec<Point> =
        prepare(Simd::widest(), &scenarios, &Timing { end_s, window_s, checkpoints: 0 })
            .into_iter()
            .map(|point| point.expect("the paper's machine has an equilibrium"))
            .collect();
    let last = points.len() - 1;
    let corners = [0, 32, last - 32, last].map(|corner| (&points[corner], &spin));
    let steps = StepSelector::new(corners, end_s);
    let models = [("nonlinear", ModelKind::Nonlinear), ("linear", ModelKind::Linear)];
    let capped_methods = models.map(|(_, model)| {
        let step_s = steps.capped_step_s(model).expect("the paper's machine has modes");
        capped_method(model, MethodKind::Capped0, step_s.expect("its bearings are stiff"))
    });
    let methods = [
        (format!("rk4, {STEP_S:e} s"), [Method::rk4(STEP_S); 2]),
        ("capped_0".to_owned(), capped_methods),
    ];
    let subjects: Vec<_> = methods
        .iter()
        .flat_map(|(name, by_model)| {
            core::array::from_fn::<_, 2, _>(|i| {
                let (model, kind) = models[i];
                (format!("{model}, {name}"), kind, by_model[i])
            })
        })
        .collect();
    let points: Vec<_> = points.iter().collect();
    let mut times = vec![Vec::new(); subjects.len()];
    for _ in 0..rounds {
        for ((_, model, method), times) in subjects.iter().zip(&mut times) {
            let start_instant = Instant::now();
            let records = simulate(Simd::widest(), *model, method, &points);
            times.push(start_instant.elapsed().as_secs_f64());
            assert!(records.iter().all(|record| record.failure.is_none()));
        }
    }
    println!(
        "One core, {}, the {} points of Fig. 12, each trajectory once; what a run adds (runs\n\
         that are compared, refined rows) is below:\n",
        Simd::widest().name(),
        points.len()
    );
    let names: Vec<_> = subjects.iter().map(|subject| subject.0.clone()).collect();
    let medians = print_table("s a grid", &names, &times);
    println!("| ratio | |\n|---|---|");
    for (model, _) in models.iter().enumerate() {
        for method in 1..methods.len() {
            let ratio = medians[model] / medians[2 * method + model];
            println!("| {} against {} | {ratio:.1} |", names[2 * method + model], methods[0].0);
        }
    }
    println!();
    medians[2] + medians[3]
}

const FIG12_PATH: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../sweeps/fig12.toml");

/// Returns the time (s) that the program takes with these arguments, in a folder for its output.
fn measure_program_s(folder: &Path, arguments: &[&str]) -> f64 {
    let start_instant = Instant::now();
    let output = Command::new(env!("CARGO_BIN_EXE_sweep"))
        .args(arguments)
        .args(["--fresh", "--progress", "none", "--out"])
        .arg(folder.join(format!("{}.parquet", arguments[0])))
        .output();
    let took_s = start_instant.elapsed().as_secs_f64();
    let output = output.expect("the sweep program starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    took_s
}

/// Creates a folder for the program's output.
fn temporary_folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("a temporary folder can be made")
}

/// Measures the grid of Fig. 12 and its boundary with each criterion.
fn measure_boundaries(rounds: usize) {
    let folder = temporary_folder();
    let text = std::fs::read_to_string(FIG12_PATH).expect("the grid file of Fig. 12");
    let criteria = ["peak", "rms", "envelope"].map(|criterion| {
        let path = folder.path().join(format!("{criterion}.toml"));
        let reliability = format!("[reliability]\ncriterion = \"{criterion}\"");
        std::fs::write(&path, text.replace("[reliability]", &reliability)).expect("a grid file");
        (criterion, path)
    });
    let commands = ["run", "boundary"];
    let mut times = vec![Vec::new(); criteria.len() * commands.len()];
    for _ in 0..rounds {
        for (i, (_, path)) in criteria.iter().enumerate() {
            let path = path.to_str().expect("a path in Unicode");
            for (k, command) in commands.iter().enumerate() {
                let took_s = measure_program_s(folder.path(), &[command, path, "--threads", "1"]);
                times[commands.len() * i + k].push(took_s);
            }
        }
    }
    println!(
        "`sweep run` and `sweep boundary` of `sweeps/fig12.toml`, by criterion, on one thread:\n"
    );
    let names: Vec<_> = criteria
        .iter()
        .flat_map(|(criterion, _)| commands.map(|command| format!("{criterion}: sweep {command}")))
        .collect();
    let medians = print_table("s", &names, &times);
    println!("| ratio | |\n|---|---|");
    for (i, (criterion, _)) in criteria.iter().enumerate() {
        let time_ratio = medians[commands.len() * i + 1] / medians[commands.len() * i];
        println!("| {criterion}: boundary against grid | {time_ratio:.3} |");
    }
    println!();
}

/// Measures the periodic responses of both models at held speeds, with all multipliers. `pair_s` is
/// the time of a point's two trajectories of 50 s by the fast method.
fn measure_responses(rounds: usize, pair_s: f64) {
    let spin = Spin::Ramped { profile: Profile::Ramp, peak_rpm: 350.0, ramp_s: 50.0 };
    let timing = Timing { end_s: 50.0, window_s: [30.0, 50.0], checkpoints: 0 };
    let mut machine = Machine::paper();
    machine.unbalance.mass_kg = 0.4;
    let point = prepare(Simd::widest(), &[(machine, spin)], &timing)
        .remove(0)
        .expect("the paper's machine has an equilibrium");
    let held_speeds: Vec<HeldSpeed<'_>> =
        (0..=140).map(|k| HeldSpeed { point: &point, speed_rpm: 210.0 + f64::from(k) }).collect();
    let mut times = vec![Vec::new()];
    for _ in 0..rounds {
        let start_instant = Instant::now();
        let responses = find_responses(&held_speeds, Cancel::Never);
        times[0].push(start_instant.elapsed().as_secs_f64() * 1e3 / held_speeds.len() as f64);
        assert!(responses.iter().all(Result::is_ok));
    }
    println!("One core, a point of 0.4 kg and 140 N s/m at 210 to 350 rpm, by 1 rpm:\n");
    let medians =
        print_table("ms a speed", &["both responses, all multipliers".to_owned()], &times);
    println!(
        "| ratio | |\n|---|---|\n| a speed of a point against its two trajectories of 50 s, \
         rk4-mass-scaled, 1e-3 | {:.3} |\n",
        1e-3 * medians[0] / pair_s
    );
}

/// Measures the search for motions at a held speed, from eight starts of 100 s, against eight
/// trajectories with peaks: with as many steps of the same formula, and with as long a time by
/// plain RK4.
fn measure_motions(rounds: usize) {
    const SPEED_RPM: f64 = 250.0;
    const STEPS_A_TURN: f64 = 96.0;
    let mut machine = Machine::paper();
    machine.unbalance.mass_kg = 0.4;
    let spin = Spin::Table { time_s: vec![0.0], speed_rpm: vec![SPEED_RPM] };
    let prepare_points = |end_s: f64| -> Vec<Point> {
        let timing = Timing { end_s, window_s: [0.0, end_s], checkpoints: 0 };
        let scenarios = vec![(machine.clone(), spin.clone()); TRAJECTORY_COUNT];
        let points: Result<_, _> =
            prepare(Simd::widest(), &scenarios, &timing).into_iter().collect();
        points.expect("the paper's machine has an equilibrium")
    };
    let dwell_points = prepare_points(1.0);
    let held_speeds = [HeldSpeed { point: &dwell_points[0], speed_rpm: SPEED_RPM }];
    let starts =
        StartRule { start_count: TRAJECTORY_COUNT, max_time_s: 100.0, ..StartRule::default() };
    let find_motions =
        || find_attractors(Simd::widest(), &held_speeds, &[], &starts, Cancel::Never).remove(0);
    // The time is a whole number of windows.
    let followed_s =
        find_motions().map(|found| found.attractors[0].time_s).expect("it has motions");
    let points_of_as_many_steps =
        prepare_points(followed_s * SPEED_RPM / 60.0 * STEPS_A_TURN * STEP_S);
    let points_of_as_long_time = prepare_points(followed_s);
    let integrate = |points: &[Point]| {
        let points: Vec<&Point> = points.iter().collect();
        let method = Method::rk4(STEP_S);
        let records = simulate(Simd::widest(), ModelKind::Nonlinear, &method, &points);
        assert!(records.iter().all(|record| record.failure.is_none()));
    };
    let mut times = vec![Vec::new(); 4];
    for _ in 0..rounds {
        let measured_works: [&dyn Fn(); 4] = [
            &|| assert!(find_motions().is_ok()),
            &|| assert!(find_responses(&held_speeds, Cancel::Never)[0].is_ok()),
            &|| integrate(&points_of_as_many_steps),
            &|| integrate(&points_of_as_long_time),
        ];
        for (work, times) in measured_works.iter().zip(&mut times) {
            let start_instant = Instant::now();
            work();
            times.push(start_instant.elapsed().as_secs_f64() * 1e3);
        }
    }
    println!(
        "One core, what {SPEED_RPM} rpm ends in from {TRAJECTORY_COUNT} starts, followed for \
         {followed_s:.0} s:\n"
    );
    let names = [
        "responses, starts, settling".to_owned(),
        "of these, both models' responses".to_owned(),
        "trajectories of as many RK4 steps".to_owned(),
        format!("trajectories as long by RK4 at {STEP_S:e} s"),
    ];
    let medians = print_table("ms", &names, &times);
    println!(
        "| ratio | |\n|---|---|\n\
         | motions against trajectories of as many steps | {:.2} |\n\
         | motions without responses against these | {:.2} |\n\
         | motions against trajectories as long by RK4 at {STEP_S:e} s | {:.2} |\n",
        medians[0] / medians[2],
        (medians[0] - medians[1]) / medians[2],
        medians[0] / medians[3]
    );
}

/// Measures the map of Fig. 12 by the program. `once_s` is the time of one trajectory of each model
/// at every point, by the coarsest level.
fn measure_threads(rounds: usize, once_s: f64) {
    let folder = temporary_folder();
    let thread_counts = ["1", "2"];
    let mut times = vec![Vec::new(); thread_counts.len()];
    for _ in 0..rounds {
        for (count, times) in thread_counts.iter().zip(&mut times) {
            times.push(measure_program_s(folder.path(), &["run", FIG12_PATH, "--threads", count]));
        }
    }
    println!(
        "`sweep run sweeps/fig12.toml` (1287 points, both models), start of the program included:\n"
    );
    let names: Vec<_> = thread_counts.iter().map(|count| format!("--threads {count}")).collect();
    let medians = print_table("s a map", &names, &times);
    println!(
        "| ratio | |\n|---|---|\n| two threads against one | {:.2} |\n| the run against its \
         trajectories once: the cost of checks and refinement | {:.2} |\n",
        medians[0] / medians[1],
        medians[0] / once_s
    );
}

/// Measures the time that each element of a suspension adds to a step. The machines have two
/// friction dampers, three stops, a gasket or four stiffening springs, with the numbers of
/// `docs/examples/friction.toml`; the numbers of the springs are assumed.
fn measure_elements(rounds: usize) {
    let add_friction = |machine: &mut Machine| {
        for damper in &mut machine.dampers {
            damper.friction_n = 50.0;
            damper.friction_speed_m_per_s = 0.01;
            damper.friction_linear_speed_m_per_s = Some(0.15);
        }
    };
    let add_stops = |machine: &mut Machine| {
        let places = [
            ([0.35, 0.0, 0.28], [0.0, 0.0, 1.0], 0.02),
            ([0.35, 0.0, -0.28], [0.0, 0.0, -1.0], 0.02),
            ([0.3, -0.28, 0.0], [0.0, -1.0, 0.0], 0.03),
        ];
        machine.stops = places
            .map(|(tub_m, direction, clearance_m)| BumpStop {
                tub_m,
                direction,
                clearance_m,
                stiffness_n_per_m: 4e4,
                damping_n_s_per_m: 100.0,
                softness_m: 1e-4,
            })
            .to_vec();
    };
    let add_gasket = |machine: &mut Machine| {
        machine.bushings = vec![Bushing {
            tub_m: [0.45, 0.0, 0.0],
            stiffness_n_per_m: [0.0, 600.0, 600.0],
            cubic_n_per_m3: [0.0, 5e6, 5e6],
            damping_n_s_per_m: [0.0, 12.0, 12.0],
        }];
    };
    let stiffen_springs = |machine: &mut Machine| {
        machine.springs.iter_mut().for_each(|spring| spring.cubic_n_per_m3 = 2e5);
    };
    type MachineChange<'a> = &'a dyn Fn(&mut Machine);
    let subjects: [(&str, &[MachineChange<'_>]); 6] = [
        ("none", &[]),
        ("two friction dampers", &[&add_friction]),
        ("three stops", &[&add_stops]),
        ("gasket", &[&add_gasket]),
        ("four stiffening springs", &[&stiffen_springs]),
        ("all of these", &[&add_friction, &add_stops, &add_gasket, &stiffen_springs]),
    ];
    let timing = Timing { end_s: 50.0, window_s: [30.0, 50.0], checkpoints: 0 };
    let spin = Spin::Ramped { profile: Profile::Triangular, peak_rpm: 350.0, ramp_s: 50.0 };
    let points_by_subject = subjects.map(|(_, fits)| {
        let scenarios: Vec<_> = (0..TRAJECTORY_COUNT)
            .map(|i| {
                let mut machine = Machine::paper();
                machine.unbalance.mass_kg = 0.1 + 0.3 * i as f64 / TRAJECTORY_COUNT as f64;
                fits.iter().for_each(|fit| fit(&mut machine));
                (machine, spin.clone())
            })
            .collect();
        prepare(Simd::widest(), &scenarios, &timing)
    });
    let mut times = vec![Vec::new(); subjects.len()];
    for _ in 0..rounds {
        for (points, times) in points_by_subject.iter().zip(&mut times) {
            let points: Vec<&Point> = points
                .iter()
                .map(|point| point.as_ref().expect("every machine here has an equilibrium"))
                .collect();
            let start_instant = Instant::now();
            for model in [ModelKind::Nonlinear, ModelKind::Linear] {
                let records = simulate(Simd::widest(), model, &Method::rk4(2e-4), &points);
                assert!(records.iter().all(|record| record.failure.is_none()));
            }
            times.push(start_instant.elapsed().as_secs_f64() * 1e3 / TRAJECTORY_COUNT as f64);
        }
    }
    println!("One core, both models by RK4 at 2e-4 s, machines with elements:\n");
    let names = subjects.map(|(name, _)| name.to_owned());
    let medians = print_table("ms a point", &names, &times);
    println!("| against a machine without them | |\n|---|---|");
    for (name, median) in names.iter().zip(&medians).skip(1) {
        println!("| {name} | {:.2} |", median / medians[0]);
    }
}
