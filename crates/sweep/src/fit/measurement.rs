//! A measurement: columns of a file over time, each a channel of the model.

use std::path::Path;

use super::algebra::{quantile, subtract_mean};
use super::pulses::{PulseError, PulseSignal, Pulses};
use super::speed::{self, SmoothedSpin};
use sweep_engine::Diagnostics;
use sweep_engine::config::list::{ANY_UNIT, ColumnNames, ListColumn, NumberTable};
use sweep_engine::config::report::{Diagnostic, Report};
use sweep_engine::config::section::format_count;
use sweep_results::nearest_name;
use washer_model::Channel;

/// The least number of samples of a column. Basis: fewer samples do not determine the noise.
/// Doubling it refuses shorter records.
const MIN_SAMPLES: usize = 16;
/// The beginning of the names of the nonlinear model's channels in a file of `sweep trace`.
const TRACE_PREFIX: &str = "nonlinear_";
/// The greatest usual distance between rows (s). Basis: rows farther apart show no turn of a drum.
/// Doubling it accepts times in a wrong unit.
pub(super) const MAX_ROW_SPACING_S: f64 = 0.2;
/// The longest run that is simulated (s). Basis: a wash takes an hour, its longest spin a quarter
/// of it; every evaluation of a fit integrates the whole run. Doubling it doubles the time that a
/// stray row can cost before it is seen.
pub(super) const MAX_RUN_S: f64 = 3600.0;
/// The greatest ratio of the first speed to the greatest one at which a run counts as one from
/// rest. Basis: forces of an unbalance grow with the square of the speed, so those at a tenth are a
/// hundredth of the greatest. Doubling it accepts runs that begin with four times such forces.
pub(super) const REST_SPEED_RATIO: f64 = 0.1;

/// The length of a day (s).
const DAY_S: f64 = 86_400.0;
/// The greatest acceleration of a drum (rpm/s). Basis: a direct drive of 40 N m on a drum of
/// 0.4 kg m^2. Doubling it leaves drop-outs of a tachometer at twice the speed in the record.
const MAX_ACCELERATION_RPM_PER_S: f64 = 1000.0;
/// The change of speed about a zero that noise explains, in units of the usual change between
/// samples. Basis: the sizes of two samples of white noise add up to as much once in a million.
/// Doubling it leaves drop-outs at the slowest speeds of a coarse tachometer in the record.
const NOISE_STEPS: f64 = 10.0;

/// The quantity of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SignalQuantity {
    /// A channel with the order of its derivative: 0 for the motion itself, 1 for its rate, 2 for
    /// its acceleration.
    Motion(Channel, usize),
    /// The force on the cabinet, with the index of its axis: 0 for c1, 1 for c2, 2 for c3.
    CabinetForce(usize),
}

impl SignalQuantity {
    /// Returns every quantity that can be measured.
    fn all() -> impl Iterator<Item = Self> {
        let motion_quantities = Channel::ALL
            .into_iter()
            .flat_map(|channel| (0..3).map(move |order| Self::Motion(channel, order)));
        motion_quantities.chain((0..3).map(Self::CabinetForce))
    }

    /// Returns the unit of the quantity, and the unit that is recorded by mistake, with the factor
    /// between them.
    pub(crate) fn units(self) -> (String, Option<(&'static str, f64)>) {
        /// Standard gravity, m/s^2 (CGPM 1901): the unit g of loggers.
        const G: f64 = 9.806_65;
        let Self::Motion(channel, order) = self else { return ("N".to_owned(), None) };
        let unit = channel.unit();
        let unit_by_mistake = match (unit, order) {
            ("rad", 0) => Some(("degrees", 180.0 / std::f64::consts::PI)),
            ("rad", _) => Some(("degrees per s", 180.0 / std::f64::consts::PI)),
            (_, 2) => Some(("g", 1.0 / G)),
            _ => Some(("mm", 1e3)),
        };
        (format!("{unit}{}", ["", "/s", "/s^2"][order]), unit_by_mistake)
    }

    /// Returns the name of the column.
    pub(crate) fn column(self) -> String {
        match self {
            Self::Motion(channel, order) => {
                let name = channel.name();
                let unit = channel.unit();
                format!("{name}_{unit}{}", ["", "_per_s", "_per_s2"][order])
            }
            Self::CabinetForce(axis) => format!("cabinet_force_{}_n", ["x", "y", "z"][axis]),
        }
    }

    /// Returns the quantity that a column's name means. Names of displacements and angles may omit
    /// the unit.
    fn from_name(name: &str) -> Option<Self> {
        let has_name = |quantity: &Self| match quantity {
            Self::Motion(channel, 0) if channel.name() == name => true,
            _ => quantity.column() == name,
        };
        Self::all().find(has_name)
    }
}

/// A column of a measurement.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Signal {
    pub(crate) quantity: SignalQuantity,
    /// The values at all rows; NaN for a missing sample.
    pub(crate) values: Vec<f64>,
}

impl Signal {
    /// Iterates over the samples with their rows, without missing ones.
    pub(crate) fn samples(&self) -> impl Iterator<Item = (usize, f64)> {
        self.values.iter().copied().enumerate().filter(|(_, value)| !value.is_nan())
    }

    /// Returns the samples less their mean.
    pub(crate) fn centred_values(&self) -> Vec<f64> {
        subtract_mean(self.samples().map(|(_, value)| value).collect()).0
    }
}

/// A measurement of one run.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Measurement {
    /// The file's name, as messages and reports have it.
    pub(crate) name: String,
    /// The times of the rows (s), increasing from 0 or later.
    pub(crate) time_s: Vec<f64>,
    /// The tachometer, if there is one (rpm); NaN where it has no sample.
    pub(crate) speed_rpm: Option<Vec<f64>>,
    /// The pulses of the tachometer, if it gives those instead of speeds.
    pub(super) pulses: Option<Pulses>,
    pub(crate) signals: Vec<Signal>,
    /// The number of rows before time 0, at which the drum is still at rest. They are left out.
    pub(crate) rows_before_start: usize,
    /// The reading of a clock that does not start with the run (s), at the first row. Times are
    /// counted from it.
    pub(crate) clock_start_s: Option<f64>,
    /// The clock time of the first row as the file has it, if times are not numbers.
    first_clock_time: Option<String>,
    /// The time intervals without rows (s).
    pub(crate) gaps_s: Vec<[f64; 2]>,
    /// Notes on the parts of the file that were converted or left out.
    pub(crate) notes: Vec<String>,
    /// The names of the columns in the file.
    pub(crate) headers: Vec<String>,
}

impl Measurement {
    /// Reads a file. `names_by_header` pairs headers of columns with the names of their quantities.
    ///
    /// # Errors
    /// Returns every mistake in the file, with its location.
    pub(crate) fn read(
        path: &Path,
        names_by_header: &[(String, String)],
    ) -> Result<Self, Diagnostics> {
        let report = Report::default();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let names =
            ColumnNames { find_quantity: &find_known_name, renamed_headers: names_by_header };
        let table = NumberTable::read_point_list(path, &names, &report);
        let measurement = table.map(|table| check_table(name, table, &report));
        report.finish(measurement)
    }

    /// Creates a measurement from columns in memory; `names_by_header` is that of [`Self::read`].
    ///
    /// # Errors
    /// Returns the errors of [`Self::read`].
    pub(crate) fn from_columns(
        columns: Vec<(String, Vec<f64>)>,
        names_by_header: &[(String, String)],
    ) -> Result<Self, Diagnostics> {
        let report = Report::default();
        let names =
            ColumnNames { find_quantity: &find_known_name, renamed_headers: names_by_header };
        let table = NumberTable::from_columns("table", columns, &names, &report);
        let measurement = check_table("table".to_owned(), table, &report);
        report.finish(Some(measurement))
    }

    /// Counts times from the first row if the clock does not start with the run, like one of
    /// seconds since 1970 or since midnight: if the run would be too long to simulate, or if the
    /// record begins at rest after the end of the grid's run and the wait would be longer than the
    /// record.
    pub(crate) fn count_from_first_row(&mut self, grid_end_s: f64) {
        let Some((&first_s, &last_s)) = self.time_s.first().zip(self.time_s.last()) else { return };
        let is_after_run = first_s > grid_end_s.max(last_s - first_s) && self.begins_at_rest();
        if first_s > 0.0 && (last_s > MAX_RUN_S || is_after_run) {
            self.time_s.iter_mut().for_each(|time_s| *time_s -= first_s);
            let pulse_times = self.pulses.iter_mut().flat_map(|pulses| &mut pulses.pulse_times_s);
            pulse_times.for_each(|pulse_time_s| *pulse_time_s -= first_s);
            self.gaps_s = find_time_gaps(&self.time_s);
            self.clock_start_s = Some(first_s);
        }
    }

    /// Returns the time that the clock shows at the first row, as messages print it, if the clock
    /// does not start with the run.
    pub(crate) fn clock_start(&self) -> Option<String> {
        let start_s = self.clock_start_s?;
        Some(self.first_clock_time.clone().unwrap_or_else(|| format!("{start_s} s")))
    }

    /// Returns whether the tachometer, if there is one, begins at rest.
    fn begins_at_rest(&self) -> bool {
        if let (Some(pulses), Some(first_s)) = (&self.pulses, self.time_s.first()) {
            let [first_rpm, greatest_rpm] = pulses.first_and_greatest_rpm(*first_s);
            return first_rpm <= REST_SPEED_RATIO * greatest_rpm;
        }
        let speeds = || self.speed_rpm.iter().flatten().filter(|speed| !speed.is_nan());
        let greatest_rpm = speeds().fold(0.0_f64, |greatest, speed| greatest.max(speed.abs()));
        speeds().next().is_none_or(|first| first.abs() <= REST_SPEED_RATIO * greatest_rpm)
    }

    /// Fits the spin to the tachometer, if there is one.
    pub(super) fn smooth_spin(&self) -> Option<SmoothedSpin> {
        match &self.pulses {
            Some(pulses) => pulses.smooth_spin(),
            None => speed::smooth_spin(&self.time_s, self.speed_rpm.as_ref()?),
        }
    }

    /// Returns whether a column may have this name.
    pub(crate) fn is_known_name(name: &str) -> bool {
        find_known_name(name).is_some()
    }

    /// Returns the number of samples of all columns.
    pub(crate) fn count_samples(&self) -> usize {
        self.signals.iter().map(|signal| signal.samples().count()).sum()
    }
}

/// Returns the name of a quantity that a header names, and its unit.
fn find_known_name(header: &str) -> Option<(String, String)> {
    let name = header.strip_prefix(TRACE_PREFIX).unwrap_or(header);
    let [name, unit] = match name {
        "time_s" | "time" | "timestamp" | "t_s" | "zeit" | "zeit_s" => {
            ["time_s", "s"].map(str::to_owned)
        }
        "speed_rpm" | "rpm" | "drehzahl_rpm" => ["speed_rpm", "rpm"].map(str::to_owned),
        _ if PulseSignal::from_name(name).is_some() => [name, ANY_UNIT].map(str::to_owned),
        _ => [name.to_owned(), SignalQuantity::from_name(name)?.units().0],
    };
    Some((name, unit))
}

/// Returns every name that a column may have.
fn all_names() -> Vec<String> {
    let names = SignalQuantity::all().map(SignalQuantity::column);
    names.chain(["time_s", "speed_rpm", "tacho_pulses", "tacho_count"].map(str::to_owned)).collect()
}

/// Returns the mistake that a column's name is misspelled, if it is near the name of a channel.
fn find_misspelling(column: &ListColumn) -> Option<Diagnostic> {
    // Words without underscores, such as drum, are near many names, but name no channel.
    let names = all_names();
    let has_underscore = column.header.contains('_');
    nearest_name(&column.header, names.iter().map(String::as_str)).filter(|_| has_underscore)?;
    let title = format!("the column `{}` does not name a channel", column.header);
    let expected = "expected a channel of `sweep trace` with its unit, as in \
                    tub_front_y_m_per_s2, tub_yaw_rad or cabinet_force_y_n";
    let refusal = Diagnostic::new(title).at_location(&column.name.location, expected);
    Some(refusal.with_nearest_name(&column.header, names.iter().map(String::as_str)))
}

/// Converts a table to a measurement, and reports the mistakes in it.
fn check_table(name: String, mut table: NumberTable, report: &Report) -> Measurement {
    let clock = table.columns.iter_mut().find(|column| column.name.value == "time_s");
    let passes_midnight = clock.is_some_and(|clock| continue_past_midnight(&mut clock.values));
    let clock = table.columns.iter().find(|column| column.name.value == "time_s");
    let first_row_of_run =
        clock.map_or(0, |clock| clock.values.iter().take_while(|t| **t < 0.0).count());
    // A file of `sweep trace` counts as a measurement of its nonlinear motion.
    let is_trace = table.columns.iter().any(|column| column.header.starts_with(TRACE_PREFIX));
    let mut notes = if is_trace { Vec::new() } else { table.notes() };
    if passes_midnight {
        notes
            .push("its clock passes midnight: times after it are those of the next day".to_owned());
    }
    let headers = table.columns.iter().map(|column| column.header.clone()).collect();
    let mut measurement = Measurement {
        name,
        rows_before_start: first_row_of_run,
        notes,
        headers,
        ..Measurement::default()
    };
    let mut names_so_far: Vec<&str> = Vec::new();
    let mut pulse_columns: Vec<(&ListColumn, (PulseSignal, u32))> = Vec::new();
    for column in &table.columns {
        if !column.is_known {
            let mistake = if is_trace { None } else { find_misspelling(column) };
            mistake.into_iter().for_each(|mistake| report.push(mistake));
            continue;
        }
        let name = column.name.value.as_str();
        let location = &column.name.location;
        if names_so_far.contains(&name) {
            let title = format!("the column `{name}` is given twice");
            report.push(Diagnostic::new(title).at_location(location, "expected each column once"));
            continue;
        }
        names_so_far.push(name);
        if let Some(row) = column.values.iter().position(|value| value.is_infinite()) {
            report.push_with(|sources| {
                let title = format!("`{name}` is infinite in row {}", row + 1);
                let expected = "expected a number, or nothing where no sample is";
                Diagnostic::new(title)
                    .at_location(&table.locate(sources, column.column_index, row), expected)
            });
        }
        let values = &column.values[first_row_of_run..];
        let sample_count = values.iter().filter(|value| !value.is_nan()).count();
        match (name, SignalQuantity::from_name(name)) {
            ("time_s", _) => {
                measurement.time_s = values.to_vec();
                measurement.first_clock_time = clock_time(&table, column, first_row_of_run, report);
                check_times(&table, column, report);
            }
            ("speed_rpm", _) => measurement.speed_rpm = Some(values.to_vec()),
            (_, Some(_)) if sample_count >= MIN_SAMPLES && is_constant(values) => {
                let title = format!("the column `{name}` never changes");
                report.push(
                    Diagnostic::new(title).at_location(location, "expected what a sensor measured"),
                );
            }
            (_, Some(quantity)) if sample_count >= MIN_SAMPLES => {
                measurement.signals.push(Signal { quantity, values: values.to_vec() });
            }
            (_, Some(_)) => {
                let title = format!("the column `{name}` has {sample_count} samples");
                report.push(
                    Diagnostic::new(title)
                        .at_location(location, format!("expected {MIN_SAMPLES} at least")),
                );
            }
            (_, None) => {
                pulse_columns.extend(PulseSignal::from_name(name).map(|kind| (column, kind)));
            }
        }
    }
    let is_complete = report.is_clean();
    let missing_columns = [
        ("time_s", !names_so_far.contains(&"time_s")),
        ("any channel", measurement.signals.is_empty()),
    ];
    for (name, is_missing) in missing_columns {
        if is_complete && is_missing {
            let title = format!("{} has no column of {name}", measurement.name);
            let help = "expected time_s, and channels of `sweep trace` with their units, as in \
                        tub_front_y_m_per_s2";
            let refusal = Diagnostic::new(title).with_help(help);
            let unknown_column = table.columns.iter().find(|column| !column.is_known);
            let naming_help = unknown_column.map(|column| {
                format!(
                    "say what a column holds: --column '{}=tub_front_y_m_per_s2', or [columns] in \
                     the grid file",
                    column.header
                )
            });
            report.push(naming_help.into_iter().fold(refusal, Diagnostic::with_help));
        }
    }
    for (column, kind) in pulse_columns {
        if report.is_clean() {
            read_pulses(&mut measurement, &table, column, kind, report);
        }
    }
    remove_drop_outs(&mut measurement, |row| {
        let clock = table.columns.iter().find(|column| column.name.value == "time_s");
        clock.and_then(|clock| clock_time(&table, clock, first_row_of_run + row, report))
    });
    measurement.gaps_s = find_time_gaps(&measurement.time_s);
    measurement
}

/// Adds a day to the times after each midnight, and returns whether there is a midnight. A clock
/// passes midnight where its time falls by at most a day, and by at least a day less the longest
/// run.
fn continue_past_midnight(times: &mut [f64]) -> bool {
    let mut passed_midnights_s = 0.0;
    let mut latest_s = f64::NEG_INFINITY;
    for time_s in times {
        let fall_s = latest_s - (*time_s + passed_midnights_s);
        if fall_s > DAY_S - MAX_RUN_S && fall_s <= DAY_S {
            passed_midnights_s += DAY_S;
        }
        *time_s += passed_midnights_s;
        latest_s = latest_s.max(*time_s);
    }
    passed_midnights_s > 0.0
}

/// Returns the clock time of a row, if the file has clock times. A time in a text file is returned
/// as the file has it.
fn clock_time(
    table: &NumberTable,
    column: &ListColumn,
    row: usize,
    report: &Report,
) -> Option<String> {
    let text = table.cell(report, column.column_index, row).filter(|cell| cell.contains(':'));
    text.or_else(|| column.clock_time(row))
}

/// Removes drop-outs from the speeds, with a note. `clock_time` returns the clock time of a row.
fn remove_drop_outs(measurement: &mut Measurement, clock_time: impl Fn(usize) -> Option<String>) {
    let Some(speed_rpm) = &mut measurement.speed_rpm else { return };
    let drop_out_rows = find_drop_outs(&measurement.time_s, speed_rpm);
    let Some(first_row) = drop_out_rows.first() else { return };
    let first_time =
        clock_time(*first_row).unwrap_or_else(|| format!("{} s", measurement.time_s[*first_row]));
    let sample_text = format_count(drop_out_rows.len(), "sample");
    let [verb, prefix] =
        if drop_out_rows.len() == 1 { ["drops", ""] } else { ["drop", "the first "] };
    let note =
        format!("{sample_text} of speed_rpm {verb} to zero, {prefix}at {first_time}: left out");
    measurement.notes.push(note);
    drop_out_rows.into_iter().for_each(|row| speed_rpm[row] = f64::NAN);
}

/// Returns the rows of a tachometer's drop-outs. A drop-out is a zero between two speeds, between
/// which no drum could have stopped and started again. At a standstill speeds approach zero
/// instead.
fn find_drop_outs(time_s: &[f64], speed_rpm: &[f64]) -> Vec<usize> {
    let is_running = |row: &usize| !speed_rpm[*row].is_nan() && speed_rpm[*row] != 0.0;
    let rows = 0..time_s.len().min(speed_rpm.len());
    let running: Vec<usize> = rows.filter(is_running).collect();
    let speed_steps_rpm =
        running.windows(2).map(|pair| (speed_rpm[pair[1]] - speed_rpm[pair[0]]).abs());
    let usual_step_rpm =
        quantile(speed_steps_rpm.filter(|step| *step > 0.0), 0.5).unwrap_or_default();
    let mut zero_rows = Vec::new();
    for pair in running.windows(2) {
        let [before, after] = [pair[0], pair[1]];
        let change_rpm = speed_rpm[before].abs() + speed_rpm[after].abs();
        let possible_change_rpm = MAX_ACCELERATION_RPM_PER_S * (time_s[after] - time_s[before]);
        if change_rpm > possible_change_rpm + NOISE_STEPS * usual_step_rpm {
            zero_rows.extend((before + 1..after).filter(|row| speed_rpm[*row] == 0.0));
        }
    }
    zero_rows
}

/// Reads a column of pulses as the tachometer, and reports its mistakes.
fn read_pulses(
    measurement: &mut Measurement,
    table: &NumberTable,
    column: &ListColumn,
    kind: (PulseSignal, u32),
    report: &Report,
) {
    let name = &column.name.value;
    if measurement.speed_rpm.is_some() || measurement.pulses.is_some() {
        let title = format!("the column `{name}` is a second tachometer");
        let expected = "expected speed_rpm or one column of pulses";
        report.push(Diagnostic::new(title).at_location(&column.name.location, expected));
        return;
    }
    let count_column_name = name.replace("pulses", "count");
    let voltage_column_name = name.replace("count_per_row", "pulses").replace("count", "pulses");
    let (title, expected, row) = match Pulses::read(
        &measurement.time_s,
        &column.values[measurement.rows_before_start..],
        kind,
    ) {
        Ok(pulses) => {
            measurement.pulses = Some(pulses);
            return;
        }
        Err(PulseError::FewPulses(count)) => (
            format!("the column `{name}` has {}", format_count(count, "pulse")),
            format!(
                "expected three at least: a signal that rises through half of its range once \
                     a pulse; the column of a counter is `{count_column_name}`"
            ),
            None,
        ),
        Err(PulseError::FewReadings(count)) => (
            format!("the count `{name}` tells the turns at {}", format_count(count, "time")),
            "expected three at least, so far apart that the speed between them is known to 1 %"
                .to_owned(),
            None,
        ),
        Err(PulseError::TooFast(row)) => (
            format!("pulses of `{name}` are as fast as half of the sampling rate"),
            "expected three rows a pulse at least: faster pulses look slower than they are"
                .to_owned(),
            Some(row),
        ),
        Err(PulseError::FallingCount(row)) => (
            format!("the count `{name}` falls in row {}", measurement.rows_before_start + row + 1),
            format!(
                "expected a count that rises, or starts again at 0 after 65536 or 4294967296; \
                     the column of a voltage is `{voltage_column_name}`"
            ),
            Some(row),
        ),
        Err(PulseError::MissingCount(row)) => (
            format!("`{name}` has no number in row {}", measurement.rows_before_start + row + 1),
            "expected the number of pulses since the previous row in each row".to_owned(),
            Some(row),
        ),
    };
    report.push_with(|sources| {
        let location = match row {
            Some(row) => {
                table.locate(sources, column.column_index, measurement.rows_before_start + row)
            }
            None => column.name.location.clone(),
        };
        Diagnostic::new(title).at_location(&location, expected)
    });
}

/// Returns whether all samples are equal.
fn is_constant(values: &[f64]) -> bool {
    let mut samples = values.iter().filter(|value| !value.is_nan());
    let first_sample = samples.next();
    samples.all(|value| Some(value) == first_sample)
}

/// Checks the column of times. Only the first row with each mistake is reported, because often all
/// rows have it.
fn check_times(table: &NumberTable, column: &ListColumn, report: &Report) {
    let values = &column.values;
    let mut last_s = f64::NEG_INFINITY;
    let mut reported_mistakes = [false; 4];
    let usual_step_s = usual_step(values).unwrap_or_default();
    for (row, &time_s) in values.iter().enumerate() {
        let (mistake_index, description) = match time_s {
            _ if time_s.is_nan() => (0, "a row without its time".to_owned()),
            _ if time_s == last_s => (3, format!("two rows have the same time, {time_s} s")),
            _ if time_s < last_s => (1, format!("time goes back: {time_s} s after {last_s} s")),
            _ if usual_step_s > MAX_ROW_SPACING_S => {
                (2, format!("rows are {usual_step_s} s apart: are these ms?"))
            }
            _ => {
                last_s = time_s;
                continue;
            }
        };
        last_s = last_s.max(time_s);
        if std::mem::replace(&mut reported_mistakes[mistake_index], true) {
            continue;
        }
        report.push_with(|sources| {
            let expected = "expected times in s that rise from row to row, 0 where the run begins";
            Diagnostic::new(description)
                .at_location(&table.locate(sources, column.column_index, row), expected)
        });
    }
    if reported_mistakes == [false; 4] {
        refuse_long_run(table, column, report);
    }
}

/// Refuses a record of a longer run than is simulated, at the row after its longest gap.
fn refuse_long_run(table: &NumberTable, column: &ListColumn, report: &Report) {
    let all_times = &column.values;
    let run_start = all_times.partition_point(|time_s| *time_s < 0.0);
    let times = &all_times[run_start..];
    let Some((first_s, last_s)) = times.first().zip(times.last()) else { return };
    let length_s = last_s - first_s;
    if length_s <= MAX_RUN_S {
        return;
    }
    let gap_s = |row: usize| times[row] - times[row - 1];
    let Some(row) = (1..times.len()).max_by(|a, b| gap_s(*a).total_cmp(&gap_s(*b))) else {
        return;
    };
    // A gap of a tenth of the length counts as the cause, because a record may have several.
    let title = if gap_s(row) > 0.1 * length_s {
        format!("time jumps by {} s, from {} to {} s", gap_s(row), times[row - 1], times[row])
    } else {
        format!("the record is {length_s} s long: are these ms?")
    };
    report.push_with(|sources| {
        let expected = format!(
            "expected a run of at most {MAX_RUN_S} s: remove stray rows, cut the record, or \
             convert its times to s"
        );
        Diagnostic::new(title)
            .at_location(&table.locate(sources, column.column_index, run_start + row), expected)
    });
}

/// Returns the median distance of neighbouring rows.
pub(super) fn usual_step(time_s: &[f64]) -> Option<f64> {
    quantile(time_s.windows(2).map(|pair| pair[1] - pair[0]), 0.5)
}

/// Returns the time intervals without rows. They are longer than twenty usual distances of rows.
fn find_time_gaps(time_s: &[f64]) -> Vec<[f64; 2]> {
    let Some(usual_step_s) = usual_step(time_s) else { return Vec::new() };
    let gaps = time_s.windows(2).filter(|pair| pair[1] - pair[0] > 20.0 * usual_step_s);
    gaps.map(|pair| [pair[0], pair[1]]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal_text(text: &str) -> String {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.csv");
        std::fs::write(&path, text).unwrap();
        Measurement::read(&path, &[]).unwrap_err().to_string()
    }

    #[test]
    fn columns_are_known_by_their_units() {
        let column_of_name = |name| SignalQuantity::from_name(name).map(SignalQuantity::column);
        for name in ["tub_front_y_m_per_s2", "tub_yaw_rad_per_s", "tub_pitch_rad"] {
            assert_eq!(column_of_name(name).as_deref(), Some(name));
        }
        assert_eq!(column_of_name("drum_front_z").as_deref(), Some("drum_front_z_m"));
        assert_eq!(column_of_name("cabinet_force_z_n").as_deref(), Some("cabinet_force_z_n"));
        assert_eq!(column_of_name("tub_yaw_m"), None);
    }

    #[test]
    fn a_file_of_trace_is_its_nonlinear_motion() {
        let names = ["time_s", "nonlinear_tub_yaw", "linear_tub_yaw", "min_gap_nonlinear_m"];
        let column_of_numbers = |name: &str| {
            (name.to_owned(), (0..20).map(|k| 0.01 * f64::from(k)).collect::<Vec<f64>>())
        };
        let measurement =
            Measurement::from_columns(names.map(column_of_numbers).to_vec(), &[]).unwrap();
        let columns: Vec<String> =
            measurement.signals.iter().map(|signal| signal.quantity.column()).collect();
        assert_eq!(columns, ["tub_yaw_rad"]);
    }

    #[test]
    fn mistakes_have_their_places() {
        let text = refusal_text("time_s,tub_front_y_m_s2\n0,1\n0.1,2\n0.1,3\n,4\n0.05,5\n");
        for expected_part in [
            "does not name a channel",
            "did you mean `tub_front_y_m",
            "two rows have the same time, 0.1 s",
            "time goes back: 0.05 s after 0.1 s",
            "without its time",
        ] {
            assert!(text.contains(expected_part), "{expected_part}: {text}");
        }
        assert!(text.contains(":4:") && text.contains(":5:"), "{text}");
        assert!(refusal_text("time_s,tub_yaw_rad\n0,1\n1,\n").contains("has 1 samples"));
        assert!(refusal_text("tub_yaw_rad\n1\n").contains("has 1 samples"));
        let rows: String = (0..20).map(|k| format!("{k},\n")).collect();
        assert!(refusal_text(&format!("time_s,tub_yaw\n{rows}")).contains("has 0 samples"));
        assert!(refusal_text("time_s\n0.1\n0.2\n").contains("no column of any channel"));
        assert!(refusal_text("time_s,tub_yaw\n0,inf\n").contains("is infinite"));
        let rows: String = (0..20).map(|k| format!("{},1\n", 0.01 * f64::from(k))).collect();
        assert!(refusal_text(&format!("time_s,tub_yaw\n{rows}")).contains("never changes"));
        // Times in milliseconds are reported once, not once for each row.
        let rows: String = (0..20).map(|k| format!("{},{k}\n", 2 * k)).collect();
        let text = refusal_text(&format!("time_s,tub_yaw\n{rows}"));
        assert_eq!(text.matches("rows are 2 s apart: are these ms?").count(), 1, "{text}");
    }

    #[test]
    fn a_run_that_is_too_long_to_simulate_is_refused_at_its_longest_gap() {
        let csv_of_times = |times: &mut dyn Iterator<Item = f64>| -> String {
            let rows = times.enumerate().map(|(k, time_s)| format!("{time_s},{k}\n"));
            "time_s,tub_yaw\n".to_owned() + &rows.collect::<String>()
        };
        let steady_times = || (0..200).map(|k| 0.01 * f64::from(k));
        let csv_with_stray_time = csv_of_times(&mut steady_times().chain([1e5]));
        let text = refusal_text(&csv_with_stray_time);
        assert!(text.contains("time jumps by 99998.01 s, from 1.99 to 100000 s"), "{text}");
        assert!(text.contains(":202:1") && text.contains("at most 3600 s"), "{text}");
        let csv_with_gap =
            csv_of_times(&mut steady_times().chain(steady_times().map(|time_s| 1e4 + time_s)));
        assert!(refusal_text(&csv_with_gap).contains(":202:1"), "{}", refusal_text(&csv_with_gap));
        let csv_with_epoch_time =
            csv_of_times(&mut [0.0].into_iter().chain(steady_times().map(|time_s| 1.7e9 + time_s)));
        assert!(
            refusal_text(&csv_with_epoch_time).contains(":3:1"),
            "{}",
            refusal_text(&csv_with_epoch_time)
        );
        let csv_in_milliseconds = csv_of_times(&mut (0..40_000).map(|k| 0.1 * f64::from(k)));
        let text = refusal_text(&csv_in_milliseconds);
        assert!(text.contains("s long: are these ms?") && text.lines().count() < 12, "{text}");
    }

    #[test]
    fn a_clock_that_does_not_start_with_the_run_counts_from_the_first_row() {
        let measurement_from = |first_s: f64, first_rpm: f64, with_tachometer: bool| {
            let column_over_time = |name: &str, value: &dyn Fn(f64) -> f64| {
                (name.to_owned(), (0..100).map(|k| value(0.1 * f64::from(k))).collect::<Vec<f64>>())
            };
            let mut columns = vec![
                column_over_time("time_s", &|t| first_s + t),
                column_over_time("tub_yaw", &|t| t.sin()),
            ];
            if with_tachometer {
                columns.push(column_over_time("speed_rpm", &|t| first_rpm + 20.0 * t));
            }
            let mut measurement = Measurement::from_columns(columns, &[]).unwrap();
            measurement.count_from_first_row(24.0);
            measurement
        };
        for (first_s, first_rpm, with_tachometer, counts_from_first_row) in [
            (1.7e9, 0.0, true, true),
            (1.7e9, 150.0, true, true),
            (36_000.0, 0.0, false, true),
            (60.0, 0.0, true, true),
            (60.0, 0.0, false, true),
            // The tachometer shows that the drum turns already, so that the run began at time 0.
            (60.0, 150.0, true, false),
            // The record begins within the grid's run.
            (15.0, 0.0, false, false),
            (0.5, 0.0, true, false),
        ] {
            let measurement = measurement_from(first_s, first_rpm, with_tachometer);
            let description = format!("{first_s} {first_rpm} {with_tachometer}");
            assert_eq!(
                measurement.clock_start_s,
                counts_from_first_row.then_some(first_s),
                "{description}"
            );
            assert!((measurement.time_s[0] == 0.0) == counts_from_first_row, "{description}");
            assert!(
                (measurement.time_s[99] - measurement.time_s[0] - 9.9).abs() < 1e-6,
                "{description}"
            );
        }
    }

    #[test]
    fn a_loggers_file_is_read_as_it_is() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bench.csv");
        let rows: String =
            (0..20).map(|k| format!("{};{};{};21,5\n", 20 * k, k % 5, 100 * k)).collect();
        let text = format!("Bench 3;\nTime;Acc front;Drum;Temp\nms;g;Hz;\u{b0}C\n{rows}");
        std::fs::write(&path, &text).unwrap();
        let names_by_header = [("Acc front", "tub_front_y_m_per_s2"), ("Drum", "speed_rpm")];
        let names_by_header =
            names_by_header.map(|(header, name)| (header.to_owned(), name.to_owned()));
        let measurement = Measurement::read(&path, &names_by_header).unwrap();
        assert_eq!(measurement.time_s[19], 0.38);
        assert_eq!(measurement.speed_rpm.expect("it is there")[2], 12_000.0);
        let columns: Vec<String> =
            measurement.signals.iter().map(|signal| signal.quantity.column()).collect();
        assert_eq!(columns, ["tub_front_y_m_per_s2"]);
        assert_eq!(measurement.signals[0].values[4], 4.0 * 9.80665);
        assert!(measurement.notes.join(";").contains("left out the column `Temp`"));
        // Times of a clock are seconds since midnight.
        let rows: String = (0..20).map(|k| format!("12:00:0{}.{},{k}\n", k / 10, k % 10)).collect();
        std::fs::write(&path, format!("Time,tub_yaw [deg]\n{rows}")).unwrap();
        let clock_measurement = Measurement::read(&path, &[]).unwrap();
        assert_eq!(
            (clock_measurement.time_s[0], clock_measurement.time_s[19]),
            (43_200.0, 43_201.9)
        );
        let clock_start_of = |mut measurement: Measurement| {
            measurement.count_from_first_row(24.0);
            measurement.clock_start()
        };
        assert_eq!(clock_start_of(clock_measurement).as_deref(), Some("12:00:00.0"));
        let rows: String =
            (0..20).map(|k| format!("{}.{},{k}\n", 43_200 + k / 10, k % 10)).collect();
        std::fs::write(&path, format!("Time,tub_yaw [deg]\n{rows}")).unwrap();
        assert_eq!(
            clock_start_of(Measurement::read(&path, &[]).unwrap()).as_deref(),
            Some("43200 s")
        );
        std::fs::write(&path, &text).unwrap();
        // Without names for the columns the file has no signals, and the message says what to do.
        let refusal_text = Measurement::read(&path, &[]).unwrap_err().to_string();
        assert!(
            refusal_text.contains("--column 'Acc front=tub_front_y_m_per_s2'"),
            "{refusal_text}"
        );
    }

    #[test]
    fn a_tachometer_by_pulses_is_read() {
        for (name, expected_signal) in [
            ("tacho_pulses", Some((PulseSignal::Voltage, 1))),
            ("tacho_60_pulses", Some((PulseSignal::Voltage, 60))),
            ("tacho_count", Some((PulseSignal::Count, 1))),
            ("tacho_60_count", Some((PulseSignal::Count, 60))),
            ("tacho_2_count_per_row", Some((PulseSignal::CountPerRow, 2))),
            ("tacho_0_pulses", None),
            ("tacho_60pulses", None),
            ("tacho__pulses", None),
            ("tacho_60", None),
        ] {
            assert_eq!(PulseSignal::from_name(name), expected_signal, "{name}");
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.csv");
        let read_record = |columns: &str, period: u32, further_cells: &str| {
            let voltage_v = |k: u32| if k % period < period / 2 { 0.1 } else { 4.9 };
            let rows: String = (0..80)
                .map(|k| format!("{},{k},{}{further_cells}\n", 0.01 * f64::from(k), voltage_v(k)))
                .collect();
            std::fs::write(&path, format!("{columns}\n{rows}")).unwrap();
            let names_by_header = [("Tacho".to_owned(), "tacho_12_pulses".to_owned())];
            Measurement::read(&path, &names_by_header)
        };
        let measurement = read_record("Time,tub_yaw,Tacho [V]", 10, "").unwrap();
        let spin = measurement.smooth_spin().unwrap().spin;
        let speeds: Vec<f64> = spin.speeds_rpm([0.0, 0.3, 0.7]).collect();
        assert!(speeds.iter().all(|speed| (speed - 50.0).abs() < 1e-6), "{speeds:?}");
        assert!(!measurement.begins_at_rest());
        let read_error = |columns, period, further_cells| {
            read_record(columns, period, further_cells).unwrap_err().to_string()
        };
        let text = read_error("Time,tub_yaw,Tacho,rpm", 10, ",50");
        assert!(text.contains("`tacho_12_pulses` is a second tachometer"), "{text}");
        let text = read_error("Time,tub_yaw,tacho_pulses", 40, "");
        assert!(text.contains("has 2 pulses") && text.contains("three at least"), "{text}");
        let text = read_error("Time,tub_yaw,tacho_pulses", 2, "");
        assert!(text.contains("half of the sampling rate") && text.contains(":5:"), "{text}");
    }

    #[test]
    fn instants_of_pandas_count_from_the_first_row() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("testdata/fit");
        let names_by_header = [("Acc front".to_owned(), "tub_front_y_m_per_s2".to_owned())];
        let measurement =
            Measurement::read(&folder.join("pandas_datetime.parquet"), &names_by_header);
        let mut measurement = measurement.unwrap();
        assert!(measurement.notes.join(";").contains("left out the column `logged_at`"));
        measurement.count_from_first_row(24.0);
        assert_eq!(measurement.clock_start().as_deref(), Some("2026-03-01 12:34:56.789"));
        for (k, time_s) in measurement.time_s.iter().enumerate() {
            assert!((time_s - 0.01 * k as f64).abs() < 5e-7, "{k}: {time_s}");
        }
    }

    #[test]
    fn a_tachometer_by_a_count_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.csv");
        let read_record = |header: &str, count_in_row: &dyn Fn(u32) -> u32| {
            let rows: String = (0..400)
                .map(|k| format!("{},{k},{}\n", 0.01 * f64::from(k), count_in_row(k)))
                .collect();
            std::fs::write(&path, format!("Time,tub_yaw,{header}\n{rows}")).unwrap();
            let names_by_header = [("Pulses".to_owned(), "tacho_60_count".to_owned())];
            Measurement::read(&path, &names_by_header)
        };
        // 240 rpm are 2.4 pulses a row.
        let total_count = |k: u32| 12 * k / 5;
        for (header, count) in [
            ("Pulses", &total_count as &dyn Fn(u32) -> u32),
            ("tacho_60_count_per_row", &|k| total_count(k + 1) - total_count(k)),
        ] {
            let measurement = read_record(header, count).unwrap();
            let spin = measurement.smooth_spin().unwrap().spin;
            let speeds: Vec<f64> = spin.speeds_rpm([0.5, 2.0, 3.5]).collect();
            assert!(speeds.iter().all(|speed| (speed - 240.0).abs() < 2.0), "{speeds:?}");
        }
        let text = read_record("Pulses", &|k| k % 100).unwrap_err().to_string();
        assert!(text.contains("`tacho_60_count` falls in row 101") && text.contains(":102:"));
        assert!(text.contains("the column of a voltage is `tacho_60_pulses`"), "{text}");
        let text = read_record("tacho_60_pulses", &total_count).unwrap_err().to_string();
        assert!(text.contains("the column of a counter is `tacho_60_count`"), "{text}");
    }

    #[test]
    fn a_clock_that_passes_midnight_goes_on() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.csv");
        let clock_time = |k: u32| match k {
            0..10 => format!("23:59:59.{k}"),
            _ => format!("00:00:0{}.{}", k / 10 - 1, k % 10),
        };
        let whole_seconds = |k: u32| format!("{}", (863_990 + k) % 864_000 / 10);
        let decimal_seconds = |k: u32| format!("{}.{}", whole_seconds(k), k % 10);
        for time_text in [&clock_time as &dyn Fn(u32) -> String, &decimal_seconds] {
            let rows: String = (0..40).map(|k| format!("{},{k}\n", time_text(k))).collect();
            std::fs::write(&path, format!("Time,tub_yaw\n{rows}")).unwrap();
            let mut measurement = Measurement::read(&path, &[]).unwrap();
            assert!(
                measurement.notes.join(";").contains("passes midnight"),
                "{:?}",
                measurement.notes
            );
            measurement.count_from_first_row(24.0);
            for (k, time_s) in measurement.time_s.iter().enumerate() {
                assert!((time_s - 0.1 * k as f64).abs() < 1e-9, "{k}: {time_s}");
            }
        }
        // A clock that falls by much less than a day, or by more than a day, is a mistake.
        for first_s in [80_000, 100_000] {
            let text = refusal_text(&format!("time_s,tub_yaw\n{first_s},1\n0,2\n"));
            assert!(text.contains(&format!("time goes back: 0 s after {first_s} s")), "{text}");
        }
    }

    #[test]
    fn drop_outs_of_the_tachometer_are_left_out_and_a_standstill_is_not() {
        // The drum washes in both directions with a pause, then spins.
        let true_speed_rpm = |t: f64| match t {
            t if t < 1.0 => 50.0 * t,
            t if t < 2.0 => 50.0 * (2.0 - t),
            t if t < 4.0 => 0.0,
            t if t < 5.0 => -50.0 * (t - 4.0),
            t if t < 6.0 => -50.0 * (6.0 - t),
            t => 30.0 * (t - 6.0),
        };
        let record_with_zeros = |step_s: f64, resolution_rpm: f64, zero_rows: &[usize]| {
            let times: Vec<f64> =
                (0..(12.0 / step_s) as u32).map(|k| step_s * f64::from(k)).collect();
            let mut speeds: Vec<f64> = times
                .iter()
                .map(|t| (true_speed_rpm(*t) / resolution_rpm).round() * resolution_rpm)
                .collect();
            zero_rows.iter().for_each(|row| speeds[*row] = 0.0);
            let yaw_values = times.iter().map(|t| t.sin()).collect();
            let columns = [("time_s", times), ("speed_rpm", speeds), ("tub_yaw", yaw_values)];
            let owned_columns = columns.map(|(name, values)| (name.to_owned(), values));
            Measurement::from_columns(owned_columns.to_vec(), &[]).unwrap()
        };
        for (step_s, digit_rpm) in [(0.001, 1e-3), (0.001, 5.0), (0.02, 1.0), (0.1, 1e-3)] {
            let without_zeros = record_with_zeros(step_s, digit_rpm, &[]);
            assert!(
                without_zeros.notes.is_empty(),
                "{step_s} {digit_rpm}: {:?}",
                without_zeros.notes
            );
            assert!(without_zeros.speed_rpm.unwrap().iter().all(|speed| !speed.is_nan()));
        }
        let with_zeros = record_with_zeros(0.02, 1.0, &[40, 520, 550, 551]);
        let note = "4 samples of speed_rpm drop to zero, the first at 0.8 s: left out";
        assert_eq!(with_zeros.notes, [note]);
        let speeds = with_zeros.speed_rpm.unwrap();
        let missing_rows: Vec<usize> =
            (0..speeds.len()).filter(|row| speeds[*row].is_nan()).collect();
        assert_eq!(missing_rows, [40, 520, 550, 551]);
        let notes = record_with_zeros(0.02, 1.0, &[520]).notes;
        assert_eq!(notes, ["1 sample of speed_rpm drops to zero, at 10.4 s: left out"]);
    }

    #[test]
    fn rows_before_the_run_are_left_out() {
        let columns_from_row = |first_row: i32| {
            let multiples = |factor: f64| (first_row..20).map(|k| factor * f64::from(k)).collect();
            let named_column = |(name, by): (&str, f64)| (name.to_owned(), multiples(by));
            [("time_s", 0.01), ("tub_yaw", 1.0), ("speed_rpm", 2.0)].map(named_column).to_vec()
        };
        let [full_record, early_record] =
            [0, -30].map(|from| Measurement::from_columns(columns_from_row(from), &[]).unwrap());
        assert_eq!(early_record, Measurement { rows_before_start: 30, ..full_record });
    }

    #[test]
    fn a_missing_sample_is_not_a_number_and_a_gap_is_seen() {
        let time_and_yaw = |k: usize| {
            let t = if k < 10 { 0.01 * k as f64 } else { 5.0 + 0.01 * k as f64 };
            (t, if k.is_multiple_of(3) { f64::NAN } else { k as f64 })
        };
        let (time_s, yaw_values) = (0..40).map(time_and_yaw).unzip();
        let columns = vec![("time_s".to_owned(), time_s), ("tub_yaw".to_owned(), yaw_values)];
        let measurement = Measurement::from_columns(columns, &[]).unwrap();
        assert_eq!(measurement.count_samples(), 26);
        assert_eq!(measurement.gaps_s.len(), 1);
        assert!((measurement.gaps_s[0][1] - 5.1).abs() < 1e-12);
    }
}
