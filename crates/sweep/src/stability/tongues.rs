//! Tongues: runs of speeds at which a response is unstable, found in the rows of a stability file.

use std::fmt::Write as _;

use crate::places;
use sweep_engine::commands::cells::short;
use sweep_engine::config::section::counted;
use sweep_files::{FileError, ParquetFile};

/// What is read of a row.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Row {
    pub(crate) point: f64,
    /// The values of the point's axes.
    pub(crate) at: Vec<f64>,
    pub(crate) speed_rpm: f64,
    /// Not finite where there is no response.
    pub(crate) growth_per_s: f64,
    pub(crate) frequency_cpm: f64,
    pub(crate) kind: String,
    /// The speed (rpm) above which its branch is not.
    pub(crate) branch_to_rpm: Option<f64>,
    /// What of the machine's geometry it passes.
    pub(crate) beyond: Option<String>,
    /// Whether it is not on the curve of responses.
    pub(crate) is_off_curve: bool,
    /// What moves in the modes that take part, and their numbers.
    pub(crate) modes: Vec<(f64, String)>,
    pub(crate) status: String,
}

/// A run of unstable speeds of one point.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tongue {
    /// The row of the largest growth.
    pub(crate) at: Row,
    /// First and last unstable speed (rpm).
    pub(crate) from_to_rpm: [f64; 2],
}

/// What a file says as a whole.
#[derive(Debug, Default)]
pub(crate) struct StabilitySummary {
    axes: Vec<String>,
    rows: u64,
    points: u64,
    without: u64,
    unstable: u64,
    /// Rows that are stable by their multipliers, and pass what no machine can.
    beyond: u64,
    /// Rows, each the first of its speed, that are not on the curve of responses.
    off_curve: u64,
    /// Stable rows above an unstable speed of their point, which a drum that runs up has passed.
    passed: u64,
    /// Rows behind another of the same point and speed, which all else leaves out.
    coexisting: u64,
    tongues: Vec<Tongue>,
    /// Rows on branches whose end a machine that runs up comes to.
    jumps: Vec<Row>,
    /// The fastest of all rows.
    fastest_rpm: f64,
    last: Option<Row>,
}

impl StabilitySummary {
    /// Takes in the next row.
    pub(crate) fn add(&mut self, row: Row) {
        let same_point = self.last.as_ref().is_some_and(|last| last.point == row.point);
        let is_other = |last: &Row| same_point && last.speed_rpm == row.speed_rpm;
        // A machine that runs up is on the first branch that there is at a speed.
        if self.last.as_ref().is_some_and(is_other) {
            self.coexisting += 1;
            return;
        }
        self.rows += 1;
        self.fastest_rpm = self.fastest_rpm.max(row.speed_rpm);
        let end = |row: &Row| (row.point, row.branch_to_rpm);
        let has_end = row.branch_to_rpm.is_some() && !row.is_off_curve;
        if has_end && self.jumps.last().map(end) != Some(end(&row)) {
            self.jumps.push(row.clone());
        }
        let follows = same_point && self.last.as_ref().is_some_and(|last| last.growth_per_s > 0.0);
        self.points += u64::from(!same_point);
        self.without += u64::from(row.status != "ok");
        self.off_curve += u64::from(row.is_off_curve);
        self.beyond += u64::from(row.growth_per_s <= 0.0 && row.beyond.is_some());
        let is_passed =
            |tongue: &Tongue| tongue.at.point == row.point && tongue.from_to_rpm[1] < row.speed_rpm;
        let is_stable = row.growth_per_s <= 0.0 && row.beyond.is_none();
        self.passed += u64::from(is_stable && self.tongues.last().is_some_and(is_passed));
        if row.growth_per_s > 0.0 {
            self.unstable += 1;
            match self.tongues.last_mut() {
                // One tongue ends where the kind changes, even if the next begins at once.
                Some(tongue) if follows && tongue.at.kind == row.kind => {
                    tongue.from_to_rpm[1] = row.speed_rpm;
                    if row.growth_per_s > tongue.at.growth_per_s {
                        tongue.at = row.clone();
                    }
                }
                _ => {
                    self.tongues.push(Tongue { at: row.clone(), from_to_rpm: [row.speed_rpm; 2] });
                }
            }
        }
        self.last = Some(row);
    }

    /// In words, a line each with its name.
    pub(crate) fn lines(&self) -> Vec<(&'static str, String)> {
        let mut lines = vec![(
            "stable",
            format!(
                "{} of {} rows, {} not, {} without a response; {}",
                self.rows - self.unstable - self.without - self.beyond,
                self.rows,
                self.unstable,
                self.without,
                counted(self.points as usize, "point")
            ),
        )];
        if self.passed > 0 {
            let words = "above an unstable speed: a drum that was carried up may be in another \
                         motion (`sweep dwell --carry up`)";
            lines[0].1.push_str(&format!("; {} {words}", self.passed));
        }
        if self.beyond > 0 {
            let words = "rows pass what no machine can (column beyond), and count for neither";
            lines.push(("beyond", format!("{} {words}", self.beyond)));
        }
        if self.off_curve > 0 {
            let words = "of these rows are off the curve (column on_curve): a machine that runs up \
                         may be in another motion there (`sweep dwell`)";
            lines.push(("off curve", format!("{} {words}", self.off_curve)));
        }
        if self.coexisting > 0 {
            let words = "further rows: other responses at the same speeds (column branch)";
            lines.push(("others", format!("{} {words}", self.coexisting)));
        }
        for row in &self.jumps {
            let (of_point, rpm) = (self.of_point(row), row.branch_to_rpm.unwrap_or_default());
            if rpm > self.fastest_rpm {
                continue;
            }
            let words = "running up, the response folds back and the motion jumps";
            lines.push(("jump", format!("{of_point}at {rpm:.2} rpm, {words}")));
        }
        // All of one point; else the worst.
        let mut listed: Vec<&Tongue> = self.tongues.iter().collect();
        if self.points > 1 {
            listed.sort_by(|a, b| b.at.growth_per_s.total_cmp(&a.at.growth_per_s));
        }
        lines.extend(listed.iter().map(|tongue| ("unstable", self.words(tongue))));
        lines
    }

    /// Which of several points.
    fn of_point(&self, row: &Row) -> String {
        match self.points {
            0 | 1 => String::new(),
            _ => format!("{}: ", places::words(&self.axes, &row.at)),
        }
    }

    fn words(&self, tongue: &Tongue) -> String {
        let Tongue { at, from_to_rpm: [from, to] } = tongue;
        let mut text = self.of_point(at);
        let [speed, first, last] = [at.speed_rpm, *from, *to].map(short);
        let to = if first == last { String::new() } else { format!(" to {last}") };
        // Writing to a String cannot fail.
        let _ = write!(
            text,
            "{first}{to} rpm, {}, up to {:.4} /s at {speed} rpm ({:.1} and {:.1} per minute)",
            at.kind.replace('_', " "),
            at.growth_per_s,
            at.frequency_cpm,
            at.speed_rpm - at.frequency_cpm
        );
        for (number, name) in &at.modes {
            let _ = write!(text, "; mode {number}: {name}");
        }
        text
    }
}

/// Reads through a stability file.
///
/// # Errors
/// As [`ParquetFile::read`].
pub(crate) fn summary(file: &ParquetFile) -> Result<StabilitySummary, FileError> {
    let axes = places::axes(file);
    let numbers = ["point", "speed_rpm", "growth_per_s", "frequency_cpm", "branch_to_rpm"];
    let modes = ["mode_1", "mode_2", "mode_1_name", "mode_2_name"];
    let words = ["kind", "status", "beyond", "on_curve"];
    let own = [&numbers[..], &modes, &words].concat();
    let names = [&own[..], &axes.iter().map(String::as_str).collect::<Vec<_>>()].concat();
    let mut summary = StabilitySummary { axes: axes.clone(), ..StabilitySummary::default() };
    file.each_row(&names, |row| {
        let [point, speed_rpm, growth_per_s, frequency_cpm, branch_to_rpm] =
            std::array::from_fn(|column| row.value(column));
        let [kind, status, beyond] = [9, 10, 11].map(|column| row.word(column).map(str::to_owned));
        let is_off_curve = row.word(12) == Some("false");
        let modes = [5, 6].map(|column| (row.value(column), row.word(column + 2)));
        let modes = modes.into_iter().filter(|(number, _)| !number.is_nan());
        summary.add(Row {
            point,
            at: (own.len()..names.len()).map(|column| row.value(column)).collect(),
            speed_rpm,
            growth_per_s,
            frequency_cpm,
            kind: kind.unwrap_or_default(),
            branch_to_rpm: Some(branch_to_rpm).filter(|speed| !speed.is_nan()),
            beyond,
            is_off_curve,
            modes: modes
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
    fn tongues_are_runs_of_one_point_and_kind() {
        let axes = vec!["unbalance_mass_kg".to_owned()];
        let mut summary = StabilitySummary { axes, ..StabilitySummary::default() };
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
        // A second row of a speed is another response, and no speed.
        for (point, speed_rpm, growth_per_s, kind) in rows {
            let status = if growth_per_s.is_nan() { "no_response" } else { "ok" };
            summary.add(Row {
                point,
                at: vec![0.1 * (point + 1.0)],
                speed_rpm,
                growth_per_s,
                kind: kind.to_owned(),
                status: status.to_owned(),
                is_off_curve: kind == "period_doubling",
                ..Row::default()
            });
        }
        let found: Vec<_> =
            summary.tongues.iter().map(|t| (t.from_to_rpm, t.at.speed_rpm)).collect();
        assert_eq!(
            found,
            [([2.0, 3.0], 3.0), ([4.0, 4.0], 4.0), ([1.0, 1.0], 1.0), ([3.0, 3.0], 3.0)]
        );
        let lines = summary.lines();
        let all = "2 of 8 rows, 5 not, 1 without a response; 2 points; 1 above an unstable speed: ";
        assert!(lines[0].1.starts_with(all), "{lines:?}");
        assert!(lines[1].1.starts_with("2 of these rows are off the curve"));
        assert!(lines[2].1.starts_with("1 further rows"));
        assert!(lines[3].1.starts_with(
            "unbalance_mass_kg 0.1: 2 to 3 rpm, quasi periodic, up to 0.3000 /s at 3"
        ));
        assert!(lines[4].1.starts_with("unbalance_mass_kg 0.1: 4 rpm, period doubling, up to"));
    }

    #[test]
    fn jumps_are_those_of_the_curve_at_speeds_that_were_asked() {
        let mut summary = StabilitySummary::default();
        for (speed_rpm, ends_rpm, is_off_curve) in
            [(240.0, 245.0, false), (245.0, 248.0, true), (250.0, 260.0, false)]
        {
            let branch_to_rpm = Some(ends_rpm);
            summary.add(Row { speed_rpm, branch_to_rpm, is_off_curve, ..Row::default() });
        }
        let lines = summary.lines();
        let jumps: Vec<_> = lines.iter().filter(|(name, _)| *name == "jump").collect();
        assert_eq!(jumps.len(), 1, "{lines:?}");
        assert!(jumps[0].1.starts_with("at 245.00 rpm"), "{lines:?}");
    }

    #[test]
    fn speeds_are_rounded_for_people() {
        let mut summary = StabilitySummary::default();
        for speed_rpm in [0.1 + 0.2, 249.700_000_000_000_02] {
            summary.add(Row { speed_rpm, growth_per_s: 1.0, ..Row::default() });
        }
        let (_, tongue) = summary.lines().pop().unwrap();
        assert!(tongue.starts_with("0.3 to 249.7 rpm"), "{tongue}");
    }
}
