//! The summary of a stability file, with its tongues: ranges of speeds in which a response is
//! unstable.

use std::fmt::Write as _;

use crate::places;
use sweep_engine::commands::cells::format_number;
use sweep_engine::config::section::format_count;
use sweep_files::{FileError, ParquetFile};

/// The columns of a row that the summary uses.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct StabilityRow {
    pub(crate) point: f64,
    /// The values of the point's axes.
    pub(crate) axis_values: Vec<f64>,
    pub(crate) speed_rpm: f64,
    /// The growth; not finite if there is no response.
    pub(crate) growth_per_s: f64,
    pub(crate) frequency_cpm: f64,
    pub(crate) kind: String,
    /// The speed (rpm) of the fold at which the branch ends, if it does.
    pub(crate) branch_to_rpm: Option<f64>,
    /// The limit of the machine's geometry that the response exceeds, if it does.
    pub(crate) beyond: Option<String>,
    /// Whether the response is not on the curve of a machine that runs up.
    pub(crate) is_off_curve: bool,
    /// The modes that take part, with their numbers and names.
    pub(crate) modes: Vec<(f64, String)>,
    pub(crate) status: String,
}

/// A range of speeds of one point that are unstable in the same way.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct UnstableRange {
    /// The row of the largest growth.
    pub(crate) largest_growth_row: StabilityRow,
    /// The first and the last unstable speed (rpm).
    pub(crate) end_speeds_rpm: [f64; 2],
}

/// The counts and lists of a summary.
#[derive(Debug, Default)]
pub(crate) struct StabilitySummary {
    axes: Vec<String>,
    rows: u64,
    points: u64,
    rows_without_response: u64,
    unstable_rows: u64,
    /// The number of rows that are stable by their multipliers, but exceed the machine's geometry.
    rows_beyond_limits: u64,
    /// The number of speeds whose first row is not on the curve of responses.
    rows_off_curve: u64,
    /// The number of stable rows above an unstable speed of their point, which a run-up passes
    /// first.
    rows_above_tongue: u64,
    /// The number of further rows of the same point and speed, which the other counts omit.
    coexisting_rows: u64,
    tongues: Vec<UnstableRange>,
    /// The rows on branches that end at a fold which a machine that runs up reaches.
    jumps: Vec<StabilityRow>,
    greatest_speed_rpm: f64,
    last_row: Option<StabilityRow>,
}

impl StabilitySummary {
    /// Adds the next row of the file.
    pub(crate) fn add(&mut self, row: StabilityRow) {
        let is_same_point = self.last_row.as_ref().is_some_and(|last| last.point == row.point);
        let is_coexisting = |last: &StabilityRow| is_same_point && last.speed_rpm == row.speed_rpm;
        // A machine that runs up is on the branch of the first row at a speed.
        if self.last_row.as_ref().is_some_and(is_coexisting) {
            self.coexisting_rows += 1;
            return;
        }
        self.rows += 1;
        self.greatest_speed_rpm = self.greatest_speed_rpm.max(row.speed_rpm);
        let point_and_branch_end = |row: &StabilityRow| (row.point, row.branch_to_rpm);
        let has_end = row.branch_to_rpm.is_some() && !row.is_off_curve;
        if has_end
            && self.jumps.last().map(point_and_branch_end) != Some(point_and_branch_end(&row))
        {
            self.jumps.push(row.clone());
        }
        let continues_tongue =
            is_same_point && self.last_row.as_ref().is_some_and(|last| last.growth_per_s > 0.0);
        self.points += u64::from(!is_same_point);
        self.rows_without_response += u64::from(row.status != "ok");
        self.rows_off_curve += u64::from(row.is_off_curve);
        self.rows_beyond_limits += u64::from(row.growth_per_s <= 0.0 && row.beyond.is_some());
        let is_passed_before = |tongue: &UnstableRange| {
            tongue.largest_growth_row.point == row.point && tongue.end_speeds_rpm[1] < row.speed_rpm
        };
        let is_stable = row.growth_per_s <= 0.0 && row.beyond.is_none();
        self.rows_above_tongue +=
            u64::from(is_stable && self.tongues.last().is_some_and(is_passed_before));
        if row.growth_per_s > 0.0 {
            self.unstable_rows += 1;
            match self.tongues.last_mut() {
                // A tongue ends where the kind changes, even if the next one begins at the same
                // speed.
                Some(tongue) if continues_tongue && tongue.largest_growth_row.kind == row.kind => {
                    tongue.end_speeds_rpm[1] = row.speed_rpm;
                    if row.growth_per_s > tongue.largest_growth_row.growth_per_s {
                        tongue.largest_growth_row = row.clone();
                    }
                }
                _ => {
                    self.tongues.push(UnstableRange {
                        largest_growth_row: row.clone(),
                        end_speeds_rpm: [row.speed_rpm; 2],
                    });
                }
            }
        }
        self.last_row = Some(row);
    }

    /// Returns the lines of the summary, each with its name.
    pub(crate) fn lines(&self) -> Vec<(&'static str, String)> {
        let mut lines = vec![(
            "stable",
            format!(
                "{} of {}, {} not, {} without a response; {}",
                self.rows
                    - self.unstable_rows
                    - self.rows_without_response
                    - self.rows_beyond_limits,
                format_count(self.rows as usize, "row"),
                self.unstable_rows,
                self.rows_without_response,
                format_count(self.points as usize, "point")
            ),
        )];
        if self.rows_above_tongue > 0 {
            let text = "above an unstable speed: a machine that runs up may be in another motion \
                         there (`sweep dwell --carry up`)";
            lines[0].1.push_str(&format!("; {} {text}", self.rows_above_tongue));
        }
        if self.rows_beyond_limits > 0 {
            let rows = format_count(self.rows_beyond_limits as usize, "row");
            let description = "beyond the machine's geometry (column beyond), counted as neither";
            lines.push(("beyond", format!("{rows} {description}")));
        }
        if self.rows_off_curve > 0 {
            let rows = format_count(self.rows_off_curve as usize, "row");
            let text = "off the curve (column on_curve): a machine that runs up may be in another \
                         motion at these speeds (`sweep dwell`)";
            lines.push(("off curve", format!("{rows} {text}")));
        }
        if self.coexisting_rows > 0 {
            let rows = format_count(self.coexisting_rows as usize, "further row");
            let description = "other responses at the same speeds (column branch)";
            lines.push(("others", format!("{rows}: {description}")));
        }
        for row in &self.jumps {
            let point_prefix = self.point_prefix(row);
            let rpm = row.branch_to_rpm.unwrap_or_default();
            if rpm > self.greatest_speed_rpm {
                continue;
            }
            let description = "running up, the response folds back and the motion jumps";
            lines.push(("jump", format!("{point_prefix}at {rpm:.2} rpm, {description}")));
        }
        // The tongues of a single point are listed in order of speed, those of several points by
        // growth.
        let mut listed_tongues: Vec<&UnstableRange> = self.tongues.iter().collect();
        if self.points > 1 {
            listed_tongues.sort_by(|a, b| {
                b.largest_growth_row.growth_per_s.total_cmp(&a.largest_growth_row.growth_per_s)
            });
        }
        lines.extend(listed_tongues.iter().map(|tongue| ("unstable", self.format_tongue(tongue))));
        lines
    }

    /// Returns the prefix of a line that names a row's point; empty if the file has one point.
    fn point_prefix(&self, row: &StabilityRow) -> String {
        match self.points {
            0 | 1 => String::new(),
            _ => format!("{}: ", places::point_text(&self.axes, &row.axis_values)),
        }
    }

    fn format_tongue(&self, tongue: &UnstableRange) -> String {
        let UnstableRange { largest_growth_row: row, end_speeds_rpm: [first_rpm, last_rpm] } =
            tongue;
        let mut text = self.point_prefix(row);
        let [growth_speed_text, first_text, last_text] =
            [row.speed_rpm, *first_rpm, *last_rpm].map(format_number);
        let range_end_text =
            if first_text == last_text { String::new() } else { format!(" to {last_text}") };
        // Writing to a String cannot fail.
        let _ = write!(
            text,
            "{first_text}{range_end_text} rpm, {}, up to {:.4} /s at {growth_speed_text} rpm \
             ({:.1} and {:.1} per minute)",
            row.kind.replace('_', " "),
            row.growth_per_s,
            row.frequency_cpm,
            row.speed_rpm - row.frequency_cpm
        );
        for (number, name) in &row.modes {
            let _ = write!(text, "; mode {number}: {name}");
        }
        text
    }
}

/// Summarises a stability file.
///
/// # Errors
/// Returns an error if the file cannot be read.
pub(crate) fn summarise(file: &ParquetFile) -> Result<StabilitySummary, FileError> {
    let axes = places::axis_names(file);
    let number_columns = ["point", "speed_rpm", "growth_per_s", "frequency_cpm", "branch_to_rpm"];
    let mode_columns = ["mode_1", "mode_2", "mode_1_name", "mode_2_name"];
    let word_columns = ["kind", "status", "beyond", "on_curve"];
    let fixed_columns = [&number_columns[..], &mode_columns, &word_columns].concat();
    let column_names =
        [&fixed_columns[..], &axes.iter().map(String::as_str).collect::<Vec<_>>()].concat();
    let mut summary = StabilitySummary { axes: axes.clone(), ..StabilitySummary::default() };
    file.each_row(&column_names, |row| {
        let [point, speed_rpm, growth_per_s, frequency_cpm, branch_to_rpm] =
            std::array::from_fn(|column| row.value(column));
        let [kind, status, beyond] = [9, 10, 11].map(|column| row.word(column).map(str::to_owned));
        let is_off_curve = row.word(12) == Some("false");
        let modes = [5, 6].map(|column| (row.value(column), row.word(column + 2)));
        let participating_modes = modes.into_iter().filter(|(number, _)| !number.is_nan());
        summary.add(StabilityRow {
            point,
            axis_values: (fixed_columns.len()..column_names.len())
                .map(|column| row.value(column))
                .collect(),
            speed_rpm,
            growth_per_s,
            frequency_cpm,
            kind: kind.unwrap_or_default(),
            branch_to_rpm: Some(branch_to_rpm).filter(|speed| !speed.is_nan()),
            beyond,
            is_off_curve,
            modes: participating_modes
                .map(|(number, name)| (number, name.unwrap_or_default().to_owned()))
                .collect(),
            status: status.unwrap_or_default(),
        });
        Ok::<(), FileError>(())
    })?;
    Ok(summary)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tongues_are_ranges_of_one_point_and_kind() {
        let axis_names = vec!["unbalance_mass_kg".to_owned()];
        let mut summary = StabilitySummary { axes: axis_names, ..StabilitySummary::default() };
        let rows = [
            (0.0, 1.0, -0.1, "stable"),
            (0.0, 2.0, 0.1, "quasi_periodic"),
            (0.0, 3.0, 0.3, "quasi_periodic"),
            (0.0, 4.0, 0.2, "period_doubling"),
            (0.0, 4.0, 0.9, "fold"),
            (1.0, 1.0, 0.2, "period_doubling"),
            (1.0, 2.0, f64::NAN, ""),
            (1.0, 3.0, 0.1, "fold"),
            (1.0, 4.0, -0.1, "stable"),
        ];
        // A second row of a speed is another response, which is not counted as a speed.
        for (point, speed_rpm, growth_per_s, kind) in rows {
            let status = if growth_per_s.is_nan() { "no_response" } else { "ok" };
            summary.add(StabilityRow {
                point,
                axis_values: vec![0.1 * (point + 1.0)],
                speed_rpm,
                growth_per_s,
                kind: kind.to_owned(),
                status: status.to_owned(),
                is_off_curve: kind == "period_doubling",
                ..StabilityRow::default()
            });
        }
        let tongue_speeds_rpm: Vec<_> = summary
            .tongues
            .iter()
            .map(|t| (t.end_speeds_rpm, t.largest_growth_row.speed_rpm))
            .collect();
        assert_eq!(
            tongue_speeds_rpm,
            [([2.0, 3.0], 3.0), ([4.0, 4.0], 4.0), ([1.0, 1.0], 1.0), ([3.0, 3.0], 3.0)]
        );
        let lines = summary.lines();
        let expected_counts =
            "2 of 8 rows, 5 not, 1 without a response; 2 points; 1 above an unstable speed: ";
        assert!(lines[0].1.starts_with(expected_counts), "{lines:?}");
        assert!(lines[1].1.starts_with("2 rows off the curve"));
        assert!(lines[2].1.starts_with("1 further row: other responses"));
        assert!(lines[3].1.starts_with(
            "unbalance_mass_kg 0.1: 2 to 3 rpm, quasi periodic, up to 0.3000 /s at 3"
        ));
        assert!(lines[4].1.starts_with("unbalance_mass_kg 0.1: 4 rpm, period doubling, up to"));
    }

    #[test]
    fn one_row_is_in_the_singular() {
        let mut summary = StabilitySummary::default();
        summary.add(StabilityRow {
            speed_rpm: 250.0,
            growth_per_s: -0.1,
            status: "ok".to_owned(),
            is_off_curve: true,
            ..StabilityRow::default()
        });
        let lines = summary.lines();
        assert!(lines[0].1.starts_with("1 of 1 row, 0 not, 0 without a response; 1 point"));
        assert!(lines.iter().any(|(_, line)| line.starts_with("1 row off the curve")), "{lines:?}");
    }

    #[test]
    fn jumps_are_at_folds_of_the_curve_up_to_the_greatest_speed() {
        let mut summary = StabilitySummary::default();
        for (speed_rpm, fold_rpm, is_off_curve) in
            [(240.0, 245.0, false), (245.0, 248.0, true), (250.0, 260.0, false)]
        {
            let branch_to_rpm = Some(fold_rpm);
            summary.add(StabilityRow {
                speed_rpm,
                branch_to_rpm,
                is_off_curve,
                ..StabilityRow::default()
            });
        }
        let lines = summary.lines();
        let jumps: Vec<_> = lines.iter().filter(|(name, _)| *name == "jump").collect();
        assert_eq!(jumps.len(), 1, "{lines:?}");
        assert!(jumps[0].1.starts_with("at 245.00 rpm"), "{lines:?}");
    }

    #[test]
    fn speeds_are_rounded() {
        let mut summary = StabilitySummary::default();
        for speed_rpm in [0.1 + 0.2, 249.700_000_000_000_02] {
            summary.add(StabilityRow { speed_rpm, growth_per_s: 1.0, ..StabilityRow::default() });
        }
        let (_, tongue_text) = summary.lines().pop().unwrap();
        assert!(tongue_text.starts_with("0.3 to 249.7 rpm"), "{tongue_text}");
    }
}
