//! What a file of `sweep dwell` says as a whole.

use std::collections::BTreeMap;

use arrow_schema::ArrowError;
use washer_model::decimal;

use sweep_engine::store::StoreError;
use sweep_files::{ParquetFile, cells, key};

/// Places that are listed.
const MOST_LISTED: usize = 12;

/// A point at a speed.
struct Place {
    /// Axes by name.
    at: Vec<(String, f64)>,
    motions: u64,
}

/// Reads through a file: lines, each with its name.
///
/// # Errors
/// [`StoreError::File`] and [`StoreError::Parquet`].
pub(crate) fn lines(file: &ParquetFile) -> Result<Vec<(&'static str, String)>, StoreError> {
    let failed = StoreError::parquet("read", file.path());
    let mut kinds: BTreeMap<String, u64> = BTreeMap::new();
    let (mut rows, mut places) = (0_u64, Vec::<Place>::new());
    let mut farthest: Vec<(String, f64, String, Vec<(String, f64)>)> = Vec::new();
    let axes = axes(file);
    for batch in file.batches(|builder| builder)? {
        let batch = batch?;
        let mut add = || -> Result<(), ArrowError> {
            let missing =
                |name: &str| ArrowError::SchemaError(format!("there is no column {name}"));
            let numbers = |name: &str| {
                cells::numbers(batch.column_by_name(name).ok_or_else(|| missing(name))?)
            };
            let words =
                |name: &str| cells::texts(batch.column_by_name(name).ok_or_else(|| missing(name))?);
            let (kind, status, motion) = (words("kind")?, words("status")?, numbers("motion")?);
            let at = axes.iter().map(|axis| numbers(axis)).collect::<Result<Vec<_>, _>>()?;
            let angles = ["nonlinear_tub_yaw", "nonlinear_tub_pitch"];
            let angles = angles.map(|name| (name, numbers(name).ok()));
            for i in 0..batch.num_rows() {
                rows += 1;
                let what = kind[i].or(status[i]).unwrap_or_default();
                *kinds.entry(what.to_owned()).or_default() += 1;
                let place = || -> Vec<(String, f64)> {
                    let values = at.iter().map(|values| values[i].unwrap_or(f64::NAN));
                    axes.iter().cloned().zip(values).collect()
                };
                match places.last_mut() {
                    Some(last) if motion[i] != Some(0.0) => last.motions += 1,
                    _ => places.push(Place { at: place(), motions: 1 }),
                }
                for (name, values) in &angles {
                    let Some(value) = values.as_ref().and_then(|values| values[i]) else {
                        continue;
                    };
                    let known = farthest.iter_mut().find(|known| known.0 == *name);
                    match known {
                        Some(known) if known.1 >= value => {}
                        Some(known) => {
                            (known.1, known.2, known.3) = (value, what.to_owned(), place());
                        }
                        None => {
                            farthest.push(((*name).to_owned(), value, what.to_owned(), place()));
                        }
                    }
                }
            }
            Ok(())
        };
        add().map_err(|error| failed(error.into()))?;
    }
    let list: Vec<String> =
        kinds.iter().map(|(kind, count)| format!("{count} {}", kind.replace('_', " "))).collect();
    let counted = format!("{rows} at {} points and speeds: {}", places.len(), list.join(", "));
    let mut lines = vec![("motions", counted)];
    for (name, value, kind, at) in &farthest {
        let name = name.trim_start_matches("nonlinear_").replace('_', " ");
        let kind = kind.replace('_', " ");
        let said = format!("{name} {:.1} mrad, {kind}, at {}", 1e3 * value, words_of(at));
        lines.push(("farthest", said));
    }
    let several: Vec<&Place> = places.iter().filter(|place| place.motions > 1).collect();
    for place in several.iter().take(MOST_LISTED) {
        lines.push(("several", format!("{} motions at {}", place.motions, words_of(&place.at))));
    }
    if several.len() > MOST_LISTED {
        lines.push(("", format!("and at {} more", several.len() - MOST_LISTED)));
    }
    Ok(lines)
}

/// The axes, the speed last.
fn axes(file: &ParquetFile) -> Vec<String> {
    let plan: Option<serde_json::Value> =
        file.value(key::PLAN).and_then(|plan| serde_json::from_str(plan).ok());
    let axes = plan.as_ref().and_then(|plan| plan["axis"].as_array());
    let names = axes.into_iter().flatten().filter_map(|axis| axis["parameter"].as_str());
    names.map(str::to_owned).chain(["speed_rpm".to_owned()]).collect()
}

fn words_of(at: &[(String, f64)]) -> String {
    let one = |(name, value): &(String, f64)| match name.as_str() {
        "speed_rpm" => format!("{} rpm", decimal(*value)),
        _ => format!("{name} {}", decimal(*value)),
    };
    at.iter().map(one).collect::<Vec<_>>().join(", ")
}
