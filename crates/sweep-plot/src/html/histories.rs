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
const TIME_BUCKETS: usize = 500;

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
pub(crate) fn read_histories(folder: &Path, map: &CellMap, model: &dyn Figures) -> Result<Value> {
    let model_kinds = map.table.source.model_kinds;
    let names = regular::file_names(folder).map_err(FileError::io("list", folder))?;
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
        let source = FigureFile::open(&file, model_kinds)?;
        let unfit_error =
            |reason: &str| PlotError::Unfit(format!("`--traces`: {}: {reason}", file.display()));
        if source.kind != FigureKind::TRACE {
            return Err(unfit_error("not a trace file"));
        }
        let point_of_file = together::point_of_trace(&source);
        let cell = find_cell(&source, &point_of_file, map).ok_or_else(|| {
            unfit_error(
                "it belongs to no point of this map: neither its metadata (`at`) nor its name \
                   (point-<index>) says one",
            )
        })?;
        let point_in_map = map_point(&point_of_file, cell, map);
        // In a map whose cells have several points, an index alone does not identify a point.
        let point_of_trace = if point_of_file.is_empty() && map.grid.merges_points() {
            &point_in_map
        } else {
            &point_of_file
        };
        let files = [(&map.table.source, &point_in_map), (&source, point_of_trace)];
        together::check_agreement(
            "--traces",
            &file,
            files,
            &together::history_sections(model_kinds),
        )?;
        let chart = model.history(&FigureTable::read_decimated(source, TIME_BUCKETS)?)?;
        let chart = chart_json(&chart, |values| json!(embed::quantise(values)));
        histories.insert(cell.to_string(), chart);
    }
    Ok(Value::Object(histories))
}

/// Returns the cell of a trace's point in the map's grid.
fn find_cell(trace: &FigureFile, point_of_trace: &NamedPoint, map: &CellMap) -> Option<usize> {
    // A file whose metadata give its point belongs to that point only, whatever its name.
    if !point_of_trace.is_empty() {
        let find_axis_value = |name: &str| {
            point_of_trace.iter().find(|(known, _)| known == name).map(|(_, value)| *value)
        };
        let cells_of_axes = map
            .grid
            .axes
            .iter()
            .map(|axis| axis.cell_index_near(find_axis_value(&axis.swept_axis.name)?));
        let cells_of_axes: Vec<usize> = cells_of_axes.collect::<Option<_>>()?;
        return Some(map.grid.flat_index(cells_of_axes)).filter(|&cell| map.has_points(cell));
    }
    let stem = trace.path.file_stem()?.to_str()?;
    let digits = stem.rsplit(|letter: char| !letter.is_ascii_digit()).next()?;
    let point_index: u32 = digits.parse().ok()?;
    map.table.numbers("point").ok()?.iter().position(|point| *point == f64::from(point_index))
}

/// Returns the values of the map's axes at a trace's point.
fn map_point(point_of_trace: &NamedPoint, cell: usize, map: &CellMap) -> NamedPoint {
    let mut remaining = cell;
    let mut point = NamedPoint::new();
    for axis in map.grid.axes.iter().rev() {
        let axis_value = point_of_trace.iter().find(|(name, _)| *name == axis.swept_axis.name);
        let value =
            axis_value.map_or(axis.values[remaining % axis.values.len()], |(_, value)| *value);
        point.push((axis.swept_axis.name.clone(), value));
        remaining /= axis.values.len();
    }
    point
}
