use arrow_array::RecordBatch;
use arrow_array::cast::AsArray as _;
use arrow_array::types::Float64Type;
use lane_ode::Cancel;

use super::*;
use crate::engine::ModelEngine;

#[test]
fn start_values_are_of_coordinates_and_speeds() {
    assert_eq!(
        parse_start_value("q5=0.1"),
        Ok(StartValue { is_speed: false, index: 4, value: 0.1 })
    );
    assert_eq!(
        parse_start_value(" u10 = -2"),
        Ok(StartValue { is_speed: true, index: 9, value: -2.0 })
    );
    for wrong in ["", "q5", "q0=1", "q11=1", "x=1", "q1=nan", "u1=1e999", "q=1", "q5=2"] {
        assert!(parse_start_value(wrong).unwrap_err().contains("expected"), "{wrong}");
    }
}

/// Returns the greatest magnitude of a column from an instant on.
fn column_peak(rows: &RecordBatch, column: &str, first_row: usize) -> f64 {
    let values = rows.column_by_name(column).unwrap().as_primitive::<Float64Type>();
    values.values()[first_row..].iter().fold(0.0, |peak, value| value.abs().max(peak))
}

/// A fixed step of 2e-4 s misses the corners of friction, with errors of 1 % of a foot's load.
#[test]
fn a_trace_with_friction_is_as_accurate_as_its_row() {
    let folder = tempfile::tempdir().unwrap();
    let machine = include_str!("../../../../docs/examples/friction.toml");
    std::fs::write(folder.path().join("machine.toml"), machine).unwrap();
    let grid = "machine = \"machine.toml\"\n[time]\nend_s = 3.3\nwindow_s = [3.2, 3.3]\n\
         [spin]\nprofile = \"table\"\ntime_s = [0, 3, 3.2, 3.25]\n\
         speed_rpm = [0, 1400, 0, 0]\n";
    let path = folder.path().join("grid.toml");
    let foot_loads_and_method = |integrator: &str| {
        std::fs::write(&path, format!("{grid}{integrator}")).unwrap();
        let plan = crate::config::load(&path, &[]).unwrap();
        let extras = TraceExtras { forces: true, ..TraceExtras::default() };
        let settings = TraceSettings {
            every_s: Some(1e-3),
            models: Models::Nonlinear,
            start: InitialDeviation::default(),
            extras,
            capped: None,
        };
        let trace = trace_one_point(&plan, 0, Vec::new(), &settings, Cancel::Never).unwrap();
        let trace_rows = trace.table.finish().unwrap().0;
        let load_column = trace_rows.column_by_name("foot_1_load_nonlinear_n").unwrap();
        (load_column.as_primitive::<Float64Type>().values()[3200..].to_vec(), trace.method)
    };
    let (reference_loads_n, method) = foot_loads_and_method("");
    assert_eq!(method, Some(MethodKind::Dop853));
    let (expected_loads_n, _) =
        foot_loads_and_method("[integrator]\nmethod = \"rk4\"\nstep_s = 1e-5\n");
    for (load_n, expected_n) in reference_loads_n.iter().zip(&expected_loads_n) {
        assert!((load_n / expected_n - 1.0).abs() < 2e-3, "{load_n} for {expected_n}");
    }
}

#[test]
fn a_trace_by_a_rows_method_is_the_trajectory_of_the_row() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("grid.toml");
    let grid = "spin = { profile = \"triangular\", peak_rpm = 350, ramp_s = 50 }\n\
         time = { end_s = 50, window_s = [30, 50] }\n\
         [[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [0.05, 0.3, 0.8]\n\
         [[axis]]\nparameter = \"damping_n_s_per_m\"\nvalues = [100, 300]\n";
    std::fs::write(&path, grid).unwrap();
    let plan = crate::config::load(&path, &[]).unwrap();
    let engine = ModelEngine::new(&plan).unwrap();
    let points: Vec<_> = (0..plan.points()).map(|point| plan.axis_values(point)).collect();
    let every_s = 0.002;
    let window_start_row = (plan.window_s[0] / every_s) as usize;
    let mut capped_row_count = 0;
    for row in engine.outcomes_at(&points) {
        let Some(capped) = engine.capped_run(row.method) else { continue };
        capped_row_count += 1;
        assert_eq!(capped.methods[0].kind, row.method);
        let settings = TraceSettings {
            every_s: Some(every_s),
            models: Models::Both,
            start: InitialDeviation::default(),
            extras: TraceExtras::default(),
            capped: Some(capped),
        };
        let trace_result = trace_one_point(&plan, row.point, Vec::new(), &settings, Cancel::Never);
        let (trace_rows, _) = trace_result.unwrap().table.finish().unwrap();
        // The row's level is that of the nonlinear model; the linear one may have another. Peaks
        // between long steps have an error of 1e-5.
        for (name, model, max_excess) in
            [("nonlinear", &row.nonlinear, 1e-5), ("linear", &row.linear, 1e-3)]
        {
            for (channel, amplitude) in plan.reliability.channels.iter().zip(&model.amplitudes) {
                let sampled_peak =
                    column_peak(&trace_rows, &format!("{name}_{}", channel.name), window_start_row);
                // The trace may miss the peak, which lies between two instants.
                let peak_ratio = sampled_peak / amplitude;
                assert!(
                    (0.998..1.0 + max_excess).contains(&peak_ratio),
                    "{row:?} {channel:?}: {peak_ratio}"
                );
            }
        }
    }
    assert!(capped_row_count >= 3, "{capped_row_count}");
}

#[test]
fn points_integrated_together_have_the_bits_that_each_has_alone() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("grid.toml");
    // A run takes several steps, and there are more machines than lanes.
    let grid = "spin = { profile = \"ramp\", peak_rpm = 250, ramp_s = 2 }\n\
         time = { end_s = 4 }\n\
         [[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [0.1, 0.4, 0.7]\n\
         [[axis]]\nparameter = \"spring_stiffness_n_per_m\"\nvalues = [5e3, 9e3, 4e5]\n";
    std::fs::write(&path, grid).unwrap();
    let plan = crate::config::load(&path, &[]).unwrap();
    for (every_s, models) in [(Some(0.03), Models::Both), (None, Models::Nonlinear)] {
        let extras = TraceExtras { rates: true, states: true, forces: true, angle: true };
        let settings = TraceSettings {
            every_s,
            models,
            start: InitialDeviation::default(),
            extras,
            capped: None,
        };
        let all_traces = trace_all_points(&plan, &settings, Cancel::Never);
        assert_eq!(every_s.is_none(), all_traces.instants < 9 * 20);
        let (all_rows, _) = all_traces.table.finish().unwrap();
        let mut first_row = 0;
        for point in 0..plan.points() {
            let point_trace =
                trace_one_point(&plan, point, Vec::new(), &settings, Cancel::Never).unwrap();
            let (point_rows, _) = point_trace.table.finish().unwrap();
            for (k, field) in point_rows.schema().fields().iter().enumerate() {
                let column_of_all = all_rows.column_by_name(field.name()).unwrap();
                let slice_of_point = column_of_all.slice(first_row, point_rows.num_rows());
                assert_eq!(&slice_of_point, point_rows.column(k), "{field:?} at point {point}");
            }
            first_row += point_rows.num_rows();
        }
        assert_eq!(all_rows.num_rows(), first_row);
    }
}

/// Returns a plan of two points whose drums make ten turns a second after a ramp of 2 s.
fn plan_with_ramp(end_s: f64) -> Plan {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("grid.toml");
    let grid = format!(
        "spin = {{ profile = \"ramp\", peak_rpm = 600, ramp_s = 2 }}\n\
         time = {{ end_s = {end_s} }}\n\
         [[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [0.1, 0.4]\n"
    );
    std::fs::write(&path, grid).unwrap();
    crate::config::load(&path, &[]).unwrap()
}

#[test]
fn too_many_turns_are_refused_before_any_work() {
    assert_eq!(check_spacing(None, &plan_with_ramp(90_000.0)).unwrap(), None);
    let refusal_message = check_spacing(None, &plan_with_ramp(110_000.0)).unwrap_err().to_string();
    for word in ["--turns to 110000 s", "at most 2000000 turns", "end_s"] {
        assert!(refusal_message.contains(word), "{refusal_message}");
    }
}

#[test]
fn the_angle_of_a_whole_turn_is_zero() {
    let extras = TraceExtras { angle: true, ..TraceExtras::default() };
    let settings = TraceSettings {
        every_s: None,
        models: Models::Linear,
        start: InitialDeviation::default(),
        extras,
        capped: None,
    };
    let all_traces = trace_all_points(&plan_with_ramp(4.05), &settings, Cancel::Never);
    assert_eq!(all_traces.instants, 2 * 31);
    let (rows, _) = all_traces.table.finish().unwrap();
    assert_eq!(column_peak(&rows, "drum_angle_rad", 0), 0.0);
}
