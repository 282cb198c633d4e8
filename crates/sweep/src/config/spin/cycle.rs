//! A cycle from a file: the drum's speed over time, with straight or smooth joints between points.

use std::path::Path;

use sweep_engine::config::list::{ColumnNames, ListColumn, NumberTable};
use sweep_engine::config::section::format_count;
use sweep_engine::config::{Diagnostic, Location, Report};
use washer_model::{Range, decimal};

use super::MAX_TABLE_ROWS;

/// Range of a cycle's speeds (rpm), that of a table in the grid file. Basis: far above any washing
/// machine. Doubling it accepts more mistakes of units.
const SPEED_RANGE_RPM: Range = Range::Within(-1e5, 1e5);

/// Maximum distance of the straight pieces from a smooth joint, relative to the greatest speed.
/// Basis: less than the resolution of a tachometer. A joint from rest to full speed has about 60
/// pieces, each a segment of every run. Doubling it takes 1.4 times fewer pieces.
const JOINT_TOLERANCE: f64 = 1e-4;

/// The interpolation between the points of a cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum JointKind {
    /// Straight lines.
    Straight,
    /// Monotone cubics, cut into straight pieces.
    Smooth,
}

impl JointKind {
    /// All interpolations, with their names in grid files.
    pub(super) const ALL: [(Self, &'static str); 2] =
        [(Self::Straight, "straight"), (Self::Smooth, "smooth")];
}

/// The times (s) and speeds (rpm) of a cycle's points.
pub(super) type CyclePoints = (Vec<f64>, Vec<f64>);

/// Reads a cycle's points and joins them; mistakes are reported. `location` is that of the file's
/// name.
pub(super) fn read(
    path: &Path,
    joints: JointKind,
    location: &Location,
    report: &Report,
) -> Option<CyclePoints> {
    let table = NumberTable::read_point_list(
        path,
        &ColumnNames { find_quantity: &find_quantity_and_unit, renamed_headers: &[] },
        report,
    )?;
    table.notes().into_iter().for_each(|note| report.add_note(format!("the cycle: {note}")));
    let times = find_column(&table, "time_s", "time", location, report);
    let speeds = find_column(&table, "speed_rpm", "speed", location, report);
    let times = times?;
    let speeds = speeds?;
    if !check_columns(&table, times, speeds, report) {
        return None;
    }
    // Smooth joints multiply the number of rows by up to a hundred, so that a table that is too
    // long is not joined.
    let fits_in_table = |rows: usize| rows <= MAX_TABLE_ROWS;
    let points = match joints {
        JointKind::Smooth if fits_in_table(times.values.len()) => {
            interpolate_smoothly(&times.values, &speeds.values)
        }
        _ => (times.values.clone(), speeds.values.clone()),
    };
    if !fits_in_table(points.0.len()) {
        let title =
            format!("the cycle has {} with its joints", format_count(points.0.len(), "row"));
        let expected = format!(
            "expected at most {MAX_TABLE_ROWS}: leave out rows between which the speed is straight"
        );
        return report.refuse(location, title, expected);
    }
    Some(points)
}

/// Returns the quantity and the unit of a header, if the header is known.
fn find_quantity_and_unit(header: &str) -> Option<(String, String)> {
    let [name, unit] = match header {
        "time_s" | "t_s" | "zeit_s" => ["time_s", "s"],
        "speed_rpm" | "spin_speed_rpm" | "drum_speed_rpm" | "drehzahl_rpm" | "n_rpm" | "rpm" => {
            ["speed_rpm", "rpm"]
        }
        _ => return None,
    };
    Some((name.to_owned(), unit.to_owned()))
}

/// Returns the column of a name; `None` and a mistake if the table has none or two.
fn find_column<'t>(
    table: &'t NumberTable,
    name: &str,
    quantity: &str,
    location: &Location,
    report: &Report,
) -> Option<&'t ListColumn> {
    let mut matching_columns = table.columns.iter().filter(|column| column.name.value == name);
    let first_match = matching_columns.next();
    if let Some(second) = matching_columns.next() {
        let title = format!("the cycle's file has two columns of {quantity}");
        return report.refuse(&second.name.location, title, "expected one");
    }
    if first_match.is_none() {
        let headers: Vec<&str> =
            table.columns.iter().map(|column| column.header.as_str()).collect();
        let title = format!("the cycle's file has no column of {quantity} with its unit");
        let expected = "expected a header such as `time_s` or `Time [min]`, and one such as \
            `speed_rpm`, `Speed [Hz]` or `n (rad/s)`";
        let refusal = Diagnostic::new(title).at_location(location, expected);
        report.push(refusal.with_help(format!("its columns are {headers:?}")));
    }
    first_match
}

/// Returns whether times increase from 0 and all speeds are given and within their range. The first
/// row of each mistake is reported.
fn check_columns(
    table: &NumberTable,
    times: &ListColumn,
    speeds: &ListColumn,
    report: &Report,
) -> bool {
    let refuse = |column: &ListColumn, row: usize, title: String, expected: &str| {
        report.push_with(|sources| {
            let cell_location = table.locate(sources, column.column_index, row);
            Diagnostic::new(title).at_location(&cell_location, expected)
        });
    };
    let values = &times.values;
    let expected = "expected times that rise from row to row, from 0 on";
    let first_s = values.first().copied().unwrap_or(f64::NAN);
    if values.is_empty() {
        refuse(times, 0, "the cycle's file has no rows".to_owned(), expected);
    } else if first_s != 0.0 {
        let title = format!("the cycle begins at {} s", decimal(first_s));
        refuse(times, 0, title, "expected 0 in the first row");
    }
    if let Some(row) = values
        .windows(2)
        .position(|pair| pair[1].partial_cmp(&pair[0]) != Some(std::cmp::Ordering::Greater))
    {
        let [before_s, after_s] = [values[row], values[row + 1]].map(decimal);
        let title = format!("the cycle's time goes from {before_s} s to {after_s} s");
        refuse(times, row + 1, title, expected);
    }
    if let Some(row) = speeds.values.iter().position(|speed| !SPEED_RANGE_RPM.contains(*speed)) {
        let title = match speeds.values[row] {
            missing if missing.is_nan() => "the cycle has a row without its speed".to_owned(),
            speed_rpm => format!("the cycle's speed {} rpm is out of range", decimal(speed_rpm)),
        };
        refuse(speeds, row, title, &format!("expected {SPEED_RANGE_RPM}"));
    }
    report.is_clean()
}

/// Returns monotone cubics through points, as straight pieces. Between two points no speed is
/// beyond those of the points.
///
/// F. N. Fritsch, R. E. Carlson, Monotone piecewise cubic interpolation, SIAM Journal on Numerical
/// Analysis 17 (1980), 238-246.
fn interpolate_smoothly(time_s: &[f64], speed_rpm: &[f64]) -> CyclePoints {
    let slopes = compute_monotone_slopes(time_s, speed_rpm);
    let greatest_speed_rpm =
        speed_rpm.iter().fold(0.0, |greatest: f64, speed| greatest.max(speed.abs()));
    let tolerance_rpm = JOINT_TOLERANCE * greatest_speed_rpm;
    let mut points = (vec![time_s[0]], vec![speed_rpm[0]]);
    for k in 1..time_s.len() {
        let length_s = time_s[k] - time_s[k - 1];
        let change_rpm = speed_rpm[k] - speed_rpm[k - 1];
        let [start_slope_rpm, end_slope_rpm] = [slopes[k - 1] * length_s, slopes[k] * length_s];
        // The second derivative is linear, so that it is greatest at an end. It bounds the distance
        // of a chord from the cubic.
        let end_curvatures = [
            6.0 * change_rpm - 4.0 * start_slope_rpm - 2.0 * end_slope_rpm,
            2.0 * start_slope_rpm + 4.0 * end_slope_rpm - 6.0 * change_rpm,
        ];
        let max_curvature = end_curvatures[0].abs().max(end_curvatures[1].abs());
        let exact_piece_count = if tolerance_rpm > 0.0 {
            (max_curvature / (8.0 * tolerance_rpm)).sqrt().ceil().max(1.0)
        } else {
            1.0
        };
        let piece_count = exact_piece_count as usize;
        for piece in 1..piece_count {
            let fraction = piece as f64 / piece_count as f64;
            let remainder = 1.0 - fraction;
            let change_weight = fraction * fraction * (3.0 - 2.0 * fraction);
            let slope_contribution_rpm =
                fraction * remainder * (remainder * start_slope_rpm - fraction * end_slope_rpm);
            points.0.push(time_s[k - 1] + fraction * length_s);
            points.1.push(speed_rpm[k - 1] + change_weight * change_rpm + slope_contribution_rpm);
        }
        points.0.push(time_s[k]);
        points.1.push(speed_rpm[k]);
    }
    points
}

/// Returns the slopes of monotone cubics at points (rpm/s).
fn compute_monotone_slopes(time_s: &[f64], speed_rpm: &[f64]) -> Vec<f64> {
    let chord_slopes: Vec<f64> = (1..time_s.len())
        .map(|k| (speed_rpm[k] - speed_rpm[k - 1]) / (time_s[k] - time_s[k - 1]))
        .collect();
    let mut slopes = vec![0.0; time_s.len()];
    for k in 1..chord_slopes.len() {
        let is_extremum = chord_slopes[k - 1] * chord_slopes[k] <= 0.0;
        slopes[k] = if is_extremum { 0.0 } else { 0.5 * (chord_slopes[k - 1] + chord_slopes[k]) };
    }
    for (k, chord) in chord_slopes.iter().copied().enumerate() {
        if chord == 0.0 {
            continue;
        }
        let [start_ratio, end_ratio] = [slopes[k] / chord, slopes[k + 1] / chord];
        let radius = (start_ratio * start_ratio + end_ratio * end_ratio).sqrt();
        // The cubic is monotone if the two ratios lie within this circle.
        if radius > 3.0 {
            slopes[k] = 3.0 / radius * start_ratio * chord;
            slopes[k + 1] = 3.0 / radius * end_ratio * chord;
        }
    }
    slopes
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The times of a spin cycle with steep and flat parts, a pause and a reversal.
    const TIMES_S: [f64; 8] = [0.0, 5.0, 20.0, 22.0, 40.0, 60.0, 61.0, 80.0];
    const SPEEDS_RPM: [f64; 8] = [0.0, 50.0, 50.0, 90.0, 800.0, 1200.0, 0.0, -45.0];

    #[test]
    fn smooth_joints_are_monotone_and_pass_through_the_points() {
        let (times, speeds) = interpolate_smoothly(&TIMES_S, &SPEEDS_RPM);
        assert!(times.windows(2).all(|pair| pair[0] < pair[1]));
        for (time_s, speed) in TIMES_S.iter().zip(SPEEDS_RPM) {
            let position = times.iter().position(|time| time == time_s).expect("it is kept");
            assert_eq!(speeds[position], speed);
        }
        for k in 1..TIMES_S.len() {
            let is_between_points = |time: &f64| (TIMES_S[k - 1]..=TIMES_S[k]).contains(time);
            let speeds_between: Vec<f64> = times
                .iter()
                .zip(&speeds)
                .filter(|(t, _)| is_between_points(t))
                .map(|(_, s)| *s)
                .collect();
            let [least, greatest] =
                [SPEEDS_RPM[k - 1].min(SPEEDS_RPM[k]), SPEEDS_RPM[k - 1].max(SPEEDS_RPM[k])];
            assert!(
                speeds_between.iter().all(|speed| (least..=greatest).contains(speed)),
                "{k}: {speeds_between:?}"
            );
            let rises = speeds_between.windows(2).all(|pair| pair[0] <= pair[1]);
            let falls = speeds_between.windows(2).all(|pair| pair[0] >= pair[1]);
            assert!(rises || falls, "{k}: {speeds_between:?}");
        }
        assert!(times.len() < 60 * TIMES_S.len(), "{}", times.len());
    }

    #[test]
    fn pieces_are_within_the_tolerance_of_the_cubic() {
        // From rest to rest the cubic is 3 x^2 - 2 x^3.
        let (times, speeds) = interpolate_smoothly(&[0.0, 10.0], &[0.0, 1000.0]);
        let mut largest_error: f64 = 0.0;
        for k in 1..times.len() {
            for step in 0..=20 {
                let piece_fraction = f64::from(step) / 20.0;
                let joint_fraction =
                    (times[k - 1] + piece_fraction * (times[k] - times[k - 1])) / 10.0;
                let exact_rpm =
                    1000.0 * joint_fraction * joint_fraction * (3.0 - 2.0 * joint_fraction);
                largest_error = largest_error.max(
                    (speeds[k - 1] + piece_fraction * (speeds[k] - speeds[k - 1]) - exact_rpm)
                        .abs(),
                );
            }
        }
        assert!(
            (0.5e-4 * 1000.0..1e-4 * 1000.0 + 1e-9).contains(&largest_error),
            "{largest_error}"
        );
    }
}
