//! The summary of a file of `sweep dwell`.

use std::collections::BTreeMap;

use crate::places;
use sweep_files::{FileError, ParquetFile, key};

/// The channels whose amplitudes the summary gives.
const SUMMARY_CHANNELS: [&str; 2] = ["tub_yaw", "tub_pitch"];

/// Maximum number of motions that have a line each. Basis: they fit on a screen. Doubling it
/// doubles the longest summary.
const MAX_LISTED_MOTIONS: usize = 12;

/// Returns the lines of the summary, each with its name.
///
/// # Errors
/// Returns an error if the file cannot be read.
pub(crate) fn summary_lines(file: &ParquetFile) -> Result<Vec<(&'static str, String)>, FileError> {
    let mut axes = places::axis_names(file);
    axes.push("speed_rpm".to_owned());
    let mut counts_by_kind: BTreeMap<String, u64> = BTreeMap::new();
    let mut row_count = 0_u64;
    let mut point_count = 0_u64;
    // Each entry has the coordinates of a point and speed with several motions, and their number.
    let mut points_with_several_motions: Vec<(Vec<f64>, u64)> = Vec::new();
    let mut farthest_motions = FarthestMotions::default();
    let has_turns = file.schema().index_of("turn").is_ok();
    let amplitude_columns = SUMMARY_CHANNELS.map(|name| format!("nonlinear_{name}"));
    let has_kicks = file.schema().index_of("least_kick_rad_per_s").is_ok();
    let mut listed_motions: Vec<MotionLine> = Vec::new();
    let names = ["kind", "status", "motion", "turn", "starts", "starts_made"].into_iter();
    let column_names = names.chain(has_kicks.then_some("least_kick_rad_per_s"));
    let names = column_names.chain(amplitude_columns.iter().map(String::as_str));
    let names: Vec<&str> = names.chain(axes.iter().map(String::as_str)).collect();
    file.each_row(&names, |row| {
        // Only the first of a motion's turns is counted.
        if has_turns && row.value(3) > 0.0 {
            return Ok(());
        }
        let first_channel_column = 6 + usize::from(has_kicks);
        let first_axis_column = first_channel_column + SUMMARY_CHANNELS.len();
        let point_and_speed =
            || (first_axis_column..names.len()).map(|column| row.value(column)).collect();
        let kind_text = row.word(0).or(row.word(1)).unwrap_or_default();
        row_count += 1;
        if listed_motions.len() <= MAX_LISTED_MOTIONS {
            listed_motions.push(MotionLine {
                point_and_speed: point_and_speed(),
                motion_number: row.value(2),
                kind_text: kind_text.replace('_', " "),
                amplitudes_rad: [0, 1].map(|k| row.value(first_channel_column + k)),
                start_counts: [row.value(4), row.value(5)],
                least_kick_rad_per_s: if has_kicks { row.value(6) } else { f64::NAN },
            });
        }
        *counts_by_kind.entry(kind_text.to_owned()).or_default() += 1;
        match row.value(2) {
            0.0 => point_count += 1,
            1.0 => points_with_several_motions.push((point_and_speed(), 2)),
            _ => points_with_several_motions
                .iter_mut()
                .last()
                .into_iter()
                .for_each(|(_, count)| *count += 1),
        }
        let status = row.word(1).unwrap_or_default();
        let amplitudes_rad = [0, 1].map(|k| row.value(first_channel_column + k));
        farthest_motions.add(status, amplitudes_rad, kind_text, &point_and_speed);
        Ok::<(), FileError>(())
    })?;
    let kind_counts: Vec<String> = counts_by_kind
        .iter()
        .map(|(kind, count)| format!("{count} {}", kind.replace('_', " ")))
        .collect();
    let plural = if point_count == 1 { "" } else { "s" };
    let summary_text = format!(
        "{row_count} at {point_count} point{plural} and speed{plural}: {}",
        kind_counts.join(", ")
    );
    let mut lines = vec![("motions", summary_text)];
    if row_count as usize <= MAX_LISTED_MOTIONS {
        lines.extend(listed_motions.iter().map(|motion| ("motion", motion.to_sentence(&axes))));
        lines.extend(
            format_kick_sentences(file, &axes, &listed_motions)
                .into_iter()
                .map(|line| ("push", line)),
        );
    }
    lines.extend(farthest_motions.to_lines(&axes));
    for (values, motions) in &points_with_several_motions {
        lines.push((
            "several",
            format!("{motions} motions at {}", places::point_text(&axes, values)),
        ));
    }
    Ok(lines)
}

/// A class of motions among which the farthest one is named.
struct MotionClass {
    /// The status of the motions' rows.
    status: &'static str,
    /// The name of the summary's lines about the class.
    line_name: &'static str,
    /// The words after the place of a motion, which begin with a comma, or are empty.
    remark: &'static str,
}

/// The classes of motions. Only confirmed endings, which have the status `ok`, may be named as the
/// farthest motion that a machine stays in.
const MOTION_CLASSES: [MotionClass; 3] = [
    MotionClass { status: "ok", line_name: "farthest", remark: "" },
    MotionClass { status: "transient", line_name: "transient", remark: ", which ends elsewhere" },
    MotionClass { status: "not_settled", line_name: "unsettled", remark: ", with an unknown end" },
];

/// A motion with the greatest amplitude of a channel.
struct FarthestMotion {
    /// The amplitude (rad).
    amplitude_rad: f64,
    kind_text: String,
    /// The point and the speed.
    point_and_speed: Vec<f64>,
}

/// The motions with the greatest amplitudes, by the classes in [`MOTION_CLASSES`] and by channel.
#[derive(Default)]
struct FarthestMotions([[Option<FarthestMotion>; SUMMARY_CHANNELS.len()]; MOTION_CLASSES.len()]);

impl FarthestMotions {
    /// Adds a motion by its status, with its amplitudes (rad) and its point and speed. A motion of
    /// no class, or without amplitudes, is left out.
    fn add(
        &mut self,
        status: &str,
        amplitudes_rad: [f64; SUMMARY_CHANNELS.len()],
        kind_text: &str,
        point_and_speed: &dyn Fn() -> Vec<f64>,
    ) {
        let Some(class) = MOTION_CLASSES.iter().position(|class| class.status == status) else {
            return;
        };
        for (amplitude_rad, farthest) in amplitudes_rad.into_iter().zip(&mut self.0[class]) {
            let greatest_rad =
                farthest.as_ref().map_or(f64::NEG_INFINITY, |motion| motion.amplitude_rad);
            if amplitude_rad > greatest_rad {
                let kind_text = kind_text.replace('_', " ");
                *farthest = Some(FarthestMotion {
                    amplitude_rad,
                    kind_text,
                    point_and_speed: point_and_speed(),
                });
            }
        }
    }

    /// Returns a line for each class and channel with a motion.
    fn to_lines(&self, axes: &[String]) -> Vec<(&'static str, String)> {
        let mut lines = Vec::new();
        for (class, motions) in MOTION_CLASSES.iter().zip(&self.0) {
            for (name, motion) in SUMMARY_CHANNELS.iter().zip(motions) {
                let Some(FarthestMotion { amplitude_rad, kind_text, point_and_speed }) = motion
                else {
                    continue;
                };
                let name = name.replace('_', " ");
                let point_text = places::point_text(axes, point_and_speed);
                let amplitude_mrad = 1e3 * amplitude_rad;
                let sentence =
                    format!("{name} {amplitude_mrad:.1} mrad, {kind_text}, at {point_text}");
                lines.push((class.line_name, sentence + class.remark));
            }
        }
        lines
    }
}

/// A motion with a line in the summary.
struct MotionLine {
    /// The point and the speed.
    point_and_speed: Vec<f64>,
    /// The number of the motion among those of the point and speed, from 0.
    motion_number: f64,
    /// The kind of the motion, or the reason why it has none.
    kind_text: String,
    /// The amplitudes of yaw and pitch (rad).
    amplitudes_rad: [f64; SUMMARY_CHANNELS.len()],
    /// The number of starts that ended in this motion, and that of all starts.
    start_counts: [f64; 2],
    /// The smallest kick (rad/s) that led to this motion; not finite if it is not known.
    least_kick_rad_per_s: f64,
}

impl MotionLine {
    fn to_sentence(&self, axes: &[String]) -> String {
        let mut text =
            format!("{} at {}", self.kind_text, places::point_text(axes, &self.point_and_speed));
        for (name, value) in SUMMARY_CHANNELS.iter().zip(self.amplitudes_rad) {
            if value.is_finite() {
                text += &format!(", {} {:.1} mrad", name.replace('_', " "), 1e3 * value);
            }
        }
        let [starts_ended_here, starts_in_all] = self.start_counts;
        if starts_in_all > 0.0 {
            text += &format!("; from {starts_ended_here} of {starts_in_all} starts");
            if self.least_kick_rad_per_s == 0.0 {
                text += ", the disturbed periodic response among them";
            } else if self.least_kick_rad_per_s > 0.0 {
                text += &format!(", the weakest a kick of {:.2} rad/s", self.least_kick_rad_per_s);
            } else if starts_ended_here > 0.0 {
                text += ", of the machine at rest";
            } else {
                text += ", where a transient ended";
            }
        }
        text
    }

    /// Returns whether the row describes a motion.
    fn describes_motion(&self) -> bool {
        self.start_counts[1] > 0.0
    }
}

/// Returns for each point and speed a sentence on the kicks that lead from motion 0 to another
/// motion.
fn format_kick_sentences(
    file: &ParquetFile,
    axes: &[String],
    listed_motions: &[MotionLine],
) -> Vec<String> {
    let search_json = file.json(key::DWELL).unwrap_or_default();
    let Some(max_kick_rad_per_s) = search_json["kick_rad_per_s"].as_f64() else {
        return Vec::new();
    };
    let mut sentences = Vec::new();
    for motions in listed_motions.chunk_by(|a, b| a.point_and_speed == b.point_and_speed) {
        let place_text = places::point_text(axes, &motions[0].point_and_speed);
        let other_motions = motions.iter().filter(|motion| motion.motion_number > 0.0);
        let least_kicks_rad_per_s =
            other_motions.map(|motion| motion.least_kick_rad_per_s).filter(|kick| kick.is_finite());
        if !motions[0].describes_motion() {
            continue;
        }
        sentences.push(match least_kicks_rad_per_s.reduce(f64::min) {
            Some(kick) => format!("a kick of {kick:.2} rad/s leads elsewhere at {place_text}"),
            None => {
                format!(
                    "no push up to {max_kick_rad_per_s} rad/s that was tried leads elsewhere at \
                     {place_text}"
                )
            }
        });
    }
    sentences
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_transient_is_never_the_farthest_motion() {
        let mut farthest = FarthestMotions::default();
        for (status, yaw_rad, kind, speed_rpm) in [
            ("ok", 0.020, "periodic", 250.0),
            ("transient", 0.061, "transient", 260.0),
            ("ok", 0.035, "periodic_2", 270.0),
            ("not_settled", 0.052, "not_settled", 280.0),
            ("left_range", f64::NAN, "left_range", 290.0),
        ] {
            farthest.add(status, [yaw_rad, f64::NAN], kind, &|| vec![speed_rpm]);
        }
        let lines = farthest.to_lines(&["speed_rpm".to_owned()]);
        let expected_lines = [
            ("farthest", "tub yaw 35.0 mrad, periodic 2, at 270 rpm"),
            ("transient", "tub yaw 61.0 mrad, transient, at 260 rpm, which ends elsewhere"),
            ("unsettled", "tub yaw 52.0 mrad, not settled, at 280 rpm, with an unknown end"),
        ];
        assert_eq!(lines, expected_lines.map(|(line, text)| (line, text.to_owned())));
    }
}
