//! What a file of `sweep dwell` says as a whole.

use std::collections::BTreeMap;

use crate::places;
use sweep_files::{FileError, ParquetFile};

/// Channels whose farthest motion is told.
const TOLD: [&str; 2] = ["tub_yaw", "tub_pitch"];

/// Reads through a file: lines, each with its name.
///
/// # Errors
/// As [`ParquetFile::read`].
pub(crate) fn lines(file: &ParquetFile) -> Result<Vec<(&'static str, String)>, FileError> {
    let mut axes = places::axes(file);
    axes.push("speed_rpm".to_owned());
    let mut kinds: BTreeMap<String, u64> = BTreeMap::new();
    let (mut rows, mut places) = (0_u64, 0_u64);
    // Where there are several motions, and how many.
    let mut several: Vec<(Vec<f64>, u64)> = Vec::new();
    // By channel: how far, which kind of motion, where.
    let mut farthest: [Option<(f64, String, Vec<f64>)>; TOLD.len()] = [None, None];
    let has_turns = file.schema().index_of("turn").is_ok();
    let channels = TOLD.map(|name| format!("nonlinear_{name}"));
    let names = ["kind", "status", "motion", "turn"].into_iter();
    let names = names.chain(channels.iter().map(String::as_str));
    let names: Vec<&str> = names.chain(axes.iter().map(String::as_str)).collect();
    file.each_row(&names, |row| {
        // A motion counts by the first of its turns, if these were kept.
        if has_turns && row.value(3) > 0.0 {
            return Ok(());
        }
        let place = || (4 + TOLD.len()..names.len()).map(|column| row.value(column)).collect();
        let what = row.word(0).or(row.word(1)).unwrap_or_default();
        rows += 1;
        *kinds.entry(what.to_owned()).or_default() += 1;
        match row.value(2) {
            0.0 => places += 1,
            1.0 => several.push((place(), 2)),
            _ => several.iter_mut().last().into_iter().for_each(|(_, count)| *count += 1),
        }
        for (column, farthest) in (4..).zip(&mut farthest) {
            let value = row.value(column);
            if value > farthest.as_ref().map_or(f64::NEG_INFINITY, |(known, ..)| *known) {
                *farthest = Some((value, what.to_owned(), place()));
            }
        }
        Ok::<(), FileError>(())
    })?;
    let list: Vec<String> =
        kinds.iter().map(|(kind, count)| format!("{count} {}", kind.replace('_', " "))).collect();
    let s = if places == 1 { "" } else { "s" };
    let counted = format!("{rows} at {places} point{s} and speed{s}: {}", list.join(", "));
    let mut lines = vec![("motions", counted)];
    for (name, farthest) in TOLD.iter().zip(&farthest) {
        if let Some((value, kind, at)) = farthest {
            let (name, kind) = (name.replace('_', " "), kind.replace('_', " "));
            let at = places::words(&axes, at);
            lines.push(("farthest", format!("{name} {:.1} mrad, {kind}, at {at}", 1e3 * value)));
        }
    }
    for (at, motions) in &several {
        lines.push(("several", format!("{motions} motions at {}", places::words(&axes, at))));
    }
    Ok(lines)
}
