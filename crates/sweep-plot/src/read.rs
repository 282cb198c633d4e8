//! An open result file: its metadata, and its rows batch by batch.
//!
//! This is the only module that reads files. A map of ten million rows is read in several passes
//! over the columns that a figure needs, and is never in memory whole.

use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::error::{PlotError, Result};
use super::label;
use sweep_files::{self as files, ParquetFile};

/// The facts of a column; [`super::table::FigureColumn`] also has its rows.
pub use sweep_files::Column as ColumnFacts;
use sweep_parameter::Worse;

/// The kind of a result file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FigureKind {
    /// The name, as in "a map file".
    pub name: &'static str,
    /// The columns that identify the kind. Axes stand before the first of these.
    pub required_columns: &'static [&'static str],
    /// The prefixes of names, if any: a file of the kind also has a column whose name begins with
    /// one of them.
    pub required_prefixes: &'static [&'static str],
    /// Whether the rows belong to points, which `--at` chooses.
    pub has_points: bool,
}

impl FigureKind {
    /// A map: one row for each grid point.
    pub const MAP: Self = Self::new("map", &["status", "ratio_max"]).with_points();
    /// A map whose points are scattered.
    pub const DESIGN: Self = Self { name: "design", has_points: false, ..Self::MAP };
    /// The differences of two maps: one row for each grid point that both have.
    pub const DIFFERENCES: Self = Self::new("differences", &["ratio_change", "flip"]).with_points();
    /// The candidates of an optimisation study.
    pub const STUDY: Self = Self::new("study", &["candidate", "on_front"]);
    /// Time histories of both models at one point, or of a measurement and the fitted model.
    pub const TRACE: Self =
        Self { required_prefixes: &["nonlinear_", "measured_"], ..Self::new("trace", &["time_s"]) };
    /// The curve on which a quantity is at its limit. A file of this kind has the two columns of a
    /// bracket.
    pub const BOUNDARY: Self = Self::new("boundary", &[]);

    /// Returns a kind that these columns identify.
    pub const fn new(name: &'static str, required_columns: &'static [&'static str]) -> Self {
        Self { name, required_columns, required_prefixes: &[], has_points: false }
    }

    /// Returns the kind with rows that belong to points.
    pub const fn with_points(self) -> Self {
        Self { has_points: true, ..self }
    }

    fn matches_columns(&self, names: &[&str]) -> bool {
        let has_prefix =
            |name: &&str| self.required_prefixes.iter().any(|prefix| name.starts_with(prefix));
        self.required_columns.iter().all(|name| names.contains(name))
            && (self.required_prefixes.is_empty() || names.iter().any(has_prefix))
            && (!self.required_columns.is_empty() || bracket_columns(names).is_some())
    }
}

/// The model's kinds of files and sections of plans.
#[derive(Clone, Copy, Debug, Default)]
pub struct ModelKinds {
    /// The kinds of files. If several fit a file, the first is taken.
    pub kinds: &'static [FigureKind],
    /// The sections of a plan on which time histories depend.
    pub history_sections: &'static [&'static str],
    /// The sections of a plan on which results at a constant speed depend.
    pub machine_sections: &'static [&'static str],
}

impl ModelKinds {
    /// Returns all kinds. If several fit a file, the first is taken; a design has the columns of a
    /// map.
    pub fn all_kinds(self) -> impl Iterator<Item = FigureKind> {
        let model_kinds = self.kinds.iter().copied();
        let common_kinds =
            [FigureKind::MAP, FigureKind::DIFFERENCES, FigureKind::TRACE, FigureKind::BOUNDARY];
        std::iter::once(FigureKind::STUDY).chain(model_kinds).chain(common_kinds)
    }
}

/// An open result file of a kind that has a figure.
#[derive(Debug)]
pub struct FigureFile {
    pub path: PathBuf,
    pub kind: FigureKind,
    /// The columns in file order, without columns of types that no result file has.
    pub columns: Vec<ColumnFacts>,
    /// The key-value metadata of the file in file order, parsed if it is JSON.
    pub provenance: Vec<(String, Value)>,
    /// The number of rows.
    pub rows: usize,
    /// The model's kinds of files and sections of plans.
    pub model_kinds: ModelKinds,
    /// The name of the run with the settings of its command line, if the file has them.
    pub run_name: Option<String>,
    file: ParquetFile,
}

/// The key of Arrow's own copy of the schema, which is not part of the provenance.
const ARROW_SCHEMA: &str = "ARROW:schema";

impl FigureFile {
    /// Opens a file and reads its metadata.
    ///
    /// # Errors
    /// [`PlotError::File`], or [`PlotError::Undrawable`] if the columns are those of no kind.
    pub fn open(path: &Path, model_kinds: ModelKinds) -> Result<Self> {
        let file = ParquetFile::open(path)?;
        let rows = usize::try_from(file.rows()).unwrap_or(usize::MAX);
        let provenance = file.pairs().filter(|entry| entry.key != ARROW_SCHEMA).map(|entry| {
            let text = entry.value.clone().unwrap_or_default();
            (entry.key.clone(), serde_json::from_str(&text).unwrap_or(Value::String(text)))
        });
        let provenance: Vec<(String, Value)> = provenance.collect();
        let columns = files::columns(file.schema()).into_iter();
        let columns: Vec<ColumnFacts> = columns.map(complete_by_name).collect();
        let column_names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
        let kind = model_kinds.all_kinds().find(|kind| kind.matches_columns(&column_names));
        let kind = kind.ok_or_else(|| PlotError::Undrawable {
            path: path.to_owned(),
            reason: format!(
                "its columns ({}) are those of no file that has a figure: {}",
                column_names.join(", "),
                model_kinds.all_kinds().map(|kind| kind.name).collect::<Vec<_>>().join(", ")
            ),
        })?;
        let run_name = compose_run_name(&provenance);
        Ok(Self {
            path: path.to_owned(),
            kind,
            columns,
            provenance,
            rows,
            model_kinds,
            run_name,
            file,
        })
    }

    /// Calls `visit` for each row with the columns of these names; a missing column is null.
    ///
    /// # Errors
    /// [`PlotError::File`], and the errors of `visit`.
    pub fn each_row(
        &self,
        names: &[&str],
        mut visit: impl FnMut(FigureRow<'_>) -> Result<()>,
    ) -> Result<()> {
        self.file.each_row(names, |row| visit(FigureRow(row)))
    }

    /// Returns the column of this name.
    pub fn column(&self, name: &str) -> Option<&ColumnFacts> {
        self.columns.iter().find(|column| column.name == name)
    }

    /// Returns the columns of numbers whose name starts with `prefix`, with the rest of the name.
    pub fn with_prefix(&self, prefix: &str) -> Vec<(&str, &ColumnFacts)> {
        self.number_columns()
            .filter_map(|column| Some((column.name.strip_prefix(prefix)?, column)))
            .collect()
    }

    /// Yields the columns of numbers.
    pub fn number_columns(&self) -> impl Iterator<Item = &ColumnFacts> {
        self.columns.iter().filter(|column| column.is_number())
    }

    /// Returns the error for an option that names something that the file does not have.
    pub fn unknown_name_error(
        &self,
        option: &str,
        requested_name: impl fmt::Display,
        kind_of_name: &str,
        name_list: impl fmt::Display,
    ) -> PlotError {
        let path = self.path.display();
        let requested_name = requested_name.to_string();
        let name_list = name_list.to_string();
        let valid_names = name_list.split(", ").map(str::to_owned).collect();
        let message = format!(
            "`{option} {requested_name}`: {path}: there is no such {kind_of_name}; it has \
             {name_list}"
        );
        PlotError::NotThere { message, requested_name, valid_names }
    }

    fn undrawable_error(&self, reason: String) -> PlotError {
        PlotError::Undrawable { path: self.path.clone(), reason }
    }

    /// Returns the error for a file without anything to draw.
    pub fn nothing_to_draw_error(&self, reason: &str) -> PlotError {
        self.undrawable_error(format!("nothing to draw: {reason}"))
    }

    /// Returns the error for a file with more rows than a figure of its kind can show.
    pub fn too_many_rows_error(&self, rows: usize, max_rows: usize) -> PlotError {
        let kind_name = self.kind.name;
        self.undrawable_error(format!(
            "a {kind_name} file of {rows} rows is more than a figure can show, which is {max_rows} \
             of them"
        ))
    }

    /// Rejects an option that has no effect on this file. `has_effect` says whether the option has
    /// an effect; `valid_files` names the files on which it has one.
    ///
    /// # Errors
    /// [`PlotError::Unfit`].
    pub fn reject_option(
        &self,
        option: &str,
        is_given: bool,
        has_effect: bool,
        valid_files: &str,
    ) -> Result<()> {
        if !is_given || has_effect {
            return Ok(());
        }
        let kind_name = self.kind.name;
        let path = self.path.display();
        Err(PlotError::Unfit(format!(
            "`{option}` is for {valid_files}; {path} is a {kind_name} file"
        )))
    }

    /// Rejects a file of another kind than an option takes.
    ///
    /// # Errors
    /// [`PlotError::Unfit`], which says what writes such a file.
    pub fn expect_kind(&self, kind: FigureKind, option: &str, hint: &str) -> Result<()> {
        if self.kind == kind {
            return Ok(());
        }
        let path = self.path.display();
        let kind_name = self.kind.name;
        Err(PlotError::Unfit(format!("`{option} {path}`: this is a {kind_name} file; {hint}")))
    }

    /// Returns the error for a missing column that this kind of file needs.
    pub fn missing_column_error(&self, column: &str, expected: &str) -> PlotError {
        let kind_name = self.kind.name;
        self.undrawable_error(format!("a {kind_name} file needs the {expected} column `{column}`"))
    }

    /// Returns the first value of `key` in the metadata; outer levels are searched before inner
    /// ones.
    pub fn find_metadata(&self, key: &str) -> Option<&Value> {
        find_in_entries(&self.provenance, key)
    }

    /// Returns the name of the run, if the file has it, and these notes.
    pub fn notes(&self, further_notes: impl IntoIterator<Item = String>) -> Vec<String> {
        self.run_name.iter().cloned().chain(further_notes).collect()
    }

    /// Returns the name of the run, if the file has it, and `text` as a subtitle.
    pub fn subtitle(&self, text: &str) -> String {
        self.notes([text.to_owned()]).join(" · ")
    }

    /// Returns the quantity whose ratio is taken, by the run's criterion.
    pub fn compared_quantity(&self) -> &'static str {
        match self.find_metadata("criterion").and_then(Value::as_str) {
            Some("envelope") => "amplitudes by turn",
            Some("rms") => "root mean squares",
            _ => "amplitudes",
        }
    }

    /// Returns the method that placed the points, if the plan is a design.
    pub fn design_method(&self) -> Option<&str> {
        self.find_metadata("design")?.get("method")?.as_str()
    }

    /// Yields the entries of a list that the metadata has under `key`.
    pub fn metadata_list(&self, key: &str) -> impl Iterator<Item = &Value> {
        self.find_metadata(key).and_then(Value::as_array).into_iter().flatten()
    }

    /// Yields the swept parameters that the plan names.
    pub fn planned_axes(&self) -> impl Iterator<Item = &str> {
        self.metadata_list("axis").filter_map(|axis| axis.get("parameter")?.as_str())
    }

    /// Returns whether the plan spaces an axis by the logarithm.
    pub fn is_log_axis(&self, parameter: &str) -> bool {
        self.metadata_list("axis").filter(|axis| axis["parameter"] == parameter).any(|axis| {
            axis["range"]["spacing"] == "log" || axis["distribution"]["kind"] == "lognormal"
        })
    }

    /// Returns the limit of a column in its unit: the column's own, or the run's for ratios. Ratios
    /// in a file of differences have no limit, because each of the two runs has its own.
    pub fn column_limit(&self, column: &ColumnFacts) -> Option<f64> {
        let has_run_limit = is_ratio(column) && self.kind != FigureKind::DIFFERENCES;
        column.metadata.limit.or_else(|| has_run_limit.then(|| self.ratio_limit()))
    }

    /// Returns the ratio from which a point is unreliable: the run's limit, or else that of the
    /// paper, 2.
    pub fn ratio_limit(&self) -> f64 {
        let limit =
            self.find_metadata("ratio_limit").and_then(Value::as_f64).map(clamp_to_drawable);
        limit.filter(|limit| *limit > 0.0).unwrap_or(2.0)
    }
}

/// Returns whether a column's numbers are ratios of both models.
pub fn is_ratio(column: &ColumnFacts) -> bool {
    column.name.starts_with("ratio_") && column.name != "ratio_change"
}

/// Returns the names as a list, or "none".
pub fn list_names<'a>(names: impl Iterator<Item = &'a str>) -> String {
    let names: Vec<&str> = names.collect();
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

/// A row of a file.
#[derive(Clone, Copy)]
pub struct FigureRow<'a>(sweep_files::Row<'a>);

impl<'a> FigureRow<'a> {
    /// Returns the index of the row in the file.
    pub fn index(self) -> usize {
        self.0.index() as usize
    }

    /// Returns the number in a column as it is drawn, NaN where there is none.
    pub fn number(self, column: usize) -> f64 {
        clamp_to_drawable(self.0.value(column))
    }

    /// Returns the numbers in these columns.
    pub fn numbers(self, columns: Range<usize>) -> Vec<f64> {
        columns.map(|column| self.number(column)).collect()
    }

    /// Returns the word in a column.
    pub fn word(self, column: usize) -> Option<&'a str> {
        self.0.word(column)
    }
}

/// Greatest magnitude that is drawn; larger numbers are drawn as this. Basis: arithmetic on drawn
/// numbers, such as borders halfway on a logarithmic axis, must not overflow.
const MAX_DRAWN_MAGNITUDE: f64 = 1e100;
/// Least magnitude that is drawn; smaller numbers are drawn as 0, so that arithmetic on drawn
/// numbers does not underflow.
const MIN_DRAWN_MAGNITUDE: f64 = 1e-100;

fn clamp_to_drawable(value: f64) -> f64 {
    if value.is_infinite() {
        value
    } else if value.abs() < MIN_DRAWN_MAGNITUDE {
        0.0
    } else {
        value.clamp(-MAX_DRAWN_MAGNITUDE, MAX_DRAWN_MAGNITUDE)
    }
}

fn find_in_entries<'a>(provenance: &'a [(String, Value)], key: &str) -> Option<&'a Value> {
    provenance
        .iter()
        .find_map(|(name, value)| if name == key { Some(value) } else { find_in_value(value, key) })
}

/// Maximum length of a run's name in figures, characters. Basis: room in the subtitle for the
/// settings that follow.
const MAX_RUN_NAME_CHARACTERS: usize = 40;

/// Returns the name of a run with its settings, as in "fig12, mass_kg = 20".
fn compose_run_name(provenance: &[(String, Value)]) -> Option<String> {
    let name = find_in_entries(provenance, "name")?.as_str()?;
    let mut full_name: String = name.chars().take(MAX_RUN_NAME_CHARACTERS).collect();
    if full_name.len() < name.len() {
        full_name.push('…');
    }
    let settings = find_in_entries(provenance, "set").and_then(Value::as_object);
    for (name, value) in settings.into_iter().flatten() {
        let value = match value {
            Value::String(text) => text.clone(),
            Value::Number(number) => number
                .as_f64()
                .map_or(number.to_string(), |value| label::format_significant(value, 6)),
            other => other.to_string(),
        };
        full_name.push_str(&format!(", {name} = {value}"));
    }
    Some(full_name)
}

fn find_in_value<'a>(value: &'a Value, key: &str) -> Option<&'a Value> {
    match value {
        Value::Object(map) => {
            map.get(key).or_else(|| map.values().find_map(|nested| find_in_value(nested, key)))
        }
        Value::Array(items) => items.iter().find_map(|nested| find_in_value(nested, key)),
        _ => None,
    }
}

/// Returns the two columns of a boundary's bracket, which follow its two coordinates.
pub fn bracket_columns<'a>(names: &[&'a str]) -> Option<(&'a str, &'a str)> {
    let find_by_words = |words: &[&str]| {
        names.iter().skip(2).copied().find(|name| name.split('_').any(|part| words.contains(&part)))
    };
    Some((find_by_words(&["low", "lower", "min"])?, find_by_words(&["high", "upper", "max"])?))
}

/// Completes unit and bad direction from the column's name, for files that lost their metadata in
/// another program.
fn complete_by_name(mut column: ColumnFacts) -> ColumnFacts {
    if column.metadata.unit.is_empty() {
        column.metadata.unit = label::unit_of_name(&column.name);
    }
    let worse = column.name.starts_with("min_").then_some(Worse::Less);
    column.metadata.worse = column.metadata.worse.or(worse);
    column
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_clamped_to_the_drawable_range() {
        for value in [0.0, -350.0, 1e-99, 9e99] {
            assert_eq!(clamp_to_drawable(value).to_bits(), value.to_bits());
        }
        assert_eq!(clamp_to_drawable(5e-324), 0.0);
        assert_eq!(clamp_to_drawable(-1e300), -MAX_DRAWN_MAGNITUDE);
        assert_eq!(clamp_to_drawable(f64::INFINITY), f64::INFINITY, "it is left out, as it was");
        assert!(clamp_to_drawable(f64::NAN).is_nan());
    }
}
