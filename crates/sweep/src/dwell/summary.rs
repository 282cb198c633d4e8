//! What a file of `sweep dwell` says as a whole.

use std::collections::BTreeMap;

use arrow_schema::ArrowError;

use crate::places;
use sweep_engine::StoreError;
use sweep_files::{ParquetFile, cells};

/// Places that are listed.
const MOST_LISTED: usize = 12;

/// Channels whose farthest motion is told.
const TOLD: [&str; 2] = ["tub_yaw", "tub_pitch"];

/// Reads through a file: lines, each with its name.
///
/// # Errors
/// [`StoreError::File`] and [`StoreError::Parquet`].
pub(crate) fn lines(file: &ParquetFile) -> Result<Vec<(&'static str, String)>, StoreError> {
    let failed = StoreError::parquet("read", file.path());
    let mut axes = places::axes(file);
    axes.push("speed_rpm".to_owned());
    let mut kinds: BTreeMap<String, u64> = BTreeMap::new();
    let (mut rows, mut places) = (0_u64, 0_u64);
    // Where there are several motions, and how many.
    let mut several: Vec<(Vec<f64>, u64)> = Vec::new();
    // By channel: how far, which kind of motion, where.
    let mut farthest: [Option<(f64, String, Vec<f64>)>; TOLD.len()] = [None, None];
    for batch in file.batches(|builder| builder)? {
        let batch = batch?;
        let mut add = || -> Result<(), ArrowError> {
            let missing =
                |name: &str| ArrowError::SchemaError(format!("there is no column {name}"));
            let column = |name: &str| batch.column_by_name(name).ok_or_else(|| missing(name));
            let numbers = |name: &str| cells::numbers(column(name)?);
            let (kind, status) = (cells::texts(column("kind")?)?, cells::texts(column("status")?)?);
            let motion = numbers("motion")?;
            // A motion counts by the first of its turns, if these were kept.
            let turn = batch.column_by_name("turn").map(|turn| cells::numbers(turn)).transpose()?;
            let at = axes.iter().map(|axis| numbers(axis)).collect::<Result<Vec<_>, _>>()?;
            let told = TOLD.map(|name| numbers(&format!("nonlinear_{name}")).unwrap_or_default());
            let is_first = |i: &usize| turn.as_ref().is_none_or(|turn| turn[*i] <= Some(0.0));
            for i in (0..batch.num_rows()).filter(is_first) {
                let place = || at.iter().map(|values| values[i].unwrap_or(f64::NAN)).collect();
                let what = kind[i].or(status[i]).unwrap_or_default();
                rows += 1;
                *kinds.entry(what.to_owned()).or_default() += 1;
                match motion[i] {
                    Some(0.0) => places += 1,
                    Some(1.0) => several.push((place(), 2)),
                    _ => several.iter_mut().last().into_iter().for_each(|(_, count)| *count += 1),
                }
                for (farthest, values) in farthest.iter_mut().zip(&told) {
                    let value = values.get(i).copied().flatten();
                    if value > farthest.as_ref().map(|(known, ..)| *known) {
                        *farthest = value.map(|value| (value, what.to_owned(), place()));
                    }
                }
            }
            Ok(())
        };
        add().map_err(|error| failed(error.into()))?;
    }
    let list: Vec<String> =
        kinds.iter().map(|(kind, count)| format!("{count} {}", kind.replace('_', " "))).collect();
    let counted = format!("{rows} at {places} points and speeds: {}", list.join(", "));
    let mut lines = vec![("motions", counted)];
    for (name, farthest) in TOLD.iter().zip(&farthest) {
        if let Some((value, kind, at)) = farthest {
            let (name, kind) = (name.replace('_', " "), kind.replace('_', " "));
            let at = places::words(&axes, at);
            lines.push(("farthest", format!("{name} {:.1} mrad, {kind}, at {at}", 1e3 * value)));
        }
    }
    for (at, motions) in several.iter().take(MOST_LISTED) {
        lines.push(("several", format!("{motions} motions at {}", places::words(&axes, at))));
    }
    if several.len() > MOST_LISTED {
        lines.push(("", format!("and at {} more", several.len() - MOST_LISTED)));
    }
    Ok(lines)
}
