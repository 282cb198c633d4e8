//! Time histories beside a map: the point of each trace file, and its chart small enough for a
//! page.

use std::path::{Path, PathBuf};

use serde_json::{Map as Object, Value, json};

use super::{chart_json, embed};
use crate::error::{PlotError, Result};
use crate::gather::CellMap;
use crate::model::Figures;
use crate::read::{FigureFile, FigureKind};
use crate::table::FigureTable;
use crate::together::{self, NamedPoint};
use sweep_files::{FileError, regular};

/// Number of time buckets of a history, each of which keeps its least and greatest value. Basis: a
/// page draws a history about 500 px wide. Doubling it doubles the size of histories in a page.
const BUCKETS: usize = 500;

/// Returns the charts of a folder's trace files by the cell of their point, their curves quantised.
///
/// A file belongs to the point that its metadata gives (`at`: axis to value), or else to the one
/// whose index (column `point`) ends its name, as in `point-123.parquet`. Histories are reduced to
/// 500 buckets of two values each: the least and the greatest in the order in which they occur, at
/// the first and the middle instant of the bucket.
///
/// # Errors
/// [`PlotError::File`] for the folder; the errors of [`FigureTable::open`] for its files;
/// [`PlotError::Unfit`] for a file that is not a trace or belongs to no point of the grid, and for
/// a folder without traces.
pub(crate) fn read(folder: &Path, map: &CellMap, model: &dyn Figures) -> Result<Value> {
    let known = map.table.source.model_kinds;
    let names = regular::names(folder).map_err(FileError::io("list", folder))?;
    let mut files: Vec<PathBuf> = names.iter().map(|name| folder.join(name)).collect();
    files.retain(|file| file.extension().is_some_and(|ending| ending == "parquet"));
    if files.is_empty() {
        return Err(PlotError::Unfit(format!(
            "`--traces {}`: no trace files (.parquet) in it",
            folder.display()
        )));
    }
    let mut histories = Object::new();
    for file in files {
        let source = FigureFile::open(&file, known)?;
        let unfit =
            |what: &str| PlotError::Unfit(format!("`--traces`: {}: {what}", file.display()));
        if source.kind != FigureKind::TRACE {
            return Err(unfit("not a trace file"));
        }
        let at = together::at(&source);
        let cell = cell(&source, &at, map).ok_or_else(|| {
            unfit(
                "it belongs to no point of this map: neither its metadata (`at`) nor its name \
                   (point-<index>) says one",
            )
        })?;
        let point = point(&at, cell, map);
        // In a map whose cells have several points, an index alone does not identify a point.
        let own = if at.is_empty() && map.grid.merged() { &point } else { &at };
        let files = [(&map.table.source, &point), (&source, own)];
        together::check_agreement("--traces", &file, files, &together::history_parts(known))?;
        let chart = model.history(&FigureTable::read_decimated(source, BUCKETS)?)?;
        let chart = chart_json(&chart, |values| json!(embed::quantised(values)));
        histories.insert(cell.to_string(), chart);
    }
    Ok(Value::Object(histories))
}

/// Returns the cell of a trace's point in the map's grid.
fn cell(trace: &FigureFile, at: &NamedPoint, map: &CellMap) -> Option<usize> {
    // A file whose metadata give its point belongs to that point only, whatever its name.
    if !at.is_empty() {
        let value =
            |name: &str| at.iter().find(|(known, _)| known == name).map(|(_, value)| *value);
        let places = map.grid.axes.iter().map(|axis| axis.place_near(value(&axis.swept.name)?));
        let places: Vec<usize> = places.collect::<Option<_>>()?;
        return Some(map.grid.index(places)).filter(|&cell| map.filled(cell));
    }
    let stem = trace.path.file_stem()?.to_str()?;
    let digits = stem.rsplit(|letter: char| !letter.is_ascii_digit()).next()?;
    let wanted: u32 = digits.parse().ok()?;
    map.table.numbers("point").ok()?.iter().position(|point| *point == f64::from(wanted))
}

/// Returns the values of the map's axes at a trace's point.
fn point(at: &NamedPoint, cell: usize, map: &CellMap) -> NamedPoint {
    let mut rest = cell;
    let mut point = NamedPoint::new();
    for axis in map.grid.axes.iter().rev() {
        let named = at.iter().find(|(name, _)| *name == axis.swept.name);
        let value = named.map_or(axis.values[rest % axis.values.len()], |(_, value)| *value);
        point.push((axis.swept.name.clone(), value));
        rest /= axis.values.len();
    }
    point
}
